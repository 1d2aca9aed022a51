"""Tangential motion: sliding, rolling and turning particles, against other paths and what must be conserved."""

from __future__ import annotations

import math
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import simpson
from sliding_by_velocities import functions_of, integrate
from sympy import Abs, Rational, Symbol, pi, sqrt

from softdyn.derive import LENGTH, ContactLaw, E, R, Tangential, a, delta, eta, h, size_ratio
from softdyn.derive import tangential as stage
from softdyn.derive.contact_equations import ContactNeeds
from softdyn.derive.contact_kernel import contact_ir
from softdyn.derive.emit import emit
from softdyn.derive.laws.equal_spheres import law as equal_spheres
from softdyn.derive.laws.rognon_gay import law as rognon_gay
from softdyn.errors import IntegrationError, LawError, SceneError
from softdyn.particles import linear
from softdyn.particles.checkpoint import fingerprint
from softdyn.particles.files import particle_scene_from
from softdyn.particles.force_balance import Newton
from softdyn.particles.geometry import Wall, curvatures, directions, lattice, rotations, turning
from softdyn.particles.mechanisms import sliding
from softdyn.particles.mechanisms.soft_films import solve_contacts
from softdyn.particles.observables import relative_viscosity
from softdyn.particles.particle_keys import Hold, ParticleScene, Push
from softdyn.particles.particle_run import prepare, simulate_particles
from softdyn.particles.results import ParticleResult, load_particles
from softdyn.particles.rubbing_suspension import known_laws
from softdyn.particles.start import start
from softdyn.particles.step import take_step
from softdyn.particles.system import System, image_velocities
from softdyn.scene.stock_scenes import particle_scenes

Array = NDArray[np.float64]
UNIT = {"E": 1.0, "eta": 1.0, "nu": 0.5}
RIGID = {"E": 1e12, "eta": 1.0, "nu": 0.5}


def scene(**changes: Any) -> ParticleScene:
    """Two equal spheres a twentieth of a radius apart, undeformed, unless changed."""
    two: dict[str, Any] = {
        "law": "equal_spheres",
        "parameters": UNIT,
        "positions": [[0.0, 0.0, 0.0], [2.05, 0.0, 0.0]],
        "radii": 1.0,
        "tangential": True,
        "until_t": 10.0,
        "times": 5,
        "rtol": 1e-5,
    }
    return ParticleScene(**{**two, **changes})


#: Four unequal spheres, three pairs of them pressed.
PLACES = np.array([[0, 0, 0], [2.1, 0.4, 0.3], [1.0, 1.9, -0.4], [0.8, 0.5, 1.95]])
RADII = np.array([1.0, 1.2, 0.9, 1.0])


def tetrahedron(d: int = 3, **changes: Any) -> ParticleScene:
    """Four unequal spheres in a shear flow."""
    places = PLACES if d == 3 else np.array([[0, 0], [2.1, 0.4], [1.0, 1.9], [3.0, 2.2]])
    flow = {"drag": 1.0, "shear_rate": 0.01, "gap": 0.1, "until_t": 100.0}
    return scene(**{"positions": places, "radii": RADII, **flow, **changes})


def stirred(
    problem: ParticleScene, seed: int = 0, far: float = 1e-3
) -> tuple[System, Any, sliding.Known, Array, float]:
    """A system, its state, tangential forces that it might have, and a small motion of all particles."""
    system = prepare(problem)
    state = start(system, Newton())
    draw = np.random.default_rng(seed)
    n, _ = directions(state.contacts, state.x, lattice(system.box, 0.0), system.walls)
    T = draw.standard_normal(n.shape) * 1e-2
    state.contacts.T = T - sliding.dot(T, n)[:, None] * n
    known = sliding.starting(state.contacts, system.radii, n, state.contacts.T)
    return system, state, known, far * draw.standard_normal(system.fixed.shape), 3.0


def slid_at(
    system: System, state: Any, known: sliding.Known, moved: Array, s: float
) -> tuple[sliding.TangentialForces, Array]:
    d = system.dimension
    contacts = state.contacts
    n, r = directions(contacts, state.x + moved[:, :d], lattice(system.box, 0.0), system.walls)
    curvature = curvatures(contacts, r, len(state.x))
    nothing = np.zeros(len(r))
    *_, values = solve_contacts(system, contacts.S - r, s, contacts.h, nothing, nothing.copy(), contacts.q)
    images = s * image_velocities(system, contacts, 0.0)
    return sliding.slide(known, contacts, values, n, r, curvature, moved, images, s), n


# the derivation, and what a law declares


def test_the_derivation_checks_itself() -> None:
    assert [symbol.name for symbol in stage.stage()][:5] == ["friction_t", "keep", "stiff", "roll", "lever"]


@pytest.mark.slow
def test_nothing_of_it_is_in_kernels_that_do_not_ask() -> None:
    """The text is that of the same law without a tangential part, to the byte."""
    without = replace(equal_spheres, tangential=None)
    needs = ContactNeeds(varying=("R",), fading=True)
    one, other = (contact_ir(law, needs) for law in (equal_spheres, without))
    for target in ("c", "numba"):
        assert emit(one, target) == emit(other, target)


@pytest.mark.slow
def test_equal_spheres_have_no_lever() -> None:
    """It is left out, and so is size_ratio; both are there for unequal ones."""
    equal = contact_ir(equal_spheres, ContactNeeds(tangential=True))
    unequal = contact_ir(equal_spheres, ContactNeeds(varying=("R", "size_ratio"), tangential=True))
    assert "lever" not in equal.functions["tangent"].gives
    assert "lever" in unequal.functions["tangent"].gives
    assert not any(name == "size_ratio" for name in (*equal.arrays["p"], *equal.arrays["q"]))
    assert equal.functions["tangent"].operations["mul"] < unequal.functions["tangent"].operations["mul"]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"sliding": 3 * eta * R * delta / h}, "tangential sliding.*'delta' is not allowed"),
        ({"sliding": 3 * eta * R**2}, "tangential sliding.*dimension"),
        ({"k_t": E * R**2}, "tangential k_t.*dimension"),
        ({"k_t": E * (a - R)}, "tangential k_t must be positive"),
        ({"rolling": eta * R**3, "coupling": 9 * eta * R**2}, "coupling.2 must be positive"),
        ({"coupling": eta * R**2}, "coupling.2 must be positive"),
        ({"sliding": eta * R * (1 - 8 * size_ratio)}, "at size_ratio=0.125"),
    ],
)
def test_faults_of_the_declaration_are_named(changes: dict[str, Any], words: str) -> None:
    declared = {"sliding": 3 * eta * R, "k_t": E * a}
    with pytest.raises(LawError, match=words):
        replace(rognon_gay, tangential=Tangential(**{**declared, **changes}))


def test_a_law_of_its_own_parameters_slides() -> None:
    """What only the tangential part depends on is a parameter of scenes with tangential motion."""
    slip = Symbol("slip", positive=True)
    own = ContactLaw(
        name="slippery",
        a=sqrt(2 * R * (R * h / (R + h) + Abs(delta))),
        F_ela=Rational(4, 9) * E * a * delta,
        zeta=6 * pi * eta * R**2 / h,
        tangential=Tangential(sliding=eta * a**2 / (h + slip), k_t=E * a / 2),
        parameters={slip: LENGTH},
    )
    result = simulate_particles(scene(law=own, parameters={"E": 1.0, "eta": 1.0, "slip": 0.1}, drag=1.0, until_t=1.0))
    assert result.stats["steps"] > 0
    with pytest.raises(SceneError, match="slip is missing"):
        simulate_particles(scene(law=own, parameters={"E": 1.0, "eta": 1.0}, drag=1.0))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"law": "rognon_gay", "parameters": {"E": 1.0, "eta": 1.0}}, "declares none: give it tangential="),
        ({"positions": [[0.0], [2.05]]}, "in one dimension there is no tangential motion"),
        ({"tangential": "yes"}, "tangential must be true or false"),
        ({"tangential": False, "hold": [Hold([0], "xyz", None, [0, 0, 1])]}, "spin has no meaning without"),
        ({"hold": [Hold([0], "xyz", None, [1.0])]}, "spin needs 3 components in 3 dimensions"),
        ({"tangential": False, "push": [Push([0], torque=[0, 0, 1])]}, "torque has no meaning without tangential"),
        ({"push": [Push([0], torque=[1.0])]}, r"\[\[push\]\] 0: torque needs 3 components in 3 dimensions"),
        (
            {"positions": [[0.0, 0.0], [2.05, 0.0]], "push": [Push([0], [0, 0], 1e-3)]},
            "torque needs 1 component in 2 dimensions",
        ),
        ({"push": [Push([0])]}, r"\[\[push\]\] 0: force or torque is missing"),
        ({"push": [Push([0], torque=[0, 0, "1/t"])]}, "torque about z = '1/t' has no finite value at t = 0"),
        ({"hold": [Hold([0], "x", None, [0, 0, 1]), Hold([0], "y", None, [0, 0, 1])]}, "particle 0 given two spins"),
        ({"parameters": {**UNIT, "size_ratio": 0.2}}, "size_ratio follows from the radii"),
    ],
)
def test_bad_scenes_are_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises((SceneError, LawError), match=words):
        simulate_particles(scene(**changes))


def test_a_scene_file_asks_for_it(tmp_path: Any) -> None:
    data = {
        "law": "equal_spheres",
        "parameters": UNIT,
        "particles": {"positions": [[0.0, 0.0], [2.05, 0.0]], "radii": 1.0},
        "contacts": {"tangential": True},
        "hold": [{"particles": [0], "axes": "xy", "velocity": [0.0, 1e-3], "spin": [0.0]}],
        "push": [{"particles": [1], "torque": ["w*t"]}],
        "constants": {"w": 0.0},
        "flow": {"drag": 1.0},
        "until": {"t": 1.0},
    }
    result = simulate_particles(particle_scene_from(data, tmp_path))
    assert result.spin.shape == (11, 2, 1)
    assert result.contact_T.shape == (11, 2)
    assert result.spin[-1, 0, 0] == 0
    assert result.spin[-1, 1, 0] != 0
    turned = simulate_particles(particle_scene_from({**data, "constants": {"w": 1e-3}}, tmp_path))
    assert turned.spin[-1, 1, 0] > result.spin[-1, 1, 0]
    again = load_particles(result.save(tmp_path / "two.npz"))
    assert np.array_equal(again.contact_T, result.contact_T)
    assert np.array_equal(again.spin, result.spin)


# what must be conserved


@pytest.mark.slow
@pytest.mark.parametrize("d", [2, 3])
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_forces_and_torques_sum_to_zero(d: int, seed: int) -> None:
    """Any sliding, rolling and elasticity, unequal spheres: to the rounding of the terms."""
    system, state, known, moved, s = stirred(tetrahedron(d), seed, far=1e-2)
    slid, n = slid_at(system, state, known, moved, s)
    x = state.x + moved[:, :d]
    total = sliding.reactions(state.contacts, known, slid, n, len(x))
    force, torque = total[:, :d], total[:, d:] * system.radii[:, None]
    largest = max(float(np.abs(slid.force).sum()), float(np.abs(slid.moment).sum()))
    rounding = 100 * np.finfo(float).eps * largest * (1 + np.abs(x).max())
    assert largest > 0
    assert np.abs(force.sum(axis=0)).max() < rounding
    about = sliding.torque(x, force)
    assert np.abs((about + torque).sum(axis=0)).max() < rounding


@pytest.mark.parametrize("d", [2, 3])
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_rigid_motion_neither_slides_nor_rolls(d: int, seed: int) -> None:
    """To the rounding of displacements of order one."""
    system, state, known, _, s = stirred(tetrahedron(d), seed)
    draw = np.random.default_rng(seed)
    turn, shift = draw.standard_normal(rotations(d)), draw.standard_normal(d)
    spread = np.repeat(turn[None], len(state.x), axis=0)
    moved = np.concatenate([turning(spread, state.x) + shift, system.radii[:, None] * spread], axis=1)
    contacts = state.contacts
    n, r = directions(contacts, state.x, lattice(system.box, 0.0), ())
    curvature = curvatures(contacts, r, len(state.x))
    nothing = np.zeros(len(r))
    *_, values = solve_contacts(system, contacts.S - r, s, contacts.h, nothing, nothing.copy(), contacts.q)
    slid = sliding.slide(known, contacts, values, n, r, curvature, moved, np.zeros_like(n), s)
    assert np.abs(slid.slip).max() < 1e-13
    assert np.abs(slid.moment).max() < 1e-12


def circling(spin: float, own: float, **changes: Any) -> ParticleScene:
    """Two spheres held on a slanted line, the first turning by itself, all of it turned about z."""
    first, second = np.array([0.6, -0.4, -0.5]), np.array([-0.9, 0.7, 0.85])
    holds = []
    for number, place in enumerate((first, second)):
        velocity: list[str | float] = [
            f"-w*({place[0]}*sin(w*t) + {place[1]}*cos(w*t))",
            f"w*({place[0]}*cos(w*t) - {place[1]}*sin(w*t))",
            0.0,
        ]
        holds.append(Hold([number], "xyz", velocity, [0.0, 0.0, spin + (own if number == 0 else 0.0)]))
    settings_of = {"positions": [first, second], "radii": [1.0, 1.2], "gap": 0.05, "constants": {"w": spin}}
    return scene(**{**settings_of, "hold": holds, "rtol": 1e-6, **changes})


@pytest.mark.slow
def test_forces_do_not_depend_on_who_looks() -> None:
    """Turned by 1.2 radians, spin about the normal included: equal to the errors of some hundred steps at 1e-6."""
    still, turned = (simulate_particles(circling(w, 0.02, until_t=12.0)) for w in (1e-9, 0.1))
    size = np.linalg.norm(still.contact_T, axis=1)
    assert size[-1] > 1e-3
    np.testing.assert_allclose(np.linalg.norm(turned.contact_T, axis=1), size, rtol=1e-4, atol=1e-8)
    np.testing.assert_allclose(turned.contact_F, still.contact_F, rtol=1e-4, atol=1e-8)
    np.testing.assert_allclose(turned.contact_h, still.contact_h, rtol=1e-5)
    angle = 0.1 * turned.t
    back = np.stack(
        [
            np.cos(angle) * turned.contact_T[:, 0] + np.sin(angle) * turned.contact_T[:, 1],
            np.cos(angle) * turned.contact_T[:, 1] - np.sin(angle) * turned.contact_T[:, 0],
            turned.contact_T[:, 2],
        ],
        axis=1,
    )
    np.testing.assert_allclose(back, still.contact_T, atol=1e-4 * size.max())


# against other solutions


@pytest.mark.parametrize("modulus", [1.0, 100.0])
@pytest.mark.parametrize("lam", [1.0, 2.0])
def test_a_sheared_contact_relaxes_as_a_maxwell_element(modulus: float, lam: float) -> None:
    """T = A v (1 - exp(-t k_t/A)) at a gap that stays, with A and k_t from the declared expressions.

    The motion changes the gap by 3e-6 of it. A step may be wrong by 1e-7 of what would shear by the gap, or 2e-5 of the
    force in the end.
    """
    parameters = {**UNIT, "E": modulus}
    values = functions_of(equal_spheres, parameters)(0.05, 0.0, 2 * lam / (1 + lam), lam / (1 + lam) ** 2)
    A, k_t = values[3], values[6]
    speed = 5e-3 * 0.05 * k_t / A
    still: list[float] = [0.0] * 3
    holds = [Hold([0], "xyz", [0.0, speed, 0.0], still), Hold([1], "xyz", None, still)]
    places = [[0.0, 0.0, 0.0], [1.05 + lam, 0.0, 0.0]]
    changes = {"parameters": parameters, "positions": places, "radii": [1.0, lam]}
    result = simulate_particles(scene(hold=holds, until_t=3 * A / k_t, rtol=1e-7, **changes))
    expected = A * speed * (1 - np.exp(-result.t * k_t / A))
    np.testing.assert_allclose(result.contact_T[:, 1], expected, atol=1e-4 * A * speed)


def resistances(lam: float, gap: float) -> Array:
    """Force and torque that sphere 1 exerts, per velocity across the line and spins of both: shape (3, 2)."""
    rows = []
    for motion in range(3):
        velocity = [0.0, 1e-9 if motion == 0 else 0.0]
        spins = [1e-9 if motion == k else 0.0 for k in (1, 2)]
        holds = [Hold([0], "xy", velocity, [spins[0]]), Hold([1], "xy", None, [spins[1]])]
        places = [[0.0, 0.0], [1 + lam + gap, 0.0]]
        problem = scene(parameters=RIGID, positions=places, radii=[1.0, lam], hold=holds)
        system = prepare(problem)
        state = start(system, Newton())
        # a millionth of it is left after a time long against the relaxation of so hard a contact, which is below 1e-6
        end = take_step(system, state.contacts, Newton(), 0.0, state.x, state.v, state.y_rate, 1.0).end
        rows.append(end.reaction[0, 1:] / 1e-9)
    return np.array(rows)


@pytest.mark.parametrize("lam", [0.2, 0.5, 1.0, 3.0])
def test_hard_spheres_resist_as_jeffrey_and_onishi_say(lam: float) -> None:
    """The factors of ln(1/xi) in Y^A_11, Y^B_11, Y^C_11 and Y^C_12, from the difference of two gaps; a1 = 1.

    Their formulas, as corrected by Townsend, are independent of the law's: four functions of a2/a1 against three
    numbers. What is left is of the order of the larger gap times its logarithm, some ten times that where terms cancel.
    """
    gaps = 1e-6, 1e-8
    near, nearer = (resistances(lam, gap) for gap in gaps)
    found = (nearer - near) / math.log(gaps[0] / gaps[1])
    Y_A = 4 * lam * (2 + lam + 2 * lam**2) / (15 * (1 + lam) ** 3)
    Y_B = lam * (4 + lam) / (5 * (1 + lam) ** 2)
    Y_C11, Y_C12 = 2 * lam / (5 * (1 + lam)), 4 * lam**2 / (5 * (1 + lam) ** 4)
    units = 6 * math.pi, 4 * math.pi, 8 * math.pi, math.pi * (1 + lam) ** 3
    np.testing.assert_allclose(found[0], [units[0] * Y_A, units[1] * Y_B], rtol=1e-4)
    np.testing.assert_allclose(found[1], [units[1] * Y_B, units[2] * Y_C11], rtol=1e-4)
    assert found[2, 1] == pytest.approx(units[3] * Y_C12, rel=1e-4)


@pytest.mark.parametrize("lam", [0.2, 1.0, 3.0])
def test_hard_spheres_resist_approach_as_jeffrey_and_onishi_say(lam: float) -> None:
    """X^A: 6 pi eta a1 g1/xi; what is left is the logarithm, 10 to 15 xi of it, and rounding, 2e-3."""
    for gap, modulus in ((1e-3, 1e10), (1e-4, 1e11)):
        speed = 1e-4 * gap
        holds = [Hold([0], "xy", [speed, 0.0], [0.0]), Hold([1], "xy", None, [0.0])]
        places = [[0.0, 0.0], [1 + lam + gap, 0.0]]
        problem = scene(parameters={**UNIT, "E": modulus}, positions=places, radii=[1.0, lam], hold=holds)
        system = prepare(problem)
        state = start(system, Newton())
        end = take_step(system, state.contacts, Newton(), 0.0, state.x, state.v, state.y_rate, 1.0).end
        xi, g1 = 2 * gap / (1 + lam), 2 * lam**2 / (1 + lam) ** 3
        assert end.reaction[0, 0] / speed == pytest.approx(6 * math.pi * g1 / xi, rel=20 * xi + 2e-3)


def test_a_hard_sphere_beside_a_wall_resists_as_goldman_cox_and_brenner_say() -> None:
    """8/15, 1/10 and 2/5 of ln(1/h), in units of 6 pi eta a, 8 pi eta a^2 and 8 pi eta a^3."""
    rows = []
    for gap in (1e-6, 1e-8):
        row = []
        for motion in range(2):
            holds = [Hold([0], "xy", [1e-9 * (motion == 0), 0.0], [1e-9 * (motion == 1)]), Hold([1], "xy", None, [0])]
            wall = Wall(np.array([0.0, -1.0 - gap]), np.array([0.0, -1.0]))
            problem = scene(positions=[[0, 0], [30, 30]], wall=[wall], hold=holds, parameters=RIGID, range=4.0)
            system = prepare(problem)
            state = start(system, Newton())
            end = take_step(system, state.contacts, Newton(), 0.0, state.x, state.v, state.y_rate, 1.0).end
            row.append(np.abs(end.reaction[0, [0, 2]]) / 1e-9)
        rows.append(row)
    found = (np.array(rows[1]) - rows[0]) / math.log(100)
    np.testing.assert_allclose(found[0], [6 * math.pi * 8 / 15, 8 * math.pi / 10], rtol=1e-5)
    np.testing.assert_allclose(found[1], [8 * math.pi / 10, 8 * math.pi * 2 / 5], rtol=1e-5)


@pytest.mark.slow
def test_another_route_agrees_at_third_order() -> None:
    """Positions, gaps and tangential forces of four unequal spheres in a shear flow, turned by most of a radian."""
    times = [0.0, 10.0, 40.0, 100.0]
    pairs = np.triu_indices(4, 1)
    apart = np.linalg.norm(PLACES[:, None] - PLACES[None], axis=2)[pairs] - RADII[pairs[0]] - RADII[pairs[1]]
    x, gaps, T = integrate(equal_spheres, UNIT, PLACES, RADII, np.maximum(apart, 0.1), 0.01, times)
    errors, steps = [], []
    for rtol in (1e-4, 1e-5, 1e-6):
        result = simulate_particles(tetrahedron(times=times, rtol=rtol))
        found = [
            np.abs(result.x - x).max(axis=(1, 2)),
            np.abs(result.contact_h.reshape(4, -1) / gaps - 1).max(axis=1),
            np.abs(result.contact_T.reshape(4, -1, 3) - T).max(axis=(1, 2)) / np.abs(T).max(),
        ]
        off = np.max(found, axis=0)
        errors.append((float(off[-1]), float(found[0][-1])))
        steps.append(result.stats["steps"])
        # errors of order rtol in each step, which mostly decay
        assert off.max() < 5 * rtol
    of_all, of_positions = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert of_all > 2.5
    assert of_positions > 2.8


@pytest.mark.parametrize("d", [2, 3])
def test_the_tangent_is_the_derivative_of_the_forces(d: int) -> None:
    """Central differences of forces and torques by all coordinates: error of the order step^2, and rounding/step."""
    problem = tetrahedron(d)
    system, state, known, _, s = stirred(problem)
    contacts, count = state.contacts, len(state.x)
    nothing = np.zeros(len(contacts))

    def forces(moved: Array) -> Array:
        slid, n = slid_at(system, state, known, moved, s)
        return sliding.reactions(contacts, known, slid, n, count).reshape(-1)

    n, r = directions(contacts, state.x, lattice(system.box, 0.0), ())
    curvature = curvatures(contacts, r, len(state.x))
    *_, values = solve_contacts(system, contacts.S - r, s, contacts.h, nothing, nothing.copy(), contacts.q)
    # a state that has slid, but has not turned: the tangent is exact there
    moved = np.zeros(system.fixed.shape)
    moved[:, d:] = 1e-2 * np.random.default_rng(1).standard_normal((count, moved.shape[1] - d))
    slid, _ = slid_at(system, state, known, moved, s)
    quarters = sliding.tangents(known, values, slid, n, curvature, s)
    pattern = linear.pattern_of(count, contacts.i, contacts.j)
    width = moved.shape[1]
    matrix = linear.assemble_quarters(pattern, quarters, np.zeros((count, width)), system.fixed).toarray()
    step = 1e-5
    numeric = np.empty_like(matrix)
    for column in range(matrix.shape[1]):
        change = np.zeros(matrix.shape[1])
        change[column] = step
        change = change.reshape(moved.shape)
        numeric[:, column] = (forces(moved + change) - forces(moved - change)) / (2 * step)
    assert np.abs(matrix - matrix.T).max() > 1e-3 * np.abs(matrix).max()  # it is not symmetric
    assert np.abs(numeric - matrix).max() < 1e-6 * np.abs(matrix).max()


# runs


@pytest.mark.parametrize("d", [2, 3])
def test_energy_is_accounted_for(d: int) -> None:
    """Every term is there, sliding and rolling among them, and what is left is a part of the tolerance."""
    for rtol in (1e-3, 1e-5):
        energy = simulate_particles(tetrahedron(d, rtol=rtol)).energy
        assert abs(energy["imbalance"]) < rtol
    assert energy["sliding"] > 0
    assert energy["rolling"] > 0
    assert energy["k_t"] != 0


def rhombus(**changes: Any) -> ParticleScene:
    """Four spheres without drag: two in touch, two beside them that are pushed together."""
    half = math.sqrt(2.02**2 - 1.01**2)
    positions = [[-half, 0.0], [half, 0.0], [0.0, 1.01], [0.0, -1.01]]
    pushes = [Push([0], [5e-3, 0.0]), Push([1], [-5e-3, 0.0])]
    return scene(**{"positions": positions, "push": pushes, "gap": 0.0202, "until_t": 2e4, "rtol": 1e-4, **changes})


@pytest.mark.slow
def test_without_drag_films_alone_resist() -> None:
    """Forces and torques balance at every step, energy too, and nothing drifts or turns as a whole."""
    result = simulate_particles(rhombus())
    assert np.all(result.step_residual <= 1e-7)
    assert abs(result.energy["imbalance"]) < 1e-4
    assert result.energy["sliding"] > 0
    assert result.energy["drag"] == 0
    np.testing.assert_allclose(result.x.mean(axis=1), result.x[0].mean(axis=0)[None].repeat(5, axis=0), atol=1e-9)
    np.testing.assert_allclose(result.spin, 0, atol=1e-12)  # by symmetry
    # sliding films slow the swap down
    normal = simulate_particles(rhombus(tangential=False))
    assert result.x[-1, 1, 0] > normal.x[-1, 1, 0] + 0.01


@pytest.mark.slow
def test_numbers_are_the_same_on_both_targets() -> None:
    """To the roundings of a hundred steps, each of which Newton's iteration ends at 1e-8 of the forces."""
    c, numba = (simulate_particles(tetrahedron(until_t=20.0, target=target)) for target in ("c", "numba"))
    np.testing.assert_allclose(c.contact_T, numba.contact_T, atol=1e-7 * np.abs(c.contact_T).max())
    np.testing.assert_allclose(c.spin, numba.spin, atol=1e-7 * np.abs(c.spin).max())


def periodic(**changes: Any) -> ParticleScene:
    """A sheared periodic packing of unequal spheres in three dimensions."""
    place = 2.04 * np.array([[i, j, k] for i in range(3) for j in range(3) for k in range(3)], dtype=float)
    draw = np.random.default_rng(3)
    radii = 1 + 0.05 * draw.uniform(-1, 1, 27)
    moved = np.mod(place + 0.1 * draw.uniform(-1, 1, place.shape), 6.12)
    settings_of = {"positions": moved, "radii": radii, "box": [6.12] * 3, "range": 0.4, "gap": 0.03, "drag": 1.0}
    return scene(**{**settings_of, "shear_rate": 1e-3, "until_t": 100.0, "rtol": 1e-3, "times": 2, **changes})


@pytest.mark.slow
def test_a_sheared_packing_keeps_its_balances() -> None:
    """Work of box and flow is that of the symmetric part of the stress; the mean spin is about that of the flow."""
    result = simulate_particles(periodic(times=101))
    assert abs(result.energy["imbalance"]) < 1e-3
    assert result.stats["made"] >= len(result.contacts(0)["i"])
    stress = (result.stress[:, 0, 1] + result.stress[:, 1, 0]) / 2
    work = 6.12**3 * np.trapezoid(stress, result.t * 1e-3)
    # as far as 101 frames resolve it, the first transient among them
    assert result.energy["box"] + result.energy["flow"] == pytest.approx(work, rel=2e-2)
    assert result.spin[-1].mean(axis=0)[2] == pytest.approx(-5e-4, rel=0.5)
    normal = simulate_particles(periodic(tangential=False))
    assert result.stress[-1, 0, 1] > normal.stress[-1, 0, 1]


@pytest.mark.slow
def test_outputs_lie_within_the_steps() -> None:
    """They change no step, and are as close to a run at a hundredth of the tolerance as the ends of steps are."""
    often, seldom = (simulate_particles(periodic(times=count)) for count in (101, 2))
    assert often.stats["steps"] == seldom.stats["steps"] < 100
    np.testing.assert_allclose(often.x[-1], seldom.x[-1], atol=1e-6)  # the tolerance of Newton's iteration
    exact = simulate_particles(periodic(times=101, rtol=1e-5))
    ends = np.isin(often.t, often.step_t)
    assert 1 <= ends.sum() < len(often) / 2
    off = np.abs(often.x - exact.x).max(axis=(1, 2))
    assert off[~ends].max() <= 5 * 1e-3  # a few tolerances, in radii
    for frame in np.flatnonzero(~ends)[::10]:
        T, fine = (result.contacts(int(frame))["T"] for result in (often, exact))
        np.testing.assert_allclose(T, fine, atol=0.02 * np.abs(fine).max())


@pytest.mark.slow
def test_films_alone_turn_particles_with_the_flow() -> None:
    """Without drag, in a sheared box: films carry all of it, and the mean spin is minus half of the shear rate."""
    result = simulate_particles(periodic(drag=0.0))
    assert abs(result.energy["imbalance"]) < 1e-3
    assert result.energy["drag"] == result.energy["flow"] == 0
    # of 27 particles that turn each as its neighbours make it
    np.testing.assert_allclose(result.spin[-1].mean(axis=0), [0, 0, -5e-4], atol=2e-5)


@pytest.mark.parametrize("drag", [0.0, 1.0])
def test_spheres_pulled_along_a_wall_roll(drag: float) -> None:
    """Forwards, pressed against it and pulled along x; energy is accounted for."""
    wall = Wall(np.array([0.0, -1.02]), np.array([0.0, -1.0]))
    pushes = [Push([0, 1], [1e-3, -1e-2])]
    changes = {"positions": [[0, 0], [2.6, 0]], "wall": [wall], "push": pushes, "drag": drag, "range": 0.5}
    result = simulate_particles(scene(until_t=300.0, rtol=1e-4, **changes))
    assert np.all(result.v[-1, :, 0] > 0)
    assert np.all(result.spin[-1] < 0)  # clockwise
    # a film resists sliding more than rolling: the surface by the wall lags behind the centre
    assert np.all(np.abs(result.spin[-1, :, 0]) < result.v[-1, :, 0])
    assert abs(result.energy["imbalance"]) < 2e-4


def test_the_iterative_solver_takes_the_same_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """What it leaves, Newton's iteration corrects: the same positions to its tolerance, over some ten steps."""
    problem = periodic(until_t=20.0, times=2)
    monkeypatch.setattr(linear, "PER_PRODUCT", 1e9)  # products dear: factors
    direct = simulate_particles(problem)
    monkeypatch.setattr(linear, "LARGEST_FACTOR", 0)
    iterated = simulate_particles(problem)
    assert "LU" in direct.stats["linear_solver"]
    assert "BiCGStab" in iterated.stats["linear_solver"]
    np.testing.assert_allclose(iterated.x, direct.x, atol=1e-4)
    np.testing.assert_allclose(iterated.stress, direct.stress, atol=1e-4 * np.abs(direct.stress).max())


@pytest.mark.slow
def test_contacts_come_and_go_without_a_jump_in_tangential_force() -> None:
    """A particle driven past another, neither turning: the force starts from zero and ends at zero."""
    holds = [Hold([0], "xy", [1e-3, 0.0], [0.0]), Hold([1], "xy", None, [0.0])]
    times = list(np.linspace(0, 8000, 401))
    changes = {"positions": [[-4.0, 0.0], [0.0, 2.1]], "range": 0.5, "until_t": 8000.0, "times": times, "hold": holds}
    result = simulate_particles(scene(**changes))
    assert (result.stats["made"], result.stats["dropped"]) == (1, 1)
    size = np.zeros(len(result))
    for k in range(len(result)):
        T = result.contacts(k)["T"]
        size[k] = np.linalg.norm(T[0]) if len(T) else 0.0
    inside = np.flatnonzero(size)
    assert 20 < len(inside) < 380
    assert max(size[inside[0]], size[inside[-1]]) < 0.05 * size.max()


def caged(d: int, seed: int, force: Any, torque: Any, **changes: Any) -> ParticleScene:
    """A sphere between held ones, which it does not quite touch, pushed and turned."""
    draw = np.random.default_rng(seed)
    ways = np.eye(d + 1)[:, :d] - 1 / (d + 1 + math.sqrt(d + 1))  # a simplex, turned at random
    ways -= ways.mean(axis=0)
    ways = ways / np.linalg.norm(ways, axis=1)[:, None] @ np.linalg.qr(draw.normal(size=(d, d)))[0]
    radii = np.array([1.0, *draw.uniform(0.8, 1.2, d + 1)])
    gaps = 10 ** draw.uniform(-2.3, -1.0, d + 1)
    turns = 1 if d == 2 else 3
    push = draw.normal(size=d) * 10 ** draw.uniform(-2.5, -1.7)
    twist = draw.normal(size=turns) * 10 ** draw.uniform(-2.5, -1.7)
    settings = {
        "positions": np.concatenate([np.zeros((1, d)), ways * (radii[1:] + 1 + gaps)[:, None]]),
        "radii": radii,
        "drag": 0.0,
        "gap": None,
        "range": 0.6,
        "push": [Push([0], [force(f) for f in push], [torque(f) for f in twist])],
        "hold": [Hold([k], "xyz"[:d], None, [0.0] * turns) for k in range(1, d + 2)],
        **changes,
    }
    return scene(**settings)


@pytest.mark.slow
@settings(max_examples=6, deadline=None)
@given(d=st.sampled_from([2, 3]), seed=st.integers(0, 2**32 - 1), at=st.sampled_from([0.0, 37.0]))
def test_a_jump_of_forces_is_the_limit_of_ramps(d: int, seed: int, at: float) -> None:
    """Where nothing resists, and surfaces stick: at the start of a run as later, to the tolerance."""
    until, brief, rtol = 100.0, 1e-7, 1e-5
    behind = at + 2 * brief  # a step ends there

    def jumping(size: float) -> Any:
        if not at:
            return ([0.0, behind, until], [size, size, size])
        return ([0.0, at, at, behind, until], [0.3 * size, 0.3 * size, -size, -size, -size])

    def ramp(size: float) -> Any:
        if not at:
            return ([0.0, brief, behind, until], [0.0, size, size, size])
        start = [0.0, brief, at, at + brief, behind, until]
        return (start, [0.0, 0.3 * size, 0.3 * size, -size, -size, -size])

    more = {"times": [0.0, behind, until], "until_t": until, "rtol": rtol}
    jumped, ramped = (simulate_particles(caged(d, seed, drive, drive, **more)) for drive in (jumping, ramp))
    for frame in (1, 2):
        one, other = jumped.contacts(frame), ramped.contacts(frame)
        largest = np.abs(other["F"]).max()
        np.testing.assert_allclose(one["h"], other["h"], rtol=20 * rtol)
        np.testing.assert_allclose(one["F"], other["F"], atol=20 * rtol * largest)
        np.testing.assert_allclose(one["T"], other["T"], atol=20 * rtol * largest)
    assert not jumped.stats["warnings"]


def test_a_run_goes_on_from_a_checkpoint(tmp_path: Any) -> None:
    """Tangential forces and spins are in it: to the bit."""
    whole = simulate_particles(tetrahedron(until_t=20.0, rtol=1e-4))

    def stop(t: float, _steps: int, _iterations: int) -> None:
        if t > 8.0:
            raise KeyboardInterrupt

    path = tmp_path / "run.checkpoint.npz"
    with pytest.raises(KeyboardInterrupt):
        simulate_particles(tetrahedron(until_t=20.0, rtol=1e-4), stop, path)
    again: ParticleResult = simulate_particles(tetrahedron(until_t=20.0, rtol=1e-4), None, path, resume=True)
    np.testing.assert_allclose(again.contact_T, whole.contact_T, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(again.spin, whole.spin, rtol=1e-5, atol=1e-7)


@pytest.mark.slow
def test_a_chain_that_spins_freely_is_at_rest() -> None:
    """In three dimensions nothing resists the spin of two spheres about their line: they have none."""
    pushes = [Push([0], [1e-2, 0, 0]), Push([1], [-1e-2, 0, 0])]
    result = simulate_particles(scene(push=pushes, until_t=100.0))
    np.testing.assert_allclose(result.spin, 0, atol=1e-12)
    assert result.contact_h[-1] < 0.05


# external torques


def coefficients(gap: float) -> tuple[float, float, float]:
    """Friction of sliding and of rolling of two equal undeformed spheres of radius 1, and the lever to mid-gap."""
    _, _, _, A, _, G, _ = functions_of(equal_spheres, UNIT)(gap, 0.0, 1.0, 0.25)
    return float(A), float(G), 1 + gap / 2


@pytest.mark.slow
def test_opposite_torques_roll_a_free_pair() -> None:
    """Without drag: one on the other, at the rate of rolling alone; the pair stays where it is, all work is lost there.

    Nothing slides, so that this rate is there from the start: exact but for Newton's tolerance, 1e-3 rtol.
    """
    torque = 1e-3
    _, G, _ = coefficients(0.05)
    pushes = [Push([0], torque=[0.0, 0.0, torque]), Push([1], torque=[0.0, 0.0, -torque])]
    result = simulate_particles(scene(push=pushes, until_t=100.0))
    rate = torque / (2 * G)
    np.testing.assert_allclose(result.spin, np.tile([[0, 0, rate], [0, 0, -rate]], (5, 1, 1)), atol=1e-8 * rate)
    np.testing.assert_allclose(result.x, np.tile([[0, 0, 0], [2.05, 0, 0]], (5, 1, 1)), atol=1e-12)
    assert result.energy["external"] == pytest.approx(2 * torque * rate * 100.0, rel=1e-8)
    assert result.energy["rolling"] == pytest.approx(result.energy["external"], rel=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("d", [2, 3])
def test_a_sphere_turned_beside_another_drags_it_along(d: int) -> None:
    """Both held in place, without drag: sliding and rolling resist, and the other turns as no torque on it remains.

    With the sum S and the difference D of both rates, A lever^2 S + G D is the torque on the first, and
    A lever^2 S - G D, on the second, is 0. The elastic deformation is there from the start, and stays; rates are those
    of the last stage of a step, to the tolerance.
    """
    torque, axis = 1e-3, [0.0] * (rotations(d) - 1)
    A, G, lever = coefficients(0.05)
    changes = {
        "positions": [[0.0, 0.0, 0.0][:d], [2.05, 0.0, 0.0][:d]],
        "hold": [Hold("all", "xyz"[:d])],
        "push": [Push([0], torque=[*axis, torque])],
    }
    result = simulate_particles(scene(rtol=1e-5, **changes))
    total, difference = torque / (2 * A * lever**2), torque / (2 * G)
    expected = (total + difference) / 2, (total - difference) / 2
    np.testing.assert_allclose(result.spin[:, :, -1], np.tile(expected, (5, 1)), rtol=1e-5)
    assert result.energy["external"] == pytest.approx(torque * expected[0] * 10.0, rel=1e-5)
    assert abs(result.energy["imbalance"]) < 1e-5


@pytest.mark.slow
def test_a_moment_of_forces_balances_a_torque() -> None:
    """Of a free pair without drag; a thousandth more of the torque is refused."""
    force, arm = 1e-3, 2.05
    for torque in (arm * force, 1.001 * arm * force):
        pushes = [Push([0], [0.0, force], [torque]), Push([1], [0.0, -force])]
        problem = scene(positions=[[0.0, 0.0], [arm, 0.0]], push=pushes)
        if torque > arm * force:
            with pytest.raises(IntegrationError, match=r"have the torque 2\.05e-06 at t=0"):
                simulate_particles(problem)
        else:
            result = simulate_particles(problem)
            A, G, lever = coefficients(0.05)
            # the tangential force is what pushes the first; on the second only it and rolling act
            np.testing.assert_allclose(result.contact_T[:, 1], force, rtol=1e-6)
            total, difference = force / (A * lever), lever * force / G
            np.testing.assert_allclose(result.spin[-1, :, 0].sum(), total, rtol=1e-6)
            np.testing.assert_allclose(np.diff(result.spin[-1, ::-1, 0])[0], difference, rtol=1e-6)
            assert abs(result.energy["imbalance"]) < 1e-6


def test_a_hard_sphere_turned_beside_a_wall_goes_with_it_or_spins() -> None:
    """Across the wall's normal, as both resistances and Stokes' drag have it; about the normal, by drag alone."""
    gap, tau = 0.01, 1e-4
    wall = Wall([0.0, -1.0 - gap, 0.0], [0.0, -1.0, 0.0])
    around = {"positions": [[0, 0, 0], [30, 30, 0]], "wall": [wall], "parameters": RIGID, "range": 4.0}
    resists = []
    for motion in range(2):  # along x, about z
        velocity, spin = [1e-9 * (motion == 0), 0.0, 0.0], [0.0, 0.0, 1e-9 * (motion == 1)]
        holds = [Hold([0], "xyz", velocity, spin), Hold([1], "xyz", None, [0, 0, 0])]
        problem = scene(hold=holds, **around)
        system = prepare(problem)
        state = start(system, Newton())
        end = take_step(system, state.contacts, Newton(), 0.0, state.x, state.v, state.y_rate, 1.0).end
        resists.append(end.reaction[0, [0, 5]] / 1e-9)
    by_fluid = np.diag([6 * math.pi, 8 * math.pi])
    v, omega = np.linalg.solve(np.array(resists).T + by_fluid, [0.0, tau])
    pushes = [Push([0], torque=[0.0, tau, tau])]
    result = simulate_particles(scene(push=pushes, drag=1.0, until_t=1e-3, **around))
    assert v < 0  # it rolls
    # the sphere hardly moves; what its film resists across the normal is uniform along the wall
    assert result.v[-1, 0, 0] == pytest.approx(v, rel=1e-4)
    np.testing.assert_allclose(result.spin[-1, 0], [0.0, tau / (8 * math.pi), omega], rtol=1e-4, atol=1e-9 * tau)


@pytest.mark.slow
def test_torques_turn_particles_as_another_route_says() -> None:
    """Four unequal spheres, a torque of another direction on each, in no flow: at a sixth of a turn of the first."""
    times = [0.0, 30.0, 60.0]
    torques = 0.3 * np.array([[1.0, 0.5, -0.5], [0.0, -1.0, 0.2], [0.4, 0.0, 0.8], [-0.6, 0.6, 0.0]])
    pairs = np.triu_indices(4, 1)
    apart = np.linalg.norm(PLACES[:, None] - PLACES[None], axis=2)[pairs] - RADII[pairs[0]] - RADII[pairs[1]]
    x, gaps, T = integrate(equal_spheres, UNIT, PLACES, RADII, np.maximum(apart, 0.1), 0.0, times, torques=torques)
    pushes = [Push([k], torque=list(torque)) for k, torque in enumerate(torques)]
    rtol = 1e-5
    result = simulate_particles(tetrahedron(times=times, until_t=60.0, shear_rate=0.0, push=pushes, rtol=rtol))
    # errors of order rtol in each step, which mostly decay
    np.testing.assert_allclose(result.x, x, atol=5 * rtol)
    np.testing.assert_allclose(result.contact_h.reshape(3, -1), gaps, rtol=5 * rtol)
    np.testing.assert_allclose(result.contact_T.reshape(3, -1, 3), T, atol=5 * rtol * np.abs(T).max())
    assert abs(result.energy["imbalance"]) < rtol


@pytest.mark.slow
@pytest.mark.parametrize("d", [2, 3])
def test_the_work_of_varying_torques_is_in_the_balance(d: int) -> None:
    """What comes in is torque times angular velocity, and all of it is found again."""
    axis = ["0.1*cos(w*t)"] if d == 2 else [0.0, "0.05*t/50", "0.1*cos(w*t)"]
    changes = {"shear_rate": 0.0, "until_t": 50.0, "times": 401, "constants": {"w": 0.1}, "rtol": 1e-4}
    result = simulate_particles(tetrahedron(d, push=[Push([0, 1], torque=axis)], **changes))
    t = result.t
    torque = np.stack([np.zeros_like(t), 0.05 * t / 50, 0.1 * np.cos(0.1 * t)], axis=1)[:, -rotations(d) :]
    power = np.einsum("ta,tia->t", torque, result.spin[:, :2])
    # Simpson's rule over 400 intervals: far below the tolerance
    assert result.energy["external"] == pytest.approx(simpson(power, x=t), rel=1e-3)
    assert result.energy["external"] > 0
    assert abs(result.energy["imbalance"]) < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("changes", [{"shear_rate": 1e-3}, {"shear_rate": 0.0, "stress": {"xy": 1e-3}}])
@pytest.mark.parametrize("drag", [0.0, 1.0])
def test_torques_in_a_periodic_box_keep_its_balances(changes: dict[str, Any], drag: float) -> None:
    """Also where their sum is not 0, and makes the stress unsymmetric; films resist that all turn alike."""
    pushes = [Push("all", torque=[0.0, 0.0, 1e-2]), Push([3], torque=["1e-2*sin(t)", 0.0, 0.0])]
    result = simulate_particles(periodic(drag=drag, until_t=30.0, push=pushes, **changes))
    assert abs(result.energy["imbalance"]) < 1e-3
    # forces are balanced to 1e-3 rtol, and an imposed stress to ten times that
    assert np.all(result.step_residual <= (1e-5 if "stress" in changes else 1e-6))
    without = simulate_particles(periodic(drag=drag, until_t=30.0, **changes))
    assert np.all(result.spin[-1, :, 2] > without.spin[-1, :, 2])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"push": [Push([0], torque=[0, 0, 1e-3])]}, "have the torque 0.001 at t=0.*drag"),
        # about the line of their contact
        (
            {"push": [Push([0], torque=[1e-3, 0, 0]), Push([1], torque=[-1e-3, 0, 0])]},
            "nothing resists the external torque on particles 0, 1: .*drag",
        ),
        # beyond the range of any contact, held in place
        (
            {
                "positions": [[0.0, 0.0], [2.05, 0.0], [9.0, 0.0]],
                "range": 1.0,
                "hold": [Hold([2], "xy"), Hold([0], "xy")],
                "push": [Push([2], torque=[1e-3])],
            },
            "nothing resists the external torque on particle 2: .*drag",
        ),
    ],
)
def test_a_torque_that_nothing_resists_is_named(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(IntegrationError, match=words):
        simulate_particles(scene(**changes))


def test_a_checkpoint_belongs_to_its_torques() -> None:
    def key(torque: Any) -> str:
        problem = scene(push=[Push([0], torque=torque)], drag=1.0)
        return fingerprint(prepare(problem))

    assert key([0.0, 0.0, 1e-3]) == key((0.0, 0.0, 1e-3)) == key(np.array([0.0, 0.0, 1e-3]))
    assert key([0.0, 0.0, 1e-3]) != key([0.0, 0.0, 2e-3])


@pytest.mark.slow
@pytest.mark.parametrize("phi", [0.3, 0.4])
def test_the_viscosity_of_a_dense_suspension_lies_within_the_envelope_of_known_laws(phi: float) -> None:
    """Films and Stokes' drag make all of it but for what each sphere does by itself, Einstein's 5/2 phi."""
    text = particle_scenes()["spheres"].read_text().replace("fraction = 0.4", f"fraction = {phi}")
    result = simulate_particles(particle_scene_from(tomllib.loads(text), Path()))
    steady = result.t >= 0.75  # the first transient is over
    found = float(relative_viscosity(result)[steady].mean()) + 2.5 * phi
    known = known_laws(phi).values()
    assert min(known) < found < max(known)
    assert np.all(result.contact_h > 0)
    # nearly rigid: no surface gives in by a thousandth of the radius
    assert float(result.contacts(-1)["delta"].max()) < 1e-3
    assert abs(result.energy["imbalance"]) < 2e-3


@pytest.mark.slow
def test_a_sphere_with_one_contact_is_not_floppy_in_space() -> None:
    """A free pair in three dimensions under opposite tangential forces and the torque that balances them."""
    pushes = [Push([0], [0, 1e-4, 0]), Push([1], [0, -1e-4, 0], torque=[0, 0, 2.05e-4])]
    result = simulate_particles(
        scene(positions=[[0.0, 0, 0], [2.05, 0, 0]], radii=1.0, gap=0.05, push=pushes, until_t=10.0, times=2, drag=0.0)
    )
    # surfaces slide as they are pushed; how the pair turns as a whole, nothing tells
    v, spin = result.v[-1, :, 1], result.spin[-1, :, 2]
    assert v[0] - v[1] + spin.sum() > 0
    assert abs(result.energy["imbalance"]) < 1e-3


@pytest.mark.slow
def test_a_sphere_does_not_spin_about_the_line_of_its_only_contact() -> None:
    """No film resists that, and nothing starts it: as the line turns, a rotation across it does not become one along.

    Such a rotation would turn the tangential force about the line.
    """
    turned = {}
    for rtol in (1e-4, 1e-6):
        holds = [Hold([0], "xyz", spin=[0.0, 0.1, 0.02]), Hold([1], "xyz", velocity=[-0.02, 0.1, 0.03])]
        places = [[0.0, 0.0, 0.0], [1.99, 0.0, 0.0]]
        result = simulate_particles(scene(positions=places, gap=0.02, hold=holds, rtol=rtol))
        way = result.x[:, 1] - result.x[:, 0]
        n = way / np.linalg.norm(way, axis=1)[:, None]
        assert np.degrees(np.arccos(n[0] @ n[-1])) > 20
        spin = result.arrays["spin"][1:, 1]
        along = np.abs(np.sum(spin * n[1:], axis=1)) / np.linalg.norm(spin, axis=1)
        assert along.max() < 1e-3 * rtol**0.5
        turned[rtol] = result.contacts(-1)["T"]
    np.testing.assert_allclose(turned[1e-4], turned[1e-6], atol=3e-4 * np.abs(turned[1e-6]).max())
