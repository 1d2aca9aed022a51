"""When a run ends: at a time, or at the strain that the integral of a given shear rate reaches."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from softdyn.enclosure import enclose
from softdyn.errors import SceneError
from softdyn.particles.driven import given_function
from softdyn.particles.names import SIZES, is_number
from softdyn.particles.particle_keys import ParticleScene
from softdyn.particles.time_functions import TimeFunction
from softdyn.scene.time_tables import Table

#: The end of a run is looked for up to so many doublings of the time that the first shear rate would take.
DOUBLINGS = 20


def run_end(scene: ParticleScene) -> float:
    """Time at which a run ends; under an imposed shear stress it may end before, at a strain.

    Raises
    ------
    SceneError
        If nothing says when, or a strain is not reached, or may not be.
    """
    strain = scene.until_strain
    if strain is None and scene.until_t is None:
        raise SceneError("[until] needs t, strain, or both: when does the run end?")
    if "xy" in scene.stress:
        if scene.until_t is None:
            raise SceneError("[until] t is missing: under an imposed shear stress a strain may never be reached")
        return float(scene.until_t)
    if strain is None:
        assert scene.until_t is not None
        return float(scene.until_t)
    if is_number(scene.shear_rate):
        if not scene.shear_rate:
            raise SceneError("[until] strain needs [flow] shear_rate, or [stress] xy: without them nothing is strained")
        reached = abs(strain) / abs(scene.shear_rate)  # type: ignore[arg-type]
    else:
        reached = _reached(scene, abs(strain))
    return reached if scene.until_t is None else min(reached, float(scene.until_t))


def ends_at_strain(scene: ParticleScene) -> bool:
    """Whether only the run tells when its strain is reached: that of a box under an imposed shear stress."""
    return scene.until_strain is not None and "xy" in scene.stress


def _reached(scene: ParticleScene, strain: float) -> float:
    """First time at which the integral of a shear rate that changes has a size; that of the scene if it never has."""
    for end in _ends(scene, strain):
        rate = _shear(replace(scene, until_t=end))
        found = first_passage(rate, strain)
        if found is not None:
            return found
    if scene.until_t is None:
        raise SceneError(
            f"[until] strain = {scene.until_strain:g} is not reached before t={end:.6g}: give [until] t, too"
        )
    return float(scene.until_t)


def _shear(scene: ParticleScene) -> TimeFunction:
    return given_function(scene, scene.shear_rate, "[flow] shear_rate")


def _ends(scene: ParticleScene, strain: float) -> list[float]:
    """Times up to which the strain is looked for, one after the other."""
    if scene.until_t is not None:
        return [float(scene.until_t)]
    given = scene.shear_rate
    if isinstance(given, Table):
        return [float(given.t[-1])]
    if isinstance(given, (tuple, list)):
        return [float(np.asarray(given[0], dtype=float)[-1])]
    rate = _shear(replace(scene, until_t=1.0))
    start = abs(rate.after(0.0))
    if not start:
        raise SceneError("[until] strain, with a shear rate that is 0 at the start, needs [until] t, too")
    with np.errstate(over="ignore"):
        ends = np.float64(strain) / start * 2.0 ** np.arange(DOUBLINGS)
    within = [float(end) for end in ends if end < SIZES[1]]
    if not within:
        raise SceneError(f"[until] strain = {scene.until_strain:g} is reached so late that no number tells when")
    return within


def first_passage(rate: TimeFunction, size: float) -> float | None:
    """First time at which the integral of a function has a size, to rounding; None if it has not until its end.

    Intervals are halved until bounds of the function show of each that it keeps its sign there, so that the integral is
    largest at an end, or that the integral cannot reach the size on it.
    """
    ends = [0.0, *(float(when) for when in rate.breaks), rate.end]
    left = [(low, high) for low, high in itertools.pairwise(ends)][::-1]
    while left:
        low, high = left.pop()
        least, most = _bounds(rate, low, high)
        middle = low + (high - low) / 2
        if least < 0 < most and low < middle < high:
            if abs(rate.integral(low)) + max(-least, most) * (high - low) >= size:
                left += [(middle, high), (low, middle)]
        elif abs(rate.integral(high)) >= size:
            return _bisected(rate, size, low, high)
    return None


def _bounds(rate: TimeFunction, low: float, high: float) -> tuple[float, float]:
    """Bounds of a function between two of its breaks."""
    if rate.expression is None:
        ends = rate.after(low), rate(high)
        return min(ends), max(ends)
    part = rate.parts[int(np.searchsorted(rate.breaks, low + (high - low) / 2, side="right"))]
    least, most = enclose(part, low, high)
    return float(least), float(most)


def _bisected(rate: TimeFunction, size: float, low: float, high: float) -> float:
    """Where the integral first has the size, on an interval where it grows."""
    while low < (middle := low + (high - low) / 2) < high:
        if abs(rate.integral(middle)) >= size:
            high = middle
        else:
            low = middle
    return high
