"""The filter between grains and mesh: no volume is lost, and its shape is not that of the mesh."""

from __future__ import annotations

import math

import numpy as np
import pytest

from softdyn.errors import SceneError
from softdyn.fluid.built_meshes import box_mesh
from softdyn.fluid.mesh import Mesh, place
from softdyn.fluid.numbering import nodes_of
from softdyn.suspension.filter import Filter, filter_of, gathered, require_inside, spread, spread_flux, weights_at


def box(sides: tuple[float, ...], cells: tuple[int, ...], width: float, *pairs: tuple[str, str]) -> Filter:
    mesh = box_mesh(sides, cells)
    return filter_of(mesh, nodes_of(mesh, 1, pairs), width, pairs)


@pytest.mark.parametrize("d", [2, 3])
def test_no_volume_is_lost_at_walls_corners_and_through_periodic_boundaries(d: int) -> None:
    """Grains anywhere, on corners too; in elements much smaller and much larger than they are."""
    random = np.random.default_rng(1)
    for cells in ((4, 5, 4)[:d], (12, 9, 7)[:d]):
        one = box((2.0, 1.5, 1.7)[:d], cells, 0.4, ("left", "right"))
        x = random.uniform(0, 1, (50, d)) * (2.0, 1.5, 1.7)[:d]
        x[0], x[1], x[2, 1] = 0.0, (2.0, 1.5, 1.7)[:d], 1.5
        x[3:5, 0] += 6.0  # three periods on
        amounts = random.uniform(1e-4, 1e-2, 50)
        weights, lost = weights_at(one, x)
        found = spread(one, weights, amounts)
        assert not len(lost)
        assert found.min() > 0
        assert one.mass @ found == pytest.approx(amounts.sum(), rel=1e-12, abs=0)
        # the way back is the same: amounts times filtered values, and the field times a field
        field = random.uniform(-1, 1, one.nodes.count)
        back = gathered(one, weights, one.mass * field)
        assert amounts @ back == pytest.approx(float(one.mass * found @ field), rel=1e-11, abs=1e-13)
        assert gathered(one, weights, one.mass) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("cells", [10, 16, 32])
def test_the_width_is_that_asked_for_on_every_mesh(cells: int) -> None:
    """Variance of a grain's share along each axis, in the middle of a box that is ten widths wide."""
    one = box((10.0, 10.0), (cells, cells), 1.0)
    weights, _ = weights_at(one, np.array([[5.1, 4.87]]))
    share = spread(one, weights, np.ones(1)) * one.mass
    # linear shape functions add at most a quarter of a cell's square
    for axis, centre in enumerate((5.1, 4.87)):
        variance = share @ (one.nodes.at[:, axis] - centre) ** 2
        assert variance == pytest.approx(1.0, abs=0.01 + 0.25 * (10 / cells) ** 2)
    if cells == 32:
        # exp(-r/l)-like: r/l K_1(r/l)/(4 pi l^2) with l = width/2, whose value at 0 is 1/(4 pi l^2)
        assert share.max() / one.mass[0:].max() == pytest.approx(1 / (4 * math.pi * 0.25), rel=0.1)


def share_that_moves(cells: int, start: np.ndarray, end: np.ndarray) -> tuple[float, float, float]:
    """Integrals of a smooth field times what a share changes by as a grain moves, and what its flux says of that.

    The flux as it is, and as it would be if vectors were spread as shares are.
    """
    one = box((2.0, 1.5), (cells, cells), 0.3)
    at = one.nodes.at
    field = np.cos(at[:, 0] + 0.3) * np.cos(at[:, 1] + 0.2)
    slope = np.stack(
        [-np.sin(at[:, 0] + 0.3) * np.cos(at[:, 1] + 0.2), -np.cos(at[:, 0] + 0.3) * np.sin(at[:, 1] + 0.2)], axis=1
    )
    change = [one.mass * field @ spread(one, weights_at(one, x[None])[0], np.ones(1)) for x in (start, end)]
    parts, told, even = 40, 0.0, 0.0
    for k in range(parts):
        weights, _ = weights_at(one, (start + (end - start) * (k + 0.5) / parts)[None])
        amount = (end - start)[None] / parts
        told += float(np.sum(one.mass[:, None] * slope * spread_flux(one, weights, amount)))
        even += float(np.sum(one.mass[:, None] * slope * spread(one, weights, amount)))
    return float(change[1] - change[0]), told, even


@pytest.mark.parametrize(
    ("start", "end"), [((0.1, 0.7), (0.7, 0.9)), ((0.05, 0.1), (0.4, 0.3)), ((1.9, 0.2), (1.95, 0.9))]
)
def test_the_share_falls_by_the_divergence_of_the_flux(start: tuple[float, float], end: tuple[float, float]) -> None:
    """Away from a wall, out of a corner, along a wall: the more, the finer the mesh."""
    errors = []
    for cells in (20, 80):
        change, told, even = share_that_moves(cells, np.array(start), np.array(end))
        errors.append(abs(told / change - 1))
    # ends of the way are interpolated, so that errors go to and fro below the second order
    assert errors[1] < 0.3 * errors[0] < 0.01
    if start[0] < 1:  # what is spread evenly goes through the wall
        assert abs(even / change - 1) > 0.1


def test_no_flux_of_the_grains_goes_through_a_boundary_however_it_stands() -> None:
    """Grains that move in all directions next to walls and corners of a box, and of the same box turned round."""
    random = np.random.default_rng(3)
    mesh = box_mesh((2.0, 1.5), (10, 8))
    turn = np.array([[math.cos(math.pi / 6), -0.5], [0.5, math.cos(math.pi / 6)]])
    turned = Mesh(mesh.at @ turn.T, mesh.corners, mesh.boundaries)
    x, v = random.uniform(0, 1, (20, 2)) * (2.0, 1.5), random.uniform(-1, 1, (20, 2))
    found = []
    for one, way in ((mesh, np.eye(2)), (turned, turn)):
        nodes = nodes_of(one, 1)
        made = filter_of(one, nodes, 0.4)
        weights, _ = weights_at(made, x @ way.T)
        found.append(spread_flux(made, weights, v @ way.T) @ way)
        for name, axis in (("left", 0), ("right", 0), ("bottom", 1), ("top", 1)):
            assert np.abs(found[-1][np.unique(nodes.facets[name]), axis]).max() < 1e-14
    assert found[1] == pytest.approx(found[0], abs=1e-12)
    # far from walls vectors and shares are spread alike
    far = box((2.0, 1.5), (20, 15), 0.16)
    weights, _ = weights_at(far, np.array([[1.0, 0.75]]))
    flux, plain = spread_flux(far, weights, np.array([[1.0, -2.0]])), spread(far, weights, np.array([[1.0, -2.0]]))
    assert flux == pytest.approx(plain, abs=2e-3 * np.abs(plain).max())


def test_what_the_filter_cannot_do_is_refused() -> None:
    with pytest.raises(SceneError, match=r"width = 6: the filter is wider than half the fluid.*10"):
        box((10.0, 12.0), (8, 8), 6.0)
    with pytest.raises(SceneError, match=r"width = 0.1: the mesh does not resolve.*a width of 1.25 at least"):
        box((10.0, 10.0), (8, 8), 0.1)
    one = box((10.0, 10.0), (10, 10), 1.0)
    x = np.array([[5.0, 5.0], [11.0, 5.0], [5.0, -1.0]])
    with pytest.raises(SceneError, match=r"grain 1 is at \(11, 5\), outside of the mesh, and 1 more"):
        require_inside(x, weights_at(one, x)[1])
    assert place(x[0]) == "(5, 5)"
