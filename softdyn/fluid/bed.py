"""The section [bed] of a scene: grains that are not resolved, by their porosity and their drag."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.fluid.fields import FieldFunction, values_at
from softdyn.fluid.mesh import place
from softdyn.scene.keys import Key, with_keys
from softdyn.scene.kinds import FIELD, FIELD_LIST, LAW, POSITIVE, Kind

Array = NDArray[np.float64]

#: Porosities below this one are taken for it: no packing is as dense, and the drag on one grows without bound.
LEAST = 0.05
#: How far above 1 rounding may bring a porosity.
ROUNDING = 1e-12

CLOSURE = Kind('a stock closure, "path/closure.py", in Python a closure, too', LAW.schema, path=LAW.path)


@with_keys
@dataclass(frozen=True)
class Bed:
    """Grains in the fluid that are not resolved: their porosity, drag and motion."""

    porosity: Annotated[
        float | str,
        Key(
            "[bed] porosity",
            FIELD,
            "Fraction of the volume that is fluid, up to 1, which is fluid alone. Values between 0 and "
            f"{LEAST:g} are taken for {LEAST:g}, and a warning tells where.",
        ),
    ]
    drag: Annotated[
        Any,
        Key("[bed] drag", CLOSURE, "The drag on a grain, a closure that gives it; none without."),
    ] = None
    radius: Annotated[
        float | None, Key("[bed] radius", POSITIVE, "Radius of the grains; what gives a drag needs it.", "length")
    ] = None
    velocity: Annotated[
        Sequence[float | str] | None,
        Key("[bed] velocity", FIELD_LIST, "Velocity of the grains, which are at rest without.", "length/time"),
    ] = None


def bed_faults(bed: Bed) -> list[str]:
    """What is wrong with the keys of a bed together."""
    if bed.drag is not None and bed.radius is None:
        return ["[bed] radius is missing: the drag on the grains needs it"]
    if bed.drag is None and bed.radius is not None:
        return ["[bed] radius is of no use without a drag: leave it out, or name a closure, drag"]
    return []


def porosity_at(porosity: FieldFunction, at: Array, t: float) -> tuple[Array, str]:
    """Porosity at points, and a warning where it was taken for the least, or "".

    Parameters
    ----------
    porosity : FieldFunction
    at : array, shape (points, d)
    t : float

    Raises
    ------
    SceneError
        Where it is not between 0 and 1, with the place.
    """
    found = values_at(porosity, at, t)
    wrong = (found <= 0) | (found > 1 + ROUNDING)
    if wrong.any():
        first = int(np.argmax(wrong))
        raise SceneError(
            f"{porosity.where} must lie between 0 and 1, and is {found[first]:g} at {place(at[first])}, t = {t:g}"
        )
    low = found < LEAST
    warning = ""
    if low.any():
        first = int(np.argmin(found))
        warning = (
            f"{porosity.where} is below {LEAST:g} at {int(low.sum())} of {len(at)} nodes, least {found[first]:g} at "
            f"{place(at[first])}: taken for {LEAST:g}"
        )
    return np.clip(found, LEAST, 1.0), warning
