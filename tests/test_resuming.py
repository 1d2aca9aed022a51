"""A run that was interrupted goes on as if it had not been: to the last bit, whatever the scene and the step."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from softdyn.particles.files import read_particle_scene
from softdyn.particles.particle_keys import ParticleScene
from softdyn.particles.particle_run import simulate_particles
from softdyn.particles.results import ParticleResult
from softdyn.particles.until import run_end
from softdyn.results.rerun import differences
from softdyn.scene.stock_scenes import particle_scenes
from softdyn.stress.particles.sampling import random_case


def interrupted(scene: ParticleScene, every: int, folder: Path) -> ParticleResult:
    """A run that is stopped after every so many steps, and gone on with from its file."""
    checkpoint = folder / "run.checkpoint.npz"

    for _ in range(1000):
        begun: list[int] = []

        def stop(_t: float, steps: int, _iterations: int, begun: list[int] = begun) -> None:
            begun.append(steps)
            if len(begun) == every:
                raise KeyboardInterrupt

        try:
            return simulate_particles(scene, stop, checkpoint, resume=True)
        except KeyboardInterrupt:
            assert checkpoint.exists()
    raise AssertionError("the run does not end")


def check(scene: ParticleScene, every: int, folder: Path) -> None:
    whole = simulate_particles(scene)
    resumed = interrupted(scene, every, folder)
    assert differences(whole, resumed) == {}
    assert resumed.energy == whole.energy
    timed = ("wall_s", "compile_s")
    assert {k: v for k, v in resumed.stats.items() if k not in timed} == {
        k: v for k, v in whole.stats.items() if k not in timed
    }


@pytest.mark.slow
@pytest.mark.parametrize(
    "seed", [102, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (7, 100, 101, *range(103, 110)))]
)
def test_random_scenes_resume_to_the_bit(seed: int, tmp_path: Path) -> None:
    check(random_case(seed).scene, 9 if seed < 100 else 30 + seed % 11, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(particle_scenes()))
def test_stock_scenes_resume_to_the_bit(name: str, tmp_path: Path) -> None:
    """Their beginnings: many contacts, solved for with the factor of an earlier matrix."""
    scene = read_particle_scene(particle_scenes()[name])
    check(replace(scene, until_t=0.02 * run_end(scene), until_strain=None, times=3), 10, tmp_path)
