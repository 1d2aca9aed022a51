"""From the contact kernel's intermediate representation to the text of a target."""

from __future__ import annotations

from softdyn.derive.contact_kernel import ContactIR
from softdyn.derive.emit import render_body, render_template
from softdyn.derive.translate import to_c

#: Contacts that go together; wide enough for any machine's vectors, and for the latency of divisions.
LANES = 16


def emit_contacts(ir: ContactIR, target: str) -> str:
    """Source text of the contact kernel for a target, "c" or "numba"."""
    body = render_body("common/contacts.py.j2", ir, {"lanes": LANES})
    if target == "c":
        return render_template("c/contacts.c.j2", ir, to_c(body).rstrip())
    return render_template("numba/contacts.py.j2", ir, body)
