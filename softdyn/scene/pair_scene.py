"""Scenes: what to simulate, from a TOML file or from keyword arguments, checked before anything runs."""

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.scene.keys import UNITS, Key, Section, key_faults, with_keys
from softdyn.scene.kinds import (
    DRIVEN,
    LAW,
    NUMBER,
    NUMBERS_BY_NAME,
    POSITIVE,
    Kind,
    between,
    choice,
    count_or_list,
)
from softdyn.scene.numbers import (
    LARGEST_COUNT,
    SMALLEST_RTOL,
    Range,
    finite_number,
    named_numbers,
    positive_number,
    range_fault,
)
from softdyn.scene.pair_drive import DRIVES
from softdyn.scene.pair_quantities import QUANTITIES
from softdyn.scene.reading import fields_from, is_fluid_scene, is_particle_scene, scene_of_file
from softdyn.scene.time_tables import OverTime
from softdyn.targets import CHOICES
from softdyn.words import listed, suggestion

DEFAULT_QUANTITIES = ("X", "a", "F")
METHODS = ("auto", "integrate", "quadrature")

#: A number; or an array, of shape (runs,), that makes so many runs.
Number = float | NDArray[Any]
QUANTITY_NAMES = Kind("a list of names", {"type": "array", "items": {"enum": list(QUANTITIES)}})


class Spring(TypedDict):
    """A spring whose force is stiffness (X - base), as from a cantilever whose base moves."""

    stiffness: Annotated[float, Key("[drive] spring: stiffness", POSITIVE, "Stiffness of the spring.", "force/length")]
    base: Annotated[
        OverTime,
        Key(
            "[drive] spring: base",
            DRIVEN,
            "Place of the base of the spring; no jumps.",
            "length",
            ("x", "X", "position"),
        ),
    ]


@with_keys
@dataclass(frozen=True)
class Scene:
    """Two particles, pushed or moved; all numbers in one consistent set of units.

    One of ``force``, ``position``, ``velocity`` and ``spring`` says by what: each a number, an expression of t, a
    table, or a pair of arrays (t, values).
    """

    law: Annotated[Any, Key("law", LAW, "The contact law.")]
    parameters: Annotated[
        Mapping[str, Number], Key("[parameters]", NUMBERS_BY_NAME, "A value for each parameter of the law.")
    ]
    h: Annotated[Number, Key("[pair] h", POSITIVE, "Initial gap.", "length")]
    force: Annotated[
        OverTime | NDArray[Any] | None,
        Key(
            "[drive] force",
            DRIVEN,
            "External force, > 0 pushes the particles together.",
            "force",
            ("F", "F_ext"),
        ),
    ] = None
    position: Annotated[
        OverTime | None,
        Key(
            "[drive] position",
            DRIVEN,
            "Distance of the centres, X. A jump of it would take an infinite velocity, and is refused.",
            "length",
            ("x", "X", "distance"),
        ),
    ] = None
    velocity: Annotated[
        OverTime | NDArray[Any] | None,
        Key(
            "[drive] velocity", DRIVEN, "dX/dt, < 0 brings the particles together.", "length/time", ("v", "V", "dX_dt")
        ),
    ] = None
    spring: Annotated[
        Spring | None,
        Section(
            "[drive] spring",
            "softdyn.scene.pair_scene:Spring",
            "A spring that drives the pair, stiffness and base: the force is stiffness (X - base), as from a "
            "cantilever whose base moves; no jumps.",
        ),
    ] = None
    constants: Annotated[
        Mapping[str, Number], Key("[constants]", NUMBERS_BY_NAME, "Named constants of the expressions.")
    ] = field(default_factory=dict)
    X: Annotated[
        float | None,
        Key(
            "[pair] X",
            NUMBER,
            "Initial distance of the centres, which must agree with h and with what else is given.",
            "length",
        ),
    ] = None
    delta: Annotated[
        Number | None,
        Key(
            "[pair] delta",
            NUMBER,
            "Initial deflection where the force is not given. It is better conditioned than X; with a velocity alone, "
            "it is 0 if neither is given.",
            "length",
        ),
    ] = None
    until_h: Annotated[
        float | None, Key("[until] h", POSITIVE, "The run ends when the gap passes this, if not before.", "length")
    ] = None
    until_t: Annotated[float | None, Key("[until] t", NUMBER, "The run ends at this time, if not before.", "time")] = (
        None
    )
    times: Annotated[
        int | Sequence[float] | NDArray[np.float64] | None,
        Key(
            "[output] times",
            count_or_list(LARGEST_COUNT),
            "Output times: how many, evenly spaced over the run, or which. Without times and gaps there is one output "
            "at every step taken, and at the nodes of panels of the gap.",
            "time",
        ),
    ] = None
    gaps: Annotated[
        int | Sequence[float] | NDArray[np.float64] | None,
        Key(
            "[output] gaps",
            count_or_list(LARGEST_COUNT),
            "Output gaps, in the place of times: how many, evenly spaced in ln h between h and until_h, or which, in "
            "the order of passage.",
            "length",
        ),
    ] = None
    quantities: Annotated[
        Sequence[str],
        Key(
            "[output] quantities",
            QUANTITY_NAMES,
            f"What to output besides t, h and delta: of {', '.join(QUANTITIES)}. F is the external force.",
        ),
    ] = DEFAULT_QUANTITIES
    rtol: Annotated[
        float,
        Key(
            "[accuracy] rtol",
            between(SMALLEST_RTOL, 1.0, ", where rounding sets in,", below=True),
            "Relative error allowed in h at each step; ten times that at any output.",
        ),
    ] = 1e-9
    method: Annotated[
        str,
        Key(
            "[accuracy] method",
            choice("method", METHODS),
            'Which way the pair is integrated. "auto" takes ln h as the independent variable under a constant force, '
            "as long as the gap moves by more than a tenth of its distance to where it would rest; else, and with "
            '"integrate" always, it is the time. "quadrature", for a constant force and outputs at gaps alone, is '
            "Gauss's, to rounding: what the others "
            "are measured against.",
        ),
    ] = "auto"
    target: Annotated[
        str, Key("target", choice("target", CHOICES), "What runs the kernel: C, numba, or C where there is a compiler.")
    ] = "auto"
    units: Annotated[str | None, UNITS] = field(default=None, compare=False)


def read_scene(path: str | Path) -> Scene:
    """Read a scene file.

    Raises
    ------
    SceneError
        If the file cannot be read, is not TOML (with the line), or holds an unknown or missing key.
    """
    return scene_of_file(path, scene_from)


def scene_from(data: Mapping[str, Any], folder: Path) -> Scene:
    """Scene from the content of a scene file; paths in it are relative to ``folder``."""
    if is_fluid_scene(data):
        raise SceneError("it is a scene of a fluid, for softdyn run; here one of two particles is needed, with [pair]")
    if is_particle_scene(data):
        raise SceneError("it is a scene of many particles, for softdyn run; here one of two is needed, with [pair]")
    drive = data.get("drive")
    undriven = isinstance(drive, Mapping) and not set(DRIVES) & set(drive)
    lacking = ["[drive] force is missing (or position, velocity, spring)"] if undriven else []
    return Scene(**fields_from(Scene, data, folder, needed=("drive", "until"), besides=lacking))


def check_scene(scene: Scene) -> None:
    """Refuse what is wrong with a scene whatever its law, all faults at once.

    Raises
    ------
    SceneError
    """
    faults = key_faults(scene)
    if scene.delta is not None and scene.force is not None:
        faults.append("[pair] delta follows from the force; leave it out")
    if scene.until_h is None and scene.until_t is None:
        faults.append("[until] needs h, t, or both: when does the run end?")
    if scene.times is not None and scene.gaps is not None:
        faults.append("[output] takes times or gaps, not both")
    for name, values, check in (("times", scene.times, finite_number), ("gaps", scene.gaps, positive_number)):
        try:
            _require_listed(name, values, check)
        except SceneError as error:
            faults.append(str(error))
    if isinstance(scene.gaps, (int, np.integer)) and scene.until_h is None:
        faults.append("[output] gaps = a count needs [until] h, to know where they end")
    if not faults and scene.until_h == scene.h:
        faults.append(f"[until] h is the initial gap, {scene.h}: there is nothing to run")
    faults += _quantity_faults(scene.quantities)
    try:
        named_numbers("[parameters]", scene.parameters)
    except SceneError as error:
        faults.append(str(error))
    if faults:
        raise SceneError(listed(faults))


def _quantity_faults(quantities: Any) -> list[str]:
    names = isinstance(quantities, Iterable) and not isinstance(quantities, str)
    if not names or not all(isinstance(name, str) for name in quantities):
        return [f"[output] quantities must be a list of names, not {quantities!r}"]
    unknown = [name for name in quantities if name not in QUANTITIES]
    return [f"[output] unknown quantity {name!r}{suggestion(name, QUANTITIES)}" for name in unknown]


def _require_listed(name: str, values: Any, check: Callable[[str, Any], float]) -> None:
    """Refuse what is wrong with a list of outputs; a count is none."""
    if values is None or not isinstance(values, Iterable) or isinstance(values, (str, Mapping)):
        return
    numbers = [check(f"[output] {name}", one) for one in values]
    if not numbers:
        raise SceneError(f"[output] {name} is an empty list")
    if name == "times" and any(late <= early for early, late in itertools.pairwise(numbers)):
        raise SceneError("[output] times must increase")


def parameter_values(
    scene: Scene, names: Sequence[str], positive: Sequence[str], ranges: Mapping[str, Range]
) -> NDArray[Any]:
    """Values of a law's parameters, in its order.

    Parameters
    ----------
    scene : Scene
    names : sequence of str
        The law's parameters, in its order.
    positive : sequence of str
        Those that must be.
    ranges : mapping from str to Range
        Of those that have one.

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
