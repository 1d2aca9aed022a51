"""Completion of commands in a shell: of options, of stock laws, closures and scenes, of keys, of files.

``pip install 'softdyn[completion]'``, and in bash or zsh ``eval "$(register-python-argcomplete softdyn)"``. Nothing is
imported, and no command is slower, unless a shell asks.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterator

#: What a shell sets when it asks.
ASKED = "_ARGCOMPLETE"


def complete(parser: argparse.ArgumentParser) -> None:
    """Answer a shell that asks what may come next, and end; return at once if none does."""
    if ASKED not in os.environ:
        return
    try:
        import argcomplete
    except ImportError:
        return
    add_completers(parser)
    argcomplete.autocomplete(parser)


def add_completers(parser: argparse.ArgumentParser) -> None:
    """Tell each argument what it takes."""
    from argcomplete.completers import FilesCompleter

    takes: dict[object, tuple[Callable[[], Iterator[str]], tuple[str, ...]]] = {
        "LAW": (_laws, ("py",)),
        "SCENE": (_scenes, ("toml",)),
        "KEY": (_keys, ()),
        "NAME": (_scenes, ()),
        "RESULT": (_nothing, ("npz", "json")),
    }
    for action in _arguments(parser):
        if action.metavar in takes and not action.option_strings:
            names, endings = takes[action.metavar]
            action.completer = _Completer(names, FilesCompleter(endings) if endings else None)  # type: ignore[attr-defined]


class _Completer:
    """Names that softdyn has, and files."""

    def __init__(self, names: Callable[[], Iterator[str]], files: Callable[..., object] | None) -> None:
        self.names, self.files = names, files

    def __call__(self, prefix: str, **given: object) -> list[str]:
        found = [name for name in self.names() if name.startswith(prefix)]
        files = self.files(prefix, **given) if self.files is not None else []
        return [*found, *files]  # type: ignore[misc]


def _arguments(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    for action in parser._actions:  # argparse tells them in no other way
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _arguments(command)
        else:
            yield action


def _laws() -> Iterator[str]:
    from softdyn.laws import stock_closures, stock_laws

    yield from stock_laws()
    yield from stock_closures()


def _scenes() -> Iterator[str]:
    from softdyn.scene.stock_scenes import stock_scenes

    yield from stock_scenes()


def _keys() -> Iterator[str]:
    from softdyn.scene.key_words import entries

    yield from dict.fromkeys(entry.row.last for entry in entries() if entry.row.last)


def _nothing() -> Iterator[str]:
    yield from ()
