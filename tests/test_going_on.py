"""Own output is own input: runs go on from the end of others, and positions may be any image in a periodic box."""

from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from softdyn import particles

PHYSICS: dict[str, Any] = {
    "law": "rognon_gay",
    "parameters": {"E": 1.0, "eta": 1.0},
    "gap": 0.02,
    "range": 0.5,
    "drag": 1.0,
    "shear_rate": 1e-5,
    "rtol": 1e-3,
}


packed = cache(partial(particles.random_packing, 40, 2, 0.9, (1.0, 1.4), 1))


def run(**changes: Any) -> particles.ParticleResult:
    x, radii, box = packed()
    scene = {"positions": x, "radii": radii, "box": box, "times": 3, "until_t": 1e4, **PHYSICS, **changes}
    return particles.simulate(particles.ParticleScene(**scene))


@pytest.mark.slow
@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    images=st.lists(st.tuples(st.integers(-3, 3), st.integers(-3, 3)), min_size=40, max_size=40),
    turns=st.integers(-3, 3),
    centred=st.booleans(),
)
def test_any_image_of_a_particle_is_that_particle(images: list, turns: int, centred: bool) -> None:
    """Images by the leaning box's own vectors, whole lengths of tilt, and an origin in the middle: forces stay."""
    x, _, box = packed()
    tilt = 0.3 * box[0]
    cell = np.array([[box[0], tilt], [0.0, box[1]]])
    start = x @ (cell / np.diag(cell)[None, :]).T  # the same lattice of fractions in the leaning box
    changes: dict[str, Any] = {"gap": 0.2, "times": [0.0], "until_t": 1.0, "shear_rate": 0.0}
    at_home = run(positions=start, tilt=tilt, **changes)
    moved = start + np.array(images) @ cell.T - (cell.sum(axis=1) / 2 if centred else 0.0)
    elsewhere = run(positions=moved, tilt=tilt + turns * box[0], **changes)
    np.testing.assert_array_equal(elsewhere.x[0], moved)
    here, there = at_home.contacts(0), elsewhere.contacts(0)
    np.testing.assert_array_equal(np.array([here["i"], here["j"]]), np.array([there["i"], there["j"]]))
    np.testing.assert_allclose(there["h"], here["h"], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(there["F"], here["F"], rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(there["n"], here["n"], atol=1e-10)


@pytest.mark.parametrize("by_file", [False, True])
def test_runs_in_sequence_are_one_run(tmp_path: Path, by_file: bool) -> None:
    """Positions, films and tilt are handed on: what differs is what the tolerance allows, and nothing jumps."""
    whole = run(until_t=3e4, times=[0.0, 1e4, 2e4, 3e4])
    parts = [run(times=[0.0, 1e4])]
    for _ in range(2):
        last = parts[-1]
        placed = particles.read_particles(last.save(tmp_path / "last.npz")) if by_file else particles.from_result(last)
        scene = particles.ParticleScene(**placed, **PHYSICS, until_t=1e4, times=[0.0, 1e4])
        parts.append(particles.simulate(scene))
        np.testing.assert_array_equal(parts[-1].x[0], last.x[-1])
        np.testing.assert_array_equal(parts[-1].cell[0], last.cell[-1])
    # displacements are some radii by then, rtol = 1e-3 of a gap at each of some hundred steps
    np.testing.assert_allclose(parts[-1].x[-1], whole.x[-1], atol=2e-3)
    np.testing.assert_allclose(particles.strain(parts[-1])[-1], particles.strain(whole)[-1], rtol=1e-12)
    np.testing.assert_allclose(particles.strain(whole)[-1], 0.3, rtol=1e-9)
    np.testing.assert_allclose(parts[-1].stress[-1], whole.stress[-1], atol=2e-2 * np.abs(whole.stress).max())


@pytest.mark.slow
def test_positions_alone_are_an_input_too() -> None:
    """What has left the box is taken: a whole box of strain leaves an upright lattice."""
    _, _, box = packed()
    result = run(until_t=1e5 * box[0] / box[1])
    assert np.any((result.x[-1] < 0) | (result.x[-1] > box))
    again = run(positions=result.x[-1], times=[0.0, 1.0], until_t=1.0)
    np.testing.assert_array_equal(again.x[0], result.x[-1])
