"""Warnings of films that are pulled: what a result tells of surfaces that flow or forces draw apart.

Laws are checked where surfaces are pressed, and, but for those with a branch of their own for delta < 0, meant for
these alone: a film that is held shut where a real one opens makes a stretched solid of a sheared emulsion.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.observables import is_periodic, pressure

if TYPE_CHECKING:
    from softdyn.particles.results import ParticleResult

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

MEANT = "a law that is meant for pressed surfaces, as rognon_gay,"
REMEDY = "a law with a branch of its own for them (equal_spheres, droplet, steric), a stiffer one, a slower flow"


def pulled_films(result: ParticleResult) -> Iterator[str]:
    """Words of warning, once for each kind: where it begins among the frames of a result, and where it is worst.

    Three kinds are told:

    - a surface is pulled by more than a tenth of the smaller radius, in any run;
    - of MANY contacts and more, pulled films bear more than a fifth of the sum of abs(F). Only films narrowed by the
      pull count (see NARROWED): nearly rigid spheres in a flow, whose surfaces stay as they are, pull on one another
      as much as they press, and no film is held shut;
    - the pressure is negative, on average over the second half of the frames of a flow in a periodic box: not at its
      start, where contacts that part bear as much as those that meet.
    """
    if not len(result):
        return
    yield from _stretched(result)
    yield from _tension(result)


def _contact(result: ParticleResult, c: int) -> str:
    i, j, count = int(result.contact_i[c]), int(result.contact_j[c]), len(result.radii)
    return f"particles {i} and {j}" if j < count else f"particle {i} and wall {j - count}"


def _stretched(result: ParticleResult) -> Iterator[str]:
    """Of single surfaces."""
    radii, j = result.radii, result.contact_j
    smaller = np.minimum(radii[result.contact_i], np.append(radii, np.inf)[np.minimum(j, len(radii))])
    relative = -result.contact_delta / smaller
    found = np.flatnonzero(relative > PULLED)
    if not len(found):
        return
    frames = np.searchsorted(result.contact_start, found, side="right") - 1
    k = int(np.argmax(relative[found]))
    worst, when, first = int(found[k]), result.t[frames[k]], result.t[frames[0]]
    begin = f"first above {PULLED:g} at t={first:.6g}, for {_contact(result, int(found[0]))}"
    who = f"the contact of {_contact(result, worst)} is pulled to a deflection of {relative[worst]:.3g} radii"
    if relative[worst] > TORN:
        yield (
            f"{who} at t={when:.6g}, where no law of contacts holds ({begin}): use weaker forces, slower flow, a "
            "stiffer law, or a shorter range of contacts"
        )
    else:
        yield (
            f"{who} at t={when:.6g} ({begin}): laws of contacts are for small deflections, and {MEANT} holds pulled "
            f"films shut; use {REMEDY}, or a shorter range of contacts"
        )


def _tension(result: ParticleResult) -> Iterator[str]:
    """Of many contacts together."""
    start, F = result.contact_start, result.contact_F
    numbers = np.diff(start)
    many = numbers >= MANY
    if not many.any():
        return
    drawn = (F < 0) & (-result.contact_delta > NARROWED * result.contact_h)
    sizes = _sums(np.abs(F), start)
    pulled = _sums(np.where(drawn, -F, 0.0), start)
    share = np.divide(pulled, sizes, out=np.zeros(len(sizes)), where=many & (sizes > 0))
    over = np.flatnonzero(share > SHARE)
    if len(over):
        worst = int(np.argmax(share))
        part = slice(start[worst], start[worst + 1])
        c = int(start[worst]) + int(np.argmin(np.where(drawn[part], F[part], np.inf)))
        yield (
            f"pulled films bear {share[worst]:.2g} of the sum of all abs(F) at t={result.t[worst]:.6g}, most of it "
            f"that of {_contact(result, c)} (first above {SHARE:g} at t={result.t[over[0]]:.6g}): laws are least "
            f"certain there, and {MEANT} makes a stretched solid of what flows; use {REMEDY}"
        )
    flowing = result.gradient.any(axis=(1, 2))
    late = np.flatnonzero(flowing & many & (np.arange(len(result)) >= len(result) / 2))
    if not is_periodic(result) or not len(late):
        return
    p = pressure(result)
    if p[late].mean() < -1e-9 * np.abs(p[late]).mean():
        shown = np.flatnonzero(flowing & many & (p < 0))
        worst = int(shown[np.argmin(p[shown])])
        part = slice(start[worst], start[worst + 1])
        c = int(start[worst]) + int(np.argmin(F[part]))
        yield (
            f"the pressure is negative under shear, {p[worst]:.3g} at t={result.t[worst]:.6g}, where the contact of "
            f"{_contact(result, c)} pulls most (first at t={result.t[shown[0]]:.6g}): pulled films hold together what "
            f"flows, as {MEANT} makes them; use {REMEDY}, or a longer run if it has just started"
        )


def _sums(values: Array, start: NDArray[np.int64]) -> Array:
    """Sum over the contacts of each frame."""
    total = np.concatenate([[0.0], np.cumsum(values)])
    sums: Array = total[start[1:]] - total[start[:-1]]
    return sums
