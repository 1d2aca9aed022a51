"""Files of results and checkpoints that are damaged: read as what they are, or refused; never half believed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fuzzing import Enough, Random, mutated_arrays, mutated_bytes, rezipped, survives

import softdyn
from softdyn import particles
from softdyn.particles.results import ParticleResult
from softdyn.results.pair_result import PairResult
from softdyn.results.registry import load_result

pytestmark = pytest.mark.slow
FILES = 1500
MUTATIONS: tuple[Callable[[bytes, Random], bytes], ...] = (mutated_bytes, mutated_arrays, rezipped)


def scene(**more: Any) -> particles.ParticleScene:
    return particles.ParticleScene(
        law="rognon_gay", parameters={"E": 1.0, "eta": 1.0}, positions=[[1.0, 1.0], [2.95, 1.1], [4.0, 3.0]], radii=1.0,
        gap=0.05, range=0.4, box=[7.0, 7.0], shear_rate=1e-3, drag=1.0, until_t=60.0, times=5, rtol=1e-3, **more,
    )  # fmt: skip


def looked_at(result: PairResult | ParticleResult) -> None:
    """Whatever is read can be told, gone through, and gone on from."""
    assert repr(result)
    if isinstance(result, PairResult):
        assert len(result.h) == len(result.t)
        return
    for frame in range(len(result)):
        contacts = result.contacts(frame)
        assert len({len(values) for values in contacts.values()}) == 1


def test_damaged_results_are_read_or_refused(tmp_path: Path) -> None:
    whole = particles.simulate(scene()).save(tmp_path / "many.npz").read_bytes()
    pair = softdyn.simulate(
        law="rognon_gay", parameters={"R": 1.0, "E": 1.0, "eta": 1.0}, h=1.0, force=1e-2, until_h=0.1
    )
    two = pair.save(tmp_path / "two.npz").read_bytes()
    text = pair.save(tmp_path / "two.json").read_bytes()
    random = np.random.default_rng(4)
    for number in range(FILES):
        content, ending = [(whole, ".npz"), (two, ".npz"), (text, ".json")][number % 3]
        mutate = mutated_bytes if ending == ".json" else MUTATIONS[int(random.integers(3))]
        path = tmp_path / f"damaged{ending}"
        path.write_bytes(mutate(content, random))
        result = survives(lambda path=path: load_result(path), f"file {number}")
        if result is not None:
            survives(lambda result=result: looked_at(result), f"file {number}")


def test_a_run_goes_on_from_what_is_whole_alone(tmp_path: Path) -> None:
    """Films and positions of a damaged result: checked as those of any scene are."""
    result = particles.simulate(scene())
    whole = result.save(tmp_path / "many.npz").read_bytes()
    random = np.random.default_rng(5)
    for number in range(FILES // 3):
        path = tmp_path / "damaged.npz"
        path.write_bytes(mutated_arrays(whole, random))

        def go_on(path: Path = path) -> None:
            given = particles.read_particles(path)
            more = {name: value for name, value in given.items() if name not in ("names",)}
            base = {
                "law": "rognon_gay",
                "parameters": {"E": 1.0, "eta": 1.0},
                "range": 0.4,
                "drag": 1.0,
                "until_t": 1.0,
            }
            found = particles.simulate(particles.ParticleScene(**{**base, **more}), progress=some_steps(5))
            assert np.isfinite(found.x).all()

        survives(go_on, f"file {number}")


def some_steps(most: int) -> Callable[[float, int, int], None]:
    def progress(t: float, steps: int, iterations: int) -> None:
        if steps > most:
            raise Enough

    return progress


def test_damaged_checkpoints_are_refused_or_give_the_same_run(tmp_path: Path) -> None:
    path = tmp_path / "run.checkpoint.npz"

    def stop(t: float, steps: int, iterations: int) -> None:
        if steps == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        particles.simulate(scene(), progress=stop, checkpoint=path)
    frames = tmp_path / "run.frames"
    content, made = path.read_bytes(), frames.read_bytes()
    expected = particles.simulate(scene(), checkpoint=path, resume=True).arrays
    random = np.random.default_rng(6)
    accepted = 0
    for number in range(FILES // 2):
        # the checkpoint, or the frames beside it
        path.write_bytes(content if number % 4 == 3 else MUTATIONS[number % 3](content, random))
        frames.write_bytes(mutated_bytes(made, random) if number % 4 == 3 else made)
        result = survives(lambda: particles.simulate(scene(), checkpoint=path, resume=True), f"checkpoint {number}")
        if result is not None:
            accepted += 1
            for name in ("t", "x", "v", "contact_h", "contact_F", "stress"):
                assert np.array_equal(result.arrays[name], expected[name]), (number, name)
    assert accepted > 0
