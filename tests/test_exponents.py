"""Exponents measured with the pair engine, against what can be worked out by hand."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from sympy import Rational
from test_phases import diagram_of

from softdyn.errors import IntegrationError, SceneError
from softdyn.results.pair_result import PairResult
from softdyn.scene.pair_scene import Scene
from softdyn.study import exponents, plane
from softdyn.targets import c

TARGET = "c" if c.available() else "numba"
EDGE = 4 * np.sqrt(2) / 9  # of the paper's law, where delta = R: (9/(4 sqrt 2)) kappa = 1


@pytest.fixture(scope="module")
def paper() -> exponents.Measurement:
    return exponents.measure(diagram_of("rognon_gay"), TARGET)


@pytest.fixture(scope="module")
def film() -> exponents.Measurement:
    return exponents.measure(diagram_of("film"), TARGET)


# By hand, from the paper's eqs. 3 to 5, for each regime: the leading deflection from kappa/EDGE and h/R; the exponents,
# and what the two next terms add to them, in the small ratios of neighbouring lengths.
BY_HAND = {
    # delta/R, R/h
    "Stokes": (lambda k, x: k, ((0, (0, -1 / 2)), (0, (0, 1)))),
    # delta/h, h/R
    "Poiseuille": (lambda k, x: k / np.sqrt(x), ((-1 / 2, (3 / 4, 1 / 2)), (1, (3, -1)))),
    # h/delta, delta/R
    "Hertz": (lambda k, x: k ** (2 / 3) * np.ones_like(x), ((0, (-1 / 3, 0)), (3, (-4 / 3, 0)))),
}


@pytest.mark.slow
def test_measured_exponents_are_the_papers_within_what_the_next_terms_predict(paper: exponents.Measurement) -> None:
    seen = set()
    for run in paper.runs:
        gaps = np.array(run.h)
        k = np.full(len(gaps), run.kappa / EDGE)
        for name, (leading, expected) in BY_HAND.items():
            deflection = leading(k, gaps)
            order = {
                "Stokes": (deflection, 1, gaps),
                "Poiseuille": (deflection, gaps, 1),
                "Hertz": (gaps, deflection, 1),
            }
            low, middle, high = (np.broadcast_to(length, gaps.shape) for length in order[name])
            ratios = np.array([low / middle, middle / high])
            inside = ratios.max(axis=0) < 0.02
            for values, (exponent, of_ratios) in zip((run.lambda1, run.lambda2), expected, strict=True):
                off = np.array(values) - exponent - np.dot(of_ratios, ratios)
                # what is left is of second order; the largest coefficient of the expansions is below 10
                assert np.all(np.abs(off)[inside] <= 10 * ratios.sum(axis=0)[inside] ** 2)
            if inside.any():
                seen.add(name)
    assert seen == set(BY_HAND)


@pytest.mark.slow
def test_the_largest_deviation_of_each_regime_is_what_the_next_corrections_explain(
    paper: exponents.Measurement,
) -> None:
    assert {(one.regime, one.exponent, one.predicted) for one in paper.deviations} == {
        ("Stokes", "lambda1", "0"), ("Poiseuille", "lambda1", "-1/2"), ("Hertz", "lambda1", "0"),
        ("Stokes", "lambda2", "0"), ("Poiseuille", "lambda2", "1"), ("Hertz", "lambda2", "3"),
    }  # fmt: skip
    for one in paper.deviations:
        assert one.resolved
        assert one.points > 50
        assert one.small == 0.01
        # the slope of a correction is at most 3/2 of it, two add up
        assert abs(one.deviation) < 2 * 1.5 * one.small
        # of second order in the ratios of lengths, which are below small; the coefficients are below 10. In Hertz's
        # regime delta/R alone corrects nothing, so that it may be as large as the conditions allow, APART * small
        ratios = (2 * one.small) ** 2 if one.regime != "Hertz" else one.small * (exponents.APART * one.small) ** (2 / 3)
        for left in (one.deviation - one.expected, one.unexplained):
            assert abs(left) < (10 if one.regime != "Hertz" else 7.5) * ratios
        # it was found where it is said to be
        (run,) = (run for run in paper.runs if run.kappa == pytest.approx(one.kappa, rel=1e-12))
        at = int(np.argmin(np.abs(np.log(np.array(run.h) / one.h))))
        predicted = float(Rational(one.predicted))
        assert getattr(run, one.exponent)[at] - predicted == pytest.approx(one.deviation, rel=1e-12)


def test_exponents_are_differences_of_the_engines_output(paper: exponents.Measurement) -> None:
    law = diagram_of("rognon_gay").law
    step = np.log(10) / exponents.DENSITY
    for run in paper.runs:
        u = np.log(run.h)
        assert np.allclose(np.diff(u), step, rtol=1e-9)
        exact = plane.states(law, "compression", np.array(run.h), np.array(run.kappa))
        assert np.allclose(run.delta, exact["delta"], rtol=1e-12)
        assert np.allclose(run.dh_dt, exact["dh_dt"], rtol=1e-11)
        for exponent, values in (("lambda1", run.delta), ("lambda2", run.dh_dt)):
            measured = np.array(getattr(run, exponent))
            y = np.log(np.abs(values))
            assert np.allclose(measured[2:-2], (y[:-4] - 8 * y[1:-3] + 8 * y[3:-1] - y[4:]) / (12 * step), atol=1e-12)
            # they are not the analytic ones, but near: the stencil's error is step^4/30 of a derivative of order 1
            assert 0 < np.max(np.abs(measured - exact[exponent])) < step**4


@pytest.mark.slow
def test_a_film_is_approached_from_both_sides_and_never_crossed(film: exponents.Measurement) -> None:
    assert film.failures == ()
    for kappa in (1e-7, 1e-6):
        h_eq = 1e-3 * np.log(1e-4 / kappa)
        closing, opening = (
            [
                run
                for run in film.runs
                if run.side == "compression" and abs(run.kappa / kappa - 1) < 1e-9 and wanted(run)
            ]
            for wanted in (lambda run: run.dh_dt[0] < 0, lambda run: run.dh_dt[0] > 0)
        )
        assert len(closing) == len(opening) == 1
        assert np.all(np.array(closing[0].dh_dt) < 0)
        assert np.all(np.array(opening[0].dh_dt) > 0)
        # five points make a difference: the film is at most three steps from the last
        reach = 10 ** (3.0 / exponents.DENSITY)
        assert h_eq < closing[0].h[0] < h_eq * reach
        assert h_eq / reach < opening[0].h[-1] < h_eq
    # in tension the gap opens everywhere
    assert all(min(run.dh_dt) > 0 for run in film.runs if run.side == "tension")


@pytest.mark.slow
def test_the_regimes_on_both_sides_of_a_film_have_their_exponents(film: exponents.Measurement) -> None:
    regimes = [regime for regime in diagram_of("film").regimes if regime.side == "compression" and regime.inside]
    opening = [regime for regime in regimes if not regime.dh_dt.could_extract_minus_sign()]
    assert sorted(regime.lambda2 for regime in opening) == [1, 3]
    # next to the repelled Hertz contact: the free spheres, and the contact pressed harder than it repels
    for regime in regimes:
        for one in film.deviations:
            if (one.regime, one.side) == (regime.name, "compression"):
                assert one.resolved
                assert one.points > 0
                # a correction goes with the gap to the power 1 or less, and three at most compete
                assert abs(one.deviation) < 3 * one.small
                # of second order, in ratios up to APART * small
                assert one.unexplained < 3 * one.small * exponents.APART * one.small


def test_a_wrong_prediction_is_seen() -> None:
    diagram = diagram_of("rognon_gay")
    wrong = [
        replace(regime, lambda2=regime.lambda2 + Rational(1, 2)) if regime.name == "Hertz" else regime
        for regime in diagram.regimes
    ]
    found = exponents.measure(replace(diagram, regimes=tuple(wrong)), TARGET)
    off = {one.regime: one.deviation for one in found.deviations if one.exponent == "lambda2"}
    assert off["Hertz"] == pytest.approx(-1 / 2, abs=0.03)
    assert abs(off["Stokes"]) < 0.03


def test_the_result_is_plain_data_and_a_table(paper: exponents.Measurement) -> None:
    data = json.loads(json.dumps(paper.to_dict()))
    assert data["law"] == "rognon_gay"
    assert data["target"] == TARGET
    assert len(data["runs"]) == len(paper.runs)
    assert data["deviations"][0]["deviation"] == paper.deviations[0].deviation
    text = paper.text()
    for one in paper.deviations:
        (line,) = [line for line in text.splitlines() if line.split()[:2] == [one.regime, one.exponent]]
        assert f"{one.deviation:+.2e}" in line
        assert f"{one.kappa:.2e}" in line


def test_a_run_that_fails_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    simulate = exponents.simulate_pair

    def fail_at_small_forces(scene: Scene) -> PairResult:
        if scene.force < 1e-4:
            raise IntegrationError("the reason given")
        return simulate(scene)

    monkeypatch.setattr(exponents, "simulate_pair", fail_at_small_forces)
    found = exponents.measure(diagram_of("rognon_gay"), TARGET)
    assert found.failures
    assert all("the reason given" in failure for failure in found.failures)
    assert "not run to its end: compression, kappa = " in found.text()
    assert min(run.kappa for run in found.runs) >= 1e-4 * (1 - 1e-9)


@pytest.mark.parametrize("name", ["lubrication_rigid", "hertz_dry"])
def test_a_one_sided_law_cannot_be_run(name: str) -> None:
    with pytest.raises(SceneError, match=r"one-sided, without a (deflection|gap)"):
        exponents.measure(diagram_of(name))
