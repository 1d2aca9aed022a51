"""The one form of every kernel, of pairs, of contacts, of elements: everything that a template sees.

Input: equations with what a scene does not need left out, and what the code around them provides. Output: a
:class:`KernelIR`, plain text and numbers.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from softdyn.derive.printing import KINDS, Assignment, operations
from softdyn.derive.rules import Saving

#: Names in expressions that are numbers.
NUMBERS = frozenset({"nan", "inf"})


@dataclass(frozen=True)
class Function:
    """Straight-line code with its signature.

    Attributes
    ----------
    takes : tuple of str
        What the code around provides, and this uses.
    reads : mapping from str to tuple of (str, int)
        Of each array of the kernel the entries that this uses: their names here, and their places.
    gives : tuple of str
        What is asked of it.
    lines : tuple of (str, str)
        Assignments, in order: a name, and an expression in the subset of Python that all targets share.
    operations : dict
        How many, by kind.
    """

    takes: tuple[str, ...]
    reads: Mapping[str, tuple[tuple[str, int], ...]]
    gives: tuple[str, ...]
    lines: tuple[Assignment, ...]
    operations: dict[str, int]


@dataclass(frozen=True)
class Provenance:
    """Where a kernel comes from.

    Attributes
    ----------
    title : str
        What it is a kernel of.
    source : str
        Where that is published.
    declared : str
        What kind of thing was declared: "law", "form".
    fingerprint : str
        Its digest.
    declaration : tuple of (str, str)
        What was declared: names and expressions.
    fixed : tuple of (str, str)
        Parameters that are numbers in the text.
    sympy_version : str
        Empty if sympy had no part in it.
    """

    title: str
    source: str = ""
    declared: str = ""
    fingerprint: str = ""
    declaration: tuple[tuple[str, str], ...] = ()
    fixed: tuple[tuple[str, str], ...] = ()
    sympy_version: str = ""


@dataclass(frozen=True)
class KernelIR:
    """Everything a template sees.

    Attributes
    ----------
    kind : str
        Name of its templates: "pair", "contacts", "elements", "enclosures".
    name : str
        Prefix of the generated functions.
    provenance : Provenance
    arrays : mapping from str to tuple of str
        What the arrays hold from which functions read, in order.
    functions : mapping from str to Function
    settings : mapping
        What else the algorithm around these functions has to know.
    savings : tuple of Saving
        What each rule of specialisation saved.
    """

    kind: str
    name: str
    provenance: Provenance
    arrays: Mapping[str, tuple[str, ...]]
    functions: Mapping[str, Function]
    settings: Mapping[str, Any]
    savings: tuple[Saving, ...]


def function(
    lines: Sequence[Assignment], gives: Iterable[str], given: Iterable[str], arrays: Mapping[str, Sequence[str]]
) -> Function:
    """Put a signature before straight-line code.

    Parameters
    ----------
    lines : sequence of (str, str)
    gives : iterable of str
        What is asked of it. Without code the template has something else in its place.
    given : iterable of str
        What the code around can provide, in the order of the signature.
    arrays : mapping from str to sequence of str
        Names in the code of what the arrays hold.

    Raises
    ------
    AssertionError
        If nothing provides a name that the code uses.
    """
    known: set[str] = set()
    free: set[str] = set()
    for name, text in lines:
        free |= names_in(text) - known
        known.add(name)
    reads = {array: tuple((name, i) for i, name in enumerate(names) if name in free) for array, names in arrays.items()}
    takes = tuple(name for name in given if name in free)
    unknown = free.difference(takes, *(names for names in arrays.values()))
    assert not unknown, f"nothing provides {', '.join(sorted(unknown))} to the code of {', '.join(gives)}"
    return Function(takes, reads, tuple(gives), tuple(lines), operations(lines))


def names_in(text: str) -> set[str]:
    """Names of variables in an expression of straight-line code."""
    tree = ast.parse(text, mode="eval")
    called = {node.func.id for node in ast.walk(tree) if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)}
    return {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)} - called - NUMBERS


def operations_of(ir: KernelIR) -> dict[str, dict[str, int]]:
    """Operations of each function, by kind."""
    return {name: function.operations for name, function in ir.functions.items()}


def total_operations(ir: KernelIR) -> int:
    """All operations of a kernel's functions."""
    return sum(counts[kind] for counts in operations_of(ir).values() for kind in KINDS)
