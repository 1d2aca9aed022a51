"""What is left of a law as E -> infinity, or as eta -> 0, is its limit; where there is none, it is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from invented_laws import LAWS
from sympy import Abs, Rational, Symbol, exp, oo, pi, sign, simplify, sqrt

import softdyn
from softdyn.derive import FORCE, LENGTH, ContactLaw, E, Limit, R, a, delta, eta, h
from softdyn.derive.law_dynamics import law_quantities
from softdyn.derive.laws.equal_spheres import law as equal_spheres
from softdyn.derive.laws.hertz_dry import law as hertz_dry
from softdyn.derive.laws.lubrication_rigid import law as lubrication_rigid
from softdyn.derive.laws.rognon_gay import law as rognon_gay
from softdyn.derive.limits import check_limits
from softdyn.derive.one_sided import dry, rigid
from softdyn.derive.regimes import discover
from softdyn.errors import LawError, SceneError

UNITS = {"R": 1.0, "E": 1.0, "eta": 1.0}
APPROACH: dict[str, Any] = {"h": 10.0, "force": 1e-2, "until_h": 1e-3, "gaps": 9, "rtol": 1e-11}


def test_the_rigid_limit_keeps_the_friction_at_no_deflection() -> None:
    law = rigid(rognon_gay, name="rigid")
    hbar = R * h / (R + h)
    assert law.F_ela == oo
    assert simplify(law.a - sqrt(2 * R * hbar)) == 0
    assert law.zeta == rognon_gay.zeta
    quantities = law_quantities(law)
    assert "C" not in quantities
    assert simplify(quantities["D"] - quantities["zeta"]) == 0
    assert quantities["dX_dt"] == quantities["dh_dt"]


def test_the_dry_limit_is_hertz() -> None:
    law = dry(rognon_gay, name="dry")
    assert law.zeta == 0
    assert law.a == sqrt(2 * R * Abs(delta))
    assert law.F_ela == rognon_gay.F_ela
    assert eta not in law.a.free_symbols | law.F_ela.free_symbols


@pytest.mark.parametrize("law", [hertz_dry, lubrication_rigid], ids=lambda law: law.name)
def test_the_stock_limits_claim_what_is_proved(law: ContactLaw) -> None:
    found = check_limits(law)
    assert len(found) >= 4
    assert {finding.verdict for finding in found} == {"proved"}


@pytest.mark.slow
def test_stiff_spheres_approach_as_rigid_ones() -> None:
    """At E = 1e10 the deflection, about F/E, changes the friction by as little: far less than the tolerance allows."""
    stiff = softdyn.simulate(law=equal_spheres, parameters={**UNITS, "E": 1e10, "nu": 0.5}, **APPROACH)
    hard = softdyn.simulate(law=lubrication_rigid, parameters={"R": 1.0, "eta": 1.0}, **APPROACH)
    steps = max(stiff.stats["steps"], hard.stats["steps"])
    # delta/h is at most F/(E sqrt(R h) h) = 3e-8, and what it adds to zeta is about as much
    np.testing.assert_allclose(hard.t[1:], stiff.t[1:], rtol=1e-7 + 1e-11 * steps)
    np.testing.assert_array_equal(hard.delta, 0)
    np.testing.assert_array_equal(hard.X, 2 + hard.h)


@pytest.mark.parametrize("target", ["c", pytest.param("numba", marks=pytest.mark.slow)])
def test_a_dry_contact_follows_the_force(target: str) -> None:
    """Hertz's law, by hand: F = (4/3) E/(1 - nu^2) sqrt(R) delta^(3/2)."""
    result = softdyn.simulate(
        law=hertz_dry, parameters={"R": 2.0, "E": 3.0, "nu": 0.3}, h=1.0, force="1e-3*(1.5 + sin(t))", until_t=10.0,
        times=21, quantities=("X", "F", "C", "dX_dt"), target=target,
    )  # fmt: skip
    force = 1e-3 * (1.5 + np.sin(result.t))
    deflection = (3 * force * (1 - 0.3**2) / (4 * 3.0 * np.sqrt(2.0))) ** (2 / 3)
    np.testing.assert_allclose(result.delta, deflection, rtol=1e-13)
    np.testing.assert_array_equal(result.h, 0)
    np.testing.assert_allclose(result.X, 4 - 2 * deflection, rtol=1e-14)
    # dX/dt = -(dF/dt)/C with C = (dF/d(delta))/2
    np.testing.assert_allclose(result.dX_dt, -1e-3 * np.cos(result.t) / (0.75 * force / deflection), rtol=1e-11)


@pytest.mark.slow
def test_regimes_of_the_one_sided_laws_are_those_of_the_whole_one() -> None:
    """Friction at no deflection and elasticity at no gap have the leading forms that the whole law has there."""
    whole = discover(equal_spheres)
    hard, soft = discover(lubrication_rigid), discover(hertz_dry)
    for name in ("Stokes", "Poiseuille"):
        for quantity in ("zeta", "dh_dt"):
            expected = whole.regime(name).forms[quantity].leading
            assert simplify(hard.regime(name).forms[quantity].leading - expected) == 0
    assert "delta" not in hard.regime("Stokes").forms
    for quantity in ("delta", "a", "C"):
        expected = whole.regime("Hertz").forms[quantity].leading
        assert simplify(soft.regime("Hertz").forms[quantity].leading - expected) == 0
    assert hard.conservative
    assert soft.conservative


A, ell = Symbol("A", positive=True), Symbol("ell", positive=True)
HBAR = R * h / (R + h)


def spheres(**changes: Any) -> ContactLaw:
    parts = {
        "a": sqrt(2 * R * (HBAR + Abs(delta))),
        "F_ela": Rational(4, 9) * E * a * delta,
        "zeta": 3 * pi * eta * a**4 / (2 * HBAR**3),
    }
    return ContactLaw(name="spheres", **{**parts, **changes})


@pytest.mark.parametrize(
    ("rule", "changes", "reason"),
    [
        (rigid, {"F_ela": E * a * delta + A * delta / ell, "parameters": {A: FORCE, ell: LENGTH}}, "not proportional"),
        (rigid, {"zeta": eta * R * (1 + R / h), "F_adh": E * R * h * exp(-h / R)}, "F_adh = .* depends on E"),
        (dry, {"F_adh": A * exp(-h / ell), "parameters": {A: FORCE, ell: LENGTH}}, "may hold a gap open"),
        (dry, {"a": sqrt(R**3 / h + R * Abs(delta))}, "no limit as h -> 0"),
        (dry, {"a": R + h + sqrt(R * Abs(delta)) * (3 + sign(delta)) / 2}, "in compression, .* in tension"),
    ],
    ids=["a spring besides E", "a force with E", "a remote force", "a that diverges", "a that differs by side"],
)
def test_a_law_without_the_limit_is_refused(rule: Any, changes: dict[str, Any], reason: str) -> None:
    with pytest.raises(LawError, match=reason):
        rule(spheres(**changes), name="left")


@pytest.mark.parametrize(
    ("parts", "reason"),
    [
        ({"F_ela": oo}, "declares rigid particles.* a = .* must not depend on delta"),
        ({"zeta": 0}, "declares a dry contact.* a = .* must not depend on h"),
        ({"F_ela": oo, "zeta": 0, "a": R}, "leave nothing that moves"),
        ({"F_ela": oo, "a": R, "limits": (Limit("near", (h, R), {"C": E * R}),)}, "has no C"),
        ({"zeta": 0, "a": R, "limits": (Limit("near", (delta, R), {"dh_dt": -h}),)}, "has no dh_dt"),
    ],
    ids=["rigid with delta", "dry with h", "both", "claim of C", "claim of dh_dt"],
)
def test_a_contradictory_declaration_is_refused(parts: dict[str, Any], reason: str) -> None:
    with pytest.raises(LawError, match=reason):
        spheres(**parts)


def test_what_a_one_sided_law_has_not_cannot_be_asked_for() -> None:
    with pytest.raises(LawError, match="'C' is no output of this law"):
        softdyn.simulate(law=lubrication_rigid, parameters={"R": 1.0, "eta": 1.0}, quantities=("C",), **APPROACH)
    with pytest.raises(SceneError, match=r"dry contact, which has no gap: end the run by \[until\] t"):
        softdyn.simulate(law=hertz_dry, parameters={"R": 1.0, "E": 1.0, "nu": 0.5}, **APPROACH)


@pytest.mark.slow
def test_no_other_law_is_one_sided() -> None:
    for law in LAWS.values():
        assert {"C", "D", "zeta"} <= law_quantities(law).keys()
