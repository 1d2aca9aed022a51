"""The stock scenes of a fluid: what they give is what others have found, or what their equations say."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from softdyn.cli import main
from softdyn.fluid import FluidResult, FluidScene, simulate
from softdyn.fluid.fluid_scene import read_fluid_scene
from softdyn.fluid.locate import located, locator, sampled
from softdyn.scene.stock_scenes import fluid_scenes

#: Of the benchmark 2D-1: drag, lift, and difference of pressure before and behind the cylinder.
DRAG, LIFT, DROP = 5.57953523384, 0.010618948146, 0.11752016697


def stock(name: str) -> FluidScene:
    return read_fluid_scene(fluid_scenes()[name])


@cache
def flow(name: str) -> FluidResult:
    return simulate(stock(name))


def values(result: FluidResult, points: list[tuple[float, float]], frame: int = -1) -> np.ndarray:
    """Velocity at points."""
    found = located(locator(result.at, result.corners), np.array(points))
    return sampled(result.u[frame], result.u_nodes, *found)


def coarser(scene: FluidScene) -> FluidScene:
    """The same scene on few cells."""
    mesh = scene.mesh
    if mesh.around is not None:
        return replace(scene, mesh=replace(mesh, around=16))
    assert mesh.cells is not None
    return replace(scene, mesh=replace(mesh, cells=[max(4, n // 6) for n in mesh.cells]))


def test_there_are_those_that_the_page_names() -> None:
    assert set(fluid_scenes()) == {"cavity", "cylinder", "cylinder_shedding", "bed", "channel", "darcy"}


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    ["cavity", "channel", *(pytest.param(name, marks=pytest.mark.slow) for name in ("cylinder", "bed", "darcy"))],
)
def test_each_runs_on_few_cells_and_has_a_picture(name: str) -> None:
    scene = coarser(stock(name))
    if name == "cavity":
        scene = replace(scene, viscosity=1e-2)
    result = simulate(scene)
    assert result.mass_imbalance.max() < 1e-10
    assert result.momentum_imbalance.max() < 1e-10
    titles = [axes.get_title(loc="left") for axes in result.plot().axes]
    assert "pressure" in titles
    assert ("porosity" in titles) == (scene.bed is not None)


@pytest.mark.slow
def test_what_flows_in_evenly_flows_out_whole() -> None:
    result = simulate(coarser(stock("channel")))
    assert result.flux_left[-1] == pytest.approx(-1, rel=1e-12)
    assert result.flux_right[-1] == pytest.approx(1, rel=1e-12)


@pytest.mark.slow
def test_the_profile_of_a_channel_becomes_a_parabola() -> None:
    """Of mean 1: 6 y (1 - y), and the pressure falls by 12 eta a length."""
    result = flow("channel")
    y = np.linspace(0.05, 0.95, 19)
    found = values(result, [(7.5, one) for one in y])
    assert found[:, 0] == pytest.approx(6 * y * (1 - y), rel=2e-3)
    assert np.abs(found[:, 1]).max() < 1e-3
    p = {x: float(result.p[-1][np.argmin(np.hypot(*(result.p_at - [x, 0.5]).T))]) for x in (7.0, 8.0)}
    assert p[7.0] - p[8.0] == pytest.approx(0.12, rel=0.1)


@pytest.mark.slow
def test_the_cylinder_at_re_20_has_the_drag_the_lift_and_the_pressure_of_the_benchmark() -> None:
    result = flow("cylinder")
    drag, lift = 500 * result.force_cylinder[-1]
    assert drag == pytest.approx(DRAG, rel=1e-4)
    assert lift == pytest.approx(LIFT, rel=1e-3)
    # at the corners of the polygon that stand for (0.15, 0.2) and (0.25, 0.2)
    ends = [int(np.argmin(np.hypot(*(result.p_at - [x, 0.2]).T))) for x in (0.15, 0.25)]
    assert result.p[-1][ends[0]] - result.p[-1][ends[1]] == pytest.approx(DROP, rel=1e-3)


@pytest.mark.slow
def test_a_bed_takes_the_pressure_that_its_closure_says() -> None:
    """Against the integral of the drag on the grains of each slice, over the length: the closure is evaluated apart."""
    from sympy import lambdify

    from softdyn.derive.closure import Re, c, eta, r, rho, slip
    from softdyn.laws import law_or_closure_of

    scene, result = stock("bed"), flow("bed")
    assert scene.bed is not None
    radius = float(scene.bed.radius or math.nan)
    x = (np.arange(20_000) + 0.5) / 20_000 * 0.04
    porosity = 1 - 0.6 * smoothstep(x, 0.008, 0.014) * (1 - smoothstep(x, 0.026, 0.032))
    speed = 0.01 / porosity
    closure = law_or_closure_of("dallavalle_di_felice").expression
    force = lambdify([Re, c, slip, r, rho, eta], closure * slip)(
        2 * radius * scene.density * speed / scene.viscosity, porosity, speed, radius, scene.density, scene.viscosity
    )
    # grad p = -(drag per volume of the bed)/c; what the flow gains in speed it loses again
    per_volume = force * (1 - porosity) / (4 / 3 * math.pi * radius**3)
    drop = float(np.sum(per_volume / porosity)) * 0.04 / len(x)
    left = result.p_at[:, 0] == 0
    assert result.p[-1][left].mean() == pytest.approx(drop, rel=0.02)
    assert result.flux_right[-1] == pytest.approx(0.01 * 0.01, rel=0.02)


def smoothstep(x: np.ndarray, low: float, high: float) -> np.ndarray:
    part = np.clip((x - low) / (high - low), 0, 1)
    return part**2 * (3 - 2 * part)


@pytest.mark.slow
def test_what_seeps_through_sand_is_the_same_in_each_section_and_follows_darcys_law() -> None:
    """Twice the pressure drives a little less than twice the flux: Ergun's drag has inertia."""
    result = flow("darcy")
    y = (np.arange(400) + 0.5) / 400 * 0.05
    through = [0.05 * values(result, [(x, one) for one in y])[:, 0].mean() for x in (0.01, 0.03, 0.05, 0.09)]
    assert through == pytest.approx([float(result.flux_right[-1])] * 4, rel=0.01)
    scene = stock("darcy")
    left = replace(scene.boundary[0], pressure=1.0)
    creeping = simulate(replace(scene, boundary=[left, *scene.boundary[1:]]))
    ratio = float(result.flux_right[-1] / creeping.flux_right[-1])
    assert 700 < ratio < 1000


@pytest.mark.slow
def test_vortices_part_from_the_cylinder_at_re_100_as_often_as_in_the_benchmark() -> None:
    """Strouhal number 0.30, largest drag 3.23 and lift 1 of 2D-2: nearly so on fewer cells than the scene has."""
    scene = stock("cylinder_shedding")
    result = simulate(replace(scene, mesh=replace(scene.mesh, around=40), times=3))
    late = result.step_t > 4.5
    t, lift, drag = result.step_t[late], 20 * result.force_cylinder[late, 1], 20 * result.force_cylinder[late, 0]
    up = np.flatnonzero((lift[:-1] < 0) & (lift[1:] >= 0))
    crossings = t[up] - lift[up] * (t[up + 1] - t[up]) / (lift[up + 1] - lift[up])
    # 0.292, 3.14 and 0.87
    assert 0.285 < 0.1 / float(np.diff(crossings).mean()) < 0.31
    assert 3.1 < drag.max() < 3.3
    assert 0.85 < lift.max() < 1.1


@pytest.mark.slow
def test_a_stock_scene_runs_by_its_name_and_has_a_picture_and_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["run", "channel", "-o", "run.npz"]) == 0
    assert "flux out" in capsys.readouterr().out
    assert main(["plot", "run.npz"]) == 0
    assert main(["convert", "run.npz", "-o", "run.pvd"]) == 0
    assert Path("run.png").stat().st_size > 10_000
    assert Path("run.pvd").exists()
