"""Files of laws that go with tasks to other machines: what a task names is what was there when it was sent.

A worker has another folder, and in it no file of that name, or another one. So the text of each law file goes with
the task, with that of the files beside it that it imports; the worker keeps them in its cache, under their digest, and
finds them there. (Data that a law file reads are not among them: a law that reads some fails where they are not.)
"""

from __future__ import annotations

import os
import socket
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import TypeVar

from softdyn import cache
from softdyn.errors import SceneError
from softdyn.kernels import tool_digest
from softdyn.laws import find, in_place_of, sources_of

Task = TypeVar("Task")
Found = TypeVar("Found")


@dataclass(frozen=True)
class Sources:
    """What goes with a task.

    Attributes
    ----------
    tool : str
        Digest of what derives and writes kernels, where it was sent.
    files : mapping from str to (str, mapping from str to bytes)
        For each law file, as tasks name it, the digest of its folder, and that: names in it, with their contents. The
        first is that of the law.
    """

    tool: str
    files: Mapping[str, tuple[str, Mapping[str, bytes]]]


def digest_of(files: Mapping[str, bytes]) -> str:
    """Digest of some files with their names."""
    total = sha256()
    for name, content in files.items():
        total.update(f"{name}\n{len(content)}\n".encode() + content)
    return total.hexdigest()


def sources(laws: Iterable[str]) -> Sources:
    """What goes with tasks that name these laws.

    Raises
    ------
    SceneError
        If there is no such file, or it cannot be read.
    """
    found = {}
    for law in dict.fromkeys(laws):
        reference = find(law)
        if reference.path is None:
            continue
        home = reference.path.parent
        paths = sorted(sources_of(reference.path), key=lambda path: (path != reference.path, str(path)))
        try:
            files = {path.relative_to(home).as_posix(): path.read_bytes() for path in paths}
        except OSError as error:
            raise SceneError(f"law file {reference.path}: cannot read what it imports: {error}") from None
        found[_file_of(law)] = digest_of(files), files
    return Sources(tool_digest(), found)


def with_sources(work: Callable[[Task], Found], task: Task, given: Sources) -> Found:
    """Carry out a task where it was sent to, with the laws that it was sent with.

    Parameters
    ----------
    work : function of a task
    task : Any
    given : Sources
        Of the laws that it was sent with.

    Raises
    ------
    SceneError
        If softdyn here would write other kernels, or what came is not what was sent.
    """
    here = f"worker {socket.gethostname()}, process {os.getpid()}"
    if tool_digest() != given.tool:
        raise SceneError(
            f"{here}: its softdyn, or its sympy, is another one than that which sends the tasks, and would write other "
            "kernels: install the same on all machines"
        )
    places = {}
    for name, (digest, files) in given.files.items():
        if digest_of(files) != digest:
            raise SceneError(f"{here}: law file {name} is not what was sent: its digest is another one")
        entry = cache.read("laws", digest) or cache.publish("laws", digest, files, replace=True)
        places[name] = entry / next(iter(files))
    with in_place_of(places):
        return work(task)


def _file_of(law: str) -> str:
    """The file that a law's text names, as it is named."""
    return law.rpartition(":")[0] if ".py:" in law else law


def laws_in(content: object, home: Path) -> list[str]:
    """Texts that name law files in the content of a scene file, with its folder before them."""
    if isinstance(content, Mapping):
        return [law for value in content.values() for law in laws_in(value, home)]
    if isinstance(content, list):
        return [law for value in content for law in laws_in(value, home)]
    named = isinstance(content, str) and (content.endswith(".py") or ".py:" in content)
    return [str(home / str(content))] if named else []
