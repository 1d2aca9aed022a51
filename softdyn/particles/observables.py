"""What is measured on a run of many particles.

Stresses are > 0 in tension, forces in compression, as in the result. Frames are counted as those of a list.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from softdyn.particles.results import ParticleResult

Array = NDArray[np.float64]


def is_sheared(result: ParticleResult) -> bool:
    """Whether there is a shear flow."""
    return bool(result.x.shape[2] > 1 and result.gradient[:, 0, 1].any())


def is_periodic(result: ParticleResult) -> bool:
    """Whether the box is periodic along all axes, so that there is a stress; otherwise ``stress`` is a virial."""
    return bool(np.isfinite(result.box).all())


def strain(result: ParticleResult) -> Array:
    """Shear strain of the background flow at each frame: the integral of its rate, or how far a periodic box leans.

    The two are one but where a normal stress is imposed and makes the box longer one way than the other: then it is
    by how much the box leans, relative to its height.

    Examples
    --------
    With ``result`` of the example of :func:`softdyn.particles.simulate`:

    >>> strain(result)[-1].round(6)
    np.float64(0.1)
    """
    if np.isfinite(result.box[1]):
        lean: Array = result.cell[:, 0, 1] / result.cell[:, 1, 1]
        return lean
    rate = result.gradient[:, 0, 1]
    steps = np.diff(result.t, prepend=0.0)
    mean: Array = (rate + np.concatenate([rate[:1], rate[:-1]])) / 2
    return np.cumsum(mean * steps)


def has_viscosity(result: ParticleResult) -> bool:
    """Whether :func:`relative_viscosity` is defined: there is a shear flow in a periodic box, and the fluid's eta."""
    eta = result.parameters.get("eta")
    return is_sheared(result) and is_periodic(result) and eta is not None and not isinstance(eta, Mapping)


def relative_viscosity(result: ParticleResult) -> Array:
    """Viscosity relative to the fluid's, at each frame: 1 + sigma_xy/(eta shear_rate), the particles' part added.

    The symmetric part of the stress is taken, which does the work: where drag resists rotations, there is another. In
    two dimensions the spheres are a layer, as deep as the result's ``depth``. What each sphere does to the flow by
    itself, Einstein's 5/2 of the volume fraction, is not in it. Where nothing shears, as at the start under an imposed
    stress, it is nan.

    Raises
    ------
    ValueError
        If the run has no shear flow, no periodic box to take a stress of, or its law no viscosity eta.

    Examples
    --------
    With ``result`` of the example of :func:`softdyn.particles.simulate`:

    >>> relative_viscosity(result)[-1] > 1
    np.True_
    """
    if not has_viscosity(result):
        raise ValueError("a relative viscosity needs a shear flow in a periodic box, and the parameter eta")
    # a box under an imposed stress may be resisted by another viscosity than the law's
    viscosity = float(result.stats.get("viscosity", result.parameters["eta"]))
    viscous = viscosity * result.gradient[:, 0, 1]
    shear = (result.stress[:, 0, 1] + result.stress[:, 1, 0]) / 2
    return np.asarray(1 + np.divide(shear, viscous, out=np.full(len(result), np.nan), where=viscous != 0))


def normal_stress_differences(result: ParticleResult) -> tuple[Array, Array]:
    """N1 = sigma_xx - sigma_yy and N2 = sigma_yy - sigma_zz at each frame; N2 = 0 in two dimensions.

    x is the direction of the flow, y that of its gradient, z that of the vorticity.

    Raises
    ------
    ValueError
        If there is but one dimension.

    Examples
    --------
    With ``result`` of the example of :func:`softdyn.particles.simulate`:

    >>> first, second = normal_stress_differences(result)
    >>> first.shape == result.t.shape
    True
    """
    stress = result.stress
    if stress.shape[1] < 2:
        raise ValueError("normal stress differences need two dimensions at least")
    second = stress[:, 1, 1] - stress[:, 2, 2] if stress.shape[1] == 3 else np.zeros(len(result))
    return stress[:, 0, 0] - stress[:, 1, 1], second


def pressure(result: ParticleResult) -> Array:
    """Pressure of the particles at each frame, -tr(sigma)/d; of a virial where the box is not periodic.

    Examples
    --------
    With ``result`` of the example of :func:`softdyn.particles.simulate`:

    >>> pressure(result)[-1] > 0
    np.True_
    """
    mean: Array = -np.trace(result.stress, axis1=1, axis2=2) / result.stress.shape[1]
    return mean


def wall_forces(result: ParticleResult) -> Array:
    """Force of all particles on each wall at each frame, shape (frames, walls, d).

    Over the area of the wall it is a stress: along the normal a pressure, along the wall what drags it.

    Examples
    --------
    >>> floor = Wall(point=(0.0, 0.0), normal=(0.0, -1.0))
    >>> weighed = simulate(ParticleScene(
    ...     law="rognon_gay", parameters={"E": 1.0, "eta": 1.0}, positions=[[0.0, 1.01]], radii=1.0, gap=0.02,
    ...     wall=[floor], push=[Push([0], (0.0, -1e-3))], until_t=1e5,
    ... ))
    >>> wall_forces(weighed)[-1].round(9)
    array([[ 0.   , -0.001]])
    """
    count, walls, d = result.x.shape[1], *result.wall_normal.shape
    forces = np.zeros((len(result), walls, d))
    for frame, force in enumerate(forces):
        contacts = result.contacts(frame)
        on = contacts["j"] >= count
        pushed = contacts["F"][on, None] * contacts["n"][on]
        if "T" in contacts:
            pushed = pushed + contacts["T"][on]
        np.add.at(force, contacts["j"][on] - count, pushed)
    return forces


def rattlers(result: ParticleResult, frame: int = -1) -> NDArray[np.bool_]:
    """Which particles no pressed contacts can hold.

    Those with fewer than d + 1 of them, or than 2 where tangential forces hold, too; and, their contacts taken away,
    those that are left with fewer, until none is.

    Returns
    -------
    array of bool, shape (N,)

    Examples
    --------
    With ``result`` of the example of :func:`softdyn.particles.simulate`:

    >>> rattlers(result).shape
    (20,)
    """
    count, d = result.x.shape[1:]
    needed = 2 if "contact_T" in result.arrays else d + 1
    i, j = _pressed(result, frame)
    loose = np.zeros(max(count, int(np.max(j, initial=-1)) + 1), dtype=bool)  # walls never are
    while True:
        holding = ~(loose[i] | loose[j])
        few = _numbers(count, i[holding], j[holding]) < needed
        if np.array_equal(few, loose[:count]):
            return few
        loose[:count] = few


def coordination(result: ParticleResult, without_rattlers: bool = False) -> Array:
    """Mean number of pressed contacts of a particle at each frame: those with F > 0; walls count once.

    Parameters
    ----------
    result : ParticleResult
    without_rattlers : bool
        Leave out the particles of :func:`rattlers`, and their contacts; nan where no others are.

    Examples
    --------
    With ``result`` of the example of :func:`softdyn.particles.simulate`:

    >>> coordination(result)[-1] > 3
    np.True_
    """
    count = result.x.shape[1]
    numbers = np.full(len(result), np.nan)
    for frame in range(len(result)):
        i, j = _pressed(result, frame)
        kept = np.ones(count, dtype=bool)
        if without_rattlers:
            kept = ~rattlers(result, frame)
            holding = kept[i] & np.append(kept, True)[np.minimum(j, count)]
            i, j = i[holding], j[holding]
        if kept.any():
            numbers[frame] = _numbers(count, i, j).sum() / kept.sum()
    return numbers


def fabric(result: ParticleResult) -> Array:
    """Fabric tensor at each frame, shape (frames, d, d): the mean of n n over pressed contacts; of trace 1, or nan.

    Isotropic, it is 1/d times the unit tensor; its xy component is negative where contacts are along the direction of
    compression of a shear flow.

    Examples
    --------
    With ``result`` of the example of :func:`softdyn.particles.simulate`:

    >>> fabric(result)[-1].trace().round(12)
    np.float64(1.0)
    """
    tensors = np.full((len(result), *result.stress.shape[1:]), np.nan)
    for frame in range(len(result)):
        contacts = result.contacts(frame)
        n = contacts["n"][contacts["F"] > 0]
        if len(n):
            tensors[frame] = np.einsum("ca,cb->ab", n, n) / len(n)
    return tensors


def gap_distribution(result: ParticleResult, frame: int = -1, bins: int | None = None) -> tuple[Array, Array]:
    """Distribution of the gaps of contacts within their range: its density per unit of ln h.

    Parameters
    ----------
    result : ParticleResult
    frame : int
    bins : int, optional
        How many, equal in ln h; half the root of the number of contacts by default, 5 at least.

    Returns
    -------
    edges : array, shape (bins + 1,)
        In h, of those contacts that have one.
    density : array, shape (bins,)
        Its integral over ln h is 1. Both are empty without contacts.

    Examples
    --------
    With ``result`` of the example of :func:`softdyn.particles.simulate`:

    >>> at, density = gap_distribution(result, bins=8)
    >>> at.shape, density.shape
    ((9,), (8,))
    """
    h = result.contacts(frame)["h"]
    h = h[h > 0]
    if not len(h):
        return np.empty(0), np.empty(0)
    smallest = float(h.min())  # in units of which logarithms are taken
    width = float(np.log(h.max() / smallest))
    widen = 0.05 if width < 1e-9 else 1e-9  # gaps that differ by rounding alone are one
    edges: Array = smallest * np.exp(np.linspace(-widen, width + widen, (bins or _bins(h)) + 1))
    density: Array = np.histogram(h, edges)[0] / (len(h) * np.diff(np.log(edges / smallest)))
    return edges, density


def force_distribution(result: ParticleResult, frame: int = -1, bins: int | None = None) -> tuple[Array, Array]:
    """Distribution of the forces, relative to their mean size; what pulls is < 0.

    Contacts within their range that bear no force are left out.

    Parameters
    ----------
    result : ParticleResult
    frame : int
    bins : int, optional
        Over how many the values spread, about: 0 is an edge. By default as of :func:`gap_distribution`, 10 at least.

    Returns
    -------
    edges : array, shape (bins + 1,)
        Of f, of equal widths.
    density : array, shape (bins,)
        Its integral is 1. Both are empty without forces.

    Examples
    --------
    With ``result`` of the example of :func:`softdyn.particles.simulate`:

    >>> at, density = force_distribution(result, bins=8)
    >>> at.shape, density.shape
    ((10,), (9,))
    """
    F = result.contacts(frame)["F"]
    F = F[F != 0]
    if not len(F):
        return np.empty(0), np.empty(0)
    f = F / np.abs(F).mean()
    low, high = min(0.0, float(f.min())), max(0.0, float(f.max()))
    # the outermost values are within, whatever the rounding
    width = (1 + 1e-9) * (high - low) / (bins or max(10, _bins(f)))
    edges = width * np.arange(math.floor(low / width), math.ceil(high / width) + 1, dtype=np.float64)
    density: Array = np.histogram(f, edges)[0] / (len(f) * np.diff(edges))
    return edges, density


def mean_square_displacement(result: ParticleResult) -> Array:
    """Mean squares of displacements from the start that are not the flow's, along each axis, shape (frames, d).

    What is left of x - A x(0), with A the deformation of the periodic box, less its mean over the particles. Across the
    flow (y and z) it is diffusion by shear; along x it includes that the flow carries what has moved along y.

    Raises
    ------
    ValueError
        If the box is not periodic along all axes: then nothing says how its background has deformed.

    Examples
    --------
    With ``result`` of the example of :func:`softdyn.particles.simulate`:

    >>> mean_square_displacement(result)[0]
    array([0., 0.])
    """
    if not is_periodic(result):
        raise ValueError("displacements are measured against a box that is periodic along all axes")
    deformation = result.cell @ np.linalg.inv(result.cell[0])
    moved = result.x - np.einsum("fab,ib->fia", deformation, result.x[0])
    moved = moved - moved.mean(axis=1, keepdims=True)
    squares: Array = (moved**2).mean(axis=1)
    return squares


def _pressed(result: ParticleResult, frame: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Both ends of the contacts with F > 0."""
    contacts = result.contacts(frame)
    pressed = contacts["F"] > 0
    return contacts["i"][pressed], contacts["j"][pressed]


def _numbers(count: int, i: NDArray[Any], j: NDArray[Any]) -> NDArray[np.int64]:
    """Number of contacts of each particle."""
    return np.bincount(np.concatenate([i, j[j < count]]), minlength=count)


def _bins(values: Array) -> int:
    return max(5, math.isqrt(len(values)) // 2)


def swap_time(result: ParticleResult, parting: tuple[int, int], meeting: tuple[int, int]) -> float:
    """Time at which the gap of one pair grows beyond that of another: the middle of a T1 process.

    Between frames, the logarithm of the ratio of both gaps is taken as linear; pairs that are not in contact are
    infinitely far apart. Where that has no number, as between dry contacts, whose gap is 0, it is halfway.

    Parameters
    ----------
    result : ParticleResult
    parting, meeting : pair of int
        Numbers of the particles, the smaller first.

    Returns
    -------
    float
        nan if it does not happen within the run.

    Examples
    --------
    >>> places = [[-1.75, 0.0], [1.75, 0.0], [0.0, 1.01], [0.0, -1.01]]
    >>> pushes = [Push([0], (5e-3, 0.0)), Push([1], (-5e-3, 0.0))]
    >>> t1 = simulate(ParticleScene(
    ...     law="rognon_gay", parameters={"E": 1.0, "eta": 1.0}, positions=places, radii=1.0, gap=0.02,
    ...     push=pushes, until_t=1e5,
    ... ))
    >>> 0 < swap_time(t1, (2, 3), (0, 1)) < t1.t[-1]
    np.True_
    """
    ratios = np.empty(len(result))
    for frame in range(len(result)):
        contacts = result.contacts(frame)
        gaps = [
            float(np.min(contacts["h"][(contacts["i"] == i) & (contacts["j"] == j)], initial=np.inf))
            for i, j in (parting, meeting)
        ]
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios[frame] = np.log(gaps[0]) - np.log(gaps[1]) if np.isfinite(gaps).any() else np.nan
    over = np.flatnonzero((ratios[1:] >= 0) & (ratios[:-1] < 0))
    if not len(over):
        return float("nan")
    k = int(over[0])
    before, after = ratios[k], ratios[k + 1]
    fraction = before / (before - after) if np.isfinite([before, after]).all() else 0.5
    return float(result.t[k] + fraction * (result.t[k + 1] - result.t[k]))
