"""The duration of a T1 process against the first separations."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from softdyn.cli import main
from softdyn.particles import t1


@pytest.mark.parametrize("force", [5e-4, 5e-3])
def test_from_small_gaps_a_swap_takes_as_long_as_the_parting_pair_alone(force: float) -> None:
    """The time is spent while the rhombus has its first shape, but for deflections: (9 kappa/(4 sqrt 2))^(2/3) of R."""
    duration, _ = t1.swap(force, 1e-3)
    assert duration == pytest.approx(t1.pair_alone(force, 1e-3), rel=(9 * force / (4 * np.sqrt(2))) ** (2 / 3))


@pytest.mark.slow
def test_durations_are_drawn_from_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reproduce", "t1", "-o", str(tmp_path)]) == 0
    words = capsys.readouterr().out
    assert all((tmp_path / name).stat().st_size > 1000 for name in t1.FILES)
    with (tmp_path / "t1.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(t1.FORCES) * len(t1.GAPS)
    duration = np.array([float(row["duration"]) for row in rows]).reshape(len(t1.FORCES), -1)
    assert np.all(np.diff(duration, axis=1) < 0)
    # a pulled film that is flat thickens as h^3: the slope of the duration is -2 where h0 << deflection
    slope = np.log(duration[2, 0] / duration[2, 2]) / np.log(t1.GAPS[0] / t1.GAPS[2])
    assert slope == pytest.approx(-2, abs=0.1)
    times = duration[1, 2] / duration[1, 4]
    assert f"{times:.3g} times as long" in words
    assert times > 4
