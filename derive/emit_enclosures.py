"""The text of the functions that enclose expressions of time, for each target."""

from __future__ import annotations

import softdyn
from softdyn.derive.emit import render_part
from softdyn.derive.translate import to_c


def emit_enclosures(target: str) -> str:
    """Source text for a target, "c" or "numba"."""
    body = render_part("common/enclosures.py.j2", {})
    text = to_c(body) if target == "c" else body
    template = "c/enclosures.c.j2" if target == "c" else "numba/enclosures.py.j2"
    return render_part(template, {"version": softdyn.__version__, "body": text.rstrip()})
