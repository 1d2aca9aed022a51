"""Straight-line code of what drives a pair, an expression of time.

Input: an expression's shape (:mod:`softdyn.expression`), a list of operations. Output: an assignment for each of them,
and the expression as its enclosure takes it. Numbers are entries of the array ``c``, so that a kernel serves all
expressions of one shape, and no hostile number is ever evaluated symbolically.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from softdyn.derive.printing import Assignment
from softdyn.enclosure import program_of
from softdyn.expression import Shape, derivative, operands, pieces, value_and_slope

#: Longer texts of an expression are not shown.
LONGEST_TEXT = 200
_CALLS = {
    "abs": "fabs({0})",
    "coth": "1.0 / tanh({0})",
    "min": "({0} if {0} < {1} else {1})",
    "max": "({0} if {0} > {1} else {1})",
    "sign": "(1.0 if {0} > 0.0 else (-1.0 if {0} < 0.0 else 0.0))",
    "step": "(1.0 if {0} >= 0.0 else 0.0)",
}


@dataclass(frozen=True)
class DriveCode:
    """What a kernel holds of an expression.

    Attributes
    ----------
    force : list of (name, text)
        Of its value and rate, ``F`` and ``dF_dt``, as they are at any time.
    given : list of (name, text)
        Of that of these two which the integration needs, smooth between the kinks by choices, constants of their own.
    constants : int
        How many constants there are, choices among them.
    program : tuple of float
        The same as its enclosure takes it.
    numbers : int
        Operations of the program that are numbers.
    text : str
    """

    force: list[Assignment] = field(default_factory=list)
    given: list[Assignment] = field(default_factory=list)
    constants: int = 1
    program: tuple[float, ...] = ()
    numbers: int = 0
    text: str = ""


def drive_code(shape: Shape, value: bool) -> DriveCode:
    """Code of an expression; ``value`` tells whether the integration needs its value, or else its rate."""
    build, places, slopes = value_and_slope(shape)
    smooth = pieces(shape)
    needed = smooth.shape if value else derivative(smooth.shape)
    program = program_of(needed)
    return DriveCode(
        force=_lines(build.operations, {"F": places[-1], "dF_dt": slopes[-1]}),
        given=_lines(needed, {"F" if value else "dF_dt": len(needed) - 1}),
        constants=max(1, smooth.first + len(smooth.switches)),
        program=tuple(program.rows.tolist()),
        numbers=program.numbers,
        text=_shown(shape),
    )


def _lines(operations: Sequence[tuple[Any, ...]], wanted: dict[str, int]) -> list[Assignment]:
    """An assignment for each operation that is needed, and for what is wanted."""
    used = set(wanted.values())
    for i in range(len(operations) - 1, -1, -1):
        if i in used:
            used.update(operands(operations[i]))
    lines: list[Assignment] = []
    names: dict[int, str] = {}
    for i in sorted(used):
        names[i] = _name(operations[i], i)
        if names[i] == f"x{i}":
            lines += _assigned(operations[i], names[i], [names[x] for x in operands(operations[i])])
    return [*lines, *((name, names[i]) for name, i in wanted.items())]


def _name(operation: tuple[Any, ...], i: int) -> str:
    kind, *parts = operation
    if kind == "time":
        return "t"
    if kind == "constant":
        return f"c[{parts[0]}]"
    if kind == "number":
        return repr(parts[0]) if parts[0] >= 0 else f"({parts[0]!r})"
    return f"x{i}"


def _assigned(operation: tuple[Any, ...], name: str, those: Sequence[str]) -> list[Assignment]:
    kind, *parts = operation
    if kind == "neg":
        return [(name, f"-{those[0]}")]
    if kind == "power":
        return _power(name, those[0], parts[1])
    if kind == "**":
        return [(name, f"pow({those[0]}, {those[1]})")]
    if kind == "select":
        return [(name, f"({those[1]} if {those[0]} < 0.0 else {those[2]})")]
    if kind == "choose" and len(parts) > 3:
        # continuous: the function itself, lest the root of abs is one of a negative number within rounding of a kink
        return [(name, _CALLS[parts[3]].format(*(those[1:] if parts[3] == "abs" else those)))]
    if kind == "choose":
        return [(name, f"({those[0]} if c[{parts[0]}] < 0.0 else {those[1]})")]
    if kind == "call":
        return [(name, _CALLS.get(parts[0], parts[0] + "({0})").format(*those))]
    return [(name, f"{those[0]} {kind} {those[1]}")]


def _power(name: str, base: str, n: int) -> list[Assignment]:
    """Products: of powers half as high, each computed once."""
    lines: list[Assignment] = []
    found = {1: base}

    def power(k: int) -> str:
        if k not in found:
            low, high = power(k // 2), power(k - k // 2)
            found[k] = name if k == n else f"{name}_p{k}"
            lines.append((found[k], f"{high} * {low}"))
        return found[k]

    power(n)
    return lines


def _shown(shape: Shape) -> str:
    """An expression as text, unless it is long."""
    texts: list[str] = []
    for operation in shape:
        kind, *parts = operation
        those = [texts[x] for x in operands(operation)]
        if any(not text for text in those) or sum(map(len, those)) > LONGEST_TEXT:
            texts.append("")
        elif kind == "power":
            texts.append(f"{those[0]}**{parts[1]}")
        elif kind == "call":
            texts.append(f"{parts[0]}({', '.join(those)})")
        elif kind == "neg":
            texts.append(f"(-{those[0]})")
        elif those:
            texts.append(f"({those[0]} {kind} {those[1]})")
        else:
            texts.append(_name(operation, 0).replace("[", "").replace("]", ""))
    found = texts[-1]
    if not found:
        return f"an expression of {len(shape)} operations"
    return found[1:-1] if found.startswith("(") and shape[-1][0] not in ("power", "call") else found
