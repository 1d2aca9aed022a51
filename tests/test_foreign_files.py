"""Particles from files of other programs: what each says is read, and what it lacks is told."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gsd.hoomd
import meshio
import numpy as np
import pytest

from softdyn import particles
from softdyn.errors import SceneError
from softdyn.particles import ParticleScene, read_particles

RUN: dict[str, Any] = {
    "law": "rognon_gay",
    "parameters": {"E": 1.0, "eta": 1.0},
    "drag": 1.0,
    "range": 1.0,
    "until_t": 1e-3,
}
X = np.array([[0.1, 0.2, 0.3], [2.4, 0.2, 0.3], [0.1, 2.5, 4.0]])
RADII = np.array([1.0, 1.2, 0.8])

EXTENDED = """1
an earlier frame
A 9 9 9
3
Lattice="8 0 0 1.5 6 0 0 0 7" Properties=species:S:1:pos:R:3:radius:R:1 pbc="T T F"
A 0.1 0.2 0.3 1.0
B 2.4 0.2 0.3 1.2
A 0.1 2.5 4.0 0.8
"""
DATA = """a file of LAMMPS

3 atoms
2 atom types
-4 4 xlo xhi
-3 3 ylo yhi
-3.5 3.5 zlo zhi
1.5 0 0 xy xz yz

Masses

1 1.0

Atoms # sphere

2 2 2.4 1.0 2.4 0.2 0.3 0 0 0
1 1 2.0 1.0 0.1 0.2 0.3 0 0 0
3 1 1.6 1.0 0.1 2.5 4.0 0 0 0

Velocities

1 0 0 0
"""
DUMP = """ITEM: TIMESTEP
7
ITEM: NUMBER OF ATOMS
3
ITEM: BOX BOUNDS xy xz yz pp pp ff
-4 5.5 1.5
-3 3 0
-3.5 3.5 0
ITEM: ATOMS id type {columns}
2 2 {second}
1 1 {first}
3 1 {third}
"""


def dump(columns: str, of: Any) -> str:
    first, second, third = (" ".join(f"{value:.17g}" for value in row) for row in of)
    return DUMP.format(columns=columns, first=first, second=second, third=third)


CELL = np.array([[8, 1.5, 0], [0, 6, 0], [0, 0, 7.0]])
SCALED = np.linalg.solve(CELL, (X - [-4, -3, -3.5]).T).T
TEXTS = {
    "a.xyz": EXTENDED,
    "data.film": DATA,
    "a.lmp": DATA,
    "a.dump": dump("x y z radius", np.c_[X, RADII]),
    "b.lammpstrj": dump("xs ys zs diameter", np.c_[SCALED, 2 * RADII]),
    "dump.film": dump("radius xu yu zu", np.c_[RADII, X]),
}


@pytest.mark.parametrize("name", TEXTS)
def test_what_a_text_says_is_read(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(TEXTS[name])
    placed = read_particles(tmp_path / name)
    np.testing.assert_allclose(placed["positions"], X, rtol=0, atol=4 * np.finfo(float).eps * 8)
    np.testing.assert_array_equal(placed["radii"], RADII)
    assert placed["species"] in (["A", "B", "A"], ["1", "2", "1"])
    assert placed["box"] == [8, 6, 7 if TEXTS[name] is DATA else None]
    assert placed["tilt"] == 1.5


def test_a_gsd_file_of_two_dimensions_is_read_as_such(tmp_path: Path) -> None:
    frame = gsd.hoomd.Frame()
    frame.particles.N = 2
    frame.particles.position = [[0, 0, 0], [2.5, 1, 0]]
    frame.particles.diameter = [2.0, 3.0]
    frame.configuration.dimensions = 2
    frame.configuration.box = [8, 6, 0, 0.25, 0, 0]
    with gsd.hoomd.open(str(tmp_path / "a.gsd"), "w") as trajectory:
        trajectory.append(frame)
    placed = read_particles(tmp_path / "a.gsd")
    assert placed["positions"].tolist() == [[0, 0], [2.5, 1]]
    assert placed["radii"].tolist() == [1, 1.5]
    assert placed["box"] == [8, 6]
    assert placed["tilt"] == 1.5


def test_points_of_vtk_are_read(tmp_path: Path) -> None:
    cells = [("vertex", np.arange(3)[:, None])]
    meshio.Mesh(X, cells, point_data={"Radius": RADII}).write(tmp_path / "a.vtu")
    placed = read_particles(tmp_path / "a.vtu")
    np.testing.assert_array_equal(placed["positions"], X)
    np.testing.assert_array_equal(placed["radii"], RADII)
    assert "box" not in placed


def test_what_softdyn_wrote_for_ovito_starts_the_next_run(tmp_path: Path) -> None:
    scene = ParticleScene(positions=[[0.1, 0.2], [2.2, 0.4]], radii=[1.0, 1.1], box=[12, 10], **RUN)
    result = particles.simulate(scene)
    again = ParticleScene(file=result.save(tmp_path / "a.gsd"), **RUN)
    single = float(np.finfo(np.float32).eps)
    # a box of GSD has its centre at 0
    np.testing.assert_allclose(again.positions + np.array([6, 5]), result.x[-1], rtol=0, atol=12 * single)
    assert again.box == pytest.approx([12, 10], rel=single)


def test_a_file_without_sizes_leaves_them_to_the_scene(tmp_path: Path) -> None:
    (tmp_path / "a.xyz").write_text("2\n\nAr 0 0 0\nAr 2.5 0 0\n")
    scene = ParticleScene(file=tmp_path / "a.xyz", radii=1.0, **RUN)
    assert np.shape(scene.positions) == (2, 2)  # all z are 0
    assert scene.box is None
    with pytest.raises(SceneError, match=r"a\.xyz tells no sizes: give \[particles\] radii"):
        ParticleScene(file=tmp_path / "a.xyz", **RUN)
    (tmp_path / "b.xyz").write_text(EXTENDED)
    with pytest.raises(SceneError, match=r"\[particles\] radii: .*b\.xyz tells them; leave them out"):
        ParticleScene(file=tmp_path / "b.xyz", radii=1.0, **RUN)
    with pytest.raises(SceneError, match=r"\[box\] follows from \[particles\] file"):
        ParticleScene(file=tmp_path / "b.xyz", box=[1, 1, 1], **RUN)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.xyz", "", "there is no particle"),
        ("a.xyz", "two\n", r"line 1: the number of particles is meant, not 'two'"),
        ("a.xyz", "9999999999\n\nA 0 0 0\n", r"line 1: 9999999999 particles are announced, and 1 lines follow"),
        ("a.xyz", "1\n\nA 0 0\n", r"line 3: 3 columns, where 4 are meant: species pos0 pos1 pos2"),
        ("a.xyz", "1\n\nA 0 0 zero\n", r"line 3: 'zero' is no number"),
        ("a.xyz", "1\n\nA 0 0 nan\n", "the position of particle 0 is no number"),
        ("a.xyz", '1\nProperties="pos:R"\nA 0 0 0\n', r"line 2: Properties is name:kind:columns"),
        ("a.xyz", '1\nLattice="1 0 0 0 1 0"\nA 0 0 0\n', r"line 2: Lattice has 6 numbers, not 9"),
        ("a.xyz", '1\nLattice="1 1 0 0 1 0 0 0 1"\nA 0 0 1\n', "the first must lie along x"),
        ("a.lmp", DATA.replace(" # sphere", ""), r"line 14: the style of the atoms is ''; write it after the heading"),
        ("a.lmp", DATA.replace("3 atoms", "30 atoms"), r"line 20: 3 columns, where 7 are meant|line \d+: 0 columns"),
        ("a.lmp", "nothing\n", "a LAMMPS data file has lines 'N atoms'"),
        ("a.dump", "", "line 1: a LAMMPS dump starts with 'ITEM: TIMESTEP'"),
        ("a.dump", DUMP[: DUMP.index("ITEM: ATOMS")], "was it cut off?"),
        ("a.dump", "\n".join(TEXTS["a.dump"].splitlines()[:-1]), "the file ends after 2 of 3 particles"),
        ("a.dump", TEXTS["a.dump"].replace(" x y z", " vx vy vz"), "the dump has no columns x y z"),
        ("a.gsd", "no gsd", "no GSD file"),
        ("a.vtu", "no vtu", "no VTK file"),
        ("a.xyz", None, "No such file"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_told_with_its_place(name: str, text: str | None, words: str, tmp_path: Path) -> None:
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(SceneError, match=words) as told:
        read_particles(tmp_path / name)
    assert name in str(told.value)
