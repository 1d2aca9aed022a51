"""Tables: whatever way one is written, its numbers come back; what is none is named, with its line or its format."""

import json
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import softdyn
from softdyn import particles, tables
from softdyn.errors import IntegrationError, SceneError
from softdyn.particles import Push, read_particles
from softdyn.particles.foreign_files import reader_of
from softdyn.scene.pair_scene import read_scene
from softdyn.scene.time_tables import read_table

SEPARATORS = st.sampled_from([",", ";", "\t", " ", "   ", ", ", " ; "])
NUMBERS = st.floats(-1e300, 1e300, allow_nan=False)
SHARED = settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])

Drawn = Callable[..., object]


def headings(draw: Drawn, names: list[str]) -> list[str]:
    """The names, some with notes of units."""
    units = ["", "(s)", " (s)", " [N]", "/mm"]
    return [name + draw(st.sampled_from(units)) for name in names]


@st.composite
def written_tables(draw: Drawn, names: tuple[str, ...], words: tuple[str, ...] = ()) -> tuple[str, str, dict]:
    """Text, encoding and content of a table of some rows, of those columns in any order."""
    separator = draw(SEPARATORS)
    order = draw(st.permutations(names))
    comma = separator.strip() != "," and draw(st.booleans()) and not words
    quote = draw(st.booleans()) and separator.strip() != ""
    rows = draw(st.integers(2, 30))
    word = st.text("abcXYZ_01", min_size=1, max_size=8)
    content = {name: draw(st.lists(word if name in words else NUMBERS, min_size=rows, max_size=rows)) for name in names}

    def cell(value: object) -> str:
        text = value if isinstance(value, str) else repr(value)
        text = text.replace(".", ",") if comma else text
        return f'"{text}"' if quote and draw(st.booleans()) else text

    head = separator.join(headings(draw, order))
    lines = [separator.join(cell(content[name][row]) for name in order) for row in range(rows)]
    noise = st.sampled_from(["", "", "", "# a remark", "#", "   "])
    body = [part for line in lines for part in (draw(noise), line + draw(st.sampled_from(["", "", " # a remark"])))]
    prefix = "# " if not words and draw(st.booleans()) else ""
    ending = draw(st.sampled_from(["\n", "\r\n", "\r"]))
    before = draw(st.sampled_from([[], ["# exported by someone, once"], [""]]))
    first = [part for part in [prefix + head] if part]
    body = body if not prefix else [part for part in body if part != "#"]
    text = ending.join([*before, *first, *body]) + draw(st.sampled_from(["", ending]))
    return text, draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16"])), content


def saved(folder: Path, text: str, encoding: str = "utf-8", name: str = "table.csv") -> Path:
    path = folder / name
    path.write_bytes(text.encode(encoding))
    return path


@SHARED
@given(table=written_tables(("time", "force")), block=st.sampled_from([1, 3, 100_000]))
def test_a_table_over_time_comes_back_however_it_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, table: tuple, block: int
) -> None:
    text, encoding, content = table
    monkeypatch.setattr(tables, "BLOCK", block)
    known = (tables.Column("time", ("t",)), tables.Column("force", ("F",)))
    read = tables.read_columns(saved(tmp_path, text, encoding), "table", known, order=("time", "force"))
    for name, values in content.items():
        assert np.array_equal(read[name], values), name
    for row in (0, len(read) - 1):
        number = int(re.search(r"line (\d+)$", read.at(row))[1])
        line = re.split("\r\n|\r|\n", text)[number - 1]
        assert json.dumps(content["time"][row]).replace(".", ",") in line.replace(".", ",")


@SHARED
@given(table=written_tables(("x", "y", "radius", "species"), ("species",)))
def test_particles_come_back_however_their_table_is_written(tmp_path: Path, table: tuple) -> None:
    text, encoding, content = table
    placed = read_particles(saved(tmp_path, text, encoding))
    assert np.array_equal(placed["positions"], np.column_stack([content["x"], content["y"]]))
    assert np.array_equal(placed["radii"], content["radius"])
    assert placed["species"] == content["species"]


@SHARED
@given(
    rows=st.integers(2, 60),
    at=st.integers(0, 59),
    separator=st.sampled_from([",", ";", "\t", " "]),
    fault=st.sampled_from(["1 N", "x", "", "1.000,5", "1D-3", "nan", "1_0", "0x10", "short", "long"]),
    headed=st.booleans(),
)
def test_the_line_of_a_fault_is_named(
    tmp_path: Path, rows: int, at: int, separator: str, fault: str, headed: bool
) -> None:
    at %= rows
    lines = [["time", "force"]] * headed + [[repr(0.5 * k), repr(1.0 + k)] for k in range(rows)]
    row = at + headed
    cell = fault.replace(" ", "") if separator == " " else fault.replace(",", "'") if separator == "," else fault
    whole = {"short": lines[row][:1], "long": [*lines[row], "1"]}
    lines[row] = whole.get(fault, [lines[row][0], cell])
    path = saved(tmp_path, "\n".join(separator.join(line) for line in lines))
    with pytest.raises(SceneError) as caught:
        read_table(path, "force")
    said = str(caught.value)
    assert f"line {row + 1}" in said
    assert "unit" in said or fault != "1 N" or not (headed or at)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time,load\n0,1\n1,2\n", ["unknown column 'load'", "there are time (or t), force (or F, value)"]),
        ("time,forse\n0,1\n1,2\n", ["unknown column 'forse'; did you mean 'force'?", "force missing"]),
        ("time,velocity\n0,1\n1,2\n", ["unknown column 'velocity'"]),
        ("# Zeit;Kraft\n0;1\n1;2\n", ["unknown column 'Zeit'", "unknown column 'Kraft'", "time and force missing"]),
        ("time,F,force\n0,1,2\n1,2,3\n", ["force is there more than once: F, force"]),
        (",time,force\n0,0,1\n1,1,2\n", ["column 1 has no heading", "index=False"]),
        ("0,5,1,5\n1,5,2,5\n", ["line 1: 2 numbers are expected", "and there are 4", "; or a tab"]),
        ("time,force\n0,5,1,5\n", ["4 columns under 2 headings", "; or a tab"]),
        ("0|1\n1|2\n", ["and there are 1", "separated by commas, semicolons, tabs or spaces"]),
        ("0;1,5\n1;2.5\n", ["'1,5' and '2.5' have different decimal marks"]),
        ("0;1.000,5\n1;2\n", ["line 1: force: '1.000,5' is no number: digits are not grouped"]),
        ("0 s,1 N\n1 s,2 N\n", ["line 1: time: '0 s' is a number with a unit", "as in time (s)"]),
        ("time,force\ns,N\n0,1\n", ["line 2: time: 's' is no number", "starts with #"]),
        ("0,1.0D-3\n1,1\n", ["exponent after a D: write e"]),
        ("time,force\n0,1 000\n1,2\n", ["line 2: force: '1 000' is no number: digits are not grouped"]),
        ("time,force\n0,\u22121\n1,2\n", ["line 2", "has a minus sign of print: write -"]),
        ("time,force\n", ["at least two rows of time and force", "0 found"]),
    ],
)
def test_headings_and_cells_that_contradict_are_named(tmp_path: Path, text: str, words: list[str]) -> None:
    with pytest.raises(SceneError) as caught:
        read_table(saved(tmp_path, text), "force", ("F",))
    for word in words:
        assert word in str(caught.value)


def test_columns_of_a_result_are_taken_by_their_names(tmp_path: Path) -> None:
    """What a run of two particles writes as .csv drives another: X as a position, F as a force, dX_dt as a velocity."""
    path = saved(tmp_path, "t,h,delta,X,F,dX_dt\n0,9,9,1,2,3\n1,9,9,4,5,6\n")
    for name, also, values in (
        ("position", ("X",), [1, 4]),
        ("force", ("F",), [2, 5]),
        ("velocity", ("dX_dt",), [3, 6]),
    ):
        assert read_table(path, name, also).F.tolist() == values


def test_a_scene_takes_the_columns_of_its_tables_by_their_headings(tmp_path: Path) -> None:
    saved(tmp_path, "force,time\n1e-6,0\n2e-6,1e-6\n3e-6,2e-6\n", name="swapped.csv")
    scene = """
law = "rognon_gay"
parameters = {R = 1.0, E = 1.0, eta = 1.0}
pair = {h = 0.1}
drive = {force = {file = "swapped.csv"}}
until = {t = 3e-6}
"""
    table = read_scene(saved(tmp_path, scene, name="scene.toml")).force
    assert table.t.tolist() == [0, 1e-6, 2e-6]
    assert table.F.tolist() == [1e-6, 2e-6, 3e-6]


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.lammpstrj", b"ITEM: TIMESTEP\n0\n", "a dump of LAMMPS"),
        ("a.data", b"LAMMPS data file\n\n2 atoms\n", "a data file of LAMMPS"),
        ("a.xyz", b'1\nLattice="8 0 0 0 8 0 0 0 8" Properties=pos:R:3\n1 1 1\n', "an extended XYZ file"),
        ("a.xyz", b"1\nwater\nO 0.0 0.0 0.0\n", "an XYZ file"),
        ("a.vtk", b"# vtk DataFile Version 3.0\n", "a VTK file"),
        ("a.vtu", b'<?xml version="1.0"?>\n<VTKFile type="x">', "a VTK file"),
        ("a.txt", b'{"t": []}', "JSON"),
        ("a.gsd", b"\0\0\0\0", "a GSD file"),
        ("a.h5", b"\x89HDF\r\n", "an HDF5 file"),
        ("a.npy", b"\x93NUMPY", "an array of numpy"),
        ("a.csv.gz", b"\x1f\x8b\x08", "compressed (gzip)"),
        ("a.bin", b"\1\0\2", "not a text"),
        ("a.csv", b"x,radius\n\xe9,1\n", "not text in UTF-8"),
        ("a.zip", b"PK\x03\x04", "a zip archive"),
    ],
)
def test_files_of_other_formats_are_told_by_name(tmp_path: Path, name: str, content: bytes, words: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    for read in (read_table, read_particles) if reader_of(path) is None else (read_table,):
        with pytest.raises(SceneError, match=re.escape(words)):
            read(path)


def test_headings_may_be_separated_otherwise_than_numbers(tmp_path: Path) -> None:
    for text in ("force,time\n5;0\n6;1\n", "force time\n5,0\n6,1\n", "# force, time\n5 0\n6 1\n"):
        assert read_table(saved(tmp_path, text), "force").F.tolist() == [5, 6]


def test_a_table_of_particles_as_yade_writes_it(tmp_path: Path) -> None:
    text = "#format x_y_z_r\n# exported by yade\n0.0\t0.0\t0.0\t0.001\n0.0021\t0.0\t0.0\t0.002\n"
    placed = read_particles(saved(tmp_path, text))
    assert placed["positions"].tolist() == [[0, 0, 0], [0.0021, 0, 0]]
    assert placed["radii"].tolist() == [0.001, 0.002]


def test_a_diameter_is_twice_a_radius(tmp_path: Path) -> None:
    placed = read_particles(saved(tmp_path, "Diameter,x,Y\n2;0;0\n3;2,6;0\n"))
    assert placed["positions"].tolist() == [[0, 0], [2.6, 0]]
    assert placed["radii"].tolist() == [1, 1.5]
    for text, words in (
        ("x,y,diameter,radius\n0,0,2,1\n", "radius or diameter is needed, one of them"),
        ("x,y\n0,0\n", "radius or diameter is needed"),
        ("x,z,radius\n0,0,1\n", "there is a column z, and none y"),
        ("x,y,diametre\n0,0,1\n", "unknown column 'diametre'; did you mean 'diameter'"),
        ("0,0,1\n2,0,1\n", "the first line must name the columns"),
        ("x,y,radius\n", "no particle"),
        ("x,y,radius,species\n0,0,1,a\n3,0,1,\n", "line 3: the species is empty"),
    ):
        with pytest.raises(SceneError, match=words):
            read_particles(saved(tmp_path, text))


def test_folders_and_missing_files_are_named(tmp_path: Path) -> None:
    for read in (read_table, read_particles):
        for path in (tmp_path, tmp_path / "none.csv"):
            with pytest.raises(SceneError, match="cannot read the table"):
                read(path)


def test_ten_times_a_hundred_thousand_rows_are_read_in_blocks(tmp_path: Path) -> None:
    """Numbers are exact, and a fault at the end is found, whatever the block that it is in."""
    rng = np.random.default_rng(1)
    t, F = np.sort(rng.uniform(0, 1e6, 250_000)), rng.normal(size=250_000)
    path = saved(
        tmp_path, "force;time\n" + "".join(f"{b!r};{a!r}\n" for a, b in zip(t.tolist(), F.tolist(), strict=True))
    )
    table = read_table(path, "force")
    assert np.array_equal(table.t, t)
    assert np.array_equal(table.F, F)
    with path.open("a") as file:
        file.write("1 N;1e7\n")
    with pytest.raises(SceneError, match="line 250002: force: '1 N'"):
        read_table(path, "force")


def test_a_table_has_a_largest_number_of_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tables, "MOST_ROWS", 100)
    monkeypatch.setattr(tables, "BLOCK", 7)
    path = saved(tmp_path, "".join(f"{k},1\n" for k in range(100)))
    assert len(read_table(path).t) == 100
    path = saved(tmp_path, "".join(f"{k},1\n" for k in range(101)))
    with pytest.raises(SceneError, match="more than 100 rows"):
        read_table(path)


@pytest.mark.slow
def test_more_rows_than_a_run_may_take_steps_are_refused_before_it_starts() -> None:
    """Ten million that differ: by number and remedy, in the time of some copies; equal ones say and cost nothing."""
    t, F = np.arange(1e7), 1e-2 + 1e-3 * (np.arange(10_000_000) % 3)
    pair = {"law": "rognon_gay", "parameters": {"R": 1.0, "E": 1.0, "eta": 1.0}, "h": 1.0}
    softdyn.simulate(**pair, force=(t[:3], F[:3]), until_t=1.0, times=2)
    began = time.process_time()
    copies = [t.copy() for _ in range(4)]  # all at once: new memory takes time
    copying = time.process_time() - began
    del copies
    for end in ({"until_t": 9e6, "times": 3}, {"until_h": 1e-3}):
        began = time.process_time()
        with pytest.raises(SceneError, match=r"rows between t = 0 and \S+, .* 2000000 steps at most"):
            softdyn.simulate(**pair, force=(t, F), **end)
        assert time.process_time() - began < 10 * copying
    assert softdyn.simulate(**pair, force=(t, F), until_t=1e3, times=2).stats["steps"] >= 999
    softdyn.simulate(**pair, force=(t, np.full(len(t), 1e-2)), until_t=9e6, times=2)
    push = Push([0], [(t[:1_500_000], F[:1_500_000])])
    with pytest.raises(IntegrationError, match=r"kinks before t=1.5e\+06.* 1000000 steps at most"):
        particles.simulate(
            particles.ParticleScene(
                law="rognon_gay", parameters={"E": 1.0, "eta": 1.0}, positions=[[0.0]], radii=1.0, drag=1.0,
                push=[push], until_t=1.499999e6,
            )
        )  # fmt: skip


MESSY = st.one_of(
    st.binary(max_size=200),
    st.text(max_size=120).map(lambda text: text.encode("utf-8", "surrogatepass")),
    st.text("0123456789.,;\t \n\r#\"'eE+-xyzFt|()[]/µ\0\ufeff", max_size=200).map(lambda text: text.encode()),
    st.text("01,;\n", max_size=60).map(lambda text: ("time,force\n" + text).encode("utf-16")),
)


def outcome(read: Callable[[Path], Any], path: Path) -> Any:
    """What is read, or the refusal."""
    try:
        return read(path)
    except SceneError as error:
        return error


@pytest.mark.slow
@settings(max_examples=400, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(content=MESSY, ending=st.sampled_from(["csv", "txt", "npz", "json", "xyz"]))
def test_whatever_a_file_holds_it_is_read_or_refused(tmp_path: Path, content: bytes, ending: str) -> None:
    """Finite numbers at rising times, positions with radii, or one kind of error: nothing else comes out."""
    path = tmp_path / f"any.{ending}"
    path.write_bytes(content)
    table, placed = outcome(read_table, path), outcome(read_particles, path)
    if not isinstance(table, SceneError):
        assert np.isfinite(table.t).all()
        assert np.isfinite(table.F).all()
        assert (np.diff(table.t) >= 0).all()
    if not isinstance(placed, SceneError):
        assert len(placed["positions"]) == len(placed["radii"])
        assert np.isfinite(placed["positions"]).all()
    for refused in (table, placed):
        assert not isinstance(refused, SceneError) or str(path) in str(refused)
