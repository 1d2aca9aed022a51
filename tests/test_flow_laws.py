"""Fits of flow curves: parameters of synthetic data come back within their stated errors, and only what is told is."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.rheology.flow_laws import FlowFit, fit_flow_law

Array = NDArray[np.float64]
TRUE = {"sigma_y": 0.02, "K": 3.0, "n": 0.5}


def measured(seed: int, rates: Array, noise: float, truth: dict[str, float] = TRUE) -> FlowFit:
    rng = np.random.default_rng(seed)
    stress = truth["sigma_y"] + truth["K"] * rates ** truth["n"]
    errors = noise * stress
    return fit_flow_law("Herschel-Bulkley", rates, stress + errors * rng.standard_normal(len(rates)), errors)


def test_data_without_noise_give_the_parameters_back() -> None:
    fit = measured(0, np.logspace(-7, -3, 9), 1e-9)
    for name, value in TRUE.items():
        assert fit.values[name] == pytest.approx(value, rel=1e-6)
    assert not fit.undetermined


def test_parameters_are_within_their_errors_as_often_as_these_say() -> None:
    """Of 200 trials 95.4 % within two errors: 191 of them, with a deviation of 3."""
    fits = [measured(seed, np.logspace(-7, -3, 9), 0.02) for seed in range(200)]
    for name, value in TRUE.items():
        within = sum(abs(fit.values[name] - value) < 2 * fit.errors[name] for fit in fits)
        assert within >= 182, name


def test_units_of_rate_and_stress_change_nothing() -> None:
    rates = np.logspace(-6, -3, 7)
    fit = measured(1, rates, 0.02)
    a, b = 1e5, 1e-4
    rng = np.random.default_rng(1)
    stress = TRUE["sigma_y"] + TRUE["K"] * rates ** TRUE["n"]
    noisy = stress + 0.02 * stress * rng.standard_normal(len(rates))
    scaled = fit_flow_law("Herschel-Bulkley", rates * a, noisy * b, 0.02 * stress * b)
    n = fit.values["n"]
    assert scaled.values["n"] == pytest.approx(n, rel=1e-6)
    assert scaled.errors["n"] == pytest.approx(fit.errors["n"], rel=1e-4)
    assert scaled.values["sigma_y"] == pytest.approx(b * fit.values["sigma_y"], rel=1e-6)
    assert scaled.values["K"] == pytest.approx(fit.values["K"] * b / a**n, rel=1e-5)


def test_a_fluid_without_a_yield_stress_is_not_given_one() -> None:
    fit = measured(3, np.logspace(-4, 0, 9), 0.02, {"sigma_y": 0.0, "K": 1.0, "n": 1.0})
    assert "none is seen" in fit.undetermined["sigma_y"]
    assert fit.values["n"] == pytest.approx(1.0, abs=0.05)
    power = fit_flow_law("power law", np.logspace(-4, 0, 9), np.logspace(-4, 0, 9), 0.01 * np.logspace(-4, 0, 9))
    assert power.values["n"] == pytest.approx(1.0)


def test_data_on_the_plateau_alone_do_not_tell_the_exponent() -> None:
    rates = np.logspace(-9, -8, 6)
    fit = measured(4, rates, 0.05)
    assert "not determined" in fit.undetermined["n"]
    assert "not determined" in fit.words()


def test_points_that_scatter_more_than_their_bars_have_wider_errors() -> None:
    rates, rng = np.logspace(-6, -3, 12), np.random.default_rng(5)
    stress = TRUE["sigma_y"] + TRUE["K"] * rates ** TRUE["n"]
    noisy = stress * (1 + 0.05 * rng.standard_normal(12))
    honest = fit_flow_law("Herschel-Bulkley", rates, noisy, 0.05 * stress)
    boasting = fit_flow_law("Herschel-Bulkley", rates, noisy, 0.001 * stress)
    assert boasting.chi2 / boasting.dof > 100
    assert boasting.errors["n"] == pytest.approx(honest.errors["n"], rel=0.5)


@pytest.mark.parametrize(
    ("rates", "errors", "words"),
    [
        ([1.0, 1.0, 2.0], [0.1, 0.1, 0.1], "need points at 3 rates"),
        ([1.0, 2.0, -3.0], [0.1, 0.1, 0.1], "rates and error bars positive"),
        ([1.0, 2.0, 3.0], [0.1, 0.0, 0.1], "rates and error bars positive"),
    ],
)
def test_points_that_cannot_be_fitted_are_refused(rates: list[float], errors: list[float], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        fit_flow_law("Herschel-Bulkley", np.array(rates), np.array([1.0, 2.0, 3.0]), np.array(errors))
