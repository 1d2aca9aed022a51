"""One form for kernels of every kind: templates use all of it, and its code is closed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from jinja2 import UndefinedError
from kernels_by_text import compile_c

from softdyn.derive.averaged_flow import averaged_flow, outlet
from softdyn.derive.contact_equations import ContactNeeds
from softdyn.derive.contact_kernel import contact_ir
from softdyn.derive.element_equations import ElementNeeds
from softdyn.derive.element_kernel import element_ir
from softdyn.derive.emit import emit, header, kernel_body, write, write_enclosures
from softdyn.derive.kernel_form import KernelIR, function, names_in
from softdyn.derive.pair_equations import Needs
from softdyn.derive.pair_kernel import kernel_ir
from softdyn.expression import parse
from softdyn.laws import law_of
from softdyn.targets import TARGETS

#: Of each kind, kernels that together use all of its form.
KINDS: dict[str, list[Callable[[], KernelIR]]] = {
    "pair": [
        lambda: kernel_ir(law_of("rognon_gay"), Needs()),
        lambda: kernel_ir(law_of("rognon_gay"), Needs(parse("sin(t)").shape, fixed={"R": "1"})),
    ],
    "contacts": [
        lambda: contact_ir(law_of("equal_spheres"), ContactNeeds(("R",), fading=True, tangential=True, drag=True)),
    ],
    "elements": [
        lambda: element_ir(averaged_flow(2, 2), ElementNeeds(uniform=("force",))),
        lambda: element_ir(outlet(2, 2), ElementNeeds()),
    ],
}


@cache
def kernels_of(kind: str) -> list[KernelIR]:
    return [make() for make in KINDS[kind]]


def entries(kind: str) -> list[tuple[str, str]]:
    """Every entry of the form, by its part."""
    parts = ("arrays", "functions", "settings")
    return sorted({(part, name) for ir in kernels_of(kind) for part in parts for name in getattr(ir, part)})


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_templates_use_every_entry_of_the_form_and_fail_without_it(kind: str) -> None:
    for part, name in entries(kind):
        missing = 0
        for ir in kernels_of(kind):
            left = {key: value for key, value in getattr(ir, part).items() if key != name}
            try:
                emit(replace(ir, **{part: left}), "c")
            except (UndefinedError, KeyError):
                missing += 1
        assert missing, f"no template uses {part}.{name} of {kind}"


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_form_is_text_and_numbers(kind: str) -> None:
    """No expression of sympy is left in it, so that a template can print all of it."""
    plain = (str, int, float, bool, tuple)
    for ir in kernels_of(kind):
        assert all(isinstance(value, plain) for value in ir.settings.values())
        for one in ir.functions.values():
            assert all(isinstance(part, str) for line in one.lines for part in line)
            # it gives what is asked of it, but for what a template has without code
            assert not one.lines or set(one.gives) <= {name for name, _ in one.lines}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_signatures_are_those_of_the_text(kind: str) -> None:
    for ir in kernels_of(kind):
        for target in TARGETS:
            written = write(ir, target)
            assert written.functions
            for name, (_, types) in written.functions.items():
                (line,) = (one for one in kernel_body(ir).splitlines() if one.startswith(f"def {ir.name}_{name}("))
                assert line.count(": ") == len(types)


def test_enclosures_are_a_kernel_too() -> None:
    """No law enters them: a form without functions, whose head says what it is, and no more."""
    for target in TARGETS:
        written = write_enclosures(target)
        assert list(written.functions) == ["of"]
        assert "Enclosures of expressions of time, written by softdyn" in written.text
        assert "Operations" not in written.text


def test_code_that_nothing_provides_for_is_refused() -> None:
    lines = [("x", "p0 * h"), ("y", "x + sqrt(late)")]
    made = function([*lines[:1]], ["x"], ("h", "delta"), {"p": ("p1", "p0")})
    assert (made.takes, made.reads) == (("h",), {"p": (("p0", 1),)})
    with pytest.raises(AssertionError, match="nothing provides late to the code of y"):
        function(lines, ["y"], ("h", "delta"), {"p": ("p1", "p0")})
    assert names_in("(nan if x > -inf and not y < c[3] else _lane_exp(z))") == {"x", "y", "c", "z"}


@pytest.mark.slow
def test_a_gap_that_stands_alone_is_a_term_of_the_gap(tmp_path: Path) -> None:
    """With R = 1 a product of delta and h has no more than h that depends on the gap alone."""
    for name in ("equal_spheres", "dlvo"):
        ir = kernel_ir(law_of(name), Needs(fixed={"R": "1"}))
        assert "h" not in ir.functions["newton"].takes
        assert compile_c(emit(ir, "c"), tmp_path)


@pytest.mark.slow
def test_the_head_names_what_was_declared() -> None:
    (ir,) = kernels_of("contacts")
    lines = header(ir).splitlines()
    assert lines[0].startswith("Contact law equal_spheres: written by softdyn ")
    assert any(line.startswith("    drag rotation = ") for line in lines)
    assert any(line.startswith("    k_t = ") for line in lines)
