"""The keys of a scene of many particles; see :mod:`softdyn.scene.keys`."""

from collections.abc import Mapping, Sequence
from dataclasses import InitVar, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypedDict

from softdyn.errors import SceneError
from softdyn.particles.geometry import Wall
from softdyn.particles.method_names import METHODS
from softdyn.particles.names import ALL
from softdyn.scene.keys import UNITS, Key, Section, with_keys
from softdyn.scene.kinds import (
    COORDINATES,
    DRIVEN,
    DRIVEN_LIST,
    FLAG,
    LAW,
    LENGTHS,
    NAMES,
    NAMES_BY_NAME,
    NOT_NEGATIVE,
    NOT_ZERO,
    NUMBER,
    NUMBERS_BY_NAME,
    NUMBERS_BY_SPECIES,
    PATH,
    POSITIVE,
    Kind,
    between,
    choice,
    count_or_list,
)
from softdyn.scene.numbers import SMALLEST_RTOL
from softdyn.scene.time_tables import OverTime
from softdyn.targets import CHOICES

if TYPE_CHECKING:
    from softdyn.particles.chains import Chains
    from softdyn.particles.mechanisms.bonds import Bond
    from softdyn.particles.mechanisms.coulomb import Friction
    from softdyn.particles.mechanisms.gravity import Gravity
    from softdyn.particles.mechanisms.inertia import Inertia
    from softdyn.particles.mechanisms.noise import Noise
    from softdyn.particles.mechanisms.potentials import PairPotential
    from softdyn.particles.packing import Packing

#: What a scene without particles, or with too many, is told.
PLACES = (
    "[particles] and [packing] are two ways to say where the particles are, [chains] is a third: give one of them, "
    "[particles] with positions and radii, or with a file"
)

_LIST_OF_LISTS = {"type": "array", "items": COORDINATES.schema, "minItems": 1}
POSITIONS = Kind("a list of lists of numbers, or an array of shape (N, d)", _LIST_OF_LISTS)
RADII = Kind("a number, or a list of numbers", {"anyOf": [{"type": "number"}, COORDINATES.schema]})
PARTICLES = Kind(
    f'a list of their numbers, the name of a species, or "{ALL}"',
    {"anyOf": [{"type": "array", "items": {"type": "integer", "minimum": 0}}, {"type": "string"}]},
)
AXES_NAMED = Kind('some of "xyz"', {"type": "string", "pattern": "^[xyz]{1,3}$"})


@with_keys
@dataclass(frozen=True)
class Push:
    """An external force or torque, or both, on each of some particles."""

    particles: Annotated[Sequence[int] | str, Key("[[push]] particles", PARTICLES, "Which particles are pushed.")]
    force: Annotated[
        Sequence[OverTime] | None,
        Key(
            "[[push]] force",
            DRIVEN_LIST,
            "Force on each of them, one number for each axis.",
            "force",
            ("F",),
            of_axes=True,
        ),
    ] = None
    torque: Annotated[
        Sequence[OverTime] | None,
        Key(
            "[[push]] torque",
            DRIVEN_LIST,
            "Torque on each about its centre, where there is tangential motion: one in two dimensions, > 0 from x to "
            "y; three in three.",
            "force length",
            ("T", "moment"),
            of_axes=True,
        ),
    ] = None


@with_keys
@dataclass(frozen=True)
class Hold:
    """Coordinates that do not follow from forces: held at rest, or driven."""

    particles: Annotated[Sequence[int] | str, Key("[[hold]] particles", PARTICLES, "Which particles are held.")]
    axes: Annotated[str, Key("[[hold]] axes", AXES_NAMED, "Along which axes they are held.")]
    velocity: Annotated[
        Sequence[OverTime] | None,
        Key(
            "[[hold]] velocity",
            DRIVEN_LIST,
            "Velocity along each of the axes; at rest without.",
            "length/time",
            ("v", "V"),
            of_axes=True,
        ),
    ] = None
    spin: Annotated[
        Sequence[OverTime] | None,
        Key(
            "[[hold]] spin",
            DRIVEN_LIST,
            "Angular velocity, where there is tangential motion: one number in two dimensions, three in three. Without "
            "it the particles turn as torques make them.",
            "1/time",
            ("omega", "angular_velocity"),
            of_axes=True,
        ),
    ] = None


def _component(name: str, text: str, headings: tuple[str, ...] = (), of_axes: bool = False) -> Key:
    also = headings or ("stress", "sigma", f"stress_{name}", f"sigma_{name}")
    return Key(f"[stress] {name}", DRIVEN, text, "force/length^2", also, of_axes)


class Stress(TypedDict, total=False):
    """Stress imposed on a box that is periodic along all axes, that of the contacts and of the fluid, 2 eta D."""

    xy: Annotated[OverTime, _component("xy", "Shear stress, instead of a shear rate.")]
    xx: Annotated[OverTime, _component("xx", "Stress along x, > 0 in tension.")]
    yy: Annotated[OverTime, _component("yy", "Stress along y, > 0 in tension.")]
    zz: Annotated[OverTime, _component("zz", "Stress along z, > 0 in tension.")]
    pressure: Annotated[
        OverTime,
        _component(
            "pressure",
            "Minus a third (in two dimensions, half) of the sum of the stresses along the axes, at which the box keeps "
            "its shape.",
            ("p", "P"),
            of_axes=True,
        ),
    ]


BOND = Section(
    "[[bond]]", "softdyn.particles.mechanisms.bonds:Bond", "Bonds between pairs of particles, by a potential."
)
POTENTIAL_ENTRY = Section(
    "[[potential]]",
    "softdyn.particles.mechanisms.potentials:PairPotential",
    "Remote forces between pairs of particles, by a potential: see .docs/potentials.md.",
)
CHAINS = Section(
    "[chains]",
    "softdyn.particles.chains:Chains",
    "Where particles start, instead: chains or rings, whose neighbours are bonded.",
)
SPECIES = Key("[particles] species", NAMES, "One name for each particle; needed where a parameter depends on it.")
FRICTION = Section(
    "[friction]",
    "softdyn.particles.mechanisms.coulomb:Friction",
    "Coulomb friction of surfaces that touch, and what resists rolling and twisting.",
)


@with_keys
@dataclass(frozen=True)
class ParticleScene:
    """Many particles; all numbers in one consistent set of units."""

    law: Annotated[Any, Key("law", LAW, "The contact law; rigid grains have none.")] = None
    parameters: Annotated[
        Mapping[str, float | Mapping[str, float]],
        Key(
            "[parameters]",
            NUMBERS_BY_SPECIES,
            "A value for each parameter of the law but R, which follows from the radii. Where it depends on the "
            "species, a value for each of them.",
        ),
    ] = field(default_factory=dict)
    positions: Annotated[
        Any,
        Key(
            "[particles] positions",
            POSITIONS,
            "Positions of the centres, a list of 1 to 3 coordinates for each particle. Anywhere: in a periodic box a "
            "particle stands for all of its images, and the result goes on from the one that is given, without ever "
            "wrapping it. So a box may as well reach from -L/2 to L/2.",
            "length",
        ),
    ] = None
    radii: Annotated[
        Any, Key("[particles] radii", RADII, "One radius for all particles, or one for each.", "length")
    ] = None
    species: Annotated[
        Sequence[str] | None,
        SPECIES,
    ] = None
    velocities: Annotated[
        Any,
        Key(
            "[particles] velocities",
            POSITIONS,
            "Velocities at the start, of grains with inertia: one number for each axis, for each particle. At rest "
            "without; in a sheared box, with the flow.",
            "length/time",
        ),
    ] = None
    spins: Annotated[
        Any,
        Key(
            "[particles] spins",
            POSITIONS,
            "Angular velocities at the start, of grains with inertia that turn: for each particle a list of one number "
            "in two dimensions, of three in three.",
            "1/time",
        ),
    ] = None
    file: InitVar[
        Annotated[
            str | Path | None,
            Key(
                "[particles] file",
                PATH,
                "Where positions, radii and species are read from, instead: a table with the columns x, y, z, radius "
                "or diameter, species; the result of an earlier run (.npz), whose last frame is gone on from, with "
                "its box, tilt, gaps and tangential forces, time starting anew; or the last frame of a file of LAMMPS "
                "(.data, .lmp, .dump, .lammpstrj), extended XYZ (.xyz), GSD (.gsd) or VTK (.vtk, .vtu), with its box. "
                "Such a file may leave radii to the scene.",
            ),
        ]
    ] = None
    packing: InitVar[
        Annotated[
            "Packing | None",
            Section(
                "[packing]",
                "softdyn.particles.packing:Packing",
                "Where particles start, instead of positions, radii and box: a random packing, or a lattice.",
            ),
        ]
    ] = None
    chains: InitVar[
        Annotated[
            "Chains | None",
            CHAINS,
        ]
    ] = None
    mixing: Annotated[
        Mapping[str, str],
        Key(
            "[mixing]",
            NAMES_BY_NAME,
            'For each parameter that depends on the species, how a contact of two takes it: "arithmetic", "geometric" '
            'or "harmonic" mean. E is always the harmonic mean, as for two elastic half-spaces under one pressure.',
        ),
    ] = field(default_factory=dict)
    gap: Annotated[
        float | None,
        Key(
            "[contacts] gap",
            POSITIVE,
            "Initial gap of the pairs whose surfaces are closer than that, which are then pressed together; all others "
            "start undeformed.",
            "length",
        ),
    ] = None
    range: Annotated[
        float | None,
        Key(
            "[contacts] range",
            POSITIVE,
            "Range of a contact: beyond this gap there is none, and from half of it on it fades. Without it all pairs "
            "are in contact; with drag, those within 200 of the largest radius. Periodic boxes, and more than 64 "
            "particles, need it.",
            "length",
        ),
    ] = None
    tangential: Annotated[
        bool, Key("[contacts] tangential", FLAG, "Whether particles slide, roll and turn, as their law declares.")
    ] = False
    films: Annotated[
        Mapping[str, Any] | None,
        Key(
            "films",
            Kind("a mapping", {}),
            "Contacts of an earlier run, as from_result and read_particles give them: pairs i < j (walls from N on) "
            "and shift, by how many lengths of the box j is displaced (none by default); for each its gap h, with "
            "tangential motion its force T. They start so, as far as they are within the range, all others as above. "
            "wall_point and wall_normal: where the walls were; the scene's must be there, or it has none.",
            in_files=False,
        ),
    ] = None
    box: Annotated[
        Sequence[float | None] | None,
        Key(
            "[box] lengths",
            LENGTHS,
            "Edges of the periodic box; in files 0, in Python None, along an axis that is not periodic.",
            "length",
        ),
    ] = None
    tilt: Annotated[
        float,
        Key(
            "[box] tilt",
            NUMBER,
            "By how much the box leans at the start: how far its top is displaced along x, by more than its length, "
            "too. What strain tells of a result counts from an upright box.",
            "length",
        ),
    ] = 0.0
    depth: Annotated[
        float | None,
        Key(
            "[box] depth",
            POSITIVE,
            "Depth of the layer that spheres in two dimensions are, and width and depth of the column that they are in "
            "one: what makes a stress of the forces in a box that is periodic along all axes. Twice the mean radius by "
            "default; in three dimensions, and where there is no stress, it is refused.",
            "length",
        ),
    ] = None
    wall: Annotated[
        Sequence[Wall],
        Section("[[wall]]", "softdyn.particles.geometry:Wall", "Flat walls."),
    ] = ()
    shear_rate: Annotated[
        OverTime,
        Key(
            "[flow] shear_rate",
            DRIVEN,
            "Background flow u = shear_rate y along x; a periodic box is sheared with it.",
            "1/time",
            ("rate", "gamma_dot"),
            of_axes=True,
        ),
    ] = 0.0
    stress: Annotated[
        Stress,
        Section(
            "[stress]",
            "softdyn.particles.particle_keys:Stress",
            "Stress imposed on a box that is periodic along all axes, which then shears or stretches as it must.",
        ),
    ] = field(default_factory=Stress)
    stress_viscosity: Annotated[
        float | None,
        Key(
            "[stress] viscosity",
            POSITIVE,
            "Viscosity eta of the fluid in an imposed stress; the parameter eta by default.",
            "force time/length^2",
        ),
    ] = None
    drag: Annotated[
        float,
        Key(
            "[flow] drag",
            NOT_NEGATIVE,
            "Drag of each particle over 6 pi eta R: 1 for Stokes' drag, 0 for none. With it, contacts "
            "carry what of the law's friction exceeds its limit far apart: see softdyn.derive.far_field.",
        ),
    ] = 0.0
    gravity: Annotated[
        "Gravity | None",
        Section(
            "[gravity]",
            "softdyn.particles.mechanisms.gravity:Gravity",
            "The weight of the particles, less their buoyancy.",
        ),
    ] = None
    inertia: Annotated[
        "Inertia | None",
        Section(
            "[inertia]", "softdyn.particles.mechanisms.inertia:Inertia", "The mass of the particles: they have inertia."
        ),
    ] = None
    friction: Annotated["Friction | None", FRICTION] = None
    potential: Annotated[Sequence["PairPotential"], POTENTIAL_ENTRY] = ()
    bond: Annotated[Sequence["Bond"], BOND] = ()
    noise: Annotated[
        "Noise | None",
        Section("[noise]", "softdyn.particles.mechanisms.noise:Noise", "Brownian motion, without inertia."),
    ] = None
    push: Annotated[
        Sequence[Push],
        Section(
            "[[push]]", "softdyn.particles.particle_keys:Push", "External forces and torques on some of the particles."
        ),
    ] = ()
    hold: Annotated[
        Sequence[Hold],
        Section("[[hold]]", "softdyn.particles.particle_keys:Hold", "Particles that are held at rest, or driven."),
    ] = ()
    constants: Annotated[
        Mapping[str, float], Key("[constants]", NUMBERS_BY_NAME, "Named constants of the expressions.")
    ] = field(default_factory=dict)
    until_t: Annotated[
        float | None, Key("[until] t", POSITIVE, "The run ends at this time, if not before.", "time")
    ] = None
    until_strain: Annotated[
        float | None,
        Key(
            "[until] strain",
            NOT_ZERO,
            "The run ends at this shear strain, if not before: of a box under an imposed shear stress, or where the "
            "integral of the shear rate reaches it. Where it may never be reached, it needs a time, too.",
        ),
    ] = None
    times: Annotated[
        int | Sequence[float] | Any,
        Key(
            "[output] times",
            count_or_list(1_000_000),
            "Output times: how many, evenly spaced from 0 to the end, or which.",
            "time",
        ),
    ] = 11
    rtol: Annotated[
        float,
        Key(
            "[accuracy] rtol",
            between(100 * SMALLEST_RTOL, 0.1),
            "Relative error of the gaps allowed in one step.",
        ),
    ] = 1e-4
    method: Annotated[
        str | None,
        Key(
            "[method] name",
            choice("method", METHODS),
            "Method of integration; without it the one that costs least of those that can do the scene, which the "
            "result tells. Implicit: long steps of soft contacts. Explicit: short steps of grains with inertia, in "
            "dry contact. Contact dynamics: rigid grains.",
        ),
    ] = None
    step: Annotated[
        float | None,
        Key(
            "[method] step",
            POSITIVE,
            "Longest step of contact dynamics. By default a grain moves by a tenth of its radius in it, at the speed "
            "that it may fall with, or by less. Steps are of one length between two output times.",
            "time",
        ),
    ] = None
    target: Annotated[
        str, Key("target", choice("target", CHOICES), "What runs the kernel: C, numba, or C where there is a compiler.")
    ] = "auto"
    units: Annotated[str | None, UNITS] = field(default=None, compare=False)

    @property
    def turns(self) -> bool:
        """Whether particles have rotations: with tangential motion, or with friction."""
        return bool(self.tangential) or self.friction is not None

    def __post_init__(self, file: str | Path | None, packing: "Packing | None", chains: "Chains | None") -> None:
        if file is not None or packing is not None or chains is not None:
            from softdyn.particles.placing import placed

            for name, value in placed(self, file, packing, chains).items():
                object.__setattr__(self, name, value)
        elif self.positions is None or self.radii is None:
            raise SceneError(PLACES)
