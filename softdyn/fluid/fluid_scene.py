"""Scenes of a fluid: their keys, what must hold of these together, and scene files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from softdyn.errors import SceneError
from softdyn.fluid.time_steps import METHODS
from softdyn.scene.keys import UNITS, Key, Section, key_faults, with_keys
from softdyn.scene.kinds import (
    COORDINATES,
    FIELD,
    FIELD_LIST,
    FLAG,
    LAW,
    NOT_NEGATIVE,
    NUMBERS_BY_NAME,
    POSITIVE,
    Kind,
    between,
    choice,
    count_or_list,
    shown,
)
from softdyn.scene.reading import fields_from, scene_of_file
from softdyn.targets import CHOICES
from softdyn.words import listed

if TYPE_CHECKING:
    from softdyn.fluid.bed import Bed
    from softdyn.fluid.boundary_keys import Boundary
    from softdyn.fluid.mesh_section import MeshSection

#: Elements, by the orders of the velocity.
ORDERS = {"P2-P1": 2, "P1-P1": 1}
#: What a time, a density or a viscosity may be: beyond, squares and products leave the range of doubles.
SIZES = (1e-100, 1e100)

CLOSURE = Kind('a stock closure, "path/closure.py", in Python a closure, too', LAW.schema, path=LAW.path)
TERMS = Kind(
    'a list of "path/terms.py:name", in Python of terms, too',
    {"type": "array", "items": {"type": "string"}},
    lambda value: None if isinstance(value, (list, tuple)) else f" must be a list, not {shown(value)}",
)
FIELDS_BY_NAME = Kind(
    "numbers, or expressions of x, y, z and t, by name",
    {"type": "object", "additionalProperties": {"anyOf": [FIELD.schema, FIELD_LIST.schema]}},
    NUMBERS_BY_NAME.fault,
)


@with_keys
@dataclass(frozen=True)
class FluidScene:
    """A fluid, by itself or among grains that are given; all numbers in one consistent set of units."""

    viscosity: Annotated[float, Key("[fluid] viscosity", POSITIVE, "Viscosity of the fluid.", "force time/length^2")]
    mesh: Annotated[
        "MeshSection",
        Section("[mesh]", "softdyn.fluid.mesh_section:MeshSection", "The mesh: built in, or a file."),
    ]
    density: Annotated[
        float,
        Key(
            "[fluid] density",
            NOT_NEGATIVE,
            "Density of the fluid; without, there is no inertia: Stokes flow, in which every time stands alone.",
            "force time^2/length^4",
        ),
    ] = 0.0
    elements: Annotated[
        str,
        Key(
            "[fluid] elements",
            choice("elements", tuple(ORDERS)),
            "Order of the velocity and of the pressure on an element: Taylor and Hood's, or linear ones, stabilised.",
        ),
    ] = "P2-P1"
    mixture: Annotated[
        Any,
        Key(
            "[fluid] mixture",
            CLOSURE,
            "Viscosity of fluid and grains together, a closure that gives it; without, it is that of the fluid.",
        ),
    ] = None
    force: Annotated[
        Sequence[float | str] | None,
        Key(
            "[fluid] force",
            FIELD_LIST,
            "Force per volume of fluid besides its weight, one component for each axis.",
            "force/length^3",
        ),
    ] = None
    terms: Annotated[
        Sequence[Any],
        Key("[fluid] terms", TERMS, "Further forces on the fluid, each a Term that a file declares as it would a law."),
    ] = ()
    parameters: Annotated[
        Mapping[str, Any],
        Key("[parameters]", FIELDS_BY_NAME, "A value for each parameter of the closures, and for all that terms need."),
    ] = field(default_factory=dict)
    gravity: Annotated[
        Sequence[float] | None,
        Key("[gravity] acceleration", COORDINATES, "Acceleration, one number for each axis.", "length/time^2"),
    ] = None
    boundary: Annotated[
        "Sequence[Boundary]",
        Section("[[boundary]]", "softdyn.fluid.boundary_keys:Boundary", "What holds at each part of the boundary."),
    ] = ()
    bed: Annotated[
        "Bed | None",
        Section("[bed]", "softdyn.fluid.bed:Bed", "Grains in the fluid that are not resolved."),
    ] = None
    start: Annotated[
        Sequence[float | str] | None,
        Key(
            "[start] velocity",
            FIELD_LIST,
            "Velocity of the fluid at the start, one component for each axis; at rest without. The run starts from the "
            "nearest one that boundaries and volume allow.",
            "length/time",
        ),
    ] = None
    constants: Annotated[
        Mapping[str, float], Key("[constants]", NUMBERS_BY_NAME, "Named constants of the expressions.")
    ] = field(default_factory=dict)
    until_t: Annotated[float | None, Key("[until] t", POSITIVE, "The run ends at this time.", "time")] = None
    steady: Annotated[
        bool, Key("[until] steady", FLAG, "Whether the steady flow is looked for, instead of a run in time.")
    ] = False
    times: Annotated[
        int | Sequence[float] | Any,
        Key(
            "[output] times",
            count_or_list(1_000_000),
            "Output times: how many, evenly spaced from 0 to the end, or which. Forces are told of each step anyway.",
            "time",
        ),
    ] = 11
    method: Annotated[
        str, Key("[steps] method", choice("method", tuple(METHODS)), "BDF2 of order 2, or implicit Euler of order 1.")
    ] = "BDF2"
    dt: Annotated[
        float | None,
        Key(
            "[steps] dt",
            POSITIVE,
            "Length of all steps, but for what output times need; without, it follows from the error.",
            "time",
        ),
    ] = None
    rtol: Annotated[
        float,
        Key(
            "[accuracy] rtol",
            between(1e-10, 0.1),
            "Error of the velocities allowed in one step, over the largest velocity.",
        ),
    ] = 1e-4
    target: Annotated[
        str, Key("target", choice("target", CHOICES), "What runs the kernel: C, numba, or C where there is a compiler.")
    ] = "auto"
    units: Annotated[str | None, UNITS] = field(default=None, compare=False)


def check_fluid(scene: FluidScene) -> None:
    """Refuse what is wrong with a scene whatever its mesh; as many faults at once as can be told.

    Raises
    ------
    SceneError
    """
    faults = key_faults(scene)
    if faults:
        raise SceneError(listed(faults))
    sizes = {"[fluid] viscosity": scene.viscosity, "[fluid] density": scene.density, "[until] t": scene.until_t}
    sizes["[steps] dt"] = scene.dt
    for name, value in sizes.items():
        if value and not SIZES[0] < value < SIZES[1]:
            faults.append(f"{name} = {value:g}: choose units in which it lies between {SIZES[0]:g} and {SIZES[1]:g}")
    if scene.steady == (scene.until_t is not None):
        faults.append(
            "[until] has both t and steady: give one of them"
            if scene.steady
            else "[until] needs t, or steady = true: when does the run end?"
        )
    if scene.steady and scene.start is not None:
        faults.append("[start] is of no use where the steady flow is looked for: leave it out")
    if not scene.density and scene.start is not None:
        faults.append("[start] is of no use without [fluid] density: a flow without inertia remembers nothing")
    if not scene.density and scene.gravity is not None:
        faults.append("[gravity] is of no use without [fluid] density: leave it out, or give one")
    if scene.dt is not None and scene.until_t is not None and scene.dt > scene.until_t:
        faults.append(f"[steps] dt = {scene.dt:g} is longer than the run, {scene.until_t:g}")
    if faults:
        raise SceneError(listed(faults))


def read_fluid_scene(path: str | Path) -> FluidScene:
    """Read a scene file of a fluid.

    Raises
    ------
    SceneError
        If the file cannot be read, is not TOML (with the line), or holds an unknown or missing key.

    Examples
    --------
    >>> from pathlib import Path
    >>> from softdyn.fluid import read_scene
    >>> text = '''
    ... fluid = {viscosity = 1.0, density = 1.0}
    ... mesh = {box = [2.0, 1.0], cells = [8, 4]}
    ... [[boundary]]
    ... on = ["bottom", "top"]
    ... velocity = [0, 0]
    ... [[boundary]]
    ... on = ["left"]
    ... velocity = ["4*y*(1 - y)", 0]
    ... [[boundary]]
    ... on = ["right"]
    ... pressure = 0
    ... [until]
    ... steady = true
    ... '''
    >>> _ = Path("channel.toml").write_text(text, encoding="utf-8")
    >>> read_scene("channel.toml").viscosity
    1.0
    """
    return scene_of_file(path, fluid_scene_from)


def fluid_scene_from(data: Mapping[str, Any], folder: Path) -> FluidScene:
    """Scene from the content of a scene file; paths in it are relative to ``folder``.

    Raises
    ------
    SceneError
        Listing unknown and missing keys.
    """
    return FluidScene(**fluid_fields_from(FluidScene, data, folder))


def fluid_fields_from(cls: type[FluidScene], data: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Fields of a scene of a fluid, or of one that has more.

    Parameters
    ----------
    cls : type
        Of the scene.
    data : mapping
        As read from TOML.
    folder : Path
        From which paths in it start.

    Raises
    ------
    SceneError
        Listing unknown and missing keys.
    """
    fields = fields_from(cls, data, folder, needed=("until", "boundary"))
    if isinstance(fields.get("terms"), list):
        fields["terms"] = [str(folder / one) if isinstance(one, str) else one for one in fields["terms"]]
    return fields
