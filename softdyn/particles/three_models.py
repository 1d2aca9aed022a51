"""One packing, sheared as dry grains, as bubbles, and as soft spheres with films: ``softdyn reproduce models``.

All three have one spring, F = k x with the overlap x, at the same places at first:

- grains of Cundall & Strack: inertia, a dashpot, a tangential spring cut at mu N (explicit steps);
- bubbles of Durian: a drag b on each against the flow, no inertia;
- Soft Dynamics: droplets with that drag and a film of the same fluid between any two, whose gap is a state.

What they share is the elastic packing, so that the stress of the slowest flow is a yield stress of one size, but for
what the friction of grains adds. What they do not is all that resists a rate: collisions, drag, films.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.colours import BLUE, GREEN, ORANGE
from softdyn.particles.mechanisms.coulomb import Friction
from softdyn.particles.mechanisms.inertia import Inertia
from softdyn.particles.packing import Packing
from softdyn.particles.particle_keys import ParticleScene
from softdyn.particles.particle_run import simulate_particles
from softdyn.particles.reproduced import reproduce, told
from softdyn.particles.results import ParticleResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from softdyn.derive import ContactLaw

Array = NDArray[np.float64]

FILES = ("models.png", "models.svg", "models.csv")
MODELS = {"Cundall-Strack": GREEN, "bubble model": ORANGE, "Soft Dynamics": BLUE}
#: Shear rates, in units of k/b; k, b and the smaller radius are 1.
RATES = (0.02, 0.05, 0.1)
COUNT, FRACTION, STRAIN = 40, 0.95, 1.5
#: Strain from which on stresses are averaged.
STEADY = 0.6
#: Of the grains: mass of the smaller ones, in b^2/k; damping ratio of their dashpot; coefficient of friction.
MASS, DAMPING, MU = 0.05, 0.5, 0.5


def grain_law() -> ContactLaw:
    """The law ``linear_spring`` with a tangential spring, 2/7 as stiff."""
    from dataclasses import replace

    from sympy import Rational, oo

    from softdyn.derive import Tangential
    from softdyn.derive.laws.linear_spring import k, law

    return replace(law, name="cundall_strack", tangential=Tangential(sliding=oo, k_t=Rational(2, 7) * k), limits=())


def scene_of(model: str, rate: float, count: int = COUNT, strain: float = STRAIN, seed: int = 1) -> ParticleScene:
    """The packing sheared at a rate, by one of :data:`MODELS`.

    Parameters
    ----------
    model : str
    rate : float
        Shear rate, in k/b.
    count : int
        Particles.
    strain : float
        At the end.
    seed : int
        Of the packing.
    """
    packing = Packing("random", count=count, dimension=2, fraction=FRACTION, radii=[1.0, 1.4], seed=seed)
    shared: dict[str, Any] = {"packing": packing, "shear_rate": rate, "until_t": strain / rate, "times": 121}
    if model == "bubble model":
        return ParticleScene("durian", {"k": 1.0, "b": 1.0}, drag=1.0, rtol=1e-3, **shared)
    if model == "Soft Dynamics":  # F = 4 pi sigma delta is k x, and 6 pi eta R is b
        parameters = {"sigma": 1 / (2 * math.pi), "eta": 1 / (6 * math.pi)}
        return ParticleScene("droplet", parameters, drag=1.0, gap=0.02, range=0.5, rtol=1e-3, **shared)
    parameters = {"k": 1.0, "c": 2 * DAMPING * math.sqrt(MASS / 2)}
    return ParticleScene(
        grain_law(), parameters, inertia=Inertia(3 * MASS / (4 * math.pi)), friction=Friction(MU), method="explicit",
        **shared,
    )  # fmt: skip


@dataclass(frozen=True)
class Sheared:
    """Mean shear stresses and pressures, shape (models, rates), and each model's run at the middle rate."""

    rates: tuple[float, ...]
    stress: Array
    pressure: Array
    shown: Mapping[str, ParticleResult]


def measure(
    rates: Sequence[float] = RATES, count: int = COUNT, strain: float = STRAIN, progress: bool = False
) -> Sheared:
    """Shear the packing by all models at all rates.

    Parameters
    ----------
    rates : sequence of float
        Shear rates, in k/b.
    count : int
        Particles.
    strain : float
        Of each run.
    progress : bool
        Whether to show how far it is.
    """
    stress, pressure = np.empty((2, len(MODELS), len(rates)))
    shown = {}
    bar = told(
        [(m, r) for m in range(len(MODELS)) for r in range(len(rates))],
        progress,
    )
    for m, r in bar:
        name = tuple(MODELS)[m]
        result = simulate_particles(scene_of(name, rates[r], count, strain))
        late = result.t * rates[r] >= STEADY * strain / STRAIN
        stress[m, r] = result.stress[late, 0, 1].mean()
        pressure[m, r] = -np.trace(result.stress[late].mean(axis=0)) / 2
        if r == len(rates) // 2:
            shown[name] = result
    return Sheared(tuple(rates), stress, pressure, shown)


def reproduce_models(folder: Path) -> int:
    """Shear one packing by the three models, print their stresses, and draw them.

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


def summary(sheared: Sheared) -> Iterator[str]:
    """Mean shear stress and pressure of each model at each rate."""
    yield f"{COUNT} particles at a fraction of {FRACTION:g}: shear stress (pressure), in k/R, at the rate in k/b"
    yield "  " + "".join(f"{f'{rate:g}':>24}" for rate in sheared.rates)
    for name, stress, pressure in zip(MODELS, sheared.stress, sheared.pressure, strict=True):
        cells = "".join(f"{f'{s:.4g} ({p:.4g})':>24}" for s, p in zip(stress, pressure, strict=True))
        yield f"  {name:<16}{cells}"


def _table(sheared: Sheared) -> Iterator[str]:
    yield "model,shear_rate,shear_stress,pressure"
    for name, stress, pressure in zip(MODELS, sheared.stress, sheared.pressure, strict=True):
        for rate, s, p in zip(sheared.rates, stress, pressure, strict=True):
            yield f"{name},{rate!r},{float(s)!r},{float(p)!r}"


def draw(sheared: Sheared) -> Figure:
    """Draw stress and stress over pressure against the rate, and the forces in each model at the end of a run."""
    from matplotlib.figure import Figure

    from softdyn.particles.particle_plots import draw_network, largest_force

    figure = Figure(figsize=(9.0, 6.4), layout="constrained")
    grid = figure.add_gridspec(2, 6, height_ratios=[1.1, 1])
    of_stress, of_ratio = figure.add_subplot(grid[0, :3]), figure.add_subplot(grid[0, 3:])
    for (name, colour), stress, pressure in zip(MODELS.items(), sheared.stress, sheared.pressure, strict=True):
        of_stress.loglog(sheared.rates, stress, "o-", color=colour, markersize=4, label=name)
        of_ratio.semilogx(sheared.rates, stress / pressure, "o-", color=colour, markersize=4, label=name)
    of_stress.set(xlabel=r"shear rate $\dot\gamma\, b/k$", ylabel=r"shear stress $\sigma_{xy} R/k$")
    of_ratio.set(xlabel=r"shear rate $\dot\gamma\, b/k$", ylabel=r"shear stress over pressure", ylim=(0, None))
    of_stress.legend()
    for axes in (of_stress, of_ratio):
        axes.grid(alpha=0.3, which="both", linewidth=0.4)
    for place, (name, result) in enumerate(sheared.shown.items()):
        state, last = figure.add_subplot(grid[1, 2 * place : 2 * place + 2]), len(result) - 1
        side = float(result.box[0])
        window = np.array([[0.0, 0.0], [side, side]])
        draw_network(state, result, last, largest_force(result, [last]), window)
        state.set(xlabel="", ylabel="", xticks=[], yticks=[])
        state.set_title(name, fontsize="small")
    return figure
