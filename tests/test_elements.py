"""Kernels of elements: what a weak form declares, against an independent assembler and complex steps."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
import skfem
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.linalg import spsolve
from skfem.helpers import ddot, div, dot, grad, mul, sym_grad
from skfem.quadrature import get_quadrature
from sympy import Integer, Symbol, cos, lambdify, pi, sin, sqrt

from softdyn.derive.element_equations import ElementNeeds, weight
from softdyn.derive.element_kernel import element_ir
from softdyn.derive.emit import emit
from softdyn.derive.kernel_form import KernelIR, total_operations
from softdyn.derive.stokes_flow import averaged_stokes
from softdyn.derive.weak_form import FINENESS, Field, WeakForm
from softdyn.derive.weak_form import dot as product_of
from softdyn.elements import ElementKernel, element_matrices, get_element_kernel
from softdyn.errors import LawError
from softdyn.targets import TARGETS

Array = NDArray[np.float64]

x, s = Field("x", 2), Field("s", 2)
half = Symbol("half", positive=True)
tau = Symbol("tau", positive=True)
ALL = ElementNeeds()
#: Everything that the flow's form has not: powers of the unknown, a quantity that depends on it, and a parameter.
CURVED = WeakForm(
    name="curved",
    dimension=2,
    fields=(x,),
    coefficients=(s,),
    parameters=(half,),
    terms={
        "diffusion": (half + x.value**2) * product_of(x.gradient, x.test.gradient),
        "reaction": s.value * x.value**3 * x.test.value,
        "steepness": tau * product_of(x.gradient, x.gradient) * x.value * x.test.value,
    },
    quantities={tau: 1 / (FINENESS * sqrt(1 + x.mean**2) + s.mean)},
)


def mesh(d: int, refined: int = 2) -> tuple[Any, NDArray[np.int64]]:
    """A mesh whose points were moved about, for scikit-fem, and its elements, none of them inverted."""
    kind = skfem.MeshTri if d == 2 else skfem.MeshTet
    regular = kind().refined(refined)
    moved = np.random.default_rng(d).uniform(-0.04, 0.04, regular.p.shape) / 2**refined
    made = kind(regular.p + moved, regular.t)
    corners = made.t.T.astype(np.int64)
    edges = made.p.T[corners[:, 1:]] - made.p.T[corners[:, :1]]
    inverted = np.linalg.det(edges) < 0
    corners[inverted, :2] = corners[inverted, 1::-1]
    return made, corners


def state(kernel: ElementKernel, points: int, seed: int = 1) -> tuple[Array, Array, Array]:
    """Values of unknowns, coefficients and numbers, none of them small."""
    draw = np.random.default_rng(seed).uniform
    return (
        draw(0.5, 1.5, (points, len(kernel.fields))),
        draw(0.3, 0.9, (points, len(kernel.varying))),
        draw(0.3, 0.9, len(kernel.uniform)),
    )


def assembled(kernel: ElementKernel, made: Any, corners: Any, given: tuple[Array, ...]) -> tuple[Array, Array, Array]:
    """Residual and matrix of all unknowns, a point's after another's, and the sizes of what made the residual."""
    residuals, matrices = element_matrices(kernel, corners, made.p.T, *given)
    count = len(kernel.fields)
    places = (corners[:, :, None] * count + np.arange(count)).reshape(len(corners), -1)
    size = made.p.shape[1] * count
    total, r, scale = np.zeros((size, size)), np.zeros(size), np.zeros(size)
    for rows, residual, matrix in zip(places, residuals, matrices, strict=True):
        r[rows] += residual
        scale[rows] += np.abs(residual)
        total[np.ix_(rows, rows)] += matrix
    return r, total, scale


def by_scikit_fem(d: int, made: Any, values: dict[str, Array]) -> tuple[Array, Array]:
    """The matrix of averaged Stokes flow and the part of its residual without the unknowns, by another assembler."""
    scalar = skfem.ElementTriP1() if d == 2 else skfem.ElementTetP1()
    # the drag is a product of three linear functions: degree 3
    flow, pressure = skfem.Basis(made, skfem.ElementVector(scalar), intorder=4), skfem.Basis(made, scalar, intorder=4)
    fields = {name: pressure.interpolate(value) for name, value in values.items() if name != "b"}
    fields["b"] = flow.interpolate(_of_vector(flow, values["b"]))
    fineness = sum(np.sum(pressure.basis[i][0].grad[:, :, :1] ** 2, axis=0) for i in range(d + 1))
    means = {name: values[name][made.t].mean(axis=0)[:, None] for name in ("eta", "k")}
    times = 1 / (means["eta"] * fineness + means["k"]) * np.ones_like(flow.dx)

    def bilinear(form: Callable[..., Any], trial: Any, test: Any) -> Any:
        return skfem.BilinearForm(form).assemble(trial, test, **fields, times=times).toarray()

    def linear(form: Callable[..., Any], test: Any) -> Any:
        return skfem.LinearForm(form).assemble(test, **fields, times=times)

    blocks = {
        (0, 0): bilinear(lambda u, v, w: 2 * w.eta * ddot(sym_grad(u), sym_grad(v)) + w.k * dot(u, v), flow, flow),
        (0, 1): bilinear(lambda p, v, w: w.c * dot(grad(p), v), pressure, flow),
        (1, 0): bilinear(
            lambda u, q, w: (
                q * div(u) + w.times * dot(grad(q), w.k * np.asarray(u) - 2 * mul(sym_grad(u), grad(w.eta)))
            ),
            flow,
            pressure,
        ),
        (1, 1): bilinear(lambda p, q, w: w.times * w.c * dot(grad(p), grad(q)), pressure, pressure),
    }
    loads = {
        0: linear(lambda v, w: -w.c * dot(w.b, v), flow),
        1: linear(lambda q, w: -w.times * w.c * dot(w.b, grad(q)), pressure),
    }
    points = made.p.shape[1]
    places = [(np.arange(points) * (d + 1) + np.arange(d)[:, None], flow.nodal_dofs)]
    places.append((np.arange(points)[None] * (d + 1) + d, pressure.nodal_dofs))
    matrix, load = np.zeros(((d + 1) * points,) * 2), np.zeros((d + 1) * points)
    for i, (rows, own_rows) in enumerate(places):
        load[rows.ravel()] = loads[i][own_rows.ravel()]
        for j, (columns, own_columns) in enumerate(places):
            block = blocks[i, j][np.ix_(own_rows.ravel(), own_columns.ravel())]
            matrix[np.ix_(rows.ravel(), columns.ravel())] = block
    return matrix, load


def _of_vector(flow: Any, values: Array) -> Array:
    found = np.empty(flow.N)
    found[flow.nodal_dofs] = values.T
    return found


@pytest.mark.parametrize("target", TARGETS)
def test_triangles_are_those_of_an_independent_assembler(target: str) -> None:
    """Some hundred roundings to an entry, relative to the sizes of what is summed."""
    agrees_with_scikit_fem(2, target)


@pytest.mark.slow
def test_tetrahedra_are_those_of_an_independent_assembler() -> None:
    agrees_with_scikit_fem(3, "c")


def agrees_with_scikit_fem(d: int, target: str) -> None:
    kernel = get_element_kernel(averaged_stokes(d), target)
    made, corners = mesh(d, 3 if d == 2 else 1)
    unknown, q, p = state(kernel, made.p.shape[1])
    residual, matrix, scale = assembled(kernel, made, corners, (unknown, q, p))
    values = {name: q[:, kernel.varying.index(name)] for name in ("c", "eta", "k")}
    values["b"] = q[:, [i for i, name in enumerate(kernel.varying) if name.startswith("b")]]
    expected, load = by_scikit_fem(d, made, values)
    # velocity and pressure have units of their own: each block by itself
    for rows in (np.arange(len(residual)) % (d + 1) < d, np.arange(len(residual)) % (d + 1) == d):
        for columns in (rows, ~rows):
            one, other = matrix[np.ix_(rows, columns)], expected[np.ix_(rows, columns)]
            assert np.abs(one - other).max() <= 1e-13 * np.abs(other).max()
    whole = expected @ unknown.reshape(-1) + load
    sizes = np.abs(expected) @ np.abs(unknown.reshape(-1)) + np.abs(load) + scale
    assert (np.abs(residual - whole) <= 1e-13 * sizes).all()


# ---------------------------------------------------------------- the Jacobian


@cache
def ir_of(form: WeakForm, needs: ElementNeeds = ALL) -> KernelIR:
    return element_ir(form, needs)


def evaluated(ir: KernelIR, values: dict[str, Any]) -> dict[str, Any]:
    """The straight-line code of an element, run as it is: of complex numbers, too."""
    names: dict[str, Any] = {"sqrt": np.emath.sqrt, **values}
    for name, text in ir.functions["element"].lines:
        names[name] = eval(text, {}, names)
    return names


def values_of(ir: KernelIR, seed: int) -> dict[str, Any]:
    """Numbers for everything that the code reads, the element not inverted."""
    draw = np.random.default_rng(seed).uniform
    corner = {2: [(0, 0), (1.1, 0.1), (0.3, 0.9)], 3: [(0, 0, 0), (1.1, 0.1, 0.2), (0.3, 0.9, 0), (0.1, 0.2, 1.2)]}
    reads = ir.functions["element"].reads
    values = {name: draw(0.4, 1.4) for array in ("fields", "q", "p") for name, _ in reads[array]}
    nodes = corner[len(ir.arrays["at"])]
    return values | {name: nodes[i // len(nodes[0])][i % len(nodes[0])] for name, i in reads["at"]}


@pytest.mark.parametrize("form", [averaged_stokes(2), CURVED], ids=["averaged_stokes", "curved"])
def test_the_jacobian_is_that_of_complex_steps(form: WeakForm) -> None:
    """Of every entry: the residual's imaginary part at an imaginary step of 1e-30."""
    ir = ir_of(form)
    reads = ir.functions["element"].reads["fields"]
    for seed in range(5):
        values = values_of(ir, seed)
        found = evaluated(ir, values)
        size = len(reads)
        exact = np.array([[found[f"matrix{i}_{j}"] for j in range(size)] for i in range(size)])
        for j, (name, _) in enumerate(reads):
            moved = evaluated(ir, {**values, name: values[name] + 1e-30j})
            column = np.array([moved[f"residual{i}"].imag / 1e-30 for i in range(size)])
            np.testing.assert_allclose(exact[:, j], column, rtol=1e-10, atol=1e-10 * np.abs(exact).max())


def test_a_form_with_powers_is_integrated_exactly() -> None:
    """Against Gauss's rule of degree 6 on the element, at random states."""
    ir = ir_of(CURVED)
    X, W = get_quadrature(skfem.ElementTriP1.refdom, 6)
    shapes = np.array([1 - X[0] - X[1], X[0], X[1]])
    for seed in range(5):
        values = values_of(ir, seed)
        found = evaluated(ir, values)
        at = np.array([[values[f"at{m}_n{i}"] for m in range(2)] for i in range(3)])
        edges = (at[1:] - at[0]).T
        slopes = np.vstack([-np.ones(2), np.eye(2)]) @ np.linalg.inv(edges)
        x, s = (np.array([values[f"own_{name}_n{i}"] for i in range(3)]) for name in "xs")
        gradient, point, known = x @ slopes, x @ shapes, s @ shapes
        times = 1 / (np.sum(slopes**2) * math.sqrt(1 + x.mean() ** 2) + s.mean())
        for i in range(3):
            flux = (values["own_half"] + point**2) * (gradient @ slopes[i])
            source = (known * point**3 + times * (gradient @ gradient) * point) * shapes[i]
            expected = np.linalg.det(edges) * np.sum(W * (flux + source))
            assert found[f"residual{i}"] == pytest.approx(expected, rel=1e-13)


def test_products_of_shape_functions_are_integrated_exactly() -> None:
    """Their integrals add up to that of 1: sum_j lambda_j = 1."""
    for d in (2, 3):
        for indices in ((), (0,), (0, 1), (1, 1), (0, 0, 1)):
            assert sum(weight(d, (*indices, j)) for j in range(d + 1)) == weight(d, indices)
    assert weight(2, ()) == 1


# ---------------------------------------------------------------- what is not needed


def names_of(ir: KernelIR) -> str:
    return " ".join(f"{name} = {text};" for name, text in ir.functions["element"].lines)


def test_without_drag_there_are_no_operations_of_drag() -> None:
    """By the rules: what is left is the kernel of a form that was declared without."""
    whole, spared = ir_of(averaged_stokes(2)), ir_of(averaged_stokes(2), ElementNeeds(absent=("k",)))
    declared = ir_of(averaged_stokes(2, drag=False))
    assert "own_k" in names_of(whole)
    assert "own_k" not in names_of(spared)
    assert spared.arrays["q"] == declared.arrays["q"] == ("c", "eta", "b0", "b1")
    (saving,) = spared.savings
    assert (saving.rule, saving.after) == ("absent coefficients", total_operations(spared))
    assert total_operations(spared) == total_operations(declared) < total_operations(whole)
    values = values_of(whole, 3)
    nothing = {name: 0.0 if name.startswith("own_k_") else value for name, value in values.items()}
    found = [evaluated(ir, nothing) for ir in (whole, spared, declared)]
    for name in whole.functions["element"].gives:
        assert found[1][name] == pytest.approx(found[0][name], rel=1e-13, abs=1e-15)
        assert found[2][name] == pytest.approx(found[0][name], rel=1e-13, abs=1e-15)


def test_a_uniform_coefficient_is_one_number_and_has_no_gradient() -> None:
    whole, spared = ir_of(averaged_stokes(2)), ir_of(averaged_stokes(2), ElementNeeds(("b", "c", "eta", "k")))
    assert spared.arrays["q"] == ()
    assert spared.arrays["p"] == ("c", "eta", "k", "b0", "b1")
    assert "own_eta_d0" not in names_of(spared)
    assert total_operations(spared) < 0.6 * total_operations(whole)
    values = values_of(whole, 3)
    values |= {name: values[name.rsplit("_", 1)[0] + "_n0"] for name in values if name.startswith("own_")
               and name.split("_")[1] in ("c", "eta", "k", "b0", "b1")}  # fmt: skip
    one = {name: values[f"{name}_n0"] for name, _ in spared.functions["element"].reads["p"]}
    found = [evaluated(whole, values), evaluated(spared, values | one)]
    scale = max(abs(found[0][name]) for name in whole.functions["element"].gives)
    for name in whole.functions["element"].gives:
        assert found[1][name] == pytest.approx(found[0][name], rel=1e-13, abs=1e-15 * scale)


@pytest.mark.slow
def test_operations_of_an_element() -> None:
    """More would be a regression."""
    counts = {
        needs: total_operations(ir_of(averaged_stokes(2), ElementNeeds(*needs)))
        for needs in [((), ()), (("eta", "b"), ()), (("eta", "b"), ("k",)), (("c", "eta"), ("b", "k"))]
    }
    assert list(counts.values()) <= [607, 411, 281, 239]


# ---------------------------------------------------------------- flows


def test_uniform_flow_through_a_uniform_bed_is_exact() -> None:
    """Then c grad p = -k u + c b at every point: no residual beyond the rounding of its terms, stabilised or not."""
    kernel = get_element_kernel(averaged_stokes(2), "c", uniform=("c", "eta", "k", "b"))
    made, corners = mesh(2)
    c, eta, k, u, b = 0.45, 0.7, 1e3, np.array([0.3, -0.2]), np.array([2.0, -9.0])
    pressure = (b - k * u / c) @ made.p
    unknown = np.column_stack([*(np.full(made.p.shape[1], one) for one in u), pressure])
    p = np.array([c, eta, k, *b])
    assert kernel.uniform == ("c", "eta", "k", "b0", "b1")
    residual, _, sizes = assembled(kernel, made, corners, (unknown, np.empty((len(unknown), 0)), p))
    other = assembled(kernel, made, corners, (unknown * [1, 1, 0], np.empty((len(unknown), 0)), p))[0]
    assert np.abs(residual).max() < 1e-12 * np.abs(other).max()
    assert sizes.max() < 1e-12 * np.abs(other).max()


def test_flow_converges_at_the_orders_of_its_elements() -> None:
    """A vortex in a box, through a bed of varying porosity, viscosity and drag, with the force that it takes.

    Linear velocities are of order 2; of the pressure 1 is proved, and 3/2 is seen where meshes are regular.
    """
    form, errors = averaged_stokes(2), []
    kernel = get_element_kernel(form, "c")
    exact = vortex()
    for refined in (4, 5, 6):
        made = skfem.MeshTri().refined(refined)
        corners, points = made.t.T.astype(np.int64), made.p.T
        edges = points[corners[:, 1:]] - points[corners[:, :1]]
        inverted = np.linalg.det(edges) < 0
        corners[inverted, :2] = corners[inverted, 1::-1]
        values = {name: np.broadcast_to(of(*made.p), len(points)) for name, of in exact.items()}
        expected, q = (np.column_stack([values[name] for name in names]) for names in (kernel.fields, kernel.varying))
        load, matrices = element_matrices(kernel, corners, points, 0 * expected, q, np.empty(0))
        places = (corners[:, :, None] * 3 + np.arange(3)).reshape(len(corners), -1)
        pairs = np.repeat(places, 9, axis=1).ravel(), np.tile(places, (1, 9)).ravel()
        matrix = csr_array((matrices.ravel(), pairs), shape=(expected.size,) * 2)
        right = -np.bincount(places.ravel(), load.ravel(), expected.size)
        edge = made.boundary_nodes()
        fixed = np.concatenate([3 * edge, 3 * edge + 1, [2]])
        free = np.setdiff1d(np.arange(expected.size), fixed)
        found = np.where(np.isin(np.arange(expected.size), fixed), expected.ravel(), 0.0)
        found[free] = spsolve(matrix[free][:, free].tocsc(), (right - matrix @ found)[free])
        error = found.reshape(expected.shape) - expected
        error[:, 2] -= error[:, 2].mean()
        errors.append(np.sqrt((error**2).mean(axis=0)))
    orders = np.log2(errors[1] / errors[2])
    assert (orders[:2] > 1.9).all()
    assert orders[2] > 1.3


def vortex() -> dict[str, Callable[..., Any]]:
    """Fields of a flow in a unit square, functions of x and y; b is what its momentum balance leaves."""
    place = tuple(map(Symbol, "xy"))
    at, up = place
    stream = sin(pi * at) ** 2 * sin(pi * up) ** 2 / pi
    u = (stream.diff(up), -stream.diff(at))
    fields = {
        "c": 0.5 + sin(2 * at + up) / 5,
        "eta": 1 + at * up / 2,
        "k": 1 + at / 3,
        "p": cos(pi * at) * sin(pi * up),
        **{f"u{i}": u[i] for i in (0, 1)},
    }
    for i in (0, 1):
        stress = [fields["eta"] * (u[i].diff(place[j]) + u[j].diff(place[i])) for j in (0, 1)]
        viscous = sum(stress[j].diff(place[j]) for j in (0, 1))
        fields[f"b{i}"] = (-viscous + fields["c"] * fields["p"].diff(place[i]) + fields["k"] * u[i]) / fields["c"]
    return {name: lambdify(place, field, "numpy") for name, field in fields.items()}


def test_any_number_of_elements_gives_the_same_bits() -> None:
    """Blocks of lanes are filled up, and the rest is not written."""
    kernel = get_element_kernel(averaged_stokes(2), "c")
    made, corners = mesh(2)
    given = state(kernel, made.p.shape[1])
    residuals, matrices = element_matrices(kernel, corners, made.p.T, *given)
    for count in (0, 1, 3, 4, 5, 17):
        some = element_matrices(kernel, corners[:count], made.p.T, *given)
        assert np.array_equal(some[0], residuals[:count])
        assert np.array_equal(some[1], matrices[:count])


def test_targets_round_alike() -> None:
    """The same operations in the same order."""
    made, corners = mesh(2)
    found = []
    for target in TARGETS:
        kernel = get_element_kernel(averaged_stokes(2), target)
        found.append(element_matrices(kernel, corners, made.p.T, *state(kernel, made.p.shape[1])))
    for one in found[1:]:
        assert all(np.array_equal(*pair) for pair in zip(one, found[0], strict=True))


def test_inverted_and_flat_elements_and_wrong_arrays_are_refused() -> None:
    kernel = get_element_kernel(averaged_stokes(2), "c")
    at = np.array([[0.0, 0], [1, 0], [0, 1], [2, 0]])
    given = state(kernel, 4)
    with pytest.raises(ValueError, match="2 of 3 elements are inverted or flat"):
        element_matrices(kernel, np.array([[0, 1, 2], [0, 2, 1], [0, 1, 3]]), at, *given)
    with pytest.raises(ValueError, match="corners name points from 0 to 4, and there are 4"):
        element_matrices(kernel, np.array([[0, 1, 4]]), at, *given)
    with pytest.raises(ValueError, match=r"q of averaged_stokes has the shape \(4, 2\), and \(4, 5\) is needed"):
        element_matrices(kernel, np.array([[0, 1, 2]]), at, given[0], given[1][:, :2], given[2])


# ---------------------------------------------------------------- declarations


def declared(**changed: Any) -> WeakForm:
    form: dict[str, Any] = {
        "name": "plain",
        "dimension": 2,
        "fields": (x,),
        "coefficients": (s,),
        "terms": {"reaction": s.value * x.value * x.test.value},
    }
    return WeakForm(**{**form, **changed})


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"terms": {"square": x.test.value**2}}, "term 'square' is not linear in the test functions"),
        ({"terms": {"load": s.value}}, "term 'load' is not linear in the test functions"),
        ({"terms": {"load": Symbol("halt") * x.test.value}, "parameters": (half,)}, "halt, .* is half meant"),
        ({"fields": (Field("x", 3),)}, "field x is of 3 dimensions"),
        ({"coefficients": (Field("x", 2),)}, "two things are named x"),
        ({"name": "no name"}, "the form's name 'no name' is no identifier"),
        ({"parameters": (Symbol("s_mean"),)}, "the name 's_mean' is not of letters and digits"),
        ({"quantities": {tau: x.value}}, "quantity tau has x, which is declared nowhere"),
    ],
)
def test_a_faulty_form_is_refused(changed: dict[str, Any], message: str) -> None:
    with pytest.raises(LawError, match=message):
        declared(**changed)


def test_what_cannot_be_integrated_exactly_is_refused() -> None:
    with pytest.raises(LawError, match="is no polynomial in the values of fields"):
        element_ir(declared(terms={"root": sqrt(s.value) * x.test.value}), ElementNeeds())
    with pytest.raises(LawError, match="weak form 'averaged_stokes' has 2 faults"):
        element_ir(averaged_stokes(2), ElementNeeds(uniform=("drag", "k"), absent=("k",)))


def test_a_constant_term_has_a_constant_residual() -> None:
    """A form of nothing but a load, of which nothing is sought: the Jacobian is zero, and is written as such."""
    ir = element_ir(declared(terms={"load": Integer(3) * x.test.value}, coefficients=()), ElementNeeds())
    found = evaluated(ir, values_of(ir, 0))
    # three times a third of the area of (0, 0), (1.1, 0.1), (0.3, 0.9)
    assert [found[f"residual{i}"] for i in range(3)] == pytest.approx([(1.1 * 0.9 - 0.1 * 0.3) / 2] * 3, rel=1e-14)
    assert all(found[f"matrix{i}_{j}"] == 0 for i in range(3) for j in range(3))
    assert "matrix0_0" in emit(ir, "c")
