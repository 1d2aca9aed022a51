"""Rigid discs and spheres in a periodic box whose stress is imposed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softdyn.errors import IntegrationError, SceneError
from softdyn.particles import ParticleScene, simulate
from softdyn.particles.contact_dynamics.rigid_run import prepare
from softdyn.particles.mechanisms.coulomb import Friction
from softdyn.particles.mechanisms.inertia import Inertia
from softdyn.particles.packing import random_packing
from softdyn.particles.particle_scene import check


def lattice_scene(d: int, **changes: Any) -> ParticleScene:
    """Grains of radius 1 at the places of a cubic lattice, a tenth of their size apart."""
    side, count = 2.2, 3
    places = np.stack(np.meshgrid(*[np.arange(count)] * d, indexing="ij"), axis=-1).reshape(-1, d)
    given: dict[str, Any] = {"friction": Friction(0.5)} if d > 1 else {}
    given |= {
        "positions": (side * (places + 0.5)).tolist(), "radii": 1.0, "box": [side * count] * d,
        "inertia": Inertia(1.0), "method": "contact_dynamics", "stress_viscosity": 5.0,
        "until_t": 1.0, "times": 11, "step": 5e-3, "rtol": 1e-6,
    }  # fmt: skip
    return ParticleScene(**{**given, **changes})


@pytest.mark.parametrize(("d", "component"), [(1, "xx"), (2, "pressure"), (2, "yy"), (3, "pressure")])
def test_without_contacts_the_fluid_alone_bears_the_stress(d: int, component: str) -> None:
    """2 eta D = imposed: lengths shrink by (1 - P dt/(2 eta)) a step, by less than the gap of the lattice."""
    P, dt = 0.5, 5e-3
    stress = {component: P if component == "pressure" else -P}
    result = simulate(lattice_scene(d, stress=stress, until_t=0.5))
    shrunk = 6.6 * (1 - P * dt / 10) ** 100
    lengths = np.diagonal(result.cell[-1])
    axes = [k for k in range(d) if component == "pressure" or component[0] == "xyz"[k]]
    np.testing.assert_allclose(lengths[axes], shrunk, rtol=1e-12)
    np.testing.assert_allclose(np.delete(lengths, axes), 6.6, rtol=1e-15)


@pytest.mark.parametrize("d", [1, 2])
def test_pressed_grains_bear_the_stress_when_they_touch(d: int) -> None:
    """The lattice closes, and stops where all touch: contacts bear the pressure, the mean of the stresses."""
    P = 40.0
    result = simulate(lattice_scene(d, stress={"pressure": P}, until_t=0.25, times=3, step=1e-2))
    np.testing.assert_allclose(np.diagonal(result.cell[-1]), 6.0, rtol=1e-6)
    assert -np.trace(result.stress[-1]) / d == pytest.approx(P, rel=1e-4)
    assert abs(result.energy["imbalance"]) < 1e-12


def test_a_shear_stress_shears_what_does_not_touch() -> None:
    result = simulate(lattice_scene(2, stress={"xy": 0.3}, until_t=0.5))
    np.testing.assert_allclose(result.gradient[1:, 0, 1], 0.3 / 5.0, rtol=1e-12)
    np.testing.assert_allclose(result.cell[-1][0, 1], 0.3 / 5.0 * 0.5 * 6.6, rtol=1e-12)


def sheared(**changes: Any) -> ParticleScene:
    """Forty discs, sheared at an inertial number of 0.1."""
    x, radii, lengths = random_packing(40, 2, 0.76 * 1.001**2, [1.001 * r for r in (0.42, 0.5, 0.58)], 1)
    given: dict[str, Any] = {
        "positions": x.tolist(), "radii": (radii / 1.001).tolist(), "box": lengths.tolist(),
        "inertia": Inertia(1.0, shape="disc"), "friction": Friction(0.4), "method": "contact_dynamics",
        "shear_rate": 1.0, "stress": {"yy": -100.0}, "stress_viscosity": 20.0, "until_t": 0.2, "times": 101,
        "step": 2e-3, "rtol": 1e-2,
    }  # fmt: skip
    return ParticleScene(**{**given, **changes})


def test_a_sheared_box_breathes_and_its_energy_is_in_balance() -> None:
    """Over a step the momentum balance of the box is that of its faces; the energy sums up to rounding."""
    result = simulate(sheared())
    lengths = np.diagonal(result.cell, axis1=1, axis2=2)
    assert np.ptp(lengths[:, 1]) > 0
    assert np.ptp(lengths[:, 0]) == 0
    assert abs(result.energy["imbalance"]) < 1e-12
    assert result.stats["force_residual"] <= 1e-2


@pytest.mark.slow
def test_the_mean_stress_is_the_imposed_one() -> None:
    """The mean over a strain of 2, but for what the volume changed by: 2 eta of that, and the error of a mean."""
    result = simulate(sheared(until_t=2.0, times=1001))
    height = result.cell[:, 1, 1]
    fluid = 2 * 20.0 * np.log(height[-1] / height[0]) / 2.0
    stress = result.stress[1:, 1, 1]
    blocks = [part.mean() for part in np.array_split(stress, 10)]
    error = np.std(blocks, ddof=1) / np.sqrt(10)
    assert error < 10
    assert abs(stress.mean() + fluid + 100.0) < 3 * error


def test_a_run_that_is_resumed_does_what_it_would_have_done(tmp_path: Path) -> None:
    whole = simulate(sheared(times=5))
    path = tmp_path / "state"
    simulate(sheared(until_t=0.1, times=[0.0, 0.05, 0.1]), checkpoint=path, keep=True)
    resumed = simulate(sheared(times=5), checkpoint=path, resume=True)
    np.testing.assert_array_equal(resumed.x, whole.x)
    np.testing.assert_array_equal(resumed.cell, whole.cell)


def test_a_stress_needs_a_viscosity_and_a_periodic_box() -> None:
    with pytest.raises(SceneError, match=r"\[stress\] viscosity"):
        simulate(sheared(stress_viscosity=None))
    open_box = replace(lattice_scene(2, stress={"pressure": 1.0}), box=None)
    with pytest.raises(SceneError, match="periodic along all axes"):
        simulate(open_box)


def test_a_strain_that_no_run_would_end_at_is_refused() -> None:
    with pytest.raises(SceneError, match=r"\[until\] strain of a shear stress"):
        simulate(lattice_scene(2, stress={"xy": 0.3}, until_strain=0.1))


def test_a_box_that_would_collapse_in_a_step_is_told() -> None:
    far = {"positions": [[0.0, 0.0], [50.0, 50.0]], "box": [100.0, 100.0]}
    with pytest.raises(IntegrationError, match=r"larger \[stress\] viscosity"):
        simulate(lattice_scene(2, stress={"pressure": 1e4}, step=0.05, **far))


def test_a_step_is_chosen_by_the_stress_too() -> None:
    """A twentieth of the time in which the stress moves the lightest grain by its radius, from rest."""
    system = prepare(check(lattice_scene(2, stress={"pressure": 30.0}, until_t=10.0, step=None)))
    mass, side = 4 / 3 * np.pi, 2.0 * 2.0
    assert system.dt == pytest.approx(np.sqrt(2 * 1.0 * mass / (30.0 * side)) / 20)
