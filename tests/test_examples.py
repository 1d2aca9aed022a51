"""Every public function has an example, and it runs."""

from __future__ import annotations

import doctest
import inspect
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

#: What the reference of Python shows; functions of a room may be used by their names in its examples.
ROOMS = (
    "softdyn",
    "softdyn.derive",
    "softdyn.elements",
    "softdyn.fluid",
    "softdyn.particles",
    "softdyn.suspension",
)
#: Examples that others go on from come first.
FIRST = ("get_element_kernel", "assembly", "read_scene", "simulate")


def public(room: str) -> dict[str, Any]:
    """What a room offers, by name."""
    module = import_module(room)
    own = [name for name, value in vars(module).items() if getattr(value, "__module__", "") == room and name[0] != "_"]
    return {name: getattr(module, name) for name in getattr(module, "__all__", own)}


def functions(room: str) -> dict[str, Any]:
    named = {name: value for name, value in public(room).items() if inspect.isfunction(inspect.unwrap(value))}
    order = [*(name for name in FIRST if name in named), *(name for name in named if name not in FIRST)]
    return {name: named[name] for name in order}


@pytest.mark.parametrize("room", ROOMS)
def test_every_public_function_has_an_example(room: str) -> None:
    found = functions(room)
    assert found
    assert [name for name, function in found.items() if ">>>" not in (inspect.getdoc(function) or "")] == []


@pytest.mark.slow
@pytest.mark.parametrize("room", ROOMS)
def test_the_examples_of_a_room_run(room: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One after another, as somebody types them in, in a folder of their own."""
    monkeypatch.chdir(tmp_path)
    world = dict(public(room))
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    told: list[str] = []
    for name, function in functions(room).items():
        text = inspect.getdoc(function) or ""
        example = doctest.DocTestParser().get_doctest(text, world, f"{room}.{name}", None, None)
        runner.run(example, out=told.append, clear_globs=False)
        world = example.globs
    assert runner.summarize(verbose=False).failed == 0, "".join(told)
