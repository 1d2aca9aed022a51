"""What changes during a run of many particles."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.geometry import Box, Contacts, Wall
from softdyn.particles.neighbours import Listed
from softdyn.particles.results import Frame

Array = NDArray[np.float64]


@dataclass
class State:
    """Everything that changes during a run; it is all that a checkpoint holds.

    Attributes
    ----------
    t, dt : float
        Time, and the step to try next.
    x : array, shape (N, d)
    v : array, shape (N, d + rotations)
        Velocities, and with tangential motion radius times angular velocity.
    y_rate : array, shape (contacts,)
        Guess of dy/dt for the next step.
    contacts : Contacts
    listed : Listed
    box : Box
    walls : tuple of Wall
    work : dict
        Energies exchanged since the start.
    power : dict or None
        Their rates, if v and y_rate are the rates at t, and not only guesses of them.
    stored0 : float
        Elastic energy at the start.
    counts : dict
    history : list of tuple
        For each step: time, length, residual, error, contacts within their range.
    frames : list of Frame
    """

    t: float
    dt: float
    x: Array
    v: Array
    y_rate: Array
    contacts: Contacts
    listed: Listed
    box: Box
    walls: tuple[Wall, ...]
    work: dict[str, float]
    power: dict[str, float] | None = None
    stored0: float = 0.0
    counts: dict[str, int] = field(default_factory=dict)
    history: list[tuple[float, float, float, float, int]] = field(default_factory=list)
    frames: list[Frame] = field(default_factory=list)
