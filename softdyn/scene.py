"""Scenes: what to simulate, from a TOML file or from keyword arguments, checked before anything runs."""

from __future__ import annotations

import itertools
import math
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.expression import FUNCTIONS, Expression, parse
from softdyn.expression import evaluate as evaluate_expression
from softdyn.tables import Column, read_columns
from softdyn.targets import CHOICES
from softdyn.words import listed, suggestion

#: Quantities that a result can hold besides t, h and delta; F and dF_dt are the external force and its rate.
QUANTITIES = ("X", "a", "F", "dF_dt", "zeta", "F_adh", "C", "D", "dh_dt", "ddelta_dt", "dX_dt", "lambda1", "lambda2")
DEFAULT_QUANTITIES = ("X", "a", "F")
METHODS = ("auto", "integrate", "quadrature")
#: Below this, rounding of ln h is of the order of the tolerance.
SMALLEST_RTOL = 1e-14
LARGEST_COUNT = 10_000_000

KEYS: dict[str, tuple[str, ...]] = {
    "pair": ("h", "X", "delta"),
    "drive": ("force", "position", "velocity", "spring", "constants"),
    "until": ("h", "t"),
    "output": ("times", "gaps", "quantities"),
    "accuracy": ("rtol", "method"),
}
#: What can drive a pair; exactly one of them does.
DRIVES = ("force", "position", "velocity", "spring")
#: Headings of their tables, besides their own names; those of a result of softdyn among them.
HEADINGS = {
    "force": ("F", "F_ext"),
    "velocity": ("v", "V", "dX_dt"),
    "position": ("x", "X", "distance"),
    "base": ("x", "X", "position"),
}
TOP_LEVEL = ("law", "target", "parameters", *KEYS)
#: What a parameter may be: low, high, and whether each of these is itself left out.
Range = tuple[float, float, bool, bool]


@dataclass(frozen=True)
class Table:
    """What is given at rising times, linear in between: arrays of one length, times and values.

    A time that comes twice is a jump, from the first value to the second.
    """

    t: NDArray[np.float64]
    F: NDArray[np.float64]


@dataclass(frozen=True)
class Scene:
    """Two particles, pushed or moved; all numbers in one consistent set of units.

    One of ``force``, ``position``, ``velocity`` and ``spring`` says by what: each a number, an expression of t, a
    table, or a pair of arrays (t, values).

    Parameters
    ----------
    law : str, Path or ContactLaw
        A stock law's name, ``path/law.py``, ``path/law.py:name``, or a law.
    parameters : mapping from str to float
        A value for each parameter of the law.
    h : float
        Initial gap, > 0.
    force : optional
        External force, > 0 pushes the particles together.
    position : optional
        Distance of the centres, X. A jump of it would take an infinite velocity, and is refused.
    velocity : optional
        dX/dt, < 0 brings the particles together.
    spring : mapping, optional
        ``stiffness`` (a number, force/length) and ``base``, a distance: the force is stiffness (X - base), as from a
        cantilever whose base moves; no jumps.
    constants : mapping from str to float
        Named constants of the expression.
    X : float, optional
        Initial distance of the centres, which must agree with h and with what else is given.
    delta : float, optional
        Initial deflection where the force is not given, better conditioned than X; with ``velocity`` alone, 0 if
        neither is given.
    until_h, until_t : float, optional
        The run ends when the gap passes until_h, or at the time until_t, whichever comes first.
    times : int or sequence of float, optional
        Output times: how many, evenly spaced over the run, or which.
    gaps : int or sequence of float, optional
        Output gaps instead: how many, evenly spaced in ln h between h and until_h, or which, in the order of passage.
        Without times and gaps there is one output at every step taken, and at the nodes of panels of the gap.
    quantities : sequence of str
        What to output besides t, h and delta: of :data:`QUANTITIES`.
    rtol : float
        Relative error allowed in h at each step.
    method : "auto", "integrate" or "quadrature"
        "auto" takes ln h as the independent variable under a constant force, as long as the gap moves by more than a
        tenth of its distance to where it would rest; else, and with "integrate" always, it is the time. "quadrature",
        for a constant force and outputs at gaps alone, is Gauss's, to rounding: what the others are measured against.
    target : "auto", "c" or "numba"
    """

    law: Any
    parameters: Mapping[str, float]
    h: float
    force: Any = None
    position: Any = None
    velocity: Any = None
    spring: Mapping[str, Any] | None = None
    constants: Mapping[str, float] = field(default_factory=dict)
    X: float | None = None
    delta: float | None = None
    until_h: float | None = None
    until_t: float | None = None
    times: int | Sequence[float] | NDArray[np.float64] | None = None
    gaps: int | Sequence[float] | NDArray[np.float64] | None = None
    quantities: Sequence[str] = DEFAULT_QUANTITIES
    rtol: float = 1e-9
    method: str = "auto"
    target: str = "auto"


def read_scene(path: str | Path) -> Scene:
    """Read a scene file.

    Raises
    ------
    SceneError
        If the file cannot be read, is not TOML (with the line), or holds an unknown or missing key.
    """
    path = Path(path)
    data = read_toml(path)
    try:
        return scene_from(data, path.parent)
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from None


_RESULT = 'a result: softdyn plot and convert read it, and a scene may go on from it, [particles] file = "..."'
_TABLE = "a table: a scene names it, as [particles] file, or as what drives a pair"
#: Endings of files that are no scenes, and what they are.
NO_SCENES = {
    ".npz": _RESULT,
    ".json": _RESULT,
    ".csv": _TABLE,
    ".gsd": "what other programs show",
    ".pvd": "what other programs show",
    ".py": 'a law: a scene names it, law = "FILE.py"',
}


def read_toml(path: Path) -> dict[str, Any]:
    """Content of a scene file.

    Raises
    ------
    SceneError
        If the file cannot be read, or is not TOML (with the line).
    """
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise SceneError(f"cannot read the scene {path}: {error.strerror}") from None
    if path.suffix.lower() in NO_SCENES:
        raise SceneError(f"{path} is no scene, which is TOML, but {NO_SCENES[path.suffix.lower()]}")
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise SceneError(f"{path} is text in UTF-16, and TOML is in UTF-8: save it as such")
    try:
        text = raw.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = raw[: error.start].count(b"\n") + 1
        raise SceneError(
            f"{path} is not text in UTF-8: {error.reason} at byte {error.start}, line {line}; save it as such"
        ) from None
    try:
        content = tomllib.loads(text)
    except RecursionError:
        raise SceneError(f"{path} is nested too deeply") from None
    except ValueError as error:
        raise SceneError(f"{path} is not valid TOML: {error}") from None
    if "\\" in text and _holds_nul(content):
        raise SceneError(f"{path}: a text in it holds a NUL character, which no name and no path has")
    return content


def _holds_nul(content: Any) -> bool:
    if isinstance(content, Mapping):
        return any(_holds_nul(key) or _holds_nul(value) for key, value in content.items())
    return "\0" in content if isinstance(content, str) else isinstance(content, list) and any(map(_holds_nul, content))


def is_particle_scene(data: Mapping[str, Any]) -> bool:
    """Whether the content of a scene file is a scene of many particles (:mod:`softdyn.particles.files`)."""
    return "particles" in data or "packing" in data


def scene_from(data: Mapping[str, Any], folder: Path) -> Scene:
    """Scene from the content of a scene file; paths in it are relative to ``folder``."""
    if is_particle_scene(data):
        raise SceneError("it is a scene of many particles, for softdyn run; here one of two is needed, with [pair]")
    faults = unknown_keys(data, TOP_LEVEL, "")
    for section, keys in KEYS.items():
        content = data.get(section, {})
        if not isinstance(content, Mapping):
            faults.append(f"{section} must be a section, [{section}]")
        else:
            faults += unknown_keys(content, keys, f"[{section}] ", TOP_LEVEL)
    missing = [key for key in ("law", "parameters", "pair", "drive", "until") if key not in data]
    faults += [f"[{key}] is missing" if key != "law" else 'law is missing: law = "NAME"' for key in missing]
    if "pair" not in missing and isinstance(data["pair"], Mapping) and "h" not in data["pair"]:
        faults.append("[pair] h is missing")
    if "drive" not in missing and isinstance(data["drive"], Mapping) and not set(DRIVES) & set(data["drive"]):
        faults.append("[drive] force is missing (or position, velocity, spring)")
    if faults:
        raise SceneError(listed(faults))
    law = data["law"]
    if isinstance(law, str) and ".py" in law:
        law = str(folder / law)
    drive = {name: _file_or_value(name, data["drive"][name], folder) for name in DRIVES if name in data["drive"]}
    output, accuracy = data.get("output", {}), data.get("accuracy", {})
    return Scene(
        law=law,
        target=data.get("target", "auto"),
        parameters=data["parameters"],
        h=data["pair"]["h"],
        X=data["pair"].get("X"),
        delta=data["pair"].get("delta"),
        **drive,
        constants=data["drive"].get("constants", {}),
        until_h=data["until"].get("h"),
        until_t=data["until"].get("t"),
        **{key: output[key] for key in output},
        **{key: accuracy[key] for key in accuracy},
    )


def _file_or_value(name: str, value: Any, folder: Path) -> Any:
    """What a scene file says of a drive, with the table that it names in its place."""
    if name == "spring" and isinstance(value, Mapping) and "base" in value:
        return {**value, "base": _file_or_value("base", value["base"], folder)}
    if name == "spring" or not isinstance(value, Mapping):
        return value
    if set(value) != {"file"}:
        raise SceneError(f'[drive] {name}: a table is {{file = "{name}.csv"}}, with no other key')
    if not isinstance(value["file"], str):
        raise SceneError(f"[drive] {name}: file must be a path, not {value['file']!r}")
    try:
        return read_table(folder / value["file"], name, HEADINGS[name])
    except SceneError as error:
        raise SceneError(f"[drive] {name}: {error}") from None


#: Keys that are likely meant otherwise, and how.
MEANT = {
    "diameter": "radii are half of it",
    "diameters": "radii are half of them",
    "tilt_xy": "[box] tilt",
    "contacts": "a section of scenes of many particles, with [particles] or [packing]",
    "flow": "a section of scenes of many particles, with [particles] or [packing]",
    "box": "a section of scenes of many particles, with [particles] or [packing]",
    "drive": "a section of scenes of two particles; many are driven by [[push]], [[hold]], [flow] and [stress]",
}


def unknown_keys(given: Iterable[str], allowed: Sequence[str], where: str, above: Sequence[str] = ()) -> list[str]:
    """Faults of the keys of a section that it does not have; ``above`` are those of the top level."""
    faults = []
    for key in given:
        if key in allowed:
            continue
        if key in above:
            hint = "; it is a key of the scene itself: write it before the first section, or as a section of its own"
        elif key in MEANT:
            hint = f"; {MEANT[key]}"
        else:
            hint = suggestion(key, allowed)
        faults.append(f"{where}unknown key {key!r}{hint}")
    return faults


def read_table(path: str | Path, name: str = "value", also: Sequence[str] = ()) -> Table:
    """Read a table of what is given over time: two columns, by their headings, or time and then value without any.

    Parameters
    ----------
    path : str or Path
        Of the table, or of a result of two particles (.npz, .json), of which the column is taken.
    name : str
        Heading of the values.
    also : sequence of str
        Other headings that they may have, besides "value".

    Returns
    -------
    Table

    Raises
    ------
    SceneError
        Naming the column or the line at fault.
    """
    if Path(path).suffix in (".npz", ".json") and Path(path).is_file():
        return _table_of_result(Path(path), name, also)
    known = (Column("time", ("t",)), Column(name, tuple(also) if name == "value" else (*also, "value")))
    read = read_columns(path, "table", known, order=("time", name), besides=("h", "delta", *QUANTITIES))
    t = read["time"]
    if len(t) < 2:
        raise SceneError(f"table {path}: at least two rows of time and {name} are needed, and {len(t)} found")
    steps = np.diff(t)
    back = steps < 0
    back[1:] |= (steps[1:] == 0) & (steps[:-1] == 0)
    if back.any():
        row = int(np.argmax(back)) + 1
        more = " (twice is a jump, more is nothing)" if steps[row - 1] == 0 else ""
        raise SceneError(f"{read.at(row)}: time {t[row]:.17g} does not come after {t[row - 1]:.17g}{more}")
    return Table(t, read[name])


def _table_of_result(path: Path, name: str, also: Sequence[str]) -> Table:
    """What a saved result of two particles says of a quantity over time."""
    from softdyn.results import PairResult, load_result

    result = load_result(path)
    if not isinstance(result, PairResult):
        raise SceneError(f"{path} holds a run of many particles; a table of time and {name} is needed")
    held = [quantity for quantity in also if quantity in result.arrays]
    if not held:
        wanted = [quantity for quantity in also if quantity in QUANTITIES]
        quantity = f" ({wanted[0]})" if wanted else ""
        raise SceneError(f"the result {path} holds no {name}{quantity}; it holds {', '.join(result.arrays)}")
    return table_of(name, result.t, result.arrays[held[0]])


@dataclass(frozen=True)
class Drive:
    """What drives the pair, in the form that a kernel takes.

    Attributes
    ----------
    shape : "constant", "table" or the shape of an expression
    constants : array
        The value itself, or the constants of the expression.
    table : Table or None
    start : float
        The time at which the run starts: 0, or the first of the table.
    control : "force", "position", "velocity" or "spring"
        What is given.
    stiffness : float
        Of the spring.
    """

    shape: str | tuple
    constants: NDArray[np.float64]
    table: Table | None = None
    start: float = 0.0
    control: str = "force"
    stiffness: float = math.inf

    @property
    def arguments(self) -> tuple[Any, ...]:
        """What a kernel's functions take for the drive."""
        if self.table is not None:
            return (self.table.t, self.table.F, len(self.table.t))
        return (self.constants,)

    @property
    def deflection(self) -> str:
        """The signs that the deflection can take, as far as the drive tells."""
        if self.control != "force":
            return "either"
        forces = self.table.F if self.table is not None else self.constants if self.shape == "constant" else np.zeros(1)
        return "compression" if np.all(forces > 0) else "tension" if np.all(forces < 0) else "either"


def drive_of(scene: Scene) -> Drive:
    """Drive of a scene.

    Raises
    ------
    SceneError
        If not exactly one drive is given, or it is neither a finite number, nor an expression, nor a table.
    """
    given = [name for name in DRIVES if getattr(scene, name) is not None]
    if len(given) != 1:
        raise SceneError(f"[drive] takes one of {', '.join(DRIVES)}, and has {' and '.join(given) or 'none'}")
    (control,) = given
    if control != "spring":
        return _checked(replace(_drive_from(control, getattr(scene, control), scene.constants), control=control))
    spring = scene.spring
    if not isinstance(spring, Mapping) or set(spring) != {"stiffness", "base"}:
        raise SceneError("[drive] spring is {stiffness = NUMBER, base = NUMBER, EXPRESSION or TABLE}")
    stiffness = _positive("[drive] spring: stiffness", spring["stiffness"])
    drive = _drive_from("spring: base", spring["base"], scene.constants)
    return _checked(replace(drive, control=control, stiffness=stiffness))


def _checked(drive: Drive) -> Drive:
    """Refuse jumps of a position, and a table that ends, or begins, with one."""
    if drive.table is None:
        return drive
    at = np.flatnonzero(np.diff(drive.table.t) == 0)
    if len(at) and drive.control in ("position", "spring"):
        raise SceneError(
            f"[drive] {drive.control}: a jump, at t = {drive.table.t[at[0]]:g}, takes an infinite velocity"
        )
    if len(at) and (at[0] == 0 or at[-1] == len(drive.table.t) - 2):
        raise SceneError(f"[drive] {drive.control}: a table neither starts nor ends with a jump")
    return drive


def _drive_from(name: str, value: Any, named: Mapping[str, float]) -> Drive:
    if isinstance(value, str):
        constants = named_numbers("[drive] constants", named)
        taken = [constant for constant in constants if constant in ("t", "pi", *FUNCTIONS)]
        if taken:
            raise SceneError(f"[drive] constants: {', '.join(taken)} has a meaning of its own in an expression")
        try:
            expression: Expression = parse(value, constants)
        except SceneError as error:
            raise SceneError(f"[drive] {name}: {error}") from None
        unused = [constant for constant in constants if not re.search(rf"\b{re.escape(constant)}\b", value)]
        if unused:
            raise SceneError(f"[drive] constants: {', '.join(unused)} does not appear in the {name} {value!r}")
        if expression.of_time:
            return Drive(expression.shape, np.array(expression.constants or (0.0,)))
        number = evaluate_expression(expression, 0.0)
        if not math.isfinite(number):
            raise SceneError(f"[drive] {name} = {value!r} has no finite value")
        return Drive("constant", np.array([number]))
    if named:
        raise SceneError(f"[drive] constants belong to a {name} that is an expression, and this one is not")
    if isinstance(value, Table):
        value = (value.t, value.F)
    if isinstance(value, (tuple, list)) and len(value) == 2:
        table = table_of(name, *value)
        return Drive("table", np.zeros(1), table, float(table.t[0]))
    return Drive("constant", np.array([_finite(name, value)]))


def table_of(name: str, t: Any, F: Any) -> Table:
    """Table from a pair of arrays.

    Raises
    ------
    SceneError
        If they are not of one length, times do not rise, or a number is not finite.
    """
    try:
        table = Table(np.array(t, dtype=float), np.array(F, dtype=float))
    except (TypeError, ValueError, OverflowError):
        raise SceneError(f"{name}: a table is a pair of arrays of numbers, (t, values)") from None
    if table.t.ndim != 1 or table.t.shape != table.F.shape or len(table.t) < 2:
        found = " and ".join(str(len(values)) if values.ndim == 1 else f"{values}" for values in (table.t, table.F))
        raise SceneError(
            f"[drive] {name}: a table is two lists of one length, 2 at least, times and values, not {found}; many runs "
            "at once take their values as a numpy array"
        )
    steps = np.diff(table.t)
    rising = (steps >= 0).all() and not (np.diff(np.flatnonzero(steps == 0)) == 1).any()
    if not (np.isfinite(table.t).all() and np.isfinite(table.F).all() and rising):
        raise SceneError(f"{name}: a table's times must increase, or come twice at a jump, and its numbers be finite")
    # a row that repeats the value before and after it says nothing; steps would have to end there
    tells = np.ones(len(table.t), dtype=bool)
    tells[1:-1] = (table.F[1:-1] != table.F[:-2]) | (table.F[1:-1] != table.F[2:])
    return Table(table.t[tells], table.F[tells])


def named_numbers(where: str, values: Any) -> dict[str, float]:
    """Finite numbers by name.

    Raises
    ------
    SceneError
    """
    if not isinstance(values, Mapping):
        raise SceneError(f"{where} must map names to numbers, not {values!r}")
    return {str(name): _finite(f"{where}: {name}", value) for name, value in values.items()}


def _finite(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise SceneError(f"{name} must be a number, not {value!r}")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise SceneError(f"{name} must be finite, not {value!r}")
    return number


def _positive(name: str, value: Any) -> float:
    number = _finite(name, value)
    if number <= 0:
        raise SceneError(f"{name} must be positive, not {value!r}")
    if number < np.finfo(float).tiny:
        raise SceneError(f"{name} = {value!r} is below the smallest normal double; choose other units")
    return number


def check_scene(scene: Scene) -> None:
    """Refuse what is wrong with a scene whatever its law, all faults at once.

    Raises
    ------
    SceneError
    """
    faults = []

    def attempt(check: Any, *arguments: Any) -> Any:
        try:
            return check(*arguments)
        except SceneError as error:
            faults.append(str(error))
            return None

    h = attempt(_positive, "[pair] h", scene.h)
    if scene.X is not None:
        attempt(_finite, "[pair] X", scene.X)
    if scene.delta is not None:
        attempt(_finite, "[pair] delta", scene.delta)
        if scene.force is not None:
            faults.append("[pair] delta follows from the force; leave it out")
    until_h = attempt(_positive, "[until] h", scene.until_h) if scene.until_h is not None else None
    if scene.until_t is not None:
        attempt(_finite, "[until] t", scene.until_t)
    if scene.until_h is None and scene.until_t is None:
        faults.append("[until] needs h, t, or both: when does the run end?")
    if scene.times is not None and scene.gaps is not None:
        faults.append("[output] takes times or gaps, not both")
    attempt(_outputs, "times", scene.times, _finite)
    gaps = attempt(_outputs, "gaps", scene.gaps, _positive)
    if isinstance(gaps, int) and scene.until_h is None:
        faults.append("[output] gaps = a count needs [until] h, to know where they end")
    if h is not None and until_h == h:
        faults.append(f"[until] h is the initial gap, {h}: there is nothing to run")
    faults += _quantity_faults(scene.quantities)
    rtol = attempt(_positive, "[accuracy] rtol", scene.rtol)
    if rtol is not None and not SMALLEST_RTOL <= rtol < 1:
        faults.append(
            f"[accuracy] rtol must lie between {SMALLEST_RTOL:g}, where rounding sets in, and 1, not {rtol:g}"
        )
    if scene.method not in METHODS:
        faults.append(f"[accuracy] unknown method {scene.method!r}{suggestion(scene.method, METHODS)}")
    if scene.target not in CHOICES:
        faults.append(f"unknown target {scene.target!r}{suggestion(scene.target, CHOICES)}")
    attempt(named_numbers, "[parameters]", scene.parameters)
    if faults:
        raise SceneError(listed(faults))


def _quantity_faults(quantities: Any) -> list[str]:
    names = isinstance(quantities, Iterable) and not isinstance(quantities, str)
    if not names or not all(isinstance(name, str) for name in quantities):
        return [f"[output] quantities must be a list of names, not {quantities!r}"]
    unknown = [name for name in quantities if name not in QUANTITIES]
    return [f"[output] unknown quantity {name!r}{suggestion(name, QUANTITIES)}" for name in unknown]


def _outputs(name: str, value: Any, check: Any) -> Any:
    if value is None:
        return None
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool):
        if not 2 <= value <= LARGEST_COUNT:
            raise SceneError(f"[output] {name} must be 2 to {LARGEST_COUNT}, or a list, not {value}")
        return int(value)
    if isinstance(value, (str, Mapping)) or not isinstance(value, Iterable):
        raise SceneError(f"[output] {name} must be a count or a list of numbers, not {value!r}")
    values = [check(f"[output] {name}", one) for one in value]
    if not values:
        raise SceneError(f"[output] {name} is an empty list")
    if name == "times" and any(late <= early for early, late in itertools.pairwise(values)):
        raise SceneError("[output] times must increase")
    return values


def range_fault(name: str, value: float, allowed: Range) -> str | None:
    """What is wrong with a parameter's value, if it is outside of its range."""
    low, high, above, below = allowed
    if (low < value if above else low <= value) and (value < high if below else value <= high):
        return None
    signs = ["<" if is_open else "<=" for is_open in (above, below)]
    return f"[parameters] {name} = {value:g} lies outside of its range, {low:g} {signs[0]} {name} {signs[1]} {high:g}"


def parameter_values(
    scene: Scene, names: Sequence[str], positive: Sequence[str], ranges: Mapping[str, Range]
) -> NDArray:
    """Values of a law's parameters, in its order.

    Raises
    ------
    SceneError
        Listing missing, unknown, non-positive and out-of-range parameters.
    """
    given = named_numbers("[parameters]", scene.parameters)
    faults = [
        f"[parameters] {name!r} is not a parameter of the law{suggestion(name, names)}"
        for name in given
        if name not in names
    ]
    for name in names:
        if name not in given:
            faults.append(f"[parameters] {name} is missing; the law needs {', '.join(names)}")
        elif name in ranges and (fault := range_fault(name, given[name], ranges[name])):
            faults.append(fault)
        elif name in positive:
            try:
                _positive(f"[parameters] {name}", given[name])
            except SceneError as error:
                faults.append(str(error))
    if faults:
        raise SceneError(listed(faults))
    return np.array([given[name] for name in names])
