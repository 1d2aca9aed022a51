"""Scenes of many particles.

>>> from softdyn import particles
>>> scene = particles.ParticleScene(
...     law="rognon_gay", parameters={"E": 1.0, "eta": 1.0}, positions=[[0, 0], [2.1, 0], [4.2, 0]], radii=1.0,
...     push=[particles.Push([0], force=[1e-2, 0])], drag=1.0, until_t=100.0,
... )
>>> result = particles.simulate(scene)
>>> particles.coordination(result).shape
(11,)

Importing softdyn.particles imports nothing else: each name is loaded on first use.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from softdyn.particles.chains import Chains
    from softdyn.particles.files import read_particle_scene as read_scene
    from softdyn.particles.geometry import Wall
    from softdyn.particles.mechanisms.bonds import Bond
    from softdyn.particles.mechanisms.coulomb import Friction
    from softdyn.particles.mechanisms.gravity import Gravity
    from softdyn.particles.mechanisms.inertia import Inertia
    from softdyn.particles.mechanisms.noise import Noise
    from softdyn.particles.mechanisms.potentials import PairPotential
    from softdyn.particles.observables import (
        coordination,
        fabric,
        force_distribution,
        gap_distribution,
        mean_square_displacement,
        normal_stress_differences,
        pressure,
        rattlers,
        relative_viscosity,
        strain,
        swap_time,
        wall_forces,
    )
    from softdyn.particles.packing import Packing, lattice_packing, random_packing
    from softdyn.particles.particle_keys import Hold, ParticleScene, Push, Stress
    from softdyn.particles.particle_run import simulate_particles as simulate
    from softdyn.particles.placing import from_result, read_particles
    from softdyn.particles.results import ParticleResult
    from softdyn.particles.results import load_particles as load

__all__ = [
    "Bond",
    "Chains",
    "Friction",
    "Gravity",
    "Hold",
    "Inertia",
    "Noise",
    "Packing",
    "PairPotential",
    "ParticleResult",
    "ParticleScene",
    "Push",
    "Stress",
    "Wall",
    "coordination",
    "fabric",
    "force_distribution",
    "from_result",
    "gap_distribution",
    "lattice_packing",
    "load",
    "mean_square_displacement",
    "normal_stress_differences",
    "pressure",
    "random_packing",
    "rattlers",
    "read_particles",
    "read_scene",
    "relative_viscosity",
    "simulate",
    "strain",
    "swap_time",
    "wall_forces",
]

#: The module of each, and its name there.
_HOME = {
    "Chains": ("chains", "Chains"),
    "Bond": ("mechanisms.bonds", "Bond"),
    "Friction": ("mechanisms.coulomb", "Friction"),
    "Gravity": ("mechanisms.gravity", "Gravity"),
    "Hold": ("particle_keys", "Hold"),
    "Inertia": ("mechanisms.inertia", "Inertia"),
    "Noise": ("mechanisms.noise", "Noise"),
    "PairPotential": ("mechanisms.potentials", "PairPotential"),
    "Packing": ("packing", "Packing"),
    "ParticleResult": ("results", "ParticleResult"),
    "ParticleScene": ("particle_keys", "ParticleScene"),
    "Push": ("particle_keys", "Push"),
    "Stress": ("particle_keys", "Stress"),
    "Wall": ("geometry", "Wall"),
    "coordination": ("observables", "coordination"),
    "fabric": ("observables", "fabric"),
    "force_distribution": ("observables", "force_distribution"),
    "from_result": ("placing", "from_result"),
    "gap_distribution": ("observables", "gap_distribution"),
    "lattice_packing": ("packing", "lattice_packing"),
    "load": ("results", "load_particles"),
    "mean_square_displacement": ("observables", "mean_square_displacement"),
    "normal_stress_differences": ("observables", "normal_stress_differences"),
    "pressure": ("observables", "pressure"),
    "random_packing": ("packing", "random_packing"),
    "rattlers": ("observables", "rattlers"),
    "read_particles": ("placing", "read_particles"),
    "read_scene": ("files", "read_particle_scene"),
    "relative_viscosity": ("observables", "relative_viscosity"),
    "simulate": ("particle_run", "simulate_particles"),
    "strain": ("observables", "strain"),
    "swap_time": ("observables", "swap_time"),
    "wall_forces": ("observables", "wall_forces"),
}


def __getattr__(name: str) -> Any:
    if name in _HOME:
        module, there = _HOME[name]
        return getattr(import_module(f"softdyn.particles.{module}"), there)
    raise AttributeError(f"module 'softdyn.particles' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
