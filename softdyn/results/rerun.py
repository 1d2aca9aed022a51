"""Running again the scene that made a result, and telling by how much the two differ."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.api import simulate
from softdyn.errors import SceneError
from softdyn.fluid.fluid_result import FluidResult
from softdyn.laws import law_of
from softdyn.particles.results import ParticleResult
from softdyn.results.pair_result import PairResult
from softdyn.results.registry import load_result, scene_of
from softdyn.targets import PLUGINS

AnyResult = PairResult | ParticleResult | FluidResult


def run_again(path: Path) -> tuple[AnyResult, AnyResult]:
    """Return a saved result, and that of its scene, run again.

    Raises
    ------
    SceneError
        If the file does not tell its scene, or the law is another one today.
    LawError, CompileError, IntegrationError
    """
    from softdyn.derive.law import law_hash

    old = load_result(path)
    if isinstance(old, FluidResult):
        return _fluid_again(path, old)
    try:
        scene: Any = scene_of(old)
        law = law_of(scene.law)
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from None
    assert old.origin is not None
    if old.target in PLUGINS:
        raise SceneError(f"{path} was made by {old.target}: run its scene again with --engine {old.target}")
    if not old.origin.law.startswith(law_hash(law)):
        raise SceneError(
            f"{path}: the law {law.name!r} is not the one that made it: its equations have changed since, from "
            f"{old.origin.law[:12]} to {law_hash(law)[:12]}"
        )
    return old, simulate(scene)


def _fluid_again(path: Path, old: FluidResult) -> tuple[AnyResult, AnyResult]:
    """Return the result of a fluid, and that of its scene, run again."""
    try:
        new: FluidResult = simulate(scene_of(old))
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from None
    assert old.origin is not None
    assert new.origin is not None
    if old.target == new.target and old.origin.law != new.origin.law:
        raise SceneError(
            f"{path}: the equations of the flow have changed since it was made, from {old.origin.law[:12]} to "
            f"{new.origin.law[:12]}"
        )
    return old, new


def differences(old: AnyResult, new: AnyResult) -> dict[str, float]:
    """Largest difference in each array that differs, relative to its largest value; inf where shapes do."""
    names = list(dict.fromkeys((*old.arrays, *new.arrays)))
    found = {name: _difference(old.arrays.get(name), new.arrays.get(name)) for name in names}
    return {name: size for name, size in found.items() if size > 0}


def _difference(old: NDArray[np.generic] | None, new: NDArray[np.generic] | None) -> float:
    if old is None or new is None or old.shape != new.shape or old.dtype.kind != new.dtype.kind:
        return np.inf
    if old.dtype.kind != "f":
        return 0.0 if np.array_equal(old, new) else np.inf
    a, b = np.asarray(old, dtype=float), np.asarray(new, dtype=float)
    same = (a == b) | (np.isnan(a) & np.isnan(b))
    if same.all():
        return 0.0
    with np.errstate(invalid="ignore"):
        return float(np.max(np.abs(a - b)[~same]) / np.max(np.abs(a[~same])))
