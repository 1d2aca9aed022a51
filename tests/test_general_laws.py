"""Laws beyond the paper's restriction, F_ela(a, delta, h) and F_adh(a, h, delta), against their equations.

These are written by hand from the forces and the friction alone and left to scipy: no stiffness, no slope, no rate of
the deflection is in them. Where the force is given, delta solves the balance anew at each instant.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from invented_laws import b, ell, hbar, layered, sticky
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from sympy import Abs, Rational, log, oo, pi, sqrt

import softdyn
from softdyn.derive import ContactLaw, E, Limit, R, a, delta, eta, h
from softdyn.derive.films import relaxation_rate
from softdyn.derive.regimes import discover
from softdyn.errors import LawError, SceneError
from softdyn.particles.particle_keys import ParticleScene, Push
from softdyn.particles.particle_run import simulate_particles

Array = NDArray[np.float64]
Forces = Callable[[Any, Any], tuple[Any, Any, Any]]

VALUES = {
    "layered": {"E": 1.0, "eta": 1.0, "thickness": 0.1, "softness": 0.8, "work": 1e-3, "ell": 0.02},
    "sticky": {"E": 1.0, "eta": 1.0, "rim": 0.1, "work": 1e-3, "ell": 0.02},
}
#: Friction far apart.
FAR = {"layered": 6 * np.pi, "sticky": 1.5 * np.pi * 1.01**2}
LAWS = {"layered": layered, "sticky": sticky}


def of_layer(gap: Any, d: Any) -> tuple[Any, Any, Any]:
    """F_ela, zeta and F_adh of ``layered``; R = E = eta = 1."""
    bar = gap / (1 + gap)
    radius = np.sqrt(2 * (bar + np.abs(d)))
    elastic = 4 / 9 * radius * d * (1 + 0.8 * 0.1 / (0.1 + gap))
    remote = -np.pi * 1e-3 * np.exp(-gap / 0.02) * (1 + d**2 / (0.02 + d**2))
    return elastic, 1.5 * np.pi * radius**4 / bar**3, remote


def of_rim(gap: Any, d: Any) -> tuple[Any, Any, Any]:
    """F_ela, zeta and F_adh of ``sticky``; R = E = eta = 1."""
    bar = gap / (1 + gap)
    radius = np.sqrt(bar + 0.01)
    pull = np.sqrt(8 * np.pi * 1e-3 * radius**3) * np.exp(-gap / 0.02)
    return 2 * radius * d + 2 / 3 * d**3 / radius - pull, 1.5 * np.pi * radius**4 / bar**3, 0 * gap


FORCES: dict[str, Forces] = {"layered": of_layer, "sticky": of_rim}


def pair_by_hand(forces: Forces, h0: float, T: float, deflection: Callable[[float, float], float]) -> float:
    """Gap at the time T, with delta as a function of t and h."""

    def rate(t: float, logarithm: Array) -> Array:
        gap = float(np.exp(logarithm[0]))
        elastic, zeta, remote = forces(gap, deflection(t, gap))
        return np.array([-(elastic - remote) / (zeta * gap)])

    end = solve_ivp(rate, (0.0, T), [np.log(h0)], method="LSODA", rtol=1e-10, atol=1e-11)
    assert end.success
    return float(np.exp(end.y[0, -1]))


@pytest.mark.slow
@pytest.mark.parametrize("target", ["c", pytest.param("numba", marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", list(LAWS))
def test_a_pair_under_a_varying_force_is_what_its_balance_says(name: str, target: str) -> None:
    """The force changes sign and passes the one at delta = 0: the gap closes and opens."""
    T, forces = 300.0, FORCES[name]

    def balanced(t: float, gap: float) -> float:
        force = 0.02 * np.cos(0.03 * t)
        return float(brentq(lambda d: forces(gap, d)[0] - force, -0.9, 0.9, xtol=1e-15, rtol=1e-14))

    result = softdyn.simulate(
        law=LAWS[name], parameters={"R": 1.0, **VALUES[name]}, h=0.05, force="0.02*cos(0.03*t)", until_t=T,
        target=target, times=1000, quantities=("X", "dX_dt", "C", "D", "F", "dF_dt", "F_adh"),
    )  # fmt: skip
    gap = pair_by_hand(forces, 0.05, T, balanced)
    assert abs(result.h[-1] / gap - 1) < 1e-7
    assert abs(result.delta[-1] - balanced(T, gap)) < 1e-8
    # eq. 9 of the general law along the run, and X itself from one output to the next; at a kink the rate jumps
    at = result.arrays
    assert np.allclose(-at["dF_dt"] / at["C"] - (at["F"] - at["F_adh"]) / at["D"], at["dX_dt"], rtol=1e-9)
    step = np.diff(result.t)
    by_rate = step * (at["dX_dt"][1:] + at["dX_dt"][:-1]) / 2
    assert np.abs(np.diff(at["X"]) - by_rate).max() < 1e-2 * np.abs(by_rate).max()


@pytest.mark.slow
@pytest.mark.parametrize("control", ["velocity", "spring"])
@pytest.mark.parametrize("name", list(LAWS))
def test_a_pair_whose_centres_are_moved_is_what_its_balance_says(name: str, control: str) -> None:
    """Pressed together and drawn apart, by a machine that is rigid or gives in."""
    T, forces, h0, k = 200.0, FORCES[name], 0.05, 0.7
    base = 2.0 + h0
    moved = lambda t: base - 0.04 * np.sin(0.025 * t)  # noqa: E731

    def deflection(t: float, gap: float) -> float:
        if control == "velocity":
            return (2.0 + gap - moved(t)) / 2
        # the spring is shortened by what the centres are further apart than its base
        return float(brentq(lambda d: forces(gap, d)[0] - k * (2.0 + gap - 2 * d - moved(t)), -0.9, 0.9, xtol=1e-15))

    keywords: dict[str, Any] = (
        {"velocity": "-0.001*cos(0.025*t)", "delta": 0.0}
        if control == "velocity"
        else {"spring": {"stiffness": k, "base": "2.05 - 0.04*sin(0.025*t)"}}
    )
    result = softdyn.simulate(
        law=LAWS[name], parameters={"R": 1.0, **VALUES[name]}, h=h0, until_t=T, target="numba", **keywords
    )
    gap = pair_by_hand(forces, h0, T, deflection)
    assert abs(result.h[-1] / gap - 1) < 1e-6
    assert abs(result.delta[-1] - deflection(T, gap)) < 1e-7


@pytest.mark.slow
@pytest.mark.parametrize("name", list(LAWS))
def test_particles_are_what_their_balance_says(name: str) -> None:
    """Three spheres in a viscous fluid, pushed together and pulled apart; their gaps are states of their own."""
    T, forces = 400.0, FORCES[name]
    x0 = np.array([[0.0, 0.0], [2.05, 0.1], [0.9, 1.9]])
    i, j = np.array([0, 0, 1]), np.array([1, 2, 2])
    pull = 0.01 * (x0 - x0.mean(axis=0))

    def rates(t: float, state: Array) -> Array:
        x, gap = state[:6].reshape(3, 2), np.exp(state[6:])
        along = x[j] - x[i]
        r = np.linalg.norm(along, axis=1)
        elastic, zeta, remote = forces(gap, (2.0 - r + gap) / 2)
        total = -pull * np.cos(0.02 * t)
        np.add.at(total, i, -elastic[:, None] * along / r[:, None])
        np.add.at(total, j, elastic[:, None] * along / r[:, None])
        # what the friction exceeds its limit far apart by: zeta x/(1 + x), x = zeta_0/zeta_oo - 1
        x_ = forces(gap, 0 * gap)[1] / FAR[name] - 1
        return np.concatenate([(total / (6 * np.pi)).reshape(-1), -(elastic - remote) / (zeta * x_ / (1 + x_) * gap)])

    start = np.concatenate([x0.reshape(-1), np.log([0.05, 0.12, 0.15])])
    end = solve_ivp(rates, (0.0, T), start, method="Radau", rtol=1e-9, atol=1e-11)
    scene = ParticleScene(
        law=LAWS[name], parameters=VALUES[name], positions=x0, radii=np.ones(3), drag=1.0, until_t=T, times=2,
        rtol=1e-5, films={"i": i, "j": j, "h": np.array([0.05, 0.12, 0.15])},
        push=[Push([k], [f"{-float(p)!r}*cos(0.02*t)" for p in pull[k]]) for k in range(3)],
    )  # fmt: skip
    result = simulate_particles(scene)
    assert result.stats["warnings"] == []
    assert np.abs(result.x[-1] - end.y[:6, -1].reshape(3, 2)).max() < 1e-4
    assert result.stats["energy_error"] < 1e-4


# ---------------------------------------------------------------- the law's own


def the_fault(law: ContactLaw, **changes: Any) -> str:
    with pytest.raises(LawError) as caught:
        replace(law, typical={}, **changes)
    return str(caught.value)


def test_the_restriction_is_the_default_and_the_message_says_what_lifts_it() -> None:
    for name, symbol in (("F_ela", "h"), ("F_adh", "delta")):
        message = the_fault(layered, general=False)
        assert f"{name}(" in message
        assert f"symbol '{symbol}' is not allowed here" in message
        assert "general=True" in message
    assert "general=True" in the_fault(sticky, general=False, F_ela=2 * E * a * delta - E * a**2)
    # what neither kind of law may use
    assert "through a only" in the_fault(layered, zeta=eta * R * delta / h)
    assert "must be True or False" in the_fault(layered, general=1)


def test_what_has_no_deflection_at_a_force_is_refused_by_name() -> None:
    """C <= 0: F_ela falls with delta somewhere, so that delta does not follow from F and h."""
    falling = the_fault(layered, F_ela=E * a * delta * (1 - 2 * R / (R + h)))
    assert "C must be positive" in falling
    # JKR with a radius that vanishes: the rim's pull wins
    vanishing = the_fault(sticky, a=sqrt(R * (hbar + delta**2 / R)), parameters=sticky.parameters)
    assert "C must be positive" in vanishing
    # a kink that no step would end at
    kinked = the_fault(sticky, a=sqrt(R * (hbar + Abs(delta)) + b**2))
    assert "Abs(delta) has a kink there" in kinked
    assert "must be finite at delta = 0" in the_fault(sticky, F_ela=2 * E * a * delta + E * R**2 * log(Abs(delta) / R))


def test_one_sided_laws_have_nothing_of_the_other_side() -> None:
    rigid = the_fault(layered, F_ela=oo, a=sqrt(2 * R * hbar))
    assert "F_adh" in rigid
    assert "must not depend on delta" in rigid
    dry = the_fault(layered, zeta=0, a=sqrt(R * Abs(delta)), F_adh=0)
    assert "F_ela" in dry
    assert "must not depend on h" in dry


def test_a_range_needs_a_force_at_rest_that_has_faded() -> None:
    scene = ParticleScene(
        law=sticky, parameters=VALUES["sticky"], positions=[[0.0, 0.0], [2.03, 0.0]], radii=[1.0, 1.0], range=0.2,
        drag=1.0, until_t=1.0,
    )  # fmt: skip
    with pytest.raises(SceneError, match=r"of its largest: give a larger \[contacts\] range"):
        simulate_particles(scene)
    assert simulate_particles(replace(scene, range=2.0)).stats["steps"] > 0


@pytest.mark.slow
def test_limits_and_regimes_of_a_layer_know_both_of_its_stiffnesses() -> None:
    """Thick against the gap it stiffens by 1 + softness; thin it is not there. U_h has its sign turned in between."""
    thickness, softness, work = (next(s for s in layered.parameters if s.name == name) for name in
                                 ("thickness", "softness", "work"))  # fmt: skip
    bare = Rational(4, 9) * E * sqrt(2 * R * h) * delta
    law = replace(
        layered,
        limits=(
            Limit("thick", ((delta, h, thickness, R), (h, ell)), {"F": bare * (1 + softness), "F_adh": -pi * work * R}),
            Limit("thin", (delta, thickness, h, R), {"F": bare, "D": 6 * pi * eta * R**2 / h}),
            Limit("wrong", (delta, h, thickness, R), {"F": bare}),
        ),
    )
    assert [finding.verdict for finding in softdyn.check(law)] == ["proved"] * 4 + ["disproved"]
    signs = {bool(regime.forms["U_h"].state.subs(dict.fromkeys(regime.forms["U_h"].state.free_symbols, 1)) > 0)
             for regime in discover(law).regimes if "U_h" in regime.forms and regime.side == "compression"}  # fmt: skip
    assert signs == {True, False}


def test_a_law_with_a_force_at_rest_has_no_diagram_and_says_why() -> None:
    for regime in discover(sticky).regimes:
        assert set(regime.undecided.values()) == {regime.undecided["delta"]}
        assert "F_ela is not 0 at delta = 0" in regime.undecided["delta"]


def test_the_rate_of_a_film_follows_the_deflection() -> None:
    """-(dF_adh/dh)/zeta along delta(h) at constant force, from two balances a little apart."""
    numbers = {symbol: Rational(VALUES["layered"][symbol.name]).limit_denominator(10**6)
               for symbol in layered.parameters} | {R: 1, E: 1, eta: 1}  # fmt: skip
    gap, d = 0.013, -0.004
    force = of_layer(gap, d)[0]

    def carried(x: float) -> float:
        return of_layer(x, brentq(lambda y: of_layer(x, y)[0] - force, -0.5, 0.0, xtol=1e-16))[2]

    state = {h: gap, delta: d, a: layered.a.subs(numbers).subs({h: gap, delta: d})}
    found = float(relaxation_rate(layered).subs(numbers).subs(state))
    along = (carried(gap + 1e-7) - carried(gap - 1e-7)) / 2e-7
    assert found == pytest.approx(-along / of_layer(gap, d)[1], rel=1e-6)
