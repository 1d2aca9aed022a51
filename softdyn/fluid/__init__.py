"""The fluid, by finite elements: meshes, conditions on their boundaries, and what is solved on them.

>>> from softdyn import fluid
>>> scene = fluid.FluidScene(
...     viscosity=1.0, mesh=fluid.MeshSection(box=[1.0, 1.0], cells=[8, 8]), steady=True,
...     boundary=[
...         fluid.Boundary("top", velocity=[1.0, 0.0]),
...         fluid.Boundary(["left", "right", "bottom"], velocity=[0.0, 0.0]),
...     ],
... )
>>> result = fluid.simulate(scene)
>>> result.u.shape
(1, 289, 2)

Importing softdyn.fluid imports nothing else: each name is loaded on first use.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from softdyn.fluid.bed import Bed
    from softdyn.fluid.boundary_keys import Boundary
    from softdyn.fluid.fluid_result import FluidResult
    from softdyn.fluid.fluid_run import simulate_fluid as simulate
    from softdyn.fluid.fluid_scene import FluidScene
    from softdyn.fluid.fluid_scene import read_fluid_scene as read_scene
    from softdyn.fluid.mesh_section import MeshSection

__all__ = ["Bed", "Boundary", "FluidResult", "FluidScene", "MeshSection", "read_scene", "simulate"]

#: The module of each, and its name there.
_HOME = {
    "Bed": ("bed", "Bed"),
    "Boundary": ("boundary_keys", "Boundary"),
    "FluidResult": ("fluid_result", "FluidResult"),
    "FluidScene": ("fluid_scene", "FluidScene"),
    "MeshSection": ("mesh_section", "MeshSection"),
    "read_scene": ("fluid_scene", "read_fluid_scene"),
    "simulate": ("fluid_run", "simulate_fluid"),
}


def __getattr__(name: str) -> Any:
    if name in _HOME:
        module, there = _HOME[name]
        return getattr(import_module(f"softdyn.fluid.{module}"), there)
    raise AttributeError(f"module 'softdyn.fluid' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
