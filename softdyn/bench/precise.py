"""What references in 30 digits are made with: the paper's law, and collocation, in mpmath.

Both ``softdyn bench`` and ``softdyn stress`` have theirs from here. Of the derivation and of kernels nothing is used
but the nodes of Radau IIA. R = E = eta = 1.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import mpmath as mp

from softdyn.results.whole_files import written_whole

#: Of the arithmetic, and nodes of a step.
DIGITS, STAGES = 34, 16
UNIT = {"R": 1.0, "E": 1.0, "eta": 1.0}

#: Rates of the components of a state y at t; the last argument, the middle of the step, tells the side of a jump.
Rates = Callable[[Any, Sequence[Any], Any], list[Any]]


def deflection(h: Any, F: Any) -> Any:
    """The deflection that balances a force at a gap, of the same sign."""
    bar = h / (1 + h)
    size = abs(F)
    if size == 0:
        return mp.mpf(0)
    delta = mp.mpf(9) / 4 * size / mp.sqrt(2 * (bar + mp.cbrt(mp.mpf(81) / 32 * size**2)))
    for _ in range(80):
        a = mp.sqrt(2 * (bar + delta))
        step = (4 * a * delta / 9 - size) / (4 * (a + delta / a) / 9)
        delta -= step
        if abs(step) < delta * mp.mpf(10) ** (-DIGITS // 2 - 1):
            return delta if F > 0 else -delta
    raise ArithmeticError("no deflection")


def elastic_force(h: Any, delta: Any) -> Any:
    """F_ela = 4/9 a delta."""
    return 4 * mp.sqrt(2 * (h / (1 + h) + abs(delta))) * delta / 9


def gap_rate(h: Any, delta: Any, F: Any, remote: Sequence[tuple[Any, Any]] = ()) -> Any:
    """dh/dt under a force F, with a remote force that is the sum of A exp(-h/lam) over pairs (A, lam).

    Parameters
    ----------
    h, delta : number
        Over R.
    F : number
        Over E R^2.
    remote : sequence of (A, lam)
        Over E R^2, and over R.
    """
    bar = h / (1 + h)
    net = F - mp.fsum(A * mp.exp(-h / lam) for A, lam in remote)
    return -net / (3 * mp.pi / 2 * (2 * (bar + abs(delta))) ** 2 / bar**3)


def collocate(
    rates: Rates, y: Sequence[Any], ends: Sequence[float], times: Sequence[float]
) -> Iterator[tuple[Any, list[Any], Any]]:
    """Integrate from t = 0 by collocation on given steps.

    Parameters
    ----------
    rates : function of (t, y, middle of the step)
    y : sequence
        The state at t = 0.
    ends : sequence of float
        Of the steps.
    times : sequence of float
        Of the outputs, in order; none beyond the last step.

    Yields
    ------
    t, y, middle of the step
        At each of the times.

    Raises
    ------
    ArithmeticError
        If the equations of a step cannot be solved.
    """
    from softdyn.derive.radau import _nodes, _weights

    nodes = _nodes(STAGES)
    points = [mp.mpf(0), *nodes]
    powers = mp.matrix([[c**j for j in range(STAGES)] for c in nodes])
    integrals = mp.matrix([[c ** (j + 1) / (j + 1) for j in range(STAGES)] for c in nodes])
    inverse = powers * integrals**-1
    t, y, left = mp.mpf(0), list(y), list(times)
    for end in ends:
        step = mp.mpf(end) - t
        middle = t + step / 2
        z = _stages(rates, [t + c * step for c in nodes], y, step, inverse, middle)
        while left and left[0] <= end:
            at = mp.mpf(left.pop(0))
            weights = _weights(points, (at - t) / step, derivative=False)[1:]
            found = [
                start + mp.fsum(weight * stage for weight, stage in zip(weights, one, strict=True))
                for start, one in zip(y, z, strict=True)
            ]
            yield at, found, middle
        t, y = mp.mpf(end), [start + one[-1] for start, one in zip(y, z, strict=True)]
    assert not left, "outputs are left over"


def _stages(rates: Rates, times: list[Any], y: list[Any], step: Any, inverse: Any, middle: Any) -> list[list[Any]]:
    """Stages by component: the collocation equations by Newton's iteration, slopes by differences.

    The last change is below 1e-24, and made with a matrix that is right to some 8 digits: what it leaves is rounding.
    """
    count, stages = len(y), len(times)
    sizes = [mp.mpf(1)] + [max(abs(value), mp.mpf(10) ** -9) for value in y[1:]]
    small = mp.mpf(10) ** -12
    start = times[0] - (times[-1] - times[0]) / 1000

    def slopes_at(t: Any, state: list[Any], here: list[Any]) -> list[list[Any]]:
        columns = []
        for k in range(count):
            moved = [value + (small * sizes[k] if i == k else 0) for i, value in enumerate(state)]
            there = rates(t, moved, middle)
            columns.append([(a - b) / (small * sizes[k]) for a, b in zip(there, here, strict=True)])
        return columns

    # along the tangent, bent where it decays
    here = rates(times[0], y, middle)
    decay = min([mp.mpf(0), *(slopes_at(times[0], y, here)[k][k] for k in range(count))])
    z = [[(t - start) * rate / (1 - (t - start) * decay) for t in times] for rate in here]
    before = mp.inf
    for _ in range(80):
        states = [[value + one[i] for value, one in zip(y, z, strict=True)] for i in range(stages)]
        found = [rates(t, state, middle) for t, state in zip(times, states, strict=True)]
        if before > mp.mpf(10) ** -8:
            matrix = mp.matrix(count * stages)
            slopes = [slopes_at(t, state, one) for t, state, one in zip(times, states, found, strict=True)]
            for k in range(count):
                for i in range(stages):
                    for j in range(stages):
                        matrix[k * stages + i, k * stages + j] = inverse[i, j]
                    for m in range(count):
                        matrix[k * stages + i, m * stages + i] -= step * slopes[i][m][k]
            solver = matrix**-1
        residual = mp.matrix(
            [step * found[i][k] - mp.fsum(inverse[i, j] * z[k][j] for j in range(stages))
             for k in range(count) for i in range(stages)]
        )  # fmt: skip
        change = solver * residual
        z = [[z[k][i] + change[k * stages + i] for i in range(stages)] for k in range(count)]
        size = max(abs(change[k * stages + i]) / sizes[k] for k in range(count) for i in range(stages))
        if size < mp.mpf(10) ** -24:
            return z
        before = size
    raise ArithmeticError(f"the collocation equations were solved to {mp.nstr(before, 3)} only")


def digits(number: Any) -> str:
    """Thirty digits, as text."""
    return str(mp.nstr(number, 30))


def stored(file: Path) -> dict[str, Any]:
    """References in a file, by the names of their cases."""
    cases: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))["cases"]
    return cases


def how_made(doc: str | None) -> str:
    """What the file says of how its references are made: the docstring of the module that makes them, less its head."""
    return (doc or "").split("\n\n", 1)[1].replace("\n", " ").strip()


def remake(
    file: Path, doc: str | None, makers: Mapping[str, Callable[[], dict[str, Any]]], chosen: Sequence[str] | None = None
) -> None:
    """Make some of the references of a file, and write it after each.

    Parameters
    ----------
    file : Path
    doc : str
        Docstring of the module that makes them.
    makers : mapping
        From each case's name to what makes its reference; any other is dropped from the file.
    chosen : sequence of str, optional
        Names of the cases to make; those that the file lacks, if it is not given.
    """
    cases = stored(file) if file.is_file() else {}
    file.parent.mkdir(parents=True, exist_ok=True)

    def write() -> None:
        content = {"how": how_made(doc), "cases": {name: cases[name] for name in makers if name in cases}}
        with written_whole(file) as temporary:
            temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")

    write()
    for name in [name for name in makers if name not in cases] if chosen is None else chosen:
        began = time.process_time()
        cases[name] = makers[name]()
        write()
        print(f"{name}: {time.process_time() - began:.1f} s", file=sys.stderr, flush=True)
