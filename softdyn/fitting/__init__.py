"""Fitting a law to what was measured: curves of force, gap and distance over time, and flow curves."""
