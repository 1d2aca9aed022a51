"""From a kernel's intermediate representation to the text of a target.

Input: a :class:`KernelIR` or a :class:`ContactIR`, or nothing for the enclosures of expressions, which no law enters.
Output: source text, which imports and includes nothing of softdyn's, and the signatures of its functions. The
algorithms are templates in ``common``, in the subset of Python that all targets share; each is translated, put behind
the elementary functions that it calls, and wrapped by the target's own template.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

from jinja2 import Environment, FileSystemLoader, StrictUndefined

import softdyn
from softdyn import templates
from softdyn.derive import special
from softdyn.derive.elementary import constants, nested, used_functions
from softdyn.derive.kernel import KernelIR, total_operations
from softdyn.derive.printing import KINDS
from softdyn.derive.radau import PANEL_NODES, blindness, radau_iia
from softdyn.targets import Signature, target_module

if TYPE_CHECKING:
    from softdyn.derive.contact_kernel import ContactIR

#: Contacts that go together; wide enough for any machine's vectors, and for the latency of divisions.
LANES = 16


class Written(NamedTuple):
    """Source text of a kernel, the ending of its file, and its functions, by their names without the kernel's."""

    text: str
    suffix: str
    functions: dict[str, Signature]


def write(ir: KernelIR | ContactIR, target: str) -> Written:
    """Write a kernel for a target."""
    # what the law's author wrote must end neither a comment nor a docstring
    safe = header(ir).replace("*/", "* /").replace("\\", "\\\\").replace('"""', "'''")
    return _written(ir.name, ir.template, kernel_body(ir), {"ir": ir, "header": safe}, target)


def write_enclosures(target: str) -> Written:
    """Write the functions that enclose expressions of time, which are the same for all laws."""
    values = {"version": softdyn.__version__}
    return _written("enclosures", "enclosures", render_part("common/enclosures.py.j2", {}), values, target)


def emit(ir: KernelIR | ContactIR, target: str) -> str:
    """Source text of a kernel for a target."""
    return write(ir, target).text


def suffix(target: str) -> str:
    """Ending of a target's files."""
    return str(target_module(target).SUFFIX)


def _written(name: str, template: str, body: str, values: Mapping[str, object], target: str) -> Written:
    text = render_part(f"{target}/{template}{suffix(target)}.j2", {**values, "body": with_functions(body, target)})
    return Written(text, suffix(target), signatures(body, name))


def signatures(body: str, name: str) -> dict[str, Signature]:
    """Signatures of the functions of a body that others may call: ``NAME_function``."""
    functions = [node for node in ast.parse(body).body if isinstance(node, ast.FunctionDef) and node.name[0] != "_"]
    return {
        node.name.removeprefix(f"{name}_"): (
            ast.unparse(node.returns) if node.returns else "None",
            [ast.unparse(argument.annotation) for argument in node.args.args if argument.annotation],
        )
        for node in functions
    }


@cache
def _environment() -> Environment:
    return Environment(
        loader=FileSystemLoader(templates.__path__), undefined=StrictUndefined, keep_trailing_newline=True
    )


def kernel_body(ir: KernelIR | ContactIR) -> str:
    """The algorithms of a kernel in the subset of Python that all targets share."""
    of_pairs = {"radau": radau_iia(), "panel": radau_iia(PANEL_NODES), "blind": blindness()}
    numbers = of_pairs if isinstance(ir, KernelIR) else {"lanes": LANES}
    return with_special(render_part(f"common/{ir.template}.py.j2", {"ir": ir, **numbers}))


def with_special(body: str) -> str:
    """A body in the subset of Python that all targets share, behind the special functions that it calls."""
    if not special.calls_special(body):
        return body
    return render_part("common/special.py.j2", {**special.constants(), "nested": nested}) + "\n\n" + body


def with_functions(body: str, target: str) -> str:
    """Text for a target of a body in the shared subset of Python, behind the elementary functions that it calls."""
    translate, used = target_module(target).translate, used_functions(body)
    if not used:
        return str(translate(body)).rstrip()
    numbers = {**constants(), "used": used, "nested": nested}
    whole = render_part("common/elementary.py.j2", numbers) + "\n\n" + body
    bits = render_part(f"{target}/bits{suffix(target)}.j2", numbers)
    return f"{bits}\n\n{translate(whole)}".rstrip()


def render_part(name: str, values: Mapping[str, object]) -> str:
    """Text of a template."""
    text = _environment().get_template(name).render(**values)
    return "\n".join(line.rstrip() for line in text.strip().splitlines()) + "\n"


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
