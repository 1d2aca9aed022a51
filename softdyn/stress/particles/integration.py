"""The equations of a case, integrated by scipy between the breaks of its drives and the switches of its contacts.

What a contact is, pressed, pulled, or beyond its range, stays as it is until one of them changes, which is located:
between two such times nothing has a kink but the law itself.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from softdyn.particles.particle_keys import ParticleScene
from softdyn.particles.until import run_end
from softdyn.stress.particles.cases import ACROSS, FREE, Case, Equations, Pair, first_surroundings, part_of, set_up
from softdyn.stress.particles.own_equations import (
    PRESSED,
    PULLED,
    RIDES,
    Mode,
    Now,
    by,
    geometry,
    jacobian,
    pack,
    spread,
    tell,
    unpack,
    weights,
)

Array = NDArray[np.float64]
#: Beyond this effort a scene is left without a reference.
MOST_EVALUATIONS = 30_000
#: Duration of a jump of the forces where surfaces slide, in units of that of the run.
INSTANT = 1e-12
#: Contacts are looked for so far beyond their range, in radii, before it is known which will come within it.
BESIDE = 0.25
#: Deflections over the radius below this are none; and how close to the range a contact is at it.
NONE, AT_RANGE = 1e-13, 1e-9


def images(scene: ParticleScene, d: int) -> Iterator[tuple[int, int, int]]:
    """Lattice vectors to look for neighbours at."""
    spans = [(0,) if length is None else (-2, -1, 0, 1, 2) for length in (scene.box or [None] * d)] + [(0,)] * (3 - d)
    yield from ((p, q, s) for p in spans[0] for q in spans[1] for s in spans[2])


def near(case: Case, x: Array, z: Array, beside: float = 0.0) -> set[Pair]:
    """Pairs whose surfaces are within the range of one another, or by so many radii beyond it.

    Parameters
    ----------
    case : Case
    x : array, shape (N, d)
    z : array, shape (4 + 3 walls,)
        What surrounds the particles, as of :func:`softdyn.stress.particles.cases.first_surroundings`.
    beside : float
        How far beyond the range pairs are wanted, in units of the smallest radius.
    """
    scene, (count, d) = case.scene, x.shape
    reach = math.inf if scene.range is None else float(scene.range)
    radii = np.broadcast_to(np.array(scene.radii, dtype=float), (count,))
    reach += beside * float(radii.min())
    cell = np.diag([math.exp(z[k]) if k < d and (scene.box or [None] * d)[k] is not None else 0.0 for k in range(3)])
    cell[0, 1] = z[3]
    place = np.pad(x, ((0, 0), (0, 3 - d)))
    found: set[Pair] = set()
    for shift in images(scene, d):
        apart = np.linalg.norm(place[None, :] - place[:, None] + cell @ shift, axis=2) - radii[:, None] - radii
        found |= {(int(i), int(j), shift) for i, j in np.argwhere(apart < reach) if i < j}
    points = z[4:].reshape(-1, 3)
    for w, wall in enumerate(scene.wall):
        normal = np.array(wall.normal, float) / np.linalg.norm(wall.normal)
        apart = (points[w, :d] - x) @ normal - radii
        found |= {(int(i), count + w, (0, 0, 0)) for i in np.flatnonzero(apart < reach)}
    return found


class Beyond(ArithmeticError):
    """The reference itself cannot be computed."""


def balanced(eq: Equations, t: float, state: Array, part: int) -> Array:
    """Without drag: positions in elastic equilibrium at the gaps of a state.

    Beyond their range surfaces do not press, and the gap follows the centres, until it is the range.

    Parameters
    ----------
    eq : Equations
    t : float
    state : array
        Its positions are a guess.
    part : int
        Number of the part between breaks of the drives, as of :func:`softdyn.stress.particles.cases.part_of`.
    """
    x, u, T, z = unpack(eq, state.copy())
    given = eq.given(t, part)
    held, free = np.exp(u), ~eq.fixed.reshape(-1)
    pair = eq.j < eq.count
    apart = eq.first - eq.second
    for _ in range(60):
        n, r = geometry(eq, x, z)
        gap = np.where(held < eq.reach, held, np.where(r - eq.S < held, np.maximum(r - eq.S, eq.reach), held))
        deflection = (eq.S - r + gap) / 2
        elastic, _, by_delta, *_ = (np.broadcast_to(v, gap.shape) for v in eq.law_of(gap, deflection, *eq.q))
        _, _, grip, _ = weights(eq, gap, np.where(deflection < 0, PULLED, PRESSED))
        left = given["force"] - apart.T @ ((grip * elastic)[:, None] * n + T)
        dyad = n[:, :, None] * n[:, None, :]
        block = by(grip * by_delta / 2) * dyad - by(np.where(pair, grip * elastic / r, 0.0)) * (ACROSS - dyad)
        matrix = spread(apart, apart, block).reshape(3 * eq.count, -1)[np.ix_(free, free)]
        change = np.linalg.lstsq(matrix, left.reshape(-1)[free], rcond=FREE)[0]
        factor = min(1.0, 0.1 * float(eq.radii.min()) / max(float(np.abs(change).max(initial=0.0)), 1e-300))
        x.reshape(-1)[free] += factor * change
        if np.abs(change).max(initial=0.0) < 1e-14 * eq.radii.max():
            return pack(eq, x, np.log(gap), T, z)
    raise Beyond("no elastic equilibrium is found")


def settled(eq: Equations, t: float, state: Array, part: int, before: Mode | None = None) -> tuple[Array, Mode]:
    """A state, and what its contacts are from then on; those that ride have exactly the gap that goes with it.

    Parameters
    ----------
    eq : Equations
    t : float
    state : array
    part : int
        Number of the part between breaks of the drives.
    before : array of int, shape (contacts,), optional
        What the contacts were until then: gaps of those that rode are what goes with their centres.
    """
    x, u, T, z = unpack(eq, state.copy())
    _, r = geometry(eq, x, z)
    gap, length = np.exp(u), float(eq.radii.min())
    deflection = (eq.S - r + gap) / 2
    if math.isinf(eq.reach):
        return state, np.full(len(gap), PRESSED)
    beyond = gap >= eq.reach * (1 - AT_RANGE)
    rides = beyond & (deflection >= -NONE * length)
    rides |= False if before is None else before == RIDES
    u, T = np.where(rides, np.log(np.where(rides, r - eq.S, 1.0)), u), np.where(rides[:, None], 0.0, T)
    state = pack(eq, x, u, T, z)
    mode = np.where(rides & beyond, RIDES, np.where(deflection < 0, PULLED, PRESSED))
    level = rides | (np.abs(deflection) <= NONE * length)
    if level.any():
        opening = tell(eq, t, state, part, mode).opening
        mode = np.where(level & (opening < 0), PULLED, np.where(level & ~beyond, PRESSED, mode))
    return state, mode


def lasting(eq: Equations, t: float, state: Array, part: int, mode: Mode) -> float:
    """Above 0 as long as all contacts are what they were.

    Parameters
    ----------
    eq : Equations
    t : float
    state : array
    part : int
        Number of the part between breaks of the drives.
    mode : array of int, shape (contacts,)
        What the contacts were: PRESSED, PULLED or RIDES.
    """
    now = tell(eq, t, state, part, mode)
    size, margin = now.deflection / float(eq.radii.min()), 2 * NONE
    pressed = np.minimum(size + margin, 1 - now.gap / eq.reach)
    rides = np.minimum(now.gap / eq.reach - 1 + 2 * AT_RANGE, now.opening / np.abs(now.rates).max() + margin)
    left = np.where(mode == PRESSED, pressed, np.where(mode == PULLED, margin - size, rides))
    return float(left.min(initial=1.0))


def integrate(eq: Equations, first: Array, times: Array, rtol: float) -> Array:
    """States at the times, the first of which is that of ``first``, shape (times, ...).

    Parameters
    ----------
    eq : Equations
    first : array
        State at the first of the times.
    times : array, shape (times,)
        Increasing.
    rtol : float
        Of scipy's steps.
    """
    ends = [float(times[0]), *(t for t in eq.breaks if times[0] < t < times[-1]), float(times[-1])]
    force = max(float(np.abs(now_of(eq, t, first).F).max(initial=0.0)) for t in ends)
    stiff = float(np.abs(eq.law_of(np.exp(unpack(eq, first)[1]), 0 * eq.S, *eq.q)[2]).max()) if len(eq.pairs) else 1.0
    scale = max(force, 1e-3 * stiff * float(eq.radii.min()))
    c, length = len(eq.pairs), float(eq.radii.min())
    around = np.concatenate([np.ones(3), np.full(1 + 3 * eq.walls, length)])
    size = pack(eq, np.full((eq.count, 3), length), np.ones(c), np.full((c, 3), scale), around)
    states, state, taken = [first], first, 0

    def rates(t: float, state: Array, part: int, mode: Mode) -> Array:
        nonlocal taken
        taken += 1
        if taken > MOST_EVALUATIONS:
            raise Beyond(f"{MOST_EVALUATIONS} evaluations of the equations are not enough: t={t:.4g} is reached")
        return tell(eq, t, state, part, mode).rates

    for start, end in pairwise(ends):
        part, t, mode = part_of(eq, (start + end) / 2), start, None
        if start > ends[0] and not eq.dragged:
            state = jumped(eq, start, state, part, rtol)
        while t < end:
            state, mode = settled(eq, t, state, part, mode)

            def changes(t: float, y: Array, *of: Any) -> float:
                return lasting(eq, t, y, *of)

            changes.terminal, changes.direction = True, -1  # type: ignore[attr-defined]
            wanted = [*times[(t < times) & (times < end)], end]
            with np.errstate(all="ignore"):
                done = solve_ivp(
                    rates, (t, end), state, method="Radau", t_eval=wanted, rtol=rtol,
                    atol=0.1 * rtol * size, max_step=(end - start) / 4, args=(part, mode),
                    jac=lambda t, y, *of: jacobian(eq, t, y, *of),
                    events=None if math.isinf(eq.reach) else changes,
                )  # fmt: skip
            found = np.reshape(done.y, (len(state), -1)).T  # empty, it is no array
            if not done.success or not np.isfinite(found).all():
                raise Beyond(f"scipy gives up at t={done.t[-1] if len(done.t) else t:.4g}: {done.message}")
            states += [y for when, y in zip(done.t, found, strict=True) if when < end]
            ended = done.status == 0
            t, state = (end, found[-1]) if ended else (float(done.t_events[0][0]), done.y_events[0][0])
        if end in times:
            states.append(state)
    return np.array(states)


def now_of(eq: Equations, t: float, state: Array) -> Now:
    """All that the equations say of a state by itself; at a break of the drives, before it.

    Parameters
    ----------
    eq : Equations
    t : float
    state : array
    """
    part = part_of(eq, t)
    state, mode = settled(eq, t, state, part)
    return tell(eq, t, state, part, mode)


def jumped(eq: Equations, t: float, state: Array, after: int, rtol: float) -> Array:
    """State behind a jump of the forces, where nothing but films resists for an instant: these stay as they are.

    Parameters
    ----------
    eq : Equations
    t : float
        Of the jump, a break of the drives.
    state : array
        Before it.
    after : int
        Number of the part of the drives behind it.
    rtol : float
        Of scipy's steps, where surfaces slide.
    """
    before = eq.given(t, part_of(eq, t))["force"]
    jump = eq.given(t, after)["force"] - before
    if np.abs(jump).max() < FREE * np.abs(eq.given(t, after)["force"]).max():
        return state
    return ramped(eq, t, state, before, after, rtol) if eq.slides else balanced(eq, t, state, after)


def ramped(eq: Equations, t: float, state: Array, before: Array, after: int, rtol: float) -> Array:
    """State behind a jump of the forces where surfaces slide: how they come to stick depends on the way.

    That is the limit of faster and faster ramps. Of one within an instant the equations are what they always are, in
    which films and what slides have no time to move.

    Parameters
    ----------
    eq : Equations
    t : float
        Of the jump.
    state : array
        Before it.
    before : array, shape (N, 3)
        External forces before it.
    after : int
        Number of the part of the drives behind it.
    rtol : float
        Of scipy's steps.
    """
    instant, then = INSTANT * run_end(eq.case.scene), eq.given(t, after)
    still = {name: np.zeros_like(value) for name, value in then.items()}
    still |= {"torque": then["torque"], "force_rate": (then["force"] - before) / instant}

    def given(since: float, part: int) -> dict[str, Array]:
        return still | {"force": before + since * still["force_rate"]}

    return np.asarray(integrate(replace(eq, given=given, breaks=[]), state, np.array([0.0, instant]), rtol)[-1])


def solve(case: Case, times: Array, rtol: float, looks: int = 8) -> tuple[Equations, Array]:
    """States of a case at the output times, and its equations.

    Contacts that come within range on the way are looked for, and the whole is integrated once more with them.

    Parameters
    ----------
    case : Case
    times : array, shape (times,)
        Increasing, from 0.
    rtol : float
        Of scipy's steps.
    looks : int
        So many times between two outputs contacts are looked for.
    """
    scene = case.scene
    x = np.array(scene.positions, dtype=float)
    d = x.shape[1]
    z = first_surroundings(scene, d)
    pairs = near(case, x, z, BESIDE)
    fine = np.interp(np.arange((len(times) - 1) * looks + 1) / looks, np.arange(len(times)), times)
    for _ in range(8):
        eq = set_up(case, sorted(pairs))
        place = np.pad(x, ((0, 0), (0, 3 - d)))
        apart = geometry(eq, place, z)[1] - eq.S
        gap = apart if scene.gap is None else np.maximum(apart, scene.gap)
        if (gap <= 0).any():
            raise Beyond("surfaces overlap, and no gap is given")
        first = pack(eq, place, np.log(gap), np.zeros((len(pairs), 3)), z)
        if not eq.dragged:
            still = np.zeros((eq.count, 3))
            first = ramped(eq, 0.0, first, still, 0, rtol) if eq.slides else balanced(eq, 0.0, first, 0)
        states = integrate(eq, first, fine, rtol)
        met = set(pairs)
        for state in states:
            place, _, _, around = unpack(eq, state)
            met |= near(case, place[:, :d], around)
        if met == pairs:
            return eq, states[::looks]
        pairs = met
    raise Beyond("new contacts are found without end")
