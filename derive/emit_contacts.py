"""From the contact kernel's intermediate representation to the text of a target."""

from __future__ import annotations

from softdyn.derive.contact_kernel import ContactIR
from softdyn.derive.elementary import constants, nested, used_functions
from softdyn.derive.emit import render_body, render_part, render_template, with_special
from softdyn.derive.translate import to_c

#: Contacts that go together; wide enough for any machine's vectors, and for the latency of divisions.
LANES = 16


def emit_contacts(ir: ContactIR, target: str) -> str:
    """Source text of the contact kernel for a target, "c" or "numba"."""
    body = with_special(render_body("common/contacts.py.j2", ir, {"lanes": LANES}))
    text = with_functions(body, target).rstrip()
    return render_template("c/contacts.c.j2" if target == "c" else "numba/contacts.py.j2", ir, text)


def with_functions(body: str, target: str) -> str:
    """Text for a target of a body in the shared subset of Python, behind the elementary functions that it calls."""
    used = used_functions(body)
    if not used:
        return to_c(body) if target == "c" else body
    numbers = {**constants(), "used": used, "nested": nested}
    body = render_part("common/elementary.py.j2", numbers) + "\n\n" + body
    bits = render_part("c/bits.c.j2" if target == "c" else "numba/bits.py.j2", numbers)
    return f"{bits}\n{to_c(body)}" if target == "c" else f"{bits}\n\n{body}"
