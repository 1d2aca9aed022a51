"""Meshes of triangles and tetrahedra: what they are, what follows from them, and whether they can be used.

A facet is a side of an element: an edge in two dimensions, a triangle in three. The order of an element's corners is a
convention of whoever made the mesh: elements are turned, so that all have a positive volume. What overlaps in truth is
found by its neighbours: two elements that share a facet must lie on different sides of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Corners of the facet that is opposite to each corner, so that its normal points out of the element.
FACETS = {2: ((1, 2), (2, 0), (0, 1)), 3: ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1))}
#: Volume of an element over the power of its longest edge, below which it is flat: digits of its gradients are lost.
FLATTEST = 1e-10
#: How far from a facet a point lies on it, over the facet's size.
ON_FACET = 1e-8
#: Places that a message names, at most.
SHOWN = 3


@dataclass(frozen=True)
class Mesh:
    """A mesh that was checked: see :func:`mesh_of`.

    Attributes
    ----------
    at : array, shape (points, d)
        The points, each a corner of some element.
    corners : array of int, shape (elements, d + 1)
        Points at the corners of each element, whose volume is positive in their order.
    boundaries : mapping from str to array of int, shape (facets, d)
        Points of the facets of each named part of the boundary, with normals that point out of the fluid: in two
        dimensions the fluid is to the left of the way from the first point to the second.
    """

    at: Array
    corners: Ints
    boundaries: Mapping[str, Ints]

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return int(self.at.shape[1])


def mesh_of(at: Array, corners: Ints, boundaries: Mapping[str, Ints], where: str = "the mesh") -> Mesh:
    """Check a mesh, turn its elements and facets, and leave out points that no element has.

    Parameters
    ----------
    at : array, shape (points, d)
    corners : array of int, shape (elements, d + 1)
    boundaries : mapping from str to array of int, shape (facets, d)
        In any order of their points.
    where : str
        What messages call the mesh.

    Raises
    ------
    SceneError
        If an array has another shape, or an element names no point; if elements are flat, or overlap; if points hang,
        which are on a facet without being its corner; if a part of the boundary has no name or two of them, a name has
        no facet, or a facet is none of the boundary.
    """
    at, corners = _arrays(at, corners, where)
    d = at.shape[1]
    named = {name: _facets(name, facets, len(at), d, where) for name, facets in boundaries.items()}
    at, corners, named = _used(at, corners, named, where)
    size = determinants(at, corners)
    longest = _longest_edges(at, corners)
    flat = np.abs(size) <= FLATTEST * longest**d
    if flat.any():
        raise SceneError(
            f"{where}: {_counted(flat.sum(), 'flat element')}, {_places(at[corners[flat]].mean(axis=1))}: move their "
            "points, or make the mesh anew"
        )
    corners[size < 0, :2] = corners[size < 0, 1::-1]
    outer = _boundary_facets(at, corners, where)
    _require_no_hanging_points(at, outer, where)
    return Mesh(at, corners, _matched(at, corners, outer, named, where))


def determinants(at: Array, corners: Ints) -> Array:
    """Determinants of the edges of each element from its first corner: d! times its volume, with its sign."""
    return np.asarray(np.linalg.det(at[corners[:, 1:]] - at[corners[:, :1]]))


def volumes(mesh: Mesh) -> Array:
    """Volume of each element; its area in two dimensions."""
    return determinants(mesh.at, mesh.corners) / (2 if mesh.dimension == 2 else 6)


def facet_normals(at: Array, facets: Ints) -> Array:
    """Normals of facets as long as the facets are large, shape (facets, d): outwards for those of a mesh's boundary."""
    edges = at[facets[:, 1:]] - at[facets[:, :1]]
    if at.shape[1] == 2:
        return np.stack([edges[:, 0, 1], -edges[:, 0, 0]], axis=1)
    return np.asarray(np.cross(edges[:, 0], edges[:, 1])) / 2


def all_facets(corners: Ints) -> Ints:
    """Facets of all elements, an element's after another's, each opposite to a corner; (elements (d + 1), d)."""
    d = corners.shape[1] - 1
    return corners[:, np.array(FACETS[d])].reshape(-1, d)


def grouped(rows: Ints) -> tuple[Ints, Ints]:
    """Which rows are equal.

    Parameters
    ----------
    rows : array of int, shape (n, k)

    Returns
    -------
    first : array of int
        Number of the first of each group of equal rows; groups in the order of their rows' values.
    group : array of int, shape (n,)
        Group of each row.
    """
    order = np.lexsort(rows.T[::-1])
    new = np.ones(len(rows), dtype=bool)
    new[1:] = (rows[order[1:]] != rows[order[:-1]]).any(axis=1)
    group = np.empty(len(rows), dtype=np.int64)
    group[order] = np.cumsum(new) - 1
    return order[new], group


def owners(mesh: Mesh, facets: Ints) -> Ints:
    """Element of which each facet of the boundary is a side."""
    every = np.sort(all_facets(mesh.corners), axis=1)
    _, group = grouped(np.concatenate([every, np.sort(facets, axis=1)]))
    element = np.empty(group.max(initial=0) + 1, dtype=np.int64)
    element[group[: len(every)]] = np.arange(len(every)) // mesh.corners.shape[1]
    return element[group[len(every) :]]


def _arrays(at: Array, corners: Ints, where: str) -> tuple[Array, Ints]:
    at, corners = np.array(at, dtype=float), np.array(corners, dtype=np.int64)
    if at.ndim != 2 or at.shape[1] not in FACETS:
        raise SceneError(f"{where}: points have 2 or 3 coordinates, in an array of shape (points, d), not {at.shape}")
    if corners.ndim != 2 or corners.shape[1] != at.shape[1] + 1 or not len(corners):
        raise SceneError(
            f"{where}: elements have {at.shape[1] + 1} corners in {at.shape[1]} dimensions, in an array of shape "
            f"(elements, {at.shape[1] + 1}), not {corners.shape}"
        )
    if not np.isfinite(at).all():
        raise SceneError(f"{where}: point {int(np.argmin(np.isfinite(at).all(axis=1)))} is not finite")
    _require_points(corners, len(at), f"{where}: corners of the elements")
    return at, corners


def _require_points(numbers: Ints, count: int, what: str) -> None:
    if numbers.size and not 0 <= numbers.min() <= numbers.max() < count:
        raise SceneError(f"{what} name points from {numbers.min()} to {numbers.max()}, and there are {count}, from 0")


def _facets(name: str, facets: Ints, points: int, d: int, where: str) -> Ints:
    found = np.array(facets, dtype=np.int64)
    if not found.size:
        raise SceneError(f"{where}: no facet has the name {name!r}: leave it out, or name some")
    if found.ndim != 2 or found.shape[1] != d:
        raise SceneError(f"{where}: facets of {name!r} have {d} points each, not an array of shape {found.shape}")
    _require_points(found, points, f"{where}: facets of {name!r}")
    return found


def _used(at: Array, corners: Ints, named: dict[str, Ints], where: str) -> tuple[Array, Ints, dict[str, Ints]]:
    """Leave out the points that no element has, such as the centres of circles that a mesh was made of."""
    used = np.zeros(len(at), dtype=bool)
    used[corners] = True
    if used.all():
        return at, corners, named
    for name, facets in named.items():
        loose = ~used[facets].all(axis=1)
        if loose.any():
            raise SceneError(
                f"{where}: {_counted(loose.sum(), 'facet')} of {name!r} at points that no element has, "
                f"{_places(at[facets[loose]].mean(axis=1))}: an element is missing there, or the facet is none"
            )
    new = np.cumsum(used) - 1
    return at[used], new[corners], {name: new[facets] for name, facets in named.items()}


def _longest_edges(at: Array, corners: Ints) -> Array:
    n = corners.shape[1]
    pairs = [(i, j) for i in range(n) for j in range(i + 1, n)]
    lengths = [np.linalg.norm(at[corners[:, j]] - at[corners[:, i]], axis=1) for i, j in pairs]
    return np.asarray(np.max(lengths, axis=0))


def _odd(rows: Ints) -> NDArray[np.bool_]:
    """Whether an odd number of exchanges sorts each row of two or three."""
    swaps = (rows[:, 0] > rows[:, 1]).astype(int)
    if rows.shape[1] == 3:
        swaps += (rows[:, 0] > rows[:, 2]).astype(int) + (rows[:, 1] > rows[:, 2]).astype(int)
    return np.asarray(swaps % 2 == 1)


def _boundary_facets(at: Array, corners: Ints, where: str) -> Ints:
    """Facets of one element alone, with outward normals."""
    every = all_facets(corners)
    first, group = grouped(np.sort(every, axis=1))
    count = np.bincount(group)
    many = count > 2
    if many.any():
        raise SceneError(
            f"{where}: {_counted(many.sum(), 'facet')} shared by three elements or more, "
            f"{_places(at[every[first[many]]].mean(axis=1))}: elements overlap, or are there twice"
        )
    odd = np.bincount(group, weights=_odd(every))
    folded = (count == 2) & (odd != 1)
    if folded.any():
        raise SceneError(
            f"{where}: elements on both sides of {_counted(folded.sum(), 'facet')} overlap, "
            f"{_places(at[every[first[folded]]].mean(axis=1))}: one of them is inverted; move its points, or make the "
            "mesh anew"
        )
    return np.asarray(every[first[count == 1]])


def _require_no_hanging_points(at: Array, outer: Ints, where: str) -> None:
    """Refuse points on a facet of the boundary that are none of its corners: there two elements meet one."""
    from scipy.spatial import cKDTree

    points = np.unique(outer)
    middle = at[outer].mean(axis=1)
    radius = np.linalg.norm(at[outer] - middle[:, None], axis=2).max(axis=1)
    tree = cKDTree(at[points])
    near = tree.query_ball_point(middle, radius * (1 + ON_FACET))
    facet = np.repeat(np.arange(len(outer)), [len(found) for found in near])
    point = points[np.concatenate([np.array(found, dtype=np.int64) for found in near])]
    corner = at[outer[facet]]
    apart = np.linalg.norm(corner - at[point][:, None], axis=2) > ON_FACET * radius[facet, None]
    facet, point, corner = facet[apart.all(axis=1)], point[apart.all(axis=1)], corner[apart.all(axis=1)]
    # the point by its coordinates along the facet's edges, and what is left
    edges = np.swapaxes(corner[:, 1:] - corner[:, :1], 1, 2)
    across = np.swapaxes(edges, 1, 2)
    along = np.linalg.solve(across @ edges, across @ (at[point] - corner[:, 0])[:, :, None])
    off = np.linalg.norm((edges @ along)[:, :, 0] - (at[point] - corner[:, 0]), axis=1)
    inside = (along[:, :, 0] > -ON_FACET).all(axis=1) & (along[:, :, 0].sum(axis=1) < 1 + ON_FACET)
    hanging = np.unique(point[inside & (off < ON_FACET * radius[facet])])
    if len(hanging):
        raise SceneError(
            f"{where}: {_counted(len(hanging), 'point')} on a facet without being its corner, {_places(at[hanging])}: "
            "split the element there, so that each facet is that of both its elements"
        )


def _matched(at: Array, corners: Ints, outer: Ints, named: dict[str, Ints], where: str) -> dict[str, Ints]:
    """Named facets as they are sides of elements; all facets of the boundary must have one name."""
    none = np.empty((0, outer.shape[1]), dtype=np.int64)
    given = np.concatenate([none, *(np.sort(facets, axis=1) for facets in named.values())])
    names = list(named)
    label = np.repeat(np.arange(len(names)), [len(facets) for facets in named.values()])
    first, group = grouped(np.concatenate([np.sort(outer, axis=1), given]))
    own, other = group[: len(outer)], group[len(outer) :]
    facet_of = np.full(len(first), -1)
    facet_of[own] = np.arange(len(outer))
    found = facet_of[other]
    for number, name in enumerate(names):
        lost = given[(label == number) & (found < 0)]
        if len(lost):
            raise SceneError(
                f"{where}: {_counted(len(lost), 'facet')} of {name!r} not on the boundary of the fluid, "
                f"{_places(at[lost].mean(axis=1))}: leave out names of what lies inside"
            )
    name_of = np.full(len(outer), -1)
    name_of[found] = label
    twice = found[name_of[found] != label]
    if len(twice):
        both = sorted({names[k] for k in label[found == twice[0]]})
        raise SceneError(
            f"{where}: {_counted(len(twice), 'facet')} in {' and in '.join(map(repr, both))}, "
            f"{_places(at[outer[twice]].mean(axis=1))}: give each part of the boundary one name"
        )
    bare = name_of < 0
    if bare.any():
        raise SceneError(_unnamed(at, outer[bare], names, where))
    return {name: outer[name_of == number] for number, name in enumerate(names)}


def _unnamed(at: Array, facets: Ints, names: list[str], where: str) -> str:
    from scipy.spatial import cKDTree

    double = cKDTree(at[np.unique(facets)]).query_pairs(ON_FACET * np.ptp(at, axis=0).max())
    remedy = (
        "points are there twice: merge those of the parts that the mesh was put together from"
        if double
        else f"name them ({', '.join(map(repr, names)) if names else 'nothing has a name'} so far)"
    )
    bare = _counted(len(facets), "facet")
    return f"{where}: {bare} of the boundary without a name, {_places(at[facets].mean(axis=1))}: {remedy}"


def _counted(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"


def place(point: Array) -> str:
    """A point, for a message."""
    return f"({', '.join(f'{x:.4g}' for x in point)})"


def _places(points: Array) -> str:
    more = f" and {len(points) - SHOWN} more" if len(points) > SHOWN else ""
    return "at " + ", ".join(place(point) for point in points[:SHOWN]) + more


def periods_of(mesh: Mesh, pairs: Iterable[tuple[str, str]]) -> dict[int, float]:
    """Axes along which a mesh repeats itself, and how far, from its pairs of periodic boundaries."""
    found = {}
    for pair in pairs:
        one, other = (mesh.at[np.unique(mesh.boundaries[name])].min(axis=0) for name in pair)
        axis = int(np.argmax(np.abs(other - one)))
        found[axis] = float(abs(other - one)[axis])
    return found
