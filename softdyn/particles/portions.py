"""Work on many contacts, in portions that a processor's cache holds; threads share them.

What is computed of a contact depends on no other, and sums are taken in the order of the portions: results do not
depend on threads, to the bit.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from softdyn.particles.geometry import Contacts, some_of

Result = TypeVar("Result")

#: Contacts in a portion.
PORTION = 1 << 14


def processors() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_portions(work: Callable[[slice], Result], count: int) -> list[Result]:
    """Do some work on ``count`` contacts, a slice of them at a time; returns what each gave, in order."""
    parts = [slice(low, min(low + PORTION, count)) for low in range(0, count, PORTION)] or [slice(0, 0)]
    threads = min(processors(), len(parts))
    if threads == 1:
        return [work(part) for part in parts]
    # numpy and the kernels let go of the interpreter; a pool that is kept would not survive a fork
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(work, parts))


def portion(contacts: Contacts, part: slice) -> Contacts:
    """Contacts of one portion; all of them, and no copy, where there is only one."""
    return contacts if part == slice(0, len(contacts)) else some_of(contacts, part)
