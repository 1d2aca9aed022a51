"""One random scene: the engine's frames against the reference, and how large their difference may be.

A step leaves an error of ``rtol`` at most: of each gap relative to it, of each position relative to the radius, of each
tangential force relative to the largest force. What becomes of such an error is seen on the reference itself: it is
kicked by a small error of that shape at every other frame, and integrated again. Ten times ``rtol``, times one and the
largest response to a kick of size one, is what may be: a step estimates the error of a formula of lower order than its
own, so that the errors of hundreds of them come to few such estimates (a twentieth to five in nearly all scenes). A
difference that does not shrink with ``rtol`` is seen best at a tight one: so each scene is also run at that.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SoftdynError
from softdyn.particles.particle_run import DOUBTFUL, UNBALANCED, UNSEEN, simulate_particles
from softdyn.particles.results import ParticleResult
from softdyn.stress.judge import OUTCOMES, REFUSED, RIGHT, TOLD, WRONG
from softdyn.stress.particles.cases import Case, Equations, part_of
from softdyn.stress.particles.integration import Beyond, balanced, integrate, now_of, solve
from softdyn.stress.particles.own_equations import geometry, pack, unpack

Array = NDArray[np.float64]
#: The tight tolerance.
TIGHT = 1e-6
#: So many times rtol an output may be off, and as many times the response to that.
OFF = 10.0
#: Size of a kick.
KICK = 1e-4
#: Contacts may be within the range for one and beyond it for the other that are so close to it.
EDGE = 0.03
#: Words of the warnings that say a number may be wrong. All others, of pulled films, of motions that nothing resists,
#: are of what the scene asks, and excuse no wrong number.
OF_NUMBERS = (UNBALANCED, UNSEEN, DOUBTFUL)
#: A scene that has no reference.
UNKNOWN = "no reference"


@dataclass(frozen=True)
class Verdict:
    """What came of a scene.

    Attributes
    ----------
    seed : int
    kind : str
    outcome : str
    error, allowed : float
        Of what is worst relative to what is allowed.
    what : str
        That: x, h, F, T, v, spin, stress, cell or gradient.
    rtol : float
    steps : int
    said : str
        The error's or the warnings' words.
    """

    seed: int
    kind: str
    outcome: str
    error: float = math.nan
    allowed: float = math.nan
    what: str = ""
    rtol: float = math.nan
    steps: int = 0
    said: str = ""


#: What is compared at a frame: by name, each an array; those of contacts by contact.
Frame = dict[str, Array]


def of_reference(eq: Equations, t: float, state: Array) -> tuple[Frame, dict[tuple[int, int], int]]:
    """What the reference says at t, and the rows of the contacts within their range.

    Parameters
    ----------
    eq : Equations
    t : float
    state : array
        As of :func:`softdyn.stress.particles.own_equations.pack`.
    """
    now = now_of(eq, t, state)
    x, *_ = unpack(eq, state)
    d = eq.d
    frame = {"x": x[:, :d], "h": now.gap, "F": now.F}
    frame |= {"cell": now.cell[:d, :d]} if eq.periodic.any() else {}
    frame |= {"stress": now.stress[:d, :d]} if eq.periodic[:d].all() else {}
    if eq.imposed:
        frame["gradient"] = now.gradient[:d, :d]
    if eq.slides:
        frame["T"] = now.T[:, :d]
    if eq.dragged:
        frame["v"] = now.v[:, :d]
        if eq.slides:
            frame["spin"] = now.spin[:, 2:] if d == 2 else now.spin
    rows = {(int(i), int(j)): c for c, (i, j) in enumerate(zip(eq.i, eq.j, strict=True)) if now.gap[c] < eq.reach}
    return frame, rows


def of_engine(eq: Equations, result: ParticleResult, k: int) -> tuple[Frame, dict[tuple[int, int], int]]:
    """The same of frame k of a result.

    Parameters
    ----------
    eq : Equations
    result : ParticleResult
    k : int
    """
    contacts = result.contacts(k)
    frame: Frame = {name: contacts[name] for name in ("h", "F", "T") if name in contacts}
    frame |= {
        name: result.arrays[name][k]
        for name in ("x", "v", "cell", "gradient", "stress", "spin")
        if name in result.arrays
    }
    pairs = zip(contacts["i"].tolist(), contacts["j"].tolist(), strict=True)
    return frame, {pair: c for c, pair in enumerate(pairs)}


def differences(
    eq: Equations, one: tuple[Frame, dict[tuple[int, int], int]], other: tuple[Frame, dict[tuple[int, int], int]],
    sizes: dict[str, float],
) -> dict[str, float]:  # fmt: skip
    """By how much two frames differ, what each name stands for in units of its size.

    Parameters
    ----------
    eq : Equations
    one, other : tuple of (Frame, mapping from (i, j) to int)
        Frames, and the rows that the contacts within their range have in them.
    sizes : mapping from str to float
        As of :func:`sizes_of`.
    """
    (left, rows), (right, others) = one, other
    found = {}
    for name in left:
        if name in ("h", "F", "T"):
            common = sorted(rows.keys() & others.keys())
            u, v = left[name][[rows[c] for c in common]], right[name][[others[c] for c in common]]
            u, v = (np.log(u), np.log(v)) if name == "h" else (u, v)
            if name == "h":
                lone = [left["h"][rows[c]] for c in rows.keys() - others.keys()]
                lone += [right["h"][others[c]] for c in others.keys() - rows.keys()]
                if any(gap < (1 - EDGE) * eq.reach for gap in lone):
                    found[name] = math.inf
                    continue
        else:
            u, v = left[name], right[name]
        if name == "x" and eq.gauge:
            u, v = (np.linalg.norm(place[:, None] - place[None], axis=2) for place in (u, v))
        found[name] = float(np.abs(u - v).max(initial=0.0)) / sizes[name]
    return found


def sizes_of(eq: Equations, frames: list[Frame]) -> dict[str, float]:
    """Units in which each quantity is compared: the largest of it, or a radius."""
    sizes = {}
    for name in frames[0]:
        size = max(float(np.abs(frame[name]).max(initial=0.0)) for frame in frames)
        sizes[name] = size if size > 0 else 1.0
    sizes |= {"x": float(eq.radii.min()), "h": 1.0}
    if "T" in sizes:
        sizes["T"] = sizes["F"] = max(sizes["T"], sizes["F"])
    return sizes


def kicked(eq: Equations, t: float, state: Array, size: float, random: np.random.Generator) -> Array:
    """A state with an error as large as a step may leave, of that size instead of ``rtol``.

    Parameters
    ----------
    eq : Equations
    t : float
    state : array
    size : float
        Of gaps relative to them, of positions in units of the radius, of tangential forces in units of the largest
        force.
    random : Generator
        Draws the signs.
    """
    x, u, T, z = unpack(eq, state)

    def sign(shape: int | tuple[int, ...]) -> Array:
        return random.choice([-1.0, 1.0], shape)

    # as a contact fades, so does what its gap counts for
    ahead = np.clip(2 * (1 - np.exp(u) / eq.reach), 0.0, 1.0)
    u = u + size * sign(len(u)) / np.maximum(ahead**2 * (3 - 2 * ahead), 0.03)
    if eq.slides:
        now = now_of(eq, t, state)
        n, _ = geometry(eq, x, z)
        stiffness = np.broadcast_to(eq.law_of(now.gap, now.deflection, *eq.q)[-1], now.gap.shape)
        forces = float(max(np.abs(now.F).max(initial=0.0), np.abs(now.T).max(initial=0.0)))
        # as the surfaces would be sheared by a gap, if that is more
        T = T + (size * np.maximum(stiffness * now.gap, forces) * sign(len(n)))[:, None] * np.cross(n, [0.0, 0.0, 1.0])
    if eq.dragged:
        return pack(eq, x + size * eq.radii[:, None] * sign(x.shape) * ~eq.fixed, u, T, z)
    try:
        return balanced(eq, t, pack(eq, x, u, T, z), part_of(eq, t))
    except Beyond:
        return state


def judge_case(seed: int, case: Case) -> Verdict:
    """Run a case at its tolerance, and at a tight one if that is another, and say what it came to: the worse."""
    rtols = sorted({float(case.scene.rtol), min(TIGHT, float(case.scene.rtol))}, reverse=True)
    results: list[ParticleResult] = []
    for rtol in rtols:
        judged = partial(Verdict, seed, case.kind, rtol=rtol)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                results.append(simulate_particles(replace(case.scene, rtol=rtol)))
        except SoftdynError as refusal:
            return judged(outcome=REFUSED, said=str(refusal))
        except Exception as failure:  # anything else is a fault, and is reported as one
            return judged(outcome=WRONG, said=f"{type(failure).__name__}: {failure}")
        arrays = results[-1].arrays
        numbers = [values for name, values in arrays.items() if values.dtype.kind == "f" and name != "box"]
        if not all(np.isfinite(values).all() for values in numbers) or not (arrays["contact_h"] > 0).all():
            return judged(outcome=WRONG, said="an output is not finite, or h <= 0")
    try:
        compared = _errors(seed, case, results, rtols)
    except Beyond as reason:
        return Verdict(seed, case.kind, UNKNOWN, rtol=rtols[0], said=str(reason))
    found = []
    for (errors, allowed), result, rtol in zip(compared, results, rtols, strict=True):
        what = max(errors, key=lambda name: errors[name] / allowed[name])
        told = [warning for warning in result.stats["warnings"] if any(words in warning for words in OF_NUMBERS)]
        outcome = RIGHT if errors[what] <= allowed[what] else TOLD if told else WRONG
        steps = int(result.stats["steps"])
        found.append(Verdict(seed, case.kind, outcome, errors[what], allowed[what], what, rtol, steps, "; ".join(told)))
    return max(found, key=lambda verdict: (OUTCOMES.index(verdict.outcome), verdict.error / verdict.allowed))


#: Errors, or what they may be, by what they are of.
Sizes = dict[str, float]


@np.errstate(all="ignore")  # of branches of the law that do not hold
def _errors(
    seed: int, case: Case, results: Sequence[ParticleResult], rtols: Sequence[float]
) -> list[tuple[Sizes, Sizes]]:
    """Largest differences of each result from the reference over all frames, and what they may be."""
    times = results[0].t
    eq, states = solve(case, times, 1e-2 * rtols[-1])
    frames = [of_reference(eq, float(t), state) for t, state in zip(times, states, strict=True)]
    sizes = sizes_of(eq, [frame for frame, _ in frames])
    response = dict.fromkeys(frames[0][0], 0.0)
    random = np.random.default_rng(seed)
    for k in range(0, len(times) - 1, 2):
        start = kicked(eq, float(times[k]), states[k], KICK, random)
        for m, state in enumerate(integrate(eq, start, times[k:], 1e-2 * KICK)):
            moved = of_reference(eq, float(times[k + m]), state)
            for name, value in differences(eq, frames[k + m], moved, sizes).items():
                response[name] = max(response[name], value / KICK)
    found = []
    allowed = {name: OFF * (1 + value) for name, value in response.items()}
    for result, rtol in zip(results, rtols, strict=True):
        errors = dict.fromkeys(response, 0.0)
        for k, frame in enumerate(frames):
            for name, error in differences(eq, frame, of_engine(eq, result, k), sizes).items():
                errors[name] = max(errors[name], error)
        found.append((errors, {name: rtol * value for name, value in allowed.items()}))
    return found
