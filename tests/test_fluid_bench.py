"""``softdyn bench fluid``: what it measures is a step that solves its equations, and what is missing is said."""

from __future__ import annotations

from pathlib import Path

import pytest

from softdyn.bench import fluid_bench
from softdyn.errors import SceneError


@pytest.mark.slow
@pytest.mark.parametrize("elements", fluid_bench.ELEMENTS)
def test_a_step_is_solved_to_rounding_and_costs_more_than_its_assembly(elements: str) -> None:
    found = fluid_bench.time_ours(8, elements)
    nodes = {"P1-P1": 9**2, "P2-P1": 17**2}[elements]
    assert found["unknowns"] == 2 * nodes + 9**2
    assert found["residual"] < 1e-12
    assert 0 < found["assembly"] < found["step"]


def test_it_tells_ratios_to_who_is_there_and_names_who_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("skfem")
    monkeypatch.setattr(fluid_bench, "CELLS", (4,))
    monkeypatch.setattr(fluid_bench, "measured", lambda work, cells, elements: work(cells, elements))
    monkeypatch.setattr(fluid_bench, "time_ours", lambda *_: {"unknowns": 1.0, "assembly": 1.0, "residual": 0.0})
    peers = {"nobody": ("no_such_package", fluid_bench.time_migflow), "twice": ("skfem", lambda *_: {"assembly": 2.0})}
    monkeypatch.setattr(fluid_bench, "PEERS", peers)
    assert fluid_bench.bench_fluid(tmp_path) == 0
    text = (tmp_path / "fluid.txt").read_text()
    assert capsys.readouterr().out.strip() in text
    assert "not installed, and so not measured: nobody" in text
    assert text.count("twice: assembly 2e+03 ms; ours over theirs: assembly 0.5") == 2
    assert not list(tmp_path.glob("*.partial.txt"))


def test_a_folder_that_is_none_is_refused_before_anything_is_measured(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(SceneError, match="file"):
        fluid_bench.bench_fluid(tmp_path / "file")
