"""Coulomb friction: the return map, slopes, oblique impacts, rolling and twisting, against rigid bodies."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from softdyn.derive.coulomb import most as bound
from softdyn.derive.coulomb import return_map, size, tangent
from softdyn.particles import Friction, Gravity, Hold, Inertia, ParticleScene, Wall, simulate

R, RHO, G = 0.5, 2.0, 9.81
STIFF: dict[str, Any] = {"law": "hertz_dry", "parameters": {"E": 1e7, "nu": 0.3}, "radii": R, "times": 2}


def test_the_return_map_is_coulombs_law() -> None:
    """No more than mu N, along the trial force; the force is a function of it with the derivatives told."""
    keep = return_map()
    assert keep.subs({size: 2.0, bound: 3.0}) == 1
    assert keep.subs({size: 4.0, bound: 3.0}) * 4.0 == 3.0
    assert keep.subs({size: 4.0, bound: 0.0}) == 0
    assert keep.subs({size: 0.0, bound: 0.0}) == 1
    assert set(tangent()) == {"along", "across", "by_N"}


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["sphere", "disc"])
@pytest.mark.parametrize("mu", [0.1, 1.0])
def test_on_a_slope_grains_roll_or_slide(shape: str, mu: float) -> None:
    """Stiff ones as rigid ones, within 2e-3: at first, the tangential force swings about what holds them.

    They roll at g sin/(1 + I/(m R^2)) if mu is at least tan/(1 + m R^2/I), else slide at g (sin - mu cos).
    """
    angle, gyration = math.radians(30), 0.4 if shape == "sphere" else 0.5
    pull = [G * math.sin(angle), -G * math.cos(angle)]
    depth = 1.0 if shape == "disc" else None
    mass = RHO * (math.pi * R**2 if depth else 4 / 3 * math.pi * R**3)
    star = 1e9 / (1 - 0.3**2)  # of a rigid wall, F = 4/3 E* sqrt(R) x^(3/2)
    sunk = (3 * mass * G * math.cos(angle) / (4 * star * math.sqrt(R))) ** (2 / 3)
    scene = ParticleScene(
        **{**STIFF, "parameters": {"E": 1e9, "nu": 0.3}}, positions=[[0.0, R - sunk]], rtol=1e-2,
        inertia=Inertia(RHO, shape), friction=Friction(mu), until_t=0.5,
        wall=[Wall([0, 0], [0, -1])], gravity=Gravity(pull), depth=depth,
    )  # fmt: skip
    result = simulate(scene)
    if mu >= math.tan(angle) / (1 + 1 / gyration):
        expected, spin = G * math.sin(angle) / (1 + gyration), -result.v[-1, 0, 0] / R
    else:
        expected, spin = G * (math.sin(angle) - mu * math.cos(angle)), -mu * G * math.cos(angle) / (gyration * R) * 0.5
    np.testing.assert_allclose(result.v[-1, 0, 0], 0.5 * expected, rtol=2e-3)
    np.testing.assert_allclose(result.spin[-1, 0, 0], spin, rtol=2e-3)
    assert abs(result.energy["imbalance"]) < 1e-3


@pytest.mark.parametrize(
    ("d", "method"),
    [(2, "explicit"), (3, "explicit"), (2, "implicit"), pytest.param(3, "implicit", marks=pytest.mark.slow)],
)
def test_an_oblique_impact_slides_as_rigid_bodies_do(d: int, method: str) -> None:
    """While it slides throughout, the tangential impulse is mu times the normal one, and turns the sphere.

    Its lever is the distance from the wall, shorter by the overlap x, whose mean by force is B(7/5, 1/2)/2 of the
    largest (Hertz, m (dx/dt)^2/2 = m v^2/2 (1 - (x/x_max)^(5/2))). An implicit step may be wrong by rtol, an explicit
    one makes a period wrong by it.
    """
    mu, v_n, v_t, rtol = 0.2, 0.5, 3.0, 1e-6 if method == "explicit" else 1e-5
    x, v = [0.0] * d, [0.0] * d
    x[-1], v[0], v[-1] = R + 1e-3, v_t, -v_n
    normal = [0.0] * (d - 1) + [-1.0]
    scene = ParticleScene(
        **STIFF, positions=[x], velocities=[v], inertia=Inertia(RHO), friction=Friction(mu), until_t=0.02,
        wall=[Wall([0.0] * d, normal)], rtol=rtol, method=method,
    )  # fmt: skip
    result = simulate(scene)
    allowed = rtol * (10 if method == "explicit" else result.stats["steps"])
    assert not result.contacts(-1)["F"].any()
    np.testing.assert_allclose(result.v[-1, 0, -1], v_n, rtol=allowed)
    # friction takes a seventh of this velocity
    np.testing.assert_allclose(result.v[-1, 0, 0], v_t - 2 * mu * v_n, rtol=1e-6 if method == "explicit" else allowed)
    star, mass = 1e7 / (1 - 0.3**2), RHO * 4 / 3 * math.pi * R**3
    deepest = (15 * mass * v_n**2 / (16 * star * math.sqrt(R))) ** 0.4
    beta = math.gamma(1.4) * math.gamma(0.5) / math.gamma(1.9)
    spin = 2.5 * 2 * mu * v_n / R * (1 - deepest / R * beta / 2)
    np.testing.assert_allclose(result.spin[-1, 0, 1] if d == 3 else -result.spin[-1, 0, 0], spin, rtol=allowed)
    lost = result.energy["friction"] + result.energy["k_t"]
    assert lost == pytest.approx(-result.energy["kinetic"], rel=allowed)
    # T is mu N on the way back as on the way in: k_t takes nothing. Explicit steps tell the two apart to first order,
    # a part omega dt = (24 rtol)^(1/2) of what the springs hold, mu^2 of the energy of the impact and some
    first = math.sqrt(24 * rtol) * mu**2 * mass * v_n**2 if method == "explicit" else 0.0
    assert abs(result.energy["k_t"]) < first + allowed * lost


@pytest.mark.slow
def test_the_tangential_spring_turns_with_the_pair() -> None:
    """A grain is turned on another, which loads the spring; then both turn as one body, and it turns with them."""
    half, turn = 0.499, 2.0
    at = f"(t - 0.1)*{turn}"
    later = "step(t - 0.1)"
    moves = [f"{later}*{half}*{turn}*sin({at})", f"-{later}*{half}*{turn}*cos({at})", 0.0]
    scene = ParticleScene(
        **{**STIFF, "times": [0.1, 0.1 + math.pi / 4]}, positions=[[-half, 0.0, 0.0], [half, 0.0, 0.0]],
        inertia=Inertia(RHO), friction=Friction(10.0), until_t=0.1 + math.pi / 4, rtol=1e-3,
        hold=[
            Hold([0], "xyz", moves, [0.0, f"0.01 - 0.01*{later}", f"{turn}*{later}"]),
            Hold([1], "xyz", [f"-({moves[0]})", f"-({moves[1]})", 0.0], [0.0, 0.0, f"{turn}*{later}"]),
        ],
    )  # fmt: skip
    before, after = (simulate(scene).contacts(frame)["T"][0] for frame in range(2))
    assert np.linalg.norm(before) > 1.0
    np.testing.assert_allclose(after, before, atol=1e-4 * np.abs(before).max())  # along z, about which it turns


def test_rolling_resistance_stops_what_rolls() -> None:
    """Of the moment rolling N 2R of a wall: a = -2 rolling g/(1 + 2/5)."""
    rolling, v = 0.02, 1.0
    scene = ParticleScene(
        **STIFF, positions=[[0.0, R - 2e-4]], velocities=[[v, 0.0]], spins=[[-v / R]], inertia=Inertia(RHO),
        friction=Friction(1.0, rolling=rolling), wall=[Wall([0, 0], [0, -1])], gravity=Gravity([0, -G]), until_t=0.5,
        rtol=1e-3,
    )  # fmt: skip
    result = simulate(scene)
    np.testing.assert_allclose(result.v[-1, 0, 0], v - 2 * rolling * G / 1.4 * 0.5, rtol=0.01)


def test_twisting_resistance_stops_what_spins() -> None:
    """About the normal of a wall: d omega/dt = -twisting N 2R/(2/5 m R^2)."""
    twisting, omega = 0.01, 3.0
    scene = ParticleScene(
        **STIFF, positions=[[0.0, 0.0, R - 2e-4]], spins=[[0.0, 0.0, omega]], inertia=Inertia(RHO), until_t=0.5,
        friction=Friction(0.5, twisting=twisting), wall=[Wall([0, 0, 0], [0, 0, -1])], gravity=Gravity([0, 0, -G]),
        rtol=1e-3,
    )  # fmt: skip
    result = simulate(scene)
    np.testing.assert_allclose(result.spin[-1, 0, 2], omega - 5 * twisting * G / R * 0.5, rtol=0.01)
