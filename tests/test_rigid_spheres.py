"""The friction of two rigid spheres of any radii, against exact solutions of Stokes' equations."""

from __future__ import annotations

import math
from dataclasses import replace

import brenner
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sympy import Rational, Symbol, lambdify, limit, log, oo

from softdyn.derive import E, R, h, size_ratio
from softdyn.derive.laws.equal_spheres import law as equal_spheres
from softdyn.derive.laws.rognon_gay import law as rognon_gay
from softdyn.derive.rigid_spheres import brenner as of_equal
from softdyn.derive.rigid_spheres import brenner_unequal, unequal
from softdyn.errors import LawError
from softdyn.stress import two_spheres

friction = lambdify((h, R, size_ratio), brenner_unequal, "math")
ratios = st.floats(0.0, 3.0).map(lambda x: 10**x) | st.just(math.inf)


def closed(gap: float, ratio: float) -> float:
    """The closed form for spheres of radii 1 and ``ratio``."""
    return float(friction(gap, 2 / (1 + 1 / ratio), (1 / ratio) / (1 + 1 / ratio) ** 2))


@pytest.mark.slow
@given(gap=st.floats(-2, 2).map(lambda x: 10**x), ratio=ratios)
@settings(max_examples=60, deadline=None)
def test_the_closed_form_is_within_a_percent_of_the_exact_solution(gap: float, ratio: float) -> None:
    assert closed(gap, ratio) == pytest.approx(two_spheres.friction(gap, ratio), rel=0.0075)


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [1.0, 1.1, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0, 40.0, 100.0, math.inf])
def test_the_closed_form_is_within_a_percent_at_any_gap(ratio: float) -> None:
    for power in range(-12, 9):
        gap = 10 ** (power / 4)
        assert closed(gap, ratio) == pytest.approx(two_spheres.friction(gap, ratio), rel=0.0075)


@pytest.mark.parametrize("gap", [0.01, 0.1, 1.0, 10.0, 100.0])
def test_the_exact_solution_is_brenners_for_equal_spheres(gap: float) -> None:
    assert two_spheres.friction(gap, 1.0) == pytest.approx(float(brenner.friction(gap)), rel=1e-10)


def test_the_exact_solution_has_the_known_limits_at_a_wall() -> None:
    """Cox & Brenner 1967 near contact; Lorentz's, to the third order in R1/(h + R1), far away."""
    near = 1 / 1e-3 - log(1e-3) / 5 + 0.971264
    assert two_spheres.friction(1e-3, math.inf) == pytest.approx(float(near), rel=1e-6)
    far = 1 / (1 - 9 / 8 / 101 + 1 / 2 / 101**3)
    assert two_spheres.friction(100.0, math.inf) == pytest.approx(far, rel=1e-7)


@pytest.mark.parametrize("gap", [0.1, 1.0, 10.0])
def test_a_sphere_that_is_large_enough_is_a_wall(gap: float) -> None:
    assert two_spheres.friction(gap, 1e6) == pytest.approx(two_spheres.friction(gap, math.inf), rel=1e-5)


def test_the_closed_form_has_the_exact_leading_terms() -> None:
    """Near contact R/(2h) and the logarithm of Jeffrey & Onishi; far apart 1; of equal spheres, Brenner's."""
    lam = Symbol("lam", positive=True)
    size = lam / (1 + lam) ** 2
    exact = (1 + 7 * lam + lam**2) / (5 * (1 + lam) ** 2)
    assert ((1 + 5 * size) / 5 - exact).simplify() == 0
    for ratio in (Rational(0), Rational(1, 9), Rational(1, 4)):
        form = brenner_unequal.subs({size_ratio: ratio, R: 1})
        assert limit(form * 2 * h, h, 0, "+") == 1
        assert limit((form - 1 / (2 * h)) / log(1 / h), h, 0, "+") == (1 + 5 * ratio) / 5
        assert limit(form, h, oo) == 1
    assert brenner_unequal.subs(size_ratio, Rational(1, 4)) == of_equal
    assert unequal.subs(size_ratio, Rational(1, 4)) == 1
    assert "size_ratio" not in str(equal_spheres.zeta)


@pytest.mark.parametrize(
    ("factor", "message"),
    [
        (1 + size_ratio, "unequal must be 1 of equal particles"),
        (1 + (1 - 4 * size_ratio) * (R / h - 1) * 2, "unequal must be positive for h > 0, but at size_ratio=0"),
        (1 + (1 - 4 * size_ratio) / h, "unequal"),
        (1 + (1 - 4 * size_ratio) * E, "unequal: symbol 'E' is not allowed here; allowed: h, R, size_ratio"),
        ("1", "not a sympy expression"),
    ],
)
def test_a_factor_of_unequal_particles_that_is_none_is_refused(factor: object, message: str) -> None:
    with pytest.raises(LawError, match=message):
        replace(rognon_gay, name="wrong", unequal=factor)
