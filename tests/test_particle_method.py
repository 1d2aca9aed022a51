"""The Runge-Kutta method of many particles: its order at the end of a step and within, against exact solutions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import brentq

from softdyn.particles.method import (
    ERROR,
    GAMMA,
    NODES,
    ORDER,
    ROWS,
    STAGES,
    WEIGHTS,
    dense_row,
    rate_weights,
)
from softdyn.particles.particle_keys import ParticleScene, Push
from softdyn.particles.particle_run import simulate_particles
from softdyn.particles.step import power_error

Array = NDArray[np.float64]
thetas = st.floats(0.01, 0.99)


def test_the_method_is_of_order_3_and_stiffly_accurate() -> None:
    one = np.ones(3)
    assert one @ WEIGHTS == pytest.approx(1)
    np.testing.assert_allclose(WEIGHTS @ NODES, 1 / 2)
    np.testing.assert_allclose(WEIGHTS @ NODES**2, 1 / 3)
    np.testing.assert_allclose(WEIGHTS @ STAGES @ NODES, 1 / 6)
    assert np.array_equal(WEIGHTS, STAGES[-1])
    assert abs(ERROR.sum()) < 1e-15
    assert abs(ERROR @ NODES) < 1e-15


@given(theta=thetas, degree=st.integers(0, 2))
def test_integrals_and_rates_within_a_step_are_exact_for_parabolas(theta: float, degree: int) -> None:
    for known in (True, False):
        powers = np.concatenate([[0.0**degree], NODES**degree, [theta**degree]])
        integral = np.concatenate([dense_row(theta, known), [GAMMA]]) @ powers
        assert integral == pytest.approx(theta ** (degree + 1) / (degree + 1))
    assert rate_weights(theta) @ NODES**degree == pytest.approx(theta**degree)


def step(f, t: float, y: float, dt: float, theta: float, rate: float | None) -> tuple[float, float, float]:  # type: ignore[no-untyped-def]
    """Solution of y' = f(t, y) within a step and at its end, and the rate there; each stage by root finding."""
    rates = [0.0 if rate is None else rate]

    def stage(row: Array, when: float) -> tuple[float, float]:
        known = y + dt * float(row[: len(rates)] @ np.array(rates))
        found = brentq(lambda value: value - known - GAMMA * dt * f(when, value), -10, 10, xtol=1e-15, rtol=1e-15)
        return found, (found - known) / (GAMMA * dt)

    for row, node in zip(ROWS, NODES, strict=True):
        end, at = stage(row, t + node * dt)
        rates.append(at)
    return stage(dense_row(theta, rate is not None), t + theta * dt)[0], end, rates[-1]


@pytest.mark.parametrize(("known", "order"), [(True, 3), (False, 2)])
@pytest.mark.parametrize("theta", [0.1, 0.5, 0.8])
def test_the_solution_within_a_step_has_its_order(known: bool, order: int, theta: float) -> None:
    """Of y' = -y^2 cos t the solution y = 1/(1 + sin t): the error of a step falls with the order and one more."""
    errors = []
    steps = np.array([0.05, 0.025, 0.0125])
    for dt in steps:
        t, y = 0.3, 1 / (1 + np.sin(0.3))
        rate = -(y**2) * np.cos(t)
        within, _, _ = step(lambda t, y: -(y**2) * np.cos(t), t, y, dt, theta, rate if known else None)
        errors.append(abs(within - 1 / (1 + np.sin(t + theta * dt))))
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope > order + 0.7


def test_the_solution_within_a_stiff_step_is_damped() -> None:
    """Of y' = -1e8 (y - cos t): a smooth state stays on cos t within the step, as at its end."""
    t, dt = 0.3, 0.1

    def f(t: float, y: float) -> float:
        return -1e8 * (y - np.cos(t))

    for theta in (0.05, 0.4, 0.9):
        within, end, _ = step(f, t, np.cos(t), dt, theta, -np.sin(t))
        assert within == pytest.approx(np.cos(t + theta * dt), abs=1e-7)
        assert end == pytest.approx(np.cos(t + dt), abs=1e-7)


@pytest.mark.slow
def test_outputs_do_not_change_the_steps() -> None:
    """As many steps for a hundred outputs as for two; what they give lies on the run in small steps."""

    def run(times: int, rtol: float = 1e-3):  # type: ignore[no-untyped-def]
        pushes = [Push([0], [1e-2, 0]), Push([1], [-1e-2, 0])]
        return simulate_particles(
            ParticleScene(
                law="rognon_gay",
                parameters={"E": 1.0, "eta": 1.0},
                positions=[[0.0, 0.0], [2.1, 0.0]],
                radii=1.0,
                gap=0.1,
                drag=1.0,
                push=pushes,
                until_t=2e3,
                times=times,
                rtol=rtol,
            )
        )

    few, many, exact = run(2), run(101), run(101, 1e-8)
    assert few.stats["steps"] == many.stats["steps"] < 50
    np.testing.assert_array_equal(few.x[-1], many.x[-1])
    # what one step allows, of some ten that lie between a fast and a slow end
    np.testing.assert_allclose(many.contact_h, exact.contact_h, rtol=10 * 1e-3)
    np.testing.assert_allclose(many.contact_F, exact.contact_F, rtol=10 * 1e-3)
    # velocities too, from the first frame on
    np.testing.assert_allclose(many.v, exact.v, atol=0.02 * np.abs(exact.v).max())
    assert np.abs(exact.v[0]).max() > 0
    energy = sum(many.arrays[f"energy_{name}"] for name in ("stored", "gaps", "drag", "remote", "U_h"))
    np.testing.assert_allclose(many.energy_external, energy, atol=5e-3 * energy[-1])
    assert ORDER == 3


@given(rate=st.floats(0.02, 15.0), size=st.floats(1e-6, 1e6))
def test_the_error_expected_of_energy_is_one_where_a_power_fades(rate: float, size: float) -> None:
    """A spring relaxes in a step: what the quadrature of its power is off by is below what is expected of it.

    The difference of two quadratures, by itself, is a hundredth of that at a rate of 1.35.
    """
    x, rates = 1.0, []
    for row in STAGES:
        x = (1 + sum(w * past for w, past in zip(row, rates, strict=False))) / (1 + GAMMA * rate)
        rates.append(-rate * x)
    power = size * rate * (np.array(rates) / rate) ** 2
    off = float(WEIGHTS @ power) - size * (1 - x**2) / 2
    expected = power_error(power)
    assert abs(off) < expected
    assert expected == pytest.approx(float(abs(ERROR @ power))) or rate > 0.3  # and no more where steps are short


@given(
    power=st.lists(st.floats(-1, 1).map(lambda x: round(x, 6)), min_size=3, max_size=3), decades=st.integers(-290, 300)
)
def test_the_estimated_error_of_a_power_is_in_its_units(power: list[float], decades: int) -> None:
    """Whatever they are: no square of it is computed."""
    values = np.array(power)
    found = power_error(values * 10.0**decades)
    # below the smallest normal number digits are lost
    assert found == pytest.approx(power_error(values) * 10.0**decades, rel=1e-9, abs=max(1e-300, 1e-15 * 10.0**decades))
