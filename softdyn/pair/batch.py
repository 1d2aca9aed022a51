"""Batches: many runs of one scene that differ in some of its numbers, in few calls of the kernel.

The kernel makes the runs one after the other, the stages of each side by side in vector registers, and writes the
outputs that are asked for; threads share the runs. What it cannot finish, or not to the tolerance, is run again by
itself, as :func:`simulate_pair` does it, which tells why.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from os import cpu_count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError, SoftdynError
from softdyn.expression import has_kinks
from softdyn.kernels import Kernel, get_kernel
from softdyn.pair.pair_run import (
    ALLOWED_ERROR,
    LARGEST_RESIDUAL,
    MOST_STEPS,
    PULLED,
    kernel_needs,
    model_warnings,
    require_few_rows,
    simulate_pair,
    step_rtol,
)
from softdyn.pair.states import initial_deflection
from softdyn.results.whole_files import written_whole
from softdyn.scene.pair_drive import Drive, drive_of
from softdyn.scene.pair_scene import Scene, check_scene, parameter_values
from softdyn.words import suggestion

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]

#: Runs in one call of the kernel: some milliseconds, within which nothing can be interrupted.
CALL = 256
#: Rows of what a kernel writes before the quantities: t, h, delta, what the drive gives, and its rate.
STATES = 5


@dataclass(frozen=True, repr=False)
class Batch:
    """What many runs gave, one row for each run.

    Attributes
    ----------
    varied : mapping from str to array, shape (runs,)
        The values in which the runs differ.
    arrays : mapping from str to array, shape (runs, outputs)
        As in a :class:`PairResult`; nan where a run failed, or ended before an output. Each is an attribute, too.
    errors : mapping from int to str
        Why a run failed, by its number.
    warnings : mapping from int to tuple of str
        Of each run that has any, by its number.
    """

    varied: Mapping[str, Array]
    arrays: Mapping[str, Array]
    errors: Mapping[int, str] = field(default_factory=dict)
    warnings: Mapping[int, tuple[str, ...]] = field(default_factory=dict)

    def __getattr__(self, name: str) -> Array:
        if name != "arrays" and name in self.arrays:
            return self.arrays[name]
        there = ", ".join(self.arrays) if name != "arrays" else ""
        raise AttributeError(f"the batch has no {name!r}; its arrays are {there}")

    def __repr__(self) -> str:
        names, values = ", ".join(self.varied), ", ".join(self.arrays)
        return f"Batch of {len(self)} runs, {len(self.errors)} of them failed; varied: {names}; arrays: {values}"

    def __len__(self) -> int:
        return len(self.arrays["t"])

    def save(self, path: str | Path) -> Path:
        """Write to .npz, or to .csv as one table with a line for each output of each run.

        There, ``varied_`` stands before the names of what was varied.

        Raises
        ------
        SceneError
            If the ending is another, or the file cannot be written.
        """
        path = Path(path)
        if path.suffix not in (".npz", ".csv"):
            raise SceneError(f"cannot save to {path}: the ending of a table of many runs must be .npz or .csv")
        with written_whole(path) as temporary:
            if path.suffix == ".npz":
                with temporary.open("wb") as file:
                    np.savez(file, **as_arrays(self))
            else:
                outputs = next(iter(self.arrays.values())).shape[1]
                columns = [np.repeat(values, outputs) for values in self.varied.values()]
                table = np.column_stack([*columns, *(values.ravel() for values in self.arrays.values())])
                heads = ",".join([*(f"varied_{name}" for name in self.varied), *self.arrays])
                np.savetxt(temporary, table, delimiter=",", header=heads, comments="", fmt="%.17g")
        return path


def as_arrays(batch: Batch) -> dict[str, Any]:
    """All that a batch holds as arrays, as they go into a file: varied_NAME, NAME, and errors and warnings as JSON."""
    texts = {"errors": batch.errors, "warnings": batch.warnings}
    return {
        **{f"varied_{name}": values for name, values in batch.varied.items()},
        **batch.arrays,
        **{name: np.array(json.dumps({str(run): text for run, text in of.items()})) for name, of in texts.items()},
    }


def simulate_batch(scene: Scene, varied: Mapping[str, Array], progress: Progress | None = None) -> Batch:
    """Run a scene for several values of some of its numbers.

    Parameters
    ----------
    scene : Scene
        With [output] times or gaps; without, the end of each run is its only output.
    varied : mapping from str to array, shape (runs,)
        A parameter of the law, a constant of the drive, "h", "delta", "force", "velocity", or "kappa", which stands for
        a constant force kappa E R^2.
    progress : function of (runs done, runs), optional

    Raises
    ------
    SceneError
        If a name cannot be varied, or the scene cannot be used whatever the values.
    """
    runs = len(next(iter(varied.values())))
    points = [dict(zip(_in_order(varied), row, strict=True)) for row in _rows(varied)]
    varied_scene(scene, points[0])
    kernels: dict[str, Kernel] = {}

    def kernel_of(law: Any, target: str, **needs: Any) -> Kernel:
        """Look a kernel up once for each shape of scene, of which a batch has one or two."""
        shape = repr(needs)
        if shape not in kernels:
            kernels[shape] = get_kernel(law, target, **needs)
        return kernels[shape]

    found = _together(scene, varied, points, kernel_of, progress) if is_plain(scene) else None
    arrays, alone, warnings = found or ({}, list(range(runs)), {})
    results: dict[int, dict[str, Array]] = {}
    errors: dict[int, str] = {}
    for done, run in enumerate(alone):
        try:
            result = simulate_pair(varied_scene(scene, points[run]), kernel_of=kernel_of)
            keep = slice(None) if scene.times is not None or scene.gaps is not None else slice(-1, None)
            results[run] = {name: values[keep] for name, values in result.arrays.items()}
            if result.warnings:
                warnings[run] = result.warnings
        except SoftdynError as error:
            errors[run] = str(error)
        if progress is not None and (done + 1) % CALL == 0:
            progress(runs - len(alone) + done + 1, runs)
    if progress is not None:
        progress(runs, runs)
    return Batch(dict(varied), _joined(runs, arrays, alone, results), errors, warnings)


def varied_scene(scene: Scene, point: Mapping[str, float]) -> Scene:
    """A scene with some of its numbers replaced.

    Raises
    ------
    SceneError
        If it has no such number.
    """
    for name, value in point.items():
        if name in scene.parameters and name in scene.constants:
            raise SceneError(f"{name!r} is both a parameter and a constant: give the constant another name")
        if name in scene.parameters:
            scene = replace(scene, parameters={**scene.parameters, name: value})
        elif name in scene.constants:
            scene = replace(scene, constants={**scene.constants, name: value})
        elif name in ("h", "delta", "force", "velocity"):
            change: dict[str, Any] = {name: value}
            scene = replace(scene, **change)
        elif name == "kappa" and scene.force is not None and {"E", "R"} <= set(scene.parameters):
            force = value * float(scene.parameters["E"]) * float(scene.parameters["R"]) ** 2
            scene = replace(scene, force=force, constants={})
        elif name == "kappa":
            raise SceneError("kappa stands for a force kappa E R^2: give the scene a force, E and R, or vary another")
        else:
            known = [*scene.parameters, *scene.constants, "h", "delta", "force", "velocity", "kappa"]
            raise SceneError(f"{name!r} cannot be varied in this scene{suggestion(name, known)}")
    return scene


def _in_order(varied: Mapping[str, Array]) -> list[str]:
    """Names with kappa last: it is made of parameters, which may be varied, too."""
    return sorted(varied, key=lambda name: name == "kappa")


def _rows(varied: Mapping[str, Array]) -> Any:
    return np.column_stack([varied[name] for name in _in_order(varied)]).tolist()


def is_plain(scene: Scene) -> bool:
    """Whether the outputs of all runs are known before, in number and place."""
    if scene.method == "quadrature":
        return False
    if scene.gaps is not None:
        return scene.until_h is not None and scene.until_t is None
    return (scene.until_h is None) != (scene.until_t is None) and (scene.times is None or scene.until_h is None)


def _first_sound(scene: Scene, points: list[dict[str, float]]) -> Scene:
    """The first of the runs whose numbers can be used: what is wrong with some is told of each of them."""
    faults = []
    for point in points:
        try:
            check_scene(found := varied_scene(scene, point))
            drive_of(found)
            return found
        except SceneError as error:
            faults.append(error)
    raise faults[0]


def _together(
    scene: Scene,
    varied: Mapping[str, Array],
    points: list[dict[str, float]],
    kernel_of: Callable[..., Kernel],
    progress: Progress | None,
) -> tuple[dict[str, Array], list[int], dict[int, tuple[str, ...]]] | None:
    """Arrays of all runs, the numbers of those that have to be made alone, and warnings; None if all have to."""
    runs = len(points)
    first = _first_sound(scene, points)
    drive = drive_of(first)
    require_few_rows(first, drive)
    constants = _constants(scene, varied, points, drive)
    if constants is None:
        return None
    # a kernel whose deflection has every sign that occurs
    signs = np.sign(constants) if drive.control == "force" and drive.shape == "constant" else np.zeros(1)
    one_sign = {1.0: "compression", -1.0: "tension"}.get(float(signs.flat[0])) if np.all(signs == signs[0]) else None
    needs = kernel_needs(first, drive)
    if drive.table is None:
        needs["deflection"] = one_sign or "either"
    kernel = kernel_of(scene.law, scene.target, **needs)
    if kernel.tabulated or kernel.dry or (isinstance(drive.shape, tuple) and has_kinks(drive.shape)):
        return None  # at kinks steps have to end; whether a table is left is seen from the steps
    parameters, sound = _parameters(first, varied, kernel, drive)
    h = np.broadcast_to(np.asarray(varied.get("h", scene.h), dtype=float), (runs,))
    sound &= np.isfinite(h) & (h >= np.finfo(float).tiny) & np.isfinite(constants).all(axis=1)
    deltas = np.full(runs, math.nan)
    # under a force the kernel finds it, unless X is given, and has to agree
    if drive.control != "force" or scene.X is not None:
        for run in np.flatnonzero(sound):
            try:
                of_run = varied_scene(scene, points[run])
                R = float(parameters[run, kernel.parameters.index("R")])
                deltas[run] = initial_deflection(of_run, kernel, drive_of(of_run), parameters[run], R)
            except SoftdynError:
                sound[run] = False
    with np.errstate(all="ignore"):
        u = np.log(h)
    targets, at_gaps = _targets(scene, drive.start, h)
    t_end = math.inf if scene.until_t is None else float(scene.until_t)
    u_stop = math.nan if scene.until_h is None else math.log(scene.until_h)
    if t_end <= drive.start or (at_gaps and np.any(np.diff(targets, axis=1) * (u_stop - u[:, None]) < 0)):
        return None  # these say what is wrong, or are out of order
    rows = np.column_stack([np.full(runs, t_end), np.full(runs, u_stop), u, deltas, parameters, constants])
    automatic = float(scene.method == "auto")
    settings = np.array([step_rtol(scene, kernel), drive.start, math.inf, float(MOST_STEPS), automatic])
    # [output] tells which outputs there are: a run that does not get to all of them is made alone
    out, status, error = _call(kernel, drive, settings, rows[sound], targets[sound], at_gaps, progress)
    arrays = {name: np.full((runs, targets.shape[1]), math.nan) for name in ("t", "h", "delta", *scene.quantities)}
    names = ("t", "h", "delta", *(("F", "dF_dt") if drive.control == "force" else ("", "")), *kernel.outputs)
    known = dict(zip(names, out, strict=True))
    for name in arrays:
        arrays[name][sound] = known[name]
    if at_gaps:
        gaps = _gaps(scene, h)
        arrays["h"][sound] = gaps[sound]
        arrays["t"][sound] = np.where(gaps == h[:, None], drive.start, arrays["t"])[sound]
    largest = np.max(np.abs(known["F_ela"]), axis=1, initial=0.0)
    good = np.isin(status, (0, 1)) & (error <= ALLOWED_ERROR * scene.rtol) & np.isfinite(largest)
    for values in known.values():
        good &= np.isfinite(values).all(axis=1)
    if drive.control == "force":
        residual = np.max(np.abs(known["F_ela"] - known["F"]), axis=1, initial=0.0)
        good &= residual <= max(LARGEST_RESIDUAL, float(scene.rtol)) * np.max(np.abs(known["F"]), axis=1, initial=0.0)
    place = np.flatnonzero(sound)
    R = parameters[sound, kernel.parameters.index("R")]
    E = parameters[sound, kernel.parameters.index("E")] if "E" in kernel.parameters else np.inf
    deepest = np.max(np.abs(known["delta"]), axis=1, initial=0.0)
    pulled = np.max(-known["delta"], axis=1, initial=0.0)
    outside = (largest > E * R**2) | (deepest >= R) | (pulled > PULLED * R)
    warnings = {
        int(place[i]): found
        for i in np.flatnonzero(good & outside)
        if (
            found := model_warnings(
                kernel, parameters[place[i]], float(largest[i]), arrays["t"][place[i]], known["delta"][i]
            )
        )
    }
    return arrays, sorted({*range(runs)} - {*place[good].tolist()}), warnings


def _constants(scene: Scene, varied: Mapping[str, Array], points: list[dict[str, float]], drive: Drive) -> Array | None:
    """Constants of the drive, a row for each run; None if the runs have drives of several shapes."""
    runs = len(points)
    if drive.table is not None:
        return np.zeros((runs, 0))
    given = {"force", "velocity", "kappa", *scene.constants} & set(varied)
    if not given:
        return np.tile(drive.constants, (runs, 1))
    if drive.shape == "constant" and len(given) == 1 and not given & set(scene.constants):
        values = np.array(varied[given.pop()])
        if "kappa" in varied:
            E, R = (np.asarray(varied.get(name, scene.parameters[name]), dtype=float) for name in "ER")
            values = values * E * R**2
        return values[:, None]
    drives = [drive_of(varied_scene(scene, point)) for point in points]
    if len({repr(one.shape) for one in drives}) > 1:
        return None
    return np.array([one.constants for one in drives])


def _parameters(
    scene: Scene, varied: Mapping[str, Array], kernel: Kernel, drive: Drive
) -> tuple[Array, NDArray[np.bool_]]:
    """What the kernel takes for p, a row for each run; and which rows hold values that are allowed."""
    runs = len(next(iter(varied.values())))
    names = kernel.parameters[:-1] if drive.control == "spring" else kernel.parameters
    p = np.tile(parameter_values(scene, names, (), {}), (runs, 1))
    for i, name in enumerate(names):
        if name in varied:
            p[:, i] = varied[name]
    sound = np.isfinite(p).all(axis=1)
    for i, name in enumerate(names):
        if name in kernel.positive:
            sound &= p[:, i] >= np.finfo(float).tiny
        if name in kernel.ranges:
            low, high, above, below = kernel.ranges[name]
            sound &= (p[:, i] > low) if above else (p[:, i] >= low)
            sound &= (p[:, i] < high) if below else (p[:, i] <= high)
    if drive.control == "spring":
        p = np.column_stack([p, np.full(runs, 1 / drive.stiffness)])
    return p, sound


def _gaps(scene: Scene, h: Array) -> Array:
    """Gaps of the outputs, a row for each run."""
    if scene.gaps is None:
        return np.full((len(h), 1), float(scene.until_h or 0))
    if isinstance(scene.gaps, (int, np.integer)):
        gaps = np.geomspace(h, float(scene.until_h or 0), int(scene.gaps), axis=1)
        gaps[:, 0], gaps[:, -1] = h, float(scene.until_h or 0)
        return gaps
    return np.tile(np.array(scene.gaps, dtype=float), (len(h), 1))


def _targets(scene: Scene, start: float, h: Array) -> tuple[Array, bool]:
    """Where the outputs are, a row for each run: times, or values of ln h."""
    if scene.gaps is not None or scene.until_t is None:
        with np.errstate(all="ignore"):
            return np.log(_gaps(scene, h)), True
    if scene.times is None:
        times = np.array([float(scene.until_t)])
    elif isinstance(scene.times, (int, np.integer)):
        times = np.linspace(start, float(scene.until_t), int(scene.times))
    else:
        times = np.array(scene.times, dtype=float)
        if times[0] < start or times[-1] > scene.until_t:
            raise SceneError(f"[output] times must lie within the run, {start:g} .. {scene.until_t:g}")
    return np.tile(times, (len(h), 1)), False


def _call(
    kernel: Kernel,
    drive: Drive,
    settings: Array,
    rows: Array,
    targets: Array,
    at_gaps: bool,
    progress: Progress | None,
) -> tuple[Array, Array, Array]:
    """Make the runs, in as many threads as there are processors.

    Returns
    -------
    out : array, shape (states and quantities, runs, outputs)
    status, error : arrays, shape (runs,)
    """
    runs, count = targets.shape
    height = STATES + len(kernel.outputs)
    out, status, error = np.empty((height, runs, count)), np.empty(runs), np.empty(runs)
    table = drive.arguments if drive.table is not None else ()

    def make(first: int) -> int:
        part = slice(first, min(first + CALL, runs))
        n = int(part.stop - part.start)
        written = np.full((height * count + 2) * n, math.nan)
        given = np.ascontiguousarray(rows[part]).ravel(), np.ascontiguousarray(targets[part]).ravel()
        kernel.functions.runs(n, count, int(at_gaps), settings, *given, *table, written)
        out[:, part] = written[: height * count * n].reshape(height, n, count)
        status[part], error[part] = written[height * count * n :].reshape(2, n)
        return n

    if kernel.target == "numba":  # compiled here if it never was, and not by all threads at once
        kernel.functions.runs(0, 0, 0, settings, np.empty(0), np.empty(0), *table, np.empty(0))
    done = 0
    with ThreadPoolExecutor(cpu_count() or 1) as pool:
        for n in pool.map(make, range(0, runs, CALL)):
            done += n
            if progress is not None:
                progress(done, runs)
    return out, status, error


def _joined(
    runs: int, arrays: dict[str, Array], alone: list[int], results: Mapping[int, Mapping[str, Array]]
) -> dict[str, Array]:
    """Arrays of all runs: those of the kernel, and in their places those of runs that were made alone."""
    names = list(arrays) or next((list(of) for of in results.values()), ["t", "h", "delta"])
    longest = max((len(of["t"]) for of in results.values()), default=0)
    if arrays:
        longest = max(longest, arrays["t"].shape[1])
    joined = {name: np.full((runs, longest), math.nan) for name in names}
    for name, values in arrays.items():
        joined[name][:, : values.shape[1]] = values
        joined[name][alone] = math.nan
    for run, of in results.items():
        for name, content in of.items():
            joined[name][run, : len(content)] = content
    return joined
