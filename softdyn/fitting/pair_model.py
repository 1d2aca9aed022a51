"""Curves of two particles as functions of what is fitted: trajectories, and how they depend on it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.fitting.curve_data import (
    ERROR,
    FORCE,
    LENGTH,
    PAIR_COLUMNS,
    STIFFNESS,
    VELOCITY,
    CurveData,
    read_curve,
)
from softdyn.fitting.least_squares import Parameter
from softdyn.fitting.static_model import SHIFT
from softdyn.kernels import Kernel, get_kernel
from softdyn.pair.sensitivities import sensitivities
from softdyn.scene.pair_drive import DRIVES
from softdyn.scene.pair_scene import Scene
from softdyn.scene.time_tables import Table
from softdyn.scene.units import Powers, quantity
from softdyn.words import listed, suggestion

Array = NDArray[np.float64]

#: What can be compared with a trajectory.
QUANTITIES = ("h", "X", "delta", "a", "F")
#: Of the start of each curve: with several, each has its own.
OF_START = ("h", "delta")
OF_DRIVE: dict[str, Powers] = {"force": FORCE, "velocity": VELOCITY, "position": LENGTH, "base": LENGTH}
#: What a fit needs of a scene; all else of it is the fit's own affair.
OF_SCENE = ("law", "parameters", "h", "delta", "constants", "rtol", "target", *DRIVES)


#: Steps that a run may take, and more for each row of the data: parameters for which it takes more are far off.
MOST_STEPS, STEPS_OF_ROW = 3000, 10


@dataclass(frozen=True)
class Column:
    """A column of the data that drives a pair, with its sign: "-Z" goes the other way."""

    name: str
    sign: float


@dataclass(frozen=True)
class PairCurve:
    """One measured curve, and the scene that is to give it.

    Attributes
    ----------
    data : CurveData
    scene : Scene
        At the start values; its outputs are at the times of the data.
    order : array of int, shape (points,)
        Which of the times of the scene is that of each point.
    measured : tuple of str
        Quantities that are compared.
    driven : Table or None
        Of a position or a base that is a column: it is known up to a constant.
    """

    data: CurveData
    scene: Scene
    order: NDArray[np.int64]
    measured: tuple[str, ...]
    driven: Table | None

    def at(self, values: Mapping[str, float]) -> Scene:
        """The scene with some of its numbers."""
        scene = self.scene
        own: dict[str, Any] = {
            name: values[name] for name in ("h", "delta", "force", "velocity", "position") if name in values
        }
        parameters = {name: values.get(name, number) for name, number in scene.parameters.items()}
        constants = {name: values.get(name, number) for name, number in scene.constants.items()}
        scene = replace(scene, parameters=parameters, constants=constants, **own)
        spring = scene.spring
        if spring is not None and "stiffness" in values:
            spring = {**spring, "stiffness": values["stiffness"]}
        if self.driven is not None:
            # where it is zero nobody knows: at the start the pair is at the gap h, and as yet not deflected
            shift = 2 * parameters["R"] + scene.h - 2 * (scene.delta or 0.0)
            place = Table(self.driven.t, self.driven.F + shift)
            if spring is None:
                return replace(scene, position=place)
            spring = {**spring, "base": place}
        return replace(scene, spring=spring)


class PairModel:
    """Values of all curves at all points, and their slopes, as a fit takes them."""

    def __init__(self, curves: Sequence[PairCurve], free: Mapping[str, tuple[int | None, str]]) -> None:
        self.curves = curves
        self.free = dict(free)
        self.kernels: dict[str, Kernel] = {}
        counts = [len(curve.order) * len(curve.measured) for curve in curves]
        self.starts = np.concatenate([[0], np.cumsum(counts)])

    def _kernel(self, *given: Any, **needs: Any) -> Kernel:
        """A kernel, looked up once."""
        key = repr(sorted(needs.items(), key=lambda item: item[0]))
        if key not in self.kernels:
            self.kernels[key] = get_kernel(*given, **needs)
        return self.kernels[key]

    def __call__(self, values: Array) -> tuple[Array, Array]:
        found = np.empty(self.starts[-1])
        slopes = np.zeros((self.starts[-1], len(values)))
        for n, curve in enumerate(self.curves):
            here = [k for k, (owner, _) in enumerate(self.free.values()) if owner in (None, n)]
            names = [list(self.free.values())[k][1] for k in here]
            scene = curve.at(dict(zip(names, (float(values[k]) for k in here), strict=True)))
            most = MOST_STEPS + STEPS_OF_ROW * len(curve.order)
            run = sensitivities(
                scene, names, kernel_of=partial(self._kernel), relative=curve.driven is not None, most=most
            )
            size = len(curve.order)
            for m, name in enumerate(curve.measured):
                place = self.starts[n] + m * size
                found[place : place + size] = run.result.arrays[name][curve.order]
                slopes[place : place + size, here] = run.slopes[name][curve.order]
        return found, slopes


def curves_of(data: Sequence[Any], given: Mapping[str, Any], numbers: Mapping[str, float]) -> list[PairCurve]:
    """Read the data of a fit, and make the scene of each curve.

    Parameters
    ----------
    data : sequence
        Of paths, or of arrays by name.
    given : mapping
        Fields of a scene: law, parameters, h, delta, constants, target, rtol, and the drive.
    numbers : mapping from str to float
        Of its parameters and constants, where the fit starts.

    Raises
    ------
    SceneError
    """
    control, value = _drive_of(given)
    curves = []
    for n, one in enumerate(data):
        column, known = _column_of(control, value, one, n + 1)
        curves.append(_curve(known, given, control, value, column, numbers, n))
    return curves


def _drive_of(given: Mapping[str, Any]) -> tuple[str, Any]:
    named = [name for name in DRIVES if given.get(name) is not None]
    if len(named) != 1:
        raise SceneError(
            f"a fit needs a drive, one of {', '.join(DRIVES)}, as drive={{'velocity': -1e-6}} or "
            f"drive={{'spring': {{'stiffness': 0.05, 'base': 'Z'}}}} with Z a column; here there is "
            f"{' and '.join(named) or 'none'}"
        )
    return named[0], given[named[0]]


def _column_of(control: str, value: Any, data: Any, number: int) -> tuple[Column | None, CurveData]:
    """The column that drives, if one does, and the data with it."""
    text = value.get("base") if control == "spring" and isinstance(value, Mapping) else value
    wanted = OF_DRIVE["base" if control == "spring" else control]
    if isinstance(text, str):
        name = text.removeprefix("-").strip()
        try:
            read = read_curve(data, number, PAIR_COLUMNS, {name: wanted} if name.isidentifier() else {})
        except SceneError as error:
            if not name.isidentifier() or (
                f"{name} missing" not in str(error) and f"{name} is missing" not in str(error)
            ):
                raise
            read = read_curve(data, number, PAIR_COLUMNS, {})  # then it is an expression
        if name in read.columns:
            return Column(name, -1.0 if text.startswith("-") else 1.0), read
        return None, read
    return None, read_curve(data, number, PAIR_COLUMNS, {})


def _curve(
    data: CurveData,
    given: Mapping[str, Any],
    control: str,
    value: Any,
    column: Column | None,
    numbers: Mapping[str, float],
    n: int,
) -> PairCurve:
    """One curve with its scene."""
    where = f"data {data.name}"
    measured = [name for name in data.measured(QUANTITIES) if column is None or name != column.name]
    if control == "force":
        measured = [name for name in measured if name != "F"]
    if control == "position":
        measured = [name for name in measured if name != "X"]
    if not measured:
        raise SceneError(
            f"{where}: there is nothing to fit: a column is needed of {', '.join(QUANTITIES)} that is not given by the "
            f"drive; there are {', '.join(data.columns)}"
        )
    t = _times(data, column, given.get("speed"), where)
    order = np.argsort(t, kind="stable")
    times, places = np.unique(t, return_inverse=True)
    driven = None
    fields_of_drive: dict[str, Any] = {}
    if column is None:
        fields_of_drive[control] = value
        if times[0] < 0:
            raise SceneError(f"{where}: a run starts at t = 0, and the data at {times[0]:g}: shift their times")
    else:
        moved = column.sign * data.columns[column.name][order]
        table_t, first = np.unique(t[order], return_index=True)
        if len(table_t) < 2:
            raise SceneError(f"{where}: two rows at least are needed, at different times")
        if control in ("position", "spring"):
            driven = _corners(Table(table_t, moved[first] - moved[first][0]))
            fields_of_drive = (
                {"position": driven}
                if control == "position"
                else {"spring": {"stiffness": value["stiffness"], "base": driven}}
            )
        else:
            fields_of_drive[control] = Table(table_t, moved[first])
    start = {}
    for name in OF_START:
        one = given.get(name)
        if isinstance(one, (list, tuple, np.ndarray)):
            one = one[n]
        if one is not None:
            start[name] = one
    scene = Scene(
        law=given["law"], parameters={name: numbers[name] for name in given["parameters"]}, **start,
        constants={name: numbers[name] for name in given.get("constants") or {}},
        until_t=float(times[-1]), times=times.tolist(), quantities=("X", "a", "F"),
        rtol=given.get("rtol") or 1e-9, target=given.get("target") or "auto", **fields_of_drive,
    )  # fmt: skip
    return PairCurve(data, scene, places.ravel(), tuple(measured), driven)


#: Of the range of a place, the part by which rows may be off a straight line between others, and are left out: ten
#: picometres of a micrometre, below what a piezo does.
STRAIGHT = 1e-5


def _corners(table: Table) -> Table:
    """The rows between which a place moves at a constant velocity: a step of the integration ends at each."""
    t, x = table.t, table.F
    off = STRAIGHT * float(np.ptp(x))
    kept, low, high = [0], -math.inf, math.inf
    for n in range(1, len(t)):
        since = t[n] - t[kept[-1]]
        slope, slack = (x[n] - x[kept[-1]]) / since, off / since
        if not low <= slope <= high:
            kept.append(n - 1)
            since = t[n] - t[n - 1]
            slope, slack, low, high = (x[n] - x[n - 1]) / since, off / since, -math.inf, math.inf
        low, high = max(low, slope - slack), min(high, slope + slack)
    return Table(t[[*kept, len(t) - 1]], x[[*kept, len(t) - 1]])


def _times(data: CurveData, column: Column | None, speed: Any, where: str) -> Array:
    """When each point was taken: by its column, or by the way at a constant speed."""
    if "t" in data.columns:
        if speed is not None:
            raise SceneError(f"{where}: there is a column t, so that the speed follows; leave out one of the two")
        return data.columns["t"]
    if column is None or speed is None:
        raise SceneError(
            f"{where}: there is no column t; without it a column must drive, at a speed that is known: "
            "drive={'spring': {'stiffness': ..., 'base': 'Z'}, 'speed': ...} or {'position': 'X', 'speed': ...}"
        )
    way = np.abs(np.diff(data.columns[column.name]))
    return np.concatenate([[0.0], np.cumsum(way)]) / float(speed)


def sigma_of(curves: Sequence[PairCurve]) -> tuple[Array, Array, NDArray[np.int64]]:
    """Measured values, their standard errors (nan where unknown) and groups, in the order of the model."""
    measured: list[Array] = []
    sigma: list[Array] = []
    groups: list[NDArray[np.int64]] = []
    for curve in curves:
        for name in curve.measured:
            column = curve.data.columns[name]
            measured.append(column)
            sigma.append(curve.data.columns.get(name + ERROR, np.full(len(column), math.nan)))
            groups.append(np.full(len(column), len(groups)))
    return np.concatenate(measured), np.concatenate(sigma), np.concatenate(groups)


def free_parameters(
    free: Any, curves: Sequence[PairCurve], positive: Sequence[str], ranges: Mapping[str, Sequence[Any]]
) -> tuple[list[Parameter], dict[str, tuple[int | None, str]]]:
    """Parameters that are fitted, with bounds by what the law declares, and where each belongs.

    Parameters
    ----------
    free : sequence of str, or mapping from str to (low, high)
    curves : sequence of PairCurve
    positive, ranges
        What the law declares of its parameters.

    Raises
    ------
    SceneError
    """

    def start_of(name: str, owner: int) -> float | None:
        return _start_of(curves[owner].scene, name)

    scene = curves[0].scene
    there = [*scene.parameters, *scene.constants, "h"]
    return _freed(free, start_of, there, len(curves), positive, ranges)


def static_parameters(
    free: Any, numbers: Mapping[str, float], curves: int, positive: Sequence[str], ranges: Mapping[str, Sequence[Any]]
) -> tuple[list[Parameter], dict[str, tuple[int | None, str]]]:
    """The same where nothing moves: of the parameters of the law, and of the shift of each curve's gaps.

    Parameters
    ----------
    free : sequence of str, or mapping from str to (low, high)
        Names of what is fitted, with bounds.
    numbers : mapping from str to float
        Values at which the fit starts.
    curves : int
        How many there are.
    positive : sequence of str
        Parameters that must be.
    ranges : mapping from str to sequence
        Of those that have one: low, high, and whether these are left out.

    Raises
    ------
    SceneError
    """
    return _freed(free, lambda name, _: numbers.get(name), list(numbers), curves, positive, ranges)


def _freed(
    free: Any,
    start_of: Callable[[str, int], float | None],
    there: Sequence[str],
    curves: int,
    positive: Sequence[str],
    ranges: Mapping[str, Sequence[Any]],
) -> tuple[list[Parameter], dict[str, tuple[int | None, str]]]:
    """What is fitted, with its bounds, and where each belongs."""
    wanted = dict.fromkeys(free) if not isinstance(free, Mapping) else dict(free)
    if isinstance(free, str) or not wanted:
        raise SceneError(f"free names what is fitted, a list as ['A', 'h'], not {free!r}")
    parameters: list[Parameter] = []
    places: dict[str, tuple[int | None, str]] = {}
    faults: list[str] = []
    for name, limits in wanted.items():
        owners = range(curves) if name in (*OF_START, SHIFT) and curves > 1 else (None,)
        for owner in owners:
            start = start_of(name, owner or 0)
            if start is None:
                faults.append(f"free: there is nothing called {name!r} in the scene{suggestion(name, there)}")
                break
            low, high, by_log = _bounds(name, limits, positive, ranges, faults)
            if not low <= start <= high:
                faults.append(f"free: {name} starts at {start:g}, outside of its bounds {low:g} .. {high:g}")
            shown = name if owner is None else f"{name}_{owner + 1}"
            places[shown] = owner, name
            parameters.append(Parameter(shown, start, low, high, by_log))
    if faults:
        raise SceneError(listed(faults))
    return parameters, places


def _start_of(scene: Scene, name: str) -> float | None:
    if name in scene.parameters:
        return float(scene.parameters[name])
    if name in scene.constants:
        return float(scene.constants[name])
    if name == "stiffness" and scene.spring is not None:
        return float(scene.spring["stiffness"])
    if name == "delta" and scene.velocity is not None:
        return float(scene.delta or 0.0)
    value = getattr(scene, name, None) if name in ("h", "force", "velocity", "position") else None
    return float(value) if isinstance(value, (int, float)) else None


def _bounds(
    name: str, limits: Any, positive: Sequence[str], ranges: Mapping[str, Sequence[Any]], faults: list[str]
) -> tuple[float, float, bool]:
    """Bounds of a parameter, and whether its logarithm is fitted."""
    low, high = -math.inf, math.inf
    by_log = name in positive or name in ("h", "stiffness")
    if name in ranges:
        low, high = ranges[name][:2]
        by_log = False
    if by_log:
        low = 0.0
    if limits is not None:
        try:
            first, last = (float(one) for one in limits)
        except (TypeError, ValueError):
            faults.append(f"free: bounds of {name} are two numbers, (low, high), not {limits!r}")
            return low, high, by_log
        if not max(low, first) < min(high, last):
            faults.append(f"free: {name} lies within {low:g} .. {high:g}, and {first:g} .. {last:g} are no bounds")
            return low, high, by_log
        low, high = max(low, first), min(high, last)
    return low, high, by_log


def plain_numbers(given: Mapping[str, Any], dimensions: Mapping[str, Powers]) -> dict[str, Any]:
    """What is given, each quantity with a unit as a number in SI units."""
    found = dict(given)
    own = {**dimensions}
    found["parameters"] = {
        name: quantity(f"[parameters] {name}", value, own.get(name)) for name, value in given["parameters"].items()
    }
    constants = given.get("constants") or {}
    found["constants"] = {name: quantity(f"[constants] {name}", value, None) for name, value in constants.items()}
    for name, of in (("h", LENGTH), ("delta", LENGTH)):
        one = given.get(name)
        if isinstance(one, (list, tuple)):
            found[name] = [quantity(f"[pair] {name}", value, of) for value in one]
        elif one is not None and not isinstance(one, np.ndarray):
            found[name] = quantity(f"[pair] {name}", one, of)
    for name in DRIVES:
        if given.get(name) is not None:
            found[name] = _plain_drive(name, given[name])
    if given.get("speed") is not None:
        found["speed"] = quantity("[drive] speed", given["speed"], VELOCITY)
    return found


def _plain_drive(name: str, value: Any) -> Any:
    if isinstance(value, Mapping):
        if "stiffness" not in value:
            return value
        return {**value, "stiffness": quantity(f"[drive] {name}: stiffness", value["stiffness"], STIFFNESS)}
    if isinstance(value, (str, Table, tuple, list)):
        if isinstance(value, str) and value[:1].isdigit() and " " in value.strip():
            try:
                return quantity(f"[drive] {name}", value, OF_DRIVE[name])
            except SceneError:
                return value  # an expression that starts with a number
        return value
    return quantity(f"[drive] {name}", value, OF_DRIVE[name])


def scene_fields(scene: Scene) -> dict[str, Any]:
    """What a fit takes of a scene."""
    return {field.name: getattr(scene, field.name) for field in fields(scene) if field.name in OF_SCENE}
