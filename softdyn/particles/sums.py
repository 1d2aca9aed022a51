"""Sums over the contacts of each particle: a product with the matrix that says whose each contact is.

Terms are added in the order of the contacts, whatever the number of threads: sums are the same to the bit. All sums
over contacts that forces and matrices need are taken here.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

Array = NDArray[np.float64]
Integers = NDArray[np.signedinteger[Any]]


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


def gatherings(contacts: Any, count: int) -> tuple[csr_array, csr_array]:
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
