"""What was proved of a law as it was declared is kept on disk, while the law and the prover are the same."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from sympy import Function, Symbol, exp, pi, sqrt
from test_regimes import changed

from softdyn import cache, verdicts
from softdyn.derive import ContactLaw, E, R, a, closure, delta, eta, h, law
from softdyn.derive.dimensions import DIMENSIONLESS
from softdyn.derive.laws.rognon_gay import law as rognon_gay
from softdyn.errors import LawError

#: Sound, and quickly proved.
PARTS: dict[str, Any] = {
    "name": "own",
    "a": sqrt(R * h),
    "F_ela": E * a * delta,
    "zeta": pi * eta * a**2 / h,
}


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SOFTDYN_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


class ProvedAnewError(Exception):
    """The prover was asked."""


def refuse_to_prove(monkeypatch: pytest.MonkeyPatch) -> None:
    def asked(*_: Any) -> list[str]:
        raise ProvedAnewError

    for module in (law, closure):
        monkeypatch.setattr(module, "faults_of", asked)


def test_a_law_is_proved_once(monkeypatch: pytest.MonkeyPatch) -> None:
    ContactLaw(**PARTS)
    refuse_to_prove(monkeypatch)
    ContactLaw(**PARTS)
    with pytest.raises(ProvedAnewError):
        ContactLaw(**{**PARTS, "F_ela": 2 * E * a * delta})


def test_a_closure_is_proved_once(monkeypatch: pytest.MonkeyPatch) -> None:
    drag = {"name": "own", "gives": "drag", "expression": 6 * pi * closure.eta * closure.r}
    closure.Closure(**drag)
    refuse_to_prove(monkeypatch)
    closure.Closure(**drag)
    with pytest.raises(ProvedAnewError):
        closure.Closure(**{**drag, "expression": 7 * pi * closure.eta * closure.r})


def test_a_changed_prover_proves_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    ContactLaw(**PARTS)
    refuse_to_prove(monkeypatch)
    monkeypatch.setattr(verdicts, "prover_digest", lambda: "another")
    with pytest.raises(ProvedAnewError):
        ContactLaw(**PARTS)


@pytest.mark.parametrize("kept", [b'{"open": []}', b"[1]", b"[", b"\xff"])
def test_what_is_damaged_is_proved_anew(kept: bytes, own_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where its digest says that it is whole; then it is mended."""
    ContactLaw(**PARTS)
    (entry,) = (own_cache / verdicts.KIND).iterdir()
    cache.publish(verdicts.KIND, entry.name, {"open.json": kept}, replace=True)
    with monkeypatch.context() as patched:
        refuse_to_prove(patched)
        with pytest.raises(ProvedAnewError):
            ContactLaw(**PARTS)
    ContactLaw(**PARTS)
    refuse_to_prove(monkeypatch)
    ContactLaw(**PARTS)
    (entry / "open.json").write_text("[] ")
    with pytest.raises(ProvedAnewError):
        ContactLaw(**PARTS)


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="permissions of POSIX")
def test_nothing_is_believed_that_others_could_write(own_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ContactLaw(**PARTS)
    (entry,) = (own_cache / verdicts.KIND).iterdir()
    entry.chmod(0o777)
    refuse_to_prove(monkeypatch)
    with pytest.raises(ProvedAnewError):
        ContactLaw(**PARTS)


def test_without_a_folder_laws_are_proved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("SOFTDYN_CACHE_DIR", str(tmp_path / "file"))
    ContactLaw(**PARTS)
    with pytest.raises(LawError, match="zeta must be positive"):
        ContactLaw(**{**PARTS, "zeta": -PARTS["zeta"]})


def test_a_faulty_law_is_refused_each_time() -> None:
    for _ in range(2):
        with pytest.raises(LawError, match="zeta must be positive"):
            ContactLaw(**{**PARTS, "zeta": -PARTS["zeta"]})


def test_what_is_not_proved_is_told_each_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(law, "undecided_signs", lambda _: ["zeta > 0 is not proved at h near 0.03"])
    with pytest.warns(UserWarning, match="law 'own': zeta > 0 is not proved at h near 0.03"):
        ContactLaw(**PARTS)
    refuse_to_prove(monkeypatch)
    with pytest.warns(UserWarning, match="law 'own': zeta > 0 is not proved at h near 0.03"):
        ContactLaw(**PARTS)


def test_what_differs_is_written_differently() -> None:
    """Whatever it is: an expression, an assumption, a claim, a range, a type, a class of the user's own."""
    own = Symbol("own", positive=True)
    parts: dict[str, Any] = {"parameters": {own: DIMENSIONLESS}, "typical": {own: 1}, "ranges": {own: (0, 2)}}
    limits = rognon_gay.limits
    drag = replace(rognon_gay.drag, translation=2 * rognon_gay.drag.translation)
    claims = [replace(limits[0], within={"zeta": 0.05}), replace(limits[0], claims={"zeta": eta * R})]
    laws = [
        changed(**{**parts, **others})
        for others in (
            {},
            *({name: 2 * getattr(rognon_gay, name)} for name in ("a", "F_ela", "zeta")),
            {"general": True},
            {"ranges": {own: (0, 3)}},
            {"typical": {own: 2}},
            {"drag": drag},
            *({"limits": claimed} for claimed in (limits, limits[1:], *((one, *limits[1:]) for one in claims))),
        )
    ]
    assert len({verdicts.written(one) for one in laws}) == len(laws)
    assert verdicts.written(Symbol("x", positive=True)) != verdicts.written(Symbol("x", real=True))
    assert len({verdicts.written(one) for one in (1, 1.0, "1", True)}) == 4
    assert verdicts.written(exp(h)) != verdicts.written(type("exp", (Function,), {})(h))
