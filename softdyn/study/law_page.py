"""All that is known of a law, as one web page to hand to a colleague.

The page holds everything itself, figures and the font of its formulas too, and needs neither a network nor a
script. The same law and versions give the same bytes, unless something is given up for the time that it takes.
"""

from __future__ import annotations

import io
import re
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jinja2 import DictLoader, Environment, StrictUndefined
from markupsafe import Markup
from sympy import Eq, Expr, S, Symbol, sstr

import softdyn
from softdyn.derive.checks import chains
from softdyn.derive.dynamics import generic_dynamics, partials
from softdyn.derive.emit import emit
from softdyn.derive.films import Film, Films
from softdyn.derive.forms import force, force_unit
from softdyn.derive.kernel_form import operations_of, total_operations
from softdyn.derive.law import (
    dimensions_for,
    expressions,
    is_dry,
    is_rigid,
    law_hash,
    parameters_of,
    range_text,
    ranges_of,
)
from softdyn.derive.law_dynamics import law_quantities
from softdyn.derive.limits import Finding, ordering
from softdyn.derive.pair_equations import Needs
from softdyn.derive.pair_kernel import kernel_ir
from softdyn.derive.printing import KINDS
from softdyn.derive.regimes import Crossover, Diagram, Form, Regime, Side
from softdyn.derive.symbols import E, F, R, eta
from softdyn.derive.typeset import (
    RATES,
    condition_latex,
    correction_latex,
    form_latex,
    line_latex,
    name_latex,
    tangential_sections,
    to_latex,
)
from softdyn.derive.witness import side_of
from softdyn.errors import SoftdynError
from softdyn.findings import films_of, limits_of, regimes_of
from softdyn.results.whole_files import written_whole
from softdyn.stock import kinds
from softdyn.study.findings_text import holds_text, presence_text, same_size, twin
from softdyn.study.formulas import formula, widest
from softdyn.study.presence import ANYWHERE, Presences, presence_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from softdyn.derive.law import ContactLaw, Limit

#: Sets LaTeX; the second argument says it in words.
Show = Callable[[str, object], Markup]

#: Few telephones have a font that knows how formulas are set.
FONT = "math.woff2"
TEMPLATES = ("page.html.j2", "closure.html.j2", "style.css.j2")
MEANINGS = {R: "radius of the particles", E: "elastic modulus", eta: "viscosity of the fluid"}
ARGUMENTS = {"a": r"(h, \delta)", "F_ela": r"(a, \delta)", "zeta": "(a, h)", "F_adh": "(a, h)"}
GENERAL = {**ARGUMENTS, "F_ela": r"(a, \delta, h)", "F_adh": r"(a, h, \delta)"}
WHAT = {
    "a": "radius of the interacting region",
    "F_ela": "elastic force",
    "zeta": "normal friction coefficient",
    "F_adh": "remote force",
    "F": "transmitted force",
    "delta": "deflection",
    "C": "stiffness",
    "D": "friction of the centres",
    "dh_dt": "rate of the gap",
    "dX_dt": "rate of the distance",
    "U_h": "energy's slope in the gap",
    "sliding": "friction of sliding",
    "coupling": "friction that couples sliding and rolling",
    "rolling": "friction of rolling",
    "k_t": "tangential stiffness",
}
RIGID = "The particles are rigid: the elastic force is whatever keeps δ = 0, and the centres move as the gap does."
DRY = "No fluid resists: the gap closes at once, h = 0, and the centres follow the force."
EXPONENTS = {"lambda1": "local exponent of the deflection", "lambda2": "local exponent of the gap's rate"}
SLOPES = {
    "a_h": "radius by the gap",
    "a_delta": "radius by the deflection",
    "F_a": "elastic force by the radius",
    "F_delta": "elastic force by the deflection",
    "F_h": "elastic force by the gap",
}
RAISED = str.maketrans("-/0123456789", "⁻ᐟ⁰¹²³⁴⁵⁶⁷⁸⁹")
#: Width, in the font's size, of what still stands on a line of the page.
LINE = 46.0

#: Kinds of scenes, and what they need of a kernel; those of ``generated/`` first.
SCENES: dict[str, Needs] = {
    "approach: constant force, compression": kinds()["approach"],
    "general: any force, as a table; every output": kinds()["general"],
    "any force, as a table; X alone": Needs(drive="table", outputs=("X",)),
    "force as a table, compression": Needs(drive="table", deflection="compression", outputs=("a", "X", "dh_dt")),
    "pull-off: constant force, tension": Needs(deflection="tension", outputs=("a", "X", "dh_dt")),
    "approach in units of R and eta": Needs(
        deflection="compression", fixed={"R": "1", "eta": "1"}, outputs=("a", "X", "dh_dt")
    ),
}


def write_report(law: ContactLaw, path: Path) -> None:
    """Write a page on a law: declaration, derivation, limits, regimes, figures, kernels.

    Parameters
    ----------
    law : ContactLaw
    path : Path
        The file, HTML; it is written whole, or not at all.

    Raises
    ------
    SceneError
        If the file cannot be written.
    """
    with written_whole(path) as temporary:  # a path that cannot be written is refused before the work is done
        temporary.write_text(page(law), encoding="utf-8")


def page(law: ContactLaw) -> str:
    """Return the page on a law."""
    findings = limits_of(law)
    diagram = regimes_of(law)
    films = films_of(diagram)
    made = kernels(law)
    arguments = GENERAL if law.general else ARGUMENTS
    about = {
        "law": law,
        "hash": law_hash(law),
        "versions": {name: version(name) for name in ("sympy", "mpmath", "matplotlib")},
        "softdyn": softdyn.__version__,
        "summary": summary(findings, diagram, films),
        "declared": [
            {"name": WHAT[name], "formula": shown(f"{name_latex(name)}{arguments[name]} = {to_latex(expr)}", expr)}
            for name, expr in expressions(law).items()
        ],
        "note": RIGID if is_rigid(law) else DRY if is_dry(law) else "",
        "parameters": parameters(law, shown),
        "any_law": any_law(law, shown),
        "this_law": this_law(law, shown),
        "tangential": tangential(law, shown),
        "limits": [limit_entry(limit, findings, diagram, shown) for limit in law.limits],
        "figures": figures(diagram),
        "regimes": regimes(diagram, shown, presence_of(diagram)),
        "units": units(law, shown),
        "energy": energy(shown),
        "conservative": diagram.conservative,
        "film": film(law),
        "films": None if films is None else film_entries(films, diagram, shown),
        "kernels": made,
        "parts": next((list(kernel["operations"]) for kernel in made if not kernel["reason"]), []),
        "kinds": KINDS,
    }
    return rendered("page.html.j2", about)


def rendered(name: str, about: Mapping[str, Any]) -> str:
    """A page of a template in ``report``, with its style and the font of its formulas within it.

    Parameters
    ----------
    name : str
    about : Mapping from str
        What the template asks for.
    """
    folder = files("softdyn.templates").joinpath("report")
    texts = {name: folder.joinpath(name).read_text(encoding="utf-8") for name in TEMPLATES}
    made = Environment(
        loader=DictLoader(texts), undefined=StrictUndefined, autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    font = b64encode(folder.joinpath(FONT).read_bytes()).decode()
    return made.get_template(name).render(**about, style=made.get_template("style.css.j2").render(font=font))


def shown(latex: str, text: object) -> Markup:
    """A formula, from its LaTeX as of :mod:`softdyn.derive.typeset`, and the same in plain text: a str, or an Expr."""
    return Markup(formula(latex, text if isinstance(text, str) else sstr(text)))


def summary(findings: Sequence[Finding], diagram: Diagram, films: Films | None) -> list[str]:
    """What was found, in sentences.

    Parameters
    ----------
    findings : sequence of Finding
        Of all claimed limits.
    diagram : Diagram
    films : Films or None
        None of a law without remote forces, or without a fluid.
    """
    lines = []
    counts = {verdict: sum(f.verdict == verdict for f in findings) for verdict in ("proved", "disproved", "undecided")}
    if findings:
        parts = ", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count)
        limits = len({finding.limit for finding in findings})
        lines.append(f"{_count(len(findings), 'claim')} on {_count(limits, 'limit')}: {parts}.")
    else:
        lines.append("Its author claims no limits.")
    pressed = [regime for regime in diagram.regimes if regime.side == "compression"]
    inside = sum(regime.inside for regime in pressed)
    outside = len(pressed) - inside
    lines.append(
        f"{_count(inside, 'regime')} of gap and force in compression"
        + (f", and {outside} outside the model, where the deflection exceeds the radius." if outside else ".")
    )
    if diagram.conservative is not None:
        lines.append(
            "Conservative." if diagram.conservative else "Not conservative: its elastic energy depends on the gap."
        )
    if films is not None and films.branches is None:
        lines.append("Equilibrium films in numbers: unknown, since the law gives no typical values of all parameters.")
    elif films is not None and films.branches is not None:
        stable = sum(branch.stable for branch in films.branches)
        lines.append(
            f"Families of equilibrium films at typical parameters: {stable} stable, "
            f"{len(films.branches) - stable} unstable."
        )
    return lines


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}{'' if number == 1 else 's'}"


def parameters(law: ContactLaw, show: Show) -> list[dict[str, Any]]:
    """Rows of the table of parameters."""
    rows = []
    dimensions = dimensions_for(law)
    for symbol in parameters_of(law):
        bounds = ranges_of(law).get(symbol)
        if bounds is not None:
            signs = ["<" if is_open else r"\leq" for is_open in (bounds.left_open, bounds.right_open)]
            low, high = (to_latex(bound) for bound in (bounds.start, bounds.end))
            allowed = show(f"{low} {signs[0]} {to_latex(symbol)} {signs[1]} {high}", range_text(symbol, bounds))
        else:
            allowed = Markup("positive") if symbol.is_positive else Markup("any number")
        typical = law.typical.get(symbol)
        rows.append({
            "symbol": show(to_latex(symbol), symbol),
            "meaning": MEANINGS.get(symbol, "the law's own"),
            "dimension": re.sub(r"\^\(?([-\d/]+)\)?", lambda m: m[1].translate(RAISED), str(dimensions[symbol])),
            "allowed": allowed,
            "typical": "" if typical is None else show(to_latex(S(typical)), typical),
        })  # fmt: skip
    return rows


# --------------------------------------------------------------------------------------------------------- derivation


def any_law(law: ContactLaw, show: Show) -> list[dict[str, Any]]:
    """Steps that lead from eqs. 1 and 2 to eqs. 7 and 9, for any law of that kind."""
    generic = generic_dynamics(law.general)
    steps = [
        *generic.steps,
        *((f"{EXPONENTS[name]}, at constant force", Eq(Symbol(name), getattr(generic, name))) for name in EXPONENTS),
    ]
    return [
        {"text": _sentence(text), "formula": show(to_latex(step), f"{sstr(step.lhs)} = {sstr(step.rhs)}")}
        for text, step in steps
    ]


#: What the derivation calls its steps, as the paper numbers them.
NUMBERED = {
    "force balance, viscous part": "Force balance, viscous part (eq. 1)",
    "solved for dh/dt (eq. 7)": "Solved for the rate of the gap (eq. 7)",
    "force balance, elastic part, differentiated": "Force balance, elastic part (eq. 1), differentiated",
    "solved for d(delta)/dt": "Solved for the rate of the deflection",
    "geometry": "Geometry (eq. 2): distance of the centres",
    "centre dynamics (eq. 9)": "Distance differentiated, rates inserted: centre dynamics (eq. 9)",
}


def _sentence(text: str) -> str:
    return NUMBERED.get(text, text[:1].upper() + text[1:])


def this_law(law: ContactLaw, show: Show) -> list[dict[str, Any]]:
    """The same for one law: partial derivatives, then what follows from them."""
    slopes = {"a_h"} if is_rigid(law) else SLOPES.keys() - ({"F_h"} if not law.general else set())
    found: dict[str, Expr] = {symbol.name: expr for symbol, expr in partials(law).items() if symbol.name in slopes}
    quantities = law_quantities(law)
    after = ("C", "D", "dh_dt", "dX_dt", "lambda1", "lambda2")
    found |= {name: quantities[name] for name in after if name in quantities}
    lines = []
    for name, expr in found.items():
        latex = f"{name_latex(name)} = {to_latex(expr)}"
        fits = widest(latex) <= LINE
        lines.append({
            "text": {**WHAT, **EXPONENTS, **SLOPES}[name],
            "formula": show(latex, f"{name} = {sstr(expr)}") if fits else show(name_latex(name), name),
            "long": not fits,
        })  # fmt: skip
    return lines


def tangential(law: ContactLaw, show: Show) -> list[dict[str, Any]]:
    """What the law declares of tangential motion, and what any law makes of that; nothing, if it declares none."""
    found = []
    for name, value in (line for lines in tangential_sections(law).values() for line in lines):
        step = value if isinstance(value, Eq) else Eq(Symbol(name), value, evaluate=False)
        found.append({
            "text": _sentence(WHAT.get(name, name)),
            "formula": show(to_latex(step), f"{sstr(step.lhs)} = {sstr(step.rhs)}"),
        })  # fmt: skip
    return found


# ------------------------------------------------------------------------------------------------------------- limits


def limit_entry(limit: Limit, findings: Sequence[Finding], diagram: Diagram, show: Show) -> dict[str, Any]:
    """One claimed limit and the verdicts on what it claims.

    Parameters
    ----------
    limit : Limit
    findings : sequence of Finding
        Of all limits; those of this one are taken.
    diagram : Diagram
    show : Show
        Sets a formula, as :func:`shown` does.
    """
    law = diagram.law
    side: Side = "compression" if side_of(limit) > 0 else "tension"
    regime = next((r for r in diagram.regimes if r.side == side and limit.name in r.name.split(" / ")), None)
    balance = None if regime is None else regime.balance
    claims = []
    for finding in findings:
        if (finding.limit, finding.ordering) != (limit.name, ordering(limit)):
            continue
        claimed = finding.claimed.subs(F, force) if side == "compression" else finding.claimed
        written = form_latex(claimed, law, finding.quantity in RATES, balance)
        claims.append({
            "quantity": WHAT.get(finding.quantity, finding.quantity),
            "claim": show(
                rf"{name_latex(finding.quantity)} \simeq {written}", f"{finding.quantity} ~ {sstr(finding.claimed)}"
            ),
            "verdict": finding.verdict,
            "reason": finding.reason,
            "chain": [
                show(rf"{to_latex(whole)} \to {to_latex(term)}", f"{_words(whole)} -> {_words(term)}")
                for whole, term in finding.chain
            ],
            "ratio": None if finding.ratio is None else ratio(finding, law, show),
            "certificate": [(decimal(eps), decimal(deviation)) for eps, deviation in finding.certificate],
            "set": holds_text(finding),
            "witness": [
                (", ".join(f"{name} = {value}" for name, value in at.items()), found)
                for at, found in (() if finding.witness is None else finding.witness.points)
            ],
        })  # fmt: skip
    order = [r" \ll ".join(to_latex(size) for size in chain) for chain in chains(limit)]
    words = [" << ".join(sstr(size) for size in chain) for chain in chains(limit)]
    return {
        "name": limit.name,
        "order": [show(latex, text) for latex, text in zip(order, words, strict=True)],
        "claims": claims,
    }


@lru_cache(maxsize=512)  # claims of one limit rest on the same sums
def _words(expr: Expr) -> str:
    return str(sstr(expr))


def ratio(finding: Finding, law: ContactLaw, show: Show) -> Markup:
    """Found over claimed, and how fast it gets there.

    Parameters
    ----------
    finding : Finding
        One with a ratio.
    law : ContactLaw
    show : Show
        Sets a formula, as :func:`shown` does.
    """
    assert finding.ratio is not None
    number = to_latex(finding.ratio)
    latex, text = number, sstr(finding.ratio)
    if finding.rate:
        changes = correction_latex(finding.rate, True, law)
        latex = changes if finding.ratio == 1 else rf"{number} \left({changes}\right)"
        latex += r" + \ldots" if finding.ratio == 1 else ""
        text += " times 1 + " + " + ".join(f"({sstr(term)})" for term in finding.rate)
    return show(latex, text)


def decimal(value: float) -> str:
    """A number to three digits, as it is written by hand."""
    mantissa, _, exponent = f"{value:.3g}".partition("e")
    if not exponent:
        return mantissa.replace("-", "−")
    power = str(int(exponent)).translate(RAISED)
    return f"10{power}" if mantissa == "1" else f"{mantissa}·10{power}".replace("-", "−")


# ------------------------------------------------------------------------------------------------------------ regimes


def units(law: ContactLaw, show: Show) -> list[Markup]:
    """What forms are written in."""
    unit = force_unit(law)
    return [
        # on a line of text: no fractions
        show(rf"\kappa = F/{'({})' if unit.is_Mul else '{}'}".format(to_latex(unit)), f"kappa = F/({unit})"),
        show(r"V = F/(\eta R)", "V = F/(eta R)"),
    ]


def regimes(diagram: Diagram, show: Show, found: Presences) -> dict[str, Any]:
    """Regimes of both sides, those in tension where they differ; crossovers and points.

    Parameters
    ----------
    diagram : Diagram
    show : Show
        Sets a formula, as :func:`shown` does.
    found : mapping
        Of :func:`softdyn.study.presence.presence_of`.
    """
    twins = {(r.side, r.name): twin(diagram, r) for r in diagram.regimes}
    same = all(twins[r.side, r.name] is not None for r in diagram.regimes if r.side == "tension")
    tension = [r for r in diagram.regimes if r.side == "tension"]
    own = [regime_entry(r, diagram, show, found) for r in tension if twins[r.side, r.name] is None]
    differing = []
    for regime in tension:
        other = twins[regime.side, regime.name]
        if other is None:
            continue
        names = [name for name, form in regime.forms.items() if not same_size(form, other.forms[name])]
        if names:
            differing.append({"name": regime.name, "forms": form_rows(regime, names, diagram, show)})
    sides: list[Side] = ["compression"] if same else ["compression", "tension"]
    return {
        "compression": [regime_entry(r, diagram, show, found) for r in diagram.regimes if r.side == "compression"],
        "absent": [
            r.name
            for r in tension
            if twins[r.side, r.name] is not None and not found.get((r.side, r.name), ANYWHERE).there
        ],
        "tension": own,
        "pulled": bool(tension),
        "same": same,
        "differing": differing,
        "crossovers": [crossover_entry(c, diagram, show) for c in diagram.crossovers if c.side in sides],
        "points": [
            {
                "side": point.side,
                "regimes": point.regimes,
                "at": [
                    _line(Symbol("h"), point.h, diagram.law, show),
                    _line(force, point.force, diagram.law, show),
                ],
            }
            for point in diagram.points
            if point.side in sides
        ],
        "sides": sides,
        "scales": [show(rf"{to_latex(s)} = {to_latex(S(diagram.law.typical[s]))}", s) for s in diagram.scales],
        "exponents": [
            show(f"{to_latex(s)} = {to_latex(value)}", f"{s} = {value}") for s, value in diagram.exponents.items()
        ],
    }


def regime_entry(regime: Regime, diagram: Diagram, show: Show, found: Presences) -> dict[str, Any]:
    """One regime: where it is, whether it is there at typical values, and the forms of all quantities.

    Parameters
    ----------
    regime : Regime
    diagram : Diagram
    show : Show
        Sets a formula, as :func:`shown` does.
    found : mapping
        Of :func:`softdyn.study.presence.presence_of`; regimes that are not in it are told without their presence.
    """
    law = diagram.law
    presence = found.get((regime.side, regime.name))
    return {
        "name": regime.name,
        "side": regime.side,
        "inside": regime.inside,
        "absent": presence is not None and not presence.there,
        "presence": "" if presence is None else presence_text(presence),
        "conditions": [
            show(condition_latex(c.small, c.large, law), f"{sstr(c.small)} << {sstr(c.large)}")
            for c in regime.conditions
        ],
        "exponents": [
            None if exponent is None else show(to_latex(exponent), exponent)
            for exponent in (regime.lambda1, regime.lambda2)
        ],
        "shown": [
            "undecided" if name in regime.undecided else _leading(name, regime, law, show)
            for name in ("delta", "dh_dt")
        ],
        "forms": form_rows(regime, list(regime.forms), diagram, show),
        "undecided": [
            {"quantity": WHAT.get(name, name), "symbol": show(name_latex(name), name), "reason": reason}
            for name, reason in regime.undecided.items()
        ],
        "edge": None if regime.edge is None else _line(force, regime.edge, law, show),
    }


def _leading(name: str, regime: Regime, law: ContactLaw, show: Show) -> Markup | None:
    if name not in regime.forms:
        return None
    leading = regime.forms[name].leading
    return show(form_latex(leading, law, name in RATES, regime.balance), leading)


def form_rows(regime: Regime, names: Sequence[str], diagram: Diagram, show: Show) -> list[dict[str, Any]]:
    """Leading forms of some quantities, with the next corrections.

    Parameters
    ----------
    regime : Regime
    names : sequence of str
        Of quantities of which the regime has forms.
    diagram : Diagram
    show : Show
        Sets a formula, as :func:`shown` does.
    """
    law = diagram.law

    def corrections(form: Form) -> Markup | None:
        if not form.corrections:
            return None
        latex = correction_latex(form.corrections, form.resolved, law, regime.balance)
        return show(latex, "1 + " + " + ".join(f"({sstr(term)})" for term in form.corrections))

    return [
        {
            "quantity": WHAT[name],
            "form": show(
                rf"{name_latex(name)} \simeq "
                + form_latex(regime.forms[name].leading, law, name in RATES, regime.balance),
                f"{name} ~ {sstr(regime.forms[name].leading)}",
            ),
            "corrections": corrections(regime.forms[name]),
        }
        for name in names
    ]


def crossover_entry(crossover: Crossover, diagram: Diagram, show: Show) -> dict[str, Any]:
    """One crossover: the line, and where else quantities other than its own would put it.

    Parameters
    ----------
    crossover : Crossover
    diagram : Diagram
    show : Show
        Sets a formula, as :func:`shown` does.
    """
    line = crossover.line
    return {
        "first": crossover.first,
        "second": crossover.second,
        "side": crossover.side,
        "line": _line(line.lhs, line.rhs, diagram.law, show),
        "quantity": show(name_latex(crossover.quantity), crossover.quantity) if crossover.quantity else None,
        "others": [
            (show(name_latex(name), name), _line(line.lhs, rhs, diagram.law, show))
            for name, rhs in crossover.others.items()
        ],
    }


def _line(left: Expr, right: Expr, law: ContactLaw, show: Show) -> Markup:
    return show(" = ".join(line_latex(left, right, law)), f"{left} = {sstr(right)}")


def energy(show: Show) -> list[Markup]:
    """The energy of a contact, and its balance."""
    ela = to_latex(Symbol("F_ela"))
    return [
        show(
            rf"U(h, \delta) = \int_0^{{\,\delta}} 2 {ela}(a(h, \delta'), \delta')\,\mathrm{{d}}\delta'",
            "U(h, delta) = integral from 0 to delta of 2 F_ela(a(h, s), s) ds",
        ),
        show(
            r"-\int\, F_\mathrm{ext}\,\mathrm{d}X = \Delta U - \int\, U_h\,\mathrm{d}h"
            r" + \int\, \zeta \dot{h}^2\,\mathrm{d}t + \Delta W",
            "- integral of F_ext dX = change of U - integral of U_h dh + integral of zeta (dh/dt)^2 dt + change of W",
        ),
        show(r"F_\mathrm{adh} = -\mathrm{d}W/\mathrm{d}h", "F_adh = -dW/dh"),
    ]


def film_entries(films: Films, diagram: Diagram, show: Show) -> dict[str, Any]:
    """Equilibrium films: in closed form, between regimes, and in numbers.

    Parameters
    ----------
    films : Films
    diagram : Diagram
        Of the same law.
    show : Show
        Sets a formula, as :func:`shown` does.
    """
    law = diagram.law

    def leading(film: Film) -> Markup | None:
        balance = diagram.regime(film.closing, film.side).balance
        return None if film.rate is None else show(form_latex(film.rate, law, balance=balance), film.rate)

    rate = rf"s = {to_latex(films.rate)}"
    gap = None if films.h_eq is None else rf"h_\mathrm{{eq}} = {to_latex(films.h_eq)}"
    return {
        "h_eq": None if gap is None else show(gap, f"h_eq = {sstr(films.h_eq)}"),
        "rate": show(rate, f"s = {sstr(films.rate)}"),
        "films": [
            {
                "side": film.side,
                "closing": film.closing,
                "opening": film.opening,
                "stable": {True: "stable", False: "unstable", None: "edge"}[film.stable]
                + (", but none such at the typical parameters" if film.found is False else ""),
                "gap": None if film.h_eq is None else show(to_latex(film.h_eq), film.h_eq),
                "rate": leading(film),
                "edge": None if film.edge is None else _line(F, film.edge, law, show),
            }
            for film in films.films
        ],
        "branches": [
            {
                "stable": "stable" if branch.stable else "unstable",
                "ranges": [
                    f"{decimal(values[0])} … {decimal(values[-1])}" for values in (branch.h, branch.force, branch.rate)
                ],
            }
            for branch in films.branches or ()
        ],
    }


# ------------------------------------------------------------------------------------------------------------ figures


def figures(diagram: Diagram) -> list[dict[str, Any]]:
    """The map of the regimes and the curves along lines of constant force, or why there is none."""
    from softdyn.study import phases

    names = ", ".join(dict.fromkeys(regime.name for regime in diagram.regimes if regime.side == "compression"))
    drawn = []
    for draw, alt in (
        (phases.phase_diagram, f"Map of the regimes over gap and force, on logarithmic scales: {names}."),
        (
            phases.exponent_plots,
            "Deflection, rate of the gap and their local exponents against the gap, at several constant forces, "
            "with the leading forms of each regime.",
        ),
    ):
        try:
            figure = draw(diagram)
            tall = figure.get_figheight() > figure.get_figwidth()
            drawn.append({"alt": alt, "source": data_address(figure), "reason": "", "tall": tall})
        except SoftdynError as reason:
            drawn.append({"alt": alt, "source": "", "reason": str(reason), "tall": False})
    return drawn


def film(law: ContactLaw) -> dict[str, Any] | None:
    """The law's film against elastohydrodynamics, if that describes it."""
    from softdyn.study import elastohydrodynamics as ehd

    if not ehd.applies(law):
        return None
    off = ehd.deviation(law)
    low, high = (f"{x:g}".replace("-", "−") for x in ehd.INSIDE)
    return {
        "source": data_address(ehd.draw(law)),
        "between": f"w/h = {low} and {high}",
        "band": f"{100 * ehd.BAND:.0f} %",
        "off": f"{100 * (off - 1):.0f} %" if off < 1.5 else f"a factor of {decimal(off)}",
        "elastic": ehd.is_half_space(law),
    }


def data_address(figure: Figure) -> str:
    """A figure as SVG within the page: in an image, its names and scripts, if any, cannot touch the page."""
    from softdyn.study.figures import paper_style

    buffer = io.BytesIO()
    with paper_style():
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return "data:image/svg+xml;base64," + b64encode(buffer.getvalue()).decode()


# ------------------------------------------------------------------------------------------------------------ kernels


def kernels(law: ContactLaw) -> list[dict[str, Any]]:
    """Kernels of a law for several kinds of scenes, with their operations and source; or why there is none."""
    entries: list[dict[str, Any]] = []
    for scene, needs in SCENES.items():
        used = {symbol.name for symbol in parameters_of(law)}
        needs = replace(needs, fixed={name: value for name, value in needs.fixed.items() if name in used})
        try:
            ir = kernel_ir(law, needs)
        except SoftdynError as reason:
            entries.append({"scene": scene, "reason": str(reason)})
            continue
        source = emit(ir, "c")
        # the force is no part of a law
        parts = {part: PARTS.get(part, part.replace("_", " ")) for part in ir.functions if part != "force"}
        entries.append({
            "scene": scene,
            "reason": "",
            "operations": {name: sum(ir.functions[part].operations.values()) for part, name in parts.items()},
            "kinds": {kind: sum(counts[kind] for counts in operations_of(ir).values()) for kind in KINDS},
            "total": total_operations(ir),
            "savings": ir.savings,
            "outputs": ir.settings["outputs"],
            "code": {
                name: "\n".join(f"{left} = {right}" for left, right in ir.functions[part].lines)
                for part, name in parts.items()
            },
            "source": source,
            "length": len(source.splitlines()),
        })  # fmt: skip
    return entries


#: What parts of a kernel are called, where not by their names.
PARTS = {"balance": "force balance", "slopes": "for stiff steps", "quantities": "outputs"}
