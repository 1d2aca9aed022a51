"""The frames of a run that has not ended: what is read of its file while it goes on, or after it was killed."""

from __future__ import annotations

from pathlib import Path

from softdyn.particles.mechanisms import untold
from softdyn.particles.particle_keys import ParticleScene
from softdyn.particles.particle_run import prepare_any
from softdyn.particles.results import Frame, ParticleResult, gather
from softdyn.results.frame_file import unended
from softdyn.results.origin import scene_from


def load_frames(path: Path) -> ParticleResult:
    """Return a result of the frames that a run has written so far.

    Raises
    ------
    SceneError
        If the file is no such file, holds no frame, or tells of a scene that cannot be made ready.
    LawError, CompileError
    """
    system, frames, words = unended(path, Frame, lambda origin: prepare_any(scene_from(origin, ParticleScene)))
    found = list(frames)
    energy = dict(zip((*system.works, "stored"), found[-1].energy.tolist(), strict=True))
    return gather(system, found, [], energy, {"warnings": [words, *untold(system.mechanisms)]})
