"""What is measured of rigid grains is a step that bears the weight."""

from __future__ import annotations

import pytest

from softdyn.bench import rigid_bench


def test_a_column_is_measured_at_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rigid_bench, "COLUMNS", (100,))
    monkeypatch.setattr(rigid_bench, "find_spec", lambda _: None)
    lines: list[str] = []
    rigid_bench.tell_columns(lines.append)
    assert "not installed" in lines[1]
    found = rigid_bench.column_ours(100)
    assert found["lacking"] < 1e-6
    assert found["step"] > 0
