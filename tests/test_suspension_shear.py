"""A sheared suspension has the viscosity that its closure says."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import softdyn
from softdyn.fluid import Boundary, MeshSection
from softdyn.particles.packing import random_packing
from softdyn.rheology.measured_runs import measured_flow
from softdyn.scene.stock_scenes import suspension_scenes
from softdyn.suspension import SuspensionResult, SuspensionScene, simulate
from softdyn.suspension.stresses import mean_stresses, told_stresses
from softdyn.suspension.suspension_run import made_ready

#: Diameters between the walls, which move at half of it, against each other.
SIDE = 6.0


def sheared(phi: float, cells: int, grain_density: float, dt: float, **more: object) -> SuspensionScene:
    """Spheres of diameter 1 at random places between two walls, moving as these do, without contacts."""
    count = round(phi * SIDE**3 / (math.pi / 6))
    x, _, lengths = random_packing(count=count, dimension=3, fraction=phi, seed=1, radii=[0.5])
    x = np.asarray(x) * SIDE / float(lengths[0]) % SIDE
    x[:, 1] = np.clip(x[:, 1], 0.1, SIDE - 0.1)
    v = np.zeros_like(x)
    v[:, 0] = x[:, 1] - SIDE / 2
    return SuspensionScene(
        viscosity=1.0, elements="P1-P1", mesh=MeshSection(box=[SIDE] * 3, cells=[cells] * 3), positions=x, velocities=v,
        boundary=[
            Boundary(["left", "right"], periodic=True), Boundary(["front", "back"], periodic=True),
            Boundary("top", velocity=[SIDE / 2, 0, 0]), Boundary("bottom", velocity=[-SIDE / 2, 0, 0]),
        ],
        radii=0.5, grain_density=grain_density, drag="dallavalle_di_felice", width=1.5, mixture="batchelor",
        parameters={"B": 5.2}, until_t=4 * dt, dt=dt, times=2, **more,
    )  # fmt: skip


def stress_over_closure(scene: SuspensionScene, result: SuspensionResult) -> tuple[float, float]:
    """Stress on the two walls at the end over that of the closure at the mean fraction, at the shear rate 1."""
    mixture = made_ready(scene).mixture
    assert mixture is not None
    phi = len(result.radii) * math.pi / 6 / SIDE**3
    viscosity = float(mixture.viscosity(np.array(phi)))
    forces = -result.force_top[-1, 0], result.force_bottom[-1, 0]
    return forces[0] / SIDE**2 / viscosity, forces[1] / SIDE**2 / viscosity


@pytest.mark.parametrize(
    ("phi", "cells", "grain_density", "dt"),
    [
        (0.2, 6, 0.01, 0.25),
        pytest.param(0.1, 6, 0.01, 0.25, marks=pytest.mark.slow),
        pytest.param(0.3, 6, 0.01, 0.25, marks=pytest.mark.slow),
        pytest.param(0.4, 6, 0.01, 0.25, marks=pytest.mark.slow),
        pytest.param(0.4, 9, 0.01, 0.25, marks=pytest.mark.slow),
        pytest.param(0.2, 6, 1e-4, 0.25, marks=pytest.mark.slow),
        pytest.param(0.2, 6, 0.01, 0.02, marks=pytest.mark.slow),
        pytest.param(0.2, 6, 1.0, 0.25, marks=pytest.mark.slow),
    ],
)
def test_the_viscosity_is_that_of_the_closure(phi: float, cells: int, grain_density: float, dt: float) -> None:
    """Within 2 % at every fraction, on every mesh, however fast grains follow the fluid, in short steps and long.

    Of steps that are shorter than grains need to follow the fluid, four are long enough, for grains start in place.
    """
    scene = sheared(phi, cells, grain_density, dt)
    result = simulate(scene)
    assert stress_over_closure(scene, result) == pytest.approx((1.0, 1.0), abs=0.02)
    kinds = ("mass", "momentum", "volume", "exchange")
    assert all(float(result.arrays[f"{kind}_imbalance"].max()) < 1e-12 for kind in kinds)
    # along the walls fluid and grains together move as these do
    mixed = (result.u + result.us)[-1]
    for y, speed in ((SIDE, SIDE / 2), (0.0, -SIDE / 2)):
        own = np.abs(result.u_at[:, 1] - y) < 1e-9
        assert mixed[own, 0] == pytest.approx(speed, abs=1e-12)
        assert np.abs(result.us[-1][own, 1]).max() < 1e-13


@pytest.mark.slow
def test_the_stock_scene_has_the_stress_of_its_closure_on_walls_and_within(tmp_path: Path) -> None:
    """With errors by blocks, that are told, too, and go into tables; of results that were saved as well."""
    scene = softdyn.read_scene(suspension_scenes()["shear_suspension"])
    assert isinstance(scene, SuspensionScene)
    result = softdyn.load_result(simulate(scene).save(tmp_path / "shear.npz"))
    assert isinstance(result, SuspensionResult)
    phi = len(result.radii) * math.pi / 6 / SIDE**3
    expected = 1 + 2.5 * phi + 5.2 * phi**2
    found = mean_stresses(result)
    inside = found.means["fluid_stress_xy"]
    assert found.steady
    assert inside.value == pytest.approx(expected, rel=0.02)
    assert 0 < inside.error < 1e-3 * inside.value
    late = slice(found.start, None)
    for force in (-result.force_top[late, 0], result.force_bottom[late, 0]):
        assert force.mean() / SIDE**2 == pytest.approx(inside.value, rel=1e-3)
    assert found.means["grain_stress_xy"].value == 0
    assert "mean shear stress xy from t = " in told_stresses(result)
    assert " +- " in told_stresses(result)
    row, _ = measured_flow(result)
    assert row["fluid_stress_xy"] == pytest.approx(inside.value, rel=1e-3)
    assert 0 < row["fluid_stress_xy_error"] < 1e-3
    assert row["grain_drag_x_error"] >= 0
    # the picture has it
    titles = [axes.get_title(loc="left") for axes in result.plot(panels=["stress"]).axes]
    assert titles == ["mean shear stress"]
