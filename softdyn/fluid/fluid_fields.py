"""Fields of a result at the nodes of its mesh, each at its own place: without periods."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from softdyn.fluid.numbering import Nodes
    from softdyn.results.result import Result


def spread_to(values: NDArray[Any], result: Result, nodes: Nodes) -> NDArray[Any]:
    """Values at nodes that are numbered without periods, of those at a result's own.

    Parameters
    ----------
    values : array, shape (n, ...)
        At the result's nodes of the velocity, or of the pressure, which are spread linearly.
    result : FluidResult
    nodes : Nodes
        Of the order of the velocity.
    """
    found = np.empty((nodes.count, *values.shape[1:]), dtype=values.dtype)
    if len(values) == result.u.shape[1]:
        found[nodes.of] = values[result.u_nodes]
        return found
    corner = values[result.p_nodes]
    n = corner.shape[1]
    found[nodes.of[:, :n]] = corner
    for place, (i, j) in enumerate(combinations(range(n), 2), n):
        if place < nodes.of.shape[1]:
            found[nodes.of[:, place]] = (corner[:, i] + corner[:, j]) / 2
    return found
