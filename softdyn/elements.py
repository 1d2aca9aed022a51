"""The element kernel of a weak form: made, compiled and loaded."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.kernels import choose_target, kept_manifest, loaded

if TYPE_CHECKING:
    from softdyn.derive.weak_form import WeakForm

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ElementKernel:
    """A loaded element kernel.

    Attributes
    ----------
    form, target, key : str
    nodes : int
        Of an element.
    fields : tuple of str
        Unknowns of a node.
    varying, uniform : tuple of str
        Coefficients of a node, and numbers: what the arrays ``q`` and ``p`` hold.
    elements : function
        See the template ``elements``.
    """

    form: str
    target: str
    key: str
    nodes: int
    fields: tuple[str, ...]
    varying: tuple[str, ...]
    uniform: tuple[str, ...]
    elements: Callable[..., int]


def element_manifest(form: WeakForm, target: str, needs: Mapping[str, Any]) -> dict[str, Any]:
    """Derive an element kernel."""
    from softdyn.derive.element_equations import ElementNeeds
    from softdyn.derive.element_kernel import element_ir
    from softdyn.derive.emit import write

    ir = element_ir(form, ElementNeeds(**needs))
    written = write(ir, target)
    return {
        "name": ir.name,
        "nodes": ir.settings["nodes"],
        "fields": ir.arrays["fields"],
        "varying": ir.arrays["q"],
        "uniform": ir.arrays["p"],
        "source": written.text,
        "suffix": written.suffix,
        "functions": written.functions,
        "savings": [(saving.rule, saving.before, saving.after) for saving in ir.savings],
        "depends": {},
    }


def get_element_kernel(
    form: WeakForm, target: str = "auto", *, uniform: tuple[str, ...] = (), absent: tuple[str, ...] = ()
) -> ElementKernel:
    """Element kernel of a weak form, from the cache or made now.

    Parameters
    ----------
    form : WeakForm
    target : "auto", "c" or "numba"
    uniform, absent : tuple of str
        Coefficients that are the same at all nodes, and those that are zero.

    Raises
    ------
    LawError, SceneError, CompileError
    """
    from softdyn.derive.weak_form import form_hash

    target = choose_target(target)
    needs = {"uniform": tuple(sorted(uniform)), "absent": tuple(sorted(absent))}
    identity = [form.name, form_hash(form)]
    manifest = kept_manifest("elements", identity, target, needs, lambda: element_manifest(form, target, needs))
    key, _, functions = loaded(target, manifest)
    return ElementKernel(
        form=form.name,
        target=target,
        key=key,
        nodes=manifest["nodes"],
        fields=tuple(manifest["fields"]),
        varying=tuple(manifest["varying"]),
        uniform=tuple(manifest["uniform"]),
        elements=functions.elements,
    )


def element_matrices(
    kernel: ElementKernel, corners: NDArray[np.int64], at: Array, fields: Array, q: Array, p: Array
) -> tuple[Array, Array]:
    """Residuals and matrices of all elements.

    Parameters
    ----------
    corners : array of int, shape (elements, nodes)
    at, fields, q : arrays, shape (points, axes), (points, unknowns of a node), (points, varying coefficients)
    p : array
        Uniform coefficients and parameters.

    Returns
    -------
    residuals : array, shape (elements, unknowns)
    matrices : array, shape (elements, unknowns, unknowns)

    Raises
    ------
    ValueError
        If an array is of another shape, a corner is no point, or an element is inverted or flat.
    """
    corners = np.ascontiguousarray(corners, np.int64)
    at, fields, q, p = (np.ascontiguousarray(array, float) for array in (at, fields, q, p))
    points, size = len(at), kernel.nodes * len(kernel.fields)
    expected = {
        "corners": (corners, (len(corners), kernel.nodes)),
        "at": (at, (points, kernel.nodes - 1)),
        "fields": (fields, (points, len(kernel.fields))),
        "q": (q, (points, len(kernel.varying))),
        "p": (p, (len(kernel.uniform),)),
    }
    for name, (array, shape) in expected.items():
        if array.shape != shape:
            raise ValueError(f"{name} of {kernel.form} has the shape {array.shape}, and {shape} is needed")
    if corners.size and not 0 <= corners.min() <= corners.max() < points:
        raise ValueError(f"corners name points from {corners.min()} to {corners.max()}, and there are {points}")
    residuals, matrices = np.empty((len(corners), size)), np.empty((len(corners), size, size))
    flat = [array.reshape(-1) for array in (corners, at, fields, q, p, residuals, matrices)]
    bad = kernel.elements(len(corners), *flat)
    if bad:
        raise ValueError(f"{bad} of {len(corners)} elements are inverted or flat: their corners do not turn left")
    return residuals, matrices
