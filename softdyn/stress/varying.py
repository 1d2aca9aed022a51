"""Forces that a few points of a step do not tell: pulses, gates, chirps and sums of sines, of ``softdyn stress``.

Between rigid spheres whose friction goes as 1/h, ln h falls by the impulse of the force over 6 pi eta R^2, and the
impulse of each of these forces is known in closed form: no step and no sample of the force is in the reference.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np

from softdyn.api import simulate
from softdyn.pair.pair_run import ALLOWED_ERROR
from softdyn.results.pair_result import PairResult
from softdyn.stress.judge import Cell, judge

#: When the runs end, and where their outputs are, as a part of that.
END = 1e5
AT = (0.3, 0.5, 0.77, 1.0)
FRICTION = 6 * math.pi
#: Widths of pulses, as a part of the run, and where they are.
WIDTHS = (1e-1, 1e-2, 1e-3, 1e-5, 1e-8)
PLACE = 0.41234
Impulse = Callable[[float], float]


def pulse(width: float) -> tuple[str, dict[str, float], Impulse]:
    """A Gaussian pulse, which moves ln h by 0.3, on a small force."""
    from scipy.special import erf

    w, c = width * END, PLACE * END
    A = 0.3 * FRICTION / (w * math.sqrt(math.pi))
    constants = {"F0": 1e-5, "A": A, "c": c, "w": w}
    half = A * w * math.sqrt(math.pi) / 2
    return "F0 + A*exp(-((t - c)/w)**2)", constants, lambda t: 1e-5 * t + half * float(erf((t - c) / w))


def gates(count: int, q: float) -> tuple[str, dict[str, float], Impulse]:
    """So many openings, the narrower the larger q: by Jacobi and Anger's series."""
    from scipy.special import ive

    w, A = math.pi * count / END, 3 * FRICTION / END * math.sqrt(q)
    k = np.arange(1, int(20 * math.sqrt(q) + 60))

    def impulse(t: float) -> float:
        x = w * t + 0.7
        return A / w * math.fsum([ive(0, q / 2) * x, *(ive(k, q / 2) * np.sin(2 * k * x) / k)])

    return "A*exp(-q*sin(w*t + 0.7)**2)", {"A": A, "q": q, "w": w}, impulse


def chirp(turns: float) -> tuple[str, dict[str, float], Impulse]:
    """A sine whose frequency grows: Fresnel's integral."""
    from scipy.special import fresnel

    b, A = 2 * math.pi * turns / END**2, 2 * FRICTION / END
    scale = math.sqrt(math.pi / (2 * b))
    return "A*(1 + sin(b*t*t))", {"A": A, "b": b}, lambda t: A * (t + scale * float(fresnel(t / scale)[0]))


def sines(turns: Sequence[float], small: float) -> tuple[str, dict[str, float], Impulse]:
    """Three sines, the last one small."""
    A, sizes = 2 * FRICTION / END, (1.0, 0.7, small)
    w = [2 * math.pi * n / END for n in turns]
    constants = {"A": A, **{f"a{i}": a for i, a in enumerate(sizes)}, **{f"w{i}": x for i, x in enumerate(w)}}

    def impulse(t: float) -> float:
        return A * (t - math.fsum(a / x * (math.cos(x * t) - 1) for a, x in zip(sizes, w, strict=True)))

    return "A*(1 + a0*sin(w0*t) + a1*sin(w1*t) + a2*sin(w2*t))", constants, impulse


def varying_cases() -> dict[str, tuple[str, dict[str, float], Impulse]]:
    """Each force, its constants and its impulse from 0 on but for a constant, by name."""
    return {
        **{f"a pulse of {width:g} of the run": pulse(width) for width in WIDTHS},
        **{f"{count} gates, q = {q:g}": gates(count, q) for count, q in ((10, 20.0), (128, 50.0), (64, 500.0))},
        "a chirp of 100 turns": chirp(100.0),
        "sines of 16, 32 and 64 turns": sines((16.0, 32.0, 64.0), 1.0),
        "sines of incommensurate turns, one of 1e-6": sines((1.0, 13 * math.sqrt(2.0), 7 * math.pi), 1e-6),
    }


def varying_cells(rtols: Iterable[float]) -> Iterable[Cell]:
    """Every force at every tolerance."""
    law = _rigid()
    times = [x * END for x in AT]
    for rtol in rtols:
        for name, (force, constants, impulse) in varying_cases().items():
            expected = np.array([-(impulse(t) - impulse(0.0)) / FRICTION for t in times])

            def error(result: PairResult, expected: Any = expected) -> float:
                return float(np.max(np.abs(np.expm1(np.log(result.h) - expected))))

            run = partial(
                simulate, law=law, parameters={"R": 1.0, "eta": 1.0}, h=1.0, force=force, constants=constants,
                until_t=END, times=times, rtol=rtol,
            )  # fmt: skip
            # the series and the impulse round
            yield judge(("vary", name, f"{rtol:g}"), run, error, max(ALLOWED_ERROR * rtol, 1e-12))


def _rigid() -> Any:
    from sympy import oo, pi

    from softdyn.derive import ContactLaw, R, eta, h

    return ContactLaw(name="rigid", a=R, F_ela=oo, zeta=6 * pi * eta * R**2 / h)
