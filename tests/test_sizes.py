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
from softdyn.particles.particle_keys import Hold, ParticleScene, Push
from softdyn.particles.particle_run import simulate_particles
from softdyn.particles.results import ParticleResult


def run(**changes: Any) -> ParticleResult:
    settings: dict[str, Any] = {
        "law": "equal_spheres", "parameters": {"E": 1e6, "eta": 1.0, "nu": 0.5}, "positions": [[0.0, 0.0, 3.0]],
        "radii": 1.0, "drag": 1.0, "until_t": 1.0, "times": 3, **changes,
    }  # fmt: skip
    return simulate_particles(ParticleScene(**settings))


@pytest.mark.slow
def test_one_sphere_that_is_pushed_moves_as_stokes_says() -> None:
    result = run(radii=2.0, push=[Push([0], [1.0, 0.0, 0.0])])
    assert result.x[-1, 0, 0] == pytest.approx(1 / (12 * np.pi), rel=1e-12)
    with pytest.raises(IntegrationError, match="without drag"):
        run(drag=0.0, push=[Push([0], [1.0, 0.0, 0.0])])


@pytest.mark.slow
def test_one_sphere_settles_on_a_wall() -> None:
    result = run(
        wall=[Wall([0.0, 0.0, 0.0], [0.0, 0.0, -1.0])], push=[Push([0], [0.0, 0.0, -1.0])], range=1.0, until_t=100.0
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
        radii=[1.0, small], push=[Push([0], [1.0, 0.0]), Push([1], [-1.0, 0.0])], until_t=1e-3 * h * zeta, rtol=1e-6,
    )  # fmt: skip
    assert 1 / (result.v[-1, 0, 0] - result.v[-1, 1, 0]) == pytest.approx(zeta, rel=4e-3)


@pytest.mark.parametrize("ratio", [2.0, 40.0, 1000.0])
@pytest.mark.parametrize("depth", [1e-4, 1e-2])
def test_two_pressed_spheres_near_contact_are_hertz_whatever_their_ratio(ratio: float, depth: float) -> None:
    """Force and drainage at h << delta: F = (4/3) E* sqrt(R') w^(3/2), dh/dt = -h^3 F/(4 pi eta a^4), a^2 = R' w.

    R' = R1 R2/(R1 + R2), w the deflection of both together, 1/E* = 2 (1 - nu^2)/E. Held at a distance; what follows is
    of order h/delta.
    """
    small = 1 / ratio
    Re, w = small / (1 + small), depth * small
    h = 1e-5 * w
    E, nu = 1.0, 0.3
    F = 4 / 3 * E / (2 * (1 - nu**2)) * Re**0.5 * w**1.5
    rate = h**3 * F / (4 * np.pi * (Re * w) ** 2)
    result = run(
        parameters={"E": E, "eta": 1.0, "nu": nu}, positions=[[0.0, 0.0], [1 + small + h - w, 0.0]], gap=h,
        radii=[1.0, small], hold=[Hold([0, 1], "xy")], until_t=1e-2 * h / rate, rtol=1e-6, drag=0.0,
    )  # fmt: skip
    first, last = result.contacts(0), result.contacts(-1)
    assert first["F"][0] == pytest.approx(F, rel=1e-4)
    assert (first["h"][0] - last["h"][0]) / result.t[-1] == pytest.approx(rate, rel=0.02)


@pytest.mark.parametrize(("law", "parameters"), [
    ("rognon_gay", {"E": 1.0, "eta": 1.0}), ("equal_spheres", {"E": 1.0, "eta": 1.0, "nu": 0.5}),
    ("droplet", {"sigma": 1.0, "eta": 1.0}),
])  # fmt: skip
@pytest.mark.parametrize("other", [1.0, 40.0, None])
def test_a_contact_that_grows_as_wide_as_the_smaller_sphere_ends_the_run(
    law: str, parameters: dict[str, float], other: float | None
) -> None:
    """Pressed ever deeper, against a sphere of another size or a wall (None): told by name, at a deflection below R/2.

    a^2 = 2 R delta of the first and the last law, R near 2 of a wall and a large sphere: at a quarter of the radius.
    """
    wall = other is None
    far = 1.0 + (other or 0.0)
    with pytest.raises(IntegrationError, match=r"no law of contacts holds") as caught:
        run(
            law=law, parameters=parameters, positions=[[0.0, far], [0.0, 0.0]][: 1 if wall else 2], gap=1e-3,
            radii=[1.0, other or 1.0][: 1 if wall else 2], wall=[Wall([0.0, 0.0], [0.0, -1.0])] if wall else [],
            hold=[Hold([0], "xy", velocity=[0.0, -1e-3]), *([] if wall else [Hold([1], "xy")])], until_t=2e3, drag=0.0,
            rtol=1e-3,
        )  # fmt: skip
    R = 2.0 if wall else 2 * far / (1 + 1 / 1.0) / far if other == 1.0 else 2 * (other or 1.0) / (1 + (other or 1.0))
    message = str(caught.value)
    wide = law != "equal_spheres" and R > 1.0
    assert ("flattened over a radius of 1" in message) == wide, message
    assert ("surfaces overlap by 1" in message) == (not wide), message
    partial = caught.value.partial  # type: ignore[attr-defined]
    reached = float(partial.contacts(-1)["delta"][0]) if len(partial) else 0.0
    assert reached < 0.5


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


@pytest.mark.slow
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
