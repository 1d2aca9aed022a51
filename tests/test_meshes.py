"""Meshes of the fluid: what is built in has the volumes, boundaries and nodes that it says; wrong ones are refused."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softdyn.errors import SceneError
from softdyn.fluid.built_meshes import box_mesh, cylinder_mesh, graded
from softdyn.fluid.mesh import Array, Ints, Mesh, facet_normals, mesh_of, owners, volumes
from softdyn.fluid.numbering import nodes_of

BOXES = [((2.0, 1.0), (4, 3)), ((2.0, 1.0, 0.5), (4, 3, 5))]


def angles(mesh: Mesh) -> Array:
    """Angles of triangles in degrees, shape (elements, 3)."""
    found = []
    for k in range(3):
        a, b = (mesh.at[mesh.corners[:, (k + j) % 3]] - mesh.at[mesh.corners[:, k]] for j in (1, 2))
        cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        found.append(np.degrees(np.arctan2(cross, np.sum(a * b, axis=1))))
    return np.stack(found, axis=1)


@pytest.mark.parametrize(("lengths", "cells"), BOXES)
def test_a_box_is_filled_and_each_side_has_its_area(lengths: tuple[float, ...], cells: tuple[int, ...]) -> None:
    mesh = box_mesh(lengths, cells, origin=[1.0] * len(lengths), finer_at=["left", "right", "top"], ratio=5)
    assert len(mesh.corners) == math.prod(cells) * math.factorial(len(cells))
    assert volumes(mesh).min() > 0
    assert math.isclose(volumes(mesh).sum(), math.prod(lengths), rel_tol=1e-13)
    assert mesh.at.min(axis=0) == pytest.approx(1.0)
    for axis, names in enumerate((("left", "right"), ("bottom", "top"), ("front", "back"))[: len(lengths)]):
        outwards = np.zeros(len(lengths))
        outwards[axis] = math.prod(lengths) / lengths[axis]
        for name, sign in zip(names, (-1, 1), strict=True):
            assert facet_normals(mesh.at, mesh.boundaries[name]).sum(axis=0) == pytest.approx(sign * outwards)


@pytest.mark.parametrize("mesh", [box_mesh((1, 1), (5, 4)), box_mesh((1, 1, 1), (3, 4, 2)), cylinder_mesh()])
def test_no_element_has_all_its_corners_on_the_boundary_but_in_a_cell_between_two_walls(mesh: Mesh) -> None:
    outer = np.unique(np.concatenate([facets.reshape(-1) for facets in mesh.boundaries.values()]))
    assert not np.isin(mesh.corners, outer).all(axis=1).any()


def test_cells_grow_by_the_ratio_asked_for() -> None:
    sizes = np.diff(graded(6, 8.0, True, False))
    assert sizes[1:] / sizes[:-1] == pytest.approx(8 ** (1 / 5))
    both = np.diff(graded(7, 8.0, True, True))
    assert both == pytest.approx(both[::-1])
    assert both.max() / both.min() == pytest.approx(8)
    assert np.diff(graded(4, 8.0, False, False)) == pytest.approx(0.25)


@pytest.mark.parametrize("around", [16, 64, 120])
def test_the_channel_with_a_cylinder_has_its_area_and_no_sharp_angle(around: int) -> None:
    mesh = cylinder_mesh(around=around)
    assert math.isclose(volumes(mesh).sum(), 2.2 * 0.41 - math.pi * 0.05**2, rel_tol=1e-13)
    on = mesh.at[np.unique(mesh.boundaries["cylinder"])]
    assert len(on) == around
    out = math.pi**2 / 3 / around**2
    assert np.linalg.norm(on - [0.2, 0.2], axis=1) == pytest.approx(0.05 * (1 + out), rel=2 * out**2)
    assert angles(mesh).min() > 30
    assert angles(mesh).max() < 104
    closed = sum(facet_normals(mesh.at, facets).sum(axis=0) for facets in mesh.boundaries.values())
    assert closed == pytest.approx(0, abs=1e-14)
    assert facet_normals(mesh.at, mesh.boundaries["inlet"]).sum(axis=0) == pytest.approx([-0.41, 0])
    # cells at the cylinder are as long as its circumference says, those across the channel as its height says
    edge = np.linalg.norm(np.diff(mesh.at[mesh.boundaries["cylinder"]], axis=1)[:, 0], axis=1)
    assert edge.max() < 2.2 * math.pi * 0.05 * 2 / around
    assert len(mesh.boundaries["outlet"]) == around // 4


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(
    length=st.floats(1.0, 10.0),
    height=st.floats(0.3, 3.0),
    x=st.floats(0.05, 0.95),
    y=st.floats(0.05, 0.95),
    size=st.floats(0.02, 0.9),
    around=st.sampled_from([16, 32, 48]),
)
def test_any_cylinder_inside_of_a_channel_is_meshed(
    length: float, height: float, x: float, y: float, size: float, around: int
) -> None:
    """Checked by mesh_of: no element is inverted, and each facet of the boundary has a name.

    Angles follow the narrowest place: a facet of the cylinder is seen from the wall under atan(facet/gap).
    """
    x, y = x * length, y * height
    radius = size * min(x, length - x, y, height - y)
    mesh = cylinder_mesh((length, height), (x, y), radius, around)
    assert math.isclose(volumes(mesh).sum(), length * height - math.pi * radius**2, rel_tol=1e-12)
    assert set(mesh.boundaries) == {"inlet", "outlet", "walls", "cylinder"}
    gap, facet = min(x, length - x, y, height - y) - radius, 2 * math.pi * radius / around
    assert angles(mesh).min() > math.degrees(math.atan2(gap, facet)) / 6


@pytest.mark.parametrize(("lengths", "cells"), BOXES)
def test_nodes_of_order_two_are_in_the_middles_of_edges(lengths: tuple[float, ...], cells: tuple[int, ...]) -> None:
    mesh = box_mesh(lengths, cells)
    d = mesh.dimension
    nodes = nodes_of(mesh, 2)
    pairs = [(i, j) for i in range(d + 1) for j in range(i + 1, d + 1)]
    for place, (i, j) in enumerate(pairs, d + 1):
        assert nodes.at[nodes.of[:, place]] == pytest.approx((nodes.at[nodes.of[:, i]] + nodes.at[nodes.of[:, j]]) / 2)
    # every node is of some element, and no two are at one place; Euler's formula counts the edges
    assert len(np.unique(nodes.of)) == nodes.count == len(np.unique(np.round(nodes.at, 9), axis=0))
    assert nodes.count == math.prod(2 * n + 1 for n in cells)
    for name, facets in mesh.boundaries.items():
        assert (nodes.facets[name][:, :d] == facets).all()
        middles = nodes.at[nodes.facets[name][:, d:]].mean(axis=1)
        assert middles == pytest.approx(mesh.at[facets].mean(axis=1))


@pytest.mark.parametrize(("lengths", "cells"), BOXES)
@pytest.mark.parametrize("order", [1, 2])
def test_a_box_periodic_along_all_axes_has_a_node_for_each_place_of_a_torus(
    lengths: tuple[float, ...], cells: tuple[int, ...], order: int
) -> None:
    mesh = box_mesh(lengths, cells)
    pairs = [("left", "right"), ("bottom", "top"), ("front", "back")][: len(lengths)]
    nodes = nodes_of(mesh, order, pairs)
    assert nodes.count == math.prod(order * n for n in cells)
    assert nodes.facets == {}
    spread = np.cos(2 * np.pi * mesh.at / lengths).sum(axis=1)
    assert np.cos(2 * np.pi * nodes.at / lengths).sum(axis=1)[nodes.points] == pytest.approx(spread)


def test_two_cells_around_a_period_keep_their_own_edges() -> None:
    """Two edges with the same ends, one through the inside and one through the period, are two."""
    nodes = nodes_of(box_mesh((1, 1), (2, 2)), 2, [("left", "right"), ("bottom", "top")])
    assert nodes.count == 16


@pytest.mark.parametrize(("lengths", "cells"), BOXES)
def test_each_facet_belongs_to_the_element_that_has_its_points(
    lengths: tuple[float, ...], cells: tuple[int, ...]
) -> None:
    mesh = box_mesh(lengths, cells)
    for facets in mesh.boundaries.values():
        element = owners(mesh, facets)
        assert all(set(facet) <= set(corners) for facet, corners in zip(facets, mesh.corners[element], strict=True))


def triangle_pair(**changed: Any) -> tuple[Array, Ints, dict[str, Ints]]:
    """A square of two triangles, as arrays of a mesh."""
    at = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    corners = np.array([[0, 1, 2], [0, 2, 3]])
    sides = {"left": [[3, 0]], "right": [[1, 2]], "bottom": [[0, 1]], "top": [[2, 3]]}
    given: dict[str, Any] = {"at": at, "corners": corners, "boundaries": sides} | changed
    return given["at"], given["corners"], {name: np.array(facets) for name, facets in given["boundaries"].items()}


def test_elements_and_facets_are_turned_whichever_way_they_are_given() -> None:
    at, corners, sides = triangle_pair(corners=np.array([[0, 2, 1], [0, 2, 3]]))
    mesh = mesh_of(at, corners, {name: facets[:, ::-1] for name, facets in sides.items()})
    assert volumes(mesh) == pytest.approx(0.5)
    assert facet_normals(mesh.at, mesh.boundaries["top"]) == pytest.approx(np.array([[0, 1]]))


def test_points_that_no_element_has_are_left_out() -> None:
    at, corners, sides = triangle_pair()
    far = np.concatenate([[[9.0, 9.0]], at])
    mesh = mesh_of(far, corners + 1, {name: facets + 1 for name, facets in sides.items()})
    assert (mesh.at == at).all()
    assert (mesh.corners == corners).all()


def hanging() -> Mapping[str, Any]:
    """Three triangles, the long side of one against two of the others."""
    at = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]])
    sides = {"walls": [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2], [0, 4], [4, 2]]}
    return {"at": at, "corners": np.array([[0, 1, 2], [0, 4, 3], [4, 2, 3]]), "boundaries": sides}


SQUARE = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
WRONG: dict[str, tuple[Mapping[str, Any], str]] = {
    "flat": (
        {"at": np.array([[0.0, 0], [1, 0], [2, 0], [0, 1]])},
        r"1 flat element, at \(1, 0\): move their points, or make the mesh anew",
    ),
    "inverted": (
        {"at": np.array([[0.0, 0], [1, 0], [1, 1], [0.9, 0.1]])},
        r"elements on both sides of 1 facet overlap, at \(0.5, 0.5\): one of them is inverted",
    ),
    "twice": (
        {"corners": np.array([[0, 1, 2], [0, 2, 3], [2, 0, 3]])},
        r"1 facet shared by three elements or more, at \(0.5, 0.5\)",
    ),
    "hanging": (hanging(), r"1 point on a facet without being its corner, at \(0.5, 0.5\): split the element there"),
    "unnamed": (
        {"boundaries": {"left": [[3, 0]], "right": [[1, 2]], "bottom": [[0, 1]]}},
        r"1 facet of the boundary without a name, at \(0.5, 1\): name them \('left', 'right', 'bottom' so far\)",
    ),
    "not merged": (
        {"at": np.concatenate([SQUARE, SQUARE[[0, 2]]]), "corners": np.array([[0, 1, 2], [4, 5, 3]])}
        | {"boundaries": {"left": [[3, 4]], "right": [[1, 2]], "bottom": [[0, 1]], "top": [[5, 3]]}},
        r"2 facets of the boundary without a name, at .*: points are there twice: merge those of the parts",
    ),
    "empty name": (
        {"boundaries": {"left": [[3, 0]], "hole": np.empty((0, 2))}},
        "no facet has the name 'hole': leave it out, or name some",
    ),
    "two names": (
        {"boundaries": {"walls": [[3, 0], [1, 2], [0, 1], [2, 3]], "top": [[3, 2]]}},
        r"1 facet in 'top' and in 'walls', at \(0.5, 1\): give each part of the boundary one name",
    ),
    "inside": (
        {"boundaries": {"cut": [[0, 2]], "walls": [[3, 0], [1, 2], [0, 1], [2, 3]]}},
        r"1 facet of 'cut' not on the boundary of the fluid, at \(0.5, 0.5\): leave out names of what lies inside",
    ),
    "facet of nothing": (
        {"at": np.concatenate([SQUARE, [[5.0, 5.0]]]), "boundaries": {"left": [[3, 4]]}},
        "1 facet of 'left' at points that no element has",
    ),
    "no such point": ({"corners": np.array([[0, 1, 7]])}, "corners of the elements name points from 0 to 7.* are 4"),
    "not finite": ({"at": np.array([[0.0, 0], [1, 0], [math.nan, 1], [0, 1]])}, "point 2 is not finite"),
    "not a simplex": ({"corners": np.array([[0, 1, 2, 3]])}, "elements have 3 corners in 2 dimensions"),
    "no elements": ({"corners": np.empty((0, 3))}, "elements have 3 corners"),
    "on a line": ({"at": np.zeros((4, 1))}, "points have 2 or 3 coordinates"),
}


@pytest.mark.parametrize("what", list(WRONG))
def test_what_is_wrong_with_a_mesh_is_named_with_its_place_and_remedy(what: str) -> None:
    changed, said = WRONG[what]
    with pytest.raises(SceneError, match=said):
        mesh_of(*triangle_pair(**changed), where="square")


def test_a_point_that_hangs_on_a_face_or_an_edge_of_a_tetrahedron_is_found() -> None:
    """One of two tetrahedra with a common face is split in two at the middle of an edge of that face."""
    at = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1], [0.5, 0.5, 0]])
    corners = np.array([[0, 1, 2, 3], [0, 1, 5, 4], [0, 5, 2, 4]])
    with pytest.raises(SceneError, match=r"1 point on a facet without being its corner, at \(0.5, 0.5, 0\)"):
        mesh_of(at, corners, {})


def test_a_wall_without_thickness_inside_of_the_fluid_is_a_boundary() -> None:
    """Two sides of a baffle, at the same places, are no hanging points and no unmerged parts where they have names."""
    at, corners, _ = triangle_pair(at=np.concatenate([SQUARE, SQUARE[[0, 2]]]))
    corners[1] = [4, 5, 3]
    walls = {"walls": np.array([[3, 4], [1, 2], [0, 1], [5, 3]]), "baffle": np.array([[0, 2], [4, 5]])}
    assert set(mesh_of(at, corners, walls).boundaries) == {"walls", "baffle"}


@pytest.mark.parametrize(
    ("periodic", "said"),
    [
        ([("left", "rigth")], "there is no boundary 'rigth'; there are"),
        ([("left", "right"), ("right", "top")], "boundary 'right' is given twice"),
        ([("left", "top")], "'left' and 'top' are not alike: 4 nodes and 5"),
        ([("inner", "outer")], "'inner' and 'outer' are not alike: the fluid does not go on"),
    ],
)
def test_boundaries_that_cannot_be_periodic_are_refused(periodic: list[tuple[str, str]], said: str) -> None:
    mesh = box_mesh((1, 1), (4, 3))
    if periodic[0][0] == "inner":
        bottom = mesh.boundaries["bottom"]
        rest = {name: facets for name, facets in mesh.boundaries.items() if name != "bottom"}
        order = np.argsort(mesh.at[bottom].mean(axis=1)[:, 0])
        mesh = mesh_of(mesh.at, mesh.corners, rest | {"inner": bottom[order[:2]], "outer": bottom[order[2:]]})
    with pytest.raises(SceneError, match=said):
        nodes_of(mesh, 1, periodic)


def test_a_boundary_that_was_moved_is_not_like_the_other() -> None:
    mesh = box_mesh((1, 1), (4, 3))
    at = mesh.at.copy()
    at[np.unique(mesh.boundaries["right"])[1], 1] += 0.05
    moved = mesh_of(at, mesh.corners, mesh.boundaries)
    with pytest.raises(SceneError, match=r"the node of 'left' at \(0, 0.3333\) has none of 'right' at \(1, 0.3333\)"):
        nodes_of(moved, 2, [("left", "right")])


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: box_mesh((1, 1), (4, 1)), "cells: at least 2 along each axis"),
        (lambda: box_mesh((1, -1), (4, 4)), "lengths must be positive"),
        (lambda: box_mesh((1, 1), (4, 4, 4)), "as many each"),
        (lambda: box_mesh((1, 1), (4, 4), ratio=0.5), "1 or larger"),
        (lambda: box_mesh((1, 1), (4, 4), finer_at=["front"]), "'front' is none of left, right, bottom, top"),
        (lambda: cylinder_mesh(radius=0.2), "must be inside of the channel"),
        (lambda: cylinder_mesh(around=18), "multiple of 4"),
    ],
)
def test_numbers_that_make_no_mesh_are_refused(make: Any, said: str) -> None:
    with pytest.raises(SceneError, match=said):
        make()
