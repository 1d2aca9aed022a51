"""Potentials: remote forces between pairs of particles, of all or of two species, within a cut-off.

Energy and force are shifted, so that both end at the cut-off r_c without a jump, U(r) - U(r_c) + (r - r_c) F(r_c) and
F(r) - F(r_c). A potential that is declared with an activation has it as a factor: what that gives, or takes, is in the
balance as ``activation``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.driven import given_function
from softdyn.particles.energy import ELASTIC
from softdyn.particles.geometry import Box, Contacts, bare_contacts, directions, find_pairs, lattice
from softdyn.particles.mechanisms import Mechanism
from softdyn.particles.names import ALL
from softdyn.particles.pair_forces import POTENTIAL, PairForce, Rows, RowsOf, pair_force, require_resistance
from softdyn.particles.potential_kernels import activities
from softdyn.scene.keys import Key, with_keys
from softdyn.scene.kinds import NUMBERS_BY_NAME, POSITIVE, Kind
from softdyn.words import suggestion

if TYPE_CHECKING:
    from softdyn.particles.energy import Rates
    from softdyn.particles.force_balance import Balance
    from softdyn.particles.results import Frame
    from softdyn.particles.state import State
    from softdyn.particles.system import PreparedScene, System, ValidatedScene
    from softdyn.particles.time_functions import TimeFunction

Array = NDArray[np.float64]

BETWEEN = Kind(
    "a list of two names of species",
    {"type": "array", "items": {"type": "string"}, "minItems": 2, "maxItems": 2},
)
#: Particles up to this many may all act on one another without a cut-off.
MOST_WITHOUT_CUT_OFF = 64


@with_keys
@dataclass(frozen=True)
class PairPotential:
    """A remote force between pairs of particles."""

    potential: Annotated[
        Any, Key("[[potential]] potential", POTENTIAL, "The potential: softdyn potentials lists the stock ones.")
    ]
    parameters: Annotated[
        Mapping[str, float],
        Key("[[potential]] parameters", NUMBERS_BY_NAME, "A value for each parameter of the potential."),
    ] = field(default_factory=dict)
    cut_off: Annotated[
        float | None,
        Key(
            "[[potential]] cut_off",
            POSITIVE,
            "Distance of the centres beyond which there is no force; energy and force are shifted to end there without "
            "a jump. Periodic boxes, and more than 64 particles, need it.",
            "length",
        ),
    ] = None
    between: Annotated[
        Sequence[str] | None,
        Key("[[potential]] between", BETWEEN, "Two species whose particles it acts between; all pairs without."),
    ] = None


@dataclass(frozen=True)
class OnePotential:
    """One of the potentials of a scene.

    Attributes
    ----------
    force : PairForce
    cut : float
        Its cut-off, or inf.
    species : tuple of (int, int), optional
        Numbers of the species that it acts between.
    column : int
        Of ``Contacts.since``; -1 without an activation.
    rows : RowsOf
    """

    force: PairForce
    cut: float
    species: tuple[int, int] | None
    column: int
    rows: RowsOf = field(default_factory=RowsOf)


@dataclass(frozen=True)
class Potentials(Mechanism):
    """The potentials of a scene.

    Attributes
    ----------
    every : tuple of OnePotential
    sheared : TimeFunction, optional
        The shear rate of the background flow, where an activation may depend on it.
    local : array, shape (N,), optional
        Instead, the shear rate where each particle is; a pair has the mean of the two.
    """

    every: tuple[OnePotential, ...]
    sheared: TimeFunction | None = None
    local: Array | None = None
    farthest: float = 0.0
    timed: int = 0
    made_by: tuple[str, ...] = ()

    gives = ("activation",)

    def central(self, system: System, contacts: Contacts, t: float, r: Array) -> tuple[Array, Array]:
        """See :class:`Mechanism`."""
        F, F_r = np.zeros(len(r)), np.zeros(len(r))
        for one in self.every:
            near, _, force, slope = self._near(system, one, contacts, r)
            factor, _ = self._active(system, one, contacts, near, t)
            F[near] += factor * force
            F_r[near] += factor * slope
        return F, F_r

    def central_energy(self, system: System, contacts: Contacts, t: float, r: Array) -> float:
        """See :class:`Mechanism`."""
        total = 0.0
        for one in self.every:
            near, energy, _, _ = self._near(system, one, contacts, r)
            total += float(np.sum(self._active(system, one, contacts, near, t)[0] * energy))
        return total

    def powers(self, system: System, contacts: Contacts, at: Balance, rates: Rates) -> dict[str, float]:
        """What the activations give; and the rate of the stored energy."""
        stored, given = 0.0, 0.0
        for one in self.every:
            near, energy, force, _ = self._near(system, one, contacts, at.r)
            factor, by_time = self._active(system, one, contacts, near, rates.t)
            stored -= float(np.sum(factor * force * rates.r[near]))
            given += float(np.sum(by_time * energy))
        return {"activation": given, ELASTIC: stored + given}

    def note(self, system: System, state: State) -> bool:
        """Since when pairs are within the cut-off."""
        if self.timed:
            _, r = directions(state.contacts, state.x, lattice(state.box, state.t), state.walls)
            for one in self.every:
                if one.column >= 0:
                    near = np.zeros(len(r), dtype=bool)
                    near[self._near(system, one, state.contacts, r)[0]] = True
                    since = state.contacts.since[:, one.column]
                    since[near & np.isinf(since)] = state.t
                    since[~near] = np.inf
        return False

    def columns(self, system: PreparedScene, frames: Sequence[Frame]) -> dict[str, NDArray[Any]]:
        """Energy of the potentials in each frame, without their activation."""
        if self.timed:
            return {}
        energies = np.zeros(len(frames))
        for k, frame in enumerate(frames):
            within = max(self.farthest - 2 * float(system.radii.min()), 0.0)
            box = replace(system.box, tilt=0.0, shear_rate=0.0, stretch=None)
            contacts = _pairs(frame.x, system.radii, box, frame.cell, within)
            _, r = directions(contacts, frame.x, frame.cell, ())
            for one in self.every:
                energies[k] += float(np.sum(self._near(system, one, contacts, r)[1]))
        return {"potential_energy": energies}

    def _near(
        self, system: PreparedScene, one: OnePotential, contacts: Contacts, r: Array
    ) -> tuple[Rows, Array, Array, Array]:
        """Pairs within the cut-off; energy, force and its slope of each, shifted."""
        rows = one.rows.known(contacts)
        if rows is None:
            rows = one.rows.keep(contacts, _rows_of(system, one, contacts))
        near = rows[r[rows] < one.cut] if math.isfinite(one.cut) else rows
        U, F, F_r = one.force(r[near], contacts.S[near])
        if math.isfinite(one.cut):
            U_cut, F_cut, _ = one.force(np.full(len(near), one.cut), contacts.S[near])
            U, F = U - U_cut + (r[near] - one.cut) * F_cut, F - F_cut
        return near, U, F, F_r

    def _active(
        self, system: System, one: OnePotential, contacts: Contacts, near: Rows, t: float
    ) -> tuple[Array, Array]:
        """Activation of some pairs, and its rate."""
        if one.column < 0:
            return np.ones(len(near)), np.zeros(len(near))
        since = contacts.since[near, one.column]
        age = np.maximum(t - since, 0.0)  # 0 of pairs that come near within the step
        rate: float | Array = system.box.shear_rate
        if self.local is not None:
            rate = (self.local[contacts.i[near]] + self.local[contacts.j[near]]) / 2
        factor, by_age = activities(one.force.kernel, one.force.p, rate, age)
        by_age = np.where(np.isinf(since), 0.0, by_age)
        if self.local is not None or self.sheared is None or self.sheared.constant:
            return factor, by_age
        rate = system.box.shear_rate
        slope = self.sheared.rate(t)
        small = 1e-6 * abs(rate) or 1e-6
        up, _ = activities(one.force.kernel, one.force.p, abs(rate) + small, age)
        down, _ = activities(one.force.kernel, one.force.p, abs(rate) - small, age)
        return factor, by_age + (up - down) / (2 * small) * slope * np.sign(rate)


def _rows_of(system: PreparedScene, one: OnePotential, contacts: Contacts) -> Rows:
    """Pairs of particles of the right species."""
    pair = contacts.j < len(system.radii)
    if one.species is not None:
        a, b = one.species
        j = np.where(pair, contacts.j, contacts.i)
        first, second = system.species[contacts.i], system.species[j]
        pair &= ((first == a) & (second == b)) | ((first == b) & (second == a))
    return np.flatnonzero(pair)


def _pairs(x: Array, radii: Array, box: Box, cell: Array, within: float) -> Contacts:
    """Pairs of particles in a box with these lattice vectors, whose surfaces are within a distance."""
    periodic = box.periodic
    lengths = np.where(periodic, np.diag(cell), np.inf)
    here = replace(box, lengths=lengths, tilt=float(cell[0, 1]) if len(cell) > 1 else 0.0)
    return bare_contacts(*find_pairs(x, radii, here, 0.0, (), within), radii)


def check(facts: ValidatedScene, faults: list[str]) -> Potentials | None:
    """Potentials of a scene."""
    scene, before = facts.scene, len(faults)
    require_resistance(facts, "[[potential]]: remote forces", faults)
    every: list[OnePotential] = []
    timed = 0
    for number, given in enumerate(scene.potential):
        where = f"[[potential]] {number}"
        if not isinstance(given, PairPotential):
            faults.append(f"{where}: must be a PairPotential(...), not {given!r}")
            continue
        force = pair_force(facts, given.potential, given.parameters, where, faults)
        cut = _cut_off(facts, given, where, faults)
        species = _species(facts, given, where, faults)
        if force is not None:
            active = force.kernel.activities is not None
            every.append(OnePotential(force, cut, species, timed if active else -1))
            timed += active
    if len(faults) > before:
        return None
    if timed and (scene.stress.get("xy") is not None):
        faults.append(
            "[[potential]]: an activation needs a shear rate that is given, and an imposed shear stress gives none: "
            "use [flow] shear_rate"
        )
        return None
    sheared = given_function(scene, scene.shear_rate, "[flow] shear_rate") if timed else None
    keys = tuple(one.force.kernel.key for one in every)
    found = Potentials(tuple(every), sheared, None, max((one.cut for one in every), default=0.0), timed, keys)
    _require_finite(facts, found, faults)
    return found


def _cut_off(facts: ValidatedScene, given: PairPotential, where: str, faults: list[str]) -> float:
    if given.cut_off is not None:
        return float(given.cut_off)
    if facts.box.periodic.any():
        faults.append(f"{where} cut_off is missing: in a periodic box a potential needs one")
    elif len(facts.x) > MOST_WITHOUT_CUT_OFF:
        faults.append(f"{where} cut_off is missing: {len(facts.x)} particles are too many to act on all others")
    return math.inf


def _species(facts: ValidatedScene, given: PairPotential, where: str, faults: list[str]) -> tuple[int, int] | None:
    if given.between is None:
        return None
    names = list(given.between) if isinstance(given.between, (list, tuple)) else []
    if len(names) != 2:
        faults.append(f"{where} between needs two names of species, not {given.between!r}")
        return None
    unknown = [name for name in names if name not in facts.names]
    if unknown:
        known = ", ".join(map(repr, (name for name in facts.names if name))) or "none ([particles] species)"
        faults.append(
            f"{where} between: there is no species {unknown[0]!r}{suggestion(unknown[0], facts.names)}; there are "
            f"{known}; for {ALL} pairs leave it out"
        )
        return None
    return facts.names.index(names[0]), facts.names.index(names[1])


def _require_finite(facts: ValidatedScene, found: Potentials, faults: list[str]) -> None:
    """At the start each potential has a finite force."""
    apart = found.farthest - 2 * float(facts.radii.min())
    i, j, shift = find_pairs(facts.x, facts.radii, facts.box, 0.0, (), max(apart, 0.0))
    contacts = bare_contacts(i, j, shift, facts.radii)
    with np.errstate(divide="ignore", invalid="ignore"):
        _, r = directions(contacts, facts.x, lattice(facts.box, 0.0), ())
    for number, one in enumerate(found.every):
        name = one.force.kernel.potential
        if math.isfinite(one.cut) and not all(
            np.isfinite(values).all() for values in one.force(np.array([one.cut]), np.array([2 * facts.radii.min()]))
        ):
            faults.append(f"[[potential]] {number} cut_off = {one.cut:g}: there {name} has no finite force")
            continue
        rows = _rows_of(facts, one, contacts)  # type: ignore[arg-type]
        rows = rows[~(r[rows] >= one.cut)]
        with np.errstate(all="ignore"):
            values = one.force(r[rows], contacts.S[rows])
        bad = rows[~np.isfinite(np.array(values)).all(axis=0)]
        if len(bad):
            c = int(bad[0])
            more = f"; and {len(bad) - 1} pairs more" if len(bad) > 1 else ""
            faults.append(
                f"[[potential]] {number}: {name} has no finite force between particles {i[c]} and {j[c]}, which are "
                f"{r[c]:.6g} apart{more}: place them elsewhere, or leave them out"
            )
