"""Scenes of many particles, run by LAMMPS: over many processors, in explicit steps. See ``.docs/lammps.md``."""
