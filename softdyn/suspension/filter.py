"""The filter between grains and mesh: it spreads what grains have over a width that is not of the mesh.

A grain's volume V at X makes the share phi of the grains as the solution of

    (1 - l^2 laplacian) psi = V delta(x - X) ,  (1 - l^2 laplacian) phi = psi ,  neither with a flux through walls,

by linear finite elements with lumped masses. Integrated over the fluid this gives V, whatever the mesh and wherever the
walls: no volume is lost. What shape functions add to the width is taken off l, element by element. On meshes
without obtuse angles no share is negative. Far from walls the filter is exp(-r/l) in three dimensions, with a standard
deviation of 2 l along each axis, which is its width; its transform is (1 + l^2 k^2)^-2. Momentum goes the same way, and
velocities come back to a grain by the same filter, which is symmetric: so what one gains the other loses.

At a boundary the share is that of the grains and of their mirror images, which move as such: along the boundary as the
grains, and against them through it. So the flux of the grains that :func:`spread_flux` makes has no part through any
boundary, and its divergence is what their share falls by.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space
from scipy.sparse import block_diag, coo_matrix, csc_matrix, csr_matrix, diags

from softdyn.errors import SceneError
from softdyn.fluid.conditions import directions_at
from softdyn.fluid.locate import Locator, located, locator
from softdyn.fluid.mesh import Mesh, place, volumes
from softdyn.fluid.numbering import Nodes

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Width of the filter over the length l: two passes, each of a variance 2 l^2 along an axis.
WIDE = 2.0
#: What is taken off l^2, over the square of an element's side: grains come on the mesh, and velocities off it, by
#: linear shape functions, of a variance of 1/6 of it, which two passes of the filter, of a variance 2 l^2 each, make up
#: for. The mass of each node counts as its own, which leaves the variance of a share, on average, too small by 0.14 of
#: that square at most; without, it is too large by 0.12, and what comes back to a grain is wider yet.
HATS = 1 / 24
#: Length of the filter over the length of an element's side, below which the mesh does not resolve it.
RESOLVED = 0.5
#: Of sides, as they follow from volumes.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Filter:
    """A filter on a mesh.

    Attributes
    ----------
    nodes : Nodes
        Of order 1.
    length : float
        The l of the filter: half of its width.
    mass : array, shape (nodes,)
        Integrals of the nodes' shape functions.
    factor : object
        Of mass + l^2 stiffness.
    free : sparse matrix, shape (d nodes, free)
        Vectors at the nodes without a part through boundaries, an axis after another: its columns are of unit size.
    flux_factor : object
        The same of these.
    grid : Locator
    periods : tuple of (array, array)
        A point on a periodic boundary, and the way to the other one.
    """

    nodes: Nodes
    length: float
    mass: Array
    factor: Any
    free: csr_matrix
    flux_factor: Any
    grid: Locator
    periods: tuple[tuple[Array, Array], ...]


def filter_of(mesh: Mesh, nodes: Nodes, width: float, periodic: Sequence[tuple[str, str]] = ()) -> Filter:
    """Make a filter of a width, the standard deviation along each axis, on a mesh.

    Parameters
    ----------
    mesh : Mesh
    nodes : Nodes
        Of order 1, with the periodic pairs.
    width : float
    periodic : sequence of pairs of str

    Raises
    ------
    SceneError
        If it is wider than the fluid, or narrower than the mesh can tell.
    """
    from scipy.sparse.linalg import splu

    sides, length = np.ptp(mesh.at, axis=0), width / WIDE
    if not width <= 0.5 * sides.min():
        raise SceneError(
            f"[coupling] width = {width:.4g}: the filter is wider than half the fluid, whose shortest side is "
            f"{sides.min():.4g}; give a smaller width, or a larger mesh"
        )
    sizes = volumes(mesh)
    side = float(_side(sizes, mesh.dimension).max())
    if not length >= RESOLVED * side * (1 - ROUNDING):
        raise SceneError(
            f"[coupling] width = {width:.4g}: the mesh does not resolve the filter, for its largest element has sides "
            f"of {side:.4g}; give a width of {WIDE * RESOLVED * side:.4g} at least, or a finer mesh"
        )
    d = mesh.dimension
    mass = np.zeros(nodes.count)
    np.add.at(mass, nodes.of, (sizes / (d + 1))[:, None])
    slopes = gradients(mesh)
    local = np.einsum("e,eia,eja->eij", sizes * (length**2 - HATS * _side(sizes, d) ** 2), slopes, slopes)
    rows, columns = np.repeat(nodes.of, d + 1, axis=1).ravel(), np.tile(nodes.of, (1, d + 1)).ravel()
    stiffness = csr_matrix(coo_matrix((local.ravel(), (rows, columns)), shape=(nodes.count, nodes.count)))
    whole = csc_matrix(diags(mass) + stiffness)
    free = _free(mesh, nodes)
    of_vectors = csc_matrix(free.T @ block_diag([whole] * d) @ free)
    ways = tuple(_period(mesh, *pair) for pair in periodic)
    return Filter(nodes, length, mass, splu(whole), free, splu(of_vectors), locator(mesh.at, mesh.corners), ways)


def _free(mesh: Mesh, nodes: Nodes) -> csr_matrix:
    """Vectors at nodes without a part through boundaries; see ``Filter.free``."""
    d, count = mesh.dimension, nodes.count
    node, normals = directions_at(mesh, nodes, list(nodes.facets))
    axis = np.argmax(np.abs(normals), axis=1)
    straight = np.abs(normals[np.arange(len(node)), axis]) > 1 - ROUNDING
    is_free = np.ones((d, count), dtype=bool)
    is_free[axis, node] = False
    slanted = np.unique(node[~straight])
    is_free[:, slanted] = False
    row, value = [np.flatnonzero(is_free)], [np.ones(int(is_free.sum()))]
    column, size = [np.arange(len(row[0]))], len(row[0])
    for one in slanted:
        tangents = null_space(normals[node == one])  # shape (d, tangents)
        axes, each = np.indices(tangents.shape)
        row.append((one + count * axes).ravel())
        column.append((size + each).ravel())
        value.append(tangents.ravel())
        size += tangents.shape[1]
    entries = np.concatenate(value), (np.concatenate(row), np.concatenate(column))
    return csr_matrix(coo_matrix(entries, shape=(d * count, size)))


def _side(volume: Array, d: int) -> Array:
    """Side of a cell of a box of which an element is one of the parts."""
    return np.asarray((volume * math.factorial(d)) ** (1 / d))


def _period(mesh: Mesh, one: str, other: str) -> tuple[Array, Array]:
    first, second = (mesh.at[np.unique(mesh.boundaries[name])] for name in (one, other))
    return first.min(axis=0), np.asarray(second.min(axis=0) - first.min(axis=0))


def gradients(mesh: Mesh) -> Array:
    """Gradients of the linear shape functions of each element, shape (elements, d + 1, d)."""
    edges = mesh.at[mesh.corners[:, 1:]] - mesh.at[mesh.corners[:, :1]]
    inner = np.linalg.inv(edges).transpose(0, 2, 1)
    return np.concatenate([-inner.sum(axis=1, keepdims=True), inner], axis=1)


def wrapped(one: Filter, x: Array) -> Array:
    """Places in the mesh of points that may have gone through periodic boundaries."""
    found = np.array(x, dtype=float)
    for start, way in one.periods:
        turns = np.floor((found - start) @ way / (way @ way))
        found -= turns[:, None] * way
    return found


def weights_at(one: Filter, x: Array) -> tuple[csr_matrix, Ints]:
    """Shape functions of all nodes at points, shape (points, nodes), and which points are in no element.

    Parameters
    ----------
    one : Filter
    x : array, shape (points, d)
    """
    element, shares = located(one.grid, wrapped(one, x))
    lost = np.flatnonzero(element < 0)
    shares, corners = np.where(element[:, None] < 0, 0.0, shares), one.nodes.of[element]
    shares = shares / np.where(element < 0, 1.0, shares.sum(axis=1))[:, None]
    count, each = corners.shape
    starts = np.arange(count + 1) * each
    return csr_matrix((shares.ravel(), corners.ravel(), starts), shape=(count, one.nodes.count)), lost


def require_inside(x: Array, lost: Ints) -> None:
    """Refuse grains that start outside of the mesh.

    Raises
    ------
    SceneError
    """
    if len(lost):
        more = f", and {len(lost) - 1} more grains are" if len(lost) > 1 else ""
        raise SceneError(
            f"[particles] positions: grain {lost[0]} is at {place(x[lost[0]])}, outside of the mesh{more}: move it "
            "there, or make the mesh larger"
        )


def smoothed(one: Filter, loads: Array) -> Array:
    """What loads at nodes make of a field, shape of the loads: their sum is the integral of the field.

    Parameters
    ----------
    one : Filter
    loads : array, shape (nodes, ...)
        Integrals of a density times the nodes' shape functions.
    """
    flat = np.ascontiguousarray(loads.reshape(len(loads), -1))
    once = one.mass[:, None] * one.factor.solve(flat)
    return np.asarray(one.factor.solve(once)).reshape(loads.shape)


def spread(one: Filter, weights: csr_matrix, amounts: Array) -> Array:
    """Density at the nodes of amounts that grains have, shape (nodes, ...).

    Parameters
    ----------
    one : Filter
    weights : sparse matrix, shape (grains, nodes)
        See :func:`weights_at`.
    amounts : array, shape (grains, ...)
    """
    flat = np.asarray(weights.T @ amounts.reshape(len(amounts), math.prod(amounts.shape[1:])))
    return smoothed(one, flat.reshape(-1, *amounts.shape[1:]))


def spread_flux(one: Filter, weights: csr_matrix, amounts: Array) -> Array:
    """Flux at the nodes of amounts, volumes times velocities, that grains have; none of it through a boundary.

    Parameters
    ----------
    one : Filter
    weights : sparse matrix, shape (grains, nodes)
        See :func:`weights_at`.
    amounts : array, shape (grains, d)
    """
    loads = one.free.T @ np.asarray(weights.T @ amounts).T.reshape(-1)
    mass = np.tile(one.mass, amounts.shape[1])
    once = one.free.T @ (mass * (one.free @ one.flux_factor.solve(loads)))
    return np.asarray((one.free @ one.flux_factor.solve(once)).reshape(amounts.shape[1], -1).T)


def gathered(one: Filter, weights: csr_matrix, loads: Array) -> Array:
    """Filtered values at the grains, shape (grains, ...), of a field that is given by its integrals at nodes.

    The sum over grains of amounts times these is the integral of the field times what :func:`spread` makes of the
    amounts.

    Parameters
    ----------
    one : Filter
    weights : sparse matrix, shape (grains, nodes)
        Of the nodes at each grain.
    loads : array, shape (nodes, ...)
        Integrals of the field times the shape function of each node.
    """
    found = smoothed(one, loads)
    there = np.asarray(weights @ found.reshape(len(found), -1))
    return there.reshape(there.shape[0], *loads.shape[1:])
