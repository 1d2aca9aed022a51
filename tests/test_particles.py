"""Many particles, against the pair engine, the route by velocities, and what must be conserved."""

from __future__ import annotations

import itertools
import math
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from by_velocities import simulate_by_velocities
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.sparse import bsr_array, diags_array

import softdyn
from softdyn.derive.laws.dlvo import law as dlvo
from softdyn.errors import IntegrationError, SceneError
from softdyn.particles import linear
from softdyn.particles import step_times as bench
from softdyn.particles.contact_kernels import energies
from softdyn.particles.force_balance import Newton, StageInput, balance, contact_forces
from softdyn.particles.geometry import Wall, directions, lattice
from softdyn.particles.integrate import _shorten
from softdyn.particles.observables import swap_time
from softdyn.particles.particle_keys import Hold, ParticleScene, Push
from softdyn.particles.particle_run import prepare, simulate_particles
from softdyn.particles.particle_scene import check
from softdyn.particles.results import ParticleResult, load_particles
from softdyn.particles.start import start

Array = NDArray[np.float64]
UNIT = {"E": 1.0, "eta": 1.0}


def scene(**changes: Any) -> ParticleScene:
    """Two equal particles pushed together, unless changed."""
    two: dict[str, Any] = {
        "law": "rognon_gay",
        "parameters": UNIT,
        "positions": [[0.0, 0.0], [2.1, 0.0]],
        "radii": 1.0,
        "gap": 0.1,
        "until_t": 1e4,
        "push": [Push([0], [1e-2, 0]), Push([1], [-1e-2, 0])],
        "times": 5,
        "rtol": 1e-5,
    }
    return ParticleScene(**{**two, **changes})


def rhombus(force: float = 5e-3, gap: float = 0.02, turn: float = 0.0, **changes: Any) -> ParticleScene:
    """Four spheres: two in touch, two beside them that are pushed together until they have taken their place."""
    side = 2 + gap
    half = np.sqrt(side**2 - (side / 2) ** 2)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    positions = np.array([[-half, 0], [half, 0], [0, side / 2], [0, -side / 2]]) @ rotation.T
    push = rotation @ np.array([force, 0.0])
    pushes = [Push([0], list(push)), Push([1], list(-push))]
    settings = {"positions": positions, "gap": 1.01 * gap, "until_t": 5e4, "push": pushes, **changes}
    return scene(**settings)


def gaps(result: ParticleResult) -> Array:
    """Gaps of all pairs at each frame."""
    return result.contact_h.reshape(len(result), -1)


@pytest.mark.slow
@pytest.mark.parametrize("d", [1, 2, 3])
def test_two_particles_are_the_pair(d: int) -> None:
    """To 1e-9: third order at 5e-10 in each of some hundred steps."""
    pad = [0.0] * (d - 1)
    pushes = [Push([0], [1e-2, *pad]), Push([1], [-1e-2, *pad])]
    positions = [[0.0, *pad], [2.1, *pad]]
    result = simulate_particles(scene(positions=positions, push=pushes, until_t=2e3, rtol=5e-10))
    pair = softdyn.simulate(
        law="rognon_gay", parameters={"R": 1.0, **UNIT}, h=0.1, force=1e-2, until_t=2e3, times=5, rtol=1e-12
    )
    np.testing.assert_allclose(gaps(result)[:, 0], pair.h, rtol=1e-9)
    np.testing.assert_allclose(result.contact_delta, pair.delta, rtol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_a_free_pair_in_space_may_lie_along_any_line(seed: int) -> None:
    """Rounding puts particles beside the line through them: that tells nothing of how they are turned."""
    along = np.random.default_rng(seed).standard_normal(3)
    along /= np.linalg.norm(along)
    pushes = [Push([0], list(1e-2 * along)), Push([1], list(-1e-2 * along))]
    aslant = simulate_particles(scene(positions=[[0, 0, 0], 2.1 * along], push=pushes))
    np.testing.assert_allclose(aslant.contact_h, simulate_particles(scene()).contact_h, rtol=1e-7)


@pytest.mark.slow
def test_two_particles_under_a_varying_force_are_the_pair() -> None:
    """The force as an expression of t, with constants, through compression and tension."""
    text, constants = "F0*cos(w*t)", {"F0": 1e-2, "w": 1e-2}
    pushes = [Push([0], [text, 0]), Push([1], [f"-{text}", 0])]
    result = simulate_particles(scene(push=pushes, constants=constants, until_t=600.0, rtol=1e-8))
    pair = softdyn.simulate(
        law="rognon_gay",
        parameters={"R": 1.0, **UNIT},
        h=0.1,
        force=text,
        constants=constants,
        until_t=600.0,
        times=5,
        rtol=1e-11,
    )
    # the law has a kink where the force crosses zero, which costs an order there
    np.testing.assert_allclose(gaps(result)[:, 0], pair.h, rtol=1e-6)


@pytest.mark.slow
def test_three_in_a_line_are_two_pairs() -> None:
    positions = [[0.0], [2.1], [4.2]]
    pushes = [Push([0], [1e-2]), Push([2], [-1e-2])]
    # the outer two are no neighbours of one another
    result = simulate_particles(scene(positions=positions, push=pushes, range=1.0, until_t=2e3, rtol=1e-7))
    pair = softdyn.simulate(
        law="rognon_gay", parameters={"R": 1.0, **UNIT}, h=0.1, force=1e-2, until_t=2e3, times=5, rtol=1e-12
    )
    for contact in range(2):
        np.testing.assert_allclose(gaps(result)[:, contact], pair.h, rtol=1e-6)
    np.testing.assert_allclose(result.x[:, 1], 2.1, atol=1e-9)  # zero mean velocity


@pytest.mark.parametrize(("one", "other"), [(1.0, 2.0), (1.0, 1.0), (0.5, 4.0)])
def test_unequal_spheres_are_a_pair_of_their_effective_radius(one: float, other: float) -> None:
    """The law sees R = 2 R1 R2/(R1 + R2) and E = 2 E1 E2/(E1 + E2), and nothing else of the two."""
    positions = [[0.0], [one + other + 0.1]]
    E = {"soft": 1.0, "hard": 3.0}
    changes = {"positions": positions, "radii": [one, other], "species": ["soft", "hard"], "until_t": 1e3, "rtol": 1e-8}
    pushes = [Push([0], [1e-2]), Push([1], [-1e-2])]
    result = simulate_particles(scene(parameters={"E": E, "eta": 1.0}, push=pushes, **changes))
    effective = {"R": 2 * one * other / (one + other), "E": 1.5, "eta": 1.0}
    pair = softdyn.simulate(law="rognon_gay", parameters=effective, h=0.1, force=1e-2, until_t=1e3, times=5, rtol=1e-12)
    np.testing.assert_allclose(gaps(result)[:, 0], pair.h, rtol=1e-7)
    distance = result.x[:, 1, 0] - result.x[:, 0, 0]
    np.testing.assert_allclose(distance, one + other + pair.h - 2 * pair.delta, rtol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("rigid", [True, False])
def test_a_wall_is_a_sphere_of_infinite_radius(rigid: bool) -> None:
    """R = 2 R1; a rigid wall doubles E, as it gives in by nothing; X = R1 + h - 2 delta."""
    wall = Wall(np.array([0.0, -1.1]), np.array([0.0, -2.0]), rigid=rigid)
    changes = {"positions": [[0.0, 0.0], [30.0, 5.0]], "wall": [wall], "range": 4.0, "drag": 1e-9, "until_t": 1e3}
    result = simulate_particles(scene(push=[Push([0], [0, -1e-2])], rtol=1e-8, **changes))
    effective = {"R": 2.0, "E": 2.0 if rigid else 1.0, "eta": 1.0}
    pair = softdyn.simulate(law="rognon_gay", parameters=effective, h=0.1, force=1e-2, until_t=1e3, times=5, rtol=1e-12)
    # the drag resists by 1e-9 of Stokes': some 1e-8 of the friction in the film
    np.testing.assert_allclose(gaps(result)[1:, 0], pair.h[1:], rtol=1e-6)
    np.testing.assert_allclose(result.x[1:, 0, 1] + 1.1, (1 + pair.h - 2 * pair.delta)[1:], rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("drag", [0.0, 1.0])
def test_both_routes_agree_through_the_swap_at_third_order(drag: float) -> None:
    """The error falls with the tolerance of a step, and as the third power of the number of steps at least as 2.5."""
    times = [0.0, 1e4, 3e4, 5e4]
    _, expected = simulate_by_velocities(rhombus(drag=drag), times, rtol=1e-10)
    errors, steps = [], []
    for rtol in (1e-5, 1e-6, 1e-7):
        result = simulate_particles(rhombus(drag=drag, times=times, rtol=rtol))
        errors.append(float(np.abs(gaps(result) / expected - 1).max()))
        steps.append(result.stats["steps"])
        # the sum of errors of order rtol over the steps, of which only the last few matter as gaps close
        assert errors[-1] < 50 * rtol
    order = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order > 2.5
    # it is a swap: the pair in touch has gone, the other has come close
    assert expected[0, 5] < 0.1 < 0.5 < expected[-1, 5]
    assert expected[-1, 0] < 0.75 * expected[0, 0]


@pytest.mark.parametrize("drag", [0.0, 1.0])
def test_forces_balance_at_the_end_of_every_step(drag: float) -> None:
    result = simulate_particles(rhombus(drag=drag, rtol=1e-4))
    assert len(result.step_t) == result.stats["steps"] > 10
    assert np.all(result.step_residual <= 1e-7)
    assert result.step_t[-1] == 5e4


@pytest.mark.slow
@pytest.mark.parametrize("drag", [0.0, 1.0])
def test_energy_is_accounted_for(drag: float) -> None:
    """Every term of the balance is there, and what is left falls with the tolerance."""
    left = []
    for rtol in (1e-3, 1e-6):
        energy = simulate_particles(rhombus(drag=drag, rtol=rtol)).energy
        left.append(abs(energy["imbalance"]))
        assert left[-1] < rtol * 5
    assert energy["external"] > 0
    assert energy["gaps"] > 0
    assert energy["U_h"] != 0  # this law is not conservative
    assert (energy["drag"] > 0) == (drag > 0)


def test_the_elastic_energy_is_the_integral_of_the_force() -> None:
    """U = 2 integral of F d(delta), by finite differences: dU/d(delta) = 2 F; and U_h at fixed delta."""
    system = prepare(scene())
    draw = np.random.default_rng(1)
    h, delta = 10 ** draw.uniform(-4, 0, 200), 10 ** draw.uniform(-4, -0.5, 200) * draw.choice([1, -1], 200)
    none = np.empty(0)

    def U(h: Array, delta: Array) -> Array:
        return energies(system.kernel, math.inf, 2 * delta - h, h, system.p, none)[0]

    step = 1e-4
    force = (U(h, delta * (1 + step)) - U(h, delta * (1 - step))) / (2 * step * delta)
    a = np.sqrt(2 * (h / (1 + h) + np.abs(delta)))
    np.testing.assert_allclose(force, 2 * 4 / 9 * a * delta, rtol=1e-6)
    slope = (U(h * (1 + step), delta) - U(h * (1 - step), delta)) / (2 * step * h)
    np.testing.assert_allclose(energies(system.kernel, math.inf, 2 * delta - h, h, system.p, none)[1], slope, rtol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("law", ["rognon_gay", "equal_spheres"])
def test_without_drag_pairs_beyond_their_range_may_be_near(law: str) -> None:
    """The two that are pushed towards one another are listed from the start, as they are just out of range."""
    positions = [[0, 0], [2.02, 0], [1.01, 1.755], [1.01, -1.755]]
    pushes = [Push([2], [0, -1e-3]), Push([3], [0, 1e-3])]
    changes = {"positions": positions, "push": pushes, "gap": 0.03, "until_t": 100.0, "law": law}
    if law == "equal_spheres":
        changes |= {"parameters": {**UNIT, "nu": 0.5}, "tangential": True}
    near = simulate_particles(scene(range=1.25, **changes))
    far = simulate_particles(scene(range=1.0, **changes))
    assert len(near.contacts(0)["i"]) == len(far.contacts(0)["i"]) == 5
    # the weight of the film starts to fall at half the range, far from the gaps of all five
    np.testing.assert_allclose(near.contact_h, far.contact_h, rtol=1e-9)
    assert abs(near.energy["imbalance"]) < 1e-4


def test_internal_forces_and_torques_sum_to_zero() -> None:
    system = prepare(rhombus())
    state = start(system, Newton())
    n, r = directions(state.contacts, state.x, lattice(system.box, 0.0), ())
    F = np.random.default_rng(0).standard_normal(len(r))
    total = contact_forces(state.contacts, F, n, 4)
    rounding = 20 * np.finfo(float).eps * np.abs(F).sum()
    assert np.abs(total.sum(axis=0)).max() < rounding
    assert abs(np.sum(state.x[:, 0] * total[:, 1] - state.x[:, 1] * total[:, 0])) < 4 * rounding


@pytest.mark.slow
@pytest.mark.parametrize("drag", [0.0, 1.0])
def test_nothing_depends_on_place_direction_or_numbering(drag: float) -> None:
    """Same gaps after a translation, a rotation, another numbering: to the tolerance of Newton's iteration."""
    changes = {"drag": drag, "until_t": 2e4, "rtol": 1e-6}
    plain = simulate_particles(rhombus(**changes))
    moved = simulate_particles(rhombus(positions=np.array(rhombus().positions) + np.array([5.0, -3.0]), **changes))
    turned = simulate_particles(rhombus(turn=0.7, **changes))
    for other in (moved, turned):
        np.testing.assert_allclose(gaps(other), gaps(plain), rtol=1e-5)
    order = [2, 0, 3, 1]
    pushes = [Push([1], [5e-3, 0]), Push([3], [-5e-3, 0])]
    renumbered = simulate_particles(
        rhombus(positions=np.array(rhombus().positions)[order], **{**changes, "push": pushes})
    )
    np.testing.assert_allclose(np.sort(gaps(renumbered)), np.sort(gaps(plain)), rtol=1e-5)
    again = simulate_particles(rhombus(**changes))
    assert np.array_equal(again.x, plain.x)


def test_a_flow_seen_from_another_height_is_the_same_flow() -> None:
    """Galilean invariance: shifted along y, everything is carried along x by a uniform velocity."""
    changes: dict[str, Any] = {
        "drag": 1.0,
        "shear_rate": 1e-3,
        "until_t": 500.0,
        "push": (),
        "range": 1.0,
        "rtol": 1e-5,
    }
    positions = np.array([[0.0, 0.0], [2.05, 0.8], [4.0, -0.3]])
    plain = simulate_particles(scene(positions=positions, **changes))
    moved = simulate_particles(scene(positions=positions + np.array([0.0, 7.0]), **changes))
    np.testing.assert_allclose(gaps(moved), gaps(plain), rtol=1e-6)
    carried = plain.x + np.array([0.0, 7.0]) + np.array([7e-3, 0.0]) * plain.t[:, None, None]
    np.testing.assert_allclose(moved.x, carried, atol=1e-6)


def hexagons(rows: int = 6, compression: float = 0.9, **changes: Any) -> ParticleScene:
    """A periodic, disturbed packing of pressed particles."""
    spacing = 2 * compression
    place = np.array([[i + 0.5 * (j % 2), j * np.sqrt(3) / 2] for j in range(rows) for i in range(rows)]) * spacing
    box = np.array([rows * spacing, rows * spacing * np.sqrt(3) / 2])
    draw = np.random.default_rng(2)
    radii = 1 + 0.05 * draw.uniform(-1, 1, len(place))
    settings = {
        "positions": np.mod(place + 0.05 * draw.uniform(-1, 1, place.shape), box),
        "radii": radii,
        "box": list(box),
        "range": 0.4,
        "gap": 0.05,
        "push": (),
        "until_t": 100.0,
        "times": 3,
        "rtol": 1e-4,
        **changes,
    }
    return scene(**settings)


def test_at_frozen_gaps_positions_minimise_the_elastic_energy() -> None:
    """Without drag, against scipy's minimisation of the sum of U(h, delta) over the same contacts."""
    problem = hexagons()
    system = prepare(problem)
    state = start(system, Newton())
    contacts, cell = state.contacts, lattice(system.box, 0.0)

    def energy(flat: Array) -> tuple[float, Array]:
        x = flat.reshape(-1, 2)
        n, r = directions(contacts, x, cell, ())
        delta = (contacts.S - r + contacts.h) / 2
        radius = contacts.q[0]
        a = np.sqrt(2 * radius * (radius * contacts.h / (radius + contacts.h) + np.abs(delta)))
        U, _ = energies(system.kernel, system.reach, contacts.S - r, contacts.h, system.p, contacts.q.reshape(-1))
        return float(U.sum()), contact_forces(contacts, 4 / 9 * a * delta, n, len(x)).reshape(-1)

    found = minimize(energy, system.x.reshape(-1), jac=True, method="BFGS", options={"gtol": 1e-10})
    assert np.abs(energy(state.x.reshape(-1))[1]).max() < 1e-8
    assert energy(state.x.reshape(-1))[0] == pytest.approx(found.fun, rel=1e-9)
    difference = state.x.reshape(-1) - found.x
    difference = difference.reshape(-1, 2) - difference.reshape(-1, 2).mean(axis=0)
    assert np.abs(difference).max() < 1e-5


@pytest.mark.parametrize("drag", [0.0, 1.0])
def test_a_sheared_periodic_packing_keeps_its_balances(drag: float) -> None:
    result = simulate_particles(hexagons(shear_rate=1e-4, until_t=1000.0, drag=drag, rtol=1e-4))
    assert abs(result.energy["imbalance"]) < 1e-3
    assert result.energy["box"] > 0
    assert np.all(result.contact_h > 0)
    assert np.all(result.step_residual <= 1e-7)
    np.testing.assert_allclose(result.stress, result.stress.transpose(0, 2, 1), atol=1e-15)
    # the work done by the moving box is the shear stress times the strain, as far as frames resolve it
    strain = result.t * 1e-4
    volume = float(np.prod(result.box) * result.depth)
    fine = simulate_particles(hexagons(shear_rate=1e-4, until_t=1000.0, drag=drag, rtol=1e-4, times=201))
    work = volume * np.trapezoid(fine.stress[:, 0, 1], fine.t * 1e-4)
    assert strain[-1] == pytest.approx(0.1)
    assert fine.energy["box"] == pytest.approx(work, rel=2e-2)


def test_contacts_come_and_go_without_a_jump_in_force() -> None:
    """A particle driven past another, into its range and out of it: the force starts from zero and ends at zero."""
    positions = [[-4.0, 0.0], [0.0, 2.1]]
    holds = [Hold([0], "xy", [1e-4, 0.0]), Hold([1], "xy")]
    times = np.linspace(0, 80000, 401)
    result = simulate_particles(
        scene(positions=positions, hold=holds, push=(), gap=None, range=0.5, until_t=80000.0, times=list(times))
    )
    assert result.stats["made"] == 1
    assert result.stats["dropped"] == 1
    force = np.zeros(len(result))
    for k in range(len(result)):
        F = result.contacts(k)["F"]
        force[k] = F[0] if len(F) else 0.0
    inside = np.flatnonzero(force)
    assert 20 < len(inside) < 380
    # continuous at both ends: the first and last values are far below the largest, and so are all jumps
    largest = np.abs(force).max()
    assert max(abs(force[inside[0]]), abs(force[inside[-1]])) < 0.02 * largest
    assert force.max() > 0 > force.min()  # pressed on the way in, pulled on the way out
    assert result.energy["external"] > 0
    assert abs(result.energy["imbalance"]) < 1e-3


def test_a_wall_does_not_move_along_with_all_particles() -> None:
    """Two that fall on it side by side, from beyond its range: they stop there."""
    falling = simulate_particles(
        scene(
            positions=[[0.0, 3.0], [5.0, 3.0]],
            wall=[Wall(np.zeros(2), np.array([0.0, -1.0]))],
            push=[Push([0, 1], [0.0, -0.1])],
            gap=None,
            range=0.4,
            drag=1.0,
            until_t=1000.0,
        )
    )
    assert falling.stats["made"] == 2
    assert np.all(falling.contacts(-1)["h"] > 0)
    # it carries what the drag does not
    np.testing.assert_allclose(falling.contacts(-1)["F"], 0.1 + 6 * np.pi * falling.v[-1, :, 1], rtol=1e-6)


def test_a_ring_of_four_in_a_line_is_pressed_as_one_pair() -> None:
    """A periodic box of one dimension, which starts pressed: all gaps stay alike, each under the force F."""
    settings: dict[str, Any] = {"positions": [[0.5], [2.5], [4.5], [6.5]], "box": [8.0], "gap": 0.1, "push": ()}
    ring = simulate_particles(scene(**settings, range=0.4, until_t=100.0))
    assert len(ring.contacts(-1)["h"]) == 4
    held = [Hold([0, 1], "xy")]
    pair = simulate_particles(scene(positions=[[0.0, 0.0], [2.0, 0.0]], hold=held, push=(), until_t=100.0, range=0.4))
    for name in ("h", "F"):
        np.testing.assert_allclose(ring.contacts(-1)[name], pair.contacts(-1)[name][0], rtol=1e-6)


def test_what_is_held_stays_where_it_is_given_however_bad_the_guess() -> None:
    """At a guess that is no number there are no forces: what may move comes back from it, and nothing else."""
    system = prepare(scene(hold=[Hold([0], "xy", [1e-3, 0.0])], push=(), gap=None, drag=1.0))
    contacts = start(system, Newton()).contacts
    s, x_star = 1.0, system.x
    guess = x_star + s * system.velocity(s)
    given = guess[0].copy()
    guess[1] = np.nan
    nothing = np.zeros(len(contacts))
    found = balance(system, contacts, Newton(), StageInput(s, s, x_star, nothing), guess, nothing.copy())
    assert found.residual <= system.force_tolerance
    np.testing.assert_array_equal(found.x[0], given)


def test_pairs_beyond_the_range_have_no_part_in_the_first_equilibrium() -> None:
    """A disturbed crystal, whose second neighbours are listed but out of range: their gaps follow the centres."""
    cell = np.array([[0, 0, 0], [1, 1, 0], [1, 0, 1], [0, 1, 1]]) * 1.9 / np.sqrt(2)
    place = np.concatenate([cell + np.array(k) * 1.9 * np.sqrt(2) for k in np.ndindex(3, 3, 3)])
    length = 3 * 1.9 * np.sqrt(2)
    x = np.mod(place + 0.05 * np.random.default_rng(2).uniform(-1, 1, place.shape), length)
    settings: dict[str, Any] = {"positions": x, "box": [length] * 3, "range": 0.4, "gap": 0.05, "push": ()}
    result = simulate_particles(scene(**settings, until_t=300.0, rtol=1e-4))
    assert abs(result.energy["imbalance"]) < 1e-3


def test_forces_that_start_from_none_are_found() -> None:
    """A wall that comes from rest towards particles far away: at first all forces are far below rounding of others."""
    wall = Wall(np.zeros(2), np.array([0.0, -1.0]), velocity=[0.0, "1e-4*t"])
    result = simulate_particles(
        scene(positions=[[0.0, 1.5], [4.0, 1.5]], wall=[wall], push=(), gap=None, drag=1.0, until_t=10.0)
    )
    assert result.stats["rejected"] == 0
    assert np.all(result.v[-1, :, 1] > 0)


def test_a_step_that_no_length_makes_good_names_what_changes_fastest() -> None:
    system = prepare(scene())
    state = start(system, Newton())
    state.y_rate = np.array([3.0])
    with pytest.raises(IntegrationError, match="rtol=1e-05 cannot be met; the contact of particles 0 and 1 changes"):
        _shorten(system, state, 1e4, dt=1e-13, error=5.0, failure=None)
    state.v[1] = 4.0
    with pytest.raises(IntegrationError, match="particle 1 moves fastest"):
        _shorten(system, state, 1e4, dt=1e-13, error=5.0, failure=None)


def test_the_result_is_read_back(tmp_path: Any) -> None:
    result = simulate_particles(scene(until_t=10.0))
    again = load_particles(result.save(tmp_path / "two.npz"))
    assert dict(again.energy) == result.energy
    for name in result.arrays:
        assert np.array_equal(again.arrays[name], result.arrays[name]), name
    with pytest.raises(SceneError, match="npz"):
        result.save(tmp_path / "two.txt")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"push": [Push([0], [1e-2, 0])]}, "sum to 0.01"),
        ({"push": [Push([0], [0, 1e-2]), Push([1], [0, -1e-2])]}, "torque"),
        ({"positions": [[0, 0], [2.1, 0], [9, 9]], "range": 1.0}, "particle 2, without any contact"),
        (
            {"positions": [[0, 0], [2.1, 0], [9, 9], [9, 11.1]], "range": 1.0},
            "cluster of particles 0, 1 is connected to no other",
        ),
        # a chain of three can buckle sideways
        (
            {
                "positions": [[0, 0], [2.1, 0], [4.2, 0]],
                "range": 1.0,
                "push": [Push([0], [1e-2, 0]), Push([2], [-1e-2, 0])],
            },
            "particles? .*1.* can give way",
        ),
    ],
)
def test_what_nothing_resists_is_named(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(IntegrationError, match=words) as error:
        simulate_particles(scene(**changes))
    assert "drag" in str(error.value)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"positions": [[0, 0], [0.9, 0]]}, "particle 0 and particle 1 overlap by 1.1, more than the radius 1"),
        ({"positions": [[0, 0], [1.9, 0]], "gap": None}, "particles 0 and 1: give the initial gap"),
        (
            {"positions": [[1, 1], [3e7, 1]], "box": [20.0, 20.0], "range": 1.0},
            "particle 1 more than 1e.06 lengths outside",
        ),
        ({"positions": [[1, 1], [3.1, np.nan]]}, "particle 1 are not finite"),
        ({"radii": [1.0, -1.0]}, "unlike that of particle 1: "),
        ({"box": [4.0, 4.0], "range": 1.0, "positions": [[1, 1], [3.1, 1]]}, "too small along x, y"),
        ({"parameters": {"E": {"a": 1.0}, "eta": 1.0}}, "particles have none"),
        ({"parameters": {"E": 1.0}}, "eta is missing"),
        ({"parameters": {**UNIT, "R": 1.0}}, "R follows from the radii"),
        ({"parameters": {"E": -1.0, "eta": 1.0}}, "E must be positive"),
        ({"push": [Push([7], [1, 0])]}, r"no particle \[7\]"),
        ({"push": [Push([0], [1])]}, "needs 2 components"),
        ({"push": [Push([0], ["1/t", 0])]}, "no finite value at t = 0"),
        (
            {"push": [Push("big", [1, 0])]},
            r"\[\[push\]\] 0: there is no species 'big'; particles are named by 'all', or",
        ),
        (
            {"species": ["big", "small"], "hold": [Hold("bog", "x")]},
            r"\[\[hold\]\] 0: there is no species 'bog'; particles are named by 'all', 'big', 'small', or a list",
        ),
        ({"species": ["all", "small"]}, "no species can have the name 'all'"),
        ({"push": Push("all", [1, 0])}, r"push must be a list of Push\(\.\.\.\), not Push"),
        ({"wall": [{"point": [0, -2], "normal": [0, -1]}]}, r"wall must be a list of Wall\(\.\.\.\)"),
        ({"wall": [Wall([0, -2], [0, -1], velocity=1.0)]}, "wall 0: velocity needs 2 components"),
        ({"hold": [Hold([0], None)]}, "axes must be some of 'xy', not None"),
        ({"hold": [Hold([0], "x"), Hold([0], "xy")]}, "particle 0 held twice along x"),
        ({"hold": [Hold([0], "z")]}, "axes must be some of 'xy'"),
        ({"gap": 1.0, "range": 0.5}, "must not exceed half of the range"),
        ({"shear_rate": 1.0}, "here is neither"),
        ({"rtol": 1.0}, "rtol must lie between"),
        ({"until_t": -1.0}, r"\[until\] t must be a positive number"),
        ({"wall": [Wall(np.zeros(2), np.array([1.0, 0.0]))]}, "particles 0, 1 on the wrong side of wall 0"),
        ({"times": [0.0, 2e4]}, "times must increase"),
        ({"constants": {"w": 1.0}}, "does not appear"),
        ({"parameters": None, "box": [9.0, 9.0], "stress": {"xy": 1.0}}, r"\[parameters\] must map names"),
        ({"mixing": ["E"]}, r"\[mixing\] must map names"),
        ({"stress": 5}, r"\[stress\] must map names"),
        ({"constants": ["w"]}, r"\[constants\] must map names"),
        ({"box": 9.0}, "must be a list of numbers"),
        ({"wall": [Wall([0, -0.9], [0, -1])], "gap": None}, "first the contact of particle 0 and wall 0"),
        ({"positions": np.random.default_rng(0).uniform(0, 500, (65, 2))}, "range of their contacts"),
    ],
)
def test_bad_scenes_are_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        simulate_particles(scene(**changes))


def test_particles_are_named_by_number_species_or_all() -> None:
    """In pushes and holds alike; numbers, lists and arrays make the same scene."""
    three = {"positions": [[0, 0], [2.1, 0], [4.2, 0]], "species": ["big", "small", "big"], "drag": 1.0}
    named = prepare(scene(**three, push=[Push("big", [1.0, "2*t"]), Push("all", [0, 3.0])], hold=[Hold("small", "x")]))
    np.testing.assert_array_equal(named.force(1.0), [[1, 5], [0, 3], [1, 5]])
    np.testing.assert_array_equal(named.fixed, [[False, False], [True, False], [False, False]])
    forces = [Push(np.array([0, 2]), np.array([1.0, 2.0])), Push((0, 1, 2), (0, 3.0))]
    numbered = prepare(scene(**three, push=forces, hold=[Hold([1], "x")]))
    np.testing.assert_array_equal(numbered.force(1.0), named.force(1.0))
    np.testing.assert_array_equal(numbered.fixed, named.fixed)


def test_a_run_that_cannot_go_on_hands_over_its_last_good_state(tmp_path: Path) -> None:
    """The force has no finite value from t = 5 on."""
    pushes = [Push([0], ["1e-2*sqrt(5-t)", 0]), Push([1], ["-1e-2*sqrt(5-t)", 0])]
    bad = scene(push=pushes, until_t=10.0, times=11)
    with pytest.raises(IntegrationError, match="no finite value") as error:
        simulate_particles(bad)
    partial = error.value.partial
    assert isinstance(partial, ParticleResult)
    assert 0 < partial.step_t[-1] <= 5
    assert np.array_equal(partial.t, np.arange(1 + np.floor(partial.step_t[-1])))
    # and leaves it behind, for another try
    checkpoint = tmp_path / "a.checkpoint.npz"
    with pytest.raises(IntegrationError, match=r"the last good state, at t=.*, is in .*a\.checkpoint\.npz"):
        simulate_particles(bad, checkpoint=checkpoint)
    kept = simulate_particles(
        scene(push=pushes, until_t=partial.step_t[-1], times=2), checkpoint=checkpoint, resume=True
    )
    assert np.array_equal(kept.step_t, partial.step_t)


@pytest.mark.slow
def test_numbers_are_the_same_on_both_targets() -> None:
    """To the roundings of a few hundred steps, each of which Newton's iteration ends at 1e-9 of the forces."""
    c, numba = (simulate_particles(rhombus(until_t=1e4, rtol=1e-6, target=target)) for target in ("c", "numba"))
    np.testing.assert_allclose(gaps(c), gaps(numba), rtol=1e-7)


@pytest.mark.parametrize("drag", [0.0, 1.0])
def test_conjugate_gradients_take_the_same_way(drag: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """What they leave, Newton's iteration corrects: the same positions to its tolerance, over some ten steps."""
    problem = hexagons(shear_rate=1e-4, until_t=300.0, drag=drag)
    monkeypatch.setattr(linear, "PER_PRODUCT", 1e9)  # products dear: factors
    direct = simulate_particles(problem)
    monkeypatch.setattr(linear, "LARGEST_FACTOR", 0)
    iterated = simulate_particles(problem)
    assert "LDL" in direct.stats["linear_solver"]
    assert "conjugate" in iterated.stats["linear_solver"]
    np.testing.assert_allclose(iterated.x, direct.x, atol=1e-4)
    np.testing.assert_allclose(iterated.stress, direct.stress, atol=1e-4 * np.abs(direct.stress).max())


def test_the_bench_times_solvers_of_one_system() -> None:
    """That of a sheared crystal: all solve it, Krylov's methods to their tolerance in the norm of the residual."""
    matrix = bench.newton_matrix(bench.plane_crystal(6))
    b = np.random.default_rng(0).standard_normal(matrix.shape[0])
    blocks = linear.block_diagonal(matrix, 2)
    solved = [(linear.direct(matrix, 2).solve(b), 1e-9)]
    for iterate in (linear.conjugate_gradients, linear.stabilised):
        x, _, done = iterate(matrix, blocks, b, 2, 1e-6, 1000)
        assert done
        solved.append((x, 1e-6))
    for x, tolerance in solved:
        assert np.linalg.norm(matrix @ x - b) <= 1.01 * tolerance * np.linalg.norm(b)
    assert all(seconds > 0 for seconds in bench.time_solvers(matrix, 2).values())


def nearly_singular(count: int, softness: float) -> bsr_array:
    """A chain of springs in one dimension, held by soft ones: conjugate gradients need many iterations."""
    matrix = diags_array([-np.ones(count - 1), np.full(count, 2 + softness), -np.ones(count - 1)], offsets=(-1, 0, 1))
    return bsr_array(matrix, blocksize=(1, 1))


def test_a_method_that_breaks_down_gives_what_it_has() -> None:
    """BiCGStab on a matrix for which the residual of its first iteration is orthogonal to the right-hand side."""
    matrix = bsr_array(np.array([[1.0, 0, 1], [1, 1, -1], [0, 1, 1]]), blocksize=(3, 3))
    b = np.array([[1.0, 0, 0]])
    x, _, done = linear.stabilised(matrix, lambda v: v, b, 3, 1e-8, 100)
    assert not done
    assert np.linalg.norm(matrix @ x.reshape(-1) - b) < np.linalg.norm(b)


def test_what_costs_least_solves_a_system() -> None:
    """Well-conditioned ones are not factorised, ill-conditioned ones are; a factor serves the systems that follow."""
    b = np.ones(400)
    easy, hard = (linear.Solver(1, 1) for _ in range(2))
    for step in range(12):
        for solver, softness in ((easy, 1e12), (hard, 1e-4)):
            matrix = nearly_singular(400, softness * (1 + 0.01 * step))
            linear.prepare(solver, matrix)
            x = linear.solve(solver, b, 1e-6)
            assert np.linalg.norm(matrix @ x - b) <= 1.01e-6 * np.linalg.norm(b)
    assert easy.counts["factorisations"] == 0
    assert easy.method == "conjugate gradients, preconditioned by blocks on the diagonal"
    assert 1 <= hard.counts["factorisations"] <= 3
    assert hard.counts["krylov"] <= 60


def test_a_factor_is_replaced_when_it_is_worn_out() -> None:
    """Systems that change more and more: there is a new factor when the old one costs more."""
    b = np.random.default_rng(3).standard_normal(400)
    solver = linear.Solver(1, 1)
    for step in range(60):
        stiff = np.random.default_rng(5).uniform(0, 1, 400) * (1.3**step - 1)
        matrix = bsr_array(nearly_singular(400, 1e-6).tocsr() + diags_array(stiff * 1e-6).tocsr(), blocksize=(1, 1))
        linear.prepare(solver, matrix)
        x = linear.solve(solver, b, 1e-6)
        assert np.linalg.norm(matrix @ x - b) <= 1.01e-6 * np.linalg.norm(b)
    assert 2 <= solver.counts["factorisations"] <= 30


def test_a_factor_that_serves_other_matrices_keeps_not_its_own() -> None:
    """Of many particles a matrix takes as much memory as all else."""
    solver = linear.Solver(1, 1, certain=True)
    first, second = (nearly_singular(50, softness) for softness in (1.0, 1.1))
    linear.prepare(solver, first)
    kept = weakref.ref(first)
    solver.certain = False
    linear.prepare(solver, second)
    del first
    assert "preconditioned by sparse LDL" in solver.method
    assert kept() is None


def test_where_nothing_else_resists_each_matrix_is_factorised() -> None:
    """A direction along which nothing resists is then seen even where no force points along it."""
    solver = linear.Solver(1, 1, certain=True)
    loose = bsr_array(diags_array([1.0, 1.0, 0.0]).tocsr(), blocksize=(1, 1))
    with pytest.raises(linear.Indefinite) as caught:
        linear.prepare(solver, loose)
    assert np.argmax(np.abs(caught.value.direction())) == 2


def test_conjugate_gradients_name_what_gives_way(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(linear, "LARGEST_FACTOR", 0)
    positions = [[0, 0], [2.1, 0], [4.2, 1e-9]]
    pushes = [Push([0], [1e-2, 0]), Push([2], [-1e-2, 0])]
    with pytest.raises(IntegrationError, match="can give way"):
        simulate_particles(scene(positions=positions, range=1.0, push=pushes))


@pytest.mark.slow
def test_the_duration_of_a_swap_depends_on_the_first_gaps() -> None:
    """Minute changes of the separations change the duration substantially, as arXiv 0901.0171 says.

    The pair in touch starts at 1/50, 1/100, 1/200 of a radius; what is left to go is the same to a hundredth.
    """
    durations = []
    for gap in (0.02, 0.01, 0.005):
        result = simulate_particles(rhombus(gap=gap, until_t=3e5, times=301, rtol=1e-4))
        durations.append(swap_time(result, (2, 3), (0, 1)))
    # resolved: half of the frames make no difference beyond the interpolation's own error
    coarse = simulate_particles(rhombus(until_t=3e5, times=151))
    assert swap_time(coarse, (2, 3), (0, 1)) == pytest.approx(durations[0], rel=1e-2)
    assert durations[1] > 1.5 * durations[0]
    assert durations[2] > 1.5 * durations[1]
    assert np.isnan(swap_time(simulate_particles(rhombus(until_t=10.0)), (2, 3), (0, 1)))


def test_pairs_are_counted_once() -> None:
    result = simulate_particles(rhombus(until_t=10.0))
    pairs = list(zip(result.contacts(0)["i"].tolist(), result.contacts(0)["j"].tolist(), strict=True))
    assert pairs == list(itertools.combinations(range(4), 2))


@pytest.mark.slow
@pytest.mark.parametrize("tangential", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_film_that_attraction_drains_ends_the_run_by_name(tangential: bool) -> None:
    """Nearly rigid spheres that attract each other touch at the integral of zeta/F_adh over the gap, drag counted once.

    Without the end of the run gaps fall to 1e-104, where h^3 underflows, and energies reach 1e104 without an error.
    Spheres flatten below (A/E)^(2/5), 2e-5 of the first gap squared: time does not tell. Each of some hundred steps is
    allowed an error of 1e-5.
    """
    parameters = {"E": 1e9, "eta": 1.0, "nu": 0.5, "Pi0": 1e-3, "ell": 0.01, "A": 1e-3}
    places = [[0.0, 0.0, 0.0], [2.01, 0.0, 0.0]]
    flow = {"drag": 1.0, "range": 0.5, "until_t": 20.0, "tangential": tangential, "rtol": 1e-5, "gap": None}
    with pytest.raises(IntegrationError, match="film of the contact of particles 0 and 1 is drained") as stopped:
        simulate_particles(scene(law="dlvo", parameters=parameters, positions=places, push=[], **flow))
    values = {"R": 1.0, "delta": 0.0, **parameters}
    terms = [(term, {str(symbol): symbol for symbol in term.free_symbols}) for term in (dlvo.zeta, dlvo.F_adh)]

    def slowness(gap: float) -> float:
        width = float(dlvo.a.subs({symbol: {**values, "h": gap}[str(symbol)] for symbol in dlvo.a.free_symbols}))
        at = {**values, "h": gap, "a": width}
        zeta, F_adh = (float(term.subs({symbol: at[name] for name, symbol in names.items()})) for term, names in terms)
        return zeta / -F_adh

    nodes, weights = np.polynomial.legendre.leggauss(20)
    touch = sum(0.005 * w * slowness(0.005 * (1 + node)) for node, w in zip(nodes, weights, strict=True))
    partial = stopped.value.partial
    assert isinstance(partial, ParticleResult)
    assert partial.step_t[-1] == pytest.approx(touch, rel=1e-3)
    assert abs(partial.energy["imbalance"]) < 1e-3


def pulled_apart(rtol: float) -> ParticleResult:
    """Two soft particles, pulled until their contact leaves its range."""
    pushes = [Push([0], [-1e-2, 0]), Push([1], [1e-2, 0])]
    places = [[0.0, 0.0], [2.02, 0.0]]
    return simulate_particles(
        scene(positions=places, gap=0.02, range=0.2, drag=1.0, push=pushes, until_t=3e4, times=3, rtol=rtol)
    )


@pytest.mark.parametrize("rtol", [1e-4, 1e-5])
def test_a_contact_that_is_pulled_beyond_its_range_ends_without_a_jump(rtol: float) -> None:
    """Its force fades, with what it stores: the balance of energy holds, and no step is wasted on its end."""
    result = pulled_apart(rtol)
    assert result.stats["dropped"] == 1 or result.stats["made"] == 1
    assert len(result.contacts(2)["h"]) == 0 < len(result.contacts(0)["h"])
    assert abs(result.energy["imbalance"]) < 3 * rtol  # errors of steps may add up to a few
    assert result.stats["warnings"] == result.stats["pulled"]  # the surfaces are pulled by more than a tenth on the way


def test_a_run_in_balance_has_no_warning() -> None:
    assert simulate_particles(scene(rtol=1e-4)).stats["warnings"] == []


def test_what_is_outside_the_model_is_told() -> None:
    """Two particles pulled so hard that their surfaces would stretch by more than a radius."""
    pushes = [Push([0], [-3.0, 0.0]), Push([1], [3.0, 0.0])]
    pulled = simulate_particles(
        scene(positions=[[0.0, 0.0], [2.02, 0.0]], gap=0.02, push=pushes, until_t=40.0, drag=1.0)
    )
    (warning,) = pulled.stats["warnings"]
    assert "the contact of particles 0 and 1 is pulled to a deflection of" in warning
    assert "no law of contacts holds" in warning


@pytest.mark.parametrize("aside", [0.0, 0.01, 0.3])
@pytest.mark.parametrize("push", [3e1, 1e3, 1e6])
def test_no_particle_passes_through_another(push: float, aside: float) -> None:
    """However hard it is pushed, and past the centre: the run ends by name where surfaces overlap by a radius."""
    holds, pushes = [Hold([0], "xy")], [Push([1], [-push, 0.0])]
    places = [[0.0, 0.0], [2.01, aside], [4.5, 0.0]]
    with pytest.raises(
        IntegrationError, match="the contact of particles 0 and 1 is pressed until its surfaces overlap by 1"
    ) as error:
        simulate_particles(scene(positions=places, gap=None, hold=holds, push=pushes, drag=1.0, until_t=10.0))
    assert np.all(error.value.partial.x[:, 1, 0] > 0.9)


@pytest.mark.parametrize("rigid", [False, True])
def test_no_wall_passes_through_a_particle(rigid: bool) -> None:
    walls = [Wall([0.0, -1.01], [0.0, -1.0], velocity=[0.0, 1.0]), Wall([0.0, 1.01], [0.0, 1.0], rigid=rigid)]
    with pytest.raises(IntegrationError, match=r"wall [01] is pressed until its surfaces .* no law of contacts"):
        simulate_particles(scene(positions=[[0.0, 0.0], [2.5, 0.0]], gap=None, wall=walls, drag=1.0, until_t=10.0))
    walls = [Wall([1.01, 0.0], [1.0, 0.0], rigid=rigid)]
    pushed = scene(
        positions=[[0.0, 0.0], [-50.0, 0.0]], gap=None, wall=walls, push=[Push([0], [1e5, 0.0])], drag=1.0, until_t=1.0
    )
    with pytest.raises(IntegrationError, match=r"wall 0 is pressed until its surfaces .* no law of contacts") as error:
        simulate_particles(pushed)
    assert np.all(error.value.partial.x[:, 0, 0] < 1.01)


def test_a_periodic_box_needs_a_range_of_its_contacts() -> None:
    """Without one all pairs are in contact, and which image of a particle is meant nobody knows."""
    with pytest.raises(SceneError, match="in a periodic box contacts need a range"):
        check(scene(positions=[[1.0, 1.0], [3.1, 1.0]], box=[20.0, 20.0], drag=1.0, range=None))


def test_a_pulled_pair_without_drag_has_an_equilibrium() -> None:
    """Overlapping at first, so that forces grow small on the way: what is left is compared, not its ratio to them."""
    pushes = [Push([0], [-1e-4, 0.0]), Push([1], [1e-4, 0.0])]
    result = simulate_particles(scene(positions=[[0.0, 0.0], [1.98, 0.0]], gap=0.02, push=pushes, until_t=100.0))
    np.testing.assert_allclose(result.contacts(0)["F"], -1e-4, rtol=1e-3)


def test_what_is_too_large_to_be_searched_for_loose_particles_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(linear, "LARGEST_FACTOR", 0)
    (warning,) = simulate_particles(hexagons(shear_rate=1e-4, until_t=30.0)).stats["warnings"]
    assert "not searched for motions that nothing resists" in warning


@pytest.mark.parametrize("rtol", [1e-3, 1e-5])
def test_velocities_without_drag_are_rates_of_the_positions(rtol: float) -> None:
    """Of a pushed pair, half of dX/dt of the pair engine at the run's own gap, whatever the tolerance of its steps."""
    pushes = [Push([0], ["1e-2*(1 + 0.5*sin(1e-3*t))", 0.0]), Push([1], ["-1e-2*(1 + 0.5*sin(1e-3*t))", 0.0])]
    result = simulate_particles(scene(push=pushes, until_t=1e4, times=9, rtol=rtol))
    pair = softdyn.simulate(
        law="rognon_gay", parameters={"R": 1.0, "E": 1.0, "eta": 1.0}, h=float(result.contacts(0)["h"][0]),
        force="1e-2*(1 + 0.5*sin(1e-3*t))", until_t=1e4, times=9, quantities=("dX_dt",), rtol=1e-10,
    )  # fmt: skip
    found = result.v[:, 1, 0] - result.v[:, 0, 0]
    # the rates depend on the gap, whose error is a few tolerances
    np.testing.assert_allclose(found, pair.dX_dt, atol=20 * rtol * np.abs(pair.dX_dt).max() + 1e-12)


@pytest.mark.parametrize("held", [False, True])
def test_velocities_without_drag_are_the_changes_of_positions(held: bool) -> None:
    """Of a sheared box, and with a driven particle, between two close outputs."""
    changes = {"hold": [Hold([0], "xy", [1e-5, 2e-5])]} if held else {}
    result = simulate_particles(hexagons(shear_rate=1e-4, until_t=60.0, times=[29.9, 30.0, 30.1], rtol=1e-6, **changes))
    change = (result.x[2] - result.x[0]) / (result.t[2] - result.t[0])
    size = np.abs(change).max()
    np.testing.assert_allclose(result.v[1], change - (0 if held else np.mean(change, axis=0)), atol=1e-3 * size)


def test_particles_that_go_with_the_flow_and_touch_nothing_have_no_warning() -> None:
    """All terms of their balance of energy are rounding, of which no part is much."""
    places = [[1.0, 1.0], [6.0, 2.5], [2.0, 7.0]]
    result = simulate_particles(
        scene(positions=places, gap=None, box=[10.0, 10.0], range=0.5, shear_rate=1e-2, drag=1.0, until_t=50.0, push=[])
    )
    assert result.stats["warnings"] == []
    np.testing.assert_allclose(result.v[-1, :, 0], 1e-2 * result.x[-1, :, 1], rtol=1e-9)
