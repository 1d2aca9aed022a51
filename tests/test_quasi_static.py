"""Quasi-static compression and shear of a lattice, whose pressure and moduli are known by hand."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

from softdyn.cli import main
from softdyn.errors import SceneError
from softdyn.rheology.curves import gathered_curves
from softdyn.rheology.quasi_static import (
    Protocol,
    check_protocol,
    deformed,
    jamming_point,
    make_protocol,
    protocol_curve,
    state_file,
)
from softdyn.rheology.runs import Run, carry_out, planned

LATTICE = """
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
gap = 1e-5
range = 0.1
[flow]
drag = 1.0
[until]
t = 1.0
[accuracy]
rtol = 1e-5
"""
#: Fraction at which the discs touch: pi/(2 sqrt 3).
TOUCHING = math.pi / (2 * math.sqrt(3))


def test_a_box_is_deformed_with_all_that_is_in_it() -> None:
    start = {"positions": np.array([[1.0, 2.0], [3.0, 1.0]]), "box": [4.0, 3.0], "tilt": 0.5, "films": {"h": [1.0]}}
    gradient = np.array([[0.9, 0.2], [0.0, 0.9]])
    found = deformed(start, gradient)
    np.testing.assert_allclose(found["positions"], [[0.9 + 0.4, 1.8], [2.7 + 0.2, 0.9]])
    np.testing.assert_allclose(found["box"], [3.6, 2.7])
    assert found["tilt"] == pytest.approx(0.9 * 0.5 + 0.2 * 3.0)
    assert found["films"] == start["films"]


@pytest.mark.parametrize("exponent", [1.0, 1.5])
def test_the_jamming_point_of_a_power_law_is_found(exponent: float) -> None:
    phi = np.linspace(0.82, 0.9, 17)
    pressure = 3.0 * np.maximum(phi - 0.8417, 0.0) ** exponent
    point = jamming_point(phi, pressure)
    assert (point.below, point.above) == pytest.approx((0.84, 0.845))
    assert point.fraction == pytest.approx(0.8417, abs=1e-6)
    assert point.exponent == pytest.approx(exponent, rel=1e-4)
    noisy = jamming_point(phi, pressure * (1 + 0.02 * np.random.default_rng(1).standard_normal(len(phi))))
    assert abs(noisy.fraction - 0.8417) < 4 * noisy.error < 0.01


def test_what_does_not_tell_a_jamming_point_tells_none() -> None:
    few = jamming_point([0.8, 0.82, 0.84], [0.0, 0.0, 0.1])
    assert (few.below, few.above) == (0.82, 0.84)
    assert math.isnan(few.fraction)
    assert math.isnan(jamming_point([0.7, 0.71], [0.0, 0.0]).above)


@pytest.mark.parametrize(
    ("fractions", "strains", "probe", "rest", "words"),
    [
        ((0.8, 0.9), (), 0.0, 1.0, "a step is 0.05 of the fraction at most"),
        ((0.8, 0.8), (), 0.0, 1.0, "and not 0"),
        ((0.8,), (0.1,), 0.0, 1.0, "a step is 0.05 at most"),
        ((0.8,), (), 0.1, 1.0, "--probe 0.1"),
        ((0.8,), (), 0.0, 0.0, "--rest 0"),
    ],
)
def test_protocols_that_cannot_be_are_refused(
    fractions: tuple[float, ...], strains: tuple[float, ...], probe: float, rest: float, words: str
) -> None:
    with pytest.raises(SceneError, match=words):
        check_protocol(Protocol(fractions, strains, probe, rest))


@pytest.mark.slow
def test_a_lattice_is_compressed_and_sheared_as_by_hand(tmp_path: Path) -> None:
    """P = sqrt(3) F/r and G = (sqrt 3/4)(k - 3 F/r), of the layer's depth of 2; F = 2 pi (2 - r), k = 2 pi.

    Films are 1e-5 thick at most: of a pressure by overlaps of 0.01 and more they make 1e-3.
    """
    fractions, strains = (0.92, 0.94, 0.96), (0.002, 0.004)
    protocol = vars(Protocol(fractions, strains, 1e-4, 10.0))
    runs = planned(tomllib.loads(LATTICE), tmp_path, tmp_path / "t.runs", {}, None, protocol)
    assert carry_out(runs, work=make_protocol) == {}
    curve = gathered_curves(runs, {}, protocol_curve).curves[0]
    np.testing.assert_allclose(curve["fraction"], [*fractions, 0.96, 0.96])
    r = 2 * np.sqrt(TOUCHING / np.array(fractions))
    F, k = 2 * math.pi * (2 - r), 2 * math.pi
    np.testing.assert_allclose(curve["pressure"][:3], math.sqrt(3) * F / r / 2, rtol=2e-3)
    modulus = math.sqrt(3) / 4 * (k - 3 * F / r) / 2
    np.testing.assert_allclose(curve["shear_modulus"][:3], modulus, rtol=2e-3)
    np.testing.assert_allclose(curve["shear_stress"][3:], modulus[-1] * np.array(strains), rtol=5e-3)
    np.testing.assert_array_equal(curve["coordination"], 6)
    assert curve["settled"].all()

    # a state that is there is kept: the same protocol, stopped after the second state, ends the same
    run = runs[0]
    run.result.unlink()
    for state in (2, 3, 4):
        state_file(run, state).unlink()
    kept = state_file(run, 1).stat().st_mtime_ns
    carry_out(runs, work=make_protocol)
    assert state_file(run, 1).stat().st_mtime_ns == kept
    again = gathered_curves(runs, {}, protocol_curve).curves[0]
    for name, values in curve.items():
        np.testing.assert_array_equal(values, again[name])


def test_scenes_whose_box_cannot_be_moved_fail_by_name(tmp_path: Path) -> None:
    content = tomllib.loads(LATTICE) | {"stress": {"pressure": 1.0}}
    protocol = vars(Protocol((0.92,), (), 0.0, 1.0))
    run = Run(0, {}, content, tmp_path, tmp_path / "t.runs", protocol)
    assert "leave [stress]" in make_protocol(run)
    assert "leave [stress]" in run.failure.read_text()


def test_the_command_writes_states_and_a_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "lattice.toml").write_text(LATTICE.replace("rtol = 1e-5", "rtol = 1e-2"))
    arguments = ["compress", str(tmp_path / "lattice.toml"), "--fractions", "0.92,0.93", "--rest", "1", "--probe", "0"]
    assert main([*arguments, "-o", str(tmp_path / "t.csv")]) == 0
    assert "pressure sets in below 0.92" in capsys.readouterr().out
    assert (tmp_path / "t.csv").read_text().count("\n") == 3
    assert (tmp_path / "t.png").stat().st_size > 10_000
