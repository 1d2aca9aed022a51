"""The frames of a run that has not ended: what is read of its file while it goes on, or after it was killed."""

from __future__ import annotations

from pathlib import Path

from softdyn.errors import SceneError
from softdyn.particles.particle_keys import ParticleScene
from softdyn.particles.particle_run import prepare
from softdyn.particles.results import Frame, ParticleResult, gather
from softdyn.results.frame_file import read_frames
from softdyn.results.origin import origin_in, scene_from


def load_frames(path: Path) -> ParticleResult:
    """Return a result of the frames that a run has written so far.

    Raises
    ------
    SceneError
        If the file is no such file, holds no frame, or tells of a scene that cannot be made ready.
    LawError, CompileError
    """
    content, beside, frames = read_frames(path, Frame)
    if not len(frames):
        raise SceneError(f"{path} holds no frame yet")
    try:
        origin = origin_in(content, beside)
        if origin is None:
            raise ValueError("it does not tell of its scene")
        system = prepare(scene_from(origin, ParticleScene))
    except (KeyError, ValueError) as error:
        raise SceneError(f"{path} is no file of frames: {error}") from None
    found = list(frames)
    energy = dict(zip((*system.works, "stored"), found[-1].energy.tolist(), strict=True))
    stats = {"warnings": [f"the run that wrote {path} has not ended: these are its frames up to t={found[-1].t:.6g}"]}
    return gather(system, found, [], energy, stats)
