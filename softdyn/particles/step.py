"""One step of many particles: implicit stages, an estimate of the error, and outputs within the step.

See :mod:`softdyn.particles.force_balance` for what is solved at a stage, and :mod:`softdyn.particles.method` for the
stages.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.energy import CARRIED, ELASTIC, net_power, powers
from softdyn.particles.force_balance import (
    Balance,
    Newton,
    StageInput,
    balance,
    largest,
    unresisted,
    unturned,
    with_torques,
)
from softdyn.particles.geometry import Box, Contacts
from softdyn.particles.method import ERROR, GAMMA, NODES, ROWS, dense_row, rate_weights
from softdyn.particles.surroundings import coordinates, placed
from softdyn.particles.system import System, turns_freely

Array = NDArray[np.float64]
Rates = Mapping[str, Array]
#: Times that a stage is solved for, each with less of the rotations that nothing resists.
MOST_TWISTS = 5
#: Of the estimate for a power that fades: enough for one that falls by any factor up to exp(30) within a step.
FADING = 0.1


@dataclass(frozen=True)
class Output:
    """State within a step: time, balance, velocities, energies exchanged since the start of the step; box and walls."""

    t: float
    at: Balance
    v: Array
    work: dict[str, float]
    system: System


@dataclass(frozen=True)
class Step:
    """A step that has been taken.

    Attributes
    ----------
    end : Balance
    error : float
        Estimated error in units of what is allowed.
    v : array, shape (N, d + rotations)
    y_rate : array, shape (contacts,)
        Rates at the end.
    work : dict
        Energy of each kind, exchanged over the step; kinds as ``System.works``.
    system : System
        With the box and the walls as they are at the end.
    first_v : array, shape (N, d + rotations)
        Velocities at the start, extrapolated from within.
    first_box : Box
        At the start, with its rates there.
    outputs : tuple of Output
    power : dict
        Of each kind, at the end.
    work_error : float
        Estimated error of all work together.
    kept : dict
        Numbers of the particles that mechanisms integrate, at the end.
    """

    end: Balance
    error: float
    v: Array
    y_rate: Array
    work: dict[str, float]
    system: System
    first_v: Array
    first_box: Box
    outputs: tuple[Output, ...]
    power: dict[str, float]
    work_error: float
    kept: dict[str, Array]


@dataclass(frozen=True)
class _Begun:
    """A step as it begins: what all its stages start from.

    Attributes
    ----------
    t, dt : float
    x : array, shape (N, d + rotations)
        Positions; rotations count from here.
    z : array
        Coordinates of box and walls, if they move otherwise than by a given shear rate; else empty.
    own : dict
        What mechanisms integrate, as it is at the start.
    notes : dict
        What they noted.
    turned : array, shape (N, rotations)
        By how much those whose spin is given have turned before.
    """

    system: System
    contacts: Contacts
    newton: Newton
    t: float
    dt: float
    x: Array
    z: Array
    own: dict[str, Array]
    notes: dict[str, Any]
    turned: Array


@dataclass(frozen=True)
class _Stage:
    """One implicit stage: what was found, with box and walls; all rates; the unknown ones of the box.

    Rates are by name: ``x``, ``y``, ``z`` of positions, gaps, and box with walls; the others are the mechanisms' own.
    """

    given: StageInput
    found: Balance
    system: System
    rates: Rates
    box_rates: Array


def take_step(
    system: System,
    contacts: Contacts,
    newton: Newton,
    t: float,
    x: Array,
    v: Array,
    y_rate: Array,
    dt: float,
    outputs: Sequence[float] | Array = (),
    power: dict[str, float] | None = None,
    end: float | None = None,
    kept: Mapping[str, Array] | None = None,
) -> Step:
    """Try a step of the given length from time t, with v and y_rate as guesses of the rates.

    Parameters
    ----------
    outputs : sequence of float
        Times within the step at which the state is wanted too, if the error allows the step.
    power : dict, optional
        Power of each kind at t, if v and y_rate are the rates there, and not only guesses of them.
    end : float, optional
        Time at the end, which t + dt rounds.
    kept : mapping, optional
        Numbers of the particles that mechanisms integrate from step to step, as they are.

    Raises
    ------
    StepFailed, softdyn.particles.linear.Indefinite
    """
    begun = _begin(system, contacts, newton, t, x, dt, kept or {})
    z_rate = placed(system, t, 0.0, begun.z, system.box_rates)[1] if begun.z.size else begun.z
    # at the start, where those of the mechanisms' own are not known, and at each stage
    unknown = {name: np.zeros_like(values) for name, values in begun.own.items()}
    rates: list[Rates] = [{"x": v, "y": y_rate, "z": z_rate, **unknown}]
    guess_x, guess_y, box_rates = v, y_rate, system.box_rates
    spent = [power or dict.fromkeys((*system.works, ELASTIC, CARRIED), 0.0)]
    at: _Stage | None = None
    end = t + dt if end is None else end
    for row, when in zip(ROWS, (*(t + NODES[:-1] * dt), end), strict=True):
        at = None  # many numbers that the next stage has no use for
        at = _stage(begun, rates, row, float(when), guess_x, guess_y, box_rates)
        rates.append(at.rates)
        guess_x, guess_y, box_rates = at.rates["x"], at.rates["y"], at.box_rates
        spent.append(powers(at.system, contacts, at.found, float(when), at.rates))
    assert at is not None

    weights = np.array([0.0, *ERROR])
    errors = {name: dt * _combined(rates, weights, name) for name in at.rates}
    # what is given by its rate has no error
    errors["x"] = np.where(system.fixed, 0.0, errors["x"])
    error = error_of(system, at.found, errors)
    if system.leader is not None:
        # errors of the strains of the box, as of positions
        strains = system.dimension + (system.lean0 is None)
        error = max(error, largest(errors["z"][:strains]) / system.rtol)
    between = []
    for when in outputs if error <= 1.0 else ():
        if begun.own:
            # their rates at the start are not known, without which a stage more is not as good: a shorter step is
            shorter = take_step(
                system, contacts, newton, t, x, v, y_rate, float(when) - t, (), power, float(when), kept
            )
            between.append(Output(float(when), shorter.end, shorter.v, shorter.work, shorter.system))
            continue
        theta = (float(when) - t) / dt
        near = np.array([0.0, *rate_weights(theta)])
        row = dense_row(theta, power is not None)
        guess_x, guess_y = _combined(rates, near, "x"), _combined(rates, near, "y")
        other = _stage(begun, rates, row, when, guess_x, guess_y, box_rates)
        own = powers(other.system, contacts, other.found, when, other.rates)
        work = _work(dt, [*row, GAMMA], [*spent, own])
        between.append(Output(float(when), other.found, other.rates["x"], work, other.system))
    ahead = np.array([0.0, *rate_weights(0.0)])
    first_v, first_box = _combined(rates, ahead, "x"), system.box
    if system.leader is not None:
        first_box = system.leader.box_with(system.box, _combined(rates, ahead, "z"))
    whole = _work(dt, ROWS[-1], spent)
    work_error = dt * power_error(np.array([net_power(system, of) for of in spent[1:]]))
    return Step(
        at.found,
        error,
        at.rates["x"],
        at.rates["y"],
        whole,
        at.system,
        first_v,
        first_box,
        tuple(between),
        spent[-1],
        work_error,
        {name: at.given.own[name] + at.given.s * at.rates[name] for name in kept or {}},
    )


def power_error(power: Array) -> float:
    """Estimated error of the mean power over a step, from that at the stages.

    What two quadratures differ by is a second difference. That of a power which fades is 0 by chance where it falls to
    a sixth within the step. Of an exponential it is the square of the first difference over the power itself, which is
    not: a part of that is added where it falls by a third or more.
    """
    size = float(np.abs(power).max())
    if not 0 < size < math.inf:
        return float(abs(ERROR @ power))
    part = power / size  # of a square there may be no number
    fades = np.sign(part[-1]) == np.sign(part[0]) and 0 < abs(part[-1]) < 2 / 3 * abs(part[0])
    return float(size * (abs(ERROR @ part) + (FADING * (part[-1] - part[0]) ** 2 if fades else 0.0)))


def _begin(
    system: System, contacts: Contacts, newton: Newton, t: float, x: Array, dt: float, kept: Mapping[str, Array]
) -> _Begun:
    notes: dict[str, Any] = {}
    own = dict(kept)
    for mechanism in system.having["begin"]:
        noted, start = mechanism.begin(system, contacts, t, x)
        notes |= noted
        own |= start
    z = coordinates(system, t) if system.surrounded else np.empty(0)
    turned = system.place(t)[:, system.dimension :] if system.fixed.any() else np.empty(0)
    return _Begun(system, contacts, newton, t, dt, with_torques(system, x), z, own, notes, turned)


def _combined(rates: Sequence[Rates], weights: Array, name: str) -> Array:
    """Weighted sum of one of the rates over the start and the stages."""
    total = np.zeros_like(rates[0][name])
    for weight, of_stage in zip(weights, rates, strict=False):
        if weight:
            total += weight * of_stage[name]
    return total


def _work(dt: float, weights: Sequence[float] | Array, spent: Sequence[dict[str, float]]) -> dict[str, float]:
    """Energy of each kind, from the powers at the start and at the stages."""
    pairs = list(zip(weights, spent, strict=True))
    return {name: dt * sum(float(w) * powers[name] for w, powers in pairs) for name in spent[-1]}


def _stage(
    begun: _Begun,
    rates: Sequence[Rates],
    row: Array,
    when: float,
    guess_x: Array,
    guess_y: Array,
    box_rates: Array,
) -> _Stage:
    """Solve one implicit stage.

    Parameters
    ----------
    rates : sequence of mapping
        At the start, and at the stages before.
    row : array
        Weights of these.
    when : float
        Time of the stage.
    guess_x, guess_y, box_rates : array
        Guesses of the rates.
    """
    system, contacts, newton, dt = begun.system, begun.contacts, begun.newton, begun.dt
    s = GAMMA * dt
    x_star, y_star = begun.x + dt * _combined(rates, row, "x"), dt * _combined(rates, row, "y")
    first = x_star + s * guess_x
    if not system.dragged:  # rates are no velocities there, and behind a jump not even that
        far = largest(first - begun.x) / (0.5 * float(system.radii.min()))
        first = begun.x + (first - begun.x) / max(far, 1.0)
    if turns_freely(system):  # nothing says how fast all of them turn together: not at all
        first = begun.x + unturned(begun.x[:, : system.dimension], system.radii, first - begun.x)
    if system.fixed.any():
        place, velocity = system.place(when), system.velocity(when)
        place[:, system.dimension :] -= begun.turned  # rotations count from the start of the step
        x_star = np.where(system.fixed, place - s * velocity, x_star)
        first = np.where(system.fixed, place, first)
    own = {name: values + dt * _combined(rates, row, name) for name, values in begun.own.items()}
    given = StageInput(when, s, x_star, y_star, own, begun.notes)
    here, at_z, guess = system, np.empty(0), y_star + s * guess_y

    def solve(here: System, x: Array) -> Balance:
        return balance(here, contacts, newton, given, x, guess)

    z_star = begun.z + dt * _combined(rates, row, "z")
    for _ in range(MOST_TWISTS):
        if system.leader is not None:
            found, here, at_z, box_rates = system.leader.lead(
                system, contacts, newton, when, s, z_star, box_rates, solve, first
            )
        else:
            if begun.z.size:
                here, at_z = placed(system, when, s, z_star, box_rates)
            found = solve(here, first)
        if system.dragged:
            break
        # what no film resists keeps the guess that it had, and has none
        near = np.flatnonzero(found.h < system.reach)
        twist = unresisted(system, contacts, near, found.n[near], found.x - x_star)
        if twist is None or largest(twist) <= system.force_tolerance * float(system.radii.min()):
            break
        first, guess = found.x - twist, found.y
    at_end = {"x": (found.x - x_star) / s, "y": (found.y - y_star) / s, "z": at_z}
    for mechanism in system.having["rates_of"]:
        at_end |= mechanism.rates_of(here, given, found)
    return _Stage(given, found, here, at_end, box_rates)


def error_of(system: System, end: Balance, errors: Mapping[str, Array]) -> float:
    """Error of a step relative to what is allowed, from those that the method estimates, by names of the rates.

    The root of the mean square over contacts within their range, each as much as there is of it, and a tenth of the
    largest. Likewise over particles, where their positions are integrated; and what mechanisms say of what they
    integrate.

    Parameters
    ----------
    system : System
    end : Balance
        At the end of the step.
    errors : mapping from str to array
        Of positions ``x``, shape (N, w), of films ``y``, shape (contacts,), and of what mechanisms integrate.
    """
    active = end.h < system.reach
    found = [0.0]
    if active.any():
        relative = (errors["y"] / np.sqrt(1 + end.y**2))[active] * weight(end.h[active], system.reach) / system.rtol
        found += [float(np.sqrt(np.mean(relative**2))), float(np.abs(relative).max()) / 10]
    moving = system.integrated
    if moving.any():
        relative = (errors["x"][moving, : system.dimension] / system.radii[moving, None]).reshape(-1) / system.rtol
        found += [float(np.sqrt(np.mean(relative**2))), float(np.abs(relative).max()) / 10]
    for mechanism in system.having["errors"]:
        found += mechanism.errors(system, end, errors)
    return max(found) if all(map(math.isfinite, found)) else math.inf


def weight(h: Array, reach: float) -> Array:
    """What there is of a contact: 1 up to half of its range, 0 at its range, as in the kernel."""
    if reach == 0:  # no contacts
        return np.zeros_like(h)
    ahead = np.clip(2 * (1 - h / reach), 0.0, 1.0)
    return np.asarray(ahead**2 * (3 - 2 * ahead))
