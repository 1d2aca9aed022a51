"""All that is known of a closure, as one web page to hand to a colleague: see :mod:`softdyn.study.law_page`."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Any

from markupsafe import Markup
from sympy import Expr, sstr, true
from sympy.logic.boolalg import And

import softdyn
from softdyn.derive.closure import Closure, ranges_of
from softdyn.derive.closure_dynamics import derived
from softdyn.derive.closure_limits import check_closure_limits
from softdyn.derive.closure_regimes import ClosureDiagram, ClosureRegime, discover_closure
from softdyn.derive.closure_signs import signs_of_closure
from softdyn.derive.law import range_text
from softdyn.derive.limits import Finding
from softdyn.derive.regimes import Form
from softdyn.derive.typeset import to_latex
from softdyn.results.whole_files import written_whole
from softdyn.study.closure_pictures import draw
from softdyn.study.closure_plane import Presences, presence_of_closure
from softdyn.study.closure_text import WORDS, case_text, numbers_text, signs_of_closure_text, written
from softdyn.study.findings_text import holds_text, presence_text
from softdyn.study.law_page import Show, data_address, rendered, shown

MEANINGS = {
    "drag": "the force on a grain over its slip",
    "viscosity": "of the mixture",
    "permeability": "k in c slip = −k grad p/η",
    "settling": "the superficial velocity of grains that settle, over that of one alone",
}


def write_closure_report(closure: Closure, path: Path) -> None:
    """Write a page on a closure: declaration, derivation, limits, regimes, picture.

    Parameters
    ----------
    closure : Closure
    path : Path
        The file, HTML; it is written whole, or not at all.

    Raises
    ------
    SceneError
        If the file cannot be written.
    """
    with written_whole(path) as temporary:
        temporary.write_text(closure_page(closure), encoding="utf-8")


def closure_page(closure: Closure) -> str:
    """Return the page on a closure."""
    diagram = discover_closure(closure)
    findings = check_closure_limits(closure)
    found = presence_of_closure(diagram)
    names = ", ".join(regime.name for regime in diagram.regimes)
    about = {
        "closure": closure,
        "meaning": MEANINGS[closure.gives],
        "softdyn": softdyn.__version__,
        "versions": {name: version(name) for name in ("sympy", "mpmath", "matplotlib")},
        "summary": _summary(closure, findings, diagram),
        "declared": [
            {"name": name, "formula": shown(to_latex(expr), expr)}
            for name, expr in (("expression", closure.expression), ("in the plane", closure.in_plane))
            if expr is not None
        ],
        "parameters": _parameters(closure, shown),
        "derived": [
            {"text": x.says, "formula": shown(f"{x.symbol} = {to_latex(x.value)}", f"{x.name} = {written(x.value)}")}
            for x in derived(closure, diagram)[1:]
        ],
        "limits": _limits(closure, findings, shown),
        "figure": data_address(draw(diagram)),
        "alt": f"Regimes of {closure.name}, and what it gives with its leading forms: {names}.",
        "regimes": [_regime(regime, shown, found) for regime in diagram.regimes],
        "crossovers": [
            {
                "first": one.first,
                "second": one.second,
                "case": case_text(one.case) or "everywhere",
                "line": "not in closed form"
                if one.line is None
                else shown(rf"\mathrm{{Re}} = {to_latex(one.line.rhs)}", f"Re = {written(one.line.rhs)}"),
                "numbers": "" if one.line is None else numbers_text(closure, one.line.rhs),
            }
            for one in diagram.crossovers
        ],
        "jumps": [str(jump) for jump in diagram.jumps],
    }
    return rendered("closure.html.j2", about)


def _summary(closure: Closure, findings: list[Finding], diagram: ClosureDiagram) -> list[str]:
    counts = {verdict: sum(x.verdict == verdict for x in findings) for verdict in ("proved", "disproved", "undecided")}
    parts = ", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count)
    claims = f"{len(findings)} claim{'' if len(findings) == 1 else 's'} on limits: {parts}." if findings else ""
    regimes = f"{len(diagram.regimes)} regime{'' if len(diagram.regimes) == 1 else 's'}."
    jumps = f"{len(diagram.jumps)} jump{'' if len(diagram.jumps) == 1 else 's'} between cases." if diagram.jumps else ""
    signs = signs_of_closure_text(closure, signs_of_closure(closure)).splitlines()
    return [line for line in (claims or "Its author claims no limits.", regimes, jumps, *signs) if line]


def _parameters(closure: Closure, show: Show) -> list[dict[str, Any]]:
    rows = []
    for symbol, dimension in closure.parameters.items():
        allowed = ranges_of(closure).get(symbol)
        typical = closure.typical.get(symbol)
        rows.append(
            {
                "symbol": show(to_latex(symbol), symbol),
                "dimension": str(dimension),
                "allowed": "positive" if allowed is None else range_text(symbol, allowed),
                "typical": "" if typical is None else str(typical),
            }
        )
    return rows


def _limits(closure: Closure, findings: list[Finding], show: Show) -> list[dict[str, Any]]:
    found: dict[str, dict[str, Any]] = {}
    claimed = [quantity for limit in closure.limits for quantity in limit.claims]
    for finding, quantity in zip(findings, claimed, strict=True):
        entry = found.setdefault(finding.limit, {"name": finding.limit, "order": finding.ordering, "claims": []})
        entry["claims"].append(
            {
                "claim": show(
                    rf"{_quantity(quantity)} \simeq {to_latex(finding.claimed)}",
                    f"{finding.quantity} ~ {sstr(finding.claimed)}",
                ),
                "verdict": finding.verdict,
                "reason": finding.reason,
                "set": holds_text(finding),
                "ratio": None
                if finding.ratio is None
                else show(
                    " + ".join((to_latex(finding.ratio), *(f"({to_latex(term)})" for term in finding.rate))),
                    " + ".join((sstr(finding.ratio), *(f"({sstr(term)})" for term in finding.rate))),
                ),
            }
        )
    return list(found.values())


def _quantity(quantity: str | Expr) -> str:
    """LaTeX of what a claim is about."""
    if isinstance(quantity, Expr):
        return to_latex(quantity)
    return quantity if quantity == "C_d" else rf"\mathrm{{{quantity}}}"


def _regime(regime: ClosureRegime, show: Show, found: Presences) -> dict[str, Any]:
    presence = found.get(regime.name)
    cases = [] if regime.case == true else [*(regime.case.args if isinstance(regime.case, And) else (regime.case,))]
    return {
        "name": regime.name,
        "exact": regime.exact,
        "undecided": regime.undecided,
        "presence": "" if presence is None else presence_text(presence).replace("its forms are", "its form is"),
        "conditions": [
            *(
                show(rf"{to_latex(x.small)} \ll {to_latex(x.large)}", f"{written(x.small)} << {written(x.large)}")
                for x in regime.conditions
            ),
            *sorted(written(case) for case in cases),
        ],
        "forms": [] if regime.form is None else [*_rows(regime, show)],
    }


def _rows(regime: ClosureRegime, show: Show) -> list[dict[str, Any]]:
    assert regime.form is not None
    rows = [_row("everywhere in it", "", regime.form, show)]
    for end, one in regime.ends.items():
        small = show(rf"{to_latex(one.small)} \ll 1", f"{written(one.small)} << 1")
        where = Markup("{}, {}").format(end if one.name == end else f"{end} ({one.name})", small)
        if one.form is None:
            rows.append({"where": where, "note": one.reason, "form": "undecided", "times": ""})
            continue
        note = "" if one.verdict == "proved" else f"{WORDS[one.verdict]}: {one.reason}"
        rows.append(_row(where, note, one.form, show))
    return rows


def _row(where: Any, note: str, form: Form, show: Show) -> dict[str, Any]:
    times: Any = ""
    if form.corrections:
        latex = "1 + " + " + ".join(_bracketed(term) for term in form.corrections)
        times = show(latex.replace("+ -", "-"), "1 + " + " + ".join(f"({sstr(term)})" for term in form.corrections))
    return {"where": where, "note": note, "form": show(to_latex(form.leading), form.leading), "times": times}


def _bracketed(term: Expr) -> str:
    number, _ = term.as_coeff_Mul()
    return f"-{to_latex(-term)}" if number.is_negative else to_latex(term)
