"""Flows whose solutions are known, in space and in time, and what runs of them leave."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from sympy import lambdify
from threadpoolctl import threadpool_limits

import softdyn
from softdyn.cli import main
from softdyn.derive import closure as arguments
from softdyn.errors import IntegrationError, SceneError
from softdyn.fluid import Bed, Boundary, FluidResult, FluidScene, MeshSection, simulate
from softdyn.fluid.fluid_run import simulate_fluid
from softdyn.fluid.fluid_scene import fluid_scene_from
from softdyn.laws import law_or_closure_of
from softdyn.results.rerun import differences, run_again
from softdyn.scene.stock_scenes import fluid_scenes

Array = NDArray[np.float64]

#: Forces and fluxes close to this: see balances.
CLOSED = 1e-10


def box(cells: tuple[int, int], lengths: tuple[float, float] = (1.0, 1.0), **more: Any) -> MeshSection:
    return MeshSection(box=list(lengths), cells=list(cells), **more)


WALLS = Boundary(["bottom", "top"], velocity=[0.0, 0.0])


def closed(result: FluidResult) -> bool:
    return bool(result.mass_imbalance.max() < CLOSED and result.momentum_imbalance.max() < CLOSED)


@pytest.mark.slow
@pytest.mark.parametrize("elements", ["P2-P1", "P1-P1"])
def test_poiseuille_flow_has_its_forces_and_its_flux(elements: str) -> None:
    """A channel of height 1 and length 3, viscosity 0.5, 12 cells high, with u = 4 y (1 - y) let in."""
    scene = FluidScene(
        viscosity=0.5, density=2.0, elements=elements, mesh=box((12, 12), (3.0, 1.0)), steady=True,
        boundary=[WALLS, Boundary("left", velocity=["4*y*(1 - y)", 0]), Boundary("right", pressure=7.0)],
    )  # fmt: skip
    result = simulate(scene)
    exact, within = elements == "P2-P1", 1e-9 if elements == "P2-P1" else 0.05
    assert result.flux_right[-1] == pytest.approx(2 / 3, rel=within)
    # eta du/dy = 2 on each wall, and p falls by 2 eta 4 a length
    assert (result.force_bottom + result.force_top)[-1, 0] == pytest.approx(12.0, rel=within)
    left = result.p_at[:, 0] == 0
    assert result.p[-1][left] == pytest.approx(7 + 12.0, rel=2 * within)
    # of u' = 4 (1 - 2 y): eta times the mean of u'^2, 16/3, on 3
    assert result.dissipation[-1] == pytest.approx(0.5 * 16 / 3 * 3, rel=2 * within)
    assert closed(result)
    if exact:
        assert result.energy_imbalance[-1] < 1e-9
        y = result.u_at[:, 1]
        assert result.u[-1][:, 0] == pytest.approx(4 * y * (1 - y), abs=1e-10)


@pytest.mark.slow
def test_a_fluid_at_rest_carries_its_weight() -> None:
    walls = Boundary(["left", "right", "bottom", "top"], slip=True)
    scene = FluidScene(
        viscosity=0.1, density=3.0, gravity=[0.0, -2.0], mesh=box((5, 4), (2.0, 1.0)), boundary=[walls], steady=True
    )
    result = simulate(scene)
    assert np.abs(result.u).max() < 1e-12
    p = result.p[-1]
    assert p - p.mean() == pytest.approx(-6 * (result.p_at[:, 1] - result.p_at[:, 1].mean()), abs=1e-10)
    assert (result.force_bottom + result.force_top)[-1] == pytest.approx([0.0, -12.0], abs=1e-10)
    # each by itself is that of the pressure in the frames, whose mean is 0
    assert result.force_bottom[-1] == pytest.approx([0.0, -6.0], abs=1e-10)
    assert result.force_left[-1] == pytest.approx([0.0, 0.0], abs=1e-10)
    assert result.volume_force[-1] == pytest.approx([0.0, -12.0])
    assert closed(result)


def pressure_drop(closure: str, Re: float, c: float, radius: float) -> float:
    """Fall of the pressure over a length, by a closure's drag at a Reynolds number; viscosity and density are 1."""
    given = law_or_closure_of(closure)
    drag = lambdify([arguments.c, arguments.phi, arguments.Re, arguments.eta, arguments.r], given.expression, "math")
    slip = Re / (2 * radius)
    return float(drag(c, 1 - c, Re, 1.0, radius) * slip * (1 - c) / (4 / 3 * math.pi * radius**3) / c)


@pytest.mark.slow
@pytest.mark.parametrize("elements", ["P1-P1", "P2-P1"])
@pytest.mark.parametrize("cells", [2, 20])
@pytest.mark.parametrize(("Re", "c"), [(1e-12, 0.3), (1e-3, 0.9), (1e-3, 0.3), (1.0, 0.6), (1e4, 0.3), (1e8, 0.9)])
def test_a_fixed_bed_takes_what_its_closure_says(elements: str, cells: int, Re: float, c: float) -> None:
    """Grains of diameter 1, with so many cells of the mesh each, or so many of them in a cell: 2 and 1/20 a grain."""
    size = 1 / 2 if cells == 2 else 20
    U = c * Re
    scene = FluidScene(
        viscosity=1.0, density=1.0, elements=elements, mesh=box((8, 4), (8 * size, 4 * size)), steady=True,
        bed=Bed(porosity=c, drag="dallavalle_di_felice", radius=0.5),
        boundary=[
            Boundary("left", flux=[U, 0.0]), Boundary(["bottom", "top"], slip=True), Boundary("right", pressure=0.0),
        ],
    )  # fmt: skip
    result = simulate(scene)
    wanted = pressure_drop("dallavalle_di_felice", Re, c, 0.5) * 8 * size
    x = result.p_at[:, 0]
    within = 0.02 if elements == "P1-P1" else 1e-9
    assert result.p[-1][x == 0] - result.p[-1][x == x.max()].mean() == pytest.approx(wanted, rel=within)
    assert result.u[-1][:, 0] == pytest.approx(U, rel=within)
    assert result.flux_right[-1] == pytest.approx(4 * size * U, rel=within)
    # what the grains take is what the pressure on the fluid gives, c p on each end
    assert result.bed_force[-1, 0] == pytest.approx(c * wanted * 4 * size, rel=2 * within)
    assert closed(result)


@pytest.mark.parametrize("elements", ["P1-P1", "P2-P1"])
@pytest.mark.parametrize("Re", [1e-3, 1e2])
def test_a_bed_with_ends_loses_no_fluid_and_no_pressure(elements: str, Re: float) -> None:
    """The porosity rises to 1 exactly on both sides; grains of diameter 1, a cell each."""
    U, radius = Re * 0.4, 0.5
    scene = FluidScene(
        viscosity=1.0, density=1.0, elements=elements, mesh=box((40, 4), (40.0, 4.0)), steady=True,
        bed=Bed(
            porosity="1 - 0.6*smoothstep(x, 8, 14)*(1 - smoothstep(x, 26, 32))", drag="dallavalle_di_felice",
            radius=radius,
        ),
        boundary=[
            Boundary("left", flux=[U, 0.0]), Boundary(["bottom", "top"], slip=True), Boundary("right", pressure=0.0),
        ],
    )  # fmt: skip
    result = simulate(scene)
    x, p = result.p_at[:, 0], result.p[-1]
    inner = p[np.abs(x - 17) < 1e-9].mean() - p[np.abs(x - 23) < 1e-9].mean()
    assert inner == pytest.approx(6 * pressure_drop("dallavalle_di_felice", Re, 0.4, radius), rel=0.02)
    assert result.flux_right[-1] == pytest.approx(4 * U, rel=1e-9)
    inside = np.abs(result.u_at[:, 0] - 20) < 3.5
    assert result.u[-1][inside, 0] == pytest.approx(U, rel=0.02)
    assert closed(result)


@pytest.mark.slow
def test_grains_that_move_with_the_fluid_take_nothing() -> None:
    """Fluid and grains that go along together: the slip is exactly 0, and so are drag and pressure."""
    scene = FluidScene(
        viscosity=1.0, density=1.0, mesh=box((4, 3)), steady=True,
        bed=Bed(porosity=0.5, drag="dallavalle_di_felice", radius=0.01, velocity=[2.0, 0.0]),
        boundary=[
            Boundary("left", velocity=[2.0, 0.0]), Boundary(["bottom", "top"], slip=True),
            Boundary("right", pressure="-0.75"),
        ],
    )  # fmt: skip
    result = simulate(scene)
    assert result.u[-1] == pytest.approx(np.tile([1.0, 0.0], (len(result.u_at), 1)), abs=1e-12)
    assert result.bed_force[-1] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert result.us[-1][:, 0] == pytest.approx(1.0)


def taylor_green(dt: float | None, elements: str = "P2-P1", cells: int = 6, **more: Any) -> FluidScene:
    """Vortices that fade in a periodic square of side 2 pi, exp(-2 nu t), nu = 0.1."""
    values: dict[str, Any] = {
        "viscosity": 0.1, "density": 1.0, "elements": elements, "mesh": box((cells, cells), (2 * math.pi,) * 2),
        "boundary": [Boundary(["left", "right"], periodic=True), Boundary(["bottom", "top"], periodic=True)],
        "start": ["sin(x)*cos(y)", "-cos(x)*sin(y)"], "until_t": 2.0, "dt": dt, "times": 3,
    }  # fmt: skip
    return FluidScene(**{**values, **more})


@pytest.mark.slow
@pytest.mark.parametrize(("method", "least"), [("BDF2", 1.9), ("Euler", 0.95)])
def test_steps_in_time_converge_with_the_order_of_the_method(method: str, least: float) -> None:
    """On one mesh, against steps so short that they are exact beside: velocities and pressures."""
    finest = simulate(taylor_green(0.00625, method="BDF2"))
    errors = []
    for dt in (0.1, 0.05):
        result = simulate(taylor_green(dt, method=method))
        errors.append([np.abs(result.u[-1] - finest.u[-1]).max(), np.abs(result.p[-1] - finest.p[-1]).max()])
    assert np.log2(np.array(errors[0]) / errors[1]).min() > least


@pytest.mark.slow
def test_adaptive_steps_keep_to_their_tolerance() -> None:
    finest = simulate(taylor_green(0.00625))
    for rtol in (1e-3, 1e-4, 1e-5):
        result = simulate(taylor_green(None, rtol=rtol))
        assert np.abs(result.u - finest.u).max() < 10 * rtol
        assert np.nanmax(result.step_error) <= 1
        assert closed(result)


@pytest.mark.slow
def test_what_viscosity_dissipates_was_kinetic_energy() -> None:
    """Of the vortices' energy, 2 pi^2 exp(-4 nu t)/2."""
    result = simulate(taylor_green(0.02, cells=12))
    assert result.kinetic_energy[-1] == pytest.approx(math.pi**2 * math.exp(-0.8), rel=1e-2)
    assert result.kinetic_rate[-1] == pytest.approx(-result.dissipation[-1], rel=1e-3)


@pytest.mark.slow
def test_no_unit_matters() -> None:
    """The same cavity in units of 2^30 of length, 2^-20 of time and 2^50 of mass."""
    L, T, M = 2.0**30, 2.0**-20, 2.0**50

    def cavity(L: float, T: float, M: float) -> FluidScene:
        return FluidScene(
            viscosity=0.01 * M / (L * T), density=M / L**3, mesh=box((6, 6), (L, L)), until_t=1.0 * T, times=3,
            boundary=[
                Boundary("top", velocity=[L / T, 0.0]), Boundary(["left", "right", "bottom"], velocity=[0.0, 0.0]),
            ],
        )  # fmt: skip

    one, other = simulate(cavity(1, 1, 1)), simulate(cavity(L, T, M))
    assert other.step_t / T == pytest.approx(one.step_t, rel=1e-8)
    assert other.u * T / L == pytest.approx(one.u, abs=1e-9)
    assert other.p * L * T**2 / M == pytest.approx(one.p, abs=1e-7)
    assert other.stats["steps"] == one.stats["steps"]


SWINGING = FluidScene(
    viscosity=0.02, density=1.0, mesh=box((5, 5)), until_t=2.0, times=5, rtol=1e-3,
    boundary=[
        Boundary("top", velocity=["sin(3*t)", 0.0]), Boundary(["left", "right"], velocity=[0.0, 0.0]),
        Boundary("bottom", pressure=0.0),
    ],
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("after", [0.3, 1.1])
def test_a_run_that_was_stopped_goes_on_to_the_last_bit(after: float, tmp_path: Path) -> None:
    checkpoint = tmp_path / "run.checkpoint.npz"

    def stop(t: float, *_: Any) -> None:
        if t > after:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_fluid(SWINGING, stop, checkpoint)
    there = softdyn.load_result(tmp_path / "run.frames")
    assert 1 <= len(there) < 5
    assert "has not ended" in there.warnings[0]
    resumed, whole = simulate_fluid(SWINGING, None, checkpoint, True), simulate_fluid(SWINGING)
    assert differences(whole, resumed) == {}
    assert np.array_equal(there.u, whole.u[: len(there)])
    assert not checkpoint.exists()
    assert not (tmp_path / "run.frames").exists()


def test_a_checkpoint_of_another_scene_is_refused(tmp_path: Path) -> None:
    checkpoint = tmp_path / "run.checkpoint.npz"

    def stop(*_: Any) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_fluid(SWINGING, stop, checkpoint)
    with pytest.raises(SceneError, match="another scene"):
        simulate_fluid(replace(SWINGING, viscosity=0.03), None, checkpoint, True)


@pytest.mark.slow
def test_results_are_kept_read_and_made_again(tmp_path: Path) -> None:
    bed = Bed(porosity="0.5 + 0.2*x", drag="ergun", radius=0.01)
    scene = FluidScene(
        viscosity=1.0, density=1.0, mesh=box((4, 4)), bed=bed, steady=True, constants={"U": 2.0},
        boundary=[
            Boundary("left", flux=["U", 0]), Boundary("right", pressure=0), Boundary(["bottom", "top"], slip=True),
        ],
    )  # fmt: skip
    result = simulate(scene)
    read = softdyn.load_result(result.save(tmp_path / "run.npz"))
    assert differences(result, read) == {}
    assert softdyn.scene_of(read) == scene
    assert differences(*run_again(tmp_path / "run.npz")) == {}
    assert isinstance(read, FluidResult)
    assert repr(read) == "<FluidResult, P2-P1: 1 frames up to t=0>"


@pytest.mark.slow
def test_a_flow_without_inertia_is_found_at_each_time_by_itself() -> None:
    scene = FluidScene(
        viscosity=2.0, mesh=box((4, 4)), until_t=1.0, times=[0.0, 0.5, 1.0],
        boundary=[Boundary("top", velocity=["t", 0.0]), Boundary("bottom", velocity=[0.0, 0.0]),
                  Boundary(["left", "right"], periodic=True)],
    )  # fmt: skip
    result = simulate(scene)
    assert result.force_top[:, 0] == pytest.approx([0.0, -1.0, -2.0])
    assert result.t.tolist() == [0.0, 0.5, 1.0]


GOOD: dict[str, Any] = {
    "fluid": {"viscosity": 1.0, "density": 1.0},
    "mesh": {"box": [1.0, 1.0], "cells": [2, 2]},
    "boundary": [
        {"on": "top", "velocity": [1.0, 0.0]},
        {"on": ["left", "right", "bottom"], "velocity": [0.0, 0.0]},
    ],
    "until": {"steady": True},
}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"until": {"steady": True, "t": 1.0}}, "both t and steady"),
        ({"until": {}}, "needs t, or steady = true"),
        ({"until": None}, r"\[until\] is missing"),
        ({"mesh": None}, r"\[mesh\] is missing"),
        ({"boundary": None}, r"\[boundary\] is missing"),
        ({"fluid": {"viscosity": -1.0}}, "viscosity must be a positive number"),
        ({"fluid": {"viscosity": 1.0, "elements": "P3"}}, "unknown elements 'P3'"),
        ({"fluid": {"viscosty": 1.0}}, "did you mean 'viscosity'"),
        ({"start": {"velocity": [0.0, 0.0]}}, "of no use where the steady flow"),
        ({"fluid": {"viscosity": 1.0}, "gravity": {"acceleration": [0, -1]}}, "of no use without"),
        ({"gravity": {"acceleration": [0, -1, 0]}}, "needs 2 components"),
        ({"fluid": {"viscosity": 1.0, "mixture": "einstein"}}, "of no use without a"),
        ({"bed": {"porosity": 0.5, "drag": "nobody", "radius": 1.0}}, r"\[bed\] drag: unknown closure 'nobody'; "),
        ({"bed": {"porosity": 0.5, "drag": "schiller_nauman", "radius": 1.0}}, "did you mean 'schiller_naumann'"),
        ({"bed": {"porosity": 0.5, "drag": "hertz", "radius": 1.0}}, r"\[bed\] drag"),
        ({"bed": {"porosity": 0.5, "drag": "ergun"}}, "radius is missing"),
        ({"bed": {"porosity": 0.5, "drag": "einstein", "radius": 1.0}}, "is taken for the drag"),
        ({"parameters": {"k": 1.0}}, "of no use"),
        ({"fluid": {"viscosity": 1.0, "terms": ["boussinesq"]}}, "declared in a file"),
        ({"until": {"t": 1.0}, "steps": {"dt": 2.0}}, "longer than the run"),
        ({"until": {"t": 1.0}, "output": {"times": [0.0, 2.0]}}, "must increase, from 0"),
        ({"until": {"t": 1e200}}, "choose units"),
        ({"mesh": {"box": [1.0, 1.0], "cells": [2, 2]}, "boundary": GOOD["boundary"][:1]}, "nothing is said"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_scene_is_told(change: dict[str, Any], words: str) -> None:
    content = {name: value for name, value in {**GOOD, **change}.items() if value is not None}
    with pytest.raises(softdyn.errors.SoftdynError, match=words):
        simulate(fluid_scene_from(content, Path()))


@pytest.mark.slow
def test_a_flow_that_is_not_found_is_an_error_that_tells_where() -> None:
    """A lid at Re = 1e9 on a few cells; inflow that grows beyond all numbers within the run."""
    content = {**GOOD, "fluid": {"viscosity": 1e-9, "density": 1.0}, "mesh": {"box": [1.0, 1.0], "cells": [12, 12]}}
    with pytest.raises(IntegrationError, match=r"the balance of (momentum along [xy]|volume) at \("):
        simulate(fluid_scene_from(content, Path()))


@pytest.mark.parametrize("dt", [1e-12, 1.0])
def test_steps_may_be_as_short_or_as_long_as_they_like(dt: float) -> None:
    until = dt if dt == 1.0 else 3e-12
    content = {**GOOD, "until": {"t": until}, "steps": {"dt": dt}, "output": {"times": 2}}
    result = simulate(fluid_scene_from(content, Path()))
    assert result.stats["residual"] <= 1e-10
    assert result.stats["steps"] == round(until / dt)
    assert closed(result)


@pytest.mark.slow
def test_the_command_line_runs_a_scene(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = tmp_path / "channel.toml"
    scene.write_text(
        "[fluid]\nviscosity = 1.0\ndensity = 1.0\n[mesh]\nbox = [1.0, 1.0]\ncells = [3, 3]\n"
        '[[boundary]]\non = ["bottom", "top"]\nvelocity = [0, 0]\n[[boundary]]\non = "left"\npressure = 1\n'
        '[[boundary]]\non = "right"\npressure = 0\n[until]\nt = 0.5\n'
    )
    assert main(["run", str(scene), "-o", str(tmp_path / "a.npz")]) == 0
    out = capsys.readouterr().out
    assert "mass closes to" in out
    assert "flux out" in out
    assert main(["run", str(scene), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["boundaries"]["right"]["flux"] == pytest.approx(1 / 12, rel=0.05)
    assert main(["rerun", str(tmp_path / "a.npz")]) == 0
    assert "the same, to the last bit" in capsys.readouterr().out
    assert main(["run", str(scene), "-o", str(tmp_path / "a.gsd")]) == 2
    assert "of a fluid the ending must be" in capsys.readouterr().err
    assert main(["generate", "--scene", str(scene), "--target", "c", "rognon_gay"]) == 2
    assert "no law" in capsys.readouterr().err


@pytest.mark.slow
def test_a_term_of_ones_own_acts_on_the_fluid(tmp_path: Path) -> None:
    """Brinkman's force, -k u, in a wide channel: the pressure falls by k u."""
    (tmp_path / "brinkman.py").write_text(
        "from sympy import Symbol\n"
        "from softdyn.derive.averaged_flow import Term\n"
        "from softdyn.derive.dimensions import FORCE, LENGTH, TIME\n"
        'k = Symbol("k", positive=True)\n'
        'brinkman = Term("brinkman", lambda flow: -k * flow.u, parameters={k: FORCE * TIME / LENGTH**4})\n'
    )
    (tmp_path / "scene.toml").write_text(
        '[fluid]\nviscosity = 1e-3\nterms = ["brinkman.py:brinkman"]\n[parameters]\nk = 4.0\n'
        "[mesh]\nbox = [1.0, 1.0]\ncells = [3, 3]\n"
        '[[boundary]]\non = "left"\npressure = 2.0\n[[boundary]]\non = "right"\npressure = 0\n'
        '[[boundary]]\non = ["bottom", "top"]\nslip = true\n[until]\nsteady = true\n'
    )
    result = softdyn.simulate(tmp_path / "scene.toml")
    assert result.u[-1][:, 0] == pytest.approx(0.5)
    assert softdyn.scene_of(result).terms[0].endswith("brinkman.py:brinkman")


def test_stock_scenes_can_be_read() -> None:
    assert set(fluid_scenes()) == {"bed", "cavity", "channel", "cylinder", "cylinder_shedding", "darcy"}
    for path in fluid_scenes().values():
        assert isinstance(softdyn.read_scene(path), FluidScene)


@pytest.mark.slow
def test_no_digit_depends_on_the_number_of_threads() -> None:
    """Fronts are dense, and more threads split their sums otherwise: each run has one."""
    scene = softdyn.read_scene(fluid_scenes()["channel"])
    assert isinstance(scene, FluidScene)
    results = []
    for threads in (1, 2):
        with threadpool_limits(threads, "blas"):
            results.append(simulate(scene))
    assert results[0].stats["linear_solver"] == "fronts, in single precision"
    assert not differences(*results)
