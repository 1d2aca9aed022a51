"""Formulas as LaTeX, and a derivation as text, LaTeX or plain data.

Formulas are LaTeX that MathJax, amsmath and matplotlib's mathtext all understand: factors and terms in the customary
order, roots joined, names of several letters upright. What a law, its derivation, the verdicts on its limits and its
regimes show of themselves in a notebook is made here too.
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from html import escape
from math import lcm
from typing import TYPE_CHECKING

from sympy import (
    Abs,
    Add,
    Dummy,
    Eq,
    Expr,
    Matrix,
    Mul,
    Piecewise,
    Pow,
    Rational,
    S,
    Symbol,
    exp,
    factorrat,
    log,
    sstr,
    true,
)
from sympy.printing.conventions import split_super_sub
from sympy.printing.latex import LatexPrinter, greek_letters_set

from softdyn.derive.dominant_balance import size
from softdyn.derive.dynamics import GenericDynamics, generic_dynamics, partials
from softdyn.derive.forms import V, as_product, force, force_unit, kappa
from softdyn.derive.forms import x as gap_ratio
from softdyn.derive.law import Drag, drag_expressions, expressions, rubbing_expressions, tangential_expressions
from softdyn.derive.law_dynamics import law_jacobians, law_quantities
from softdyn.derive.symbols import R, eta, h
from softdyn.derive.tangential import motion

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw
    from softdyn.derive.limits import Finding
    from softdyn.derive.regimes import Diagram

#: How the names of the code are typeset.
LATEX_NAMES = {
    "delta": r"\delta",
    "zeta": r"\zeta",
    "F": r"F_\mathrm{ext}",
    "F_ela": r"F_\mathrm{ela}",
    "F_adh": r"F_\mathrm{adh}",
    "dT_dt": r"\dot{T}",
    "k_t": r"k_t",
    "size_ratio": r"s_{12}",
    "dF_dt": r"\dot{F}_\mathrm{ext}",
    "dh_dt": r"\dot{h}",
    "ddelta_dt": r"\dot{\delta}",
    "dX_dt": r"\dot{X}",
    "lambda1": r"\lambda_1",
    "lambda2": r"\lambda_2",
    "F_adh_a": r"F_{\mathrm{adh},a}",
    "F_adh_h": r"F_{\mathrm{adh},h}",
    "F_adh_delta": r"F_{\mathrm{adh},\delta}",
    "F_h": r"F_h",
    "F_ah": r"F_{ah}",
    "F_hh": r"F_{hh}",
    "F_hdelta": r"F_{h\delta}",
    "a_h": r"a_h",
    "a_delta": r"a_\delta",
    "F_a": r"F_a",
    "F_delta": r"F_\delta",
    "zeta_a": r"\zeta_a",
    "zeta_h": r"\zeta_h",
    "a_hh": r"a_{hh}",
    "a_hdelta": r"a_{h\delta}",
    "a_deltadelta": r"a_{\delta\delta}",
    "F_aa": r"F_{aa}",
    "F_adelta": r"F_{a\delta}",
    "F_deltadelta": r"F_{\delta\delta}",
    "net": r"F_\mathrm{ext} - F_\mathrm{adh}",
    # what Python leaves of lambda
    "lam": r"\lambda",
    "lamda": r"\lambda",
    "ell": r"\ell",
}

#: Greek capitals that look like no Latin ones.
CAPITALS = frozenset("Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega".split())

#: The order in which factors and terms are written; "" stands for all other names.
RANK = {name: i for i, name in enumerate("pi|eta|E||kappa|dF_dt|F|V|R|a|h|delta|X|dh_dt|ddelta_dt".split("|"))}

#: (name or description, expression or equation)
Line = tuple[str, Expr | Eq | Matrix]

#: Quantities that are rates, and are written in V = F/(eta R).
RATES = ("dh_dt", "dX_dt")


# ----------------------------------------------------------------------------------------------------------- formulas


def symbol_latex(name: str) -> str:
    """Typeset a name of the code: Greek as Greek, words upright, what follows "_" or a trailing number below."""
    if name in LATEX_NAMES:
        return LATEX_NAMES[name]
    base, above, below = split_super_sub(name)
    if above:  # "__": nobody means it
        base, below = name, []
    text = _word(base)
    return text + (rf"_{{{','.join(map(_word, below))}}}" if below else "")


def _word(name: str) -> str:
    if name in greek_letters_set or name in CAPITALS:
        return rf"\{name}"
    if len(name) == 1 or name.isdigit():
        return name
    return r"\mathrm{" + re.sub(r"([_%$#&{}])", r"\\\1", name) + "}"


def to_latex(expr: Expr | Eq | Matrix, names: Mapping[str, str] | None = None) -> str:
    """LaTeX of an expression in the paper's notation; ``names`` says how some are typeset here."""
    return str(_Printer(names or {}).doprint(expr))


class _Printer(LatexPrinter):
    """sympy's, with factors and terms in the customary order, and roots joined."""

    def __init__(self, names: Mapping[str, str]) -> None:
        super().__init__({"fold_short_frac": False, "ln_notation": True})
        self.names = names

    def _print_Symbol(self, symbol: Symbol, style: str = "plain") -> str:
        # positive F is a size, real F the external force
        own = {"F": "F"} if symbol == force else {}
        return {**own, **self.names}.get(symbol.name) or symbol_latex(symbol.name)

    def _print_Rational(self, number: Rational) -> str:
        return str(number.p) if number.q == 1 else self._product((number,))

    def _print_Piecewise(self, expr: Piecewise) -> str:
        # in one line, which mathtext sets, too
        cases = [
            rf"{self._print(value)}\ \mathrm{{{'else' if asked == true else 'if'}}}"
            + ("" if asked == true else rf"\ {self._print(asked)}")
            for value, asked in expr.args
        ]
        return r"\left\{" + r";\ ".join(cases) + r"\right\}"

    def _print_Abs(self, expr: Abs, power: str | None = None) -> str:
        (inner,) = expr.args
        text = self._print(inner)
        bars = f"|{text}|" if inner.is_Symbol else rf"\left|{text}\right|"
        return bars if power is None else f"{bars}^{{{power}}}"

    def _print_sign(self, expr: Expr, power: str | None = None) -> str:
        text = rf"\mathrm{{sign}}\left({self._print(expr.args[0])}\right)"
        return text if power is None else f"{_bracketed(text)}^{{{power}}}"

    def _print_log1p(self, expr: Expr) -> str:
        return str(self._print(log(1 + expr.args[0])))

    def _print_expm1(self, expr: Expr) -> str:
        return _bracketed(self._print(exp(expr.args[0]) - 1))

    def _print_ExpBase(self, expr: Expr, power: str | None = None) -> str:
        text = self._print(expr.args[0])
        if len(text) > 40:
            text = rf"\exp\left({text}\right)"
            return text if power is None else rf"\left[{text}\right]^{{{power}}}"
        return f"e^{{{_small(text)}}}" if power is None else rf"\left(e^{{{_small(text)}}}\right)^{{{power}}}"

    def _print_Add(self, expr: Add, order: object = None) -> str:
        content, whole = _content(expr)
        if content.q > 1:
            return self._product((content, whole))
        terms = sorted(expr.args, key=_rank)
        first = next((term for term in terms if not _negative(term)), terms[0])
        terms = [first, *(term for term in terms if term is not first)]
        text = ""
        for term in terms:
            inner = self._print(term)
            sign, inner = (" - ", inner[1:]) if inner.startswith("-") else (" + ", inner)
            text += (sign if text else sign.strip(" +")) + inner
        return text

    def _print_Mul(self, expr: Mul) -> str:
        return self._product(Mul.make_args(expr))

    def _print_Pow(self, expr: Pow) -> str:
        base, power = expr.as_base_exp()
        if power.is_Rational and (power < 0 or power.q > 1):
            return self._product((expr,))
        return f"{self._base(base)}^{{{_small(self._print(power))}}}"

    def _product(self, factors: Sequence[Expr]) -> str:
        """A number times powers: a fraction if some are negative, with one square root above and one below."""
        number, rest = S.One, []
        for factor in factors:
            if factor.is_Rational:
                number *= factor
            elif factor.as_base_exp()[0].is_Add and factor.as_base_exp()[1].is_Integer:
                base, power = factor.as_base_exp()
                content, whole = _content(base)
                if whole.as_coeff_Add()[0].is_negative:  # rather -(1 - x) than x - 1
                    content, whole = -content, -whole
                number *= content**power
                rest.append(whole**power)
            else:
                rest.append(factor)
        radicals, rest = _radicals(rest)
        index = lcm(*(power.q for _, power in radicals))
        radicand = Mul(*(base ** (power * index) for base, power in radicals))
        sides: tuple[list[tuple[Expr, Expr]], ...] = ([], [])
        roots: tuple[list[Expr], ...] = ([], [])
        for factor in rest:
            base, power = (factor, S.One) if isinstance(factor, exp) else factor.as_base_exp()
            if not power.is_Rational:
                base, power = factor, S.One
            if abs(power) == S.Half:
                roots[power.is_negative].append(base)
            else:
                sides[power.is_negative].append((base, abs(power)))
        if index == 2 and roots[0]:
            roots[0].append(radicand)
            radicand, index = S.One, 1
        decades = len(str(number.q)) - 1
        if decades > 2 and number.q == 10**decades:
            top = [*([] if abs(number.p) == 1 else [str(abs(number.p)), r"\cdot"]), f"10^{{-{decades}}}"]
            number = S(number.p)
        else:
            top = [] if abs(number.p) == 1 else [str(abs(number.p))]
        if radicand != 1:
            top.append((r"\sqrt" if index == 2 else rf"\sqrt[{index}]") + f"{{{self._print(radicand)}}}")
        bottom = [] if number.q == 1 else [str(number.q)]
        texts = []
        for side, parts, under in zip((top, bottom), sides, roots, strict=True):
            ordered = sorted(parts, key=lambda part: _rank(part[0]))
            alone = not side and not under and len(ordered) == 1 and ordered[0][1] == 1
            written = [self._print(ordered[0][0])] if alone else [self._power(base, power) for base, power in ordered]
            if under:
                within = [factor for root in under for factor in Mul.make_args(root)]
                written.append(rf"\sqrt{{{self._product(within)}}}")
            # a lone sum over or under a bar needs no brackets
            texts.append((_join([*side, *written]), alone and ordered[0][0].is_Add))
        (above, sum_above), (below, _) = texts
        sign = "-" if number < 0 else ""
        if below:
            return rf"{sign}\frac{{{above or '1'}}}{{{below}}}"
        return sign + (_bracketed(above) if sum_above and sign else above or "1")

    def _power(self, base: Expr, power: Expr) -> str:
        if power == 1:
            text = self._print(base)
            return _bracketed(text) if base.is_Add or text.startswith("-") else text
        return f"{self._base(base)}^{{{_small(self._print(power))}}}"

    def _base(self, base: Expr) -> str:
        text = self._print(base)
        simple = (base.is_Symbol or base.is_Integer) and not text.startswith((r"\frac", r"\dot")) and "-" not in text
        return text if simple or isinstance(base, Abs) else _bracketed(text)


def _bracketed(text: str) -> str:
    return rf"\left({text}\right)"


def _small(text: str) -> str:
    """Fractions of an exponent on the line."""
    text = re.sub(r"^- ", "-", text)
    group = r"\{((?:[^{}]|\{(?:[^{}]|\{[^{}]*\})*\})*)\}"

    def on_the_line(match: re.Match[str]) -> str:
        top, bottom = match.groups()
        return f"{_closed(top) if re.search('[-+]', top) else top}/{_closed(bottom)}"

    plain = re.sub(r"\\frac" + group + group, on_the_line, text)
    return text if r"\frac" in plain else plain


def _closed(text: str) -> str:
    return text if re.fullmatch(r"-?\\?\w+(_?\{\w+\})?", text) else f"({text})"


#: What does not stand close to the factor before it.
WIDE = re.compile(r"\\(mathrm|operatorname|frac|sqrt\[|exp|ln|[a-z]*(sin|cos|tan)h?\b)")


def _join(parts: Sequence[str]) -> str:
    """Factors side by side, with a space where two would read as one."""
    text = ""
    for part in parts:
        wide = WIDE.match(part) or (text.endswith("}") and not part.startswith(r"\left("))
        text += (r"\," if wide and text else " " if text else "") + part
    return text


def _content(total: Expr) -> tuple[Rational, Expr]:
    """A sum as a number times a sum, where all of its terms have the same."""
    content, whole = total.primitive()
    same = all(abs(term.as_coeff_Mul()[0]) == content for term in total.args)
    return (content, whole) if same else (S.One, total)


def _negative(term: Expr) -> bool:
    return bool(term.as_coeff_Mul()[0].is_negative)


@lru_cache(maxsize=4096)  # to write a long sum takes longer than to set it
def _rank(expr: Expr) -> tuple[bool, bool, list[tuple[int, str]], str]:
    """Numbers, then symbols, then sums and functions; each by the symbols in it."""
    symbols = sorted((RANK.get(symbol.name, RANK[""]), symbol.name) for symbol in expr.free_symbols)
    return not expr.is_number, not (expr.is_Symbol or expr.is_number or expr.is_Mul or expr.is_Pow), symbols, sstr(expr)


def _radicals(factors: Iterable[Expr]) -> tuple[list[tuple[Expr, Rational]], list[Expr]]:
    """Roots of whole numbers, as (number, power), and the other factors."""
    roots, others = [], []
    for factor in factors:
        base, power = factor.as_base_exp()
        if base.is_Integer and base > 0 and power.is_Rational and power > 0:
            roots.append((base, power))
        else:
            others.append(factor)
    return roots, others


def form_latex(form: Expr, law: ContactLaw, rate: bool = False, balance: Expr | None = None) -> str:
    r"""LaTeX of a leading form, as :math:`(\frac{9\sqrt{2}}{8} \kappa)^{2/3} R`.

    Parameters
    ----------
    form : Expr
        In h, \|F\| and the parameters.
    law : ContactLaw
    rate : bool
        Whether it is a rate, written in V = F/(eta R).
    balance : Expr or None
        Leading form of F in h and delta: its number stands by kappa, where that leaves a simpler one outside.
    """
    unit = force_unit(law)
    sums: dict[Expr, Expr] = {}
    hidden = _hidden(form, sums)
    product = as_product(hidden, unit)
    if product is None:
        return to_latex(form)
    if rate and product.powers.keys() & unit.free_symbols - {R}:
        product = as_product(hidden, unit, rate=True) or product
    number = product.number * Mul(*(s**power for s, power in product.powers.items() if s in sums))
    powers = {symbol: power for symbol, power in product.powers.items() if symbol not in sums}
    k, p = powers.get(kappa, S.Zero), powers.pop(gap_ratio, S.Zero)
    alone = V not in powers and not (form.has(force) and form.has(*unit.free_symbols - {R}))
    if alone and (powers.keys() - {kappa} or form.has(force)):
        return to_latex(form)  # neither kappa nor h/R are to the point
    after = []
    if k and not k.is_Integer:
        balanced = S.One if balance is None else _hidden(balance, sums)
        inside = _number_by_force(
            number, powers.pop(kappa), balanced.as_independent(*balanced.free_symbols - sums.keys())[0]
        )
        number = _collected(number / inside**k)
        after.append(_raised(to_latex((inside * kappa).subs(sums)), k, inside != 1))
    if abs(p) == 1:
        powers[h], powers[R] = p, powers.get(R, S.Zero) - p
    elif p:
        text = r"\frac{h}{R}" if p > 0 else r"\frac{R}{h}"
        after.append(_raised(text, abs(p), closed=True))
    before = to_latex(Mul(number.subs(sums), *(symbol**power for symbol, power in powers.items())))
    if not after:
        return before
    return _join([*({"1": [], "-1": ["-"]}.get(before, [before])), *after])


def _hidden(product: Expr, sums: dict[Expr, Expr]) -> Expr:
    """A product with symbols for the sums in it, which are added to ``sums``."""
    known = {value: symbol for symbol, value in sums.items()}
    factors = []
    for factor in Mul.make_args(product):
        base, power = factor.as_base_exp()
        if base.is_Add and not base.is_number:
            symbol = known.setdefault(base, Dummy(f"sum{len(known)}", positive=True))
            sums[symbol] = base
            factor = symbol**power
        factors.append(factor)
    return Mul(*factors)


def _raised(text: str, power: Expr, closed: bool) -> str:
    if power == 1:
        return text
    if power == S.Half:
        return rf"\sqrt{{{text}}}"
    return f"{_bracketed(text) if closed else text}^{{{_small(to_latex(power))}}}"


def _number_by_force(number: Expr, power: Expr, balance: Expr) -> Expr:
    """A number c such that number = c^power times something with no roots but square ones; 1/balance if it is one."""
    algebraic = abs(number.as_independent(S.Pi)[0])
    own = _collected(algebraic ** (1 / power))
    for inside in (1 / balance, *([own] if len(sstr(own)) <= len(sstr(algebraic)) else [])):
        factors = [*Mul.make_args(inside), *Mul.make_args(_collected(number / inside**power))]
        if all(p.is_Rational and p.q <= 2 for p in (factor.as_base_exp()[1] for factor in factors)):
            return inside
    return S.One


def _collected(number: Expr) -> Expr:
    """A product of roots of whole numbers, each prime once."""
    primes: dict[Expr, Expr] = {}
    others = []
    for factor in Mul.make_args(number):
        base, power = factor.as_base_exp()
        if not (base.is_Rational and base > 0 and power.is_Rational):
            others.append(factor)
            continue
        for prime, times in factorrat(base).items():
            primes[S(prime)] = primes.get(S(prime), S.Zero) + times * power
    return Mul(*others, *(prime**power for prime, power in primes.items()))


def condition_latex(small: Expr, large: Expr, law: ContactLaw) -> str:
    """One inequality between sizes, h, F or kappa first.

    Parameters
    ----------
    small, large : Expr
    law : ContactLaw
    """
    first, other, relation = (small, large, r"\ll") if small in (force, h, size) else (large, small, r"\gg")
    left, right = line_latex(first, other, law)
    return f"{left} {relation} {right}"


def line_latex(left: Expr, right: Expr, law: ContactLaw) -> tuple[str, str]:
    """Two sides of a relation between forces, or between lengths: in kappa and h/R, if the law's unit is in it.

    Parameters
    ----------
    left, right : Expr
    law : ContactLaw
    """
    unit = force_unit(law)
    if left == force and right.free_symbols & unit.free_symbols - {R}:
        return r"\kappa", form_latex(right / unit, law)
    return to_latex(left), to_latex(right)


def correction_latex(corrections: Sequence[Expr], resolved: bool, law: ContactLaw, balance: Expr | None = None) -> str:
    """The factor 1 + next terms of a leading form.

    Parameters
    ----------
    corrections : sequence of Expr
        Next terms, relative to the leading form.
    resolved : bool
        Whether there are no more.
    law : ContactLaw
    balance : Expr, optional
        As :func:`form_latex` takes it.
    """
    text = "1"
    for term in corrections:
        written = form_latex(term, law, balance=balance)
        text += f" - {written[1:].lstrip()}" if written.startswith("-") else f" + {written}"
    return text if resolved else text + r" + \ldots"


# --------------------------------------------------------------------------------------------------------- derivation


class Derivation(dict[str, list[Line]]):
    """Sections of a law's derivation, in reading order; a notebook shows them typeset."""

    def _repr_html_(self) -> str:
        return "".join(
            f"<p><b>{escape(title)}</b></p>$$\\begin{{aligned}} {escape(_aligned(lines))} \\end{{aligned}}$$"
            for title, lines in self.items()
        )


def derivation(law: ContactLaw) -> Derivation:
    """Sections of a law's derivation, in reading order."""
    generic = generic_dynamics(law.general)
    return Derivation({
        "declared": list(expressions(law).items()),
        "any law": [*generic.steps, *_generic_results(generic)],
        "Jacobians of any law, d(rates)/d(state)": list(generic.jacobians.items()),
        "this law": [
            *((symbol.name, expr) for symbol, expr in partials(law).items() if expr != 0 and "_" in symbol.name),
            *(item for item in law_quantities(law).items() if item[0] not in expressions(law)),
        ],
        "Jacobians of this law, d(rates)/d(state)": list(law_jacobians(law).items()),
        **({"unequal particles: friction over zeta, declared": [("unequal", law.unequal)]} if law.unequal != 1 else {}),
        **tangential_sections(law),
    })  # fmt: skip


def tangential_sections(law: ContactLaw) -> dict[str, list[Line]]:
    """What a law declares of tangential motion, and what follows; of what rubs; of drag, where not that of Stokes."""
    sections: dict[str, list[Line]] = {}
    if law.tangential is not None:
        sections["tangential motion, declared"] = list(tangential_expressions(law.tangential).items())
        sections["tangential motion of any law"] = list(motion())
    if law.rubbing is not None:
        sections["surfaces that touch and rub, declared"] = list(rubbing_expressions(law.rubbing).items())
    if law.drag != Drag():
        declared = drag_expressions(law.drag)
        sections["drag of a particle alone, declared"] = [(f"drag_{name}", expr) for name, expr in declared.items()]
    return sections


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
    if len(words) > 3:
        return rf"\text{{{name}}}"
    return " ".join({"ln": r"\ln"}.get(w, symbol_latex(w.rstrip(",")) + "," * w.endswith(",")) for w in words)


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


FORMATS = {"text": as_text, "latex": as_latex, "json": as_json}


# ------------------------------------------------------------------------------------------------------ for notebooks


def declaration_latex(law: ContactLaw) -> str:
    """Return the four expressions, as a notebook shows a law."""
    return _display(list(expressions(law).items()))


def generic_latex(generic: GenericDynamics) -> str:
    """Return what follows for any law, step by step, as a notebook shows it."""
    return _display([*generic.steps, *_generic_results(generic)])


def _display(lines: Sequence[Line]) -> str:
    return rf"$\displaystyle \begin{{aligned}} {_aligned(lines)} \end{{aligned}}$"


def _aligned(lines: Sequence[Line]) -> str:
    rows = []
    for name, value in lines:
        if isinstance(value, Eq):
            rows.append(rf"{to_latex(value.lhs)} &= {to_latex(value.rhs)} && \text{{{name}}}")
        elif isinstance(value, Matrix):
            rows.append(rf"J_{{({name_latex(name)})}} &= {to_latex(value)}")
        else:
            rows.append(f"{name_latex(name)} &= {to_latex(value)}")
    return r" \\ ".join(rows)


def findings_html(findings: Sequence[Finding]) -> str:
    """Table of verdicts on claims, with LaTeX between dollars, as a notebook shows it."""
    rows = [
        [
            _words(finding.limit),
            _words(finding.ordering),
            _math(rf"{name_latex(finding.quantity)} \simeq {to_latex(finding.claimed)}"),
            finding.verdict,
            "" if finding.ratio is None else _math(to_latex(finding.ratio)),
            _words("" if finding.verdict == "proved" else finding.reason),
            _words(f"{finding.holds}; {finding.samples} random paths" if finding.holds else ""),
        ]
        for finding in findings
    ]
    return _table(["limit", "ordering", "claim", "verdict", "found/claimed", "reason", "set, and paths into it"], rows)


#: Quantities of a regime that an overview shows.
OVERVIEW = ("a", "zeta", "delta", "dh_dt")


def diagram_html(diagram: Diagram, absent: Collection[tuple[str, str]] = ()) -> str:
    """Tables of regimes and of crossovers, with LaTeX between dollars, as a notebook shows them.

    Parameters
    ----------
    diagram : Diagram
    absent : collection of (side, name)
        Regimes that are not there at the law's typical values.
    """
    law, deflection = diagram.law, symbol_latex("delta")
    outside = f"{deflection} > R"
    regimes, lines = [], []
    for regime in diagram.regimes:
        forms = [
            _math(form_latex(regime.forms[name].leading, law, name in RATES, regime.balance))
            if name in regime.forms
            else _words(regime.undecided.get(name, ""))
            for name in OVERVIEW
        ]
        regimes.append([
            regime.side,
            _words(regime.name)
            + ("" if regime.inside else f" (outside the model: {_math(outside)})")
            + (" (absent there)" if (regime.side, regime.name) in absent else ""),
            ", ".join(_math(condition_latex(c.small, c.large, law)) for c in regime.conditions),
            *forms,
            *("" if exponent is None else _math(to_latex(exponent)) for exponent in (regime.lambda1, regime.lambda2)),
        ])  # fmt: skip
    for crossover in diagram.crossovers:
        line = " = ".join(line_latex(crossover.line.lhs, crossover.line.rhs, law))
        lines.append([crossover.side, _words(crossover.first), _words(crossover.second), _math(line)])
    units = rf"\kappa = {to_latex(force / force_unit(law))},\; V = {to_latex(force / (eta * R))}"
    conservative = {True: "U_h = 0", False: r"U_h \neq 0", None: ""}[diagram.conservative]
    heads = [_math(name_latex(name)) for name in (*OVERVIEW, "lambda1", "lambda2")]
    return (
        f"<p>{_words(law.name)}: {_math(units)}; {_math('F')} and {_math(deflection)} stand for their sizes. "
        f"{_math(conservative)}</p>"
        + _table(["side", "regime", "where", *heads], regimes)
        + (_table(["side", "between", "and", "crossover"], lines) if lines else "")
    )


def _math(text: str) -> str:
    return f"${escape(text)}$" if text else ""


def _words(text: str) -> str:
    """What somebody wrote: neither markup nor a formula."""
    return f'<span class="tex2jax_ignore mathjax_ignore">{escape(text)}</span>' if text else ""


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    def line(cells: Sequence[str], tag: str) -> str:
        return "<tr>" + "".join(f'<{tag} style="text-align: left">{cell}</{tag}>' for cell in cells) + "</tr>"

    body = "".join(line(row, "td") for row in rows)
    return f"<table><thead>{line(heads, 'th')}</thead><tbody>{body}</tbody></table>"
