"""Bonds: potentials between named pairs of particles, which may break.

A bond acts at any distance at which its potential holds. It breaks at a length, or at a force in tension, for good: the
step ends there, and what the bond has stored is lost, ``broken`` in the balance of energy.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.energy import ELASTIC
from softdyn.particles.geometry import Contacts, Integers, bare_contacts, directions, lattice
from softdyn.particles.mechanisms import Mechanism
from softdyn.particles.neighbours import common
from softdyn.particles.pair_forces import POTENTIAL, PairForce, Rows, RowsOf, pair_force, require_resistance
from softdyn.scene.keys import Key, with_keys
from softdyn.scene.kinds import NUMBERS_BY_NAME, POSITIVE, Kind

if TYPE_CHECKING:
    from softdyn.particles.energy import Rates
    from softdyn.particles.force_balance import Balance
    from softdyn.particles.results import Frame
    from softdyn.particles.state import State
    from softdyn.particles.system import PreparedScene, System, ValidatedScene

Array = NDArray[np.float64]

#: Stands for the bonds of generated chains.
CHAINS = "chains"
PAIRS = Kind(
    f'a list of pairs of their numbers, or "{CHAINS}"',
    {
        "anyOf": [
            {
                "type": "array",
                "items": {
                    "type": "array",
                    "items": {"type": "integer", "minimum": 0},
                    "minItems": 2,
                    "maxItems": 2,
                },
            },
            {"enum": [CHAINS]},
        ]
    },
)
#: A bond breaks within this part of its length, or force.
CLOSE = 1e-9
#: The least part of a step that is tried for the end of a bond.
SHORTEST = 1e-3


@with_keys
@dataclass(frozen=True)
class Bond:
    """Bonds between pairs of particles."""

    pairs: Annotated[
        Sequence[Sequence[int]] | str,
        Key("[[bond]] pairs", PAIRS, "Which particles are bonded, two by two; or neighbours in [chains]."),
    ]
    potential: Annotated[
        Any, Key("[[bond]] potential", POTENTIAL, "The potential: softdyn potentials lists the stock ones.")
    ]
    parameters: Annotated[
        Mapping[str, float],
        Key("[[bond]] parameters", NUMBERS_BY_NAME, "A value for each parameter of the potential."),
    ] = field(default_factory=dict)
    breaks_at_length: Annotated[
        float | None,
        Key("[[bond]] breaks_at_length", POSITIVE, "Distance of the centres at which a bond breaks.", "length"),
    ] = None
    breaks_at_force: Annotated[
        float | None, Key("[[bond]] breaks_at_force", POSITIVE, "Tension at which a bond breaks.", "force")
    ] = None


@dataclass(frozen=True)
class Bonds(Mechanism):
    """All bonds of a scene; arrays of one length.

    Attributes
    ----------
    forces : tuple of PairForce
        Of each entry of the scene.
    of : array of int
        Which entry a bond is of.
    ends_of : Contacts
        Particles i < j, the lattice vector of j, and the sum of the radii.
    at_length, at_force : array
        Where each breaks; inf if it does not.
    broken : array
        Time at which each broke; inf of those that hold. What changes in a run.
    """

    forces: tuple[PairForce, ...]
    of: Integers
    ends_of: Contacts
    at_length: Array
    at_force: Array
    broken: Array
    made_by: tuple[str, ...] = ()
    rows: RowsOf = field(default_factory=RowsOf)

    takes = ("broken",)

    def pairs(self) -> tuple[Integers, Integers, Integers]:
        """See :class:`Mechanism`."""
        return self.ends_of.i, self.ends_of.j, self.ends_of.shift

    def central(self, system: System, contacts: Contacts, t: float, r: Array) -> tuple[Array, Array]:
        """See :class:`Mechanism`."""
        F, F_r = np.zeros(len(r)), np.zeros(len(r))
        for rows, _, (_, force, slope) in self._holding(contacts, r):
            F[rows] += force
            F_r[rows] += slope
        return F, F_r

    def central_energy(self, system: System, contacts: Contacts, t: float, r: Array) -> float:
        """See :class:`Mechanism`."""
        return float(sum(energy.sum() for _, _, (energy, _, _) in self._holding(contacts, r)))

    def powers(self, system: System, contacts: Contacts, at: Balance, rates: Rates) -> dict[str, float]:
        """The rate of the stored energy."""
        held = self._holding(contacts, at.r)
        return {ELASTIC: -float(sum(np.sum(force * rates.r[rows]) for rows, _, (_, force, _) in held))}

    def ends(self, system: System, state: State, at: Balance, when: float) -> float | None:
        """Length of a step at whose end the first bond breaks."""
        if not self._may_break():
            return None
        _, before = directions(state.contacts, state.x, lattice(state.box, state.t), state.walls)
        lengths = []
        for r in (before, at.r):
            load = np.zeros(len(self.of))
            for rows, bonds, (_, force, _) in self._holding(state.contacts, r):
                load[bonds] = np.maximum(r[rows] / self.at_length[bonds], -force / self.at_force[bonds])
            lengths.append(load)
        first, last = lengths
        beyond = np.flatnonzero(last > 1 + CLOSE)
        if not len(beyond):
            return None
        part = np.min((1 - first[beyond]) / (last[beyond] - first[beyond]))
        return (when - state.t) * max(float(part), SHORTEST)

    def note(self, system: System, state: State) -> bool:
        """Break what is stretched as far as it goes."""
        if not self._may_break():
            return False
        _, r = directions(state.contacts, state.x, lattice(state.box, state.t), state.walls)
        lost = 0.0
        breaking = []
        for rows, bonds, (energy, force, _) in self._holding(state.contacts, r):
            load = np.maximum(r[rows] / self.at_length[bonds], -force / self.at_force[bonds])
            gone = load >= 1 - CLOSE
            lost += float(energy[gone].sum())
            breaking.append(bonds[gone])
        now = np.concatenate(breaking) if breaking else np.empty(0, dtype=np.int64)
        self.broken[now] = state.t
        state.work["broken"] += lost
        state.work[ELASTIC] -= lost
        return bool(len(now))

    def marks(self) -> dict[str, Array]:
        """Times at which bonds broke."""
        return {"broken": self.broken}

    def columns(self, system: PreparedScene, frames: Sequence[Frame]) -> dict[str, NDArray[Any]]:
        """Length, tension and energy of the bonds in each frame; those that are broken have none."""
        count = len(self.of)
        r, pull, energies = np.full((len(frames), count), np.nan), np.zeros((len(frames), count)), np.zeros(len(frames))
        for k, frame in enumerate(frames):
            _, r[k] = directions(self.ends_of, frame.x, frame.cell, ())
            for number, force in enumerate(self.forces):
                mine = np.flatnonzero((self.of == number) & (self.broken > frame.t))
                energy, pushing, _ = force(r[k, mine], self.ends_of.S[mine])
                pull[k, mine] = -pushing
                energies[k] += float(energy.sum())
        ends = {"bond_i": self.ends_of.i, "bond_j": self.ends_of.j, "bond_shift": self.ends_of.shift}
        return {**ends, "bond_r": r, "bond_tension": pull, "bond_energy": energies, "bond_broken": self.broken.copy()}

    def stats(self) -> dict[str, Any]:
        """How many bonds there are, and how many broke."""
        return {"bonds": len(self.of), "bonds_broken": int(np.isfinite(self.broken).sum())}

    def untold(self) -> str:
        """Which bonds have broken."""
        return "its bonds are told as if none had broken: frames do not say which have" if self._may_break() else ""

    def _may_break(self) -> bool:
        return bool(np.isfinite(self.at_length).any() or np.isfinite(self.at_force).any())

    def _holding(self, contacts: Contacts, r: Array) -> list[tuple[Rows, Rows, tuple[Array, Array, Array]]]:
        """Of each entry the rows of its bonds that hold, their numbers, and energy, force and slope of each."""
        known = self.rows.known(contacts)
        if known is None:
            known = self.rows.keep(contacts, common(contacts, self.ends_of))
        rows, bonds = known
        found = []
        for number, force in enumerate(self.forces):
            mine = (self.of[bonds] == number) & np.isinf(self.broken[bonds])
            found.append((rows[mine], bonds[mine], force(r[rows[mine]], self.ends_of.S[bonds[mine]])))
        return found


def check(facts: ValidatedScene, faults: list[str]) -> Bonds | None:
    """Bonds of a scene."""
    before = len(faults)
    require_resistance(facts, "[[bond]]: bonds", faults)
    forces: list[PairForce] = []
    pairs: list[NDArray[np.int64]] = []
    limits: list[tuple[float, float]] = []
    for number, given in enumerate(facts.scene.bond):
        where = f"[[bond]] {number}"
        if not isinstance(given, Bond):
            faults.append(f"{where}: must be a Bond(...), not {given!r}")
            continue
        force = pair_force(facts, given.potential, given.parameters, where, faults)
        found = _pairs(facts, given.pairs, where, faults)
        if force is not None and found is not None:
            forces.append(force)
            pairs.append(found)
            at = (given.breaks_at_length, given.breaks_at_force)
            limits.append((math.inf if at[0] is None else float(at[0]), math.inf if at[1] is None else float(at[1])))
            if force.kernel.activities is not None:
                faults.append(f"{where}: {force.kernel.potential} has an activation, which is of pairs that come near")
    if len(faults) > before:
        return None
    every = np.concatenate([np.empty((0, 2), np.int64), *pairs])
    of = np.repeat(np.arange(len(pairs)), [len(some) for some in pairs])
    _require_once(every, faults)
    if len(faults) > before:
        return None
    order = np.lexsort((every[:, 1], every[:, 0]))
    every, of = every[order], of[order]
    shift = _nearest(facts, every)
    ends = bare_contacts(every[:, 0].astype(np.int32), every[:, 1].astype(np.int32), shift, facts.radii)
    lengths, tensions = (np.array([one[k] for one in limits])[of] for k in (0, 1))
    bonds = Bonds(
        tuple(forces), of, ends, lengths, tensions, np.full(len(of), np.inf), tuple(f.kernel.key for f in forces)
    )
    _require_possible(facts, bonds, faults)
    return bonds


def _pairs(facts: ValidatedScene, given: Any, where: str, faults: list[str]) -> NDArray[np.int64] | None:
    """Numbers of the particles that are bonded, the smaller first, shape (bonds, 2)."""
    if given == CHAINS:
        faults.append(f'{where} pairs = "{CHAINS}" are those of chains that are generated: give [chains]')
        return None
    try:
        pairs = np.array(given)
    except ValueError:
        pairs = np.empty(0)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or not len(pairs) or pairs.dtype.kind not in "iu":
        faults.append(f'{where} pairs must be a list of pairs of whole numbers, or "{CHAINS}", not {str(given)[:80]}')
        return None
    count = len(facts.x)
    for one, other in pairs:
        missing = [int(end) for end in (one, other) if not 0 <= end < count]
        if missing:
            faults.append(f"{where}: there is no particle {missing[0]}; they are numbered 0 to {count - 1}")
            return None
        if one == other:
            faults.append(f"{where}: particle {one} is bonded to itself")
            return None
    return np.sort(pairs.astype(np.int64), axis=1)


def _require_once(every: NDArray[np.int64], faults: list[str]) -> None:
    unique, counts = np.unique(every, axis=0, return_counts=True)
    twice = unique[counts > 1]
    if len(twice):
        i, j = twice[0]
        more = f"; and {len(twice) - 1} pairs more" if len(twice) > 1 else ""
        faults.append(f"[[bond]]: particles {i} and {j} are bonded twice{more}")


def _nearest(facts: ValidatedScene, every: NDArray[np.int64]) -> NDArray[np.int64]:
    """Lattice vectors by which the second particles are displaced to the image that is nearest to the first."""
    d = facts.x.shape[1]
    cell, periodic = lattice(facts.box, 0.0), facts.box.periodic
    along = facts.x[every[:, 1]] - facts.x[every[:, 0]]
    if not periodic.any():
        return np.zeros((len(every), d), dtype=np.int64)
    loose = np.diag(np.where(periodic, 0.0, 1.0))
    middle = -np.rint(np.linalg.solve(cell + loose, along.T).T) * periodic
    best, shift = np.full(len(every), np.inf), np.zeros((len(every), d))
    # in a box that leans the nearest image may be next to the one that rounding finds
    for step in itertools.product(*((-1, 0, 1) if repeats else (0,) for repeats in periodic)):
        trial = middle + np.array(step)
        away = np.linalg.norm(along + trial @ cell.T, axis=1)
        closer = away < best * (1 - 1e-12)
        best[closer], shift[closer] = away[closer], trial[closer]
    return shift.astype(np.int64)


def _require_possible(facts: ValidatedScene, bonds: Bonds, faults: list[str]) -> None:
    """At the start bonds have finite forces, and are not to break at once."""
    ends = bonds.ends_of
    with np.errstate(all="ignore"):
        _, r = directions(ends, facts.x, lattice(facts.box, 0.0), ())
    for number, force in enumerate(bonds.forces):
        mine = np.flatnonzero(bonds.of == number)
        with np.errstate(all="ignore"):
            values = np.array(force(r[mine], ends.S[mine]))
        bad = mine[~np.isfinite(values).all(axis=0)]
        load = np.maximum(r[mine] / bonds.at_length[mine], -values[1] / bonds.at_force[mine])
        torn = mine[load >= 1 - CLOSE]
        name = force.kernel.potential
        for those, words in ((bad, f"beyond the distances at which {name} holds"), (torn, "where the bond breaks")):
            if len(those):
                b = int(those[0])
                more = f"; and {len(those) - 1} bonds more" if len(those) > 1 else ""
                faults.append(
                    f"[[bond]] {number}: particles {ends.i[b]} and {ends.j[b]} are {r[b]:.6g} apart at the start, "
                    f"{words}{more}"
                )
