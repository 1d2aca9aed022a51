"""Target numba: a file that numba compiles at first use, and caches beside it."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache as memoize
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import ModuleType
from typing import Any

from softdyn import cache
from softdyn.errors import CompileError, SoftdynError
from softdyn.targets import LoadError, Signatures

SUFFIX = ".py"


def translate(body: str) -> str:
    """What is written in the shared subset of Python, as it is: numba compiles it."""
    return body


def available() -> bool:
    """Whether numba is installed."""
    return importlib.util.find_spec("numba") is not None


@memoize
def identity() -> dict[str, Any]:
    """Return versions; the machine's instruction set is part of numba's own key."""
    try:
        return {"numba": version("numba"), "python": sys.implementation.cache_tag}
    except PackageNotFoundError:
        raise CompileError("target 'numba' needs numba: pip install numba") from None


def build(name: str, source: str, made_by: Mapping[str, Any], functions: Sequence[str] = ()) -> dict[str, bytes]:
    """Nothing to do but to store the file, executed text cannot be cached, and a folder for what numba keeps of it.

    Parameters
    ----------
    name : str
        Of the kernel.
    source : str
    made_by : mapping
    functions : sequence of str
    """
    return {f"{name}.py": source.encode(), "__pycache__/numba": b""}


def check(folder: Path, name: str, functions: Sequence[str]) -> None:
    """Nothing to do: what does not load fails here, too.

    Parameters
    ----------
    folder : Path
    name : str
    functions : sequence of str
    """


@contextmanager
def loading(folder: Path, name: str) -> Iterator[None]:
    """Tell every failure to import and compile a kernel as one that its entry in the cache may be the cause of.

    What numba kept may be cut short, or from another of its versions, which it tells by errors of any kind.
    """
    try:
        yield
    except (SoftdynError, MemoryError):
        raise
    except Exception as error:
        said = f"{type(error).__name__}: {error}"
        raise LoadError(f"cannot load the kernel {folder / name}.py: {said}") from error


def module_of(folder: Path, name: str) -> ModuleType:
    """Import a kernel's file.

    Raises
    ------
    SceneError
        If others could have written what numba kept of its functions, which is run: wherever its settings have it.
    """
    path = folder / f"{name}.py"
    spec = importlib.util.spec_from_file_location(f"softdyn_kernel_{name}_{folder.name}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # numba's cache refers to the functions of a kernel by the name of its module
    spec.loader.exec_module(module)
    kept = {value._cache.cache_path for value in vars(module).values() if hasattr(value, "_cache")}
    for one in kept:
        cache.require_own(Path(one), "numba's cache")
    return module


def load(folder: Path, name: str, functions: Signatures, later: Sequence[str] = ()) -> dict[str, Callable[..., Any]]:
    """Import a kernel and compile it, or load what numba compiled before; ``later`` is compiled at its first call.

    Parameters
    ----------
    folder : Path
        Of the entry.
    name : str
        Of the kernel.
    functions : Signatures
        Of what is wanted, by name.
    later : sequence of str

    Raises
    ------
    LoadError
    """
    with loading(folder, name):
        module = module_of(folder, name)
        found = {function: getattr(module, f"{name}_{function}") for function in functions}
        _compile({found[function]: types for function, (_, types) in functions.items() if function not in later})
    return found


def _compile(functions: Mapping[Any, Sequence[str]]) -> None:
    """Compile now, for the types of the arguments, so that compiling is not taken for running."""
    from numba import float64, int32, int64

    types = {"int": int64, "float": float64, "array": float64[::1]}
    types |= {"indices": int64[::1], "short_indices": int32[::1], "integers": int32[::1]}
    for function, arguments in functions.items():
        function.compile(tuple(types[one] for one in arguments))
