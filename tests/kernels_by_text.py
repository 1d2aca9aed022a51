"""Kernels straight from their text, for tests that look at the text as well; numba compiles only what is called."""

from __future__ import annotations

import ctypes
import importlib.util
import itertools
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.derive import ContactLaw
from softdyn.derive.emit import emit
from softdyn.derive.kernel_form import KernelIR
from softdyn.derive.pair_equations import Needs
from softdyn.derive.pair_kernel import kernel_ir
from softdyn.targets import c as c_target

Array = NDArray[np.float64]
_counter = itertools.count()


class TextKernel:
    """A kernel built from the text that was emitted for it; one form, ``ir``, may serve several targets."""

    def __init__(self, law: ContactLaw, needs: Needs, target: str, folder: Path, ir: KernelIR | None = None) -> None:
        self.ir: KernelIR = ir or kernel_ir(law, needs)
        self.text = emit(self.ir, target)
        self._function = (_c_functions if target == "c" else _numba_functions)(self.text, folder)

    def evaluate(self, p: Array, h: Array, delta: Array, **inputs: Array) -> dict[str, Array]:
        """Return the outputs by name; of the inputs (F, dF_dt), those are used that the kernel takes."""
        out = np.empty(len(self.ir.settings["outputs"]) * len(h))
        function = self._function(f"{self.ir.name}_evaluate")
        function(len(h), h, delta, *(inputs[name] for name in self.ir.settings["inputs"]), p, out)
        return dict(zip(self.ir.settings["outputs"], out.reshape(-1, len(h)), strict=True))

    def solve_delta(self, p: Array, h: Array, F: Array) -> Array:
        """Deflections that balance F."""
        delta = np.full(len(h), np.nan)
        self._function(f"{self.ir.name}_solve_delta")(len(h), h, F, p, delta)
        return delta


def compile_c(text: str, folder: Path) -> ctypes.CDLL:
    """Compile C text with the project's flags and load it."""
    files = c_target.build("kernel", text, c_target.identity())
    path = folder / f"kernel{next(_counter)}.so"
    path.write_bytes(files["kernel.so"])
    return ctypes.CDLL(str(path))


def import_text(text: str, folder: Path) -> ModuleType:
    """Import Python text as a module of its own."""
    name = f"kernel{next(_counter)}"
    path = folder / f"{name}.py"
    path.write_text(text, encoding="utf-8")
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _c_functions(text: str, folder: Path) -> Callable[[str], Callable[..., None]]:
    library = compile_c(text, folder)

    def function(name: str) -> Callable[..., None]:
        raw = getattr(library, name)
        raw.restype = None

        def call(n: int, *arrays: Any) -> None:
            raw(ctypes.c_int64(n), *(array.ctypes.data_as(ctypes.c_void_p) for array in arrays))

        return call

    return function


def _numba_functions(text: str, folder: Path) -> Callable[[str], Callable[..., None]]:
    module = import_text(text, folder)
    return lambda name: getattr(module, name)
