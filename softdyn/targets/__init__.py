"""Building and loading a kernel's source: one module for each target, with the same functions.

``identity()`` tells what, besides the source, the built kernel depends on; ``build(name, source, identity, functions)``
makes the files of a cache entry, and sees that these functions are in it; ``load(folder, manifest)`` returns the
kernel's functions; ``check(folder, name, functions)`` sees that a kernel of unknown origin loads.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from softdyn.errors import SceneError


class LoadError(SceneError):
    """A built kernel does not load: its entry in the cache is to be made anew."""


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
