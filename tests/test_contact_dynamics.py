"""Rigid grains by contact dynamics, against what rigid-body mechanics says of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from softdyn import simulate
from softdyn.errors import IntegrationError, SceneError
from softdyn.particles import Friction, Gravity, Hold, Inertia, ParticleScene, Push, Wall
from softdyn.particles.contact_dynamics import impulses as solver
from softdyn.particles.contact_dynamics.impulses import Effort, Problem, solve
from softdyn.particles.contact_dynamics.rigid_kernel import get_rigid_kernel
from softdyn.particles.packing import lattice_packing

G = 9.81
GYRATION = {"sphere": 0.4, "disc": 0.5}


def problem_of(d, first, second, normals, bounds, mu, mass, v, walls=1, target="auto", gyration=0.4):
    """Contacts of grains with these masses and velocities, and of walls behind them."""
    kernel, count = get_rigid_kernel(d, target), len(mass)
    first, second = (np.asarray(some, np.int32) for some in (first, second))
    masses = np.repeat(mass[:, None], kernel.width, axis=1)
    masses[:, d:] *= gyration
    free = np.ones((count + walls, kernel.width))
    free[count:] = 0
    whole = np.zeros((count + walls, kernel.width))
    whole[:count, : v.shape[1]] = v
    lights, looses = (np.append(1 / one, np.zeros(walls)) for one in (mass, gyration * mass))
    mobilities = np.empty((len(first), 2))
    kernel.mobilities(len(first), first, second, lights, looses, mobilities.reshape(-1))
    frictions = np.full(len(first), float(mu))
    normals = np.asarray(normals, float)
    return Problem(
        kernel, first, second, normals, np.zeros_like(normals), np.asarray(bounds, float), mobilities, frictions,
        masses, free, whole,
    )  # fmt: skip


def column(n, ratio=1.0, fall=0.0, gap=0.0, d=2, dt=1e-3):
    """A column of grains on a floor, the last at the bottom, over which masses change by a ratio; and its momentum."""
    mass = np.geomspace(1, ratio, n)
    v = np.zeros((n, d))
    v[:, -1] = -G * dt - fall
    normals = np.zeros((n, d))
    normals[:, -1] = -1
    made = problem_of(d, np.arange(n), np.arange(1, n + 1), normals, np.full(n, gap), 0.3, mass, v)
    return made, float(mass.sum()) * (G * dt + fall)


def pile(d, target="auto", mu=0.4):
    """Grains that touch all their neighbours on a close-packed lattice, flung at one another: redundant contacts."""
    rng = np.random.default_rng(d)
    kind, cells = {1: ("", ()), 2: ("hexagonal", [3, 2]), 3: ("fcc", [2, 2, 1])}[d]
    x = 2 * np.arange(12.0)[:, None] if d == 1 else lattice_packing(kind, cells, 2.0)[0]
    first, second = np.triu_indices(len(x), 1)
    apart = x[second] - x[first]
    touching = np.linalg.norm(apart, axis=1) < 2 + 1e-9
    first, second, normals = first[touching], second[touching], apart[touching] / 2
    bounds = rng.uniform(0, 0.3, len(first))
    v = rng.normal(size=(len(x), d)) - 0.5 * (x - x.mean(axis=0))
    return problem_of(d, first, second, normals, bounds, mu, rng.uniform(0.5, 2, len(x)), v, 0, target)


def laws_violated(problem, solution):
    """By how much Signorini's and Coulomb's laws are violated, each relative to the largest of its kind."""
    U = problem.slips(solution.v)
    n, P = problem.normals, solution.impulses
    P_n, U_n = np.sum(P * n, axis=1), np.sum(U * n, axis=1)
    P_t, U_t = P - P_n[:, None] * n, U - U_n[:, None] * n
    force, speed = P_n.max(), np.abs(U).max()
    gap = U_n + problem.bounds
    slack = problem.frictions * P_n - np.linalg.norm(P_t, axis=1)
    slides = np.linalg.norm(U_t, axis=1)
    opposed = np.sum(P_t * U_t, axis=1) + problem.frictions * P_n * slides
    return max(
        -P_n.min() / force,
        -gap.min() / speed,
        np.abs(P_n * gap).max() / (force * speed),
        -slack.min() / force,
        np.abs(opposed).max() / (force * speed),
    )


# contacts together


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("mu", [0.0, 0.4, 10.0])
def test_both_laws_hold_at_all_contacts_however_redundant(d, mu):
    """Of close-packed grains, all in collision."""
    problem = pile(d, mu=mu)
    solution = solve(problem, np.zeros_like(problem.normals), 1e-10, Effort())
    assert solution.converged
    assert laws_violated(problem, solution) < 1e-9


@pytest.mark.parametrize("mu", [1.0, 10.0])
def test_they_are_found_whatever_way_rounding_takes(mu):
    """Of impulses that are not unique: their last digits, which differ from machine to machine, lead elsewhere."""
    problem, rng = pile(3, mu=mu), np.random.default_rng(1)
    for _ in range(20):
        here = replace(problem, v=problem.v * (1 + 1e-13 * rng.normal(size=problem.v.shape)))
        assert solve(here, np.zeros_like(here.normals), 1e-10, Effort()).converged


@pytest.mark.parametrize("ratio", [1.0, 1e3, 1e-3])
@pytest.mark.parametrize("n", [30, 300])
def test_a_floor_bears_the_weight_of_a_column(n, ratio):
    problem, weight = column(n, ratio)
    solution = solve(problem, np.zeros((n, 2)), 1e-8, Effort())
    assert np.linalg.norm(solution.impulses[-1]) == pytest.approx(weight, rel=1e-6)
    assert np.abs(solution.v).max() < 1e-6 * G * 1e-3


@pytest.mark.parametrize("case", [{}, {"fall": 1.0, "gap": 0.01}])
def test_the_cost_of_a_column_grows_like_its_length(case):
    """In counted operations, from 100 to 3000 grains: at rest, and while a shock runs through it."""
    cost = []
    for n in (100, 3000):
        effort = Effort()
        problem, _ = column(n, **case)
        assert solve(problem, np.zeros((n, 2)), 1e-4, effort).converged
        cost.append(effort.operations)
    assert cost[1] / cost[0] < 30**1.3


def test_sweeps_alone_take_the_square_of_a_columns_length():
    """That is what Newton's method is for."""
    needed = []
    for n in (20, 40):
        problem, _ = column(n)
        state = solver._Sweeping(np.zeros((n, 2)), problem.velocities(np.zeros((n, 2))))
        while state.error > 1e-6:
            solver._sweep(problem, state, 20, 1e-6, Effort())
        needed.append(state.done)
    assert needed[1] / needed[0] > 3


def test_newtons_method_and_sweeps_find_the_same_velocities():
    """Impulses may be many; velocities are one, without friction."""
    problem = pile(3, mu=0.0)
    guess = np.zeros_like(problem.normals)
    state = solver._Sweeping(guess.copy(), problem.velocities(guess))
    while state.error > 1e-13:
        solver._sweep(problem, state, 50, 1e-13, Effort())
    start = solver._Sweeping(guess.copy(), problem.velocities(guess))
    solver._sweep(problem, start, 20, 1e-13, Effort())
    for kind in ("exact", "smoothed"):
        found = solver._newton(problem, start, kind, 1e-8, Effort())
        assert found is not None
        assert found.v == pytest.approx(state.v, abs=1e-9)


# scenes


def slope(shape, mu, theta=0.5, **more):
    """A grain on a slope, from rest, along x."""
    d = 2 if shape == "disc" else 3
    down = np.array([math.sin(theta), -math.cos(theta)]) if d == 2 else np.array([math.sin(theta), 0, -math.cos(theta)])
    up = np.eye(d)[-1]
    return ParticleScene(
        positions=[0.7 * up], radii=0.7, inertia=Inertia(density=2.0, shape=shape), friction=Friction(mu=mu),
        gravity=Gravity(acceleration=(G * down).tolist()), wall=[Wall([0] * d, (-up).tolist())], until_t=0.5, step=0.02,
        times=3, **more,
    )  # fmt: skip


@pytest.mark.parametrize("shape", ["disc", "sphere"])
@pytest.mark.parametrize("mu", [0.0, 0.1, 0.17, 0.5, 10.0])
def test_a_grain_rolls_or_slides_down_a_slope_as_its_friction_allows(shape, mu):
    theta, k = 0.5, GYRATION[shape]
    result = simulate(slope(shape, mu, theta))
    rolls = mu >= math.tan(theta) * k / (1 + k)
    a = G * math.sin(theta) / (1 + k) if rolls else G * (math.sin(theta) - mu * math.cos(theta))
    spinning = a if rolls else mu * G * math.cos(theta) / k
    # to the right it turns clockwise, in three dimensions about y
    sign = -1 if shape == "disc" else 1
    axis = 0 if shape == "disc" else 1
    assert result.v[-1, 0, 0] == pytest.approx(a * 0.5, rel=1e-10)
    assert result.spin[-1, 0, axis] == pytest.approx(sign * spinning * 0.5 / 0.7, rel=1e-10, abs=1e-12)
    # implicit Euler: of first order in the step, exactly so under a constant force
    assert result.x[-1, 0, 0] == pytest.approx(a * 0.5 * (0.5 + result.step_dt[0]) / 2, rel=1e-10)
    assert abs(result.energy["imbalance"]) < 1e-12
    assert result.x[-1, 0, -1] == pytest.approx(0.7, rel=1e-12)


def collision(d, restitution, mu, v1, spin=0.0):
    """Two grains of masses 1 and 8, along a slanting line, one of which flies into the other."""
    n = np.array([0.6, 0.8, 0.0][:d])
    v = np.zeros((2, d))
    v[0] = v1[:d]
    turning = 1 if d == 2 else 3
    spins = np.zeros((2, turning))
    spins[1, -1] = spin
    return ParticleScene(
        positions=[[0.0] * d, (3.0 * n).tolist()], radii=[1.0, 2.0],
        inertia=Inertia(density=3 / (4 * math.pi)), friction=Friction(mu=mu, restitution=restitution),
        velocities=v.tolist(), spins=spins.tolist(), until_t=0.2, step=0.01, times=2,
    )  # fmt: skip


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("mu", [0.0, 0.1, 1.0])
@pytest.mark.parametrize("d", [2, 3])
def test_a_collision_is_that_of_two_rigid_bodies(restitution, mu, d):
    """Normal impulse (1 + e) U_n/w_n; the tangential one stops the sliding, or is mu times that."""
    v1, spin, m, R = np.array([2.0, 1.0, 0.5][:d]), 0.7, np.array([1.0, 8.0]), np.array([1.0, 2.0])
    result = simulate(collision(d, restitution, mu, v1, spin))
    n = np.array([0.6, 0.8, 0.0][:d])
    z = spin * R[1] * np.array([-n[1], n[0], 0.0][:d])
    U = -v1 - z  # of the second surface: -R2 n from its centre, spin about z
    U_n = float(U @ n)
    U_t = U - U_n * n
    w_n, w_t = np.sum(1 / m), np.sum(3.5 / m)
    P_n = -(1 + restitution) * U_n / w_n
    stick = -U_t / w_t
    P_t = stick * min(1.0, mu * P_n / np.linalg.norm(stick)) if mu else 0 * stick
    P = P_n * n + P_t
    assert result.v[-1, 0] == pytest.approx(v1 - P / m[0], abs=1e-10)
    assert result.v[-1, 1] == pytest.approx(P / m[1], abs=1e-10)
    lost = -0.5 * (P @ U + P @ (U + w_n * P_n * n + w_t * P_t))
    assert result.energy["collisions"] + result.energy["friction"] == pytest.approx(lost, abs=1e-10)
    assert abs(result.energy["imbalance"]) < 1e-13
    momentum = result.v[-1].T @ m
    assert momentum == pytest.approx(v1 * m[0], abs=1e-13)


def test_angular_momentum_is_conserved_where_grains_touch():
    """Of an oblique plastic collision with friction, whose impulse acts at the point of contact."""
    m, R = np.array([1.0, 8.0]), np.array([1.0, 2.0])
    result = simulate(collision(3, 0.0, 0.3, np.array([2.0, 1.0, 0.5])))

    def angular(k):
        x, v = result.x[k], result.v[k]
        return np.sum(m[:, None] * np.cross(x, v) + 0.4 * (m * R**2)[:, None] * result.spin[k], axis=0)

    assert angular(-1) == pytest.approx(angular(0), abs=1e-12)


def test_three_grains_in_line_collide_at_once():
    """A plastic one that meets two at rest, which touch: all three go on together."""
    scene = ParticleScene(
        positions=[[-2.0], [0.0], [2.0]], radii=1.0, inertia=Inertia(density=1.0), velocities=[[1.0], [0.0], [0.0]],
        until_t=0.1, step=0.1, times=2, rtol=1e-10,
    )  # fmt: skip
    result = simulate(scene)
    assert result.v[-1, :, 0] == pytest.approx([1 / 3] * 3, abs=1e-9)
    # two thirds of the kinetic energy are lost
    assert result.energy["collisions"] == pytest.approx(2 / 3 * 0.5 * 4 / 3 * math.pi, rel=1e-9)


def test_a_ball_bounces_to_the_height_that_its_restitution_allows():
    """Of first order in the step."""
    scene = ParticleScene(
        positions=[[0.0, 1.5]], radii=0.5, inertia=Inertia(density=1.0), friction=Friction(restitution=0.5),
        gravity=Gravity(acceleration=[0, -2.0]), wall=[Wall([0, 0], [0, -1])], until_t=2.0, step=0.002, times=1001,
    )  # fmt: skip
    height = simulate(scene).x[:, 0, 1] - 0.5
    assert height.min() >= -1e-14
    assert height[600:].max() == pytest.approx(0.25, abs=0.01)


def wedged(mu, theta, push):
    """A grain in a wedge that opens upwards, whose walls are at the angle theta to the vertical."""
    walls = [Wall([0, 0], [side * math.cos(theta), -math.sin(theta)]) for side in (1, -1)]
    return ParticleScene(
        positions=[[0, 1 / math.sin(theta)]], radii=1.0, inertia=Inertia(density=3 / (4 * math.pi)),
        friction=Friction(mu=mu), wall=walls, until_t=0.1, step=0.01, times=2, rtol=1e-10,
        push=[Push("all", force=[0.0, push])],
    )  # fmt: skip


def test_a_wedge_bears_what_pushes_into_it():
    """Without friction by the normal forces alone, F/(2 sin theta); with it by less. Pulled out, it resists nothing."""
    theta = 0.3
    smooth = simulate(wedged(0.0, theta, -3.0))
    assert smooth.contacts(-1)["F"] == pytest.approx([3 / (2 * math.sin(theta))] * 2, rel=1e-9)
    rough = simulate(wedged(10.0, theta, -3.0))
    contacts = rough.contacts(-1)
    assert np.sum(contacts["F"][:, None] * contacts["n"] + contacts["T"], axis=0) == pytest.approx(
        [0.0, -3.0], abs=1e-9
    )
    assert np.abs(rough.v[-1]).max() < 1e-9
    out = simulate(wedged(10.0, theta, 3.0))
    assert out.v[-1, 0] == pytest.approx([0.0, 0.3], abs=1e-10)


def test_a_moving_wall_pushes_and_drags_what_it_touches():
    """A floor that moves up and along: the grain goes up with it, and is dragged along until it rolls with it."""
    scene = ParticleScene(
        positions=[[0.0, 1.0]], radii=1.0, inertia=Inertia(density=1.0, shape="disc"), friction=Friction(mu=0.5),
        gravity=Gravity(acceleration=[0, -G]), wall=[Wall([0, 0], [0, -1], velocity=[2.0, 0.3])], until_t=2.0, times=3,
    )  # fmt: skip
    result = simulate(scene)
    assert result.x[-1, 0, 1] == pytest.approx(1.6, rel=1e-10)
    # with rolling at the end: the impulse on the centre is a third of what would drag it whole
    assert result.v[-1, 0, 0] == pytest.approx(2.0 / 3, rel=1e-10)
    assert result.spin[-1, 0, 0] == pytest.approx(4.0 / 3, rel=1e-10)
    assert abs(result.energy["imbalance"]) < 1e-12
    assert result.energy["external"] > 0


def test_what_is_held_does_not_move_and_what_is_driven_does():
    scene = ParticleScene(
        positions=[[0.0, 0.0], [2.0, 0.0], [4.0, 0.0]], radii=1.0, inertia=Inertia(density=1.0),
        friction=Friction(mu=0.3), hold=[Hold([0], "xy", velocity=["0.5*t", 0.0]), Hold([2], "x")], until_t=0.5,
        wall=[Wall([0, -1], [0, -1])], times=6, rtol=1e-10,
    )  # fmt: skip
    with pytest.raises(IntegrationError, match=r"does not converge .* particles 1 and 2"):
        simulate(scene)
    open_ended = replace(scene, hold=scene.hold[:1], packing=None, file=None)
    result = simulate(open_ended)
    assert result.v[-1, :, 0] == pytest.approx([0.25 - 0.5 * result.stats["step"] / 2] * 3, abs=0.01)
    assert (np.diff(result.x[-1, :, 0]) >= 2 - 1e-12).all()
    assert abs(result.energy["imbalance"]) < 1e-12


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"positions": [[0, 0], [1.9, 0], [10, 0]]}, "particle 0 and particle 1 by 0.1"),
        ({"friction": Friction(mu=0.3, restitution=1.5)}, "restitution"),
        ({"friction": Friction(mu=-0.3)}, "mu"),
        ({"friction": Friction(mu=0.3, rolling=0.1)}, "rolling is not known to contact dynamics"),
        ({"drag": 1.0}, "drag is not known to contact dynamics"),
        ({"inertia": None}, "inertia"),
        ({"step": -1.0}, "step"),
    ],
)
def test_what_cannot_be_run_is_refused_by_name(change, words):
    good = {
        "positions": [[0, 0], [2.1, 0], [10, 0]], "radii": 1.0, "inertia": Inertia(density=1.0),
        "friction": Friction(mu=0.3), "until_t": 1.0, "method": "contact_dynamics",
    }  # fmt: skip
    with pytest.raises(SceneError, match=words):
        simulate(ParticleScene(**{**good, **change}))
