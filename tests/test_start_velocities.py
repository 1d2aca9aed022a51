"""Velocities of the first frame follow from the forces there, however fast these then relax."""

from __future__ import annotations

import math

import numpy as np
import pytest

from softdyn import particles


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-2, 1e-4, 1e-6])
def test_the_first_velocities_are_those_of_the_first_forces(rtol: float) -> None:
    """Extrapolated from within the first step they were off by a tenth: pressed spheres spring apart within it."""
    scene = particles.ParticleScene(
        law="rognon_gay", parameters={"E": 100.0, "eta": 1.0}, positions=[[0.0, 0.0], [1.96, 0.0]], radii=1.0, gap=0.01,
        push=[particles.Push([0], force=[0.1, -0.2])], drag=1.0, until_t=50.0, times=3, rtol=rtol,
    )  # fmt: skip
    result = particles.simulate(scene)
    F = result.contacts(0)["F"][0]
    exact = np.array([[0.1 - F, -0.2], [F, 0.0]]) / (6 * math.pi)
    assert np.abs(result.v[0] - exact).max() < 3 * rtol * np.abs(exact).max()


def test_a_box_under_stress_moves_from_the_start() -> None:
    """Its first frame said that it is at rest, while its particles were not."""
    scene = particles.ParticleScene(
        law="rognon_gay", parameters={"E": 10.0, "eta": 1.0}, positions=[[1.0, 1.0], [3.0, 1.2]], radii=1.0, gap=0.05,
        range=0.4, box=[6.0, 6.0], stress={"xy": 0.1}, drag=1.0, until_t=2.0, times=3, rtol=1e-4,
    )  # fmt: skip
    result = particles.simulate(scene)
    stress = (result.stress[0] + result.stress[0].T) / 2
    assert abs(stress[0, 1]) > 1e-5
    assert result.gradient[0, 0, 1] == pytest.approx(0.1 - stress[0, 1], rel=1e-5)
