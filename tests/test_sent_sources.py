"""Tasks that go to other machines compute the law that they were sent with, or refuse."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softdyn import sent_sources
from softdyn.errors import SceneError
from softdyn.laws import find, law_of
from softdyn.pair.pair_run import simulate_pair
from softdyn.pair.sweep import run_part, sweep
from softdyn.rheology.runs import carry_out, planned
from softdyn.scene.pair_scene import Scene
from softdyn.sent_sources import Sources, laws_in, sources, with_sources

LAW = """
from sympy import Abs, sqrt
from softdyn.derive import ContactLaw
from softdyn.derive.symbols import E, R, a, delta, eta, h
from mine import numbers

law = ContactLaw(name="mylaw", a=sqrt(2*R*(h + Abs(delta))), F_ela=numbers.FACTOR*E*a*delta, zeta=eta*a**4/h**3)
"""
PARAMETERS = {"R": 1.0, "E": 1.0, "eta": 1.0}
VALUES = {"h": np.array([0.5, 1.0])}


def law_in(folder: Path, factor: str) -> Path:
    """A law file with a package beside it."""
    (folder / "mine" / "deep").mkdir(parents=True)
    (folder / "mine" / "__init__.py").write_text("")
    (folder / "mine" / "deep" / "__init__.py").write_text(f"FACTOR = {factor}\n")
    (folder / "mine" / "numbers.py").write_text("from mine.deep import FACTOR\n")
    path = folder / "mylaw.py"
    path.write_text(LAW)
    return path


def scene_of(law: str) -> Scene:
    """Surfaces that are pressed together."""
    return Scene(law=law, parameters=PARAMETERS, h=1.0, force=1e-2, until_t=1.0)


@pytest.fixture
def places(tmp_path: Path) -> Callable[[str], Path]:
    """Folders: of who sends, of a worker that has nothing, and of one that has another law of that name."""
    law_in(tmp_path / "sender", "2")
    law_in(tmp_path / "impostor", "77")
    (tmp_path / "empty").mkdir()
    return lambda name: tmp_path / name


@pytest.fixture
def sent(places: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch) -> Sources:
    monkeypatch.chdir(places("sender"))
    return sources(["mylaw.py"])


def test_a_law_goes_with_all_that_it_imports(sent: Sources) -> None:
    (digest, files) = sent.files["mylaw.py"]
    assert list(files) == ["mylaw.py", "mine/__init__.py", "mine/deep/__init__.py", "mine/numbers.py"]
    assert digest == sent_sources.digest_of(files)
    assert not sources(["rognon_gay"]).files


@pytest.mark.slow
@pytest.mark.parametrize("where", ["impostor", pytest.param("empty", marks=pytest.mark.slow)])
def test_a_worker_computes_the_law_that_was_sent(
    where: str, sent: Sources, places: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever its folder holds, and from a file of the sender's folder that is gone by now."""
    here = simulate_pair(replace(scene_of("mylaw.py"), h=0.5)).arrays
    monkeypatch.chdir(places(where))
    if where == "impostor":
        other = simulate_pair(replace(scene_of("mylaw.py"), h=0.5)).arrays
        assert abs(other["delta"][-1] / here["delta"][-1] - 1) > 0.1
    else:
        with pytest.raises(SceneError, match="there is no file"):
            find("mylaw.py")
    (places("sender") / "mylaw.py").unlink()
    part = with_sources(run_part, (scene_of("mylaw.py"), VALUES, 0, 2), sent)
    assert not part.errors
    for name in ("delta", "X"):
        assert part.arrays[name][0, -1] == here[name][-1]


def test_names_within_a_file_and_full_paths_are_sent_too(places: Callable[[str], Path]) -> None:
    text = f"{places('sender') / 'mylaw.py'}:law"
    given = sources([text])
    assert list(given.files) == [str(places("sender") / "mylaw.py")]
    (places("sender") / "mylaw.py").unlink()
    assert with_sources(lambda law: law_of(law).name, text, given) == "mylaw"


def test_what_a_scene_file_names_is_found_wherever_it_stands() -> None:
    content: Any = {"law": "mylaw.py", "bond": [{"potential": "in/bonds.py:stiff"}], "particles": {"file": "a.npz"}}
    assert laws_in(content, Path("/at")) == ["/at/mylaw.py", "/at/in/bonds.py:stiff"]


def test_another_tool_or_another_text_is_refused(sent: Sources) -> None:
    with pytest.raises(SceneError, match="would write other kernels: install the same on all machines"):
        with_sources(len, [], replace(sent, tool="older"))
    digest, files = sent.files["mylaw.py"]
    forged = {**files, "mylaw.py": files["mylaw.py"] + b"\n"}
    with pytest.raises(SceneError, match=r"law file mylaw\.py is not what was sent"):
        with_sources(len, [], replace(sent, files={"mylaw.py": (digest, forged)}))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_workers_of_a_cluster_need_no_file_and_take_no_other(
    places: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of pairs, and of particles, whose results are where the sender asked for them."""
    import distributed

    monkeypatch.chdir(places("sender"))
    values = {"h": np.linspace(0.5, 1.0, 400)}
    here = sweep(scene_of("mylaw.py"), values)
    content = {
        "law": "mylaw.py",
        "parameters": {"E": 1.0, "eta": 1.0},
        "particles": {"positions": [[0.0, 0.0], [1.9, 0.0]], "radii": 1.0},
        "contacts": {"gap": 0.1, "range": 0.5},
        "flow": {"drag": 1.0},
        "until": {"t": 1.0},
    }
    runs = planned(content, Path("."), Path("t.runs"), {"until.t": np.array([1.0, 2.0])})
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        address = cluster.scheduler_address
        with distributed.Client(address) as client:
            workers = list(client.scheduler_info()["workers"])
            for worker, where in zip(workers, ("empty", "impostor"), strict=True):
                client.run(os.chdir, str(places(where)), workers=[worker])
        monkeypatch.setattr("softdyn.pair.sweep.PART", 50)
        monkeypatch.setattr("softdyn.pair.sweep.is_plain", lambda scene: False)
        found = sweep(scene_of("mylaw.py"), values, scheduler=address)
        failed = carry_out(runs, scheduler=address)
        with monkeypatch.context() as patch:
            patch.setattr(sent_sources, "tool_digest", lambda: "older")
            with pytest.raises(SceneError, match="would write other kernels"):
                sweep(scene_of("mylaw.py"), values, scheduler=address)
    for name, array in here.arrays.items():
        assert np.array_equal(found.arrays[name], array)
    assert failed == {}
    assert all(run.result.is_file() for run in runs)
    assert [*places("empty").iterdir()] == []
