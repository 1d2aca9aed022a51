"""The Runge-Kutta method: Alexander's SDIRK of three stages and order 3, L-stable and stiffly accurate.

Each stage is implicit in itself alone, with the same factor gamma; the last stage is the result, so that the algebraic
equations of an index-1 system hold at the end of a step as they do within, and the order is that of the method
(Alexander 1977; Hairer & Wanner II, VI.1).
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray

Array = NDArray[np.float64]

ORDER = 3
#: The root between 1/6 and 1/2 of 6 g^3 - 18 g^2 + 9 g - 1: the one for which the method is L-stable.
GAMMA = 0.43586652150845899942
_B1 = -(6 * GAMMA**2 - 16 * GAMMA + 1) / 4
_B2 = (6 * GAMMA**2 - 20 * GAMMA + 5) / 4

NODES: Array = np.array([GAMMA, (1 + GAMMA) / 2, 1.0])
STAGES: Array = np.array([[GAMMA, 0.0, 0.0], [(1 - GAMMA) / 2, GAMMA, 0.0], [_B1, _B2, GAMMA]])
WEIGHTS: Array = STAGES[2]
#: Weights of order 2 that do without the last stage; the difference estimates the error, of order 3.
_EMBEDDED_2 = (0.5 - NODES[0]) / (NODES[1] - NODES[0])
ERROR: Array = WEIGHTS - np.array([1 - _EMBEDDED_2, _EMBEDDED_2, 0.0])
#: Rows of the stages, with the rate at the start of a step first, which they do without.
ROWS: Array = np.pad(STAGES, ((0, 0), (1, 0)))
#: The parabola that is 1 at one of the nodes and 0 at the others.
_BASES = [polynomial.polyfromroots(np.delete(NODES, k)) / np.prod(NODES[k] - np.delete(NODES, k)) for k in range(3)]


def rate_weights(theta: float) -> Array:
    """Weights of the stages' rates for the rate at the fraction theta of a step: the parabola through them."""
    return np.array([polynomial.polyval(theta, basis) for basis in _BASES])


def dense_row(theta: float, start_known: bool) -> Array:
    """Row of one more implicit stage, which gives the solution at the fraction theta of a step.

    Within a step the equations hold as they do at its end: the forces balance, and the stage is as stable as the
    others. With the weights b of the rates at the start and at the three stages, and gamma of the stage's own, the
    conditions for order 3 are (c nodes, A the stages' rows)::

        sum b + gamma = theta ,                    sum b c + gamma theta = theta^2/2 ,
        sum b c^2 + gamma theta^2 = theta^3/3 ,    sum b (A c) + gamma theta^2/2 = theta^3/6

    (Hairer, Norsett & Wanner I, II.6). Without the rate at the start the last cannot be met: order 2.

    Parameters
    ----------
    theta : float
    start_known : bool
        Whether the rate at the start is known.

    Returns
    -------
    array, shape (4,)
        Weights of the rates at the start and at the three stages; the stage's own is gamma.
    """
    c = np.concatenate([[0.0], NODES])
    conditions = np.array([np.ones(4), c, c**2, np.concatenate([[0.0], STAGES @ NODES])])
    wanted = np.array([theta, theta**2 / 2, theta**3 / 3, theta**3 / 6])
    wanted -= GAMMA * np.array([1.0, theta, theta**2, theta**2 / 2])
    if start_known:
        return np.linalg.solve(conditions, wanted)
    return np.concatenate([[0.0], np.linalg.solve(conditions[:3, 1:], wanted[:3])])
