"""Work on many contacts, in portions that a processor's cache holds; threads share them.

What is computed of a contact depends on no other, and sums are taken in the order of the portions, or of the contacts:
results do not depend on threads, to the bit. All sums over the contacts of each particle that forces and matrices need
are products with the matrices made here.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from softdyn.particles.geometry import Contacts, some_of

Result = TypeVar("Result")
Integers = NDArray[np.signedinteger[Any]]

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


def gathering(ends: Integers, count: int) -> csr_array:
    """Matrix that sums over the contacts of each particle, shape (count, contacts).

    Parameters
    ----------
    ends : array of int, shape (contacts,)
        One particle of each contact; numbers from ``count`` on are walls, of which no sum is taken.
    count : int
        Particles.
    """
    order = np.argsort(ends, kind="stable").astype(np.int32)
    indptr = np.searchsorted(ends[order], np.arange(count + 1)).astype(np.int32)
    columns = order[: indptr[-1]]
    return csr_array((np.ones(len(columns)), columns, indptr), shape=(count, len(ends)))


def gatherings(contacts: Contacts, count: int) -> tuple[csr_array, csr_array]:
    """Such a matrix of the first and one of the second particles; made once for each list of contacts.

    Parameters
    ----------
    contacts : Contacts
    count : int
        Particles.
    """
    kept: tuple[csr_array, csr_array] | None = contacts.__dict__.get("_gatherings")
    if kept is None or kept[0].shape != (count, len(contacts)):
        kept = gathering(contacts.i, count), gathering(contacts.j, count)
        contacts.__dict__["_gatherings"] = kept
    return kept
