"""Proof or refutation of the limits that a potential claims, by the prover of laws and closures.

Input: a potential. Output: findings as those of a closure (:mod:`softdyn.derive.closure_limits`).
"""

from __future__ import annotations

from itertools import pairwise

from sympy import Dummy, Expr, S, Symbol

from softdyn.derive.asymptotics import OutOfEffortError
from softdyn.derive.checks import chains
from softdyn.derive.closure_limits import Known, Ordered, finding_of
from softdyn.derive.dimensions import LENGTH
from softdyn.derive.law import Limit
from softdyn.derive.limits import EFFORT, Findings
from softdyn.derive.patience import within
from softdyn.derive.positive import knowing_ranges
from softdyn.derive.potential import (
    Potential,
    claimed_of,
    dimensions_for,
    distance_from,
    force_of,
    r,
    ranges_of,
    sample_values,
)


def ordered(limit: Limit) -> Ordered:
    """Return the ordering of a limit: a difference of r and a distance becomes a symbol, in which r is written."""
    written: dict[Symbol, Expr] = {}
    replaced: dict[Symbol, Expr] = {}
    pairs = []
    for chain in chains(limit):
        sizes = []
        for member in map(S, chain):
            rest = distance_from(member)
            if rest is None:
                sizes.append(member)
                continue
            gap = next((symbol for symbol, known in written.items() if known == member), Dummy("gap", positive=True))
            written[gap] = member
            replaced[r] = rest + member.diff(r) * gap
            sizes.append(gap)
        pairs += list(pairwise(sizes))
    return Ordered(tuple(pairs), written, replaced, r, LENGTH)


def check_potential_limits(potential: Potential, effort: int = EFFORT) -> Findings:
    """Prove or disprove every limit that a potential claims.

    Parameters
    ----------
    potential : Potential
    effort : int
        Operations after which claims that are not yet decided are left undecided.
    """
    found, follows = Findings(), force_of(potential)
    known = Known(dimensions_for(potential), sample_values(potential))
    with within(effort, OutOfEffortError), knowing_ranges(ranges_of(potential)):
        for limit in potential.limits:
            order = ordered(limit)
            for quantity, claimed in limit.claims.items():
                about = claimed_of(quantity)
                assert about is not None
                sides = [x.xreplace(order.replaced) for x in (about.subs(follows), S(claimed))]
                found.append(finding_of(known, limit, order, str(quantity), claimed, (sides[0], sides[1])))
    return found
