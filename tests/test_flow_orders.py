"""Flows with known solutions: errors fall at the orders of the elements; a solution that is quadratic has none.

The force that a solution takes is made by sympy from the equations themselves, not from their weak form.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import block_array, csr_array
from scipy.sparse.linalg import splu
from sympy import Expr, Matrix, Rational, Symbol, cos, exp, lambdify, pi, sin, sqrt

from softdyn.derive import closure as arguments
from softdyn.derive.averaged_flow import averaged_flow, outlet
from softdyn.derive.closures.ergun import closure as ergun
from softdyn.derive.closures.slides_viscosity import closure as slides_viscosity
from softdyn.derive.simplices import rule, values_at
from softdyn.derive.symbols import eta
from softdyn.elements import (
    Assembly,
    ElementKernel,
    assembled,
    assembly,
    facet_assembly,
    get_element_kernel,
)
from softdyn.fluid.built_meshes import box_mesh
from softdyn.fluid.mesh import Mesh, volumes
from softdyn.fluid.numbering import Nodes, nodes_of

Array = NDArray[np.float64]
PLACE = [Symbol(name, real=True) for name in "xyz"]


@dataclass(frozen=True, eq=False)
class Exact:
    """A flow that is known: expressions of x, y, z; numbers of the fluid and the grains."""

    d: int
    u: Any
    p: Expr
    numbers: dict[str, Any]
    c: Expr | None = None
    us: Any = None
    force: Any = None

    @property
    def place(self) -> list[Symbol]:
        return PLACE[: self.d]


def strained(vector: Any, place: list[Symbol]) -> Any:
    """Its gradient, a row for each component."""
    return Matrix([[part.diff(x) for x in place] for part in vector])


def with_its_force(flow: Exact) -> Exact:
    """The force that the momentum balance leaves, with Ergun's drag and the viscosity of MigFlow's slides."""
    place, n = flow.place, {name: Rational(value) for name, value in flow.numbers.items()}
    assert flow.c is not None
    c, u, us, phi = flow.c, flow.u, flow.us, 1 - flow.c
    slip = us / phi - u / c
    size = sqrt(sum(x**2 for x in slip))
    known = {arguments.r: n["r"], arguments.rho: n["rho"], eta: n["eta"], arguments.c: c, arguments.phi: phi}
    known[arguments.Re] = 2 * n["r"] * n["rho"] * size / n["eta"]
    friction = ergun.expression.subs(known, simultaneous=True)
    viscosity = slides_viscosity.expression.subs({eta: n["eta"], arguments.phi: phi}, simultaneous=True)
    mean = strained(u + us, place)
    stress = viscosity * (mean + mean.T)
    force = []
    for i in range(flow.d):
        carried = sum((u[i] * u[j] / c).diff(x) for j, x in enumerate(place))
        sheared = sum(stress[i, j].diff(x) for j, x in enumerate(place))
        drag = phi / (Rational(4, 3) * pi * n["r"] ** 3) * friction * slip[i]
        force.append((n["rho"] * carried + c * flow.p.diff(place[i]) - sheared - drag) / c)
    return Exact(flow.d, u, flow.p, flow.numbers, c, us, Matrix(force))


@cache
def through_a_bed(d: int) -> Exact:
    """Both phases move, without sources, through a porosity that varies."""
    x, y, z = PLACE
    if d == 2:
        stream, other = sin(2 * x + y) * cos(x - 2 * y) / 2, sin(x + y) / 8
        u, us = (Matrix([one.diff(y), -one.diff(x)]) for one in (stream, other))
        p, c = cos(2 * x) * sin(y), Rational(11, 20) + sin(2 * x + y) / 8
    else:
        u = Matrix([cos(x) * sin(y) * cos(z), sin(x) * cos(y) * cos(z), 2 * sin(x) * sin(y) * sin(z)])
        us = Matrix([sin(y) / 8, sin(z) / 8, sin(x) / 8])
        p, c = cos(x + y) * sin(z), Rational(11, 20) + sin(x + y - z) / 8
    assert sum(u[i].diff(place) for i, place in enumerate(PLACE[:d])).simplify() == 0
    return with_its_force(Exact(d, u, p, {"rho": 1, "eta": Rational(1, 10), "r": Rational(1, 5)}, c, us))


def kovasznay() -> Exact:
    """The wake of a grid at Re = 40: Kovasznay, Proc. Camb. Philos. Soc. 44 (1948) 58."""
    x, y, _ = PLACE
    rate = 20 - sqrt(400 + 4 * pi**2)
    u = Matrix([1 - exp(rate * x) * cos(2 * pi * y), rate / (2 * pi) * exp(rate * x) * sin(2 * pi * y)])
    return Exact(2, u, -exp(2 * rate * x) / 2, {"rho": 1, "eta": Rational(1, 40)})


def values_of(expr: Expr, flow: Exact, at: Array) -> Array:
    """An expression at places, one in each row."""
    found = _function(expr, flow.d)(*at.T)
    return np.broadcast_to(np.asarray(found, float), len(at))


@cache
def _function(expr: Expr, d: int) -> Callable[..., Any]:
    return lambdify(PLACE[:d], expr, "numpy", cse=True)


@dataclass(frozen=True)
class Solved:
    """What was found, in its mesh."""

    mesh: Mesh
    nodes: dict[str, Nodes]
    u: Array
    p: Array


def solved(flow: Exact, mesh: Mesh, order: int) -> Solved:
    """The discrete flow with the exact velocity at the boundary, by Newton's method from rest."""
    nodes = {"u": nodes_of(mesh, order), "p": nodes_of(mesh, 1)}
    bed = {} if flow.c is None else {"drag": ergun, "mixture": slides_viscosity}
    kernel = get_element_kernel(
        averaged_flow(flow.d, order, **bed),
        "c",
        absent=("past", "rate", *(() if flow.c is not None else ("us", "force"))),
        unit=() if flow.c is not None else ("c",),
    )
    a = assembly(kernel, mesh.at, mesh.corners, {order: nodes["u"].of, 1: nodes["p"].of})
    known = {"c": [flow.c], "us": flow.us, "force": flow.force}
    at = nodes["u"].at
    q = np.concatenate(
        [np.empty(0), *(values_of(one, flow, at) for name, _, _ in kernel.varying for one in known[name])]
    )
    p = np.array([float(flow.numbers[name]) for name in kernel.numbers])
    edge = np.unique(np.concatenate([one.ravel() for one in nodes["u"].facets.values()]))
    count = len(at)
    fixed = np.concatenate([edge + k * count for k in range(flow.d)])
    found = np.zeros(a.size)
    found[fixed] = np.concatenate([values_of(one, flow, at[edge]) for one in flow.u])
    # the level of the pressure is held by its mean, so that no node takes up what interpolation lets in at the boundary
    level = np.zeros(a.size)
    share = np.repeat(volumes(mesh) / (flow.d + 1), flow.d + 1)
    level[flow.d * count :] = np.bincount(nodes["p"].of.ravel(), share, a.size - flow.d * count)
    found = newton(kernel, a, found, q, p, fixed, level=level)
    return Solved(mesh, nodes, found[: flow.d * count].reshape(flow.d, count), found[flow.d * count :])


def newton(
    kernel: ElementKernel,
    a: Assembly,
    found: Array,
    q: Array,
    p: Array,
    fixed: Any,
    more: Any = (),
    level: Array | None = None,
) -> Array:
    """Newton's method, quadratic to the end, of a form on elements and others on facets.

    Where ``level`` is given its product with the unknowns is zero, and a multiplier of it is added to the residual.
    """
    free = np.setdiff1d(np.arange(a.size), fixed)
    multiplier = 0.0
    for _ in range(20):
        residual, matrix = assembled(kernel, a, found, q, p)
        for one, b, known, numbers in more:
            other = assembled(one, b, found, known, numbers)
            residual, matrix = residual + other[0], matrix + other[1]
        inner, right = matrix[free][:, free], residual[free]
        if level is not None:
            border = csr_array(level[free][:, None])
            inner = block_array([[inner, border], [border.T, None]])
            right = np.append(right + multiplier * level[free], level @ found)
        step = splu(inner.tocsc()).solve(right)
        found[free] -= step[: len(free)]
        multiplier -= step[-1] if level is not None else 0.0
        if np.abs(step).max() <= 1e-11 * np.abs(found).max():
            return found
    raise AssertionError("Newton's method does not converge")


def errors(flow: Exact, one: Solved) -> tuple[float, float]:
    """Errors of velocity and pressure in the mean square over the domain; the pressure's level is free."""
    d, (weights, points) = flow.d, rule(flow.d, 8)
    corners = one.mesh.at[one.mesh.corners]
    places = np.einsum("gi,eim->egm", np.array(points), corners)
    share = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))[:, None] * np.array(weights)
    share /= share.sum()
    found = []
    for nodes, values, exact in ((one.nodes["u"], one.u, list(flow.u)), (one.nodes["p"], one.p[None], [flow.p])):
        shapes = np.reshape(values_at(d, nodes.order, points), (len(points), -1))
        wrong = np.array(
            [
                np.einsum("ga,ea->eg", shapes, value[nodes.of])
                - values_of(expr, flow, places.reshape(-1, d)).reshape(share.shape)
                for value, expr in zip(values, exact, strict=True)
            ]
        )
        if nodes is one.nodes["p"]:
            wrong -= (wrong * share).sum()
        found.append(float(np.sqrt((wrong**2 * share).sum())))
    return found[0], found[1]


def orders(
    flow: Exact, order: int, counts: tuple[int, ...], box: Any = None
) -> tuple[float, float, tuple[float, float]]:
    """Orders of convergence between the last two meshes, and the last errors."""
    lower, upper = box or ((0.0,) * flow.d, (1.0,) * flow.d)
    found = []
    for n in counts:
        size = [b - a for a, b in zip(lower, upper, strict=True)]
        cells = [round(n * side) for side in size]
        found.append(errors(flow, solved(flow, box_mesh(size, cells, origin=list(lower)), order)))
    falls = [np.log(found[-2][k] / found[-1][k]) / np.log(counts[-1] / counts[-2]) for k in (0, 1)]
    return float(falls[0]), float(falls[1]), found[-1]


#: Orders of velocity and pressure that are asked for, by that of the velocity.
LEAST = {1: (1.9, 1.5), 2: (2.9, 1.9)}


@pytest.mark.slow
@pytest.mark.parametrize(("d", "order", "counts"), [(2, 1, (16, 32)), (2, 2, (8, 16)), (3, 1, (4, 8)), (3, 2, (3, 6))])
def test_flow_through_a_bed_converges_at_the_orders_of_its_elements(
    d: int, order: int, counts: tuple[int, int]
) -> None:
    """With inertia, drag, a viscosity of the mixture, grains that move, and a porosity that varies."""
    velocity, pressure, _ = orders(through_a_bed(d), order, counts)
    assert velocity >= LEAST[order][0]
    assert pressure >= LEAST[order][1]


@pytest.mark.slow
@pytest.mark.parametrize(("order", "counts"), [(1, (32, 64)), (2, (16, 32))])
def test_kovasznays_flow_converges_at_the_orders_of_its_elements(order: int, counts: tuple[int, int]) -> None:
    velocity, pressure, _ = orders(kovasznay(), order, counts, ((-0.5, -0.5), (1.0, 1.5)))
    assert velocity >= LEAST[order][0]
    assert pressure >= LEAST[order][1]


@pytest.mark.slow
@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_developed_flow_leaves_through_an_outlet_without_an_error(d: int) -> None:
    """A quadratic velocity and a linear pressure are in the space of the elements: what is left is rounding.

    At the outlet pressure alone is given; that the flow there is developed is the outlet's own doing.
    """
    x, y, z = PLACE
    speed = y * (1 - y) if d == 2 else y * (1 - y) + z * (1 - z)
    flow = Exact(
        d, Matrix([speed, 0, 0][:d]), Rational(3, 10) * 2 * (d - 1) * (2 - x) + 5, {"rho": 2, "eta": Rational(3, 10)}
    )
    mesh = box_mesh([2.0, 1.0, 1.0][:d], [4, 2, 2][:d])
    nodes = {"u": nodes_of(mesh, 2), "p": nodes_of(mesh, 1)}
    needs = {"absent": ("us",), "unit": ("c",)}
    kernel = get_element_kernel(averaged_flow(d, 2), "c", absent=("past", "rate", "us", "force"), unit=("c",))
    facets = get_element_kernel(outlet(d, 2), "c", uniform=("pressure",), **needs)
    a = assembly(kernel, mesh.at, mesh.corners, {2: nodes["u"].of, 1: nodes["p"].of})
    right = mesh.boundaries["right"]
    inside = [np.flatnonzero(np.isin(mesh.corners, one).sum(axis=1) == d)[0] for one in right]
    sides = np.argmin(np.array([np.isin(mesh.corners[e], one) for e, one in zip(inside, right, strict=True)]), axis=1)
    b = facet_assembly(facets, a, np.array(inside), sides)
    at, count = nodes["u"].at, len(nodes["u"].at)
    held = [name for name in mesh.boundaries if name != "right"]
    edge = np.unique(np.concatenate([nodes["u"].facets[name].ravel() for name in held]))
    fixed = np.concatenate([edge + k * count for k in range(d)])
    found = np.zeros(a.size)
    found[fixed] = np.concatenate([values_of(one, flow, at[edge]) for one in flow.u])
    p, numbers = (
        np.array([{"rho": 2.0, "eta": 0.3, "pressure": 5.0}[name] for name in one.numbers]) for one in (kernel, facets)
    )
    nothing = np.empty(0)
    found = newton(kernel, a, found, nothing, p, fixed, [(facets, b, nothing, numbers)])
    one = Solved(mesh, nodes, found[: d * count].reshape(d, count), found[d * count :])
    velocity, _ = errors(flow, one)
    assert velocity < 1e-13
    np.testing.assert_allclose(one.p, values_of(flow.p, flow, nodes["p"].at), rtol=1e-11)
