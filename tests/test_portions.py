"""Work on contacts that threads share: the same to the bit, however many there are."""

from __future__ import annotations

import numpy as np
import pytest

from softdyn.particles import ParticleScene, portions, simulate
from softdyn.particles.packing import Packing
from softdyn.particles.portions import gathering


@pytest.mark.slow
@pytest.mark.parametrize("tangential", [False, True])
def test_no_digit_depends_on_how_many_threads_there_are(tangential: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Portions of few contacts, so that there is work for all; and of all contacts, from which rounding differs."""
    scene = ParticleScene(
        "steric", {"E": 1.0, "eta": 1.0, "nu": 0.5, "Pi0": 0.01, "L": 0.02},
        packing=Packing("random", 40, 3, 0.45, radii=[1.0, 1.2], seed=1), gap=0.02, range=0.3, drag=1.0,
        tangential=tangential, shear_rate=1e-3, until_t=2.0, times=2, rtol=1e-5,
    )  # fmt: skip
    whole = simulate(scene)
    monkeypatch.setattr(portions, "PORTION", 16)
    runs = []
    for threads in (1, 3):
        monkeypatch.setattr(portions, "processors", lambda threads=threads: threads)
        runs.append(simulate(scene))
    one, three = runs
    assert len(one.contacts(-1)["h"]) > 5 * 16
    for name, values in one.arrays.items():
        assert np.array_equal(values, three.arrays[name], equal_nan=values.dtype.kind == "f"), name
    assert one.energy == three.energy
    assert one.x[-1] == pytest.approx(whole.x[-1], abs=1e-9)


def test_sums_over_contacts_are_those_of_a_loop() -> None:
    """Of whole numbers, which are added without rounding; walls, beyond the particles, are left out."""
    draw = np.random.default_rng(1)
    ends, values = draw.integers(0, 12, 100), draw.integers(-9, 9, (100, 3)).astype(float)
    expected = np.zeros((10, 3))
    for end, value in zip(ends, values, strict=True):
        if end < 10:
            expected[end] += value
    assert np.array_equal(gathering(ends, 10) @ values, expected)
    assert gathering(ends[:0], 10).shape == (10, 0)
