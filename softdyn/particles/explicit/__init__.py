"""Explicit steps of grains with inertia, in dry contact: velocity Verlet, whole steps in compiled code."""
