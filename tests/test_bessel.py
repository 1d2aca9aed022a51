"""Bessel functions of whole order: in kernels, to 4 units in the last place in both targets; in laws, and in proofs."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from dataclasses import replace

import mpmath
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from kernels_by_text import compile_c, import_text
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import k1
from sympy import Expr, Rational, Symbol, besseli, besselj, besselk, bessely, exp, log, pi, sqrt

import softdyn
from softdyn.derive import LENGTH, ContactLaw, E, Limit, R, delta, h
from softdyn.derive.bessel import FUNCTIONS, HIGHEST, in_digits, parts, polynomials
from softdyn.derive.branches import in_plain_functions
from softdyn.derive.emit import with_special
from softdyn.derive.laws.rognon_gay import law as rognon_gay
from softdyn.derive.limits import check_limits
from softdyn.derive.positive import positivity, ranges_of_positive
from softdyn.derive.translate import to_c
from softdyn.particles import ParticleScene, Push, simulate

Array = NDArray[np.float64]
Functions = dict[str, Callable[[str, Array], Array]]
TARGETS = ("c", pytest.param("numba", marks=pytest.mark.slow))
ULPS = 4
USED = [(kind, n) for kind, n in FUNCTIONS if n <= HIGHEST]
HEAD = """
from math import cos, exp, fabs, inf, log, nan, sin, sqrt
import numba
from numpy import ndarray as array
jit = numba.njit(error_model="numpy")
"""
BODY = "\n\n".join(
    f"@jit\ndef all_{kind}{n}(n: int, x: array, out: array) -> None:\n    for i in range(n):\n"
    f"        out[i] = _bessel_{kind}{n}(x[i])\n"
    for kind, n in USED
)


@pytest.fixture(scope="module")
def values(tmp_path_factory: pytest.TempPathFactory) -> Functions:
    """Each function of arrays, by its kind and order, for each target."""
    folder = tmp_path_factory.mktemp("bessel")
    raw = compile_c("#include <math.h>\n#include <stdint.h>\n" + to_c(with_special(BODY)), folder)
    compiled = import_text(HEAD + with_special(BODY), folder)

    def in_c(name: str, x: Array) -> Array:
        function = getattr(raw, f"all_{name}")
        function.argtypes, function.restype = [ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p], None
        out = np.empty_like(x)
        function(len(x), x.ctypes.data, out.ctypes.data)
        return out

    def in_numba(name: str, x: Array) -> Array:
        out = np.empty_like(x)
        getattr(compiled, f"all_{name}")(len(x), x, out)
        return out

    return {"c": in_c, "numba": in_numba}


def units_off(kind: str, n: int, x: float, found: float) -> float:
    """Error in units of the last place; of what oscillates, of its amplitude."""
    with mpmath.workdps(40):
        exact = getattr(mpmath, f"bessel{kind}")(n, mpmath.mpf(x))
        size = abs(float(exact))
        if kind in "jy" and x > (0.5 if kind == "y" else 2.0):
            size = max(size, min(1.0, math.sqrt(2 / (math.pi * x))))
        return float(abs(mpmath.mpf(found) - exact) / mpmath.mpf(math.ulp(size)))


ARGUMENTS = st.one_of(
    st.floats(-300, 0).map(lambda k: 10**k),
    st.floats(0.5, 20),
    st.floats(20, 690),
    st.sampled_from([1.0, 2.0, 4.0, 6.0, 8.0]).flatmap(lambda c: st.floats(c * (1 - 1e-15), c * (1 + 1e-15))),
)


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    which=st.sampled_from(USED),
    drawn=st.lists(ARGUMENTS, min_size=20, max_size=40),
    far=st.lists(st.floats(2.8, 8).map(lambda k: 10**k), max_size=5),
)
def test_bessel_functions_are_exact_to_four_units(
    values: Functions, target: str, which: tuple[str, int], drawn: list[float], far: list[float]
) -> None:
    kind, n = which
    # x^-2 and x^2 have a value as far as 1e-150
    x = [argument for argument in drawn if n < 2 or argument > 1e-150] + (far if kind in "jy" else [])
    for argument, value in zip(x, values[target](f"{kind}{n}", np.array(x)).tolist(), strict=True):
        assert units_off(kind, n, argument, value) <= ULPS, (argument, value)


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
def test_their_symmetry_and_values_at_the_ends(values: Functions, target: str) -> None:
    x = np.array([0.3, 3.0, 30.0])
    for kind, n in USED:
        function = values[target]
        at = function(f"{kind}{n}", np.array([0.0, math.inf, math.nan, -1.0])).tolist()
        zero, far = {"j": (n == 0, 0.0), "i": (n == 0, math.inf), "y": (-math.inf, 0.0), "k": (math.inf, 0.0)}[kind]
        assert at[:2] == [zero, far]
        assert math.isnan(at[2])
        if kind in "ji":
            np.testing.assert_array_equal(function(f"{kind}{n}", -x), (-1) ** n * function(f"{kind}{n}", x))
        else:
            assert math.isnan(at[3])


@pytest.mark.slow
def test_the_polynomials_leave_less_than_a_unit() -> None:
    """With exact arithmetic, what is cut off and what the coefficients are rounded by."""
    for kind, n in USED:
        found = polynomials(kind, n)
        with mpmath.workdps(30):
            for name, pieces in parts(kind, n).items():
                for (function, low, high, _), (_, _, coefficients) in zip(pieces, found[name], strict=True):
                    u = [mpmath.mpf(k) / 20 for k in range(-19, 20)]
                    exact = [function((low + high) / mpmath.mpf(2) + v * (high - low) / 2) for v in u]
                    near = [mpmath.polyval([mpmath.mpf(c) for c in reversed(coefficients)], v) for v in u]
                    largest = max(map(abs, exact))
                    off = max(abs(one - other) for one, other in zip(near, exact, strict=True))
                    assert off < 2.0**-52 * largest, (kind, n, name, low)


@pytest.mark.parametrize("digits", [15, 100])
def test_values_of_many_digits_are_those_of_mpmath(digits: int) -> None:
    with mpmath.workdps(digits):
        for kind, n in USED:
            for x in ("1e-20", "0.7", "7", "30", "150", "-3"):
                if kind in "ji" or x != "-3":
                    exact = getattr(mpmath, f"bessel{kind}")(n, mpmath.mpf(x))
                    assert mpmath.almosteq(in_digits(kind, n, mpmath.mpf(x)), exact, mpmath.mpf(10) ** (2 - digits))


x = Symbol("x", positive=True)


@pytest.mark.parametrize("general", [besselj, bessely, besseli, besselk])
@pytest.mark.parametrize("n", [-1, 0, 1, 2, 5])
def test_each_order_and_its_derivatives_are_those_of_sympy(general: Expr, n: int) -> None:
    expr = general(n, x)
    own = in_plain_functions(expr)
    if general in (besselj, besseli) and n > HIGHEST:
        assert own == expr
        return
    for k in range(3):
        values = [float(one.diff(x, k).subs(x, Rational(7, 5)).evalf(20)) for one in (own, expr)]
        assert values[0] == pytest.approx(values[1], rel=1e-14)


# ---------------------------------------------------------------- in laws

ell = Symbol("ell", positive=True)
SIZE = E * R**2 / 10**6


def screened(F_adh: Expr, limits: tuple[Limit, ...] = ()) -> ContactLaw:
    """The paper's law with a remote force: two cylinders repel as K1, plates with a porous layer as I1/I0."""
    own = {"parameters": {ell: LENGTH}, "typical": {ell: R / 100}}
    return replace(rognon_gay, name="screened", F_adh=F_adh, limits=limits, **own)


NEAR, FAR = ((delta, h, R), (h, ell)), ((delta, h, R), (ell, h))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("force", "order", "form"),
    [
        (besselk(1, h / ell), NEAR, ell / h),
        (besselk(1, h / ell), FAR, sqrt(pi * ell / (2 * h)) * exp(-h / ell)),
        (besselk(0, h / ell), NEAR, log(ell / h)),
        (besseli(0, h / ell) - 1, NEAR, h**2 / (4 * ell**2)),
        (besseli(1, h / ell) / besseli(0, h / ell), NEAR, h / (2 * ell)),
        (besseli(1, h / ell) / besseli(0, h / ell), FAR, 1),
        (1 - besseli(1, h / ell) / besseli(0, h / ell), FAR, ell / (2 * h)),
        (besselk(1, h / ell) - ell / h, NEAR, -h / (2 * ell) * log(ell / h)),
        (bessely(1, h / ell), NEAR, -2 * ell / (pi * h)),
        (besselj(2, h / ell), NEAR, h**2 / (8 * ell**2)),
    ],
)
def test_leading_terms_are_proved_and_others_disproved(force: Expr, order: tuple[tuple[Expr, ...]], form: Expr) -> None:
    limits = tuple(Limit(name, order, {"F_adh": k * SIZE * form}) for name, k in (("right", 1), ("wrong", 2)))
    right, wrong = check_limits(screened(SIZE * force, limits))
    assert (right.verdict, wrong.verdict, wrong.ratio) == ("proved", "disproved", Rational(1, 2))


@pytest.mark.slow
def test_what_oscillates_is_not_proved_far_out() -> None:
    (found,) = check_limits(screened(SIZE * besselj(0, h / ell), (Limit("far", FAR, {"F_adh": SIZE}),)))
    assert found.verdict == "disproved"


@pytest.mark.slow
def test_positivity_of_bessel_functions() -> None:
    domain = ((x, ranges_of_positive("x")),)
    certain = [besseli(0, x) - Rational(1, 2), 2 - besselj(0, x), 1 + x - x * besselk(1, x) / (1 + besselk(1, x))]
    for expr in certain:
        assert positivity(in_plain_functions(expr), domain).verdict == "positive", expr
    for expr in (besselj(0, x), 2 - besseli(0, x), besselk(0, x) - 1):
        assert positivity(in_plain_functions(expr), domain).verdict == "witness", expr


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
def test_a_pair_rests_where_the_screened_force_is_that_of_scipy(target: str) -> None:
    result = softdyn.simulate(
        law=screened(SIZE * besselk(1, h / ell)), parameters={"R": 1.0, "E": 1.0, "eta": 1.0, "ell": 0.01},
        h=0.5, force=1e-6, until_h=None, target=target, until_t=1e12,
    )  # fmt: skip
    assert result.h[-1] == pytest.approx(0.01 * brentq(lambda z: k1(z) - 1, 0.1, 2), rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
def test_two_particles_rest_there_too(target: str) -> None:
    scene = ParticleScene(
        law=screened(SIZE * besselk(1, h / ell)), parameters={"E": 1.0, "eta": 1.0, "ell": 0.01},
        positions=[[0.0, 0.0], [2.5, 0.0]], radii=[1.0, 1.0], drag=1.0, target=target, until_t=1e12,
        push=[Push([0], force=[1e-6, 0.0]), Push([1], force=[-1e-6, 0.0])],
    )  # fmt: skip
    result = simulate(scene)
    assert result.contact_h[-1] == pytest.approx(0.01 * brentq(lambda z: k1(z) - 1, 0.1, 2), rel=1e-4)
