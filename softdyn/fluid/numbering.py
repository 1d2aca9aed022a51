"""Numbers of nodes: of order 1 the points of a mesh, of order 2 the middles of its edges, too.

Nodes on boundaries that are periodic are the same: a node has the least of the numbers that it would have. Elements
are straight; a node of order 2 is in the middle of its edge.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.fluid.mesh import Mesh, facet_normals, grouped, place

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: How far apart nodes that are to be the same may be, over the size of the mesh.
APART = 1e-7


@dataclass(frozen=True)
class Nodes:
    """Nodes of one order.

    Attributes
    ----------
    order : 1 or 2
    at : array, shape (nodes, d)
    of : array of int, shape (elements, nodes of an element)
        The corners, then the middles of the edges (0, 1), (0, 2), (1, 2) in two dimensions, (0, 1), (0, 2), (0, 3),
        (1, 2), (1, 3), (2, 3) in three.
    points : array of int, shape (points,)
        Node at each point of the mesh.
    facets : mapping from str to array of int, shape (facets, nodes of a facet)
        Nodes of the facets of each boundary, as those of an element; without the boundaries that are periodic.
    """

    order: int
    at: Array
    of: Ints
    points: Ints
    facets: Mapping[str, Ints]

    @property
    def count(self) -> int:
        """How many nodes there are."""
        return len(self.at)


def nodes_of(mesh: Mesh, order: int, periodic: Sequence[tuple[str, str]] = ()) -> Nodes:
    """Number the nodes of a mesh.

    Parameters
    ----------
    mesh : Mesh
    order : 1 or 2
    periodic : sequence of pairs of str
        Boundaries of which the second is the first, displaced: their nodes are the same.

    Raises
    ------
    SceneError
        If there is no such boundary, or two that are to be the same differ.
    """
    if order not in (1, 2):
        raise ValueError(f"nodes are of order 1 or 2, not {order}")
    at, of, facets = mesh.at, mesh.corners, dict(mesh.boundaries)
    if order == 2:
        at, of, facets = _with_middles(mesh)
    new = np.arange(len(at))
    if periodic:
        new = _identified(mesh, at, facets, periodic)
    kept = np.unique(new)
    number = np.empty(len(at), dtype=np.int64)
    number[kept] = np.arange(len(kept))
    number = number[new]
    gone = {name for pair in periodic for name in pair}
    return Nodes(
        order=order,
        at=at[kept],
        of=number[of],
        points=number[: len(mesh.at)],
        facets={name: number[nodes] for name, nodes in facets.items() if name not in gone},
    )


def edges_of(simplices: Ints) -> Ints:
    """Edges of elements or of facets, by their ends, the smaller first; an element's after another's."""
    pairs = np.array(list(combinations(range(simplices.shape[1]), 2)))
    return np.sort(simplices[:, pairs].reshape(-1, 2), axis=1)


def _with_middles(mesh: Mesh) -> tuple[Array, Ints, dict[str, Ints]]:
    """Nodes of order 2: coordinates, those of elements, those of facets."""
    simplices = [mesh.corners, *mesh.boundaries.values()]
    edges = [edges_of(each) for each in simplices]
    rows = np.concatenate(edges)
    first, group = grouped(rows)
    middles = np.split(group + len(mesh.at), np.cumsum([len(each) for each in edges])[:-1])
    nodes = [np.hstack([each, middle.reshape(len(each), -1)]) for each, middle in zip(simplices, middles, strict=True)]
    at = np.concatenate([mesh.at, mesh.at[rows[first]].mean(axis=1)])
    return at, nodes[0], dict(zip(mesh.boundaries, nodes[1:], strict=True))


def _identified(mesh: Mesh, at: Array, facets: Mapping[str, Ints], periodic: Sequence[tuple[str, str]]) -> Ints:
    """The least node that each is the same as."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    used = [name for pair in periodic for name in pair]
    for name in used:
        if name not in facets:
            raise SceneError(f"periodic: there is no boundary {name!r}; there are {', '.join(map(repr, facets))}")
        if used.count(name) > 1:
            raise SceneError(f"periodic: boundary {name!r} is given twice")
    pairs = np.concatenate([_partners(mesh, at, facets, *pair) for pair in periodic])
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(at), len(at)))
    _, group = connected_components(graph, directed=False)
    least = np.full(group.max() + 1, len(at))
    np.minimum.at(least, group, np.arange(len(at)))
    return np.asarray(least[group])


def _partners(mesh: Mesh, at: Array, facets: Mapping[str, Ints], one: str, other: str) -> Ints:
    """Pairs of nodes of two boundaries that are the same, displaced; shape (pairs, 2)."""
    from scipy.spatial import cKDTree

    first, second = np.unique(facets[one]), np.unique(facets[other])
    way = at[second].min(axis=0) - at[first].min(axis=0)
    size = float(np.ptp(mesh.at, axis=0).max())
    apart, nearest = cKDTree(at[second]).query(at[first] + way)
    alike = f"periodic: boundaries {one!r} and {other!r} are not alike"
    remedy = "mesh one of them as a copy of the other"
    if len(first) != len(second):
        raise SceneError(f"{alike}: {len(first)} nodes and {len(second)}; {remedy}")
    if apart.max() > APART * size or len(np.unique(nearest)) < len(second):
        worst = int(np.argmax(apart))
        raise SceneError(
            f"{alike}: the node of {one!r} at {place(at[first[worst]])} has none of {other!r} at "
            f"{place(at[first[worst]] + way)}; {remedy}"
        )
    to = np.arange(len(at))
    to[first] = second[nearest]
    d = mesh.dimension
    both = np.concatenate([to[facets[one][:, :d]], facets[other][:, :d]])
    _, group = grouped(np.sort(both, axis=1))
    if (np.bincount(group) != 2).any():
        odd = int(np.argmax(np.bincount(group)[group] != 2))
        raise SceneError(f"{alike}: their facets differ at {place(at[both[odd]].mean(axis=0))}; {remedy}")
    normals = [facet_normals(mesh.at, mesh.boundaries[name]).sum(axis=0) for name in (one, other)]
    if np.linalg.norm(normals[0] + normals[1]) > 1e-6 * np.linalg.norm(normals[0]):
        raise SceneError(f"{alike}: the fluid does not go on from one to the other; they must face each other")
    return np.stack([first, second[nearest]], axis=1)
