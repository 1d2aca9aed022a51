"""Rheology of many particles: sweeps, flow curves, oscillation, steps, compression.

Each of these builds scenes, runs them, and measures; the engine is that of :mod:`softdyn.particles`.
"""
