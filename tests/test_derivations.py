"""Expressions that were derived are kept on disk, and come back as they are."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
from sympy import Add, Dummy, Expr, Mul, Symbol, exp, log, pi, sqrt, srepr

from softdyn import derivations
from softdyn.derivations import kept
from softdyn.derive import ContactLaw, E, R, a, delta, eta, h
from softdyn.derive.dynamics import partials

x, y = Symbol("x", positive=True), Symbol("y")


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SOFTDYN_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


class DerivedAnewError(Exception):
    """What was kept is not found."""


def never() -> Any:
    raise DerivedAnewError


@pytest.mark.parametrize(
    "found",
    [
        2 * sqrt(x + 1) + exp(-x) / pi,
        Mul(2, x + y, evaluate=False),
        Add(x, Mul(2, 3, evaluate=False), x, evaluate=False),
        1 / Mul(x, 1 + 1 / Mul(3, x + 1, evaluate=False), evaluate=False),
    ],
)
def test_an_expression_comes_back_as_it_is(found: Expr) -> None:
    """Products that sympy would multiply out among them: kernels are the same whether or not they were kept."""
    assert srepr(kept("it", [x], lambda: found)) == srepr(found)
    assert srepr(kept("it", [x], never)) == srepr(found)
    with pytest.raises(DerivedAnewError):
        kept("it", [y], never)
    with pytest.raises(DerivedAnewError):
        kept("another", [x], never)


@pytest.mark.parametrize("found", [Dummy("z") + x, exp(Mul(2, log(x), evaluate=False), evaluate=False)])
def test_what_would_come_back_otherwise_is_not_kept(found: Expr) -> None:
    assert kept("it", [x], lambda: found) == found
    with pytest.raises(DerivedAnewError):
        kept("it", [x], never)


def test_another_tool_derives_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    kept("it", [x], lambda: x)
    monkeypatch.setattr(derivations, "prover_digest", lambda: "another")
    with pytest.raises(DerivedAnewError):
        kept("it", [x], never)


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="permissions of POSIX")
def test_what_is_damaged_or_others_could_write_is_derived_anew(own_cache: Path) -> None:
    kept("it", [x], lambda: x)
    (entry,) = (own_cache / derivations.KIND).iterdir()
    (entry / "found.pickle").write_bytes(b"cos\nsystem\n(S'echo harm'\ntR.")
    with pytest.raises(DerivedAnewError):
        kept("it", [x], never)
    kept("it", [x], lambda: x)
    entry.chmod(0o777)
    with pytest.raises(DerivedAnewError):
        kept("it", [x], never)


def test_slopes_of_a_law_are_the_same_from_the_disk() -> None:
    """To the order of their terms, and of the mapping that they stand in."""

    def derived() -> list[str]:
        law = ContactLaw(name="own", a=sqrt(R * h + delta**2), F_ela=E * a * delta, zeta=pi * eta * a**2 / h)
        slopes = partials(law)
        return [*map(srepr, slopes), *map(srepr, slopes.values())]

    first = derived()
    assert derived() == first
