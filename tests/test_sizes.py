"""Few particles, and particles of very different sizes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softdyn.errors import IntegrationError, SceneError
from softdyn.particles.files import particle_scene_from
from softdyn.particles.geometry import Wall, close_pairs
from softdyn.particles.packing import drawn_radii, random_packing
from softdyn.particles.results import ParticleResult
from softdyn.particles.run import simulate_particles
from softdyn.particles.scene import ParticleScene, Push


def run(**changes: Any) -> ParticleResult:
    settings: dict[str, Any] = {
        "law": "equal_spheres", "parameters": {"E": 1e6, "eta": 1.0, "nu": 0.5}, "positions": [[0.0, 0.0, 3.0]],
        "radii": 1.0, "drag": 1.0, "until": 1.0, "times": 3, **changes,
    }  # fmt: skip
    return simulate_particles(ParticleScene(**settings))


def test_one_sphere_that_is_pushed_moves_as_stokes_says() -> None:
    result = run(radii=2.0, pushes=[Push([0], [1.0, 0.0, 0.0])])
    assert result.x[-1, 0, 0] == pytest.approx(1 / (12 * np.pi), rel=1e-12)
    with pytest.raises(IntegrationError, match="without drag"):
        run(drag=0.0, pushes=[Push([0], [1.0, 0.0, 0.0])])


def test_one_sphere_settles_on_a_wall() -> None:
    result = run(
        walls=[Wall([0.0, 0.0, 0.0], [0.0, 0.0, -1.0])], pushes=[Push([0], [0.0, 0.0, -1.0])], reach=1.0, until=100.0
    )
    assert len(result.contacts(-1)["h"]) == 1
    assert 0 < result.contacts(-1)["h"][0] < 0.1
    assert abs(result.energy["imbalance"]) < 1e-3


@pytest.mark.parametrize("ratio", [2.0, 40.0, 1000.0])
def test_the_friction_of_two_spheres_near_contact_is_the_exact_leading_term_whatever_their_ratio(ratio: float) -> None:
    """6 pi eta Re^2/h, with what follows of order h/Re ln(Re/h) of it."""
    small = 1 / ratio
    Re, h = small / (1 + small), 1e-4 * small
    zeta = 6 * np.pi * Re**2 / h
    result = run(
        parameters={"E": 1e12 * ratio, "eta": 1.0, "nu": 0.5}, positions=[[0.0, 0.0], [1 + small + h, 0.0]],
        radii=[1.0, small], pushes=[Push([0], [1.0, 0.0]), Push([1], [-1.0, 0.0])], until=1e-3 * h * zeta, rtol=1e-6,
    )  # fmt: skip
    assert 1 / (result.v[-1, 0, 0] - result.v[-1, 1, 0]) == pytest.approx(zeta, rel=4e-3)


@given(
    count=st.integers(1, 60), widest=st.floats(0, 4), within=st.floats(0, 0.5), seed=st.integers(0, 99),
    periodic=st.booleans(),
)  # fmt: skip
@settings(max_examples=50, deadline=None)
def test_all_pairs_that_are_close_are_found_once(
    count: int, widest: float, within: float, seed: int, periodic: bool
) -> None:
    rng = np.random.default_rng(seed)
    radii, x, edge = 0.1 * np.exp(-widest * rng.uniform(0, 1, count)), rng.uniform(0, 3, (count, 3)), 3.0
    first, second = close_pairs(x, radii, within, edge if periodic else None)
    assert (first < second).all()
    found = set(zip(first.tolist(), second.tolist(), strict=True))
    assert len(found) == len(first)
    apart = x[:, None] - x[None]
    apart -= edge * np.round(apart / edge) if periodic else 0.0
    near = np.linalg.norm(apart, axis=2) - radii[:, None] - radii[None] < within
    assert {(i, j) for i, j in np.argwhere(near).tolist() if i < j} <= found


def test_small_particles_do_not_look_as_far_as_a_large_one() -> None:
    """One of forty times their radius among ten thousand: some neighbours of each, not all within its diameter."""
    rng = np.random.default_rng(1)
    radii = np.append(np.full(10_000, 0.025), 1.0)
    first, _ = close_pairs(rng.uniform(0, 4, (len(radii), 2)), radii, 0.01)
    assert len(first) < 20 * len(radii)


def test_radii_are_drawn_as_their_distribution_says_and_again_for_the_same_seed() -> None:
    """Within five standard errors."""
    count = 20_000
    radii = drawn_radii({"mean": 3.0, "sigma": 0.5}, count, 7)
    np.testing.assert_array_equal(radii, drawn_radii({"mean": 3.0, "sigma": 0.5}, count, 7))
    assert radii.mean() == pytest.approx(3.0, abs=5 * radii.std() / count**0.5)
    assert np.log(radii).std() == pytest.approx(0.5, rel=5 / (2 * count) ** 0.5)
    table = drawn_radii({"values": [1.0, 2.0], "weights": [1, 3]}, count, 7)
    assert np.mean(table == 2.0) == pytest.approx(0.75, abs=5 * (0.75 * 0.25 / count) ** 0.5)
    assert set(table.tolist()) == {1.0, 2.0}


def test_a_lognormal_packing_is_a_scene() -> None:
    packing = {
        "kind": "random", "count": 400, "dimension": 2, "fraction": 0.8, "radii": {"mean": 1.0, "sigma": 0.5},
        "seed": 2,
    }  # fmt: skip
    scene = particle_scene_from(
        {"law": "equal_spheres", "parameters": {"E": 10.0, "eta": 1.0, "nu": 0.5}, "packing": packing,
         "contacts": {"gap": 0.01, "range": 0.1}, "flow": {"drag": 1.0, "shear_rate": 1e-3}, "until": {"t": 1.0}},
        Path(),
    )  # fmt: skip
    x, radii, box = random_packing(400, 2, 0.8, {"mean": 1.0, "sigma": 0.5}, 2)
    np.testing.assert_array_equal(scene.positions, x)
    assert np.pi * np.sum(radii**2) / np.prod(box) == pytest.approx(0.8, rel=1e-12)
    assert radii.max() > 10 * radii.min()
    simulate_particles(scene)


@pytest.mark.parametrize(
    "radii",
    [
        {"mean": 1.0}, {"mean": -1.0, "sigma": 0.1}, {"mean": 1.0, "sigma": float("nan")},
        {"values": [1.0], "weights": []},
        {"values": [1.0, -1.0], "weights": [1, 1]}, {"values": [1.0], "weights": [0]}, {"mean": "1", "sigma": [1]},
    ],
)  # fmt: skip
def test_what_is_no_distribution_is_refused(radii: dict[str, Any]) -> None:
    with pytest.raises(SceneError, match="a distribution is"):
        drawn_radii(radii, 10, 1)
