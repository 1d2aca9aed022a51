"""Constant force: the time to reach a gap, by quadrature.

With F constant, eq. 7 separates: t(h) = integral of zeta/(F - F_adh) dh at delta(h), a smooth integrand in ln h. This
shares with the integrator the law, but neither a step nor an error estimate: it is what errors are measured against.
"""

from __future__ import annotations

import itertools
import math
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import IntegrationError, SceneError
from softdyn.kernels import Kernel
from softdyn.pair.states import deflection, evaluate
from softdyn.scene.pair_scene import Scene

Array = NDArray[np.float64]

#: Gauss points per panel, and the width of a panel in ln h: 20 points over a factor of 2 in h reach rounding.
POINTS = 20
PANEL = math.log(2.0)
DOUBLINGS = 12


@cache
def _gauss() -> tuple[Array, Array]:
    return np.polynomial.legendre.leggauss(POINTS)


def times_at_gaps(kernel: Kernel, p: Array, F: float, gaps: Array) -> tuple[Array, int]:
    """Time at which each gap is reached, from the first on.

    Parameters
    ----------
    kernel : Kernel
        With ``dh_dt`` among its outputs.
    p : array
        The law's parameters.
    F : float
        The constant force.
    gaps : array, shape (n,)
        In the order of passage.

    Returns
    -------
    times : array, shape (n,)
    evaluations : int
        How many times dh/dt was evaluated.

    Raises
    ------
    IntegrationError
        If the gap does not move from each to the next, or if the integral does not converge.
    """
    u = np.log(gaps)
    parts = [_between(kernel, p, F, start, end) for start, end in itertools.pairwise(u)]
    times = np.concatenate([[0.0], np.cumsum([value for value, _ in parts])])
    return times, sum(evaluations for _, evaluations in parts)


def _between(kernel: Kernel, p: Array, F: float, start: float, end: float) -> tuple[float, int]:
    """Integral of dt = du/(du/dt), panels halved until it no longer changes, and how many rates that took."""
    evaluations, panels = 0, max(1, math.ceil(abs(end - start) / PANEL))
    before = math.nan
    for _ in range(DOUBLINGS):
        value = _panels(kernel, p, F, start, end, panels)
        evaluations += POINTS * panels
        # the sum of POINTS terms of one sign rounds by a few units in the last place
        if abs(value - before) <= 8 * np.finfo(float).eps * abs(value) * math.sqrt(panels):
            return value, evaluations
        before, panels = value, 2 * panels
    raise IntegrationError(
        f"the quadrature between h={math.exp(start):.6g} and h={math.exp(end):.6g} does not converge: "
        "the force is nearly balanced there"
    )


def _panels(kernel: Kernel, p: Array, F: float, start: float, end: float, panels: int) -> float:
    nodes, weights = _gauss()
    edges = np.linspace(start, end, panels + 1)
    half = np.diff(edges) / 2
    u = (edges[:-1, None] + half[:, None] * (1 + nodes)).ravel()
    h = np.exp(u)
    force = np.full(len(h), F)
    delta = deflection(kernel, h, force, p)
    rate = evaluate(kernel, h, delta, {"F": force, "dF_dt": np.zeros(len(h))}, p)["dh_dt"] / h
    if not (np.isfinite(rate).all() and (rate * (end - start) > 0).all()):
        at = int(np.argmin(np.isfinite(rate) & (rate * (end - start) > 0)))
        raise IntegrationError(
            f"under F={F:g} the gap does not go from h={math.exp(start):.6g} to h={math.exp(end):.6g}: "
            f"at h={h[at]:.6g}, delta={delta[at]:.6g} it moves by dh/dt={rate[at] * h[at]:.6g}"
        )
    return float(np.sum(half[:, None] * weights * (1 / rate).reshape(panels, -1)))


def integrate_constant_force(
    scene: Scene, kernel: Kernel, p: Array, F: float
) -> tuple[Array, Array, str, dict[str, Any]]:
    """Times and gaps of the asked outputs of a scene with constant force, by quadrature.

    Parameters
    ----------
    scene : Scene
    kernel : Kernel
    p : array, shape (parameters,)
    F : float
        The force, > 0 in compression.
    """
    if scene.until_h is None or scene.times is not None:
        raise SceneError(
            "[accuracy] method = 'quadrature' gives times at gaps: it needs [until] h, and [output] gaps (not times)"
        )
    if scene.gaps is None or isinstance(scene.gaps, (int, np.integer)):
        gaps = np.geomspace(scene.h, scene.until_h, int(scene.gaps or 50))
    else:
        gaps = np.array(scene.gaps, dtype=float)
    lead = gaps[0] != scene.h
    t, evaluations = times_at_gaps(kernel, p, F, np.concatenate([[scene.h], gaps]) if lead else gaps)
    t = t[1:] if lead else t
    if scene.until_t is not None and t[-1] > scene.until_t:
        raise SceneError(
            f"[until] t = {scene.until_t:g} ends the run before the gap h = {gaps[-1]:g}, at t = {t[-1]:g}"
        )
    stats = {
        "method": "Gauss-Legendre quadrature in ln h",
        "steps": len(gaps),
        "rejected": 0,
        "evaluations": evaluations,
    }
    return t, gaps, "h", stats
