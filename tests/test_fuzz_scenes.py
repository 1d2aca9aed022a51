"""Mutated scene files, of two particles and of many: run to a finite result, or refused by one error of ours.

Kernels are compiled without optimising, which changes no number but takes a tenth of the time.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType

import numpy as np
import pytest
from fuzzing import Enough, mutated_toml, survives

from softdyn.pair.pair_run import simulate_pair
from softdyn.particles.files import read_particle_scene
from softdyn.particles.particle_run import simulate_particles
from softdyn.particles.results import ParticleResult
from softdyn.scene.pair_scene import read_scene
from softdyn.scene.reading import is_particle_scene, read_toml
from softdyn.targets import c

pytestmark = pytest.mark.slow
STEPS = 40
#: Seconds after which a scene counts as hanging: a hundred times what the slowest takes.
PATIENCE = 60

PAIRS = (
    """law = "rognon_gay"
[parameters]
R = 1.0
E = 1.0
eta = 1.0
[pair]
h = 1.0
[drive]
force = 1e-2
[until]
h = 1e-2
[output]
gaps = 5
[accuracy]
rtol = 1e-6
""",
    """law = "steric"
[parameters]
E = 1.0
eta = 1.0
R = 1.0
nu = 0.5
Pi0 = 1.5
L = 1e-3
[pair]
h = 0.1
[drive]
velocity = "-1e-4*cos(w*t)"
[constants]
w = 1e-3
[until]
t = 1e3
[output]
times = 7
quantities = ["X", "F", "D"]
""",
    """law = "droplet"
[parameters]
R = 1.0
sigma = 1.0
eta = 1.0
[pair]
h = 0.3
[drive]
spring = {stiffness = 1.0, base = {file = "base.csv"}}
[until]
t = 10.0
""",
)
MANY = (
    """law = "rognon_gay"
[parameters]
E = 1.0
eta = 1.0
[particles]
positions = [[0.5, 0.5], [2.45, 0.6], [3.4, 2.4]]
radii = [1.0, 1.0, 1.2]
[contacts]
gap = 0.02
range = 0.5
[box]
lengths = [8.0, 8.0]
[flow]
shear_rate = 1e-3
drag = 1.0
[until]
strain = 0.1
[output]
times = 4
""",
    """law = "equal_spheres"
constants = {w = 0.1}
[parameters]
E = {a = 1.0, b = 2.0}
eta = 1.0
nu = 0.5
[particles]
positions = [[0.0, 0.0, 0.0], [2.1, 0.0, 0.0], [1.0, 1.9, 0.0]]
radii = 1.0
species = ["a", "b", "a"]
[contacts]
gap = 0.05
tangential = true
[flow]
drag = 1.0
[[push]]
particles = [0]
force = ["1e-3*sin(w*t)", 0.0, 1e-3]
torque = [0.0, 0.0, 1e-3]
[[hold]]
particles = "b"
axes = "xyz"
velocity = [0.0, 0.0, 0.0]
[[wall]]
point = [0.0, -1.2, 0.0]
normal = [0.0, -1.0, 0.0]
velocity = ["1e-3*cos(t)", 0.0, 0.0]
[until]
t = 20.0
[output]
times = [0.0, 5.0, 20.0]
[accuracy]
rtol = 1e-3
""",
    """law = "droplet"
[parameters]
sigma = 1.0
eta = 1.0
[packing]
kind = "random"
count = 6
dimension = 2
fraction = 0.35
radii = [1.0]
seed = 3
[contacts]
gap = 0.02
range = 0.4
[flow]
drag = 1.0
[stress]
xy = 1e-3
pressure = "1e-3*(1 + 0.1*sin(t))"
[until]
t = 10.0
strain = 0.1
""",
    """law = "rognon_gay"
[parameters]
E = 1.0
eta = 1.0
[particles]
positions = [[0.0], [2.1], [4.2]]
radii = 1.0
[[push]]
particles = [0]
force = [1e-2]
[[push]]
particles = [2]
force = [-1e-2]
[until]
t = 1e4
""",
)


@pytest.fixture(autouse=True)
def quick_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(c, "FLAGS", tuple("-O0" if flag == "-O3" else flag for flag in c.FLAGS))


@pytest.fixture(autouse=True)
def patience() -> Iterator[None]:
    """Nothing hangs."""

    def late(number: int, frame: FrameType | None) -> None:
        raise TimeoutError(f"still not done after {PATIENCE} s")

    usual = signal.signal(signal.SIGALRM, late)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, usual)


def few_steps() -> Callable[..., None]:
    taken = 0

    def progress(*_: object) -> None:
        nonlocal taken
        taken += 1
        if taken > STEPS:
            raise Enough

    return progress


def run(path: Path) -> None:
    """As the command does it; outputs are finite."""
    signal.alarm(PATIENCE)
    if is_particle_scene(read_toml(path)):
        result: ParticleResult = simulate_particles(read_particle_scene(path), few_steps())
        assert all(
            np.isfinite(result.arrays[name]).all() for name in ("t", "x", "v", "stress", "contact_F", "contact_h")
        )
        assert (result.contact_h > 0).all()
        return
    pair = simulate_pair(read_scene(path), few_steps())
    assert all(np.isfinite(values).all() for values in pair.arrays.values())
    assert (pair.h > 0).all()


@pytest.mark.parametrize("number", range(len(MANY)))
def test_mutated_scenes_of_many_run_or_are_refused(number: int, tmp_path: Path) -> None:
    _fuzz(MANY[number], tmp_path, 400, seed=number)


@pytest.mark.parametrize("number", range(len(PAIRS)))
def test_mutated_scenes_of_two_run_or_are_refused(number: int, tmp_path: Path) -> None:
    (tmp_path / "base.csv").write_text("t,base\n0,2.3\n5,2.2\n10,2.4\n", encoding="utf-8")
    _fuzz(PAIRS[number], tmp_path, 400, seed=100 + number)


def _fuzz(text: str, folder: Path, count: int, seed: int) -> None:
    random, path = np.random.default_rng(seed), folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    run(path) if "1e4" not in text else None  # what is mutated is a scene that runs
    for _ in range(count):
        mutated = mutated_toml(text, random)
        path.write_text(mutated, encoding="utf-8")
        survives(lambda: run(path), mutated)
