"""Words and kinds that all checks of a scene share: lists of faults, names of particles and axes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.scene.kinds import is_number as is_number
from softdyn.words import listed as listed

AXES = "xyz"
#: Stands for all particles where some are named.
ALL = "all"
#: Numbers lie between these, lest products of three of them be none.
SIZES = (1e-100, 1e100)


def is_list(values: Any, size: int) -> bool:
    """Whether values are a list of that many."""
    return isinstance(values, (list, tuple, np.ndarray)) and len(values) == size


def components(size: int) -> str:
    """Words for how many numbers are wanted."""
    return f"{size} component{'s' if size > 1 else ''}"


def which(flags: NDArray[np.bool_]) -> str:
    """Words for the particles that are flagged."""
    return particles_named(np.flatnonzero(flags))


def particles_named(numbers: Sequence[int] | NDArray[np.int64]) -> str:
    """Words for some particles: their numbers, or the first ten of them."""
    shown = ", ".join(str(int(number)) for number in numbers[:10])
    more = f" and {len(numbers) - 10} more" if len(numbers) > 10 else ""
    return f"particle{'s' if len(numbers) > 1 else ''} {shown}{more}"
