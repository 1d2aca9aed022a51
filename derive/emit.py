"""From a kernel's intermediate representation to the text of a target.

Input: a :class:`KernelIR`. Output: source text, which imports and includes nothing of softdyn's.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING

from jinja2 import DictLoader, Environment, StrictUndefined

import softdyn
from softdyn.derive.elementary import nested
from softdyn.derive.kernel import KernelIR, total_operations
from softdyn.derive.printing import KINDS
from softdyn.derive.radau import PANEL_NODES, blindness, radau_iia
from softdyn.derive.special import calls_special, constants

if TYPE_CHECKING:
    from softdyn.derive.contact_kernel import ContactIR

TARGETS = ("c", "numba")
TEMPLATES = (
    "common/kernel.py.j2",
    "common/contact.py.j2",
    "common/stages.py.j2",
    "common/quadrature.py.j2",
    "common/collocation.py.j2",
    "common/outputs.py.j2",
    "c/kernel.c.j2",
    "numba/kernel.py.j2",
    *("common/contacts.py.j2", "c/contacts.c.j2", "numba/contacts.py.j2"),
    *("common/enclosure.py.j2", "common/enclosures.py.j2", "c/enclosures.c.j2", "numba/enclosures.py.j2"),
    "common/special.py.j2",
    *("common/elementary.py.j2", "c/bits.c.j2", "numba/bits.py.j2"),
)


def emit(ir: KernelIR, target: str) -> str:
    """Source text of a kernel for a target, "c" or "numba"."""
    return importlib.import_module(f"softdyn.derive.targets.{target}").render(ir)


def suffix(target: str) -> str:
    """Ending of a target's files."""
    return importlib.import_module(f"softdyn.derive.targets.{target}").SUFFIX


@cache
def _environment() -> Environment:
    folder = files("softdyn.templates")
    texts = {name: folder.joinpath(*name.split("/")).read_text(encoding="utf-8") for name in TEMPLATES}
    return Environment(loader=DictLoader(texts), undefined=StrictUndefined, keep_trailing_newline=True)


def kernel_body(ir: KernelIR) -> str:
    """The algorithms of a kernel in the subset of Python that all targets share."""
    more = {"radau": radau_iia(), "panel": radau_iia(PANEL_NODES), "blind": blindness()}
    return with_special(render_body("common/kernel.py.j2", ir, more))


def with_special(body: str) -> str:
    """A body in the subset of Python that all targets share, behind the special functions that it calls."""
    if not calls_special(body):
        return body
    return render_part("common/special.py.j2", {**constants(), "nested": nested}) + "\n\n" + body


def render_body(name: str, ir: KernelIR | ContactIR, more: Mapping[str, object]) -> str:
    """Text of a template of algorithms, which sees the representation and a few values more."""
    return render_part(name, {"ir": ir, **more})


def render_part(name: str, values: Mapping[str, object]) -> str:
    """Text of a template that is no whole file."""
    text = _environment().get_template(name).render(**values)
    return "\n".join(line.rstrip() for line in text.strip().splitlines()) + "\n"


def render_template(name: str, ir: KernelIR | ContactIR, body: str) -> str:
    """Wrap a kernel's body into a target's template."""
    # what the law's author wrote must end neither a comment nor a docstring
    safe = header(ir).replace("*/", "* /").replace("\\", "\\\\").replace('"""', "'''")
    return _environment().get_template(name).render(ir=ir, header=safe, body=body).rstrip() + "\n"


def header(ir: KernelIR | ContactIR) -> str:
    """Provenance, as every generated file carries it."""
    lines = [
        f"Contact law {ir.name}: written by softdyn {softdyn.__version__} with sympy {ir.sympy_version}; do not edit.",
        "",
        f"Source: {ir.source}",
        f"Law {ir.law_hash}:",
        *(f"    {name} = {expr}" for name, expr in ir.declaration),
    ]
    if ir.fixed:
        lines.append("With " + ", ".join(f"{name} = {value}" for name, value in ir.fixed) + ".")
    if ir.savings:
        lines.append("Left out, with the operations that each saved:")
        lines += [f"    {saving.rule}: {saving.before} -> {saving.after}" for saving in ir.savings]
    lines.append(f"Operations, {total_operations(ir)} in all:")
    for part, counts in ir.operations.items():
        if any(counts.values()):
            lines.append(f"    {part}: " + ", ".join(f"{counts[kind]} {kind}" for kind in KINDS if counts[kind]))
    return "\n".join(lines)
