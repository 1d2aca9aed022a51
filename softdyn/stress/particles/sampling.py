"""Random small scenes: two to eight particles, and of all mechanisms some.

They are made in units of a radius, a modulus and a viscosity of 1, and then given random units: no answer may depend
on them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sympy import Expr, Float, Symbol, cos, exp, sin, sqrt, tanh

from softdyn.laws import find, load
from softdyn.particles.geometry import Wall
from softdyn.particles.particle_keys import Hold, ParticleScene, Push
from softdyn.stress.particles.cases import Case, Pieces

Array = NDArray[np.float64]
Random = np.random.Generator
TIME = Symbol("t", real=True)

#: Laws, with ranges of their own parameters as powers of ten, in units of R, E and eta; which of them slide.
LAWS: dict[str, dict[str, tuple[float, float]]] = {
    "rognon_gay": {},
    "equal_spheres": {"nu": (-0.7, -0.302)},
    "steric": {"nu": (-0.7, -0.302), "Pi0": (-1.5, 0.0), "L": (-2.0, -1.0)},
    "dlvo": {"nu": (-0.7, -0.302), "Pi0": (-1.5, -0.5), "ell": (-2.0, -1.3), "A": (-9.0, -7.5)},
    "soap_film": {"sigma": (-1.0, 0.0), "Pi0": (-1.0, 0.5), "ell": (-2.0, -1.3)},
    "droplet": {"sigma": (-1.0, 0.0)},
    "cone": {"m": (-0.5, 0.0)},
}
SLIDING = ("equal_spheres", "steric", "dlvo")
#: Powers of length, force and time in what a law's parameters are measured in.
UNITS = {
    "E": (-2, 1, 0), "eta": (-2, 1, 1), "Pi0": (-2, 1, 0), "L": (1, 0, 0), "ell": (1, 0, 0), "A": (1, 1, 0),
    "sigma": (-1, 1, 0),
}  # fmt: skip
RTOLS = (1e-3, 1e-4, 1e-5, 1e-6)
#: Largest force of a pulse, in units of E R^2; and velocity, in those of the rest of the run: any.
STRONG, FAST = 0.1, 1e6


@dataclass
class Draft:
    """A scene in the making."""

    random: Random
    d: int
    unit: tuple[float, float, float]
    drives: dict[str, Pieces] = field(default_factory=dict)
    kinds: list[str] = field(default_factory=list)

    def uniform(self, low: float, high: float) -> float:
        return float(self.random.uniform(low, high))

    def decade(self, low: float, high: float) -> float:
        return float(10 ** self.random.uniform(low, high))

    def chance(self, odds: float) -> bool:
        return bool(self.random.random() < odds)

    def scale(self, length: int, force: int, time: int) -> float:
        """Size of a unit that is a product of powers of those of length, force and time.

        Parameters
        ----------
        length, force, time : int
            The powers.
        """
        return float(self.unit[0] ** length * self.unit[1] ** force * self.unit[2] ** time)

    def drive(self, size: float, until: float, plain: bool = False, most: float = 20.0) -> Any:
        """A number, an expression of t or a table, of some size; all in the units of the scene.

        Parameters
        ----------
        size : float
        until : float
            Duration of the run.
        plain : bool
            Whether it begins at 0, or near it, and has no jumps.
        most : float
            Largest height of a pulse, in units of the size.
        """
        if not plain and self.chance(0.3):
            return size
        made = [*[self._smooth] * 7, self._pulse, self._gate, self._table, self._kinked, self._jumping]
        kind = int(self.random.integers(len(made) - plain))
        return made[kind](size, until, plain, most)

    def _given(self, text: str, pieces: Pieces, kind: str) -> str:
        self.drives[text] = pieces
        self.kinds.append(kind)
        return text

    def _smooth(self, size: float, until: float, plain: bool, most: float) -> str:
        """What has no marks."""
        w, phase = self.uniform(1.0, 9.0) / until, self.uniform(0.0, 2 * math.pi)
        t, x = TIME, self.uniform(-0.9, 0.9)
        expr = {
            1: sin(_number(w) * t),
            2: _number(x) + sin(_number(w) * t + _number(phase)) / 2,
            3: exp(-t * _number(self.uniform(0.3, 3.0) / until)) * cos(_number(w) * t),
            4: tanh(_number(3.0 / until) * (t - _number(until * self.uniform(0.2, 0.8)))),
            5: sqrt(1 + (_number(w) * t) ** 2) / 5 - _number(x) * (t * _number(1.0 / until)) ** 3,
        }[1 if plain else int(self.random.integers(1, 6))]
        expr = _number(size) * expr
        return self._given(str(expr), [(0.0, expr)], "expression")

    def _pulse(self, size: float, until: float, plain: bool, most: float) -> str:
        """A Gaussian pulse, however narrow; what it is the rate of changes as much as in the rest of the run."""
        width, at = until * self.decade(-6.0, -1.0), until * self.uniform(0.1, 0.9)
        high, x = min(most, self.uniform(0.1, 0.6) * until / width), 0.0 if plain else self.uniform(-0.5, 0.5)
        form = exp(-(((TIME - _number(at)) / _number(width)) ** 2))
        expr = _number(size) * (_number(x) + _number(high) * form)
        marks = [when for when in (at - 6 * width, at, at + 6 * width) if 0 < when < until]
        return self._given(str(expr), [(0.0, expr), *((when, expr) for when in marks)], "pulse")

    def _gate(self, size: float, until: float, plain: bool, most: float) -> str:
        """On and off again some times."""
        w, sharp = self.uniform(5.0, 20.0) / until, self.decade(0.5, 1.5)
        phase = 0.5 * math.pi if plain else self.uniform(0.0, math.pi)
        expr = _number(size) * exp(-_number(sharp) * sin(_number(w) * TIME + _number(phase)) ** 2)
        marks = [(k * math.pi - phase) / w for k in range(1, 12)]
        return self._given(str(expr), [(0.0, expr), *((t, expr) for t in marks if 0 < t < until)], "gate")

    def _table(self, size: float, until: float, plain: bool, most: float) -> tuple[list[float], list[float]]:
        """A table of some rows, perhaps with a jump."""
        inside = np.sort(self.random.uniform(0.05, 0.95, int(self.random.integers(2, 6)))) * until
        t = [0.0, *inside.tolist(), until]
        values = (size * self.random.uniform(-1.0, 1.0, len(t))).tolist()
        self.kinds.append("table")
        if plain:
            values[0] = 0.0
        elif self.chance(0.5):
            t.insert(2, t[1])
            values.insert(2, size * self.uniform(-1.0, 1.0))
            self.kinds.append("jump")
        return t, values

    def _kinked(self, size: float, until: float, plain: bool, most: float) -> str:
        """An expression with kinks."""
        w, phase = self.uniform(1.0, 9.0) / until, 0.0 if plain else self.uniform(0.1, 3.0)
        k, rate, number = _number(size), _number(w), _number(phase)
        if self.chance(0.5):
            zeros = [(m * math.pi - phase) / w for m in range(1, 4)]
            signs = [(0.0, 1), *((t, (-1) ** (m + 1)) for m, t in enumerate(zeros) if 0 < t < until)]
            pieces = [(t, sign * k * sin(rate * TIME + number)) for t, sign in signs]
            return self._given(f"{k}*abs(sin({rate}*t + {number}))", pieces, "kink")
        at = self.uniform(0.1, 0.9) * until
        pieces = [(0.0, k * rate * TIME), (at, k * rate * _number(at))]
        return self._given(f"{k}*{rate}*min(t, {_number(at)})", pieces, "kink")

    def _jumping(self, size: float, until: float, plain: bool, most: float) -> str:
        """An expression with a jump."""
        at, k, x = self.uniform(0.1, 0.9) * until, _number(size), _number(self.uniform(-0.9, 0.9))
        w = _number(self.uniform(1.0, 9.0) / until)
        if self.chance(0.5):
            pieces = [(0.0, k * x * cos(w * TIME)), (at, k * (x * cos(w * TIME) + 1))]
            return self._given(f"{k}*({x}*cos({w}*t) + step(t - {_number(at)}))", pieces, "jump")
        pieces = [(0.0, -k * cos(w * TIME)), (at, k * cos(w * TIME))]
        return self._given(f"{k}*sign(t - {_number(at)})*cos({w}*t)", pieces, "jump")


def _number(value: float) -> Expr:
    """With the seventeen digits that tell it from its neighbours."""
    return Float(repr(value), 17)


def random_case(seed: int) -> Case:
    """The case of a seed."""
    random = np.random.default_rng([20261128, seed])
    d = int(random.choice([1, 2, 3], p=[0.15, 0.5, 0.35]))
    unit = tuple(float(10 ** random.uniform(-4, 4)) for _ in range(3)) if random.random() < 0.5 else (1.0, 1.0, 1.0)
    draft = Draft(random, d, unit)  # type: ignore[arg-type]
    return _still(draft) if draft.chance(0.3) else _dragged(draft)


def _law(draft: Draft, slides: bool, count: int) -> dict[str, Any]:
    """The law with its parameters, of which some may depend on the species."""
    names = SLIDING if slides else tuple(LAWS)
    name = names[int(draft.random.integers(len(names)))]
    law = load(find(name))[0]
    ranges = {"E": (0.0, 0.0), "eta": (0.0, 0.0), **LAWS[name]}
    used = {symbol.name for expr in (law.a, law.F_ela, law.zeta, law.F_adh) for symbol in expr.free_symbols} | {"eta"}
    used |= {"nu"} if "nu" in ranges else set()
    used |= {"E"} if slides else set()
    kinds = count > 2 and draft.chance(0.3)
    values: dict[str, Any] = {}
    mixing: dict[str, str] = {}
    for parameter, span in ranges.items():
        if parameter not in used:
            continue
        unit = draft.scale(*UNITS.get(parameter, (0, 0, 0)))
        values[parameter] = draft.decade(*span) * unit
        if kinds and parameter != "eta" and draft.chance(0.5):
            factor = draft.uniform(1.0, 1.6) if parameter != "nu" else 1.0
            values[parameter] = {"A": values[parameter], "B": values[parameter] * factor}
            if parameter != "E":
                mixing[parameter] = str(draft.random.choice(["arithmetic", "geometric", "harmonic"]))
    species = (
        ["A", "B"] * (count // 2) + ["A"] * (count % 2) if any(isinstance(v, dict) for v in values.values()) else None
    )
    draft.kinds += [name] + (["species"] if species else [])
    return {"law": name, "parameters": values, "mixing": mixing, "species": species}


def _radii(draft: Draft, count: int) -> Array:
    if draft.chance(0.4):
        return np.ones(count)
    draft.kinds.append("unequal radii")
    return np.asarray(draft.random.uniform(0.6, 1.5, count))


def _cluster(draft: Draft, radii: Array, overlap: float) -> Array:
    """Places of particles, each near one of those before, none overlapping another by more than that."""
    d, x = draft.d, [np.zeros(draft.d)]
    while len(x) < len(radii):
        near = int(draft.random.integers(len(x))) if d > 1 else len(x) - 1
        way = draft.random.normal(size=d)
        way = way / np.linalg.norm(way) if d > 1 else np.ones(1)
        apart = draft.uniform(-overlap, 0.05) if draft.chance(0.5) else draft.decade(-2.5, -0.3)
        place = x[near] + way * (radii[near] + radii[len(x)] + apart)
        gaps = [np.linalg.norm(place - other) - radii[k] - radii[len(x)] for k, other in enumerate(x)]
        if min(gaps) >= -overlap:
            x.append(place)
    return np.array(x)


def _boxed(draft: Draft, radii: Array, reach: float) -> tuple[Array, list[float | None]] | None:
    """Places in a periodic box, and its lengths."""
    d = draft.d
    least = 2 * (2 * float(radii.max()) + reach + 0.3)  # pairs are looked for some way beyond the range
    lengths = [least * draft.uniform(1.05, 1.4) for _ in range(d)]
    if d == 1:
        lengths = [max(lengths[0], 2 * float(radii.sum()) * draft.uniform(0.98, 1.2))]
        ends = np.cumsum(2 * radii) * lengths[0] / float(2 * radii.sum())
        return (ends - radii * lengths[0] / float(2 * radii.sum()))[:, None], list(lengths)
    x: list[Array] = []
    for _ in range(3000):
        if len(x) == len(radii):
            return np.array(x), list(lengths)
        place = draft.random.uniform(0, 1, d) * lengths
        gaps = []
        for k, other in enumerate(x):
            way = place - other
            way = way - np.array(lengths) * np.round(way / np.array(lengths))
            gaps.append(float(np.linalg.norm(way)) - radii[k] - radii[len(x)])
        if all(gap > -0.04 for gap in gaps):
            x.append(place)
    return None


def _dragged(draft: Draft) -> Case:
    """A scene whose particles the fluid resists: any of the mechanisms."""
    d, count = draft.d, int(draft.random.integers(2, 9))
    slides = d > 1 and draft.chance(0.4)
    if slides:
        draft.kinds.append("tangential")
    drag = 1.0 if draft.chance(0.7) else draft.uniform(0.3, 3.0)
    radii = _radii(draft, count)
    reach = draft.uniform(0.3, 0.6) * float(radii.min()) if draft.chance(0.6) else None
    gap = draft.decade(-2.5, -1.0) * (reach or 1.0)
    box: list[float | None] | None = None
    x = None
    if reach is not None and draft.chance(0.5):
        found = _boxed(draft, radii, reach)
        if found is not None:
            x, box = found
            draft.kinds.append("box")
    if x is None:
        x = _cluster(draft, radii, 0.05)
    size = draft.decade(-3.5, -1.5)
    until = 6 * math.pi * drag / size * draft.uniform(0.1, 0.8)
    scene = _law(draft, slides, count)
    length, force, time = (draft.scale(*(int(k == m) for m in range(3))) for k in range(3))
    if any(isinstance(v, dict) for v in scene["parameters"].values()):
        size /= 2
    T = until * time
    walls, stress = [], {}
    shear: Any = 0.0
    if box is not None and draft.chance(0.4):
        stress = _stress(draft, T, force / length**2)
    elif d > 1 and draft.chance(0.5):
        shear = draft.drive(draft.uniform(-1.2, 1.2) / T, T, most=FAST)
        draft.kinds.append("shear")
    if box is None and draft.chance(0.5):
        walls.append(_wall(draft, x, radii, length, T, slides))
        draft.kinds.append("wall")
    pushes = _pushes(draft, count, T, size * force, length, slides, STRONG / size)
    holds = [_hold(draft, count, T, length, slides)] if not stress and draft.chance(0.3) else []
    draft.kinds.append("range" if reach else "no range")
    tilt = draft.uniform(-0.4, 0.4) if box is not None and d > 1 and draft.chance(0.3) else 0.0
    if box is not None:
        least = 2 * (2 * float(radii.max()) + float(reach or 0.0))
        tilt *= least
    deep = box is not None and d < 3 and draft.chance(0.3)
    return _case(
        draft, scene, x=x, radii=radii, until_t=T, gap=gap * length, range=None if reach is None else reach * length,
        box=None if box is None else [b * length if b else None for b in box], tilt=tilt * length, wall=walls,
        depth=draft.uniform(1.0, 5.0) * length if deep else None,
        shear_rate=shear, stress=stress, drag=drag, push=pushes, hold=holds, tangential=slides,
    )  # fmt: skip


def _stress(draft: Draft, until: float, unit: float) -> dict[str, Any]:
    """Imposed components; without contacts the strain would be some tenths."""
    names = ["xy", "pressure", "both", "xx"] if draft.d > 1 else ["xx", "pressure"]
    which = str(draft.random.choice(names))
    strains = {"xy": (0.1, 0.8), "pressure": (0.02, 0.15), "xx": (-0.15, -0.02)}
    draft.kinds.append("imposed stress")
    rate = unit * draft.scale(0, 0, 1) / until
    return {
        name: draft.drive(draft.uniform(*strains[name]) * rate, until)
        for name in (("xy", "pressure") if which == "both" else (which,))
    }


def _pushes(
    draft: Draft, count: int, until: float, size: float, length: float, slides: bool, most: float
) -> list[Push]:
    """One to three pushes, with torques where there is tangential motion."""
    found = []
    for _ in range(int(draft.random.integers(1, 4))):
        particles: Any = [int(draft.random.integers(count))] if draft.chance(0.8) else "all"
        force = [draft.drive(size * draft.uniform(-1, 1), until, most=most) for _ in range(draft.d)]
        torque = None
        if slides and draft.chance(0.5):
            about = range(1 if draft.d == 2 else 3)
            torque = [draft.drive(size * draft.uniform(-1, 1) * length, until, most=most) for _ in about]
            draft.kinds.append("torque")
        found.append(Push(particles, force if torque is None or draft.chance(0.5) else None, torque))
    draft.kinds.append("push")
    return found


def _hold(draft: Draft, count: int, until: float, length: float, slides: bool) -> Hold:
    """One particle held or moved along some axes, perhaps spun."""
    axes, spin = "xyz"[: int(draft.random.integers(1, draft.d + 1))], None
    velocity = [draft.drive(draft.uniform(-0.3, 0.3) * length / until, until, most=FAST) for _ in axes]
    if slides and draft.chance(0.6):
        spin = [draft.drive(draft.uniform(-1, 1) / until, until, most=FAST) for _ in range(1 if draft.d == 2 else 3)]
    draft.kinds += ["hold"] + (["spin"] if spin else [])
    return Hold([int(draft.random.integers(count))], axes, velocity if draft.chance(0.7) else None, spin)


def _wall(draft: Draft, x: Array, radii: Array, length: float, until: float, slides: bool) -> Wall:
    """A wall that touches the particles on one side, rigid or not, at rest or moving."""
    normal = draft.random.normal(size=draft.d)
    normal /= np.linalg.norm(normal)
    reach = float((x @ normal + radii).max()) + draft.decade(-2.5, -0.5)
    velocity: list[Any] | None = None
    if draft.chance(0.5):
        rate = draft.uniform(-0.3, 0.3) * length / until
        if slides:
            velocity = [draft.drive(rate * draft.uniform(-1, 1), until, most=FAST) for _ in range(draft.d)]
        else:
            velocity = [draft.drive(rate, until, most=FAST)] * draft.d
        draft.kinds.append("moving wall")
    rigid = draft.chance(0.5)
    draft.kinds.append("rigid wall" if rigid else "soft wall")
    return Wall((normal * reach * length).tolist(), normal.tolist(), rigid, velocity)


def _still(draft: Draft) -> Case:
    """A scene without drag: positions are the elastic equilibrium at the gaps."""
    draft.kinds.append("no drag")
    length, force, time = (draft.scale(*(int(k == m) for m in range(3))) for k in range(3))
    d, size = draft.d, draft.decade(-4.0, -1.8)
    until = 6 * math.pi / size * draft.uniform(0.2, 3.0)
    T = until * time
    slides = d > 1 and draft.chance(0.4)
    walls, pushes, holds = [], [], []
    gap: float | None = draft.decade(-2.5, -1.0)
    if d == 1:  # a chain, pushed against a wall or between held ends
        count = int(draft.random.integers(2, 9))
        radii = _radii(draft, count)
        x = _cluster(draft, radii, 0.05)
        if draft.chance(0.5):
            end = x[0, 0] - radii[0] - draft.decade(-2.5, -1.0)
            walls.append(Wall([end * length], [-1.0], draft.chance(0.5)))
            draft.kinds.append("wall")
        else:
            holds.append(Hold([0], "x", [draft.drive(draft.uniform(-0.05, 0.05) * length / T, T)]))
            draft.kinds.append("hold")
        pushes.append(Push([count - 1], [draft.drive(-size * force, T, most=3.0)]))
        other = draft.drive(-size * force * draft.uniform(0, 1), T, most=3.0)
        pushes.append(Push([int(draft.random.integers(count))], [other]))
        draft.kinds.append("push")
    elif draft.chance(0.3) and not slides:  # two alone, or a regular polygon or tetrahedron, under central forces
        count = 2 if draft.chance(0.6) else d + 1
        radii = np.ones(count)
        angles = 2 * math.pi * np.arange(count) / count + draft.uniform(0, 6)
        x = np.stack([np.cos(angles), np.sin(angles)], axis=1) / math.sin(math.pi / count)
        if d == 3:
            x = np.pad(x, ((0, 0), (0, 1)))
            if count == 4:
                x = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / math.sqrt(2)
        x *= 1 + draft.uniform(-0.01, 0.1)
        value = draft.drive(-size * force, T, most=3.0)
        ways = x / np.linalg.norm(x, axis=1)[:, None]
        for k, way in enumerate(ways):
            pushes.append(Push([k], [_times(draft, value, float(w)) for w in way]))
        draft.kinds += ["free cluster", "push"]
    else:  # some in the middle of held ones
        inner = 1
        outer = (
            int(draft.random.integers(3, 5 if slides else 7))
            if d == 2
            else int(draft.random.integers(4, 6 if slides else 8))
        )
        count = inner + outer
        radii = _radii(draft, count)
        ways = _spread(draft, outer)
        apart = draft.decade(-2.5, -1.0) if slides else draft.uniform(-0.03, 0.1)
        # the outer ones far enough out that none of them meets another
        beside = np.linalg.norm(ways[:, None] - ways[None], axis=2) + 9 * np.eye(outer)
        both = radii[1:, None] + radii[None, 1:] + apart
        radii[0] = max(radii[0], float((both / beside).max()) - float(radii[1:].min()))
        x = np.concatenate([np.zeros((1, d)), ways * (radii[0] + radii[1:, None] + apart)])
        for k in range(1, count):
            moves = draft.chance(0.5)
            velocity = (
                [draft.drive(draft.uniform(-0.04, 0.04) * length / T, T, most=FAST) for _ in range(d)]
                if moves
                else None
            )
            # one spin at least is given, in 3D two: else torques that balance as they are would say nothing of the
            # whole's, or of its twist about the line of that contact
            turns = slides and (k > count - d or draft.chance(0.5))
            about = range(1 if d == 2 else 3)
            spin = (
                [draft.drive(draft.uniform(-0.1, 0.1) / T, T) for _ in about]
                if draft.chance(0.5)
                else [0.0 for _ in about]
            )
            holds.append(Hold([k], "xyz"[:d], velocity, spin if turns else None))
        pushes.append(Push([0], [draft.drive(size * draft.uniform(-1, 1) * force, T, most=3.0) for _ in range(d)]))
        if slides:
            gap = None
            about = range(1 if d == 2 else 3)
            torque = [draft.drive(size * draft.uniform(-1, 1) * force * length, T, most=3.0) for _ in about]
            pushes.append(Push([0], None, torque))
            draft.kinds += ["tangential", "torque"]
        draft.kinds += ["hold", "push"]
    scene = _law(draft, slides, count)
    reach = draft.uniform(0.5, 0.9) * float(radii.min()) if d > 1 and (slides or draft.chance(0.3)) else None
    draft.kinds.append("range" if reach else "no range")
    if reach and gap:
        gap = min(gap, reach / 2)
    return _case(
        draft, scene, x=x, radii=radii, until_t=T, gap=None if gap is None else gap * length,
        range=None if reach is None else reach * length, wall=walls, push=pushes, hold=holds, tangential=slides,
    )  # fmt: skip


def _times(draft: Draft, value: Any, factor: float) -> Any:
    """A drive times a number."""
    if isinstance(value, tuple):
        return value[0], [factor * v for v in value[1]]
    if not isinstance(value, str):
        return value * factor
    text = f"{_number(factor)}*({value})"
    draft.drives[text] = [(t, _number(factor) * expr) for t, expr in draft.drives[value]]
    return text


def _spread(draft: Draft, count: int) -> Array:
    """Directions that are far from one another."""
    if draft.d == 2:
        angles = 2 * math.pi * (np.arange(count) + draft.random.uniform(-0.1, 0.1, count)) / count
        return np.stack([np.cos(angles), np.sin(angles)], axis=1)
    ways = draft.random.normal(size=(count, 3))
    for _ in range(200):
        ways /= np.linalg.norm(ways, axis=1)[:, None]
        apart = ways[:, None] - ways[None]
        size = np.linalg.norm(apart, axis=2) + np.eye(count)
        ways = ways + 0.05 * np.sum(apart / size[:, :, None] ** 3, axis=1)
    return np.asarray(ways / np.linalg.norm(ways, axis=1)[:, None])


def _case(draft: Draft, scene: dict[str, Any], x: Array, radii: Array, **more: Any) -> Case:
    length = draft.unit[0]
    rtol = float(draft.random.choice(RTOLS))
    species = scene.pop("species")
    built = ParticleScene(
        **scene, species=species, positions=(x * length).tolist(), radii=(radii * length).tolist(), times=5, rtol=rtol,
        **more,
    )  # fmt: skip
    kind = ", ".join([f"{draft.d}D", *dict.fromkeys(draft.kinds)])
    return Case(built, draft.drives, load(find(scene["law"]))[0], kind)
