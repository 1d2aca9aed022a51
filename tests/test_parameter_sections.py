"""Public functions of three or more arguments say what these are, in a section Parameters, with shapes and units."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parent.parent
#: The checker of certificates is to be read as a whole, in less than 300 lines (``test_certificates``).
SHORT = "softdyn/certificate_checker.py"


@cache
def modules() -> dict[str, ast.Module]:
    """Public modules, by their paths."""
    files = [*(ROOT / "derive").rglob("*.py"), *(ROOT / "softdyn").rglob("*.py")]
    names = {path: path.relative_to(ROOT).as_posix() for path in files}
    linked = ("softdyn/derive/", "softdyn/templates/")
    return {
        name: ast.parse(path.read_text(encoding="utf-8"))
        for path, name in names.items()
        if not name.startswith(linked)
        and name != SHORT
        and not any(part.startswith("_") for part in path.parent.parts[len(ROOT.parts) :])
    }


def functions(body: list[ast.stmt], where: tuple[ast.ClassDef, ...] = ()) -> Iterator[tuple[str, ast.FunctionDef]]:
    """Public functions of a module, and methods of its public classes, by their names."""
    for one in body:
        if isinstance(one, ast.FunctionDef) and not one.name.startswith("_"):
            yield ".".join([*(cls.name for cls in where), one.name]), one
        elif isinstance(one, ast.ClassDef) and not one.name.startswith("_"):
            for name, function in functions(one.body, (*where, one)):
                # a method that stands in for that of a base is told of there
                bases = {base.id for base in one.bases if isinstance(base, ast.Name)}
                if not any(f"{base}.{function.name}" in told() for base in bases):
                    yield name, function


@cache
def told() -> frozenset[str]:
    """Methods that have the section, as ``Mechanism.act``."""
    return frozenset(
        f"{cls.name}.{one.name}"
        for module in modules().values()
        for cls in module.body
        if isinstance(cls, ast.ClassDef)
        for one in cls.body
        if isinstance(one, ast.FunctionDef) and has_section(one)
    )


def has_section(function: ast.FunctionDef) -> bool:
    return "Parameters\n----------\n" in (ast.get_docstring(function) or "")


def is_overload(function: ast.FunctionDef) -> bool:
    return any(isinstance(one, ast.Name) and one.id == "overload" for one in function.decorator_list)


def count(function: ast.FunctionDef) -> int:
    """Number of the arguments, without self and cls."""
    of = function.args
    names = [one.arg for one in (*of.posonlyargs, *of.args, *of.kwonlyargs, of.vararg, of.kwarg) if one is not None]
    return len(names) - (names[:1] in (["self"], ["cls"]))


def test_public_functions_say_what_they_take() -> None:
    lacking = [
        f"{module}: {name}"
        for module, tree in modules().items()
        for name, function in functions(tree.body)
        if count(function) >= 3 and not is_overload(function) and not has_section(function)
    ]
    assert not lacking, lacking
