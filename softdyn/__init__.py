"""softdyn: from a contact law, declared in four sympy expressions, to a proven, fast simulation."""
__version__ = "0.1.0"
