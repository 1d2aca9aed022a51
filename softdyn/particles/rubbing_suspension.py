"""Viscosity of suspensions whose films break at a roughness, against known laws: ``softdyn reproduce rubbing``.

Nearly rigid spheres of two sizes in a shear flow, with the law of :mod:`softdyn.derive.laws.rough_spheres`: normal and
sliding films, Stokes' drag, and asperities that touch and rub below a gap of a hundredth of the smaller radius. What
each sphere does by itself, Einstein's 5/2 phi, is added; what distant spheres do to one another is not there.

The runs are short and of few spheres: the scatter of each within its steady part stands beside its mean.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softdyn.colours import BLUE, GREEN, ORANGE
from softdyn.particles.mechanisms.coulomb import Friction
from softdyn.particles.observables import relative_viscosity
from softdyn.particles.packing import Packing
from softdyn.particles.particle_keys import ParticleScene
from softdyn.particles.particle_run import simulate_particles
from softdyn.particles.reproduced import reproduce, told

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

FILES = ("rubbing.png", "rubbing.svg", "rubbing.csv")
FRACTIONS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.55)
COEFFICIENTS = {0.0: BLUE, 0.3: GREEN, 1.0: ORANGE}
#: Particles of a run, its strain, and the strain from which on it is averaged.
COUNT, STRAIN, STEADY = 40, 1.5, 0.75
#: Gap at which surfaces touch, in smaller radii.
ROUGHNESS = 0.01


def scene_of(fraction: float, mu: float, count: int = COUNT, strain: float = STRAIN, seed: int = 1) -> ParticleScene:
    """A suspension of a volume fraction, whose surfaces rub with the coefficient mu.

    Parameters
    ----------
    fraction : float
        Volume fraction.
    mu : float
        Coefficient of friction.
    count : int
        Particles.
    strain : float
        At the end.
    seed : int
        Of the packing.
    """
    from softdyn.derive.laws.rough_spheres import law

    return ParticleScene(
        law,
        {"E": 1e7, "eta": 1.0, "nu": 0.5, "P0": 1e5, "h_r": ROUGHNESS},
        packing=Packing("random", count=count, dimension=3, fraction=fraction, radii=[1.0, 1.4], seed=seed),
        gap=ROUGHNESS,
        range=0.3,
        tangential=True,
        friction=Friction(mu),
        shear_rate=1.0,
        drag=1.0,
        until_t=strain,
        times=61,
        rtol=1e-2,
    )


def known_laws(fraction: float) -> dict[str, float]:
    """Relative viscosities of measured suspensions.

    Of Boyer, Guazzelli & Pouliquen 2011 (doi:10.1103/PhysRevLett.107.188301; phi_c = 0.585, mu_1 = 0.32, mu_2 = 0.7,
    I_0 = 0.005), of Zarraga, Hill & Leighton 2000 (doi:10.1122/1.551083), and of Krieger & Dougherty (2.5,
    phi_c = 0.64).
    """
    square = (fraction / (0.585 - fraction)) ** 2
    friction = 0.32 + (0.7 - 0.32) / (1 + 0.005 * square)
    return {
        "Boyer": 1 + 2.5 * fraction / (1 - fraction / 0.585) + friction * square,
        "Zarraga": math.exp(-2.34 * fraction) / (1 - fraction / 0.62) ** 3,
        "Krieger-Dougherty": (1 - fraction / 0.64) ** (-2.5 * 0.64),
    }


@dataclass(frozen=True)
class Viscosities:
    """Means of relative viscosities, and their scatter in time, shape (coefficients, fractions)."""

    fractions: tuple[float, ...]
    coefficients: tuple[float, ...]
    mean: Array
    scatter: Array


def measure(
    fractions: Sequence[float] = FRACTIONS,
    coefficients: Sequence[float] = tuple(COEFFICIENTS),
    count: int = COUNT,
    strain: float = STRAIN,
    progress: bool = False,
) -> Viscosities:
    """Shear suspensions of all fractions with all coefficients of friction.

    Parameters
    ----------
    fractions : sequence of float
        Volume fractions.
    coefficients : sequence of float
        Of friction.
    count : int
        Particles.
    strain : float
        Of each run.
    progress : bool
        Whether to show how far it is.
    """
    mean, scatter = np.empty((2, len(coefficients), len(fractions)))
    bar = told(
        [(m, f) for f in range(len(fractions)) for m in range(len(coefficients))],
        progress,
    )
    for m, f in bar:
        result = simulate_particles(scene_of(fractions[f], coefficients[m], count, strain))
        late = relative_viscosity(result)[result.t >= STEADY * strain / STRAIN]
        mean[m, f], scatter[m, f] = late.mean() + 2.5 * fractions[f], late.std()
    return Viscosities(tuple(fractions), tuple(coefficients), mean, scatter)


def reproduce_rubbing(folder: Path) -> int:
    """Shear suspensions that rub, print their viscosities beside those of known laws, and draw them.

    Parameters
    ----------
    folder : Path
        Where to write :data:`FILES`.

    Raises
    ------
    SceneError
        If the folder cannot be written to.
    CompileError, IntegrationError
    """
    return reproduce(folder, FILES, partial(measure, progress=True), summary, _table, draw)


def summary(found: Viscosities) -> Iterator[str]:
    """Mean and scatter of each run, and the envelope of the known laws."""
    yield f"{COUNT} spheres in three dimensions: relative viscosity, and its scatter in time, at the volume fraction"
    yield "  " + " " * 16 + "".join(f"{f'{fraction:g}':>16}" for fraction in found.fractions)
    for mu, mean, scatter in zip(found.coefficients, found.mean, found.scatter, strict=True):
        cells = "".join(f"{f'{m:.3g} ({s:.2g})':>16}" for m, s in zip(mean, scatter, strict=True))
        yield f"  {f'mu = {mu:g}':<16}{cells}"
    known = [known_laws(fraction).values() for fraction in found.fractions]
    yield f"  {'known laws':<16}" + "".join(f"{f'{min(of):.3g} to {max(of):.3g}':>16}" for of in known)


def _table(found: Viscosities) -> Iterator[str]:
    yield "mu,fraction,relative_viscosity,scatter"
    for mu, mean, scatter in zip(found.coefficients, found.mean, found.scatter, strict=True):
        for fraction, m, s in zip(found.fractions, mean, scatter, strict=True):
            yield f"{mu!r},{fraction!r},{float(m)!r},{float(s)!r}"


def draw(found: Viscosities) -> Figure:
    """Draw the viscosities against the fraction, over the envelope of the known laws."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.2, 4.2), layout="constrained")
    axes = figure.add_subplot()
    line = np.linspace(0.05, 0.56, 200)
    known = [known_laws(float(fraction)) for fraction in line]
    low, high = ([pick(of.values()) for of in known] for pick in (min, max))
    axes.fill_between(line, low, high, color="0.85", linewidth=0, label="Boyer, Zarraga, Krieger-Dougherty")
    for mu, mean, scatter in zip(found.coefficients, found.mean, found.scatter, strict=True):
        colour = COEFFICIENTS.get(mu, "k")
        below = np.minimum(scatter, 0.9 * mean)
        bars = [below, scatter]
        axes.errorbar(
            found.fractions, mean, yerr=bars, fmt="o-", color=colour, markersize=4, capsize=2, label=rf"$\mu$ = {mu:g}"
        )
    axes.set(xlabel=r"volume fraction $\phi$", ylabel="relative viscosity", yscale="log")
    axes.grid(alpha=0.3, which="both", linewidth=0.4)
    axes.legend()
    return figure
