"""Steps in time: implicit Euler and BDF2, of lengths that follow from estimates of the error.

At the end of a step the derivative is that of the polynomial through the new state and the last one (Euler) or two
(BDF2), rate u + past. What a step does wrong follows from how far off the polynomial through one state more had
predicted it: with tau = 1/rate and s the age of the oldest of these states at the end of the step, the error is
tau/(tau + s) of that, for BDF2 as for Euler (Gresho & Sani, Incompressible Flow and the Finite Element Method, 1998,
3.16.4, do the same for the trapezoidal rule). The first step is of Euler: done at once and in two halves, whose
difference is its error.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Of the length that the error would allow.
SAFETY = 0.9
#: Change of the length from one step to the next; a longer step is not worth a new factor below WORTH.
LARGEST, SMALLEST, WORTH = 2.0, 0.2, 1.25
METHODS = {"BDF2": 2, "Euler": 1}


def derivative(times: Sequence[float], t: float) -> tuple[float, list[float]]:
    """Weights of the derivative at t of the polynomial through the values at t and at earlier times.

    Returns
    -------
    rate : float
        Of the value at t.
    past : list of float
        Of those at the earlier times.
    """
    rate = sum(1 / (t - one) for one in times)
    past = [-math.prod((t - other) / (one - other) for other in times if other != one) / (t - one) for one in times]
    return rate, past


def predicted(times: Sequence[float], values: Sequence[Array], t: float) -> Array:
    """Value at t of the polynomial through values at other times.

    Parameters
    ----------
    times : sequence of float
    values : sequence of array
        At these times, of one shape.
    t : float
    """
    total = np.zeros_like(values[0])
    for one, value in zip(times, values, strict=True):
        total += math.prod((t - other) / (one - other) for other in times if other != one) * value
    return total


def error_share(times: Sequence[float], t: float, order: int) -> float:
    """Part of the distance from the prediction that is the error of a step to t; times are one more than the order.

    Parameters
    ----------
    times : sequence of float
        Earlier ones, the last first.
    t : float
        End of the step.
    order : int
    """
    rate, _ = derivative(times[:order], t)
    return (1 / rate) / (1 / rate + t - times[order])


def relative_error(wrong: Array, u: Array, largest: float) -> float:
    """Root mean square of the velocities' error over the largest velocity, now or at any time before.

    Parameters
    ----------
    wrong : array, shape (velocities,)
        Their errors.
    u : array, shape (velocities,)
    largest : float
        Largest velocity before.
    """
    size = max(largest, float(np.abs(u).max(initial=0.0)))
    return float(np.sqrt(np.mean(wrong**2))) / size if size else 0.0


def next_length(dt: float, error: float, order: int) -> float:
    """Length of a step that would have the error that is allowed.

    Parameters
    ----------
    dt, error : float
        Length of a step, and its error over what is allowed.
    order : int
        Of the method: the error goes with the power order + 1 of the length.
    """
    wanted = SAFETY * max(error, 1e-300) ** (-1 / (order + 1))
    return dt if error <= 1 and wanted < WORTH else dt * min(LARGEST, max(wanted, SMALLEST))


def length_to(t: float, dt: float, goal: float) -> tuple[float, float]:
    """Length of the next step, and its end, so that the goal is met and no sliver is left before it.

    Parameters
    ----------
    t, dt : float
        The time, and the length that a step may have.
    goal : float
        A time.
    """
    left = goal - t
    if dt >= 0.99 * left:
        return left, goal
    parts = math.ceil(left / dt - 1e-9)
    dt = left / parts if parts <= 3 else dt
    return dt, t + dt
