"""Power of each kind at a stage."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softdyn.particles import sliding
from softdyn.particles.balance import Balance
from softdyn.particles.geometry import Contacts
from softdyn.particles.kernel import energies
from softdyn.particles.portions import in_portions, portion
from softdyn.particles.system import System, background, contact_state, image_velocities, moving_images

Array = NDArray[np.float64]


def powers(system: System, contacts: Contacts, at: Balance, t: float, v: Array, y_rate: Array) -> dict[str, float]:
    """Power of each kind of :func:`softdyn.particles.system.works`, at one stage."""
    # y = sinh(ln(h/g)): dy = cosh(ln(h/g)) dh/h
    h_rate = at.h * y_rate / np.sqrt(1 + at.y**2)
    more = {}
    if at.slid is not None:
        images = image_velocities(system, contacts, t)
        values = contact_state(system, contacts, contacts.S - at.r, at.h)
        more = tangential_powers(system, contacts, at, values, v, images, h_rate)
        del images, values
    moved, velocities = moving_images(system, contacts, t)
    pushed = at.F[moved, None] * at.n[moved]
    if at.slid is not None:
        pushed = pushed + at.slid.force[moved]
    carried = -np.sum(pushed * velocities, axis=1)
    box = contacts.j[moved] < len(v)
    u = background(system, at.x)
    resisting = system.resistance * (v - u)
    held = np.where(system.fixed, at.reaction, 0.0)
    gaps, remote, U_h = _gap_powers(system, contacts, at, h_rate)
    return {
        "external": float(np.sum((system.force(t) + held) * v)) + float(carried[~box].sum()),
        "flow": -float(np.sum(resisting * u)),
        "box": float(carried[box].sum()),
        "gaps": gaps,
        "drag": float(np.sum(resisting * (v - u))),
        "remote": remote,
        "U_h": U_h,
        **more,
    }


def _gap_powers(system: System, contacts: Contacts, at: Balance, h_rate: Array) -> tuple[float, float, float]:
    """Power lost in the gaps, and taken by remote forces and the U_h term."""

    def of(part: slice) -> tuple[float, float, float]:
        some = portion(contacts, part)
        overlap, h, rate = some.S - at.r[part], at.h[part], h_rate[part]
        values = contact_state(system, some, overlap, h)
        _, U_h = energies(system.kernel, system.reach, overlap, h, system.p, some.q.reshape(-1))
        lost, remote = np.sum(values["friction"] * rate**2), -np.sum(values["remote"] * rate)
        return float(lost), float(remote), -float(np.sum(U_h * rate))

    gaps, remote, taken = zip(*in_portions(of, len(h_rate)), strict=True)
    return sum(gaps), sum(remote), sum(taken)


def tangential_powers(
    system: System, contacts: Contacts, at: Balance, values: dict[str, Array], v: Array, images: Array, h_rate: Array
) -> dict[str, float]:
    """Power lost in sliding and in rolling, and taken by a change of the tangential stiffness, at one stage."""
    assert at.slid is not None
    d = system.dimension
    walls = np.zeros((len(system.walls), v.shape[1]))
    one, other = (np.concatenate([v, walls])[ends] for ends in (contacts.i, contacts.j))
    square = sliding.dot(at.slid.force, at.slid.force)
    slides = values["friction_t"] > 0
    radii = np.append(system.radii, np.ones(len(walls)))
    turn = one[:, d:] / radii[contacts.i, None] - other[:, d:] / radii[contacts.j, None]
    if d == 3:
        turn = turn - sliding.dot(turn, at.n)[:, None] * at.n
    r_rate = sliding.dot(other[:, :d] + images - one[:, :d], at.n)
    k_rate = values["k_t_h"] * h_rate + values["k_t_delta"] * (h_rate - r_rate) / 2
    return {
        "sliding": float(np.sum(square[slides] / values["friction_t"][slides])),
        "rolling": float(np.sum(values["roll"] * sliding.dot(turn, turn))),
        "k_t": float(np.sum(square * k_rate / (2 * values["k_t"] ** 2))),
    }
