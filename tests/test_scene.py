"""Scenes: what is wrong is refused before anything runs, with one clear message."""

from pathlib import Path

import numpy as np
import pytest

from softdyn import simulate
from softdyn.errors import SceneError
from softdyn.scene.pair_drive import drive_of
from softdyn.scene.pair_scene import check_scene, parameter_values, read_scene, scene_from
from softdyn.scene.time_tables import Table, read_table

GOOD = """
law = "rognon_gay"
[parameters]
R = 1.0
E = 1.0
eta = 1.0
[pair]
h = 100.0
[drive]
force = 1e-2
[until]
h = 1e-3
"""


def write(folder: Path, text: str, name: str = "scene.toml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def refusal(folder: Path, text: str) -> str:
    path = write(folder, text)
    with pytest.raises(SceneError) as caught:
        check(path)
    return str(caught.value)


def check(path: Path) -> None:
    scene = read_scene(path)
    check_scene(scene)
    drive_of(scene)
    parameter_values(scene, ("R", "E", "eta"), ("R", "E", "eta"), {})


@pytest.mark.parametrize(
    ("change", "into", "messages"),
    [
        ("[pair]", "[pari]", ["unknown key 'pari'", "did you mean 'pair'", "[pair] is missing"]),
        ("h = 100.0", "hh = 100.0", ["[pair] unknown key 'hh'", "[pair] h is missing"]),
        ("h = 100.0", "h = 0.0", ["[pair] h must be a positive number"]),
        ("h = 100.0", "h = -1", ["[pair] h must be a positive number"]),
        ("h = 100.0", "h = nan", ["[pair] h must be a positive number, not nan"]),
        ("h = 100.0", "h = 1e-320", ["below the smallest normal double"]),
        ("h = 100.0", "h = true", ["[pair] h must be a positive number"]),
        ("h = 100.0", "h = '100'", ["[pair] h must be a positive number"]),
        ("R = 1.0", "", ["R is missing", "R, E, eta"]),
        ("R = 1.0", "R = -1.0", ["[parameters] R must be positive"]),
        ("R = 1.0", "R = 1.0\nsigma = 2", ["'sigma' is not a parameter"]),
        ("eta = 1.0", "etta = 1.0", ["'etta' is not a parameter", "did you mean 'eta'", "eta is missing"]),
        ("force = 1e-2", "force = inf", ["force must be finite"]),
        ("force = 1e-2", "force = '1e-2*sine(t)'", ["position 6", "did you mean 'sin'"]),
        ("force = 1e-2", "force = {fil = 'f.csv'}", ['{file = "force.csv"}']),
        ("force = 1e-2", "force = 1e-2\n[constants]\nw = 1", ["[constants] belong to a force that is an expression"]),
        ("force = 1e-2", "force = 't*w'\n[constants]\nw = 1\nz = 2", ["z does not appear in the force"]),
        ("force = 1e-2", "force = 't'\n[constants]\nt = 1", ["[constants] t has a meaning of its own"]),
        ("[until]", "[output]\nquantities = 'X'\n[until]", ["quantities must be a list"]),
        ("[until]\nh = 1e-3", "[until]", ["[until] needs h, t, or both"]),
        ("[until]\nh = 1e-3", "[until]\nh = 100.0", ["nothing to run"]),
        ("[until]", "[output]\ntimes = 5\ngaps = [1.0]\n[until]", ["times or gaps, not both"]),
        ("[until]", "[output]\ntimes = 1\n[until]", ["[output] times must be 2 to"]),
        ("[until]", "[output]\ntimes = [2.0, 1.0]\n[until]", ["times must increase"]),
        ("[until]", "[output]\ngaps = [-1.0]\n[until]", ["must be positive"]),
        ("[until]", "[output]\nquantities = ['XX']\n[until]", ["unknown quantity 'XX'"]),
        ("[until]", "[accuracy]\nrtol = 1e-20\n[until]", ["rtol must lie between"]),
        ("[until]", "[accuracy]\nmethod = 'euler'\n[until]", ["unknown method 'euler'"]),
        ("law =", "target = 'fortran'\nlaw =", ["unknown target 'fortran'", "there are auto, c, numba"]),
    ],
)
def test_refusals_name_the_place_and_the_remedy(tmp_path: Path, change: str, into: str, messages: list[str]) -> None:
    assert change in GOOD
    said = refusal(tmp_path, GOOD.replace(change, into, 1))
    for message in messages:
        assert message in said


def test_a_scene_of_many_particles_is_told_where_one_of_two_is_needed(tmp_path: Path) -> None:
    for section in ("[particles]\npositions = [[0, 0], [3, 0]]\nradii = 1.0\n", "[packing]\nkind = 'random'\n"):
        assert "it is a scene of many particles, for softdyn run" in refusal(tmp_path, GOOD + section)


def test_all_faults_are_reported_at_once(tmp_path: Path) -> None:
    text = GOOD.replace("h = 100.0", "h = -1").replace("[until]\nh = 1e-3", "[until]\nt = inf\n[accuracy]\nrtol = 2")
    said = refusal(tmp_path, text)
    assert said.count("\n  - ") == 3


def test_toml_errors_carry_the_line(tmp_path: Path) -> None:
    assert "line 5" in refusal(tmp_path, GOOD.replace("E = 1.0", "E = = 1.0"))


def test_unreadable_scenes(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="cannot read the scene"):
        read_scene(tmp_path / "missing.toml")
    (tmp_path / "binary.toml").write_bytes(b"a = 1\n\xff\x00")
    with pytest.raises(SceneError, match=r"not text in UTF-8.*line 2"):
        read_scene(tmp_path / "binary.toml")
    (tmp_path / "wide.toml").write_text(GOOD, encoding="utf-16")
    with pytest.raises(SceneError, match="UTF-16"):
        read_scene(tmp_path / "wide.toml")


def test_a_mark_of_the_order_of_bytes_is_no_part_of_a_scene(tmp_path: Path) -> None:
    (tmp_path / "marked.toml").write_text(GOOD, encoding="utf-8-sig")
    check(tmp_path / "marked.toml")


def test_paths_in_a_scene_are_relative_to_it(tmp_path: Path) -> None:
    write(tmp_path, "t,F\n0,1\n10,2\n", "force.csv")
    data = {
        "law": "own.py:law",
        "parameters": {},
        "pair": {"h": 1.0},
        "drive": {"force": {"file": "force.csv"}},
        "until": {"t": 10},
    }
    scene = scene_from(data, tmp_path)
    assert scene.law == str(tmp_path / "own.py:law")
    np.testing.assert_array_equal(scene.force.F, [1.0, 2.0])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("0,1\n2,1\n1,1\n", "line 3: time 1 does not come after 2"),
        ("0,1\n0,2\n0,3\n", "line 3: time 0 does not come after 0"),
        ("0,1\n1,x\n", "line 2: value: 'x' is no number"),
        ("0,1\n1\n", "line 2: 2 columns are expected, and there are 1"),
        ("0,1\n1,2,3\n", "line 2: 2 columns are expected, and there are 3"),
        ("0,1\n1,nan\n", "line 2.*is not finite"),
        ("t,value\n0,1\n", "at least two rows"),
        ("", "at least two rows"),
    ],
)
def test_force_tables_are_refused_with_the_line(tmp_path: Path, content: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        read_table(write(tmp_path, content, "force.csv"))


def test_force_tables_may_have_headings_comments_and_blank_lines(tmp_path: Path) -> None:
    table = read_table(write(tmp_path, "time,force\n# a comment\n\n0,1e-2\n5,2e-2\n", "force.csv"), "force")
    np.testing.assert_array_equal(table.t, [0.0, 5.0])
    with pytest.raises(SceneError, match="cannot read the table"):
        read_table(tmp_path / "missing.csv")


@pytest.mark.parametrize(
    ("force", "deflection"),
    [
        (1e-2, "compression"),
        (-1e-2, "tension"),
        (0.0, "either"),
        ("2*3", "compression"),
        ("sin(t)", "either"),
        (Table(np.array([0.0, 1.0]), np.array([1.0, 2.0])), "compression"),
        (([0.0, 1.0], [1.0, -2.0]), "either"),
    ],
)
def test_the_drive_tells_the_sign_of_the_deflection(force: object, deflection: str, tmp_path: Path) -> None:
    scene = read_scene(write(tmp_path, GOOD))
    assert drive_of(scene.__class__(**{**vars(scene), "force": force})).deflection == deflection


@pytest.mark.slow
def test_a_parameter_keeps_to_its_range_whose_ends_may_belong_to_it(tmp_path: Path) -> None:
    """Poisson's ratio of an isotropic solid: -1 < nu <= 1/2, by the stock law that has one."""
    text = GOOD.replace("rognon_gay", "equal_spheres").replace("eta = 1.0", "eta = 1.0\nnu = 0.5")
    assert simulate(read_scene(write(tmp_path, text))).h[-1] == pytest.approx(1e-3)
    for nu in ("0.51", "-1"):
        with pytest.raises(SceneError, match=rf"nu = {nu} lies outside of its range, -1 < nu <= 0\.5"):
            simulate(read_scene(write(tmp_path, text.replace("nu = 0.5", f"nu = {nu}"))))
