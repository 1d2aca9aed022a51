"""Expressions of time, and of place, in scene files, read by a grammar of their own.

::

    sum     = product { ("+" | "-") product }
    product = signed { ("*" | "/") signed }
    signed  = ("+" | "-") signed | power
    power   = atom [ "**" signed ]
    atom    = number | name | function "(" sum { "," sum } ")" | "(" sum ")"

A name is ``t``, ``pi``, one of the constants given with the expression, or an axis, ``x``, ``y`` or ``z``, where it may
depend on the place; nothing is ever evaluated as code. Numbers and constants are kept apart from the shape of the
expression, so that one kernel serves every expression of a shape.

A shape is a list of operations, each on the results of earlier ones; the last is the expression's value. So sums of
thousands of terms are as flat as short ones, and what occurs twice is computed once.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError


def _coth(x: float) -> float:
    return 1 / math.tanh(x)


def _sign(x: float) -> float:
    return float(x > 0) - float(x < 0)


def _step(x: float) -> float:
    return float(x >= 0)


#: ``sign(0)`` is 0, and ``step(0)`` is 1: a step has its later value at the jump.
FUNCTIONS: dict[str, Callable[..., float]] = {
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
    "exp": math.exp,
    "log": math.log,
    "sqrt": math.sqrt,
    "abs": abs,
    "sinh": math.sinh,
    "cosh": math.cosh,
    "tanh": math.tanh,
    "coth": _coth,
    "atan": math.atan,
    "min": min,
    "max": max,
    "sign": _sign,
    "step": _step,
    "heaviside": _step,
}
#: Functions of two arguments or more.
SEVERAL = ("min", "max")
#: Functions that are written as others, with how many arguments they take: smoothstep(x, a, b) is 0 up to a, 1 from b
#: on, and s^2 (3 - 2 s) between, s = (x - a)/(b - a).
COMPOSED = {"smoothstep": 3}
#: Functions with a kink or a jump where an argument vanishes, or two are equal.
KINKED = ("abs", "min", "max", "sign", "step")
#: Names under which a function is known elsewhere.
ELSEWHERE = {
    "ln": "log",
    "arctan": "atan",
    "fabs": "abs",
    "sgn": "sign",
    "signum": "sign",
    "minimum": "min",
    "maximum": "max",
    "theta": "step",
    "cot": "1/tan(...)",
    "pow": "a**b",
    "log10": "log(...)/log(10)",
    "sec": "1/cos(...)",
}
DEEPEST = 100
LONGEST = 10_000
#: Integer powers up to this one are products in the kernel; others go through pow.
LARGEST_POWER = 16

_TOKEN = re.compile(r"\s*(?:(\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?)|([A-Za-z_]\w*)|(\*\*|[-+*/(),]))")

#: ("time",), ("axis", number), ("constant", index), ("number", value), ("neg", x),
#: ("+" | "-" | "*" | "/" | "**", x, y), ("power", x, int), ("call", name, x) or ("call", name, x, y); and what follows:
#: ("select", s, x, y), x where s < 0 and else y, and ("choose", index, x, y), x where that constant is < 0 and else y,
#: with the name of a continuous function, if it stands for one: within rounding of a kink that may be what is meant.
#: x, y, s are numbers of earlier operations.
Operation = tuple[Any, ...]
#: Operations that work on no other.
LEAVES = ("time", "axis", "constant", "number")
Shape = tuple[Operation, ...]


@dataclass(frozen=True)
class Expression:
    """A parsed expression: its shape, and the values of the numbers in it, in order."""

    text: str
    shape: Shape
    constants: tuple[float, ...]

    @property
    def of_time(self) -> bool:
        """Whether t appears in it."""
        return ("time",) in self.shape

    @property
    def of_place(self) -> bool:
        """Whether x, y or z appears in it."""
        return any(operation[0] == "axis" for operation in self.shape)


def parse(text: str, constants: Mapping[str, float] | None = None, axes: str = "") -> Expression:
    """Parse an expression of t.

    Parameters
    ----------
    text : str
    constants : mapping from str to float, optional
        Named constants that the expression may use.
    axes : str
        "xy" or "xyz", where it may depend on the place.

    Raises
    ------
    SceneError
        Where the text leaves the grammar, with the position.
    """
    return _Parser(text, dict(constants or {}), axes).parse()


def evaluate(expression: Expression, t: float) -> float:
    """Value at time t, in plain Python: nan where the expression has none."""
    try:
        return float(_scalar(expression.shape, t, expression.constants))
    except (ValueError, ZeroDivisionError, OverflowError, TypeError):
        return math.nan


_PLAIN: dict[str, Callable[[Any, Any], Any]] = {
    "+": lambda x, y: x + y,
    "-": lambda x, y: x - y,
    "*": lambda x, y: x * y,
    "/": lambda x, y: x / y,
    "**": math.pow,  # refuses what would be complex
}


def _scalar(shape: Shape, t: float, constants: Sequence[float]) -> Any:
    found: list[Any] = []
    for kind, *parts in shape:
        if kind == "time":
            value: Any = t
        elif kind == "constant":
            value = constants[parts[0]]
        elif kind == "number":
            value = parts[0]
        elif kind == "neg":
            value = -found[parts[0]]
        elif kind == "power":
            value = found[parts[0]] ** parts[1]
        elif kind == "call":
            value = FUNCTIONS[parts[0]](*(found[x] for x in parts[1:]))
        elif kind == "select":
            value = found[parts[1]] if found[parts[0]] < 0 else found[parts[2]]
        elif kind == "choose":
            value = found[parts[1]] if constants[parts[0]] < 0 else found[parts[2]]
        else:
            value = _PLAIN[kind](found[parts[0]], found[parts[1]])
        found.append(value)
    return found[-1]


_NUMPY: dict[str, Callable[..., Any]] = {
    "atan": np.arctan,
    "coth": lambda x: 1 / np.tanh(x),
    "min": np.minimum,
    "max": np.maximum,
    "step": lambda x: np.where(x >= 0, 1.0, 0.0),
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
    "**": np.power,
}


def values(
    shape: Shape,
    t: NDArray[np.float64],
    constants: Sequence[float] | NDArray[np.float64],
    places: Sequence[NDArray[np.float64]] = (),
) -> NDArray[np.float64]:
    """Values of an expression at many times, or places, an array for each axis; nan where it has none.

    Parameters
    ----------
    shape : Shape
        Operations of the expression.
    t : array of float
        Times, of any shape, which that of the values is.
    constants : sequence of float
        What the shape names by number.
    places : sequence of arrays
        Coordinates along each axis, of the same shape.
    """
    found: list[Any] = []
    with np.errstate(all="ignore"):
        for kind, *parts in shape:
            if kind == "time":
                value: Any = t
            elif kind == "axis":
                value = places[parts[0]]
            elif kind == "constant":
                value = np.float64(constants[parts[0]])
            elif kind == "number":
                value = np.float64(parts[0])
            elif kind == "neg":
                value = -found[parts[0]]
            elif kind == "power":
                value = found[parts[0]] ** parts[1]
            elif kind == "call":
                name = parts[0]
                value = (_NUMPY.get(name) or getattr(np, name))(*(found[x] for x in parts[1:]))
            elif kind == "select":
                value = np.where(found[parts[0]] < 0, found[parts[1]], found[parts[2]])
            elif kind == "choose":
                value = found[parts[1]] if constants[parts[0]] < 0 else found[parts[2]]
            else:
                value = _NUMPY[kind](found[parts[0]], found[parts[1]])
            found.append(value)
        return np.broadcast_to(found[-1], np.broadcast_shapes(np.shape(t), *map(np.shape, places))).astype(float)


class Builder:
    """Puts operations into a list, each once, and leaves out what is known: sums with 0, products with 1."""

    def __init__(self, shape: Shape = ()) -> None:
        self.operations: list[Operation] = []
        self.places: dict[Operation, int] = {}
        for operation in shape:
            self.add(*operation)

    def add(self, *operation: Any) -> int:
        """Return the number of an operation, new or known."""
        if operation not in self.places:
            self.places[operation] = len(self.operations)
            self.operations.append(operation)
        return self.places[operation]

    def number(self, value: float) -> int:
        """Return the number of a literal."""
        return self.add("number", float(value))

    def _is(self, x: int, value: float) -> bool:
        return self.operations[x] == ("number", value)

    def plus(self, x: int, y: int) -> int:
        """Sum."""
        return y if self._is(x, 0.0) else x if self._is(y, 0.0) else self.add("+", x, y)

    def minus(self, x: int, y: int) -> int:
        """Difference."""
        return x if self._is(y, 0.0) else self.negated(y) if self._is(x, 0.0) else self.add("-", x, y)

    def times(self, x: int, y: int) -> int:
        """Product."""
        if self._is(x, 0.0) or self._is(y, 0.0):
            return self.number(0.0)
        return y if self._is(x, 1.0) else x if self._is(y, 1.0) else self.add("*", x, y)

    def over(self, x: int, y: int) -> int:
        """Quotient."""
        return x if self._is(x, 0.0) or self._is(y, 1.0) else self.add("/", x, y)

    def negated(self, x: int) -> int:
        """Negative."""
        return x if self._is(x, 0.0) else self.add("neg", x)

    def power(self, x: int, n: int) -> int:
        """Integer power, 1 or larger."""
        return x if n == 1 else self.add("power", x, n)

    def select(self, s: int, x: int, y: int) -> int:
        """Return x where s < 0, else y.

        Parameters
        ----------
        s, x, y : int
            Numbers of operations.
        """
        return x if x == y else self.add("select", s, x, y)

    def shape_of(self, x: int) -> Shape:
        """What one of the operations needs, and it."""
        return _needed(self.operations, (x,))[0]


def _needed(operations: Sequence[Operation], wanted: Sequence[int]) -> tuple[Shape, list[int]]:
    """Those operations on which some depend, in order, and the new numbers of these."""
    used = set(wanted)
    for i in range(len(operations) - 1, -1, -1):
        if i in used:
            used.update(operands(operations[i]))
    new: dict[int, int] = {}
    for i in sorted(used):
        new[i] = len(new)
    kept = tuple(_renumbered(operations[i], new) for i in sorted(used))
    return kept, [new[i] for i in wanted]


def operands(operation: Operation) -> tuple[int, ...]:
    """Numbers of the operations that one works on."""
    kind, *parts = operation
    if kind in LEAVES:
        return ()
    if kind == "power":
        return (parts[0],)
    if kind == "choose":
        return tuple(parts[1:3])
    return tuple(parts[1:]) if kind == "call" else tuple(parts)


def _renumbered(operation: Operation, new: Mapping[int, int] | Sequence[int]) -> Operation:
    kind, *parts = operation
    if kind in LEAVES:
        return operation
    if kind == "power":
        return (kind, new[parts[0]], parts[1])
    if kind == "choose":
        return (kind, parts[0], new[parts[1]], new[parts[2]], *parts[3:])
    if kind == "call":
        return (kind, parts[0], *(new[x] for x in parts[1:]))
    return (kind, *(new[x] for x in parts))


#: What a derivative is taken by: the time.
BY_TIME: Collection[Operation] = (("time",),)


def derivative(shape: Shape, by: Collection[Operation] = BY_TIME) -> Shape:
    """Shape of the derivative with respect to t, on the same constants; at a kink that of the later side.

    With the places of a named constant (:func:`places_of`) that with respect to the constant.
    """
    build, _, slopes = value_and_slope(shape, by)
    return build.shape_of(slopes[-1])


def places_of(name: str, text: str, constants: Mapping[str, float]) -> tuple[Operation, ...]:
    """Operations of a parsed expression that are a named constant: each place where it stands has an entry.

    Parameters
    ----------
    name : str
        Of the constant.
    text : str
        The expression.
    constants : mapping from str to float
        All that the text may name.
    """
    marked = parse(text, {**dict.fromkeys(constants, 0.0), name: math.nan})
    return tuple(("constant", i) for i, value in enumerate(marked.constants) if math.isnan(value))


def value_and_slope(shape: Shape, by: Collection[Operation] = BY_TIME) -> tuple[Builder, list[int], list[int]]:
    """All operations of a shape and of their derivatives: where the value and the derivative of each are."""
    build = Builder()
    places: list[int] = []
    slopes: list[int] = []
    slope_of: dict[int, int] = {}
    zero = build.number(0.0)
    for original in shape:
        operation = _renumbered(original, places)
        places.append(build.add(*operation))
        moves = any(slope_of[x] != zero for x in operands(operation))
        if operation in by:
            slopes.append(build.number(1.0))
        else:
            slopes.append(_slope(build, operation, places[-1], slope_of) if moves else zero)
        slope_of[places[-1]] = slopes[-1]
    return build, places, slopes


def _slope(build: Builder, operation: Operation, value: int, slope_of: Mapping[int, int]) -> int:
    """Derivative of an operation whose operands have these."""
    kind, *parts = operation
    slopes = [slope_of[x] for x in operands(operation)]
    if kind == "neg":
        return build.negated(slopes[0])
    if kind in ("+", "-"):
        return (build.plus if kind == "+" else build.minus)(*slopes)
    if kind == "*":
        return build.plus(build.times(slopes[0], parts[1]), build.times(parts[0], slopes[1]))
    if kind == "/":
        return build.over(build.minus(slopes[0], build.times(value, slopes[1])), parts[1])
    if kind == "power":
        x, n = parts
        return build.times(build.times(build.number(n), build.power(x, n - 1)), slopes[0])
    if kind == "**":
        return _slope_of_power(build, parts, slopes, value)
    if kind == "select":
        return build.select(parts[0], slopes[1], slopes[2])
    if kind == "choose":
        return slopes[0] if slopes[0] == slopes[1] else build.add("choose", parts[0], *slopes)
    return _slope_of_call(build, parts[0], parts[1:], slopes, value)


def _slope_of_power(build: Builder, parts: Sequence[int], slopes: Sequence[int], value: int) -> int:
    x, y = parts
    zero = build.number(0.0)
    if slopes[1] == zero:
        smaller = build.add("**", x, build.minus(y, build.number(1.0)))
        return build.times(build.times(y, smaller), slopes[0])
    grows = build.times(slopes[1], build.add("call", "log", x))
    if slopes[0] != zero:
        grows = build.plus(grows, build.over(build.times(y, slopes[0]), x))
    return build.times(value, grows)


def _slope_of_call(build: Builder, name: str, parts: Sequence[int], slopes: Sequence[int], value: int) -> int:
    x, one = parts[0], build.number(1.0)
    if name in ("sign", "step"):
        return build.number(0.0)
    if name == "abs":
        return build.select(x, build.negated(slopes[0]), slopes[0])
    if name in SEVERAL:
        first, second = slopes if name == "min" else reversed(slopes)
        return build.select(build.minus(*parts), first, second)
    outer = {
        "sin": lambda: build.add("call", "cos", x),
        "cos": lambda: build.negated(build.add("call", "sin", x)),
        "tan": lambda: build.plus(one, build.power(value, 2)),
        "exp": lambda: value,
        "log": lambda: build.over(one, x),
        "sqrt": lambda: build.over(build.number(0.5), value),
        "sinh": lambda: build.add("call", "cosh", x),
        "cosh": lambda: build.add("call", "sinh", x),
        "tanh": lambda: build.minus(one, build.power(value, 2)),
        "coth": lambda: build.minus(one, build.power(value, 2)),
        "atan": lambda: build.over(one, build.plus(one, build.power(x, 2))),
    }[name]()
    return build.times(outer, slopes[0])


@dataclass(frozen=True)
class Pieces:
    """An expression without kinks: between two of its kinks it is one of several smooth ones.

    Attributes
    ----------
    shape : Shape
        With a choice, -1, 0 or 1, in the place of each abs, min, max, sign and step: a constant, behind the others.
    switches : tuple of Shape
        What each choice has the sign of: steps must end where one of these becomes negative, or no longer is.
    first : int
        How many constants the expression itself has.
    """

    shape: Shape
    switches: tuple[Shape, ...]
    first: int


def pieces(shape: Shape) -> Pieces:
    """Take the kinks out of an expression."""
    build, switches = Builder(), Builder()
    places: list[int] = []
    found: list[int] = []
    timed = _timed(shape)
    count = 1 + max((operation[1] for operation in shape if operation[0] == "constant"), default=-1)
    for operation in shape:
        switches.add(*operation)

    def choice(switch: int, low: int, high: int, *name: str) -> int:
        if switch not in found:
            found.append(switch)
        return build.add("choose", count + found.index(switch), low, high, *name)

    for i, operation in enumerate(shape):
        kind, *parts = operation
        if kind != "call" or parts[0] not in KINKED or not timed[i]:
            places.append(build.add(*_renumbered(operation, places)))
            continue
        name, *those = parts[0], *(places[x] for x in parts[1:])
        if name == "abs":
            place = choice(parts[1], build.add("neg", those[0]), those[0], name)
        elif name in SEVERAL:
            low, high = those if name == "min" else reversed(those)
            place = choice(switches.add("-", *parts[1:]), low, high, name)
        else:
            place = choice(parts[1], build.number(0.0), build.number(1.0))
            if name == "sign":  # the choice itself
                place = build.add("constant", build.operations[place][1])
        places.append(place)
    return Pieces(build.shape_of(places[-1]), tuple(switches.shape_of(x) for x in found), count)


def _timed(shape: Shape) -> list[bool]:
    """Whether each operation depends on t."""
    timed: list[bool] = []
    for operation in shape:
        timed.append(operation == ("time",) or any(timed[x] for x in operands(operation)))
    return timed


def has_kinks(shape: Shape) -> bool:
    """Whether an expression has a kink or a jump at some times, which depend on the constants."""
    timed = _timed(shape)
    return any(op[0] == "call" and op[1] in KINKED and timed[i] for i, op in enumerate(shape))


class _Parser:
    """Recursive descent over the tokens of one text."""

    def __init__(self, text: str, names: dict[str, float], axes: str) -> None:
        if len(text) > LONGEST:
            raise SceneError(f"an expression of {len(text)} characters is too long; {LONGEST} are allowed")
        self.text, self.names, self.axes = text, names, axes
        self.constants: list[float] = []
        self.build = Builder()
        self.depth = 0
        self.tokens = self._tokens()
        self.next = 0

    def _tokens(self) -> list[tuple[str, str, int]]:
        tokens, at = [], 0
        end = len(self.text.rstrip())
        while at < end:
            match = _TOKEN.match(self.text, at)
            if match is None:
                at += len(self.text[at:]) - len(self.text[at:].lstrip())
                hint = "; a power is written **" if self.text[at] == "^" else ""
                raise self._error(f"{self.text[at]!r} is not part of the grammar{hint}", at)
            kind = ("number", "name", "operator")[(match.lastindex or 1) - 1]
            tokens.append((kind, match.group(match.lastindex or 1), match.start(match.lastindex or 1)))
            at = match.end()
        return [*tokens, ("end", "", end)]

    def _error(self, message: str, at: int) -> SceneError:
        shown = self.text if len(self.text) <= 120 else self.text[:120] + "..."
        return SceneError(f"expression {shown!r}, position {at + 1}: {message}")

    def _take(self, *texts: str) -> str | None:
        kind, text, _ = self.tokens[self.next]
        if kind == "operator" and text in texts:
            self.next += 1
            return text
        return None

    def parse(self) -> Expression:
        root = self._sum()
        kind, text, at = self.tokens[self.next]
        if kind != "end":
            raise self._error(f"{text!r} does not belong here; an operator or the end is expected", at)
        return Expression(self.text, self.build.shape_of(root), tuple(self.constants))

    def _constant(self, value: float) -> int:
        self.constants.append(value)
        return self.build.add("constant", len(self.constants) - 1)

    def _sum(self) -> int:
        self.depth += 1
        if self.depth > DEEPEST:
            raise self._error(f"nested more than {DEEPEST} deep", self.tokens[self.next][2])
        node = self._product()
        while operator := self._take("+", "-"):
            node = self.build.add(operator, node, self._product())
        self.depth -= 1
        return node

    def _product(self) -> int:
        node = self._signed()
        while operator := self._take("*", "/"):
            node = self.build.add(operator, node, self._signed())
        return node

    def _signed(self) -> int:
        minus = False
        while operator := self._take("+", "-"):
            minus ^= operator == "-"
        node = self._power()
        return self.build.add("neg", node) if minus else node

    def _power(self) -> int:
        base = self._atom()
        if not self._take("**"):
            return base
        kind, text, _ = self.tokens[self.next]
        after = self.tokens[self.next + 1][1] if kind == "number" else ""
        if kind == "number" and text.isdigit() and 2 <= int(text[:4]) <= LARGEST_POWER and after != "**":
            self.next += 1
            return self.build.add("power", base, int(text))
        self.depth += 1
        if self.depth > DEEPEST:
            raise self._error(f"nested more than {DEEPEST} deep", self.tokens[self.next][2])
        node = self.build.add("**", base, self._signed())
        self.depth -= 1
        return node

    def _atom(self) -> int:
        kind, text, at = self.tokens[self.next]
        self.next += 1
        if kind == "number":
            if not math.isfinite(float(text)):
                raise self._error(f"{text} is larger than a double can hold", at)
            return self._constant(float(text))
        if kind == "name":
            return self._name(text, at)
        if text == "(":
            node = self._sum()
            if not self._take(")"):
                raise self._error(
                    f"the parenthesis opened at position {at + 1} is not closed", self.tokens[self.next][2]
                )
            return node
        self.next -= 1
        found = repr(text) if text else "the end"
        raise self._error(f"{found} where a number, a name or a parenthesis is expected", at)

    def _name(self, name: str, at: int) -> int:
        called = self.tokens[self.next][1] == "("
        if name in FUNCTIONS:
            if not self._take("("):
                raise self._error(f"function {name!r} needs an argument in parentheses", at)
            return self._call(name, at)
        if called and name in COMPOSED:
            self._take("(")
            return self._composed(name, self._arguments(name), at)
        if called:
            near = [ELSEWHERE[name.lower()]] if name.lower() in ELSEWHERE else []
            near += get_close_matches(name.lower(), [*FUNCTIONS, *COMPOSED], n=1)
            hint = f"; did you mean {near[0]!r}?" if near else f"; there are {', '.join([*FUNCTIONS, *COMPOSED])}"
            raise self._error(f"unknown function {name!r}{hint}", at)
        if name == "t":
            return self.build.add("time")
        if len(name) == 1 and name in self.axes:
            return self.build.add("axis", self.axes.index(name))
        if name in self.names:
            return self._constant(float(self.names[name]))
        if name == "pi":
            return self._constant(math.pi)
        near = get_close_matches(name, [*self.names, "t", "pi", *self.axes, *FUNCTIONS, *COMPOSED], n=1)
        hint = f"; did you mean {near[0]!r}?" if near else "; define it among the constants"
        raise self._error(f"unknown name {name!r}{hint}", at)

    def _call(self, name: str, at: int) -> int:
        """Call a function, the parenthesis before its arguments being read."""
        arguments = self._arguments(name)
        if name not in SEVERAL:
            if len(arguments) > 1:
                raise self._error(f"{name!r} takes one argument, not {len(arguments)}", at)
            return self.build.add("call", "step" if name == "heaviside" else name, arguments[0])
        if len(arguments) < 2:
            raise self._error(f"{name!r} takes two arguments or more", at)
        node = arguments[0]
        for other in arguments[1:]:
            node = self.build.add("call", name, node, other)
        return node

    def _arguments(self, name: str) -> list[int]:
        """Take the arguments of a function, and the parenthesis behind them."""
        arguments = [self._sum()]
        while self._take(","):
            arguments.append(self._sum())
        if not self._take(")"):
            raise self._error(f"the argument of {name!r} is not closed", self.tokens[self.next][2])
        return arguments

    def _composed(self, name: str, arguments: Sequence[int], at: int) -> int:
        """Write smoothstep as other functions."""
        if len(arguments) != COMPOSED[name]:
            raise self._error(f"{name!r} takes {COMPOSED[name]} arguments, x, a and b, not {len(arguments)}", at)
        x, low, high = arguments
        build = self.build
        part = build.over(build.minus(x, low), build.minus(high, low))
        part = build.add("call", "max", build.add("call", "min", part, build.number(1.0)), build.number(0.0))
        return build.times(build.power(part, 2), build.minus(build.number(3.0), build.times(build.number(2.0), part)))
