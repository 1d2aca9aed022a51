"""What the fluid does to a particle alone: by Stokes, or as the law declares it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from sympy import Rational, Symbol, pi

from softdyn.derive import DIMENSIONLESS, Drag, E, R, eta, h
from softdyn.derive.laws.equal_spheres import law as equal_spheres
from softdyn.derive.laws.rognon_gay import law as rognon_gay
from softdyn.errors import LawError
from softdyn.particles.particle_keys import ParticleScene, Push
from softdyn.particles.particle_run import simulate_particles
from softdyn.particles.results import ParticleResult

lam = Symbol("lam", nonnegative=True)
#: A droplet with a mobile surface, its viscosity lam times that of the fluid around it (Hadamard and Rybczynski).
mobile = replace(
    rognon_gay,
    name="mobile",
    drag=Drag(translation=2 * pi * eta * R * (2 + 3 * lam) / (1 + lam)),
    parameters={lam: DIMENSIONLESS},
)


def falling(law: Any, target: str = "c", **changes: Any) -> ParticleResult:
    """Two particles of radii 1 and 2, far apart, under a force of 1e-3 each."""
    settings: dict[str, Any] = {
        "law": law,
        "parameters": {"E": 1.0, "eta": 0.5},
        "positions": [[0.0, 0.0], [10.0, 0.0]],
        "radii": [1.0, 2.0],
        "range": 0.5,
        "drag": 1.0,
        "push": [Push([0, 1], [0.0, -1e-3])],
        "until_t": 10.0,
        "times": 2,
        "target": target,
        **changes,
    }
    return simulate_particles(ParticleScene(**settings))


@pytest.mark.slow
@pytest.mark.parametrize("target", ["c", "numba"])
def test_a_particle_falls_as_stokes_says(target: str) -> None:
    v = falling("rognon_gay", target).v[-1, :, 1]
    np.testing.assert_allclose(v, -1e-3 / (6 * np.pi * 0.5 * np.array([1.0, 2.0])), rtol=1e-9)


@pytest.mark.parametrize(("ratio", "factor"), [(0.0, 4.0), (1.0, 5.0), (1e12, 6.0)])
def test_a_droplet_falls_as_its_law_declares(ratio: float, factor: float) -> None:
    """From a bubble, 4 pi eta R, to a solid sphere, 6 pi eta R."""
    parameters = {"E": 1.0, "eta": 0.5, "lam": ratio}
    v = falling(mobile, parameters=parameters).v[-1, :, 1]
    np.testing.assert_allclose(v, -1e-3 / (factor * np.pi * 0.5 * np.array([1.0, 2.0])), rtol=1e-9)


def test_parameters_of_the_drag_are_those_of_the_species() -> None:
    """Of each particle by itself, unmixed."""
    parameters = {"E": 1.0, "eta": 0.5, "lam": {"bubble": 0.0, "drop": 1.0}}
    v = falling(mobile, parameters=parameters, species=["drop", "bubble"], mixing={"lam": "arithmetic"}).v[-1, :, 1]
    np.testing.assert_allclose(v, -1e-3 / (np.array([5.0, 4.0]) * np.pi * 0.5 * np.array([1.0, 2.0])), rtol=1e-9)


@pytest.mark.slow
def test_the_rotation_is_resisted_as_declared() -> None:
    """In a shear flow a lone sphere turns with it, whatever resists."""
    slow = replace(equal_spheres, name="slow", drag=Drag(rotation=8 * pi * eta * R**3 * Rational(1, 3)))
    settings = {"tangential": True, "shear_rate": 1e-2, "push": [], "parameters": {"E": 1.0, "eta": 0.5, "nu": 0.5}}
    for law in (equal_spheres, slow):
        result = falling(law, **settings)
        np.testing.assert_allclose(result.spin[-1], -5e-3, rtol=1e-6)


@pytest.mark.parametrize(
    ("drag", "message"),
    [
        (Drag(translation=6 * pi * eta * R**2), "drag translation: .* has the dimension"),
        (Drag(translation=6 * pi * eta * h), "drag translation.*symbol 'h' is not allowed"),
        (Drag(rotation=pi * eta * R**3 - 9 * E * eta * R**3 / E), "drag rotation must be positive"),
        (6 * pi * eta * R, "not a Drag"),
    ],
)
def test_what_is_no_drag_is_refused(drag: Any, message: str) -> None:
    with pytest.raises(LawError, match=message):
        replace(rognon_gay, name="wrong", drag=drag)


def test_without_drag_there_is_none_of_it_in_the_kernel() -> None:
    from softdyn.derive.contact_equations import ContactNeeds
    from softdyn.derive.contact_kernel import contact_ir
    from softdyn.derive.emit import emit

    texts = [emit(contact_ir(mobile, ContactNeeds(drag=drag)), "c") for drag in (False, True)]
    assert ["_drag(" in text for text in texts] == [False, True]
    assert ["lam" in text for text in texts] == [False, True]
