"""Soft droplets, and grains that hold to one another, in a fluid: the contacts that they have without, less drag."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softdyn
from softdyn.errors import SceneError
from softdyn.fluid import Boundary, MeshSection
from softdyn.particles import Gravity, Inertia, ParticleScene, Wall
from softdyn.particles.particle_run import prepare
from softdyn.particles.system import contact_state
from softdyn.results.rerun import differences
from softdyn.scene.stock_scenes import suspension_scenes
from softdyn.suspension import SuspensionScene, simulate
from softdyn.suspension.suspension_run import made_ready, simulate_suspension

#: What balances close to.
CLOSED = 1e-12
SIDES = ["left", "right", "bottom", "top", "front", "back"]


def droplets(**more: Any) -> SuspensionScene:
    """Two droplets, one on the other, on the floor of a box of 6^3."""
    given: dict[str, Any] = {
        "viscosity": 1.0, "density": 1.0, "elements": "P1-P1", "mesh": MeshSection(box=[6.0] * 3, cells=[6] * 3),
        "boundary": [Boundary(SIDES, velocity=[0.0] * 3)], "positions": [[3.0, 0.52, 3.0], [3.0, 1.54, 3.0]],
        "radii": 0.5, "grain_density": 2.0, "gravity": [0.0, -4.0, 0.0], "law": "droplet",
        "parameters": {"sigma": 4.0}, "walls": SIDES, "gap": 0.05, "range": 0.25, "drag": "stokes", "width": 1.5,
        "until_t": 1.0, "dt": 0.25, "times": 3, "rtol": 1e-4,
    }  # fmt: skip
    return SuspensionScene(**{**given, **more})


def alone(**more: Any) -> ParticleScene:
    """The same in a fluid that is nothing but drag and buoyancy."""
    given: dict[str, Any] = {
        "law": "droplet", "parameters": {"sigma": 4.0, "eta": 1.0}, "positions": [[3.0, 0.52, 3.0], [3.0, 1.54, 3.0]],
        "radii": 0.5, "inertia": Inertia(2.0), "gravity": Gravity([0.0, -4.0, 0.0], fluid_density=1.0), "gap": 0.05,
        "range": 0.25, "drag": 1.0, "wall": [Wall([0.0] * 3, [0.0, -1.0, 0.0])], "until_t": 10.0, "times": 9,
    }  # fmt: skip
    return ParticleScene(**{**given, **more})


@pytest.mark.slow
def test_droplets_at_rest_are_pressed_as_without_the_fluid() -> None:
    """On the floor, under weight less buoyancy, films drain alike once the fluid that was pushed away has come to rest.

    It takes longest at first, when the droplets sink: 0.016 behind those alone at t = 1.25, of 0.15 that they are
    pressed in the end; the law's drained films then forget it.
    """
    result, other = simulate(droplets(until_t=10.0, times=9)), softdyn.simulate(alone())
    pressed = 0.5 - other.x[-1, 0, 1]
    assert pressed > 0.13
    assert np.abs(result.x[-1] - other.x[-1])[:, 1].max() < 0.005 * pressed
    assert np.abs(result.x[-3] - other.x[-3])[:, 1].max() < 0.01 * pressed
    weight = 2 * 4 / 3 * math.pi * 0.5**3 * 4.0
    assert -result.contact_force_bottom[-1, 1] == pytest.approx(weight, rel=0.01)
    assert result.grain_contact[-1, 1] == pytest.approx(weight, rel=0.01)
    kinds = ("mass", "momentum", "volume", "exchange")
    assert all(float(result.arrays[f"{kind}_imbalance"].max()) < 1e2 * CLOSED for kind in kinds)
    assert not result.warnings


@pytest.mark.parametrize("gap", [0.001, 0.02, 0.1])
def test_a_contact_carries_what_exceeds_the_drag(gap: float) -> None:
    """Of equal spheres, zeta -> 3 pi eta R far apart: that is the closure's. Less of it is left than of all of zeta."""
    parameters = {"E": 1e4, "nu": 0.3}
    scene = droplets(law="equal_spheres", parameters=parameters, gap=None, walls=[], range=0.5)
    inner = made_ready(scene).contacts
    given = {"law": "equal_spheres", "parameters": {**parameters, "eta": 1.0}, "gap": None, "wall": [], "range": 0.5}
    found = {}
    for name, system in (
        ("fluid", inner), ("drag", prepare(alone(**given))), ("all", prepare(alone(**given, drag=0.0))),
    ):  # fmt: skip
        contacts = softdyn.particles.start.start(system, softdyn.particles.force_balance.Newton()).contacts
        assert len(contacts) == 1
        found[name] = float(contact_state(system, contacts, np.array([-gap]), np.array([gap]))["friction"][0])
    assert found["fluid"] == pytest.approx(found["drag"], rel=1e-12)
    assert found["all"] - found["fluid"] == pytest.approx(3 * math.pi * 0.5, rel=0.05)


def test_a_run_with_films_that_is_killed_goes_on_to_the_bit(tmp_path: Path) -> None:
    scene, checkpoint = droplets(), tmp_path / "run.checkpoint.npz"
    whole = simulate(scene)

    def stop(t: float, *_: Any) -> None:
        if t > 0.4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_suspension(scene, stop, checkpoint)
    assert not differences(whole, simulate_suspension(scene, None, checkpoint, resume=True))


@pytest.mark.slow
def test_an_emulsion_flows_steadily_with_a_blunt_profile() -> None:
    """What walls bear of the force on the fluid, and the profile of droplets and fluid together, in the last quarter.

    Alone, the fluid would have a maximum of 1.5 times the mean; where droplets hold the middle together it is less.
    """
    scene = softdyn.read_scene(suspension_scenes()["emulsion_flow"])
    assert isinstance(scene, SuspensionScene)
    result = simulate(scene)
    assert not result.warnings
    kinds = ("mass", "momentum", "volume", "exchange")
    assert all(float(result.arrays[f"{kind}_imbalance"].max()) < 1e-10 for kind in kinds)
    height = np.zeros(result.u.shape[1])
    height[result.u_nodes] = result.at[result.corners][..., 1]
    levels, row = np.unique(np.round(height, 6), return_inverse=True)
    profiles = [np.bincount(row, (result.u + result.us)[k, :, 0]) / np.bincount(row) for k in (-5, -3, -1)]
    largest = max(profile.max() for profile in profiles)
    assert max(np.abs(profile - profiles[-1]).max() for profile in profiles) < 0.05 * largest
    assert largest / np.trapezoid(profiles[-1], levels) * np.ptp(levels) < 1.4
    driving = 0.8 * (12 * 8 - result.grain_volume[-1])
    late = result.step_t > 6
    assert (result.force_bottom + result.force_top)[late, 0].mean() == pytest.approx(driving, rel=0.1)
    assert result.contacts[-1] > 30


@pytest.mark.slow
def test_grains_that_hold_to_one_another_are_not_pulled_apart() -> None:
    """Adhesion of DMT's contact, pi R w = 6.3, in a flow that pulls: it holds at 5, and no longer at 14."""
    apart = []
    for rate in (1.0, 3.0):
        flow = [f"{rate}*(x - 3)", f"-{rate}*(y - 3)", "0"]
        scene = droplets(
            law="dmt", parameters={"E": 1e4, "nu": 0.3, "w": 4.0, "z0": 0.05}, gap=None, walls=[], gravity=None,
            positions=[[2.501, 3.0, 3.0], [3.499, 3.0, 3.0]], boundary=[Boundary(SIDES, velocity=flow)], start=flow,
            until_t=0.5, dt=0.05, grain_density=1.0,
        )  # fmt: skip
        result = simulate(scene)
        apart.append(float(np.ptp(result.x[-1, :, 0])))
    assert apart[0] == pytest.approx(1.0, abs=0.01)
    assert apart[1] > 1.5


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"parameters": {"sigma": 4.0, "eta": 2.0}}, r"\[parameters\] eta = 2: of films in this fluid it is 1,"),
        ({"gap": None, "positions": [[3.0, 0.4, 3.0]]}, "overlap"),
        ({"law": "hertz_dry", "parameters": {"E": 1.0, "nu": 0.3}, "gap": None}, r"\[contacts\] range: contacts"),
        ({"law": None, "parameters": {}, "walls": []}, r"(?s)contacts\] gap needs a contact law.*range needs"),
    ],
)  # fmt: skip
def test_bad_films_are_refused_by_name(change: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        simulate(droplets(**change))


def test_layers_of_discs_have_the_viscosity_per_depth() -> None:
    """A disc stands for a sphere in each 4/3 of its radius of depth, as the drag has it."""
    flat = replace(
        droplets(), mesh=MeshSection(box=[6.0] * 2, cells=[6] * 2), boundary=[Boundary(SIDES[:4], velocity=[0.0, 0.0])],
        positions=[[3.0, 0.52], [3.0, 1.54]], gravity=[0.0, -4.0], walls=SIDES[:4],
    )  # fmt: skip
    system = made_ready(flat).contacts
    assert system is not None
    assert system.scene.parameters["eta"] == pytest.approx(1.0 / (4 / 3 * 0.5))
