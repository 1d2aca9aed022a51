"""What the arrays of a pair kernel's integrator hold, by name: the runtime reads them so, and headers name them so."""

from __future__ import annotations

#: State of a run: see ``NAME_integrate``.
STATE = (
    "t",
    "u",
    "delta",
    "step",
    "accepted",
    "rejected",
    "iterations",
    "single_rates",
    "segment",
    "recorded",
    "fastest",
    "settled",
    "longest",
    "in_gap",
    "steps_in_gap",
    "error_u",
    "error_delta",
    "unresolved",
    "unresolved_from",
    "shortened",
)
#: Place of each.
AT = {name: place for place, name in enumerate(STATE)}
#: Settings of many runs, and what stands before the parameters of each: see ``NAME_runs``.
SETTINGS = ("rtol", "start", "longest", "most_steps", "in_gap")
RUN = ("t_end", "u_stop", "u", "delta")
