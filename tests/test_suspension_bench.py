"""``softdyn bench suspension``: what it measures are steps that balance, and what is missing is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from softdyn.bench import suspension_bench


@pytest.mark.slow
def test_steps_of_the_depot_are_solved_and_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(suspension_bench, "STEPS", 4)
    found = suspension_bench.time_ours(20, "40")
    x, radius = suspension_bench.discs(40)
    assert found["grains"] == len(x) == 600
    assert found["residual"] < 1e-10
    assert found["flows"] >= 1
    assert 0 < found["projection"] < found["step"]
    # they touch nothing, and are in the box
    assert np.diff(np.unique(np.round(x[:, 0], 9))).min() > 2 * radius
    assert x.min() > radius
    assert (x[:, 1] + radius < suspension_bench.HEIGHT).all()


def test_it_tells_ratios_and_names_who_is_not_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    ours = {
        "grains": 600.0, "step": 0.01, "memory": 1e7, "projection": 1e-6, "residual": 1e-13, "flows": 3.0,
        "substeps": 1.0,
    }  # fmt: skip
    monkeypatch.setattr(suspension_bench, "CASES", ((20, 40),))
    monkeypatch.setattr(suspension_bench, "measured", lambda work, cells, across: work(cells, across))
    monkeypatch.setattr(suspension_bench, "time_ours", lambda *_: ours)
    twice = {name: 2 * ours[name] for name in ("grains", "step", "memory", "projection")}
    peers = {"nobody": ("no_such_package", suspension_bench.time_migflow), "twice": ("numpy", lambda *_: twice)}
    monkeypatch.setattr(suspension_bench, "PEERS", peers)
    assert suspension_bench.bench_suspension(tmp_path) == 0
    text = (tmp_path / "suspension.txt").read_text()
    assert capsys.readouterr().out.strip() in text
    assert "not installed, and so not measured: nobody" in text
    assert "600 discs, 1200 triangles: step 10 ms, memory 10 MB, projection 1 us a grain; 3 flows" in text
    assert "twice: step 20 ms, memory 20 MB, projection 2 us a grain; ours over theirs: step 0.5, memory 0.5" in text
