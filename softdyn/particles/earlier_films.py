"""Films of an earlier run, from which another goes on: what a scene may say of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.geometry import Wall

Array = NDArray[np.float64]

#: Walls are where they were, to this part of a radius.
WALLS_STAND = 1e-6


def film_faults(films: Any, radii: Array, d: int, walls: tuple[Wall, ...]) -> list[str]:
    """What is wrong with films that are given: the first fault, or of the walls all.

    Parameters
    ----------
    films : mapping, optional
        Arrays ``i``, ``j``, ``h`` of shape (contacts,), and maybe ``shift`` and ``T``, shape (contacts, d).
    radii : array, shape (N,)
    d : int
        Dimensions.
    walls : tuple of Wall
    """
    if films is None:
        return []
    if not isinstance(films, Mapping) or not {"i", "j", "h"} <= set(films):
        return ["films must be a mapping with i, j and h, as read_particles gives it"]
    count = len(radii)
    try:
        i, j, h = (np.asarray(films[name]) for name in ("i", "j", "h"))
        rows = {name: np.asarray(films[name]) for name in ("shift", "T") if name in films}
        places = [np.array(films[name], float) for name in ("wall_point", "wall_normal") if name in films]
    except (TypeError, ValueError):
        return ["films must hold arrays of numbers"]
    if i.ndim != 1 or not i.shape == j.shape == h.shape or any(a.shape != (len(h), d) for a in rows.values()):
        return [
            f"films: i, j and h have the shapes {i.shape}, {j.shape} and {h.shape}, and one row for each contact is "
            f"needed, in shift and T of {d} columns"
        ]
    if not len(h):
        return []
    kinds = [(i, "iu"), (j, "iu"), (h, "fiu")]
    kinds += [(values, "iu" if name == "shift" else "fiu") for name, values in rows.items()]
    if not all(values.dtype.kind in kind and np.isfinite(values).all() for values, kind in kinds):
        return ["films: i, j and shift must be whole numbers, h and T finite ones"]
    # a scene without walls leaves those of the earlier run
    last = count + (len(places[0]) if places and not walls else len(walls))
    if ((i < 0) | (i >= count) | (j <= i) | (j >= last)).any():
        return [
            f"films: i must be numbers of particles, 0 to {count - 1}, and j larger ones, below {last}: walls from "
            f"{count} on"
        ]
    if not (h > 0).all():
        return ["films: gaps must be positive"]
    keys = np.column_stack([i, j, rows.get("shift", np.zeros((len(h), d), int))])
    if len(np.unique(keys, axis=0)) < len(keys):
        return ["films: a contact is given twice"]
    return _wall_faults(places, radii, walls) if len(places) == 2 and walls else []


def _wall_faults(places: list[Array], radii: Array, walls: tuple[Wall, ...]) -> list[str]:
    """Walls that are not where they were in the earlier run whose films are given."""
    if not all(place.shape == (len(walls), len(walls[0].normal)) for place in places):
        return [f"{len(walls)} walls, and {len(places[0])} in the earlier run whose films are given"]
    return [
        f"wall {number} stood at {_printed(point)}, with the normal {_printed(normal)}, at the end of the earlier run "
        "whose films are given: place it there"
        for number, (wall, point, normal) in enumerate(zip(walls, *places, strict=True))
        if np.linalg.norm(wall.normal - normal) > WALLS_STAND
        or abs((wall.point - point) @ normal) > WALLS_STAND * radii.min()
    ]


def _printed(place: Array) -> str:
    return "[" + ", ".join(f"{value:.9g}" for value in place) + "]"
