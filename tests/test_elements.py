"""Kernels of elements: what a weak form declares, against an independent assembler and complex steps."""

from __future__ import annotations

import ast
import cmath
import math
from collections.abc import Callable
from functools import cache
from itertools import combinations
from typing import Any

import numpy as np
import pytest
import skfem
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from skfem.helpers import ddot, div, dot, grad, mul, sym_grad, transpose
from sympy import Integer, Symbol, sqrt

from softdyn.derive.averaged_flow import averaged_flow, outlet
from softdyn.derive.closures.slides_viscosity import closure as slides_viscosity
from softdyn.derive.closures.stokes import closure as stokes
from softdyn.derive.dimensions import DIMENSIONLESS, LENGTH
from softdyn.derive.element_equations import ElementNeeds, degree_of
from softdyn.derive.element_kernel import element_ir
from softdyn.derive.emit import emit
from softdyn.derive.kernel_form import KernelIR, total_operations
from softdyn.derive.simplices import rule
from softdyn.derive.weak_form import FINENESS, Field, WeakForm, metric
from softdyn.derive.weak_form import dot as product_of
from softdyn.elements import (
    Assembly,
    ElementKernel,
    assembled,
    assembly,
    facet_assembly,
    get_element_kernel,
    residual_of,
)
from softdyn.errors import LawError
from softdyn.targets import TARGETS

Array = NDArray[np.float64]

x, s = Field("x", 2, order=2), Field("s", 2)
half = Symbol("half", positive=True)
tau = Symbol("tau", positive=True)
ALL = ElementNeeds()
#: Everything that the flow's form has not: powers of a quadratic unknown, and a quantity that is no polynomial.
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
    quantities={tau: 1 / (FINENESS * sqrt(1 + x.value**2) + s.value + metric(2)[0, 1] ** 2)},
    degree=6,
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


def numbered(at: Array, corners: NDArray[np.int64]) -> tuple[dict[int, NDArray[np.int64]], dict[int, Array]]:
    """Nodes of both orders, and where these are."""
    pairs = np.array(list(combinations(range(corners.shape[1]), 2)))
    edges = np.sort(corners[:, pairs], axis=2)
    unique, inverse = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True)
    second = np.hstack([corners, len(at) + inverse.reshape(len(corners), -1)])
    return {1: corners, 2: second}, {1: at, 2: np.vstack([at, at[unique].mean(axis=1)])}


def state(kernel: ElementKernel, a: Assembly, seed: int = 1) -> tuple[Array, Array, Array]:
    """Values of unknowns, coefficients and numbers, none of them small."""
    draw = np.random.default_rng(seed).uniform
    return draw(0.5, 1.5, a.size), draw(0.3, 0.9, a.size_of_q), draw(0.3, 0.9, len(kernel.numbers))


def parts(values: Array, of: tuple[tuple[str, int, int], ...], counts: Any) -> dict[str, Array]:
    """A flat array taken apart: of each field one row for each component."""
    found, start = {}, 0
    for name, components, order in of:
        stop = start + components * counts[order]
        found[name] = values[start:stop].reshape(components, -1)
        start = stop
    return found


# ---------------------------------------------------------------- another assembler


class ByScikitFem:
    """Averaged flow, written a second time by hand for scikit-fem: residuals, of complex numbers, too.

    Elements are its own, and so are sums over them; points of quadrature are the same: not all terms are polynomials.
    """

    def __init__(self, d: int, order: int, made: Any, places: dict[int, Array], degree: int) -> None:
        self.d, self.order, self.places = d, order, places
        elements = {
            (2, 1): skfem.ElementTriP1(),
            (2, 2): skfem.ElementTriP2(),
            (3, 1): skfem.ElementTetP1(),
            (3, 2): skfem.ElementTetP2(),
        }
        self.made = made
        self.scalars = {k: elements[d, k] for k in {1, order}}
        self.quadrature = quadrature(d, degree)
        self.bases = self.bases_of(lambda element: skfem.Basis(made, element, quadrature=self.quadrature))

    def bases_of(self, make: Callable[[Any], Any]) -> dict[Any, Any]:
        vector = skfem.ElementVector(self.scalars[self.order])
        return {**{k: make(one) for k, one in self.scalars.items()}, "vector": make(vector)}

    def order_of(self, basis: Any, order: int) -> NDArray[np.int64]:
        """Which node each of the basis' unknowns belongs to."""
        return cKDTree(self.places[order]).query(basis.doflocs.T)[1]

    def field(self, bases: dict[Any, Any], values: Array, order: int) -> Any:
        """A field from its values at nodes."""
        basis = bases["vector" if len(values) > 1 else order]
        nodes = self.order_of(basis, order)
        components = np.zeros(len(nodes), int)
        if len(values) > 1:
            for at in (basis.nodal_dofs, basis.edge_dofs, basis.facet_dofs):
                for component, row in enumerate(at):
                    components[row] = component
        return basis.interpolate(values[components, nodes])

    def assembled(self, bases: dict[Any, Any], form: Callable[..., Any], name: str, **fields: Any) -> Array:
        """Residual of one field's test functions, component by component."""
        order = self.order if name == "u" else 1
        basis = bases["vector" if name == "u" else 1]
        found = skfem.LinearForm(form, dtype=complex).assemble(basis, **fields)
        nodes = self.order_of(basis, order)
        out = np.zeros((self.d if name == "u" else 1, len(self.places[order])), complex)
        components = np.zeros(len(nodes), int)
        if name == "u":
            for at in (basis.nodal_dofs, basis.edge_dofs, basis.facet_dofs):
                for component, row in enumerate(at):
                    components[row] = component
        out[components, nodes] = found
        return out.reshape(-1)

    def residual(self, unknown: dict[str, Array], known: dict[str, Array], n: dict[str, float]) -> Array:
        """Averaged flow with Stokes' drag and the viscosity of MigFlow's slides."""
        bases, order = self.bases, self.order
        fields = {
            name: self.field(bases, value, 1 if name == "p" else order) for name, value in (unknown | known).items()
        }
        slopes = self.bases[1].basis
        gradients = np.array([slopes[i][0].grad for i in range(self.d + 1)])
        stiff = np.einsum("imeq,imeq->eq", gradients, gradients)

        def closed(w: Any) -> tuple[Any, ...]:
            phi = 1 - w.c
            eta = n["eta"] * (1 + 2.5 * phi + 5 * phi**2)
            steep = -n["eta"] * (2.5 + 10 * phi) * grad(w.c)
            k = phi / (4 / 3 * math.pi * n["r"] ** 3) * 6 * math.pi * n["eta"] * n["r"]
            pull = k * (w.u / w.c - w.us / phi)
            return eta, steep, k / w.c, pull

        def rest(w: Any) -> Any:
            _, steep, _, pull = closed(w)
            change = n["rate"] * w.u + w.past
            carried = mul(grad(w.u), w.u) / w.c + w.u * div(w.u) / w.c - w.u * dot(w.u, grad(w.c)) / w.c**2
            shear = sym_grad(w.u) + sym_grad(w.us)
            return n["rho"] * (change + carried) + w.c * grad(w.p) - 2 * mul(shear, steep) + pull - w.c * w.force

        def time(w: Any) -> Any:
            eta, _, k, _ = closed(w)
            along = sum(dot(w.u / w.c, gradients[i]) ** 2 for i in range(self.d + 1))
            return ((n["rho"] * n["rate"]) ** 2 + 2 * n["rho"] ** 2 * along + (3 * eta * stiff + k) ** 2) ** -0.5

        def momentum(v: Any, w: Any) -> Any:
            eta, _, k, pull = closed(w)
            found = n["rho"] * dot(n["rate"] * w.u + w.past, v) + dot(pull, v) - w.c * dot(w.force, v)
            found = found - n["rho"] / w.c * dot(w.u, mul(grad(v), w.u)) - w.p * (w.c * div(v) + dot(grad(w.c), v))
            found = found + 2 * eta * ddot(sym_grad(w.u) + sym_grad(w.us), sym_grad(v))
            if order == 2:
                return found + 16 * k / stiff * (div(w.u) + div(w.us)) * div(v)
            return found + time(w) * n["rho"] / w.c * dot(mul(grad(v), w.u), rest(w))

        def mass(q: Any, w: Any) -> Any:
            return q * (div(w.u) + div(w.us)) + (time(w) * dot(grad(q), rest(w)) if order == 1 else 0)

        return np.concatenate(
            [self.assembled(bases, momentum, "u", **fields), self.assembled(bases, mass, "p", **fields)]
        )

    def outflow(
        self, facets: Any, unknown: dict[str, Array], known: dict[str, Array], n: dict[str, float], degree: int
    ) -> Array:
        """What facets add where fluid may leave."""
        weights, points = rule(self.d - 1, degree)
        here = (np.array(points).T[1:], np.array(weights) / math.factorial(self.d - 1))
        bases = self.bases_of(lambda element: skfem.FacetBasis(self.made, element, facets=facets, quadrature=here))
        order = self.order
        fields = {
            name: self.field(bases, value, 1 if name == "p" else order) for name, value in (unknown | known).items()
        }

        def traction(v: Any, w: Any) -> Any:
            phi = 1 - w.c
            eta = n["eta"] * (1 + 2.5 * phi + 5 * phi**2)
            through = dot(w.u, w.n)
            carried = np.where(through.real > 0, through, through / 2)
            found = w.c * w.pressure * dot(w.n, v) + n["rho"] / w.c * carried * dot(w.u, v)
            return found - eta * dot(mul(transpose(grad(w.u) + grad(w.us)), w.n), v)

        found = self.assembled(bases, traction, "u", **fields)
        return np.concatenate([found, np.zeros(len(self.places[1]))])


def quadrature(d: int, degree: int) -> tuple[Array, Array]:
    """The rule of the kernels, as scikit-fem takes it."""
    weights, points = rule(d, degree)
    return np.array(points).T[1:], np.array(weights) / math.factorial(d)


def sizes_of(residual: Callable[[Array], Array], unknown: Array) -> Array:
    """How large the terms are that a residual consists of: those of other signs of the unknowns, too."""
    draw = np.random.default_rng(5).choice
    return np.maximum.reduce([np.abs(residual(unknown * draw([-1.0, 1.0], len(unknown)))) for _ in range(6)])


CASES = [(2, 1), (2, 2), pytest.param(3, 1, marks=pytest.mark.slow), pytest.param(3, 2, marks=pytest.mark.slow)]


@pytest.mark.slow
@pytest.mark.parametrize(("d", "order"), CASES)
def test_assembly_agrees_with_scikit_fem(d: int, order: int) -> None:
    """Residual and, by complex steps along any direction, matrix: 1e-13 of the largest of each kind."""
    form = averaged_flow(d, order, drag=stokes, mixture=slides_viscosity)
    kernel = get_element_kernel(form, "c")
    made, corners = mesh(d, 2 if d == 2 else 1)
    nodes, places = numbered(made.p.T, corners)
    a = assembly(kernel, made.p.T, corners, nodes)
    unknown, q, p = state(kernel, a)
    other = ByScikitFem(d, order, made, places, degree_of(form, ALL))
    known, numbers = parts(q, kernel.varying, a.counts), dict(zip(kernel.numbers, p, strict=True))

    def expected(values: Array) -> Array:
        return other.residual(parts(values, kernel.unknowns, a.counts), known, numbers)

    residual, matrix = assembled(kernel, a, unknown, q, p)
    whole = expected(unknown)
    momentum = np.arange(a.size) < d * a.counts[order]
    for rows in (momentum, ~momentum):
        assert (
            np.abs(residual - whole)[rows].max()
            <= 1e-13 * sizes_of(lambda one: expected(one).real, unknown)[rows].max()
        )
        # velocity and pressure have units of their own: each block by itself
        for columns in (momentum, ~momentum):
            direction = np.where(columns, np.random.default_rng(3).uniform(-1, 1, a.size), 0)
            slope = expected(unknown + 1e-30j * direction).imag / 1e-30
            assert np.abs(matrix @ direction - slope)[rows].max() <= 1e-13 * (abs(matrix) @ abs(direction))[rows].max()


@pytest.mark.slow
@pytest.mark.parametrize(("d", "order"), CASES)
def test_facets_agree_with_scikit_fem(d: int, order: int) -> None:
    """Outlets, through some of whose facets fluid comes in."""
    form = outlet(d, order, mixture=slides_viscosity)
    volume, kernel = get_element_kernel(averaged_flow(d, order), "c"), get_element_kernel(form, "c")
    made, corners = mesh(d, 2 if d == 2 else 1)
    nodes, places = numbered(made.p.T, corners)
    whole = assembly(volume, made.p.T, corners, nodes)
    facets = made.boundary_facets()[::2]
    elements = made.f2t[0, facets]
    apart = ~(corners[elements][:, :, None] == made.facets.T[facets][:, None, :]).any(axis=2)
    a = facet_assembly(kernel, whole, elements, np.argmax(apart, axis=1), nodes)
    unknown, q, p = state(kernel, a)
    unknown[: a.counts[order]] -= 1.0
    other = ByScikitFem(d, order, made, places, 2)
    known, numbers = parts(q, kernel.varying, a.counts), dict(zip(kernel.numbers, p, strict=True))

    def expected(values: Array) -> Array:
        return other.outflow(facets, parts(values, kernel.unknowns, a.counts), known, numbers, degree_of(form, ALL))

    residual, matrix = assembled(kernel, a, unknown, q, p)
    assert matrix.shape == (whole.size, whole.size)
    assert np.abs(residual - expected(unknown)).max() <= 1e-13 * np.abs(residual).max()
    direction = np.random.default_rng(3).uniform(-1, 1, a.size)
    slope = expected(unknown + 1e-30j * direction).imag / 1e-30
    assert np.abs(matrix @ direction - slope).max() <= 1e-13 * (abs(matrix) @ abs(direction)).max()


# ---------------------------------------------------------------- the Jacobian


class _OfReal(ast.NodeTransformer):
    """Let comparisons be of real parts."""

    def visit_Compare(self, node: ast.Compare) -> ast.AST:
        self.generic_visit(node)
        real = [ast.Attribute(one, "real", ast.Load()) for one in (node.left, *node.comparators)]
        return ast.Compare(real[0], node.ops, real[1:])


def evaluated(ir: KernelIR, values: dict[str, Any], name: str = "point") -> dict[str, Any]:
    """Straight-line code of a kernel, run as it is: of complex numbers, too."""
    names: dict[str, Any] = {"sqrt": cmath.sqrt, "_lane_exp": cmath.exp, "exp": cmath.exp, **values}
    names |= {"fabs": lambda z: z if z.real > 0 else -z, "_lane_log": cmath.log, "pow": lambda z, power: z**power}
    for left, text in ir.functions[name].lines:
        names[left] = eval(_compiled(text), {}, names)
    return names


@cache
def _compiled(text: str) -> Any:
    tree = ast.fix_missing_locations(_OfReal().visit(ast.parse(text, mode="eval")))
    return compile(tree, "<kernel>", "eval")


@cache
def ir_of(form: WeakForm, needs: ElementNeeds = ALL) -> KernelIR:
    return element_ir(form, needs)


def values_of(ir: KernelIR, seed: int) -> dict[str, Any]:
    """Numbers for everything that the code at a point reads."""
    draw = np.random.default_rng(seed).uniform
    code = ir.functions["point"]
    return {name: draw(0.4, 0.9) for name in (*(n for read in code.reads.values() for n, _ in read), *code.takes)}


def assert_slopes_are_those_of_complex_steps(ir: KernelIR, values: dict[str, Any]) -> None:
    """Of every flux by every value and gradient, relative to the largest slope of the flux by the same field's."""
    found = evaluated(ir, values)
    code, slots = ir.functions["point"], ir.settings["dimension"] + 1
    for name, index in code.reads["fields"]:
        j, t = divmod(index, slots)
        moved = evaluated(ir, {**values, name: values[name] + 1e-200j})
        for i, one in ir.settings["fluxes"]:
            step = complex(moved[f"flux{i}_{one}"]).imag / 1e-200
            exact = found.get(f"slope{i}_{one}_by{j}_{t}", 0.0)
            terms = [found.get(f"slope{i}_{one}_by{k}_{t}", 0.0) for k in range(len(ir.settings["unknowns"]))]
            assert cmath.isfinite(exact)
            assert abs(exact - step) <= 1e-10 * max(abs(step), max(map(abs, terms)) * 1e-3)


@pytest.mark.parametrize("form", [CURVED, averaged_flow(2, 1), averaged_flow(2, 2), outlet(2, 2)], ids=lambda f: f.name)
def test_the_jacobian_is_that_of_complex_steps(form: WeakForm) -> None:
    for seed in range(3):
        assert_slopes_are_those_of_complex_steps(ir_of(form), values_of(ir_of(form), seed))


def test_a_form_with_powers_is_integrated_exactly() -> None:
    """A field of degree 2 cubed, times one of degree 1 and a test function: degree 9, against a rule of degree 12."""
    form = WeakForm("powers", 2, (x,), (s,), {"reaction": s.value * x.value**3 * x.test.value})
    assert degree_of(form, ALL) == 9
    assert degree_of(form, ElementNeeds(uniform=("s",))) == 8
    assert degree_of(form, ElementNeeds(unit=("s",))) == 8
    kernel = get_element_kernel(form, "c")
    made, corners = mesh(2, 1)
    nodes, places = numbered(made.p.T, corners)
    a = assembly(kernel, made.p.T, corners, nodes)
    values, q, p = state(kernel, a)
    basis = skfem.Basis(made, skfem.ElementTriP2(), quadrature=quadrature(2, 12))
    linear = skfem.Basis(made, skfem.ElementTriP1(), quadrature=quadrature(2, 12))
    order = cKDTree(places[2]).query(basis.doflocs.T)[1]
    power = skfem.LinearForm(lambda v, w: w.s * w.x**3 * v)
    made_field = basis.interpolate(values[order])
    expected = power.assemble(basis, **{"x": made_field, "s": linear.interpolate(q)})
    np.testing.assert_allclose(residual_of(kernel, a, values, q, p)[order], expected, rtol=1e-12)


# ---------------------------------------------------------------- what is not needed


def names_of(ir: KernelIR, function: str = "point") -> str:
    return " ".join(f"{name} = {text};" for name, text in ir.functions[function].lines)


def test_stokes_flow_has_no_operations_of_inertia() -> None:
    """By the rules: what is left is what a form without has. Stabilised, it is linear, and its tau is constant."""
    whole = ir_of(averaged_flow(2, 1))
    spared = ir_of(averaged_flow(2, 1), ElementNeeds(("force",), ("rho", "us"), ("c",)))
    for name in ("own_rho", "own_rate", "own_past", "own_us", "own_c", "own_phi"):
        assert name in names_of(whole) or name == "own_phi"
        assert name not in names_of(spared)
    assert spared.arrays["q"] == ()
    assert spared.arrays["p"] == ("force0", "force1", "eta")
    assert [saving.rule for saving in spared.savings] == [
        "absent coefficients",
        "unit coefficients",
        "uniform coefficients",
    ]
    assert total_operations(spared) < 0.2 * total_operations(whole)
    # nothing but p and its gradient couples with the force: the code reads no velocity beside its gradient
    assert not [name for name, _ in spared.functions["point"].reads["fields"] if name in ("own_u0", "own_u1")]
    assert degree_of(averaged_flow(2, 1), ElementNeeds(("force",), ("rho", "us"), ("c",))) == 1


@pytest.mark.slow
def test_blocks_that_are_zero_are_neither_computed_nor_stored() -> None:
    """Without stabilisation no pressure couples with a pressure; without convection and drag u_x, u_y are by shear."""
    blocks = {(i, j): slots for i, j, slots in ir_of(averaged_flow(2, 2)).settings["blocks"]}
    assert (2, 2) not in blocks
    assert sorted(blocks) == [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2), (2, 0), (2, 1)]
    stokes_flow = ir_of(averaged_flow(2, 2), ElementNeeds(absent=("rho", "us"), unit=("c",), uniform=("force",)))
    blocks = {(i, j): slots for i, j, slots in stokes_flow.settings["blocks"]}
    assert blocks[0, 1] == ((2, 1),)
    assert blocks[2, 0] == ((0, 1),)
    assert blocks[0, 2] == ((1, 0),)
    kernel = get_element_kernel(averaged_flow(2, 2), "c")
    assert (2, 2) not in kernel.coupled
    assert (1, 1) not in kernel.pairs


def test_a_uniform_coefficient_is_one_number_and_has_no_gradient() -> None:
    whole, spared = ir_of(averaged_flow(2, 1)), ir_of(averaged_flow(2, 1), ElementNeeds(("c", "us", "force", "past")))
    assert spared.arrays["q"] == ()
    assert spared.arrays["p"] == ("c", "force0", "force1", "past0", "past1", "rho", "eta", "rate")
    assert "own_c_d0" not in names_of(spared)
    assert total_operations(spared) < total_operations(whole)
    values = values_of(whole, 3) | {f"own_{name}_d{m}": 0.0 for name in ("c", "us0", "us1") for m in range(2)}
    found = [evaluated(ir, values) for ir in (whole, spared)]
    for name in whole.functions["point"].gives:
        assert found[1].get(name, 0.0) == pytest.approx(found[0][name], rel=1e-13, abs=1e-14)


@pytest.mark.slow
def test_operations_at_a_point() -> None:
    """More would be a regression."""
    bed = {"drag": stokes, "mixture": slides_viscosity}
    for form, needs, most in [
        (averaged_flow(2, 1), (("force",), ("us",), ("c",)), 180),
        (averaged_flow(2, 2), (("force",), ("us",), ("c",)), 35),
        (averaged_flow(2, 2, **bed), (("force",), ("us",), ()), 90),
        (averaged_flow(3, 2), (("force",), ("us",), ("c",)), 65),
    ]:
        assert sum(ir_of(form, ElementNeeds(*needs)).functions["point"].operations.values()) <= most


# ---------------------------------------------------------------- flows


@pytest.mark.slow
def test_uniform_flow_through_a_uniform_bed_is_exact() -> None:
    """Then c grad p = -k u + c f at every point: no residual beyond rounding but at the boundary, stabilised or not."""
    form = averaged_flow(2, 1, drag=stokes)
    kernel = get_element_kernel(form, "c", uniform=("c", "force"), absent=("us", "rate", "past"))
    made, corners = mesh(2)
    a = assembly(kernel, made.p.T, corners, {1: corners})
    c, rho, eta, r, u, force = 0.45, 0.7, 1.3, 0.02, np.array([0.3, -0.2]), np.array([2.0, -9.0])
    k = (1 - c) / (4 / 3 * math.pi * r**3) * 6 * math.pi * eta * r / c
    pressure = (force - k * u / c) @ made.p
    unknown = np.concatenate([np.full(a.counts[1], u[0]), np.full(a.counts[1], u[1]), pressure])
    numbers = {"c": c, "force0": force[0], "force1": force[1], "rho": rho, "eta": eta, "r": r}
    p = np.array([numbers[name] for name in kernel.numbers])
    residual = residual_of(kernel, a, unknown, np.empty(0), p)
    rest = residual_of(kernel, a, unknown * np.repeat([1, 1, 0], a.counts[1]), np.empty(0), p)
    inner = np.tile(np.isin(np.arange(a.counts[1]), made.interior_nodes()), 3)
    assert np.abs(residual[inner]).max() < 1e-12 * np.abs(rest[inner]).max()


@pytest.mark.slow
def test_residuals_add_up_to_the_balance_of_momentum() -> None:
    """A constant test function sees no stress and no flux: what is left is inertia, drag and force."""
    form = averaged_flow(2, 2)
    kernel = get_element_kernel(form, "c", absent=("rate", "past", "force"))
    made, corners = mesh(2)
    nodes, _ = numbered(made.p.T, corners)
    a = assembly(kernel, made.p.T, corners, nodes)
    unknown, q, p = state(kernel, a)
    q[: a.counts[2]] = 0.6
    residual = residual_of(kernel, a, unknown, q, p)[: 2 * a.counts[2]].reshape(2, -1)
    assert np.abs(residual.sum(axis=1)).max() < 1e-12 * np.abs(residual).sum()


# ---------------------------------------------------------------- kernels


@pytest.mark.slow
def test_any_number_of_elements_gives_the_same_bits() -> None:
    """Blocks of lanes are filled up, and the rest is not added."""
    kernel = get_element_kernel(averaged_flow(2, 1), "c")
    made, corners = mesh(2)
    at = made.p.T[corners].reshape(-1, 2)  # every element has corners of its own
    apart = np.arange(len(at)).reshape(-1, 3)
    a = assembly(kernel, at, apart, {1: apart})
    unknown, q, p = state(kernel, a)
    residual, matrix = assembled(kernel, a, unknown, q, p)
    np.testing.assert_allclose(residual_of(kernel, a, unknown, q, p), residual, rtol=1e-12)
    for count in (0, 1, 7, 8, 9):
        some = assembly(kernel, at[: 3 * count], apart[:count], {1: apart[:count]})
        kept = [np.concatenate([one.reshape(k, -1)[:, : 3 * count].ravel()]) for one, k in ((unknown, 3), (q, 7))]
        found = assembled(kernel, some, *kept, p)
        assert np.array_equal(found[0], residual.reshape(3, -1)[:, : 3 * count].ravel())
        if count:
            rows = (np.arange(3)[:, None] * len(at) + np.arange(3 * count)).ravel()
            assert np.array_equal(found[1].toarray(), matrix[rows][:, rows].toarray())


@pytest.mark.slow
@pytest.mark.parametrize("form", [averaged_flow(2, 1, drag=stokes), averaged_flow(2, 2), outlet(2, 2)], ids=str)
def test_targets_round_alike(form: WeakForm) -> None:
    """The same operations in the same order."""
    made, corners = mesh(2)
    nodes, _ = numbered(made.p.T, corners)
    found = []
    for target in TARGETS:
        kernel = get_element_kernel(form, target)
        if form.on_facets:
            whole = assembly(get_element_kernel(averaged_flow(2, 2), "c"), made.p.T, corners, nodes)
            a = facet_assembly(kernel, whole, np.arange(5), np.arange(5) % 3, nodes)
        else:
            a = assembly(kernel, made.p.T, corners, nodes)
        residual, matrix = assembled(kernel, a, *state(kernel, a))
        found.append(np.concatenate([residual, matrix.data, residual_of(kernel, a, *state(kernel, a))]))
    assert all(np.array_equal(one, found[0]) for one in found[1:])


def test_nodes_that_are_identified_are_one() -> None:
    """Periodic: rows and columns of both are added up."""
    kernel = get_element_kernel(averaged_flow(2, 1), "c")
    made, corners = mesh(2, 1)
    a = assembly(kernel, made.p.T, corners, {1: corners})
    merge = np.arange(a.counts[1])
    merge[a.counts[1] - 1] = 0
    b = assembly(kernel, made.p.T, corners, {1: merge[corners]})
    spread = np.zeros((a.size, b.size))
    for k in range(3):
        spread[k * a.counts[1] + np.arange(a.counts[1]), k * b.counts[1] + merge] = 1
    unknown, q, p = state(kernel, b)
    wide = np.concatenate([q.reshape(7, -1), q.reshape(7, -1)[:, :1]], axis=1).ravel()
    one, other = assembled(kernel, b, unknown, q, p), assembled(kernel, a, spread @ unknown, wide, p)
    np.testing.assert_allclose(one[0], spread.T @ other[0], rtol=0, atol=1e-14)
    np.testing.assert_allclose(one[1].toarray(), spread.T @ other[1].toarray() @ spread, rtol=0, atol=1e-13)


@pytest.mark.slow
def test_wrong_meshes_and_arrays_are_refused() -> None:
    kernel = get_element_kernel(averaged_flow(2, 1), "c")
    at = np.array([[0.0, 0], [1, 0], [0, 1], [2, 0]])
    good = np.array([[0, 1, 2]])
    with pytest.raises(ValueError, match=r"2 of 3 elements are inverted or flat, the first is element 1"):
        assembly(kernel, at, np.array([[0, 1, 2], [0, 2, 1], [0, 1, 3]]), {1: good})
    with pytest.raises(ValueError, match="corners are from 0 to 4, and must be from 0 to 3"):
        assembly(kernel, at, np.array([[0, 1, 4]]), {1: good})
    with pytest.raises(ValueError, match="nodes of order 1 are missing, which averaged_flow has"):
        assembly(kernel, at, good, {})
    with pytest.raises(ValueError, match="1 of 4 numbers of nodes of order 1 belong to no element"):
        assembly(kernel, at, good, {1: np.array([[0, 1, 3]])})
    with pytest.raises(ValueError, match=r"nodes of order 1 have the shape \(2, 3\), and \(1, 3\) is needed"):
        assembly(kernel, at, good, {1: np.array([[0, 1, 2], [0, 1, 2]])})
    with pytest.raises(ValueError, match="corners are of type float64, and must be integers"):
        assembly(kernel, at, good.astype(float), {1: good})
    with pytest.raises(ValueError, match="averaged_flow is integrated over elements: no sides are needed"):
        assembly(kernel, at, good, {1: good}, np.array([0]))
    a = assembly(kernel, at, good, {1: good})
    facets = get_element_kernel(outlet(2, 1), "c")
    with pytest.raises(ValueError, match="outlet is integrated over facets: sides are needed"):
        assembly(facets, at, good, {1: good})
    with pytest.raises(ValueError, match="facets are of elements 0 to 1, and there are 1"):
        facet_assembly(facets, a, np.array([0, 1]), np.array([0, 0]))
    with pytest.raises(ValueError, match="sides are from 3 to 3, and must be from 0 to 2"):
        facet_assembly(facets, a, np.array([0]), np.array([3]))
    unknown, q, p = state(kernel, a)
    with pytest.raises(ValueError, match=r"q of averaged_flow has the shape \(20,\), and \(21,\) is needed"):
        assembled(kernel, a, unknown, q[:-1], p)


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
        ({"fields": (Field("x", 2, order=3),)}, "field x is of order 3; it can be 1 or 2"),
        ({"coefficients": (Field("x", 2),)}, "two things are named x"),
        ({"name": "no name"}, "the form's name 'no name' is no identifier"),
        ({"parameters": (Symbol("s_d0"),)}, "the name 's_d0' is taken by the code"),
        ({"quantities": {tau: Symbol("y")}}, "quantity tau has y, which is declared nowhere"),
        ({"quantities": {tau: Symbol("normal0", real=True)}}, "quantity tau has normal0, which is declared nowhere"),
        ({"without": {"z": {}}}, "without: 'z' is no coefficient and no parameter"),
        ({"without": {"s": {half: Integer(0)}}}, "half without s: it is no quantity"),
        ({"units": {"x": LENGTH}}, "units: the dimension of s is missing"),
        (
            {
                "units": {"x": LENGTH, "s": DIMENSIONLESS},
                "terms": {"load": s.value * x.test.value, "pull": x.value * x.test.value},
            },
            "term 'pull' is a length for the test function of x, and 'load' a dimensionless",
        ),
        (
            {"units": {"x": LENGTH, "s": DIMENSIONLESS}, "terms": {"load": (s.value + x.value) * x.test.value}},
            "term 'load': .* combines",
        ),
    ],
)
def test_a_faulty_form_is_refused(changed: dict[str, Any], message: str) -> None:
    with pytest.raises(LawError, match=message):
        declared(**changed)


def test_what_is_no_polynomial_needs_a_degree() -> None:
    root = declared(terms={"root": sqrt(s.value) * x.test.value})
    with pytest.raises(LawError, match="term 'root' is no polynomial in the values of fields: the form must state a"):
        element_ir(root, ALL)
    assert degree_of(root, ElementNeeds(uniform=("s",))) == 2


def test_wrong_needs_are_refused() -> None:
    with pytest.raises(LawError, match="weak form 'averaged_flow' has 3 faults") as error:
        element_ir(averaged_flow(2, 1), ElementNeeds(uniform=("drag", "c"), absent=("eat", "c")))
    assert "uniform: 'drag' is no coefficient; there are c, us, force, past" in str(error.value)
    assert "absent: 'eat' is no coefficient or parameter; there are c, us, force, past, rho, eta, rate" in str(
        error.value
    )
    assert "'c' is more than one of uniform, absent and one" in str(error.value)
    with pytest.raises(LawError, match="nothing is left of it"):
        element_ir(declared(), ElementNeeds(absent=("s",)))


def test_a_constant_term_has_a_constant_residual() -> None:
    """A form of nothing but a load, of which nothing is sought: there is no matrix."""
    form = declared(terms={"load": Integer(3) * x.test.value}, coefficients=(), fields=(Field("x", 2),))
    assert "void plain_elements" in emit(element_ir(form, ALL), "c")
    kernel = get_element_kernel(form, "c")
    corners = np.array([[0, 1, 2]])
    a = assembly(kernel, np.array([[0, 0], [1.1, 0.1], [0.3, 0.9]]), corners, {1: corners})
    residual, matrix = assembled(kernel, a, np.zeros(3), np.empty(0), np.empty(0))
    # three times a third of the area
    assert residual == pytest.approx([(1.1 * 0.9 - 0.1 * 0.3) / 2] * 3, rel=1e-14)
    assert matrix.nnz == 0
