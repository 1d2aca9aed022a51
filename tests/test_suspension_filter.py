"""The filter between grains and mesh: no volume is lost, and its shape is not that of the mesh."""

from __future__ import annotations

import math

import numpy as np
import pytest

from softdyn.errors import SceneError
from softdyn.fluid.built_meshes import box_mesh
from softdyn.fluid.mesh import place
from softdyn.fluid.numbering import nodes_of
from softdyn.suspension.filter import Filter, filter_of, gathered, require_inside, spread, weights_at


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
