"""What a run of grains in a fluid gives: what one of the fluid does, and the grains."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from softdyn.fluid.fluid_result import FlowFrame, FluidResult, fluid_from, gather_flow

if TYPE_CHECKING:
    from softdyn.fluid.balances import Measures
    from softdyn.fluid.flow_system import FluidSystem

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SuspensionFrame(FlowFrame):
    """A state at an output time.

    Attributes
    ----------
    x, v, drag : arrays, shape (grains, d)
        Of the grains: places, velocities, and the drag on them in the step that ended.
    contact_stress : array, shape (d, d)
        Of the contacts, over the volume of the mesh, > 0 in tension.
    walls : array, shape (walls, d)
        Forces of the grains on the walls.
    """

    x: Array
    v: Array
    drag: Array
    contact_stress: Array
    walls: Array


@dataclass(frozen=True, repr=False)
class SuspensionResult(FluidResult):
    """A run of grains in a fluid; all numbers in the units of the scene.

    Attributes
    ----------
    arrays : mapping from str to array
        Those of :class:`softdyn.fluid.fluid_result.FluidResult`, with the porosity ``c`` and the flux of the grains
        ``us``. Of the grains ``x``, ``v``, ``drag`` (frames, grains, d): places, which periods do not wrap, velocities,
        and the drag of the fluid; ``radii`` (grains,). Of their contacts ``contact_stress`` (frames, d, d), over the
        volume of the mesh, and ``contact_force_NAME`` (frames, d), what a wall of that name feels. Of bonds
        ``bond_i``, ``bond_j``, ``bond_r``, ``bond_tension``, ``bond_energy``, ``bond_broken`` and ``potential_energy``,
        as in :class:`softdyn.particles.results.ParticleResult`.

        For each step: ``grain_drag``, ``grain_pressure``, ``grain_weight``, ``grain_momentum`` (steps, d), summed over
        the grains: drag, -V grad p, weight, and momentum at its end; ``grain_contact``, the force of the walls on them;
        ``fluid_stress`` (steps, d, d), 2 eta* D of the mixture in the mean over the volume, and ``grain_stress``, that
        of the contacts at the end of the step: > 0 in tension, and on average together what walls feel of a shear;
        ``contacts``, how many there are, and ``substeps``, into how many steps these divide it; ``grain_volume``, the
        integral of the share of the grains; ``coupling_repeats``, how often the step was solved until the drag fits,
        and ``coupling_change``, what it still changed; ``volume_imbalance``, ``exchange_imbalance``: of the volume of
        the grains, and of the forces that grains and fluid have of each other. ``mass_imbalance`` is that of
        both phases, in a step.
    """

    kind: ClassVar[str] = "suspension"

    def __repr__(self) -> str:
        return (
            f"<SuspensionResult, {len(self.radii)} grains, {self.stats['elements']}: {len(self)} frames up to "
            f"t={float(self.t[-1]):.6g}>"
        )


def gather_suspension(
    system: FluidSystem,
    measures: Measures,
    radii: Array,
    frames: Iterable[SuspensionFrame],
    history: Sequence[Sequence[float]],
    stats: Mapping[str, Any],
    walls: Sequence[str] = (),
    more: Mapping[str, NDArray[Any]] | None = None,
) -> SuspensionResult:
    """Put a result together from its frames and steps.

    Parameters
    ----------
    system : FluidSystem
    measures : Measures
        What is measured of the flow.
    radii : array, shape (grains,)
    frames : iterable of SuspensionFrame
    history : sequence of rows of float
        What is noted of each step.
    stats : mapping
        What is told of the run.
    walls : sequence of str
        Names of the walls that grains touch.
    more : mapping from str to array, optional
        What bonds and potentials tell.
    """
    frames, d, count = list(frames), system.dimension, len(radii)
    plain = gather_flow(system, measures, frames, history, stats)
    nodes = system.velocity.count
    arrays = dict(plain.arrays)
    arrays["c"] = np.array([frame.c for frame in frames]).reshape(-1, nodes)
    arrays["us"] = np.array([frame.us for frame in frames]).reshape(-1, nodes, d)
    for name in ("x", "v", "drag"):
        arrays[name] = np.array([getattr(frame, name) for frame in frames]).reshape(len(frames), count, d)
    arrays["radii"] = radii
    arrays["contact_stress"] = np.array([frame.contact_stress for frame in frames]).reshape(-1, d, d)
    for number, name in enumerate(walls):
        arrays[f"contact_force_{name}"] = np.array([frame.walls[number] for frame in frames]).reshape(-1, d)
    arrays |= more or {}
    return _with(plain, arrays)


def suspension_from(content: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> SuspensionResult:
    """Result from the content of a file.

    Raises
    ------
    ValueError, KeyError
        If an array is missing, or does not fit the others.
    """
    plain = fluid_from(content, arrays)
    shape = (len(plain.t), len(arrays["radii"]), plain.at.shape[1])
    for name in ("x", "v", "drag"):
        if arrays[name].shape != shape or arrays[name].dtype.kind != "f":
            raise ValueError(f"{name} has the shape {arrays[name].shape}, and {shape} is needed")
    return _with(plain, plain.arrays)


def _with(plain: FluidResult, arrays: Mapping[str, NDArray[Any]]) -> SuspensionResult:
    given = {one.name: getattr(plain, one.name) for one in fields(plain)}
    return SuspensionResult(**{**given, "arrays": arrays})
