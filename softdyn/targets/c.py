"""Target C: compile with the machine's compiler, load with ctypes."""

from __future__ import annotations

import ctypes
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from softdyn.errors import CompileError, lacks_memory
from softdyn.targets import LoadError, Signatures

SUFFIX = ".c"
#: Types of arguments and results, as the shared subset of Python names them.
TYPES: dict[str, Any] = {"int": ctypes.c_int64, "float": ctypes.c_double, "None": None}
TYPES |= dict.fromkeys(("array", "indices", "short_indices", "integers"), ctypes.c_void_p)
#: IEEE arithmetic throughout: no -ffast-math. Contraction to fused operations is off, so that every machine and both
#: targets round alike; math functions need not set errno.
FLAGS = ("-std=c99", "-O3", "-fPIC", "-shared", "-ffp-contract=off", "-fno-math-errno")
COMPILERS = ("cc", "gcc", "clang")
TIMEOUT = 120
#: Macros by which a compiler says that its arithmetic is not that of IEEE 754, however it came to be asked for it.
NOT_IEEE = (
    "__FAST_MATH__",
    "__FINITE_MATH_ONLY__",
    "__ASSOCIATIVE_MATH__",
    "__RECIPROCAL_MATH__",
    "__NO_SIGNED_ZEROS__",
)
#: Flags that ask for it, of which some compilers tell nothing in their macros.
FAST_FLAGS = frozenset(
    "-Ofast -ffast-math -funsafe-math-optimizations -ffinite-math-only -fassociative-math -freciprocal-math -mrecip "
    "-fno-signed-zeros -fno-honor-nans -fno-honor-infinities -fapprox-func -ffp-model=fast -fp-model=fast".split()
)
#: Loads a library and looks functions up, in a process of its own: one that is cut short kills the process.
TRIAL = "import ctypes, sys; library = ctypes.CDLL(sys.argv[1]); [getattr(library, name) for name in sys.argv[2:]]"


#: What there is not enough memory for.
NO_ROOM = "a kernel cannot be loaded"


def translate(body: str) -> str:
    """C text of what is written in the shared subset of Python."""
    from softdyn.derive.translate import to_c

    return to_c(body)


@cache
def compiler() -> tuple[str, ...] | None:
    """Return the command of the C compiler, from $CC or the usual names; None if there is none."""
    if os.environ.get("CC"):
        command = words_of_command(os.environ["CC"])
        return tuple(command) if command and shutil.which(command[0]) else None
    if sys.platform == "win32":
        return None  # the usual compilers there take other flags
    found = next((path for name in COMPILERS if (path := shutil.which(name))), None)
    return (found,) if found else None


def words_of_command(command: str) -> list[str]:
    r"""Words of a command; on Windows \ parts folders, and escapes nothing."""
    if sys.platform != "win32":
        return shlex.split(command)
    return [word.strip('"') for word in shlex.split(command, posix=False)]


def available() -> bool:
    """Whether this machine can build the target."""
    return compiler() is not None


def identity() -> dict[str, Any]:
    """Return compiler, flags, ABI and the instruction set that they select.

    The predefined macros name the compiler's version and every instruction set that -march=native turns on, so a
    kernel built on one machine is not loaded on another that lacks an instruction.
    """
    command = compiler()
    if command is None:
        raise CompileError(
            f"target 'c' needs a C compiler: none of {', '.join(COMPILERS)} is on PATH, and CC is "
            f"{os.environ.get('CC') or 'not set'}; install one, or use target 'numba'"
        )
    return identity_of(command, FLAGS)


@cache
def identity_of(command: tuple[str, ...], wanted: tuple[str, ...], language: str = "c") -> dict[str, Any]:
    """Return what a compiler of C, or of C++, makes of a text, besides the text.

    Parameters
    ----------
    command : tuple of str
        That calls the compiler.
    wanted : tuple of str
        Flags.
    language : "c" or "c++"

    Raises
    ------
    CompileError
        If it does not work, or its arithmetic is not that of IEEE 754.
    """
    for extra in (("-march=native",), ()):
        flags = (*wanted, *extra)
        probe = run([*command, *(f for f in flags if f != "-shared"), "-dM", "-E", "-x", language, os.devnull])
        if probe.returncode == 0:
            _require_ieee(command, probe.stdout)
            abi = [sys.platform, platform.machine(), ctypes.sizeof(ctypes.c_void_p)]
            return {"command": list(command), "flags": list(flags), "abi": abi, "macros": probe.stdout}
    raise CompileError(f"the C compiler does not work:\n  {shlex.join(probe.args)}\n{words_of(probe)}")


def _require_ieee(command: tuple[str, ...], macros: str) -> None:
    """Refuse a compiler that was told to treat numbers as if they were real ones."""
    defined = dict(line.split(maxsplit=2)[1:] for line in macros.splitlines() if len(line.split()) >= 3)
    found = [f for f in command if f in FAST_FLAGS] or [m for m in NOT_IEEE if defined.get(m, "0").strip() != "0"]
    if found:
        raise CompileError(
            f"the kernels rely on IEEE arithmetic, and the C compiler is told otherwise ({', '.join(found)}):\n"
            f"  {shlex.join(command)}\nset CC to a compiler without -ffast-math and the flags that it stands for"
        )


def run(command: list[str]) -> subprocess.CompletedProcess[str]:
    """Run a compiler, and return what it says."""
    try:
        return subprocess.run(
            command,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=TIMEOUT,
            stdin=subprocess.DEVNULL,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise CompileError(f"could not run the C compiler:\n  {shlex.join(command)}\n{error}") from None


def words_of(done: subprocess.CompletedProcess[str]) -> str:
    """What a compiler has said."""
    return (done.stderr + done.stdout).strip() or f"(it printed nothing, and exited with {done.returncode})"


def build(name: str, source: str, made_by: Mapping[str, Any], functions: Sequence[str] = ()) -> dict[str, bytes]:
    """Compile a kernel, and see that it loads.

    Parameters
    ----------
    name : str
        Of the kernel.
    source : str
    made_by : mapping
        As :func:`identity` returns it.
    functions : sequence of str
        That the kernel must have.

    Raises
    ------
    CompileError
        With the command and the compiler's own words.
    """
    with tempfile.TemporaryDirectory(prefix="softdyn-") as scratch:
        text, library = Path(scratch, f"{name}.c"), Path(scratch, f"{name}.so")
        try:
            text.write_text(source, encoding="utf-8")
        except OSError as error:
            raise CompileError(f"cannot write {text}: {error.strerror}") from None
        command = [*made_by["command"], *made_by["flags"], "-o", str(library), str(text), "-lm"]
        done = run(command)
        if done.returncode != 0 or not library.is_file():
            raise CompileError(f"the C compiler failed:\n  {shlex.join(command)}\n{words_of(done)}")
        fault = _fault_of(library, [f"{name}_{function}" for function in functions])
        if lacks_memory(fault):
            raise MemoryError(NO_ROOM)
        if fault:
            raise CompileError(f"the C compiler made a library that does not load:\n  {shlex.join(command)}\n{fault}")
        return {f"{name}.c": source.encode(), f"{name}.so": library.read_bytes()}


def _fault_of(library: Path, names: Sequence[str]) -> str:
    """What a process says that loads a library and looks these names up; empty if all is well."""
    if not sys.executable:
        return ""  # embedded: it is loaded here, and may end this process
    command = [sys.executable, "-I", "-S", "-c", TRIAL, str(library), *names]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, errors="replace", timeout=TIMEOUT, stdin=subprocess.DEVNULL
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"{error}"
    if done.returncode < 0:
        return f"the process that loads it is ended by signal {-done.returncode}"
    return done.stderr.strip().splitlines()[-1] if done.returncode and done.stderr.strip() else ""


def check(folder: Path, name: str, functions: Sequence[str]) -> None:
    """See that a kernel that was not seen to load does so.

    Parameters
    ----------
    folder : Path
        Of the entry.
    name : str
        Of the kernel.
    functions : sequence of str
        That it must have.

    Raises
    ------
    LoadError
    """
    fault = _fault_of(folder / f"{name}.so", [f"{name}_{function}" for function in functions])
    if lacks_memory(fault):
        raise MemoryError(NO_ROOM)
    if fault:
        raise LoadError(f"cannot load the kernel {folder / name}.so: {fault}")


def _passed(array: np.ndarray) -> Any:
    """An array as C takes it. ndarray.ctypes.data takes three times as long, and a short call hardly longer."""
    try:
        return ctypes.byref(ctypes.c_char.from_buffer(array))  # type: ignore[arg-type]
    except (TypeError, ValueError, BufferError):  # read-only, or empty
        return array.ctypes.data


def library_of(folder: Path, name: str) -> ctypes.CDLL:
    """Load a kernel's shared library.

    Raises
    ------
    LoadError
    MemoryError
    """
    try:
        return ctypes.CDLL(str(folder / f"{name}.so"))
    except OSError as error:
        if lacks_memory(error):  # no fault of the library's
            raise MemoryError(NO_ROOM) from None
        raise LoadError(f"cannot load the kernel {folder / name}.so: {error}") from None


def function_of(library: ctypes.CDLL, name: str, result: Any, *types: Any) -> Any:
    """Function of a kernel's library.

    Parameters
    ----------
    library : ctypes.CDLL
    name : str
    result, types : types of ctypes
        Of what it returns, and of its arguments.

    Raises
    ------
    LoadError
        If it has none of that name; the library is closed then, lest it be found again by its path.
    """
    try:
        function = getattr(library, name)
    except AttributeError as error:
        import _ctypes

        if hasattr(_ctypes, "dlclose"):
            _ctypes.dlclose(library._handle)
        raise LoadError(f"cannot load the kernel {library._name}: {error}") from None
    function.argtypes, function.restype = types, result
    return function


def load(folder: Path, name: str, functions: Signatures, later: Sequence[str] = ()) -> dict[str, Callable[..., Any]]:
    """Load a compiled kernel: its functions by name; arrays are contiguous and of doubles, and are passed as they are.

    Parameters
    ----------
    folder : Path
        Of the entry.
    name : str
        Of the kernel.
    functions : Signatures
        Of what is wanted, by name.
    later : sequence of str
        Those of which few scenes have a use.

    Raises
    ------
    LoadError
    MemoryError
    """
    library = library_of(folder, name)

    def bound(function: str, result: str, types: Sequence[str]) -> Callable[..., Any]:
        raw = function_of(library, f"{name}_{function}", TYPES[result], *(TYPES[one] for one in types))
        return lambda *values: raw(*[_passed(v) if isinstance(v, np.ndarray) else v for v in values])

    return {function: bound(function, *signature) for function, signature in functions.items()}  # type: ignore[arg-type]
