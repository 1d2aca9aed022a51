"""Any identifier names a law's own parameter: what it is called changes nothing of what is computed."""

import ast
import keyword
import math
import string
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sympy import Abs, Rational, Symbol, exp, pi, sqrt

import softdyn
from softdyn import derive as derive_package
from softdyn import particles
from softdyn.derive import DIMENSIONLESS, FORCE, LENGTH, ContactLaw, E, Limit, R, a, delta, eta, h
from softdyn.derive.far_field import excess, far_friction
from softdyn.derive.law import code_names, in_code, parameters_of
from softdyn.derive.law_dynamics import law_quantities
from softdyn.derive.limits import check_limits
from softdyn.derive.pair_equations import Needs
from softdyn.derive.pair_kernel import kernel_ir
from softdyn.derive.printing import power_name
from softdyn.derive.symbols import DERIVED, MEANINGS, Parameter
from softdyn.derive.typeset import FORMATS
from softdyn.errors import SceneError

C_WORDS = """auto break case char const continue default do double else enum extern float for goto if inline int long
    register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while main
    y0 y1 yn j0 j1 jn gamma lgamma tgamma signgam NAN INFINITY HUGE_VAL errno EOF NULL fma hypot near M_PI""".split()
OF_THE_CODE = """n p c w out D C X t x V zeta F_ela F_adh dF_dt dh_dt x0 x1 gap0 A A_p2 A_p3 own_A own_A_p2 lambda1 T
    slip T_star u turn stiff keep roll lever sliding coupling rolling k_t overlap g reach s y_star Y Y_h H pressed side
    rho film grip friction remote terms state runs q i j k at lane dt rate slope_p11 compliance_p1 c0 h_r a_h F_a
    zeta_h λ κ_1 strain viscosity radius mixing drag""".split()
PYTHON = [*keyword.kwlist, *(name for name in dir(math) if name[0] != "_"), "abs", "min", "max", "range", "print"]
NUMBA = ["np", "numpy", "numba", "jit", "nan", "array", "empty", "inf", "isfinite", "self", "None", "lambda", "exp"]


def law_of(names: list[str], name: str) -> ContactLaw:
    """Forces 1, 2, 3, ... times parameters, in the order of these names, in the friction and the remote force."""
    own = [Symbol(one, positive=True) for one in names]
    hbar = R * h / (R + h)
    weighted = sum(k * symbol for k, symbol in enumerate(own, start=1))
    return ContactLaw(
        name=name,
        a=sqrt(2 * R * (hbar + Abs(delta))),
        F_ela=Rational(4, 9) * E * a * delta,
        zeta=3 * pi * eta * a**4 / (2 * hbar**3) * (1 + sum(symbol**2 for symbol in own) / (E * R**2) ** 2),
        F_adh=weighted * exp(-10 * h / R),
        parameters=dict.fromkeys(own, FORCE),
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("target", "names"),
    [("c", [*C_WORDS, *OF_THE_CODE, *PYTHON]), ("numba", ["n", "D", "t", "x0", "A", "A_p2", "own_A", *NUMBA])],
)
def test_names_change_nothing_of_a_run(target: str, names: list[str]) -> None:
    """Of two particles and of many: the same law with names that mean nothing, to rounding of a sum."""
    names = [name for name in dict.fromkeys(names) if name not in MEANINGS]
    found = []
    for called, name in ((names, "strange"), ([f"q{k}q" for k in range(len(names))], "plain")):
        law = law_of(called, name)
        values = {one: 1e-8 * k for k, one in enumerate(called, start=1)}
        pair = softdyn.simulate(
            law=law,
            parameters={"R": 1.0, "E": 1.0, "eta": 1.0, **values},
            h=1.0, force=1e-1, until_h=0.1, gaps=4, quantities=["C", "D", "zeta", "F_adh"], target=target,
        )  # fmt: skip
        scene = particles.ParticleScene(
            law=law, parameters={"E": 1.0, "eta": 1.0, **values}, positions=[[0, 0], [2.1, 0], [1, 2.0]], radii=1.0,
            drag=1.0, push=[particles.Push([1], [-0.1, 0.0])], until_t=10.0, times=3, target=target,
        )  # fmt: skip
        found.append((pair, particles.simulate(scene).x))
    (strange, x), (plain, y) = found
    for name, values in strange.arrays.items():
        np.testing.assert_allclose(values, plain.arrays[name], rtol=1e-12)
    np.testing.assert_allclose(x, y, rtol=1e-9)


@pytest.mark.slow
def test_the_limit_of_the_friction_far_apart_is_the_same_whatever_the_names() -> None:
    """For every name that a module of derive gives to something: each is a parameter of a law here."""
    folder = Path(derive_package.__file__).parent
    given_names = {
        part.value
        for module in folder.glob("*.py")
        for node in ast.walk(ast.parse(module.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("Symbol", "Dummy")
        for part in node.args
        if isinstance(part, ast.Constant)
    }
    names = sorted(name for name in given_names | set(string.ascii_letters) if name.isidentifier())
    names = [name for name in names if name not in MEANINGS]
    assert len(names) > 100
    law, plain = law_of(names, "named"), law_of([f"q{k}q" for k in range(len(names))], "plain")
    back = dict(zip(law.parameters, plain.parameters, strict=True))
    assert far_friction(law).xreplace(back) == far_friction(plain)
    assert excess(law) == excess(plain) == R / h


@given(st.lists(st.from_regex(r"[A-Za-zλé_][A-Za-z0-9_é]{0,8}(_p[0-9])?_?", fullmatch=True), unique=True, max_size=6))
@settings(max_examples=200, deadline=None)
def test_names_in_the_code_are_different_from_one_another_and_from_powers_of_others(names: list[str]) -> None:
    names = [name for name in names if name not in MEANINGS and name.isidentifier()]
    law = ContactLaw.__new__(ContactLaw)  # names alone matter, and no check of the rest
    object.__setattr__(law, "parameters", {Symbol(name, positive=True): FORCE for name in names})
    codes = code_names(law)
    made = [codes[name] for name in names]
    powers = {power_name(code, k) for code in codes.values() for k in range(2, 10)}
    assert len(set(codes.values())) == len(codes)
    assert not powers & set(codes.values())
    assert all(code.isascii() and code.isidentifier() and code.startswith("own_") for code in made)


@pytest.mark.slow
def test_a_law_with_the_names_of_what_is_derived_is_derived_right() -> None:
    """D and n of the law are its own: C and D of the dynamics do not meet them."""
    D, n = Symbol("D", positive=True), Symbol("n", positive=True)
    P, m = Symbol("P", positive=True), Symbol("m", positive=True)

    def declared(force: Symbol, length: Symbol, name: str) -> ContactLaw:
        hbar = R * h / (R + h)
        return ContactLaw(
            name=name, a=sqrt(2 * R * (hbar + Abs(delta))), F_ela=Rational(4, 9) * E * a * delta,
            zeta=3 * pi * eta * a**4 / (2 * hbar**3), F_adh=force * exp(-length * h),
            parameters={force: FORCE, length: 1 / LENGTH},
            typical={force: E * R**2 / 10**4, length: 1000 / R},
            limits=[Limit("near", order=(delta, h, 1 / length), claims={"F_adh": force, "D": 2 * pi * eta * R**2 / h})],
        )  # fmt: skip

    law, plain = declared(D, n, "named"), declared(P, m, "plain")
    back = {symbol: {"D": P, "n": m}[symbol.name] for symbol in law.parameters}
    for name, expr in law_quantities(law).items():
        assert expr.xreplace(back) == law_quantities(plain)[name], name
    assert [finding.verdict for finding in check_limits(law)] == [finding.verdict for finding in check_limits(plain)]
    for write in FORMATS.values():
        assert "own" in write(law)
    fixed = kernel_ir(law, Needs(fixed={"D": "1e-4"}))
    assert fixed.arrays["p"] == ("R", "E", "eta", "n")
    assert fixed.provenance.fixed == (("D", "1e-4"),)


def test_what_is_derived_has_names_that_are_listed() -> None:
    """A law's own symbol is never one of these: every symbol that meets a law's, by its name in the source."""
    folder = Path(derive_package.__file__).parent
    named = set()
    for module in ("dynamics", "pair_equations", "dominant_balance", "forms", "asymptotics"):
        for node in ast.walk(ast.parse((folder / f"{module}.py").read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Symbol":
                named |= {part.value for part in node.args if isinstance(part, ast.Constant)}
    named = {name for name in named if name.isidentifier() and not name.endswith("_p1")}
    assert named <= DERIVED | set(MEANINGS)
    law = law_of(sorted(DERIVED), "all_of_them")
    assert all(isinstance(symbol, Parameter) for symbol in law.parameters)
    assert {symbol.name for symbol in law.parameters} == set(DERIVED)
    assert not any(isinstance(symbol, Parameter) for symbol in in_code(law).parameters)
    assert len(parameters_of(law)) == 3 + len(DERIVED)


def test_a_sweep_is_told_which_of_two_things_of_one_name_is_meant() -> None:
    scene = softdyn.Scene(
        law="dlvo", parameters={"n": 1.0}, h=1.0, force="n*t", constants={"n": 2.0}, until_t=1.0, times=[1.0]
    )  # fmt: skip
    from softdyn.pair.batch import varied_scene

    with pytest.raises(SceneError, match="'n' is both a parameter and a constant"):
        varied_scene(scene, {"n": 3.0})


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: 1 / LENGTH, "L^-1"),
        (lambda: LENGTH**-1, "L^-1"),
        (lambda: 2 * LENGTH, "length"),
        (lambda: LENGTH / 2, "length"),
        (lambda: DIMENSIONLESS * LENGTH, "length"),
        (lambda: FORCE / LENGTH**2, "pressure"),
        (lambda: LENGTH**0.5, "L^(1/2)"),
        (lambda: Rational(2) * LENGTH ** Rational(1, 2), "L^(1/2)"),
    ],
)
def test_dimensions_are_reckoned_with_numbers(made: object, words: str) -> None:
    assert str(made()) == words  # type: ignore[operator]
