"""Units, of ``softdyn stress``: no result depends on those of length, time and force.

Two particles in SI units against their dimensionless twins; and scenes of two and of many in units drawn at random,
each told in units of its own radius, time and force.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.api import simulate
from softdyn.bench.precise import UNIT
from softdyn.derive.dimensions import Dimension
from softdyn.pair.pair_run import ALLOWED_ERROR
from softdyn.results.pair_result import PairResult
from softdyn.stress.judge import Cell, judge, judge_number, worst

Array = NDArray[np.float64]

#: Parameters in SI units: R, E, eta.
PARTICLES = {
    "droplet of 1 um": {"R": 0.5e-6, "E": 2.0e4, "eta": 1e-3},
    "steel ball of 1 cm": {"R": 5e-3, "E": 2e11, "eta": 0.1},
}


def _pressed(p: dict[str, float], method: str, rtol: float) -> PairResult:
    """An approach from 10 R to 1e-6 R under 1e-3 E R^2, at 15 gaps."""
    R = p["R"]
    gaps = [x * R for x in np.geomspace(10.0, 1e-6, 15).tolist()]
    force = 1e-3 * p["E"] * R**2
    result: PairResult = simulate(
        law="rognon_gay", parameters=p, h=gaps[0], force=force, until_h=gaps[-1], gaps=gaps, method=method, rtol=rtol
    )
    return result


def _swung(p: dict[str, float], rtol: float) -> PairResult:
    """To and fro under 1e-2 E R^2 sin(2e-5 t), t in units of eta/E."""
    second = p["eta"] / p["E"]
    constants = {"k": 1e-2 * p["E"] * p["R"] ** 2, "w": 2e-5 / second}
    result: PairResult = simulate(
        law="rognon_gay", parameters=p, h=p["R"], force="k*sin(w*t)", constants=constants, until_t=1e6 * second,
        times=20, rtol=rtol,
    )  # fmt: skip
    return result


def unit_cells(rtols: Sequence[float]) -> Iterable[Cell]:
    """A particle in SI units against its dimensionless twin: to rounding by quadrature, to the tolerance by steps."""
    for (name, p), rtol in itertools.product(PARTICLES.items(), rtols):
        R, second, column = p["R"], p["eta"] / p["E"], f"{rtol:g}"

        def apart(twin: PairResult, result: PairResult, R: float = R, second: float = second) -> float:
            of_t = np.max(np.abs(result.t[1:] / second / twin.t[1:] - 1))
            of_h = np.max(np.abs(result.h / R / twin.h - 1))
            return float(max(of_t, of_h, np.max(np.abs(result.delta - R * twin.delta)) / R))

        for method, allowed in (("quadrature", 1e-13), ("auto", ALLOWED_ERROR * rtol)):
            where = ("units", f"{name}, {'by quadrature' if method == 'quadrature' else 'pushed'}", column)
            twin = _pressed(UNIT, method, rtol)
            yield judge(where, partial(_pressed, p, method, rtol), partial(apart, twin), allowed)
        where = ("units", f"{name}, to and fro", column)
        yield judge(where, partial(_swung, p, rtol), partial(apart, _swung(UNIT, rtol)), ALLOWED_ERROR * rtol)


# ---------------------------------------------------------------------------------------------- units drawn at random

SEED = 20261128
#: How many random units each scene is told in, and between which powers of ten they are.
DRAWN, DECADES = 3, (-9.0, 9.0)
#: Scenes of many: what Newton's iteration leaves, relative to the tolerance of the steps, and that.
MANY_RTOL, MANY_LEFT = 1e-5, 1e-2


@dataclass(frozen=True)
class Units:
    """Numbers of the radius, of a time and of a force that are 1 by themselves."""

    length: float = 1.0
    time: float = 1.0
    force: float = 1.0

    def of(self, dimension: Dimension) -> float:
        """Number of a quantity of some dimension that is 1 by itself."""
        # mass is force time^2/length
        in_length, in_time = dimension.length - dimension.mass, dimension.time + 2 * dimension.mass
        return float(
            self.length ** float(in_length) * self.time ** float(in_time) * self.force ** float(dimension.mass)
        )


def _parameters(law: str, values: dict[str, float], units: Units) -> dict[str, float]:
    from softdyn.derive.law import dimensions_for
    from softdyn.laws import find, load

    known = {symbol.name: dimension for symbol, dimension in dimensions_for(load(find(law))[0]).items()}
    return {name: value * units.of(known[name]) for name, value in values.items()}


#: Own parameters of laws, R = E = eta = 1.
LAWS: dict[str, dict[str, float]] = {
    "rognon_gay": {"R": 1.0, "E": 1.0, "eta": 1.0},
    "equal_spheres": {"R": 1.0, "E": 1.0, "eta": 1.0, "nu": 0.4},
    "dlvo": {"R": 1.0, "E": 1.0, "eta": 1.0, "nu": 0.5, "Pi0": 0.3, "ell": 1e-3, "A": 1e-10},
    "soap_film": {"R": 1.0, "sigma": 1.0, "eta": 1.0, "Pi0": 300.0, "ell": 1e-4},
    "cone": {"R": 1.0, "E": 1.0, "eta": 1.0, "m": 0.5},
}


def _drives(u: Units) -> dict[str, dict[str, Any]]:
    """Scenes of two in some units: how they are driven, from where, until when."""
    L, T, F = u.length, u.time, u.force
    swing = {"k": 3e-3 * F, "w": 1e-4 / T}
    times, ramp = np.array([0.0, 1e4, 1e4, 3e4]) * T, np.array([0.0, 1e4, 3e4]) * T
    return {
        "pushed": {"h": L, "force": 1e-3 * F, "until_h": 1e-2 * L, "gaps": [0.5 * L, 0.1 * L, 1e-2 * L]},
        "to and fro": {
            "h": 0.3 * L, "force": "k*(0.3 + sin(w*t))", "constants": swing, "until_t": 2e5 * T, "times": 9,
        },
        "along a table": {
            "h": 0.3 * L, "force": (times, np.array([2e-3, 3e-3, -1e-3, 1e-3]) * F), "until_t": 3e4 * T, "times": 9,
        },
        "moved": {
            "h": 0.3 * L, "velocity": "-v*sin(w*t)", "constants": {"v": 3e-4 * L / T, "w": 3e-3 / T},
            "until_t": 2e3 * T, "times": 9,
        },
        "by a spring": {
            "h": 0.3 * L, "spring": {"stiffness": 0.3 * F / L, "base": (ramp, np.array([2.3, 2.1, 2.5]) * L)},
            "until_t": 2e4 * T, "times": 9,
        },
    }  # fmt: skip


def _two(law: str, drive: str, rtol: float, units: Units) -> PairResult:
    given = _parameters(law, LAWS[law], units)
    result: PairResult = simulate(law=law, parameters=given, rtol=rtol, **_drives(units)[drive])
    return result


def _apart(one: PairResult, units: Units, other: PairResult) -> float:
    """How much two tell differently, in their own units."""
    of_h = np.max(np.abs(other.h / units.length / one.h - 1))
    of_t = np.max(np.abs(other.t / units.time - one.t)) / np.max(one.t)
    of_delta = np.max(np.abs(other.delta / units.length - one.delta)) / np.max(np.abs(one.delta))
    return float(max(of_h, of_t, of_delta))


def _layer(units: Units, loads: dict[str, float], tangential: bool) -> Any:
    """Spheres in a periodic layer, sheared at a rate or under a stress; the depth of the layer is the usual one."""
    from softdyn.particles.packing import random_packing
    from softdyn.particles.particle_keys import ParticleScene

    x, radii, box = random_packing(16, 2, 0.8, [1.0, 1.2], 3)
    law, values = "steric", {"E": 100.0, "eta": 1.0, "nu": 0.5, "Pi0": 10.0, "L": 0.02}
    parameters = _parameters(law, values, units)
    pressure = units.force / units.length**2
    drive: dict[str, Any] = {"shear_rate": loads["rate"] / units.time} if "rate" in loads else {}
    stress: Any = {name: value * pressure for name, value in loads.items() if name != "rate"}
    return ParticleScene(
        law=law, parameters=parameters, positions=x * units.length, radii=radii * units.length,
        box=(box * units.length).tolist(), gap=0.02 * units.length, range=0.3 * units.length, tangential=tangential,
        drag=1.0, stress=stress, until_t=0.3 * units.time, times=4, rtol=MANY_RTOL, target="c", **drive,
    )  # fmt: skip


MANY: dict[str, tuple[dict[str, float], bool]] = {
    "a layer at a shear rate": ({"rate": 0.5}, False),
    "a sliding layer under a stress": ({"xy": 2.0, "pressure": 1.0}, True),
}


def _told(units: Units, loads: dict[str, float], tangential: bool) -> Array:
    """What the result tells without a unit: positions, gaps, stress, viscosity, strain."""
    from softdyn.particles.observables import pressure, relative_viscosity, strain
    from softdyn.particles.particle_run import simulate_particles

    result = simulate_particles(_layer(units, loads, tangential))
    scale = units.length**2 / units.force
    told = [
        result.x[-1] / units.length, result.contacts(-1)["h"] / units.length, result.stress[-1] * scale,
        pressure(result) * scale, strain(result), relative_viscosity(result)[1:],
    ]  # fmt: skip
    return np.concatenate([np.ravel(one) for one in told])


def _odd(random: np.random.Generator) -> Units:
    return Units(*(float(10 ** random.uniform(*DECADES)) for _ in range(3)))


def random_unit_cells(rtols: Iterable[float]) -> Iterable[Cell]:
    """Every law and drive in some units drawn at random, the worst of them; and scenes of many."""
    random = np.random.default_rng(SEED)
    drawn = [_odd(random) for _ in range(DRAWN)]
    for law, rtol in itertools.product(LAWS, rtols):
        found = []
        for drive in _drives(Units()):
            one = _two(law, drive, rtol, Units())
            for units in drawn:
                where = ("units", f"{law} in units drawn at random", f"{rtol:g}")
                run = partial(_two, law, drive, rtol, units)
                found.append(judge(where, run, partial(_apart, one, units), max(ALLOWED_ERROR * rtol, 1e-11)))
        yield worst(found)
    for name, scene in MANY.items():
        first = _told(Units(), *scene)

        def apart(units: Units, first: Array = first, scene: Any = scene) -> float:
            other = _told(units, *scene)
            same = other.shape == first.shape
            return float(np.max(np.abs(other - first)) / np.max(np.abs(first))) if same else math.inf

        where = ("units", f"{name}, drawn at random", f"{MANY_RTOL:g}")
        yield worst([judge_number(where, partial(apart, units), 0.0, MANY_LEFT * MANY_RTOL) for units in drawn])
