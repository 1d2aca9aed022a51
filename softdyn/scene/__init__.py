"""Scenes: what they say, how they are read, and what of them is refused before anything runs."""
