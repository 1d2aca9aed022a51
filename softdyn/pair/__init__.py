"""The engine of two particles: one run, many runs at once, sweeps, and their pictures."""
