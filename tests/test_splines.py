"""A table as a law keeps the shape of its points, runs in both engines and targets, and ends where it has no value."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq
from sympy import Abs, Expr, Piecewise, Rational, Symbol, oo, pi, sign, sqrt

import softdyn
from softdyn.derive import ContactLaw, Drag, E, Limit, R, Tangential, a, delta, eta, h, read_points, spline
from softdyn.derive.limits import check_limits
from softdyn.derive.positive import positivity, ranges_of_positive
from softdyn.derive.splines import bounds, evaluated
from softdyn.errors import IntegrationError, LawError, SceneError
from softdyn.particles import ParticleScene, Push, simulate

TARGETS = ("c", pytest.param("numba", marks=pytest.mark.slow))
#: Hertz's force over E R^2, at 40 values of delta/R.
POINTS = np.linspace(0.0, 0.2, 40)
VALUES = 4 / 3 * POINTS**1.5
WIDE = {"a": sqrt(2 * R * (h + Abs(delta))), "zeta": 3 * pi * eta * a**4 / (2 * h**3)}
HERTZ = Rational(4, 3) * E * sqrt(R) * sign(delta) * Abs(delta) ** Rational(3, 2)
SIZES = {"R": 1.0, "E": 1.0, "eta": 1.0}
x = Symbol("x", positive=True)


def measured(**more: object) -> ContactLaw:
    """The law of the points."""
    force = E * R**2 * sign(delta) * spline(Abs(delta) / R, POINTS, VALUES)
    return ContactLaw(name="measured", F_ela=force, **WIDE, **more)


def class_of(expr: Expr) -> type:
    return type(expr)


# ---------------------------------------------------------------- the function


@st.composite
def tables(draw: st.DrawFn) -> tuple[list[float], list[float]]:
    count = draw(st.integers(3, 12))
    steps = draw(st.lists(st.floats(0.01, 3), min_size=count, max_size=count))
    values = draw(st.lists(st.integers(-500, 500).map(lambda k: k / 100), min_size=count, max_size=count))
    return np.cumsum(steps).tolist(), values


@settings(deadline=None)
@given(tables())
def test_the_spline_is_that_of_scipy(table: tuple[list[float], list[float]]) -> None:
    points, values = table
    expr, theirs = spline(x, points, values), PchipInterpolator(points, values)
    at = np.linspace(points[0], points[-1], 201)
    size = max(map(abs, values)) + 1
    steep = size / min(np.diff(points))
    assert evaluated(class_of(expr).__name__, at) == pytest.approx(theirs(at), abs=1e-12 * size)
    slope = evaluated(class_of(expr.diff(x)).__name__, at)
    assert slope == pytest.approx(theirs.derivative()(at), abs=1e-11 * steep)


@settings(deadline=None)
@given(tables(), st.floats(-1, 40), st.floats(0.001, 40))
def test_bounds_hold_what_is_between_them(table: tuple[list[float], list[float]], low: float, width: float) -> None:
    for order in range(3):
        one = class_of(spline(x, *table).diff(x, order))
        least, most = bounds(one, low, low + width)
        assert least is not None
        assert most is not None
        for k in range(11):
            value = one(Rational(low) + k * (Rational(low + width) - Rational(low)) / 10)
            assert Rational(least.numerator, least.denominator) <= value <= Rational(most.numerator, most.denominator)


def test_points_that_rise_make_a_positive_slope() -> None:
    rising = spline(x, [0, 1, 2, 5], [0, 3, Rational(31, 10), 9])
    assert rising.diff(x).is_positive
    assert rising.is_positive
    falling = spline(x, [0, 1, 2, 5], [0, 3, 2, 9])
    assert falling.diff(x).is_positive is None
    domain = ((x, ranges_of_positive("x", Rational(5))),)
    # the slope of the first has no zero; with a part of it taken away it has
    assert positivity(rising.diff(x) - Rational(1, 100), domain).verdict == "positive"
    assert positivity(rising.diff(x) - Rational(1, 2), domain).verdict == "witness"
    assert positivity(falling.diff(x), domain).verdict == "witness"


def test_values_of_any_kind_are_the_same() -> None:
    expr = spline(x, POINTS, VALUES)
    near = evaluated(class_of(expr).__name__, 0.0777)
    assert float(expr.subs(x, Rational(777, 10000))) == pytest.approx(near, rel=1e-15)
    with mpmath.workdps(30):
        assert float(evaluated(class_of(expr).__name__, mpmath.mpf(777) / 10000)) == pytest.approx(near, rel=1e-15)
    assert float(expr.subs(x, sqrt(2) / 100).evalf()) == pytest.approx(
        evaluated(class_of(expr).__name__, 0.01 * 2**0.5)
    )
    assert pickle.loads(pickle.dumps(expr)) == expr


@pytest.mark.parametrize(
    ("points", "values", "words"),
    [
        ([0, 1], [0], "a value for each"),
        ([1], [1], "two points at least"),
        ([0, 1, 1], [0, 1, 2], "must increase, but number 3 is 1"),
        ([0, float("nan")], [0, 1], "not finite"),
        ([0, oo], [0, 1], "not finite"),
        ([0, "one"], [0, 1], "no number"),
    ],
)
def test_points_that_are_none_are_refused(points: list[object], values: list[object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        spline(x, points, values)


def test_points_are_read_from_a_table(tmp_path: Path) -> None:
    (tmp_path / "force.csv").write_text("delta/R,force\n0,0\n0.1,0.04\n0.2,0.12\n")
    assert read_points(tmp_path / "force.csv", "delta", "force") == ([0.0, 0.1, 0.2], [0.0, 0.04, 0.12])
    with pytest.raises(SceneError, match="stress"):
        read_points(tmp_path / "force.csv", "delta", "stress")


# ---------------------------------------------------------------- in laws


def test_faults_are_those_of_any_law() -> None:
    force = E * R**2 * sign(delta) * spline(Abs(delta) / R, [0, 0.05, 0.1, 0.2], [0, 0.1, 0.05, 0.2])
    with pytest.raises(LawError, match="C must be positive"):
        ContactLaw(name="falling", F_ela=force, **WIDE)
    with pytest.raises(LawError, match="must be dimensionless; delta is a length"):
        ContactLaw(name="long", F_ela=E * R**2 * spline(delta, POINTS, VALUES), **WIDE)


def test_limits_are_proved_in_a_piece_and_numbers_only_elsewhere() -> None:
    shape = spline(Abs(delta) / R, [0, 0.05, 0.1, 0.2], [1.25, 1.35, 1.4, 1.5])
    limits = tuple(
        Limit(name, ((delta, h, R),), {"F": c * E * sqrt(R) * delta ** Rational(3, 2)})
        for name, c in (("right", Rational(5, 4)), ("wrong", Rational(4, 3)))
    )
    power = E * R**2 * sign(delta) * (Abs(delta) / R) ** Rational(3, 2) * shape
    right, wrong = check_limits(ContactLaw(name="starting", F_ela=power, limits=limits, **WIDE))
    assert (right.verdict, wrong.verdict, wrong.ratio) == ("proved", "disproved", Rational(15, 16))
    remote = E * R**2 * spline(h / R, [0.01, 0.1, 1], [1, 0.3, 0.1]) / 1000
    limits = tuple(
        Limit(name, order, {"F_adh": E * R**2 / 1000})
        for name, order in (("near", (delta, h, R)), ("far", (delta, R, h)))
    )
    for found in check_limits(ContactLaw(name="table", F_ela=HERTZ, F_adh=remote, limits=limits, **WIDE)):
        assert found.verdict == "undecided"
        assert "numbers only" in found.reason


def interpolation_error(F: float) -> float:
    """Deflection of the law of the points under a force, over Hertz's, less 1."""
    theirs = PchipInterpolator(POINTS, VALUES)
    return brentq(lambda d: theirs(d) - F, 1e-6, 0.2, xtol=1e-15) / (0.75 * F) ** (2 / 3) - 1


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
def test_a_pair_moves_as_one_of_hertz_within_the_error_of_the_points(target: str) -> None:
    """The friction goes as (h + delta)^2: a time is off by twice what the deflection is, at most."""
    F, gaps = 2e-3, [0.1, 0.01, 0.001]
    run = {"parameters": SIZES, "h": 0.5, "force": F, "until_h": 1e-3, "gaps": gaps, "target": target}
    ours, exact = (
        softdyn.simulate(law=law, **run) for law in (measured(), ContactLaw(name="hertz", F_ela=HERTZ, **WIDE))
    )
    off = interpolation_error(F)
    assert 1e-5 < abs(off) < 1e-3
    assert ours.delta[-1] / exact.delta[-1] - 1 == pytest.approx(off, rel=1e-6)
    relative = ours.t / exact.t - 1
    assert np.all(np.abs(relative) < 2 * abs(off) + 1e-8)
    assert abs(off) < abs(relative[-1])


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
def test_particles_do_so_too(target: str) -> None:
    F = 2e-3
    laws = (measured(), ContactLaw(name="hertz", F_ela=HERTZ, **WIDE))
    ours, exact = (
        simulate(
            ParticleScene(
                law=law, parameters={"E": 1.0, "eta": 1.0}, positions=[[0.0, 0.0], [2.1, 0.0]], radii=1.0, range=0.5,
                push=[Push([0], force=[F, 0.0]), Push([1], force=[-F, 0.0])], drag=1.0, until_t=1e6, target=target,
                rtol=1e-5,
            )
        )
        for law in laws
    )  # fmt: skip
    off = interpolation_error(F)
    assert ours.contact_delta[-1] / exact.contact_delta[-1] - 1 == pytest.approx(off, rel=0.01)
    # h ~ t^(-1/2) late, and t by twice the deflection
    assert ours.contact_h[-1] / exact.contact_h[-1] - 1 == pytest.approx(off, abs=1e-5 + 0.1 * abs(off))


def test_a_run_ends_where_the_table_does() -> None:
    run = {"parameters": SIZES, "h": 0.5, "constants": {"w": 1e-4}, "until_t": 3e4, "until_h": None, "target": "c"}
    asked, ends = r"the law has no value: F_ela is asked for at Abs\(delta\)/R =", "and its table goes from 0 to 0.2"
    with pytest.raises(IntegrationError, match=rf"at t=\S+ {asked} 0\.2\d*, {ends}"):
        softdyn.simulate(law=measured(), force="0.2*sin(w*t)", **run)
    with pytest.raises(IntegrationError, match=rf"at t=0 {asked} 0\.29"):
        softdyn.simulate(law=measured(), parameters=SIZES, h=0.5, force=0.2, until_h=1e-3, target="c")
    scene = ParticleScene(
        law=measured(), parameters={"E": 1.0, "eta": 1.0}, positions=[[0.0, 0.0], [2.1, 0.0]], radii=1.0, range=0.5,
        push=[Push([0], force=["0.2*sin(w*t)", 0.0]), Push([1], force=["-0.2*sin(w*t)", 0.0])], drag=1.0,
        constants={"w": 1e-4}, until_t=3e4, target="c",
    )  # fmt: skip
    with pytest.raises(IntegrationError, match="particles 0 and 1 is where the law has no value: F_ela is asked for"):
        simulate(scene)


def test_a_batch_tells_of_each_run_that_leaves_the_table() -> None:
    forces = [1e-3, 0.2]
    found = softdyn.simulate(
        law=measured(), parameters=SIZES, h=0.5, force=np.array(forces), until_h=1e-2, gaps=[0.1, 0.01], target="c"
    )
    assert list(found.errors) == [1]
    assert "no value" in found.errors[1]


@pytest.mark.slow
def test_a_table_in_a_branch_that_does_not_hold_is_not_asked() -> None:
    """A remote force that ends where its table does."""
    remote = E * R**2 * Piecewise((spline(h / R, [0, 0.05, 0.1], [1e-4, 2e-5, 0]), h < R / 10), (0, True))
    law = ContactLaw(name="ending", F_ela=HERTZ, F_adh=remote, **WIDE)
    result = softdyn.simulate(
        law=law, parameters=SIZES, h=0.5, force=2e-5, until_h=None, until_t=1e10, target="c"
    )  # fmt: skip
    assert result.h[-1] == pytest.approx(0.05, rel=1e-4)


def test_a_table_is_asked_where_the_scene_has_a_use_for_it() -> None:
    """Sliding that is known up to a gap of R/100: a scene without tangential motion may go beyond, one with it not."""
    sliding = Tangential(sliding=eta * R * spline(h / R, [0, Rational(1, 100)], [1, 2]), k_t=E * R)
    law = ContactLaw(name="sliding", F_ela=HERTZ, tangential=sliding, **WIDE)
    scene = ParticleScene(
        law=law, parameters={"E": 1.0, "eta": 1.0}, positions=[[0.0, 0.0], [2.1, 0.0]], radii=1.0, range=0.5,
        drag=1.0, until_t=1.0, target="c",
    )  # fmt: skip
    assert simulate(scene).t[-1] == 1.0
    with pytest.raises(IntegrationError, match=r"no value: tangential sliding is asked for at h/R = 0\.1"):
        simulate(replace(scene, tangential=True))
    with pytest.raises(LawError, match="drag translation does not vary in a run"):
        replace(law, drag=Drag(translation=eta * R * spline(pi, [0, 4], [1, 2])))
