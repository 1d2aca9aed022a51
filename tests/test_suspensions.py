"""Grains in the fluid: what they exchange, and at which speed a sphere settles."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from sympy import Piecewise, Rational, integrate, lambdify, oo, pi

import softdyn
from softdyn.derive import own_flow
from softdyn.errors import IntegrationError, SceneError
from softdyn.fluid import Bed, Boundary, MeshSection
from softdyn.particles.files import read_particle_scene
from softdyn.results.rerun import differences
from softdyn.scene.stock_scenes import suspension_scenes
from softdyn.suspension import SuspensionResult, SuspensionScene, simulate
from softdyn.suspension.suspension_run import made_ready, simulate_suspension
from softdyn.suspension.undisturbed import drag_law, frictions

#: What balances close to.
CLOSED = 1e-12


def few(d: int, count: int, **more: Any) -> SuspensionScene:
    """Some grains of 0.6 to 1.4 diameters in a box of 8 diameters with walls, 12 in height."""
    random = np.random.default_rng(2)
    sides, cells = ([8.0, 12.0], [8, 12]) if d == 2 else ([6.0, 6.0, 8.0], [4, 4, 6])
    names = ["left", "right", "bottom", "top", "front", "back"][: 2 * d]
    given: dict[str, Any] = {
        "viscosity": 0.5, "density": 1.0, "elements": "P1-P1", "mesh": MeshSection(box=sides, cells=cells),
        "boundary": [Boundary(names, velocity=[0.0] * d)], "gravity": [0.1] + [0.0] * (d - 2) + [-1.0],
        "positions": random.uniform(0.3, 0.7, (count, d)) * sides, "radii": random.uniform(0.3, 0.7, count),
        "grain_density": 2.5, "drag": "schiller_naumann", "width": 1.6, "until_t": 0.4, "dt": 0.1, "times": 3,
    }  # fmt: skip
    return SuspensionScene(**{**given, **more})


def closed(result: SuspensionResult, most: float = CLOSED) -> bool:
    kinds = ("mass", "momentum", "volume", "exchange")
    return all(float(result.arrays[f"{kind}_imbalance"].max()) < most for kind in kinds)


@pytest.mark.parametrize("elements", ["P1-P1", pytest.param("P2-P1", marks=pytest.mark.slow)])
@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_what_the_fluid_loses_the_grains_gain(d: int, elements: str) -> None:
    """Momentum and volume of both phases, step by step; the grains' momentum is the sum of the forces on them."""
    result = simulate(few(d, 6, elements=elements))
    assert closed(result)
    gained = np.diff(result.grain_momentum, axis=0)
    forces = (result.grain_drag + result.grain_pressure + result.grain_weight)[1:] * result.step_dt[1:, None]
    assert gained == pytest.approx(forces, rel=1e-11, abs=1e-13)
    assert result.grain_momentum[-1, -1] < 0
    titles = [axes.get_title(loc="left") for axes in result.plot().axes]
    assert "porosity" in titles


@pytest.mark.parametrize("density", [1e-3, 1e4])
def test_any_ratio_of_densities_and_of_the_step_to_the_time_of_the_grains(density: float) -> None:
    """Light grains, whose own time is 1e-4 of a step, go up against gravity; heavy ones fall freely."""
    result = simulate(few(2, 4, grain_density=density, viscosity=5.0, until_t=1.0, dt=0.25, gravity=[0.0, -1.0]))
    assert closed(result)
    if density > 1:
        assert result.v[-1, :, 1] == pytest.approx(-1.0, rel=0.02)
    else:
        assert (result.v[-1, :, 1] > 0).all()
        assert np.abs(result.v).max() < 1


def lattice_mobility(length: float, side: float) -> float:
    """Flow of a filtered force in a periodic box less that in an unbounded fluid, over force/eta: a sum over waves."""
    waves = 2 * math.pi / side * np.array([k for k in product(range(-40, 41), repeat=3) if any(k)])
    square = np.sum(waves**2, axis=1)
    total = float(np.sum((1 - waves[:, 0] ** 2 / square) / square / (1 + length**2 * square) ** 4)) / side**3
    return total - 5 / (96 * math.pi * length)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("side", "cells", "width"),
    [(80.0, 8, 10.0), (8.0, 8, 1.5), (4.8, 16, 1.0)],
)
def test_the_drag_is_that_at_the_velocity_without_the_grain(side: float, cells: int, width: float) -> None:
    """A sphere of diameter 1 held in a periodic box through which a force drives Stokes flow: Hasimoto's array.

    Elements of 10, 1 and 0.3 diameters. The mean flux is F/(6 pi eta a) and what the images of the sphere do,
    with forces as wide as the filter.
    """
    pairs = (["left", "right"], ["bottom", "top"], ["front", "back"])
    scene = SuspensionScene(
        viscosity=1.0, elements="P1-P1", mesh=MeshSection(box=[side] * 3, cells=[cells] * 3), force=[1.0, 0.0, 0.0],
        boundary=[Boundary(pair, periodic=True) for pair in pairs],
        until_t=1.0, dt=1.0, times=2, positions=[[0.43 * side, 0.57 * side, 0.31 * side]], radii=0.5, held=True,
        drag="stokes", width=width,
    )  # fmt: skip
    result = simulate(scene)
    force = float(result.drag[-1, 0, 0])
    flux = float((made_ready(scene).maps.moments @ result.u[-1]).sum(axis=0)[0]) / side**3
    whole = force + float(result.grain_pressure[-1, 0])
    assert whole == pytest.approx(side**3 - math.pi / 6, rel=1e-10)  # what acts on the fluid
    expected = force / (3 * math.pi) + force * lattice_mobility(width / 2, side)
    assert flux == pytest.approx(expected, rel=0.03)
    assert closed(result)


@pytest.mark.slow
def test_a_sphere_settles_at_the_speed_of_its_closure() -> None:
    """The stock scene: within 3 %, of which the walls of its box have a part, in a run that balances."""
    scene = softdyn.read_scene(suspension_scenes()["settling"])
    assert isinstance(scene, SuspensionScene)
    result = simulate(scene)
    eta, r, weight = 1e-3, 5e-5, 1000.0 * 4 / 3 * math.pi * 5e-5**3 * 9.81
    closure = lambda v: 6 * math.pi * eta * r * (1 + 0.15 * (2 * r * 1000.0 * v / eta) ** 0.687) * v  # noqa: E731
    assert -result.v[-1, 0, 2] == pytest.approx(brentq(lambda v: closure(v) - weight, 1e-6, 1), rel=0.03)
    # the water's weight, of whose pressures the exchange is summed, is 1e5 times the sphere's
    assert closed(result, 1e2 * CLOSED)


def test_a_run_that_is_killed_goes_on_to_the_bit(tmp_path: Path) -> None:
    scene, checkpoint = few(2, 5), tmp_path / "run.checkpoint.npz"
    whole = simulate(scene)

    def stop(t: float, *_: Any) -> None:
        if t > 0.15:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_suspension(scene, stop, checkpoint)
    assert len(softdyn.load_result(tmp_path / "run.frames")) == 2
    resumed = simulate_suspension(scene, None, checkpoint, resume=True)
    assert not differences(whole, resumed)
    saved = whole.save(tmp_path / "run.npz")
    assert not differences(whole, softdyn.load_result(saved))
    assert not differences(whole, softdyn.simulate(softdyn.scene_of(softdyn.load_result(saved))))


def test_no_grain_is_a_fluid_by_itself() -> None:
    result = simulate(few(2, 0, gravity=[0.0, -1.0]))
    assert closed(result)
    assert np.abs(result.u).max() < 1e-12
    assert result.c == pytest.approx(1.0, abs=0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"positions": [[4.0, 13.0]], "radii": 0.5}, r"grain 0 is at \(4, 13\), outside of the mesh"),
        ({"positions": [[4.0, 3.0, 1.0]], "radii": 0.5}, r"positions: the mesh has 2 dimensions.*\(1, 3\)"),
        ({"width": 5.0}, "wider than half the fluid"),
        ({"width": 0.3}, "does not resolve the filter"),
        ({"drag": "einstein"}, r"\[closures\] drag: the closure einstein gives the viscosity"),
        ({"drag": None}, r"\[closures\] drag is missing"),
        ({"dt": None}, r"\[steps\] dt is missing"),
        ({"grain_density": None}, r"\[particles\] density is missing"),
        ({"steady": True, "until_t": None}, r"\[until\] needs t"),
        ({"bed": Bed(0.5)}, r"\[bed\] does not go with \[particles\]"),
        ({"radii": [0.5]}, "radii are 1, and there are 6 grains"),
        ({"velocities": [[0.0, math.nan]] * 6}, "finite numbers, and those of grain 0 are not"),
    ],
)
def test_bad_input_is_refused_by_name(change: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        simulate(few(2, 6, **change))


def test_what_is_for_particles_alone_refuses_a_suspension() -> None:
    with pytest.raises(SceneError, match=r"settling\.toml: it is a scene of grains in a fluid.*softdyn run takes"):
        read_particle_scene(suspension_scenes()["settling"])


def test_what_cannot_go_on_names_the_grain() -> None:
    with pytest.raises(IntegrationError, match=r"grain 0 has left the mesh, at .*t=0.1: give a contact law") as e:
        simulate(few(2, 1, velocities=[[-100.0, 0.0]], until_t=1.0, grain_density=1e4))
    assert e.value.partial is not None
    scene = few(2, 1, radii=3.0, drag="stokes", held=True)
    with pytest.raises(IntegrationError, match=r"too narrow|leave the fluid"):
        simulate(replace(scene, width=1.5))


def test_a_drag_that_does_not_settle_is_told() -> None:
    """A drag that falls tenfold at an Re: there is none that fits itself, and repetitions go to and fro."""
    from softdyn.derive.closure import Closure, Re, eta, r

    falling = Closure(
        "falling", gives="drag", expression=Piecewise((eta * r, Re < Rational(11, 10)), (eta * r / 10, True))
    )
    law = drag_law(falling, {"rho": 0.5, "eta": 1.0}, 3, 1.0, 100.0)
    near = replace(law, own=np.full_like(law.own, 0.2))  # the slip is 1.25 at the higher drag, and 1.02 at the lower
    one = np.ones(1)
    with pytest.raises(IntegrationError, match=r"drag on grain 0, of radius 1, does not settle: .* give a wider"):
        frictions(near, one, 0 * one, 4 / 3 * np.pi * one, one)


def test_the_own_flow_is_that_of_a_sphere_of_the_filters_size() -> None:
    """In Stokes flow, of the radius 16/5 l; integrals over directions against quadrature; a grain alone has S = 1."""
    three = integrate(own_flow.measure(3) * 8 * pi / 3, (own_flow.k, 0, oo))
    assert three == 1 / (6 * pi * 16 / 5)
    for d, beta in product((2, 3), (1e-2, 0.7, 30.0)):
        inner = lambdify(own_flow.n, own_flow.DIRECTIONS[d].subs(own_flow.beta, beta), "math")
        found = float(own_flow.OVER_DIRECTIONS[d].subs(own_flow.beta, beta).evalf(30))
        assert found == pytest.approx(quad(inner, 0, 1, points=[min(0.5, 1 / beta)], epsabs=1e-12)[0], rel=1e-9)
    for d in (2, 3):
        structure = own_flow.structure_factor(d)
        assert structure.subs(own_flow.phi, 0) == 1
        assert 0 < structure.subs(own_flow.phi, 0.6) < 0.05
