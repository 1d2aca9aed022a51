"""Initial positions: lattices, and random packings in a periodic box."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from softdyn.errors import SceneError
from softdyn.particles.geometry import close_pairs
from softdyn.scene.keys import Key, with_keys
from softdyn.scene.kinds import COORDINATES, NUMBER, Kind, choice, of_kind, whole_number

Array = NDArray[np.float64]

#: Volume of a ball of radius 1: in two dimensions the area of a disc.
BALL = {2: math.pi, 3: 4 * math.pi / 3}
LARGEST_FRACTION = {2: 1.2, 3: 1.0}

PACKED_RADII = Kind(
    "a number, a list of numbers, or a distribution",
    {"anyOf": [NUMBER.schema, COORDINATES.schema, {"type": "object"}]},
)
CELLS = of_kind(
    "a list of numbers",
    {"type": "array", "items": {"type": "integer", "minimum": 1, "maximum": 1000}},
    lambda value: isinstance(value, (list, tuple)),
)


#: Besides random ones: those of :func:`lattice_packing`.
KINDS = ("random", "square", "hexagonal", "cubic", "fcc")


@with_keys
@dataclass(frozen=True)
class Packing:
    """Where particles start: a random packing in a periodic box, or a lattice."""

    kind: Annotated[
        str,
        Key("[packing] kind", choice("kind", KINDS), "Kind of packing: at random places, moved apart, or a lattice."),
    ] = "random"
    count: Annotated[
        int | None, Key("[packing] count", whole_number(0), "How many particles, of a random packing.")
    ] = None
    dimension: Annotated[
        int | None, Key("[packing] dimension", whole_number(0), "Dimension of a random packing, 2 or 3.")
    ] = None
    fraction: Annotated[
        float | None,
        Key(
            "[packing] fraction",
            NUMBER,
            "Fraction of the box that a random packing fills: volumes, areas in two dimensions, overlaps counted "
            "twice.",
        ),
    ] = None
    seed: Annotated[
        int | None,
        Key("[packing] seed", whole_number(0), "Seed of a random packing: the same seed gives the same packing."),
    ] = None
    radii: Annotated[
        float | Sequence[float] | Mapping[str, Any] | None,
        Key(
            "[packing] radii",
            PACKED_RADII,
            "Radii of the particles, taken in turn; or, of a random packing, a distribution that they are drawn from: "
            "{mean, sigma}, the mean radius and the standard deviation of its logarithm, or {values, weights}, radii "
            "and how often each comes.",
            "length",
        ),
    ] = None
    cells: Annotated[
        Sequence[int] | None,
        Key(
            "[packing] cells",
            CELLS,
            "Unit cells of a lattice along each axis; a hexagonal or fcc cell holds 2 or 4 particles.",
        ),
    ] = None
    spacing: Annotated[
        float | None, Key("[packing] spacing", NUMBER, "Distance of nearest neighbours of a lattice.", "length")
    ] = None


def random_packing(
    count: int, dimension: int, fraction: float, radii: Sequence[float] | Mapping[str, Any], seed: int
) -> tuple[Array, Array, Array]:
    """Particles at random places, moved apart until the sum of their squared overlaps is at a minimum.

    Parameters
    ----------
    count : int
    dimension : 2 or 3
    fraction : float
        Volume of all particles, overlaps counted twice, relative to that of the box; area in two dimensions.
    radii : sequence of float, or mapping
        Taken in turn; or a distribution that they are drawn from: ``mean`` and ``sigma``, the mean radius and the
        standard deviation of its logarithm (lognormal), or ``values`` and ``weights``, radii and how often each comes.
    seed : int
        The same seed gives the same packing.

    Returns
    -------
    x : array, shape (count, dimension)
    radii : array, shape (count,)
    lengths : array, shape (dimension,)
        Edges of the periodic box, a square or a cube.

    Raises
    ------
    SceneError

    Examples
    --------
    >>> x, radii, box = random_packing(20, 2, 0.8, [1.0, 1.4], seed=1)
    >>> float((3.141592653589793 * radii**2).sum() / box.prod())
    0.8000000000000002
    """
    if dimension not in BALL:
        raise SceneError(f"[packing] dimension must be 2 or 3, not {dimension!r}")
    if not 0 < fraction <= LARGEST_FRACTION[dimension]:
        raise SceneError(
            f"[packing] fraction must lie between 0 and {LARGEST_FRACTION[dimension]:g} in {dimension} dimensions, "
            f"not {fraction!r}"
        )
    if not 2 <= count <= 1_000_000:
        raise SceneError(f"[packing] count must be 2 to 1000000, not {count!r}")
    drawn = drawn_radii(radii, count, seed) if isinstance(radii, Mapping) else radii
    choice = np.array(drawn, dtype=float).reshape(-1)
    if not len(choice) or not np.isfinite(choice).all() or not (choice > 0).all():
        raise SceneError(f"[packing] radii must be positive numbers, not {radii!r}")
    size = choice[np.arange(count) % len(choice)]
    # in units of the smallest radius, since the minimiser knows sizes of its own
    unit = float(choice.min())
    size = size / unit
    length = float((BALL[dimension] * np.sum(size**dimension) / fraction) ** (1 / dimension))
    start = np.random.default_rng(seed).uniform(0, length, (count, dimension))
    cut = 2 * float(size.max())
    if length < 2 * cut:
        raise SceneError(
            f"[packing] {count} particles make a box of {length * unit:.4g} only: too small for their diameters"
        )

    def energy(flat: Array) -> tuple[float, Array]:
        x = flat.reshape(count, dimension) % length
        x[x >= length] = 0.0  # a remainder may round up to the length
        i, j = close_pairs(x, size, 0.0, length)
        along = x[j] - x[i]
        along -= length * np.round(along / length)
        r = np.sqrt(np.einsum("ij,ij->i", along, along))
        overlap = np.maximum(size[i] + size[j] - r, 0.0)
        pull = (-overlap / np.maximum(r, 1e-300))[:, None] * along
        gradient = np.empty_like(x)
        for axis in range(dimension):
            gradient[:, axis] = np.bincount(j, pull[:, axis], minlength=count)
            gradient[:, axis] -= np.bincount(i, pull[:, axis], minlength=count)
        return 0.5 * float(overlap @ overlap), gradient.reshape(-1)

    found = minimize(energy, start.reshape(-1), jac=True, method="L-BFGS-B", options={"maxiter": 5000, "gtol": 1e-6})
    x = found.x.reshape(count, dimension) % length
    x[x >= length] = 0.0
    return x * unit, size * unit, np.full(dimension, length * unit)


def drawn_radii(distribution: Mapping[str, Any], count: int, seed: int) -> Array:
    """Radii drawn from a distribution, the same for the same seed, shape (count,).

    Parameters
    ----------
    distribution : mapping
        See :func:`random_packing`.
    count, seed : int

    Raises
    ------
    SceneError
    """
    rng = np.random.default_rng([seed, 1])  # places are drawn from the seed itself
    try:
        given = {name: np.array(value, dtype=float) for name, value in distribution.items()}
    except (TypeError, ValueError):
        given = {}
    finite = all(np.isfinite(value).all() for value in given.values())
    if set(given) == {"mean", "sigma"} and finite and all(value.ndim == 0 for value in given.values()):
        mean, sigma = float(given["mean"]), float(given["sigma"])
        if mean > 0 and 0 <= sigma <= 2:
            # of mean 1: the logarithm's own mean is -sigma^2/2
            return np.asarray(mean * np.exp(sigma * rng.standard_normal(count) - sigma**2 / 2))
    if set(given) == {"values", "weights"} and finite and given["values"].ndim == 1 and given["values"].size:
        values, weights = given["values"], given["weights"]
        if weights.shape == values.shape and (weights >= 0).all() and weights.sum() > 0 and (values > 0).all():
            return np.asarray(rng.choice(values, count, p=weights / weights.sum()))
    raise SceneError(
        "[packing] radii: a distribution is {mean = ..., sigma = ...}, lognormal, sigma between 0 and 2, or {values = "
        f"[...], weights = [...]}}, as many positive radii as weights, not {dict(distribution)!r}"
    )


def lattice_packing(kind: str, cells: Sequence[int], spacing: float) -> tuple[Array, Array]:
    """Positions and box of a lattice of equal spacing between neighbours.

    Parameters
    ----------
    kind : "square", "hexagonal", "cubic" or "fcc"
    cells : sequence of int
        Unit cells along each axis; a hexagonal or fcc cell holds 2 or 4 particles.
    spacing : float
        Distance of nearest neighbours.

    Raises
    ------
    SceneError

    Examples
    --------
    >>> x, box = lattice_packing("hexagonal", [4, 4], 2.1)
    >>> x.shape
    (32, 2)
    """
    half = 0.5
    bases: dict[str, tuple[list[list[float]], list[float]]] = {
        "square": ([[0, 0]], [1, 1]),
        "hexagonal": ([[0, 0], [half, half]], [1, math.sqrt(3)]),
        "cubic": ([[0, 0, 0]], [1, 1, 1]),
        "fcc": ([[0, 0, 0], [half, half, 0], [half, 0, half], [0, half, half]], [math.sqrt(2)] * 3),
    }
    if kind not in bases:
        raise SceneError(f"[packing] unknown lattice {kind!r}; there are {', '.join(bases)}")
    basis, edges = (np.array(part, dtype=float) for part in bases[kind])
    if len(cells) != len(edges) or not all(isinstance(n, int) and 1 <= n <= 1000 for n in cells):
        raise SceneError(f"[packing] cells of a {kind} lattice must be {len(edges)} counts, 1 to 1000, not {cells!r}")
    if not spacing > 0 or not math.isfinite(spacing):
        raise SceneError(f"[packing] spacing must be positive, not {spacing!r}")
    corners = np.stack(np.meshgrid(*(np.arange(n) for n in cells), indexing="ij"), axis=-1).reshape(-1, len(edges))
    places = (corners[:, None, :] + basis[None, :, :] + 0.25).reshape(-1, len(edges))
    return places * edges * spacing, np.array(cells) * edges * spacing
