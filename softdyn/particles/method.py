"""The Runge-Kutta method: Alexander's SDIRK of three stages and order 3, L-stable and stiffly accurate.

Each stage is implicit in itself alone, with the same factor gamma; the last stage is the result, so that the algebraic
equations of an index-1 system hold at the end of a step as they do within, and the order is that of the method
(Alexander 1977; Hairer & Wanner II, VI.1).
"""

from __future__ import annotations

import numpy as np
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
