"""Lemmas for Isabelle, read back by a small grammar of terms and evaluated: they say what the law says."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from softdyn.cli import main
from softdyn.derive.certificate import certificates
from softdyn.derive.lemmas import theory
from softdyn.laws import law_of, law_or_closure_of

LEMMA = re.compile(
    r"lemma \w+_\d:\n(?:  fixes (?P<fixes>[\w ]+) :: real\n)?(?:  assumes(?P<assumes>( \"[^\"]+ > 0\")+)\n)?"
    r"  shows \"\(\(\\<lambda>x::real\. (?P<goal>[^\"]+)\) \\<longlongrightarrow> 1\) at_top\"\n"
    r"  (?:using assms )?by real_asymp\n"
)
TOKEN = re.compile(r"\s*(powr|exp|ln|pi|v_\w+|x|\d+|[-+*/^()])")


class Term:
    """Value of a term: sums of products of powers, as Isabelle binds them."""

    def __init__(self, text: str, known: dict[str, float]) -> None:
        self.tokens, self.known = [], known
        place = 0
        while place < len(text):
            found = TOKEN.match(text, place)
            assert found, text[place:]
            self.tokens.append(found[1])
            place = found.end()

    def next(self, *wanted: str) -> str | None:
        return self.tokens.pop(0) if self.tokens and (not wanted or self.tokens[0] in wanted) else None

    def whole(self) -> float:
        value = self.sum()
        assert not self.tokens, self.tokens
        return value

    def sum(self) -> float:
        value = self.product()
        while sign := self.next("+", "-"):
            value += self.product() if sign == "+" else -self.product()
        return value

    def product(self) -> float:
        value = self.power()
        while sign := self.next("*", "/"):
            other = self.power()
            value = value * other if sign == "*" else value / other
        return value

    def power(self) -> float:
        if self.next("-"):
            return -self.power()
        value = self.atom()
        return value ** self.power() if self.next("powr", "^") else value

    def atom(self) -> float:
        token = self.next()
        assert token is not None
        if token == "(":
            value = self.sum()
            assert self.next(")")
            return value
        if token in ("exp", "ln"):
            return getattr(math, {"exp": "exp", "ln": "log"}[token])(self.atom())  # type: ignore[no-any-return]
        return math.pi if token == "pi" else self.known[token] if token in self.known else float(int(token))


@pytest.mark.parametrize(
    "name", ["rognon_gay", "cone", "hertz_dry", pytest.param("equal_spheres", marks=pytest.mark.slow)]
)
def test_lemmas_are_terms_and_their_quotients_tend_to_1(name: str) -> None:
    text = theory("Limits", certificates(law_of(name))[0])
    assert text.startswith("theory Limits\n")
    assert text.endswith("\nend\n")
    assert text.count("lemma ") > 3
    quotients_tend_to_1(text)


@pytest.mark.parametrize("name", ["krieger_dougherty", pytest.param("beetstra", marks=pytest.mark.slow)])
def test_lemmas_of_closures_have_their_powers_and_differences_written_out(name: str) -> None:
    text = theory("Limits", certificates(law_or_closure_of(name))[0])
    assert "power_" not in text
    quotients_tend_to_1(text)


def quotients_tend_to_1(text: str) -> None:
    found = list(LEMMA.finditer(text))
    assert len(found) == text.count("lemma ") > 0
    for one in found:
        fixed = {symbol: 0.3 + 0.17 * i for i, symbol in enumerate((one["fixes"] or "").split())}
        for condition in re.findall(r"\"([^\"]+) > 0\"", one["assumes"] or ""):
            assert Term(condition, fixed).whole() > 0
        far, further = (abs(Term(one["goal"], {**fixed, "x": x}).whole() - 1) for x in (1e4, 1e8))
        assert further < 0.1
        assert further <= far + 1e-9


@pytest.mark.slow
def test_the_command_writes_a_theory(tmp_path: Path) -> None:
    path = tmp_path / "Limits.thy"
    assert main(["check", "rognon_gay", "--lemmas", str(path)]) == 0
    assert path.read_text(encoding="utf-8").startswith("theory Limits\n")
