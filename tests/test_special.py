"""Lambert's W in kernels: exact to 4 units in the last place, in both targets, and known to proofs near its zero."""

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
from sympy import Abs, Expr, LambertW, Rational, Symbol, besselj, besselk, log, sign

import softdyn
from softdyn.derive import LENGTH, ContactLaw, E, Limit, R, a, delta, h
from softdyn.derive.emit import with_special
from softdyn.derive.films import find_films
from softdyn.derive.laws.rognon_gay import law as rognon_gay
from softdyn.derive.limits import check_limits
from softdyn.derive.regimes import discover
from softdyn.derive.special import COEFFICIENTS, branch_series, constants
from softdyn.derive.translate import to_c
from softdyn.errors import LawError
from softdyn.targets import TARGETS

Array = NDArray[np.float64]
Functions = dict[str, Callable[[Array], Array]]
ULPS = 4
#: The smallest number of which there is a value: -1/e rounded towards 0.
LOWEST = -0.3678794411714423
BODY = """@jit
def all_values(n: int, x: array, out: array) -> None:
    for i in range(n):
        out[i] = _lambert_w(x[i])
"""
HEAD = """
from math import exp, inf, log, log1p, nan, sqrt
import numba
from numpy import ndarray as array
jit = numba.njit(error_model="numpy")
"""


@pytest.fixture(scope="module")
def values(tmp_path_factory: pytest.TempPathFactory) -> Functions:
    """W of arrays, for each target."""
    folder = tmp_path_factory.mktemp("special")
    raw = compile_c("#include <math.h>\n#include <stdint.h>\n" + to_c(with_special(BODY)), folder).all_values
    raw.argtypes, raw.restype = [ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p], None
    compiled = import_text(HEAD + with_special(BODY), folder).all_values

    def in_c(x: Array) -> Array:
        out = np.empty_like(x)
        raw(len(x), x.ctypes.data, out.ctypes.data)
        return out

    def in_numba(x: Array) -> Array:
        out = np.empty_like(x)
        compiled(len(x), x, out)
        return out

    return {"c": in_c, "numba": in_numba}


def units_off(x: float, found: float) -> float:
    """Distance of a value from the exact one, in units of the last place of the latter."""
    with mpmath.workdps(60):
        exact = mpmath.re(mpmath.lambertw(mpmath.mpf(x)))
        return float(abs(mpmath.mpf(found) - exact) / mpmath.mpf(math.ulp(float(exact))))


ARGUMENTS = st.one_of(
    st.floats(LOWEST, 1.7e308),
    st.floats(-17, -0.5).map(lambda k: max(LOWEST, LOWEST + 10**k)),
    st.floats(-0.27, -0.17),
    st.floats(0.9, 1.1),
    st.floats(-307, 308).map(lambda k: 10**k),
    st.floats(-307, -1).map(lambda k: -(10**k)),
)


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(drawn=st.lists(ARGUMENTS, min_size=20, max_size=40))
def test_w_is_exact_to_four_units_in_the_last_place(values: Functions, target: str, drawn: list[float]) -> None:
    x = np.array(drawn)
    for argument, value in zip(drawn, values[target](x).tolist(), strict=True):
        assert units_off(argument, value) <= ULPS, (argument, value)


@pytest.mark.parametrize("target", TARGETS)
def test_w_is_exact_where_its_parts_meet(values: Functions, target: str) -> None:
    places = [LOWEST + k * math.ulp(LOWEST) for k in range(40)]
    places += [c + k * math.ulp(c) for c in (-0.25, 1.0, math.e, 5e-324) for k in range(-20, 20)]
    x = np.array([place for place in places if place >= LOWEST])
    assert max(units_off(*pair) for pair in zip(x.tolist(), values[target](x).tolist(), strict=True)) <= ULPS


@pytest.mark.parametrize("target", TARGETS)
def test_special_values_of_w(values: Functions, target: str) -> None:
    x = np.array([0.0, -0.0, math.inf, math.nan, math.nextafter(LOWEST, -1), -1.0, -math.inf])
    found = values[target](x)
    np.testing.assert_array_equal(found, [0.0, 0.0, math.inf, *[math.nan] * 4])
    assert math.copysign(1.0, found[1]) == -1.0


def test_the_polynomial_leaves_less_than_a_hundredth_of_a_rounding() -> None:
    with mpmath.workdps(40):
        for k in range(1, 200):
            p = mpmath.mpf(k) / 200
            found = mpmath.polyval([mpmath.mpf(c) for c in reversed(constants()["branch"])], 2 * p - 1)
            # the coefficients are rounded, the first to 2^-54
            assert abs(found / branch_series(p) - 1) < 2.0**-52
        exact = mpmath.chebyfit(lambda u: branch_series((1 + u) / 2), [-1, 1], COEFFICIENTS, error=True)
        assert exact[1] < 2.0**-60


# ---------------------------------------------------------------- in laws

ell = Symbol("ell", positive=True)


REMOTE = E * R**2 * LambertW(ell / h) / 10**6


def soft(F_adh: Expr = REMOTE, limits: tuple[Limit, ...] = ()) -> ContactLaw:
    """The paper's law with a remote force."""
    own = {"parameters": {ell: LENGTH}, "typical": {ell: R / 100}}
    return replace(rognon_gay, name="soft", F_adh=F_adh, limits=limits, **own)


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
def test_a_law_with_w_runs_and_rests_where_its_force_is_that_of_w(target: str) -> None:
    """The film: W(ell/h) = c, so that h = ell/(c exp(c))."""
    result = softdyn.simulate(
        law=soft(),
        parameters={"R": 1.0, "E": 1.0, "eta": 1.0, "ell": 0.01},
        h=0.5,
        force=1e-6,
        until_h=None,
        target=target,
        until_t=1e12,
    )
    assert result.h[-1] == pytest.approx(0.01 / math.e, rel=1e-6)


@pytest.mark.slow
def test_limits_of_w_are_proved_near_its_zero_and_far_out() -> None:
    near = Limit("near", ((delta, h, R), (ell, h)), {"F_adh": E * R**2 * ell / (10**6 * h)})
    wrong = Limit("wrong", ((delta, h, R), (ell, h)), {"F_adh": 2 * E * R**2 * ell / (10**6 * h)})
    far = Limit("far", ((delta, h, ell, R),), {"F_adh": E * R**2 * log(ell / h) / 10**6})
    half = Limit("half", ((delta, h, ell, R),), {"F_adh": E * R**2 * log(ell / h) / (2 * 10**6)})
    right, twice, grown, too_little = check_limits(soft(limits=(near, wrong, far, half)))
    assert (right.verdict, twice.verdict, twice.ratio) == ("proved", "disproved", Rational(1, 2))
    assert (grown.verdict, too_little.verdict) == ("proved", "disproved")


@pytest.mark.slow
def test_regimes_of_w_are_found_near_its_zero_and_undecided_by_name_elsewhere() -> None:
    found = discover(soft())
    forms = [str(regime.forms["F_adh"].leading) for regime in found.regimes if "F_adh" in regime.forms]
    reasons = [regime.undecided["F_adh"] for regime in found.regimes if "F_adh" in regime.undecided]
    assert forms
    assert reasons
    assert all("LambertW" in reason for reason in reasons)
    assert find_films(found) is not None


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
def test_a_spring_of_w_has_a_stiffness_where_it_is_undeformed(target: str) -> None:
    """W(x)/x, which sympy's derivative holds, has no value at 0: kernels have exp(-W)/(1 + W)."""
    spring = replace(
        rognon_gay, name="spring", F_ela=E * a * ell * sign(delta) * LambertW(Abs(delta) / ell),
        parameters={ell: LENGTH}, typical={ell: R / 100}, limits=(),
    )  # fmt: skip
    result = softdyn.simulate(
        law=spring, parameters={"R": 1.0, "E": 1.0, "eta": 1.0, "ell": 0.01}, h=0.5, force="1e-5*sin(w*t)",
        constants={"w": 1e-3}, until_t=6283.0, target=target,
    )  # fmt: skip
    assert np.isfinite(result.delta).all()
    assert result.delta.min() < 0 < result.delta.max()


def test_other_branches_and_bessel_functions_of_other_orders_are_refused_by_name() -> None:
    branch, half, high = (
        LambertW(-ell / (R + 9 * h + 9 * ell), -1),
        besselk(Rational(1, 2), h / ell),
        besselj(3, h / ell),
    )
    for force in (E * R**2 * branch, E * R**2 * half, E * R**2 * high):
        with pytest.raises(LawError, match="no target can print"):
            soft(force)
