"""Scenes: what to simulate, from a TOML file or from keyword arguments, checked before anything runs."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.scene.numbers import (
    LARGEST_COUNT,
    SMALLEST_RTOL,
    Range,
    finite_number,
    named_numbers,
    positive_number,
    range_fault,
)
from softdyn.scene.pair_drive import DRIVES, HEADINGS
from softdyn.scene.pair_quantities import QUANTITIES
from softdyn.scene.reading import is_particle_scene, read_toml, unknown_keys
from softdyn.scene.time_tables import read_table
from softdyn.targets import CHOICES
from softdyn.words import listed, suggestion

DEFAULT_QUANTITIES = ("X", "a", "F")
METHODS = ("auto", "integrate", "quadrature")

KEYS: dict[str, tuple[str, ...]] = {
    "pair": ("h", "X", "delta"),
    "drive": ("force", "position", "velocity", "spring", "constants"),
    "until": ("h", "t"),
    "output": ("times", "gaps", "quantities"),
    "accuracy": ("rtol", "method"),
}
TOP_LEVEL = ("law", "target", "parameters", *KEYS)


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
        What to output besides t, h and delta: of :data:`~softdyn.scene.pair_quantities.QUANTITIES`.
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

    h = attempt(positive_number, "[pair] h", scene.h)
    if scene.X is not None:
        attempt(finite_number, "[pair] X", scene.X)
    if scene.delta is not None:
        attempt(finite_number, "[pair] delta", scene.delta)
        if scene.force is not None:
            faults.append("[pair] delta follows from the force; leave it out")
    until_h = attempt(positive_number, "[until] h", scene.until_h) if scene.until_h is not None else None
    if scene.until_t is not None:
        attempt(finite_number, "[until] t", scene.until_t)
    if scene.until_h is None and scene.until_t is None:
        faults.append("[until] needs h, t, or both: when does the run end?")
    if scene.times is not None and scene.gaps is not None:
        faults.append("[output] takes times or gaps, not both")
    attempt(_outputs, "times", scene.times, finite_number)
    gaps = attempt(_outputs, "gaps", scene.gaps, positive_number)
    if isinstance(gaps, int) and scene.until_h is None:
        faults.append("[output] gaps = a count needs [until] h, to know where they end")
    if h is not None and until_h == h:
        faults.append(f"[until] h is the initial gap, {h}: there is nothing to run")
    faults += _quantity_faults(scene.quantities)
    rtol = attempt(positive_number, "[accuracy] rtol", scene.rtol)
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
                positive_number(f"[parameters] {name}", given[name])
            except SceneError as error:
                faults.append(str(error))
    if faults:
        raise SceneError(listed(faults))
    return np.array([given[name] for name in names])
