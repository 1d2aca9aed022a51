"""Sweeps of scenes of many particles: every run once, whatever ends the work, and each by its name."""

from __future__ import annotations

import csv
import os
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import numpy as np
import pytest

from softdyn.cli import main
from softdyn.errors import SceneError
from softdyn.particles import ParticleScene, load
from softdyn.rheology import runs as module
from softdyn.rheology.run_table import gathered, measured_run
from softdyn.rheology.runs import carry_out, planned, states
from softdyn.scene.stock_scenes import particle_scenes
from softdyn.scene.varied_content import with_values

SCENE = """
law = "droplet"
[parameters]
sigma = 1.0
eta = 1.0
[packing]
kind = "hexagonal"
cells = [3, 2]
spacing = 1.99
radii = [1.0]
[contacts]
gap = 0.02
range = 0.5
[flow]
shear_rate = 1e-3
drag = 1.0
[until]
strain = 0.02
[output]
times = 40
[accuracy]
rtol = 1e-2
"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    (tmp_path / "scene.toml").write_text(SCENE)
    return tmp_path / "scene.toml"


def content() -> dict[str, object]:
    return tomllib.loads(SCENE)


@pytest.mark.parametrize(
    ("name", "section", "key"),
    [
        ("shear_rate", "flow", "shear_rate"),
        ("flow.shear_rate", "flow", "shear_rate"),
        ("packing.spacing", "packing", "spacing"),
        ("spacing", "packing", "spacing"),
        ("until_strain", "until", "strain"),
        ("until.t", "until", "t"),
        ("stress.xy", "stress", "xy"),
        ("sigma", "parameters", "sigma"),
        ("parameters.eta", "parameters", "eta"),
        ("gap", "contacts", "gap"),
    ],
)
def test_numbers_have_the_names_of_their_keys(name: str, section: str, key: str) -> None:
    before = content()
    found = with_values(ParticleScene, before, {name: 0.25})
    assert found[section][key] == 0.25
    assert before == content()  # left as it was


def test_whole_numbers_stay_whole() -> None:
    given = tomllib.loads(particle_scenes()["emulsion"].read_text())
    found = with_values(ParticleScene, given, {"packing.seed": 3.0, "output.times": 20.0})
    assert found["packing"]["seed"] == 3
    assert isinstance(found["packing"]["seed"], int)
    assert isinstance(found["output"]["times"], int)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("shear_rat", 1.0, "did you mean 'shear_rate'"),
        ("packing.fracton", 1.0, "did you mean 'packing.fraction'"),
        ("packing.seed", 1.5, "packing.seed must be a whole number, 0 or larger, not 1.5"),
        ("contacts.gap", -1.0, "contacts.gap must be a positive number"),
        ("box.lengths", 1.0, "box.lengths cannot be varied: it is a list of numbers"),
        ("push.force", 1.0, r"\[\[push\]\] is a list"),
        ("law", 1.0, "law is no number of this scene"),
        ("viscosty", 1.0, "viscosity"),
    ],
)
def test_what_cannot_be_varied_is_told(name: str, value: float, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        with_values(ParticleScene, content(), {name: value})


def test_a_name_of_two_things_is_refused() -> None:
    given = content() | {"constants": {"gap": 1.0}}
    with pytest.raises(SceneError, match=r"gap may mean contacts\.gap or constants\.gap: say which"):
        with_values(ParticleScene, given, {"gap": 1.0})


@pytest.mark.slow
def test_each_run_is_that_of_its_scene_and_a_failure_is_named(scene: Path, tmp_path: Path) -> None:
    """The table has a row for each combination; a box that is too small for its range is no scene."""
    vary = {"shear_rate": np.array([1e-3, 2e-3]), "packing.spacing": np.array([0.9, 1.99])}
    runs = planned(content(), tmp_path, tmp_path / "t.runs", vary)
    failed = carry_out(runs)
    assert sorted(failed) == [0, 2]
    assert "too small" in failed[0]
    table = gathered(runs, vary, measured_run)
    assert table.failed.keys() == failed.keys()
    np.testing.assert_array_equal(table.varied["shear_rate"], [1e-3, 1e-3, 2e-3, 2e-3])
    for run in (1, 3):
        result = load(runs[run].result)
        rate = table.varied["shear_rate"][run]
        assert result.gradient[-1, 0, 1] == rate
        assert table.columns["strain_end"][run] == pytest.approx(0.02)
        contacts = result.stress[-1, 0, 1]
        assert table.columns["shear_stress_end"][run] == pytest.approx(contacts + rate)  # and eta = 1 of the fluid
        assert table.columns["pressure_end"][run] == pytest.approx(-np.trace(result.stress[-1]) / 2)
    assert np.isnan(table.columns["shear_stress_end"][0])


@pytest.mark.slow
def test_what_is_done_is_not_done_again(scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    vary = {"shear_rate": np.array([1e-3, 2e-3, 3e-3])}
    runs = planned(content(), tmp_path, tmp_path / "t.runs", vary)
    carry_out(runs, only=1)
    assert [run.number for run in states(runs)[0]] == [1]
    assert states(runs)[2] == [0, 2]
    made: list[int] = []
    work = module.make
    monkeypatch.setattr(module, "make", lambda run: (made.append(run.number), work(run))[1])
    monkeypatch.setattr(
        module, "carried_out", lambda work, tasks, scheduler, laws: ((task, work(task)) for task in tasks)
    )
    carry_out(runs)
    assert made == [0, 2]
    carry_out(runs)
    assert made == [0, 2]


@pytest.mark.slow
def test_results_of_another_sweep_are_not_taken(scene: Path, tmp_path: Path) -> None:
    folder = tmp_path / "t.runs"
    carry_out(planned(content(), tmp_path, folder, {"shear_rate": np.array([1e-3])}))
    with pytest.raises(SceneError, match="another sweep"):
        carry_out(planned(content(), tmp_path, folder, {"shear_rate": np.array([2e-3])}))


@pytest.mark.slow
def test_a_table_is_saved_as_csv_and_as_arrays_over_what_was_varied(scene: Path, tmp_path: Path) -> None:
    vary = {"shear_rate": np.array([1e-3, 2e-3]), "packing.spacing": np.array([1.98, 1.99])}
    runs = planned(content(), tmp_path, tmp_path / "t.runs", vary)
    carry_out(runs)
    table = gathered(runs, vary, measured_run)
    rows = list(csv.DictReader(table.save(tmp_path / "t.csv").read_text().splitlines()))
    assert [float(row["varied_packing.spacing"]) for row in rows] == [1.98, 1.99, 1.98, 1.99]
    assert float(rows[3]["pressure_end"]) == table.columns["pressure_end"][3]
    xarray = pytest.importorskip("xarray")
    with xarray.open_dataset(table.save(tmp_path / "t.nc"), engine="scipy") as data:
        found = data["pressure_end"].sel(shear_rate=2e-3, packing_spacing=1.98)
        assert float(found) == table.columns["pressure_end"][2]
    with pytest.raises(SceneError, match="the ending of a table"):
        table.save(tmp_path / "t.xlsx")


@pytest.mark.slow
def test_the_script_for_slurm_makes_what_the_command_makes(scene: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "softdyn", "sweep", "scene.toml", "--vary", "shear_rate=1e-3,2e-3", "-o", "t.csv"]
    printed = subprocess.run([*command, "--array"], cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert "#SBATCH --array=0-1\n" in printed
    assert not (tmp_path / "t.runs").exists()
    script = printed.replace("exec softdyn", f"exec {sys.executable} -m softdyn")
    early = subprocess.run([*command, "--gather"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert early.returncode == 1
    assert "2 not made yet" in early.stdout
    for task in ("1", "0"):
        environment = {**os.environ, "SLURM_ARRAY_TASK_ID": task}
        subprocess.run(["bash", "-c", script], cwd=tmp_path, env=environment, check=True)
    subprocess.run([*command, "--gather"], cwd=tmp_path, check=True)
    apart = (tmp_path / "t.csv").read_text()
    command[-1] = "u.csv"
    subprocess.run(command, cwd=tmp_path, check=True)
    assert (tmp_path / "u.csv").read_text() == apart


SWEEP = [sys.executable, "-m", "softdyn", "sweep", "scene.toml", "--vary", "packing.seed=1..4"]


def write_emulsion(folder: Path) -> None:
    text = particle_scenes()["emulsion"].read_text()
    for old, new in (("count = 1000", "count = 20"), ("2.0\n", "0.2\n"), ("times = 81", "times = 11")):
        text = text.replace(old, new)
    (folder / "scene.toml").write_text(text)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The table of a sweep that nobody stopped."""
    folder = tmp_path_factory.mktemp("undisturbed")
    write_emulsion(folder)
    subprocess.run([*SWEEP, "-o", "t.csv"], cwd=folder, check=True)
    return (folder / "t.csv").read_text()


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_a_sweep_that_is_killed_goes_on(how: signal.Signals, undisturbed: str, tmp_path: Path) -> None:
    """Results that are there are kept to the byte, and the end is that of a sweep that nobody stopped."""
    write_emulsion(tmp_path)
    running = subprocess.Popen([*SWEEP, "-o", "t.csv"], cwd=tmp_path, start_new_session=True)
    folder = tmp_path / "t.runs"
    deadline = time.monotonic() + 120
    while not list(folder.glob("000?.npz")) and time.monotonic() < deadline:
        time.sleep(0.1)
    if how == signal.SIGKILL:
        os.killpg(running.pid, how)
    else:
        running.send_signal(how)
    running.wait(timeout=60)
    kept = {path: path.stat().st_mtime_ns for path in folder.glob("000?.npz")}
    assert 1 <= len(kept) < 4
    subprocess.run([*SWEEP, "-o", "t.csv"], cwd=tmp_path, check=True)
    assert all(path.stat().st_mtime_ns == when for path, when in kept.items())
    assert (tmp_path / "t.csv").read_text() == undisturbed


def test_a_task_that_there_is_not_is_refused(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = ["sweep", str(scene), "--vary", "shear_rate=1e-3,2e-3", "-o", str(scene.parent / "t.csv"), "--task", "2"]
    assert main(given) == 2
    assert "there are the runs 0 to 1" in capsys.readouterr().err
