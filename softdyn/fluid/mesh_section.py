"""The section [mesh] of a scene: a box, a channel with a cylinder, or a file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from softdyn.errors import SceneError
from softdyn.scene.keys import Key, with_keys
from softdyn.scene.kinds import NAMES, PATH, POSITIVE, Kind, between, is_number, of_kind, shown, whole_number

if TYPE_CHECKING:
    from softdyn.fluid.mesh import Mesh

_NUMBERS = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 3}
_COUNTS = {"type": "array", "items": {"type": "integer", "minimum": 2}, "minItems": 2, "maxItems": 3}


def _is_numbers(value: Any) -> bool:
    return isinstance(value, (list, tuple)) and len(value) in (2, 3) and all(map(is_number, value))


def _is_counts(value: Any) -> bool:
    good = isinstance(value, (list, tuple)) and len(value) in (2, 3)
    return good and all(isinstance(n, int) and not isinstance(n, bool) and n >= 2 for n in value)


def _names_fault(value: Any) -> str | None:
    good = isinstance(value, (list, tuple)) and all(isinstance(name, str) for name in value)
    return None if good else f" must be a list of names, not {shown(value)}"


AXES_NUMBERS = of_kind("a list of 2 or 3 numbers", _NUMBERS, _is_numbers)
AXES_COUNTS = of_kind("a list of 2 or 3 counts, 2 or larger", _COUNTS, _is_counts)
SIDE_NAMES = Kind(NAMES.words, NAMES.schema, _names_fault)


@with_keys
@dataclass(frozen=True)
class MeshSection:
    """The mesh: a box, a channel with a cylinder, or a file."""

    file: Annotated[
        str | Path | None,
        Key(
            "[mesh] file",
            PATH,
            "A mesh of gmsh (.msh), of triangles or tetrahedra; its physical groups name the parts of the boundary.",
        ),
    ] = None
    box: Annotated[
        Sequence[float] | None,
        Key(
            "[mesh] box",
            AXES_NUMBERS,
            "Lengths of a rectangle or a cuboid, whose sides are named left, right, bottom, top, front and back.",
            "length",
        ),
    ] = None
    origin: Annotated[
        Sequence[float] | None,
        Key("[mesh] origin", AXES_NUMBERS, "The lowest corner of the box; 0 along each axis without.", "length"),
    ] = None
    cells: Annotated[
        Sequence[int] | None,
        Key(
            "[mesh] cells",
            AXES_COUNTS,
            "Cells of the box along each axis, of which each is cut into 2 triangles or 6 tetrahedra.",
        ),
    ] = None
    finer_at: Annotated[
        Sequence[str],
        Key("[mesh] finer_at", SIDE_NAMES, "Sides of the box towards which its cells become finer."),
    ] = ()
    ratio: Annotated[
        float,
        Key("[mesh] ratio", between(1, 1e6), "Largest cell over the smallest along an axis with such a side."),
    ] = 1.0
    channel: Annotated[
        Sequence[float] | None,
        Key(
            "[mesh] channel",
            AXES_NUMBERS,
            "Length and height of a channel with a cylinder across it, whose boundaries are named inlet, outlet, walls "
            "and cylinder.",
            "length",
        ),
    ] = None
    cylinder: Annotated[
        Sequence[float] | None,
        Key("[mesh] cylinder", AXES_NUMBERS, "Centre of the cylinder, from the lower end of the inlet.", "length"),
    ] = None
    radius: Annotated[float | None, Key("[mesh] radius", POSITIVE, "Radius of the cylinder.", "length")] = None
    around: Annotated[
        int | None,
        Key(
            "[mesh] around",
            whole_number(16),
            "Cells around the cylinder, a multiple of 4: a quarter of them along each side of the square that the mesh "
            "is refined in.",
        ),
    ] = None


#: The keys of each kind of mesh: what says that it is of this kind, what it needs, and what it may have.
WAYS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "file": ((), ()),
    "box": (("cells",), ("origin", "finer_at", "ratio")),
    "channel": (("cylinder", "radius", "around"), ()),
}


def mesh_faults(section: MeshSection) -> list[str]:
    """What is wrong with the keys of a mesh together."""
    given = [field.name for field in fields(section) if getattr(section, field.name) != field.default]
    ways = [way for way in WAYS if way in given]
    if len(ways) != 1:
        found = f"{' and '.join(ways)} are given" if ways else "none is given"
        return [f"[mesh] takes one of {', '.join(WAYS)}: {found}"]
    needs, may = WAYS[ways[0]]
    faults = [f"[mesh] {key} is missing: {ways[0]} needs it" for key in needs if key not in given]
    allowed = (ways[0], *needs, *may)
    faults += [f"[mesh] {key} does not go with {ways[0]}: leave it out" for key in given if key not in allowed]
    if section.finer_at and section.ratio == 1:
        faults.append("[mesh] finer_at needs a ratio of the largest cell to the smallest, larger than 1")
    if section.ratio != 1 and not section.finer_at:
        faults.append('[mesh] ratio needs the sides at which cells are finer: finer_at = ["left"]')
    return faults


def made_mesh(section: MeshSection) -> Mesh:
    """Make, or read, the mesh of a scene.

    Raises
    ------
    SceneError
    """
    from softdyn.words import listed

    faults = mesh_faults(section)
    if faults:
        raise SceneError(listed(faults))
    if section.file is not None:
        from softdyn.fluid.mesh_file import read_mesh

        return read_mesh(section.file)
    from softdyn.fluid.built_meshes import box_mesh, cylinder_mesh

    if section.box is not None:
        assert section.cells is not None
        return box_mesh(section.box, section.cells, section.origin, section.finer_at, section.ratio)
    assert section.channel is not None
    assert section.cylinder is not None
    assert section.radius is not None
    assert section.around is not None
    for name, value in (("channel", section.channel), ("cylinder", section.cylinder)):
        if len(value) != 2:
            raise SceneError(f"[mesh] {name} takes 2 numbers, not {list(value)}: the channel is plane")
    return cylinder_mesh(section.channel, section.cylinder, section.radius, section.around)
