"""Steady states and errors of means, on processes whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from softdyn.rheology.blocking import blocked_mean
from softdyn.rheology.steady_state import steady_state, truncation

Array = NDArray[np.float64]


def autoregressive(n: int, phi: float, seed: int) -> Array:
    """x_k = phi x_(k-1) + noise, stationary from the first value on, of variance 1."""
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal(n) * np.sqrt(1 - phi**2)
    x = np.empty(n)
    x[0] = rng.standard_normal()
    for k in range(1, n):
        x[k] = phi * x[k - 1] + noise[k]
    return x


def error_of_mean(n: int, phi: float) -> float:
    """Exact: var = (1/n^2) sum over pairs of phi^|i - j|."""
    lags = np.arange(1, n)
    return float(np.sqrt((n + 2 * np.sum((n - lags) * phi**lags)) / n**2))


@pytest.mark.parametrize("phi", [0.0, 0.5, 0.9])
def test_blocking_finds_the_error_of_an_autoregressive_process(phi: float) -> None:
    """The mean square of 100 errors.

    Each is known to 1/sqrt(2 blocks), a quarter or so, and is biased low by the correlation that is left between
    blocks: by less than 20 % in all.
    """
    n, trials = 2048, 100
    found = [blocked_mean(autoregressive(n, phi, seed)) for seed in range(trials)]
    assert all(mean.resolved for mean in found)
    ratio = np.sqrt(np.mean([mean.error**2 for mean in found])) / error_of_mean(n, phi)
    assert 0.8 < ratio < 1.1


def test_the_means_are_as_far_from_the_truth_as_their_errors_say() -> None:
    n, phi, trials = 1500, 0.8, 400  # no power of two
    found = [blocked_mean(autoregressive(n, phi, seed)) for seed in range(trials)]
    within = np.mean([abs(mean.value) < 2 * mean.error for mean in found])
    # 95.4 % of a normal distribution; some 90 % with errors that are known to a quarter; 3 sigma of 400 trials: 4.5 %
    assert 0.86 < within < 0.99


def test_an_error_that_is_not_resolved_says_so() -> None:
    assert not blocked_mean(np.arange(64.0)).resolved
    assert not blocked_mean(np.array([1.0, 2.0])).resolved


def test_a_random_walk_is_hardly_ever_steady() -> None:
    """It has no mean; but some of them look as if they had: 1 in 4 at most."""
    walks = [np.cumsum(np.random.default_rng(seed).standard_normal(512)) for seed in range(60)]
    assert sum(steady_state({"x": walk}).steady for walk in walks) <= 15


def test_equal_values_have_no_error() -> None:
    mean = blocked_mean(np.full(100, 0.1))
    assert mean.value == pytest.approx(0.1)
    assert mean.error < 1e-15
    assert mean.resolved


@pytest.mark.parametrize("decay", [10.0, 40.0])
def test_a_transient_is_cut_off_where_it_is_lost_in_the_noise(decay: float) -> None:
    """An exponential of 20 deviations: cut after it has fallen below the noise, before ten times that."""
    starts = []
    for seed in range(20):
        noise = autoregressive(800, 0.3, seed)
        starts.append(truncation(noise + 20 * np.exp(-np.arange(800) / decay)))
    assert 2 * decay < np.median(starts) < 10 * decay


def test_a_steady_process_is_steady_and_its_mean_is_right() -> None:
    """Also with a transient before it; of 50 each, 3 at most may be refused by chance."""
    good = 0
    for seed in range(50):
        values = 5 + autoregressive(600, 0.7, seed) - 30 * np.exp(-np.arange(600) / 15)
        found = steady_state({"x": values})
        good += found.steady
        if found.steady:
            mean = found.means["x"]
            assert abs(mean.value - 5) < 6 * mean.error
    assert good >= 47


@pytest.mark.parametrize("slope", [0.01, 0.05])
def test_a_drift_is_never_taken_for_a_steady_state(slope: float) -> None:
    for seed in range(20):
        found = steady_state({"x": 5 + autoregressive(600, 0.5, seed) + slope * np.arange(600)})
        assert not found.steady
        assert found.why.startswith("x ")


def test_one_series_that_drifts_makes_the_run_unsteady() -> None:
    series = {"x": autoregressive(600, 0.5, 1), "y": np.linspace(1.0, 2.0, 600)}
    assert not steady_state(series).steady
    assert steady_state(series, judged=("x",)).steady


def test_few_values_say_nothing() -> None:
    found = steady_state({"x": np.ones(10)})
    assert not found.steady
    assert "too few" in found.why
