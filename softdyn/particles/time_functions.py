"""What is given as a function of time: a number, an expression, or a table; its integral, and what steps miss of it.

Values are those from the left: at a jump the value before it, which a step that ends there needs;
:meth:`TimeFunction.after` gives the one behind it. Integrals from 0 on are exact for tables, and to rounding for
expressions: by Gauss's rule on pieces that are halved until a bound of what the rule cannot see, from
:mod:`softdyn.enclosure`, is below rounding. So they depend on the time alone, not on steps.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from softdyn.enclosure import RADII, enclose, intervals, models, unseen
from softdyn.errors import IntegrationError, SceneError
from softdyn.expression import Expression, derivative, evaluate, parse, pieces, values
from softdyn.particles.method import NODES
from softdyn.particles.names import is_number
from softdyn.scene.time_tables import Table, table_of

Array = NDArray[np.float64]

#: Points of Gauss's rule on a piece, which is exact for polynomials of DEGREE.
POINTS = 8
DEGREE = 2 * POINTS - 1
#: Error of an integral, relative to that of the size, and least part of it that is worth another piece.
ROUNDING, LEAST = 1e-16, 1e-19
MOST_PIECES = 2**18

_GAUSS = np.polynomial.legendre.leggauss(POINTS)
#: The stages of a step of many particles, from -1 to 1.
_STAGES = tuple((2 * NODES - 1).tolist())


@lru_cache(maxsize=64)
def _misses(nodes: tuple[float, ...], start: float) -> tuple[float, float]:
    """What a parabola through three values misses, in means over a step.

    Parameters
    ----------
    nodes : tuple of float
        The three places at which values are known, in units in which these reach from -1 to 1.
    start : float
        Of the step, which ends at 1.

    Returns
    -------
    lowest : float
        Of x^3.
    lebesgue : float
        The sum of the sizes of the polynomials that are 1 at a node and 0 at the others.
    """
    x = np.linspace(start, 1.0, 2001)
    bases = [np.prod([(x - nodes[j]) / (nodes[k] - nodes[j]) for j in range(3) if j != k], axis=0) for k in range(3)]
    missed = x**3 - sum(nodes[k] ** 3 * bases[k] for k in range(3))
    return float(np.mean(np.abs(missed))), float(np.mean(np.sum(np.abs(bases), axis=0)))


@dataclass(frozen=True)
class TimeFunction:
    """A function of time.

    Attributes
    ----------
    name : str
        What it is, for messages.
    end : float
        The run's: it is known from 0 to there.
    breaks : array
        Times between 0 and the end at which it has a kink or a jump, in order.
    number : float
        Its value, if it is a number.
    expression : Expression, optional
    parts : tuple of Expression
        Between its breaks an expression is one of these, which have none.
    doubtful : bool
        Whether breaks may be missing.
    table : Table, optional
        From 0 on.
    """

    name: str
    end: float
    breaks: Array
    number: float = 0.0
    expression: Expression | None = None
    parts: tuple[Expression, ...] = ()
    doubtful: bool = False
    table: Table | None = None

    @property
    def constant(self) -> bool:
        """Whether it is a number."""
        return self.expression is None and self.table is None

    def __call__(self, t: float) -> float:
        """Value at a time, or before the jump there."""
        if self.table is not None:
            return _interpolated(self.table, t, "left")
        if self.expression is None:
            return self.number
        return self._evaluated(t, "left")

    def after(self, t: float) -> float:
        """Value at a time, or behind the jump there."""
        if self.table is not None:
            return _interpolated(self.table, t, "right")
        return self.number if self.expression is None else self._evaluated(t, "right")

    def rate(self, t: float) -> float:
        """Derivative at a time, or before the kink there; at 0 that of what follows. It may be infinite, or nan."""
        side: Literal["left", "right"] = "left" if t > 0 else "right"
        if self.table is not None:
            times, given = self.table.t, self.table.F
            k = min(max(1, int(np.searchsorted(times, t, side))), len(times) - 1)
            return float((given[k] - given[k - 1]) / (times[k] - times[k - 1]))
        if self.expression is None:
            return 0.0
        part = self.parts[self._part(t, side)]
        return evaluate(replace(part, shape=derivative(part.shape)), t)

    def integral(self, t: float) -> float:
        """Integral from 0 to a time."""
        if self.table is not None:
            return _area(self.table, self._cumulative, t)
        if self.expression is None:
            return self.number * t
        starts, sums, _ = self._pieces
        k = max(0, int(np.searchsorted(starts, t, side="right")) - 1)
        part = np.array([self._part(float(starts[k]), "right")])
        return float(sums[k] + self._gauss(starts[k : k + 1], np.array([t]), part)[0][0])

    def missed(self, t: float, dt: float, seen: Sequence[float] | None = None) -> float:
        """Bound of the integral of |f - p| over a step without breaks, p the parabola through values that it knows.

        Parameters
        ----------
        t, dt : float
            Start and length of the step.
        seen : sequence of float, optional
            Times of three of these values, the last the end of the step, the first not behind its start, and no break
            in between. Those of the stages of a step of many particles, by default.

        Returns
        -------
        float
            inf where there is no bound.
        """
        if self.expression is None:
            return 0.0
        # a step that ends at a break is before it; the ends of steps are rounded
        part = self.parts[self._part(t + dt / 2, "right")]
        first = t if seen is None else seen[0]
        half = (t + dt - first) / 2
        nodes = _STAGES if seen is None else tuple((when - first) / half - 1 for when in seen)
        lowest, lebesgue = _misses(nodes, (t - first) / half - 1)
        best, ends = math.inf, (np.array([first]), np.array([t + dt]))
        for radius in RADII:
            found = models(part.shape, part.constants, *ends, radius, radius**-3.0, 0.0)[0]
            # in the disc the coefficient of x^k is at most the bound over the radius to k
            higher = (1 + lebesgue) * radius**-4.0 / (1 - 1 / radius)
            bound = (lowest * radius**-3.0 + higher) * found[3] + (1 + lebesgue) * found[4]
            best = min(best, bound) if not math.isnan(bound) else best
        return dt * float(best)

    def size(self) -> float:
        """Integral of the size of an expression over the run.

        Raises
        ------
        SceneError
            If it changes too often, or is singular somewhere.
        """
        return abs(self.number) * self.end if self.expression is None else self._pieces[2]

    def largest(self, start: float, end: float) -> float:
        """Bound of the size of an expression between two times without a break in between; inf where there is none."""
        if self.expression is None:
            return abs(self.number)
        part = self.parts[self._part(start + (end - start) / 2, "right")]
        least, most = enclose((part.shape, part.constants), start, end)
        found = max(abs(float(least)), abs(float(most)))
        return math.inf if math.isnan(found) else found

    def _part(self, t: float, side: str) -> int:
        """Number of the part that holds before or behind a time."""
        return int(np.searchsorted(self.breaks, t, side="left" if side == "left" else "right"))

    def _evaluated(self, t: float, side: str) -> float:
        found = evaluate(self.parts[self._part(t, side)], t)
        if not math.isfinite(found):
            raise IntegrationError(f"{self.name} = {self._text!r} has no finite value at t={t:.6g}")
        return found

    @property
    def _text(self) -> str:
        return "" if self.expression is None else self.expression.text

    @cached_property
    def _cumulative(self) -> Array:
        assert self.table is not None
        t, values = self.table.t, self.table.F
        return _sums(np.diff(t) * (values[:-1] + (values[1:] - values[:-1]) / 2))

    def _gauss(self, a: Array, b: Array, part: NDArray[np.int64]) -> tuple[Array, Array]:
        """Integrals over intervals, each in one of the parts, and those of the size."""
        points, weights = _GAUSS
        middle, half = a + (b - a) / 2, (b - a) / 2
        t = middle[:, None] + half[:, None] * points
        found = np.empty_like(t)
        for k in np.unique(part):
            found[part == k] = values(self.parts[k].shape, t[part == k], self.parts[k].constants)
        if not np.isfinite(found).all():
            at = float(t[~np.isfinite(found)][0])
            raise IntegrationError(f"{self.name} = {self._text!r} has no finite value at t={at:.6g}")
        return half * (found @ weights), half * (np.abs(found) @ weights)

    def _bounds(self, a: Array, b: Array, part: NDArray[np.int64]) -> Array:
        """Bounds of the errors of Gauss's rule: of what is no polynomial of its degree."""
        found = np.empty_like(a)
        for k in np.unique(part):
            mine = part == k
            found[mine] = 2 * (b - a)[mine] * unseen(self.parts[k], a[mine], b[mine], DEGREE, 0.0)
        return found

    @cached_property
    def _pieces(self) -> tuple[Array, Array, float]:
        """Starts of the pieces of an expression, the integral from 0 to each, and that of the size over the run."""
        ends = np.concatenate([[0.0], self.breaks, [self.end]])
        a, b, part = ends[:-1], ends[1:], np.arange(len(ends) - 1)
        total, size, wrong = *self._gauss(a, b, part), self._bounds(a, b, part)
        while True:
            whole = float(size.sum())
            allowed = ROUNDING * (size + whole * (b - a) / self.end) + LEAST * whole
            middle = a + (b - a) / 2
            coarse = ~(wrong <= allowed) & (a < middle) & (middle < b)
            if not coarse.any():
                break
            if len(a) + int(coarse.sum()) > MOST_PIECES:
                raise SceneError(f"{self.name} = {self._text!r} {_OFTEN}")
            new_a = np.concatenate([a[coarse], middle[coarse]])
            new_b, new_part = np.concatenate([middle[coarse], b[coarse]]), np.tile(part[coarse], 2)
            new = new_a, new_b, new_part, *self._gauss(new_a, new_b, new_part), self._bounds(new_a, new_b, new_part)
            old = a, b, part, total, size, wrong
            a, b, part, total, size, wrong = (np.concatenate([x[~coarse], y]) for x, y in zip(old, new, strict=True))
        if not np.isfinite(wrong).all():
            at = float(a[~np.isfinite(wrong)][0])
            raise SceneError(f"{self.name} = {self._text!r} has no bound near t={at:.6g}: is it singular there?")
        order = np.argsort(a)
        return a[order], _sums(total[order])[:-1], float(size.sum())


_OFTEN = (
    f"changes too often to be integrated, or has a singularity: {MOST_PIECES} pieces do not resolve it; end the run "
    "before, or give a table"
)


def is_driven(value: Any) -> bool:
    """Whether a value says how something changes: an expression, or a table."""
    return isinstance(value, (str, Table)) or (isinstance(value, (tuple, list)) and len(value) == 2)


def time_function(value: Any, name: str, constants: dict[str, float], end: float) -> TimeFunction:
    """TimeFunction from a number, an expression, a table, or a pair of arrays (times, values).

    Parameters
    ----------
    value : number, str, Table, or (times, values)
    name : str
        For errors.
    constants : mapping from str to float
        What an expression may name.
    end : float
        Time to which a table must reach.

    Raises
    ------
    SceneError
        If it is something else, has no value at the start, or does not reach to the end.
    """
    if isinstance(value, str):
        expression = parse(value, constants)
        found = _of_expression(expression, name, end)
        try:
            start = found(0.0)
        except IntegrationError:
            raise SceneError(f"{name} = {value!r} has no finite value at t = 0") from None
        return found if expression.of_time else TimeFunction(name, end, np.empty(0), start)
    if isinstance(value, Table):
        value = (value.t, value.F)
    if isinstance(value, (tuple, list)) and len(value) == 2:
        return _of_table(table_of(name, *value), name, end)
    if not is_number(value):
        raise SceneError(f"{name} must be a number, an expression of t, or a table, not {value!r}")
    return TimeFunction(name, end, np.empty(0), float(value))


def _of_expression(expression: Expression, name: str, end: float) -> TimeFunction:
    smooth, doubtful, last = pieces(expression.shape), False, 0.0
    breaks: list[float] = []
    parts: list[Expression] = []
    for interval in intervals(smooth, expression.constants, 0.0, end):
        part = replace(expression, shape=smooth.shape, constants=tuple(interval.constants.tolist()))
        doubtful |= interval.doubtful
        if not parts or parts[-1] != part:
            breaks += [last] if parts else []
            parts.append(part)
        last = interval.end
        if len(parts) > MOST_PIECES:
            raise SceneError(f"{name} = {expression.text!r} {_OFTEN}")
    return TimeFunction(name, end, np.array(breaks), expression=expression, parts=tuple(parts), doubtful=doubtful)


def _of_table(table: Table, name: str, end: float) -> TimeFunction:
    t, values = table.t, table.F
    if t[0] > 0:
        raise SceneError(f"{name}: the table starts at t = {t[0]:g}, after the run does, at 0")
    if t[-1] < end:
        raise SceneError(f"{name}: the table ends at t = {t[-1]:g}; extend it, or end the run earlier than {end:g}")
    start = _interpolated(table, 0.0, "right")
    later = t > 0
    table = Table(np.append(0.0, t[later]), np.append(start, values[later]))
    inside = table.t[(table.t > 0) & (table.t < end)]
    return TimeFunction(name, end, np.unique(inside), table=table)


def _interpolated(table: Table, t: float, side: str) -> float:
    """Value of a table, before or behind a jump."""
    times, values = table.t, table.F
    k = int(np.searchsorted(times, t, side="left" if side == "left" else "right"))
    if k == 0:
        return float(values[0])
    if k == len(times):
        return float(values[-1])
    if side == "left" and times[k] == t:
        return float(values[k])
    part = (t - times[k - 1]) / (times[k] - times[k - 1])
    return float(values[k - 1] + part * (values[k] - values[k - 1]))


def _area(table: Table, cumulative: Array, t: float) -> float:
    """Integral of a table from its first time."""
    k = max(1, min(int(np.searchsorted(table.t, t, side="left")), len(table.t) - 1))
    value = _interpolated(table, t, "left")
    return float(cumulative[k - 1] + (t - table.t[k - 1]) * (table.F[k - 1] + (value - table.F[k - 1]) / 2))


def _sums(parts: Iterable[float] | Array) -> Array:
    """0 and the sums of the first, of the first two, ...: each rounded as if it were one sum (Neumaier)."""
    sums, total, lost = [0.0], 0.0, 0.0
    for part in map(float, parts):
        new = total + part
        lost += (total - new) + part if abs(total) >= abs(part) else (part - new) + total
        total = new
        sums.append(total + lost)
    return np.array(sums)
