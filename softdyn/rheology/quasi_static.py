"""Quasi-static compression and shear: affine steps of the box, each followed by rest until the stress has settled.

Fractions are gone through in the order that is given, up and down; then, at the last of them, shear strains. At each
fraction two small shears, one each way, may probe the shear modulus: half the difference of their stresses, after as
long a rest as the state itself had, is free of what still creeps in both. Nothing goes on from them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError, SoftdynError
from softdyn.particles.files import particle_scene_from
from softdyn.particles.observables import coordination, rattlers
from softdyn.particles.particle_keys import ParticleScene
from softdyn.particles.particle_run import simulate_particles
from softdyn.particles.placing import from_result
from softdyn.particles.results import ParticleResult, load_particles
from softdyn.results.whole_files import written_whole
from softdyn.rheology.measures import fraction, series
from softdyn.rheology.runs import Run

Array = NDArray[np.float64]

#: The stress has settled where it changes by this part of the pressure while all of the rest is doubled.
SETTLED = 0.01
#: Below this part of the largest pressure that was met, right after steps too, there is none.
NONE = 1e-4
#: Files of the probes, and the sign of their strain.
PROBES = {"_probe": 1.0, "_probe_back": -1.0}
#: The rest is doubled so often at most.
DOUBLINGS = 12
#: Steps of the fraction and of the strain at most: beyond, surfaces are pushed into one another.
LARGEST = 0.05


@dataclass(frozen=True)
class Protocol:
    """What is done to the box.

    Attributes
    ----------
    fractions : tuple of float
        In the order in which they are reached.
    strains : tuple of float
        Shear strains at the last fraction, from the state there, in their order.
    probe : float
        Strain that probes the shear modulus at each fraction; 0 for none.
    rest : float
        Time of the first rest after a step.
    """

    fractions: tuple[float, ...]
    strains: tuple[float, ...]
    probe: float
    rest: float


def check_protocol(protocol: Protocol) -> None:
    """Refuse a protocol that cannot be gone through.

    Raises
    ------
    SceneError
    """
    for low, high in zip(protocol.fractions, protocol.fractions[1:], strict=False):
        if not 0 < abs(high / low - 1) <= LARGEST:
            raise SceneError(
                f"fractions {low:g} and {high:g}: a step is {LARGEST:g} of the fraction at most, and not 0; list more"
            )
    for low, high in zip((0.0, *protocol.strains), protocol.strains, strict=False):
        if abs(high - low) > LARGEST:
            raise SceneError(f"strains {low:g} and {high:g}: a step is {LARGEST:g} at most; list more")
    if not 0 < protocol.rest < math.inf:
        raise SceneError(f"--rest {protocol.rest:g}: a positive time is needed")
    if not 0 <= abs(protocol.probe) <= LARGEST:
        raise SceneError(f"--probe {protocol.probe:g}: a strain of {LARGEST:g} at most")


def protocol_of(run: Run) -> Protocol:
    """The protocol that a run's content holds beside the scene."""
    given = run.protocol
    return Protocol(tuple(given["fractions"]), tuple(given["strains"]), given["probe"], given["rest"])


def state_file(run: Run, state: int, part: str = "") -> Path:
    """The file of a state of a run.

    Parameters
    ----------
    run : Run
    state : int
        Its number.
    part : str
        Appended to the name.
    """
    return run.folder / f"{run.number:04d}" / f"{state:04d}{part}.npz"


def deformed(start: Mapping[str, Any], gradient: Array) -> dict[str, Any]:
    """Fields of a scene after an affine deformation, films as they were.

    Parameters
    ----------
    start : mapping
        As :func:`softdyn.particles.placing.from_result` gives it, in a box that is periodic along all axes.
    gradient : array, shape (d, d)
        Of the deformation: x -> gradient @ x; the unit tensor times a number, with a shear xy.
    """
    lengths = np.array(start["box"], dtype=float)
    tilt = float(start.get("tilt", 0.0))
    cell = np.diag(lengths)
    cell[0, 1] = tilt
    moved = gradient @ cell
    found = {**start, "positions": np.asarray(start["positions"]) @ gradient.T, "box": np.diag(moved).tolist()}
    return found | {"tilt": float(moved[0, 1])}


def rested(scene: ParticleScene, rest: float, largest: float) -> tuple[ParticleResult, bool, float, float]:
    """Let a scene rest until its stress has settled.

    Parameters
    ----------
    scene : ParticleScene
        Without a flow.
    rest : float
        Time of the first rest; each further one takes as long as all before.
    largest : float
        Largest pressure met before.

    Returns
    -------
    ParticleResult
        The last part.
    bool
        Whether it has settled.
    float
        Largest pressure met.
    float
        Time of all rest.
    """
    result = simulate_particles(replace(scene, until_t=rest, until_strain=None, times=[0.0, rest]))
    spent = rest
    for _ in range(DOUBLINGS):
        largest = max(largest, float(np.abs(series(result)["pressure"]).max()))
        start = from_result(result)
        result = simulate_particles(_with(scene, start, spent))
        spent *= 2
        found = series(result)
        before, after = (np.array([found[name][k] for name in ("pressure", "shear_stress", "N1")]) for k in (0, -1))
        scale = max(abs(after[0]), NONE * largest)
        if np.abs(after - before).max() <= SETTLED * scale:
            return result, True, largest, spent
        if max(abs(before[0]), abs(after[0])) <= NONE * largest:
            return result, True, largest, spent
    return result, False, largest, spent


def _with(scene: ParticleScene, start: Mapping[str, Any], time: float) -> ParticleScene:
    """The scene from another start, for a time."""
    return replace(scene, **start, file=None, packing=None, until_t=time, until_strain=None, times=[0.0, time])


def make_protocol(run: Run) -> str:
    """Go through the protocol of a run; states that are there are kept. Returns why it failed, or ""."""
    try:
        _go_through(run)
    except SoftdynError as error:
        with written_whole(run.failure) as temporary:
            temporary.write_text(f"{error}\n", encoding="utf-8")
        return str(error)
    run.failure.unlink(missing_ok=True)
    return ""


def _go_through(run: Run) -> None:
    protocol = protocol_of(run)
    scene = particle_scene_from(run.content, run.home)
    if scene.box is None or any(length is None for length in scene.box) or len(scene.box) < 2:
        raise SceneError("compress needs a box that is periodic along all axes, in two dimensions or three")
    if scene.stress or scene.wall or scene.hold:
        raise SceneError("compress moves the box itself: leave [stress], [[wall]] and [[hold]] out")
    scene = replace(scene, file=None, packing=None, shear_rate=0.0)
    edges = np.array(scene.box, dtype=float)
    start: Mapping[str, Any] = {"positions": scene.positions, "box": scene.box, "tilt": scene.tilt}
    largest, d = 0.0, len(edges)
    filled = _filled(scene)
    gradients: list[tuple[Any, ...]] = [("fraction", value) for value in protocol.fractions]
    gradients += [("strain", value) for value in protocol.strains]
    strain = 0.0
    for state, (kind, value) in enumerate(gradients):
        file = state_file(run, state)
        if file.is_file():
            result = load_particles(file)
            largest = float(result.stats["largest_pressure"])
        else:
            here = filled / float(np.prod(np.array(start["box"], dtype=float)))
            gradient = np.eye(d) * ((here / value) ** (1 / d) if kind == "fraction" else 1.0)
            if kind == "strain":
                gradient[0, 1] = value - strain
            moved = _with(scene, deformed(start, gradient), protocol.rest)
            result, settled, largest, spent = rested(moved, protocol.rest, largest)
            result = _saved(result, file, {"settled": settled, "largest_pressure": largest, "rested": spent})
        strain = value if kind == "strain" else strain
        start = from_result(result)
        for part, probe in PROBES.items() if kind == "fraction" and protocol.probe else ():
            if not state_file(run, state, part).is_file():
                gradient = np.eye(d)
                gradient[0, 1] = probe * protocol.probe
                probed = _with(scene, deformed(start, gradient), float(result.stats["rested"]))
                simulate_particles(probed).save(state_file(run, state, part))
    result.save(run.result)


def _saved(result: ParticleResult, file: Path, stats: Mapping[str, Any]) -> ParticleResult:
    result = replace(result, stats={**result.stats, **stats})
    result.save(file)
    return result


def _filled(scene: ParticleScene) -> float:
    """Volume, in two dimensions area, of all particles."""
    from softdyn.particles.packing import BALL

    d = np.shape(scene.positions)[1]
    radii = np.broadcast_to(np.asarray(scene.radii, dtype=float), (len(scene.positions),))
    return float(BALL[d] * np.sum(radii**d))


def protocol_curve(result: ParticleResult, run: Run) -> dict[str, Array]:
    """What was measured at each state of a run.

    Returns
    -------
    dict from str to array, shape (states,)
        ``fraction``, ``strain``, ``pressure``, ``shear_stress``, ``N1``, ``coordination`` without rattlers,
        ``rattlers`` (their part of all particles), ``settled``; ``shear_modulus`` by the probe, and ``bulk_modulus``,
        fraction dp/dfraction from the states beside it: nan where there is none.
    """
    protocol = protocol_of(run)
    rows = []
    for state in range(len(protocol.fractions) + len(protocol.strains)):
        here = load_particles(state_file(run, state))
        found = series(here)
        row = {name: float(found[name][-1]) for name in ("pressure", "shear_stress", "N1")}
        sheared = protocol.strains[state - len(protocol.fractions)] if state >= len(protocol.fractions) else 0.0
        row |= {"fraction": float(fraction(here)[-1]), "strain": sheared}
        row |= {"coordination": float(coordination(here, without_rattlers=True)[-1])}
        row |= {"rattlers": float(rattlers(here).mean()), "settled": float(here.stats["settled"])}
        row["shear_modulus"] = math.nan
        if state < len(protocol.fractions) and protocol.probe:
            probed = [load_particles(state_file(run, state, part)) for part in PROBES]
            forth, back = (float(series(probe)["shear_stress"][-1]) for probe in probed)
            row["shear_modulus"] = (forth - back) / (2 * protocol.probe)
        rows.append(row)
    curve = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    compressed = len(protocol.fractions)
    bulk = np.full(len(rows), math.nan)
    if compressed > 2:
        phi, p = curve["fraction"][:compressed], curve["pressure"][:compressed]
        ahead = np.sign(phi[2:] - phi[1:-1]) == np.sign(phi[1:-1] - phi[:-2])
        slope = (p[2:] - p[:-2]) / np.where(ahead, phi[2:] - phi[:-2], np.nan)
        bulk[1 : compressed - 1] = phi[1:-1] * slope
    return curve | {"bulk_modulus": bulk}


@dataclass(frozen=True)
class JammingPoint:
    """Where pressure sets in.

    Attributes
    ----------
    below, above : float
        Fractions of the last state without a pressure, and of the first with one; nan where there is none.
    fraction, error : float
        Where the pressure, A (fraction - fraction_J)^exponent, extrapolates to 0, and the standard error of the fit;
        nan where the states do not tell.
    exponent : float
    """

    below: float
    above: float
    fraction: float
    error: float
    exponent: float


def jamming_point(fractions: Sequence[float] | Array, pressures: Sequence[float] | Array) -> JammingPoint:
    """Where pressure sets in on compression.

    Parameters
    ----------
    fractions, pressures : array, shape (states,)
        Of the states of one compression, fractions increasing. Below NONE of the largest there is no pressure.
    """
    phi, p = np.asarray(fractions, dtype=float), np.asarray(pressures, dtype=float)
    jammed = p > NONE * np.abs(p).max() if len(p) else np.zeros(0, dtype=bool)
    first = int(np.argmax(jammed)) if jammed.any() else len(p)
    below = float(phi[first - 1]) if first > 0 else math.nan
    above = float(phi[first]) if first < len(p) else math.nan
    nothing = JammingPoint(below, above, math.nan, math.nan, math.nan)
    x, y = phi[first:], p[first:]
    if len(x) < 5 or not (y > 0).all():
        return nothing
    from scipy.optimize import least_squares

    scale, span = float(y.max()), float(x[-1] - x[0])
    # where it sets in, below the first jammed state, as a multiple of the span; logarithms of the pressures are fitted
    found = least_squares(
        lambda q: q[0] + q[1] * np.log((x - x[0]) / span + q[2]) - np.log(y / scale),
        np.array([0.0, 1.0, 0.1]),
        bounds=([-np.inf, 0.1, 1e-9], [np.inf, 5.0, 10.0]),
        x_scale="jac",
    )
    dof = len(x) - 3
    curvature = found.jac.T @ found.jac
    if np.linalg.cond(curvature) > 1e12 or found.active_mask.any():
        return nothing
    spread = np.sqrt(np.diag(np.linalg.inv(curvature)) * 2 * found.cost / dof)
    at = float(x[0] - found.x[2] * span)
    error = float(spread[2] * span)
    return JammingPoint(below, above, at, error, float(found.x[1])) if error < span else nothing
