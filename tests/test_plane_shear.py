"""Plane shear of dry discs by explicit steps and by contact dynamics."""

from __future__ import annotations

import numpy as np
import pytest

from softdyn.particles.plane_shear import METHODS, Flowing, beside, draw, known_friction, measure, scene_of, summary


def flowing(method: str, I: float, mu: float, phi: float) -> Flowing:  # noqa: E741
    return Flowing(method, I, 0.01 * I, mu, 0.01, phi, 0.001)


def test_rigid_discs_do_not_overlap_at_the_start() -> None:
    scene = scene_of("contact dynamics", 0.01, 30, 1.0)
    x, radii, box = np.array(scene.positions), np.array(scene.radii), np.array(scene.box)
    i, j = np.triu_indices(len(x), 1)
    along = x[j] - x[i]
    along -= box * np.round(along / box)
    assert (np.linalg.norm(along, axis=1) > radii[i] + radii[j]).all()


def test_flows_are_compared_told_and_drawn() -> None:
    """Elastic flows are a line between two inertial numbers, against which the rigid one stands."""
    found = [
        flowing("explicit", 0.1, 0.36, 0.785),
        flowing("explicit", 0.2, 0.46, 0.755),
        flowing("contact dynamics", 0.15, 0.41, 0.77),
        flowing("contact dynamics", 0.3, 0.5, 0.73),
    ]
    ((one, mu, phi),) = beside(found)
    np.testing.assert_allclose([one.I, mu, phi], [0.15, 0.41, 0.77])
    lines = list(summary(found))
    assert lines[-1].split()[-4:] == ["mu", "1.000,", "phi", "1.0000"]
    assert len(list(summary(found[2:]))) == 4  # of one method alone, there is nothing beside it
    figure = draw(found)
    assert len(figure.axes) == 2
    assert len(figure.axes[0].containers) == len(METHODS)


@pytest.mark.slow
def test_both_methods_have_one_flow_curve() -> None:
    """At I about 0.15, 60 discs: within the errors of the means, and of da Cruz' line within a tenth.

    That line ends at I = 0.2.
    """
    strains = {"explicit": 8.0, "contact dynamics": 1.7}
    found = measure((0.765, 0.785), (0.15,), dict.fromkeys(METHODS, 60), strains)
    ((rigid, mu, phi),) = beside(found)
    errors = max(one.mu_error for one in found) + rigid.mu_error
    assert rigid.mu == pytest.approx(mu, abs=0.02 + 2 * errors)
    assert rigid.phi == pytest.approx(phi, abs=0.015)
    for one in found:
        assert one.I <= 0.2
        assert one.mu == pytest.approx(known_friction(one.I), rel=0.1, abs=2 * one.mu_error)
