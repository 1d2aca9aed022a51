"""Contacts without a gap state: dry ones and those of rigid particles, as scenes of many."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import quad
from sympy import Symbol, exp, sqrt

from softdyn.derive import FORCE, LENGTH, ContactLaw, E, R, Tangential, a, delta, eta, h
from softdyn.derive.gapless_equations import force_of_contact
from softdyn.derive.laws.lubrication_rigid import law as lubrication_rigid
from softdyn.derive.limits import check_limits
from softdyn.errors import IntegrationError, LawError, SceneError
from softdyn.laws import law_of
from softdyn.particles.contact_kernels import get_contact_kernel
from softdyn.particles.geometry import Wall
from softdyn.particles.mechanisms.gravity import Gravity
from softdyn.particles.observables import wall_forces
from softdyn.particles.particle_keys import Hold, ParticleScene, Push
from softdyn.particles.particle_run import simulate_particles
from softdyn.targets import TARGETS

Array = NDArray[np.float64]
PULL, ELL = Symbol("pull", positive=True), Symbol("ell", positive=True)

#: A dry law with all that there may be: a dashpot that grows with the contact, and a remote force.
everything = ContactLaw(
    name="everything",
    a=sqrt(R * delta),
    F_ela=E * a * delta,
    zeta=0,
    F_adh=-PULL * exp(-h / ELL),
    dashpot=eta * (R + a),
    parameters={PULL: FORCE, ELL: LENGTH},
)
#: One that slides against friction and a tangential spring.
sliding = ContactLaw(
    name="sliding_dry", a=R, F_ela=E * R * delta, zeta=0, tangential=Tangential(sliding=3 * eta * R, k_t=E * R)
)


def contacts(kernel: Any, overlap: Array, rate: Array, pace: float, p: Array) -> tuple[Array, Array, Array]:
    """Gap, force and tangent."""
    n = len(overlap)
    out = np.empty(n), np.empty(n), np.empty(n)
    reach = (0.5,) if kernel.fading else ()
    assert kernel.contacts(n, 1 / pace, pace, *reach, overlap, rate, p, np.empty(0), *out) == 0
    return out


def test_the_derivation_checks_itself() -> None:
    assert [symbol.name for symbol in force_of_contact()] == ["h_r", "F", "F_r"]


@pytest.mark.slow
@settings(deadline=None, max_examples=25)
@given(
    st.floats(-0.45, 0.4).filter(lambda x: abs(x) > 1e-4),
    st.floats(-2, 2),
    st.floats(0.1, 100),
    st.sampled_from(TARGETS),
)
def test_the_tangent_is_the_derivative_of_the_force(overlap: float, rate: float, pace: float, target: str) -> None:
    """By central differences, the rate moving with the distance as it does in a stage: 1e-7 of the size."""
    for law, sign in ((everything, 1.0), (lubrication_rigid, -1.0)):
        if sign * overlap < 0 and law is lubrication_rigid:
            overlap = -overlap
        kernel = get_contact_kernel(law if law is everything else "lubrication_rigid", target, fading=True)
        p, step = np.ones(len(kernel.uniform)), 1e-6 * abs(overlap)
        moved = np.array([-step, 0.0, step])  # of r
        _, F, F_r = contacts(
            kernel, overlap - moved if sign > 0 else -abs(overlap) - moved, rate + pace * moved, pace, p
        )
        assert (F[2] - F[0]) / (2 * step) == pytest.approx(F_r[1], rel=1e-6, abs=1e-6 * abs(F_r[1]) + 1e-6)


@pytest.mark.slow
def test_both_targets_give_one_force() -> None:
    draw = np.random.default_rng(0)
    overlap, rate = draw.uniform(-0.6, 0.4, 300), draw.normal(size=300)
    found = [contacts(get_contact_kernel(everything, t, fading=True), overlap, rate, 3.0, np.ones(5)) for t in TARGETS]
    for other in found[1:]:
        np.testing.assert_allclose(other, found[0], rtol=1e-14, atol=1e-14)


def test_surfaces_that_do_not_touch_have_no_force_but_the_remote_one() -> None:
    """F = -pull exp(-h/ell) with a gap; E a delta less the pull in touch, whatever the rate of the others."""
    kernel = get_contact_kernel(everything, fading=True)
    gap, F, _ = contacts(kernel, np.array([-0.1, 0.08]), np.array([5.0, 0.0]), 1.0, np.ones(5))
    np.testing.assert_allclose(gap, [0.1, 0.0], rtol=1e-15)
    np.testing.assert_allclose(F, [-math.exp(-0.1), 0.04**1.5 - 1], rtol=1e-14)


PAIR: dict[str, Any] = {"positions": [[0, 0], [2.1, 0]], "radii": 1.0}
PRESSED = {**PAIR, "push": [Push([0], [1e-3, 0.0]), Push([1], [-1e-3, 0.0])]}


def test_two_spheres_come_to_rest_at_the_deflection_of_hertz() -> None:
    """Pushed against their drag: F = (4/3) E/(1 - nu^2) sqrt(R) delta^(3/2), and every energy is told."""
    scene = ParticleScene("hertz_dry", {"E": 1.0, "nu": 0.5, "eta": 0.01}, **PRESSED, drag=1.0, until_t=1e3)
    result = simulate_particles(scene)
    at_rest = (3 * 1e-3 * 0.75 / 4) ** (2 / 3)
    assert result.contact_delta[-1] == pytest.approx(at_rest, rel=1e-6)
    stored = 2 * 2 / 5 * 1e-3 * at_rest
    assert result.energy["stored"] == pytest.approx(stored, rel=1e-6)
    assert abs(result.energy["imbalance"]) < 3e-4
    assert not result.stats["warnings"]


@pytest.mark.slow
def test_rigid_spheres_approach_as_brenner_has_it() -> None:
    """With their drags: t(h) is the integral of zeta/F, whose sum drag and contact are."""
    scene = ParticleScene(
        "lubrication_rigid", {"eta": 0.01}, **PRESSED, drag=1.0, until_t=300.0, times=[100.0, 300.0], rtol=1e-5
    )
    result = simulate_particles(scene)
    friction = 3 * math.pi * 0.01
    brenner = lambda x: friction * (1 + 1 / (2 * x) + 0.45 * math.log1p(20 / (9 * x)))  # noqa: E731
    for t, gap in zip(result.t, result.contact_h, strict=True):
        taken = quad(lambda u: brenner(math.exp(u)) * math.exp(u), math.log(gap), math.log(0.1), epsrel=1e-12)[0] / 1e-3
        assert taken == pytest.approx(t, rel=1e-4)  # errors of rtol in ln h in some hundred steps
    assert abs(result.energy["imbalance"]) < 1e-5
    assert result.energy["stored"] == 0.0


@pytest.mark.slow
def test_stiff_spheres_move_as_rigid_ones() -> None:
    """equal_spheres at E = 1e5: what is left is of the order of the deflection, F/E, and of errors of many steps."""
    given = {**PAIR, "push": [Push([0], [1e-3, 5e-4])], "drag": 1.0, "until_t": 60.0, "rtol": 1e-5, "times": 2}
    hard = simulate_particles(ParticleScene("lubrication_rigid", {"eta": 0.01}, **given))
    stiff = simulate_particles(ParticleScene("equal_spheres", {"eta": 0.01, "E": 1e5, "nu": 0.5}, **given))
    np.testing.assert_allclose(hard.x[-1], stiff.x[-1], atol=1e-5)


def test_a_dry_column_without_drag_stands_in_elastic_equilibrium() -> None:
    """Floor, three spheres, and the weights above each: Hertz's deflections at once."""
    R_, E_ = 1.0, 100.0
    scene = ParticleScene(
        "hertz_dry", {"E": E_, "nu": 0.5}, positions=[[0, 0.99], [0, 2.97], [0, 4.95]], radii=R_, until_t=1.0, times=2,
        wall=[Wall([0, 0], [0, -1], rigid=True)], hold=[Hold("all", "x")], gravity=Gravity([0.0, -1.0], 1e-2),
    )  # fmt: skip
    result = simulate_particles(scene)
    weight = 1e-2 * 4 / 3 * math.pi
    np.testing.assert_allclose(wall_forces(result)[-1, 0, 1], -3 * weight, rtol=1e-9)
    modulus = E_ / 0.75
    expected = [(3 * k * weight / (4 * modulus)) ** (2 / 3) for k in (2, 1)]
    pairs = result.contact_delta[-3:][result.contact_j[-3:] < 3]
    np.testing.assert_allclose(pairs, expected, rtol=1e-6)


@pytest.mark.slow
def test_what_slides_dry_is_lost_and_stored() -> None:
    """A sphere dragged along another: energy is told, of friction and a tangential spring in series."""
    scene = ParticleScene(
        sliding, {"E": 1.0, "eta": 0.02}, positions=[[0, 0], [1.9, 0]], radii=1.0, tangential=True, drag=1.0,
        hold=[Hold([0], "xy", spin=[0.0]), Hold([1], "xy", ["0", "1e-2"])], until_t=30.0, rtol=1e-5,
    )  # fmt: skip
    result = simulate_particles(scene)
    assert result.energy["sliding"] > 0
    assert abs(result.energy["imbalance"]) < 1e-4
    assert not result.stats["warnings"]


@pytest.mark.parametrize(
    ("law", "more", "words"),
    [
        ("lubrication_rigid", {"parameters": {"eta": 1.0}}, "films of rigid particles alone do not say how"),
        ("lubrication_rigid", {"parameters": {"eta": 1.0}, "gap": 0.1}, r"\[contacts\] gap: that of rigid particles"),
        (
            "lubrication_rigid",
            {"parameters": {"eta": 1.0}, "drag": 1.0, "positions": [[0, 0], [1.9, 0]]},
            "particles 0 and 1: rigid particles cannot be pressed into one another",
        ),
        ("hertz_dry", {"gap": 0.1}, r"\[contacts\] gap: the surfaces of a dry contact touch"),
        (everything, {"parameters": {"E": 1.0, "eta": 1.0, "pull": 1.0, "ell": 1.0}, "range": 1.0}, "dashpots of the"),
    ],
)
def test_what_does_not_go_together_is_refused(law: Any, more: dict[str, Any], words: str) -> None:
    given = {"parameters": {"E": 1.0, "nu": 0.5}, **PAIR, "until_t": 1.0, **more}
    with pytest.raises(SceneError, match=words):
        simulate_particles(ParticleScene(law, **given))


def test_a_floppy_packing_without_drag_is_refused_by_name() -> None:
    scene = ParticleScene(
        "hertz_dry", {"E": 1.0, "nu": 0.5}, positions=[[0, 0], [1.9, 0], [9, 0]], radii=1.0, until_t=1.0
    )
    with pytest.raises(IntegrationError, match=r"nothing resists the motion of particle 2, without any contact"):
        simulate_particles(scene)


def test_a_film_has_no_dashpot_and_a_pair_of_dry_ones_with_one_is_a_scene() -> None:
    with pytest.raises(LawError, match=r"dashpot = .* is for dry contacts"):
        ContactLaw(name="both", a=R, F_ela=E * R * delta, zeta=eta * R, dashpot=eta * R)
    with pytest.raises(LawError, match="dashpot: eta has the dimension viscosity"):
        ContactLaw(name="wrong", a=R, F_ela=E * R * delta, zeta=0, dashpot=eta)
    with pytest.raises(LawError, match="dashpot must be positive"):
        ContactLaw(name="gains", a=R, F_ela=E * R * delta, zeta=0, dashpot=-eta * R)


@pytest.mark.parametrize("law", ["linear_spring", "hertz", "dmt"])
def test_every_claim_of_the_dry_laws_is_proved(law: str) -> None:
    found = check_limits(law_of(law))
    assert len(found) >= 3
    assert {finding.verdict for finding in found} == {"proved"}


def test_the_pull_off_force_of_dmt_is_that_of_its_reduced_radius() -> None:
    """-2 pi w R1 R2/(R1 + R2): the least force of the law, where surfaces just touch, and none is left far away."""
    w, R1, R2 = 1e-3, 1.0, 3.0
    reduced = R1 * R2 / (R1 + R2)
    kernel = get_contact_kernel("dmt", fading=True)
    named = {"R": 2 * reduced, "E": 1.0, "nu": 0.5, "w": w, "z0": 1e-3}
    overlap = np.concatenate([-np.logspace(-8, 0, 60)[::-1], [0.0], np.logspace(-8, -1, 60)])
    p = np.array([named[name] for name in kernel.uniform])
    _, F, _ = contacts(kernel, overlap, np.zeros(len(overlap)), 1.0, p)
    assert F.min() == pytest.approx(-2 * math.pi * w * reduced, rel=1e-5)
    assert overlap[np.argmin(F)] == pytest.approx(0.0, abs=1e-7)
    assert F[0] == 0.0


@pytest.mark.slow
def test_two_spheres_with_adhesion_stick_until_they_are_pulled_off() -> None:
    """At 0.9 of the pull-off force they stay within a thousandth of the radius; at 1.1 of it they are far apart."""
    w, force = 1e-3, 2 * math.pi * 1e-3 * 0.5
    for part, sticks in ((0.9, True), (1.1, False)):
        scene = ParticleScene(
            "dmt", {"E": 1.0, "nu": 0.5, "w": w, "z0": 0.01, "eta": 0.01}, positions=[[0.0], [2.0]], radii=1.0,
            drag=1.0, push=[Push([0], [-part * force]), Push([1], [part * force])], range=0.5, until_t=1e3, times=2,
        )  # fmt: skip
        result = simulate_particles(scene)
        gap = float(result.x[-1, 1, 0] - result.x[-1, 0, 0]) - 2.0
        assert (gap < 0.0) if sticks else (gap > 1.0)
        assert abs(result.energy["imbalance"]) < 2e-3


def test_a_dry_law_that_pulls_where_surfaces_just_touch_is_refused() -> None:
    """As JKR's: its contacts break elsewhere than they are made, which these would not."""
    k, pull = Symbol("k", positive=True), Symbol("pull", positive=True)
    with pytest.raises(LawError, match="F_ela must vanish at delta = 0, where it is -pull"):
        ContactLaw(
            name="pulling", a=sqrt(R * delta), F_ela=k * delta - pull, zeta=0, general=True,
            parameters={k: FORCE / LENGTH, pull: FORCE}, typical={k: E * R, pull: E * R**2 / 1000},
        )  # fmt: skip
