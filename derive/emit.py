"""From a kernel's intermediate representation to the text of a target.

Input: a :class:`KernelIR`, of any kind. Output: source text, which imports and includes nothing of softdyn's, and the
signatures of its functions. The algorithms are templates in ``common``, in the subset of Python that all targets share;
each is translated, put behind the elementary functions that it calls, and wrapped by the target's own template.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Mapping
from functools import cache
from typing import NamedTuple

from jinja2 import Environment, FileSystemLoader, StrictUndefined

import softdyn
from softdyn import pair_layout, templates
from softdyn.derive import bessel, special, splines
from softdyn.derive.elementary import constants, nested, used_functions
from softdyn.derive.kernel_form import KernelIR, Provenance, operations_of, total_operations
from softdyn.derive.printing import KINDS
from softdyn.derive.radau import PANEL_NODES, blindness, radau_iia
from softdyn.targets import Signature, target_module

#: Contacts that go together are wide enough for any machine's vectors, and for the latency of divisions. Of elements
#: the template knows: so many that their matrices stay in the nearest cache until they are added up.
LANES = {"contacts": 16}


class Written(NamedTuple):
    """Source text of a kernel, the ending of its file, and its functions, by their names without the kernel's."""

    text: str
    suffix: str
    functions: dict[str, Signature]


def write(ir: KernelIR, target: str) -> Written:
    """Write a kernel for a target."""
    body, ending = kernel_body(ir), suffix(target)
    # what the law's author wrote must end neither a comment nor a docstring
    safe = header(ir).replace("*/", "* /").replace("\\", "\\\\").replace('"""', "'''")
    values = {"ir": ir, "header": safe, "body": with_functions(body, target)}
    return Written(render_part(f"{target}/{ir.kind}{ending}.j2", values), ending, signatures(body, ir.name))


def companions(ir: KernelIR, target: str, stem: str, values: Mapping[str, str]) -> dict[str, str]:
    """Files beside a kernel's source, by what follows ``stem`` in their names: in C a header and an example.

    Parameters
    ----------
    ir : KernelIR
    target : str
    stem : str
        Name of the source file, without its ending.
    values : mapping from str to str
        Of the kernel's parameters, as the example has them.
    """
    own = f"{target}/{ir.kind}"
    names = [name for name in _environment().list_templates() if name.startswith((f"{own}_", f"{own}."))]
    names.remove(f"{own}{suffix(target)}.j2")
    if not names:
        return {}
    heads = rf"^(?:void|int64_t|double) {ir.name}_\w+\(.*\)$"
    prototypes = [line.replace("restrict ", "") for line in re.findall(heads, emit(ir, target), flags=re.MULTILINE)]
    given = {"ir": ir, "stem": stem, "header": header(ir).replace("*/", "* /"), "values": values}
    given |= {"prototypes": prototypes, "layout": pair_layout}
    return {name.removeprefix(own).removesuffix(".j2"): render_part(name, given) for name in names}


def write_enclosures(target: str) -> Written:
    """Write the functions that enclose expressions of time: no law enters them, and they are the same for all."""
    title = Provenance("Enclosures of expressions of time,")
    return write(KernelIR("enclosures", "enclosures", title, {}, {}, {}, ()), target)


def emit(ir: KernelIR, target: str) -> str:
    """Source text of a kernel for a target."""
    return write(ir, target).text


def suffix(target: str) -> str:
    """Ending of a target's files."""
    return str(target_module(target).SUFFIX)


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


@cache
def _numbers(kind: str) -> dict[str, object]:
    """Numbers of the algorithm of a kind of kernels, whatever its functions."""
    if kind == "pair":
        return {"radau": radau_iia(), "panel": radau_iia(PANEL_NODES), "blind": blindness()}
    return {"lanes": LANES[kind]} if kind in LANES else {}


def kernel_body(ir: KernelIR) -> str:
    """The algorithms of a kernel in the subset of Python that all targets share."""
    return with_special(render_part(f"common/{ir.kind}.py.j2", {"ir": ir, **_numbers(ir.kind)}))


def with_special(body: str) -> str:
    """A body in the subset of Python that all targets share, behind the special functions that it calls."""
    tables = splines.called_in(body)
    if tables:
        numbers = {"called": tables, "leaves": splines.leaves, "nested": nested}
        body = render_part("common/splines.py.j2", numbers) + "\n\n" + body
    called = bessel.called_in(body)
    if called:
        numbers = {"called": called, "polynomials": bessel.polynomials, "nested": nested, "pi": math.pi}
        body = render_part("common/bessel.py.j2", numbers) + "\n\n" + body
    if special.calls_lambert(body):
        body = render_part("common/special.py.j2", {**special.constants(), "nested": nested}) + "\n\n" + body
    return body


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


def header(ir: KernelIR) -> str:
    """Provenance, as every generated file carries it."""
    made = ir.provenance
    by = f"softdyn {softdyn.__version__}" + (f" with sympy {made.sympy_version}" if made.sympy_version else "")
    lines = [f"{made.title} written by {by}; do not edit."]
    if made.source:
        lines += ["", f"Source: {made.source}"]
    if made.declaration:
        lines += [
            f"{made.declared.capitalize()} {made.fingerprint}:",
            *(f"    {name} = {expr}" for name, expr in made.declaration),
        ]
    if made.fixed:
        lines.append("With " + ", ".join(f"{name} = {value}" for name, value in made.fixed) + ".")
    if ir.savings:
        lines.append("Left out, with the operations that each saved:")
        lines += [f"    {saving.rule}: {saving.before} -> {saving.after}" for saving in ir.savings]
    if ir.functions:
        lines.append(f"Operations, {total_operations(ir)} in all:")
    for name, counts in operations_of(ir).items():
        if any(counts.values()):
            lines.append(f"    {name}: " + ", ".join(f"{counts[kind]} {kind}" for kind in KINDS if counts[kind]))
    return "\n".join(lines)
