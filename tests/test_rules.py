"""One list of rules for every kind of kernel: what a rule drops is absent from the kernel, and there without it."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import pytest

from softdyn.derive.averaged_flow import averaged_flow
from softdyn.derive.contact_equations import ContactNeeds
from softdyn.derive.contact_kernel import contact_ir
from softdyn.derive.element_equations import ElementNeeds
from softdyn.derive.element_kernel import element_ir
from softdyn.derive.emit import emit
from softdyn.derive.equations import Equations
from softdyn.derive.pair_equations import Needs
from softdyn.derive.pair_kernel import kernel_ir
from softdyn.derive.rules import RULES, Rule, specialised
from softdyn.laws import law_of


def pair(law: str, needs: Needs) -> Callable[..., Any]:
    return lambda rules: kernel_ir(law_of(law), needs, rules)


def contacts(law: str, needs: ContactNeeds) -> Callable[..., Any]:
    return lambda rules: contact_ir(law_of(law), needs, rules)


def elements(needs: ElementNeeds) -> Callable[..., Any]:
    return lambda rules: element_ir(averaged_flow(2, 1), needs, rules)


#: Of each rule a kernel that it is applied to, and a name that is then absent from its code.
DROPPED: list[tuple[str, Callable[..., Any], str]] = [
    ("one sign of delta", pair("rognon_gay", Needs(deflection="compression")), "fabs"),
    ("constant force", pair("rognon_gay", Needs(outputs=("ddelta_dt",))), "dF_dt"),
    ("rigid drive", pair("rognon_gay", Needs(control="velocity")), "compliance_p1"),
    ("no remote force", pair("rognon_gay", Needs(outputs=("dh_dt",))), "F_adh"),
    ("fixed parameters", pair("rognon_gay", Needs(fixed={"eta": "2"})), "eta"),
    ("outputs asked for", pair("rognon_gay", Needs(outputs=("X",))), "lambda2"),
    ("no range", contacts("rognon_gay", ContactNeeds()), "film"),
    ("no remote force", contacts("rognon_gay", ContactNeeds()), "F_adh"),
    ("equal radii", contacts("equal_spheres", ContactNeeds(tangential=True)), "size_ratio"),
    ("absent coefficients", elements(ElementNeeds(absent=("us",))), "own_us0_d0"),
    ("absent coefficients", elements(ElementNeeds(absent=("rho",))), "own_rho"),
    ("unit coefficients", elements(ElementNeeds(unit=("c",))), "own_c"),
    ("uniform coefficients", elements(ElementNeeds(uniform=("c",))), "own_c_d1"),
]


def names_in(lines: Any) -> set[str]:
    """Every name in straight-line code."""
    return {name for left, right in lines for name in re.findall(r"[A-Za-z_]\w*", f"{left} {right}")}


def names_of(ir: Any) -> set[str]:
    """Every name in the code that was derived for a kernel."""
    return {name for function in ir.functions.values() for name in names_in(function.lines)}


@pytest.mark.parametrize(("rule", "make", "name"), DROPPED, ids=[f"{rule} {name}" for rule, _, name in DROPPED])
def test_what_a_rule_drops_is_absent(rule: str, make: Callable[..., Any], name: str) -> None:
    without = tuple(one for one in RULES if one.name != rule)
    with_rule, general = make(RULES), make(without)
    assert rule in [saving.rule for saving in with_rule.savings]
    assert rule not in [saving.rule for saving in general.savings]
    if rule == "fixed parameters":
        assert name not in with_rule.arrays["p"]
    elif rule == "outputs asked for":
        assert with_rule.savings[-1].after < general.savings[-1].after
    else:
        assert name in names_of(general)
    assert name not in names_of(with_rule)


def test_every_rule_is_held_to_it() -> None:
    assert {rule for rule, _, _ in DROPPED} == {rule.name for rule in RULES}


def test_rules_are_those_of_a_kind_and_stay_in_order() -> None:
    """A rule that reads the needs of contacts is none of a pair's, whatever it says of when it applies."""
    always = Rule("always", (ContactNeeds,), lambda *_: True, lambda equations, _: equations)
    nothing = Equations({}, frozenset())
    assert specialised(nothing, Needs(), (always,))[1] == ()
    assert [saving.rule for saving in specialised(nothing, ContactNeeds(), (always, always))[1]] == ["always"] * 2
    of_contacts = contact_ir(law_of("rognon_gay"), ContactNeeds())
    assert [saving.rule for saving in of_contacts.savings] == ["no range", "no remote force"]


def test_equations_are_left_as_they_are_given() -> None:
    """Rules are pure: the equations, which are kept for other scenes, are not changed."""
    ir = kernel_ir(law_of("rognon_gay"), Needs("table", outputs=None))
    kernel_ir(law_of("rognon_gay"), Needs(deflection="tension", fixed={"R": "2"}))
    assert emit(kernel_ir(law_of("rognon_gay"), Needs("table", outputs=None)), "c") == emit(ir, "c")
