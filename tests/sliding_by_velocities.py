"""Dragged particles that slide and roll, integrated another way: velocities from forces, by scipy.

Shares with the runtime neither kernel nor geometry nor method: forces and torques are summed pair by pair, the law is
what sympy makes of its declaration, the tangential force turns by its rate, and rotations follow from the torques.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from sympy import lambdify

from softdyn.derive import E, R, a, delta, eta, h, size_ratio
from softdyn.derive.law import ContactLaw, tangential_expressions

Array = NDArray[np.float64]


def functions_of(law: ContactLaw, parameters: dict[str, float]) -> Any:
    """Return a function of (h, delta, R, size_ratio) that gives F_ela, zeta, F_adh and the tangential coefficients."""
    assert law.tangential is not None
    named = {symbol: parameters[symbol.name] for symbol in (*law.parameters, E, eta) if symbol.name in parameters}
    expressions = [law.F_ela, law.zeta * law.unequal, law.F_adh, *tangential_expressions(law.tangential).values()]
    values = [expr.subs(a, law.a).subs(named) for expr in expressions]
    return lambdify([h, delta, R, size_ratio], values)


def integrate(
    law: ContactLaw,
    parameters: dict[str, float],
    x: Array,
    radii: Array,
    gaps: Array,
    shear_rate: float,
    times: list[float],
    rtol: float = 1e-9,
    torques: Array | None = None,
) -> tuple[Array, Array, Array]:
    """Positions (times, N, 3), gaps (times, pairs) and tangential forces (times, pairs, 3) with Stokes' drag.

    External torques, shape (N, 3), are constant.
    """
    count = len(x)
    pairs = [(i, j) for i in range(count) for j in range(i + 1, count)]
    law_of = functions_of(law, parameters)
    viscosity = parameters["eta"]
    drag, spin_drag = 6 * math.pi * viscosity * radii, 8 * math.pi * viscosity * radii**3
    vorticity = np.array([0.0, 0.0, -shear_rate / 2])

    def rates(_t: float, state: Array) -> Array:
        place = state[: 3 * count].reshape(count, 3)
        gap = state[3 * count : 3 * count + len(pairs)]
        sliding = state[3 * count + len(pairs) :].reshape(-1, 3)
        force, spin_matrix = np.zeros((count, 3)), np.zeros((count, 3, count, 3))
        torque = spin_drag[:, None] * vorticity + (0.0 if torques is None else torques)
        for k in range(count):
            spin_matrix[k, :, k, :] += spin_drag[k] * np.eye(3)
        found = []
        for c, (i, j) in enumerate(pairs):
            along = place[j] - place[i]
            r = float(np.linalg.norm(along))
            n = along / r
            one, other = radii[i], radii[j]
            deflection = (one + other - r + gap[c]) / 2
            pair = 2 * one * other / (one + other), one * other / (one + other) ** 2
            with np.errstate(invalid="ignore"):  # in branches that are not taken
                F, zeta, remote, A, B, G, k_t = law_of(gap[c], deflection, *pair)
                # drag beside it has what the friction of undeflected spheres is far apart
                zeta *= 1 - 3 * math.pi * viscosity * pair[0] / law_of(gap[c], 0.0, *pair)[1]
            D = (one - other) / (one + other)
            excess = (r - one - other) / 2
            lever = one + excess + D * B / A, other + excess - D * B / A
            T = sliding[c] - (sliding[c] @ n) * n
            push = F * n + T
            force[i] -= push
            force[j] += push
            torque[i] -= lever[0] * np.cross(n, T)
            torque[j] -= lever[1] * np.cross(n, T)
            roll = (G - (D * B) ** 2 / A) * (np.eye(3) - np.outer(n, n))
            spin_matrix[i, :, i, :] += roll
            spin_matrix[j, :, j, :] += roll
            spin_matrix[i, :, j, :] -= roll
            spin_matrix[j, :, i, :] -= roll
            found.append((n, r, lever, T, F, zeta, remote, A, k_t))
        flow = np.zeros((count, 3))
        flow[:, 0] = shear_rate * place[:, 1]
        v = flow + force / drag[:, None]
        spin = np.linalg.solve(spin_matrix.reshape(3 * count, -1), torque.reshape(-1)).reshape(count, 3)
        gap_rate, sliding_rate = np.zeros(len(pairs)), np.zeros((len(pairs), 3))
        for c, (i, j) in enumerate(pairs):
            n, r, lever, T, F, zeta, remote, A, k_t = found[c]
            gap_rate[c] = -(F - remote) / zeta
            apart = v[i] - v[j]
            slip = apart - (apart @ n) * n + np.cross(lever[0] * spin[i] + lever[1] * spin[j], n)
            turning = -np.cross(n, apart) / r + ((spin[i] + spin[j]) @ n / 2) * n
            sliding_rate[c] = k_t * (slip - T / A) + np.cross(turning, T)
        return np.concatenate([v.reshape(-1), gap_rate, sliding_rate.reshape(-1)])

    first = np.concatenate([x.reshape(-1), gaps, np.zeros(3 * len(pairs))])
    size = np.concatenate([np.full(3 * count, float(radii.min())), gaps, np.full(3 * len(pairs), 1e-3)])
    done = solve_ivp(rates, (0.0, times[-1]), first, method="DOP853", t_eval=times, rtol=rtol, atol=1e-2 * rtol * size)
    assert done.success, done.message
    end = 3 * count + len(pairs)
    return (
        done.y[: 3 * count].T.reshape(-1, count, 3),
        done.y[3 * count : end].T,
        done.y[end:].T.reshape(-1, len(pairs), 3),
    )
