"""The generated kernels compute the law: every output, on both targets, against 50 digits."""

from __future__ import annotations

import builtins
import decimal
import keyword
import re
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from invented_laws import LAWS
from kernels_by_text import TextKernel, import_text
from numpy.typing import NDArray
from reference import DIGITS, Exact, exact, exact_decimal, ulp
from sympy import Add, Symbol, lambdify, sqrt, tanh

from softdyn.derive import FORCE, ContactLaw, E, R, a, delta, eta, h
from softdyn.derive.emit import emit
from softdyn.derive.law import parameters_of
from softdyn.derive.laws.rognon_gay import law as rognon_gay
from softdyn.derive.pair_equations import OUTPUTS, Deflection, Needs
from softdyn.derive.pair_kernel import kernel_ir
from softdyn.errors import LawError
from softdyn.expression import parse
from softdyn.kernels import get_kernel
from softdyn.targets import TARGETS

Array = NDArray[np.float64]
STATES = 100_000
#: R, E, eta: in no units, in SI for a droplet and for a bead, and numbers without meaning.
PARAMETERS = ((1.0, 1.0, 1.0), (2e-6, 3e4, 1e-3), (1e-3, 5e6, 70.0), (1.37, 0.0271, 9.3))

#: Allowed error, in units in the last place of the output's size (see reference.py). One rounding moves a result by at
#: most one such unit, so the bounds count roundings along the formula, each times the power in which it enters:
#:   a     R + h, R h, their quotient, the sum, 2R(...) under the root (halves them), the root: 5/2 + 1 = 3.5
#:   F_ela, C, lambda1: a or 1/a times a few factors: 8; lambda1 has a^2 and (R + h)^2: 16
#:   zeta  a^4 (4 * 3.5 + 2), (R + h)^3 (3 + 2), R^3, h^3 and 3 pi/2 (2 + 2 + 1), five products: 31
#:   dh_dt zeta and a quotient: 32; lambda2 the same powers: 32
#:   D, ddelta_dt, dX_dt: zeta, C and dF_dh (8 each), quotients and sums: 32 + 16 + 4
#:   X     two sums of exact numbers: 2
#: Rounding errors add up like random ones: what is measured stays at half of these bounds or below.
ALLOWED = {
    **{
        "a": 3.5,
        "F_ela": 8,
        "zeta": 31,
        "F_adh": 0,
        "C": 8,
        "D": 52,
        "dh_dt": 32,
        "ddelta_dt": 52,
        "dX_dt": 52,
        "X": 2,
    },
    **{"lambda1": 16, "lambda2": 32},
}


@dataclass(frozen=True)
class States:
    """States of contacts of one set of parameters."""

    p: Array
    h: Array
    delta: Array
    F: Array
    dF_dt: Array

    def rows(self) -> Iterator[tuple[float, ...]]:
        """Each state in turn: h, delta, F, dF_dt."""
        return zip(*(x.tolist() for x in (self.h, self.delta, self.F, self.dF_dt)), strict=True)


def random_states(seed: int, n: int, R: float, E: float, eta: float, *own: float) -> States:
    """h/R over 1e-12..1e4, abs(delta)/R over 1e-14..1, either sign and zero, forces over kappa = 1e-14..1."""
    draw = np.random.default_rng(seed)
    h = R * 10 ** draw.uniform(-12, 4, n)
    delta = R * 10 ** draw.uniform(-14, 0, n) * draw.choice([1, -1, 0], n, p=[0.45, 0.45, 0.1])
    h[:4], delta[:4] = R * np.array([1e-12, 1e-12, 1e4, 1e4]), R * np.array([1, -1, 1, -1])
    F = E * R**2 * 10 ** draw.uniform(-14, 0, n) * draw.choice([1, -1], n)
    dF_dt = np.abs(F) * E / eta * 10 ** draw.uniform(-12, 2, n) * draw.choice([1, -1, 0], n, p=[0.45, 0.45, 0.1])
    return States(np.array([R, E, eta, *own]), h, delta, F, dF_dt)


@cache
def all_states() -> tuple[States, ...]:
    """1e5 states in all."""
    return tuple(random_states(i, STATES // len(PARAMETERS), *p) for i, p in enumerate(PARAMETERS))


@cache
def references() -> tuple[tuple[dict[str, Exact], dict[str, Array]], ...]:
    """Exact outputs and their sizes at :func:`all_states`, in 50 decimal digits."""
    with decimal.localcontext(prec=DIGITS):
        evaluate = exact_decimal(rognon_gay)
        return tuple(
            _collect([evaluate(_in(Decimal, states.p), *map(Decimal, row)) for row in states.rows()])
            for states in all_states()
        )


def _in(number: Any, values: Array) -> list[Any]:
    return [number(value) for value in values.tolist()]


def _collect(rows: list[dict[str, tuple[Any, Any]]]) -> tuple[dict[str, Exact], dict[str, Array]]:
    return (
        {name: Exact([row[name][0] for row in rows]) for name in OUTPUTS},
        {name: np.array([float(row[name][1]) for row in rows]) for name in OUTPUTS},
    )


def outputs_of(law: Any, target: str, states: States) -> dict[str, Array]:
    """All outputs of a kernel from the cache."""
    kernel = get_kernel(law, target, drive="table", outputs=OUTPUTS)
    out = np.empty(len(OUTPUTS) * len(states.h))
    inputs = [{"F": states.F, "dF_dt": states.dF_dt}[name] for name in kernel.inputs]
    kernel.functions.evaluate(len(states.h), states.h, states.delta, *inputs, states.p, out)
    return dict(zip(OUTPUTS, out.reshape(len(OUTPUTS), -1), strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
def test_every_output_is_accurate_to_the_roundings_of_its_formula(target: str) -> None:
    worst = dict.fromkeys(OUTPUTS, 0.0)
    for states, (values, sizes) in zip(all_states(), references(), strict=True):
        computed = outputs_of("rognon_gay", target, states)
        for name in OUTPUTS:
            errors = values[name].error(computed[name]) / ulp(sizes[name])
            assert np.isfinite(computed[name]).all(), name
            worst[name] = max(worst[name], float(errors.max()))
    print("worst error in units in the last place of the size:", worst)
    assert {name: error for name, error in worst.items() if error > ALLOWED[name]} == {}


@pytest.mark.slow
def test_outputs_without_a_difference_do_not_cancel() -> None:
    """Size and magnitude are one, so the bound of the test above is one in units in the last place of the value."""
    for values, sizes in references():
        for name in ("a", "F_ela", "zeta", "F_adh", "C", "dh_dt", "lambda1"):
            np.testing.assert_allclose(sizes[name], np.abs(values[name].high), rtol=1e-15, atol=0, err_msg=name)


@pytest.mark.slow
def test_the_friction_D_is_never_ill_conditioned() -> None:
    """C + F_a a_h is (2/9) E (R/a)(|delta|(3 - 2 hbar') + 2 hbar) or more, whatever the sign of delta; hbar' < 1.

    Its terms' magnitudes add up to at most 5 times that.
    """
    for values, sizes in references():
        assert (sizes["D"] / np.abs(values["D"].high)).max() <= 5


@pytest.mark.slow
def test_both_targets_round_alike() -> None:
    """The text holds the same operations in the same order, and IEEE leaves them no choice: not one bit differs."""
    for states in all_states():
        c, numba = (outputs_of("rognon_gay", target, states) for target in TARGETS)
        for name in OUTPUTS:
            np.testing.assert_array_equal(c[name], numba[name], err_msg=name)


def test_the_decimal_reference_is_that_of_mpmath() -> None:
    with decimal.localcontext(prec=DIGITS), mpmath.workdps(DIGITS):
        quick, slow = exact_decimal(rognon_gay), exact(rognon_gay)
        for states in all_states():
            for row in list(states.rows())[:100]:
                found = quick(_in(Decimal, states.p), *map(Decimal, row))
                expected = slow(_in(mpmath.mpf, states.p), *map(mpmath.mpf, row))
                for name in OUTPUTS:
                    value, size = expected[name]
                    # 50 digits, less those that plain derivatives lose by cancelling at h/R = 1e4: 4 each
                    assert abs(mpmath.mpf(str(found[name][0])) - value) <= mpmath.mpf(10) ** (10 - DIGITS) * size, name


@pytest.mark.slow
def test_every_output_is_accurate_against_mpmath() -> None:
    for states in all_states():
        with mpmath.workdps(DIGITS):
            evaluate = exact(rognon_gay)
            values, sizes = _collect(
                [evaluate(_in(mpmath.mpf, states.p), *map(mpmath.mpf, row)) for row in states.rows()]
            )
        for target in TARGETS:
            computed = outputs_of("rognon_gay", target, states)
            for name in OUTPUTS:
                error = (values[name].error(computed[name]) / ulp(sizes[name])).max()
                assert error <= ALLOWED[name], (target, name)


#: Values of the invented laws' own parameters, by name, for R = 1.37.
OWN = {"screened": (0.4, -0.003), "cone": (0.8,), "rimmed": (0.3,), "branched": (0.25,)}


def conditioned(law: ContactLaw, states: States) -> tuple[dict[str, Exact], dict[str, Array]]:
    """Exact outputs, and the sizes that an evaluation with rounded arguments can be held to.

    To the size is added the effect of an error in the arguments, the sum of abs(x df/dx) over all arguments x: rounded
    exponents and bases of powers have it.
    """
    with mpmath.workdps(DIGITS):
        evaluate = exact(law)
        p = _in(mpmath.mpf, states.p)
        values, totals = [], []
        small = mpmath.mpf(10) ** -20
        for row in states.rows():
            arguments = [*p, *map(mpmath.mpf, row)]
            at = evaluate(p, *arguments[len(p) :])
            totals.append({name: size for name, (_, size) in at.items()})
            values.append(at)
            for i, x in enumerate(arguments):
                if x == 0:
                    continue
                moved = [*arguments[:i], x * (1 + small), *arguments[i + 1 :]]
                there = evaluate(moved[: len(p)], *moved[len(p) :])
                for name in OUTPUTS:
                    totals[-1][name] += abs(there[name][0] - at[name][0]) / small
        return _collect(values)[0], {name: np.array([float(row[name]) for row in totals]) for name in OUTPUTS}


@cache
def invented_case(law_name: str) -> tuple[States, dict[str, Exact], dict[str, Array]]:
    """Return a few hundred states of an invented law, its exact outputs there, and their sizes."""
    states = random_states(7, 300, *PARAMETERS[-1], *OWN[law_name])
    return (states, *conditioned(LAWS[law_name], states))


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("law_name", list(OWN))
def test_laws_with_exponentials_roots_and_branches(law_name: str, target: str, tmp_path: Path) -> None:
    law = LAWS[law_name]
    assert len(parameters_of(law)) == 3 + len(OWN[law_name])
    states, values, sizes = invented_case(law_name)
    kernel = TextKernel(law, Needs(drive="table", outputs=OUTPUTS), target, tmp_path)
    computed = kernel.evaluate(states.p, states.h, states.delta, F=states.F, dF_dt=states.dF_dt)
    worst = {name: float((values[name].error(computed[name]) / ulp(sizes[name])).max()) for name in OUTPUTS}
    print(worst)
    # the sizes hold all amplification; what is left is a chain of at most 16 roundings of one unit each
    assert {name: error for name, error in worst.items() if not error <= 16} == {}


@pytest.mark.parametrize("target", TARGETS)
def test_a_decaying_force_is_as_accurate_as_exp(target: str, tmp_path: Path) -> None:
    """With ell = 1 the exponent is h itself, not rounded: exp errs by one unit at most, its product by A by another."""
    h = np.linspace(1.0, 700.0, 1000)
    zero, p = np.zeros(len(h)), np.array([1.0, 1.0, 1.0, 1.0, 1.0])
    kernel = TextKernel(LAWS["screened"], Needs(outputs=("F_adh",)), target, tmp_path)
    with mpmath.workdps(DIGITS):
        expected = Exact([mpmath.exp(-mpmath.mpf(x)) for x in h.tolist()])
    found = kernel.evaluate(p, h, zero, F=zero)["F_adh"]
    assert (expected.error(found) / ulp(expected.high)).max() <= 2


def elastic_force(law: ContactLaw, p: Array, h_values: Array, delta_values: Array) -> Exact:
    """F_ela(a(h, delta), delta) in 50 digits."""
    with mpmath.workdps(DIGITS):
        function = lambdify([h, delta, *parameters_of(law)], law.F_ela.subs(a, law.a), "mpmath")
        pairs = zip(_in(mpmath.mpf, h_values), _in(mpmath.mpf, delta_values), strict=True)
        return Exact([function(*pair, *_in(mpmath.mpf, p)) for pair in pairs])


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize(
    ("law_name", "deflection"),
    [("rognon_gay", "either"), ("rognon_gay", "compression"), ("rognon_gay", "tension"), ("cone", "either")],
)
def test_the_deflection_found_balances_the_force(
    law_name: str, deflection: Deflection, target: str, tmp_path: Path
) -> None:
    """F_ela errs by 8 units in the last place at most (see ALLOWED); a unit of delta is two of F, relatively: 10."""
    parameters = (*PARAMETERS[1], *OWN.get(law_name, ()))
    states = random_states(3, 2000, *parameters)
    F = {"either": states.F, "compression": np.abs(states.F), "tension": -np.abs(states.F)}[deflection]
    kappa = np.abs(F) / (parameters[1] * parameters[0] ** 2)
    assert kappa.min() < 1e-13
    assert kappa.max() > 1e-1
    kernel = TextKernel(LAWS[law_name], Needs(deflection=deflection), target, tmp_path)
    found = kernel.solve_delta(states.p, states.h, F)
    assert np.array_equal(np.sign(found), np.sign(F))
    assert (elastic_force(LAWS[law_name], states.p, states.h, found).error(F) / ulp(F)).max() <= 10


@pytest.mark.parametrize("target", TARGETS)
def test_no_force_no_deflection(target: str, tmp_path: Path) -> None:
    kernel = TextKernel(rognon_gay, Needs(), target, tmp_path)
    h = np.geomspace(1e-12, 1e4, 50)
    assert np.array_equal(kernel.solve_delta(np.ones(3), h, np.zeros(50)), np.zeros(50))


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
def test_where_no_deflection_balances_the_force_there_is_nan(target: str, tmp_path: Path) -> None:
    saturating = ContactLaw("saturating", a=sqrt(R * h), F_ela=E * R**2 * tanh(delta / R), zeta=eta * R)
    kernel = TextKernel(saturating, Needs(), target, tmp_path)
    p, gaps = np.array([1.0, 1.0, 1.0]), np.ones(6)
    found = kernel.solve_delta(p, gaps, np.array([0.5, -0.5, 1.5, -1.5, np.nan, np.inf]))
    # tanh near 1/2 errs by a unit; its slope, 3/4, makes that of delta
    np.testing.assert_allclose(found[:2], [np.arctanh(0.5), -np.arctanh(0.5)], rtol=4 * np.finfo(float).eps)
    assert np.isnan(found[2:]).all()

    pushed_only = TextKernel(rognon_gay, Needs(deflection="compression"), target, tmp_path)
    pulled_only = TextKernel(rognon_gay, Needs(deflection="tension"), target, tmp_path)
    assert np.isnan(pushed_only.solve_delta(p, gaps[:1], np.array([-0.1]))).all()
    assert np.isnan(pulled_only.solve_delta(p, gaps[:1], np.array([0.1]))).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    "source",
    [
        "a comment that ends */ early",
        'a text that ends """ early',
        r"eq. 3 of \xi\upsilon\Nature, C:\new",
        "ends in a backslash \\",
        'ends in a quote "',
        "two\nlines",
        "Lévy & Sørensen, §2 → ζ",
        "??/ and {{ braces }} {% raw %}",
    ],
)
def test_no_source_reference_breaks_the_generated_text(source: str, tmp_path: Path) -> None:
    one = np.ones(1)
    law = ContactLaw("quoted", a=R * h / (R + h), F_ela=E * R * delta, zeta=eta * R, source=source)
    kernel = TextKernel(law, Needs(outputs=("a",)), "c", tmp_path)
    assert kernel.evaluate(np.ones(3), one, one)["a"] == 0.5
    # for numba a look at the module is enough, without its decorators: it is the text that could break
    module = import_text(emit(kernel.ir, "numba").replace("@jit\n", ""), tmp_path)
    out = np.empty(1)
    module.quoted_evaluate(1, one, one, np.ones(3), out)
    assert out[0] == 0.5


C_WORDS = (
    "auto break case char const continue default do double else enum extern float for goto if inline int long register "
    "restrict return short signed sizeof static struct switch typedef union unsigned void volatile while INFINITY NAN "
    "isnan fmin fmax y0 y1 j0 j1 gamma cbrt hypot int64_t M_PI"
)
INTERNAL = (
    "F_a F_delta a_h a_delta a_hh zeta_a zeta_h F_adh_a F_adh_h F_aa delta_size E1 I S N O Q pi R_p2 a_p4 x0 x1 k1"
)


def names_in_the_way() -> list[str]:
    """Every identifier in the text of kernels, the keywords of C and Python, and names of the derivation's own."""
    drives = ("constant", "table", parse("sin(2*t)").shape)
    kernels = [kernel_ir(LAWS["screened"], Needs(drive=drive, outputs=OUTPUTS)) for drive in drives]
    texts = [emit(ir, target) for ir in kernels for target in TARGETS]
    found = {name for text in texts for name in re.findall(r"[A-Za-z_]\w*", text)}
    found |= {*C_WORDS.split(), *INTERNAL.split(), *keyword.kwlist, *dir(builtins)}
    return sorted(found - {"R", "E", "eta"})


def refused_names(names: list[str], assumptions: dict[str, bool]) -> set[str]:
    """Names that a law refuses for its parameters."""
    symbols = [Symbol(name, **assumptions) for name in names]
    try:
        ContactLaw("named", a=R, F_ela=E * R * delta, zeta=eta * R, parameters=dict.fromkeys(symbols, FORCE))
    except LawError as error:
        return {name for name in names if any(repr(name) in fault for fault in error.faults)}
    return set()


def evaluate_with_parameters(
    names: list[str], assumptions: dict[str, bool], targets: tuple[str, ...], folder: Path
) -> None:
    """Check that kernels tell the parameters of their law apart from names of their own."""
    symbols = [Symbol(name, **assumptions) for name in names]
    law = ContactLaw(
        "named",
        a=sqrt(R * h),
        F_ela=E * a * delta + Add(*(symbol**2 * delta / (E * R**3) for symbol in symbols)),
        zeta=eta * a**4 * (R + h) ** 3 / h**6,
        F_adh=Add(*(2**i * symbol * a**2 / R**2 for i, symbol in enumerate(symbols, start=1))),
        parameters=dict.fromkeys(symbols, FORCE),
    )
    needs = Needs(drive="table", outputs=("F_adh", "dh_dt", "lambda2"))
    ir = kernel_ir(law, needs)
    for target in targets:
        kernel = TextKernel(law, needs, target, folder, ir)
        values = {name: 3.0**-i for i, name in enumerate(names, start=1)}
        p = np.array([{"R": 1.0, "E": 1.0, "eta": 1.0, **values}[name] for name in kernel.ir.arrays["p"]])
        one = np.ones(1)
        found = kernel.evaluate(p, one, one, F=one, dF_dt=one)
        # the geometric series of 2/3, with a = h = R = 1; each of its terms rounds a few times
        series = sum((2 / 3) ** i for i in range(1, len(names) + 1))
        assert found["F_adh"][0] == pytest.approx(series, rel=8 * len(names) * 2**-52), names
        assert found["dh_dt"][0] == pytest.approx(-(1 - series) / 8, rel=64 * len(names) * 2**-52), names
        stiffness = 1 + sum(9.0**-i for i in range(1, len(names) + 1))
        deflection = kernel.solve_delta(p, one, 0.5 * stiffness * one)
        assert deflection[0] == pytest.approx(0.5, rel=8 * len(names) * 2**-52), names


#: Names of every kind that could get in the way: an argument, a loop's, quantities, a power's, a partial's, keywords.
SUSPECTS = [
    "w",
    "i",
    "gap0",
    "newton",
    "terms",
    "lambda1",
    "F_ela",
    "dF_ddelta",
    "x0",
    "R_p2",
    "a_h",
    "expm1",
    "signed",
    "class",
]


@pytest.mark.slow
@pytest.mark.parametrize("assumption", ["positive", "real"])
def test_a_parameter_is_refused_or_keeps_clear_of_the_names_in_the_text(assumption: str, tmp_path: Path) -> None:
    refused = refused_names(SUSPECTS, {assumption: True})
    allowed = [name for name in SUSPECTS if name not in refused]
    assert allowed
    evaluate_with_parameters(allowed, {assumption: True}, ("c",), tmp_path)


@pytest.mark.slow
def test_no_name_of_the_text_or_of_a_language_gets_in_the_way(tmp_path: Path) -> None:
    names = names_in_the_way()
    refused = refused_names(names, {"real": True})
    allowed = [name for name in names if name not in refused]
    assert len(allowed) > 20, "the names left are what the test is about"
    for i in range(0, len(allowed), 48):
        evaluate_with_parameters(allowed[i : i + 48], {"real": True}, TARGETS, tmp_path)
