"""Weak forms on a mesh: their kernels, made, compiled and loaded, and the residual and the matrix that these give.

Unknowns stand in one flat array, component by component: of a flow u_x at all nodes of its order, u_y at all of them,
p at all nodes of its own order. Coefficients stand in another, likewise, in the order of
:attr:`ElementKernel.varying`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import accumulate
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.kernels import choose_target, kept_manifest, loaded

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

    from softdyn.derive.weak_form import WeakForm

Array = NDArray[np.float64]
Integers = NDArray[np.integer[Any]]
#: Elements whose places in the matrix are looked up at once: what that takes stays small beside the matrix.
AT_ONCE = 16384
#: A field's name, how many components it has, and its order.
Part = tuple[str, int, int]


@dataclass(frozen=True)
class ElementKernel:
    """A loaded element kernel.

    Attributes
    ----------
    form, target, key : str
    dimension : int
    on_facets : bool
        Whether it integrates over facets.
    nodes : dict
        How many an element has, by order.
    unknowns, varying : tuple of (name, components, order)
        Of fields, and of coefficients that stand in ``q``.
    numbers : tuple of str
        What ``p`` holds: uniform coefficients and parameters.
    coupled : tuple of (int, int)
        Components of which one's residual depends on the other.
    pairs : tuple of (int, int)
        Orders of such components.
    residuals, elements : functions
        See the template ``elements``.
    """

    form: str
    target: str
    key: str
    dimension: int
    on_facets: bool
    nodes: dict[int, int]
    unknowns: tuple[Part, ...]
    varying: tuple[Part, ...]
    numbers: tuple[str, ...]
    coupled: tuple[tuple[int, int], ...]
    pairs: tuple[tuple[int, int], ...]
    residuals: Callable[..., None]
    elements: Callable[..., None]


@dataclass(frozen=True)
class Assembly:
    """What does not change from one assembly on a mesh to the next.

    Attributes
    ----------
    at : array, shape (points, d)
    corners : array of int32, shape (elements, d + 1)
    nodes : dict from order to array of int32, shape (elements, nodes of an element)
    counts : dict from order to int
        Nodes of the mesh.
    sides : array of int32 or None
        Of facets the corner of the element that is opposite.
    size, size_of_q : int
        Of the arrays of unknowns and of coefficients.
    bases, starts, degrees, places : arrays of int
        Where things stand: see the template ``elements``.
    columns : array of int
        Of the matrix's entries.
    """

    at: Array
    corners: Integers
    nodes: Mapping[int, Integers]
    counts: Mapping[int, int]
    sides: Integers | None
    size: int
    size_of_q: int
    bases: Integers
    starts: Integers
    degrees: Integers
    places: Integers
    columns: Integers


def element_manifest(form: WeakForm, target: str, needs: Mapping[str, Any]) -> dict[str, Any]:
    """Derive an element kernel.

    Parameters
    ----------
    form : WeakForm
    target : str
    needs : mapping
        Fields of :class:`softdyn.derive.element_equations.ElementNeeds`.

    Examples
    --------
    After the example of :func:`get_element_kernel`:

    >>> element_manifest(form, "c", {})["unknowns"]
    [('u', 1, 1)]
    """
    from softdyn.derive.element_equations import ElementNeeds
    from softdyn.derive.element_kernel import element_ir, left_fields
    from softdyn.derive.emit import write

    ir = element_ir(form, ElementNeeds(**needs))
    written = write(ir, target)
    settings = ir.settings
    unknowns, varying = (
        [(one.name, len(one.components), one.order) for one in some] for some in (form.fields, left_fields(form, ir))
    )
    return {
        "name": ir.name,
        "dimension": settings["dimension"],
        "on_facets": settings["on_facets"],
        "nodes": settings["nodes"],
        "unknowns": unknowns,
        "varying": varying,
        "numbers": ir.arrays["p"],
        "coupled": [block[:2] for block in settings["blocks"]],
        "pairs": settings["pairs"],
        "source": written.text,
        "suffix": written.suffix,
        "functions": written.functions,
        "savings": [(saving.rule, saving.before, saving.after) for saving in ir.savings],
        "depends": {},
    }


def get_element_kernel(
    form: WeakForm,
    target: str = "auto",
    *,
    uniform: tuple[str, ...] = (),
    absent: tuple[str, ...] = (),
    unit: tuple[str, ...] = (),
) -> ElementKernel:
    """Element kernel of a weak form, from the cache or made now.

    Parameters
    ----------
    form : WeakForm
    target : "auto", "c" or "numba"
    uniform : tuple of str
        Coefficients that are the same at all nodes: they stand in ``p``.
    absent : tuple of str
        Coefficients and parameters that are zero.
    unit : tuple of str
        Coefficients that are one.

    Raises
    ------
    LawError, SceneError, CompileError

    Examples
    --------
    >>> from sympy import Symbol
    >>> from softdyn.derive.weak_form import Field, WeakForm
    >>> u = Field("u", 2)
    >>> k = Symbol("k", positive=True)
    >>> flux = k * sum(a * b for a, b in zip(u.gradient, u.test.gradient))
    >>> form = WeakForm(
    ...     name="conduction", dimension=2, fields=(u,), coefficients=(), parameters=(k,), terms={"flux": flux},
    ...     degree=2,
    ... )
    >>> kernel = get_element_kernel(form)
    """
    from softdyn.derive.weak_form import form_hash

    target = choose_target(target)
    needs = {"uniform": tuple(sorted(uniform)), "absent": tuple(sorted(absent)), "unit": tuple(sorted(unit))}
    identity = [form.name, form_hash(form)]
    manifest = kept_manifest("elements", identity, target, needs, lambda: element_manifest(form, target, needs))
    key, _, functions = loaded(target, manifest)
    return ElementKernel(
        form=form.name,
        target=target,
        key=key,
        dimension=manifest["dimension"],
        on_facets=manifest["on_facets"],
        nodes=dict(manifest["nodes"]),
        unknowns=tuple((name, count, order) for name, count, order in manifest["unknowns"]),
        varying=tuple((name, count, order) for name, count, order in manifest["varying"]),
        numbers=tuple(manifest["numbers"]),
        coupled=tuple((i, j) for i, j in manifest["coupled"]),
        pairs=tuple((one, other) for one, other in manifest["pairs"]),
        residuals=functions.residuals,
        elements=functions.elements,
    )


def assembly(
    kernel: ElementKernel, at: Array, corners: Integers, nodes: Mapping[int, Integers], sides: Integers | None = None
) -> Assembly:
    """Prepare the assembly of a kernel's form on a mesh: check it, and find where entries of the matrix stand.

    Parameters
    ----------
    at : array, shape (points, d)
        Coordinates of the mesh's points.
    corners : array of int, shape (elements, d + 1)
        Points of each element. Of a form on facets those of the element at each facet.
    nodes : mapping from order to array of int, shape (elements, nodes of an element)
        Of the same elements the numbers of their nodes: corners, then, of order 2, the middles of the edges (0, 1),
        (0, 2), ... Nodes that are identified have one number. Of a form on facets these are the numbers of the
        whole mesh; see :func:`facet_assembly`.
    sides : array of int, shape (facets,), optional
        Of a form on facets: which corner of the element is opposite.

    Raises
    ------
    ValueError
        If an array has the wrong shape, numbers are out of range or not all used, or an element is inverted or flat.

    Examples
    --------
    After the example of :func:`get_element_kernel`:

    >>> import numpy as np
    >>> at = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    >>> corners = np.array([[0, 1, 2], [1, 3, 2]])
    >>> a = assembly(kernel, at, corners, {1: corners})
    """
    counts = {order: int(np.max(nodes[order], initial=-1)) + 1 for order in kernel.nodes if order in nodes}
    return _assembly(kernel, at, corners, nodes, counts, sides)


def facet_assembly(
    kernel: ElementKernel,
    of: Assembly,
    elements: Integers,
    sides: Integers,
    nodes: Mapping[int, Integers] | None = None,
) -> Assembly:
    """Prepare the assembly of a form on some facets of a mesh that the form on elements is assembled on.

    Parameters
    ----------
    kernel : ElementKernel
        Of a form on facets, with the same unknowns.
    of : Assembly
        That on the elements.
    elements, sides : arrays of int, shape (facets,)
        The element of each facet, and which of its corners is opposite.
    nodes : mapping, optional
        Nodes of all elements, where the kernel has orders that ``of`` has not.

    Raises
    ------
    ValueError

    Examples
    --------
    After the example of :func:`get_element_kernel` and of :func:`assembly`:

    >>> fed = WeakForm(
    ...     name="fed", dimension=2, fields=(u,), coefficients=(), parameters=(k,), terms={"feed": k * u.test.value},
    ...     on_facets=True, degree=2,
    ... )
    >>> feed = get_element_kernel(fed)
    >>> side = facet_assembly(feed, a, np.array([0]), np.array([2]), {1: corners})
    >>> residual_of(feed, side, at[:, 0].copy(), np.empty(0), np.array([2.0])).round(12)
    array([1., 1., 0., 0.])
    """
    elements = np.asarray(elements)
    if elements.size and not 0 <= elements.min() <= elements.max() < len(of.corners):
        raise ValueError(
            f"facets are of elements {elements.min()} to {elements.max()}, and there are {len(of.corners)}"
        )
    whole = {**(nodes or {}), **of.nodes}
    missing = [order for order in kernel.nodes if order not in whole]
    if missing:
        raise ValueError(f"nodes of order {missing[0]} are missing, which {kernel.form} has")
    counts = {order: int(of.counts.get(order, np.max(whole[order], initial=-1) + 1)) for order in kernel.nodes}
    return _assembly(kernel, of.at, of.corners[elements], {k: whole[k][elements] for k in kernel.nodes}, counts, sides)


def _assembly(
    kernel: ElementKernel,
    at: Array,
    corners: Integers,
    nodes: Mapping[int, Integers],
    counts: Mapping[int, int],
    sides: Integers | None,
) -> Assembly:
    at = np.ascontiguousarray(at, float)
    corners = _numbers("corners", corners, (len(corners), kernel.dimension + 1), len(at))
    if at.ndim != 2 or at.shape[1] != kernel.dimension:
        raise ValueError(f"at has the shape {at.shape}, and (points, {kernel.dimension}) is needed")
    if kernel.on_facets != (sides is not None):
        over = "facets: sides are" if kernel.on_facets else "elements: no sides are"
        raise ValueError(f"{kernel.form} is integrated over {over} needed")
    sides = None if sides is None else _numbers("sides", sides, (len(corners),), kernel.dimension + 1)
    _require_upright(at, corners)
    kept: dict[int, Integers] = {}
    for order, count in kernel.nodes.items():
        if order not in nodes:
            raise ValueError(f"nodes of order {order} are missing, which {kernel.form} has")
        kept[order] = _numbers(f"nodes of order {order}", nodes[order], (len(corners), count), counts[order])
        if sides is None:
            unused = counts[order] - np.count_nonzero(np.bincount(kept[order].ravel(), minlength=counts[order]))
            if unused:
                raise ValueError(f"{unused} of {counts[order]} numbers of nodes of order {order} belong to no element")
    orders = [order for _, count, order in kernel.unknowns for _ in range(count)]
    known = [order for _, count, order in kernel.varying for _ in range(count)]
    first, of_q = (list(accumulate((counts[order] for order in some), initial=0)) for some in (orders, known))
    graphs = {pair: _graph(kept[pair[0]], kept[pair[1]], counts[pair[0]], counts[pair[1]]) for pair in kernel.pairs}
    lengths = list(accumulate((counts[one] for one, _ in kernel.pairs), initial=0))
    degrees = np.concatenate([np.diff(starts) for starts, _, _ in graphs.values()] or [np.zeros(0)]).astype(np.int64)
    places = np.concatenate([np.empty((len(corners), 0), np.int32), *(one for _, _, one in graphs.values())], axis=1)
    starts, columns = _rows(kernel, orders, first, graphs)
    return Assembly(
        at=at,
        corners=corners,
        nodes=kept,
        counts=dict(counts),
        sides=sides,
        size=first[-1],
        size_of_q=of_q[-1],
        bases=np.array([*first[:-1], *of_q[:-1], *lengths[:-1]], np.int64),
        starts=starts,
        degrees=degrees,
        places=np.ascontiguousarray(places, np.int32),
        columns=columns,
    )


def _numbers(what: str, given: Integers, shape: tuple[int, ...], count: int) -> Integers:
    """Numbers of points or nodes, checked, as the kernels take them."""
    array = np.asarray(given)
    if array.shape != shape:
        raise ValueError(f"{what} have the shape {array.shape}, and {shape} is needed")
    if not np.issubdtype(array.dtype, np.integer):
        raise ValueError(f"{what} are of type {array.dtype}, and must be integers")
    if array.size and not 0 <= array.min() <= array.max() < count:
        raise ValueError(f"{what} are from {array.min()} to {array.max()}, and must be from 0 to {count - 1}")
    return np.ascontiguousarray(array, np.int32)


def _require_upright(at: Array, corners: Integers) -> None:
    bad = np.flatnonzero(~(np.linalg.det(at[corners[:, 1:]] - at[corners[:, :1]]) > 0))
    if bad.size:
        raise ValueError(
            f"{len(bad)} of {len(corners)} elements are inverted or flat, the first is element {bad[0]}: "
            "their corners do not turn left"
        )


def _graph(rows: Integers, columns: Integers, count: int, width: int) -> tuple[Integers, Integers, Integers]:
    """Which nodes share an element: where each row starts, sorted columns, and the places of all pairs within rows."""
    from scipy.sparse import csr_array

    elements, of_row, of_column = len(rows), rows.shape[1], columns.shape[1]
    ends = np.arange(elements + 1)
    ones = np.ones(max(rows.size, columns.size), np.int8)
    left = csr_array((ones[: rows.size], rows.reshape(-1), ends * of_row), shape=(elements, count)).T.tocsr()
    right = csr_array((ones[: columns.size], columns.reshape(-1), ends * of_column), shape=(elements, width))
    graph = (left @ right).tocsr()
    graph.sort_indices()
    # the place of an entry within its row, found as the value of a matrix
    starts = graph.indptr.astype(np.int64)
    graph.data = np.arange(graph.nnz, dtype=np.int64)
    places = np.empty((elements, of_row * of_column), np.int32)
    for begin in range(0, elements, AT_ONCE):
        some = slice(begin, begin + AT_ONCE)
        pairs = np.repeat(rows[some], of_column, axis=1).reshape(-1), np.tile(columns[some], (1, of_row)).reshape(-1)
        found = np.asarray(graph[pairs]).reshape(-1) - starts[pairs[0]]
        places[some] = found.reshape(-1, of_row * of_column)
    return starts, graph.indices.astype(np.int64), places


def _rows(
    kernel: ElementKernel,
    orders: list[int],
    first: list[int],
    graphs: Mapping[tuple[int, int], tuple[Integers, Integers, Integers]],
) -> tuple[Integers, Integers]:
    """Where each row of the matrix starts, and the columns of all its entries."""
    lengths: list[Integers] = []
    for i, order in enumerate(orders):
        own = np.zeros(first[i + 1] - first[i], np.int64)
        for j in (j for k, j in kernel.coupled if k == i):
            own += np.diff(graphs[order, orders[j]][0])
        lengths.append(own)
    starts = np.concatenate([[0], np.cumsum(np.concatenate(lengths))]).astype(np.int64)
    columns = np.empty(starts[-1], np.int64)
    for i, order in enumerate(orders):
        before = starts[first[i] : first[i + 1]].copy()
        for j in (j for k, j in kernel.coupled if k == i):
            begin, indices, _ = graphs[order, orders[j]]
            degree = np.diff(begin)
            columns[np.repeat(before - begin[:-1], degree) + np.arange(len(indices))] = indices + first[j]
            before += degree
    small = starts[-1] < 2**31 and first[-1] < 2**31
    return starts, columns.astype(np.int32) if small else columns


def assembled(kernel: ElementKernel, a: Assembly, x: Array, q: Array, p: Array) -> tuple[Array, csr_matrix]:
    """Residual and matrix, its derivative by the unknowns.

    Parameters
    ----------
    kernel : ElementKernel
    a : Assembly
        Made for it.
    x : array, shape (unknowns,)
    q : array
        Coefficients at nodes.
    p : array
        Uniform coefficients and parameters.

    Returns
    -------
    residual : array, shape (unknowns,)
    matrix : csr_matrix
        With an entry for all nodes that share an element, of components that are coupled.

    Raises
    ------
    ValueError
        If an array is of another length.

    Examples
    --------
    After the example of :func:`get_element_kernel` and of :func:`assembly`:

    >>> residual, matrix = assembled(kernel, a, at[:, 0].copy(), np.empty(0), np.array([2.0]))
    >>> residual.round(12)
    array([-1.,  1., -1.,  1.])
    """
    from scipy.sparse import csr_matrix

    residual, data = np.zeros(a.size), np.zeros(len(a.columns))
    kernel.elements(*_arguments(kernel, a, x, q, p), residual, a.starts, a.degrees, a.places.reshape(-1), data)
    starts = a.starts.astype(a.columns.dtype)
    matrix = csr_matrix((data, a.columns, starts), shape=(a.size, a.size))
    matrix.has_sorted_indices = True
    return residual, matrix


def residual_of(kernel: ElementKernel, a: Assembly, x: Array, q: Array, p: Array) -> Array:
    """Residual alone: see :func:`assembled`.

    Parameters
    ----------
    kernel : ElementKernel
    a : Assembly
    x : array, shape (unknowns,)
    q : array
        Values of what varies in space, as :func:`assembled` takes them.
    p : array, shape (numbers,)
        Values of what does not.

    Examples
    --------
    After the example of :func:`get_element_kernel` and of :func:`assembly`:

    >>> residual_of(kernel, a, at[:, 0].copy(), np.empty(0), np.array([2.0])).round(12)
    array([-1.,  1., -1.,  1.])
    """
    residual = np.zeros(a.size)
    kernel.residuals(*_arguments(kernel, a, x, q, p), residual)
    return residual


def _arguments(kernel: ElementKernel, a: Assembly, x: Array, q: Array, p: Array) -> list[Any]:
    x, q, p = (np.ascontiguousarray(array, float) for array in (x, q, p))
    for name, array, size in (("x", x, a.size), ("q", q, a.size_of_q), ("p", p, len(kernel.numbers))):
        if array.shape != (size,):
            raise ValueError(f"{name} of {kernel.form} has the shape {array.shape}, and ({size},) is needed")
    nodes = [a.nodes[order].reshape(-1) for order in kernel.nodes]
    sides = [] if a.sides is None else [a.sides]
    return [len(a.corners), a.at.reshape(-1), a.corners.reshape(-1), *nodes, *sides, a.bases, x, q, p]
