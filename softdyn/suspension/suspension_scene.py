"""Scenes of grains in a fluid: their keys, what must hold of these together, and scene files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.fluid.bed import CLOSURE
from softdyn.fluid.fluid_scene import FluidScene, check_fluid, fluid_fields_from
from softdyn.particles.particle_keys import BOND, CHAINS, FRICTION, POSITIONS, POTENTIAL_ENTRY, RADII, SPECIES
from softdyn.scene.keys import Key, with_keys
from softdyn.scene.kinds import FLAG, LAW, NAMES, POSITIVE, between, choice
from softdyn.scene.reading import scene_of_file
from softdyn.words import listed

if TYPE_CHECKING:
    from softdyn.fluid.mesh import Mesh
    from softdyn.particles.chains import Chains
    from softdyn.particles.mechanisms.bonds import Bond
    from softdyn.particles.mechanisms.coulomb import Friction
    from softdyn.particles.mechanisms.potentials import PairPotential

#: Width of the filter over the largest radius, where a scene does not say.
WIDTH = 3.0


@with_keys
@dataclass(frozen=True)
class SuspensionScene(FluidScene):
    """Grains in a fluid that is averaged around them; all numbers in one consistent set of units."""

    method: Annotated[
        str,
        Key(
            "[steps] method",
            choice("method", ("Euler",)),
            "Implicit Euler, of order 1: implicit in the flow, in the drag and in the pressure that grains feel.",
        ),
    ] = "Euler"
    rtol: Annotated[
        float,
        Key(
            "[accuracy] rtol",
            between(1e-12, 0.1),
            "Change of the drag on the grains, over the largest, at which a step is not repeated any more.",
        ),
    ] = 1e-6
    positions: Annotated[
        Any,
        Key(
            "[particles] positions",
            POSITIONS,
            "Positions of the centres, a list of 2 or 3 coordinates for each grain, in the mesh.",
            "length",
        ),
    ] = ()
    radii: Annotated[
        Any,
        Key(
            "[particles] radii",
            RADII,
            "One radius for all grains, or one for each. In two dimensions they are discs, whose drag per volume is "
            "that of spheres.",
            "length",
        ),
    ] = None
    density: Annotated[
        float,
        Key(
            "[fluid] density",
            between(0, 1e100),
            "Density of the fluid; without, the fluid has no inertia and no weight.",
            "force time^2/length^4",
        ),
    ] = 0.0
    grain_density: Annotated[
        float | None,
        Key(
            "[particles] density",
            POSITIVE,
            "Density of the grains, which have inertia; their buoyancy is in the pressure of the fluid.",
            "force time^2/length^4",
        ),
    ] = None
    velocities: Annotated[
        Any,
        Key(
            "[particles] velocities",
            POSITIONS,
            "Velocities at the start, one number for each axis, for each grain; at rest without.",
            "length/time",
        ),
    ] = None
    held: Annotated[
        bool,
        Key("[particles] held", FLAG, "Whether the grains keep the velocities that they start with, at rest without."),
    ] = False
    species: Annotated[Sequence[str] | None, SPECIES] = None
    chains: Annotated["Chains | None", CHAINS] = None
    drag: Annotated[Any, Key("[closures] drag", CLOSURE, "The drag on a grain, a closure that gives it.")] = None
    law: Annotated[
        Any,
        Key("law", LAW, "The contact law of grains that touch; its parameters stand in [parameters], too."),
    ] = None
    friction: Annotated["Friction | None", FRICTION] = None
    potential: Annotated[Sequence["PairPotential"], POTENTIAL_ENTRY] = ()
    bond: Annotated[Sequence["Bond"], BOND] = ()
    walls: Annotated[
        Sequence[str],
        Key(
            "[contacts] walls",
            NAMES,
            "Flat parts of the mesh's boundary that grains touch, and which keep them in, by their names.",
        ),
    ] = ()
    gap: Annotated[
        float | None,
        Key(
            "[contacts] gap",
            POSITIVE,
            "Initial gap of the pairs whose surfaces are closer than that, which are then pressed together; all others "
            "start undeformed. Of laws with a film.",
            "length",
        ),
    ] = None
    range: Annotated[
        float | None,
        Key(
            "[contacts] range",
            POSITIVE,
            "Range of the contacts of laws with a film or a remote force: beyond this gap there is none, and from half "
            "of it on it fades. The smallest radius without: what is further away is the fluid's.",
            "length",
        ),
    ] = None
    width: Annotated[
        float | None,
        Key(
            "[coupling] width",
            POSITIVE,
            f"Width over which grains and fluid feel each other, a standard deviation along each axis; {WIDTH:g} times "
            "the largest radius without. Results should not depend on it, nor on the mesh.",
            "length",
        ),
    ] = None


@dataclass(frozen=True)
class GrainArrays:
    """Grains at the start.

    Attributes
    ----------
    x, v : arrays, shape (grains, d)
    radii : array, shape (grains,)
    bonds : tuple of Bond
        With the pairs of chains that are placed.
    """

    x: NDArray[np.float64]
    v: NDArray[np.float64]
    radii: NDArray[np.float64]
    bonds: tuple["Bond", ...] = ()


def check_suspension(scene: SuspensionScene) -> None:
    """Refuse what is wrong with a scene whatever its mesh.

    Raises
    ------
    SceneError
    """
    faults = []
    if scene.bed is not None:
        faults.append("[bed] does not go with [particles]: grains are either given as a bed, or one by one")
    if scene.steady or scene.until_t is None:
        faults.append("[until] needs t: grains move, and there is no steady flow to look for")
    if scene.dt is None:
        faults.append("[steps] dt is missing: the length of the steps of grains and fluid")
    if scene.drag is None:
        faults.append('[closures] drag is missing: the drag on the grains, as drag = "schiller_naumann"')
    if scene.chains is not None and (scene.radii is not None or len(scene.positions)):
        faults.append("[particles] positions and [chains] are two ways to say where the grains are: give one of them")
    elif scene.chains is None and scene.radii is None:
        faults.append("[particles] radii is missing")
    if scene.grain_density is None and not scene.held:
        faults.append("[particles] density is missing: grains have inertia, unless they are held")
    contacts = {"[friction]": scene.friction is not None, "[contacts] walls": bool(len(scene.walls))}
    contacts |= {f"[contacts] {name}": getattr(scene, name) is not None for name in ("gap", "range")}
    if scene.law is None:
        faults += [f'{name} needs a contact law, as law = "hertz"' for name in contacts if contacts[name]]
    forces = {"law": scene.law is not None, "[[potential]]": len(scene.potential), "[[bond]]": len(scene.bond)}
    if scene.held:
        faults += [f"{name} is of no use to grains that are held: leave it out" for name in forces if forces[name]]
    if faults:
        raise SceneError(listed(faults))
    check_fluid(scene)


def grains_of(scene: SuspensionScene, mesh: "Mesh") -> GrainArrays:
    """Grains of a scene in a mesh.

    Raises
    ------
    SceneError
        If an array is none, or has another shape.
    """
    d, bonds = mesh.dimension, tuple(scene.bond)
    if scene.chains is not None:
        x, bonds = _chains_in(scene, mesh)
    else:
        x = _array(scene.positions, "[particles] positions", d, None)
    v = np.zeros_like(x)
    if scene.velocities is not None:
        v = _array(scene.velocities, "[particles] velocities", d, len(x))
    try:
        radii = np.array(scene.radii if scene.chains is None else scene.chains.radius, dtype=float)
    except (TypeError, ValueError):
        raise SceneError("[particles] radii must be a number, or a list of numbers") from None
    if radii.ndim > 1 or (radii.ndim == 1 and len(radii) != len(x)):
        raise SceneError(f"[particles] radii are {radii.size}, and there are {len(x)} grains")
    if not (np.isfinite(radii).all() and (radii > 0).all()):
        raise SceneError("[particles] radii must be positive numbers")
    return GrainArrays(x, v, np.broadcast_to(radii, len(x)).copy(), bonds)


def _chains_in(scene: SuspensionScene, mesh: "Mesh") -> tuple[NDArray[np.float64], tuple["Bond", ...]]:
    """Places of the beads of chains in the box around a mesh, and the bonds of the scene."""
    from softdyn.fluid.boundary_keys import periodic_pairs
    from softdyn.fluid.mesh import periods_of
    from softdyn.particles.chains import chains_between

    low, high = mesh.at.min(axis=0), mesh.at.max(axis=0)
    repeats = periods_of(mesh, periodic_pairs(scene.boundary))
    walled = [axis for axis in range(mesh.dimension) if axis not in repeats]
    return chains_between(scene.chains, scene.bond, low, high, walled)


def _array(given: Any, where: str, d: int, count: int | None) -> NDArray[np.float64]:
    try:
        found = np.array(given, dtype=float)
    except (TypeError, ValueError):
        raise SceneError(f"{where} must be a list of lists of {d} numbers, one for each grain") from None
    found = found.reshape(0, d) if found.size == 0 else found
    if found.ndim != 2 or found.shape[1] != d or (count is not None and len(found) != count):
        grains = "" if count is None else f", and there are {count} grains"
        raise SceneError(
            f"{where}: the mesh has {d} dimensions, and each grain needs as many numbers, not an array of shape "
            f"{found.shape}{grains}"
        )
    if not np.isfinite(found).all():
        first = int(np.argmin(np.isfinite(found).all(axis=1)))
        raise SceneError(f"{where} must be finite numbers, and those of grain {first} are not")
    return found


def read_suspension_scene(path: str | Path) -> SuspensionScene:
    """Read a scene file of grains in a fluid.

    Raises
    ------
    SceneError
        If the file cannot be read, is not TOML (with the line), or holds an unknown or missing key.

    Examples
    --------
    >>> from pathlib import Path
    >>> from softdyn.suspension import read_scene
    >>> text = '''
    ... fluid = {density = 1000.0, viscosity = 1e-3, elements = "P1-P1"}
    ... mesh = {box = [1.6e-3, 1.6e-3, 3.2e-3], cells = [4, 4, 8]}
    ... gravity = {acceleration = [0, 0, -9.81]}
    ... particles = {positions = [[0.85e-3, 0.75e-3, 2.6e-3]], radii = 5e-5, density = 2000.0}
    ... closures = {drag = "schiller_naumann"}
    ... coupling = {width = 4e-4}
    ... until = {t = 0.02}
    ... steps = {dt = 4e-3}
    ... [[boundary]]
    ... on = ["left", "right", "bottom", "top", "front", "back"]
    ... velocity = [0, 0, 0]
    ... '''
    >>> _ = Path("settling.toml").write_text(text, encoding="utf-8")
    >>> read_scene("settling.toml").width
    0.0004
    """
    return scene_of_file(path, suspension_scene_from)


def suspension_scene_from(data: Mapping[str, Any], folder: Path) -> SuspensionScene:
    """Scene from the content of a scene file; paths in it are relative to ``folder``.

    Raises
    ------
    SceneError
        Listing unknown and missing keys.
    """
    return SuspensionScene(**fluid_fields_from(SuspensionScene, data, folder))
