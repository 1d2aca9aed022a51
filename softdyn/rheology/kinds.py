"""What many runs are made of, for each kind of scene: how one is read, made ready, carried out and measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from softdyn.scene.reading import is_fluid_scene, is_particle_scene

#: Numbers that a run has, by their names, and what is to be known of it, or "".
Measured = tuple[dict[str, float], str]


class Kind(NamedTuple):
    """A kind of scene.

    Attributes
    ----------
    scene : type
        Its class, which declares its keys.
    read : function of the content of a scene file, and the folder of that
        Gives a scene.
    ready : function of a scene
        Derives and compiles what it runs.
    simulate : function of a scene, progress, checkpoint, whether it goes on from that, and whether it keeps it
    measured : function of a result
    """

    scene: type
    read: Callable[[Mapping[str, Any], Path], Any]
    ready: Callable[[Any], object]
    simulate: Callable[..., Any]
    measured: Callable[[Any], Measured]


def kind_of(content: Mapping[str, Any]) -> Kind:
    """The kind of a scene, by the content of its file; what other kinds need is not imported."""
    if is_fluid_scene(content):
        return _suspension() if is_particle_scene(content) else _fluid()
    return _particles() if is_particle_scene(content) else _pair()


def _particles() -> Kind:
    from softdyn.particles.files import particle_scene_from
    from softdyn.particles.particle_keys import ParticleScene
    from softdyn.particles.particle_run import prepare_any, simulate_particles
    from softdyn.rheology.measured_runs import measured_particles

    return Kind(ParticleScene, particle_scene_from, prepare_any, simulate_particles, measured_particles)


def _fluid() -> Kind:
    from softdyn.fluid.flow_system import prepared
    from softdyn.fluid.fluid_run import simulate_fluid
    from softdyn.fluid.fluid_scene import FluidScene, fluid_scene_from
    from softdyn.rheology.measured_runs import measured_flow

    return Kind(FluidScene, fluid_scene_from, prepared, simulate_fluid, measured_flow)


def _suspension() -> Kind:
    from softdyn.rheology.measured_runs import measured_flow
    from softdyn.suspension.suspension_run import made_ready, simulate_suspension
    from softdyn.suspension.suspension_scene import SuspensionScene, suspension_scene_from

    return Kind(SuspensionScene, suspension_scene_from, made_ready, simulate_suspension, measured_flow)


def _pair() -> Kind:
    from softdyn.pair.pair_run import simulate_pair
    from softdyn.rheology.measured_runs import measured_pair
    from softdyn.scene.pair_scene import Scene, scene_from

    # two particles take so short a time that there is nothing to go on from
    return Kind(Scene, scene_from, lambda _: None, lambda scene, *_: simulate_pair(scene), measured_pair)
