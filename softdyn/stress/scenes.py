"""Random ordinary scenes at default settings, each against a reference computed another way.

Under a constant force that is Gauss's quadrature, else LSODA on (ln h, delta), delta differentiated and not solved for,
restarted at every kink. What differs from it is judged by collocation in 30 digits.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.api import simulate
from softdyn.pair.pair_run import ALLOWED_ERROR
from softdyn.results.pair_result import PairResult
from softdyn.scene.pair_scene import Scene
from softdyn.stress.judge import OUTCOMES, REFUSED, RIGHT, WRONG, judge
from softdyn.stress.precise_pairs import Case, make_reference

Array = NDArray[np.float64]
SEED = 20261123
OUTPUTS = 12
#: Default tolerance, and what LSODA can be asked for.
RTOL = Scene.rtol
TIGHT = 1e-13


def random_case(random: np.random.Generator, number: int) -> Case:
    """One ordinary scene: forces up to 0.3 E R^2, gaps from 1e-4 to 100 R, some decades of motion."""

    def decade(low: float, high: float) -> float:
        return float(10 ** random.uniform(low, high))

    h0, kappa, name = decade(-3, 2), decade(-8, -0.5), str(number)
    # the time in which h would halve, about, by Stokes' and Poiseuille's limits
    duration = 6 * math.pi * max(h0, 1.0) / kappa * decade(-1, 0.8)
    kind = number % 5
    if kind == 0:
        return Case("random", name, "force", float(kappa), h0, h0 * decade(-4, -0.5), by_gap=True)
    w, phase = random.uniform(1, 30) / duration, random.uniform(0, 2 * math.pi)
    if kind == 1:
        sine = ("sine", kappa * random.uniform(-0.3, 1.5), kappa, w, phase)
        return Case("random", name, "force", sine, h0, duration)
    if kind == 2:
        times = np.concatenate([[0.0], np.sort(random.uniform(0, duration, 4)), [1.01 * duration]])
        values = kappa * random.uniform(-0.5, 1, len(times))
        return Case("random", name, "force", ("table", tuple(times.tolist()), tuple(values.tolist())), h0, duration)
    # moved by up to half of h, or R if that is less, but never so far that the deflection is beyond 0.2 R
    reach = min(h0, 0.3) * random.uniform(0.1, 1.0)
    swing = random.uniform(1, 12)
    duration = decade(1, 5)
    w = swing / duration
    if kind == 3:
        return Case("random", name, "velocity", ("sine", 0.0, -reach * w, w, phase), h0, duration)
    times = np.concatenate([[0.0], np.sort(random.uniform(0, duration, 4)), [1.01 * duration]])
    base = 2 + h0 - np.concatenate([[0.0], random.uniform(-1, 1, len(times) - 1)]) * reach
    stiffness = decade(-3, 2)
    table = ("table", tuple(times.tolist()), tuple(base.tolist()))
    return Case("random", name, "spring", table, h0, duration, stiffness=stiffness)


def _kinks(case: Case) -> list[float]:
    """Times within the run at which what is given has a kink, or a force crosses zero."""
    given, found = case.given, []
    if given[0] == "table":
        times, values = given[1:]
        found += times[1:-1]
        if case.drive == "force":
            pairs = itertools.pairwise(zip(times, values, strict=True))
            found += [t - F * (t2 - t) / (F2 - F) for (t, F), (t2, F2) in pairs if F * F2 < 0]
    elif case.drive == "force":
        m, k, w, f = given[1:]
        if abs(m) < k:
            for root in (math.asin(-m / k), math.pi - math.asin(-m / k)):
                first = math.ceil((f - root) / (2 * math.pi))
                last = math.floor((w * case.end + f - root) / (2 * math.pi))
                found += [(root + 2 * math.pi * n - f) / w for n in range(first, last + 1)]
    return sorted(t for t in found if 0 < t < case.end)


def _lsoda(case: Case, delta0: float) -> tuple[Array, Array]:
    """Gap and deflection at the outputs, from the paper's equations as differential equations for both."""
    from scipy.integrate import solve_ivp

    compliance = 1 / case.stiffness
    by_force = case.drive == "force"

    def given(t: float, middle: float) -> tuple[float, float]:
        """What is given, and its rate."""
        if case.given[0] == "sine":
            m, k, w, f = case.given[1:]
            return m + k * math.sin(w * t + f), k * w * math.cos(w * t + f)
        times, values = case.given[1:]
        i = int(np.searchsorted(times, middle)) - 1
        slope = (values[i + 1] - values[i]) / (times[i + 1] - times[i])
        return values[i] + slope * (t - times[i]), slope

    def rates(t: float, y: Array, middle: float, unit: float) -> list[float]:
        h, d = math.exp(y[0]), y[1] * unit
        bar = h / (1 + h)
        a = math.sqrt(2 * (bar + abs(d)))
        value, slope = given(t, middle)
        F = value if by_force else 4 / 9 * a * d
        h_dot = -F / (1.5 * math.pi * a**4 / bar**3)
        F_d, F_h = 4 / 9 * (a + abs(d) / a), 4 / 9 * d / a / (1 + h) ** 2
        if by_force:
            d_dot = (slope - F_h * h_dot) / F_d
        else:
            V = value if case.drive == "velocity" else slope
            d_dot = (h_dot - V - compliance * F_h * h_dot) / (2 + compliance * F_d)
        return [h_dot / h, d_dot / unit]

    unit = max(abs(delta0), 1e-6)
    y = np.array([math.log(case.h0), delta0 / unit])
    h, delta = [], []
    for start, end in itertools.pairwise([0.0, *_kinks(case), case.end]):
        inside = [t for t in case.at if start < t <= end]
        stops = inside if end in inside else [*inside, end]
        found = solve_ivp(
            rates, (start, end), y, method="LSODA", rtol=TIGHT, atol=[TIGHT, 1e-2 * TIGHT], t_eval=stops,
            args=((start + end) / 2, unit),
        )  # fmt: skip
        if not found.success:
            raise ArithmeticError(found.message)
        y = found.y[:, -1]
        h += np.exp(found.y[0, : len(inside)]).tolist()
        delta += (unit * found.y[1, : len(inside)]).tolist()
    return np.array(h), np.array(delta)


def _run(case: Case, rtol: float) -> PairResult:
    """The scene, output where the reference is."""
    at: dict[str, Any] = {"until_h": case.end, "gaps": case.at.tolist()}
    if not case.by_gap:
        at = {"until_t": case.end, "times": [0.0, *case.at.tolist()]}
    result: PairResult = simulate(**case.scene, **at, rtol=rtol)
    return result


def error_of(case: Case, rtol: float, result: PairResult) -> float:
    """Largest relative error of the outputs: of t at gaps, of h at times.

    Gaps that are off from LSODA's by more than ten times the tolerance are compared with 30 digits.

    Parameters
    ----------
    case : Case
    rtol : float
        Tolerance of the run.
    result : PairResult
        At the gaps of the case, or at its start and its times.
    """
    if case.by_gap:
        exact = simulate(**case.scene, until_h=case.end, gaps=case.at.tolist(), method="quadrature")
        return float(np.max(np.abs(result.t / exact.t - 1)))
    h, _ = _lsoda(case, float(result.delta[0]))
    error = float(np.max(np.abs(result.h[1:] / h - 1)))
    if error <= ALLOWED_ERROR * rtol:
        return error
    precise = make_reference(replace(case, outputs=tuple(case.at.tolist())))
    return float(np.max(np.abs(result.h[1:] / np.array([float(x) for x in precise["h"]]) - 1)))


def random_scenes(count: int, say: Callable[[str], None] = lambda _: None, rtol: float = RTOL) -> dict[str, Any]:
    """Run so many scenes; how many came out how, the largest error, what was wrong, and how errors were estimated.

    Parameters
    ----------
    count : int
    say : function of str
        Is told a line of each scene that is not right.
    rtol : float
        Tolerance of the runs.
    """
    random = np.random.default_rng(SEED)
    cells, ratios, wrong = [], [], []
    for number in range(count):
        case = random_case(random, number)
        judged = judge(
            ("random", str(number), f"{rtol:g}"), partial(_run, case, rtol), partial(error_of, case, rtol),
            ALLOWED_ERROR * rtol,
        )  # fmt: skip
        cells.append(judged)
        # the references' own errors are far below; at gaps the estimate is of h or t, whichever is less
        if judged.error > 0.1 * rtol and not case.by_gap:
            ratios.append(judged.estimated / judged.error)
        if judged.outcome == WRONG:
            wrong.append(repr(case))
        if judged.outcome != RIGHT:
            say(f"random {number}: {judged.outcome}: error {judged.error:.1e}: {judged.said}: {case}")
    counts = Counter(cell.outcome for cell in cells)
    low, middle, high = np.quantile(ratios, [0, 0.5, 1]).tolist() if ratios else [None] * 3
    return {
        "scenes": count,
        "rtol": rtol,
        "seed": SEED,
        **{outcome: counts[outcome] for outcome in OUTCOMES},
        "largest_error": max((cell.error for cell in cells if not math.isnan(cell.error)), default=0.0),
        "estimate_over_error": {"scenes": len(ratios), "least": low, "median": middle, "largest": high},
        "wrong_scenes": wrong,
        "refusals": [f"{cell.name}: {cell.said}" for cell in cells if cell.outcome == REFUSED],
    }
