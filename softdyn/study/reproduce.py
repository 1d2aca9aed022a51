"""Reproduce Rognon & Gay, arXiv 0803.1573: their derivation, limits, simulations and figures, in one run.

Everything printed and drawn comes from the law's declaration or from the simulations made here: what is expected from
the limits that the law claims and that are proved again, what is found from the runs, and the errors from a comparison
with exact quadrature. Units: R, E and eta are 1, so that F = kappa and t is in units of eta/E.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from sympy import lambdify
from tqdm import tqdm

from softdyn.derive.dynamics import generic_dynamics
from softdyn.derive.forms import force as F
from softdyn.derive.forms import force_unit
from softdyn.derive.laws.rognon_gay import law as LAW
from softdyn.derive.limits import Finding, check_limits
from softdyn.derive.regimes import Diagram, Regime, discover
from softdyn.derive.symbols import E, R, eta, h
from softdyn.pair.pair_run import simulate_pair
from softdyn.results.pair_result import PairResult
from softdyn.results.whole_files import require_folder, written_whole
from softdyn.scene.pair_scene import Scene
from softdyn.study import figures
from softdyn.study.plane import length_ratios, monomial
from softdyn.terminal import as_it_is

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

DEFAULT_FOLDER = Path("softdyn-results")
FILES = ("figure3.png", "figure3.svg", "figure4.png", "figure4.svg", "figure3.csv")
PARAMETERS = {"R": 1.0, "E": 1.0, "eta": 1.0}
KAPPAS = np.geomspace(1e-6, 0.3, 13)
#: 20 gaps per decade, from far apart to nearly in contact.
GAPS = np.geomspace(1e2, 1e-4, 121)
RTOL = 1e-9

#: Columns of figure3.csv, all dimensionless; ``regime`` is a word.
COLUMNS = (
    "kappa",
    "h/R",
    "t",
    "t_quadrature",
    "relative error",
    "delta/R",
    "X/R",
    "dh_dt",
    "lambda1",
    "lambda2",
    "regime",
)


@dataclass(frozen=True)
class Study:
    """The simulated approaches.

    Attributes
    ----------
    table : mapping from str to array of shape (forces, gaps)
        The columns of figure3.csv; ``regime`` holds names.
    allowed : array of shape (forces,)
        Relative error in t that the tolerance allows each run.
    target : str
    steps : int
        Of all runs.
    """

    table: Mapping[str, NDArray[Any]]
    allowed: Array
    target: str
    steps: int


@dataclass(frozen=True)
class Comparison:
    """One leading form against the simulation, at the simulated point deepest inside its regime.

    The form is prefactor * kappa**power * (h/R)**exponent; ``found`` prefactor and exponent are the simulated value
    over the same powers, and the simulated local exponent.
    """

    regime: str
    quantity: str
    h: float
    kappa: float
    exponent: float
    exponent_found: float
    prefactor: float
    prefactor_found: float


def reproduce(folder: str | Path = DEFAULT_FOLDER, target: str = "auto", progress: bool = True) -> int:
    """Re-derive the paper's law, prove its limits, find its regimes, simulate it, and draw its figures 3 and 4.

    Parameters
    ----------
    folder : path
        Where to write :data:`FILES`; made if it is not there.
    target : "auto", "c" or "numba"
    progress : bool
        Show the progress on stderr, if that is a terminal.

    Returns
    -------
    int
        0 if every limit is proved and every error is within what the tolerance allows, else 1. The summary is printed.

    Raises
    ------
    SceneError
        If the folder cannot be written to.
    CompileError, IntegrationError
    """
    start = time.perf_counter()
    folder = Path(folder)
    require_folder(folder)
    findings = derive()
    print("\n".join(derivation_lines(findings)), flush=True)
    study = run(target, progress)
    _write(folder, study)
    print("\n".join(study_lines(study)))
    print(f"\nwritten to {folder}: {', '.join(FILES)}\nrun time {time.perf_counter() - start:.1f} s")
    proved = all(finding.verdict == "proved" for finding in findings)
    return 0 if proved and np.all(study.table["relative error"] <= study.allowed[:, None]) else 1


def derive() -> list[Finding]:
    """Derive eqs. 7 and 9, and check what the law claims of its limits."""
    generic_dynamics()  # raises if C or D is not the paper's
    return check_limits(LAW)


@cache
def diagram() -> Diagram:
    """Return the regimes of the paper's law."""
    return discover(LAW)


def regimes() -> list[Regime]:
    """Those in compression, within the model."""
    return [regime for regime in diagram().regimes if regime.inside and regime.side == "compression"]


def derivation_lines(findings: Sequence[Finding]) -> Iterator[str]:
    """Summary of the derivation."""
    yield f"{LAW.name}: {LAW.source}"
    yield "\nderived from force balance and geometry"
    for name, equation in generic_dynamics().steps:
        if name.startswith(("solved for dh/dt", "stiffness", "friction", "centre dynamics")):
            yield f"  {equation.lhs} = {equation.rhs}    [{name}]"
    yield "\nlimits claimed"
    for finding in findings:
        yield (f"  {finding.limit:<12}{finding.ordering:<18}{finding.quantity:<8}{finding.verdict:<10}{finding.reason}")


def run(target: str = "auto", progress: bool = False) -> Study:
    """Simulate the approach under each force, and compare its times with exact quadrature."""
    rows, allowed, steps = [], [], 0
    for force in tqdm(
        KAPPAS,
        desc="approaches",
        unit="force",
        leave=False,
        file=as_it_is(sys.stderr),
        disable=None if progress else True,
    ):
        result, exact = _approach(float(force), target, "integrate"), _approach(float(force), target, "quadrature")
        rows.append(_row(result, exact, float(force)))
        # A step may put ln h off by RTOL, hence t by RTOL over the rate of ln h; t itself sums the lengths of the steps
        # in ln h over that rate: its relative error is at most RTOL over the shortest step, not far below 1/steps
        allowed.append(RTOL * result.stats["steps"])
        steps += result.stats["steps"]
    table = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    return Study(table, np.array(allowed), result.target, steps)


def _approach(force: float, target: str, method: str) -> PairResult:
    scene = Scene(
        law=LAW.name,
        target=target,
        parameters=PARAMETERS,
        h=float(GAPS[0]),
        force=force,
        until_h=float(GAPS[-1]),
        gaps=GAPS,
        quantities=("X", "dh_dt", "lambda1", "lambda2"),
        rtol=RTOL,
        method=method,
    )
    return simulate_pair(scene)


def _row(result: PairResult, exact: PairResult, force: float) -> dict[str, NDArray[Any]]:
    names = np.array([regime.name for regime in regimes()])
    deviation = np.abs(result.t - exact.t)
    return {
        "kappa": np.full(len(GAPS), force),
        "h/R": result.h,
        "t": result.t,
        "t_quadrature": exact.t,
        # both start at 0
        "relative error": np.divide(deviation, exact.t, out=deviation, where=exact.t > 0),
        "delta/R": result.delta,
        "X/R": result.X,
        "dh_dt": result.dh_dt,
        "lambda1": result.lambda1,
        "lambda2": result.lambda2,
        "regime": names[np.argmax([depth(regime, result.h, force) for regime in regimes()], axis=0)],
    }


def depth(regime: Regime, gap: Array, force: Array | float) -> Array:
    """How far inside a regime each point lies: decades to its nearest crossover, as ratios of lengths; < 0 outside.

    Parameters
    ----------
    regime : Regime
        Of the paper's law.
    gap : array
        h/R.
    force : float or array of the same shape
        kappa.
    """
    # R = E = 1
    ratios = [lambdify((h, F), ratio.subs({R: 1, E: 1}))(gap, force) for ratio in length_ratios(regime)]
    return np.asarray(np.min([-np.log10(np.broadcast_to(ratio, np.shape(gap))) for ratio in ratios], axis=0))


def compare(study: Study) -> list[Comparison]:
    """Leading forms, expected, against the simulated values at the deepest point of each regime."""
    table, found = study.table, []
    for regime in regimes():
        at = np.unravel_index(np.argmax(depth(regime, table["h/R"], table["kappa"])), table["h/R"].shape)
        gap, force = float(table["h/R"][at]), float(table["kappa"][at])
        values = {
            "delta/R": (regime.delta / R, table["delta/R"][at], table["lambda1"][at]),
            # V = F/(eta R) is kappa in these units
            "-dh/dt / V": (-regime.dh_dt * eta * R / F, -table["dh_dt"][at] / force, table["lambda2"][at]),
        }
        for quantity, (form, value, slope) in values.items():
            prefactor, slope_expected, power = map(float, monomial(form, force_unit(LAW)))
            powers = force**power * gap**slope_expected
            found.append(
                Comparison(
                    regime.name, quantity, gap, force,
                    slope_expected, float(slope), prefactor, float(value / powers),
                )
            )  # fmt: skip
    return found


def study_lines(study: Study) -> Iterator[str]:
    """Summary of the simulations: exponents, prefactors and errors."""
    yield f"\nsimulated with target {study.target}, rtol = {RTOL:g}, {study.steps} steps in all"
    yield (
        f"  {len(KAPPAS)} forces, kappa = {KAPPAS[0]:g} to {KAPPAS[-1]:g}; "
        f"{len(GAPS)} gaps, h/R = {GAPS[0]:g} to {GAPS[-1]:g}"
    )
    yield "\nexpected (proved limits) and found (simulated, at the point deepest inside the regime)"
    yield "  regime      quantity     exponent in h      prefactor               at h/R      kappa"
    yield "                          expected  found     expected   found"
    for one in compare(study):
        yield (
            f"  {one.regime:<12}{one.quantity:<12}{one.exponent:>8g}  {one.exponent_found:<9.4f}"
            f"{one.prefactor:>9.6f}  {one.prefactor_found:<10.6f}{one.h:>10.3g}  {one.kappa:>9.3g}"
        )
    error = study.table["relative error"]
    at = np.unravel_index(np.argmax(error), error.shape)
    yield (
        f"\nlargest relative error of t against exact quadrature: {error[at]:.2e}, "
        f"at h/R = {study.table['h/R'][at]:.3g}, kappa = {study.table['kappa'][at]:.3g}"
    )
    beyond = np.flatnonzero((error > study.allowed[:, None]).any(axis=1))
    yield f"allowed, rtol times the steps of that run: {study.allowed[at[0]]:.2e}" + (
        f"; exceeded for kappa = {', '.join(f'{KAPPAS[i]:.3g}' for i in beyond)}" if len(beyond) else ""
    )


def csv_lines(table: Mapping[str, NDArray[Any]]) -> Iterator[str]:
    """Lines of figure3.csv; numbers to their last digit."""
    yield ",".join(COLUMNS)
    for values in zip(*(table[name].ravel().tolist() for name in COLUMNS), strict=True):
        yield ",".join(map(str, values))


def _write(folder: Path, study: Study) -> None:
    with written_whole(folder / "figure3.csv") as temporary:
        temporary.write_text("\n".join(csv_lines(study.table)) + "\n", encoding="utf-8")
    with figures.paper_style():
        drawn: dict[str, Figure] = {"figure3": figures.figure3(diagram(), study.table), "figure4": figures.figure4(LAW)}
        for name, figure in drawn.items():
            figures.save(figure, folder / f"{name}.png")
            figures.save(figure, folder / f"{name}.svg")
