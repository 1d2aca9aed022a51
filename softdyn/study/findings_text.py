"""What is found of a law, as text and as plain data: verdicts on its limits, its regimes, crossovers and films."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from sympy import S, latex

from softdyn.derive.error_bounds import ErrorFinding
from softdyn.derive.films import Films
from softdyn.derive.forms import force, force_unit
from softdyn.derive.law import ContactLaw, parameters_of
from softdyn.derive.limits import Finding
from softdyn.derive.regimes import Diagram, Form, Regime, Side
from softdyn.derive.symbolic_powers import exponents_words
from softdyn.derive.symbols import E, R, h
from softdyn.study.notation import Formulas, Numbers
from softdyn.study.presence import Presence, Presences
from softdyn.study.values import RealValues

# ------------------------------------------------------------------------------------------------------------- limits


def limits_text(name: str, findings: Sequence[Finding]) -> str:
    """Verdicts on the claimed limits, with the evidence for each."""
    lines = []
    for limit in dict.fromkeys(finding.limit for finding in findings):
        of_limit = [finding for finding in findings if finding.limit == limit]
        lines.append(f"{name}, {limit}: {of_limit[0].ordering}")
        for finding in of_limit:
            lines.append(f"  {finding.verdict:10}{finding.quantity} ~ {finding.claimed}")
            lines += (f"      {line}" for line in _evidence(finding))
    return "\n".join(lines) + "\n"


def _evidence(finding: Finding) -> Iterator[str]:
    if finding.verdict != "proved":
        yield finding.reason
    if finding.chain:
        yield "dominant: " + ", ".join(f"{whole} -> {term}" for whole, term in finding.chain)
    if finding.ratio is not None:
        ratio = f"found/claimed -> {finding.ratio}"
        # terms that are known; where there are none, the ratio is exact up to less than any power
        yield ratio + (f" as 1 + {' + '.join(f'({term})' for term in finding.rate)} + ..." if finding.rate else "")
    if finding.certificate:
        yield "in numbers: " + ", ".join(f"{value:.0e} off at eps = {eps:.0e}" for eps, value in finding.certificate)
    if text := holds_text(finding):
        yield text


def holds_text(finding: Finding) -> str:
    """On which set a verdict holds, and what random paths into that set say of it, in words."""
    if not finding.holds:
        return ""
    looked = f"{finding.samples} random path{'' if finding.samples == 1 else 's'} into that set"
    if finding.verdict == "undecided":
        return f"asked {finding.holds}; none of {looked} refutes it" if finding.samples else f"asked {finding.holds}"
    if finding.verdict == "disproved":
        return f"claimed {finding.holds}" + (f"; refuted by one of {looked}" if finding.witness is not None else "")
    return f"holds {finding.holds}; " + (
        f"none of {looked} says otherwise" if finding.samples else "no numbers were drawn from that set"
    )


def limits_data(law: str, findings: Sequence[Finding]) -> dict[str, Any]:
    """Verdicts and evidence as plain data; expressions as text."""
    counts = {verdict: sum(f.verdict == verdict for f in findings) for verdict in ("proved", "disproved", "undecided")}
    return {"law": law, **counts, "limits": [_plain_data(asdict(finding)) for finding in findings]}


def errors_text(findings: Sequence[ErrorFinding]) -> str:
    """Verdicts on claimed errors, a line each, and what stands against them."""
    lines = []
    for finding in findings:
        found = "" if finding.given or finding.verdict != "proved" else " (found)"
        lines.append(f"  {finding.verdict:10}{finding.limit}: {finding.quantity} {finding}{found}")
        lines += [f"      {finding.reason}"] if finding.reason else []
    return "".join(line + "\n" for line in lines)


def errors_data(findings: Sequence[ErrorFinding]) -> list[Any]:
    """Verdicts on claimed errors as plain data; expressions as text."""
    return [_plain_data(asdict(finding)) for finding in findings]


def signs_text(law: ContactLaw) -> str:
    """What is proved of the signs of radius, stiffness and friction, and of surfaces that rub."""
    from softdyn.derive.checks import pressed_only, rubbing_signs_of, signs_of, undecided_signs

    # a law may be of pressed surfaces alone
    domain = "h > 0, 0 < delta < R" if law.zeta == 0 or pressed_only(law) else "h > 0, |delta| < R"
    proved = dict.fromkeys(sign.quantity for sign in signs_of(law) if sign.found.verdict == "positive")
    open_ = undecided_signs(law)
    whole = [name for name in proved if not any(words.startswith(f"{name} >") for words in open_)]
    lines = [f"{', '.join(whole)} > 0: proved for {domain}"] if whole else []
    rubbing = rubbing_signs_of(law)
    if rubbing and all(sign.found.verdict == "positive" for sign in rubbing):
        names = ", ".join(dict.fromkeys(sign.quantity for sign in rubbing))
        lines.append(f"{names} >= 0: proved for {domain}")
    return "".join(line + "\n" for line in (*lines, *open_))


def _plain_data(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain_data(part) for key, part in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain_data(part) for part in value]
    return value if isinstance(value, (str, float, int, bool, type(None))) else str(value)


# ------------------------------------------------------------------------------------------------------------ regimes


def regimes_text(
    diagram: Diagram, films: Films | None = None, found: Presences | None = None, real: RealValues | None = None
) -> str:
    """The regimes of a law, their crossovers and its films, to read on a terminal.

    Parameters
    ----------
    diagram : Diagram
    films : Films, optional
    found : mapping, optional
        Of :func:`softdyn.study.presence.presence_of`: which regimes are there, and how far their forms are off.
    real : RealValues, optional
        Of the diagram's law: all is then told in numbers.
    """
    law = diagram.law
    words: Formulas | Numbers = Formulas(law) if real is None else Numbers(real)
    inside = sum(regime.inside and regime.side == "compression" for regime in diagram.regimes)
    outside = sum(not regime.inside and regime.side == "compression" for regime in diagram.regimes)
    lines = [
        f"{law.name}: {inside} regime{'s' if inside > 1 else ''} of h and F in compression"
        + (f", and {outside} outside the model (delta > R)" if outside else ""),
        *words.about(),
    ]
    if diagram.scales and real is None:
        unit = force_unit(law)
        own = {} if E in parameters_of(law) else {E: unit / R**2}
        scales = ", ".join(f"{symbol} = {S(law.typical[symbol]).subs(own)}" for symbol in diagram.scales)
        lines.append(f"own parameters scale as they do at {scales}")
    if diagram.exponents and real is None:
        lines.append(exponents_words(diagram.exponents))
    conservative = {
        True: "conservative: U_h = 0",
        False: "not conservative: the elastic energy depends on the gap; U_h is given in each regime",
        None: "whether the law is conservative is not decided",
    }
    lines.append(conservative[diagram.conservative])
    for side in ("compression", "tension"):
        lines += ["", *_side_lines(diagram, side, words, found or {})]
    if films is not None:
        lines += ["", *_film_lines(films, words)]
    return "\n".join(lines) + "\n"


def _side_lines(diagram: Diagram, side: Side, words: Formulas | Numbers, found: Presences) -> Iterator[str]:
    yield {"compression": "compression, F > 0", "tension": "tension, F < 0"}[side]
    here = [regime for regime in diagram.regimes if regime.side == side]
    if not here:
        yield "  nothing: the law is one of pressed surfaces alone, delta >= 0"
        return
    twins = {regime.name: twin(diagram, regime) for regime in here}
    mirrored = side == "tension" and all(twins.values())
    if mirrored:
        yield (
            "  the same regimes as in compression, but for:"
            if any(
                not same_size(form, twins[regime.name].forms[name])  # type: ignore[union-attr]
                for regime in here
                for name, form in regime.forms.items()
            )
            else "  as in compression"
        )
    for regime in here:
        other = twins[regime.name] if side == "tension" else None
        different = [
            name for name in regime.forms if other is None or not same_size(regime.forms[name], other.forms[name])
        ]
        presence = found.get((side, regime.name))
        alike = other is None or _is_there(presence) == _is_there(found.get((other.side, other.name)))
        if other is not None and not different and alike:
            continue
        conditions = ", ".join(words.condition(condition) for condition in regime.conditions) or "everywhere"
        yield f"\n  {regime.name}{'' if regime.inside else ' (outside the model: delta > R)'}: {conditions}"
        if presence is not None:
            yield f"    {presence_text(presence)}"
        names = {name: words.name(name) for name in different}
        width = max([6, *map(len, names.values())])
        for name, written in names.items():
            yield f"    {written:{width}} ~ {_form_text(name, regime.forms[name], words)}"
        for name, reason in regime.undecided.items():
            yield f"    {name:6} undecided: {reason}"
        if regime.lambda1 is not None and other is None:
            yield f"    lambda1 = {regime.lambda1}" + (
                f", lambda2 = {regime.lambda2}" if regime.lambda2 is not None else ""
            )
        if regime.edge is not None and other is None:
            yield f"    the model ends, at delta = R, where {words.line(force, regime.edge)}"
    lines = [crossover for crossover in diagram.crossovers if crossover.side == side]
    if mirrored:
        return
    if lines:
        yield "\n  crossovers"
    for crossover in lines:
        left = crossover.line.lhs
        others = ", ".join(f"{name}: {words.value(left, rhs)}" for name, rhs in crossover.others.items())
        met = (
            f"    [{crossover.quantity}{'; others elsewhere, ' + others if others else ''}]"
            if crossover.quantity
            else ""
        )
        yield f"    {crossover.first} | {crossover.second}: {words.line(left, crossover.line.rhs)}{met}"
    for point in diagram.points:
        if point.side == side:
            yield (f"    {', '.join(point.regimes)} meet at {words.line(h, point.h)}, {words.line(force, point.force)}")


def _is_there(presence: Presence | None) -> bool:
    return presence is None or presence.there


def presence_text(presence: Presence) -> str:
    """Whether a regime is there at the law's values, and how far its forms are off, in words."""
    if not presence.there:
        return f"absent there: {presence.reason}"
    parts = [
        f"within {100 * error:g} % where each << is a factor of {_rounded_up(factor)} or more"
        + (", and delta << R too" if error in presence.shallow else "")
        for error, factor in presence.factors.items()
        if factor is not None
    ]
    if len(parts) < len(presence.factors):
        parts = [f"off by {_rounded(100 * presence.off)} % at best", *parts]
    if presence.share >= 0.005:
        parts.append(f"off by more than their own size at {100 * presence.share:.0f} % of the points looked at")
    return f"its forms are {'; '.join(parts)}"


def _rounded_up(factor: float) -> str:
    """To two digits, never less."""
    if factor <= 1:
        return "1"
    step = 10.0 ** (math.floor(math.log10(factor)) - 1)
    return f"{math.ceil(factor / step - 1e-9) * step:.4g}"


def _rounded(number: float) -> str:
    """To two digits, without a power of ten where that is not needed."""
    return f"{number:.2g}" if number < 99.5 else f"{number:.0f}"


def twin(diagram: Diagram, regime: Regime) -> Regime | None:
    """Return the regime of the other side with the same conditions and quantities, if there is one."""
    return next(
        (
            other
            for other in diagram.regimes
            if other.side != regime.side
            and set(other.conditions) == set(regime.conditions)
            and other.forms.keys() == regime.forms.keys()
        ),
        None,
    )


def same_size(one: Form, other: Form) -> bool:
    """Whether two leading forms differ by their sign at most, and by nothing in their corrections."""
    return one.leading in (other.leading, -other.leading) and set(one.corrections) == set(other.corrections)


def _form_text(name: str, form: Form, words: Formulas | Numbers) -> str:
    text = words.form(name, form.leading)
    if not form.corrections:
        return text
    terms = [words.term(term) for term in form.corrections]
    signed = "".join(f" - {term[1:]}" if term.startswith("-") else f" + {term}" for term in terms)
    return f"{text}    (1{signed}{'' if form.resolved else ' + ...'})"


def _film_lines(films: Films, words: Formulas | Numbers) -> Iterator[str]:
    yield "films, where F_adh = F"
    if films.h_eq is not None:
        yield f"  h_eq = {films.h_eq}"
    yield f"  relaxation rate = {films.rate}, in h = h_eq"
    for film in films.films:
        between = f"  {film.side}, {film.closing} (closing) | {film.opening} (opening): "
        if film.stable is None:
            exact = isinstance(words, Formulas)
            edge = "this line" if film.edge is None else f"F = {film.edge if exact else words.value(force, film.edge)}"
            yield f"{between}no film beyond {edge}"
            continue
        gap = f", h_eq ~ {words.value(h, film.h_eq)}" if film.h_eq is not None and films.h_eq is None else ""
        rate = f", {words.name('rate')} ~ {words.form('rate', film.rate)}" if film.rate is not None else ""
        there = f"; none such {_where(words).replace('at typ', 'at the typ')}" if film.found is False else ""
        yield f"{between}{'stable' if film.stable else 'unstable'}{gap}{rate}{there}"
    if films.branches is None:
        yield "  in numbers: unknown, since the law gives no typical values of all of its parameters"
    elif films.branches:
        units = "" if isinstance(words, Numbers) else ", in units of R, E and eta"
        yield f"  {_where(words)}{units}:"
    for branch in films.branches or ():
        gaps, forces, rates = (
            _range(words, name, values)
            for name, values in (("h", branch.h), ("F", branch.force), ("rate", branch.rate))
        )
        yield (
            f"    {'stable' if branch.stable else 'unstable':9} h_eq {gaps}, F {forces}, {words.name('rate')} {rates}"
            + ("; found in numbers only, no leading form is known" if branch in films.without_form() else "")
        )


def _where(words: Formulas | Numbers) -> str:
    return "at these values" if isinstance(words, Numbers) else "at typical parameters"


def _range(words: Formulas | Numbers, name: str, values: Sequence[float]) -> str:
    factor, unit = words.scale(name)
    return f"{factor * values[0]:.3g} to {factor * values[-1]:.3g}{' ' + unit if unit else ''}"


def regimes_data(
    diagram: Diagram, films: Films | None = None, found: Presences | None = None, real: RealValues | None = None
) -> dict[str, Any]:
    """The regimes of a law as plain data; expressions as text, leading forms as LaTeX too.

    With real values, ``at`` holds these, in SI units, and what R, E and eta are units of; ``numbers`` holds the leading
    forms with numbers in their place, as text.

    Parameters
    ----------
    diagram : Diagram
    films : Films, optional
        Of the diagram's law, if it has any.
    found : mapping, optional
        Of :func:`softdyn.study.presence.presence_of`.
    real : RealValues, optional
        Of the diagram's law.
    """
    words = None if real is None else Numbers(real)
    regimes = [
        {
            "name": regime.name,
            "side": regime.side,
            "inside": regime.inside,
            "conditions": [{"small": str(c.small), "large": str(c.large)} for c in regime.conditions],
            "forms": {
                name: {
                    "leading": str(form.leading),
                    "latex": latex(form.leading),
                    "state": str(form.state),
                    "corrections": [str(term) for term in form.corrections],
                    "resolved": form.resolved,
                }
                for name, form in regime.forms.items()
            },
            "undecided": dict(regime.undecided),
            "lambda1": _plain_data(regime.lambda1),
            "lambda2": _plain_data(regime.lambda2),
            "edge": _plain_data(regime.edge),
            **presence_data((found or {}).get((regime.side, regime.name))),
            **({} if words is None else {"numbers": _numbers_data(regime, words)}),
        }
        for regime in diagram.regimes
    ]
    crossovers = [
        {
            "first": c.first,
            "second": c.second,
            "side": c.side,
            "quantity": c.quantity,
            "line": {
                "of": str(c.line.lhs),
                "is": str(c.line.rhs),
                **({} if words is None else {"numbers": words.value(c.line.lhs, c.line.rhs)}),
            },
            "others": _plain_data(c.others),
        }
        for c in diagram.crossovers
    ]
    return {
        "law": diagram.law.name,
        "conservative": diagram.conservative,
        "typical": {str(symbol): str(value) for symbol, value in diagram.law.typical.items()},
        "exponents": _plain_data(diagram.exponents),
        "regimes": regimes,
        "crossovers": crossovers,
        "points": [_plain_data(asdict(point)) for point in diagram.points],
        "films": None if films is None else _plain_data(asdict(films)),
        **({} if real is None else {"at": _values_data(real)}),
    }


def presence_data(presence: Presence | None) -> dict[str, Any]:
    if presence is None:
        return {}
    data = asdict(presence)
    # JSON has no word for what is no number
    numbers = {name: data[name] if math.isfinite(data[name]) else None for name in ("off", "share")}
    numbers["shallow"] = sorted(data["shallow"])
    return {"presence": {**data, **numbers, "factors": {str(e): factor for e, factor in presence.factors.items()}}}


def _numbers_data(regime: Regime, words: Numbers) -> dict[str, Any]:
    return {
        "conditions": [words.condition(condition) for condition in regime.conditions],
        "forms": {words.name(name): words.form(name, form.leading) for name, form in regime.forms.items()},
        "edge": None if regime.edge is None else words.value(force, regime.edge),
    }


def _values_data(real: RealValues) -> dict[str, Any]:
    return {
        "values": {str(symbol): value for symbol, value in real.values.items()},
        "taken": [str(symbol) for symbol in real.taken],
        "units": {"R": real.length, "E": real.modulus, "eta": real.viscosity if real.timed else None},
    }
