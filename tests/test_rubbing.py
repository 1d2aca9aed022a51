"""Coulomb friction in implicit steps: dry contacts, and films that break at a roughness."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq
from sympy import Integer, Max

from softdyn.derive import E, R, Rubbing, a, delta, eta, h, slip_rate
from softdyn.derive.checks import rubbing_signs_of
from softdyn.derive.laws.equal_spheres import law as equal_spheres
from softdyn.derive.laws.rough_spheres import P0, h_r, load, slope
from softdyn.derive.laws.rough_spheres import law as rough_spheres
from softdyn.derive.limits import check_limits
from softdyn.errors import LawError, SceneError
from softdyn.particles import Packing, ParticleScene, Push, Wall, linear
from softdyn.particles.force_balance import Balance, Newton, StageInput
from softdyn.particles.geometry import directions, lattice
from softdyn.particles.mechanisms.coulomb import Friction
from softdyn.particles.mechanisms.gravity import Gravity
from softdyn.particles.mechanisms.inertia import Inertia
from softdyn.particles.particle_run import prepare, simulate_particles
from softdyn.particles.results import ParticleResult
from softdyn.particles.start import start
from softdyn.study.findings_text import signs_text

ROUGH = {"E": 1e4, "eta": 1.0, "nu": 0.5, "P0": 1e3, "h_r": 0.01}
#: Drag of a sphere of radius 1 in this fluid, and its torque.
DRAG, TORQUE = 6 * math.pi, 8 * math.pi


def pressed(force: float, mu: float, law: Any = rough_spheres, **changes: Any) -> ParticleScene:
    """A sphere in a fluid, pressed on a wall by 2 until its film breaks, and pushed along it."""
    given: dict[str, Any] = {
        "positions": [[0.0, 1.009]],
        "radii": 1.0,
        "range": 0.2,
        "drag": 1.0,
        "wall": [Wall([0.0, 0.0], [0.0, -1.0])],
        "push": [Push([0], [force, -2.0])],
        "friction": Friction(mu),
        "until_t": 40.0,
        "times": [0.0, 30.0, 40.0],
        "rtol": 1e-4,
    }
    return ParticleScene(law, ROUGH, **{**given, **changes})


@pytest.mark.slow
@pytest.mark.parametrize(("force", "mu"), [pytest.param(1.0, 0.0, marks=pytest.mark.slow), (1.04, 0.3), (1.06, 0.3)])
def test_a_sphere_rolls_as_far_as_friction_holds_it_and_slides_beyond(force: float, mu: float) -> None:
    """Exact: T = F/(1 + 3/4 l^2), l the lever, where it rolls; mu N beyond, F = 1.05 at mu = 0.3."""
    result = simulate_particles(pressed(force, mu))
    lever = 1 + (float(result.x[-1, 0, 1]) - 1) / 2
    T = min(force / (1 + DRAG / TORQUE * lever**2), 2.0 * mu)
    assert result.v[-1, 0, 0] == pytest.approx((force - T) / DRAG, rel=1e-6)
    assert result.arrays["spin"][-1, 0, 0] == pytest.approx(-T * lever / TORQUE, rel=1e-5, abs=1e-9)
    np.testing.assert_allclose(result.contacts(-1)["T"][0], [T, 0.0], rtol=1e-5, atol=1e-7)
    assert abs(result.energy["imbalance"]) < 1e-4
    assert not result.stats["warnings"]


@pytest.mark.slow
def test_friction_may_fall_with_the_speed_of_sliding_and_the_gap() -> None:
    """A law's own mu(h, slip_rate), against the solution by bisection."""
    assert rough_spheres.rubbing is not None
    # P0 R/eta is a speed, 2000 here: of a sphere and a wall R is twice the radius
    falling = (1 - h**2 / (4 * h_r**2)) / (1 + 40000 * slip_rate * eta / (P0 * R))
    weaker = replace(rough_spheres, name="weaker", limits=(), rubbing=replace(rough_spheres.rubbing, mu=falling))
    result = simulate_particles(pressed(1.5, 0.3, weaker))
    gap, lever = float(result.contacts(-1)["h"][0]), 1 + (float(result.x[-1, 0, 1]) - 1) / 2
    low, high = 0.0, 0.6
    for _ in range(60):
        T = (low + high) / 2
        speed = (1.5 - T) / DRAG - T * lever**2 / TORQUE
        bound = 0.6 * (1 - gap**2 / (4 * ROUGH["h_r"] ** 2)) / (1 + 20 * speed)
        low, high = (T, high) if bound > T else (low, T)
    assert result.v[-1, 0, 0] == pytest.approx((1.5 - low) / DRAG, rel=1e-6)


def ball(mu: float, method: str, d: int = 2, **changes: Any) -> ParticleScene:
    """A dry sphere at rest on a slope of 30 degrees, in a frame in which that lies along x."""
    stiffness, nu, tilt = 1e4, 0.3, math.radians(30)
    weight = 4 / 3 * math.pi * math.cos(tilt)
    # Hertz's, with R = 2 and a wall that gives in by nothing
    sunk = (3 * weight * (1 - nu**2) / (8 * stiffness * math.sqrt(2))) ** (2 / 3)
    more = [0.0] * (d - 2)
    given: dict[str, Any] = {
        "positions": [[0.0, 1 - 2 * sunk, *more]],
        "radii": 1.0,
        "wall": [Wall([0.0] * d, [0.0, -1.0, *more])],
        "gravity": Gravity([math.sin(tilt), -math.cos(tilt), *more], 1.0),
        "inertia": Inertia(1.0),
        "friction": Friction(mu),
        "until_t": 1.5,
        "times": [0.0, 0.5, 1.5],
        "method": method,
        "rtol": 1e-4,
    }
    return ParticleScene("hertz", {"E": stiffness, "nu": nu, "tau": 2e-3}, **{**given, **changes})


@pytest.mark.parametrize(("mu", "d"), [pytest.param(0.1, 2, marks=pytest.mark.slow), (0.1, 3)])
def test_a_ball_slides_down_a_slope_as_it_must(mu: float, d: int) -> None:
    """A = g (sin - mu cos), and 5/2 mu g cos of the spin: exact of a rigid ball once its spring has been stretched."""
    result = simulate_particles(ball(mu, "implicit", d))
    a = result.v[2, 0, 0] - result.v[1, 0, 0]
    spin = result.arrays["spin"][2, 0, -1] - result.arrays["spin"][1, 0, -1]
    assert a == pytest.approx(0.5 - mu * math.sqrt(0.75), rel=1e-6)
    # the lever is the distance from the wall
    lever = float(result.x[2, 0, 1])
    assert spin == pytest.approx(-2.5 * mu * math.sqrt(0.75) * lever, rel=1e-6)
    assert result.energy["friction"] > 0
    assert abs(result.energy["imbalance"]) < 1e-6


def swung(times: list[float], rolling: float) -> np.ndarray:
    """Exact solution of the ball on the slope that does not slide: its velocity and its spin at some times.

    It stands in equilibrium with the wall, so that load, stiffnesses and lever stay; the springs of friction and of
    rolling follow what slips and rolls, dT/dt = k_t (v - l w), dM/dt = k_t R w until M is rolling N.
    """
    stiffness, nu, mass, tilt, R = 2e4, 0.3, 4 / 3 * math.pi, math.radians(30), 2.0
    N, inertia = mass * math.cos(tilt), 0.4 * mass
    sunk = (3 * N * (1 - nu**2) / (4 * stiffness * math.sqrt(R))) ** (2 / 3)
    k, lever = 2 * stiffness * math.sqrt(R * sunk) / ((1 + nu) * (2 - nu)), 1 - 2 * sunk

    def after(y: np.ndarray, t: float, joined: bool) -> np.ndarray:
        rates = np.zeros((5, 5))  # of v, w, T, M, 1
        rates[0, [2, 4]] = -1 / mass, math.sin(tilt)
        rates[1, [2, 3]] = lever / inertia, -R / inertia
        rates[2, [0, 1]] = k, -k * lever
        rates[3, 1] = k * R * joined
        return np.asarray(expm(rates * t) @ y)

    rest = np.array([0.0, 0.0, 0.0, 0.0, 1.0])
    grid = np.linspace(0.0, max(times), 101)
    beyond = [t for t in grid if after(rest, t, True)[3] > rolling * N]
    first = brentq(lambda t: after(rest, t, True)[3] - rolling * N, 0.0, beyond[0]) if beyond else max(times)
    rolls = after(rest, first, True)
    return np.array([after(rest, t, True) if t <= first else after(rolls, t - first, False) for t in times])[:, :2]


@pytest.mark.parametrize("rolling", [0.0, 0.1, 0.8])
@pytest.mark.parametrize(
    ("method", "d", "rtol"),
    [("explicit", 2, 1e-7), ("explicit", 3, 1e-7), pytest.param("implicit", 3, 1e-6, marks=pytest.mark.slow)],
)
def test_a_ball_rolls_down_a_slope_as_its_resistance_lets_it(method: str, d: int, rtol: float, rolling: float) -> None:
    """By 5/7 g sin without resistance, less with it; where 2 rolling R exceeds tan l it stays, and swings there.

    Of explicit steps rtol is the error of a frequency, 1e-6 at most of what some three swings come to; of an implicit
    one the error of a step, of the largest velocity or of R over the time of the run, 2.
    """
    times = [0.25, 0.5]
    scene = ball(3.0, method, d, friction=Friction(3.0, rolling=rolling), rtol=rtol, until_t=0.5, times=[0.0, *times])
    result, exact = simulate_particles(scene), swung(times, rolling)
    found = np.stack([result.v[1:, 0, 0], -result.arrays["spin"][1:, 0, -1]], axis=1)
    allowed = 1e-6 * np.abs(exact).max() if method == "explicit" else rtol * result.stats["steps"] * 2.0
    np.testing.assert_allclose(found, exact, rtol=0, atol=allowed)
    means = {0.0: 5 / 7 * 0.5, 0.1: 5 / 7 * (0.5 - 2 * 0.1 * math.sqrt(0.75)), 0.8: 0.0}
    # about which the springs swing
    assert exact[1, 0] / 0.5 == pytest.approx(means[rolling], abs=0.06)


@pytest.mark.slow
@pytest.mark.parametrize("about", [1.0, -0.7])
def test_a_ball_that_spins_on_the_floor_is_held_by_its_resistance(about: float) -> None:
    """Twisting takes 2 R N twisting of moment, and the spin falls by that over the moment of inertia; both methods."""
    sunk = (3 * 4 / 3 * math.pi * (1 - 0.3**2) / (8e4 * math.sqrt(2))) ** (2 / 3)
    changes: dict[str, Any] = {
        "gravity": Gravity([0.0, -1.0, 0.0], 1.0),
        "positions": [[0.0, 1.0 - 2 * sunk, 0.0]],
        "spins": [[0.0, about, 0.0]],
        "friction": Friction(0.5, rolling=0.05, twisting=0.02),
        "times": [0.0, 0.1, 0.4],
        "until_t": 0.4,
    }
    explicit, implicit = (
        simulate_particles(ball(0.5, method, 3, rtol=rtol, **changes))
        for method, rtol in (("explicit", 1e-6), ("implicit", 1e-5))
    )
    spin = explicit.arrays["spin"][:, 0, 1]
    assert (spin[1] - spin[2]) * math.copysign(1.0, about) == pytest.approx(2 * 0.02 / 0.4 * 0.3, rel=1e-6)
    allowed = 1e-5 * implicit.stats["steps"]
    np.testing.assert_allclose(implicit.arrays["spin"][:, 0, 1], spin, rtol=0, atol=allowed)
    for kind in ("friction", "k_t"):
        assert implicit.energy[kind] == pytest.approx(explicit.energy[kind], rel=0, abs=allowed)


def thrown(method: str, **changes: Any) -> ParticleScene:
    """A spinning sphere thrown obliquely at a wall, in three dimensions."""
    flying: dict[str, Any] = {
        "positions": [[0.0, 1.001, 0.0]],
        "gravity": None,
        "velocities": [[0.1, -0.1, 0.05]],
        "spins": [[0.1, 0.02, 0.2]],
        "until_t": 0.2,
        "times": [0.0, 0.2],
    }
    return ball(0.2, method, 3, **{**flying, **changes})


@pytest.mark.slow
def test_an_oblique_collision_is_that_of_explicit_steps() -> None:
    """Surfaces stick and slide within it; both methods have one velocity, one spin, one balance towards its end.

    Each implicit step may be wrong by rtol of the largest speed; explicit ones are better than that.
    """
    implicit, explicit = (simulate_particles(thrown(method, rtol=1e-6)) for method in ("implicit", "explicit"))
    allowed = 1e-6 * implicit.stats["steps"]
    np.testing.assert_allclose(implicit.v[-1], explicit.v[-1], rtol=0, atol=allowed * 0.15)
    np.testing.assert_allclose(implicit.arrays["spin"][-1], explicit.arrays["spin"][-1], rtol=0, atol=allowed * 0.23)
    whole = sum(abs(amount) for amount in explicit.energy.values())
    for kind in ("friction", "k_t", "dashpots", "kinetic", "stored"):
        assert implicit.energy[kind] == pytest.approx(explicit.energy[kind], rel=0, abs=allowed * whole)


@pytest.mark.slow
def test_surfaces_that_come_to_touch_and_stick_are_no_matter_of_the_step() -> None:
    """At first all forces are small, and T is of the size of N however short the step; two grains, nearly head on."""
    scene = ParticleScene(
        "hertz_dry", {"E": 1e4, "nu": 0.3}, positions=[[0.0, 0.0], [2.5, 0.3]], radii=1.0,
        velocities=[[3.0, 0.0], [0.0, 0.0]], inertia=Inertia(1.0), friction=Friction(0.3), until_t=0.5, times=2,
        method="implicit",
    )  # fmt: skip
    implicit, explicit = simulate_particles(scene), simulate_particles(replace(scene, method="explicit", rtol=1e-6))
    np.testing.assert_allclose(implicit.v[-1], explicit.v[-1], rtol=0, atol=1e-4 * implicit.stats["steps"] * 3.0)
    assert implicit.stats["steps"] < 300


def sheared(**changes: Any) -> ParticleScene:
    """A few rough spheres in a shear flow, which touch, rub and slide on films."""
    given: dict[str, Any] = {
        "packing": Packing("random", count=12, dimension=2, fraction=0.7, radii=1.0, seed=3),
        "gap": 0.009,
        "range": 0.3,
        "tangential": True,
        "drag": 1.0,
        "shear_rate": 1.0,
        "friction": Friction(0.5),
        "until_t": 0.1,
        "times": 3,
        "rtol": 1e-3,
    }
    return ParticleScene(rough_spheres, {**ROUGH, "E": 1e6}, **{**given, **changes})


@pytest.mark.slow
def test_energy_of_a_sheared_suspension_that_rubs() -> None:
    result = simulate_particles(sheared())
    assert result.energy["friction"] > 0
    assert abs(result.energy["imbalance"]) < 1e-3
    assert not result.stats["warnings"]


@pytest.mark.slow
def test_a_run_goes_on_to_the_bit(tmp_path: Any) -> None:
    """The springs of surfaces that touch, of rolling too, are in a checkpoint, apart from the forces of films."""

    def stop(t: float, _steps: int, _iterations: int) -> None:
        if t > 0.01:
            raise KeyboardInterrupt

    path, scene = tmp_path / "run.checkpoint.npz", sheared(until_t=0.03, friction=Friction(0.5, rolling=0.1))
    with pytest.raises(KeyboardInterrupt):
        simulate_particles(scene, stop, path)
    again: ParticleResult = simulate_particles(scene, None, path, resume=True)
    whole = simulate_particles(scene, None, tmp_path / "other.checkpoint.npz")
    for name in ("x", "v", "spin", "contact_T", "contact_h", "step_t"):
        np.testing.assert_array_equal(again.arrays[name], whole.arrays[name])
    assert again.energy == whole.energy


@pytest.mark.parametrize(
    ("d", "friction"),
    [
        (2, Friction(0.5)),
        (3, Friction(0.5)),
        (2, Friction(0.5, rolling=0.02)),
        (3, Friction(0.5, rolling=0.02, twisting=0.01)),
    ],
)
def test_the_tangent_is_that_of_the_forces(d: int, friction: Friction) -> None:
    """Of surfaces that stick, and of some that slide, roll or twist: central differences by all coordinates."""
    packing = Packing("random", count=24, dimension=d, fraction={2: 0.7, 3: 0.45}[d], radii=1.0, seed=3)
    system = prepare(sheared(packing=packing, friction=friction))

    state = start(system, Newton())
    contacts, (films,) = state.contacts, system.having["solve"]
    rng = np.random.default_rng(2)
    n, _ = directions(contacts, state.x, lattice(system.box, 0.0), system.walls)
    T = rng.standard_normal(n.shape)
    T = 0.2 * (T - np.sum(n * T, axis=1)[:, None] * n)
    M = rng.standard_normal((len(n), system.rubbed - d))
    if d == 3 and friction.rolling:
        M[:, :3] -= np.sum(n * M[:, :3], axis=1)[:, None] * n
    contacts.rubbed = np.concatenate([T, 4e-3 * M], axis=1)
    (rubbing,) = [one for one in system.mechanisms if type(one).__name__ == "Springs"]
    notes, own = rubbing.begin(system, contacts, 0.0, state.x)
    start_x = np.zeros(system.fixed.shape)
    start_x[:, :d] = state.x
    given = StageInput(0.0, 0.01, start_x, np.zeros(len(contacts)), own, notes)
    # a state that has slid, but not turned: the tangent is exact there
    here = start_x.copy()
    here[:, d:] += 1e-4 * rng.standard_normal(here[:, d:].shape)

    def at(x: np.ndarray) -> tuple[Balance, Any]:
        y = np.zeros(len(contacts))
        n, r, h, F, F_r, values = films.solve(system, contacts, x[:, :d], lattice(system.box, 0.0), given, y)
        found = Balance(x, y, h, F, F_r, n, r, np.zeros_like(x), 0.0, 0.0, values)
        action = rubbing.act(system, contacts, given, found)
        assert action is not None
        return replace(found, notes=dict(action.notes)), action

    middle, action = at(here)
    for bound, _ in action.notes["friction"].cut:
        keep = bound["keep"][middle.values["load"] > 0]
        assert (keep < 1).any()
        assert (keep == 1).any()
    quarters = rubbing.contact_tangents(system, contacts, given, middle)
    assert quarters is not None
    pattern = linear.pattern_of(len(state.x), contacts.i, contacts.j)
    matrix = linear.assemble_quarters(pattern, quarters, np.zeros(here.shape), system.fixed).toarray()
    step, numeric = 1e-8, np.empty_like(matrix)
    for column in range(matrix.shape[1]):
        change = np.zeros(matrix.shape[1])
        change[column] = step
        change = change.reshape(here.shape)
        numeric[:, column] = ((at(here + change)[1].reaction - at(here - change)[1].reaction) / (2 * step)).reshape(-1)
    assert np.abs(numeric - matrix).max() < 1e-5 * np.abs(matrix).max()


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"law": equal_spheres}, LawError, "says nothing of surfaces that touch: give it rubbing="),
        ({"drag": 0.0}, SceneError, r"\[friction\] where nothing but contacts resists"),
    ],
)
def test_what_is_not_known_is_refused_by_name(changes: dict[str, Any], error: type[Exception], words: str) -> None:
    scene = pressed(1.0, 0.3, **changes)
    with pytest.raises(error, match=words):
        prepare(scene)


@pytest.mark.slow
def test_surfaces_that_just_touch_rub_against_nothing() -> None:
    """Their load is that of a gap below the roughness by its rounding."""
    scene = ParticleScene(
        rough_spheres, {"E": 1e4, "eta": 1.0, "nu": 0.5, "P0": 1e3, "h_r": 0.01}, positions=[[0, 0, 0], [2.01, 0, 0]],
        radii=1.0, range=0.5, drag=1.0, friction=Friction(0.3), until_t=0.1, times=2,
    )  # fmt: skip
    result = simulate_particles(scene)
    np.testing.assert_allclose(result.x[-1], result.x[0], rtol=0, atol=1e-12)


def test_a_load_is_a_force() -> None:
    with pytest.raises(LawError, match="rubbing load"):
        replace(equal_spheres, name="wrong", rubbing=Rubbing(load=h, k_t=1))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"load": load - E * R**2 / 1000}, r"rubbing load must not be negative .*, but at h=.* it is -0.000997"),
        ({"load": load + E * delta * R}, r"rubbing load .*delta=-.*\(delta < 0\) it is -"),
        ({"k_t": -slope}, "rubbing k_t must not be negative"),
        ({"mu": 1 - 2 * h / h_r}, "rubbing mu load must not be negative"),
        ({"mu": 1 - slip_rate * eta / (P0 * R)}, "rubbing mu load must not be negative .*slip_rate=1.0"),
    ],
)
def test_what_would_drive_surfaces_is_refused_with_a_witness(changes: dict[str, Any], words: str) -> None:
    """A negative load, stiffness or bound of friction somewhere; not where there is no load."""
    assert rough_spheres.rubbing is not None
    with pytest.raises(LawError, match=words):
        replace(rough_spheres, name="wrong", limits=(), rubbing=replace(rough_spheres.rubbing, **changes))


@pytest.mark.parametrize(
    "changes",
    [{}, {"load": Max(0, h_r - h) * E * R}, {"k_t": E * a}, {"mu": (1 - h**2 / (4 * h_r**2)) / (1 + slip_rate)}],
)
def test_signs_of_what_rubs_are_proved(changes: dict[str, Any]) -> None:
    """A load may be 0 where surfaces do not touch, and mu may be anything there."""
    assert rough_spheres.rubbing is not None
    mu = changes.get("mu", Integer(1)).subs(slip_rate, slip_rate * eta / (P0 * R))
    rubbing = replace(rough_spheres.rubbing, **{**changes, "mu": mu})
    law = replace(rough_spheres, name="other", limits=(), rubbing=rubbing)
    found = rubbing_signs_of(law)
    assert {sign.found.verdict for sign in found} == {"positive"}
    assert "rubbing load, rubbing k_t" in signs_text(law)


@pytest.mark.slow
def test_every_claim_of_rough_spheres_is_proved() -> None:
    found = check_limits(rough_spheres)
    assert len(found) == 8
    assert {(f.limit, f.quantity): f.reason for f in found if f.verdict != "proved"} == {}


@pytest.mark.slow
def test_surfaces_that_attract_rub_without_any_load() -> None:
    """Of a sphere on a wall, pushed along it alone: |T| = mu 2 pi w R1 where it slides, less than 4/7 of the push."""
    w, mu, push = 0.05, 0.4, 0.5
    scene = ParticleScene(
        "dmt", {"E": 1e4, "nu": 0.3, "w": w, "z0": 1e-3, "eta": 1.0}, positions=[[0.0, 0.999]], radii=1.0, drag=1.0,
        wall=[Wall([0.0, 0.0], [0.0, -1.0])], push=[Push([0], [push, 0.0])],
        friction=Friction(mu), until_t=40.0, times=[0.0, 30.0, 40.0], rtol=1e-5,
    )  # fmt: skip
    result = simulate_particles(scene)
    T = mu * 2 * math.pi * w
    assert result.v[-1, 0, 0] == pytest.approx((push - T) / DRAG, rel=1e-5)
    np.testing.assert_allclose(result.contacts(-1)["T"][0], [T, 0.0], rtol=1e-5, atol=1e-7)
