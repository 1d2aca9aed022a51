"""Explicit steps of grains: collisions, invariants, energies, order; the same to the bit whatever the threads."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from softdyn.errors import IntegrationError, SceneError
from softdyn.particles import (
    Friction,
    Gravity,
    Hold,
    Inertia,
    ParticleScene,
    Push,
    Wall,
    lattice_packing,
    load,
    simulate,
)
from softdyn.particles.explicit import steps
from softdyn.particles.explicit.explicit_run import prepare
from softdyn.particles.explicit.given import given_over
from softdyn.particles.explicit.touching import accelerations, touching
from softdyn.particles.mechanisms.inertia import start_velocities
from softdyn.particles.particle_scene import check

Array = NDArray[np.float64]
E, NU, R, RHO = 1e5, 0.3, 0.5, 2.0
MASS = RHO * 4 / 3 * math.pi * R**3
STAR = E / (2 * (1 - NU**2))  # F = 4/3 E* sqrt(R_eff) x^(3/2), R_eff = R/2
HERTZ: dict[str, Any] = {"law": "hertz_dry", "parameters": {"E": E, "nu": NU}, "inertia": Inertia(RHO), "times": 2}


def crowd(d: int, cells: int, **changes: Any) -> ParticleScene:
    """Grains of three sizes, pressed together on a disturbed lattice in a sheared box, with random velocities."""
    draw = np.random.default_rng(1)
    x, lengths = lattice_packing("hexagonal" if d == 2 else "fcc", [cells] * d, 0.6)
    count = len(x)
    given: dict[str, Any] = {
        **HERTZ, "positions": x + draw.uniform(-0.01, 0.01, x.shape), "radii": draw.choice([0.29, 0.3, 0.31], count),
        "velocities": draw.normal(0, 0.3, (count, d)), "spins": draw.normal(0, 1, (count, 2 * d - 3)),
        "box": list(lengths), "shear_rate": 0.3, "until_t": 0.05, "rtol": 1e-2,
        "friction": Friction(0.5, rolling=0.05, twisting=0.02 if d == 3 else 0.0),
    }  # fmt: skip
    return ParticleScene(**{**given, **changes})


def head_on(speed: float, **changes: Any) -> ParticleScene:
    """Two grains on one line, a thousandth of the diameter apart."""
    return ParticleScene(
        **{**HERTZ, "positions": [[0.0], [1.001]], "radii": R, "velocities": [[speed / 2], [-speed / 2]], **changes}
    )


def lasts(speed: float) -> float:
    """How long Hertz's collision takes (Johnson 1985, sec. 11.4)."""
    return 2.868265 * ((MASS / 2) ** 2 / (R / 2 * STAR**2 * speed)) ** 0.2


def measured(speed: float, rtol: float) -> float:
    """The same, from where the grains are behind it."""
    until = 1e-3 / speed + 1.5 * lasts(speed)
    result = simulate(head_on(speed, until_t=until, rtol=rtol))
    return until - 1e-3 / speed - float(result.x[-1, 1, 0] - result.x[-1, 0, 0] - 1.0) / speed


@pytest.mark.parametrize("speed", [1e-3, 0.1])
def test_a_collision_takes_the_time_of_hertz(speed: float) -> None:
    """Within 1e-4 at the tolerance by default, and what was the relative velocity is it again."""
    assert measured(speed, 1e-4) == pytest.approx(lasts(speed), rel=1e-4)
    result = simulate(head_on(speed, until_t=1e-3 / speed + 1.5 * lasts(speed)))
    np.testing.assert_allclose(result.v[-1, :, 0], [-speed / 2, speed / 2], rtol=1e-5)


@pytest.mark.parametrize("z", [0.03, 0.3])
def test_a_linear_dashpot_gives_the_known_restitution(z: float) -> None:
    """As in implicit steps: while surfaces overlap their dashpot may pull, as the closed form has it."""
    k = 50.0
    c = 2 * z * math.sqrt(k * MASS / 2)
    linear = {"law": "linear_spring", "parameters": {"k": k, "c": c}, "method": "explicit"}
    result = simulate(head_on(0.1, until_t=0.01 + 1.5 * math.pi * math.sqrt(MASS / 2 / k), rtol=1e-5, **linear))
    left = float(result.v[-1, 1, 0] - result.v[-1, 0, 0]) / 0.1
    assert left == pytest.approx(math.exp(-math.pi * z / math.sqrt(1 - z**2)), rel=2e-3)


def test_the_method_is_of_second_order() -> None:
    """A tolerance is one of frequencies, which steps change by their square: the error falls as the tolerance."""
    errors = [abs(measured(0.1, rtol) / lasts(0.1) - 1) for rtol in (1e-3, 1e-4, 1e-5)]
    assert errors[0] < 1e-3
    assert errors[1] < 0.2 * errors[0]
    assert errors[2] < 0.2 * errors[1]


@pytest.mark.slow
@pytest.mark.parametrize("d", [2, 3])
def test_compiled_forces_are_those_of_arrays(d: int) -> None:
    """Of contacts across faces of a sheared box too, and after their lists were made anew."""
    facts = check(crowd(d, 8 if d == 2 else 4))
    system = prepare(facts)
    state = steps.start_of(system, *start_velocities(facts, []))
    with ThreadPoolExecutor(1) as pool:
        while state.counts["listings"] < 3:
            steps._stretch(system, state, 1.0, pool)
    contacts = touching(system, state, *steps.walls_at(system, state.t))
    assert len(contacts) > 20
    assert np.abs(contacts.history).max(axis=0).min() > 0
    given = given_over(system, system.groups, np.array([state.t, state.t + 1e-6]), np.zeros(2))
    expected = accelerations(system, state, contacts, given)
    np.testing.assert_allclose(state.rate_v, expected, atol=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize("d", [2, 3])
def test_momentum_and_angular_momentum_are_conserved(d: int) -> None:
    """To rounding, through collisions with friction, rolling and twisting."""
    result = simulate(crowd(d, 5 if d == 2 else 2, box=None, shear_rate=0.0, until_t=0.2))
    masses = RHO * 4 / 3 * math.pi * result.radii**3
    momentum = np.einsum("i,fia->fa", masses, result.v)
    np.testing.assert_allclose(momentum[-1], momentum[0], atol=1e-12 * masses.sum())
    x, v = result.x, result.v
    turning = (x[..., :1] * v[..., 1:] - x[..., 1:] * v[..., :1]) if d == 2 else np.cross(x, v)
    spins = 0.4 * (masses * result.radii**2)[:, None] * result.spin
    angular = np.sum(masses[:, None] * turning + spins, axis=1)
    np.testing.assert_allclose(angular[-1], angular[0], atol=1e-12 * np.abs(turning).sum())
    assert result.energy["friction"] > 0


@pytest.mark.parametrize("d", [2, 3])
def test_the_balance_of_energy_closes_with_the_step(d: int) -> None:
    """What the sheared box gives is kinetic, stored, or rubbed away; what is left over falls with the tolerance."""
    left = [simulate(crowd(d, 8 if d == 2 else 4, rtol=rtol)).energy["imbalance"] for rtol in (1e-2, 1e-4)]
    assert abs(left[0]) < 3e-3
    assert abs(left[1]) < 1e-4


def test_results_do_not_depend_on_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """To the last bit."""
    found = []
    monkeypatch.setattr(steps, "SMALLEST_BLOCK", 8)
    for threads in (1, 2, 3):
        monkeypatch.setattr(steps, "threads_for", lambda system, threads=threads: threads)
        found.append(simulate(crowd(3, 4, target="c")))
    for other in found[1:]:
        for name in ("x", "v", "spin", "contact_T", "stress", "energy_friction", "energy_box"):
            np.testing.assert_array_equal(found[0].arrays[name], other.arrays[name])


@pytest.mark.slow
def test_both_targets_make_the_same_steps() -> None:
    pytest.importorskip("numba")
    one, other = (simulate(crowd(2, 6, target=target)) for target in ("c", "numba"))
    np.testing.assert_allclose(one.x, other.x, atol=1e-12)


@pytest.mark.slow
def test_a_resumed_run_is_the_same_to_the_last_bit(tmp_path: Path) -> None:
    scene = crowd(2, 8, times=6)
    whole = simulate(scene)

    def stop(t: float, steps_made: int, iterations: int) -> None:
        if t > 0.5 * 0.05:
            raise KeyboardInterrupt

    file = tmp_path / "run.checkpoint.npz"
    with pytest.raises(KeyboardInterrupt):
        simulate(scene, stop, checkpoint=file)
    again = simulate(scene, checkpoint=file, resume=True)
    assert not file.exists()
    for name, array in whole.arrays.items():
        np.testing.assert_array_equal(array, again.arrays[name], err_msg=name)
    read = load(again.save(tmp_path / "run.npz"))
    assert read.stats["method"].startswith("explicit")
    read.plot()


@pytest.mark.slow
def test_what_is_given_is_followed() -> None:
    """A held grain moves as told, a pushed one by its push, and the energy that they take is told."""
    scene = ParticleScene(
        **HERTZ, positions=[[0, 0], [5, 0], [0, 9]], radii=R, friction=Friction(0.3), until_t=2.0,
        hold=[Hold([0], "xy", ["cos(t)", 0.5])], push=[Push([1], ["3*t", 0.0], [0.2])],
    )  # fmt: skip
    result = simulate(scene)
    np.testing.assert_allclose(result.x[-1, 0], [math.sin(2.0), 1.0], rtol=1e-9)
    np.testing.assert_allclose(result.v[-1, 1, 0], 1.5 * 4 / MASS, rtol=1e-4)
    np.testing.assert_allclose(result.spin[-1, 1, 0], 0.2 * 2 / (0.4 * MASS * R**2), rtol=1e-9)
    np.testing.assert_array_equal(result.x[-1, 2], [0, 9])
    assert abs(result.energy["imbalance"]) < 1e-4


def test_a_wall_that_moves_gives_what_it_meets_twice_its_speed() -> None:
    """An elastic collision with an infinite mass, whose work is the kinetic energy."""
    scene = ParticleScene(
        **HERTZ, positions=[[0.6, 0.0]], radii=R, wall=[Wall([0, 0], [-1, 0], velocity=[0.2, 0.0])], until_t=2.0
    )
    result = simulate(scene)
    np.testing.assert_allclose(result.v[-1], [[0.4, 0.0]], atol=1e-5)
    assert result.energy["external"] == pytest.approx(0.5 * MASS * 0.16, rel=1e-3)


def test_steps_are_those_of_the_stiffest_contact() -> None:
    """Of two that touch, (omega dt)^2 = 24 rtol: the bound is exact, and the step is no shorter than it must be."""
    scene = head_on(1e-9, positions=[[0.0], [0.99]], until_t=0.01)
    stiffness = 2 * STAR * math.sqrt(R / 2 * 0.01)  # dF/dx = 2 E* sqrt(R_eff x)
    omega = math.sqrt(2 * stiffness / MASS)
    assert simulate(scene).stats["longest_step"] <= math.sqrt(24e-4) / omega * 1.01
    assert simulate(scene).step_dt[0] > 0.9 * math.sqrt(24e-4) / omega


def test_a_grain_that_would_pass_through_another_ends_the_run_by_name() -> None:
    """The last good state is there."""
    with pytest.raises(
        IntegrationError, match=r"particle 0 and particle 1 overlap by .* one is about to pass"
    ) as error:
        simulate(head_on(500.0, until_t=1.0, rtol=1e-2))
    assert error.value.partial is not None
    with pytest.raises(IntegrationError, match="particle 0 and wall 0 overlap"):
        simulate(
            ParticleScene(
                **HERTZ, positions=[[2.0]], radii=R, velocities=[[-500.0]], until_t=1.0, wall=[Wall([0], [-1])]
            )
        )


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"box": [9.0, 9.0], "gravity": Gravity([0, -1.0])}, "there is nothing to stand on"),
        ({"box": [1.5, 9.0]}, "too small along x"),
        ({"parameters": {"E": 1.0}}, "nu is missing"),
    ],
)  # fmt: skip
def test_what_explicit_steps_cannot_have_is_refused(change: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        simulate(ParticleScene(**{**HERTZ, "positions": [[0, 0], [2, 0]], "radii": R, "until_t": 1.0, **change}))
