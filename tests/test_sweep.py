"""Sweeps: the runs of simulate, all of them and each once, whatever happens on the way."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softdyn
from softdyn import sweep as module
from softdyn.errors import SceneError
from softdyn.scene import Scene
from softdyn.sweep import read_values, sweep

SCENE = Scene(
    law="rognon_gay", parameters={"R": 2.0, "E": 3.0, "eta": 0.5}, h=10.0, force=1e-2, until_h=0.1, gaps=[1.0, 0.1]
)


def alone(kappa: float, h: float) -> softdyn.PairResult:
    return softdyn.simulate(**{**vars(SCENE), "force": kappa * 3.0 * 4.0, "h": h})


def test_every_combination_is_the_run_that_simulate_makes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PART", 2)  # three parts, in processes of their own
    done = []
    kappa, h = [1e-3, 1e-2], [5.0, 10.0, 20.0]
    found = sweep(SCENE, {"kappa": kappa, "h": h}, progress=lambda n, total: done.append((n, total)))
    assert [n for n, _ in done] == [2, 4, 6]
    assert found.errors == {}
    for i in range(6):
        at = found.varied["kappa"][i], found.varied["h"][i]
        assert at == (kappa[i // 3], h[i % 3])
        for name, expected in alone(*at).arrays.items():
            np.testing.assert_array_equal(found.arrays[name][i], expected)


def test_a_run_that_fails_leaves_a_reason_and_the_others(tmp_path: Path) -> None:
    found = sweep(SCENE, {"force": [1e-2, -1e-2]})
    assert np.isfinite(found.arrays["t"][0]).all()
    assert np.isnan(found.arrays["t"][1]).all()
    assert "moves the gap the other way" in found.errors[1]
    table = np.genfromtxt(found.save(tmp_path / "table.csv"), delimiter=",", names=True)
    assert table.dtype.names == ("force", "t", "h", "delta", "X", "a", "F")
    np.testing.assert_array_equal(table["t"][:2], found.arrays["t"][0])


def test_an_interrupted_sweep_goes_on_from_what_is_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PART", 1)
    folder, values = tmp_path / "parts", {"kappa": [1e-4, 1e-3, 1e-2, 1e-1]}

    def interrupt(done: int, runs: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(SCENE, values, folder=folder, progress=interrupt)
    kept = {path.name for path in folder.glob("[0-9]*.json")}
    assert len(kept) == 2
    with pytest.raises(SceneError, match="parts of another sweep"):
        sweep(SCENE, {"kappa": [1e-4, 1e-3, 1e-2, 0.2]}, folder=folder)
    made = []
    original = module._made
    monkeypatch.setattr(module, "_made", lambda tasks, at: (made.append(task[2]) or part for task in tasks for part in original([task], at)))  # fmt: skip  # noqa: E501
    found = sweep(SCENE, values, folder=folder)
    assert {f"{first}.json" for first in made} | kept == {f"{i}.json" for i in range(4)}
    assert len(made) == 2
    assert not folder.exists()
    for i, kappa in enumerate(values["kappa"]):
        np.testing.assert_array_equal(found.arrays["t"][i], alone(kappa, 10.0).t)


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


@pytest.mark.parametrize("text", ["kappa", "=1", "h=", "h=logspace(1,2)", "h=logspace(1,2,0)", "h=__import__('os')"])
def test_what_is_no_list_of_values_is_refused(text: str) -> None:
    with pytest.raises(SceneError, match="is expected"):
        read_values(text)


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


def worker_processes(address: str) -> dict[str, int]:
    """Process ids of the workers of a Dask cluster, by their addresses."""
    from distributed import Client

    with Client(address) as client:
        return client.run(os.getpid)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_that_loses_a_worker_loses_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    distributed: Any = pytest.importorskip("distributed")
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

        found = sweep(SCENE, values, scheduler=cluster.scheduler_address, progress=kill_one)
    assert progress == list(range(50, 2001, 50))
    here = sweep(SCENE, values)
    for name, array in here.arrays.items():
        np.testing.assert_array_equal(found.arrays[name], array)
