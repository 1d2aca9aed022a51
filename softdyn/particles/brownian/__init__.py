"""Brownian motion without inertia: steps of a fixed length, with noise that drag and temperature give."""
