"""Enclosures of expressions of time: what one can do between the times at which it is looked at.

On an interval of time an expression is enclosed by a polynomial of degree 2 about the middle, an analytic part whose
bound in a complex disc bounds all its derivatives (Cauchy), a part that is only bounded, and a range. All of these
come of one pass over the expression's operations; see the template ``enclosure``, which the kernels of pairs hold, too.
Bounds are rigorous: rounding is counted, but that of the constants, which are doubles.

The questions that an engine has:

- :func:`enclose`: in what range are the values? With :func:`softdyn.expression.derivative`, of the slopes, too: at a
  kink both are within; a jump is not seen.
- :func:`unseen`: how far can the expression be, on the interval, from a polynomial of a degree? A step of a method
  that follows such polynomials has seen all of it but that.
- :func:`resolved`: intervals, each of which is resolved so, up to what is allowed.
- :func:`kinks`: where must steps end?
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache as memoize
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn import cache
from softdyn.expression import Builder, Expression, Pieces, Shape, derivative, operands, pieces, values

Array = NDArray[np.float64]

EPS = float(np.finfo(float).eps)
#: For rounding, relative: of the functions, and of some sums.
SLACK = 8 * EPS
#: Radii of the disc, over half of the interval, that are tried: the best depends on what is enclosed.
RADII = (1.5, 2.5, 4.0, 8.0, 16.0, 32.0)
#: Most intervals that are looked at.
MOST = 500_000

#: Numbers of the operations in a program; see the template.
KINDS = {
    "number": 0, "constant": 1, "time": 2, "neg": 3, "+": 4, "-": 5, "*": 6, "inverse": 7, "power": 8, "**": 9,
    "exp": 10, "sin": 11, "cos": 12, "sinh": 13, "cosh": 14, "tanh": 15, "atan": 16, "log": 17, "sqrt": 18,
    "abs": 19, "min": 20, "max": 21, "select": 22, "choose": 23,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Program:
    """An expression as its enclosure takes it: the operations, four numbers each, those without operands first."""

    numbers: int
    rows: Array

    @property
    def length(self) -> int:
        """How many operations there are."""
        return len(self.rows) // 4


@lru_cache(maxsize=1024)
def program_of(shape: Shape) -> Program:
    """The program of a shape."""
    rows = program_rows(shape)
    numbers = sum(row[0] <= KINDS["constant"] for row in rows)
    return Program(numbers, np.array(rows, dtype=float).ravel())


def program_rows(shape: Shape) -> list[tuple[float, ...]]:
    """Rows of a program: what an operation is, and what it works on."""
    build = Builder()
    places: list[int] = []
    timed: list[bool] = []
    for operation in shape:
        kind, *parts = operation
        timed.append(kind == "time" or any(timed[x] for x in operands(operation)))
        those = [places[x] for x in operands(operation)]
        if kind in ("number", "constant", "time"):
            places.append(build.add(*operation))
        elif kind == "/":
            places.append(build.add("*", those[0], build.add("inverse", those[1])))
        elif kind == "*" and those[0] == those[1]:
            places.append(build.add("power", those[0], 2))
        elif kind == "power":
            places.append(build.add("power", those[0], parts[1]))
        elif kind == "**" and timed[parts[1]]:
            power = build.add("exp", build.add("*", those[1], build.add("log", those[0])))
            # a negative base has values where the exponent is whole, and no bound: log(-1) has none
            places.append(build.add("select", those[0], build.add("log", build.number(-1.0)), power))
        elif kind == "choose":
            places.append(build.add("choose", parts[0], *those))
        else:
            places.append(_called(build, parts[0], those) if kind == "call" else build.add(kind, *those))
    order = sorted(range(len(build.operations)), key=lambda i: build.operations[i][0] not in ("number", "constant"))
    new = {old: i for i, old in enumerate(order)}
    return [_row(build.operations[i], new) for i in order]


def _called(build: Builder, name: str, those: Sequence[int]) -> int:
    """Operations of a function."""
    if name == "tan":
        return build.add("*", build.add("sin", *those), build.add("inverse", build.add("cos", *those)))
    if name == "coth":
        return build.add("inverse", build.add("tanh", *those))
    if name == "step":
        return build.add("select", those[0], build.number(0.0), build.number(1.0))
    if name == "sign":
        return build.add("-", _called(build, "step", those), _called(build, "step", [build.add("neg", *those)]))
    if name in ("min", "max"):
        return build.add(name, build.add("-", *those), *those)
    return build.add(name, *those)


def _row(operation: tuple[Any, ...], new: dict[int, int]) -> tuple[float, ...]:
    kind, *parts = operation
    code = float(KINDS[kind])
    if kind in ("number", "constant"):
        return (code, parts[0], 0.0, 0.0)
    if kind == "time":
        return (code, 0.0, 0.0, 0.0)
    if kind == "power":
        return (code, new[parts[0]], parts[1], 0.0)
    if kind == "choose":
        return (code, new[parts[1]], new[parts[2]], parts[0])
    places = [float(new[x]) for x in parts]
    if kind in ("min", "max", "select"):
        return (code, places[1], places[2], places[0])
    if kind == "abs":
        return (code, places[0], places[0], places[0])
    return (code, *places, *[0.0] * (3 - len(places)))


@memoize
def _compiled() -> Callable[..., None]:
    """The compiled function, from the cache or made now."""
    from softdyn.kernels import choose_target, loaded, tool_digest

    target = choose_target("auto")
    key = cache.key_of("enclosures", target, tool_digest())
    kept = cache.read("manifests", key)
    if kept is None:
        from softdyn.derive.emit import write_enclosures

        text, _, functions = write_enclosures(target)
        made = {"name": "enclosures", "source": text, "functions": functions}
        kept = cache.publish("manifests", key, {"manifest.json": json.dumps(made).encode()})
    manifest = json.loads((kept / "manifest.json").read_text(encoding="utf-8"))
    of: Callable[..., None] = loaded(target, manifest)[2].of
    return of


def models(
    shape: Shape,
    constants: Sequence[float] | Array,
    starts: Array,
    ends: Array,
    radius: float,
    faith: float,
    slack: float = SLACK,
) -> Array:
    """Models of an expression over intervals, shape (intervals, 7).

    Parameters
    ----------
    starts, ends : arrays, shape (intervals,)
        Finite times.
    radius : float
        Of the disc, over half of an interval.
    faith : float
        Where the range of an operation is below ``faith`` times the bound of its analytic part, it takes its place.
    slack : float
        For rounding; 0 if the expression is not to be told from what is computed of it.

    Returns
    -------
    array
        Of each interval, x the time from its middle: the terms 1, x and x^2; a bound in the disc of the analytic part,
        which starts with x^3; a bound of the rest; the least and the largest value.
    """
    program = program_of(shape)
    starts, ends = (np.ascontiguousarray(x, dtype=float) for x in (starts, ends))
    c = np.ascontiguousarray(constants, dtype=float)
    scratch, out = np.empty(7 * program.length), np.empty((len(starts), 7))
    sizes = radius, faith, slack, program.numbers, program.length
    _compiled()(len(starts), starts, ends, *sizes, program.rows, c if len(c) else np.zeros(1), scratch, out)
    return out


def _of_shape(
    expression: Expression | tuple[Shape, Any], t0: float | Array, t1: float | Array
) -> tuple[Any, Any, Array, Array, bool]:
    shape, constants = (expression.shape, expression.constants) if isinstance(expression, Expression) else expression
    scalar = np.ndim(t0) == 0 and np.ndim(t1) == 0
    starts, ends = np.broadcast_arrays(np.atleast_1d(np.asarray(t0, float)), np.atleast_1d(np.asarray(t1, float)))
    return shape, constants, starts, ends, scalar


def enclose(
    expression: Expression | tuple[Shape, Any], t0: float | Array, t1: float | Array
) -> tuple[float | Array, float | Array]:
    """Bounds of the values of an expression on [t0, t1]; infinite where none are found.

    Parameters
    ----------
    expression : Expression, or (shape, constants)
    t0, t1 : float or arrays of one shape
        Of one interval, or of many.

    Returns
    -------
    low, high : float or arrays
        Where the expression has no value (a root of a negative number) the bounds are of its values elsewhere.
    """
    shape, constants, starts, ends, scalar = _of_shape(expression, t0, t1)
    low, high = np.full(len(starts), -math.inf), np.full(len(starts), math.inf)
    for radius in (1.1, 2.0, 5.0):
        found = models(shape, constants, starts, ends, radius, radius**-3)
        low, high = np.fmax(low, found[:, 5]), np.fmin(high, found[:, 6])
    return (float(low[0]), float(high[0])) if scalar else (low, high)


def unseen(
    expression: Expression | tuple[Shape, Any],
    t0: float | Array,
    t1: float | Array,
    degree: int,
    slack: float = SLACK,
) -> float | Array:
    """How far an expression can be from some polynomial of a degree, anywhere on [t0, t1].

    The polynomial through degree + 1 points of the interval is off by 1 + L times that at most, with L Lebesgue's
    constant of the points: 1 for two points at the ends, some 2 for good ones.

    Parameters
    ----------
    expression : Expression, or (shape, constants)
    t0, t1 : float or arrays of one shape
    degree : int
        0 or larger.
    slack : float
        For rounding, relative; 0 if the expression is not to be told from what is computed of it.

    Returns
    -------
    float or array
        Infinite where no bound is found.
    """
    shape, constants, starts, ends, scalar = _of_shape(expression, t0, t1)
    best = np.full(len(starts), math.inf)
    s = (ends - starts) / 2
    for radius in RADII:
        tail = radius ** -max(degree + 1.0, 3.0) / (1 - 1 / radius)
        found = models(shape, constants, starts, ends, radius, tail, slack)
        with np.errstate(all="ignore"):
            bound = tail * found[:, 3] + found[:, 4]
            if degree < 2:  # a parabola is off its best chord by half of its height
                bound += 0.5 * np.abs(found[:, 2]) * s**2
            if degree < 1:
                bound += np.abs(found[:, 1]) * s + 0.5 * np.abs(found[:, 2]) * s**2
                bound = np.fmin(bound, (found[:, 6] - found[:, 5]) / 2)
        best = np.fmin(best, np.where(np.isnan(bound), math.inf, bound))
    return float(best[0]) if scalar else best


@dataclass(frozen=True)
class Resolved:
    """Intervals of time on which an expression is resolved.

    Attributes
    ----------
    edges : array, shape (intervals + 1,)
        Rising times.
    whole : bool
        Whether they reach the end that was asked for: else there are too many.
    doubtful : array of bool, shape (intervals,)
        Where no bound could be had, however short the interval: the expression may do anything there.
    """

    edges: Array
    whole: bool
    doubtful: NDArray[np.bool_]


def resolved(
    expression: Expression | tuple[Shape, Any],
    start: float,
    end: float,
    allowed: float,
    degree: int,
    most: int = MOST,
) -> Resolved:
    """Intervals on each of which :func:`unseen` is at most what is allowed, rounding apart.

    Found by bisection, from left to right, so that a pulse is found however narrow it is. At the kinks of an expression
    there is no polynomial: split at them (:func:`kinks`) before.

    Parameters
    ----------
    expression : Expression, or (shape, constants)
    start, end : float
        Finite.
    allowed : float
        In the units of the expression, > 0.
    degree : int
    most : int
        Intervals that may be looked at.
    """
    shape, constants, *_ = _of_shape(expression, start, end)
    edges, doubtful, looked = [start], [], 0
    waiting = [(start, end)]  # the earliest last
    while waiting:
        batch = [waiting.pop() for _ in range(min(len(waiting), 64))]
        looked += len(batch)
        lows, highs = (np.array(x) for x in zip(*batch, strict=True))
        bounds = np.asarray(unseen((shape, constants), lows, highs, degree, 0.0))
        split: list[tuple[float, float]] = []
        for (low, high), bound in zip(batch, bounds.tolist(), strict=True):
            middle = low + (high - low) / 2
            short = high - low <= 16 * EPS * max(abs(low), abs(high)) or not low < middle < high
            if bound <= allowed or short:
                split.append((low, high))
            else:
                split += [(low, middle), (middle, high)]
        # what comes first is settled as far as it is whole
        settled = 0
        for (low, high), (first, last), bound in zip(batch, split, bounds.tolist(), strict=False):
            if (low, high) != (first, last):
                break
            edges.append(high)
            doubtful.append(not bound <= allowed)
            settled += 1
        waiting += reversed(split[settled:])
        if looked > most:
            break
    return Resolved(np.array(edges), edges[-1] == end, np.array(doubtful, dtype=bool))


@dataclass(frozen=True)
class Interval:
    """A part of the time on which an expression has no kink inside.

    Attributes
    ----------
    end : float
    kink : bool
        Whether it ends at a kink, or a jump; else it ends since the search has come no further.
    constants : array
        Of the expression and its choices, see :class:`softdyn.expression.Pieces`.
    doubtful : bool
        Whether within it kinks are too many, or too close, to be told from one another.
    """

    end: float
    kink: bool
    constants: Array
    doubtful: bool


#: Intervals after which the search for kinks tells how far it is: at first, and at most.
FIRST_LOOK, PATIENCE = 32, 4096
#: Shortest intervals, in units of rounding, on which a sign may be undecided; so many of them, and they get longer.
SHORTEST = 16.0
UNDECIDED = 256
#: So many kinks whose mean distance is below CROWDED, relative to the time so far, pile up somewhere. Intervals are not
#: halved there below CROWD, relative to it, unless MOST_CROWDED of them are not enough.
MANY, CROWDED, CROWD, MOST_CROWDED = 4096, 2.0**-32, 2.0**-28, 2**15
#: Where a run may end at any time, the search goes as far as numbers do.
FARTHEST = 1e300


def intervals(of: Pieces, constants: Sequence[float] | Array, start: float, end: float) -> Iterator[Interval]:
    """Cut the time into intervals at whose ends alone an expression has kinks, one by one, as they are asked for.

    Every zero of what decides (the argument of abs, the difference of the two of min) is enclosed: an interval has none
    where the enclosure has not, and one at most where that of the derivative has no zero; else it is halved.

    Parameters
    ----------
    of : Pieces
    constants : sequence of float
        Of the expression.
    start, end : float
        ``end`` may be infinite.
    """
    base = np.asarray(constants, dtype=float)[: of.first]

    def piece(low: float, high: float, kink: bool, doubtful: bool) -> Interval:
        middle = np.array([low + (high - low) / 2 if high < math.inf else low + 1.0])
        signs = [float(np.sign(values(switch, middle, base))[0]) for switch in of.switches]
        return Interval(high, kink, np.append(base, np.nan_to_num(signs)), doubtful)

    last = start
    if of.switches:
        search = _Search(of, base, start, min(end, FARTHEST))
        while search.waiting:
            found, frontier = search.go_on()
            for time in found:
                # of two at one time the later tells what follows
                if last < time < end and time - last > max(SHORTEST * EPS * max(abs(time), time - start), 1e-290):
                    yield piece(last, time, True, search.doubts(last, time))
                last = time if last < time < end else last
            if not found and last < frontier < min(end, FARTHEST):
                yield piece(last, frontier, False, search.doubts(last, frontier))
                last = frontier
    if last < end:
        yield piece(last, end, False, bool(of.switches) and search.doubts(last, end))


class _Search:
    """The search for the zeros of some expressions, from left to right."""

    def __init__(self, of: Pieces, constants: Array, start: float, end: float) -> None:
        self.start, self.constants = start, constants
        self.pairs = [(switch, derivative(switch)) for switch in of.switches]
        self.jumps = [any(op[:2] in (("call", "sign"), ("call", "step")) for op in one) for one in of.switches]
        self.waiting = [(start, end)]  # the earliest last
        self.shortest, self.undecided = SHORTEST, 0
        self.patience = FIRST_LOOK
        self.crossed, self.since = 0, start
        self.crowd, self.crowded = 0.0, 0
        self.doubtful: list[tuple[float, float]] = []

    def doubts(self, low: float, high: float) -> bool:
        """Whether there are times in a part of the time, later than those asked for before, that are in doubt."""
        self.doubtful = [span for span in self.doubtful if span[1] > low]
        return any(span[0] < high for span in self.doubtful)

    def go_on(self) -> tuple[list[float], float]:
        """Zeros in the next part of the time, and where that ends."""
        alone: list[list[tuple[Array, Array]]] = [[] for _ in self.pairs]  # intervals that hold one zero at most
        looked, frontier = 0, self.start
        while self.waiting and looked < self.patience:
            batch = [self.waiting.pop() for _ in range(min(len(self.waiting), self.patience // 8, 64))]
            looked += len(batch)
            low, high = (np.array(x) for x in zip(*batch, strict=True))
            least = self.shortest * EPS * np.maximum(np.abs(low), np.abs(high - self.start))
            short = high - low <= np.maximum(least, self.crowd * (low - self.start))
            open_ = self._open(low, high)
            settled = len(batch) if not (open_ & ~short).any() else int(np.argmax(open_ & ~short))
            if settled:
                for ends in alone:
                    ends.append((low[:settled], high[:settled]))
                frontier = batch[settled - 1][1]
                self._doubt(low[:settled], high[:settled], (open_ & short)[:settled])
            for i in range(len(batch) - 1, settled - 1, -1):
                a, b = batch[i]
                middle = self._middle(a, b)
                self.waiting += [(middle, b), (a, middle)] if open_[i] and not short[i] else [(a, b)]
        self.patience = min(2 * self.patience, PATIENCE)
        found: set[float] = set()
        for (shape, _), those in zip(self.pairs, alone, strict=True):
            if those:
                found |= {*self._crossings(shape, *(np.concatenate(ends) for ends in zip(*those, strict=True)))}
        self._pile_up(len(found), frontier)
        return sorted(found), frontier

    def _doubt(self, low: Array, high: Array, undecided: NDArray[np.bool_]) -> None:
        """Keep the intervals too short to be halved again; after many of them, they need be less short."""
        if self.crowd or self.shortest > SHORTEST:  # else a kink is where the sign changes, to rounding
            self.doubtful += zip(low[undecided].tolist(), high[undecided].tolist(), strict=True)
        count = int(undecided.sum())
        if self.crowd:
            self.crowded += count
            if self.crowded > MOST_CROWDED:
                self.crowd, self.crowded = 32 * self.crowd, 0
            return
        self.undecided += count
        if self.undecided > UNDECIDED:
            self.shortest, self.undecided = 1024 * self.shortest, 0

    def _pile_up(self, found: int, frontier: float) -> None:
        """See whether kinks pile up, or no longer do."""
        self.crossed += found
        passed = frontier - self.start
        last = self.doubtful[-1][1] if self.doubtful else self.since
        if self.crowd and frontier - max(last, self.since) > MANY * self.crowd * passed:
            self.crowd, self.crowded = 0.0, 0
            self.crossed, self.since = 0, frontier
        elif self.crossed >= MANY:
            if not self.crowd and frontier - self.since < CROWDED * self.crossed * passed:
                self.crowd = CROWD
            self.crossed, self.since = 0, frontier

    def _middle(self, low: float, high: float) -> float:
        """Of an interval that spans many orders of magnitude from the start on, by their logarithm."""
        a, b = low - self.start, high - self.start
        if not b > 1e3 * a or b < 1e-290:
            return low + (high - low) / 2
        middle = self.start + (math.sqrt(a) * math.sqrt(b) if a > 0 else 1e-10 * b)
        return middle if low < middle < high else low + (high - low) / 2

    def _open(self, low: Array, high: Array) -> NDArray[np.bool_]:
        """Whether one of the expressions may have more than one zero, or jump between two."""
        zeros = [self._zero(shape, low, high) for shape, _ in self.pairs]
        open_ = np.zeros(len(low), dtype=bool)
        for k, (_, slope) in enumerate(self.pairs):
            undecided = zeros[k].copy()
            if undecided.any():
                those = (slope, self.constants), low[undecided], high[undecided]
                least, most = (np.asarray(x) for x in enclose(*those))
                undecided[undecided] = (least <= 0) & (most >= 0)
            if self.jumps[k]:
                undecided |= zeros[k] & np.any([zeros[i] for i in range(len(zeros)) if i != k], axis=0)
            open_ |= undecided
        return open_

    def _zero(self, shape: Shape, low: Array, high: Array) -> NDArray[np.bool_]:
        """Whether an expression may vanish, but not all the time."""
        below, above = (np.asarray(x) for x in enclose((shape, self.constants), low, high))
        return np.asarray((below <= 0) & (above >= 0) & ~(np.maximum(-below, above) < 1e-300))

    def _crossings(self, shape: Shape, low: Array, high: Array) -> list[float]:
        """The first times at which the sign is another, of intervals that hold one at most."""
        early = values(shape, low, self.constants) < 0
        changes = early != (values(shape, high, self.constants) < 0)
        low, high, early = low[changes], high[changes], early[changes]
        while len(low):
            middle = low + (high - low) / 2
            inside = (low < middle) & (middle < high)
            if not inside.any():
                break
            same = (values(shape, middle, self.constants) < 0) == early
            low, high = np.where(inside & same, middle, low), np.where(inside & ~same, middle, high)
        ends: list[float] = high.tolist()
        return ends


def kinks(expression: Expression | tuple[Shape, Any], start: float, end: float) -> tuple[Array, bool]:
    """Times between two at which an expression has a kink or a jump, to the last digit; and whether all are certain.

    Parameters
    ----------
    expression : Expression, or (shape, constants)
        Of time.
    start, end : float
        Times.
    """
    shape, constants, *_ = _of_shape(expression, start, end)
    found = list(intervals(pieces(shape), constants, start, end))
    return np.array([one.end for one in found if one.kink]), not any(one.doubtful for one in found)
