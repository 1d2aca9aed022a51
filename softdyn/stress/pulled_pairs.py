"""Films that are pulled, of ``softdyn stress``: laws with a branch for delta < 0, by equations and by another physics.

By equations: the force balance and dh/dt = -(F - F_adh)/zeta, with a law's expressions as sympy makes functions of
them, solved by bisection and integrated by scipy, or by Gauss's rule where gaps are given. By another physics: the
friction of a run against the table of ``softdyn/study/elastohydrodynamics.json``, at the states that the run has.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.api import simulate
from softdyn.laws import find, load
from softdyn.pair.pair_run import ALLOWED_ERROR
from softdyn.results.pair_result import PairResult
from softdyn.stress.judge import Cell, judge, worst
from softdyn.study.elastohydrodynamics import BAND, INSIDE, is_half_space, reference
from softdyn.study.plane import parameter_values

if TYPE_CHECKING:
    from softdyn.derive import ContactLaw

Array = NDArray[np.float64]
LAWS = ("equal_spheres", "droplet", "soap_film")
SEED = 20261128
RANDOM_SCENES = 24
OUTPUTS = 12
#: Of the references: scipy's steps, and Gauss's rule.
TIGHT, CERTAIN = 1e-13, 1e-11
#: Elastic radius against the table: the table is of half-spaces.
RADIUS_BAND = 0.1
#: Gaps of runs against the table, over R.
GAPS = (1e-9, 1e-3)


@dataclass(frozen=True)
class Functions:
    """A law's expressions with numbers for its parameters, R = E = eta = 1: functions of h and delta."""

    law: str
    parameters: dict[str, float]
    force: Callable[[float, float], float]
    friction: Callable[[float, float], float]
    remote: Callable[[float, float], float]

    def deflection(self, h: float, F: float) -> float:
        """What balances a force, by bisection between 0 and a deflection that is too much."""
        from scipy.optimize import brentq

        if F == 0:
            return 0.0
        side, most = math.copysign(1.0, F), 1e-12
        while abs(self.force(h, side * most)) < abs(F):
            most *= 4.0
        found = brentq(lambda d: self.force(h, side * d) - F, 0.0, most, xtol=1e-300, rtol=1e-15)
        return side * float(found)

    def rate(self, h: float, delta: float, F: float) -> float:
        """Rate of h, in units of R E/eta.

        Parameters
        ----------
        h, delta : float
            In units of R.
        F : float
            In units of E R^2, < 0 where it pulls.
        """
        return (self.remote(h, delta) - F) / self.friction(h, delta)


def functions_of(name: str) -> Functions:
    """A stock law, with its typical parameters."""
    from sympy import lambdify

    from softdyn.derive.symbols import a, delta, h

    law: ContactLaw = load(find(name))[0]
    values = parameter_values(law)
    made = [
        lambdify((h, delta), expr.subs(a, law.a).subs(values), "math", cse=True)
        for expr in (law.F_ela, law.zeta, law.F_adh)
    ]
    names = {symbol.name: value for symbol, value in values.items()}
    return Functions(name, {key: names[key] for key in _parameters(law)}, *made)


def _parameters(law: ContactLaw) -> list[str]:
    from softdyn.derive.law import parameters_of

    return [symbol.name for symbol in parameters_of(law)]


# ------------------------------------------------------------------------------------------------------ by equations


@dataclass(frozen=True)
class Pull:
    """One scene.

    Attributes
    ----------
    name : str
    of : Functions
    h0, end : float
        First gap; when it ends, or, at a constant force with outputs at gaps, the last gap.
    force : tuple
        ("constant", F), ("sine", mean, amplitude, w, phase), ("table", times, values); or ("velocity", V).
    """

    name: str
    of: Functions
    h0: float
    end: float
    force: tuple[Any, ...]

    @property
    def by_gap(self) -> bool:
        """Whether outputs are at gaps."""
        return bool(self.force[0] == "constant")

    @property
    def at(self) -> Array:
        """Gaps or times of the outputs."""
        if self.by_gap:
            return np.geomspace(self.h0, self.end, OUTPUTS + 1)[1:]
        return np.arange(1, OUTPUTS + 1) / OUTPUTS * self.end

    def run(self, rtol: float) -> PairResult:
        """By the engine."""
        kind, *numbers = self.force
        drive: dict[str, Any] = {"velocity" if kind == "velocity" else "force": numbers[0]}
        if kind == "sine":
            drive = {"force": "m + k*sin(w*t + f)", "constants": dict(zip("mkwf", numbers, strict=True))}
        elif kind == "table":
            drive = {"force": (np.array(numbers[0]), np.array(numbers[1]))}
        at = self.at.tolist()
        ends = {"gaps": at, "until_h": self.end} if self.by_gap else {"times": at, "until_t": self.end}
        known: dict[str, Any] = {"law": self.of.law, "parameters": self.of.parameters, "h": self.h0}
        result: PairResult = simulate(**known, rtol=rtol, **drive, **ends)
        return result

    def value(self, t: float, middle: float) -> float:
        """Of the force; the middle of a piece tells the side of a jump."""
        kind, *numbers = self.force
        if kind == "sine":
            m, k, w, f = numbers
            return float(m + k * math.sin(w * t + f))
        times, values = numbers
        i = next(i for i in range(len(times) - 1) if times[i] <= middle < times[i + 1])
        return float(values[i] + (values[i + 1] - values[i]) * (t - times[i]) / (times[i + 1] - times[i]))

    def stops(self) -> list[float]:
        """Times within the run at which the force jumps, has a kink, or is zero."""
        kind, *numbers = self.force
        if kind == "velocity":
            return []
        grid = sorted({*np.linspace(0, self.end, 2001), *(numbers[0] if kind == "table" else ())})
        found = list(numbers[0]) if kind == "table" else []
        from scipy.optimize import brentq

        for low, high in itertools.pairwise(grid):
            middle = (low + high) / 2
            if self.value(low, middle) * self.value(high, middle) < 0:
                found.append(float(brentq(self.value, low, high, args=(middle,), xtol=1e-300, rtol=1e-15)))
        return sorted({t for t in found if 0 < t < self.end})

    def expected(self) -> tuple[Array, Array]:
        """Times, or gaps, and deflections at the outputs."""
        if self.by_gap:
            return self._times()
        return self._parted() if self.force[0] == "velocity" else self._forced()

    def _times(self) -> tuple[Array, Array]:
        F, of = self.force[1], self.of
        nodes, weights = np.polynomial.legendre.leggauss(40)
        edges = np.log([self.h0, *self.at])
        taken = []
        for low, high in itertools.pairwise(edges):
            parts = np.linspace(low, high, 9)
            total = 0.0
            for one, other in itertools.pairwise(parts):
                h = np.exp((one + other) / 2 + (other - one) / 2 * nodes).tolist()
                slowness = [x / of.rate(x, of.deflection(x, F), F) for x in h]
                total += (other - one) / 2 * float(weights @ slowness)
            taken.append(total)
        return np.cumsum(taken), np.array([of.deflection(h, F) for h in self.at.tolist()])

    def _forced(self) -> tuple[Array, Array]:
        from scipy.integrate import solve_ivp

        def rate(t: float, u: Array, middle: float) -> list[float]:
            h, F = math.exp(u[0]), self.value(t, middle)
            return [self.of.rate(h, self.of.deflection(h, F), F) / h]

        y, h, delta = [math.log(self.h0)], [], []
        for start, end in itertools.pairwise([0.0, *self.stops(), self.end]):
            inside = [t for t in self.at if start < t <= end]
            middle = (start + end) / 2
            found = solve_ivp(
                rate, (start, end), y, method="DOP853", rtol=TIGHT, atol=TIGHT, args=(middle,),
                t_eval=inside if end in inside else [*inside, end],
            )  # fmt: skip
            if not found.success:
                raise ArithmeticError(found.message)
            y = found.y[:, -1].tolist()
            gaps = np.exp(found.y[0, : len(inside)]).tolist()
            h += gaps
            # at a jump, outputs tell of what follows it
            later = [t + 1e-9 * self.end if t == end else middle for t in inside]
            delta += [
                self.of.deflection(x, self.value(t, side if side < self.end else middle))
                for x, t, side in zip(gaps, inside, later, strict=True)
            ]
        return np.array(h), np.array(delta)

    def _parted(self) -> tuple[Array, Array]:
        """Centres that move at a given velocity: 2 d(delta)/dt = dh/dt - V, from no force."""
        from scipy.integrate import solve_ivp

        V = self.force[1]

        def rate(_t: float, y: Array) -> list[float]:
            h, delta = math.exp(y[0]), V * y[1]
            fast = self.of.rate(h, delta, self.of.force(h, delta))
            return [fast / h, (fast / V - 1) / 2]

        # the deflection in units of V: what would be left of h - V t has no digits
        found = solve_ivp(
            rate, (0.0, self.end), [math.log(self.h0), 0.0], method="DOP853", t_eval=self.at,
            rtol=TIGHT, atol=[TIGHT, 1e-6 * TIGHT * self.h0 / V],
        )  # fmt: skip
        if not found.success:
            raise ArithmeticError(found.message)
        return np.exp(found.y[0]), V * found.y[1]


def error_of(pull: Pull, expected: tuple[Array, Array], result: PairResult) -> float:
    """Largest relative error of t at gaps, or h at times; and of delta, over a tenth of the largest at least.

    Parameters
    ----------
    pull : Pull
    expected : tuple of two arrays, shape (outputs,)
        Times at the gaps, or gaps at the times, and deflections: as of :meth:`Pull.expected`.
    result : PairResult
        Its last rows are the outputs.
    """
    main, delta = expected
    found = result.t if pull.by_gap else result.h
    count = len(main)
    scale = np.maximum(np.abs(delta), 0.1 * np.abs(delta).max())
    of_delta = np.max(np.abs(result.delta[-count:] - delta) / scale)
    return float(max(np.max(np.abs(found[-count:] / main - 1)), of_delta))


def chosen(of: Functions) -> list[Pull]:
    """Pulled from a near contact, weakly and strongly; swung; reversed at once; parted."""
    turn = 2 * math.pi / 1e5
    return [
        *(Pull(f"{of.law} pulled, {k:g}", of, 1e-4, 1.0, ("constant", -k)) for k in (1e-6, 1e-3, 0.05)),
        Pull(f"{of.law} to and fro", of, 0.1, 2e5, ("sine", 0.0, 3e-3, turn, 0.0)),
        Pull(f"{of.law} pressed, then pulled", of, 0.1, 4e4, ("table", (0.0, 2e4, 2e4, 6e4), (4e-3, 4e-3, -2e-3, 0.0))),
        Pull(f"{of.law} parted", of, 1e-3, 1e3, ("velocity", 2e-4)),
    ]


def random_pull(random: np.random.Generator, of: Functions) -> Pull:
    """Drawn: how near, how hard, how it is driven."""

    def decade(low: float, high: float) -> float:
        return float(10 ** random.uniform(low, high))

    h0, k = decade(-3, 0), decade(-6, -1.5)
    duration = 6 * math.pi * h0 / k * decade(-1, 0.5)
    kind = random.integers(4)
    if kind == 0:
        return Pull("", of, h0, h0 * decade(0.5, 3), ("constant", -k))
    if kind == 1:
        w = random.uniform(1, 20) / duration
        return Pull("", of, h0, duration, ("sine", -k * random.uniform(-0.3, 1), k, w, random.uniform(0, 6.28)))
    if kind == 2:
        times = np.concatenate([[0.0], np.sort(random.uniform(0, duration, 4)), [1.01 * duration]])
        values = k * random.uniform(-1, 0.5, len(times))
        return Pull("", of, h0, duration, ("table", tuple(times.tolist()), tuple(values.tolist())))
    V = decade(-6, -3)
    return Pull("", of, h0, min(h0, 0.2) * random.uniform(0.2, 1) / V, ("velocity", V))


def pulled_cells(rtols: Iterable[float]) -> Iterable[Cell]:
    """Every law and scene by its equations, at every tolerance; and laws against elastohydrodynamics."""
    laws, rtols = [functions_of(name) for name in LAWS], tuple(rtols)
    for of in laws:
        for pull in chosen(of):
            expected = pull.expected()
            yield from (_cell(pull, pull.name, rtol, expected) for rtol in rtols)
    random = np.random.default_rng(SEED)
    drawn = [random_pull(random, laws[number % len(laws)]) for number in range(RANDOM_SCENES)]
    known = [(pull, pull.expected()) for pull in drawn]
    for rtol in rtols:
        yield worst([_cell(pull, f"the worst of {len(drawn)} random scenes", rtol, exact) for pull, exact in known])
    for of in laws[:2]:
        yield from table_cells(of)


def _cell(pull: Pull, name: str, rtol: float, expected: tuple[Array, Array]) -> Cell:
    where = ("pulled", name, f"{rtol:g}")
    return judge(where, partial(pull.run, rtol), partial(error_of, pull, expected), max(ALLOWED_ERROR * rtol, CERTAIN))


# ---------------------------------------------------------------------------------------- against elastohydrodynamics


def table_cells(of: Functions) -> Iterable[Cell]:
    """Friction of a run, F/(-dh/dt), over 6 pi eta R'^2/h, R' = R/2, between the table's rows in ln(friction).

    Pressed and pulled, so hard that the states are those of the table between 1e-9 and 1e-3 R, each in a run of its
    own; and, where the law is one of half-spaces, the elastic radius F/(E* w) over sqrt(R' h).
    """
    rows = np.array(reference()["rows"])
    law = load(find(of.law))[0]
    half_space = "nu" in of.parameters and is_half_space(law)

    def errors(result: PairResult, column: int) -> float:
        h, state = result.h, 2 * result.delta / result.h
        inside = (state > INSIDE[0]) & (state < INSIDE[1]) & (np.abs(state) > abs(rows[:, 0]).min())
        if np.count_nonzero(inside) < 10:
            return math.inf
        if column == 1:
            found = result.F / -result.dh_dt / (6 * math.pi * 0.25 / h)
        else:
            # E* of two surfaces of the plane modulus M is M/2
            modulus = 1 / (1 - of.parameters["nu"] ** 2)
            found = result.F / (modulus / 2 * 2 * result.delta) / np.sqrt(h / 2)
        expected = np.exp(np.interp(state, rows[:, 0], np.log(rows[:, column])))
        return float(np.max(np.abs(found / expected - 1)[inside]))

    for word, side in (("pressed", 1.0), ("pulled", -1.0)):
        F = side * abs(of.force(1e-6, side * 1e-6))
        ends = GAPS if side < 0 else GAPS[::-1]
        run = partial(
            simulate, law=of.law, parameters=of.parameters, h=ends[0], force=F, until_h=ends[1],
            gaps=np.geomspace(*ends, 300).tolist(), quantities=["F", "dh_dt"],
        )  # fmt: skip
        group = "elastohydrodynamics"
        yield judge((group, f"friction of {of.law}", word), run, lambda result: errors(result, 1), BAND)
        if half_space:
            yield judge((group, f"elastic radius of {of.law}", word), run, lambda r: errors(r, 2), RADIUS_BAND)
