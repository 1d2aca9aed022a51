"""Friction from contact to far apart, of ``softdyn stress``, against exact solutions of Stokes' equations.

Rigid spheres, or nearly rigid ones that are hardly pushed, approach as fast as the series in bispherical coordinates
say (Brenner 1961 of two equal spheres and of a wall; :mod:`softdyn.stress.two_spheres`), whether friction is all in
the contact or the fluid also drags each of them; and distant spheres are not slowed by one another.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import partial
from typing import Any

import numpy as np

from softdyn.api import simulate
from softdyn.stress.judge import Cell, judge_number
from softdyn.stress.two_spheres import friction

#: Gaps over the smaller radius.
GAPS = (1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0)
#: What the closed forms of the laws promise.
WITHIN = 0.01
LAWS = {
    "equal_spheres": {"E": 1e9, "eta": 1.0, "nu": 0.5},
    "droplet": {"sigma": 1e9, "eta": 1.0},
}
RATIOS = (1.0, 2.0, 10.0, 40.0, math.inf)
DISTANT = (2, 10, 64)


def pair_friction(law: str, gap: float) -> float:
    """Friction of a pair by itself, over that of spheres far apart, from the time in which the gap falls a little."""
    result = simulate(
        law=law, parameters={"R": 1.0, **LAWS[law]}, h=gap, force=1.0, until_h=gap * (1 - 1e-6),
        gaps=[gap * (1 - 1e-6)], quantities=["dh_dt"],
    )  # fmt: skip
    return -1.0 / float(result.dh_dt[-1]) / (3 * math.pi)


def friction_of_many(law: str, gap: float, ratio: float, drag: float) -> float:
    """The same in a scene of many, of spheres of the radii 1 and ``ratio``; ``inf``: of a sphere and a wall.

    Parameters
    ----------
    law : str
        One of those in ``LAWS``.
    gap : float
        Distance of the surfaces, in units of the smaller radius.
    ratio : float
        The other radius, in the same units.
    drag : float
        Of each sphere by itself, in units of that of Stokes: ``drag`` of the scene.
    """
    from softdyn.particles.geometry import Wall
    from softdyn.particles.particle_keys import ParticleScene, Push
    from softdyn.particles.particle_run import simulate_particles

    wall = math.isinf(ratio)
    R = 2.0 if wall else 2 * ratio / (1 + ratio)
    bodies: dict[str, Any]
    if wall:
        bodies = {"positions": [[0.0, 1.0 + gap]], "radii": [1.0], "wall": [Wall([0.0, 0.0], [0.0, -1.0])]}
        bodies["push"] = [Push([0], [0.0, -1.0])]
    else:
        bodies = {"positions": [[0.0, 0.0], [0.0, 1.0 + ratio + gap]], "radii": [1.0, ratio]}
        bodies["push"] = [Push([0], [0.0, 1.0]), Push([1], [0.0, -1.0])]
    until = 1e-3 * gap * 3 * math.pi * R * (1 + R / (2 * gap))
    result = simulate_particles(
        ParticleScene(law=law, parameters=LAWS[law], drag=drag, until_t=until, times=2, rtol=1e-6, **bodies)
    )
    v = result.v[-1, :, 1]
    speed = -v[0] if wall else v[0] - v[1]
    return 1.0 / float(speed) / (3 * math.pi * R)


def distant_friction(law: str, count: int) -> float:
    """Friction of one of many spheres, all a hundred radii apart, over that of Stokes."""
    from softdyn.particles.particle_keys import ParticleScene, Push
    from softdyn.particles.particle_run import simulate_particles

    x = np.array([[100.0 * i, 100.0 * ((7 * i) % 11), 0.0] for i in range(count)])
    scene = ParticleScene(
        law=law, parameters=LAWS[law], positions=x, radii=1.0, push=[Push([0], [1.0, 0.0, 0.0])], drag=1.0,
        until_t=1e-3, times=2, rtol=1e-6,
    )  # fmt: skip
    return 1.0 / float(simulate_particles(scene).v[-1, 0, 0]) / (6 * math.pi)


def far_field_cells() -> Iterable[Cell]:
    """Every law at every gap: as a pair, and in scenes of many without drag, with half of it and with all of it."""
    exact = {(ratio, gap): friction(gap, ratio) for ratio in RATIOS for gap in GAPS}
    group = "far field"
    for law in LAWS:
        for gap in GAPS:
            where = (group, f"a pair of {law}", f"h/R {gap:g}")
            yield judge_number(where, partial(pair_friction, law, gap), exact[1.0, gap], WITHIN)
        for ratio in RATIOS:
            name = f"{law} and a wall" if math.isinf(ratio) else f"{law}, radii 1 and {ratio:g}"
            for drag in (0.5, 1.0) if ratio == 1 else (1.0,):
                for gap in GAPS:
                    where = (group, f"{name}, drag {drag:g}", f"h/R {gap:g}")
                    run = partial(friction_of_many, law, gap, ratio, drag)
                    yield judge_number(where, run, exact[ratio, gap], WITHIN)
        for count in DISTANT:
            where = ("far apart", f"one of {law} is pushed, of", f"{count}")
            yield judge_number(where, partial(distant_friction, law, count), 1.0, WITHIN)
