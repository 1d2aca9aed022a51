"""Runs of many rigid grains: what is conserved, what does not depend on units, targets or interruptions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from softdyn import simulate
from softdyn.errors import IntegrationError
from softdyn.particles import Friction, Gravity, Hold, Inertia, ParticleScene, Wall, load
from softdyn.particles.files import read_particle_scene
from softdyn.particles.particle_run import simulate_particles
from softdyn.scene.stock_scenes import stock_scenes


def heap(restitution=0.0, mu=0.5, **more):
    """24 discs that fall into a box, two of them heavy."""
    rng = np.random.default_rng(1)
    x = np.stack(np.meshgrid(2.3 * np.arange(6) + 1.2, 2.3 * np.arange(4) + 1.2), axis=-1).reshape(-1, 2)
    species = ["heavy" if k in (3, 17) else "light" for k in range(24)]
    walls = [Wall([0, 0], [0, -1]), Wall([0, 0], [-1, 0]), Wall([14, 0], [1, 0])]
    given = {
        "positions": x + rng.uniform(-0.1, 0.1, x.shape), "radii": rng.uniform(0.8, 1.0, 24), "species": species,
        "inertia": Inertia(density={"light": 1.0, "heavy": 1000.0}, shape="disc"), "wall": walls,
        "friction": Friction(mu=mu, restitution=restitution), "gravity": Gravity(acceleration=[0, -1.0]),
        "until_t": 9.0, "step": 0.02, "times": 7, "rtol": 1e-8,
    }  # fmt: skip
    return ParticleScene(**{**given, **more})


@pytest.fixture(scope="module")
def fallen():
    return simulate(heap())


@pytest.mark.slow
def test_grains_of_very_different_masses_pile_up_without_overlap(fallen):
    x, radii = fallen.x[-1], fallen.radii
    i, j = np.triu_indices(len(x), 1)
    assert (np.linalg.norm(x[i] - x[j], axis=1) - radii[i] - radii[j]).min() > -1e-8
    assert (x[:, 1] - radii).min() > -1e-8
    assert fallen.step_residual.max() < 1e-8
    assert not fallen.warnings


def test_the_walls_bear_the_weight_less_what_still_accelerates(fallen):
    """Momentum: to what the impulses are converged to."""
    contacts = fallen.contacts(-1)
    on = contacts["j"] >= len(fallen.radii)
    force = np.sum((contacts["F"][:, None] * contacts["n"] + contacts["T"])[on], axis=0)
    density = np.where(fallen.species == list(fallen.species_names).index("heavy"), 1000.0, 1.0)
    mass = density * np.pi * fallen.radii**2 * float(fallen.depth)
    # the floor bears the weight where everything is at rest; walls at the sides push from both sides
    assert force[1] == pytest.approx(-mass.sum(), rel=0.02)


def test_energy_is_lost_in_collisions_and_by_friction_alone(fallen):
    energy = fallen.energy
    assert abs(energy["imbalance"]) < 1e-12
    assert energy["collisions"] > 0
    assert energy["friction"] > 0
    assert energy["gravity"] == pytest.approx(
        energy["kinetic"] + energy["collisions"] + energy["friction"] + energy["steps"], rel=1e-12
    )


def test_elastic_grains_without_friction_keep_their_energy_but_for_the_steps():
    result = simulate(heap(restitution=1.0, mu=0.0, until_t=3.0))
    assert abs(result.energy["imbalance"]) < 1e-12
    assert abs(result.energy["friction"]) < 1e-10
    assert result.energy["collisions"] >= -1e-12


@pytest.mark.slow
def test_a_run_depends_on_no_units_of_length_mass_and_time(fallen):
    """By powers of two, to the last bit."""
    length, mass, time = 2.0**20, 2.0**-30, 2.0**-7
    scene = heap()
    other = replace(
        scene, positions=np.array(scene.positions) * length, radii=np.array(scene.radii) * length, packing=None,
        file=None, inertia=Inertia({k: v * mass / length**3 for k, v in scene.inertia.density.items()}, "disc"),
        wall=[replace(wall, point=(np.array(wall.point) * length).tolist()) for wall in scene.wall],
        gravity=Gravity(acceleration=[0, -length / time**2]), until_t=9.0 * time, step=0.02 * time,
    )  # fmt: skip
    result = simulate(other)
    np.testing.assert_array_equal(result.x[-1] / length, fallen.x[-1])
    np.testing.assert_array_equal(result.contacts(-1)["F"] * (time**2 / mass / length), fallen.contacts(-1)["F"])


def test_a_run_goes_on_from_its_checkpoint_to_the_last_bit(tmp_path: Path):
    scene = heap(until_t=2.0, times=5)
    whole = simulate(scene)
    checkpoint = tmp_path / "heap.checkpoint.npz"

    class Stopped(KeyboardInterrupt):
        pass

    def stop(t: float, steps: int, iterations: int) -> None:
        if steps == 43:
            raise Stopped

    with pytest.raises(Stopped):
        simulate_particles(scene, progress=stop, checkpoint=checkpoint)
    rest = simulate_particles(scene, checkpoint=checkpoint, resume=True)
    assert rest.stats["steps"] == whole.stats["steps"]
    for name, array in whole.arrays.items():
        np.testing.assert_array_equal(array, rest.arrays[name], err_msg=name)


def test_a_step_that_does_not_converge_ends_the_run_with_the_last_good_state_saved(tmp_path: Path):
    """A grain between two others that are driven together, which no impulses keep apart."""
    scene = ParticleScene(
        positions=[[-2.5, 0.0], [0.0, 0.0], [2.5, 0.0]], radii=1.0, inertia=Inertia(density=1.0),
        hold=[Hold([0], "xy", velocity=[1.0, 0.0]), Hold([2], "xy", velocity=[-1.0, 0.0]), Hold([1], "y")],
        until_t=2.0, step=0.05, times=5,
    )  # fmt: skip
    checkpoint = tmp_path / "pressed.checkpoint.npz"
    with pytest.raises(
        IntegrationError, match=r"does not converge in the step from t=0.5: .*last good state, at t=0.5"
    ):
        simulate_particles(scene, checkpoint=checkpoint)
    assert checkpoint.exists()


@pytest.mark.parametrize("d", [2, 3])
def test_a_sheared_box_puts_in_what_friction_and_collisions_take(d: int):
    """Between the images of a periodic box that shears, at a constant volume."""
    from softdyn.particles.packing import lattice_packing

    kind, cells = {2: ("hexagonal", [6, 4]), 3: ("fcc", [3, 3, 3])}[d]
    x, lengths = lattice_packing(kind, cells, 2.3)
    scene = ParticleScene(
        positions=x + np.random.default_rng(0).uniform(-0.1, 0.1, x.shape), radii=1.0, inertia=Inertia(density=1.0),
        friction=Friction(mu=0.3), box=lengths.tolist(), shear_rate=0.5, until_strain=1.0, times=11,
    )  # fmt: skip
    result = simulate(scene)
    energy = result.energy
    assert abs(energy["imbalance"]) < 1e-12
    assert energy["friction"] > 0
    assert energy["box"] > 0
    assert result.stress[-1, 0, 0] < 0
    assert np.abs(result.v.mean(axis=1) @ np.ones(d)).max() > 0


def test_the_stock_slope_runs_as_it_says(tmp_path: Path):
    result = simulate(read_particle_scene(stock_scenes()["slope"]))
    a = 2 / 3 * 4.905
    assert result.v[-1, :, 0] == pytest.approx([2 * a] * 5, rel=1e-10)
    assert result.spin[-1, :, 0] == pytest.approx(-2 * a / result.radii, rel=1e-10)
    path = result.save(tmp_path / "slope.npz")
    again = load(path)
    np.testing.assert_array_equal(again.contact_T, result.contact_T)
    assert again.plot() is not None
