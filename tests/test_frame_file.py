"""Frames on disk: each is whole as soon as it is there, damage is told, and memory does not grow with their number."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softdyn
from softdyn.errors import SceneError
from softdyn.particles import ParticleScene
from softdyn.particles.particle_run import simulate_particles
from softdyn.particles.results import Frame
from softdyn.results import frame_file as files
from softdyn.results.rerun import differences


def scene(times: int = 11) -> ParticleScene:
    return ParticleScene(
        law="rognon_gay", parameters={"E": 1.0, "eta": 1.0}, positions=[[2.05 * k, 0.0] for k in range(20)], radii=1.0,
        range=0.5, drag=1.0, push=[softdyn.particles.Push([0], [1e-3, 0.0])], until_t=1e3, times=times,
    )  # fmt: skip


def stopped(path: Path, times: int = 11, after: float = 500.0) -> Path:
    """Checkpoint of a run that was stopped half way."""
    checkpoint = path / "run.checkpoint.npz"

    def stop(t: float, *_: int) -> None:
        if t > after:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_particles(scene(times), stop, checkpoint)
    return checkpoint


@pytest.mark.slow
def test_a_run_that_was_stopped_leaves_its_frames(tmp_path: Path) -> None:
    stopped(tmp_path)
    there, whole = softdyn.load_result(tmp_path / "run.frames"), simulate_particles(scene())
    assert 4 <= len(there) <= 7
    for name in ("t", "x", "v", "stress", "cell", "energy_drag"):
        assert np.array_equal(there.arrays[name], whole.arrays[name][: len(there)])
    assert softdyn.scene_of(there).until_t == 1e3
    assert there._repr_png_() is not None
    saved = softdyn.load_result(there.save(tmp_path / "part.npz"))
    assert differences(there, saved) == {}


@pytest.mark.parametrize("cut", [1, 40, 300])
def test_what_is_left_of_a_frame_that_was_being_written_is_passed_over(cut: int, tmp_path: Path) -> None:
    stopped(tmp_path)
    path = tmp_path / "run.frames"
    whole = softdyn.load_result(path)
    content = path.read_bytes()
    path.write_bytes(content[:-cut])
    assert len(softdyn.load_result(path)) == len(whole) - 1
    path.write_bytes(content + content[-cut:])
    assert len(softdyn.load_result(path)) == len(whole)


def test_damage_is_told(tmp_path: Path) -> None:
    checkpoint = stopped(tmp_path)
    path = tmp_path / "run.frames"
    content = bytearray(path.read_bytes())
    content[-100] ^= 1
    path.write_bytes(bytes(content))
    with pytest.raises(SceneError, match=r"is damaged: what it holds from byte [0-9]+ on is not what was written"):
        softdyn.load_result(path)
    path.write_bytes(b"something else")
    with pytest.raises(SceneError, match="is no file of frames of this version"):
        softdyn.load_result(path)
    with pytest.raises(SceneError, match="is no file of frames"):
        simulate_particles(scene(), None, checkpoint, resume=True)


def test_frames_of_another_run_are_not_gone_on_with(tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    checkpoint = stopped(tmp_path, times=5)
    stopped(tmp_path / "other", times=201)
    (tmp_path / "other" / "run.frames").replace(tmp_path / "run.frames")
    # more of its own frames would be made anew: one that has enough of them is gone on with
    assert len(simulate_particles(scene(5), None, checkpoint, resume=True)) == 5
    checkpoint = stopped(tmp_path)
    files.begin(tmp_path / "run.frames", Frame, {"key": "another"}, {})
    with pytest.raises(SceneError, match=r"does not hold the [0-9]+ frames that the checkpoint beside it tells of"):
        simulate_particles(scene(), None, checkpoint, resume=True)


def test_a_checkpoint_does_not_grow_with_the_frames(tmp_path: Path) -> None:
    sizes = []
    for times in (11, 401):
        (tmp_path / str(times)).mkdir()
        sizes.append(stopped(tmp_path / str(times), times).stat().st_size)
    # steps do not end at outputs: the same state, and more frames
    assert sizes[1] < 1.05 * sizes[0]


def test_a_frame_that_cannot_be_written_leaves_the_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    checkpoint = stopped(tmp_path)
    before = softdyn.load_result(tmp_path / "run.frames")

    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files, "sha256", full)
    with pytest.raises(SceneError, match=r"cannot write .*run\.frames: No space left on device"):
        files.FrameFile(tmp_path / "run.frames", Frame, files._ends(tmp_path / "run.frames")).append(
            Frame(**dict.fromkeys([field.name for field in fields(Frame)], np.zeros(1)))
        )
    monkeypatch.undo()
    assert differences(before, softdyn.load_result(tmp_path / "run.frames")) == {}
    assert differences(simulate_particles(scene()), simulate_particles(scene(), None, checkpoint, resume=True)) == {}
