"""Grains in the fluid: what each does to the other, averaged over a width that is larger than the grains.

Importing softdyn.suspension imports nothing else: each name is loaded on first use.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from softdyn.suspension.suspension_result import SuspensionResult
    from softdyn.suspension.suspension_run import simulate_suspension as simulate
    from softdyn.suspension.suspension_scene import SuspensionScene
    from softdyn.suspension.suspension_scene import read_suspension_scene as read_scene

__all__ = ["SuspensionResult", "SuspensionScene", "read_scene", "simulate"]

#: The module of each, and its name there.
_HOME = {
    "SuspensionResult": ("suspension_result", "SuspensionResult"),
    "SuspensionScene": ("suspension_scene", "SuspensionScene"),
    "read_scene": ("suspension_scene", "read_suspension_scene"),
    "simulate": ("suspension_run", "simulate_suspension"),
}


def __getattr__(name: str) -> Any:
    if name in _HOME:
        module, there = _HOME[name]
        return getattr(import_module(f"softdyn.suspension.{module}"), there)
    raise AttributeError(f"module 'softdyn.suspension' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
