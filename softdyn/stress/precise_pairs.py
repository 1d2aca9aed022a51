"""The cases of ``softdyn stress`` that have a reference in 30 digits, and how that is made.

Under a constant force times at gaps are an integral over ln h, by Gauss's rule in mpmath, halved until it stands. Else
the equations, with the law as the paper prints it, are integrated in mpmath by collocation on 16 stages at 34 digits,
as those of the benchmark are, on the steps of an engine run at 1e-10 (1e-12 where the centres are moved): on these an
error of order 9 is 1e-10, and one of order 17 about 1e-18. R = E = eta = 1.
``python -m softdyn.stress.precise_pairs`` makes ``reference.json`` beside this module anew; it takes some minutes.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from functools import partial
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np

from softdyn.bench.precise import DIGITS, UNIT, collocate, deflection, digits, elastic_force, gap_rate, remake, stored

FILE = Path(__file__).with_name("reference.json")
KAPPAS = (1e-14, 1e-12, 1e-9, 1e-6, 1e-3, 0.1, 1.0)
STARTS = (1e4, 1e2, 1.0, 1e-6)
NEAREST = 1e-15
PULLS = (1e-12, 1e-6, 1e-2, 0.3)
PULLED_FROM, PULLED_TO = 1e-8, 1e2
PER_DECADE = 2
OUTPUTS = 16


@dataclass(frozen=True)
class Case:
    """One case: what drives the pair, and what a remote force adds to the paper's law.

    Attributes
    ----------
    group, name : str
    drive : "force", "velocity" or "spring"
    given : float, tuple or str
        A number; ("sine", mean, amplitude, angular frequency, phase), which is mean + amplitude sin(w t + phase), the
        name of what is given aside; or ("table", times, values).
    h0 : float
    end : float
        Time or, under a constant force with outputs at gaps, the last gap.
    by_gap : bool
        Outputs are at gaps, and times the reference.
    remote : sequence of (amplitude, decay length)
        Terms of F_adh = sum of A exp(-h/lam).
    stiffness : float
        Of the spring.
    outputs : sequence of float
        Times, where they are not evenly spaced.
    """

    group: str
    name: str
    drive: str
    given: Any
    h0: float
    end: float
    by_gap: bool = False
    remote: Sequence[tuple[float, float]] = ()
    stiffness: float = math.inf
    outputs: Sequence[float] = ()

    @property
    def key(self) -> str:
        """Its name in the file of references."""
        return f"{self.group}: {self.name}"

    @property
    def at(self) -> np.ndarray:
        """Gaps, or times, of the outputs, without the start."""
        if len(self.outputs):
            return np.array(self.outputs, dtype=float)
        if self.by_gap:
            count = max(2, round(PER_DECADE * abs(math.log10(self.end / self.h0))))
            return np.geomspace(self.h0, self.end, count + 1)[1:]
        return np.arange(1, OUTPUTS + 1) / OUTPUTS * self.end

    @property
    def law(self) -> Any:
        """The law, as ``simulate`` takes it."""
        return remote_law(len(self.remote)) if self.remote else "rognon_gay"

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the law's parameters."""
        terms = {f"A{i}": A for i, (A, _) in enumerate(self.remote)} | {
            f"lam{i}": lam for i, (_, lam) in enumerate(self.remote)
        }
        return {**UNIT, **terms}

    @property
    def scene(self) -> dict[str, Any]:
        """What ``simulate`` takes, but for the tolerance, the outputs and the end."""
        given, constants = self.given, {}
        if isinstance(given, tuple) and given[0] == "sine":
            constants = dict(zip(("m", "k", "w", "f"), given[1:], strict=True))
            given = "m + k*sin(w*t + f)"
        elif isinstance(given, tuple):
            given = (np.array(given[1]), np.array(given[2]))
        drive = {self.drive: {"stiffness": self.stiffness, "base": given} if self.drive == "spring" else given}
        return {"law": self.law, "parameters": self.parameters, "h": self.h0, **drive, "constants": constants}


def remote_law(terms: int) -> Any:
    """The paper's law with F_adh = sum of A exp(-h/lam), either sign of A."""
    from sympy import Symbol, exp

    from softdyn.derive import FORCE, LENGTH, ContactLaw
    from softdyn.derive.laws.rognon_gay import law
    from softdyn.derive.symbols import h

    A = [Symbol(f"A{i}", real=True) for i in range(terms)]
    lam = [Symbol(f"lam{i}", positive=True) for i in range(terms)]
    remote = sum(x * exp(-h / y) for x, y in zip(A, lam, strict=True))
    parameters = {**dict.fromkeys(A, FORCE), **dict.fromkeys(lam, LENGTH)}
    return ContactLaw(f"remote{terms}", law.a, law.F_ela, law.zeta, F_adh=remote, parameters=parameters)


#: Repulsion at two ranges with an attraction between: two stable films, and a saddle between them.
TWO_FILMS = ((2.0e-2, 2e-4), (-1.2e-2, 1e-3), (4e-3, 1e-2))


def cases() -> list[Case]:
    """All cases with a reference in 30 digits."""
    found = [
        Case("push", f"kappa = {kappa:g} from h/R = {start:g}", "force", kappa, start, NEAREST, by_gap=True)
        for kappa in KAPPAS
        for start in STARTS
    ]
    found += [
        Case("pull", f"kappa = {-kappa:g}", "force", -kappa, PULLED_FROM, PULLED_TO, by_gap=True) for kappa in PULLS
    ]
    k, half = 1e-2, math.pi / 2
    found += [
        Case("zero", "slowly, pressed to 1e-3 R and pulled", "force", ("sine", 0.0, k, 2e-6, 0.0), 1.0, 3.2e6),
        Case("zero", "fast, 100 times", "force", ("sine", 0.0, k, 1.0, 0.0), 1e-2, 100 * math.pi),
        Case("zero", "tangentially", "force", ("sine", k, k, 1e-5, half), 1.0, 1.5e6),
        Case("zero", "by 1e-9 of its amplitude", "force", ("sine", k * (1 - 1e-9), k, 1e-5, half), 1.0, 1.5e6),
        Case("zero", "many times while the gap falls", "force", ("sine", 2e-3, k, 2e-4, 0.0), 1.0, 60 * math.pi / 2e-4),
        Case("zero", "touched and left along a table", "force", ("table", (0.0, 1e5, 3e5), (k, 0.0, k)), 1.0, 3e5),
    ]
    for factor in (-1.0, 0.0, 2.0, 1e6):
        high = min(k, k * 30 / max(factor, 1.0))  # a force above 0.3 E R^2 is outside the model
        table = ("table", (0.0, 1e5, 1e5, 3e5), (high, high, factor * high, factor * high))
        found.append(Case("jump", f"by a factor of {factor:g}", "force", table, 1.0, 3e5))
    for ratio in (1e-6, 1.0, 1e6):
        # the contact's own stiffness, C, is about 0.3 E R at h = R
        base = ("table", (0.0, 2e3, 4e3, 6e3), (3.0, 2.5, 2.5, 3.5))
        found.append(
            Case("spring", f"{ratio:g} of the contact's stiffness", "spring", base, 1.0, 6e3, stiffness=0.3 * ratio)
        )
    found += [
        Case("moved", "approach and retraction", "velocity", ("sine", 0.0, -3e-3, 2 * math.pi / 1e3, 0.0), 1.0, 2e3),
        Case("moved", "retraction from h/R = 1e-6", "velocity", 1e-4, 1e-6, 4e3),
        Case("moved", "slow approach to 1e-5 R", "velocity", ("sine", 0.0, -1e-5, 1e-5, 0.0), 0.3, 2.8e5),
    ]
    found += [
        Case(
            "film",
            "at rest, lam = 1e-9 R",
            "force",
            k,
            1e-3,
            1e18,
            remote=((k * math.exp(10.0), 1e-9),),
            outputs=tuple(np.geomspace(1e10, 1e18, OUTPUTS).tolist()),
        ),
        Case(
            "film",
            "force exactly 0, repelled to 1e18",
            "force",
            0.0,
            1e-2,
            1e18,
            remote=((k, 1e-2),),
            outputs=tuple(np.geomspace(1e3, 1e18, OUTPUTS).tolist()),
        ),
    ]
    saddle = two_films()[1]
    for side, word in ((-1, "below"), (1, "above")):
        start, outputs = saddle * (1 + side * 1e-6), tuple(np.geomspace(1e5, 1e10, OUTPUTS).tolist())
        name = f"1e-6 {word} the saddle"
        found.append(Case("snap-in", name, "force", 2e-3, start, 1e10, remote=TWO_FILMS, outputs=outputs))
    found.append(
        Case("snap-in", "to and fro", "force", ("sine", 1.5e-3, 3.5e-3, 1e-7, 0.0), 0.05, 1.2e8, remote=TWO_FILMS)
    )
    return found


def two_films() -> list[float]:
    """The gaps at which F_adh = 2e-3 E R^2: a stable film, the saddle, and another stable film."""
    from scipy.optimize import brentq

    def net(u: float) -> float:
        return sum(A * math.exp(-math.exp(u) / lam) for A, lam in TWO_FILMS) - 2e-3

    grid = np.linspace(math.log(1e-6), math.log(0.1), 2000)
    values = [net(u) for u in grid]
    roots = [
        math.exp(brentq(net, a, b, xtol=1e-15))
        for a, b, x, y in zip(grid, grid[1:], values, values[1:], strict=False)
        if x * y < 0
    ]
    assert len(roots) == 3, roots
    return roots


@dataclass(frozen=True)
class Reference:
    """What is stored of a case, rounded to double: outputs at ``at`` of the case, and what the doubles of t lack."""

    t: np.ndarray
    t_low: np.ndarray
    h: np.ndarray
    delta: np.ndarray
    rate: np.ndarray = field(default_factory=lambda: np.empty(0))


def references() -> dict[str, Reference]:
    """All stored references, by the keys of their cases."""
    return {
        key: Reference(
            **{name: np.array([float(x) for x in values]) for name, values in case.items()},
            t_low=np.array([float(Decimal(x) - Decimal(float(x))) for x in case["t"]]),
        )
        for key, case in stored(FILE).items()
    }


def _motion(case: Case) -> tuple[Callable[[Any, Any], Any], Callable[..., list[Any]]]:
    """What is given at t, and the rates of the state y at t; the middle of the step is on one side of a jump."""
    remote = [(mp.mpf(A), mp.mpf(lam)) for A, lam in case.remote]
    compliance = mp.mpf(1) / mp.mpf(case.stiffness) if case.drive == "spring" else mp.mpf(0)

    def given(t: Any, middle: Any) -> Any:
        if not isinstance(case.given, tuple):
            return mp.mpf(case.given)
        kind, *numbers = case.given
        if kind == "sine":
            m, k, w, f = (mp.mpf(x) for x in numbers)
            return m + k * mp.sin(w * t + f)
        times, values = numbers
        # steps end at rows
        i = next(i for i in range(len(times) - 1) if times[i] <= middle < times[i + 1])
        start, slope = mp.mpf(times[i]), (mp.mpf(values[i + 1]) - mp.mpf(values[i])) / (mp.mpf(times[i + 1]) - times[i])
        return slope if case.drive == "spring" else mp.mpf(values[i]) + slope * (t - start)

    def rates(t: Any, y: Sequence[Any], middle: Any) -> list[Any]:
        h = mp.exp(y[0])
        if case.drive == "force":
            F = given(t, middle)
            return [gap_rate(h, deflection(h, F), F, remote) / h]
        delta = y[1]
        a = mp.sqrt(2 * (h / (1 + h) + abs(delta)))
        h_dot = gap_rate(h, delta, elastic_force(h, delta), remote)
        F_delta, F_h = 4 * (a + abs(delta) / a) / 9, 4 * delta / a / (1 + h) ** 2 / 9
        return [h_dot / h, (h_dot - given(t, middle) - compliance * F_h * h_dot) / (2 + compliance * F_delta)]

    return given, rates


def _by_quadrature(case: Case) -> dict[str, list[str]]:
    """Times at the gaps of a case of constant force."""
    _, rates = _motion(case)
    force = mp.mpf(case.given)

    def rate(u: Any) -> Any:
        return rates(mp.mpf(0), [u], mp.mpf(0))[0]

    t, edge = mp.mpf(0), mp.log(mp.mpf(case.h0))
    rows: dict[str, list[str]] = {"t": [], "h": [], "delta": [], "rate": []}
    for gap in case.at:
        h = mp.mpf(float(gap))
        u = mp.log(h)
        t += mp.quad(lambda u: 1 / rate(u), [edge, u], method="gauss-legendre")
        edge = u
        for name, value in zip(rows, (t, h, deflection(h, force), rate(u)), strict=True):
            rows[name].append(digits(value))
    return rows


def _by_collocation(case: Case) -> dict[str, list[str]]:
    """Gaps and deflections at the times of a case."""
    from softdyn.api import simulate

    given, rates = _motion(case)
    # where delta is integrated, too, the law may vary with it faster than the gap feels
    coarse = simulate(
        **case.scene, until_t=case.end, rtol=1e-10 if case.drive == "force" else 1e-12, method="integrate"
    )
    y = [mp.log(mp.mpf(case.h0))]
    if case.drive != "force":
        y.append(mp.mpf(float(coarse.delta[0])))
    rows: dict[str, list[str]] = {"t": [], "h": [], "delta": []}
    for t, found, middle in collocate(rates, y, coarse.t[1:].tolist(), case.at.tolist()):
        h = mp.exp(found[0])
        delta = deflection(h, given(t, middle)) if case.drive == "force" else found[1]
        for name, value in zip(rows, (t, h, delta), strict=True):
            rows[name].append(digits(value))
    return rows


def make_reference(case: Case) -> dict[str, list[str]]:
    """Thirty digits of a case, as text."""
    with mp.workdps(DIGITS):
        return _by_quadrature(case) if case.by_gap else _by_collocation(case)


def main(chosen: Sequence[str] = ()) -> None:
    """Make all references anew, or those whose key contains one of the words."""
    makers = {case.key: partial(make_reference, case) for case in cases()}
    remake(FILE, __doc__, makers, [key for key in makers if not chosen or any(word in key for word in chosen)])


if __name__ == "__main__":
    main(sys.argv[1:])
