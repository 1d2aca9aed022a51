"""Scene files of many particles, packings, checkpoints, and the command line."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softdyn import particles
from softdyn.cli import main
from softdyn.errors import IntegrationError, SceneError
from softdyn.particles import integrate
from softdyn.particles.files import particle_scene_from, read_particle_scene
from softdyn.particles.observables import coordination, normal_stress_differences, relative_viscosity
from softdyn.particles.packing import BALL, lattice_packing, random_packing
from softdyn.particles.particle_run import prepare, simulate_particles
from softdyn.particles.particle_scene import check
from softdyn.particles.placing import read_particles
from softdyn.particles.results import SHAPES, ParticleResult, load_particles
from softdyn.results.registry import load_result
from softdyn.results.rerun import differences
from softdyn.scene.stock_scenes import particle_scenes

EMULSION = """
law = "rognon_gay"
parameters = {E = 1.0, eta = 1.0}
packing = {kind = "random", count = 40, dimension = 2, fraction = 0.88, radii = [1.0, 1.4], seed = 3}
contacts = {gap = 0.02, range = 0.4}
flow = {shear_rate = 1e-4, drag = 1.0}
until = {strain = 0.1}
output = {times = 5}
accuracy = {rtol = 1e-3}
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "scene.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("d", [2, 3])
def test_a_random_packing_has_its_fraction_and_its_seed(d: int) -> None:
    fraction = {2: 0.7, 3: 0.5}[d]
    x, radii, lengths = random_packing(200, d, fraction, [1.0, 1.3], 5)
    assert BALL[d] * np.sum(radii**d) / np.prod(lengths) == pytest.approx(fraction, rel=1e-12)
    assert np.all((x >= 0) & (x < lengths))
    again = random_packing(200, d, fraction, [1.0, 1.3], 5)
    assert np.array_equal(x, again[0])
    assert not np.array_equal(x, random_packing(200, d, fraction, [1.0, 1.3], 6)[0])
    # well below the densest random packing no overlap is left
    along = x[:, None] - x[None]
    along -= lengths * np.round(along / lengths)
    apart = np.linalg.norm(along, axis=2) - radii[:, None] - radii[None]
    assert np.min(apart[np.triu_indices(200, 1)]) > -1e-3


@pytest.mark.parametrize(("kind", "cells", "neighbours"), [("hexagonal", [4, 3], 6), ("fcc", [3, 3, 3], 12)])
def test_a_lattice_has_its_neighbours(kind: str, cells: list[int], neighbours: int) -> None:
    x, lengths = lattice_packing(kind, cells, 2.1)
    along = x[:, None] - x[None]
    along -= lengths * np.round(along / lengths)
    distance = np.linalg.norm(along, axis=2) + 10 * np.eye(len(x))
    assert distance.min() == pytest.approx(2.1)
    assert np.all(np.sum(distance < 2.1 * 1.01, axis=1) == neighbours)


def test_an_emulsion_from_a_file(tmp_path: Path) -> None:
    result = simulate_particles(read_particle_scene(written(tmp_path, EMULSION)))
    assert len(result) == 5
    assert result.t[-1] == pytest.approx(1000)
    viscosity = relative_viscosity(result)
    assert np.all(viscosity[1:] > 1)
    first, second = normal_stress_differences(result)
    assert first.shape == second.shape == (5,)
    # isostatic at least, as a jammed packing must be
    assert np.all(coordination(result) > 3)
    titles = " ".join(axes.get_title(loc="left") for axes in result.plot().axes)
    for title in (
        "stress, > 0 in tension",
        "relative viscosity",
        "normal stresses",
        "pressed contacts per particle",
        "balance of energy",
        "distribution of gaps",
        "distribution of forces",
    ):
        assert title in titles


def test_particles_from_a_table(tmp_path: Path) -> None:
    (tmp_path / "some.csv").write_text("x,y,radius,species\n0,0,1,soft\n2.05,0,1,hard\n\n4,1,1,soft\n")
    placed = read_particles(tmp_path / "some.csv")
    assert placed["positions"][2].tolist() == [4.0, 1.0]
    assert placed["species"] == ["soft", "hard", "soft"]
    scene = read_particle_scene(
        written(
            tmp_path,
            """
law = "rognon_gay"
parameters = {eta = 1.0, E = {soft = 1.0, hard = 2.0}}
particles = {file = "some.csv"}
flow = {drag = 1.0}
push = [{particles = "soft", force = [1e-3, "1e-3*sin(t)"]}]
hold = [{particles = [1], axes = "xy"}]
wall = [{point = [0, -1.5], normal = [0, -1]}]
until = {t = 10.0}
""",
        )
    )
    assert np.array_equal(prepare(scene).force(0.0)[:, 0], [1e-3, 0, 1e-3])
    result = simulate_particles(scene)
    assert np.array_equal(result.x[-1, 1], [2.05, 0.0])
    assert result.x[-1, 0, 0] > 0
    for text, words in (
        ("x,y,radius\n0,0\n", "line 2: 2 columns under 3 headings"),
        ("x,y,radius\n0,a,1\n", "line 2: y: 'a' is no number"),
        ("y,radius\n0,1\n", "x missing; the headings are y, radius"),
    ):
        (tmp_path / "bad.csv").write_text(text)
        with pytest.raises(SceneError, match=words):
            read_particles(tmp_path / "bad.csv")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("contacts = {gap", "contact = {gap", "unknown key 'contact'; did you mean 'contacts'"),
        ("range = 0.4", "rnage = 0.4", r"\[contacts\] unknown key 'rnage'; did you mean 'range'"),
        ("strain = 0.1", "strian = 0.1", r"\[until\] unknown key 'strian'; did you mean 'strain'"),
        (", seed = 3", "", "seed missing"),
        ("fraction = 0.88", "fraction = 7", "fraction must lie between"),
        ("count = 40", "count = 40.5", "count must be a whole number"),
        ("count = 40", "count = 3", "too small"),
        ('kind = "random"', 'kind = "quasi"', "unknown kind 'quasi'; there are random, square"),
        ("law =", "box = {lengths = [1.0]}\nlaw =", "follows from"),
        ("law =", "push = [{force = [0, 0]}]\nlaw =", r"\[\[push\]\] 0: particles is missing"),
        ("law =", "push = 3\nlaw =", "must be a list of sections"),
        ("parameters = {E = 1.0, eta = 1.0}", "parameters = 3", r"parameters must be a section"),
        ("law =", "law = = ", "not valid TOML"),
    ],
)
def test_faults_of_a_scene_file_are_named(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert old in EMULSION
    with pytest.raises(SceneError, match=words) as error:
        read_particle_scene(written(tmp_path, EMULSION.replace(old, new, 1)))
    assert str(tmp_path / "scene.toml") in str(error.value)


PAIR: dict[str, Any] = {
    "law": "rognon_gay",
    "parameters": {"E": 1.0, "eta": 1.0},
    "particles": {"positions": [[0.0, 0.0], [2.1, 0.0]], "radii": 1.0},
    "flow": {"drag": 1.0},
    "until": {"t": 1.0},
}
SQUARE = {"kind": "square", "cells": [4, 4], "spacing": 2.1}


def held(**entry: Any) -> dict[str, Any]:
    return {"hold": [{"particles": [0], "axes": "x", **entry}]}


def walled(**entry: Any) -> dict[str, Any]:
    return {"wall": [{"point": [0, -3], "normal": [0, -1], **entry}]}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"particles": PAIR["particles"] | {"species": 3}}, "species must be a list of names, one for each"),
        ({"particles": PAIR["particles"] | {"species": "ab"}}, "species must be a list of names, one for each"),
        ({"particles": PAIR["particles"] | {"species": [1, [2]]}}, "species must be a list of names, one for each"),
        ({"particles": PAIR["particles"] | {"radii": []}}, "0 radii for 2 particles"),
        (held(velocity=3), "velocity needs one component for each of the axes 'x'"),
        (held(axes="xy", velocity="t1"), "velocity needs one component for each of the axes 'xy'"),
        (held(particles=[0.5]), r"must be a list of whole numbers, a species or 'all', not \[0\.5\]"),
        (held(particles=[True]), r"must be a list of whole numbers, a species or 'all', not \[True\]"),
        (held(particles=[10**30]), "there is no particle 1000000"),
        (walled(point=["a", 0]), "wall 0 needs a point and a normal of 2 finite coordinates each"),
        (walled(normal="up"), "wall 0 needs a point and a normal of 2 finite coordinates each"),
        (walled(normal=[[0, -1], [1]]), "wall 0 needs a point and a normal of 2 finite coordinates each"),
        (walled(normal=[0, 0]), "wall 0 needs a point and a normal of 2 finite coordinates each"),
        (walled(rigid="no"), "wall 0: rigid must be true or false, not 'no'"),
        ({"mixing": {"A": ["x"]}}, r"\[mixing\] A: unknown rule \['x'\]"),
        ({"packing": SQUARE | {"radii": []}}, "two ways to say where the particles are"),
        ({"packing": SQUARE | {"radii": []}, "particles": None}, "radii must be a number, or a list of some"),
        ({"particles": None}, r"\[particles\] and \[packing\] are two ways to say .*: give one of them"),
    ],
)
def test_what_is_not_of_its_kind_is_refused(changes: dict[str, Any], words: str, tmp_path: Path) -> None:
    data = {name: value for name, value in {**PAIR, **changes}.items() if value is not None}
    with pytest.raises(SceneError, match=words):
        simulate_particles(particle_scene_from(data, tmp_path))


@pytest.mark.slow
def test_a_run_resumes_where_it_was_interrupted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As if nothing had happened: to the last bit."""
    scene = read_particle_scene(written(tmp_path, EMULSION))
    whole = simulate_particles(scene)
    checkpoint = tmp_path / "a.checkpoint.npz"

    def interrupt(t: float, steps: int, iterations: int) -> None:
        if t > 400:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_particles(scene, interrupt, checkpoint)
    assert checkpoint.exists()
    resumed = simulate_particles(scene, None, checkpoint, resume=True)
    assert not checkpoint.exists()
    assert differences(whole, resumed) == {}
    assert resumed.energy == whole.energy
    # another scene does not go on from it
    with pytest.raises(KeyboardInterrupt):
        simulate_particles(scene, interrupt, checkpoint)
    other = read_particle_scene(written(tmp_path, EMULSION.replace("drag = 1.0", "drag = 2.0")))
    with pytest.raises(SceneError, match="belongs to another scene"):
        simulate_particles(other, None, checkpoint, resume=True)
    checkpoint.write_bytes(checkpoint.read_bytes()[:1000])
    with pytest.raises(SceneError, match="no checkpoint"):
        simulate_particles(scene, None, checkpoint, resume=True)


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_amid_the_bookkeeping_waits_for_its_end(
    sent: signal.Signals, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C while the last frame is made, when the state is there already: the frame is not lost."""
    scene = read_particle_scene(written(tmp_path, EMULSION))
    whole = simulate_particles(scene)
    made = integrate.frame_now

    def interrupted(system: Any, state: Any) -> Any:
        if state.t == whole.t[-1]:
            os.kill(os.getpid(), sent)
        return made(system, state)

    monkeypatch.setattr(integrate, "frame_now", interrupted)
    checkpoint = tmp_path / "a.checkpoint.npz"
    usual = signal.signal(signal.SIGINT, signal.default_int_handler)  # tests run in the background ignore interrupts
    try:
        with pytest.raises(KeyboardInterrupt):
            simulate_particles(scene, None, checkpoint)
    finally:
        signal.signal(signal.SIGINT, usual)
    monkeypatch.undo()
    assert np.array_equal(simulate_particles(scene, None, checkpoint, resume=True).t, whole.t)


@pytest.mark.slow
@pytest.mark.parametrize(("sent", "status", "word"), [
    (signal.SIGTERM, 143, "terminated"), (signal.SIGINT, 130, "interrupted"),
])  # fmt: skip
@pytest.mark.usefixtures("users_compiler")
def test_a_signal_keeps_the_state_says_so_and_the_run_goes_on(
    sent: signal.Signals, status: int, word: str, tmp_path: Path
) -> None:
    """As a batch system sends it before it kills."""
    path = written(tmp_path, EMULSION.replace("strain = 0.1", "strain = 1.0"))
    command = [sys.executable, "-m", "softdyn", "run", str(path), "-o", str(tmp_path / "a.npz")]
    # a checkpoint of every step would slow it down: the first step is what a sleep cannot tell
    code = (
        "import signal, sys, softdyn.results.carried as run; from softdyn.cli import main;"
        "signal.signal(signal.SIGINT, signal.default_int_handler); run.CHECKPOINT_EVERY = 0.0;"
        f"sys.exit(main({command[3:]!r}))"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    checkpoint = tmp_path / "a.checkpoint.npz"
    limit = time.monotonic() + 60
    while not checkpoint.exists() and process.poll() is None and time.monotonic() < limit:
        time.sleep(0.01)
    process.send_signal(sent)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == status
    assert said == f"softdyn: {word}; its state is in {checkpoint}: the same command with --resume goes on from it\n"
    assert main([*command[3:], "--resume"]) == 0
    assert load_particles(tmp_path / "a.npz").t[-1] == pytest.approx(1e4)


@pytest.mark.slow
def test_a_result_that_cannot_be_saved_leaves_its_checkpoint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A disk that fills at the end does not take hours of work with it."""
    path = written(tmp_path, EMULSION)
    output, checkpoint = tmp_path / "a.npz", tmp_path / "a.checkpoint.npz"
    monkeypatch.setattr("softdyn.results.carried.CHECKPOINT_EVERY", 0.0)
    with monkeypatch.context() as patch:

        def full(result: object, path: Path) -> Path:
            raise SceneError(f"cannot write {path}: No space left on device")

        patch.setattr("softdyn.particles.results.ParticleResult.save", full)
        assert main(["run", str(path), "-o", str(output)]) == 2
    said = capsys.readouterr().err
    assert f"cannot write {output}: No space left on device; a state of the run is in {checkpoint}" in said
    assert main(["run", str(path), "-o", str(output), "--resume"]) == 0
    assert load_particles(output).t[-1] == pytest.approx(1e3)
    assert not checkpoint.exists()


@pytest.mark.slow
@pytest.mark.usefixtures("users_compiler")
def test_a_killed_run_resumes(tmp_path: Path) -> None:
    """SIGKILL in the middle; the last checkpoint is whole."""
    path = written(tmp_path, EMULSION.replace("strain = 0.1", "strain = 1.0"))
    code = (
        "import sys, softdyn.results.carried as run; from softdyn.cli import main; run.CHECKPOINT_EVERY = 0.0;"
        f"sys.exit(main(['run', {str(path)!r}, '-o', {str(tmp_path / 'a.npz')!r}]))"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    checkpoint = tmp_path / "a.checkpoint.npz"
    limit = time.monotonic() + 60
    while not checkpoint.exists() and process.poll() is None and time.monotonic() < limit:
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert checkpoint.exists()
    there = load_result(tmp_path / "a.frames")
    assert main(["run", str(path), "-o", str(tmp_path / "a.npz"), "--resume"]) == 0
    whole = load_particles(tmp_path / "a.npz")
    assert whole.t[-1] == pytest.approx(1e4)
    # what was there when it was killed is what came out
    assert 0 < len(there) < len(whole)
    assert np.array_equal(there.x, whole.x[: len(there)])
    assert np.array_equal(there.contact_delta, whole.contact_delta[: len(there.contact_delta)])
    assert "has not ended" in there.warnings[0]
    assert not (tmp_path / "a.frames").exists()


def test_a_failed_run_leaves_its_last_good_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = read_particle_scene(written(tmp_path, EMULSION))
    monkeypatch.setattr(integrate, "MOST_STEPS", 3)
    checkpoint = tmp_path / "a.checkpoint.npz"
    with pytest.raises(IntegrationError, match="3 steps were not enough") as error:
        simulate_particles(scene, None, checkpoint)
    assert str(checkpoint) in str(error.value)
    assert isinstance(error.value.partial, ParticleResult)
    assert error.value.partial.stats["steps"] == 4
    monkeypatch.undo()
    assert simulate_particles(scene, None, checkpoint, resume=True).t[-1] == pytest.approx(1000)


@pytest.mark.slow
def test_the_command_line_runs_and_draws(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, output = written(tmp_path, EMULSION), tmp_path / "a.npz"
    assert main(["run", str(path), "-o", str(output), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["particles"] == 40
    assert abs(summary["energy"]["imbalance"]) < 5e-3
    assert main(["plot", str(output)]) == 0
    assert (tmp_path / "a.png").stat().st_size > 10_000
    assert main(["run", str(path), "-o", str(tmp_path / "a.json")]) == 2
    assert "npz" in capsys.readouterr().err
    assert main(["run", str(path), "--resume"]) == 2
    assert "--resume" in capsys.readouterr().err
    assert main(["run", "emulsoin"]) == 2
    assert "there is no scene emulsoin" in (said := capsys.readouterr().err)
    assert "did you mean 'emulsion'?" in said


def test_the_help_names_the_stock_scenes(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["run", "--help"])
    words = capsys.readouterr().out.replace(",", " ").split()
    assert set(particle_scenes()) <= set(words)


@pytest.mark.slow
@pytest.mark.parametrize("tangential", [False, True])
def test_a_run_in_two_parts_is_the_run(tmp_path: Path, tangential: bool) -> None:
    """Films, tangential forces and the tilt of the box are taken over: what differs is what the tolerance allows."""
    more = {"law": "equal_spheres", "parameters": {"E": 1.0, "eta": 1.0, "nu": 0.5}} if tangential else {}
    data = tomllib.loads(EMULSION.replace("range = 0.4", f"range = 0.4, tangential = {str(tangential).lower()}")) | more
    # where films are pulled: some hold particles that are further apart than the range
    strain = 0.7 if tangential else 1.1
    whole = simulate_particles(particle_scene_from(data | {"until": {"strain": strain + 0.1}}, tmp_path))
    first = simulate_particles(particle_scene_from(data | {"until": {"strain": strain}}, tmp_path))
    first.save(tmp_path / "first.npz")
    rest = {name: value for name, value in data.items() if name != "packing"} | {"particles": {"file": "first.npz"}}
    scene = particle_scene_from(rest | {"until": {"strain": 0.1}}, tmp_path)
    assert scene.tilt == pytest.approx(strain * scene.box[1], rel=1e-9)
    second = simulate_particles(scene)
    last, now = whole.contacts(-1), second.contacts(-1)
    assert np.array_equal(last["i"], now["i"])
    assert np.array_equal(last["j"], now["j"])
    begun, left = second.contacts(0), first.contacts(-1)
    if not tangential:
        assert np.any(begun["h"] - 2 * begun["delta"] > 0.4 + 0.4)  # than the skin about it, even
    for name in ("i", "j", "h", "T") if tangential else ("i", "j", "h"):
        assert np.array_equal(begun[name], left[name])
    np.testing.assert_allclose(begun["F"], left["F"], rtol=1e-6)
    # some tens of steps of rtol = 1e-3 each, of which errors keep a few; gaps that had started anew are off by half
    assert np.median(np.abs(now["h"] / last["h"] - 1)) < 5e-3
    np.testing.assert_allclose(second.stress[-1], whole.stress[-1], rtol=2e-2, atol=1e-2 * np.abs(whole.stress).max())
    if tangential:
        assert np.linalg.norm(now["T"] - last["T"]) < 2e-2 * np.linalg.norm(last["T"])


@pytest.mark.slow
def test_a_scene_starts_from_an_earlier_result(tmp_path: Path) -> None:
    """Coordinates, images and tilt go on from where they were: distances and displacements are those of one run."""
    earlier = simulate_particles(
        read_particle_scene(written(tmp_path, EMULSION.replace("strain = 0.1", "strain = 1.3")))
    )
    assert np.any((earlier.x[-1] < 0) | (earlier.x[-1] > earlier.box))
    earlier.save(tmp_path / "earlier.npz")
    data = {name: value for name, value in tomllib.loads(EMULSION).items() if name != "packing"}
    scene = particle_scene_from(data | {"particles": {"file": "earlier.npz"}}, tmp_path)
    np.testing.assert_array_equal(scene.radii, earlier.radii)
    np.testing.assert_array_equal(scene.positions, earlier.x[-1])
    np.testing.assert_allclose(scene.box, earlier.box, rtol=1e-12)
    assert scene.tilt == earlier.cell[-1, 0, 1] == pytest.approx(1.3 * earlier.box[1], rel=1e-9)
    # the same arguments in Python
    again = particles.ParticleScene(**particles.read_particles(tmp_path / "earlier.npz"), **RUN)
    np.testing.assert_array_equal(again.positions, scene.positions)


def test_films_hold_however_far_the_centres_are_and_end_with_the_range() -> None:
    films = {"i": [0, 1, 2], "j": [1, 2, 3], "h": [0.01, 0.3, 0.6]}
    changes: dict[str, Any] = {"radii": 1.0, "range": 0.5, "drag": 1.0, "times": [0.0]}
    places = [[0.0, 0.0], [2.005, 0.0], [5.0, 0.0], [7.1, 0.0]]
    contacts = particles.simulate(particles.ParticleScene(positions=places, films=films, **RUN | changes)).contacts(0)
    # the last is not within the range: the pair has another, as its distance says
    np.testing.assert_allclose(contacts["h"], [0.01, 0.3, 0.1])
    np.testing.assert_allclose(contacts["delta"], [0.0025, -0.3475, 0.0], atol=1e-12)


def test_a_strain_under_an_imposed_stress_counts_from_the_start(tmp_path: Path) -> None:
    stress = {"stress": {"xy": 1e-3}, "flow": {"drag": 1.0}, "until": {"t": 1e9, "strain": 0.05}}
    data = tomllib.loads(EMULSION) | stress
    first = simulate_particles(particle_scene_from(data, tmp_path))
    first.save(tmp_path / "first.npz")
    rest = {name: value for name, value in data.items() if name != "packing"} | {"particles": {"file": "first.npz"}}
    second = simulate_particles(particle_scene_from(rest | {"output": {"times": [0.0]}}, tmp_path))
    lean = second.cell[-1, 0, 1] / second.cell[-1, 1, 1]
    assert lean == pytest.approx(0.1, rel=1e-6)


def test_walls_are_where_they_were_or_there_are_none(tmp_path: Path) -> None:
    changes: dict[str, Any] = {"range": 0.4, "drag": 1.0, "hold": [particles.Hold([0], "xy")]}
    moving = particles.Wall([3.02, 0.0], [1.0, 0.0], velocity=[-2e-2, 0.0])
    places = {"positions": [[0.0, 0.0], [2.01, 0.0]], "radii": 1.0}
    first = particles.simulate(particles.ParticleScene(wall=[moving], **places, **RUN | changes))
    placed = particles.read_particles(first.save(tmp_path / "first.npz"))
    there = replace(moving, point=first.wall_point[-1, 0])
    second = particles.simulate(particles.ParticleScene(wall=[there], **placed, **RUN | changes))
    np.testing.assert_allclose(particles.wall_forces(second)[0], particles.wall_forces(first)[-1], rtol=1e-9)
    with pytest.raises(SceneError, match=r"wall 0 stood at \[3, 0\], with the normal \[1, 0\]"):
        check(particles.ParticleScene(wall=[moving], **placed, **RUN | changes))
    with pytest.raises(SceneError, match="2 walls, and 1 in the earlier run"):
        check(particles.ParticleScene(wall=[there, there], **placed, **RUN | changes))
    alone = particles.simulate(particles.ParticleScene(**placed, **RUN | changes))
    assert alone.contacts(0)["j"].tolist() == [1]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"films": [1]}, "films must be a mapping with i, j and h"),
        ({"films": {"i": [0], "j": [1]}}, "films must be a mapping with i, j and h"),
        ({"films": {"i": [0], "j": [1], "h": [0.1, 0.2]}}, "one row for each contact is needed"),
        ({"films": {"i": [0], "j": [1], "h": [0.1], "T": [0.0]}}, "one row for each contact is needed"),
        ({"films": {"i": 0, "j": 1, "h": 0.1}}, "one row for each contact is needed"),
        ({"films": {"i": [0.5], "j": [1], "h": [0.1]}}, "i, j and shift must be whole numbers"),
        ({"films": {"i": [0], "j": [1], "h": ["a"]}}, "h and T finite ones"),
        ({"films": {"i": [0], "j": [2], "h": [0.1]}}, "and j larger ones, below 2"),
        ({"films": {"i": [0, 0], "j": [1, 1], "h": [0.1, 0.2]}}, "a contact is given twice"),
        ({"films": {"i": [1], "j": [1], "h": [0.1]}}, "and j larger ones"),
        ({"films": {"i": [0], "j": [1], "h": [0.0]}}, "gaps must be positive"),
        ({"films": {"i": [0], "j": [1], "h": [math.nan]}}, "h and T finite ones"),
        ({"tilt": "x"}, r"\[box\] tilt must be a finite number"),
        (
            {"tilt": 21e6, "box": [20.0, 20.0], "range": 0.5},
            r"\[box\] tilt = 2\.1e\+07 is more than 1e\+06 lengths of the box",
        ),
        ({"tilt": 1.0}, r"\[box\] tilt: only a box that is periodic along x and y leans"),
    ],
)
def test_films_and_tilts_that_cannot_be_are_refused(changes: dict[str, Any], words: str) -> None:
    scene = particles.ParticleScene(positions=[[0.0, 0.0], [2.005, 0.0]], radii=1.0, **RUN | changes)
    with pytest.raises(SceneError, match=words):
        check(scene)


#: What a scene has besides its particles.
RUN: dict[str, Any] = {"law": "rognon_gay", "parameters": {"E": 1.0, "eta": 1.0}, "until_t": 1.0}


def test_a_result_without_a_box_is_taken_as_it_is(tmp_path: Path) -> None:
    """Species and all; places far outside of what would be a box too."""
    names = ["soft", "hard", "soft"]
    first = particles.ParticleScene(
        law="rognon_gay", parameters={"E": {"soft": 1.0, "hard": 2.0}, "eta": 1.0}, species=names,
        radii=[1.0, 1.2, 1.0], positions=[[-50.0, 3.0], [-47.75, 3.0], [9.0, 3.0]], drag=1.0, until_t=5.0,
        push=[particles.Push("hard", [-1e-2, 0.0])],
    )  # fmt: skip
    result = particles.simulate(first)
    placed = particles.read_particles(result.save(tmp_path / "a.npz"))
    assert placed["species"] == names
    assert "box" not in placed
    np.testing.assert_array_equal(placed["positions"], result.x[-1])
    # a box may then be given: particles stand for their images in it
    data = {**PAIR, "particles": {"file": "a.npz"}, "contacts": {"range": 0.5}, "box": {"lengths": [100.0, 0]}}
    check(particle_scene_from(data, tmp_path))


def test_a_box_that_stretches_is_taken_as_it_is_at_the_end(tmp_path: Path) -> None:
    x, lengths = lattice_packing("hexagonal", [6, 3], 1.9)
    changes = {"gap": 0.05, "range": 0.4, "stress": {"pressure": 0.02}, "until_t": 50.0}
    result = particles.simulate(particles.ParticleScene(positions=x, radii=1.0, box=lengths, **{**RUN, **changes}))
    placed = particles.read_particles(result.save(tmp_path / "a.npz"))
    np.testing.assert_array_equal(placed["box"], np.diag(result.cell[-1]))
    assert np.all(np.abs(placed["box"] / lengths - 1) > 1e-3)
    check(particles.ParticleScene(**placed, **{**RUN, "gap": 0.05, "range": 0.4}))


@pytest.mark.slow
def test_results_to_start_from_are_checked(tmp_path: Path) -> None:
    sheared = simulate_particles(read_particle_scene(written(tmp_path, EMULSION)))
    empty = {name: value[:0] if "f" in SHAPES.get(name, "") else value for name, value in sheared.arrays.items()}
    empty |= {name: value[:0] for name, value in sheared.arrays.items() if name.startswith("contact_")}
    replace(sheared, arrays=empty | {"contact_start": np.array([0])}).save(tmp_path / "empty.npz")
    with pytest.raises(SceneError, match=r"empty\.npz: the result holds no frame to start from"):
        read_particles(tmp_path / "empty.npz")
    (tmp_path / "bad.npz").write_text("x,y,radius\n0,0,1\n")
    with pytest.raises(SceneError, match=r"bad\.npz is not a result saved by softdyn"):
        read_particles(tmp_path / "bad.npz")
    still = tomllib.loads(EMULSION) | {"flow": {"drag": 1.0}, "until": {"t": 1.0}}
    simulate_particles(particle_scene_from(still, tmp_path)).save(tmp_path / "upright.npz")
    data = {**PAIR, "particles": {"file": "upright.npz"}, "box": {"lengths": [30.0, 30.0]}}
    with pytest.raises(SceneError, match=r"\[box\] follows from \[particles\] file: leave it out"):
        particle_scene_from(data, tmp_path)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"t": None}, "it has no 't'"),
        ({"x": np.zeros((3, 2, 1))}, r"x has the shape \(3, 2, 1\), which does not fit"),
        ({"contact_h": np.zeros(2)}, "contact_h has the shape"),
        ({"radii": np.array(["a", "b"])}, "radii is not an array of 1 dimensions of numbers"),
        ({"contact_start": np.array([0, 1])}, "contact_start does not fit the contacts"),
    ],
)
def test_a_result_whose_parts_do_not_fit_is_refused(tmp_path: Path, change: dict[str, Any], words: str) -> None:
    result = simulate_particles(particle_scene_from(PAIR, tmp_path))
    arrays = {name: value for name, value in {**result.arrays, **change}.items() if value is not None}
    path = replace(result, arrays=arrays).save(tmp_path / "a.npz")
    with pytest.raises(SceneError, match=words):
        load_particles(path)
    empty = {name: value[:0] if "f" in SHAPES.get(name, "") else value for name, value in result.arrays.items()}
    with pytest.raises(SceneError, match="no frame to draw"):
        replace(result, arrays=empty).plot()


@pytest.mark.parametrize(
    "name", ["two", "line", "t1", *(pytest.param(name, marks=pytest.mark.slow) for name in ("emulsion", "spheres"))]
)
def test_stock_scenes_run_by_their_names(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each with its forces and its energy in balance."""
    assert name in particle_scenes()
    text = particle_scenes()[name].read_text()
    if name in ("emulsion", "spheres"):  # a part of them: the whole takes some seconds
        text = text.replace("count = 1000", "count = 100").replace("strain = 2.0", "strain = 0.1")
        text = text.replace("count = 200", "count = 30").replace("strain = 3.0", "strain = 0.1")
        arguments: list[Any] = ["run", str(written(tmp_path, text)), "--json"]
    else:
        arguments = ["run", name, "--json"]
    assert main(arguments) == 0
    summary = json.loads(capsys.readouterr().out)
    assert abs(summary["energy"]["imbalance"]) < 1e-3
    assert summary["stats"]["force_residual"] < 2e-6


@pytest.mark.parametrize(
    ("name", "lines"),
    [("two", ["0–1"]), ("line", ["0–1, 1–2"]), ("t1", ["0–1", "0–2, 0–3, 1–2, 1–3", "2–3"])],
)
def test_each_of_a_few_contacts_is_drawn_over_time(name: str, lines: list[str]) -> None:
    """Those that are alike by symmetry are one line, which names them all."""
    result = simulate_particles(read_particle_scene(particle_scenes()[name]))
    gaps = next(axes for axes in result.plot().axes if axes.get_title(loc="left") == "gaps")
    assert [str(line.get_label()).replace("\n", " ") for line in gaps.get_lines()] == lines
    first = gaps.get_lines()[0]
    np.testing.assert_array_equal(first.get_xdata(), result.t)
    frames = [result.contacts(frame) for frame in range(len(result))]
    np.testing.assert_array_equal(first.get_ydata(), [frame["h"][0] for frame in frames])
