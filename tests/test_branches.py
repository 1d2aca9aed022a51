"""Laws by cases: kinks, steps and splines are computed as they are written, and have a value everywhere."""

from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from kernels_by_text import TextKernel
from sympy import (
    Abs,
    Heaviside,
    Max,
    Min,
    Piecewise,
    Rational,
    Symbol,
    coth,
    csch,
    exp,
    interpolating_spline,
    lambdify,
    pi,
    sech,
    sign,
    sqrt,
)

import softdyn
from softdyn.derive import FORCE, LENGTH, ContactLaw, E, R, a, delta, eta, h
from softdyn.derive.branches import has_kinks
from softdyn.derive.films import find_films
from softdyn.derive.pair_equations import Needs
from softdyn.derive.regimes import discover
from softdyn.errors import LawError

A, L = Symbol("A", positive=True), Symbol("L", positive=True)
X = Symbol("X", real=True)
SPLINE = interpolating_spline(
    3,
    X,
    [0, Rational(1, 10), Rational(2, 10), Rational(3, 10), 1],
    [1, Rational(1, 2), Rational(1, 4), Rational(1, 10), 0],
)


FRICTION = 3 * pi * eta * a**4 / (2 * (R * h / (R + h)) ** 3)


def law_with(**parts: Any) -> ContactLaw:
    hbar = R * h / (R + h)
    declared = {
        "name": "cases",
        "a": sqrt(2 * R * (hbar + Abs(delta))),
        "F_ela": Rational(4, 9) * E * a * delta,
        "zeta": FRICTION,
        "parameters": {A: FORCE, L: LENGTH},
        "typical": {A: E * R**2 / 1000, L: R / 100},
    }
    return ContactLaw(**{**declared, **parts})


CASES = {
    "coth": coth(h / L) - 1,
    "csch": csch(h / L) ** 2,
    "sech": sech(h / L),
    "max": Max(1 - h / L, 0) ** 2,
    "min": Min(1, L / h),
    "sign": (1 - sign(h - L)) / 2,
    "step": Heaviside(L - h),
    "abs": Abs(1 - h / L) * exp(-h / L),
    "cases": Piecewise((1 - h / L, h < L), (0, True)),
}


@pytest.mark.slow
@pytest.mark.parametrize("target", ["c", pytest.param("numba", marks=pytest.mark.slow)])
def test_every_function_is_computed_as_it_is_written(target: str, tmp_path: Path) -> None:
    """Values and slopes against 40 digits; L is no gap that is looked at, so that no kink is hit."""
    law = law_with(F_adh=A * sum(k * case for k, case in enumerate(CASES.values(), start=1)))
    kernel = TextKernel(law, Needs(outputs=("F_adh", "dh_dt", "lambda2")), target, tmp_path)
    gaps, force = np.geomspace(1e-3, 3.0, 23), 0.1
    found = kernel.evaluate(
        np.array([1.0, 1.0, 1.0, 1e-3, 0.05]), gaps, np.full(23, 0.01), F=np.full(23, force), dF_dt=np.zeros(23)
    )
    # written once more, by hand, in mpmath: the remote force and its slope by differences
    written = {
        "coth": lambda x, L: mpmath.coth(x / L) - 1,
        "csch": lambda x, L: mpmath.csch(x / L) ** 2,
        "sech": lambda x, L: mpmath.sech(x / L),
        "max": lambda x, L: max(1 - x / L, 0) ** 2,
        "min": lambda x, L: min(1, L / x),
        "sign": lambda x, L: (1 - mpmath.sign(x - L)) / 2,
        "step": lambda x, L: 1 if x < L else 0,
        "abs": lambda x, L: abs(1 - x / L) * mpmath.exp(-x / L),
        "cases": lambda x, L: 1 - x / L if x < L else 0,
    }
    with mpmath.workdps(40):
        L_, A_ = mpmath.mpf("0.05"), mpmath.mpf("0.001")
        expected = [
            A_ * sum(k * written[name](mpmath.mpf(gap), L_) for k, name in enumerate(CASES, start=1)) for gap in gaps
        ]
    np.testing.assert_allclose(found["F_adh"], np.array(expected, dtype=float), rtol=1e-13)
    radius = np.sqrt(2 * (gaps / (1 + gaps) + 0.01))
    zeta = 3 * np.pi * radius**4 / (2 * (gaps / (1 + gaps)) ** 3)
    np.testing.assert_allclose(found["dh_dt"], -(force - found["F_adh"]) / zeta, rtol=1e-12)
    assert np.isfinite(found["lambda2"]).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", list(CASES))
def test_laws_by_cases_have_regimes_and_films_or_are_undecided(name: str) -> None:
    """Nothing fails for a kink or a step: what is not decided says so."""
    diagram = discover(law_with(F_adh=A * CASES[name]))
    assert diagram.regimes
    find_films(diagram)


@pytest.mark.parametrize(
    ("case", "words"),
    [
        (SPLINE.subs(X, h / R), "F_adh has no value for h > 1 (R = E = eta = 1)"),
        (SPLINE.subs(X, h / R + Rational(1, 2)), "for h > 1/2"),
        (SPLINE.subs(X, h / R - Rational(1, 20)), "for h < 1/20"),
        (Piecewise((1, h < R), (2, h > 2 * R)), "for 1 < h < 2"),
        (Piecewise((1, h < R), (2, h > R)), "at h = 1"),
        (Piecewise((1, h < L), (2, h > 2 * L)), "for 1/1000 < h < 1/500 (R = E = eta = 1, L = 1/1000)"),
        (Piecewise((1, h**2 < 2 * R**2), (2, h > 2 * R)), "for 1.41421 < h < 2"),
        (Piecewise((1, a < R), (2, h > R)), "for h < 1 (R = E = eta = 1, a = 1)"),
        (Piecewise((1, L < 2 * R)), "(R = E = eta = 1, L = 1000)"),
    ],
)
def test_where_no_branch_holds_is_named(case: Any, words: str) -> None:
    with pytest.raises(LawError) as caught:
        law_with(F_adh=A * case)
    assert words in str(caught.value)
    assert "end it with a default, (expression, True)" in str(caught.value)


@pytest.mark.parametrize(
    "case",
    [
        Piecewise(*SPLINE.args, (0, True)).subs(X, h / R),
        Piecewise((1, h < L), (2, h >= L)),
        Piecewise((1, h**2 < 2 * R**2), (2, h**3 > R**3)),
        Piecewise((1, h > 0)),
    ],
)
def test_branches_that_cover_the_domain_are_taken(case: Any) -> None:
    law = law_with(F_adh=A * case)
    value = lambdify((h, R, A, L), law.F_adh, "mpmath")
    assert all(mpmath.isfinite(value(mpmath.mpf(gap), 1, 1, mpmath.mpf("0.7"))) for gap in (1e-9, 0.3, 0.9, 3, 1e6))


def test_kinks_elsewhere_than_at_rest_are_known() -> None:
    p = Symbol("p", positive=True)
    none = (
        Abs(delta),
        h * Abs(delta / R),
        Max(delta, 0),
        Max(delta / h, 0),
        sign(delta),
        Piecewise((h, p < 1), (1, True)),
    )
    some = (Abs(delta - R), Max(delta, h), Min(h, R), sign(h - p), Piecewise((1, h < R), (0, True)), Abs(a - R))
    assert not has_kinks(*none, exp(-h / R))
    assert all(has_kinks(expr) for expr in (*some, sign(delta * (h - R))))


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-5, 1e-9])
@pytest.mark.parametrize(
    "parts",
    [
        {"F_adh": A * Max(1 - h / L, 0)},
        {"F_adh": A * Heaviside(L - h)},
        {"zeta": FRICTION * (1 + Max(1 - h / L, 0)), "F_adh": A * exp(-h / L)},
        {"zeta": FRICTION * Piecewise((2, h < L), (1, True)), "F_adh": 0},
    ],
    ids=["kink of a force", "jump of a force", "kink of a friction", "jump of a friction"],
)
def test_runs_over_kinks_and_jumps_keep_their_tolerance(parts: dict[str, Any], rtol: float) -> None:
    """Wherever the kink lies, within ten rtol of Gauss's quadrature on either side of it, added up."""
    law = law_with(**parts)
    rng = np.random.default_rng(3)
    lengths = np.exp(rng.uniform(np.log(0.011), np.log(0.95), 30))
    own = {"A": 5e-4} if A in law.F_adh.free_symbols else {}
    common = {"R": 1.0, "E": 1.0, "eta": 1.0, **own}
    for length in lengths.tolist():
        scene: dict[str, Any] = {"law": law, "parameters": {**common, "L": length}, "target": "c"}
        times = 0.0
        for start, end in ((1.0, length * (1 + 1e-15)), (length * (1 - 1e-15), 0.01)):
            exact = softdyn.simulate(h=start, force=1e-3, until_h=end, gaps=2, method="quadrature", **scene)
            times += exact.t[-1]
        by_gap = softdyn.simulate(h=1.0, force=1e-3, until_h=0.01, gaps=5, rtol=rtol, **scene)
        assert abs(by_gap.t[-1] / times - 1) < 10 * rtol
        by_time = softdyn.simulate(h=1.0, force=1e-3, until_t=times, times=[times], rtol=rtol, **scene)
        assert abs(by_time.h[-1] / 0.01 - 1) < 10 * rtol


@pytest.mark.slow
def test_a_kink_in_the_deflection_keeps_the_tolerance() -> None:
    """Surfaces that stiffen from a deflection on; against the same run with a tolerance ten thousand times less."""
    law = law_with(F_ela=Rational(4, 9) * E * a * Max(delta, 2 * delta - L / 10), F_adh=0)
    for length in np.geomspace(0.02, 0.2, 12).tolist():
        scene: dict[str, Any] = {
            "law": law, "parameters": {"R": 1.0, "E": 1.0, "eta": 1.0, "L": length}, "h": 1.0, "target": "c",
            "force": "1e-3*(1 + 0.5*sin(1e-4*t))", "until_t": 3e4, "times": 7,
        }  # fmt: skip
        rough, fine = softdyn.simulate(rtol=1e-7, **scene), softdyn.simulate(rtol=1e-11, **scene)
        np.testing.assert_allclose(rough.h, fine.h, rtol=1e-6)
        np.testing.assert_allclose(rough.delta, fine.delta, rtol=1e-6)


def test_conditions_are_checked_for_their_dimensions() -> None:
    with pytest.raises(LawError, match="combines"):
        law_with(F_adh=A * Piecewise((1, (h > L) & (h < A)), (0, True)))
