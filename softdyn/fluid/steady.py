"""Steady flow: Newton's method from the fluid at rest and, where that alone fails, along a path of thicker fluids."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import IntegrationError
from softdyn.fluid.flow_system import FluidSystem
from softdyn.fluid.linear_solvers import LinearFailed, LinearSolver
from softdyn.fluid.newton import NewtonFailed, Solution, solve

Array = NDArray[np.float64]

#: How much thicker than the fluid one may be whose flow is found first, in steps of a factor.
THICKEST, THICKER = 1e9, 10.0
#: Factors by which the next fluid is thinner: at first, most, and least.
RATIO, LARGEST, SMALLEST = 4.0, 16.0, 1.02


def steady_flow(
    system: FluidSystem, solver: LinearSolver, t: float, watch: Callable[[int, float], None] | None = None
) -> tuple[Solution, int]:
    """Find the flow that does not change.

    Parameters
    ----------
    system : FluidSystem
    solver : LinearSolver
    t : float
        Time at which all that is given is taken.
    watch : function of (iteration, residual), optional

    Returns
    -------
    solution : Solution
    fluids : int
        How many were solved on the way.

    Raises
    ------
    IntegrationError
        Naming the residual, and where it is largest.
    """
    rest = system.unknowns.all_of(np.zeros(system.unknowns.basis.shape[1]), system.given(t))
    done = 0

    def solved(x: Array, thicker: float) -> Solution:
        nonlocal done
        done += 1
        return solve(system.equations(t, thicker=thicker), system.unknowns, solver, x, watch=watch)

    thicker, found, failure = 1.0, None, ""
    while found is None:
        try:
            found = solved(rest, thicker)
        except (NewtonFailed, LinearFailed) as error:
            failure = failure or _words(system, error)
            thicker *= THICKER
            if thicker > THICKEST:
                raise IntegrationError(f"no steady flow is found, nor one of any thicker fluid: {failure}") from None
    ratio = RATIO
    while thicker > 1:
        next_one = max(1.0, thicker / ratio)
        try:
            found = solved(found.x, next_one)
        except (NewtonFailed, LinearFailed) as error:
            ratio = ratio**0.5
            if ratio < SMALLEST:
                raise IntegrationError(
                    f"a steady flow is found down to {thicker:.4g} times the viscosity, and no further: "
                    f"{_words(system, error)}; it may be none that is stable: give [until] t in the place of steady"
                ) from None
            continue
        thicker, ratio = next_one, min(ratio**1.5, LARGEST)
    return found, done


def _words(system: FluidSystem, error: NewtonFailed | LinearFailed) -> str:
    if isinstance(error, LinearFailed):
        return str(error)
    return f"{error}: the residual is {error.measure:.1e} of the largest terms, in {system.where(error.row)}"
