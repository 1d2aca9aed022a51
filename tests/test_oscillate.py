"""Oscillation, relaxation and creep of lattices, whose moduli are known by hand."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softdyn.cli import main
from softdyn.derive.laws.droplet import law, sigma
from softdyn.derive.symbols import R, a, delta, eta, h
from softdyn.errors import SceneError
from softdyn.particles.files import particle_scene_from
from softdyn.particles.particle_run import simulate_particles
from softdyn.rheology.oscillate import POINTS, harmonics, measured_oscillation, oscillating_scene
from softdyn.rheology.runs import Run
from softdyn.rheology.step_test import creep_of, creep_scene, relaxation_of, relaxation_scene

LATTICE = """
law = "droplet"
[parameters]
sigma = 1.0
eta = 1.0
[packing]
kind = "hexagonal"
cells = [3, 2]
spacing = 1.98
radii = [1.0]
[contacts]
gap = 0.002
range = 0.1
[until]
t = 1.0
[accuracy]
rtol = 1e-8
"""
#: Stiffness of a contact: F = 4 pi sigma delta, and r = 2 R + h - 2 delta.
STIFFNESS = 2 * math.pi
DEPTH = 2.0
#: Gap of a lattice whose discs do not press on each other.
GAP = 0.02


def content(**changes: float) -> dict[str, Any]:
    given = tomllib.loads(LATTICE)
    given["packing"]["spacing"] = changes.get("spacing", 1.98)
    given["contacts"]["gap"] = changes.get("gap", 0.002)
    return given


def oscillated(given: Mapping[str, Any], frequency: float, amplitude: float, cycles: int = 4) -> dict[str, float]:
    values = {"frequency": frequency, "amplitude": amplitude}
    made = oscillating_scene(dict(given), values, cycles)
    result = simulate_particles(particle_scene_from(made, Path()))
    row, note = measured_oscillation(result, Run(0, values, made, Path(), Path()))
    assert note == ""
    return row


def test_harmonics_of_a_known_stress_with_a_drift_are_exact() -> None:
    """Sines and cosines that the sum takes for one another are above the highest harmonic: none here."""
    phase = 2 * np.pi * np.arange(3 * POINTS + 1) / POINTS
    stress = 0.1 * (2 * np.sin(phase) + 3 * np.cos(phase) + 0.5 * np.sin(3 * phase) - 0.25 * np.cos(5 * phase))
    found = harmonics(stress, 0.1)
    assert found.shape == (3, 9)
    expected = np.zeros(9, dtype=complex)
    expected[[0, 2, 4]] = [2 + 3j, 0.5, -0.25j]
    np.testing.assert_allclose(found, np.tile(expected, (3, 1)), atol=1e-13)
    np.testing.assert_allclose(harmonics(stress + 7 + 0.3 * phase, 0.1), found, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("spacing", [pytest.param(1.98, marks=pytest.mark.slow), 1.9])
def test_a_lattice_of_pressed_discs_has_the_modulus_known_by_hand(spacing: float) -> None:
    """G' = (sqrt 3/4)(k - 3 F/r), of the depth of a layer; films that are frozen at high frequency are springs alone.

    The amplitude's square, 1e-10, and the film's flow in a cycle are the errors.
    """
    force = 2 * math.pi * (2 + 0.002 - spacing)  # 4 pi sigma delta
    expected = math.sqrt(3) / 4 * (STIFFNESS - 3 * force / spacing) / DEPTH
    row = oscillated(content(spacing=spacing), 1e3, 1e-5)
    assert row["G_storage"] == pytest.approx(expected, rel=1e-5)
    assert row["G_loss_fluid"] == 1e3  # eta w
    assert abs(row["G_loss_contacts"]) < 1e-5 * expected


def friction(gap: float) -> float:
    """Of two droplets that touch without a force, by the law's own declaration."""
    return float(law.zeta.subs(a, law.a).subs({sigma: 1, eta: 1, R: 1, h: gap, delta: 0}).evalf())


@pytest.mark.slow
@pytest.mark.parametrize(("reduced", "cycles"), [(0.2, 4), (1.0, 6), (5.0, 16)])
def test_films_and_springs_in_series_are_maxwells_fluid(reduced: float, cycles: int) -> None:
    """Discs that touch: each contact is a spring k and a dashpot zeta in series, tau = zeta/k.

    G* = (sqrt 3/4) k i w tau/(1 + i w tau). The film changes by 1e-3 of itself, and the friction with it: to second
    order in the modulus, once averaged over a cycle. What the start leaves is gone after half of the cycles.
    """
    given = content(spacing=2 + GAP, gap=GAP)
    tau = friction(GAP) / STIFFNESS
    row = oscillated(given, reduced / tau, 1e-5, cycles)
    expected = math.sqrt(3) / 4 * STIFFNESS / DEPTH * 1j * reduced / (1 + 1j * reduced)
    assert row["G_storage"] == pytest.approx(expected.real, rel=5e-4)
    assert row["G_loss_contacts"] == pytest.approx(expected.imag, rel=5e-4)
    assert row["G_loss"] == pytest.approx(expected.imag + reduced / tau, rel=5e-4)


@pytest.mark.slow
def test_a_step_of_strain_relaxes_as_maxwells_fluid_does() -> None:
    """G(t) = (sqrt 3/4) k exp(-t/tau); the ramp takes a thousandth of tau, and half of it is lost."""
    given = content(spacing=2 + GAP, gap=GAP)
    tau = friction(GAP) / STIFFNESS
    values = {"strain": 1e-5}
    made = relaxation_scene(given, values, 3 * tau, 0.5 * tau, 1e-3 * tau)
    result = simulate_particles(particle_scene_from(made, Path()))
    found = relaxation_of(result, Run(0, values, made, Path(), Path()), 0.5 * tau, 1e-3 * tau)
    after = found["time"] > 0
    expected = math.sqrt(3) / 4 * STIFFNESS / DEPTH * np.exp(-found["time"][after] / tau)
    np.testing.assert_allclose(found["G"][after], expected, rtol=5e-3)
    np.testing.assert_allclose(found["strain"][after], 1e-5, rtol=1e-9)


def test_a_step_of_stress_makes_it_creep_and_recover() -> None:
    """Maxwell's element beside the fluid eta.

    By hand: both share the stress, S = eta g' + s, and s'/G + s/(G tau) = g'. From s = 0 on, s goes to S G tau/(eta + G
    tau) with the rate 1/tau + G/eta; taken off, s decays at that rate, and g' = -s/eta.
    """
    given = content(spacing=2 + GAP, gap=GAP)
    G, tau = math.sqrt(3) / 4 * STIFFNESS / DEPTH, friction(GAP) / STIFFNESS
    S, time = 1e-6, 5.0
    values = {"stress": S}
    made = creep_scene(given, values, time, 0.0, time)
    result = simulate_particles(particle_scene_from(made, Path()))
    found = creep_of(result, Run(0, values, made, Path(), Path()), 0.0)
    end = int(np.searchsorted(found["time"], time * (1 - 1e-12)))
    fast, steady = 1 / tau + G, S * G * tau / (1 + G * tau)
    t = found["time"][: end + 1]
    # g' = S - s with eta = 1
    strain = S * t - steady * (t - (1 - np.exp(-fast * t)) / fast)
    np.testing.assert_allclose(found["strain"][1 : end + 1], strain[1:], rtol=5e-3, atol=1e-3 * strain[-1])
    kept = steady * (1 - np.exp(-fast * time))
    recovered = kept * (1 - np.exp(-fast * time)) / fast
    assert found["strain"][end] - found["strain"][-1] == pytest.approx(recovered, rel=5e-3)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["oscillate", "--frequency", "1", "--amplitude", "-1"], "--amplitude: all values must be positive"),
        (["oscillate", "--frequency", "1,x", "--amplitude", "1"], "--frequency 1,x: logspace"),
        (["oscillate", "--frequency", "1", "--amplitude", "1", "--cycles", "2"], "--cycles 2: 4 to 1000"),
        (["oscillate", "--frequency", "1", "--amplitude", "1", "--vary", "shear_rat=1"], "did you mean 'shear_rate'"),
        (["step", "--time", "1"], "step takes --strain"),
        (["step", "--time", "1", "--strain", "1", "--stress", "1"], "step takes --strain"),
        (["step", "--time", "-1", "--strain", "1"], "--time -1: a positive time is needed"),
        (["step", "--time", "1", "--strain", "0"], "a step is a number other than 0"),
        (["step", "--time", "1", "--strain", "1", "--recovery", "1"], "--recovery is of creep"),
        (["step", "--time", "1", "--stress", "1", "--ramp", "1"], "--ramp is of a step of strain"),
        (["flow-curve", "--rates", "1,-1"], "rates must be positive"),
        (["flow-curve", "--rates", "1", "--vary", "shear_rate=2"], "the rates are given by --rates"),
        (["flow-curve", "--rates", "1"], "flow-curve runs each rate to one strain"),
    ],
)
def test_what_cannot_be_done_is_refused_before_any_run(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "lattice.toml").write_text(LATTICE)
    command, *rest = arguments
    assert main([command, str(tmp_path / "lattice.toml"), *rest, "-o", str(tmp_path / "t.csv")]) == 2
    assert words in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["lattice.toml"]


def test_a_scene_with_constants_of_these_names_is_refused() -> None:
    given = content() | {"constants": {"oscillation_frequency": 1.0}}
    with pytest.raises(SceneError, match="choose others"):
        oscillating_scene(given, {"frequency": 1.0, "amplitude": 1.0}, 4)


@pytest.mark.slow
def test_the_commands_write_tables_and_pictures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "lattice.toml").write_text(LATTICE.replace("t = 1.0", "strain = 0.02").replace("1e-8", "1e-3"))
    scene, out = str(tmp_path / "lattice.toml"), str(tmp_path / "t.csv")
    several = ["--frequency", "1,10", "--amplitude", "1e-3,1e-2", "--cycles", "4"]
    assert main(["oscillate", scene, *several, "-o", out]) == 0
    assert main(["step", scene, "--strain", "1e-3", "--time", "1", "-o", str(tmp_path / "s.csv")]) == 0
    assert (
        main(["step", scene, "--stress", "1e-3", "--time", "1", "--recovery", "1", "-o", str(tmp_path / "c.csv")]) == 0
    )
    assert main(["flow-curve", scene, "--rates", "1e-3,1e-2", "-o", str(tmp_path / "f.csv")]) == 0
    for name in "tscf":
        assert (tmp_path / f"{name}.csv").read_text().count("\n") > 1
        assert (tmp_path / f"{name}.png").stat().st_size > 10_000
    assert "G-storage" in capsys.readouterr().out
