"""Elements that contain points: every point of the fluid is found, none outside, and fields have their values there."""

from __future__ import annotations

import numpy as np
import pytest

from softdyn.fluid import locate
from softdyn.fluid.built_meshes import box_mesh, cylinder_mesh
from softdyn.fluid.locate import located, locator, sampled
from softdyn.fluid.mesh import Mesh
from softdyn.fluid.numbering import nodes_of

MESHES = {
    "plane": box_mesh((2, 1), (7, 5), finer_at=["left", "top"], ratio=200),
    "cylinder": cylinder_mesh(around=32),
    "space": box_mesh((2, 1, 0.5), (5, 4, 3), finer_at=["left"], ratio=50),
}


@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES)
@pytest.mark.parametrize("together", [50, 1_000_000])
def test_points_are_found_in_the_elements_that_they_were_made_in(
    mesh: Mesh, together: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(locate, "TOGETHER", together)
    rng = np.random.default_rng(3)
    own = rng.integers(len(mesh.corners), size=500)
    shares = rng.dirichlet(np.ones(mesh.dimension + 1), size=500)
    points = np.einsum("nk,nkd->nd", shares, mesh.at[mesh.corners[own]])
    element, found = located(locator(mesh.at, mesh.corners), points)
    assert (element == own).all()
    assert found == pytest.approx(shares, abs=1e-9)


@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES)
def test_all_points_of_the_mesh_are_inside_and_those_outside_in_no_element(mesh: Mesh) -> None:
    grid = locator(mesh.at, mesh.corners)
    element, shares = located(grid, mesh.at)
    assert (element >= 0).all()
    assert shares.min() > -1e-9
    low, high = mesh.at.min(axis=0), mesh.at.max(axis=0)
    outside = np.array([low - 1e-3, high + 1e-3, high + 1e9, np.full(mesh.dimension, np.nan)])
    element, shares = located(grid, outside)
    assert (element == -1).all()
    assert np.isnan(sampled(np.ones(len(mesh.at)), mesh.corners, element, shares)).all()


def test_a_point_within_the_cylinder_is_in_no_element() -> None:
    """It is a polygon of the circle's area, with corners a little outside of the circle, and sides inside."""
    mesh = MESHES["cylinder"]
    radius = max(np.linalg.norm(mesh.at[np.unique(mesh.boundaries["cylinder"])] - 0.2, axis=1))
    points = np.array([[0.2, 0.2], [0.2, 0.249], [0.2, 0.2 + 1.001 * radius]])
    element, _ = located(locator(mesh.at, mesh.corners), points)
    assert list(element >= 0) == [False, False, True]


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES)
def test_polynomials_of_the_order_of_the_nodes_are_exact(mesh: Mesh, order: int) -> None:
    nodes = nodes_of(mesh, order)
    rng = np.random.default_rng(4)
    a, b = rng.normal(size=(2, mesh.dimension))

    def field(x: np.ndarray) -> np.ndarray:
        return np.stack([1 + (x @ a) ** order, x @ b], axis=1)

    own = rng.integers(len(mesh.corners), size=100)
    points = np.einsum("nk,nkd->nd", rng.dirichlet(np.ones(mesh.dimension + 1), 100), mesh.at[mesh.corners[own]])
    found = sampled(field(nodes.at), nodes.of, *located(locator(mesh.at, mesh.corners), points))
    assert found == pytest.approx(field(points), rel=1e-9)
