"""Flow curves fitted: Herschel & Bulkley's law, and a power law, with uncertainties and what the data do not determine.

Both are declared here once, in sympy; the function that is fitted and its derivatives follow.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from sympy import Expr, Symbol, lambdify

from softdyn.errors import SceneError

Array = NDArray[np.float64]

#: The flow's rate; yield stress, consistency and exponent.
rate = Symbol("rate", positive=True)
sigma_y, K, n = Symbol("sigma_y", real=True), Symbol("K", positive=True), Symbol("n", positive=True)

#: Stress at a rate. Herschel & Bulkley, Kolloid-Zeitschrift 39 (1926) 291.
FLOW_LAWS: dict[str, Expr] = {"Herschel-Bulkley": sigma_y + K * rate**n, "power law": K * rate**n}
#: Exponents among which the fit starts.
EXPONENTS = np.geomspace(0.05, 3.0, 41)


@dataclass(frozen=True)
class FlowFit:
    """A law fitted to a flow curve.

    Attributes
    ----------
    law : str
        Name in ``FLOW_LAWS``.
    values, errors : mapping from str to float
        Of the parameters, with standard errors; from the error bars of the points, larger by sqrt(chi2/dof) where the
        points scatter more than these. nan where the data do not tell.
    covariance : array, shape (parameters, parameters)
    chi2 : float
        Sum of the squares of the distances, in error bars.
    dof : int
        Points less parameters.
    undetermined : mapping from str to str
        Parameters that the data do not determine, and why.
    """

    law: str
    values: Mapping[str, float]
    errors: Mapping[str, float]
    covariance: Array
    chi2: float
    dof: int
    undetermined: Mapping[str, str]

    def stress(self, rates: Array) -> Array:
        """Stress at some rates."""
        function, _ = _functions(self.law)
        return function(rates, *self.values.values())

    def words(self) -> str:
        """The fit in one line."""
        parts = []
        for name, value in self.values.items():
            known = f"{name} = {value:.4g} +- {self.errors[name]:.2g}"
            parts.append(f"{name}: {self.undetermined[name]}" if name in self.undetermined else known)
        quality = f"chi2/dof = {self.chi2 / self.dof:.3g}" if self.dof else "as many parameters as points"
        return f"{self.law}: {'; '.join(parts)} ({quality})"


@cache
def _functions(law: str) -> tuple[Callable[..., Array], Callable[..., list[Array]]]:
    """Stress of a law, and its derivatives by the parameters, as functions of rates and parameters."""
    expr, names = FLOW_LAWS[law], parameters_of(law)
    arguments = [rate, *names]
    return lambdify(arguments, expr, "numpy"), lambdify(arguments, [expr.diff(name) for name in names], "numpy")


def stress_and_slopes(law: str, rates: Array, values: Array) -> tuple[Array, Array]:
    """Stress of a law at some rates, and its derivatives by the parameters, shape (rates, parameters).

    Parameters
    ----------
    law : str
        Name of a flow law.
    rates : array, shape (rates,)
        Shear rates, 1/time.
    values : array, shape (parameters,)
        Of its parameters.
    """
    function, derivatives = _functions(law)
    return function(rates, *values), _columns(derivatives(rates, *values), len(rates))


def parameters_of(law: str) -> tuple[Symbol, ...]:
    """Parameters of a law, in their order."""
    return tuple(name for name in (sigma_y, K, n) if name in FLOW_LAWS[law].free_symbols)


def fit_flow_law(law: str, rates: Array, stress: Array, errors: Array) -> FlowFit:
    """Fit a law to the points of a flow curve, each by its error bar.

    Parameters
    ----------
    law : str
        Name in ``FLOW_LAWS``.
    rates, stress, errors : array, shape (points,)
        All rates and errors > 0.

    Raises
    ------
    SceneError
        If the points are too few, not at different rates, or their numbers cannot be used.
    """
    from scipy.optimize import least_squares

    rates, stress, errors = (np.asarray(one, dtype=float) for one in (rates, stress, errors))
    count, distinct = len(parameters_of(law)), len(np.unique(rates))
    if not (np.isfinite([rates, stress, errors]).all() and (rates > 0).all() and (errors > 0).all()):
        raise SceneError(f"{law}: rates, stresses and error bars must be finite, rates and error bars positive")
    if distinct < count:
        raise SceneError(
            f"{law}: its {count} parameters need points at {count} rates at least, and there are {distinct}"
        )
    # in units in which nothing is far from 1: of the middle rate, and of the largest stress
    unit_rate, unit = float(np.exp(np.log(rates).mean())), float(np.abs(stress).max())
    if not unit > 0:
        raise SceneError(f"{law}: all stresses are 0")
    x, y, e = rates / unit_rate, stress / unit, errors / unit
    function, derivatives = _functions(law)
    # where the exponent is given, all else is linear
    start = min((_at_exponent(law, x, y, e, exponent) for exponent in EXPONENTS), key=lambda found: found[0])[1]
    low = [1e-12 if name is K else 1e-3 if name is n else -np.inf for name in parameters_of(law)]
    found = least_squares(
        lambda p: (function(x, *p) - y) / e,
        np.maximum(start, np.array(low) * 1.001),
        jac=lambda p: _columns(derivatives(x, *p), len(x)) / e[:, None],
        bounds=(low, np.inf),
        x_scale="jac",
        xtol=1e-14, ftol=1e-14, gtol=1e-14,
    )  # fmt: skip
    covariance, lost = _covariance(found.jac)
    chi2, dof = float(2 * found.cost), len(x) - count
    covariance = covariance * max(1.0, chi2 / dof if dof else 1.0)
    back = _back(law, found.x, unit_rate, unit)
    turned = back[1] @ covariance @ back[1].T
    names = [str(name) for name in parameters_of(law)]
    values = dict(zip(names, map(float, back[0]), strict=True))
    spread = dict(zip(names, np.sqrt(np.diag(turned)).tolist(), strict=True))
    return FlowFit(law, values, spread, turned, chi2, dof, _undetermined(values, spread, lost, dof))


def _columns(given: list[Array], rows: int) -> Array:
    return np.column_stack([np.broadcast_to(column, (rows,)) for column in given])


def _at_exponent(law: str, x: Array, y: Array, e: Array, exponent: float) -> tuple[float, Array]:
    """Sum of squares and parameters where the exponent is given."""
    columns = [x**exponent] if law == "power law" else [np.ones_like(x), x**exponent]
    linear, *_ = np.linalg.lstsq(np.column_stack(columns) / e[:, None], y / e, rcond=None)
    linear[-1] = max(linear[-1], 1e-9)
    off = (np.column_stack(columns) @ linear - y) / e
    return float(off @ off), np.append(linear, exponent)


def _covariance(jacobian: Array) -> tuple[Array, bool]:
    """Inverse of J^T J, and whether a direction of the parameters is lost."""
    scale = np.linalg.norm(jacobian, axis=0)
    if not (scale > 0).all():
        return np.full((len(scale), len(scale)), np.inf), True
    _, sizes, directions = np.linalg.svd(jacobian / scale, full_matrices=False)
    lost = bool(sizes[-1] < 1e-10 * sizes[0])
    turned = directions.T / np.maximum(sizes, 1e-10 * sizes[0])
    return turned @ turned.T / np.outer(scale, scale), lost


def _back(law: str, found: Array, unit_rate: float, unit: float) -> tuple[Array, Array]:
    """Parameters in the units of the data, and their derivatives by those that were fitted."""
    exponent = found[-1]
    shrunk = unit * unit_rate**-exponent
    values = np.append(found[:-1], exponent)
    turned = np.eye(len(found))
    values[-2] = found[-2] * shrunk
    turned[-2, -2], turned[-2, -1] = shrunk, -values[-2] * math.log(unit_rate)
    if law == "Herschel-Bulkley":
        values[0], turned[0, 0] = found[0] * unit, unit
    return values, turned


def _undetermined(values: Mapping[str, float], errors: Mapping[str, float], lost: bool, dof: int) -> dict[str, str]:
    """Parameters that the data do not determine: known to 100 % of themselves, or worse, at two standard errors."""
    if lost:
        return dict.fromkeys(values, "not determined: other values fit as well")
    found = {}
    for name, value in values.items():
        error = errors[name]
        if 2 * error < abs(value):
            continue
        if name == "sigma_y":
            found[name] = f"none is seen: {value:.2g} +- {error:.2g}, below {max(value, 0.0) + 2 * error:.3g} (95 %)"
        else:
            found[name] = f"not determined: {value:.3g} +- {error:.2g}"
    return found
