"""Grains of a suspension that touch one another and walls: what contacts carry, and what they leave alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softdyn
from softdyn.errors import IntegrationError, SceneError
from softdyn.fluid import Boundary, MeshSection
from softdyn.particles import Friction, Gravity, Inertia, ParticleScene, Wall
from softdyn.results.rerun import differences
from softdyn.suspension import SuspensionResult, SuspensionScene, simulate
from softdyn.suspension.suspension_run import ENOUGH, simulate_suspension

#: What balances close to.
CLOSED = 1e-12
SIDES = ["left", "right", "bottom", "top"]


def pile(**more: Any) -> SuspensionScene:
    """Six discs above the floor of a box of 6 x 8, in a fluid in which they follow within about 1."""
    given: dict[str, Any] = {
        "viscosity": 0.2, "density": 1.0, "elements": "P1-P1", "mesh": MeshSection(box=[6.0, 8.0], cells=[6, 8]),
        "boundary": [Boundary(SIDES, velocity=[0.0, 0.0])], "gravity": [0.0, -1.0], "radii": 0.5, "grain_density": 2.5,
        "positions": [[1.0, 0.6], [2.1, 0.6], [3.2, 0.6], [1.5, 1.6], [2.6, 1.6], [2.0, 2.6]],
        "law": "hertz", "parameters": {"E": 1e4, "nu": 0.3, "tau": 0.02}, "friction": Friction(mu=0.5),
        "walls": SIDES, "drag": "schiller_naumann", "width": 1.5, "until_t": 12.0, "dt": 0.2, "times": 3, "rtol": 1e-3,
    }  # fmt: skip
    return SuspensionScene(**{**given, **more})


def closed(result: SuspensionResult, most: float = CLOSED) -> bool:
    kinds = ("mass", "momentum", "volume", "exchange")
    return all(float(result.arrays[f"{kind}_imbalance"].max()) < most for kind in kinds)


@pytest.mark.slow
@pytest.mark.parametrize(("viscosity", "until"), [(0.02, 16.0), (20.0, 3.0)])
def test_walls_carry_the_buoyant_weight(viscosity: float, until: float) -> None:
    """Whether grains follow the fluid within 50 steps or within a thirtieth of one, from which on they sink slowly.

    What the law says of the contacts with walls, at the end of a step, is what the balance of the grains' momentum says
    in the mean over it; at rest it is weight less buoyancy. Steps of 0.2 are long beside what is left to move.
    """
    places = [[0.6 + 1.01 * k + 0.5 * (row % 2), 0.497 + 0.86 * row] for row in range(3) for k in range(5 - row % 2)]
    result = simulate(pile(viscosity=viscosity, positions=places, until_t=until))
    assert closed(result, 1e2 * CLOSED)  # of water that is at rest, less of all terms is left than they are summed of
    walls = sum(result.arrays[f"contact_force_{name}"][-1, 1] for name in SIDES)
    buoyant, drag = 0.6 * result.grain_weight[-1, 1], result.grain_drag[-1, 1]
    # the fluid that still flows pushes, too, where it has not come to rest
    left = -result.grain_weight[-1, 1] - result.grain_pressure[-1, 1] - drag
    assert -walls == pytest.approx(left, rel=0.02)
    assert result.grain_contact[-1, 1] == pytest.approx(left, rel=0.02)
    if until > 10:
        assert walls == pytest.approx(buoyant, rel=0.01)
        assert np.abs(result.v[-1]).max() < 0.01
    assert result.coupling_repeats.max() < ENOUGH
    assert not result.warnings


def test_contacts_among_grains_make_no_momentum() -> None:
    """Discs that fall onto one another, far from walls: pairs push and rub each other alike, walls nobody."""
    places = [[2.0, 4.0], [2.1, 5.02], [3.0, 4.4], [3.5, 5.3]]
    result = simulate(
        pile(positions=places, velocities=[[0.5, 1.0], [-0.2, -1.0], [-1.0, 0.0], [-0.5, -1.0]], until_t=0.6, times=13)
    )
    assert closed(result)
    assert result.contacts.max() > 0
    sizes = np.abs(result.grain_weight).max()
    assert np.abs(result.grain_contact).max() < CLOSED * sizes
    gained = np.diff(result.grain_momentum, axis=0)
    forces = (result.grain_drag + result.grain_pressure + result.grain_weight)[1:] * result.step_dt[1:, None]
    assert gained == pytest.approx(forces, rel=1e-11, abs=1e-11)
    assert np.trace(result.contact_stress, axis1=1, axis2=2).min() < 0


def test_next_to_no_fluid_they_are_grains_alone() -> None:
    """Discs that fall on the floor in a gas of 1e-9 of their density do what the explicit engine alone does."""
    places = [[2.0, 0.8], [2.1, 1.85], [3.3, 0.9]]
    fluid = simulate(
        pile(positions=places, density=1e-9, viscosity=1e-9, grain_density=1.0, until_t=2.0, dt=0.1, walls=["bottom"])
    )
    alone = softdyn.simulate(
        ParticleScene(
            law="hertz", parameters={"E": 1e4, "nu": 0.3, "tau": 0.02}, friction=Friction(mu=0.5), positions=places,
            radii=0.5, inertia=Inertia(1.5, "sphere"), gravity=Gravity([0.0, -1.0]), wall=[Wall([0, 0], [0, -1])],
            until_t=2.0, times=3, rtol=1e-2,
        )
    )  # fmt: skip
    assert fluid.substeps.min() > 10
    assert fluid.x[-1] == pytest.approx(alone.x[-1], abs=2e-2)


def test_a_run_with_contacts_that_is_killed_goes_on_to_the_bit(tmp_path: Path) -> None:
    scene, checkpoint = pile(until_t=2.0), tmp_path / "run.checkpoint.npz"
    whole = simulate(scene)
    assert whole.contacts.max() > 3

    def stop(t: float, *_: Any) -> None:
        if t > 1.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_suspension(scene, stop, checkpoint)
    assert len(softdyn.load_result(tmp_path / "run.frames")) == 2
    assert not differences(whole, simulate_suspension(scene, None, checkpoint, resume=True))
    saved = whole.save(tmp_path / "run.npz")
    assert not differences(whole, softdyn.simulate(softdyn.scene_of(softdyn.load_result(saved))))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"walls": ["floor"]}, r"\[contacts\] walls: boundary 'floor' is none of the mesh's"),
        ({"law": None, "parameters": {}}, r"(?s)friction\] needs a contact law.*contacts\] walls needs"),
        ({"held": True}, "law is of no use to grains that are held"),
        (
            {"law": "rognon_gay", "parameters": {"E": 1.0, "eta": 1.0}, "friction": None},
            "of films in this fluid it is 0.3",
        ),
        ({"parameters": {"E": 1.0, "nu": 0.3}}, "tau is missing"),
        ({"viscosity": 0.0}, r"\[fluid\] viscosity"),
    ],
)
def test_bad_contacts_are_refused_by_name(change: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        simulate(pile(**change))


LAW = {"E": 1e4, "nu": 0.3, "tau": 0.02}


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"mixture": "maron_pierce", "parameters": {**LAW, "phi_max": 1.5}}, SceneError, r"phi_max = 1.5 lies outside"),
        (
            {"mixture": "maron_pierce", "parameters": {**LAW, "phi_max": -1.0}},
            SceneError,
            "phi_max .* must be positive",
        ),
        (
            {"mixture": "maron_pierce", "parameters": {**LAW, "phi_max": 0.3}},
            IntegrationError,
            r"closure maron_pierce is finite and grows .* up to 0.3\d* at most, and at t=0 there is 0.4\d* at \(",
        ),
        ({"width": 5.0}, SceneError, "the filter is wider than half the fluid, whose shortest side is 6"),
        ({"positions": [[7.0, 1.0]]}, SceneError, r"grain 0 is at \(7, 1\), outside of the mesh"),
        ({"positions": [[1.0, 1.0], [1.2, 1.0]]}, SceneError, "particle 0 and particle 1 overlap"),
    ],
)
def test_what_does_not_hold_is_refused_by_name(change: dict[str, Any], error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        simulate(pile(**change))


def test_grains_that_follow_at_once_ask_for_shorter_steps() -> None:
    with pytest.raises(IntegrationError, match=r"grain 5 follows the fluid within .*give a shorter \[steps\] dt"):
        simulate(pile(viscosity=1e6, gravity=[0.0, -1e-6]))
