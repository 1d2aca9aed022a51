"""Conditions at the boundaries: which unknowns are given, along which normals nothing flows, where a pressure acts.

Where boundaries meet, a given velocity holds before slip. Of several velocities, each keeps the flow through its own
boundary: at a corner, the velocity along each normal is the one given for that boundary, so that what is said to flow
in does, and nothing leaks beside a lid. Whatever is left, and where boundaries meet without an edge, is that of a wall
at rest, else of the later in the scene. A pressure acts on facets, whatever their nodes.

Slip keeps the velocity along the mean of the normals of the facets at a node, weighted by their sizes, so that nothing
flows through the boundary as a whole; where facets meet at an edge sharper than :data:`SHARP`, along each normal.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.fluid.boundary_keys import Boundary, boundary_faults
from softdyn.fluid.fields import FieldFunction, field_of, fields_of, vectors_at
from softdyn.fluid.mesh import Mesh, facet_normals
from softdyn.fluid.numbering import Nodes
from softdyn.words import listed

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Integral of each shape function of a facet over its size: (order, dimension of the flow).
SHARES = {
    (1, 2): (1 / 2, 1 / 2),
    (1, 3): (1 / 3, 1 / 3, 1 / 3),
    (2, 2): (1 / 6, 1 / 6, 2 / 3),
    (2, 3): (0.0, 0.0, 0.0, 1 / 3, 1 / 3, 1 / 3),
}
#: Cosine of the angle between normals from which facets meet at an edge, where fluid slips along each: 40 degrees.
SHARP = math.cos(math.radians(40))
#: Its sine: normals that are nearer to each other's lines are no corner.
APART = math.sin(math.radians(40))
#: Directions at a node that are nearer to depending on each other than this are one fewer.
DEPENDENT = 0.1
#: What given velocities may let in or out of an enclosed flow, over what flows: what interpolation leaves is taken off.
IMBALANCE = 0.02
#: From here on a warning tells of it.
TOLD = 1e-6
#: Net flows below this, over sizes times speeds of the boundary, are rounding.
ROUNDING = 1e-12


@dataclass(frozen=True)
class Given:
    """A velocity that is given: of the fluid, or porosity times that.

    Attributes
    ----------
    nodes : array of int
        Of the velocity.
    fields : tuple of FieldFunction
        One for each axis.
    superficial : bool
        Whether the porosity is in it.
    parts : array, shape (nodes, d, d)
        What of it a node takes: all, but at corners, where the velocity is the sum of several parts.
    """

    nodes: Ints
    fields: tuple[FieldFunction, ...]
    superficial: bool
    parts: Array


@dataclass(frozen=True)
class Outlet:
    """A part of the boundary at which a pressure is given.

    Attributes
    ----------
    name : str
    points : array of int, shape (facets, d)
        Corners of its facets, whose normals point outwards.
    nodes : array of int, shape (facets, nodes of a facet)
        Nodes of the velocity.
    corners : array of int, shape (facets, d)
        Nodes of the pressure.
    pressure : FieldFunction
    """

    name: str
    points: Ints
    nodes: Ints
    corners: Ints
    pressure: FieldFunction


@dataclass(frozen=True)
class Enclosed:
    """A part of the fluid without an outlet: what is given must let in as much as it lets out.

    Attributes
    ----------
    level : array of int
        Its unknown pressures, which have no level.
    nodes : array of int
        Nodes of the velocity on its boundary.
    shares : array, shape (nodes, d)
        Integrals of the nodes' shape functions times the outward normal.
    """

    level: Ints
    nodes: Ints
    shares: Array


@dataclass(frozen=True)
class Conditions:
    """Conditions at all boundaries. Unknowns are all velocities, an axis after another, then all pressures.

    Attributes
    ----------
    fixed : array of int, shape (fixed,)
        Unknowns whose values are given, an axis after another.
    slipping : array of int, shape (slipping, d)
        Unknowns of the velocity at nodes without flow along a normal; a node may stand several times.
    normals : array, shape (slipping, d)
        Unit vectors, those of one node at right angles to each other.
    outlets : tuple of Outlet
    enclosed : tuple of Enclosed
    given : tuple of Given
    at : array, shape (nodes, d)
        Nodes of the velocity.
    sticking : array of int
        Nodes whose velocity is given, not their flux alone.
    along : array, shape (sticking, d, d)
        Projections there on the directions along all boundaries.
    """

    fixed: Ints
    slipping: Ints
    normals: Array
    outlets: tuple[Outlet, ...]
    enclosed: tuple[Enclosed, ...]
    given: tuple[Given, ...]
    at: Array
    sticking: Ints
    along: Array

    @property
    def levels(self) -> tuple[Ints, ...]:
        """Unknown pressures of each part of the fluid in which they have no level."""
        return tuple(part.level for part in self.enclosed)

    @property
    def of_time(self) -> bool:
        """Whether any of them may change in time."""
        fields = [field for given in self.given for field in given.fields]
        return any(field.of_time for field in [*fields, *(outlet.pressure for outlet in self.outlets)])


def conditions_of(
    boundaries: Sequence[Boundary], mesh: Mesh, velocity: Nodes, pressure: Nodes, constants: Mapping[str, float]
) -> Conditions:
    """Conditions of a scene on the nodes of its mesh.

    Parameters
    ----------
    boundaries : sequence of Boundary
    mesh : Mesh
    velocity, pressure : Nodes
        With the periodic pairs of the same boundaries.
    constants : mapping from str to float

    Raises
    ------
    SceneError
        If a boundary has no condition or two, or there is none of a name; if a condition is not one, or cannot be read.
    """
    d, count = mesh.dimension, velocity.count
    faults = boundary_faults(boundaries, mesh.boundaries)
    if faults:
        raise SceneError(listed(faults))
    said: list[tuple[Boundary, tuple[FieldFunction, ...]]] = []
    outlets: list[Outlet] = []
    for number, entry in enumerate(boundaries):
        if entry.velocity is not None or entry.flux is not None:
            key = "velocity" if entry.velocity is not None else "flux"
            said.append((entry, fields_of(getattr(entry, key), d, constants, f"[[boundary]] {number}: {key}")))
        elif entry.pressure is not None:
            field = field_of(entry.pressure, d, constants, f"[[boundary]] {number}: pressure")
            outlets += [
                Outlet(name, mesh.boundaries[name], velocity.facets[name], pressure.facets[name], field)
                for name in entry.names
            ]
    given = _given(mesh, velocity, said)
    nodes = np.unique(np.concatenate([np.empty(0, dtype=np.int64), *(one.nodes for one in given)]))
    slip = [name for entry in boundaries if entry.slip for name in entry.names]
    slipping, normals = directions_at(mesh, velocity, slip, nodes)
    sticking = np.unique(
        np.concatenate([np.empty(0, dtype=np.int64), *(one.nodes for one in given if not one.superficial)])
    )
    return Conditions(
        fixed=(np.arange(d)[:, None] * count + nodes).reshape(-1),
        slipping=slipping[:, None] + np.arange(d) * count,
        normals=normals,
        outlets=tuple(outlets),
        enclosed=_enclosed(mesh, velocity, pressure, outlets),
        given=given,
        at=velocity.at,
        sticking=sticking,
        along=_along(mesh, velocity, sticking),
    )


def _along(mesh: Mesh, velocity: Nodes, nodes: Ints) -> Array:
    """Projections, at nodes, on the directions along all boundaries there."""
    projections = np.tile(np.eye(mesh.dimension), (velocity.count, 1, 1))
    node, normals = directions_at(mesh, velocity, list(velocity.facets))
    np.subtract.at(projections, node, normals[:, :, None] * normals[:, None, :])
    return np.asarray(projections[nodes])


def given_values(
    conditions: Conditions, t: float, c: Array | None = None, us: Array | None = None, carried: Array | None = None
) -> tuple[Array, tuple[str, ...]]:
    """Values of what is given, at a time.

    Parameters
    ----------
    conditions : Conditions
    t : float
    c : array, shape (nodes,), optional
        Porosity at the nodes of the velocity; 1 without.
    us : array, shape (nodes, d), optional
        Volume fraction of the grains times their velocity; 0 without.
    carried : array, shape (nodes, d), optional
        The same of grains that are not on the boundaries, but at some distance: along a boundary, fluid and grains
        together then have the velocity that is given.

    Returns
    -------
    values : array, shape (fixed + slipping,)
        Of the unknowns ``fixed``, then of the velocities along ``normals``.
    warnings : tuple of str
        What was taken off where the flow is enclosed.

    Raises
    ------
    SceneError
        If a value is not finite, or more flows into an enclosed part than out of it.
    """
    d = conditions.at.shape[1]
    u, mixed = np.zeros_like(conditions.at), np.zeros_like(conditions.at)
    warnings = []
    for one in conditions.given:
        found = vectors_at(one.fields, conditions.at[one.nodes], t)
        flux = found if one.superficial or c is None else c[one.nodes, None] * found
        u[one.nodes] += np.einsum("nij,nj->ni", one.parts, flux)
        if carried is not None:
            mixed[one.nodes] += np.einsum("nij,nj->ni", one.parts, found - flux)
    if carried is not None:
        own = conditions.sticking
        u[own] += np.einsum("nij,nj->ni", conditions.along, mixed[own] - carried[own])
    for part in conditions.enclosed:
        warnings += _balance(part, u, us, t)
    fixed = conditions.fixed.reshape(d, -1)[0]
    return np.concatenate([u[fixed].T.reshape(-1), np.zeros(len(conditions.slipping))]), tuple(warnings)


def _given(
    mesh: Mesh, velocity: Nodes, said: Sequence[tuple[Boundary, tuple[FieldFunction, ...]]]
) -> tuple[Given, ...]:
    """Share nodes out among the velocities that are said of them: corners get a part of each."""
    d = mesh.dimension
    # a wall at rest first, then the later before the earlier
    order = sorted(range(len(said)), key=lambda k: (not all(field.zero for field in said[k][1]), -k))
    facets = [_node_normals(mesh, velocity, said[k][0].names, even=True) for k in order]
    own = [np.unique(node) for node, _ in facets]
    times = np.bincount(np.concatenate([np.empty(0, dtype=np.int64), *own]), minlength=velocity.count)
    parts = [np.tile(np.eye(d), (len(nodes), 1, 1)) for nodes in own]
    meeting = [_by_node(node, normal, times > 1) for node, normal in facets]
    for corner in np.flatnonzero(times > 1).tolist():
        there = [k for k in range(len(order)) if corner in meeting[k]]
        for k, part in zip(there, _corner_parts([_sums(meeting[k][corner]) for k in there], d), strict=True):
            parts[k][np.searchsorted(own[k], corner)] = part
    return tuple(
        Given(own[k], said[order[k]][1], said[order[k]][0].velocity is None, parts[k]) for k in range(len(order))
    )


def _corner_parts(normals: Sequence[Sequence[Array]], d: int) -> list[Array]:
    """Which part of each velocity a corner takes.

    Parameters
    ----------
    normals : sequence of sequences of arrays, shape (d,)
        Of each boundary there, the first to hold first.
    d : int

    Returns
    -------
    list of array, shape (d, d)
        The velocity is the sum of these times those given. It agrees with each along its normals, as far as these are
        an edge apart, and with the first elsewhere.
    """
    parts = [np.zeros((d, d)) for _ in normals]
    known = np.zeros((d, d))  # projection on the directions in which the velocity is known
    for k, several in enumerate(normals):
        for normal in several:
            unit = normal / np.linalg.norm(normal)
            new = unit - known @ unit
            size = float(np.linalg.norm(new))
            if size < APART:
                continue
            new /= size
            rows = [(unit if j == k else 0.0) - unit @ part for j, part in enumerate(parts)]
            parts = [part + np.outer(new, row) / size for part, row in zip(parts, rows, strict=True)]
            known += np.outer(new, new)
    parts[0] = parts[0] + np.eye(d) - known
    return parts


def _node_normals(mesh: Mesh, velocity: Nodes, names: Sequence[str], even: bool) -> tuple[Ints, Array]:
    """Nodes of facets, each as often as it has facets there, and the normals of these times the nodes' shares."""
    k = len(SHARES[velocity.order, mesh.dimension])
    shares = np.full(k, 1.0 / k) if even else np.array(SHARES[velocity.order, mesh.dimension])
    nodes = [np.empty(0, dtype=np.int64)]
    found = [np.empty((0, mesh.dimension))]
    for name in names:
        normals = facet_normals(mesh.at, mesh.boundaries[name])
        nodes.append(velocity.facets[name].reshape(-1))
        found.append((shares[None, :, None] * normals[:, None, :]).reshape(-1, mesh.dimension))
    return np.concatenate(nodes), np.concatenate(found)


def _by_node(node: Ints, normal: Array, wanted: NDArray[np.bool_]) -> dict[int, Array]:
    """Normals of the facets at each node that is wanted."""
    taken = np.flatnonzero(wanted[node])
    taken = taken[np.argsort(node[taken], kind="stable")]
    nodes, start = np.unique(node[taken], return_index=True)
    return dict(zip(nodes.tolist(), np.split(normal[taken], start[1:]), strict=True)) if len(nodes) else {}


def directions_at(mesh: Mesh, nodes: Nodes, names: Sequence[str], but: Ints | None = None) -> tuple[Ints, Array]:
    """Nodes of boundaries, and the normals there: a node as often as it has of these.

    Parameters
    ----------
    mesh : Mesh
    nodes : Nodes
    names : sequence of str
        Of boundaries.
    but : array of int, optional
        Nodes that are left out.

    Returns
    -------
    node : array of int, shape (normals,)
    normals : array, shape (normals, d)
        Unit vectors, those of one node at right angles to each other.
    """
    node, normal = _node_normals(mesh, nodes, names, even=True)
    free = ~np.isin(node, np.empty(0, dtype=np.int64) if but is None else but)
    node, normal = node[free], normal[free]
    each, group = np.unique(node, return_inverse=True)
    mean = np.zeros((len(each), mesh.dimension))
    np.add.at(mean, group, normal)
    unit = normal / np.linalg.norm(normal, axis=1)[:, None]
    first = np.full(len(each), len(node))
    np.minimum.at(first, group, np.arange(len(node)))
    edge = np.zeros(len(each), dtype=bool)
    np.logical_or.at(edge, group, np.sum(unit * unit[first[group]], axis=1) < SHARP)
    smooth = ~edge
    found = [each[smooth]]
    normals = [mean[smooth] / np.linalg.norm(mean[smooth], axis=1)[:, None]]
    for k, there in _by_node(group, normal, edge).items():
        directions = _directions(there)
        found.append(np.full(len(directions), each[k]))
        normals.append(directions)
    return np.concatenate(found), np.concatenate(normals)


def _directions(normals: Array) -> Array:
    """Directions at right angles to each other that the normals of facets at an edge span, (directions, d)."""
    units = np.array([one / np.linalg.norm(one) for one in _sums(normals)])
    _, sizes, axes = np.linalg.svd(units)
    return np.asarray(axes[: int(np.sum(sizes > DEPENDENT))])


def _sums(normals: Array) -> list[Array]:
    """Normals of facets at a node, added up where they are not an edge apart."""
    sums: list[Array] = []
    for normal in normals:
        size = np.linalg.norm(normal)
        for k, other in enumerate(sums):
            if normal @ other >= SHARP * size * np.linalg.norm(other):
                sums[k] = other + normal
                break
        else:
            sums.append(normal)
    return sums


def _enclosed(mesh: Mesh, velocity: Nodes, pressure: Nodes, outlets: Sequence[Outlet]) -> tuple[Enclosed, ...]:
    """Parts of the fluid that are connected and have no outlet."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    one, other = np.repeat(pressure.of[:, :1], mesh.dimension, axis=1).reshape(-1), pressure.of[:, 1:].reshape(-1)
    graph = coo_array((np.ones(len(one)), (one, other)), shape=(pressure.count, pressure.count))
    parts, part = connected_components(graph, directed=False)
    is_open = np.zeros(parts, dtype=bool)
    for outlet in outlets:
        is_open[part[outlet.corners]] = True
    if is_open.all():
        return ()
    node, share = _node_normals(mesh, velocity, list(velocity.facets), even=False)
    total = np.zeros_like(velocity.at)
    np.add.at(total, node, share)
    of_node = np.empty(velocity.count, dtype=np.int64)
    of_node[velocity.of] = part[pressure.of[:, :1]]
    outer = np.unique(node)
    start = mesh.dimension * velocity.count
    return tuple(
        Enclosed(start + np.flatnonzero(part == number), nodes, total[nodes])
        for number in np.flatnonzero(~is_open)
        for nodes in [outer[of_node[outer] == number]]
    )


def _balance(part: Enclosed, u: Array, us: Array | None, t: float) -> list[str]:
    """Take off the little that given velocities let into an enclosed part, in proportion to what flows at each node."""
    through = np.sum(part.shares * u[part.nodes], axis=1)
    grains = 0.0 if us is None else np.sum(part.shares * us[part.nodes], axis=1)
    net = float(np.sum(through + grains))
    sizes = np.linalg.norm(part.shares, axis=1)
    speeds = np.linalg.norm(u[part.nodes], axis=1) + (0.0 if us is None else np.linalg.norm(us[part.nodes], axis=1))
    if abs(net) <= ROUNDING * float(sizes @ speeds):
        return []
    flow = float(np.sum(np.abs(through)))
    out, into = (float(np.sum(np.maximum(sign * (through + grains), 0.0))) for sign in (1, -1))
    if abs(net) > IMBALANCE * max(into, out) or not flow:
        raise SceneError(
            f"an enclosed part of the fluid would take in {into:.6g} and give off {out:.6g} at t = {t:g}, by the "
            "velocities given at its boundaries: give one of them a pressure instead, or velocities that balance"
        )
    sizes[sizes == 0] = 1.0
    u[part.nodes] -= (net * np.abs(through) / flow / sizes**2)[:, None] * part.shares
    if abs(net) <= TOLD * max(into, out):
        return []
    return [
        f"given velocities let {into:.6g} into an enclosed part of the fluid and {out:.6g} out of it at t = {t:g}: the "
        "difference is taken off, in proportion to what flows at each node"
    ]
