"""The derivation stage: from a law declared in sympy to its dynamics, its limits and its kernels."""

if __name__ != "softdyn.derive":  # two copies of one module would not recognise each other's laws
    raise ImportError(f"import this package as softdyn.derive, not as {__name__}")

from softdyn.derive.dimensions import (
    DIMENSIONLESS,
    ENERGY,
    FORCE,
    FRICTION,
    LENGTH,
    MASS,
    PRESSURE,
    TIME,
    VISCOSITY,
    Dimension,
)
from softdyn.derive.law import ContactLaw, Drag, Limit, Rubbing, Tangential
from softdyn.derive.splines import read_points, spline
from softdyn.derive.symbols import E, F, R, a, delta, eta, h, kappa, size_ratio, slip_rate

__all__ = [
    "DIMENSIONLESS",
    "ENERGY",
    "FORCE",
    "FRICTION",
    "LENGTH",
    "MASS",
    "PRESSURE",
    "TIME",
    "VISCOSITY",
    "ContactLaw",
    "Dimension",
    "Drag",
    "E",
    "F",
    "Limit",
    "R",
    "Rubbing",
    "Tangential",
    "a",
    "delta",
    "eta",
    "h",
    "kappa",
    "read_points",
    "size_ratio",
    "slip_rate",
    "spline",
]
