"""The plain route, for small systems and for checks: solve for velocities, and integrate them explicitly.

Without drag, differentiating the force balance gives, with n from i to j and P = 1 - n n^T (reference 20 of Rognon &
Gay with the right sign and its tensors)::

    sum_j [C n n^T - (F/r) P] (v_j - v_i) = - dF_i^ext/dt - sum_j (C/D) (F - F_adh) n_ij

and dh/dt is eq. 7. With drag, velocities follow from the forces at once. It shares with :mod:`softdyn.particles.step`
the law and the geometry, but neither the kernel, nor the state, nor the method: the kernel is that of a pair, the state
(x, h), the integrator scipy's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from softdyn.errors import IntegrationError, SceneError
from softdyn.kernels import get_kernel
from softdyn.particles.force_balance import Newton, contact_forces
from softdyn.particles.geometry import directions, flow, lattice
from softdyn.particles.particle_keys import ParticleScene
from softdyn.particles.particle_run import prepare
from softdyn.particles.start import start

Array = NDArray[np.float64]


def simulate_by_velocities(
    scene: ParticleScene, times: Sequence[float], rtol: float = 1e-9, method: str = "DOP853"
) -> tuple[Array, Array]:
    """Integrate a free cluster by its velocities.

    Parameters
    ----------
    scene : ParticleScene
        Without walls, held particles, species and range.
    times : sequence of float
        Output times, from 0 on.
    rtol : float
        Relative tolerance; it is also the absolute one of positions in units of the smallest radius.
    method : str
        One of scipy's.

    Returns
    -------
    x : array, shape (times, N, d)
    h : array, shape (times, contacts)
        In the order of the pairs (0, 1), (0, 2), ...

    Raises
    ------
    SceneError
        If the scene is another.
    IntegrationError
        If the integration does not reach its end.
    """
    system = prepare(scene)
    if scene.tangential:
        raise SceneError("the route by velocities knows normal contacts only: leave [contacts] tangential out")
    if system.walls or system.fixed.any() or scene.range is not None or system.kernel.varying:
        raise SceneError("the route by velocities is for free clusters of equal spheres without a range of contacts")
    state = start(system, Newton())
    contacts = state.contacts
    outputs = ("F_ela", "F_adh", "zeta", "C", "D")
    kernel = get_kernel(scene.law, scene.target, drive="constant", outputs=outputs)
    values_of = dict(zip(system.kernel.uniform, system.p, strict=True))
    p = np.array([values_of[name] for name in kernel.parameters])
    count, d = state.x.shape

    carried = _carried(scene) if system.dragged else np.ones_like

    def rates(t: float, packed: Array) -> Array:
        x, h = packed[: count * d].reshape(count, d), packed[count * d :]
        n, r = directions(contacts, x, lattice(system.box, t), ())
        delta = (contacts.S - r + h) / 2
        out = np.empty((len(outputs), len(h)))
        inputs = {"F": np.zeros(len(h)), "dF_dt": np.zeros(len(h))}
        kernel.functions.evaluate(len(h), h, delta, *(inputs[name] for name in kernel.inputs), p, out.reshape(-1))
        value = dict(zip(outputs, out, strict=True))
        F = value["F_ela"]
        gap_rate = -(F - value["F_adh"]) / (value["zeta"] * carried(h))
        if system.dragged:
            v = flow(system.box, x) + (system.force(t) - contact_forces(contacts, F, n, count)) / system.resistance
        else:
            pull = value["C"] / value["D"] * (F - value["F_adh"])
            force_rate = _rate_of(system.force, t, 1e-3 * float(times[-1]))
            v = _velocities(contacts.i, contacts.j, n, value["C"], F / r, pull, force_rate)
        return np.concatenate([v.reshape(-1), gap_rate])

    first = np.concatenate([state.x.reshape(-1), contacts.h])
    done = solve_ivp(
        rates,
        (0.0, float(times[-1])),
        first,
        method=method,
        t_eval=np.asarray(times, dtype=float),
        rtol=rtol,
        atol=rtol * np.concatenate([np.full(count * d, float(system.radii.min())), contacts.h]) * 1e-2,
    )
    if not done.success or not np.isfinite(done.y).all():
        raise IntegrationError(f"the explicit integration ends at t={done.t[-1]:.6g}: {done.message}")
    return done.y[: count * d].T.reshape(-1, count, d), done.y[count * d :].T


def _carried(scene: ParticleScene) -> Callable[[Array], Array]:
    """Fraction of its friction that a contact has where particles have drags of their own, as a function of h."""
    from sympy import S, lambdify

    from softdyn.derive import far_field, h
    from softdyn.derive.symbols import R
    from softdyn.laws import find, load

    law, _ = load(find(scene.law))
    x = far_field.excess(law) or S.Infinity
    values = {symbol: scene.parameters.get(symbol.name) for symbol in x.free_symbols - {h, R}}
    by_gap = lambdify(h, x.subs(values).subs(R, float(np.ravel(scene.radii)[0])), "numpy")
    left = max(0.0, 1 - float(scene.drag))
    return lambda gaps: left + (1 - left) / (1 + 1 / by_gap(gaps))


def _rate_of(force: Callable[[float], Array], t: float, step: float) -> Array:
    """Rate of change of the external forces, by a central difference of fourth order."""
    return (8 * (force(t + step) - force(t - step)) - force(t + 2 * step) + force(t - 2 * step)) / (12 * step)


def _velocities(
    i: NDArray[np.int64], j: NDArray[np.int64], n: Array, C: Array, across: Array, pull: Array, force_rate: Array
) -> Array:
    """Solve for the velocities that keep the forces balanced, with no mean velocity and no mean rotation."""
    count, d = force_rate.shape
    matrix = np.zeros((count, d, count, d))
    right = -force_rate.copy()
    for a, b, normal, stiffness, sideways, strength in zip(i, j, n, C, across, pull, strict=True):
        dyad = np.outer(normal, normal)
        block = stiffness * dyad - sideways * (np.eye(d) - dyad)
        # row a: block (v_b - v_a); row b has n reversed, and the same block
        matrix[a, :, b, :] += block
        matrix[a, :, a, :] -= block
        matrix[b, :, a, :] += block
        matrix[b, :, b, :] -= block
        right[a] -= strength * normal
        right[b] += strength * normal
    # the least-squares solution of smallest norm has no part along motions that cost nothing
    found = np.linalg.lstsq(matrix.reshape(count * d, -1), right.reshape(-1), rcond=1e-12)[0]
    return np.asarray(found, dtype=float).reshape(count, d)
