"""The cases of ``softdyn bench``, with references in 30 digits.

A reference is made by collocation, too, but in mpmath, with 16 stages at 34 digits and the law as the paper prints it,
on the steps of an engine run at 1e-10: on these an error of order 9 is 1e-10, and one of order 17 about 1e-18. It is
stored in ``reference.json`` beside this module; ``python -m softdyn.bench.precise_cases`` makes what the file lacks.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np
from numpy.typing import NDArray

from softdyn.bench.precise import DIGITS, UNIT, collocate, deflection, digits, elastic_force, gap_rate, remake, stored

Array = NDArray[np.float64]
FILE = Path(__file__).with_name("reference.json")
OUTPUTS = 50
#: kappa -> time at which h = 1e-3 R is reached from 100 R, rounded; each run ends there.
CONSTANT = {1e-6: 2.103e9, 1e-2: 4.168e6, 0.3: 1.185e7}
SINE_END, RADIANS = 4.17e6, 50.0
LAM, LOG_A = 1e-5, 10.0
#: lam zeta/F on the film: the time in which a deviation of the gap from it decays.
RELAXATION = 7.56042e7
#: Approach and retraction: X = 2R + h0 - DEPTH sin(w t) from contact at h0 = R on, over half a period.
DEPTH, HALF_PERIOD = 1.3, 1e3


@dataclass(frozen=True)
class Case:
    """One case: a law and a drive, output times, and the gaps and deflections there.

    Attributes
    ----------
    drive : "constant", "sine" or "velocity"
        Of the last, the deflection is 0 at the start, and kappa too.
    film : bool
        Whether a steric force is added: the law is then not stock, but :func:`film_law`.
    """

    name: str
    about: str
    drive: str
    kappa: float
    film: bool
    h0: float
    delta0: float
    t: Array
    h: Array
    delta: Array
    constants: dict[str, float] = field(default_factory=dict)

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the law's parameters."""
        return {**UNIT, "A": self.kappa * math.exp(LOG_A), "lam": LAM} if self.film else UNIT

    @property
    def law(self) -> Any:
        """The law, as ``simulate`` takes it."""
        return film_law() if self.film else "rognon_gay"

    @property
    def given(self) -> dict[str, Any]:
        """What drives the pair, as ``simulate`` takes it."""
        if self.drive == "velocity":
            return {"velocity": "-D*w*cos(w*t)"}
        return {"force": f"{self.kappa!r}*(1 + 0.5*sin(w*t))" if self.drive == "sine" else self.kappa}

    @property
    def scale(self) -> Array:
        """Size of the deflection that its errors are measured by: its own, or the largest where it changes sign."""
        sizes = np.abs(self.delta)
        return np.full(len(sizes), np.max(sizes)) if self.drive == "velocity" else sizes


def film_law() -> Any:
    """The paper's law with F_adh = A exp(-h/lam)."""
    from sympy import Symbol, exp

    from softdyn.derive import FORCE, LENGTH, ContactLaw
    from softdyn.derive.laws.rognon_gay import law
    from softdyn.derive.symbols import h

    A, lam = Symbol("A", positive=True), Symbol("lam", positive=True)
    parameters = {A: FORCE, lam: LENGTH}
    return ContactLaw("film", law.a, law.F_ela, law.zeta, F_adh=A * exp(-h / lam), parameters=parameters)


def _definitions() -> list[dict[str, Any]]:
    even = (np.arange(1, OUTPUTS + 1) / OUTPUTS).tolist()
    found: list[dict[str, Any]] = [
        {
            "name": f"constant, kappa = {kappa:g}",
            "about": f"constant force, h/R = 100 to about 1e-3, {OUTPUTS} output times",
            "drive": "constant",
            "kappa": kappa,
            "film": False,
            "t": [end * x for x in even],
        }
        for kappa, end in CONSTANT.items()
    ]
    found.append(
        {
            "name": "sine",
            "about": f"kappa = 1e-2 (1 + 0.5 sin wt), {RADIANS:g} radians over T = {SINE_END:g}, {OUTPUTS} outputs",
            "drive": "sine",
            "kappa": 1e-2,
            "film": False,
            "t": [SINE_END * x for x in even],
            "constants": {"w": RADIANS / SINE_END},
        }
    )
    for past in (1e4, 1e6):
        found.append(
            {
                "name": f"film, {past:g}",
                "about": f"constant force, F_adh = F exp(10 - h/lam), lam = 1e-5 R, to {past:g} relaxation times, "
                f"{OUTPUTS} output times, evenly in ln t from 1e6",
                "drive": "constant",
                "kappa": 1e-2,
                "film": True,
                "t": np.geomspace(1e6, past * RELAXATION, OUTPUTS).tolist(),
            }
        )
    found.append(
        {
            "name": "velocity",
            "about": f"X = 3R - {DEPTH} R sin(pi t/T) over T = {HALF_PERIOD:g}: pressed, pulled apart; from h/R = 1, "
            f"{OUTPUTS} output times; errors of delta over the largest",
            "drive": "velocity",
            "kappa": 0.0,
            "film": False,
            "h0": 1.0,
            "t": [HALF_PERIOD * x for x in even],
            "constants": {"D": DEPTH, "w": math.pi / HALF_PERIOD},
        }
    )
    return found


def cases() -> list[Case]:
    """All cases, with their stored references."""
    known = stored(FILE)
    found = []
    for definition in _definitions():
        reference = known[definition["name"]]
        arrays = {name: np.array([float(x) for x in reference[name]]) for name in ("h", "delta")}
        of_case = {"h0": 100.0, **definition, "t": np.array(definition["t"]), **arrays}
        found.append(Case(**of_case, delta0=float(reference["delta0"])))
    return found


def _motion(definition: dict[str, Any]) -> tuple[Callable[[Any, Any], Any], Callable[[Any, Any], Any]]:
    """Return d(ln h)/dt and delta at (t, ln h) in mpmath, from the law as printed in the paper."""
    constants = definition.get("constants", {})
    kappa, w, depth = (mp.mpf(x) for x in (definition["kappa"], constants.get("w", 0.0), constants.get("D", 0.0)))
    remote = [(mp.mpf(definition["kappa"] * math.exp(LOG_A)), mp.mpf(LAM))] if definition["film"] else []
    moved = definition["drive"] == "velocity"

    def force(t: Any) -> Any:
        return kappa * (1 + mp.mpf("0.5") * mp.sin(w * t))

    def delta_at(t: Any, u: Any) -> Any:
        h = mp.exp(u)
        # X is known, or the force
        return (h - 1 + depth * mp.sin(w * t)) / 2 if moved else deflection(h, force(t))

    def rate(t: Any, u: Any) -> Any:
        h, delta = mp.exp(u), delta_at(t, u)
        return gap_rate(h, delta, elastic_force(h, delta) if moved else force(t), remote) / h

    return rate, delta_at


def make_reference(definition: dict[str, Any]) -> dict[str, Any]:
    """Integrate one case in mpmath; returns 30 digits of h and delta at its output times, as text."""
    with mp.workdps(DIGITS):
        rate, delta_at = _motion(definition)
        start = mp.log(definition.get("h0", 100))
        h, delta = [], []
        for t, (u,), _ in collocate(lambda t, y, _: [rate(t, y[0])], [start], _edges(definition), definition["t"]):
            h.append(digits(mp.exp(u)))
            delta.append(digits(delta_at(t, u)))
        return {"delta0": digits(delta_at(mp.mpf(0), start)), "h": h, "delta": delta}


def _edges(definition: dict[str, Any]) -> list[float]:
    """Ends of the steps of the engine at 1e-10."""
    from softdyn.api import simulate

    of_case = {"h0": 100.0, **definition, "t": np.array(definition["t"])}
    case = Case(**of_case, delta0=0.0, h=np.empty(0), delta=np.empty(0))
    run = simulate(
        law=case.law, parameters=case.parameters, h=case.h0, **case.given, constants=case.constants,
        until_t=definition["t"][-1], rtol=1e-10, method="integrate",
    )  # fmt: skip
    times: list[float] = run.t[1:].tolist()
    return times


def main() -> None:
    """Make the references that are missing."""
    remake(FILE, __doc__, {d["name"]: partial(make_reference, d) for d in _definitions()})


if __name__ == "__main__":
    main()
