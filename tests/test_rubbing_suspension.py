"""Suspensions that rub, and the laws that they are held against."""

from __future__ import annotations

import numpy as np
import pytest

from softdyn.particles.rubbing_suspension import COEFFICIENTS, Viscosities, draw, known_laws, measure, summary


def test_known_laws_have_their_values() -> None:
    """Those of the papers' formulas, to the digits that are quoted."""
    found = [known_laws(fraction) for fraction in (0.1, 0.3, 0.5, 0.55)]
    np.testing.assert_allclose([of["Boyer"] for of in found], [1.331, 3.313, 31.9, 145], rtol=2e-3)
    np.testing.assert_allclose([of["Zarraga"] for of in found], [1.341, 3.605, 42.8, 192], rtol=2e-3)
    np.testing.assert_allclose([of["Krieger-Dougherty"] for of in found], [1.312, 2.751, 11.4, 23.1], rtol=2e-3)


def test_viscosities_are_told_and_drawn() -> None:
    some = Viscosities((0.3, 0.5), tuple(COEFFICIENTS), np.full((3, 2), 4.0), np.full((3, 2), 0.5))
    lines = list(summary(some))
    assert lines[-1].split() == ["known", "laws", "2.75", "to", "3.6", "11.4", "to", "42.8"]
    assert "4 (0.5)" in lines[2]
    assert len(draw(some).axes[0].lines) >= 3


@pytest.mark.slow
def test_rubbing_makes_a_suspension_more_viscous() -> None:
    """At a fraction of 0.4; with mu = 0.3 no more than a fifth above the envelope of the known laws."""
    found = measure((0.4,), (0.0, 0.3), strain=1.0)
    low, high = min(known_laws(0.4).values()), max(known_laws(0.4).values())
    assert low < found.mean[0, 0] < found.mean[1, 0] < 1.2 * high
