"""Logarithms and exponentials without a branch: as exact as libm's, the same in both targets, and vectorised."""

from __future__ import annotations

import ctypes
import math
import platform
import re
import subprocess
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from kernels_by_text import compile_c, import_text
from numpy.typing import NDArray
from sympy import exp, log

from softdyn.derive import ContactLaw, E, R, h
from softdyn.derive.contact_equations import ContactNeeds
from softdyn.derive.contact_kernel import contact_ir
from softdyn.derive.elementary import FUNCTIONS, constants, exp_series, log_series, nested
from softdyn.derive.emit import emit, with_functions
from softdyn.derive.laws.dlvo import law as dlvo
from softdyn.derive.laws.droplet import law as droplet
from softdyn.derive.laws.equal_spheres import law as equal_spheres
from softdyn.derive.laws.rognon_gay import law as rognon_gay
from softdyn.derive.laws.soap_film import law as soap_film
from softdyn.derive.laws.steric import law as steric
from softdyn.targets import TARGETS
from softdyn.targets.c import FLAGS, compiler

Array = NDArray[np.float64]
Functions = dict[str, Callable[[Array], Array]]
#: Laws whose contact kernels need one elementary function or another, and one that needs none.
STOCK = (rognon_gay, equal_spheres, droplet, steric, dlvo, soap_film)
#: Units in the last place; see derive/elementary.py.
ULPS = {"log": 1, "log1p": 1, "exp": 1, "expm1": 2}

BODY = "\n\n\n".join(
    f"@jit\ndef all_{name}(n: int, x: array, out: array) -> None:\n"
    f"    for i in range(n):\n        out[i] = _lane_{name}(x[i])"
    for name in FUNCTIONS
)
PYTHON_HEAD = """
from math import inf, nan
import numba
from numpy import float64, int64
from numpy import ndarray as array
jit = numba.njit(error_model="numpy")
"""


@pytest.fixture(scope="module")
def functions(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Functions]:
    """Each function of arrays, for each target."""
    folder = tmp_path_factory.mktemp("elementary")
    library = compile_c("#include <math.h>\n#include <stdint.h>\n" + with_functions(BODY, "c"), folder)
    module = import_text(PYTHON_HEAD + with_functions(BODY, "numba"), folder)

    def in_c(name: str) -> Callable[[Array], Array]:
        raw = getattr(library, f"all_{name}")
        raw.argtypes, raw.restype = [ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p], None

        def call(x: Array) -> Array:
            out = np.empty_like(x)
            raw(len(x), x.ctypes.data, out.ctypes.data)
            return out

        return call

    def in_numba(name: str) -> Callable[[Array], Array]:
        compiled = getattr(module, f"all_{name}")

        def call(x: Array) -> Array:
            out = np.empty_like(x)
            compiled(len(x), x, out)
            return out

        return call

    return {"c": {f: in_c(f) for f in FUNCTIONS}, "numba": {f: in_numba(f) for f in FUNCTIONS}}


# ---------------------------------------------------------------- numbers


@pytest.mark.slow
def test_the_polynomials_leave_less_than_a_hundredth_of_a_rounding() -> None:
    """With their coefficients rounded, which costs a little more."""
    numbers: dict[str, Any] = constants()
    with mpmath.workdps(40):

        def polynomial(name: str, x: Any) -> Any:
            return mpmath.polyval([mpmath.mpf(c) for c in reversed(numbers[name])], x)

        for f in np.linspace(-0.2929, 0.4143, 5001).tolist():
            s = mpmath.mpf(f) / (2 + mpmath.mpf(f))
            exact = mpmath.log1p(f)
            assert abs(2 * s + s**3 * polynomial("log", s**2) - exact) <= 2**-59.5 * abs(exact)
        for r in np.linspace(-0.34658, 0.34658, 5001).tolist():
            exact = mpmath.expm1(r)
            assert abs(r + mpmath.mpf(r) ** 2 * polynomial("exp", mpmath.mpf(r)) - exact) <= 2**-59.5 * abs(exact)


def test_the_series_are_those_of_the_functions() -> None:
    with mpmath.workdps(50):
        for z in (mpmath.mpf("1e-3"), mpmath.mpf("0.0295")):
            s = mpmath.sqrt(z)
            assert abs(log_series(z) - (2 * mpmath.atanh(s) - 2 * s) / s**3) < mpmath.mpf(10) ** -42
        for r in (mpmath.mpf("-0.35"), mpmath.mpf("0.35")):
            assert abs(exp_series(r) - (mpmath.exp(r) - 1 - r) / r**2) < mpmath.mpf(10) ** -45


def test_ln_2_is_two_numbers_of_which_the_first_has_whole_multiples() -> None:
    numbers: dict[str, Any] = constants()
    high, low = numbers["ln2_high"], numbers["ln2_low"]
    with mpmath.workdps(50):
        assert abs(mpmath.mpf(high) + mpmath.mpf(low) - mpmath.ln(2)) < mpmath.mpf(2) ** -97
    # the exponents of all numbers, and the k of all exponentials, have eleven bits
    assert all(math.fsum((high * k, -high * (k - 1), -high)) == 0 for k in range(-1100, 1100))
    assert (high * 2**42).is_integer()


def test_a_polynomial_is_printed_by_horners_rule() -> None:
    assert nested([0.5, 0.25, 2.0], "x") == "0.5 + x * (0.25 + x * 2.0)"


# ---------------------------------------------------------------- accuracy


def near(*points: float) -> st.SearchStrategy[float]:
    """Numbers at any distance from some points."""
    distance = st.floats(-18, 0).map(lambda x: 10.0**x)
    return st.tuples(st.sampled_from(points), st.sampled_from((1.0, -1.0)), distance).map(lambda p: p[0] + p[1] * p[2])


numbers_of_all_sizes = st.floats(allow_nan=False, allow_infinity=False)
ARGUMENTS = {
    "log": st.one_of(
        st.floats(0, exclude_min=True, allow_infinity=False),
        near(1, 2, math.sqrt(0.5), math.sqrt(2)).filter(lambda x: x > 0),
    ),
    "log1p": st.one_of(
        st.floats(-1, exclude_min=True, allow_infinity=False),
        near(0, 1, math.sqrt(2) - 1, math.sqrt(0.5) - 1).filter(lambda x: x > -1),
        st.floats(-18, 0).map(lambda x: -1 + 10.0**x).filter(lambda x: x > -1),
    ),
    "exp": st.one_of(
        numbers_of_all_sizes, st.floats(-746, 710), st.floats(-2, 2), near(0, math.log(2) / 2, -1.5 * math.log(2))
    ),
    "expm1": st.one_of(
        numbers_of_all_sizes, st.floats(-746, 710), st.floats(-2, 2), near(0, math.log(2) / 2, -math.log(2) / 2)
    ),
}


def units_off(name: str, x: float, found: float) -> float:
    """Distance of a value from the exact one, in units of the last place of the latter."""
    with mpmath.workdps(40):
        exact = getattr(mpmath, "ln" if name == "log" else name)(mpmath.mpf(x))
        rounded = float(exact)
        if math.isinf(rounded) or math.isinf(found):
            # the exact value rounds to infinity from half a unit above the largest number on
            return 0.0 if found == rounded else math.inf
        return float(abs(mpmath.mpf(found) - exact) / mpmath.mpf(math.ulp(rounded)))


@pytest.mark.slow
@pytest.mark.parametrize("name", FUNCTIONS)
@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_functions_are_exact_to_a_unit_in_the_last_place(
    functions: dict[str, Functions], name: str, data: st.DataObject
) -> None:
    """Over all numbers; both targets give the same bits."""
    x = np.array(data.draw(st.lists(ARGUMENTS[name], min_size=20, max_size=40)))
    found = functions["c"][name](x)
    np.testing.assert_array_equal(found.view(np.int64), functions["numba"][name](x).view(np.int64))
    for argument, value in zip(x.tolist(), found.tolist(), strict=True):
        assert units_off(name, argument, value) <= ULPS[name], (argument, value)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_are_exact_where_their_parts_meet(functions: dict[str, Functions], name: str) -> None:
    """Numbers on both sides of each change of k, where what remains is largest."""
    k = np.arange(-60, 61)
    logarithm = name in ("log", "log1p")
    centre = 2.0 ** (k - 0.5) - (name == "log1p") if logarithm else (k - 0.5) * math.log(2)
    x = np.unique(
        [np.nextafter(c, side) + j * np.spacing(c) for c in centre for side in (-9, 9e99) for j in range(-8, 9)]
    )
    x = x[x > -1] if name == "log1p" else x
    found = functions["c"][name](x)
    assert max(units_off(name, *pair) for pair in zip(x.tolist(), found.tolist(), strict=True)) <= ULPS[name]


LARGEST, SMALLEST = np.finfo(float).max, 5e-324
inf, nan = math.inf, math.nan
#: As C99 has it in annex F.9: arguments and values; nan stands for no value.
SPECIAL = {
    "log": [(0.0, -inf), (-0.0, -inf), (1.0, 0.0), (-SMALLEST, nan), (-LARGEST, nan), (inf, inf), (-inf, nan)],
    "log1p": [(0.0, 0.0), (-0.0, -0.0), (-1.0, -inf), (inf, inf), (-inf, nan), (math.nextafter(-1, -2), nan)],
    "exp": [(0.0, 1.0), (-0.0, 1.0), (inf, inf), (-inf, 0.0), (LARGEST, inf), (-LARGEST, 0.0), (SMALLEST, 1.0)],
    "expm1": [(0.0, 0.0), (-0.0, -0.0), (inf, inf), (-inf, -1.0), (LARGEST, inf), (-LARGEST, -1.0), (-40.0, -1.0)],
}


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("name", FUNCTIONS)
def test_special_values_are_those_of_the_standard(functions: dict[str, Functions], target: str, name: str) -> None:
    """Signs of zero included."""
    small = [(x, x) for x in (SMALLEST, -SMALLEST, 1e-310, 1e-300)] if name in ("log1p", "expm1") else []
    x, expected = np.array([*SPECIAL[name], *small, (nan, nan)]).T.copy()
    found = functions[target][name](x)
    np.testing.assert_array_equal(found, expected)
    real = ~np.isnan(expected)
    np.testing.assert_array_equal(np.signbit(found[real]), np.signbit(expected[real]))


# ---------------------------------------------------------------- kernels


def needs_of(law: ContactLaw) -> ContactNeeds:
    """All that a scene can need."""
    tangential = law.tangential is not None
    return ContactNeeds(("R", "size_ratio") if tangential else ("R",), fading=True, tangential=tangential)


@cache
def text_of(law: ContactLaw, target: str) -> str:
    """Text of a law's contact kernel, without its head."""
    text = emit(contact_ir(law, needs_of(law)), target)
    opening = "#if" if target == "c" else "import numba"
    return opening + text.split(opening, 1)[1]


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("law", STOCK, ids=lambda law: law.name)
def test_no_contact_kernel_calls_libm_for_more_than_roots(law: ContactLaw, target: str) -> None:
    code = re.sub(r"/\*.*?\*/|\"\"\".*?\"\"\"", "", text_of(law, target), flags=re.DOTALL)
    called = set(re.findall(r"(?<![\w.])([a-z]\w*)\(", code))
    ours = {"sqrt", "fabs", "isfinite", "defined", "optimize", "error", "sizeof"} | {
        "float64",
        "int64",
        "range",
        "empty",
    }
    languages = {"int", "if", "while", "for", "njit", "float", "return"}
    assert {name for name in called if not name.startswith(law.name)} <= ours | languages


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
def test_a_kernel_holds_the_functions_that_it_calls_and_no_others(target: str) -> None:
    held = {law.name: set(re.findall(r"(?:double|def) _lane_(\w+)\(", text_of(law, target))) for law in STOCK}
    none: set[str] = set()
    assert held == {
        "rognon_gay": none,
        "steric": {"log1p"},
        "equal_spheres": {"log1p"},
        "droplet": {"log1p"},
        "dlvo": {"log1p", "exp"},
        "soap_film": {"log1p", "exp"},
    }
    assert "_exponent" not in text_of(rognon_gay, target)


def with_libm(text: str) -> str:
    """The same kernel, with libm's functions in the place of ours."""
    return re.sub(r"= (.*)_lane_(\w+)\(", r"= \1\2(", text)


def numbers_of(law: ContactLaw, text: str, folder: Path) -> tuple[Array, Array]:
    """Outputs of ``state`` and gaps and forces of ``contacts``, from C text, for a thousand contacts."""
    library = compile_c(text, folder)
    ir = contact_ir(law, needs_of(law))
    draw, n = np.random.default_rng(0), 1000
    values = {
        "E": 1.0,
        "eta": 1.0,
        "R": 1.0,
        "nu": 0.5,
        "size_ratio": 0.2,
        "Pi0": 0.3,
        "ell": 0.02,
        "A": 1e-7,
        "L": 0.03,
    }
    p = np.array([values[name] for name in ir.arrays["p"]])
    q = np.repeat([values[name] for name in ir.arrays["q"]], n)
    start = 10 ** draw.uniform(-3, -0.5, n)
    overlap = 2 * 10 ** draw.uniform(-4, -1, n) * draw.choice([1, 1, -0.3], n) - start
    state, y, gap, force, slope = np.empty(len(ir.functions["state"].gives) * n), *(np.zeros(n) for _ in range(4))
    more, count, number = np.empty(len(ir.settings["more"]) * n), ctypes.c_int64(n), ctypes.c_double
    passed = [array.ctypes.data_as(ctypes.c_void_p) for array in (overlap, start, np.zeros(n), p, q)]
    getattr(library, f"{law.name}_state")(
        count, number(0.5), *passed[:2], *passed[3:], state.ctypes.data_as(ctypes.c_void_p)
    )
    results = [array.ctypes.data_as(ctypes.c_void_p) for array in (y, gap, force, slope, more)]
    unsolved = getattr(library, f"{law.name}_contacts")(count, number(1.0), number(0.5), *passed, *results)
    assert unsolved == 0
    return state.reshape(-1, n), np.array([gap, force])


@pytest.mark.slow
@pytest.mark.parametrize(
    "law",
    [equal_spheres, *(pytest.param(law, marks=pytest.mark.slow) for law in (dlvo, steric))],
    ids=lambda law: law.name,
)
def test_kernels_give_the_numbers_of_libm(law: ContactLaw, tmp_path: Path) -> None:
    """Outputs to a few roundings, or what a difference of the law makes of them; solutions as far as they converge."""
    text = text_of(law, "c")
    assert with_libm(text) != text
    state, solution = numbers_of(law, text, tmp_path)
    expected, solved = numbers_of(law, with_libm(text), tmp_path)
    names = contact_ir(law, needs_of(law)).functions["state"].gives
    for name in ("friction", "friction_t"):
        row = names.index(name)
        np.testing.assert_allclose(state[row], expected[row], rtol=8 * 2**-53)
    size = np.maximum(np.abs(expected).max(axis=1, keepdims=True), np.finfo(float).tiny)  # no remote force, perhaps
    np.testing.assert_allclose(state / size, expected / size, rtol=1e-13, atol=8 * 2**-53)
    np.testing.assert_allclose(solution, solved, rtol=1e-11, atol=1e-13)


# ---------------------------------------------------------------- vectors


def is_gcc() -> bool:
    command = compiler()
    if command is None:
        return False
    macros = subprocess.run(
        [*command, "-dM", "-E", "-x", "c", "/dev/null"], capture_output=True, text=True, check=False
    )
    return "__GNUC__" in macros.stdout and "__clang__" not in macros.stdout


@pytest.mark.slow
@pytest.mark.skipif(not is_gcc(), reason="asks gcc which loops it has vectorised")
@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="names instruction sets of x86")
@pytest.mark.parametrize(
    "machine", ["haswell", *(pytest.param(one, marks=pytest.mark.slow) for one in ("x86-64", "x86-64-v4"))]
)
@pytest.mark.parametrize(
    "law",
    [pytest.param(law, marks=pytest.mark.slow if law in (dlvo, steric, soap_film) else ()) for law in STOCK],
    ids=lambda law: law.name,
)
def test_gcc_vectorises_the_loops_over_lanes(law: ContactLaw, machine: str, tmp_path: Path) -> None:
    """Newton's step and the tangent, with two, four and eight numbers in a vector."""
    source = tmp_path / "kernel.c"
    source.write_text(text_of(law, "c"), encoding="utf-8")
    flags = [flag for flag in FLAGS if flag != "-shared"]
    command = [*(compiler() or ()), *flags, f"-march={machine}", "-fopt-info-vec", "-c", str(source)]
    done = subprocess.run([*command, "-o", str(tmp_path / "k.o")], capture_output=True, text=True, check=False)
    if "bad value" in done.stderr:
        pytest.skip(f"this gcc does not know {machine}")
    lines = source.read_text(encoding="utf-8").splitlines()
    vectorised = {int(line) for line in re.findall(r"kernel\.c:(\d+):\d+: optimized: loop vectorized", done.stderr)}
    heads = [number for number, line in enumerate(lines, 1) if line.strip() == "for (int64_t k = 0; k < 16; k++) {"]
    laws_own = [
        number for number in heads if any("sqrt(1.0 + y_now * y_now)" in line for line in lines[number : number + 8])
    ]
    assert len(laws_own) == 2
    assert set(laws_own) <= vectorised


@pytest.mark.slow
@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="reads the assembler of x86")
def test_numba_vectorises_the_loops_over_lanes(tmp_path: Path) -> None:
    """Most of the divisions are packed: not those of one of the two loops alone."""
    ir = contact_ir(dlvo, ContactNeeds(fading=True))
    module = import_text(emit(ir, "numba").replace("cache=True, ", ""), tmp_path)
    none = np.empty(0)
    module.dlvo_contacts(0, 0.0, 1.0, none, none, none, np.ones(7), *[none] * 5)
    (assembler,) = module.dlvo_contacts.inspect_asm().values()
    divisions = sum(ir.functions[part].operations["div"] for part in ("iteration", "tangent"))
    # some of those counted have a common denominator
    assert len(re.findall(r"\bv?divpd\b", assembler)) > 0.6 * divisions


# ---------------------------------------------------------------- laws of users


@pytest.mark.parametrize("target", TARGETS)
def test_a_law_of_ones_own_gets_them_too(target: str) -> None:
    """Logarithm and exp(x) - 1, which no stock law has."""
    own = ContactLaw(
        name="own",
        a=rognon_gay.a,
        F_ela=rognon_gay.F_ela,
        zeta=rognon_gay.zeta * (3 + log(h / R) ** 2),
        F_adh=E * R**2 * (exp(-h / R) - 1),
    )
    text = emit(contact_ir(own, ContactNeeds()), target)
    assert set(re.findall(r"(?:double|def) _lane_(\w+)\(", text)) >= {"log", "expm1"}
