"""What holds of any pair under any drive: scalings, order, reversal, the balance of energy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import simpson

import softdyn

#: Random runs, many of them: the other tests hold single ones to the same.
pytestmark = pytest.mark.slow

UNIT = {"R": 1.0, "E": 1.0, "eta": 1.0}
Array = NDArray[np.float64]


def decade(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high).map(lambda x: 10**x)


def run(second: float = 1.0, length: float = 1.0, force: float = 1.0, **scene: Any) -> softdyn.PairResult:
    """A scene given in units of R, E R^2 and eta/E, run in other units."""
    scale = {"h": length, "until_t": second}
    scene |= {name: scene[name] * unit for name, unit in scale.items() if name in scene}
    if "sine" in scene:
        m, k, w, f = scene.pop("sine")
        scene |= {"force": "m + k*sin(w*t + f)"}
        scene["constants"] = {"m": m * force, "k": k * force, "w": w / second, "f": f}
    if "base" in scene:
        start, v, w = scene.pop("base")
        scene["constants"] = {"b": start * length, "v": v * length, "w": w / second}
        base = "b - v*sin(w*t)"
        scene["spring"] = {"stiffness": scene.pop("stiffness") * force / length, "base": base}
    E = force / length**2
    parameters = {"R": length, "E": E, "eta": E * second}
    return softdyn.simulate(law="rognon_gay", parameters=parameters, times=12, **scene)


SWINGS = st.tuples(st.floats(-1, 1), decade(-5, -1), decade(-5, -2), st.floats(0, 6))


def swing(numbers: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    mean, k, w, f = numbers
    return (mean * k, k, w, f)


@given(k=st.integers(-30, 30), start=decade(-3, 1), drive=SWINGS, periods=st.floats(0.1, 2), sprung=st.booleans())
@settings(max_examples=30, deadline=None)
def test_a_viscosity_twice_as_large_takes_twice_the_time_to_the_bit(
    k: int, start: float, drive: tuple, periods: float, sprung: bool
) -> None:
    """Powers of two are exact, and nothing in the engine knows a second."""
    w = drive[2]
    scene: dict[str, Any] = {"h": start, "until_t": 2 * math.pi * periods / w, "rtol": 1e-6}
    scene |= {"base": (2 + start, 0.3 * start, w), "stiffness": 1.0} if sprung else {"sine": swing(drive)}
    one, other = run(**scene), run(second=2.0**k, **scene)
    np.testing.assert_array_equal(one.h, other.h)
    np.testing.assert_array_equal(one.delta, other.delta)
    np.testing.assert_array_equal(one.t * 2.0**k, other.t)


@given(
    start=decade(-3, 1), drive=SWINGS, periods=st.floats(0.1, 2), sprung=st.booleans(),
    length=decade(-9, 3), force=decade(-12, 6), second=decade(-9, 9),
)  # fmt: skip
@settings(max_examples=30, deadline=None)
def test_units_do_not_matter_whatever_drives(
    start: float, drive: tuple, periods: float, sprung: bool, length: float, force: float, second: float
) -> None:
    """Each run is off by ten times the tolerance at most; a spring's force by the rounding of X - base, too."""
    w = drive[2]
    scene: dict[str, Any] = {"h": start, "until_t": 2 * math.pi * periods / w, "rtol": 1e-8}
    scene |= {"base": (2 + start, 0.3 * start, w), "stiffness": 1.0} if sprung else {"sine": swing(drive)}
    one, other = run(**scene), run(length=length, force=force, second=second, **scene)
    np.testing.assert_allclose(other.h / length, one.h, rtol=2e-7)
    scale = np.max(np.abs(one.delta))
    np.testing.assert_allclose(other.delta / length, one.delta, rtol=0, atol=2e-7 * scale + 1e-15 * (2 + start))


@given(start=decade(-4, 1), apart=decade(-6, 0.5), drive=SWINGS, periods=st.floats(0.2, 3))
@settings(max_examples=30, deadline=None)
def test_a_gap_that_is_larger_stays_larger(start: float, apart: float, drive: tuple, periods: float) -> None:
    """Under one force, whatever it is, the gap has one equation of first order: solutions do not cross."""
    scene = {"sine": swing(drive), "until_t": 2 * math.pi * periods / drive[2], "rtol": 1e-7}
    lower, upper = run(h=start, **scene), run(h=start * (1 + apart), **scene)
    assert np.all(lower.h <= upper.h * (1 + lower.stats["error"] + upper.stats["error"]))


@given(kappa=decade(-12, -0.5), start=decade(-8, 1))
@settings(max_examples=20, deadline=None)
def test_under_a_constant_pull_the_gap_opens_and_the_deflection_fades(kappa: float, start: float) -> None:
    result = softdyn.simulate(
        law="rognon_gay", parameters=UNIT, h=start, force=-kappa, until_h=start * 1e4, gaps=20, rtol=1e-4
    )
    assert np.all(np.diff(result.t) > 0)
    assert np.all(result.delta < 0)
    assert np.all(np.diff(result.delta) > 0)


@pytest.mark.parametrize(
    ("law", "parameters"),
    [
        ("rognon_gay", UNIT),
        ("equal_spheres", {**UNIT, "nu": 0.5}),
        ("cone", {**UNIT, "m": 1.0}),
        ("droplet", {"R": 1.0, "eta": 1.0, "sigma": 1.0}),
    ],
)
def test_reversing_the_force_at_a_gap_reverses_its_rate_or_opens_faster_what_a_pull_narrows(
    law: str, parameters: dict[str, float]
) -> None:
    """To the bit, where friction is that of the size of the deflection; a film that narrows opens faster."""
    for gap, kappa in ((1e-6, 1e-3), (1e-2, 0.1), (1.0, 1e-8), (30.0, 1e-2)):
        rates = [
            softdyn.simulate(
                law=law, parameters=parameters, h=gap, force="F + 0*t", constants={"F": sign * kappa}, until_t=1e-30,
                times=2, quantities=("dh_dt",),
            ).dh_dt[0]
            for sign in (1, -1)
        ]  # fmt: skip
        if law in ("equal_spheres", "droplet"):
            assert rates[0] < 0 < -rates[0] < rates[1]
        else:
            assert rates[0] == -rates[1] < 0


@given(start=decade(-2, 1), drive=SWINGS, periods=st.floats(0.1, 1.5), speed=st.floats(-0.3, 0.3), moved=st.booleans())
@settings(max_examples=25, deadline=None)
def test_the_four_terms_of_energy_balance_whatever_drives(
    start: float, drive: tuple, periods: float, speed: float, moved: bool
) -> None:
    """-int F dX = [U] - int U_h dh + int zeta (dh/dt)^2 dt, by Simpson's rule on n points.

    U = c int x sqrt(bar + x) dx from 0 to abs(delta), c = (8/9) sqrt(2), by Gauss's rule. What Simpson's errs by,
    where a force crosses zero included, is below the difference to n/2 points.
    """
    until = 2 * math.pi * periods / drive[2]
    # of smaller speeds the energies have no digits
    speed = speed if abs(speed) > 1e-100 else 0.0
    scene: dict[str, Any] = {"velocity": speed * start / until} if moved else {}
    if not moved:
        m, k, w, f = swing(drive)
        scene = {"force": "m + k*sin(w*t + f)", "constants": {"m": m, "k": k, "w": w, "f": f}}
    result = softdyn.simulate(
        law="rognon_gay", parameters=UNIT, h=start, until_t=until, times=2001, rtol=1e-11,
        quantities=("F", "zeta", "dh_dt", "dX_dt"), **scene,
    )  # fmt: skip
    bar, c = result.h / (1 + result.h), 8 / 9 * math.sqrt(2)
    nodes, weights = np.polynomial.legendre.leggauss(20)
    x = np.abs(result.delta)[:, None] * (1 + nodes) / 2
    half = np.abs(result.delta)[:, None] / 2 * weights
    U = c * np.sum(half * x * np.sqrt(bar[:, None] + x), axis=1)
    U_h = c * np.sum(half * x / np.sqrt(bar[:, None] + x) / 2, axis=1) / (1 + result.h) ** 2
    powers = (-result.F * result.dX_dt, -U_h * result.dh_dt, result.zeta * result.dh_dt**2)
    terms = [float(simpson(y, x=result.t)) for y in powers]
    coarse = [float(simpson(y[::2], x=result.t[::2])) for y in powers]
    size = abs(U[-1] - U[0]) + sum(float(simpson(np.abs(y), x=result.t)) for y in powers)
    allowed = sum(abs(a - b) for a, b in zip(terms, coarse, strict=True)) + 1e-9 * size
    assert abs(U[-1] - U[0] + terms[1] + terms[2] - terms[0]) <= allowed
    # and it is no empty claim: the rule errs by less than a hundredth of what is balanced
    assert allowed <= 1e-2 * size
