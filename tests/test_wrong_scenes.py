"""What is wrong with a scene file is told truly: the place, and the remedy."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softdyn.cli import main
from softdyn.errors import SceneError
from softdyn.particles.files import read_particle_scene
from softdyn.particles.particle_scene import check
from softdyn.scene.pair_drive import drive_of
from softdyn.scene.pair_scene import check_scene, read_scene

PAIR = """law = "rognon_gay"
[parameters]
R = 1.0
E = 1.0
eta = 1.0
[pair]
h = 0.1
[drive]
force = 1e-3
[until]
t = 10.0
"""
MANY = """law = "rognon_gay"
[parameters]
E = 1.0
eta = 1.0
[particles]
positions = [[0, 0], [2.1, 0], [1, 2]]
radii = 1.0
[flow]
drag = 1.0
[until]
t = 10.0
"""
BEFORE = "it is a key of the scene itself: write it before the first section, or as a section of its own"


def read_and_check(path: Path) -> None:
    scene = read_scene(path)
    check_scene(scene)
    drive_of(scene)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[until]\nt = 10.0", "until = 10.0", ["[drive] unknown key 'until'", BEFORE, "[until] is missing"]),
        ("t = 10.0\n", 't = 10.0\ntarget = "c"\n', ["[until] unknown key 'target'", BEFORE]),
        ("t = 10.0\n", "t = 10.0\n[contacts]\ngap = 1\n", ["a section of scenes of many particles"]),
        ("force = 1e-3", "force = [1, 2]", ["[drive] force: a table is two lists of one length", "not 1.0 and 2.0"]),
        ("force = 1e-3", "force = [[0, 1], [1, 2, 3]]", ["[drive] force: a table", "not 2 and 3"]),
        ("force = 1e-3", 'force = {file = "none.csv"}', ["[drive] force: cannot read the table", "No such file"]),
        ("force = 1e-3", 'force = {file = "."}', ["[drive] force: cannot read the table", "Is a directory"]),
        ("force = 1e-3", "force = {file = 3}", ["[drive] force: file must be a path, not 3"]),
        ("force = 1e-3", 'force = ""', ["[drive] force: expression ''", "the end where a number"]),
        ("force = 1e-3", "force = 1e-3\nvelocity = 1.0", ["takes one of force, position", "has force and velocity"]),
        (
            "h = 0.1",
            'h = 0.1\nX = "a"\ndelta = "b"',
            ["X must be a finite number", "delta must be a finite number", "leave it out"],
        ),
    ],
)
def test_a_pair(tmp_path: Path, old: str, new: str, words: list[str]) -> None:
    assert old in PAIR
    path = tmp_path / "scene.toml"
    path.write_text(PAIR.replace(old, new, 1))
    with pytest.raises(SceneError) as caught:
        read_and_check(path)
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[[0, 0], [2.1, 0], [1, 2]]", "[[0, 0], [2.1], [1, 2]]", ["particle 1 has 1 numbers, and particle 0 2"]),
        ("[[0, 0], [2.1, 0], [1, 2]]", "[[0, 0], [2.1, true], [1, 2]]", ["positions must be numbers, not [[0, 0]"]),
        ("[[0, 0], [2.1, 0], [1, 2]]", '[["0", "0"], ["2", "0"]]', ["positions must be numbers, not [['0', '0']"]),
        ("radii = 1.0", "radii = [[1], [1], [1]]", ["radii must be one number, or a list of 3, not of shape (3, 1)"]),
        ("radii = 1.0", 'radii = "1 kg"', ["radii = '1 kg' is in kg, and m is needed"]),
        ("radii = 1.0", "diameter = 2.0", ["unknown key 'diameter'; radii are half of it"]),
        ("[until]\nt = 10.0", "until = 10", ["[flow] unknown key 'until'", BEFORE, "[until] is missing"]),
        ("[until]", "[drive]\nforce = 1\n[until]", ["a section of scenes of two particles"]),
        ("[until]", "[box]\nlengths = 3\n[until]", ["[box] lengths must be a list of numbers, not 3"]),
        ("[until]", "[box]\ntilt = 3\n[until]", ["[box] lengths is missing, one for each axis"]),
        ("[until]", "[[wall]]\npoint = [0, -3]\nnormal = [0, 1]\n[until]", ["particles 0, 1, 2 on the wrong side"]),
    ],
)
def test_many(tmp_path: Path, old: str, new: str, words: list[str]) -> None:
    assert old in MANY
    path = tmp_path / "scene.toml"
    path.write_text(MANY.replace(old, new, 1))
    with pytest.raises(SceneError) as caught:
        check(read_particle_scene(path))
    for word in words:
        assert word in str(caught.value)
    assert "overlap" not in str(caught.value)


def said(capsys: pytest.CaptureFixture[str], *arguments: Any) -> str:
    assert main([str(argument) for argument in arguments]) == 2
    return capsys.readouterr().err


def test_what_softdyn_writes_is_read_or_refused_by_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Results drive other scenes, are drawn and converted; each command says what else it was given."""
    pair, many = tmp_path / "pair.toml", tmp_path / "many.toml"
    pair.write_text(PAIR)
    many.write_text(MANY)
    for ending in ("npz", "json", "csv"):
        assert main(["run", str(pair), "-o", str(tmp_path / f"pair.{ending}")]) == 0
    assert main(["run", str(many), "-o", str(tmp_path / "many.npz")]) == 0
    assert main(["sweep", str(pair), "--vary", "force=1e-3,2e-3", "-o", str(tmp_path / "sweep.npz")]) == 0
    capsys.readouterr()
    for name, words in (
        ("pair.npz", "no scene, which is TOML, but a result"),
        ("pair.json", "no scene, which is TOML, but a result"),
        ("pair.csv", "no scene, which is TOML, but a table"),
        ("many.npz", "[particles] file"),
    ):
        assert words in said(capsys, "run", tmp_path / name)
    # a result's force, read from any of its files, drives a pair
    driven = tmp_path / "driven.toml"
    for ending in ("npz", "json", "csv"):
        driven.write_text(PAIR.replace("force = 1e-3", f'force = {{file = "pair.{ending}"}}'))
        table = read_scene(driven).force
        assert np.array_equal(table.F, np.full(len(table.t), 1e-3))
        assert table.t[-1] == 10.0
    driven.write_text(PAIR.replace("force = 1e-3", 'velocity = {file = "pair.npz"}'))
    assert "holds no velocity (dX_dt); it holds t, h, delta" in said(capsys, "run", driven)
    driven.write_text(PAIR.replace("force = 1e-3", 'force = {file = "many.npz"}'))
    assert "holds a run of many particles" in said(capsys, "run", driven)
    driven.write_text(PAIR.replace("force = 1e-3", 'force = {file = "sweep.npz"}'))
    assert "the table of a sweep is for numpy.load" in said(capsys, "run", driven)
    placed = MANY.replace("positions = [[0, 0], [2.1, 0], [1, 2]]\nradii = 1.0", 'file = "pair.npz"')
    driven.write_text(placed)
    assert "pair.npz holds a run of two particles" in said(capsys, "run", driven)
    driven.write_text(placed.replace("pair.npz", "many.npz"))
    assert main(["run", str(driven)]) == 0
    np.savez(tmp_path / "a.checkpoint.npz", about=np.array(json.dumps({"kind": "checkpoint"})))
    capsys.readouterr()
    assert "goes on with --resume" in said(capsys, "plot", tmp_path / "a.checkpoint.npz")


def test_a_parameter_by_species_where_particles_have_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(MANY.replace("E = 1.0", "E = {soft = 1.0}"))
    assert "E depends on the species, and particles have none: [particles] species" in said(capsys, "run", path)
