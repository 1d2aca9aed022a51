"""What surrounds the particles and moves: walls with a given velocity, and a box under an imposed stress.

The edges of a periodic box move with the velocity gradient G of the background flow u = G x. Of G, the shear rate G_xy
may be unknown, or the rate G_aa at which the box stretches along an axis, or along all axes at one rate: each for a
component of the stress that is imposed, shear stress, axial stress, or minus the pressure. At each stage of a step, one
equation for each unknown rate g_k says that the stress is as imposed::

    sigma_k + 2 eta D_k = imposed_k(t) ,    sigma_k = -(1/V) sum over contacts of (F/r) rho . E_k rho ,    rho = r n ,

with the symmetric part D of G; E_xy = e_x e_y^T, E_aa = e_a e_a^T, for the pressure E = 1/d. The second term is what
the fluid resists: a box needs a resistance of its own, lest it jump where the imposed stress does. The power of the
imposed stress, V (imposed_k - 2 eta D_k) g_k, is that of the box and the flow in the balance of energy.

The extra rows and columns of Newton's matrix, with the particles' block K, follow by differentiation. In a stage of
length s the cell A changes by dA/dg_k = s G_k A with the velocity gradient G_k of a unit rate, so that rho changes by
p_k = s G_k A shift for contacts through the faces of the box. At fixed positions, with n from i to j::

    C_ik = sum over contacts of i of [F_r n n^T + (F/r) (1 - n n^T)] p_k - Z_i G_k x_i ,    C_jk the opposite sum

and, along the balance of forces, K dx/dg_k = -C_k. With ::

    w_j = d sigma_j/d rho = -(1/V) [ (F/r)_r (rho . E_j rho) n + (F/r) (E_j + E_j^T) rho ]

the particles are eliminated, and one row and one column are left for each imposed component::

    S_jk = sum over contacts of w_j . (p_k + dx_j/dg_k - dx_i/dg_k) - s sigma_j tr G_k + eta (E_j + E_j^T) : G_k

The particles' balance is solved at each trial of g, which S leads; Broyden's corrections mend what S leaves out: that
K is kept over several iterations, terms of order s^2 where the box shears and stretches at once, and what tangential
forces have in it.

Walls, and a box whose shear rate is given, are where the integral of what is given says, to rounding; so are held
particles. What the stress makes unknown moves by the same Runge-Kutta stages as the particles.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from softdyn.particles import linear
from softdyn.particles.balance import Balance, Newton, StepFailed
from softdyn.particles.geometry import Box, Contacts, lattice
from softdyn.particles.system import System

Array = NDArray[np.float64]

MOST_TRIALS = 20
#: The lengths of a box change by less than this, as a logarithm, in one trial.
LONGEST_TRIAL = 0.1


def moves(system: System) -> bool:
    """Whether box or walls move otherwise than by a constant shear rate."""
    return system.imposed is not None or system.wall_velocity is not None or system.shear is not None


def coordinates(system: System, t: float) -> Array:
    """Coordinates z of all that moves: logarithms of lengths, tilt over the first length, points of walls."""
    cell = lattice(system.box, t)
    edges = np.log(np.where(system.box.periodic, np.diag(cell), 1.0))
    lean = [cell[0, 1] / cell[0, 0] if len(cell) > 1 and cell[0, 0] else 0.0]
    return np.concatenate([edges, lean, *(wall.point for wall in system.walls)])


def placed(system: System, t: float, s: float, z_star: Array, rates: Array) -> tuple[System, Array]:
    """Box and walls at the end of a stage, and dz/dt there.

    Parameters
    ----------
    t, s : float
        End of the stage, and gamma dt.
    z_star : array
        Known part of the coordinates.
    rates : array, shape (len(imposed.names),)
        The unknown rates of the box.
    """
    box, d = system.box, len(system.box.lengths)
    z_rate = np.zeros_like(z_star)
    shear, stretch = box.shear_rate if system.shear is None else system.shear(t), np.zeros(d)
    if system.imposed is not None:
        G = np.tensordot(rates, system.imposed.gradients(d), 1)
        stretch = np.diag(G).copy()
        shear = float(G[0, 1]) if "xy" in system.imposed.names else shear
    z_rate[:d] = stretch
    edges = np.exp(z_star[:d] + s * stretch)
    if d > 1 and box.periodic[:2].all():
        z_rate[d] = shear * edges[1] / edges[0]
    walls = system.walls
    z = z_star + s * z_rate
    if system.lean0 is not None:
        z[d] = system.lean(t)
    if system.wall_velocity is not None:
        z_rate[d + 1 :] = system.wall_velocity(t).reshape(-1)
        z[d + 1 :] = system.wall_place(t).reshape(-1)
    if system.wall_velocity is not None:
        walls = tuple(replace(wall, point=point) for wall, point in zip(walls, z[d + 1 :].reshape(-1, d), strict=True))
    if system.imposed is not None or system.shear is not None:
        tilt = float(z[d] * edges[0]) if d > 1 else 0.0
        lengths = np.where(box.periodic, edges, math.inf)
        stretching = stretch if stretch.any() else None
        box = replace(box, lengths=lengths, shear_rate=shear, tilt=tilt, since=t, stretch=stretching)
    return replace(system, box=box, walls=walls), z_rate


def stress_of(system: System, contacts: Contacts, at: Balance) -> Array:
    """Stress of the contacts of a box, shape (d, d), > 0 in tension; the fluid's is not in it.

    The symmetric part, which does the work: where drag resists rotations, there is another.
    """
    stress = np.einsum("c,ca,cb->ab", at.F * at.r, at.n, at.n)
    if at.slid is not None:
        sheared = np.einsum("c,ca,cb->ab", at.r, at.slid.force, at.n)
        stress += (sheared + sheared.T) / 2
    return -stress / system.box.volume


def fluid_stress(box: Box, viscosity: float) -> Array:
    """Stress 2 eta D of the fluid, shape (d, d)."""
    return viscosity * (box.gradient + box.gradient.T)


def excess(system: System, contacts: Contacts, at: Balance, t: float) -> Array:
    """By how much the imposed components exceed what is imposed."""
    imposed = system.imposed
    assert imposed is not None
    total = stress_of(system, contacts, at) + fluid_stress(system.box, imposed.viscosity)
    return np.einsum("kab,ab->k", imposed.weights(len(total)), total) - imposed.values(t)


def _relative(system: System, at: Balance, wrong: Array, t: float) -> float:
    """Size of an excess, relative to all that makes a stress."""
    imposed = system.imposed
    assert imposed is not None
    scale = float(np.abs(at.F * at.r).sum()) / system.box.volume
    scale += float(np.abs(imposed.values(t)).max()) + float(np.abs(fluid_stress(system.box, imposed.viscosity)).max())
    return float(np.abs(wrong).max()) / scale if scale > 0 else 0.0


def condensed(system: System, contacts: Contacts, newton: Newton, at: Balance, s: float) -> tuple[Array, Array]:
    """Derivatives of the stress by the unknown rates, forces in balance: S and dx/dg, shape (names, N, d)."""
    imposed, d = system.imposed, len(system.box.lengths)
    assert imposed is not None
    G, E = imposed.gradients(d), imposed.weights(d)
    volume = system.box.volume
    rho, slope = at.n * at.r[:, None], at.F / at.r
    images = contacts.shift @ lattice(system.box, system.box.since).T
    pushed = s * np.einsum("kab,cb->kca", G, images)
    along = np.einsum("kca,ca->kc", pushed, at.n)
    # change of F n, with the force that a pair exerts on i
    changed = at.F_r * along
    force = changed[:, :, None] * at.n + slope[:, None] * (pushed - along[:, :, None] * at.n)
    moved = np.zeros((len(G), *at.x.shape))
    for k in range(len(G)):
        column = np.zeros_like(at.x)
        np.add.at(column[:, :d], contacts.i, force[k])
        np.add.at(column[:, :d], contacts.j, -force[k])
        if system.dragged:
            column[:, :d] -= system.drag[:, None] * (at.x[:, :d] @ G[k].T)
            if at.x.shape[1] > d:  # rotations follow the flow's, -g/2
                column[:, -1] += system.resistance[:, -1] * G[k, 0, 1] / 2 * system.radii
        column[system.fixed] = 0.0
        if newton.solver is not None and newton.solver.matrix is not None:
            moved[k] = -linear.solve(newton.solver, column)
    curved = (at.F_r - slope) / at.r
    square = np.einsum("ca,jab,cb->jc", rho, E, rho)
    both = E + E.transpose(0, 2, 1)
    w = -(curved * square)[:, :, None] * at.n - slope[:, None] * np.einsum("jab,cb->jca", both, rho)
    w /= volume
    drho = pushed + moved[:, contacts.j, :d] - moved[:, contacts.i, :d]
    sigma = np.einsum("jab,ab->j", E, stress_of(system, contacts, at))
    S = np.einsum("jca,kca->jk", w, drho) - np.outer(sigma, s * np.trace(G, axis1=1, axis2=2))
    S += imposed.viscosity * np.einsum("jab,kab->jk", both, G)
    return S, moved


def balance_under_stress(
    system: System,
    contacts: Contacts,
    newton: Newton,
    t: float,
    s: float,
    z_star: Array,
    rates: Array,
    solve: Callable[[System, Array], Balance],
    x: Array,
) -> tuple[Balance, System, Array, Array]:
    """Balance of all forces at the rates of the box for which the stress is as imposed.

    Parameters
    ----------
    system, contacts, newton, t, s, z_star
        See :func:`placed`.
    rates : array
        A guess.
    solve : function of a System and positions
        Balances the particles' forces in a given box, from a guess of the positions.
    x : array, shape (N, d)
        A guess.

    Returns
    -------
    Balance, System, array, array
        Found there; with box and walls; dz/dt; the rates.

    Raises
    ------
    StepFailed
        If no rates are found.
    """
    imposed = system.imposed
    assert imposed is not None
    here, z_rate = placed(system, t, s, z_star, rates)
    found = solve(here, x)
    wrong = excess(here, contacts, found, t)
    S, moved = condensed(here, contacts, newton, found, s)
    for _ in range(MOST_TRIALS):
        off = _relative(here, found, wrong, t)
        if off <= 10 * system.force_tolerance:
            return replace(found, residual=max(found.residual, off)), here, z_rate, rates
        try:
            change = -np.linalg.solve(S, wrong)
        except np.linalg.LinAlgError:
            break
        size = float(np.abs(change).max()) * s
        if not math.isfinite(size):
            break
        change *= min(1.0, LONGEST_TRIAL / size) if size > 0 else 1.0
        rates = rates + change
        here, z_rate = placed(system, t, s, z_star, rates)
        found = solve(here, found.x + np.tensordot(change, moved, 1))
        before, wrong = wrong, excess(here, contacts, found, t)
        largest = float(np.abs(change).max())
        if largest > 0:
            along = change / largest  # whose square is no underflow
            S = S + np.outer((wrong - before - S @ change) / largest, along) / float(along @ along)
    raise StepFailed(
        f"no rate of the box keeps the imposed stress at t={t:.6g}: it is off by {float(np.abs(wrong).max()):.3g}; is "
        "it a shear stress beyond what the packing bears, or a pressure below 0?"
    )
