"""A box under an imposed stress, and walls that move."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from softdyn.errors import IntegrationError, SceneError
from softdyn.expression import evaluate, parse
from softdyn.particles.files import read_particle_scene
from softdyn.particles.force_balance import Balance, Newton, StageInput, balance
from softdyn.particles.geometry import Wall
from softdyn.particles.mechanisms.stress import condensed, excess
from softdyn.particles.observables import strain
from softdyn.particles.particle_keys import Hold, ParticleScene
from softdyn.particles.particle_run import prepare, simulate_particles
from softdyn.particles.results import ParticleResult
from softdyn.particles.start import start
from softdyn.particles.surroundings import coordinates, placed
from softdyn.particles.system import System
from softdyn.particles.until import run_end

Array = NDArray[np.float64]
ETA = 1.0


def packing(d: int = 2, **changes: Any) -> ParticleScene:
    """A periodic, disturbed packing of pressed particles."""
    draw = np.random.default_rng(2)
    if d == 2:
        place = np.array([[i + 0.5 * (j % 2), j * np.sqrt(3) / 2] for j in range(6) for i in range(6)]) * 1.8
        box = np.array([6, 3 * np.sqrt(3)]) * 1.8
    else:
        cell = np.array([[0, 0, 0], [1, 1, 0], [1, 0, 1], [0, 1, 1]]) * 1.9 / np.sqrt(2)
        edge = 1.9 * np.sqrt(2)
        place = np.concatenate([cell + np.array(k) * edge for k in np.ndindex(3, 3, 3)])
        box = np.full(3, 3 * edge)
    settings: dict[str, Any] = {
        "law": "rognon_gay",
        "parameters": {"E": 1.0, "eta": ETA},
        "positions": np.mod(place + 0.05 * draw.uniform(-1, 1, place.shape), box),
        "radii": 1 + 0.05 * draw.uniform(-1, 1, len(place)),
        "box": list(box),
        "range": 0.4,
        "gap": 0.05,
        "until_t": 300.0,
        "times": 4,
        "rtol": 1e-4,
        **changes,
    }
    return ParticleScene(**settings)


def total_stress(result: ParticleResult) -> Array:
    """Stress of contacts and fluid at each frame."""
    return result.stress + ETA * (result.gradient + result.gradient.transpose(0, 2, 1))


@pytest.mark.parametrize("drag", [0.0, 1.0])
@pytest.mark.parametrize(
    ("d", "stress", "shear_rate"),
    [
        (2, {"xy": "2e-3 + 1e-6*t"}, 0.0),
        (2, {"pressure": 0.05}, 0.0),
        (2, {"pressure": 0.04}, 1e-4),
        (2, {"yy": -0.03, "xy": 1e-3}, 0.0),
        (3, {"zz": -0.03}, 1e-4),
    ],
)
def test_the_stress_is_as_imposed(d: int, stress: dict[str, Any], shear_rate: float, drag: float) -> None:
    """At the end of each step, to ten times the tolerance of the force balance; no other part of the box gives in."""
    result = simulate_particles(packing(d, stress=stress, shear_rate=shear_rate, drag=drag))
    tolerance = 10 * min(1e-3 * 1e-4, 1e-6)
    assert np.all(result.step_residual <= tolerance)
    assert abs(result.energy["imbalance"]) < 1e-3
    total, size = total_stress(result), np.abs(result.stress).sum(axis=(1, 2)).max()
    expected = {
        name: [evaluate(parse(value), float(t)) for t in result.t] if isinstance(value, str) else value
        for name, value in stress.items()
    }
    for name, value in expected.items():
        if name == "pressure":
            found = -np.trace(total, axis1=1, axis2=2) / d
        else:
            found = total[:, "xyz".index(name[0]), "xyz".index(name[1])]
        # from the first step on; the stress at the start is what it is. Forces are the larger, contacts pull and push
        np.testing.assert_allclose(found[1:], np.broadcast_to(value, found.shape)[1:], atol=100 * tolerance * size)
    edges = np.diagonal(result.cell, axis1=1, axis2=2)
    for axis, name in enumerate("xyz"[:d]):
        gives_in = "pressure" in stress or 2 * name in stress
        assert (np.ptp(edges[:, axis]) > 1e-6) == gives_in
    if "pressure" in stress:  # keeps its shape
        np.testing.assert_allclose(edges / edges[:1], np.tile(edges[:, :1] / edges[:1, :1], d), rtol=1e-12)
    if "xy" not in stress:
        assert np.all(result.gradient[:, 0, 1] == shear_rate)


@pytest.mark.slow
@pytest.mark.parametrize("drag", [0.0, 1.0])
def test_the_stress_is_as_imposed_with_tangential_forces(drag: float) -> None:
    """These have a part in the stress, and in the work of the box."""
    changes: dict[str, Any] = {"law": "equal_spheres", "parameters": {"E": 1.0, "eta": ETA, "nu": 0.5}}
    stress = {"pressure": 0.05, "xy": 1e-3}
    result = simulate_particles(packing(**changes, tangential=True, stress=stress, drag=drag))
    assert np.all(result.step_residual <= 1e-6)
    total = total_stress(result)[1:]
    np.testing.assert_allclose(-np.trace(total, axis1=1, axis2=2) / 2, 0.05, rtol=1e-4)
    np.testing.assert_allclose((total[:, 0, 1] + total[:, 1, 0]) / 2, 1e-3, rtol=1e-3)
    assert np.abs(result.contact_T).max() > 0
    assert abs(result.energy["imbalance"]) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("drag", [0.0, 1.0])
def test_the_stress_of_a_shear_flow_imposed_gives_back_the_flow(drag: float) -> None:
    """The stress measured at a fixed rate, as a polynomial of t, imposed: the same strain, and the same gaps."""
    until = 1000.0
    sheared = simulate_particles(packing(shear_rate=1e-4, until_t=until, drag=drag, times=101, rtol=1e-5))
    stress = sheared.stress[:, 0, 1] + ETA * 1e-4
    late = sheared.t >= 0.02 * until  # with drag, particles first come to rest in the flow
    fit = np.polynomial.polynomial.polyfit(sheared.t[late] / until, stress[late], 12)
    missed = np.abs(np.polynomial.polynomial.polyval(sheared.t / until, fit) - stress).max() / stress.max()
    text = " + ".join(f"({float(factor)!r})*(t/{until})**{power}" for power, factor in enumerate(fit))
    imposed = simulate_particles(packing(stress={"xy": text}, until_t=until, drag=drag, times=11, rtol=1e-5))
    strain = imposed.cell[:, 0, 1] / imposed.cell[:, 1, 1]
    # what is missed of the stress, relative to its largest, is missed of the strain of 0.1 at which it is reached
    np.testing.assert_allclose(strain, 1e-4 * imposed.t, atol=0.1 * (10 * missed + 1e-4))
    if drag == 0:
        assert missed < 1e-5  # the tolerance of a step, which outputs within it have
        np.testing.assert_allclose(imposed.gradient[1:, 0, 1], 1e-4, rtol=1e-3)
        np.testing.assert_allclose(imposed.contacts(-1)["h"], sheared.contacts(-1)["h"], rtol=1e-3)


@pytest.mark.slow
def test_the_work_of_the_pressure_is_that_of_the_box_and_the_flow() -> None:
    """-integral of P dV, as it rises from that at the start; the rest goes to the fluid, 2 eta D : D."""
    first = simulate_particles(packing(drag=1.0, until_t=1.0, times=2))
    p0 = -float(np.trace(first.stress[0])) / 2
    result = simulate_particles(
        packing(drag=1.0, stress={"pressure": f"{p0!r} + 2e-5*t"}, until_t=2000.0, times=401, rtol=1e-5)
    )
    V = np.linalg.det(result.cell) * float(result.depth)
    assert V[-1] < 0.95 * V[0]
    work = -np.trapezoid(p0 + 2e-5 * result.t, V)
    rate = result.gradient[:, 0, 0]
    # 2 eta D : D = 4 eta rate^2 in two dimensions
    viscous = np.trapezoid(4 * ETA * rate**2 * V, result.t)
    assert 0 < viscous < 1e-2 * work
    assert result.energy["box"] + result.energy["flow"] == pytest.approx(work - viscous, rel=1e-3)
    assert abs(result.energy["imbalance"]) < 1e-4


@pytest.mark.parametrize("drag", [0.0, 1.0])
@pytest.mark.parametrize("names", [("xy",), ("pressure",), ("xx", "yy")])
def test_the_condensed_matrix_is_the_derivative_of_the_stress(names: tuple[str, ...], drag: float) -> None:
    """By central differences, with all forces balanced at each: to the rounding of these."""
    scene = packing(stress=dict.fromkeys(names, 0.01), drag=drag, rtol=1e-8)
    system = prepare(scene)
    newton, stress = Newton(), system.leader
    state = start(system, newton)
    s, z = 5.0, coordinates(system, 0.0)
    nothing = np.zeros(len(state.contacts))
    guess = np.linspace(1e-4, 2e-4, len(names))

    def at(rates: Array, x: Array) -> tuple[System, Balance]:
        here, _ = placed(system, s, s, z, rates)
        return here, balance(here, state.contacts, newton, StageInput(s, s, state.x, nothing), x, nothing.copy())

    here, found = at(guess, state.x)
    newton.forget()  # and factorise next to the balance
    here, found = at(guess, found.x + 1e-5 * np.sin(np.arange(found.x.size)).reshape(found.x.shape))
    S, _ = condensed(stress, here, state.contacts, newton, found, s)
    step = 1e-6
    for k in range(len(names)):
        ends = []
        for sign in (1, -1):
            moved = guess.copy()
            moved[k] += sign * step
            other, balanced = at(moved, found.x)
            ends.append(excess(stress, other, state.contacts, balanced, s))
        np.testing.assert_allclose(S[:, k], (ends[0] - ends[1]) / (2 * step), rtol=1e-3, atol=1e-3 * np.abs(S).max())


@pytest.mark.slow
def test_a_run_under_an_imposed_stress_resumes(tmp_path: Path) -> None:
    scene = packing(stress={"pressure": 0.04, "xy": 1e-3}, drag=1.0)
    whole = simulate_particles(scene)

    def interrupt(t: float, steps: int, iterations: int) -> None:
        if t > 100:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_particles(scene, interrupt, tmp_path / "a.npz")
    resumed = simulate_particles(scene, None, tmp_path / "a.npz", resume=True)
    np.testing.assert_allclose(resumed.cell, whole.cell, atol=1e-6)
    np.testing.assert_allclose(resumed.x, whole.x, atol=1e-5)
    with pytest.raises(KeyboardInterrupt):
        simulate_particles(scene, interrupt, tmp_path / "a.npz")
    with pytest.raises(SceneError, match="belongs to another scene"):
        simulate_particles(replace(scene, stress={"pressure": 0.04}), None, tmp_path / "a.npz", resume=True)


@pytest.mark.slow
@pytest.mark.parametrize("tangential", [False, True])
def test_a_wall_that_comes_is_a_particle_that_goes_to_it(tangential: bool) -> None:
    """The same gaps and the same work, whichever of the two moves; both by the same Runge-Kutta stages.

    With tangential forces it comes aslant, and they are the same.
    """
    law = {"law": "equal_spheres", "parameters": {"E": 1.0, "eta": 1.0, "nu": 0.5}, "tangential": True}
    plain = {"law": "rognon_gay", "parameters": {"E": 1.0, "eta": 1.0}}
    settings: dict[str, Any] = law if tangential else plain
    speed, constants = "v*(1 - cos(w*t))", {"v": 4e-4, "w": 2e-2}
    results = []
    for wall, held in ((speed, 0.0), (0.0, f"-{speed}")):
        scene = ParticleScene(
            positions=[[0.0, 1.3], [9.0, 1.3]],
            radii=1.0,
            wall=[Wall(np.zeros(2), np.array([0.0, -1.0]), velocity=[wall if tangential else 0.0, wall])],
            hold=[Hold([0, 1], "xy", [held if tangential else 0.0, held])],
            range=0.8,
            constants=constants,
            until_t=900.0,
            times=10,
            rtol=1e-5,
            **settings,
        )
        results.append(simulate_particles(scene))
    moved, still = results
    assert moved.contacts(-1)["h"][0] < 0.25
    assert moved.contacts(-1)["F"][0] > 0
    np.testing.assert_allclose(moved.contact_h, still.contact_h, rtol=1e-8)
    assert moved.energy["external"] == pytest.approx(still.energy["external"], rel=1e-8)
    assert abs(moved.energy["imbalance"]) < 1e-4
    if tangential:
        assert np.abs(moved.contact_T).max() > 1e-3 * np.abs(moved.contact_F).max()
        np.testing.assert_allclose(moved.contact_T, still.contact_T, rtol=1e-6, atol=1e-9)
    risen = 4e-4 * (moved.t - np.sin(2e-2 * moved.t) / 2e-2)
    np.testing.assert_allclose(moved.wall_point[:, 0, 1], risen, atol=1e-4)


@pytest.mark.slow
def test_a_fast_wall_passes_nobody() -> None:
    """From beyond the range of any contact, in long steps: the contact is found in time."""
    scene = ParticleScene(
        law="rognon_gay",
        parameters={"E": 1.0, "eta": 1.0},
        positions=[[0.0, 5.0], [9.0, 5.0]],
        radii=1.0,
        wall=[Wall(np.zeros(2), np.array([0.0, -1.0]), velocity=[0.0, 0.01])],
        range=0.5,
        drag=1.0,
        until_t=1000.0,
        times=3,
        rtol=1e-2,
    )
    result = simulate_particles(scene)
    # swept along: at the velocity of the wall, but for what the film still thins
    np.testing.assert_allclose(result.v[-1, :, 1], 0.01, rtol=0.1)
    assert np.all(result.x[-1, :, 1] > result.wall_point[-1, 0, 1])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"stress": {"xyz": 1.0}}, "unknown component 'xyz'"),
        ({"stress": {"zz": 1.0}}, "unknown component 'zz'"),
        ({"stress": {"xy": 1.0}, "shear_rate": 1e-3, "drag": 1.0}, "give one of them"),
        ({"stress": {"pressure": 1.0, "yy": 1.0}}, "give either"),
        ({"stress": {"xy": 1.0}, "hold": [Hold([0], "x")]}, "do not move with a box"),
        ({"stress": {"xy": 1.0}, "stress_viscosity": -1.0}, "must be a positive number"),
        ({"stress_viscosity": 1.0}, "none is"),
        ({"stress": {"xy": "1/t"}}, "no finite value at t = 0"),
        ({"stress": {"xy": 1.0}, "box": None, "gap": None, "radii": 0.5}, "periodic along all axes"),
    ],
)
def test_bad_stresses_are_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        simulate_particles(packing(**changes))


def test_a_stress_that_ends_leaves_the_last_good_state() -> None:
    with pytest.raises(IntegrationError, match=r"xy = '1e-3\*sqrt\(100-t\)' has no finite value at t=") as error:
        simulate_particles(packing(stress={"xy": "1e-3*sqrt(100-t)"}))
    assert isinstance(error.value.partial, ParticleResult)
    assert 0 < error.value.partial.step_t[-1] <= 100


def test_stresses_and_velocities_of_walls_are_read_from_files(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(
        """
law = "rognon_gay"
parameters = {E = 1.0, eta = 1.0}
packing = {kind = "hexagonal", cells = [6, 3], spacing = 1.9, radii = 1.0}
contacts = {gap = 0.05, range = 0.4}
stress = {pressure = "p*(1 + t/100)", xy = 1e-3, viscosity = 2.0}
constants = {p = 0.03}
until = {t = 100.0}
"""
    )
    scene = read_particle_scene(path)
    assert scene.stress == {"pressure": "p*(1 + t/100)", "xy": 1e-3}
    result = simulate_particles(scene)
    total = result.stress[-1] + 2.0 * (result.gradient[-1] + result.gradient[-1].T)
    assert -np.trace(total) / 2 == pytest.approx(0.06, rel=1e-4)
    assert total[0, 1] == pytest.approx(1e-3, rel=1e-2)
    path.write_text(
        """
law = "rognon_gay"
parameters = {E = 1.0, eta = 1.0}
particles = {positions = [[0.0, 1.5], [4.0, 1.5]], radii = 1.0}
flow = {drag = 1.0}
wall = [{point = [0, 0], normal = [0, -1], velocity = [0, "1e-3*t/10"]}]
until = {t = 10.0}
"""
    )
    assert simulate_particles(read_particle_scene(path)).wall_point[-1, 0, 1] == pytest.approx(5e-3)
    path.write_text(path.read_text().replace('[0, "1e-3*t/10"]', "[1.0]"))
    with pytest.raises(SceneError, match="wall 0: velocity needs 2 components"):
        simulate_particles(read_particle_scene(path))


def test_a_run_under_an_imposed_shear_stress_ends_at_a_strain() -> None:
    """Exactly there, with a frame of it, which is that of a run that goes on to a later time."""
    creeping = packing(stress={"xy": 2e-3}, drag=1.0, until_t=1e5, until_strain=0.02, times=[0.0])
    result = simulate_particles(creeping)
    lean = result.cell[-1, 0, 1] / result.cell[-1, 1, 1]
    assert lean == pytest.approx(0.02, rel=1e-8)
    assert result.t[-1] < 1e5
    onward = simulate_particles(replace(creeping, until_strain=None, until_t=2 * result.t[-1], times=[result.t[-1]]))
    passed = onward.cell[0, 0, 1] / onward.cell[0, 1, 1]
    assert passed == pytest.approx(0.02, rel=1e-3)  # ten times the tolerance of a step


#: Up to the strain 0.02: a rate that swings, a table of it, and one that changes its sign before it gets there.
STRAINED = {
    "expression": ("g*w*cos(w*t)", math.asin(0.4) / 0.02),
    "table": (([0.0, 10.0, 10.0, 100.0], [1e-3, 1e-3, 2e-3, 2e-3]), 15.0),
    "turning": ("-1e-3 + 1e-4*t", 10 + 10 * math.sqrt(1 + 4)),
}


@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize("until_t", [None, 90.0])
@pytest.mark.parametrize("name", list(STRAINED))
def test_a_run_under_a_given_shear_rate_ends_at_a_strain(name: str, until_t: float | None, periodic: bool) -> None:
    """The first time that the integral of the rate has it, known before the run; without a periodic box, too."""
    rate, end = STRAINED[name]
    constants = {"g": 0.05, "w": 0.02} if name == "expression" else {}
    box = {} if periodic else {"box": None, "gap": 0.05}
    scene = packing(shear_rate=rate, constants=constants, drag=1.0, until_t=until_t, until_strain=0.02, times=2, **box)
    result = simulate_particles(scene)
    assert result.t[-1] == pytest.approx(end, rel=1e-14)
    if periodic:  # elsewhere the integral is that of a line through the frames
        assert abs(strain(result)[-1]) == pytest.approx(0.02, rel=1e-12)


def test_a_time_that_comes_before_the_strain_ends_the_run() -> None:
    scene = packing(
        shear_rate="g*w*cos(w*t)", constants={"g": 0.05, "w": 0.02}, drag=1.0, until_t=5.0, until_strain=0.06
    )
    assert run_end(scene) == 5.0
    # 0.05 is the largest strain that there is
    assert run_end(replace(scene, until_t=1e3)) == 1e3
    assert run_end(replace(scene, until_t=1e3, until_strain=0.05 * (1 - 1e-12))) == pytest.approx(
        math.pi / 0.04, rel=1e-5
    )


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"until_strain": 0.1}, r"\[until\] strain needs \[flow\] shear_rate, or \[stress\] xy"),
        ({"until_strain": 0.1, "until_t": None, "stress": {"xy": 1e-3}}, r"\[until\] t is missing.* never be reached"),
        (
            {"until_strain": 0.1, "until_t": None, "shear_rate": "1e-3*exp(-t)"},
            "is not reached before .* give .until. t",
        ),
        ({"until_strain": 0.1, "until_t": None, "shear_rate": "1e-3*sin(t)"}, "0 at the start, needs .until. t"),
        ({"until_t": None}, r"\[until\] needs t, strain, or both"),
        ({"until_strain": 0.0, "stress": {"xy": 1e-3}}, "must be a number other than 0"),
    ],
)
def test_a_strain_that_is_no_end_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        simulate_particles(packing(drag=1.0, **changes))


@pytest.mark.slow
def test_a_shear_rate_that_changes_is_followed() -> None:
    """The box leans by the integral of its rate, energy is in balance; a constant may be given as text."""
    swings = packing(shear_rate="g*w*cos(w*t)", constants={"g": 0.05, "w": 0.02}, drag=1.0, until_t=500.0, times=26)
    result = simulate_particles(swings)
    np.testing.assert_allclose(strain(result), 0.05 * np.sin(0.02 * result.t), atol=1e-15)
    np.testing.assert_allclose(result.gradient[:, 0, 1], 1e-3 * np.cos(0.02 * result.t), rtol=1e-9, atol=1e-12)
    finer = simulate_particles(replace(swings, rtol=1e-5))
    expected = [one.stats["energy_error_expected"] for one in (finer, result)]
    assert abs(finer.energy["imbalance"]) < expected[0] < expected[1] / 4 < 2.5e-3
    assert abs(result.energy["imbalance"]) < 1e-4
    number, text = (simulate_particles(packing(shear_rate=rate, drag=1.0)) for rate in (1e-4, "1e-4"))
    np.testing.assert_allclose(text.x, number.x, atol=1e-4)


def test_a_lone_particle_goes_with_a_flow_that_changes() -> None:
    """X = x0 + y times the strain, in a flow without a box."""
    flow = ParticleScene(
        law="rognon_gay", parameters={"E": 1.0, "eta": ETA}, positions=[[0.0, 0.0], [0.0, 9.0]], radii=1.0, range=0.5,
        shear_rate="1e-2*sin(0.1*t)", drag=1.0, until_t=60.0, times=7, rtol=1e-5,
    )  # fmt: skip
    result = simulate_particles(flow)
    np.testing.assert_allclose(result.x[:, 1, 0], 9 * 0.1 * (1 - np.cos(0.1 * result.t)), atol=1e-3)


def test_a_shear_rate_that_is_no_expression_is_refused() -> None:
    with pytest.raises(SceneError, match="is not part of the grammar"):
        simulate_particles(packing(shear_rate="__import__('os')", drag=1.0))
    with pytest.raises(SceneError, match=r"\[flow\] shear_rate must be a finite number, an expression"):
        simulate_particles(packing(shear_rate=[1.0], drag=1.0))
