"""Plane shear of dry discs, by explicit steps and by contact dynamics: ``softdyn reproduce mu_i``.

Both shear a periodic box, so that no wall disturbs the flow. Explicit steps have elastic discs, k/P around 2000, at a
constant volume: what follows is the pressure. Rigid discs would jam at a constant volume; contact dynamics imposes the
stress across the flow, and the box breathes: what follows is the volume. Either gives the friction of the flow,
mu = shear stress over pressure, and the area fraction phi, against the inertial number I = rate d (density/P)^(1/2)
(GDR MiDi 2004, doi:10.1140/epje/i2003-10153-0). Lengths are mean diameters, the density and the shear rate are 1.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.colours import BLUE, ORANGE
from softdyn.particles.mechanisms.coulomb import Friction
from softdyn.particles.mechanisms.inertia import Inertia
from softdyn.particles.observables import pressure
from softdyn.particles.packing import random_packing
from softdyn.particles.particle_keys import ParticleScene
from softdyn.particles.particle_run import simulate_particles
from softdyn.particles.reproduced import reproduce, told
from softdyn.particles.results import ParticleResult
from softdyn.particles.three_models import grain_law

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

FILES = ("mu_i.png", "mu_i.svg", "mu_i.csv")
METHODS = {"explicit": BLUE, "contact dynamics": ORANGE}
RADII = (0.42, 0.46, 0.5, 0.54, 0.58)
#: Coefficient of friction of the grains, and their restitution.
MU, RESTITUTION = 0.4, 0.1
#: What is imposed: area fractions by explicit steps, inertial numbers by contact dynamics.
FRACTIONS = (0.73, 0.76, 0.785, 0.8, 0.81, 0.817, 0.822)
NUMBERS = (0.3, 0.2, 0.1, 0.03, 0.01, 0.003, 0.001)
#: Discs and strains of each method, and the part of the strain that is left out at the start.
COUNTS = {"explicit": 200, "contact dynamics": 100}
STRAINS = {"explicit": 12.0, "contact dynamics": 6.0}
START = 0.2
#: Inertial number of rigid discs from which on runs are three times as long: volumes scatter, and a step is cheap.
FAST = 0.1
#: Stiffness over pressure of the elastic discs.
STIFFNESS = 2000.0
#: Of rigid discs: strain of a step over I, and its bounds; distance to the laws, in largest impulses.
STEP, STEPS, RTOL = 0.1, (1e-3, 2e-3), 5e-2
#: Frames for a unit of strain, and blocks of a run that tell the error of a mean.
FRAMES, BLOCKS = 60, 8
#: Strain in which a box of rigid discs follows its stress, over I: viscosity of the box over pressure.
BREATH = 1.0


#: Of the line of friction of :func:`known_friction`.
AT_REST, RISE = 0.25, 1.1


def known_friction(I: float | Array) -> float | Array:  # noqa: E741 - the symbol of the paper
    """Friction of discs in plane shear, up to I = 0.2 (da Cruz et al. 2005, doi:10.1103/PhysRevE.72.021309)."""
    return AT_REST + RISE * I


def guessed_number(fraction: float) -> float:
    """Inertial number about which discs of an area fraction flow, which stiffness and times are chosen for."""
    return max(1e-3, (0.823 - fraction) / 0.32)


def scene_of(method: str, given: float, count: int, strain: float, seed: int = 1) -> ParticleScene:
    """Discs that are sheared by one of :data:`METHODS`.

    Parameters
    ----------
    method : str
    given : float
        Area fraction of elastic discs, inertial number of rigid ones.
    count : int
        Discs.
    strain : float
        At the end.
    seed : int
        Of the packing.
    """
    rigid = method == "contact dynamics"
    fraction = min(0.8, 0.82 - 0.32 * given) if rigid else given
    # rigid discs must not overlap at the start: they are packed a little larger than they are
    swollen = 1.001
    x, radii, lengths = random_packing(count, 2, fraction * swollen**2, [swollen * one for one in RADII], seed)
    shared: dict[str, Any] = {
        "positions": x.tolist(), "radii": (radii / swollen).tolist(), "box": lengths.tolist(),
        "inertia": Inertia(1.0, shape="disc"), "shear_rate": 1.0, "until_t": strain,
        "times": max(2, round(FRAMES * strain) + 1),
    }  # fmt: skip
    if rigid:
        imposed = given**-2
        return ParticleScene(
            method="contact_dynamics", friction=Friction(MU), stress={"yy": -imposed},
            stress_viscosity=BREATH * given * imposed, step=float(np.clip(STEP * given, *STEPS)), rtol=RTOL, **shared,
        )  # fmt: skip
    k = STIFFNESS * guessed_number(given) ** -2
    damping = -math.log(RESTITUTION) / math.hypot(math.pi, math.log(RESTITUTION))
    effective = math.pi / 8  # half the mass of a disc
    parameters = {"k": k, "c": 2 * damping * math.sqrt(k * effective)}
    return ParticleScene(grain_law(), parameters, method="explicit", friction=Friction(MU), rtol=1e-2, **shared)


@dataclass(frozen=True)
class Flowing:
    """What one run gives, without its start; the errors are those of the means of blocks.

    Attributes
    ----------
    method : str
    I, I_error, mu, mu_error, phi, phi_error : float
    """

    method: str
    I: float  # noqa: E741
    I_error: float
    mu: float
    mu_error: float
    phi: float
    phi_error: float


def measured(method: str, result: ParticleResult) -> Flowing:
    """Inertial number, friction and area fraction of a run.

    Of elastic discs P is the mean pressure; of rigid ones as well, since theirs is what the yy stress makes of it.
    """
    late = result.t >= START * result.t[-1]
    P, sheared = pressure(result)[late], result.stress[late, 0, 1]
    areas = np.prod(np.diagonal(result.cell[late], axis1=1, axis2=2), axis=1)
    phi = math.pi * float(np.sum(result.radii**2)) / areas
    blocks = [block for block in np.array_split(np.arange(len(P)), BLOCKS) if len(block)]

    def error(of: Any) -> float:
        values = [of(block) for block in blocks]
        return float(np.std(values, ddof=1) / math.sqrt(len(values))) if len(values) > 1 else 0.0

    mean = float(P.mean())
    number = mean**-0.5
    return Flowing(
        method,
        number,
        0.5 * number * error(lambda some: P[some].mean()) / mean,
        float(sheared.mean()) / mean,
        # of a ratio, whose two parts go together
        error(lambda some: (sheared[some] - float(sheared.mean()) / mean * P[some]).mean()) / mean,
        float(phi.mean()),
        error(lambda some: phi[some].mean()),
    )


def measure(
    fractions: Sequence[float] = FRACTIONS,
    numbers: Sequence[float] = NUMBERS,
    counts: dict[str, int] | None = None,
    strains: dict[str, float] | None = None,
    progress: bool = False,
) -> list[Flowing]:
    """Shear discs by both methods.

    Parameters
    ----------
    fractions, numbers : sequence of float
        Area fractions of elastic discs, and inertial numbers of rigid ones.
    counts, strains : mapping from str, optional
        Discs, and strain of each run, by the method.
    progress : bool
        Whether to show how far it is.
    """
    counts, strains = counts or COUNTS, strains or STRAINS
    every = [("explicit", one) for one in fractions] + [("contact dynamics", one) for one in numbers]
    return [
        measured(method, simulate_particles(scene_of(method, given, counts[method], strain)))
        for method, given in told(every, progress)
        for strain in [strains[method] * (3 if method == "contact dynamics" and given >= FAST else 1)]
    ]


def beside(found: Sequence[Flowing]) -> list[tuple[Flowing, float, float]]:
    """Rigid flows, with the friction and the fraction of elastic ones at the same I: on lines between those measured.

    Where elastic ones were measured on both sides alone.
    """
    elastic = sorted((one.I, one.mu, one.phi) for one in found if one.method == "explicit")
    if not elastic:
        return []
    numbers, mu, phi = (np.array(column) for column in zip(*elastic, strict=True))
    return [
        (one, float(np.interp(one.I, numbers, mu)), float(np.interp(one.I, numbers, phi)))
        for one in found
        if one.method != "explicit" and numbers[0] <= one.I <= numbers[-1]
    ]


def reproduce_mu_i(folder: Path) -> int:
    """Shear discs by both methods, print the friction and the fraction of each flow, and draw them.

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


def summary(found: Sequence[Flowing]) -> Iterator[str]:
    """Each flow, and how far the two methods are from one another."""
    yield f"plane shear of discs, mu = {MU:g}: friction and area fraction of the flow, with the errors of the means"
    yield f"  {'method':<18}{'I':>10}{'mu(I)':>18}{'phi(I)':>20}{f'{AT_REST:g} + {RISE:g} I':>16}"
    for one in found:
        known = f"{known_friction(one.I):.3f}" if one.I <= 0.2 else ""
        yield (
            f"  {one.method:<18}{one.I:>10.3g}{f'{one.mu:.3f} +- {one.mu_error:.3f}':>18}"
            f"{f'{one.phi:.4f} +- {one.phi_error:.4f}':>20}{known:>16}"
        )
    for one, mu, phi in beside(found):
        ratios = f"mu {one.mu / mu:.3f}, phi {one.phi / phi:.4f}"
        yield f"  at I = {one.I:.3g} contact dynamics over explicit steps: {ratios}"


def _table(found: Sequence[Flowing]) -> Iterator[str]:
    yield "method,I,I_error,mu,mu_error,phi,phi_error"
    for one in found:
        numbers = (one.I, one.I_error, one.mu, one.mu_error, one.phi, one.phi_error)
        yield ",".join([one.method, *(repr(number) for number in numbers)])


def draw(found: Sequence[Flowing]) -> Figure:
    """Draw mu(I) and phi(I) of both methods, beside the published line of friction."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    friction, fraction = figure.subplots(1, 2, sharex=True)
    line = np.geomspace(8e-4, 0.2, 100)
    known = np.asarray(known_friction(line))
    friction.fill_between(line, 0.9 * known, 1.1 * known, color="0.9", linewidth=0)
    friction.plot(line, known, color="0.45", linewidth=1, label="da Cruz et al. 2005, a tenth about it")
    for name, colour in METHODS.items():
        those = [one for one in found if one.method == name]
        I = [one.I for one in those]  # noqa: E741
        style: dict[str, Any] = {"fmt": "o", "color": colour, "markersize": 4, "capsize": 2, "label": name}
        xerr = [one.I_error for one in those]
        friction.errorbar(I, [one.mu for one in those], [one.mu_error for one in those], xerr, **style)
        fraction.errorbar(I, [one.phi for one in those], [one.phi_error for one in those], xerr, **style)
    friction.set(xlabel="inertial number $I$", ylabel=r"friction of the flow $\mu(I)$", xscale="log", ylim=(0, None))
    fraction.set(xlabel="inertial number $I$", ylabel=r"area fraction $\phi(I)$", xscale="log")
    for axes in (friction, fraction):
        axes.grid(alpha=0.3, linewidth=0.4)
    friction.legend(loc="upper left")
    return figure
