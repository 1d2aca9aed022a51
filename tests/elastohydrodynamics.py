"""A film between elastic bodies: Reynolds' equation and a half-space, axisymmetric. The reference for pulled films.

A sphere of radius R' against a half-space of modulus E*, R' = E* = eta = 1: surfaces are h(r, t) = g(t) + r^2/2 +
w(r, t) apart, w = (1/(pi E*)) integral of p dA'/|r - r'| the deflection of both under the film's pressure, and

    dh/dt = (1/r) d/dr (r h^3/(12 eta) dp/dr) ,    2 pi integral of p r dr = F ,    p = 0 at the outer radius.

At small gaps nothing else has a length: F = 1 or -1 is all that there is, and the state of a film is w/h at its centre.
Two equal spheres of radius R, each of E/(1 - nu^2), are the same with R' = R/2, E* = E/(2 (1 - nu^2)), w = 2 delta.

Pressures are constant on rings, whose deflection is exact (K. L. Johnson, Contact Mechanics, 1985, sec. 3.2), flows are
those between their middles; scipy's Radau does the rest. ``python tests/elastohydrodynamics.py`` writes the table.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

Array = NDArray[np.float64]
TABLE = Path(__file__).parents[1] / "softdyn" / "study" / "elastohydrodynamics.json"
#: w/h at which the table tells friction and elastic radius.
PULLED = (-8, -6.4, -5, -4, -3.2, -2.5, -2, -1.6, -1.25, -1, -0.8, -0.63, -0.5, -0.4, -0.3, -0.2, -0.1, -0.05)
PRESSED = (0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1, 1.4, 2, 2.5, 3, 4, 6, 8, 12, 20)
#: Gaps at the start, in units of (F/(E* sqrt(R')))^(2/3): far away, and as near as the reference of pulled films is.
FAR, NEAR = 8.0, 0.1
RINGS, OUTER, FIRST = 200, 100.0, 0.006
#: States looked at in each of the integrator's steps.
WITHIN = 8


def disc(r: Array, edge: Array) -> Array:
    """Deflection at r of a half-space under the pressure 1 on a disc."""
    r, edge = np.broadcast_arrays(r, edge)
    inside = r <= edge
    squared = (np.minimum(r, edge) / np.maximum(r, edge)) ** 2
    E, K = ellipe(squared), ellipk(np.where(inside, 0.0, squared))
    return 4 / np.pi * np.where(inside, edge * E, r * (E - (1 - squared) * K))


class Film:
    """Rings that widen from the centre, and what the pressure on each does."""

    def __init__(self, rings: int = RINGS, outer: float = OUTER, first: float = FIRST) -> None:
        growth = brentq(lambda q: first * (q**rings - 1) / (q - 1) - outer, 1 + 1e-9, 2)
        self.edges = np.append(0.0, first * np.cumsum(growth ** np.arange(rings)))
        self.r = (self.edges[1:] + self.edges[:-1]) / 2
        self.areas = np.diff(self.edges**2) / 2  # over 2 pi
        self.apart = np.append(np.diff(self.r), self.edges[-1] - self.r[-1])
        discs = disc(self.r[:, None], self.edges[None, 1:])
        self.centre_of = 2 * np.diff(self.edges)  # deflection of the centre by each pressure
        matrix = np.ones((rings + 1, rings + 1))
        matrix[:-1, :-1] = np.diff(discs, axis=1, prepend=0.0)
        matrix[-1] = np.append(2 * np.pi * self.areas, 0.0)
        # pressures and g from h and F
        self.inverse = np.linalg.inv(matrix)

    def pressures(self, h: Array, F: float) -> Array:
        """Pressures, and g last."""
        return self.inverse @ np.append(h - self.r**2 / 2, F)

    def _flows(self, h: Array, p: Array) -> tuple[Array, Array, Array]:
        face = np.append((h[1:] + h[:-1]) / 2, h[-1] + (self.edges[-1] ** 2 - self.r[-1] ** 2) / 2)
        return face, np.append(np.diff(p), -p[-1]), self.edges[1:] / (12 * self.apart)

    def rates(self, h: Array, F: float) -> Array:
        """dh/dt of each ring."""
        face, steps, width = self._flows(h, self.pressures(h, F)[:-1])
        return np.diff(width * face**3 * steps, prepend=0.0) / self.areas

    def jacobian(self, h: Array, F: float) -> Array:
        """Slopes of the rates."""
        face, steps, width = self._flows(h, self.pressures(h, F)[:-1])
        count = len(h)
        carried = width * face**3
        flows = -carried[:, None] * self.inverse[:-1, :-1]
        flows[:-1] += carried[:-1, None] * self.inverse[1:-1, :-1]
        wider = 3 * width * face**2 * steps
        i = np.arange(count - 1)
        flows[i, i] += wider[:-1] / 2
        flows[i, i + 1] += wider[:-1] / 2
        flows[-1, -1] += wider[-1]
        return np.diff(flows, axis=0, prepend=np.zeros((1, count))) / self.areas[:, None]

    def centre(self, h: Array, F: float) -> tuple[float, float, float, float]:
        """Gap and deflection w at the centre, the gap's rate and that of g, which is the centres' distance."""
        p = self.pressures(h, F)
        change = self.inverse @ np.append(self.rates(h, F), 0.0)
        w = float(self.centre_of @ p[:-1])
        return float(p[-1]) + w, w, float(change[-1] + self.centre_of @ change[:-1]), float(change[-1])

    def rigid(self, h: float) -> float:
        """Friction of rigid bodies with the same outer radius: 6 pi/h but for what is left out."""
        rim = self.edges[-1] ** 2 / 2
        return 6 * np.pi / h * (1 - h / (h + rim) - h * rim / (h + rim) ** 2)

    def run(
        self, h: float | Array, F: Callable[[float], float], until: float, stop: Callable[[float], float] | None = None
    ) -> Any:
        """Integrate from a gap, or from a profile, under a force; ``stop`` ends it where its value at h is 0."""
        first = h + self.r**2 / 2 if isinstance(h, float) else h
        events = None
        if stop is not None:
            events = lambda _t, h: stop(h[0])  # noqa: E731
            events.terminal = True  # type: ignore[attr-defined]
        return solve_ivp(
            lambda t, h: self.rates(h, F(t)), (0.0, until), first, method="Radau", events=events,
            jac=lambda t, h: self.jacobian(h, F(t)), rtol=1e-8, atol=1e-12, dense_output=True,
        )  # fmt: skip


def curve(film: Film, run: Any, after: float, F: float) -> Array:
    """Rows of w/h, friction over that of rigid bodies, F/(E* w sqrt(R' h)), dX/dh, after a time.

    Within a step as well as at its ends: steps are wide where little happens, and where they end is a matter of
    rounding.
    """
    times = run.t[run.t >= after]
    times = np.interp(np.arange(0, len(times) - 1 + 1 / WITHIN, 1 / WITHIN), np.arange(len(times)), times)
    rows = []
    for h in run.sol(times).T:
        gap, w, rate, centres = film.centre(h, F)
        rows.append((w / gap, -F / rate / film.rigid(gap), F / (w * np.sqrt(gap)), centres / rate))
    return np.array(rows)


def approach(film: Film, gap: float = FAR) -> Array:
    """The curve of bodies that are pressed together from far away."""
    run = film.run(gap, lambda t: min(1.0, t), 4e3)
    return curve(film, run, 2.0, 1.0)


def escape(film: Film, gap: float = NEAR) -> Array:
    """The curve of bodies that are pulled apart from a gap, after the film's centre has begun to open.

    The force is set within 2 % of the time of escape, some 25.
    """
    run = film.run(gap, lambda t: -min(1.0, 2 * t), 400.0, stop=lambda h: h - 10.0)
    return curve(film, run, run.t[np.argmin(run.y[0]) + 1], -1.0)


def reversal(film: Film, pressed: float = 60.0, until: float = 110.0) -> dict[str, list[float]]:
    """Bodies pressed together and then pulled: force, gaps at the centre and at their smallest, over time."""

    def force(t: float) -> float:
        return max(-1.0, 1.0 - 2 * t)

    run = film.run(FAR, lambda t: min(1.0, t), FAR * 12 + pressed)
    after = film.run(run.y[:, -1], force, until, stop=lambda h: h - 1.0)
    kept = np.append(np.arange(0, len(after.t) - 1, max(1, len(after.t) // 80)), len(after.t) - 1)
    deflections = [film.centre(after.y[:, k], force(after.t[k]))[1] for k in kept]
    return {
        "t": [float(f"{x:.5g}") for x in after.t[kept]],
        "force": [float(f"{force(t):.5g}") for t in after.t[kept]],
        "centre": [float(f"{x:.5g}") for x in after.y[0, kept]],
        "smallest": [float(f"{x:.5g}") for x in after.y[:, kept].min(axis=0)],
        "deflection": [float(f"{x:.5g}") for x in deflections],
    }


def at(rows: Array, places: tuple[float, ...]) -> Array:
    """Friction and elastic radius at some w/h, by interpolation of logarithms along the curve."""
    order = np.argsort(rows[:, 0])
    x = np.log(np.abs(rows[order, 0]))
    x, values = (x, rows[order]) if x[0] < x[-1] else (x[::-1], rows[order][::-1])
    wanted = np.log(np.abs(np.array(places)))
    return np.exp(np.column_stack([np.interp(wanted, x, np.log(values[:, k])) for k in (1, 2)]))


def table() -> dict[str, Any]:
    """All that is kept of the runs."""
    film = Film()
    rows = np.vstack([at(escape(film), PULLED), at(approach(film), PRESSED)])
    return {
        "about": "Reynolds' equation and an elastic half-space, axisymmetric, at small gaps: a sphere of radius R' "
        "against a half-space of modulus E*, w the deflection of both at the centre, h the gap there",
        "made by": "python tests/elastohydrodynamics.py",
        "columns": ["w/h", "friction over 6 pi eta R'^2/h", "F/(E* w sqrt(R' h))"],
        "rows": [[x, *(float(f"{y:.4g}") for y in row)] for x, row in zip((*PULLED, *PRESSED), rows, strict=True)],
        "pulled from nearer": {
            "about": "the same, pulled from half the gap and from twice the gap: films remember how they were pulled",
            "rows": [
                [gap, x, float(f"{y:.4g}")]
                for gap in (NEAR / 2, 2 * NEAR)
                for x, (y, _) in zip((-2.5, -1.25, -0.5), at(escape(film, gap), (-2.5, -1.25, -0.5)), strict=True)
            ],
        },
        "reversed": {
            "about": "pressed by F, then pulled by F; lengths in (F/(E* sqrt(R')))^(2/3), time in eta R'^2/F from the "
            "reversal; force over F, gaps at the centre and at their smallest",
            **reversal(film),
        },
    }


if __name__ == "__main__":
    TABLE.write_text(json.dumps(table(), indent=1) + "\n", encoding="utf-8")
