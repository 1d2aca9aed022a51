"""One packing, sheared as dry grains, as bubbles, and as soft spheres with films."""

from __future__ import annotations

import numpy as np
import pytest
from sympy import simplify

from softdyn.derive.law_dynamics import law_quantities
from softdyn.derive.laws.droplet import law as droplet
from softdyn.derive.laws.droplet import sigma
from softdyn.derive.laws.durian import k as of_bubbles
from softdyn.derive.laws.durian import law as durian
from softdyn.particles.particle_run import simulate_particles
from softdyn.particles.three_models import MODELS, draw, grain_law, measure, scene_of


@pytest.mark.slow
def test_all_three_have_one_spring() -> None:
    """F = k x with the overlap x = 2 delta, whatever the names of their stiffnesses: k, and 2 pi sigma."""
    assert simplify(law_quantities(durian)["C"] - of_bubbles) == 0
    assert str(grain_law().F_ela) == str(durian.F_ela)
    scene = scene_of("Soft Dynamics", 1e-2)
    stiffness = law_quantities(droplet)["C"].subs(sigma, scene.parameters["sigma"])
    assert float(stiffness) == pytest.approx(1.0)


def test_they_start_from_one_packing() -> None:
    scenes = [scene_of(name, 1e-2, count=20) for name in MODELS]
    for other in scenes[1:]:
        np.testing.assert_array_equal(other.positions, scenes[0].positions)


@pytest.mark.slow
def test_their_stresses_and_picture() -> None:
    """At a small strain: films resist a rate more than the drag alone, whose stress the springs of bubbles bear."""
    found = measure(rates=(0.1,), count=20, strain=0.3)
    assert (found.stress > 0).all()
    assert (found.pressure > 0).all()
    bubbles, soft = (tuple(MODELS).index(name) for name in ("bubble model", "Soft Dynamics"))
    assert found.stress[soft, 0] > found.stress[bubbles, 0]
    assert len(draw(found).axes) >= 5
    assert simulate_particles(scene_of("bubble model", 0.1, 20, 0.1)).stats["warnings"] == []
