"""What a scene does not need is left out of its kernel, the operations saved are counted, and nothing else changes."""

from __future__ import annotations

import ast
import math
import re
import subprocess
from collections import Counter
from dataclasses import fields
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from invented_laws import LAWS
from jinja2 import UndefinedError
from kernels_by_text import TextKernel, import_text
from sympy import Abs, Expr, Integer, Max, Min, Piecewise, Pow, Rational, Symbol, exp, pi, sqrt

import softdyn
from softdyn.derive import E, R, a, h
from softdyn.derive import emit as emit_module
from softdyn.derive.averaged_flow import averaged_flow
from softdyn.derive.contact_equations import ContactNeeds
from softdyn.derive.contact_kernel import contact_ir
from softdyn.derive.element_equations import ElementNeeds
from softdyn.derive.element_kernel import element_ir
from softdyn.derive.emit import emit, header
from softdyn.derive.kernel_form import KernelIR, operations_of, total_operations
from softdyn.derive.law import law_hash
from softdyn.derive.laws.equal_spheres import law as equal_spheres
from softdyn.derive.laws.rognon_gay import law as rognon_gay
from softdyn.derive.pair_equations import OUTPUTS, Needs
from softdyn.derive.pair_kernel import kernel_ir
from softdyn.derive.printing import KINDS, operations, straight_line
from softdyn.derive.rules import RULES
from softdyn.errors import LawError
from softdyn.expression import parse
from softdyn.targets import TARGETS
from softdyn.targets.c import compiler

ALL = Needs(drive="table", outputs=OUTPUTS)


@cache
def ir_of(name: str, **needs: Any) -> KernelIR:
    """Return the representation of a law's kernel; fixed parameters as pairs."""
    fixed = dict(needs.pop("fixed", ()))
    return kernel_ir(LAWS[name], Needs(**needs, fixed=fixed))


def text_of(name: str, target: str, **needs: Any) -> str:
    """Return the text of a law's kernel, without its head: comments and code alone."""
    text = emit(ir_of(name, **needs), target)
    return text.split("#include <stdint.h>", 1)[1] if target == "c" else text.split('"""', 2)[2]


def rules_of(ir: KernelIR) -> list[str]:
    """Return the names of the rules that were applied."""
    return [saving.rule for saving in ir.savings]


def words(text: str) -> set[str]:
    """Return every identifier in a text."""
    return set(re.findall(r"[A-Za-z_]\w*", text))


# ---------------------------------------------------------------- the rules


SCENES: list[dict[str, Any]] = [
    {"deflection": "compression"},
    {"deflection": "tension", "outputs": OUTPUTS},
    {"drive": "table", "outputs": OUTPUTS},
]


@pytest.mark.parametrize("name", list(LAWS))
@pytest.mark.parametrize("scene", SCENES, ids=["pushed", "pulled", "driven"])
def test_no_rule_costs_operations_and_they_add_up(name: str, scene: dict[str, Any]) -> None:
    ir = ir_of(name, **scene)
    assert [rule.name for rule in RULES if rule.name in rules_of(ir)] == rules_of(ir), "in the order of the rules"
    for saving in ir.savings:
        assert saving.after <= saving.before, saving
    for early, late in pairwise(ir.savings):
        assert late.before == early.after


@pytest.mark.slow
def test_each_rule_saves_operations() -> None:
    """Of the paper's law; its particles do not slide, and those that do need no rule for radii otherwise."""
    made = [
        ir_of("rognon_gay", deflection="compression", fixed=(("R", "1"),)),
        ir_of("rognon_gay", control="velocity"),
        contact_ir(rognon_gay, ContactNeeds()),
        contact_ir(equal_spheres, ContactNeeds(tangential=True)),
        element_ir(averaged_flow(2, 1), ElementNeeds(("us",), ("rho",), ("c",))),
    ]
    assert {rule for ir in made for rule in rules_of(ir)} == {rule.name for rule in RULES}
    for saving in (saving for ir in made for saving in ir.savings):
        assert saving.after < saving.before, saving


def test_what_an_expression_needs_besides_is_counted() -> None:
    """The slope of the rate by the force itself: 4 operations that a table of forces does not take."""
    moving, table = (ir_of("rognon_gay", drive=drive) for drive in (parse("sin(t)").shape, "table"))
    assert moving.functions["slopes"].operations != table.functions["slopes"].operations
    assert [saving.rule for saving in moving.savings] == [saving.rule for saving in table.savings]
    for one, other in zip(moving.savings, table.savings, strict=True):
        assert one.before > other.before
        assert one.after > other.after


@pytest.mark.parametrize(
    ("rule", "needs"),
    [
        ("one sign of delta", {"deflection": "either"}),
        ("constant force", {"drive": "table"}),
        ("constant force", {"control": "velocity"}),
        ("rigid drive", {}),
        ("rigid drive", {"control": "spring"}),
        ("constant force", {"drive": parse("sin(t)").shape}),
        ("fixed parameters", {}),
        ("outputs asked for", {"outputs": OUTPUTS}),
        ("outputs asked for", {"outputs": OUTPUTS[::-1]}),
    ],
)
def test_a_rule_that_does_not_apply_is_absent(rule: str, needs: dict[str, Any]) -> None:
    assert rule not in rules_of(ir_of("rognon_gay", **needs))


def test_a_remote_force_is_dropped_only_where_there_is_none() -> None:
    assert "no remote force" in rules_of(ir_of("rognon_gay"))
    assert "no remote force" not in rules_of(ir_of("screened"))


# ---------------------------------------------------------------- what is gone is gone


@pytest.mark.parametrize("target", TARGETS)
class TestText:
    """The emitted text itself."""

    def test_a_constant_force_has_no_rate(self, target: str) -> None:
        assert "dF_dt" not in words(text_of("rognon_gay", target, outputs=OUTPUTS))
        assert "dF_dt" in words(text_of("rognon_gay", target, drive="table", outputs=OUTPUTS))

    def test_a_law_without_remote_force_does_not_compute_it(self, target: str) -> None:
        outputs = tuple(name for name in OUTPUTS if name != "F_adh")
        assert "F_adh" not in words(text_of("rognon_gay", target, outputs=outputs))
        assert "F_adh" in words(text_of("screened", target, outputs=outputs))

    def test_a_zero_that_is_asked_for_is_a_constant(self, target: str) -> None:
        assert re.search(r"\bF_adh = 0\.0;?\n", text_of("rognon_gay", target, outputs=OUTPUTS))

    def test_one_sign_of_delta_needs_no_abs(self, target: str) -> None:
        for deflection in ("compression", "tension"):
            law = law_code(text_of("rognon_gay", target, outputs=OUTPUTS, deflection=deflection), target)
            assert "fabs" not in law
            assert "?" not in law
            assert " if " not in law
        law = law_code(text_of("rognon_gay", target, outputs=OUTPUTS), target)
        assert "fabs" in law
        assert (" ? " if target == "c" else " if ") in law

    def test_a_fixed_parameter_is_a_number(self, target: str) -> None:
        text = text_of("screened", target, outputs=OUTPUTS, fixed=(("R", "0.5"), ("ell", "0.3"), ("eta", "1e-3")))
        assert not {"R", "own_ell", "eta"} & words(code_alone(text, target))
        assert {"E", "own_strength"} <= words(text)
        fixed = (("R", "0.5"), ("ell", "0.3"), ("eta", "1e-3"))
        assert ir_of("screened", outputs=OUTPUTS, fixed=fixed).arrays["p"] == ("E", "strength")

    def test_outputs_that_nobody_asked_for_are_not_computed(self, target: str) -> None:
        text = text_of("rognon_gay", target, outputs=("X",))
        assert not {"zeta_out", "D", "C", "lambda1", "lambda2", "dX_dt", "ddelta_dt"} & words(text)
        assert "out[0 * n + i] = X" in text
        assert "out[1 * n" not in text

    def test_zeros_are_watched_for_only_where_there_can_be_any(self, target: str) -> None:
        """Of a force that depends on time, and of the deflection where the centres are moved."""
        assert "side" not in words(code_alone(text_of("rognon_gay", target), target))
        for needs in ({"drive": "table"}, {"control": "velocity"}):
            assert "side" in words(code_alone(text_of("rognon_gay", target, **needs), target))

    def test_the_text_is_the_same_every_time(self, target: str) -> None:
        first, again = (emit(kernel_ir(LAWS["branched"], ALL), target) for _ in range(2))
        assert first == again


def code_alone(text: str, target: str) -> str:
    """Drop comments and docstrings."""
    if target == "c":
        return re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    return re.sub(r"#.*", "", re.sub(r'""".*?"""', "", text, flags=re.DOTALL))


def law_code(text: str, target: str) -> str:
    """Return the code that evaluates the law, without the algorithms around it."""
    code = code_alone(text, target)
    if target == "c":
        found = functions_in_c(code)
    else:
        found = {node.name: ast.unparse(node) for node in ast.parse(code).body if isinstance(node, ast.FunctionDef)}
    return "\n".join(found[name] for name in ("_gap_terms", "_newton", "_gap_rate", "_quantities"))


# ---------------------------------------------------------------- nothing else changes


@pytest.mark.slow
@pytest.mark.parametrize("name", list(LAWS))
def test_specialised_kernels_give_the_numbers_of_the_general_one(name: str, tmp_path: Path) -> None:
    """The same formulas with other groupings: a few roundings apart, on the size of the terms that cancel.

    No bound beyond that of test_targets.py applies; 64 roundings of at most one unit each cover both kernels, and the
    conditioning at these states, within four decades of R, adds at most a factor 1e3 where a sum cancels.
    """
    draw = np.random.default_rng(5)
    n = 200
    gaps, size = 10 ** draw.uniform(-2, 1, n), 10 ** draw.uniform(-3, -0.3, n)
    force, rate = 10 ** draw.uniform(-3, 0, n), np.zeros(n)
    values = {"R": 1.25, "E": 2.5, "eta": 0.75, "strength": -0.25, "ell": 0.5, "tilt": 0.75, "rim": 0.25, "brush": 0.5}
    general = TextKernel(LAWS[name], ALL, "c", tmp_path)
    for side, deflection in ((1, "compression"), (-1, "tension")):
        p = np.array([values[parameter] for parameter in general.ir.arrays["p"]])
        expected = general.evaluate(p, gaps, side * size, F=side * force, dF_dt=rate)
        needs = Needs(deflection=deflection, fixed={"eta": "0.75", "E": "2.5"}, outputs=OUTPUTS)  # type: ignore[arg-type]
        special = TextKernel(LAWS[name], needs, "c", tmp_path)
        assert len(special.ir.arrays["p"]) == len(p) - 2
        q = np.array([values[parameter] for parameter in special.ir.arrays["p"]])
        found = special.evaluate(q, gaps, side * size, F=side * force)
        for output in OUTPUTS:
            scale = np.abs(expected[output]) + np.median(np.abs(expected[output]))
            assert (np.abs(found[output] - expected[output]) <= 64 * 2**-52 * 1e3 * scale).all(), output


@pytest.mark.slow
def test_fewer_outputs_have_the_same_bits(tmp_path: Path) -> None:
    """Leaving outputs out may regroup products, by a few roundings, but a alone is computed as it is among all."""
    gaps = np.geomspace(1e-9, 1e3, 300)
    deflections = np.geomspace(1e-12, 1, 300)
    p = np.array([1.1, 1.3, 1.7])
    some = TextKernel(rognon_gay, Needs(outputs=("X", "a")), "c", tmp_path).evaluate(p, gaps, deflections)
    every = TextKernel(rognon_gay, ALL, "c", tmp_path).evaluate(p, gaps, deflections, F=gaps, dF_dt=gaps)
    for output in ("X", "a"):
        np.testing.assert_array_equal(some[output], every[output])


def test_inputs_are_those_that_the_outputs_need() -> None:
    assert ir_of("rognon_gay", outputs=("a", "X")).settings["inputs"] == ()
    assert ir_of("rognon_gay", outputs=("dh_dt",)).settings["inputs"] == ("F",)
    assert ir_of("rognon_gay", drive="table", outputs=("ddelta_dt",)).settings["inputs"] == ("F", "dF_dt")
    assert ir_of("rognon_gay", drive="table", outputs=("dh_dt",)).settings["inputs"] == ("F",)


@pytest.mark.slow
def test_what_is_not_the_laws_cannot_be_fixed_or_asked_for() -> None:
    with pytest.raises(LawError) as refused:
        kernel_ir(rognon_gay, Needs(fixed={"ell": "1"}, outputs=("a", "speed")))
    assert refused.value.faults == (
        "'ell' cannot be fixed: the parameters are R, E, eta",
        f"'speed' is no output; there are {', '.join(OUTPUTS)}",
    )
    with pytest.raises(LawError, match=r"-1 < nu <= 1/2 must hold, and nu is 0\.6"):
        kernel_ir(equal_spheres, Needs(fixed={"nu": "0.6"}))
    assert "nu" not in kernel_ir(equal_spheres, Needs(fixed={"nu": "0.5"})).arrays["p"]


# ---------------------------------------------------------------- operations


def count_in_c(text: str) -> Counter[str]:
    """Count the operations of C code by its characters: independent of the printer, its grammar and ast.

    Multiplications by literals count; a quotient of two literals is folded, and a sign is none.
    """
    counts: Counter[str] = Counter()
    for line in text.splitlines():
        match = re.match(r"\s*(?:const )?double (\w+) = (.*);$", line)
        if match is None or re.fullmatch(r"p\[\d+\]|terms\[\d+ \* n \+ i\]", match[2]):
            continue
        body = re.sub(r"\d+\.\d+ / \d+\.\d+", "1.0", match[2])  # constants that a compiler folds
        body = re.sub(r"(\d)e[+-]?(\d)", r"\1\2", body)
        counts["mul"] += body.count(" * ")
        counts["div"] += body.count(" / ")
        counts["add"] += body.count(" + ") + body.count(" - ")
        for name in re.findall(r"\b([a-z]\w*)\(", body):
            if name != "fabs":
                counts["sqrt" if name == "sqrt" else "call"] += 1
    return counts


def functions_in_c(text: str) -> dict[str, str]:
    """Return bodies of C functions by name."""
    return {match[1]: match[2] for match in re.finditer(r"^[\w ]*?(\w+)\([^)]*\)\n\{\n(.*?)^\}", text, re.M | re.S)}


CASES: list[tuple[str, dict[str, Any]]] = [
    ("rognon_gay", {}),
    ("rognon_gay", {"deflection": "compression"}),
    ("rognon_gay", {"drive": "table", "outputs": OUTPUTS}),
    ("screened", {"drive": "table", "outputs": OUTPUTS}),
    ("cone", {"deflection": "tension", "outputs": OUTPUTS, "fixed": (("R", "1"),)}),
    ("rimmed", {"outputs": OUTPUTS}),
]


@pytest.mark.parametrize(("name", "needs"), CASES)
def test_the_counts_in_the_header_are_those_of_the_text(name: str, needs: dict[str, Any]) -> None:
    ir = ir_of(name, **needs)
    text = emit(ir, "c")
    found = functions_in_c(text)
    grand_total = 0
    for part in ("gap_terms", "newton", "gap_rate", "slopes", "quantities"):
        counts = count_in_c(found[f"_{part}"])
        assert {kind: counts[kind] for kind in KINDS} == ir.functions[part].operations, part
        shown = ", ".join(f"{counts[kind]} {kind}" for kind in KINDS if counts[kind])
        assert not shown or f" *     {part}: {shown}\n" in text
        grand_total += counts.total()
    assert f" * Operations, {grand_total} in all:\n" in text
    assert grand_total == total_operations(ir)


def test_the_papers_law_needs_no_more_operations_than_this() -> None:
    """Constant force, compression, outputs a and X: what a scene of the paper runs. More would be a regression."""
    ir = ir_of("rognon_gay", deflection="compression")
    assert operations_of(ir) == {
        "gap_terms": {"add": 1, "mul": 1, "div": 1, "sqrt": 0, "call": 0},
        "newton": {"add": 3, "mul": 11, "div": 1, "sqrt": 1, "call": 0},
        "gap_rate": {"add": 2, "mul": 15, "div": 3, "sqrt": 1, "call": 0},
        "slopes": {"add": 6, "mul": 33, "div": 8, "sqrt": 1, "call": 0},
        "quantities": {"add": 4, "mul": 5, "div": 1, "sqrt": 1, "call": 0},
        "force": dict.fromkeys(KINDS, 0),
        "given": dict.fromkeys(KINDS, 0),
    }
    assert [(saving.rule, saving.before, saving.after) for saving in ir.savings] == [
        ("one sign of delta", 72, 71),
        ("constant force", 71, 67),
        ("no remote force", 67, 66),
        ("outputs asked for", 66, 54),
    ]


@pytest.mark.parametrize(
    ("text", "counts"),
    [
        ("x + y - z", {"add": 2}),
        ("-x", {}),
        ("x * y / (z * w)", {"mul": 2, "div": 1}),
        ("(4.0 / 9.0) * x", {"mul": 1}),
        ("sqrt(x * y)", {"mul": 1, "sqrt": 1}),
        ("fabs(x)", {}),
        ("exp(-x) + pow(x, 0.3)", {"add": 1, "call": 2}),
        ("(x if x > 0.0 else -x)", {}),
    ],
)
def test_operations_are_counted_by_kind(text: str, counts: dict[str, int]) -> None:
    assert operations([("value", text)]) == dict.fromkeys(KINDS, 0) | counts


# ---------------------------------------------------------------- straight-line code


def evaluate_lines(lines: list[tuple[str, str]], scope: dict[str, Any]) -> dict[str, Any]:
    """Run straight-line code in Python."""
    names = {**vars(math), **scope}
    for name, text in lines:
        names[name] = eval(text, {"__builtins__": {}}, names)
    return names


def expressions() -> st.SearchStrategy[Expr]:
    """Random expressions of every printable kind, finite for positive symbols."""
    leaves = st.sampled_from((R, h, a, E)) | st.fractions(-3, 3, max_denominator=7).map(
        lambda x: Rational(x.numerator, x.denominator)
    )
    positive = st.sampled_from((R, h, a, E, R + h, a * E, 1 + h**2))
    powers = st.sampled_from([Rational(x) for x in "-3 -9/4 -2 -3/2 -1 -3/4 -1/2 1/4 1/2 3/4 3/2 7/4 2 5/2 7".split()])

    def larger(inner: st.SearchStrategy[Expr]) -> st.SearchStrategy[Expr]:
        pairs = st.tuples(inner, inner)
        return st.one_of(
            pairs.map(lambda p: p[0] + p[1]),
            pairs.map(lambda p: p[0] - p[1]),
            pairs.map(lambda p: p[0] * p[1]),
            st.tuples(positive, powers).map(lambda p: Pow(*p)),
            st.tuples(inner, positive, powers).map(lambda p: p[0] * Pow(p[1], p[2])),
            st.tuples(positive, st.sampled_from((Rational(1, 3), Rational(-7, 8), pi))).map(lambda p: Pow(*p)),
            pairs.map(lambda p: Max(*p)),
            pairs.map(lambda p: Min(*p)),
            inner.map(Abs),
            inner.map(lambda x: exp(-Abs(x))),
            st.tuples(inner, inner, positive).map(lambda p: Piecewise((p[0], p[2] > 1), (p[1], True))),
        )

    return st.recursive(leaves, larger, max_leaves=8)


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(st.lists(expressions(), min_size=1, max_size=3), st.tuples(*[st.floats(0.1, 10)] * 4))
def test_printed_code_computes_the_expressions(exprs: list[Expr], numbers: tuple[float, ...]) -> None:
    targets = [Symbol(f"result{i}", real=True) for i in range(len(exprs))]
    lines = straight_line(targets, dict(zip(targets, exprs, strict=True)))
    values = dict(zip((R, h, a, E), numbers, strict=True))
    found = evaluate_lines(lines, {symbol.name: value for symbol, value in values.items()})
    for target, expr in zip(targets, exprs, strict=True):
        # a sum may cancel: its size is that of the expression with every sign made +
        exact = expr.subs({symbol: Rational(value) for symbol, value in values.items()}).evalf(40)
        size = largest_part(expr, values)
        assert abs(found[target.name] - float(exact)) <= 200 * 2**-52 * size, lines


def largest_part(expr: Expr, values: dict[Symbol, float]) -> float:
    """Return a bound on all that is added up in an expression, amplified as powers and exp amplify."""
    if expr.is_Add:
        return sum(largest_part(term, values) for term in expr.args)
    if expr.is_Mul:
        return float(np.prod([largest_part(factor, values) for factor in expr.args]))
    if isinstance(expr, (Max, Min, Abs)):
        return sum(largest_part(argument, values) for argument in expr.args)
    if isinstance(expr, exp):
        return 1 + largest_part(expr.args[0], values)
    if isinstance(expr, Piecewise):
        return sum(largest_part(branch, values) for branch, _ in expr.args)
    if expr.is_Pow:
        own = abs(float(expr.subs(values)))
        return own * (1 + abs(float(expr.exp)))
    return abs(float(expr.subs(values)))


def test_each_common_part_is_computed_once_and_powers_are_products() -> None:
    first, second = Symbol("first", real=True), Symbol("second", real=True)
    lines = dict(straight_line([first, second], {first: (R + h) ** 3 * exp(-h / R), second: (R + h) ** -2 + h**5}))
    assert "pow" not in " ".join(lines.values())
    assert " ".join(lines.values()).count("R + h") == 1
    assert lines["h_p5"] == "h_p3 * h_p2"


def test_halves_and_quarters_of_powers_are_roots_and_exponentials_are_exponentials() -> None:
    value = Symbol("value", real=True)

    def printed(expr: Expr) -> str:
        return " ".join(text for _, text in straight_line([value], {value: expr}))

    assert printed(h ** Rational(3, 2)) == "h * sqrt(h)"
    assert printed(1 / sqrt(h)) == "1.0 / sqrt(h)"
    assert printed(h ** Rational(1, 4)) == "sqrt(sqrt(h))"
    assert printed(E / h ** Rational(7, 4)) == "E / (h * sqrt(h * sqrt(h)))"
    assert printed(E * exp(-h)) == "E * exp(-h)"
    assert "pow" not in printed(R * exp(-h / R) * exp(-a / R))


@pytest.mark.parametrize("power", ["5/2", "-5/2", "3/2", "7/2", "2", "-3", "1/4", "-3/4", "13/4"])
@pytest.mark.parametrize("base", [R + h, 1 + h**2, R * (R + h)], ids=str)
def test_powers_of_sums_are_products_and_roots(base: Expr, power: str) -> None:
    value, expr = Symbol("value", real=True), base ** Rational(power)
    lines = straight_line([value], {value: expr})
    assert "pow" not in " ".join(text for _, text in lines)
    found = evaluate_lines(lines, {"R": 1.5, "h": 0.75})
    assert " ".join(text for _, text in lines).count("R + h") == str(base).count("R + h")
    # at most 8 products, two roots and a quotient, of a base that three operations make, to the power 7/2
    exact = float(expr.subs({R: Rational(3, 2), h: Rational(3, 4)}).evalf(30))
    assert found["value"] == pytest.approx(exact, rel=24 * 2**-53)


def test_numbers_are_exact_until_they_are_printed() -> None:
    value = Symbol("value", real=True)
    cases = {
        Rational(1, 10): "0.1",
        Rational(4, 9): "(4.0 / 9.0)",
        Integer(3): "3.0",
        pi: repr(float(sympy.pi)),
        sqrt(2): "1.4142135623730951",
        Rational(-7, 2): "-3.5",
    }
    for number, text in cases.items():
        ((_, printed),) = straight_line([value], {value: number})
        assert printed == text


# ---------------------------------------------------------------- provenance and templates


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("name", list(LAWS))
def test_a_generated_file_says_where_it_comes_from(name: str, target: str) -> None:
    fixed = (("R", "0.5"),)
    ir = ir_of(name, outputs=OUTPUTS, fixed=fixed)
    top = emit(ir, target)[:6000]
    law = LAWS[name]
    assert f"Contact law {name}: written by softdyn {softdyn.__version__} with sympy {sympy.__version__}" in top
    assert "do not edit." in top.splitlines()[0]
    assert f"Source: {law.source or 'no source given'}" in top
    assert f"Law {law_hash(law)}:" in top
    for part in ("a", "F_ela", "zeta", "F_adh"):
        assert f"{part} = {getattr(law, part)}" in top
    assert "With R = 0.5." in top
    for saving in ir.savings:
        assert f"{saving.rule}: {saving.before} -> {saving.after}" in top
    assert f"Operations, {total_operations(ir)} in all:" in top
    assert f"{name}_evaluate" in top


DRIVES: dict[str, Any] = {"constant": "constant", "table": "table", "expression": parse("2*t*exp(-t) + sin(3*t)").shape}
EVERY_LAW_AND_DRIVE = [*((name, "table") for name in LAWS), ("screened", "constant"), ("screened", "expression")]


@pytest.mark.parametrize(("name", "drive"), EVERY_LAW_AND_DRIVE)
def test_generated_c_stands_alone(name: str, drive: str) -> None:
    text = emit(ir_of(name, drive=DRIVES[drive], outputs=OUTPUTS), "c")
    assert re.findall(r"#\s*include\s*(\S+)", text) == ["<math.h>", "<stdint.h>"]
    assert "#pragma" not in text
    # IEEE arithmetic: fast-math is named only to be refused
    assert re.findall(r".*fast-math.*", text) == [
        '#error "this code relies on IEEE arithmetic: compile it without -ffast-math and its parts"'
    ]
    assert "softdyn" not in text.split("#include", 1)[1]


@pytest.mark.parametrize("name", list(LAWS))
def test_generated_python_stands_alone(name: str) -> None:
    text = emit(ir_of(name, drive="table", outputs=OUTPUTS), "numba")
    tree = ast.parse(text)
    imported = {
        node.module if isinstance(node, ast.ImportFrom) else node.names[0].name
        for node in ast.walk(tree)
        if isinstance(node, (ast.Import, ast.ImportFrom))
    }
    assert imported == {"__future__", "math", "numba", "numpy"}
    assert "fastmath=False" in text
    assert 'error_model="numpy"' in text
    used = {node.func.id for node in ast.walk(tree) if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)}
    known = {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    defined = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
    assert used <= known | defined | {"range", "int", "float"}


@pytest.mark.parametrize("flag", ["-ffast-math", "-ffinite-math-only", "-funsafe-math-optimizations"])
def test_fast_math_is_refused_by_the_text_itself(flag: str, tmp_path: Path) -> None:
    path = tmp_path / "kernel.c"
    path.write_text(emit(ir_of("rognon_gay"), "c"), encoding="utf-8")
    command = [*(compiler() or ()), "-std=c99", "-c", str(path), "-o", str(tmp_path / "kernel.o")]
    assert subprocess.run(command, check=False, capture_output=True).returncode == 0
    refused = subprocess.run([*command, flag], check=False, capture_output=True, text=True)
    assert refused.returncode != 0
    assert "relies on IEEE arithmetic" in refused.stderr


@pytest.mark.parametrize(("name", "drive"), EVERY_LAW_AND_DRIVE)
def test_generated_c_compiles_without_a_warning(name: str, drive: str, tmp_path: Path) -> None:
    path = tmp_path / "kernel.c"
    path.write_text(emit(ir_of(name, drive=DRIVES[drive], outputs=OUTPUTS), "c"), encoding="utf-8")
    command = [*(compiler() or ()), "-std=c99", "-Wall", "-Wextra", "-Wno-unused-parameter", "-Werror", "-c", str(path)]
    done = subprocess.run([*command, "-o", str(tmp_path / "k.o")], check=False, capture_output=True, text=True)
    assert done.stderr == ""


@pytest.mark.parametrize("field", [field.name for field in fields(KernelIR)])
def test_a_template_that_lacks_a_field_fails(field: str) -> None:
    """The representation is everything that a template sees, and a template uses all of it."""

    class Lacking:
        """A representation without one field."""

    failures = 0
    fixed = (("R", "1"),)
    for ir in (ir_of("screened", drive=drive, outputs=OUTPUTS, fixed=fixed) for drive in DRIVES.values()):
        lacking: Any = Lacking()
        for other in fields(KernelIR):
            if other.name != field:
                setattr(lacking, other.name, getattr(ir, other.name))
        for target in TARGETS:
            try:
                emit(lacking, target)
            except (UndefinedError, AttributeError):
                failures += 1
    assert failures > 0, f"no template and no header uses {field}"


def test_a_template_that_asks_for_more_fails() -> None:
    """An unknown field is an error, not an empty text."""
    template = emit_module._environment().from_string("{{ ir.name }} {{ ir.viscosity }}")
    with pytest.raises(UndefinedError, match="has no attribute 'viscosity'"):
        template.render(ir=ir_of("rognon_gay"))


def test_the_head_is_the_same_for_both_targets() -> None:
    ir = ir_of("rimmed", outputs=OUTPUTS)
    lines = [line for line in header(ir).splitlines() if line]
    for target in TARGETS:
        text = emit(ir, target)
        assert all(line in text for line in lines)


def test_code_lists_the_parameters_that_it_uses() -> None:
    ir = ir_of("screened")
    assert ir.functions["newton"].reads == {"p": (("R", 0), ("E", 1))}
    entries = ir.functions["gap_rate"].reads["p"]
    assert [name for name, _ in entries] == ["R", "eta", "own_ell", "own_strength"]
    assert [ir.arrays["p"][index] for _, index in entries] == ["R", "eta", "ell", "strength"]


def test_the_numba_text_is_plain_python(tmp_path: Path) -> None:
    """Without its decorators the module runs as it is, and gives what the compiled one gives."""
    text = emit(ir_of("rognon_gay", outputs=("a", "C")), "numba")
    plain = import_text(text.replace("@jit\n", ""), tmp_path)
    out = np.empty(2)
    plain.rognon_gay_evaluate(1, np.array([0.5]), np.array([0.25]), np.array([1.0, 2.0, 3.0]), out)
    # hbar = 1/3, a = sqrt(2 (1/3 + 1/4)), C = (2/9) E (a + |delta| R/a): six roundings
    radius = np.sqrt(7 / 6)
    np.testing.assert_allclose(out, [radius, 4 / 9 * (radius + 0.25 / radius)], rtol=6 * 2**-52)
