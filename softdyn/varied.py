"""What is varied: a name and its values, as the command line gives them."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.scene.numbers import LARGEST_COUNT

Array = NDArray[np.float64]

_RANGE = re.compile(r"(linspace|logspace)\(([^,()]+),([^,()]+),([^,()]+)\)")
_WHOLE = re.compile(r"([+-]?\d{1,15})\.\.([+-]?\d{1,15})")


def values_of(text: str) -> Array:
    """Numbers from logspace(a,b,n), linspace(a,b,n), 1..5 or x,y,z.

    Raises
    ------
    ValueError
        If it is none of these.
    """
    text = text.replace(" ", "")
    if whole := _WHOLE.fullmatch(text):
        first, last = int(whole[1]), int(whole[2])
        if not 0 <= last - first < LARGEST_COUNT:
            raise ValueError
        return np.arange(first, last + 1, dtype=float)
    match = _RANGE.fullmatch(text)
    if match is None:
        return np.array([float(value) for value in text.split(",")])
    first_number, last_number, count = float(match[2]), float(match[3]), int(match[4])
    largest = 308 if match[1] == "logspace" else 1e308  # beyond it, and from nan, there are no numbers
    if not (1 <= count <= LARGEST_COUNT and abs(first_number) <= largest and abs(last_number) <= largest):
        raise ValueError
    found: Array = getattr(np, match[1])(first_number, last_number, count)
    return found


def read_values(text: str) -> tuple[str, Array]:
    """Read NAME=logspace(a,b,n), NAME=linspace(a,b,n), NAME=1..5 or NAME=x,y,z.

    Raises
    ------
    SceneError
    """
    name, equals, values = (part.strip() for part in text.partition("="))
    try:
        if not equals or not name:
            raise ValueError
        return name, values_of(values)
    except ValueError:
        raise SceneError(
            f"--vary {text}: NAME=logspace(a,b,n) (10**a to 10**b), NAME=linspace(a,b,n), NAME=first..last (whole "
            "numbers) or NAME=x,y,... is expected"
        ) from None


def read_named(option: str, text: str) -> Array:
    """Read the values of an option that names what is varied itself.

    Raises
    ------
    SceneError
    """
    try:
        return values_of(text)
    except ValueError:
        raise SceneError(
            f"{option} {text}: logspace(a,b,n) (10**a to 10**b), linspace(a,b,n), or x,y,... is expected"
        ) from None


def read_varied(texts: Sequence[str]) -> dict[str, Array]:
    """Read several of these, each for a name of its own.

    Raises
    ------
    SceneError
    """
    pairs = [read_values(text) for text in texts]
    names = [name for name, _ in pairs]
    twice = [name for name in dict.fromkeys(names) if names.count(name) > 1]
    if twice:
        raise SceneError(f"--vary {twice[0]} is given twice; list all of its values in one: {twice[0]}=x,y,...")
    return dict(pairs)
