"""Reading results of every kind: one registry of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.archive import read_arrays, read_json
from softdyn.errors import SceneError
from softdyn.results.origin import scene_from

if TYPE_CHECKING:
    from softdyn.fluid.fluid_result import FluidResult
    from softdyn.fluid.fluid_scene import FluidScene
    from softdyn.particles.particle_keys import ParticleScene
    from softdyn.particles.results import ParticleResult
    from softdyn.results.pair_result import PairResult
    from softdyn.scene.pair_scene import Scene

#: Of each kind of result, what reads it and the scene that makes it; none is imported before it is met.
KINDS = {
    "pair": ("softdyn.results.pair_result:pair_from", "softdyn.scene.pair_scene:Scene"),
    "particles": ("softdyn.particles.results:result_from", "softdyn.particles.particle_scene:ParticleScene"),
    "fluid": ("softdyn.fluid.fluid_result:fluid_from", "softdyn.fluid.fluid_scene:FluidScene"),
    "suspension": (
        "softdyn.suspension.suspension_result:suspension_from",
        "softdyn.suspension.suspension_scene:SuspensionScene",
    ),
    "fit": ("softdyn.fitting.fit_result:fit_from", ""),  # data make a fit, no scene
}
#: Of those whose frames are on disk, what reads these of a run that has not ended.
UNFINISHED = {
    "particles": "softdyn.particles.unfinished:load_frames",
    "fluid": "softdyn.fluid.fluid_run:load_flow_frames",
    "suspension": "softdyn.suspension.suspension_run:load_suspension_frames",
}


def load_result(path: str | Path) -> PairResult | ParticleResult | FluidResult:
    """Read a result saved as .json or .npz, or the frames of a run of many particles that has not ended, .frames.

    Raises
    ------
    SceneError
        If the file is not such a result.

    Examples
    --------
    >>> import softdyn
    >>> result = softdyn.simulate(law="rognon_gay", parameters={"R": 1, "E": 1, "eta": 1}, h=1, force=0.01, until_h=0.1)
    >>> path = result.save("approach.npz")
    >>> softdyn.load_result(path).t[-1] == result.t[-1]
    np.True_
    """
    path = Path(path)
    if path.suffix == ".frames":
        return _unfinished(path)
    if path.suffix not in (".json", ".npz"):
        raise SceneError(
            f"cannot read {path}: results are read back from .json and .npz, which hold all of a run (.frames: what "
            "there is of one); a .csv holds the arrays alone, .gsd and .pvd what other programs show"
        )
    try:
        about, arrays = _npz(path) if path.suffix == ".npz" else _json(path)
        kind = about.get("kind", "pair")
        if kind == "checkpoint":
            raise ValueError("it is a checkpoint, from which the run that left it goes on with --resume")
        if kind not in KINDS:
            raise ValueError(f"it is of the kind {kind!r}, which a later softdyn writes")
        read: Callable[..., PairResult | ParticleResult | FluidResult] = _found(KINDS[kind][0])
        return read(about, arrays)
    except OSError as error:
        raise SceneError(f"cannot read {path}: {error.strerror or error}") from None
    except KeyError as error:
        raise SceneError(f"{path} is not a result saved by softdyn (.json or .npz): it has no {error}") from None
    except (ValueError, TypeError, AttributeError, OverflowError) as error:
        raise SceneError(f"{path} is not a result saved by softdyn (.json or .npz): {error}") from None


def scene_of(result: PairResult | ParticleResult | FluidResult) -> Scene | ParticleScene | FluidScene:
    """Return the scene that made a result: simulated again, it gives the same.

    Raises
    ------
    SceneError
        If the result does not tell: one that an earlier version has saved, or whose law was an object of a program.

    Examples
    --------
    >>> import softdyn
    >>> result = softdyn.load_result("run.npz")                                             # doctest: +SKIP
    >>> longer = softdyn.simulate(dataclasses.replace(softdyn.scene_of(result), until_t=9)) # doctest: +SKIP
    """
    if not KINDS[result.kind][1]:
        raise SceneError(f"a {result.kind} is made of data: there is no scene of it")
    if result.origin is None:
        raise SceneError("the result does not tell the scene that made it: an earlier version of softdyn has saved it")
    found: Scene | ParticleScene | FluidScene = scene_from(result.origin, _found(KINDS[result.kind][1]))
    return found


def _unfinished(path: Path) -> PairResult | ParticleResult | FluidResult:
    """Result of the frames that a run has written so far."""
    from softdyn.results.frame_file import kind_of_run

    kind = kind_of_run(path)
    if kind not in UNFINISHED:
        raise SceneError(f"{path} is of a run of the kind {kind!r}, which a later softdyn writes")
    load: Callable[[Path], PairResult | ParticleResult | FluidResult] = _found(UNFINISHED[kind])
    return load(path)


def _found(place: str) -> Any:
    module, name = place.split(":")
    return getattr(import_module(module), name)


def _npz(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    arrays = read_arrays(path)
    if "about" not in arrays:
        raise ValueError("it holds no run; the table of a sweep is for numpy.load")
    return read_json(str(arrays.pop("about"))), arrays


def _json(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    about = read_json(path.read_text(encoding="utf-8-sig"))
    arrays = {
        name: np.array([math.nan if v is None else v for v in values], dtype=float)
        for name, values in about.items()
        if isinstance(values, list) and name not in ("warnings", "events")
    }
    return about, arrays
