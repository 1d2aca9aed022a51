"""Building and loading a kernel's source: one module for each target, with the same functions.

``identity()`` tells what, besides the source, the built kernel depends on; ``build(name, source, identity)`` makes the
files of a cache entry; ``load(folder, manifest)`` returns the kernel's functions.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple


class Functions(NamedTuple):
    """The functions of a loaded kernel; arrays are contiguous and of doubles, and are passed as they are.

    ``evaluate(n, h, delta, *inputs, p, out)``, ``solve_delta(n, h, F, p, delta)``,
    ``drive(n, t, *drive, value, rate)``, ``integrate(t_end, u_stop, rtol, p, *drive, capacity, state, steps)``
    ``passages(n, u, at, steps, out)``, ``sample(n, t, stored, steps, out)`` and
    ``runs(n, count, at_gaps, settings, runs, targets, *table, out)``.
    """

    evaluate: Callable[..., Any]
    solve_delta: Callable[..., Any]
    drive: Callable[..., Any]
    integrate: Callable[..., int]
    passages: Callable[..., Any]
    sample: Callable[..., Any]
    runs: Callable[..., Any]
