"""What cannot be integrated, in words: what nothing resists, what does not balance, films that are drained."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from softdyn.errors import IntegrationError, pressed_only_words
from softdyn.particles import linear
from softdyn.particles.force_balance import pair_named, unresisted
from softdyn.particles.geometry import directions, lattice, torque
from softdyn.particles.names import AXES, particles_named
from softdyn.particles.state import State, free_positions, overlaps
from softdyn.particles.system import System, contact_state, gauge_axes, turns_freely

Array = NDArray[np.float64]

#: External forces on what may move freely must balance to this fraction.
UNBALANCED = 1e-9
#: So must their torque; it depends on the positions, and is known to their accuracy.
UNTURNED = 1e-4
#: Part of it that may be taken away where particles have moved from the positions at which it balances.
TURNED = 0.1
#: Deflection over the smallest radius below which surfaces that a law knows pressed alone are about to part.
PARTED = 1e-3


def require_held(system: System, state: State) -> None:
    """Without drag: every particle that may move needs a contact, and all of them are one cluster, or held."""
    contacts, count = state.contacts, len(state.x)
    active = contacts.h < system.reach
    touched = np.zeros(count, bool)
    pair = active & (contacts.j < count)
    touched[contacts.i[active]] = True
    touched[contacts.j[pair]] = True
    free = free_positions(system)
    alone = np.flatnonzero(free.any(axis=1) & ~touched)
    remedy = "give the particles a drag ([flow] drag = 1), or hold them"
    if len(alone):
        raise IntegrationError(
            f"without drag nothing resists the motion of {particles_named(alone)}, without any contact within range, "
            f"at t={state.t:.6g}: {remedy}"
        )
    links = coo_array((np.ones(int(pair.sum())), (contacts.i[pair], contacts.j[pair])), shape=(count, count))
    clusters, label = connected_components(links, directed=False)
    anchored = set(label[~free.all(axis=1)]) | set(label[contacts.i[active & (contacts.j >= count)]])
    loose = [k for k in range(clusters) if k not in anchored]
    if len(loose) > 1 or (loose and anchored):
        sizes = [np.flatnonzero(label == k) for k in loose]
        smallest = min(sizes, key=len)
        raise IntegrationError(
            f"without drag the cluster of {particles_named(smallest)} is connected to no other, at t={state.t:.6g}, "
            f"and nothing resists its motion: {remedy}"
        )


def require_balanced(system: System, state: State) -> None:
    """External forces along axes on which everything moves freely sum to zero; so do torques, with those of forces.

    Torques balance at the given positions. Where the particles are now, elastic relaxation and the motion since the
    start leave some: this rotates all particles together, which nothing resists and nothing feels, and is taken away
    (:func:`softdyn.particles.force_balance.held_torque`), as long as it is small. The state keeps the largest part.
    """
    t, x = state.t, state.x
    external, d = system.force(t), system.dimension
    force = external[:, :d]
    for axis in gauge_axes(system):
        total, size = float(force[:, axis].sum()), float(np.abs(force[:, axis]).sum())
        if abs(total) > UNBALANCED * size:
            raise IntegrationError(
                f"the external forces along {AXES[axis]} sum to {total:.6g} at t={t:.6g}, and without drag nothing "
                "balances them: give the particles a drag ([flow] drag = 1), hold one of them, or balance the forces"
            )
    if not turns_freely(system) or not external.any():
        return
    remedy = "give the particles a drag ([flow] drag = 1), hold two of them, or balance the forces"
    turning, levers, rounding = _torque(system, external, system.x)
    settled = min(TURNED * levers, state.settled * float(np.linalg.norm(force, axis=1).sum()))
    if turning > UNTURNED * levers + settled + rounding:
        raise IntegrationError(
            f"the external forces have the torque {turning:.6g} at t={t:.6g} about the given positions, and without "
            f"drag nothing resists it: {remedy}"
        )
    turning, levers, rounding = _torque(system, external, x)
    if turning > TURNED * levers + rounding:
        raise IntegrationError(
            f"the particles have moved until the external forces have the torque {turning:.6g} at t={t:.6g}, "
            f"{turning / levers:.2g} of what they could have, and without drag nothing resists it: {remedy}"
        )
    state.turned = max(state.turned, turning / levers if levers else 0.0)


def _torque(system: System, external: Array, x: Array) -> tuple[float, float, float]:
    """Torque of external forces, that of as large ones across their levers, and what of it may be rounding."""
    d = x.shape[1]
    away, force, torques = x - x.mean(axis=0), external[:, :d], external[:, d:] * system.radii[:, None]
    total = torque(away, force).sum(axis=0)
    if torques.size:
        total = total + torques.sum(axis=0)
    levers = float(np.linalg.norm(away, axis=1) @ np.linalg.norm(force, axis=1))
    return float(np.abs(total).max()), levers, UNBALANCED * float(np.abs(torques).sum())


def _twisted(system: System, state: State) -> NDArray[np.int64]:
    """Particles with an external torque that neither drag nor any contact resists."""
    if system.dragged:
        return np.empty(0, dtype=np.int64)
    near = np.flatnonzero(state.contacts.h < system.reach)
    n, _ = directions(state.contacts, state.x, lattice(system.box, state.t), system.walls)
    force = system.force(state.t)
    left = unresisted(system, state.contacts, near, n[near], force)
    if left is None:
        return np.empty(0, dtype=np.int64)
    torques = np.where(system.fixed, 0.0, force)[:, system.dimension :]
    return np.flatnonzero(np.abs(left[:, system.dimension :]).max(axis=1) > UNBALANCED * np.abs(torques).max())


def fastest(system: System, state: State) -> str:
    """Words for where a state changes fastest: a gap, by how much of itself, or a particle, over its radius."""
    within = state.contacts.h < system.reach
    closing = np.where(within, np.abs(state.y_rate), 0.0)
    speed = np.linalg.norm(state.v[:, : system.dimension], axis=1) / system.radii
    if closing.max(initial=0.0) > speed.max(initial=0.0):
        return f"{pair_named(state.contacts, int(np.argmax(closing)), len(state.x))} changes fastest"
    return f"particle {int(np.argmax(speed))} moves fastest"


def why(system: System, state: State, error: Exception) -> str:
    """Words for what a step failed of.

    Parameters
    ----------
    system : System
    state : State
        From which the step was to go on.
    error : Exception
        With which it failed.
    """
    if system.kernel.pressed_only:
        contacts = state.contacts
        delta = contact_state(system, contacts, overlaps(system, state), contacts.h)["delta"]
        parting = np.flatnonzero(~(delta > PARTED * system.radii.min()) & (contacts.h < system.reach))
        if len(parting):
            named = pair_named(contacts, int(parting[0]), len(state.x))
            return f"{pressed_only_words(system.kernel.law)} ({named})"
    twisted = _twisted(system, state)
    if len(twisted):
        return (
            f"nothing resists the external torque on {particles_named(twisted)}: without drag films do, but for a "
            "twist about their normal; give the particles a drag ([flow] drag = 1), or contacts along another line"
        )
    if not isinstance(error, linear.Indefinite):
        return str(error)
    if not system.dragged:
        require_held(system, state)
    size = np.linalg.norm(error.direction(), axis=1)
    worst = np.flatnonzero(size > 0.3 * size.max())
    worst = worst[np.argsort(-size[worst], kind="stable")]
    remedy = (
        "a shorter step does not help; the forces pull or press it over"
        if system.dragged
        else "without drag such a motion has no resistance: give the particles a drag ([flow] drag = 1), hold them, or "
        "add contacts"
    )
    kind = "turn as a whole" if turns_freely(system) and len(worst) > 0.9 * len(size) else "give way"
    who = f"{particles_named(worst)} can {kind} without any force to resist"
    return f"{who} (floppy, or unstable under pressure); {remedy}"
