"""What softdyn run says of many particles as it goes."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from softdyn.cli import main
from softdyn.particles import load, pressure, relative_viscosity

SCENE = """
law = "droplet"
parameters = {sigma = 1.0, eta = 2.0}
[packing]
kind = "hexagonal"
cells = [3, 2]
spacing = 1.99
radii = [1.0]
[contacts]
gap = 0.01
range = 0.1
[flow]
shear_rate = 1e-2
drag = 1.0
[until]
strain = 0.02
[output]
times = 5
[accuracy]
rtol = 1e-2
"""


def test_stress_pressure_and_viscosity_are_told_as_they_come(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """And are those of the result, at each of its times but the first."""
    (tmp_path / "scene.toml").write_text(SCENE)
    assert main(["run", str(tmp_path / "scene.toml"), "-o", str(tmp_path / "a.npz")]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if "shear stress" in line]
    result = load(tmp_path / "a.npz")
    assert len(lines) == 4
    for k, line in enumerate(lines, start=1):
        numbers = [float(text) for text in re.findall(r"-?\d[\d.]*(?:e-?\d+)?", line)]
        t, whole, contacts, p, viscosity, relative = numbers
        assert t == pytest.approx(result.t[k], rel=1e-3)
        assert contacts == pytest.approx((result.stress[k, 0, 1] + result.stress[k, 1, 0]) / 2, rel=1e-3)
        assert whole == pytest.approx(contacts + 2.0 * 1e-2, rel=1e-3)
        assert p == pytest.approx(pressure(result)[k], rel=1e-3)
        assert relative == pytest.approx(relative_viscosity(result)[k], rel=1e-3)
        assert viscosity == pytest.approx(2.0 * relative, rel=1e-3)


def test_nothing_is_told_beside_json_or_where_there_is_no_stress(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "scene.toml").write_text(SCENE)
    assert main(["run", str(tmp_path / "scene.toml"), "--json"]) == 0
    assert capsys.readouterr().out.count("\n") == 1
    assert main(["run", "two"]) == 0
    assert "shear stress" not in capsys.readouterr().out
