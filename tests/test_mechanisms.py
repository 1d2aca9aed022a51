"""Rooms of the mechanisms: gravity with buoyancy; a mechanism from outside; what a scene imports."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from softdyn.errors import IntegrationError, SceneError
from softdyn.particles.energy import Rates
from softdyn.particles.files import particle_scene_from
from softdyn.particles.force_balance import Balance, Newton, StageInput
from softdyn.particles.geometry import Contacts, Wall
from softdyn.particles.integrate import integrate
from softdyn.particles.mechanisms import ROOMS, Action, Mechanism
from softdyn.particles.mechanisms.gravity import Gravity
from softdyn.particles.observables import wall_forces
from softdyn.particles.particle_keys import Hold, ParticleScene, Push
from softdyn.particles.particle_run import prepare, simulate_particles
from softdyn.particles.results import load_particles
from softdyn.particles.start import start
from softdyn.particles.state import State
from softdyn.particles.system import System, background, with_mechanisms

Array = NDArray[np.float64]
ETA = 0.5
PHYSICS: dict[str, Any] = {"law": "rognon_gay", "parameters": {"E": 1.0, "eta": ETA}, "until_t": 10.0, "times": 3}


def weight(density: float, radius: float, g: float) -> float:
    return density * 4 / 3 * math.pi * radius**3 * g


# Gravity


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("drag", [1.0, 0.5])
def test_a_sphere_settles_at_the_speed_of_stokes(d: int, drag: float) -> None:
    """(density - fluid_density) 2 R^2 g/(9 eta), and its potential energy is what the drag takes."""
    g = [0.0] * (d - 1) + [-1e-2]
    scene = ParticleScene(**PHYSICS, positions=[[0.0] * d], radii=2.0, drag=drag, gravity=Gravity(g, 2.5, 1.0))
    result = simulate_particles(scene)
    speed = 1.5 * 2 * 2.0**2 * 1e-2 / (9 * ETA) / drag
    np.testing.assert_allclose(result.v[-1, 0, -1], -speed, rtol=1e-9)
    np.testing.assert_allclose(result.x[-1, 0, -1], -10 * speed, rtol=1e-9)
    given = weight(1.5, 2.0, 1e-2) * 10 * speed
    assert result.energy["gravity"] == pytest.approx(given, rel=1e-9)
    assert result.energy["drag"] == pytest.approx(given, rel=1e-9)
    assert abs(result.energy["imbalance"]) < 1e-9
    np.testing.assert_allclose(result.energy_gravity, [0.0, given / 2, given], rtol=1e-9, atol=1e-12)


def test_gravity_is_what_a_push_with_each_weight_is() -> None:
    """Of unequal spheres that touch: to rounding, but for the name of the energy."""
    given = {**PHYSICS, "positions": [[0, 0], [2.6, 0.1]], "radii": [1.0, 1.5], "gap": 0.02, "drag": 1.0}
    heavy = simulate_particles(ParticleScene(**given, gravity=Gravity([0.0, -1e-3], 2.0)))
    pushes = [Push([k], [0.0, -weight(2.0, R, 1e-3)]) for k, R in enumerate((1.0, 1.5))]
    pushed = simulate_particles(ParticleScene(**given, push=pushes))
    np.testing.assert_allclose(heavy.x, pushed.x, rtol=1e-14)
    assert heavy.energy["gravity"] == pytest.approx(pushed.energy["external"], rel=1e-12)
    assert heavy.energy["external"] == pushed.energy.get("gravity", 0.0) == 0.0


def test_of_two_species_one_sinks_and_one_floats() -> None:
    """In one fluid, far apart, each at its own speed."""
    scene = ParticleScene(
        **PHYSICS, positions=[[0, 0, 0], [50, 0, 0]], radii=1.0, species=["lead", "cork"], range=1.0, drag=1.0,
        gravity=Gravity([0.0, 0.0, -1e-3], {"lead": 11.0, "cork": 0.25}, 1.0),
    )  # fmt: skip
    v = simulate_particles(scene).v[-1, :, 2]
    np.testing.assert_allclose(v, -2e-3 / (9 * ETA) * np.array([10.0, -0.75]), rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("tangential", [False, True])
def test_a_floor_bears_the_weight(tangential: bool) -> None:
    """Of a column without drag, and the balance of energy closes over its settling."""
    law = {"law": "equal_spheres", "parameters": {"E": 1.0, "eta": ETA, "nu": 0.5}, "until_t": 100.0, "times": 3}
    scene = ParticleScene(
        **law, positions=[[0, 1.005], [0, 3.015]], radii=1.0, gap=0.02, range=0.6, tangential=tangential,
        wall=[Wall([0, 0], [0, -1])], hold=[Hold("all", "x")], gravity=Gravity([0.0, -1e-3], 1.0),
    )  # fmt: skip
    result = simulate_particles(scene)
    np.testing.assert_allclose(wall_forces(result)[:, 0, 1], -2 * weight(1.0, 1.0, 1e-3), rtol=1e-6)
    assert result.energy["gravity"] > 0
    assert abs(result.energy["imbalance"]) < 1e-3


def test_without_drag_or_anything_to_stand_on_gravity_is_refused() -> None:
    scene = ParticleScene(**PHYSICS, positions=[[0, 0], [2, 0]], radii=1.0, gap=0.02, gravity=Gravity([0, -1e-3], 1.0))
    with pytest.raises(IntegrationError, match=r"external forces along y sum to .* without drag nothing balances them"):
        simulate_particles(scene)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (([0, 0, -1.0], 1.0), "acceleration needs 2 components"),
        (([0, math.nan], 1.0), "acceleration needs 2 components, finite"),
        ((-9.81, 1.0), "acceleration needs 2 components"),
        (([0, -1.0], None), "density must be 0 or a positive number, not None"),
        (([0, -1.0], -1.0), "density must be 0 or a positive number, not -1"),
        (([0, -1.0], True), "density must be 0 or a positive number, not True"),
        (([0, -1.0], 1.0, -2), "fluid_density must be 0 or a positive number, not -2"),
        (([0, -1.0], {"a": 1.0}), "no value for species 'b'"),
        (([0, -1.0], {"a": 1.0, "b": 1.0, "c": 2.0}), "there is no species 'c'"),
        (([0, -1e99], 1e300), "weight of particles 0, 1 is beyond the largest number"),
    ],
)
def test_what_is_no_gravity_is_refused(given: tuple[Any, ...], words: str) -> None:
    gravity = Gravity(*given)
    scene = ParticleScene(
        **PHYSICS, positions=[[0, 0], [3, 0]], radii=1.0, species=["a", "b"], drag=1.0, gravity=gravity
    )
    with pytest.raises(SceneError, match=words):
        simulate_particles(scene)
    with pytest.raises(SceneError, match="must be a Gravity"):
        simulate_particles(replace(scene, gravity=[0, -1.0]))


def test_gravity_is_read_from_a_file_and_saved(tmp_path: Path) -> None:
    data = {
        "law": "rognon_gay", "parameters": {"E": 1.0, "eta": ETA}, "particles": {"positions": [[0.0]], "radii": 1.0},
        "flow": {"drag": 1.0}, "gravity": {"acceleration": [1e-3], "density": 2.0, "fluid_density": 0.5},
        "until": {"t": 1.0},
    }  # fmt: skip
    result = simulate_particles(particle_scene_from(data, Path()))
    again = load_particles(result.save(tmp_path / "settled.npz"))
    assert again.energy["gravity"] == result.energy["gravity"] > 0
    np.testing.assert_array_equal(again.energy_gravity, result.energy_gravity)
    again.plot()


# A mechanism from outside


@dataclass(frozen=True)
class SlipDrag(Mechanism):
    """Resistance z (1 + k |v|) v, with v relative to the flow: a closure whose coefficient depends on the slip."""

    z: float
    k: float

    takes = ("slip",)

    def resistance(self, shape: tuple[int, int]) -> Array:
        return np.full(shape, self.z)

    def act(self, system: System, contacts: Contacts, given: StageInput, at: Balance) -> Action | None:
        if given.s <= 0:
            return None
        v = (at.x - given.x_star) / given.s - background(system, at.x)
        force = self.z * (1 + self.k * np.linalg.norm(v, axis=1, keepdims=True)) * v
        return Action(force, float(np.abs(force).max()), self.z / given.s)

    def tangent(self, system: System, contacts: Contacts, given: StageInput, at: Balance) -> Array | None:
        if given.s <= 0:
            return None
        v = (at.x - given.x_star) / given.s - background(system, at.x)
        speed = np.linalg.norm(v, axis=1)[:, None, None]
        along = np.divide(v[:, :, None] * v[:, None, :], speed, out=np.zeros((*v.shape, v.shape[1])), where=speed > 0)
        return self.z * ((1 + self.k * speed) * np.eye(v.shape[1]) + self.k * along) / given.s

    def powers(self, system: System, contacts: Contacts, at: Balance, rates: Rates) -> dict[str, float]:
        v = rates.v - background(system, at.x)
        force = self.z * (1 + self.k * np.linalg.norm(v, axis=1, keepdims=True)) * v
        return {"slip": float(np.sum(force * v)), "flow": -float(np.sum(force * background(system, at.x)))}


class NoTangent(SlipDrag):
    """The same with the tangent of a coefficient that is constant."""

    def tangent(self, system: System, contacts: Contacts, given: StageInput, at: Balance) -> Array | None:
        return np.full(at.x.shape, self.z) / given.s if given.s > 0 else None


def run(scene: ParticleScene, *more: Mechanism) -> State:
    """State at the end of a run with mechanisms that no key asks for."""
    plain = prepare(scene)
    system = with_mechanisms(plain, plain.kernel, plain.p, (*plain.mechanisms, *more))
    newton = Newton()
    state = start(system, newton)
    integrate(system, newton, state)
    return state


@pytest.mark.slow
def test_a_drag_that_depends_on_the_slip_enters_from_outside() -> None:
    """Pushed so that v = exp(-t) along (3, 4)/5: x = 1 - exp(-t); it takes the integral of z (1 + k v) v^2."""
    z, k, t = 0.7, 3.0, 2.0
    f = f"{z}*(1 + {k}*exp(-t))*exp(-t)"
    pushes = [Push("all", [f"0.6*({f})", f"0.8*({f})"])]
    physics = {**PHYSICS, "until_t": t, "rtol": 1e-6}
    scene = ParticleScene(**physics, positions=[[0, 0], [9, 0]], radii=1.0, range=1.0, push=pushes)
    state = run(scene, SlipDrag(z, k))
    moved = 1 - math.exp(-t)
    np.testing.assert_allclose(state.x - [[0, 0], [9, 0]], moved * np.array([[0.6, 0.8]] * 2), atol=1e-5)
    taken = 2 * z * ((1 - math.exp(-2 * t)) / 2 + k * (1 - math.exp(-3 * t)) / 3)
    assert state.work["slip"] == pytest.approx(taken, rel=1e-5)  # an error of rtol in each step
    assert state.work["external"] == pytest.approx(state.work["slip"], rel=1e-8)  # at every stage forces balance
    assert state.counts["rejected"] == 0
    # Newton's iteration takes its tangent: with that of a drag that is none of the slip's it does not converge
    with pytest.raises(IntegrationError, match="does not converge"):
        run(scene, NoTangent(z, k))


def test_a_drag_that_depends_on_the_slip_carries_with_the_flow() -> None:
    """Nothing else acts: spheres move with the shear flow, and no energy is exchanged."""
    scene = ParticleScene(**PHYSICS, positions=[[0, 1], [9, 3]], radii=1.0, range=1.0, drag=1e-3, shear_rate=0.1)
    state = run(scene, SlipDrag(0.7, 3.0))
    np.testing.assert_allclose(state.x, [[1, 1], [12, 3]], atol=1e-9)
    assert abs(state.work["slip"]) < 1e-12


@dataclass(frozen=True)
class Inertia(Mechanism):
    """Masses, m dv/dt: a velocity that is integrated from step to step."""

    mass: float

    takes = ("kinetic",)
    moves_freely = True

    def kept(self, system: System) -> dict[str, Array]:
        return {"velocity": np.zeros(system.fixed.shape)}

    def act(self, system: System, contacts: Contacts, given: StageInput, at: Balance) -> Action:
        force = self.mass * self.rates_of(system, given, at)["velocity"]
        return Action(force, float(np.abs(force).max()), self.mass / given.s**2)

    def tangent(self, system: System, contacts: Contacts, given: StageInput, at: Balance) -> Array:
        return np.full(at.x.shape, self.mass / given.s**2)

    def rates_of(self, system: System, given: StageInput, at: Balance) -> dict[str, Array]:
        return {"velocity": ((at.x - given.x_star) / given.s - given.own["velocity"]) / given.s}

    def errors(self, system: System, at: Balance, errors: Mapping[str, Array]) -> list[float]:
        return [float(np.abs(errors["velocity"]).max()) / system.rtol]

    def powers(self, system: System, contacts: Contacts, at: Balance, rates: Rates) -> dict[str, float]:
        return {"kinetic": float(np.sum(self.mass * rates.own["velocity"] * rates.v))}


@pytest.mark.parametrize("drag", [0.0, 1.0])
def test_a_momentum_enters_from_outside(drag: float) -> None:
    """From rest under a constant force F, against a drag z or none: x(t), and where the work of F is."""
    m, F, t, z = 2.0, 0.3, 2.0, 6 * math.pi * ETA * drag
    physics = {**PHYSICS, "until_t": t, "rtol": 1e-6}
    scene = ParticleScene(**physics, positions=[[0, 0]], radii=1.0, range=1.0, drag=drag, push=[Push([0], [F, 0])])
    state = run(scene, Inertia(m))
    if drag:
        v = F / z * (1 - math.exp(-z * t / m))
        x = F / z * t - m * v / z
    else:
        v, x = F / m * t, F / m * t**2 / 2
    np.testing.assert_allclose(state.x, [[x, 0]], atol=1e-5)
    np.testing.assert_allclose(state.kept["velocity"], [[v, 0]], atol=1e-5)
    assert state.work["kinetic"] == pytest.approx(m * v**2 / 2, rel=1e-4)
    assert state.work["external"] == pytest.approx(F * x, rel=1e-4)
    assert state.work["drag"] + state.work["kinetic"] == pytest.approx(state.work["external"], rel=1e-8)


# What a scene imports


@pytest.mark.slow
def test_a_scene_imports_the_rooms_that_it_asks_for_alone() -> None:
    scenes = {
        "": "hold=[]",
        "drag": "drag=1.0",
        "drag shear": "drag=1.0, shear_rate=0.1",
        "drag pushes": "drag=1.0, push=[Push([0], [1e-3, 0])]",
        "holds": "hold=[Hold('all', 'xy')]",
        "drag gravity": "drag=1.0, gravity=particles.Gravity([0, -1e-3], 1.0)",
        "drag walls": "drag=1.0, wall=[Wall([0, -3], [0, -1])]",
        "stress": "box=[9.0, 9.0], stress={'pressure': 0.0}, drag=0.0",
        "sliding": "tangential=True",
    }
    for wanted, given in scenes.items():
        program = (
            "import sys\n"
            "from softdyn import particles\n"
            "from softdyn.particles import Hold, ParticleScene, Push, Wall\n"
            "from softdyn.particles.particle_run import check\n"
            "check(ParticleScene('equal_spheres', {'E': 1.0, 'eta': 1.0, 'nu': 0.5}, positions=[[0, 0]], radii=1.0, "
            f"until_t=1.0, range=1.0, {given}))\n"
            f"print(*(room for room in {tuple(ROOMS)} if 'softdyn.particles.mechanisms.' + room in sys.modules))"
        )
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
        assert set(done.stdout.split()) == {"soft_films", *wanted.split()}
