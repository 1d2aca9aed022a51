"""The bubble model, against a script of its own in numpy."""

from __future__ import annotations

import numpy as np
import pytest
from durian_by_hand import stress_by_hand

from softdyn.particles.packing import Packing
from softdyn.particles.particle_keys import ParticleScene
from softdyn.particles.particle_run import simulate_particles
from softdyn.particles.results import ParticleResult


def sheared(count: int, rate: float, strain: float, times: int, rtol: float) -> ParticleResult:
    packing = Packing("random", count=count, dimension=2, fraction=0.95, radii=[1.0, 1.4], seed=3)
    scene = ParticleScene(
        "durian", {"k": 1.0, "b": 1.0}, packing=packing, shear_rate=rate, drag=1.0, until_strain=strain, times=times,
        rtol=rtol,
    )  # fmt: skip
    return simulate_particles(scene)


def by_hand(result: ParticleResult, rate: float, strain: float, dt: float) -> tuple[np.ndarray, np.ndarray]:
    depth = 2 * float(result.radii.mean())
    return stress_by_hand(result.x[0], result.radii, float(result.box[0]), rate, strain, dt, depth)


def test_bubbles_start_to_flow_as_they_do_by_hand() -> None:
    """The stress along the first tenth of strain, before rearrangements tell small errors from none: to 1e-3."""
    result = sheared(30, 0.05, 0.1, 6, 1e-5)
    strains, stresses = by_hand(result, 0.05, 0.105, 0.01)
    expected = np.interp(result.t * 0.05, strains, stresses)
    np.testing.assert_allclose(result.stress[:, 0, 1], expected, atol=1e-3 * np.abs(expected).max())
    np.testing.assert_allclose(result.stress[:, 0, 1], result.stress[:, 1, 0], rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("rate", [0.01, 0.1])
def test_the_flow_curve_is_that_of_the_script(rate: float) -> None:
    """Mean shear stress over the strains from 1 to 4, where the foam flows steadily: within 5 %."""
    result = sheared(50, rate, 4.0, 121, 1e-3)
    strains, stresses = by_hand(result, rate, 4.0, 0.1)
    found = float(result.stress[result.t * rate >= 1.0, 0, 1].mean())
    assert found == pytest.approx(float(stresses[strains >= 1.0].mean()), rel=0.05)
