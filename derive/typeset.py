"""A derivation as text, LaTeX or plain data: first for any law, in the paper's symbols, then for one law."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import TYPE_CHECKING

from sympy import Eq, Expr, Matrix, Symbol, latex, sstr

from softdyn.derive.dynamics import GenericDynamics, generic_dynamics, law_jacobians, law_quantities, partials
from softdyn.derive.law import expressions

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw

#: How the names of the code are typeset.
LATEX_NAMES = {
    "delta": r"\delta",
    "F": r"F_\mathrm{ext}",
    "F_ela": r"F_\mathrm{ela}",
    "F_adh": r"F_\mathrm{adh}",
    "dF_dt": r"\dot{F}_\mathrm{ext}",
    "dh_dt": r"\dot{h}",
    "ddelta_dt": r"\dot{\delta}",
    "dX_dt": r"\dot{X}",
    "lambda1": r"\lambda_1",
    "lambda2": r"\lambda_2",
    "zeta": r"\zeta",
    "a_h": r"a_h",
    "a_delta": r"a_\delta",
    "F_a": r"F_a",
    "F_delta": r"F_\delta",
    "zeta_a": r"\zeta_a",
    "zeta_h": r"\zeta_h",
    "F_adh_a": r"F_{\mathrm{adh},a}",
    "F_adh_h": r"F_{\mathrm{adh},h}",
    "a_hh": r"a_{hh}",
    "a_hdelta": r"a_{h\delta}",
    "a_deltadelta": r"a_{\delta\delta}",
    "F_aa": r"F_{aa}",
    "F_adelta": r"F_{a\delta}",
    "F_deltadelta": r"F_{\delta\delta}",
}

#: (name or description, expression or equation)
Line = tuple[str, Expr | Eq | Matrix]


def derivation(law: ContactLaw) -> dict[str, list[Line]]:
    """Sections of a law's derivation, in reading order."""
    generic = generic_dynamics()
    return {
        "declared": list(expressions(law).items()),
        "any law": [*generic.steps, *_generic_results(generic)],
        "Jacobians of any law, d(rates)/d(state)": list(generic.jacobians.items()),
        "this law": [
            *((symbol.name, expr) for symbol, expr in partials(law).items() if expr != 0 and "_" in symbol.name),
            *(item for item in law_quantities(law).items() if item[0] not in expressions(law)),
        ],
        "Jacobians of this law, d(rates)/d(state)": list(law_jacobians(law).items()),
    }


def _generic_results(generic: GenericDynamics) -> list[Line]:
    return [
        ("dln(delta)/dln(h) at constant force", Eq(Symbol("lambda1"), generic.lambda1)),
        ("dln(-dh/dt)/dln(h) at constant force", Eq(Symbol("lambda2"), generic.lambda2)),
    ]


def as_text(law: ContactLaw) -> str:
    """Return the derivation to read on a terminal."""
    lines = [f"{law.name}: {law.description}" if law.description else law.name]
    lines += [f"source: {law.source}"] if law.source else []
    for title, entries in derivation(law).items():
        lines += ["", title]
        for name, value in entries:
            lines += _text_lines(name, value)
    return "\n".join(lines) + "\n"


def _text_lines(name: str, value: Expr | Eq | Matrix) -> Iterator[str]:
    if isinstance(value, Eq):
        yield f"  {sstr(value.lhs)} = {sstr(value.rhs)}    [{name}]"
    elif isinstance(value, Matrix):
        yield f"  state ({name}):"
        for i in range(value.rows):
            for j in range(value.cols):
                yield f"    J[{i}, {j}] = {sstr(value[i, j])}"
    else:
        yield f"  {name} = {sstr(value)}"


def as_latex(law: ContactLaw) -> str:
    """Return the derivation as LaTeX, to be input in a document that loads amsmath."""
    lines = [f"% {law.name}: {law.source}"]
    for title, entries in derivation(law).items():
        lines += ["", rf"\paragraph{{{title}}}"]
        for name, value in entries:
            if isinstance(value, Matrix):
                formula = rf"J_{{({name_latex(name)})}} = {to_latex(value)}"
            elif isinstance(value, Eq):
                lines.append(f"{name}:")
                formula = to_latex(value)
            else:
                formula = f"{name_latex(name)} = {to_latex(value)}"
            lines += [r"\begin{equation*}", f"  {formula}", r"\end{equation*}"]
    return "\n".join(lines) + "\n"


def name_latex(name: str) -> str:
    """Typeset the name of a quantity; a state such as "ln h, delta" too."""
    words = name.split(" ")
    return " ".join(
        {"ln": r"\ln"}.get(w, LATEX_NAMES.get(w, w)) if len(words) < 4 else rf"\text{{{w} }}" for w in words
    )


def to_latex(expr: Expr | Eq | Matrix) -> str:
    """LaTeX of an expression in the paper's notation."""
    names = {symbol: LATEX_NAMES[symbol.name] for symbol in expr.free_symbols if symbol.name in LATEX_NAMES}
    return latex(expr, symbol_names=names)


def as_json(law: ContactLaw) -> str:
    """Return the derivation as JSON: section, then name, then text and LaTeX."""

    def entry(value: Expr | Eq | Matrix) -> dict[str, object]:
        if isinstance(value, Matrix):
            return {"text": [[sstr(x) for x in value.row(i)] for i in range(value.rows)], "latex": to_latex(value)}
        if isinstance(value, Eq):
            return {"text": f"{sstr(value.lhs)} = {sstr(value.rhs)}", "latex": to_latex(value)}
        return {"text": sstr(value), "latex": to_latex(value)}

    sections = {title: {name: entry(value) for name, value in lines} for title, lines in derivation(law).items()}
    about = {"name": law.name, "description": law.description, "source": law.source}
    return json.dumps({**about, **sections}, indent=2) + "\n"


def declaration_latex(law: ContactLaw) -> str:
    """Return the four expressions, as a notebook shows a law."""
    rows = [f"{name_latex(name)} &= {to_latex(expr)}" for name, expr in expressions(law).items()]
    return r"$\displaystyle \begin{aligned} " + r" \\ ".join(rows) + r" \end{aligned}$"


FORMATS = {"text": as_text, "latex": as_latex, "json": as_json}
