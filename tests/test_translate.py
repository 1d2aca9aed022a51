"""One text, two languages: what is translated computes the same bits in C as in Python, and the rest is refused."""

from __future__ import annotations

import ast
import ctypes
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from invented_laws import LAWS
from kernels_by_text import compile_c

from softdyn.derive.emit import kernel_body
from softdyn.derive.pair_equations import OUTPUTS, Needs
from softdyn.derive.pair_kernel import kernel_ir
from softdyn.derive.translate import TranslationError, to_c

HEAD = "#include <math.h>\n#include <stdint.h>\n"
NAMES = ("x", "y", "z")


def c_library(python: str, folder: Path) -> ctypes.CDLL:
    """Translate a module and compile it."""
    return compile_c(HEAD + to_c(python), folder)


def python_module(python: str) -> dict[str, Any]:
    """Run a module as Python, with the names that kernels import."""
    scope: dict[str, Any] = {
        name: getattr(np, name) for name in ("sqrt", "fabs", "exp", "log", "sin", "tanh", "isfinite", "inf", "nan")
    }
    scope |= {"array": None, "empty": np.empty, "pow": np.power}
    exec(python, scope)
    return scope


# ---------------------------------------------------------------- arithmetic


OPERATORS = (ast.Add(), ast.Sub(), ast.Mult(), ast.Div())
COMPARISONS = (ast.Lt(), ast.LtE(), ast.Gt(), ast.GtE(), ast.Eq(), ast.NotEq())


@st.composite
def trees(draw: st.DrawFn, depth: int = 4) -> ast.expr:
    """Random arithmetic in x, y, z as syntax trees: unparsing them writes parentheses only where Python needs them."""
    kind = draw(st.integers(0, 9)) if depth else 0
    if kind < 2:
        if draw(st.booleans()):
            return ast.Name(draw(st.sampled_from(NAMES)))
        return ast.Constant(draw(st.sampled_from((0.5, 1.0, 2.0, 0.1, 3.0, 1e-3, 7e20))))
    if kind < 7:
        left, right = draw(trees(depth - 1)), draw(trees(depth - 1))
        return ast.BinOp(left, draw(st.sampled_from(OPERATORS)), right)
    if kind == 7:
        return ast.UnaryOp(ast.USub(), draw(trees(depth - 1)))
    if kind == 8:
        return ast.Call(ast.Name(draw(st.sampled_from(("fabs", "sqrt")))), [draw(trees(depth - 1))], [])
    return ast.IfExp(draw(conditions(depth - 1)), draw(trees(depth - 1)), draw(trees(depth - 1)))


@st.composite
def conditions(draw: st.DrawFn, depth: int) -> ast.expr:
    """Random comparisons of arithmetic, joined by and, or and not."""
    kind = draw(st.integers(0, 5)) if depth else 5
    if kind < 2:
        parts = [draw(conditions(depth - 1)), draw(conditions(depth - 1))]
        return ast.BoolOp(draw(st.sampled_from((ast.And(), ast.Or()))), parts)
    if kind == 2:
        return ast.UnaryOp(ast.Not(), draw(conditions(depth - 1)))
    left, right = draw(trees(max(0, depth - 1))), draw(trees(max(0, depth - 1)))
    return ast.Compare(left, [draw(st.sampled_from(COMPARISONS))], [right])


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
@given(
    st.lists(trees(), min_size=10, max_size=20), st.lists(st.tuples(*[st.floats(-9, 9)] * 3), min_size=3, max_size=3)
)
def test_arithmetic_has_the_same_bits_in_both_languages(
    tmp_path_factory: pytest.TempPathFactory, expressions: list[ast.expr], points: list[tuple[float, ...]]
) -> None:
    """IEEE arithmetic, sqrt and fabs round correctly, so precedence and grouping are all that could differ."""
    arguments = ", ".join(f"{name}: float" for name in NAMES)
    texts = [ast.unparse(ast.fix_missing_locations(ast.Expression(e))) for e in expressions]
    module = "\n\n".join(f"def f{i}({arguments}) -> float:\n    return {text}" for i, text in enumerate(texts))
    library, python = c_library(module, tmp_path_factory.mktemp("c")), python_module(module)
    for i, text in enumerate(texts):
        compiled = getattr(library, f"f{i}")
        compiled.argtypes, compiled.restype = [ctypes.c_double] * 3, ctypes.c_double
        for point in points:
            with np.errstate(all="ignore"):
                try:
                    expected = float(python[f"f{i}"](*map(np.float64, point)))
                except ZeroDivisionError:
                    continue  # constants alone: numba and C give inf or nan, as numpy does
            found = compiled(*point)
            assert found == expected or (math.isnan(found) and math.isnan(expected)), (text, point)


@pytest.mark.parametrize(
    ("python", "c"),
    [
        ("x - (y - z)", "x - (y - z)"),
        ("x - y - z", "x - y - z"),
        ("x / (y * z)", "x / (y * z)"),
        ("x / y * z", "x / y * z"),
        ("x / (y / z)", "x / (y / z)"),
        ("x + (y + z)", "x + (y + z)"),
        ("-x * y", "-x * y"),
        ("-(x * y)", "-(x * y)"),
        ("-(-x)", "-(-x)"),
        ("x - -y", "x - -y"),
        ("(x if y > z else z) * x", "(y > z ? x : z) * x"),
        ("x if y > z else z if x > y else y", "y > z ? x : x > y ? z : y"),
        ("(x if y > z else y) if z > x else z", "z > x ? (y > z ? x : y) : z"),
    ],
)
def test_parentheses_are_kept_where_c_needs_them(python: str, c: str) -> None:
    """Sums and products are not associative in floating point."""
    text = to_c(f"def f(x: float, y: float, z: float) -> float:\n    return {python}\n")
    (found,) = re.findall(r"return (.*);", text)
    without = re.sub(r"[()]", "", found)
    assert without == re.sub(r"[()]", "", c)
    # more parentheses than needed do no harm; that the value is the same is tested above
    for x, y, z in ((1e16, 1.0, 3.0), (-2.0, 3.0, 7.0), (5.0, -1.0, 0.1)):
        ternary = re.compile(r"\?|:")
        if not ternary.search(found):
            assert eval(found, {"x": x, "y": y, "z": z}) == eval(python, {"x": x, "y": y, "z": z})


# ---------------------------------------------------------------- statements

PROGRAMS = {
    "root": """
def f(x: float, n: int, v: array) -> float:
    guess = x
    for i in range(n):
        guess = 0.5 * (guess + x / guess)
    return guess
""",
    "assigned in branches, used after": """
def f(x: float, n: int, v: array) -> float:
    if x > 2.0:
        low = x
        high = 2.0 * x
    elif x > 1.0:
        low = -x
        high = x
    else:
        low = 0.0
        high = 1.0
    return high - low
""",
    "leaves loops early": """
def f(x: float, n: int, v: array) -> float:
    total = 0.0
    for i in range(100):
        if float(i) > x * 10.0:
            break
        if float(i) < x:
            continue
        total += float(i) / x
        while total > 50.0:
            total -= 7.0
            if total < 3.0:
                break
    return total
""",
    "arrays and other functions": """
def _square(x: float) -> float:
    return x * x

def _fill(v: array, x: float):
    w = empty(2)
    w[0] = x
    w[1] = _square(x)
    v[0] = w[0] + w[1]
    v[1] = v[0] * w[1]

def f(x: float, n: int, v: array) -> float:
    _fill(v, x)
    v[2] = _square(v[1])
    k: int = n - 1
    v[k] += 1.0
    return v[0] + v[1] + v[2] + v[k]
""",
    "counts": """
def f(x: float, n: int, v: array) -> float:
    k: int = 0
    while k < n and (x > 1.0 or not k > 2):
        k += 1
    return float(k) + float(int(x * 10.0))
""",
    "infinite": """
def f(x: float, n: int, v: array) -> float:
    low = -inf
    high = inf
    if not isfinite(low + high) and low < x and x < high:
        return fabs(low)
    return nan
""",
}


@pytest.mark.parametrize("name", list(PROGRAMS))
def test_statements_do_the_same_in_both_languages(name: str, tmp_path: Path) -> None:
    compiled = c_library(PROGRAMS[name], tmp_path).f
    compiled.argtypes, compiled.restype = [ctypes.c_double, ctypes.c_int64, ctypes.c_void_p], ctypes.c_double
    python = python_module(PROGRAMS[name])["f"]
    for x in (0.3, 1.0, 1.7, 2.0, 3.9):
        for n in (1, 3):
            here, there = np.zeros(4), np.zeros(4)
            with np.errstate(invalid="ignore"):
                expected = float(python(np.float64(x), n, here))
            found = compiled(x, n, there.ctypes.data)
            assert found == expected
            np.testing.assert_array_equal(here, there)


def test_an_array_is_const_unless_it_is_written_to() -> None:
    text = to_c(PROGRAMS["arrays and other functions"])
    assert "static inline double _square(double x)" in text
    assert "static inline void _fill(double *restrict v, double x)" in text
    read_only = to_c("def g(v: array) -> float:\n    return v[0]\n")
    assert "double g(const double *restrict v)" in read_only
    through = to_c("def _set(v: array):\n    v[0] = 1.0\n\ndef g(v: array, u: array):\n    _set(v)\n    v[0] = u[0]\n")
    assert "void g(double *restrict v, const double *restrict u)" in through


def test_integers_are_read_from_indices_and_not_written() -> None:
    text = "def f(n: int, of: indices, x: array) -> float:\n    i: int = of[n]\n    return x[of[i] + 1]\n"
    translated = to_c(text)
    assert "double f(int64_t n, const int64_t *restrict of, const double *restrict x)" in translated
    assert "const int64_t i = of[n];" in translated
    with pytest.raises(TranslationError, match="line 1: of of f is to be read, not written"):
        to_c("def f(of: indices) -> None:\n    of[0] = 1\n")


def test_what_is_assigned_once_is_const() -> None:
    text = to_c("def f(x: float) -> float:\n    y = 2.0 * x\n    z = y\n    z += 1.0\n    return z\n")
    assert "const double y = 2.0 * x;" in text
    assert "    double z = y;" in text


# ---------------------------------------------------------------- comments


def test_comments_and_docstrings_are_kept_where_they_stand() -> None:
    text = to_c(
        'def f(x: float) -> float:\n    """What it does.\n\n    More of it.\n    """\n    # first\n    y = x\n'
        "    if y > 0.0:\n        # within\n        # twice\n        y = 1.0\n    # last\n    return y\n"
    )
    assert text == (
        "/* What it does.\n\n   More of it. */\ndouble f(double x)\n{\n    /* first */\n    double y = x;\n"
        "    if (y > 0.0) {\n        /* within */\n        /* twice */\n        y = 1.0;\n    }\n"
        "    /* last */\n    return y;\n}\n"
    )


@pytest.mark.parametrize("drive", ["constant", "table"])
def test_no_comment_of_a_kernel_is_lost(drive: str) -> None:
    body = kernel_body(kernel_ir(LAWS["rognon_gay"], Needs(drive=drive, outputs=OUTPUTS)))
    text = to_c(body)
    comments = re.findall(r"^\s*# (.*)$", body, re.MULTILINE)
    assert len(comments) >= 5
    for comment in comments:
        assert f"/* {comment} */" in text
    docstrings = [ast.get_docstring(node) for node in ast.parse(body).body if isinstance(node, ast.FunctionDef)]
    assert all(docstrings)
    for docstring in docstrings:
        assert docstring is not None
        assert f"/* {docstring.splitlines()[0]}" in text


@pytest.mark.parametrize(
    "python",
    [
        "def f(x: float) -> float:\n    # ends */ early\n    return x\n",
        'def f(x: float) -> float:\n    """Ends */ early."""\n    return x\n',
    ],
    ids=["comment", "docstring"],
)
def test_no_comment_ends_early(python: str, tmp_path: Path) -> None:
    """Refused or written so that C reads it as one comment."""
    try:
        library = c_library(python, tmp_path)
    except TranslationError:
        return
    library.f.argtypes, library.f.restype = [ctypes.c_double], ctypes.c_double
    assert library.f(2.5) == 2.5


# ---------------------------------------------------------------- refusals

OUTSIDE = {
    "power": "return x ** 2",
    "remainder": "return x % 2.0",
    "floor division": "return x // 2.0",
    "floor division in place": "x //= 2.0\nreturn x",
    "power in place": "x **= 2\nreturn x",
    "bits": "return n & 1",
    "matrix product": "return x @ x",
    "complement": "return ~n",
    "chained comparison": "return 1.0 if 0.0 < x < 1.0 else 2.0",
    "identity": "return 1.0 if x is x else 2.0",
    "membership": "return 1.0 if x in v else 2.0",
    "truth value": "return True",
    "text": "return 'a'",
    "None": "return None",
    "complex number": "return 1j",
    "list": "return [x][0]",
    "tuple": "return (x, x)[0]",
    "slice": "return v[0:2]",
    "attribute": "return math.sqrt(x)",
    "keyword": "return pow(x, y=2.0)",
    "lambda": "return (lambda: x)()",
    "walrus": "return (y := x)",
    "formatted text": "return f'{x}'",
    "chained assignment": "y = z = x\nreturn y",
    "unpacking": "y, z = x, x\nreturn y",
    "assertion": "assert x > 0.0\nreturn x",
    "exception": "raise x",
    "try": "try:\n    return x\nexcept ValueError:\n    return x",
    "with": "with x:\n    return x",
    "import": "import os\nreturn x",
    "inner function": "def g():\n    return x\nreturn x",
    "global": "global y\nreturn x",
    "deletion": "del x\nreturn 1.0",
    "loop over an array": "for u in v:\n    x += u\nreturn x",
    "range with a start": "for i in range(1, n):\n    x += 1.0\nreturn x",
    "range with a step": "for i in range(0, n, 2):\n    x += 1.0\nreturn x",
    "else of a for": "for i in range(n):\n    x += 1.0\nelse:\n    x = 0.0\nreturn x",
    "else of a while": "while x > 1.0:\n    x = x / 2.0\nelse:\n    x = 0.0\nreturn x",
    "unknown type": "y: complex = x\nreturn x",
    "unknown function": "return foo(x)",
    "function of Python's": "return max(x, 1.0)",
    "negative index": "return v[-1]",
    "number too large": "return 1e400",
}


@pytest.mark.parametrize("what", list(OUTSIDE))
def test_what_lies_outside_the_subset_is_refused_with_its_line(what: str) -> None:
    body = OUTSIDE[what].replace("\n", "\n    ")
    with pytest.raises(TranslationError, match=r"line \d+"):
        to_c(f"def f(x: float, n: int, v: array) -> float:\n    {body}\n")


@pytest.mark.parametrize(
    "head",
    [
        "def f(x) -> float:",
        "def f(x: str) -> float:",
        "def f(x: float) -> complex:",
        "def f(x: float = 1.0) -> float:",
        "def f(x: float, *more: float) -> float:",
        "def f(x: float, *, y: float) -> float:",
        "def f(x: float, **more: float) -> float:",
        "async def f(x: float) -> float:",
        "class f:",
    ],
)
def test_a_signature_outside_the_subset_is_refused(head: str) -> None:
    with pytest.raises(TranslationError, match=r"line \d+"):
        to_c(f"{head}\n    return 1.0\n")


@pytest.mark.parametrize("statement", ["k = 3", "import math", "print(1)"])
def test_a_module_holds_functions_and_nothing_else(statement: str) -> None:
    with pytest.raises(TranslationError, match=r"line 1"):
        to_c(f"{statement}\n\ndef f(x: float) -> float:\n    return x\n")


@pytest.mark.parametrize(
    "expression",
    ["1 / 2 * x", "x * (n / 2)", "abs(x)", "round(x)", "min(x, 2.0)", "x and 2.0", "-7 / 2 + x", "x + n / 4 / 2"],
)
def test_what_means_something_else_in_c_is_refused_or_translated_rightly(expression: str, tmp_path: Path) -> None:
    """C divides integers to integers, its abs is of integers, its 'and' is 0 or 1; such text must not slip through."""
    python = f"def f(x: float, n: int) -> float:\n    return {expression}\n"
    try:
        text = to_c(python)
    except TranslationError:
        return
    compiled = compile_c(HEAD + text, tmp_path).f
    compiled.argtypes, compiled.restype = [ctypes.c_double, ctypes.c_int64], ctypes.c_double
    for x, n in ((2.5, 3), (-0.5, 7)):
        assert compiled(x, n) == eval(expression, {"x": x, "n": n})
