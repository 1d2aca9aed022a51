"""Forces on boundaries, fluxes through them, and what a step makes of mass, momentum and energy.

The residual of a row at a boundary is the force by which the boundary keeps the velocity it gives, with the momentum
that is carried in there; at an outlet it is what the facets take. So all forces on the fluid, of boundaries, of volume
and of grains, and the rate of its momentum add up to the residuals of the free rows: to what Newton's method left.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softdyn.fluid.conditions import SHARES
from softdyn.fluid.fields import AXES
from softdyn.fluid.flow_system import FlowEquations, FluidSystem, without_level
from softdyn.fluid.mesh import facet_normals, owners, volumes

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Points of a rule that is exact for squares of linear functions on a simplex, in barycentric coordinates.
RULES = {
    2: np.full((3, 3), 1 / 6) + np.eye(3) / 2,
    3: np.full((4, 4), (5 - math.sqrt(5)) / 20) + math.sqrt(1 / 5) * np.eye(4),
}


def _facet_rules() -> dict[int, tuple[Array, Array]]:
    """Points on an edge and a triangle, by barycentric coordinates, and weights; exact for polynomials of degree 6."""
    x, w = np.polynomial.legendre.leggauss(4)
    x, w = (1 + x) / 2, w / 2
    first, second = (one.ravel() for one in np.meshgrid(x, x, indexing="ij"))
    triangle = np.stack([first, (1 - first) * second, (1 - first) * (1 - second)], axis=1)
    weights = 2 * np.multiply.outer(w * (1 - x), w).ravel()
    return {2: (np.stack([x, 1 - x], axis=1), w), 3: (triangle, weights)}


FACET_RULES = _facet_rules()
#: Terms of the energy, as powers: put in by boundaries and by forces; taken by viscosity and by all else, by grains
#: above all; what kinetic energy gains.
POWERS = ("power_boundaries", "power_force", "kinetic_rate", "dissipation", "power_rest")


@dataclass(frozen=True)
class Measures:
    """What is told of each step, made once for a flow.

    Attributes
    ----------
    names : tuple of str
        Of the boundaries, without periodic ones.
    columns : tuple of str
        Of what :func:`measured` gives.
    owners : mapping from str to array of int
        Nodes of each boundary but for outlets.
    shared : array, shape (nodes,)
        How many of these boundaries each node of the velocity is on.
    corners : mapping from str to (array of int, array, array)
        Of each boundary those facets that have shared nodes: their elements, points of a rule on them in barycentric
        coordinates of the element, and normals as long as the facets are large.
    through : mapping from str to (array of int, array)
        Nodes of each boundary, and the integrals of their shape functions times the normal.
    gradients : array, shape (elements, d + 1, d)
        Of the linear shape functions.
    sizes : array, shape (elements,)
    """

    names: tuple[str, ...]
    columns: tuple[str, ...]
    owners: dict[str, Ints]
    shared: Ints
    corners: dict[str, tuple[Ints, Array, Array]]
    through: dict[str, tuple[Ints, Array]]
    gradients: Array
    sizes: Array


def measures_of(system: FluidSystem) -> Measures:
    """Prepare what is told of each step of a flow."""
    mesh, velocity, d = system.mesh, system.velocity, system.dimension
    names = tuple(velocity.facets)
    outlets = {part.outlet.name for part in system.open}
    nodes = {name: np.unique(velocity.facets[name]) for name in names if name not in outlets}
    times = np.zeros(velocity.count, dtype=np.int64)
    for own in nodes.values():
        times[own] += 1
    corners = {name: _meeting(system, name, times) for name in nodes}
    share = np.array(SHARES[velocity.order, d])
    through = {}
    for name in names:
        normals = facet_normals(mesh.at, mesh.boundaries[name])
        total = np.zeros((velocity.count, d))
        np.add.at(total, velocity.facets[name], share[None, :, None] * normals[:, None, :])
        own = np.unique(velocity.facets[name])
        through[name] = own, total[own]
    edges = mesh.at[mesh.corners[:, 1:]] - mesh.at[mesh.corners[:, :1]]
    inner = np.linalg.inv(edges).transpose(0, 2, 1)
    gradients = np.concatenate([-inner.sum(axis=1, keepdims=True), inner], axis=1)
    columns = [f"force_{name}_{axis}" for name in names for axis in AXES[:d]] + [f"flux_{name}" for name in names]
    columns += [f"{what}_{axis}" for what in ("momentum_rate", "volume_force", "bed_force") for axis in AXES[:d]]
    columns += [*POWERS, "kinetic_energy", "mass_imbalance", "momentum_imbalance", "energy_imbalance"]
    return Measures(names, tuple(columns), nodes, times, corners, through, gradients, volumes(mesh))


def _meeting(system: FluidSystem, name: str, times: Ints) -> tuple[Ints, Array, Array]:
    """Facets of a boundary that have nodes of others, too; see ``Measures.corners``."""
    mesh, d = system.mesh, system.dimension
    facets = mesh.boundaries[name][(times[system.velocity.facets[name]] > 1).any(axis=1)]
    elements = owners(mesh, facets)
    # rows of a facet's corners among those of its element
    place = np.argmax(mesh.corners[elements][:, None, :] == facets[:, :, None], axis=2)
    on_facet, _ = FACET_RULES[d]
    points = np.zeros((len(facets), len(on_facet), d + 1))
    for k in range(d):
        points[np.arange(len(facets)), :, place[:, k]] = on_facet[:, k]
    return elements, points, facet_normals(mesh.at, facets)


def measured(
    system: FluidSystem, measures: Measures, equations: FlowEquations, x: Array, residual: Array, least: float = 0.0
) -> Array:
    """What is told of a solution, in the order of ``Measures.columns``.

    Parameters
    ----------
    system : FluidSystem
    measures : Measures
    equations : FlowEquations
        Those that it solves.
    x, residual : array, shape (unknowns,)
    least : float
        Size of velocities below which they do not matter: imbalances are relative to at least what these make.

    Returns
    -------
    array, shape (columns,)
        ``force_NAME_x``: of the fluid on the boundary, force, in two dimensions force/length; with it the momentum that
        leaves there. ``flux_NAME``: of the fluid out of the domain. ``momentum_rate``, ``volume_force`` on the fluid,
        ``bed_force`` of the fluid on the grains. Powers as :data:`POWERS`. Imbalances are relative to the sum of the
        sizes of what is added up.
    """
    d, count = system.dimension, system.velocity.count
    v = system.velocities
    if system.conditions.levels:
        # forces on walls are those of the pressure that frames have
        x = without_level(system, x)
        residual = equations.residual(x)
    u, rows = x[:v].reshape(d, count), residual[:v].reshape(d, count)
    outlets = dict(zip((part.outlet.name for part in system.open), equations.of_outlets(x), strict=True))
    forces, fluxes, put_in = [], [], 0.0
    us = equations.known.get("us")
    mixed = []
    parts = _parts(system, measures, equations, x, rows)
    for name in measures.names:
        if name in outlets:
            taken = outlets[name][:v].reshape(d, count)
            forces.append(taken.sum(axis=1))
            put_in -= float(np.sum(taken * u))
        else:
            nodes, part = measures.owners[name], parts[name]
            forces.append(-part.sum(axis=1))
            put_in += float(np.sum(part * u[:, nodes]))
        nodes, normals = measures.through[name]
        fluxes.append(float(np.sum(normals * u[:, nodes].T)))
        mixed.append(fluxes[-1] + (0.0 if us is None else float(np.sum(normals * us[nodes]))))
    elements = equations.of_elements(x)[:v]
    still = equations.without("past", "rate").of_elements(x)[:v]
    # what is left without forces is of grains: viscosity and convection add up to nothing, over all rows
    passive = equations.without("past", "rate", "force").of_elements(x)[:v]
    rate, force = (elements - still).reshape(d, count), -(still - passive).reshape(d, count)
    bed = passive.reshape(d, count).sum(axis=1)
    momentum = [rate.sum(axis=1), force.sum(axis=1), bed]
    density = equations.numbers["rho"]
    kinetic, dissipated = _energies(system, measures, equations, u, density)
    powers = [put_in, float(np.sum(force * u)), float(np.sum(rate * u)), dissipated]
    powers.append(float(np.sum(passive.reshape(d, count) * u)) - dissipated)
    total = momentum[1] - momentum[0] - bed - sum(forces, np.zeros(d))
    # forces of walls may add up to little, and what is added over all rows to nothing: it is rounding of these sizes
    added = equations.without("past").of_elements(x)[:v] - still
    sizes = sum(float(np.abs(one).sum()) for one in (rate, added, force, passive))
    slow = density * equations.numbers["rate"] * least * float(measures.sizes.sum())
    through = least * sum(float(np.abs(normals).sum()) for _, normals in measures.through.values())
    imbalances = [
        _ratio(sum(mixed), sum(map(abs, mixed)) + through),
        _ratio(np.abs(total).max(), sizes + slow),
        _ratio(powers[0] + powers[1] - powers[2] - powers[3] - powers[4], sum(map(abs, powers)) + slow * least),
    ]
    return np.concatenate([*forces, fluxes, *momentum, powers, [kinetic], imbalances])


def _parts(
    system: FluidSystem, measures: Measures, equations: FlowEquations, x: Array, rows: Array
) -> dict[str, Array]:
    """What each boundary has of the reactions at its nodes, shape (d, nodes).

    Where boundaries meet, the traction on the facets of each, as the elements there have it, times the shape function,
    tells their parts; what these do not add up to is divided evenly.
    """
    found, total = {}, np.zeros_like(rows)
    for name in measures.owners:
        found[name] = _tractions(system, measures, equations, x, name)
        total += found[name]
    left = (rows - total) / np.maximum(measures.shared, 1)
    alone = measures.shared == 1
    return {
        name: np.where(alone[nodes], rows[:, nodes], found[name][:, nodes] + left[:, nodes])
        for name, nodes in measures.owners.items()
    }


def _tractions(system: FluidSystem, measures: Measures, equations: FlowEquations, x: Array, name: str) -> Array:
    """Integrals of traction and of the momentum carried in, times shape functions, over facets that meet others."""
    d, order, velocity = system.dimension, system.velocity.order, system.velocity
    elements, points, normals = measures.corners[name]
    found = np.zeros((d, velocity.count))
    if not len(elements):
        return found
    shapes, slopes = _shape_functions(points, order)
    u = x[: system.velocities].reshape(d, -1)
    nodes, known = velocity.of[elements], equations.known
    us = known.get("us")
    moving = u if us is None else u + us.T
    gradients = np.einsum("fqkm,fmb,afk->fqab", slopes, measures.gradients[elements], moving[:, nodes], optimize=True)
    p = np.einsum("fqk,fk->fq", points, x[system.velocities :][system.pressure.of[elements]])
    c = np.einsum("fqk,fk->fq", shapes, known["c"][nodes]) if "c" in known else np.ones_like(p)
    eta = equations.numbers["eta"] if system.mixture is None else _mixture(system, equations, c)
    here = np.einsum("fqk,afk->fqa", shapes, u[:, nodes])
    through = np.einsum("fqa,fa->fq", here, normals)
    stress = (gradients + gradients.transpose(0, 1, 3, 2)) * np.broadcast_to(eta, p.shape)[..., None, None]
    traction = np.einsum("fqab,fb->fqa", stress, normals) - (c * p)[..., None] * normals[:, None, :]
    traction -= (equations.numbers["rho"] / c * through)[..., None] * here
    each = np.einsum("q,fqk,fqa->afk", FACET_RULES[d][1], shapes, traction)
    for axis in range(d):
        np.add.at(found[axis], nodes, each[axis])
    return found


def _ratio(value: float, size: float) -> float:
    return abs(float(value)) / float(size) if size else 0.0


@dataclass(frozen=True)
class Sheared:
    """How the mixture is sheared, at the points of a rule in each element.

    Attributes
    ----------
    rates : array, shape (elements, points, d, d)
        D(u + us).
    viscosity : array, shape (elements, points)
        eta*.
    share : array, shape (elements, points)
        Of the fluid.
    speed : array, shape (elements, points)
        Square of u.
    weights : array, shape (elements, 1)
        Of each point.
    """

    rates: Array
    viscosity: Array
    share: Array
    speed: Array
    weights: Array


def sheared(system: FluidSystem, measures: Measures, equations: FlowEquations, u: Array) -> Sheared:
    """How the mixture is sheared by a flow.

    Parameters
    ----------
    system : FluidSystem
    measures : Measures
    equations : FlowEquations
    u : array, shape (d, nodes)
    """
    d, order = system.dimension, system.velocity.order
    points = RULES[d]
    shapes, slopes = _shape_functions(points, order)
    nodes = system.velocity.of
    values = np.einsum("qk,aek->eqa", shapes, u[:, nodes])
    c, us = equations.known.get("c"), equations.known.get("us")
    moving = u if us is None else u + us.T
    # slopes by barycentric coordinates, whose gradients are those of the linear shape functions
    gradients = np.einsum("qkm,emb,aek->eqab", slopes, measures.gradients, moving[:, nodes], optimize=True)
    rates = (gradients + gradients.transpose(0, 1, 3, 2)) / 2
    share = np.ones(shapes.shape[0]) if c is None else np.einsum("qk,ek->eq", shapes, c[nodes])
    viscosity = equations.numbers["eta"] * np.ones_like(share)
    if system.mixture is not None:
        viscosity = _mixture(system, equations, share)
    return Sheared(rates, viscosity, share, np.sum(values**2, axis=2), measures.sizes[:, None] / len(points))


def mean_stress(system: FluidSystem, measures: Measures, equations: FlowEquations, x: Array) -> Array:
    """Viscous stress of the mixture, 2 eta* D(u + us), in the mean over the volume, shape (d, d).

    Parameters
    ----------
    system : FluidSystem
    measures : Measures
    equations : FlowEquations
    x : array, shape (unknowns,)
    """
    one = sheared(system, measures, equations, x[: system.velocities].reshape(system.dimension, -1))
    factor = np.broadcast_to(2 * one.weights * one.viscosity, one.rates.shape[:2])
    return np.asarray(np.einsum("eq,eqab->ab", factor, one.rates) / measures.sizes.sum())


def _energies(
    system: FluidSystem, measures: Measures, equations: FlowEquations, u: Array, density: float
) -> tuple[float, float]:
    """Kinetic energy of the fluid, rho u^2/(2 c), and what viscosity dissipates, 2 eta* D(u + us) : D(u + us)."""
    one = sheared(system, measures, equations, u)
    kinetic = float(np.sum(one.weights * density * one.speed / (2 * one.share)))
    return kinetic, float(np.sum(one.weights * 2 * one.viscosity * np.sum(one.rates**2, axis=(2, 3))))


def _shape_functions(points: Array, order: int) -> tuple[Array, Array]:
    """Shape functions at points, (..., nodes), and slopes by barycentric coordinates, (..., nodes, d + 1)."""
    corners = points.shape[-1]
    if order == 1:
        return points, np.broadcast_to(np.eye(corners), (*points.shape[:-1], corners, corners))
    pairs = [(i, j) for i in range(corners) for j in range(i + 1, corners)]
    middles = np.stack([4 * points[..., i] * points[..., j] for i, j in pairs], axis=-1)
    slopes = np.zeros((*points.shape[:-1], corners + len(pairs), corners))
    for k in range(corners):
        slopes[..., k, k] = 4 * points[..., k] - 1
    for row, (i, j) in enumerate(pairs, start=corners):
        slopes[..., row, i], slopes[..., row, j] = 4 * points[..., j], 4 * points[..., i]
    return np.concatenate([points * (2 * points - 1), middles], axis=-1), slopes


def _mixture(system: FluidSystem, equations: FlowEquations, share: Array) -> Array:
    """Viscosity of the mixture where the fluid has a share of the volume."""
    from sympy import lambdify

    from softdyn.derive import closure as arguments

    closure = system.mixture
    assert closure is not None
    symbols = [arguments.c, arguments.phi, arguments.eta, *closure.parameters]
    function = lambdify(symbols, closure.expression, "numpy")
    own = [equations.numbers[symbol.name] for symbol in closure.parameters]
    found = function(share, 1 - share, equations.numbers["eta"], *own)
    return np.broadcast_to(np.asarray(found, dtype=float), share.shape)
