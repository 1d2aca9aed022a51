"""What ``import softdyn`` offers, loaded on first use."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

from softdyn.errors import SceneError
from softdyn.pair import Progress, simulate_pair
from softdyn.results import PairResult, load_result
from softdyn.scene import DRIVES, Scene, Table, read_scene, suggestion

__all__ = ["PairResult", "Scene", "Table", "load_result", "read_scene", "simulate"]


def simulate(
    scene: Scene | str | Path | None = None, *, progress: Progress | None = None, **keywords: Any
) -> PairResult:
    """Simulate a scene.

    Parameters
    ----------
    scene : Scene, or path of a scene file, optional
    progress : function of (t, h), optional
        Called now and then during the run.
    **keywords
        The fields of :class:`softdyn.Scene`, in the place of ``scene``.

    Returns
    -------
    PairResult

    Raises
    ------
    SceneError, LawError, CompileError, IntegrationError

    Examples
    --------
    >>> import softdyn
    >>> result = softdyn.simulate(
    ...     law="rognon_gay", parameters={"R": 1, "E": 1, "eta": 1}, h=100, force=1e-2, until_h=1e-3, gaps=6
    ... )
    >>> result.h.round(4)
    array([1.e+02, 1.e+01, 1.e+00, 1.e-01, 1.e-02, 1.e-03])
    """
    if scene is not None:
        if keywords:
            raise SceneError(f"simulate takes a scene or its fields, not both (here {', '.join(keywords)})")
        return simulate_pair(read_scene(scene) if isinstance(scene, (str, Path)) else scene, progress)
    known = [field.name for field in fields(Scene)]
    for name in keywords:
        if name not in known:
            raise SceneError(f"simulate: unknown keyword {name!r}{suggestion(name, known)}")
    missing = [name for name in ("law", "parameters", "h") if name not in keywords]
    missing += [] if set(DRIVES) & set(keywords) else ["force"]
    if missing:
        raise SceneError(f"simulate needs {', '.join(missing)}")
    return simulate_pair(Scene(**keywords), progress)
