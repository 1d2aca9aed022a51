"""Warnings of films that are pulled: what a result tells of surfaces that flow or forces draw apart.

Laws are checked where surfaces are pressed, and, but for those with a branch of their own for delta < 0, meant for
these alone: a film that is held shut where a real one opens makes a stretched solid of a sheared emulsion.

The end of every step is looked at, and every frame. Three kinds are told, once each: where it begins, and where it is
worst:

- a surface is pulled by more than a tenth of the smaller radius, in any run;
- of MANY contacts and more, pulled films bear more than a fifth of the sum of abs(F). Only films narrowed by the pull
  count (see NARROWED): nearly rigid spheres in a flow, whose surfaces stay as they are, pull on one another as much as
  they press, and no film is held shut;
- the pressure is negative, on average over the second half of the time of a flow in a periodic box: not at its start,
  where contacts that part bear as much as those that meet.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from softdyn.particles.force_balance import Balance
    from softdyn.particles.geometry import Contacts
    from softdyn.particles.system import System

Array = NDArray[np.float64]

#: Deflection, over the smaller radius, from which a pulled surface is told of; and from which no law holds.
PULLED, TORN = 0.1, 1.0
#: Part of the sum of all abs(F) that is borne by pulled films, from which it is told of.
SHARE = 0.2
#: Deflection of each surface over the gap from which a pulled film counts: friction is some 40 % less there than that
#: of round surfaces. Below, the suction between spheres in a flow is no less than their pressure, and rightly so.
NARROWED = 0.25
#: A share, or a pressure, is one of so many contacts at least: few pull as often as they press in any flow, and what
#: pulls on a pair may be wanted.
MANY = 10
#: Of the mean size of a pressure: less than that below zero is rounding.
ROUNDING = 1e-9

MEANT = "a law that is meant for pressed surfaces, as rognon_gay,"
REMEDY = "a law with a branch of its own for them (equal_spheres, droplet, steric), a stiffer one, a slower flow"


@dataclass
class Pulled:
    """What the steps of a run have had of pulled films; plain numbers and words, for checkpoints.

    Attributes
    ----------
    kinds : dict
        By kind, "stretched", "share" and "tension": the time and the particles of the first, and the size, the time and
        the particles of the worst.
    pressures : list of tuple
        Time, length and pressure of each step of a flow of many contacts in a periodic box.
    """

    kinds: dict[str, dict[str, Any]] = field(default_factory=dict)
    pressures: list[tuple[float, float, float]] = field(default_factory=list)

    def note(self, kind: str, size: float, t: float, who: str) -> None:
        """Keep what is the first or the worst of its kind.

        Parameters
        ----------
        kind : str
            Of what is told.
        size : float
            Of two, the larger is worse.
        t : float
        who : str
            The contact, in words.
        """
        found = self.kinds.setdefault(kind, {"first": t, "for": who, "size": size, "t": t, "who": who})
        if size > found["size"]:
            found.update(size=size, t=t, who=who)


class At(NamedTuple):
    """Distances of the centres, gaps and forces of all contacts, as a ``Balance`` has them."""

    r: Array
    h: Array
    F: Array


def look(pulled: Pulled, system: System, contacts: Contacts, t: float, dt: float, at: At | Balance) -> None:
    """Look at the contacts at the end of a step of the length dt, or at an output within one, for which dt is 0.

    Pulled surfaces have a negative force: only these are looked at closely.

    Parameters
    ----------
    pulled : Pulled
        To which is added what is found.
    system : System
    contacts : Contacts
    t, dt : float
    at : At or Balance
        Of the contacts at the time t.
    """
    drawn = (at.F < 0).nonzero()[0]
    flows = bool(system.box.periodic.all()) and bool(system.box.shear_rate or system.box.stretch is not None)
    if not len(drawn) and not flows:
        return
    count, h, F = len(system.radii), at.h[drawn], at.F[drawn]
    delta = (contacts.S[drawn] - at.r[drawn] + h) / 2
    if len(drawn) and delta.min() < -PULLED * system.radii.min():
        smaller = np.append(system.radii, np.inf)[np.minimum(contacts.j[drawn], count)]
        relative = -delta / np.minimum(system.radii[contacts.i[drawn]], smaller)
        k = int(np.argmax(relative))
        if relative[k] > PULLED:
            pulled.note("stretched", float(relative[k]), t, _named(contacts, int(drawn[k]), count))
    if np.count_nonzero(at.h < system.reach) < MANY:
        return
    narrowed = np.where(-delta > NARROWED * h, -F, 0.0)
    total = float(at.F.sum() - 2 * F.sum())
    share = float(narrowed.sum()) / total if total > 0 else 0.0
    if share > SHARE:
        pulled.note("share", share, t, _named(contacts, int(drawn[np.argmax(narrowed)]), count))
    if flows:
        # tangential forces are normal to the line of the centres: they add nothing to the trace
        pressure = float(at.F @ at.r) / (len(system.box.lengths) * system.box.volume)
        pulled.pressures.append((t, dt, pressure))
        if pressure < 0:
            pulled.note("tension", -pressure, t, _named(contacts, int(np.argmin(at.F)), count))


def _named(contacts: Contacts, c: int, count: int) -> str:
    i, j = int(contacts.i[c]), int(contacts.j[c])
    return f"particles {i} and {j}" if j < count else f"particle {i} and wall {j - count}"


def pulled_films(pulled: Pulled) -> Iterator[str]:
    """Words of warning, once for each kind."""
    kinds = pulled.kinds
    if "stretched" in kinds:
        yield _stretched(kinds["stretched"])
    if "share" in kinds:
        worst = kinds["share"]
        yield (
            f"pulled films bear {worst['size']:.2g} of the sum of all abs(F) at t={worst['t']:.6g}, most of it that of "
            f"{worst['who']} (first above {SHARE:g} at t={worst['first']:.6g}): laws are least certain there, and "
            f"{MEANT} makes a stretched solid of what flows; use {REMEDY}"
        )
    if "tension" in kinds and _holds_together(pulled.pressures):
        worst = kinds["tension"]
        yield (
            f"the pressure is negative under shear, {-worst['size']:.3g} at t={worst['t']:.6g}, where the contact of "
            f"{worst['who']} pulls most (first at t={worst['first']:.6g}): pulled films hold together what flows, as "
            f"{MEANT} makes them; use {REMEDY}, or a longer run if it has just started"
        )


def _stretched(worst: Mapping[str, Any]) -> str:
    size, begin = worst["size"], f"first above {PULLED:g} at t={worst['first']:.6g}, for {worst['for']}"
    who = f"the contact of {worst['who']} is pulled to a deflection of {size:.3g} radii at t={worst['t']:.6g}"
    if size > TORN:
        return (
            f"{who}, where no law of contacts holds ({begin}): use weaker forces, slower flow, a stiffer law, or a "
            "shorter range of contacts"
        )
    return (
        f"{who} ({begin}): laws of contacts are for small deflections, and {MEANT} holds pulled films shut; use "
        f"{REMEDY}, or a shorter range of contacts"
    )


def _holds_together(pressures: list[tuple[float, float, float]]) -> bool:
    """Whether the mean pressure of the second half of the time is negative."""
    t, dt, p = np.array(pressures).T
    late = np.where(t > t[-1] / 2, dt, 0.0)
    return bool(late @ p < -ROUNDING * (late @ np.abs(p)))
