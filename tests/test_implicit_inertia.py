"""Inertia in implicit steps: collisions against their exact solutions, what is conserved, and the order in time."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from sympy import Symbol, diff, simplify

from softdyn.derive import a, delta
from softdyn.derive.laws.hertz import law as hertz
from softdyn.particles import Packing
from softdyn.particles.force_balance import Newton
from softdyn.particles.mechanisms.coulomb import Friction
from softdyn.particles.mechanisms.inertia import Inertia
from softdyn.particles.particle_keys import ParticleScene, Push
from softdyn.particles.particle_run import prepare, simulate_particles
from softdyn.particles.results import ParticleResult
from softdyn.particles.start import start
from softdyn.particles.step import take_step

Array = NDArray[np.float64]
#: Density of spheres of radius 1 and mass 1.
ONE = 1 / (4 / 3 * math.pi)
IMPLICIT: dict[str, Any] = {"method": "implicit", "inertia": Inertia(ONE)}


def kinetic(result: ParticleResult, mass: Array, k: int) -> float:
    return float(np.sum(mass[:, None] * result.v[k] ** 2) / 2)


@pytest.mark.slow
@pytest.mark.parametrize("z", [0.03, 0.3])
def test_a_linear_dashpot_gives_the_known_restitution(z: float) -> None:
    """Of the relative velocity along the normal exp(-pi z/sqrt(1 - z^2)) is left; of all others all."""
    k, reduced = 50.0, 1 * 8 / 9
    c = 2 * z * math.sqrt(k * reduced)
    scene = ParticleScene(
        "linear_spring", {"k": k, "c": c}, positions=[[0, 0], [3.001, 0]], radii=[1.0, 2.0], until_t=0.7, times=2,
        velocities=[[1.0, 0.2], [-0.5, 0.2]], rtol=1e-6, **IMPLICIT,
    )  # fmt: skip
    result = simulate_particles(scene)
    v, mass = result.v[-1], np.array([1.0, 8.0])
    left = math.exp(-math.pi * z / math.sqrt(1 - z**2))
    assert (v[1, 0] - v[0, 0]) / 1.5 == pytest.approx(left, abs=1e-4)
    np.testing.assert_allclose(mass @ v, mass @ result.v[0], rtol=1e-14)
    assert abs(result.energy["imbalance"]) < 1e-4
    lost = kinetic(result, mass, 0) - kinetic(result, mass, -1)
    assert result.energy["dashpots"] == pytest.approx(lost, rel=1e-3)


@pytest.mark.slow
def test_a_hertzian_collision_lasts_as_long_as_hertz_has_it() -> None:
    """2.87 (m^2/(R E*^2 v))^(1/5), its exact constant by quadrature; twice over, by two speeds, within 1e-4."""
    # 2 times the integral of (1 - u^(5/2))^(-1/2) from 0 to 1, times (15/16)^(2/5)
    constant = 4 / 5 * math.sqrt(math.pi) * math.gamma(0.4) / math.gamma(0.9) * (15 / 16) ** 0.4
    reduced, modulus = 0.5, 100.0 / (2 * (1 - 0.25**2))
    for v in (0.1, 1.0):
        expected = constant * (reduced**2 / (0.5 * modulus**2 * v)) ** 0.2
        scene = ParticleScene(
            "hertz_dry", {"E": 100.0, "nu": 0.25}, positions=[[0.0], [2.0]], radii=1.0, until_t=1.5 * expected, times=2,
            velocities=[[v / 2], [-v / 2]], rtol=1e-6, **IMPLICIT,
        )  # fmt: skip
        result = simulate_particles(scene)
        # free again, the centres are where a collision of that duration has left them
        apart = float(result.x[-1, 1, 0] - result.x[-1, 0, 0]) - 2.0
        assert 1.5 * expected - apart / v == pytest.approx(expected, rel=1e-4)
        assert result.v[-1, 1, 0] == pytest.approx(v / 2, rel=1e-5)


def test_the_dashpot_of_hertz_is_the_rate_of_his_force() -> None:
    """It is tau dF/d(overlap): stresses are those of the strain at a time that is ahead by tau."""
    x = Symbol("x", positive=True)
    (tau,) = (symbol for symbol in hertz.parameters if symbol.name == "tau")
    dashpot, elastic = (expr.subs(a, hertz.a).subs(delta, x / 2) for expr in (hertz.dashpot, hertz.F_ela))
    assert simplify(dashpot / (tau * diff(elastic, x)) - 1) == 0


def test_steps_are_of_order_three() -> None:
    """Of two spheres that stay in touch, a nonlinear oscillator with a dashpot, against SciPy to 1e-11."""
    parameters = {"E": 50.0, "nu": 0.3, "tau": 0.01}
    scene = ParticleScene(
        "hertz", parameters, positions=[[0.0], [1.9]], radii=1.0, until_t=0.4,
        push=[Push([0], [1.0]), Push([1], [-1.0])], **IMPLICIT,
    )  # fmt: skip
    modulus = 50.0 / (1 - 0.3**2)

    def rates(_: float, y: Array) -> Array:
        d = (2 - y[0]) / 2
        force = 4 / 3 * modulus * d**1.5 - 0.01 * modulus * math.sqrt(d) * y[1]
        return np.array([y[1], 2 * (force - 1.0)])

    exact = solve_ivp(rates, (0, 0.4), [1.9, 0.0], rtol=1e-12, atol=1e-13).y[:, -1]
    system = prepare(replace(scene, rtol=1e-9))
    wrong = []
    for steps in (20, 40, 80):
        state = start(system, Newton())
        x, v, kept, newton = state.x, state.v, state.kept, Newton()
        for k in range(steps):
            t, dt = 0.4 * k / steps, 0.4 / steps
            step = take_step(system, state.contacts, newton, t, x, v, state.y_rate, dt, kept=kept)
            x, v, kept = step.end.x, step.v, step.kept
        found = np.array([x[1, 0] - x[0, 0], kept["velocity"][1, 0] - kept["velocity"][0, 0]])
        wrong.append(np.abs(found - exact).max())
    orders = np.log2(np.array(wrong[:-1]) / wrong[1:])
    assert orders.min() > 2.7
    assert orders.max() < 3.5


@pytest.mark.slow
def test_three_grains_keep_momentum_to_rounding_and_the_rest_to_the_tolerance() -> None:
    """An oblique collision of three in space: angular momentum and energy are no sums of forces that cancel."""
    draw = np.random.default_rng(1)
    scene = ParticleScene(
        "hertz_dry", {"E": 100.0, "nu": 0.3}, positions=[[0, 0, 0], [2.1, 0.5, 0.2], [-1.0, 2.0, 0.4]],
        radii=[1.0, 1.0, 1.2], velocities=draw.normal(size=(3, 3)), until_t=2.0, rtol=1e-6, **IMPLICIT,
    )  # fmt: skip
    result = simulate_particles(scene)
    mass = np.array([1, 1, 1.2**3])
    momentum = np.einsum("i,kia->ka", mass, result.v)
    turning = np.einsum("i,kia->ka", mass, np.cross(result.x, result.v))
    np.testing.assert_allclose(momentum[-1], momentum[0], rtol=0, atol=1e-13)
    np.testing.assert_allclose(turning[-1], turning[0], rtol=0, atol=2e-5)
    assert kinetic(result, mass, -1) + result.energy["stored"] == pytest.approx(kinetic(result, mass, 0), rel=2e-5)
    assert not result.stats["warnings"]


@pytest.mark.slow
def test_films_stop_spheres_that_come_fast() -> None:
    """A sphere with inertia in a fluid, far from others: exp(-6 pi eta R t/m), and where its energy goes."""
    scene = ParticleScene(
        "equal_spheres", {"E": 1.0, "eta": 0.05, "nu": 0.5}, positions=[[0.0], [50.0]], radii=1.0, drag=1.0, range=1.0,
        velocities=[[1.0], [0.0]], inertia=Inertia(ONE), until_t=2.0, times=2, rtol=1e-6,
    )  # fmt: skip
    result = simulate_particles(scene)
    rate = 6 * math.pi * 0.05
    assert result.v[-1, 0, 0] == pytest.approx(math.exp(-2 * rate), rel=1e-5)
    assert result.x[-1, 0, 0] == pytest.approx((1 - math.exp(-2 * rate)) / rate, rel=1e-5)
    assert result.energy["drag"] == pytest.approx((1 - math.exp(-4 * rate)) / 2, rel=1e-4)


@pytest.mark.slow
def test_a_spin_is_a_motion_with_a_moment_of_inertia() -> None:
    """A torque T turns a sphere at T t/(2/5 m R^2), a disc at T t/(1/2 m R^2), with m of its shape."""
    for shape, moment in (("sphere", 0.4), ("disc", 0.5 * math.pi * 2 * ONE)):
        scene = ParticleScene(
            "equal_spheres", {"E": 1.0, "eta": 0.05, "nu": 0.5}, positions=[[0, 0], [9, 0]], radii=1.0, range=1.0,
            tangential=True, push=[Push([0], torque=[0.1])], inertia=Inertia(ONE, shape), until_t=3.0, times=2,
            box=[20.0, 20.0],
        )  # fmt: skip
        result = simulate_particles(scene)
        assert result.spin[-1, 0, 0] == pytest.approx(0.1 * 3 / moment, rel=1e-9)


@pytest.mark.slow
def test_a_solitary_wave_runs_as_nesterenko_has_it() -> None:
    """Down a chain of spheres that just touch, (16/25)^(1/5) v^(1/5) spacings a unit of time, v its largest velocity.

    With spacing, mass and (mass/(K spacing^(1/2)))^(1/2) for units, F = K overlap^(3/2); within 1 % (Nesterenko 2001,
    sec. 1.3: the long-wave limit; that of the discrete chain, by SciPy to 1e-11, is 0.78 % slower).
    """
    n, modulus = 30, 100.0 / (1 - 0.3**2)
    v = np.zeros((n, 1))
    v[0] = 0.5
    times = np.concatenate([np.linspace(5.5, 7.5, 41), np.linspace(12.0, 14.0, 41)])
    scene = ParticleScene(
        "hertz_dry", {"E": 100.0, "nu": 0.3}, positions=[[2.0 * k] for k in range(n)], radii=1.0, velocities=v,
        until_t=14.0, times=times, rtol=1e-5, **{**IMPLICIT, "inertia": Inertia(1.0)},
    )  # fmt: skip
    result = simulate_particles(scene)
    passes, fastest = [], []
    for c, window in ((12, slice(0, 41)), (24, slice(41, 82))):
        at, speed = result.t[window], result.v[window, c, 0]
        k = int(np.argmax(speed))
        bend = np.polyfit(at[k - 2 : k + 3] - at[k], speed[k - 2 : k + 3], 2)
        passes.append(at[k] - bend[1] / (2 * bend[0]))
        fastest.append(np.polyval(bend, passes[-1] - at[k]))
    unit = math.sqrt(4 / 3 * math.pi / (4 / 3 * modulus / 2**1.5 * math.sqrt(2)))
    found = 12 / (passes[1] - passes[0]) * unit
    nesterenko = (16 / 25 * np.mean(fastest) * unit / 2) ** 0.2
    assert found / nesterenko == pytest.approx(1.0, abs=0.01)
    assert found / nesterenko == pytest.approx(0.9922, abs=0.001)


@pytest.mark.slow
def test_a_sheared_packing_has_the_stress_and_the_balance_that_explicit_steps_give_it() -> None:
    """One definition in both methods, of forces and of fluctuating velocities: equal within rtol for each step."""
    scene = ParticleScene(
        "hertz", {"E": 1e4, "nu": 0.3, "tau": 2e-3}, inertia=Inertia(1.0), friction=Friction(0.5), shear_rate=2.0,
        packing=Packing("random", count=12, dimension=2, fraction=0.9, radii=1.0, seed=3), until_t=0.05, times=3,
        velocities=np.random.default_rng(4).normal(size=(12, 2)), rtol=1e-5, method="implicit",
    )  # fmt: skip
    implicit, explicit = simulate_particles(scene), simulate_particles(replace(scene, method="explicit"))
    allowed = scene.rtol * implicit.stats["steps"]
    assert allowed < 2e-3
    largest = np.abs(explicit.stress).max()
    np.testing.assert_allclose(implicit.stress, explicit.stress, rtol=0, atol=allowed * largest)
    # what fluctuates makes more of it than that
    own = explicit.v[0] - explicit.x[0] @ explicit.gradient[0].T
    volume = math.prod(explicit.arrays["box"]) * float(explicit.arrays["depth"])
    assert 4 / 3 * math.pi * float((own[:, 0] ** 2).sum()) / volume > 10 * allowed * largest
    whole = sum(abs(amount) for amount in explicit.energy.values())
    for kind, amount in explicit.energy.items():
        assert implicit.energy[kind] == pytest.approx(amount, rel=0, abs=allowed * whole), kind
