"""Positivity is proved over the whole domain, or numbers show where it fails, or the box that is left is named."""

from __future__ import annotations

import math
import random
import warnings
from typing import Any

import mpmath
import pytest
import sympy
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from sympy import (
    Abs,
    Add,
    Expr,
    Integer,
    Interval,
    Piecewise,
    Rational,
    Symbol,
    cosh,
    exp,
    log,
    pi,
    sign,
    sin,
    sqrt,
    tanh,
)

import softdyn
from softdyn import particles
from softdyn.derive import DIMENSIONLESS, LENGTH, ContactLaw, E, R, a, delta, eta, h
from softdyn.derive.bound_programs import bound_program
from softdyn.derive.bounds import Box, OutOfReachError, unit_frame
from softdyn.derive.checks import pressed_only, signs_of
from softdyn.derive.logarithm_bounds import LogarithmBox
from softdyn.derive.positive import Positivity, positivity, ranges_between, ranges_of_positive
from softdyn.errors import IntegrationError, LawError, SceneError
from softdyn.laws import law_of, stock_laws
from softdyn.particles import ParticleScene, Push

hbar = R * h / (R + h)
b, c, p, q, d = (Symbol(name, positive=True) for name in "bcpqd")
n = Symbol("n", positive=True)
x, y = h / b, h / (6 * b * (1 + h))
friction = 3 * pi * eta * a**4 / (2 * hbar**3)
common: dict[str, Any] = {"name": "trial", "a": sqrt(2 * R * (hbar + Abs(delta))), "zeta": friction}
DOMAIN = (
    (h, ranges_of_positive("h")),
    (d, ranges_of_positive("d", Rational(1))),
    *((symbol, ranges_of_positive(symbol.name)) for symbol in (b, c, p, q)),
    (n, ranges_between("n", Interval.open(1, 3))),
)


@pytest.mark.parametrize(
    "expr",
    [
        (1 + y) * log(1 + 1 / y) - 1,  # slip: the leading terms cancel at one end
        x - log(1 + x),
        1 / tanh(x) - 1 / x,
        cosh(x) - 1,
        1 - exp(-x),
        1 - 70 * d + 1500 * d**2,  # softens, and does not turn
        n * d ** (n - 1) * (1 + d / h) - d**n / 2,
        1 / log(2 + 1 / d) - 1 / ((2 + 1 / d) * d * log(2 + 1 / d) ** 2) / 2,
        1 + b / h + c * p / (h + q) - b / (h + b) - q * p * c / ((q + h) ** 2 * (1 + p)),  # five scales
        h**4 - 4 * h**3 * b + 6 * h**2 * b**2 - 4 * h * b**3 + Rational(11, 10) * b**4,
        Piecewise((1 - h, h < Rational(1, 2)), (h / 2, True)),
        2 + sin(5 * log(h)),
    ],
    ids=str,
)
def test_what_is_positive_is_proved_in_few_boxes(expr: Expr) -> None:
    found = positivity(expr, DOMAIN)
    assert found.verdict == "positive"
    assert found.boxes < 500


@pytest.mark.parametrize(
    "expr",
    [
        1 - 2 * exp(-((log(100 * h / 3)) ** 2)),  # negative near h = 0.03 R
        1 - 2 * exp(-(10**16) * (log(100 * h / 3)) ** 2),  # and within 1e-8 of it alone
        1 - 80 * d + 1500 * d**2,  # a shell that snaps through
        1 + b / h + c * p / (h + q) - b / (h + b) - 3 * q * p * c / ((q + h) ** 2 * (1 + p)),
        1 + log(1 + 1 / h) - log(1 + 1 / h) ** 2 / 100,  # below h = 1e-44
        sqrt(h - Rational(1, 10**7)),
    ],
    ids=str,
)
def test_what_is_not_positive_has_a_witness(expr: Expr) -> None:
    found = positivity(expr, DOMAIN)
    assert found.verdict == "witness"
    with mpmath.workdps(60):
        exact = {
            symbol: Rational(*mpmath.libmp.to_rational(found.at[symbol.name]._mpf_)) for symbol in expr.free_symbols
        }
        value = expr.subs(exact).evalf(30)
    assert value.is_real is False or value <= 0


def test_what_touches_zero_is_unknown_and_its_box_is_small() -> None:
    found = positivity((h - Rational(3, 100)) ** 2, DOMAIN)
    assert found.verdict == "unknown"
    low, high = found.left["h"]
    assert low < 0.03 < high < low + 1e-8


def test_an_end_that_is_left_out_may_be_where_it_vanishes() -> None:
    nu = Symbol("nu", real=True)
    open_ = ((nu, ranges_between("nu", Interval.Lopen(-1, Rational(1, 2)))),)
    assert positivity(1 - nu**2, open_).verdict == "positive"
    closed = ((nu, ranges_between("nu", Interval(-1, Rational(1, 2)))),)
    assert positivity(1 - nu**2, closed) == Positivity("witness", {"nu": -1}, 0, {}, boxes=1)


def random_expression(draw: random.Random, depth: int) -> Expr:
    """An expression of h and b, of the functions that laws have."""
    if depth == 0:
        return draw.choice([h, b, h / b, Rational(draw.randint(1, 9), draw.randint(1, 9))])
    one, other = random_expression(draw, depth - 1), random_expression(draw, depth - 1)
    return draw.choice(
        [
            lambda: one + other,
            lambda: one - other,
            lambda: one * other,
            lambda: one / other,
            lambda: sqrt(1 + one**2),
            lambda: exp(-Abs(one)),
            lambda: log(1 + Abs(one)),
            lambda: tanh(one),
            lambda: one ** Rational(1, 3) if one.is_positive else one**2,
            lambda: Piecewise((one, h < b), (other, True)),
            lambda: sympy.Max(one, other),
        ]
    )()


def random_logarithms(draw: random.Random) -> Expr:
    """A sum of logarithms of what may be as small or large as one likes, with factors."""
    arguments = [h, b, h / b, 6 * b / h, h + b, 1 + h / b, 1 + b / h, h + sqrt(h * b), sqrt(h) / b]
    powers = [Integer(1), h / b, sqrt(b / h), 1 / log(2 + h / b), b]
    terms = (draw.randint(-5, 5) * draw.choice(powers) * log(draw.choice(arguments)) for _ in range(3))
    return Add(*terms) + draw.randint(-3, 3)


def bounds_hold(seed: int, kind: type[Box] = Box) -> bool | None:
    """Whether bounds on a random box hold the values, to 50 digits, at random points; None if there are no bounds."""
    draw = random.Random(seed)
    expr = random_logarithms(draw) if kind is LogarithmBox else random_expression(draw, 3)
    if expr.has(sympy.zoo, sympy.nan):
        return None
    # an exponential of another has more digits than can be had
    if any(one.args[0].has(exp, tanh) for one in expr.atoms(exp, tanh)):
        return None
    ends = []
    for _ in range(2):
        low = draw.uniform(-30, 20)
        high = low + draw.choice([0.0, 1e-3, 1.0, 30.0])
        ends.append(draw.choice([(low, high), (low, high), (-math.inf, high), (low, math.inf)]))
    function = sympy.lambdify([h, b], expr, modules="mpmath", dummify=True)
    frame = unit_frame(2) if kind is Box or seed % 3 else ((1, 0), (1, 1))
    looked = None
    for kept in (1, 4):
        try:
            box, value = bound_program(expr, [h, b], {}).on(ends, frame, kept, kind)
        except OutOfReachError:
            continue
        low, high = box.bounds(value)
        for _ in range(20):
            at = [draw.uniform(max(lo, hi - 60), hi) if hi < math.inf else draw.uniform(lo, lo + 60) for lo, hi in ends]
            with mpmath.workdps(400):
                try:
                    scales = (sum(k * mpmath.mpf(u) for k, u in zip(row, at, strict=True)) for row in frame)
                    exact = function(*map(mpmath.exp, scales))
                except (ZeroDivisionError, OverflowError):
                    continue
                if mpmath.im(exact) != 0:
                    continue
                looked = True
                signed = value.sign == 0 or exact * value.sign >= 0
                if not (low <= exact <= high and signed):
                    return False
    return looked


@pytest.mark.slow
def test_bounds_hold_every_value() -> None:
    """To 400 digits, on 150 random boxes, bounded and not."""
    verdicts = [bounds_hold(seed) for seed in range(150)]
    assert False not in verdicts
    assert verdicts.count(True) > 75


@pytest.mark.slow
def test_bounds_hold_every_value_where_logarithms_are_terms() -> None:
    verdicts = [bounds_hold(seed, LogarithmBox) for seed in range(600)]
    assert False not in verdicts
    assert verdicts.count(True) > 500


@pytest.mark.slow
def test_bounds_hold_every_value_of_many() -> None:
    verdicts = [bounds_hold(seed) for seed in range(1000, 2000)]
    assert False not in verdicts
    assert verdicts.count(True) > 500


@pytest.mark.slow
def test_no_verdict_of_300_random_laws_is_false() -> None:
    """Frictions of random exponentials and logarithms: none proved positive is negative in 200 random points of it."""
    verdicts = []
    for seed in range(300):
        draw = random.Random(10_000 + seed)
        factor = 1 + Rational(draw.randint(1, 12), 10) * (random_expression(draw, 2) - random_expression(draw, 2))
        if factor.has(sympy.zoo, sympy.nan):
            continue
        found = positivity(factor, DOMAIN, 60)
        verdicts.append(found.verdict)
        function = sympy.lambdify([h, b], factor, modules="mpmath", dummify=True)
        with mpmath.workdps(100):
            if found.verdict == "witness":
                at = [found.at.get(name, mpmath.mpf(1)) for name in ("h", "b")]
                value = function(*at)
                assert mpmath.im(value) != 0 or value <= 0, factor
            for _ in range(200 if found.verdict == "positive" else 0):
                value = function(*(mpmath.exp(mpmath.mpf(draw.uniform(-60, 60))) for _ in range(2)))
                assert value > 0, factor
    assert verdicts.count("unknown") < 60


@pytest.mark.parametrize("name", sorted(stock_laws()))
def test_every_sign_of_a_stock_law_is_proved(name: str) -> None:
    assert {sign_.found.verdict for sign_ in signs_of(law_of(name))} == {"positive"}


SPRINGS = {
    "Hertz": Rational(4, 3) * E * sqrt(R) * sqrt(Abs(delta)) * delta,
    "Lacasse": E * R**2 * (Abs(delta) / R) ** Rational(13, 10) * sign(delta),
    "Morse-Witten": E * R * delta / log(2 + R / Abs(delta)),
    "Pogorelov": E * R**2 / 100 * sqrt(Abs(delta) / R) * sign(delta),
    "cubic": E * delta**3 / R,
    "any power": E * R**2 * (Abs(delta) / R) ** n * sign(delta),
    "Hertz, pressed": Rational(4, 3) * E * sqrt(R) * delta ** Rational(3, 2),
    "any power, pressed": E * R**2 * (delta / R) ** n,
}


def spring(name: str) -> ContactLaw:
    own: dict[str, Any] = {"parameters": {n: DIMENSIONLESS}, "ranges": {n: (1, 3)}, "typical": {n: Rational(3, 2)}}
    return ContactLaw(**common, F_ela=SPRINGS[name], **(own if "any" in name else {}))


@pytest.mark.parametrize("name", SPRINGS)
def test_a_stiffness_that_vanishes_without_deflection_is_no_fault(name: str) -> None:
    law = spring(name)
    assert {sign_.found.verdict for sign_ in signs_of(law)} == {"positive"}
    assert pressed_only(law) == name.endswith("pressed")


@pytest.mark.parametrize(
    ("quantity", "changes"),
    [
        ("zeta", {"zeta": friction * (1 - 2 * exp(-((100 * log(100 * h / (3 * R))) ** 2)))}),
        ("C", {"F_ela": E * R * delta * (1 - 40 * Abs(delta) / R + 500 * delta**2 / R**2)}),
    ],
)
def test_a_law_that_fails_in_a_narrow_place_is_refused(quantity: str, changes: dict[str, Any]) -> None:
    with pytest.raises(LawError, match=f"{quantity} must be positive for h > 0"):
        ContactLaw(**{**common, "F_ela": E * a * delta, **changes})


@pytest.mark.slow
def test_a_sign_that_is_not_known_is_told_with_its_box() -> None:
    touching = friction * (log(100 * h / (3 * R))) ** 2
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        ContactLaw(**common | {"zeta": touching}, F_ela=E * a * delta)
    assert told
    assert all("zeta > 0 is not proved for delta" in str(one.message) for one in told)
    assert all("h near 0.03" in str(one.message) for one in told)


@pytest.mark.slow
def test_many_parameters_cost_no_power_of_three() -> None:
    """Seven lengths of slip, each of any size: one law, in seconds."""
    lengths = [Symbol(f"b{i}", positive=True) for i in range(7)]
    slip = sympy.Add(*(h / (h + length) for length in lengths))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        law = ContactLaw(
            **common | {"zeta": friction * (1 + slip - slip**2 / 8)},
            F_ela=E * a * delta,
            parameters=dict.fromkeys(lengths, LENGTH),
        )
    assert sum(sign_.found.boxes for sign_ in signs_of(law)) < 100


def drained(law: ContactLaw, force: float, t: float) -> tuple[float, float]:
    """Gap and deflection at a time under a constant force, from h = 0.05, integrated on its own."""
    at = {R: 1, E: 1, eta: 1, n: Rational(3, 2)}
    elastic = sympy.lambdify([h, delta], law.F_ela.subs(a, law.a).subs(at), "math")
    resisting = sympy.lambdify([h, delta], law.zeta.subs(a, law.a).subs(at), "math")

    def pressed(gap: float) -> float:
        return float(brentq(lambda size: elastic(gap, size) - force, 1e-15, 1.0, xtol=1e-17, rtol=1e-14))

    def rate(_: float, u: Any) -> list[float]:
        gap = math.exp(u[0])
        return [-force / resisting(gap, pressed(gap)) / gap]

    solved = solve_ivp(rate, (0, t), [math.log(0.05)], method="Radau", rtol=1e-11, atol=1e-12)
    gap = math.exp(solved.y[0, -1])
    return gap, pressed(gap)


@pytest.mark.parametrize(
    "name",
    [name if name in ("Hertz", "Pogorelov") else pytest.param(name, marks=pytest.mark.slow) for name in SPRINGS],
)
def test_springs_that_start_without_stiffness_run_in_both_engines(name: str) -> None:
    law, force, until = spring(name), 1e-4, 2e4
    own = {"n": 1.5} if "any" in name else {}
    gap, size = drained(law, force, until)
    run = softdyn.simulate(
        law=law, parameters={"R": 1.0, "E": 1.0, "eta": 1.0, **own}, h=0.05, force=force, until_t=until
    )
    assert run.h[-1] == pytest.approx(gap, rel=1e-8)
    assert run.delta[-1] == pytest.approx(size, rel=1e-8)
    _, first = drained(law, force, 1e-9)
    push = [Push([0], [force, 0, 0]), Push([1], [-force, 0, 0])]
    scene = ParticleScene(
        law=law, parameters={"E": 1.0, "eta": 1.0, **own}, positions=[[0.0, 0, 0], [2.05 - 2 * first, 0, 0]],
        radii=[1.0, 1.0], gap=0.05, push=push, until_t=until, rtol=1e-7,
    )  # fmt: skip
    contact = particles.simulate(scene).contacts(-1)
    assert contact["h"][0] == pytest.approx(gap, rel=1e-5)
    assert contact["delta"][0] == pytest.approx(size, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Pogorelov", "any power, pressed"])
def test_a_force_that_starts_from_zero_or_turns_is_followed_or_refused_by_name(name: str) -> None:
    law, own = spring(name), {"n": 1.5} if "any" in name else {}
    given: dict[str, Any] = {"law": law, "parameters": {"R": 1.0, "E": 1.0, "eta": 1.0, **own}, "h": 1.0}
    turning: dict[str, Any] = {**given, "constants": {"w": 1e-3}}
    for rising in ("sin(w*t)", "sin(w*t)*exp(-w*t)"):
        assert softdyn.simulate(**turning, force=f"1e-3*{rising}", until_t=1500.0).delta[-1] > 0
    if name.endswith("pressed"):
        with pytest.raises(IntegrationError, match="is defined for delta >= 0 alone"):
            softdyn.simulate(**turning, force="1e-3*cos(w*t)", until_t=3000.0)
        with pytest.raises(SceneError, match="is defined for delta >= 0 alone"):
            softdyn.simulate(**given, force=-1e-3, until_t=3000.0)
    else:
        turned = softdyn.simulate(**turning, force="1e-3*cos(w*t)", until_t=3000.0)
        assert turned.delta[-1] < 0


def test_particles_of_a_law_of_pressed_surfaces_end_by_name_where_they_part() -> None:
    pushes = [Push([0], ["1e-4*cos(w*t)", 0, 0]), Push([1], ["-1e-4*cos(w*t)", 0, 0])]
    scene = ParticleScene(
        law=spring("Hertz, pressed"), parameters={"E": 1.0, "eta": 1.0}, positions=[[0.0, 0, 0], [2.046, 0, 0]],
        radii=[1.0, 1.0], gap=0.05, push=pushes, constants={"w": 1e-3}, until_t=3e3, rtol=1e-6,
    )  # fmt: skip
    with pytest.raises(IntegrationError, match=r"defined for delta >= 0 alone.*particles 0 and 1"):
        particles.simulate(scene)
