"""What a scene gives at each point and time: a number, or an expression of x, y, z and t."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.expression import Expression, parse, values
from softdyn.fluid.mesh import place
from softdyn.scene.kinds import is_number, shown

Array = NDArray[np.float64]
AXES = "xyz"


@dataclass(frozen=True)
class FieldFunction:
    """A quantity at each point and time.

    Attributes
    ----------
    where : str
        The key that gives it, for messages.
    number : float
        Its value, if there is no expression.
    expression : Expression or None
    """

    where: str
    number: float
    expression: Expression | None = None

    @property
    def of_time(self) -> bool:
        """Whether it may change in time."""
        return self.expression is not None and self.expression.of_time

    @property
    def zero(self) -> bool:
        """Whether it is 0, everywhere and always, by what is written."""
        return self.expression is None and self.number == 0


def field_of(given: Any, d: int, constants: Mapping[str, float], where: str) -> FieldFunction:
    """Read what a scene gives.

    Parameters
    ----------
    given : number or str
    d : 2 or 3
        How many axes there are.
    constants : mapping from str to float
    where : str
        The key, for messages: "[bed] porosity".

    Raises
    ------
    SceneError
        If it is neither, or leaves the grammar.
    """
    if is_number(given):
        return FieldFunction(where, float(given))
    if not isinstance(given, str):
        raise SceneError(
            f"{where} must be a number, or an expression of {', '.join(AXES[:d])} and t, not {shown(given)}"
        )
    try:
        return FieldFunction(where, 0.0, parse(given, constants, AXES[:d]))
    except SceneError as error:
        raise SceneError(f"{where}: {error}") from None


def fields_of(given: Any, d: int, constants: Mapping[str, float], where: str) -> tuple[FieldFunction, ...]:
    """Read one quantity for each axis; see :func:`field_of`.

    Parameters
    ----------
    given : sequence
        A number or an expression for each axis.
    d : int
        Dimensions.
    constants : mapping from str to float
        What expressions may name.
    where : str
        Place in the scene, for errors.
    """
    if not isinstance(given, (list, tuple)) or len(given) != d:
        raise SceneError(
            f"{where} needs {d} components, a number or an expression for each of {', '.join(AXES[:d])}, not "
            f"{shown(given)}"
        )
    return tuple(field_of(one, d, constants, f"{where}, {axis}") for axis, one in zip(AXES, given, strict=False))


def values_at(field: FieldFunction, at: Array, t: float) -> Array:
    """Values at points, shape (points,).

    Parameters
    ----------
    field : FieldFunction
    at : array, shape (points, d)
    t : float

    Raises
    ------
    SceneError
        Where a value is not finite, with the place and the time.
    """
    if field.expression is None:
        return np.full(len(at), field.number)
    found = values(field.expression.shape, np.array(float(t)), field.expression.constants, list(at.T))
    bad = ~np.isfinite(found)
    if bad.any():
        first = int(np.argmax(bad))
        raise SceneError(f"{field.where} is {found[first]:g} at {place(at[first])}, t = {t:g}")
    return found


def vectors_at(fields: Sequence[FieldFunction], at: Array, t: float) -> Array:
    """Values of one quantity for each axis at points, shape (points, axes).

    Parameters
    ----------
    fields : sequence of FieldFunction
        One for each axis.
    at : array, shape (points, d)
    t : float
    """
    return np.stack([values_at(field, at, t) for field in fields], axis=1)
