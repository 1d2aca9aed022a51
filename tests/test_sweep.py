"""Sweeps: the runs of simulate, all of them and each once, whatever happens on the way."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import softdyn
from softdyn.cli import main
from softdyn.errors import SceneError
from softdyn.pair import sweep as module
from softdyn.pair.pair_run import simulate_pair
from softdyn.pair.sweep import sweep
from softdyn.scene.pair_scene import Scene
from softdyn.scene.time_tables import Table
from softdyn.varied import read_values, read_varied

SCENE = Scene(
    law="rognon_gay", parameters={"R": 2.0, "E": 3.0, "eta": 0.5}, h=10.0, force=1e-2, until_h=0.1, gaps=[1.0, 0.1]
)
#: With two ends, outputs are not known before: runs are made one by one.
ONE_BY_ONE = replace(SCENE, until_t=1e30)


def alone(kappa: float, h: float) -> softdyn.PairResult:
    return simulate_pair(replace(SCENE, force=kappa * 3.0 * 4.0, h=h))


def assert_close(found: NDArray[np.float64], expected: NDArray[np.float64]) -> None:
    """Outputs of a batch are solved for to a thousandth of rtol; steps may differ, and are held to rtol."""
    np.testing.assert_allclose(found, expected, rtol=2 * SCENE.rtol)


@pytest.mark.slow
@pytest.mark.parametrize("scene", [SCENE, ONE_BY_ONE], ids=["together", "one by one"])
def test_every_combination_is_the_run_that_simulate_makes(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PART", 2)  # three parts; one by one, in processes of their own
    monkeypatch.setattr(module, "PLAIN_PART", 2)
    done = []
    kappa, h = [1e-3, 1e-2], [5.0, 10.0, 20.0]
    found = sweep(scene, {"kappa": kappa, "h": h}, progress=lambda n, total: done.append((n, total)))
    assert [n for n, _ in done] == [2, 4, 6]
    assert found.errors == {}
    for i in range(6):
        at = found.varied["kappa"][i], found.varied["h"][i]
        assert at == (kappa[i // 3], h[i % 3])
        for name, expected in alone(*at).arrays.items():
            assert_close(found.arrays[name][i], expected)


def test_a_run_that_fails_leaves_a_reason_and_the_others(tmp_path: Path) -> None:
    found = sweep(SCENE, {"force": [1e-2, -1e-2]})
    assert np.isfinite(found.arrays["t"][0]).all()
    assert np.isnan(found.arrays["t"][1]).all()
    assert "moves the gap the other way" in found.errors[1]
    table = np.genfromtxt(found.save(tmp_path / "table.csv"), delimiter=",", names=True)
    assert table.dtype.names == ("varied_force", "t", "h", "delta", "X", "a", "F")
    np.testing.assert_array_equal(table["t"][:2], found.arrays["t"][0])


def test_an_interrupted_sweep_goes_on_from_what_is_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PLAIN_PART", 1)
    folder, values = tmp_path / "parts", {"kappa": [1e-4, 1e-3, 1e-2, 1e-1]}

    def interrupt(done: int, runs: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(SCENE, values, folder=folder, progress=interrupt)
    kept = {path.name for path in folder.glob("[0-9]*.npz")}
    assert len(kept) == 2
    with pytest.raises(SceneError, match="parts of another sweep"):
        sweep(SCENE, {"kappa": [1e-4, 1e-3, 1e-2, 0.2]}, folder=folder)
    made = []
    work = module.run_part
    monkeypatch.setattr(module, "run_part", lambda task: (made.append(task[2]), work(task))[1])
    found = sweep(SCENE, values, folder=folder)
    assert {f"{first}.npz" for first in made} | kept == {f"{i}.npz" for i in range(4)}
    assert len(made) == 2
    assert not folder.exists()
    for i, kappa in enumerate(values["kappa"]):
        assert_close(found.arrays["t"][i], alone(kappa, 10.0).t)


LAW = """
from sympy import Rational
from softdyn.derive import ContactLaw
from softdyn.derive.laws.rognon_gay import law as paper

law = ContactLaw(name="changing", a=paper.a, F_ela=Rational(4, 9) * paper.F_ela, zeta=paper.zeta)
"""


def test_parts_of_a_law_that_changed_since_are_not_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PLAIN_PART", 1)
    file = tmp_path / "law.py"
    file.write_text(LAW)
    scene, values = replace(SCENE, law=file), {"kappa": [1e-3, 1e-2]}

    def interrupt(done: int, runs: int) -> None:
        raise KeyboardInterrupt

    def interrupted() -> None:
        with pytest.raises(KeyboardInterrupt):
            sweep(scene, values, folder=tmp_path / "parts", progress=interrupt)

    interrupted()
    file.write_text(LAW.replace("4, 9", "5, 9"))
    with pytest.raises(SceneError, match="before its scene, its law or softdyn itself changed"):
        sweep(scene, values, folder=tmp_path / "parts")
    file.write_text("# the same law\n" + LAW)
    assert sweep(scene, values, folder=tmp_path / "parts").errors == {}


def test_parts_of_another_table_of_forces_are_not_taken(tmp_path: Path) -> None:
    """Two tables that differ in one of many numbers, which their representations leave out."""
    t = np.arange(2001.0)
    one, other = (replace(SCENE, force=Table(t, np.where(t == 1000, F, 1e-2))) for F in (1e-2, 2e-2))
    assert module._identity(one, {"h": np.ones(1)}) != module._identity(other, {"h": np.ones(1)})


@pytest.mark.parametrize("name", ["sweep.json", "0.npz"])
@pytest.mark.parametrize("content", ["", "{}", "[1]", "\x00"])
def test_damaged_parts_are_told(tmp_path: Path, name: str, content: str) -> None:
    values = {"kappa": np.array([1e-2])}
    module._found(tmp_path / "parts", module._identity(SCENE, values), {0})
    (tmp_path / "parts" / name).write_text(content)
    with pytest.raises(SceneError, match=rf"{name} is damaged: delete the folder"):
        sweep(SCENE, values, folder=tmp_path / "parts")


@pytest.mark.slow
@pytest.mark.parametrize("address", ["nonsense", "foo://x:1"])
def test_a_scheduler_that_is_none_is_told(address: str) -> None:
    with pytest.raises(SceneError, match=f"--scheduler {address}: no Dask scheduler"):
        sweep(SCENE, {"kappa": [1e-2]}, scheduler=address)


@pytest.mark.parametrize(
    ("text", "name", "values"),
    [
        ("kappa=logspace(-6, -2, 3)", "kappa", [1e-6, 1e-4, 1e-2]),
        ("h = linspace(1,2,3)", "h", [1.0, 1.5, 2.0]),
        ("E=1,2.5", "E", [1.0, 2.5]),
    ],
)
def test_values_are_read(text: str, name: str, values: list[float]) -> None:
    found, array = read_values(text)
    assert found == name
    np.testing.assert_allclose(array, values, rtol=1e-15)


@pytest.mark.parametrize(
    "text",
    ["kappa", "=1", "h=", "h=logspace(1,2)", "h=logspace(1,2,0)", "h=__import__('os')", "h=logspace(-6,nan,5)",
     "h=logspace(0,999,5)", "h=linspace(0,inf,5)"],
)  # fmt: skip
def test_what_is_no_list_of_values_is_refused(text: str) -> None:
    with pytest.raises(SceneError, match="is expected"):
        read_values(text)


def test_a_name_is_varied_once() -> None:
    assert list(read_varied(["h=1", "E=2"])) == ["h", "E"]
    with pytest.raises(SceneError, match="--vary h is given twice"):
        read_varied(["h=1", "E=2", " h = 3"])


def test_a_scene_whose_parameters_have_no_names_is_refused() -> None:
    with pytest.raises(SceneError, match=r"\[parameters\] must map names to numbers, not \[1, 2\]"):
        sweep(replace(SCENE, parameters=[1, 2]), {"kappa": [1e-2]})  # type: ignore[arg-type]


def test_kappa_is_varied_where_there_is_a_force() -> None:
    with pytest.raises(SceneError, match=r"kappa stands for a force kappa E R\^2: give the scene a force"):
        sweep(replace(SCENE, force=None, velocity=-1e-3), {"kappa": [1e-2]})


def test_what_a_scene_does_not_have_cannot_be_varied() -> None:
    with pytest.raises(SceneError, match=r"'etta' cannot be varied in this scene; did you mean 'eta'"):
        sweep(SCENE, {"etta": [1.0]})


def test_the_command_writes_one_table(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(
        'law = "rognon_gay"\nparameters = {R = 1, E = 1, eta = 1}\n[pair]\nh = 10.0\n[drive]\nforce = 1e-2\n'
        "[until]\nh = 0.1\n[output]\ngaps = [1.0, 0.1]\n"
    )
    command = [
        sys.executable,
        "-m",
        "softdyn",
        "sweep",
        "scene.toml",
        "--vary",
        "kappa=logspace(-3,-1,3)",
        "-o",
        "t.npz",
    ]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert "3 runs, 0 of them failed" in done.stdout
    with np.load(tmp_path / "t.npz") as table:
        np.testing.assert_allclose(table["varied_kappa"], [1e-3, 1e-2, 1e-1])
        assert table["t"].shape == (3, 2)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["scene.toml", "t.npz"]
    with pytest.raises(SceneError, match="it holds no run; the table of a sweep is for numpy"):
        softdyn.load_result(tmp_path / "t.npz")


def worker_processes(address: str) -> dict[str, int]:
    """Process ids of the workers of a Dask cluster, by their addresses."""
    from distributed import Client

    with Client(address) as client:
        return client.run(os.getpid)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_that_loses_a_worker_loses_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    import distributed

    monkeypatch.setattr(module, "PART", 50)
    values = {"kappa": np.geomspace(1e-6, 0.3, 2000)}
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        pids = list(worker_processes(cluster.scheduler_address).values())
        progress: list[int] = []

        def kill_one(done: int, runs: int) -> None:
            progress.append(done)
            if len(progress) == 3:
                os.kill(pids[0], signal.SIGKILL)
                time.sleep(0.2)

        found = sweep(ONE_BY_ONE, values, scheduler=cluster.scheduler_address, progress=kill_one)
    assert progress == list(range(50, 2001, 50))
    here = sweep(SCENE, values)
    for name, array in here.arrays.items():
        assert_close(found.arrays[name], array)


@pytest.mark.parametrize(
    ("vary", "outputs", "words"),
    [
        (["force=linspace(1,2,10000000)", "h=linspace(1,2,10000000)"], "", "100000000000000 runs: a table of"),
        (["force=linspace(1,2,10000000)", "h=1,2,3,4,5"], "times = 10000000", "10000000 outputs of each: a table of"),
        (["force=linspace(1,2,10000)", "h=linspace(1,2,10000)"], "gaps = 10000", "of memory: vary fewer values"),
    ],
)
def test_a_sweep_that_is_too_large_is_refused_at_once(
    vary: list[str], outputs: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(
        'law = "rognon_gay"\nparameters = {R = 1.0, E = 1.0, eta = 1.0}\npair = {h = 1.0}\ndrive = {force = 0.01}\n'
        f"until = {{h = 0.1}}\n[output]\n{outputs}\n"
    )
    began = time.process_time()
    arguments = [word for values in vary for word in ("--vary", values)]
    assert main(["sweep", str(path), *arguments, "-o", str(tmp_path / "t.npz")]) == 2
    assert time.process_time() - began < 5
    assert words in capsys.readouterr().err.splitlines()[-1]
    assert list(tmp_path.iterdir()) == [path]


def test_a_sweep_says_how_large_it_is_before_it_starts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(
        'law = "rognon_gay"\nparameters = {R = 1.0, E = 1.0, eta = 1.0}\npair = {h = 1.0}\ndrive = {force = 0.01}\n'
        "until = {h = 0.1}\noutput = {gaps = 20}\n"
    )
    assert main(["sweep", str(path), "--vary", "force=logspace(-3,-2,100)", "-o", str(tmp_path / "t.npz")]) == 0
    said = capsys.readouterr().err
    assert "softdyn: 100 runs, 20 outputs of each: a table of 96.8 kB" in said
    with np.load(tmp_path / "t.npz") as table:
        numbers = sum(table[name].size for name in table.files if table[name].dtype == float)
    assert 8 * numbers == 96_800
