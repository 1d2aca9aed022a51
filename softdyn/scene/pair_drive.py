"""What drives a pair: a force, the motion of its centres, or a spring; each a number, an expression or a table."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.expression import FUNCTIONS, Expression, parse
from softdyn.expression import evaluate as evaluate_expression
from softdyn.scene.numbers import finite_number, named_numbers, positive_number
from softdyn.scene.time_tables import Table, table_of

if TYPE_CHECKING:
    from softdyn.scene.pair_scene import Scene

#: What can drive a pair; exactly one of them does.
DRIVES = ("force", "position", "velocity", "spring")


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

    shape: str | tuple[Any, ...]
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
    stiffness = positive_number("[drive] spring: stiffness", spring["stiffness"])
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


def _drive_from(name: str, value: Any, named: Mapping[str, Any]) -> Drive:
    if isinstance(value, str):
        constants = named_numbers("[constants]", named)
        taken = [constant for constant in constants if constant in ("t", "pi", *FUNCTIONS)]
        if taken:
            raise SceneError(f"[constants] {', '.join(taken)} has a meaning of its own in an expression")
        try:
            expression: Expression = parse(value, constants)
        except SceneError as error:
            raise SceneError(f"[drive] {name}: {error}") from None
        unused = [constant for constant in constants if not re.search(rf"\b{re.escape(constant)}\b", value)]
        if unused:
            raise SceneError(f"[constants] {', '.join(unused)} does not appear in the {name} {value!r}")
        if expression.of_time:
            return Drive(expression.shape, np.array(expression.constants or (0.0,)))
        number = evaluate_expression(expression, 0.0)
        if not math.isfinite(number):
            raise SceneError(f"[drive] {name} = {value!r} has no finite value")
        return Drive("constant", np.array([number]))
    if named:
        raise SceneError(f"[constants] belong to a {name} that is an expression, and this one is not")
    if isinstance(value, Table):
        value = (value.t, value.F)
    if isinstance(value, (tuple, list)) and len(value) == 2:
        table = table_of(name, *value)
        return Drive("table", np.zeros(1), table, float(table.t[0]))
    return Drive("constant", np.array([finite_number(name, value)]))
