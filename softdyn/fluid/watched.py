"""What is given as a function of time, and how long a step of a flow may be to see all of it.

A step knows an expression by its values at the end of it and of the steps before: a pulse in between, or a fast
oscillation, it misses. What it misses of an expression f is at most the mean of |f - p| over the step, with the
parabola p through these values; it is bounded before the step is tried, see
:meth:`softdyn.particles.time_functions.TimeFunction.missed`. Of a velocity it is an error of the velocity; of a force
per volume, or of a pressure over the size of the flow, what it accelerates the fluid to within the step; of all else,
relative to its largest value, an error of the flow by as much. A step is shortened until none of it exceeds the error
that is allowed, and ends at each kink and jump.

An expression that depends on the place, too, is one at each point: it is watched at some of them, and in each part of
the run at that point at which the bounds of it are farthest apart. So a pulse at one place is not missed.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softdyn.enclosure import models
from softdyn.errors import SceneError
from softdyn.expression import parse, places_of
from softdyn.fluid.fields import AXES, FieldFunction
from softdyn.fluid.flow_system import FluidSystem
from softdyn.fluid.march import SHORTEST, FlowState
from softdyn.particles.time_functions import TimeFunction, time_function

Array = NDArray[np.float64]

#: Points at most at which an expression of the place is watched.
POINTS = 32
#: Parts of the run, in each of which the point is watched at which an expression may change most.
PARTS = 16
#: Radius of the disc in which the bounds are found, over half of a part.
DISC = 2.0
#: Of a bound of the velocities that there may be, by what is given: those below do not matter.
NEGLIGIBLE = 1e-10
#: Of what is allowed; the shortest that a trial makes of a step; the power of the length that the bound goes with.
AIM, LEAST, POWER = 0.8, 0.2, 3

VELOCITY, FORCE, PRESSURE, OTHER = "velocity", "force", "pressure", "other"


@dataclass(frozen=True)
class Watched:
    """A quantity that is given as an expression of t.

    Attributes
    ----------
    kind : str
        VELOCITY, FORCE (per volume), PRESSURE or OTHER.
    functions : tuple of TimeFunction
        At some points.
    """

    kind: str
    functions: tuple[TimeFunction, ...]


@dataclass(frozen=True)
class Watch:
    """All of it, and what its errors are told in.

    Attributes
    ----------
    watched : tuple of Watched
    breaks : array
        Times at which any of it has a kink or a jump, in order.
    until, rtol : float
        End of the run, and error that is allowed.
    density, size : float
        Of the fluid; the longest extent of the flow.
    least : float
        Size of velocities that do not matter.
    """

    watched: tuple[Watched, ...]
    breaks: Array
    until: float
    rtol: float
    density: float
    size: float
    least: float

    @property
    def ends(self) -> list[float]:
        """Times at which steps end, each the last one before a kink or a jump."""
        return [math.nextafter(t, -math.inf) for t in self.breaks.tolist() if t < self.until]

    @property
    def doubtful(self) -> list[str]:
        """Names of those that may have more kinks and jumps."""
        return sorted({one.name for watched in self.watched for one in watched.functions if one.doubtful})

    def length(self, state: FlowState, dt: float) -> tuple[float, str]:
        """Length of a step, at most dt, which sees all; and what the shortest may miss.

        Parameters
        ----------
        state : FlowState
        dt : float
        """
        while True:
            error, name = self.missed(state, dt)
            if error <= 1:
                return dt, ""
            if dt <= SHORTEST * self.until:
                return dt, name
            shorter = AIM * error ** (-1 / POWER) if math.isfinite(error) else LEAST
            dt = max(dt * max(LEAST, shorter), SHORTEST * self.until)

    def missed(self, state: FlowState, dt: float) -> tuple[float, str]:
        """Largest error, over what is allowed, that what a step misses may make; and of what.

        Parameters
        ----------
        state : FlowState
        dt : float
        """
        found = [(0.0, "")]
        for one in self.watched:
            for function in one.functions:
                bound = function.missed(state.t, dt, self._seen(state, dt)) / dt
                if bound:
                    found.append((bound / (self.rtol * self._scale(one.kind, function, state, dt)), function.name))
        return max(found)

    def _seen(self, state: FlowState, dt: float) -> list[float]:
        """Times of the values that a step knows."""
        # behind a start, or a break, a step is done in halves
        middle = state.t + dt / 2 if len(state.times) == 1 else state.times[1]
        return sorted([middle, state.t, state.t + dt])

    def _scale(self, kind: str, function: TimeFunction, state: FlowState, dt: float) -> float:
        """Size of what is given that is an error of all of the velocity."""
        velocity = max(state.largest, self.least)
        if kind == FORCE:
            return self.density * velocity / dt
        if kind == PRESSURE:
            return self.density * velocity * self.size / dt
        largest = function.largest(state.t, state.t + dt)
        return max(velocity, largest) if kind == VELOCITY else largest


def watch(system: FluidSystem, until: float, rtol: float) -> Watch:
    """Watch all that is given as an expression of t.

    Parameters
    ----------
    system : FluidSystem
    until, rtol : float
        End of the run, and error that is allowed.

    Raises
    ------
    SceneError
        If an expression has no finite value at the start, or kinks without number.
    """
    watched = tuple(
        Watched(kind, tuple(_at_points(field, at, system.scene.constants, until)))
        for kind, field, at in _given(system)
        if field.of_time
    )
    breaks = np.unique(np.concatenate([np.empty(0), *(one.breaks for each in watched for one in each.functions)]))
    at, density = system.mesh.at, float(system.scene.density)
    size = float((at.max(axis=0) - at.min(axis=0)).max())
    reached = [0.0, *(_reached(each, breaks, system, until, size) for each in watched)]
    least = NEGLIGIBLE * max(each for each in reached if math.isfinite(each))
    return Watch(watched, breaks, until, rtol, density, size, least)


def _reached(watched: Watched, breaks: Array, system: FluidSystem, until: float, size: float) -> float:
    """Bound of the velocities that the fluid may have by what is given: of all that acts, or of what viscosity lets."""
    if watched.kind == OTHER:
        return 0.0
    parts = list(itertools.pairwise([0.0, *breaks[breaks < until].tolist(), until]))
    largest = max(function.largest(*part) for function in watched.functions for part in parts)
    if watched.kind == VELOCITY:
        return largest
    try:
        impulse = max(function.size() for function in watched.functions)
    except SceneError:  # no integral is found
        impulse = largest * until
    over = size if watched.kind == PRESSURE else 1.0
    density, viscosity = float(system.scene.density), float(system.scene.viscosity)
    return min(impulse / density, largest * size**2 / viscosity) / over


def _given(system: FluidSystem) -> Iterator[tuple[str, FieldFunction, Array]]:
    """Every field that a scene gives, its kind, and where it is asked for."""
    at = system.velocity.at
    for given in system.conditions.given:
        for field in given.fields:
            yield VELOCITY, field, at[given.nodes]
    for outlet in system.conditions.outlets:
        yield PRESSURE, outlet.pressure, at[np.unique(outlet.nodes)]
    for field in system.force or ():
        yield FORCE, field, at
    for field in system.grains or ():
        yield VELOCITY, field, at
    others = [system.porosity] if system.porosity is not None else []
    for field in [*others, *(field for fields in system.own.values() for field in fields)]:
        yield OTHER, field, at


def _at_points(field: FieldFunction, at: Array, constants: Mapping[str, float], until: float) -> Iterator[TimeFunction]:
    """A field as functions of time, at some points."""
    assert field.expression is not None
    text, given = field.expression.text, dict(constants)
    if not field.expression.of_place:
        yield time_function(text, field.where, given, until)
        return
    some = np.linspace(0, len(at) - 1, POINTS).astype(int)
    watched = some if len(at) <= POINTS else np.concatenate([some, _farthest(text, at, constants, until)])
    for k in np.unique(watched):
        here = dict(zip(AXES, at[k].tolist(), strict=False))
        yield time_function(text, field.where, {**given, **here}, until)


def _farthest(text: str, at: Array, constants: Mapping[str, float], until: float) -> NDArray[np.intp]:
    """Points at which the bounds of an expression in a part of the run are farthest apart, one for each part."""
    axes = AXES[: at.shape[1]]
    expression = parse(text, {**constants, **dict.fromkeys(axes, 0.0)})
    places = [
        (axis, place)
        for axis, name in enumerate(axes)
        for _, place in places_of(name, text, {**constants, **dict.fromkeys(axes, 0.0)})
    ]
    here = np.array(expression.constants)
    ends = np.linspace(0.0, until, PARTS + 1)
    apart = np.empty((len(at), PARTS))
    for k, point in enumerate(at):
        for axis, place in places:
            here[place] = point[axis]
        apart[k] = np.subtract(*models(expression.shape, here, ends[:-1], ends[1:], DISC, DISC**-3.0)[:, :4:-1].T)
    return np.asarray(np.argmax(np.where(np.isnan(apart), math.inf, apart), axis=0))
