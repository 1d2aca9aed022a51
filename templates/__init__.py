"""Jinja templates of the generated kernels: data only."""
