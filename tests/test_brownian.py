"""Brownian motion: diffusion of one and of two spheres, Boltzmann's distribution, the orders of the schemes, seeds.

Each scene holds many runs beside one another, which have nothing to do with each other; how many is said with each.
"""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

from softdyn.errors import IntegrationError, SceneError
from softdyn.particles.brownian.brownian_run import drawn, step_of
from softdyn.particles.free_plots import pair_distribution
from softdyn.particles.mechanisms.bonds import Bond
from softdyn.particles.mechanisms.noise import Noise
from softdyn.particles.mechanisms.potentials import PairPotential
from softdyn.particles.particle_keys import Hold, ParticleScene, Push
from softdyn.particles.particle_run import prepare_any, simulate_particles
from softdyn.results.rerun import differences

#: Drag of a particle of radius 1 is 1.
UNIT: dict[str, Any] = {"parameters": {"eta": 1 / (6 * math.pi)}, "drag": 1.0, "radii": 1.0, "times": 2}


def dimers(count: int, apart: float, d: int) -> dict[str, Any]:
    """So many pairs, all at the same place, bonded two by two: runs that do not know of each other."""
    x = np.zeros((2 * count, d))
    x[1::2, 0] = apart
    return {"positions": x, "pairs": [[2 * k, 2 * k + 1] for k in range(count)]}


def run_dimers(
    count: int, apart: float, d: int, noise: Noise, potential: str, parameters: dict[str, float], **more: Any
) -> Any:
    given = dimers(count, apart, d)
    bond = Bond(given["pairs"], potential, parameters)
    return simulate_particles(ParticleScene(**{**UNIT, **more}, positions=given["positions"], bond=[bond], noise=noise))


def within_two_errors(samples: np.ndarray, expected: float) -> None:
    """The mean of independent samples is what is expected, to two of its standard errors."""
    error = float(samples.std(ddof=1)) / math.sqrt(len(samples))
    assert abs(float(samples.mean()) - expected) < 2 * error, (samples.mean(), expected, error)


@pytest.mark.parametrize("d", [1, 2, 3])
def test_a_sphere_diffuses_as_einstein_says(d: int) -> None:
    """<r^2> = 2 d kT t/Z; 40000 runs, each of which takes the steps that its outputs ask for."""
    count = 40000
    result = simulate_particles(
        ParticleScene(
            **{**UNIT, "times": 5}, positions=np.zeros((count, d)), until_t=3.0, noise=Noise(0.7, seed=10 * d)
        )
    )
    within_two_errors(np.sum(result.x[-1] ** 2, axis=1), 2 * d * 0.7 * 3.0)
    # steps are independent of one another
    steps = np.diff(result.x, axis=0)
    within_two_errors(np.sum(steps[0] * steps[1], axis=1), 0.0)


def test_in_a_shear_flow_spheres_spread_along_it() -> None:
    """<x^2> = 2 D t (1 + (rate t)^2/3), <x y> = D rate t^2; 4000 runs."""
    result = simulate_particles(
        ParticleScene(
            **UNIT, positions=np.zeros((4000, 2)), shear_rate=2.0, until_t=1.0, noise=Noise(0.5, seed=4, step=0.05)
        )
    )
    x, y = result.x[-1].T
    within_two_errors(x**2, 2 * 0.5 * (1 + 4 / 3))
    within_two_errors(x * y, 0.5 * 2.0)


def test_two_spheres_on_a_spring_diffuse_together_and_fluctuate_apart() -> None:
    """Centre: half the diffusion of one, whatever the spring. Distance: 3 kT/k (1 - exp(-4 k t/Z)); 2000 runs."""
    result = run_dimers(
        2000, 1e-9, 3, Noise(0.5, seed=8, step=0.02), "hooke", {"k": 1.0, "d": 0.0}, until_t=1.0, times=3
    )
    one, two = result.x[:, ::2], result.x[:, 1::2]
    for frame in (1, 2):
        t = result.t[frame]
        within_two_errors(np.sum(((one + two)[frame] / 2) ** 2, axis=1), 3 * 0.5 * t)
        within_two_errors(np.sum((two - one)[frame] ** 2, axis=1), 3 * 0.5 * (1 - math.exp(-4 * t)))
    # what is stored came from the fluid
    assert result.energy["bath"] == pytest.approx(result.energy["stored"], rel=0.02)


def test_pairs_in_a_morse_well_are_distributed_as_boltzmann_says() -> None:
    """exp(-U/kT), on a line; 4000 runs, 8 kT deep: mean, variance and energy, and a histogram by chi^2."""
    De, b, d, kT, edge = 1.0, 2.0, 3.0, 0.125, 4.0
    result = run_dimers(4000, d, 1, Noise(kT, seed=2, step=0.004), "morse", {"De": De, "b": b, "d": d}, until_t=0.6)
    r = result.bond_r[-1]
    r = r[r < edge]

    def weight(x: float) -> float:
        return math.exp(-De * (1 - math.exp(-b * (x - d))) ** 2 / kT)

    whole = quad(weight, 2.0, edge)[0]

    def mean(of: Any) -> float:
        return quad(lambda x: of(x) * weight(x), 2.0, edge)[0] / whole

    within_two_errors(r, mean(lambda x: x))
    within_two_errors((r - d) ** 2, mean(lambda x: (x - d) ** 2))
    within_two_errors((1 - np.exp(-b * (r - d))) ** 2, mean(lambda x: (1 - math.exp(-b * (x - d))) ** 2))
    edges = np.array([2.0, 2.7, 2.85, 2.95, 3.05, 3.15, 3.3, 3.5, edge])
    found = np.histogram(r, edges)[0]
    expected = np.array([quad(weight, *ends)[0] for ends in pairwise(edges)]) / whole * len(r)
    assert np.sum((found - expected) ** 2 / expected) < 14.07  # 95 % of 7 degrees of freedom


@pytest.mark.slow
def test_the_schemes_have_their_weak_orders() -> None:
    """Stationary variance of a spring, 2 kT: its error halves with Euler's step, and falls to a quarter with Heun's.

    50000 runs, whose error of 0.6 % is far below those of such long steps.
    """

    def variance(scheme: str, step: float) -> float:
        result = run_dimers(50000, 1e-9, 1, Noise(1.0, 5, scheme, step), "hooke", {"k": 0.5, "d": 0.0}, until_t=10.0)
        return float(np.mean((result.x[-1, 1::2] - result.x[-1, ::2]) ** 2))

    for scheme, steps, low, high in (("euler", (0.5, 0.25), 0.9, 1.5), ("heun", (1.0, 0.5), 1.8, 2.5)):
        off = [abs(variance(scheme, step) / 2 - 1) for step in steps]
        # one step after the other: v = g^2 v + 4 step s^2
        for step, error in zip(steps, off, strict=True):
            g, s = (1 - step, 1.0) if scheme == "euler" else (1 - step + step**2 / 2, 1 - step / 2)
            assert error == pytest.approx(abs(4 * step * s**2 / (1 - g**2) / 2 - 1), abs=0.03)
        assert low < math.log2(off[0] / off[1]) < high


def colloids(**more: Any) -> ParticleScene:
    """A few particles that repel in a periodic box that is sheared."""
    x = [[3.0 * i + 1.0, 3.0 * j + 1.0] for i in range(6) for j in range(6)]
    wca = PairPotential("lennard_jones", {"epsilon": 1.0, "sigma": 2.0}, cut_off=2.244924)
    given = {**UNIT, "times": 4, "potential": [wca], "shear_rate": 0.5, "box": [18.0, 18.0], "until_t": 0.1, **more}
    return ParticleScene(**{"noise": Noise(1.0, seed=3, step=0.001), **given}, positions=x)


def test_a_seed_makes_a_run_again_and_a_stopped_run_goes_on_to_the_bit(tmp_path: Path) -> None:
    whole = simulate_particles(colloids())
    assert np.array_equal(simulate_particles(colloids()).x, whole.x)
    assert not np.array_equal(simulate_particles(colloids(noise=Noise(1.0, seed=4, step=0.001))).x, whole.x)
    steps: list[float] = []

    def stop(t: float, _steps: int, _iterations: int) -> None:
        steps.append(t)
        if len(steps) % 40 == 0:
            raise KeyboardInterrupt

    resumed = None
    for _ in range(1000):
        try:
            resumed = simulate_particles(colloids(), stop, tmp_path / "run.checkpoint.npz", resume=True)
            break
        except KeyboardInterrupt:
            pass
    assert resumed is not None
    assert len(steps) > 40
    assert differences(whole, resumed) == {}
    assert resumed.energy == whole.energy


def test_noise_is_that_of_the_step_alone() -> None:
    """Whoever draws it, and in whatever order: no thread and no earlier step has a part in it."""
    noise = Noise(1.0, seed=9)
    late = drawn(noise, 1000, (5, 2))
    drawn(noise, 3, (100, 3))
    assert np.array_equal(late, drawn(noise, 1000, (5, 2)))
    assert not np.array_equal(late, drawn(noise, 1001, (5, 2)))


def test_steps_are_bounded_by_the_stiffness_that_is_reached() -> None:
    """A tenth of Z/(2 k) for one spring, at any temperature; shorter where warm ones reach further into a core."""
    scene = ParticleScene(
        **UNIT, positions=[[0.0], [2.0]], until_t=1.0, bond=[Bond([[0, 1]], "hooke", {"k": 5.0, "d": 2.0})],
        noise=Noise(0.1, seed=1),
    )  # fmt: skip
    assert step_of(prepare_any(scene)) == pytest.approx(0.1 / 10, rel=1e-12)
    cold, warm = (step_of(prepare_any(colloids(noise=Noise(kT, seed=1)))) for kT in (0.5, 2.0))
    assert warm < cold


def test_what_is_held_does_not_move_and_has_no_noise() -> None:
    result = simulate_particles(
        ParticleScene(
            **UNIT, positions=[[0.0, 0.0], [5.0, 0.0]], until_t=1.0, noise=Noise(1.0, seed=1),
            hold=[Hold([0], "xy"), Hold([1], "y", [2.0])], push=[Push([1], [3.0, 0.0])],
        )
    )  # fmt: skip
    assert np.array_equal(result.x[-1, 0], [0.0, 0.0])
    assert result.x[-1, 1, 1] == pytest.approx(2.0, rel=1e-12)
    assert result.x[-1, 1, 0] != 8.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"noise": Noise(1.0)}, r"\[noise\] seed is missing"),
        ({"noise": Noise(0.0, seed=1)}, r"\[noise\] temperature must be a positive number"),
        ({"noise": Noise(1.0, seed=1, scheme="milstein")}, "unknown scheme 'milstein'"),
        ({"drag": 0.0}, r"give \[flow\] drag"),
        ({"law": "rognon_gay", "parameters": {"E": 1.0, "eta": 1.0}, "range": 1.0}, "the noise of a film"),
        ({"shear_rate": "t"}, "the rate is a number"),
        ({"method": "implicit"}, r"\[noise\] is known to the method brownian alone"),
        ({"noise": None, "method": "brownian"}, r"needs a temperature: give \[noise\]"),
    ],
)
def test_wrong_scenes_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        simulate_particles(colloids(**changes))


def test_steps_above_the_limit_of_stability_end_the_run_by_name(tmp_path: Path) -> None:
    """With the last good state saved."""
    file = tmp_path / "run.checkpoint.npz"
    scene = ParticleScene(
        **UNIT, positions=[[0.0], [2.0]], until_t=1.0, bond=[Bond([[0, 1]], "hooke", {"k": 5.0, "d": 2.0})],
        noise=Noise(0.1, seed=1, step=0.5),
    )  # fmt: skip
    with pytest.raises(
        IntegrationError, match=r"above the limit of stability, 0.2, .*on particle 0: give a sh"
    ) as told:
        simulate_particles(scene, None, file)
    assert told.value.partial is not None
    assert file.exists()


@pytest.mark.slow
def test_spheres_that_do_not_meet_have_no_order_and_a_picture_shows_it(tmp_path: Path) -> None:
    """g(r) = 1: pairs at each distance as many as chance has, to two errors in all together."""
    x = np.random.default_rng(1).uniform(0, 40.0, (1500, 2))
    result = simulate_particles(
        ParticleScene(**{**UNIT, "times": 3}, positions=x, box=[40.0, 40.0], until_t=1e3, noise=Noise(1.0, seed=6))
    )
    r, g = pair_distribution(result)
    pairs = 2 * 1500 * 1499 / 2 * 2 * math.pi * r * (r[1] - r[0]) / 40**2  # in two frames
    assert np.sum((g - 1) ** 2 * pairs) / len(r) == pytest.approx(1.0, abs=2 * math.sqrt(2 / len(r)))
    picture = tmp_path / "spread.png"
    result.plot().savefig(picture)
    assert picture.stat().st_size > 10_000
