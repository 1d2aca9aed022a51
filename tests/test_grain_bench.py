"""``softdyn bench grains``: what it measures is the physics that it says, and who is missing is said."""

from __future__ import annotations

from pathlib import Path

import pytest

from softdyn.bench import grain_bench


@pytest.mark.slow
def test_a_compressed_lattice_keeps_its_six_contacts_for_each_grain() -> None:
    found = grain_bench.time_ours(4, 5)
    assert found["grains"] == 4 * 4**3
    assert found["contacts"] == 6 * found["grains"]
    assert found["each"] > 0


def test_it_tells_ratios_to_who_is_there_and_names_who_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    figures = {"grains": 4.0, "contacts": 24.0, "each": 1e-8, "memory": 1e6, "clock": 1.0}
    doubled = {"contacts": 24.0, "each": 2e-8, "memory": 2e6}
    monkeypatch.setattr(grain_bench, "CELLS", ((1, 10),))
    monkeypatch.setattr(grain_bench, "time_ours", lambda cells, steps: figures)
    monkeypatch.setattr(grain_bench, "time_lammps", lambda cells, steps: doubled)
    monkeypatch.setattr(grain_bench, "measured", lambda work, cells, steps, threads: work(cells, steps))
    monkeypatch.setattr(grain_bench, "tell_columns", lambda tell: tell("columns of rigid grains"))
    for there in (True, False):
        monkeypatch.setattr(grain_bench, "find_spec", lambda name, there=there: there or None)
        assert grain_bench.bench_grains(tmp_path) == 0
        text = (tmp_path / "grains.txt").read_text()
        assert "columns of rigid grains" in text
        assert ("ours over theirs: per contact and step 0.5, memory 0.5" in text) == there
        assert ("not installed, and so not measured: LAMMPS" in text) != there
    capsys.readouterr()
