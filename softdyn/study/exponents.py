"""Measured exponents against predicted ones: the pair engine is run along lines of constant force across the plane.

Input: the regimes discovered of a law. Output: lambda1 = dln(delta)/dln(h) and lambda2 = dln(dh/dt)/dln(h), as
differences of what the runs put out, and for each regime the largest deviation from its predicted exponents, inside:
where the next corrections of its leading forms are small. These are known in closed form, and so is the deviation that
they cause, up to terms of second order.

A run under constant force ends at a film, which it reaches from the side on which the gap closes; the other side is run
from small gaps upwards.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from sympy import Expr, diff

from softdyn.derive.forms import force
from softdyn.derive.law import is_dry, is_rigid, parameters_of
from softdyn.derive.regimes import SIGN, Diagram, Regime, Side
from softdyn.derive.symbols import h
from softdyn.errors import IntegrationError, SceneError
from softdyn.pair.pair_run import simulate_pair
from softdyn.scene.pair_scene import Scene
from softdyn.study.plane import Plane, evaluate, holds, parameter_values, plane_of, shown_forces, sides_of, states
from softdyn.study.values import RealValues

Array = NDArray[np.float64]
Exponent = Literal["lambda1", "lambda2"]
QUANTITY: dict[Exponent, str] = {"lambda1": "delta", "lambda2": "dh_dt"}

#: A point is inside a regime where each of the next corrections of delta and dh/dt is below the first of these that
#: leaves any; and the ratio of each of its conditions below APART times that, since what follows is smaller by those.
SMALL = (0.01, 0.03, 0.1)
APART = 10
#: Output gaps per decade.
DENSITY = 20
#: Decades beyond the window of the pictures that are run: corrections are small only far from crossovers.
BEYOND = {"large gaps": 2, "small gaps": 3, "small forces": 4}
#: An opening gap starts slowly and the time it took is soon large against a step: such runs start anew so often.
DECADES = 2
#: Points at each end of a run without a difference of five.
ENDS = 2
RTOL = 1e-9


@dataclass(frozen=True)
class Run:
    """Measured exponents along a line of constant force, where the gap moves one way.

    Attributes
    ----------
    side : "compression" or "tension"
    kappa : float
        Size of the force over the law's unit of force.
    h, delta, dh_dt, lambda1, lambda2 : tuples of float
        In units of R, E and eta, in the order of growing gaps; delta is a size.
    """

    side: Side
    kappa: float
    h: tuple[float, ...]
    delta: tuple[float, ...]
    dh_dt: tuple[float, ...]
    lambda1: tuple[float, ...]
    lambda2: tuple[float, ...]


@dataclass(frozen=True)
class Deviation:
    """How far a measured exponent is from the predicted one inside a regime, at worst.

    Attributes
    ----------
    regime : str
    side : "compression" or "tension"
    exponent : "lambda1" or "lambda2"
    predicted : str
        The exponent of the leading form.
    resolved : bool
        Whether all of the largest next corrections are known.
    small : float
        What the next corrections are below, inside.
    points : int
        Measured inside.
    deviation : float or None
        The largest in size, measured - predicted; None if there are no points.
    expected : float or None
        There, of first order in the next corrections.
    h, kappa : float or None
        Where it was found.
    unexplained : float or None
        The largest size of deviation - expected over all points: of second order, where all is ``resolved``.
    """

    regime: str
    side: Side
    exponent: Exponent
    predicted: str
    resolved: bool
    small: float
    points: int
    deviation: float | None = None
    expected: float | None = None
    h: float | None = None
    kappa: float | None = None
    unexplained: float | None = None


@dataclass(frozen=True)
class Measurement:
    """What the pair engine says of a law's regimes.

    Attributes
    ----------
    law, target : str
    parameters : dict
        In units of R, E and eta.
    deviations : tuple of Deviation
    runs : tuple of Run
    failures : tuple of str
        Runs that could not be carried to their end, with the reason.
    """

    law: str
    target: str
    parameters: dict[str, float]
    deviations: tuple[Deviation, ...]
    runs: tuple[Run, ...]
    failures: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain data."""
        return asdict(self)

    def text(self) -> str:
        """Return the deviations as a table."""
        return "\n".join(_lines(self)) + "\n"


def measure(diagram: Diagram, target: str = "auto", real: RealValues | None = None) -> Measurement:
    """Run the pair engine along lines of constant force, and compare its exponents with those of each regime.

    Parameters
    ----------
    diagram : Diagram
    target : "auto", "c" or "numba"
    real : RealValues, optional
        Of the diagram's law: lines are then of forces that are powers of ten in N, as they are drawn.

    Raises
    ------
    SceneError
        If the law has no deflection, or no gap; or gives no typical value of one of its own parameters.
    CompileError
    """
    law = diagram.law
    if is_rigid(law) or is_dry(law):
        raise SceneError(
            f"law {law.name!r} is one-sided, without a {'deflection' if is_rigid(law) else 'gap'}: "
            "the pair engine cannot run it; measure the law that it is a limit of"
        )
    shown = plane_of(diagram, real)
    low, high = shown.xlim
    plane = replace(
        shown,
        xlim=(low - BEYOND["small gaps"], high + BEYOND["large gaps"]),
        ylim=(shown.ylim[0] - BEYOND["small forces"], shown.ylim[1]),
    )
    values = parameter_values(law)
    parameters = {symbol.name: values[symbol] for symbol in parameters_of(law)}
    X = np.linspace(*plane.xlim, round(DENSITY * (plane.xlim[1] - plane.xlim[0])) + 1)
    runs: list[Run] = []
    failures: list[str] = []
    targets: set[str] = set()
    levels = {(regime.name, regime.side): _level(diagram, regime, plane) for regime in _decided(diagram)}
    for side in sides_of(diagram):
        for kappa in _forces(diagram, plane, shown, side, levels):
            for gaps in _stretches(diagram, plane, side, kappa, X):
                try:
                    run, used = _run(diagram, parameters, side, kappa, kappa * plane.unit, gaps, target)
                except IntegrationError as error:
                    failures.append(f"{side}, kappa = {kappa:.3g}, h/R = {gaps[0]:.3g} to {gaps[-1]:.3g}: {error}")
                else:
                    runs.append(run)
                    targets.add(used)
    deviations = tuple(
        deviation
        for regime in _decided(diagram)
        for deviation in _deviations(diagram, regime, plane, runs, levels[regime.name, regime.side])
    )
    return Measurement(law.name, ", ".join(sorted(targets)), parameters, deviations, tuple(runs), tuple(failures))


def _decided(diagram: Diagram) -> list[Regime]:
    """Regimes within the model that have exponents, of the sides that are looked at."""
    return [
        regime
        for regime in diagram.regimes
        if regime.side in sides_of(diagram) and regime.inside and set(QUANTITY.values()) <= set(regime.forms)
    ]


def _grid(plane: Plane) -> tuple[Array, Array]:
    """Points of the plane, four to a decade either way, in rows of constant force."""
    X, Y = np.meshgrid(np.arange(*plane.xlim, 0.25), np.arange(*plane.ylim, 0.25))
    return X, Y


def _level(diagram: Diagram, regime: Regime, plane: Plane) -> float:
    """Smallest of SMALL that leaves points inside a regime; the largest, if none does."""
    grid = _grid(plane)
    return next((small for small in SMALL if _inside(diagram, regime, plane, *grid, small).any()), SMALL[-1])


def _forces(
    diagram: Diagram, plane: Plane, shown: Plane, side: Side, levels: Mapping[tuple[str, Side], float]
) -> list[float]:
    """Forces over the unit: those of the pictures, and for each regime the one with most points inside it."""
    X, Y = _grid(plane)
    found = set(shown_forces(diagram, shown))
    for regime in _decided(diagram):
        if regime.side == side:
            inside = _inside(diagram, regime, plane, X, Y, levels[regime.name, side]).sum(axis=1)
            if inside.any():
                found.add(10.0 ** float(Y[np.argmax(inside), 0]))
    return sorted(found)


def _inside(diagram: Diagram, regime: Regime, plane: Plane, X: Array, Y: Array, small: float) -> NDArray[np.bool_]:
    """Whether points are inside a regime, with all five that a difference is made of."""
    inside = _corrections_are_small(diagram, regime, plane, X, Y, small)
    for shift in (-ENDS / DENSITY, ENDS / DENSITY):
        if inside.any():
            inside &= _corrections_are_small(diagram, regime, plane, X + shift, Y, small)
    return inside


def _corrections_are_small(
    diagram: Diagram, regime: Regime, plane: Plane, X: Array, Y: Array, small: float
) -> NDArray[np.bool_]:
    """Whether points are in a regime, far from its bounds, where all its next corrections are small."""
    inside = holds(regime, plane, X, Y)
    ratios = [(condition.small, condition.large) for condition in regime.conditions]
    ratios += [(force, regime.edge)] if regime.edge is not None else []
    for low, high in ratios:
        inside &= evaluate(low, plane, X, Y) < APART * small * evaluate(high, plane, X, Y)
    for exponent in QUANTITY:
        form = regime.forms[QUANTITY[exponent]]
        for correction in form.corrections:
            inside &= np.abs(evaluate(correction, plane, X, Y)) < small
    if diagram.law.F_adh != 0 and inside.any():
        unlisted, slope, competing = _remote(diagram, regime, plane, X, Y)
        inside &= (np.abs(unlisted) < small) & (np.abs(slope) < small) & (competing < small)
    return inside


def _remote(diagram: Diagram, regime: Regime, plane: Plane, X: Array, Y: Array) -> tuple[Array, Array, Array]:
    """What F_adh adds to dh/dt beyond its own leading form and corrections: they leave out what is below any power.

    Returns
    -------
    unlisted, slope : arrays
        A relative correction of dh/dt, and what it adds to lambda2.
    competing : array
        The smaller of F and F_adh over the larger, in size.
    """
    step, sign, form = 1e-3, SIGN[regime.side], regime.forms.get("F_adh")
    terms = []
    for shift in (-step, 0.0, step):
        gaps, forces = 10.0 ** (X + shift), plane.unit * 10.0**Y
        exact = sign * states(diagram.law, regime.side, gaps, forces)["F_adh"]
        listed = np.zeros(exact.shape)
        if form is not None:
            corrections = [evaluate(term, plane, X + shift, Y) for term in form.corrections]
            listed = sign * evaluate(form.leading, plane, X + shift, Y) * (1 + sum(corrections))
        with np.errstate(all="ignore"):
            terms.append((listed - exact) / (forces - listed))
    with np.errstate(all="ignore"):
        ratio = np.abs(exact) / forces
        competing = np.minimum(ratio, 1 / ratio)
    return terms[1], (terms[2] - terms[0]) / (2 * step * math.log(10)), competing


def _stretches(diagram: Diagram, plane: Plane, side: Side, kappa: float, X: Array) -> Iterator[Array]:
    """Gaps through which a run goes one way, within the model, in the order of passage."""
    gaps = 10.0**X
    rate = states(diagram.law, side, gaps, np.asarray(plane.unit * kappa))["dh_dt"]
    way = np.where(np.isfinite(rate), np.sign(rate), 0.0)
    starts = np.flatnonzero(np.diff(way, prepend=np.nan))
    for start, end in zip(starts, [*starts[1:], len(way)], strict=True):
        if way[start] != 0 and end - start > 2 * ENDS:
            yield gaps[start:end] if way[start] > 0 else gaps[start:end][::-1]


def _run(
    diagram: Diagram, parameters: dict[str, float], side: Side, kappa: float, push: float, gaps: Array, target: str
) -> tuple[Run, str]:
    """Simulate, and difference the output."""
    opening = gaps[-1] > gaps[0]
    length = DECADES * DENSITY if opening else len(gaps)
    parts = []
    for start in range(0, len(gaps) - 1, length):
        piece = gaps[start : start + length + 1]
        scene = Scene(
            law=diagram.law, parameters=parameters, h=float(piece[0]), force=SIGN[side] * push,
            until_h=float(piece[-1]), gaps=piece, quantities=("dh_dt",), rtol=RTOL, target=target,
        )  # fmt: skip
        result = simulate_pair(scene)
        parts.append(np.array([result.h, np.abs(result.delta), result.dh_dt])[:, 1 if start else 0 :])
    columns = np.concatenate(parts, axis=1)
    columns = columns if opening else columns[:, ::-1]
    slopes = [_slope(np.log(np.abs(values))) for values in columns[1:]]
    inner = columns[:, ENDS:-ENDS]
    return Run(side, kappa, *(tuple(map(float, values)) for values in (*inner, *slopes))), result.target


def _slope(y: Array) -> Array:
    """Difference of five points on the even grid of ln h: wrong by step^4/30 of the fifth derivative."""
    step = math.log(10) / DENSITY
    return (y[:-4] - 8 * y[1:-3] + 8 * y[3:-1] - y[4:]) / (12 * step)


def _deviations(diagram: Diagram, regime: Regime, plane: Plane, runs: list[Run], small: float) -> Iterator[Deviation]:
    """Compare the two exponents of a regime with what was measured inside."""
    inside = []
    for run in runs:
        X = np.log10(np.array(run.h))
        if run.side == regime.side:
            here = _inside(diagram, regime, plane, X, np.full(len(X), math.log10(run.kappa)), small)
            if here.any():
                inside.append((run, here))
    at = [np.array([(math.log10(gap), math.log10(run.kappa)) for gap in np.array(run.h)[here]]) for run, here in inside]
    X, Y = np.concatenate([np.empty((0, 2)), *at]).T
    for exponent in QUANTITY:
        form = regime.forms[QUANTITY[exponent]]
        predicted = regime.lambda1 if exponent == "lambda1" else regime.lambda2
        assert predicted is not None
        resolved = all(regime.forms[quantity].resolved for quantity in QUANTITY.values())
        found = Deviation(regime.name, regime.side, exponent, str(predicted), resolved, small, len(X))
        if not len(X):
            yield found
            continue
        measured = np.concatenate([np.array(getattr(run, exponent))[here] for run, here in inside])
        deviation = measured - evaluate(predicted, plane, X, Y)
        expected = np.sum([np.zeros(len(X)), *(_slope_of(term, plane, X, Y) for term in form.corrections)], axis=0)
        if exponent == "lambda2" and diagram.law.F_adh != 0:
            expected = expected + _remote(diagram, regime, plane, X, Y)[1]
        worst = int(np.argmax(np.abs(deviation)))
        yield replace(
            found,
            deviation=float(deviation[worst]),
            expected=float(expected[worst]),
            h=float(10 ** X[worst]),
            kappa=float(10 ** Y[worst]),
            unexplained=float(np.max(np.abs(deviation - expected))),
        )


def _slope_of(correction: Expr, plane: Plane, X: Array, Y: Array) -> Array:
    """What a relative correction c adds to the exponent: dln(1 + c)/dln(h) = h dc/dh, to first order."""
    return evaluate(h * diff(correction, h), plane, X, Y)


def _lines(measured: Measurement) -> Iterator[str]:
    yield (
        f"measured along lines of constant force, target {measured.target}: {len(measured.runs)} runs; largest "
        "deviations inside, where the next corrections are small: what they explain is expected"
    )
    width = max([6, *(len(one.regime) for one in measured.deviations)])
    for side in dict.fromkeys(one.side for one in measured.deviations):
        yield f"  {side}"
        yield (
            f"    {'regime':{width}}  exponent  predicted  largest deviation  expected   at h/R    kappa     "
            "unexplained  points  corrections"
        )
        for one in measured.deviations:
            if one.side != side:
                continue
            start = f"    {one.regime:{width}}  {one.exponent:8}  {one.predicted:>9}  "
            if one.deviation is None or one.expected is None or one.h is None or one.kappa is None:
                yield f"{start}no line of constant force comes far enough inside"
                continue
            yield (
                f"{start}{one.deviation:>+17.2e}  {one.expected:>+9.2e}  {one.h:<9.2e} {one.kappa:<9.2e} "
                f"{one.unexplained:<11.1e}  {one.points:<6}  < {one.small:g}"
                + ("" if one.resolved else ", not all known")
            )
    for failure in measured.failures:
        yield f"  not run to its end: {failure}"
