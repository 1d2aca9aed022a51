"""The cases of ``softdyn bench``, with references in 30 digits.

A reference is made by collocation, too, but in mpmath, with 16 stages at 34 digits and the law as the paper prints it,
on the steps of an engine run at 1e-10: on these an error of order 9 is 1e-10, and one of order 17 about 1e-18. It is
stored in ``generated/bench/reference.json``; ``python -m softdyn.bench.reference`` makes what
the file lacks.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FILE = Path(__file__).parent.parent / "generated" / "bench" / "reference.json"
DIGITS = 34
STAGES = 16
OUTPUTS = 50
UNIT = {"R": 1.0, "E": 1.0, "eta": 1.0}
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
    stored = json.loads(FILE.read_text(encoding="utf-8"))["cases"]
    found = []
    for definition in _definitions():
        reference = stored[definition["name"]]
        arrays = {name: np.array([float(x) for x in reference[name]]) for name in ("h", "delta")}
        of_case = {"h0": 100.0, **definition, "t": np.array(definition["t"]), **arrays}
        found.append(Case(**of_case, delta0=float(reference["delta0"])))
    return found


def _mp_rate(definition: dict[str, Any]) -> tuple[Callable[[Any, Any], Any], Callable[[Any, Any], Any]]:
    """Return du/dt and delta at (t, u) in mpmath, from the law as printed in the paper."""
    import mpmath as mp

    kappa, film = mp.mpf(definition["kappa"]), definition["film"]
    w = mp.mpf(definition.get("constants", {}).get("w", 0.0))
    A, lam = mp.mpf(definition["kappa"] * math.exp(LOG_A)), mp.mpf(LAM)

    moved = definition["drive"] == "velocity"
    depth = mp.mpf(definition.get("constants", {}).get("D", 0.0))

    def delta_at(t: Any, u: Any) -> Any:
        h = mp.exp(u)
        if moved:  # X is known
            return (h - 1 + depth * mp.sin(w * t)) / 2
        bar = h / (1 + h)
        F = kappa * (1 + mp.mpf("0.5") * mp.sin(w * t))
        delta = mp.mpf(9) / 4 * F / mp.sqrt(2 * (bar + mp.cbrt(mp.mpf(9) ** 2 / 32 * F**2)))
        for _ in range(60):
            a = mp.sqrt(2 * (bar + delta))
            step = (4 * a * delta / 9 - F) / (4 * (a + delta / a) / 9)
            delta -= step
            if abs(step) < abs(delta) * mp.mpf(10) ** (-DIGITS // 2 - 1):
                return delta
        raise ArithmeticError("no deflection")

    def rate(t: Any, u: Any) -> Any:
        h = mp.exp(u)
        bar = h / (1 + h)
        delta = delta_at(t, u)
        a2 = 2 * (bar + abs(delta))
        F = 4 * mp.sqrt(a2) * delta / 9 if moved else kappa * (1 + mp.mpf("0.5") * mp.sin(w * t))
        net = F - A * mp.exp(-h / lam) if film else F
        return -net / (3 * mp.pi / 2 * a2**2 / bar**3) / h

    return rate, delta_at


def make_reference(definition: dict[str, Any], say: Callable[[str], None]) -> dict[str, Any]:
    """Integrate one case in mpmath; returns 30 digits of h and delta at its output times, as text."""
    import mpmath as mp

    from softdyn.derive.radau import _nodes, _weights

    mp.mp.dps = DIGITS
    rate, delta_at = _mp_rate(definition)
    nodes = _nodes(STAGES)
    points = [mp.mpf(0), *nodes]
    powers = mp.matrix([[c**j for j in range(STAGES)] for c in nodes])
    integrals = mp.matrix([[c ** (j + 1) / (j + 1) for j in range(STAGES)] for c in nodes])
    inverse = powers * integrals**-1
    edges = _edges(definition)
    t, u = mp.mpf(0), mp.log(definition.get("h0", 100))
    outputs, found = list(definition["t"]), []
    for number, end in enumerate(edges):
        step = mp.mpf(end) - t
        times = [t + c * step for c in nodes]
        z = _stages(rate, times, u, step, inverse)
        while outputs and outputs[0] <= end:
            theta = (mp.mpf(outputs[0]) - t) / step
            weights = _weights(points, theta, derivative=False)
            value = u + mp.fsum(weight * stage for weight, stage in zip(weights[1:], z, strict=True))
            at = mp.mpf(outputs.pop(0))
            found.append((mp.nstr(mp.exp(value), 30), mp.nstr(delta_at(at, value), 30)))
        t, u = mp.mpf(end), u + z[-1]
        if number % 20 == 0:
            say(f"{definition['name']}: step {number} of {len(edges)}, h = {mp.nstr(mp.exp(u), 8)}")
    assert not outputs, "outputs are left over"
    return {
        "delta0": mp.nstr(delta_at(mp.mpf(0), mp.log(definition.get("h0", 100))), 30),
        "h": [h for h, _ in found],
        "delta": [delta for _, delta in found],
    }


def _edges(definition: dict[str, Any]) -> list[float]:
    """Ends of the steps of the engine at 1e-10."""
    from softdyn.api import simulate

    of_case = {"h0": 100.0, **definition, "t": np.array(definition["t"])}
    case = Case(**of_case, delta0=0.0, h=np.empty(0), delta=np.empty(0))
    run = simulate(
        law=case.law, parameters=case.parameters, h=case.h0, **case.given, constants=case.constants,
        until_t=definition["t"][-1], rtol=1e-10, method="integrate",
    )  # fmt: skip
    return run.t[1:].tolist()


def _stages(rate: Callable[[Any, Any], Any], times: list[Any], u: Any, step: Any, inverse: Any) -> list[Any]:
    """Solve the collocation equations by Newton's iteration, slopes by differences; to 30 digits."""
    import mpmath as mp

    slope_at_start = rate(times[0], u)
    small = mp.mpf(10) ** -12
    # along the tangent, bent where it decays
    slope = min((rate(times[0], u + small) - slope_at_start) / small, mp.mpf(0))
    reaches = [time_ - times[0] + step / 1000 for time_ in times]
    z = [reach * slope_at_start / (1 - reach * slope) for reach in reaches]
    before = mp.inf
    for _ in range(60):
        rates = [rate(time_, u + stage) for time_, stage in zip(times, z, strict=True)]
        if before > mp.mpf(10) ** -8:
            slopes = [(rate(x, u + y + small) - r) / small for x, y, r in zip(times, z, rates, strict=True)]
            matrix = inverse - step * mp.diag(slopes)
            solver = matrix**-1
        residual = mp.matrix([step * r for r in rates]) - inverse * mp.matrix(z)
        change = solver * residual
        z = [stage + correction for stage, correction in zip(z, change, strict=True)]
        size = max(abs(correction) for correction in change)
        if size < mp.mpf(10) ** -30:
            return z
        before = size
    raise ArithmeticError(f"the collocation equations were solved to {mp.nstr(before, 3)} only")


def main() -> None:
    """Make the references that are missing; all of them, where there is no file."""
    known = json.loads(FILE.read_text(encoding="utf-8"))["cases"] if FILE.is_file() else {}
    made = {d["name"]: known.get(d["name"]) or make_reference(d, print) for d in _definitions()}
    FILE.parent.mkdir(parents=True, exist_ok=True)
    how = (__doc__ or "").split("\n\n", 1)[1].replace("\n", " ").strip()
    FILE.write_text(json.dumps({"how": how, "cases": made}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
