"""The sections [[boundary]] of a scene: what holds at each named part of the boundary."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated

from softdyn.scene.keys import Key, with_keys
from softdyn.scene.kinds import FIELD, FIELD_LIST, FLAG, NAME_OR_NAMES
from softdyn.words import suggestion

#: What a boundary may say of itself: one of these.
SAYS = ("velocity", "flux", "pressure", "slip", "periodic")


@with_keys
@dataclass(frozen=True)
class Boundary:
    """What holds at one or more parts of the boundary: one of velocity, flux, pressure, slip and periodic."""

    on: Annotated[
        str | Sequence[str],
        Key("[[boundary]] on", NAME_OR_NAMES, "Which parts of the boundary, by the names that the mesh gives them."),
    ]
    velocity: Annotated[
        Sequence[float | str] | None,
        Key(
            "[[boundary]] velocity",
            FIELD_LIST,
            "Velocity of the fluid, one component for each axis: of a wall, 0 or its own; of what flows in. At corners "
            "each boundary keeps the flow through it; along them a wall at rest holds, else the later velocity.",
            "length/time",
        ),
    ] = None
    flux: Annotated[
        Sequence[float | str] | None,
        Key(
            "[[boundary]] flux",
            FIELD_LIST,
            "Porosity times velocity, instead: what flows through a bed by volume and area.",
            "length/time",
        ),
    ] = None
    pressure: Annotated[
        float | str | None,
        Key(
            "[[boundary]] pressure",
            FIELD,
            "Pressure outside, of an outlet or an inlet: minus the normal stress there.",
            "force/length^2",
        ),
    ] = None
    slip: Annotated[
        bool,
        Key(
            "[[boundary]] slip",
            FLAG,
            "Whether fluid slips along it without friction, and none flows through it, as at a plane of symmetry.",
        ),
    ] = False
    periodic: Annotated[
        bool,
        Key(
            "[[boundary]] periodic",
            FLAG,
            "Whether the flow goes on from one to the other of the two parts that it is on, which must be alike.",
        ),
    ] = False

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its parts."""
        return (self.on,) if isinstance(self.on, str) else tuple(self.on)

    @property
    def says(self) -> tuple[str, ...]:
        """Which of :data:`SAYS` are given."""
        values = {name: getattr(self, name) for name in SAYS}
        return tuple(name for name, value in values.items() if value is not None and value is not False)


def periodic_pairs(boundaries: Iterable[Boundary]) -> tuple[tuple[str, str], ...]:
    """Boundaries that are the same, displaced."""
    return tuple((entry.names[0], entry.names[1]) for entry in boundaries if entry.periodic and len(entry.names) == 2)


def boundary_faults(boundaries: Sequence[Boundary], there: Iterable[str]) -> list[str]:
    """What is wrong with the conditions together.

    Parameters
    ----------
    boundaries : sequence of Boundary
    there : iterable of str
        Names of the parts of the mesh's boundary.
    """
    there = list(there)
    faults, first = [], dict[str, int]()
    for number, entry in enumerate(boundaries):
        where = f"[[boundary]] {number}"
        if len(entry.says) != 1:
            said = f"{' and '.join(entry.says)} are given" if entry.says else "none is given"
            faults.append(f"{where}: give one of {', '.join(SAYS)}: {said}")
        if entry.periodic and len(entry.names) != 2:
            faults.append(f'{where}: periodic is on two parts, such as on = ["left", "right"], not {len(entry.names)}')
        for name in entry.names:
            if name not in there:
                faults.append(f"{where}: the mesh has no boundary {name!r}{suggestion(name, there)}")
            elif name in first:
                faults.append(f"{where}: boundary {name!r} has a condition already, of [[boundary]] {first[name]}")
            first.setdefault(name, number)
    bare = [name for name in there if name not in first]
    if bare:
        faults.append(
            f"nothing is said of boundary {', '.join(map(repr, bare))}: add [[boundary]] with on = "
            f'"{bare[0]}" and one of {", ".join(SAYS)}; a wall has velocity = [0, 0], or three zeros'
        )
    return faults
