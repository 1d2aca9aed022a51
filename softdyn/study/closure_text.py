"""The regimes of a closure, and what it gives written out, as text and as plain data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from sympy import Expr, latex, sstr, true
from sympy.logic.boolalg import And, Boolean

from softdyn.derive.closure import Closure, c, densest, dimensions_for, phi, sample_values
from softdyn.derive.closure_regimes import ClosureDiagram, ClosureRegime, End
from softdyn.derive.closure_signs import SignOfClosure
from softdyn.derive.regimes import Form
from softdyn.study.closure_plane import Presences, fractions_of, in_numbers
from softdyn.study.findings_text import presence_data, presence_text

#: Fractions of the grains at which a line is told in numbers.
TOLD = (0.01, 0.1, 0.3, 0.5, 0.6)
#: What holds of an end that is not proved.
WORDS = {"disproved": "not uniformly", "undecided": "undecided whether uniformly"}


def written(expr: Any) -> str:
    """An expression as text, numbers first in sums."""
    return str(sstr(expr, order="none") if isinstance(expr, Expr) else sstr(expr))


def case_text(case: Boolean) -> str:
    """Where a case applies."""
    if case == true:
        return ""
    return ", ".join(sorted(map(written, case.args if isinstance(case, And) else (case,))))


def form_text(form: Form, exact: bool = False) -> str:
    """A leading form, and its next terms."""
    if exact or not (form.corrections or not form.resolved):
        return written(form.leading)
    signed = "".join(_signed(term) for term in form.corrections)
    return f"{written(form.leading)}    (1{signed}{'' if form.resolved else ' + ...'})"


def _signed(term: Expr) -> str:
    number, _ = term.as_coeff_Mul()
    return f" - {written(-term)}" if number.is_negative else f" + {written(term)}"


def numbers_text(closure: Closure, line: Expr) -> str:
    """A line Re = ... in numbers: by itself, if it is a number, or at some fractions."""
    value = in_numbers(closure, line)
    if not line.has(c, phi):
        return "" if line.is_Rational else f"{float(value(1.0, 0.5)):.4g}"
    low, high = fractions_of(closure)
    return ", ".join(f"{float(value(1.0, x)):.3g} at phi = {x:g}" for x in TOLD if low < x < high)


def regimes_of_closure_text(diagram: ClosureDiagram, found: Presences | None = None) -> str:
    """The regimes of a closure and their crossovers, to read on a terminal."""
    return "\n".join(_lines(diagram, found or {})) + "\n"


def _lines(diagram: ClosureDiagram, found: Presences) -> Iterator[str]:
    closure, regimes = diagram.closure, diagram.regimes
    yield f"{closure.name}: {len(regimes)} regime{'s' if len(regimes) > 1 else ''} of its {closure.gives}"
    if closure.parameters:
        names = ", ".join(
            f"{symbol} = {closure.typical[symbol]}" if symbol in closure.typical else symbol.name
            for symbol in closure.parameters
        )
        yield f"own parameters are fixed, at any values; in numbers at {names}"
    for regime in regimes:
        yield from _regime_lines(closure, regime, found)
    if diagram.crossovers:
        yield "\n  crossovers, where the two forms are equal"
    for one in diagram.crossovers:
        where = f", where {case_text(one.case)}" if one.case != true else ""
        if one.line is None:
            yield f"    {one.first} | {one.second}{where}: not in closed form; Re ~ 1 stands for it"
            continue
        numbers = numbers_text(closure, one.line.rhs)
        yield f"    {one.first} | {one.second}{where}: Re = {written(one.line.rhs)}" + (
            f"  ({numbers})" if numbers else ""
        )
    if diagram.jumps:
        yield "\n  jumps, where cases do not meet"
        yield from (f"    {jump}" for jump in diagram.jumps)


def _regime_lines(closure: Closure, regime: ClosureRegime, found: Presences) -> Iterator[str]:
    conditions = [f"{written(x.small)} << {written(x.large)}" for x in regime.conditions]
    conditions += [case_text(regime.case)] if regime.case != true else []
    where = ", ".join(conditions)
    yield f"\n  {regime.name}{': ' + where if where else '' if regime.name == 'everywhere' else ': everywhere'}"
    if regime.form is None:
        yield f"    undecided: {regime.undecided}"
        return
    if regime.name in found:
        yield f"    {presence_text(found[regime.name]).replace('its forms are', 'its form is')}"
    sign = "=" if regime.exact else "~"
    yield f"    {closure.gives} {sign} {form_text(regime.form, regime.exact)}"
    for end, one in regime.ends.items():
        yield from _end_lines(closure, end, one)


def _end_lines(closure: Closure, end: str, one: End) -> Iterator[str]:
    named = f"{end} ({one.name})" if one.name != end else end
    if one.form is None:
        yield f"      {named}, {written(one.small)} << 1: undecided: {one.reason}"
        return
    yield f"      {named}, {written(one.small)} << 1: ~ {form_text(one.form)}" + (
        "" if one.verdict == "proved" else f", {WORDS[one.verdict]}: {one.reason}"
    )


def signs_of_closure_text(closure: Closure, signs: list[SignOfClosure]) -> str:
    """What is known of the signs of a closure, a line each."""
    lines = []
    for sign in signs:
        name = closure.gives if sign.name == "expression" else f"{closure.gives} in the plane"
        if sign.verdict == "proved":
            lines.append(f"{name} > 0: proved for Re > 0, 0 < phi < {densest(closure)}")
        elif sign.verdict == "sampled":
            left = f"; left: {sign.left}" if sign.left else ""
            lines.append(f"{name} > 0: not proved; it is so at the {sign.points} points looked at{left}")
        else:
            lines.append(f"{name} > 0: wrong, {sign.at}")
    return "".join(line + "\n" for line in lines)


def signs_data(signs: list[SignOfClosure]) -> list[Any]:
    """What is known of the signs of a closure, as plain data."""
    return [asdict(sign) for sign in signs]


def regimes_of_closure_data(diagram: ClosureDiagram, found: Presences | None = None) -> dict[str, Any]:
    """The regimes of a closure as plain data; expressions as text, forms as LaTeX too."""

    def form(one: Form | None) -> Any:
        if one is None:
            return None
        return {
            "leading": str(one.leading),
            "latex": latex(one.leading),
            "corrections": [str(term) for term in one.corrections],
            "resolved": one.resolved,
        }

    return {
        "closure": diagram.closure.name,
        "gives": diagram.closure.gives,
        "densest": str(diagram.densest),
        "typical": {str(x): str(sample_values(diagram.closure)[x]) for x in diagram.closure.parameters},
        "regimes": [
            {
                "name": regime.name,
                "case": case_text(regime.case),
                "conditions": [{"small": str(x.small), "large": str(x.large)} for x in regime.conditions],
                "form": form(regime.form),
                "exact": regime.exact,
                "undecided": regime.undecided,
                "ends": {
                    end: {
                        "name": one.name,
                        "small": str(one.small),
                        "form": form(one.form),
                        "verdict": one.verdict,
                        "reason": one.reason,
                    }
                    for end, one in regime.ends.items()
                },
                **presence_data((found or {}).get(regime.name)),
            }
            for regime in diagram.regimes
        ],
        "crossovers": [
            {
                "first": one.first,
                "second": one.second,
                "case": case_text(one.case),
                "Re": None if one.line is None else str(one.line.rhs),
            }
            for one in diagram.crossovers
        ],
        "jumps": [str(jump) for jump in diagram.jumps],
    }


def derived_text(closure: Closure, kind: str) -> str:
    """What follows from a closure, as text, LaTeX or JSON."""
    import json

    from softdyn.derive.closure_dynamics import derived
    from softdyn.derive.typeset import to_latex

    lines = derived(closure)
    if kind == "json":
        units = {str(symbol): str(unit) for symbol, unit in dimensions_for(closure).items()}
        entries = [{"name": x.name, "says": x.says, "is": str(x.value), "latex": to_latex(x.value)} for x in lines]
        return json.dumps({"closure": closure.name, "dimensions": units, "derived": entries}, indent=2) + "\n"
    if kind == "latex":
        rows = [rf"% {x.says}" + "\n" + rf"\[ {x.symbol} = {to_latex(x.value)} \]" for x in lines]
        return "\n".join(rows) + "\n"
    return f"{closure.name}: {closure.gives}\n" + "".join(
        f"\n{x.says}\n  {x.name} = {written(x.value)}\n" for x in lines
    )
