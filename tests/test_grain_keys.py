"""Keys of grains: inertia, friction, the method; what does not go together is refused by name."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from softdyn.derive import Rubbing
from softdyn.derive.laws.hertz_dry import law as hertz_dry
from softdyn.errors import SceneError
from softdyn.particles import Friction, Gravity, Inertia, ParticleScene, Push, simulate
from softdyn.particles.mechanisms import coulomb, inertia
from softdyn.particles.methods import method_of
from softdyn.particles.particle_scene import check

HERTZ: dict[str, Any] = {"law": "hertz_dry", "parameters": {"E": 1e3, "nu": 0.3}, "radii": 0.5, "until_t": 1.0}
PAIR = [[0.0, 0.0], [2.0, 0.0]]


def scene(**changes: Any) -> ParticleScene:
    return ParticleScene(**{**HERTZ, "positions": PAIR, "inertia": Inertia(2.0), **changes})


def test_mass_and_moment_of_spheres_and_discs() -> None:
    """4/3 pi R^3 and 2/5 m R^2; pi R^2 depth and m R^2/2, as deep as the layer."""
    facts = check(scene())
    (found,) = [one for one in facts.mechanisms if isinstance(one, inertia.Masses)]
    np.testing.assert_allclose(found.mass, 2.0 * 4 / 3 * np.pi * 0.5**3)
    np.testing.assert_allclose(found.moment, 0.4 * found.mass * 0.5**2)
    facts = check(scene(inertia=Inertia(2.0, "disc"), depth=3.0))
    (found,) = [one for one in facts.mechanisms if isinstance(one, inertia.Masses)]
    np.testing.assert_allclose(found.mass, 2.0 * np.pi * 0.5**2 * 3.0)
    np.testing.assert_allclose(found.moment, 0.5 * found.mass * 0.5**2)


def test_gravity_takes_the_density_of_the_inertia() -> None:
    """The weight is m g, less what the fluid bears."""
    facts = check(scene(gravity=Gravity([0.0, -9.0], fluid_density=0.5)))
    loads = [one.load for one in facts.mechanisms if one.load is not None]
    np.testing.assert_allclose(loads[0](0.0)[:, 1], -9.0 * 1.5 * 4 / 3 * np.pi * 0.5**3)


def test_friction_gives_rotations() -> None:
    assert check(scene()).width == 2
    assert check(scene(friction=Friction(0.3))).width == 3
    assert check(scene(positions=[[0, 0, 0]], friction=Friction(0.3))).width == 6
    check(scene(friction=Friction(0.3), push=[Push([0], torque=[1.0])]))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"friction": Friction(-0.1)}, r"\[friction\] mu must be 0 or a positive number, not -0.1"),
        ({"friction": Friction(0.1, rolling=-1)}, r"\[friction\] rolling must be 0 or a positive"),
        ({"friction": Friction(0.1, restitution=1.5)}, r"\[friction\] restitution must lie between 0 and 1, not 1.5"),
        ({"friction": Friction(0.1, restitution=0.5)}, r"restitution is that of rigid grains"),
        ({"friction": Friction(0.1, twisting=0.5)}, r"twisting: .* do not twist"),
        ({"friction": Friction(0.1), "positions": [[0.0], [2.0]]}, "in one dimension surfaces do not slide"),
        ({"inertia": Inertia(0.0)}, r"\[inertia\] density of particles 0, 1 is 0"),
        ({"inertia": Inertia(-1.0)}, r"\[inertia\] density must be 0 or a positive number, not -1.0"),
        ({"inertia": Inertia({"a": 1.0})}, r"there is no species 'a'"),
        ({"inertia": Inertia(1.0, "cube")}, "unknown shape 'cube'"),
        ({"inertia": Inertia(1.0, "disc"), "positions": [[0, 0, 0]]}, "is for two dimensions"),
        ({"gravity": Gravity([0, -1.0], 3.0)}, r"\[gravity\] density = 3.0 and \[inertia\] density = 2.0"),
        ({"inertia": None, "gravity": Gravity([0, -1.0])}, r"\[gravity\] density must be 0 or a positive"),
        ({"inertia": None, "velocities": PAIR}, r"\[particles\] velocities: without inertia"),
        ({"velocities": [[1.0, 0.0]]}, r"velocities must be 2 finite numbers for each of 2 particles"),
        ({"spins": [[1.0], [0.0]]}, r"spins: particles turn with \[friction\]"),
        ({"push": [Push([0], torque=[1.0])]}, r"torque has no meaning without .* or \[friction\]"),
        ({"method": "euler"}, "unknown method 'euler'"),
    ],
)
def test_what_cannot_be_is_refused(change: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        check(scene(**change))


#: Of the load of a contact, half is borne by what rubs.
PART = Rubbing(load=hertz_dry.F_ela / 2, k_t=hertz_dry.tangential.k_t)
SOFT = {"law": "rognon_gay", "parameters": {"E": 1.0, "eta": 1.0}}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"inertia": None, "method": "explicit"}, "explicit steps are those of grains with inertia"),
        ({"method": "explicit", **SOFT}, "the law has a film with a gap of its own"),
        ({"method": "explicit", "drag": 1.0, "range": 1.0}, r"\[flow\] drag is not known to the explicit"),
        ({"method": "contact_dynamics"}, "contact dynamics is for rigid grains"),
        ({"law": None, "inertia": None, "method": "contact_dynamics"}, r"\[inertia\] density is missing"),
        ({"law": None, "method": "explicit"}, "law is missing"),
        ({"law": None, "inertia": None}, "law is missing"),
        ({"method": "explicit", "step": 0.1}, r"\[method\] step is that of contact dynamics; .* \[accuracy\] rtol"),
        ({"method": "implicit", "step": 0.1}, r"\[method\] step is that of contact dynamics; .* \[accuracy\] rtol"),
        ({"method": "implicit", "box": [9.0, 9.0], "gravity": Gravity([0, -1.0])}, "there is nothing to stand on"),
        (
            {"method": "explicit", "law": replace(hertz_dry, name="own", rubbing=PART), "friction": Friction(0.1)},
            "friction of a load and a stiffness that the law declares, rubbing=, is not known to the explicit",
        ),
    ],
)
def test_a_method_refuses_the_scenes_that_it_cannot_have(change: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        simulate(scene(**change))


def test_the_method_follows_from_the_scene() -> None:
    """Films are implicit, dry grains with inertia explicit, rigid ones those of contact dynamics, if there is one."""
    films = replace(scene(**SOFT, drag=1.0, range=1.0), inertia=None)
    assert method_of(check(films)) == "implicit"
    rubbing = [one for one in check(scene(friction=Friction(0.4))).mechanisms if isinstance(one, coulomb.Rubbing)]
    assert rubbing[0].mu == 0.4
