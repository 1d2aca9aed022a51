"""What is measured on a run, against what it is by definition."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from softdyn.particles.geometry import Wall
from softdyn.particles.observables import (
    coordination,
    fabric,
    force_distribution,
    gap_distribution,
    mean_square_displacement,
    normal_stress_differences,
    pressure,
    rattlers,
    relative_viscosity,
    strain,
    wall_forces,
)
from softdyn.particles.particle_keys import ParticleScene, Push
from softdyn.particles.particle_run import simulate_particles
from softdyn.particles.results import ParticleResult

Array = NDArray[np.float64]


def result_of(contacts: list[tuple[int, int, float]], count: int, d: int = 2, **arrays: Any) -> ParticleResult:
    """One frame with contacts i, j, F, in a periodic box of edge 10, at rest."""
    content: dict[str, Any] = {
        "t": np.zeros(1),
        "x": np.zeros((1, count, d)),
        "box": np.full(d, 10.0),
        "cell": 10 * np.eye(d)[None],
        "gradient": np.zeros((1, d, d)),
        "stress": np.zeros((1, d, d)),
        "radii": np.ones(count),
        "contact_start": np.array([0, len(contacts)]),
        "contact_i": np.array([i for i, _, _ in contacts], dtype=np.int64),
        "contact_j": np.array([j for _, j, _ in contacts], dtype=np.int64),
        "contact_F": np.array([F for _, _, F in contacts], dtype=float),
        "contact_h": np.full(len(contacts), 0.1),
        "contact_delta": np.zeros(len(contacts)),
        "contact_n": np.tile(np.eye(d)[0], (len(contacts), 1)),
        **arrays,
    }
    return ParticleResult("", "", {"eta": 2.0}, content, {}, {})


def transmitted(result: ParticleResult, axis: int, planes: int) -> tuple[Array, float]:
    """Mean force on an area of planes normal to an axis, by what is in front of them on what is behind, at the end.

    Contacts are cut by planes evenly spaced over the period. Also how far off the mean may be: each contact may be cut
    by one plane more or fewer than its share.
    """
    contacts, cell = result.contacts(-1), result.cell[-1]
    i, j, n = contacts["i"], contacts["j"], contacts["n"]
    r = result.radii[i] + result.radii[j] + contacts["h"] - 2 * contacts["delta"]
    spacing = cell[axis, axis] / planes
    start = result.x[-1][i, axis]
    ends = np.sort([start, start + r * n[:, axis]], axis=0) / spacing
    cuts = np.floor(ends[1]) - np.floor(ends[0])
    # on the particle behind: the first, if the second is in front
    force = -(contacts["F"][:, None] * n + contacts.get("T", np.zeros_like(n))) * np.sign(n[:, axis])[:, None]
    area = abs(np.linalg.det(cell)) / cell[axis, axis] * (float(result.depth) if len(cell) == 2 else 1.0)
    return cuts @ force / (planes * area), float(np.abs(force).max(axis=1).sum() / (planes * area))


@pytest.mark.parametrize("tangential", [False, True])
@pytest.mark.parametrize("d", [2, 3])
def test_the_stress_is_the_force_that_planes_transmit(d: int, tangential: bool) -> None:
    """On each unit of area, averaged over planes; of a box that leans, and one whose volume has changed."""
    n = 4
    place = 1.98 * np.array([np.array(at) + 0.5 for at in np.ndindex(*(n,) * d)])
    shear: dict[str, Any] = {"stress": {"pressure": 0.02, "xy": 1e-3}} if d == 2 else {"shear_rate": 1e-3}
    result = simulate_particles(
        ParticleScene(
            law="equal_spheres" if tangential else "rognon_gay",
            parameters={"E": 1.0, "eta": 1.0, **({"nu": 0.5} if tangential else {})},
            positions=place + 0.05 * np.random.default_rng(1).uniform(-1, 1, place.shape),
            radii=1.0,
            box=[1.98 * n] * d,
            gap=0.05,
            range=0.4,
            tangential=tangential,
            drag=1.0,
            until_t=100.0,
            times=3,
            rtol=1e-3,
            **shear,
        )
    )
    assert strain(result)[-1] != 0
    for axis in range(d):
        found, off = transmitted(result, axis, 20_000)
        np.testing.assert_allclose(found, result.stress[-1][:, axis], rtol=0, atol=off)
        assert off < 1e-2 * np.abs(result.stress[-1]).max()
    assert pressure(result)[-1] == pytest.approx(-np.trace(result.stress[-1]) / d)


def test_a_pressed_contact_along_the_flow_is_under_pressure_and_lowers_the_first_normal_stress_difference() -> None:
    stress = np.diag([-3.0, 0.0, 0.0])[None]
    result = result_of([(0, 1, 1.0)], 2, 3, stress=stress)
    assert pressure(result).tolist() == [1.0]
    first, second = normal_stress_differences(result)
    assert (first.tolist(), second.tolist()) == ([-3.0], [0.0])
    first, second = normal_stress_differences(result_of([], 2, 3, stress=np.diag([1.0, 3.0, 10.0])[None]))
    assert (first.tolist(), second.tolist()) == ([-2.0], [-7.0])
    first, second = normal_stress_differences(result_of([], 2, 2, stress=np.diag([1.0, 3.0])[None]))
    assert (first.tolist(), second.tolist()) == ([-2.0], [0.0])
    with pytest.raises(ValueError, match="two dimensions"):
        normal_stress_differences(result_of([], 2, 1))


def test_a_relative_viscosity_is_that_of_the_dissipation() -> None:
    """The symmetric part of the stress works; whatever the sense of the shear. Without a fluid there is none."""
    stress = np.array([[[0.0, -3.0], [-5.0, 0.0]]])
    gradient = np.array([[[0.0, -0.5], [0.0, 0.0]]])
    result = result_of([], 2, stress=stress, gradient=gradient)
    power = float(np.sum(stress[0] * (gradient[0] + gradient[0].T) / 2))
    assert relative_viscosity(result)[0] == pytest.approx(1 + power / (2.0 * 0.5**2)) == 5.0
    for faulty in (
        result_of([], 2),
        result_of([], 2, gradient=gradient, box=np.array([10.0, np.inf])),
        ParticleResult("", "", {"E": 1.0}, result.arrays, {}, {}),
    ):
        with pytest.raises(ValueError, match="a relative viscosity needs"):
            relative_viscosity(faulty)


#: Four that hold each other, one that hangs on two of them, one that hangs on that, one that is pulled; a loose one.
HELD = [(i, j, 1.0) for i in range(4) for j in range(i)]
NETWORK = [*HELD, (0, 4, 1.0), (1, 4, 1.0), (4, 5, 1.0), (3, 6, -1.0)]


@pytest.mark.slow
def test_walls_bear_what_particles_are_pushed_with() -> None:
    """Two on top of each other, without drag: their weights on the floor; of walls that shear, opposite forces."""
    floor, lid = Wall([0.0, -1.02], [0.0, -1.0], velocity=[1e-3, 0.0]), Wall([0.0, 3.04], [0.0, 1.0])
    changes: dict[str, Any] = {"radii": 1.0, "range": 0.5, "until_t": 50.0, "times": 3, "rtol": 1e-5}
    law: dict[str, Any] = {"law": "equal_spheres", "parameters": {"E": 1.0, "eta": 1.0, "nu": 0.5}, "tangential": True}
    pushes = [Push("all", [0.0, -0.01])]
    scene = ParticleScene(positions=[[0.0, 0.0], [0.0, 2.02]], wall=[floor, lid], push=pushes, **law | changes)
    result = simulate_particles(scene)
    forces = wall_forces(result)
    assert forces.shape == (3, 2, 2)
    largest = np.abs(forces).max()
    np.testing.assert_allclose(forces.sum(axis=1), [[0.0, -0.02]] * 3, atol=1e-7 * largest)
    # the floor is dragged along by nothing, and drags: what it does to the particles goes on to the lid
    assert np.all(forces[1:, 0, 0] < -1e-4 * largest)
    assert np.all(forces[:, 0, 1] < 0)


def test_particles_that_nothing_holds_are_rattlers() -> None:
    """In the plane three pressed contacts hold; with one that lets go, others do. In space nothing of that is held."""
    assert rattlers(result_of(NETWORK, 8)).nonzero()[0].tolist() == [4, 5, 6, 7]
    assert rattlers(result_of(NETWORK, 8, 3)).all()
    # tangential forces hold where two are in touch
    frictional = result_of(NETWORK, 8, contact_T=np.zeros((len(NETWORK), 2)))
    assert rattlers(frictional).nonzero()[0].tolist() == [5, 6, 7]
    # a wall holds, too, and is no rattler itself
    triangle = [(0, 1, 1.0), (0, 2, 1.0), (1, 2, 1.0)]
    assert rattlers(result_of(triangle, 3)).all()
    assert not rattlers(result_of([*triangle, (0, 3, 1.0), (1, 4, 1.0), (2, 4, 1.0)], 3)).any()


def test_coordination_counts_both_ends_of_what_is_pressed() -> None:
    assert coordination(result_of(NETWORK, 8)).tolist() == [2 * 9 / 8]
    assert coordination(result_of(NETWORK, 8), without_rattlers=True).tolist() == [3.0]
    assert np.isnan(coordination(result_of(NETWORK, 8, 3), without_rattlers=True)).all()
    # walls from N on count once
    assert coordination(result_of([(0, 1, 1.0), (0, 2, 1.0), (1, 3, -1.0)], 2)).tolist() == [1.5]
    assert coordination(result_of([], 2)).tolist() == [0.0]


def test_the_fabric_of_contacts_all_around_is_isotropic_and_of_those_that_shear_presses_is_not() -> None:
    angles = np.linspace(0, np.pi, 7)[:-1]
    around = np.column_stack([np.cos(angles), np.sin(angles)])
    pressed = [(0, 1, 1.0)] * 6
    np.testing.assert_allclose(fabric(result_of(pressed, 2, contact_n=around))[0], np.eye(2) / 2, atol=1e-15)
    # what shear pulls is no part of it, and what it presses leans against the flow
    sheared = [(0, 1, -x * y) for x, y in around]
    tensor = fabric(result_of(sheared, 2, contact_n=around))[0]
    assert np.trace(tensor) == pytest.approx(1.0)
    assert tensor[0, 1] == tensor[1, 0] == pytest.approx(-np.sqrt(3) / 4)
    assert np.isnan(fabric(result_of([], 2))).all()


def test_a_distribution_of_forces_is_a_density_of_what_pulls_and_pushes() -> None:
    """Forces distributed exponentially on both sides, three times as often pressed: the density that they are drawn of.

    Each edge of a bin moves one force at most from one to the other.
    """
    size = -np.log1p(-(np.arange(4000) + 0.5) / 4000)
    F = np.concatenate([np.repeat(size, 3), -size, np.zeros(50)])
    edges, density = force_distribution(result_of([(0, 1, value) for value in F], 2))
    assert np.min(np.abs(edges)) == 0.0
    width = np.diff(edges)
    assert np.sum(density * width) == pytest.approx(1.0)
    m, share = size.mean(), np.where(edges[:-1] >= 0, 0.75, 0.25)
    expected = share * np.abs(np.diff(np.exp(-m * np.abs(edges)))) / width
    # three forces of one size at each of the two edges
    np.testing.assert_allclose(density, expected, rtol=0, atol=2 * 3 / (16_000 * width.min()))
    assert all(len(array) == 0 for array in force_distribution(result_of([(0, 1, 0.0)], 2)))
    # of one sign, or one value, the other side is no part of it
    for sign in (-1, 1):
        edges, density = force_distribution(result_of([(0, 1, sign * 2.0)] * 3, 2), bins=4)
        assert np.all(sign * edges >= 0)
        assert density[-1 if sign > 0 else 0] > 0
        assert np.sum(density * np.diff(edges)) == pytest.approx(1.0)


def test_a_distribution_of_gaps_is_a_density_of_their_logarithm() -> None:
    """Gaps spread evenly over three decades have the density 1/ln(1000), to one gap in each bin."""
    h = np.geomspace(1e-4, 1e-1, 5000)
    edges, density = gap_distribution(result_of([(0, 1, 1.0)] * 5000, 2, contact_h=h), bins=25)
    assert (edges[0], edges[-1]) == pytest.approx((1e-4, 1e-1), rel=1e-6)
    np.testing.assert_allclose(density, 1 / np.log(1000), rtol=25 / 5000)
    assert np.sum(density * np.diff(np.log(edges))) == pytest.approx(1.0)
    edges, density = gap_distribution(result_of([(0, 1, 1.0)] * 2, 2))
    assert np.sum(density * np.diff(np.log(edges))) == pytest.approx(1.0)
    assert all(len(array) == 0 for array in gap_distribution(result_of([], 2)))


def test_displacements_are_those_that_the_flow_does_not_make() -> None:
    """Of particles that move with a box that shears and shrinks there are none; a drift of all is none, either."""
    draw = np.random.default_rng(1)
    x = draw.uniform(0, 30, (50, 3))  # some are beyond the box: positions are never wrapped
    cells = np.array([[[10, 4, 0], [0, 10, 0], [0, 0, 10]], [[9, -3, 0], [0, 8, 0], [0, 0, 12]]], dtype=float)
    flow = cells[1] @ np.linalg.inv(cells[0])
    moved = draw.normal(size=x.shape)
    moved -= moved.mean(axis=0)
    arrays = {"t": np.arange(2.0), "cell": cells, "x": np.array([x, x @ flow.T + moved + [3.0, 0.0, 1.0]])}
    squares = mean_square_displacement(result_of([], 50, 3, **arrays))
    np.testing.assert_allclose(squares, [np.zeros(3), np.mean(moved**2, axis=0)], atol=1e-12)
    with pytest.raises(ValueError, match="periodic"):
        mean_square_displacement(result_of([], 50, 3, **arrays, box=np.array([10.0, 10.0, np.inf])))
