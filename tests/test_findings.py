"""What is found of a law is kept on disk, and is the same when it is read again."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from test_films import LAWS
from test_regimes import changed

from softdyn import findings
from softdyn.derive import E, R
from softdyn.derive.laws.rognon_gay import law as rognon_gay
from softdyn.derive.symbols import eta
from softdyn.study.findings_text import limits_text, regimes_text


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SOFTDYN_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


def text_of(law: Any) -> str:
    diagram = findings.regimes_of(law)
    return regimes_text(diagram, findings.films_of(diagram)) + limits_text(law.name, findings.limits_of(law))


def never(*_: Any) -> Any:
    raise AssertionError("it was found before")


def forget_how(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("discover", "find_films", "check_limits"):
        monkeypatch.setattr(findings, name, never)


@pytest.mark.slow
@pytest.mark.parametrize("law", [rognon_gay, changed(**LAWS["power"])], ids=["claims", "films"])
def test_what_was_found_is_read_again(law: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    first = text_of(law)
    forget_how(monkeypatch)
    assert text_of(law) == first


def test_another_law_is_looked_at_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where it differs in a typical value, or in a claim, only."""
    law = changed(**LAWS["power"], limits=rognon_gay.limits)
    kept = findings.identity(law)
    limit = law.limits[0]
    others = [
        replace(law, typical={symbol: 2 * value for symbol, value in law.typical.items()}),
        replace(law, limits=law.limits[1:]),
        replace(law, limits=(replace(limit, claims={"zeta": eta * R}), *law.limits[1:])),
        replace(law, F_ela=2 * law.F_ela),
        replace(law, F_adh=E * R**2 * law.F_adh / (E * R**2 + law.F_adh)),
    ]
    assert all(findings.identity(other) != kept for other in others)
    assert findings.identity(replace(law)) == kept


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "getuid"), reason="permissions of POSIX")
def test_nothing_is_read_where_others_can_write(own_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is found again; an answer does not need the cache."""
    findings.regimes_of(rognon_gay)
    (entry,) = (own_cache / findings.KIND).iterdir()
    entry.chmod(0o777)
    with monkeypatch.context() as patched:
        forget_how(patched)
        with pytest.raises(AssertionError, match="found before"):
            findings.regimes_of(rognon_gay)
    assert findings.regimes_of(rognon_gay).regimes


@pytest.mark.slow
def test_what_is_damaged_is_found_again(own_cache: Path) -> None:
    first = findings.regimes_of(rognon_gay)
    (entry,) = (own_cache / findings.KIND).iterdir()
    (entry / "found.pickle").write_bytes(b"cos\nsystem\n(S'echo harm'\ntR.")
    assert findings.regimes_of(rognon_gay) == first


@pytest.mark.slow
def test_without_a_folder_nothing_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("SOFTDYN_CACHE_DIR", str(tmp_path / "file"))
    assert findings.regimes_of(rognon_gay).regimes


@pytest.mark.slow
def test_the_same_law_gets_the_same_bytes_in_any_process() -> None:
    """However sets and dictionaries are ordered there."""
    code = (
        "from softdyn.derive.films import find_films; from softdyn.derive.regimes import discover;"
        "from softdyn.laws import law_of; from softdyn.study.findings_text import regimes_text;"
        "found = discover(law_of('soap_film')); print(regimes_text(found, find_films(found)))"
    )
    texts = {
        subprocess.run(
            [sys.executable, "-c", code], env={**os.environ, "PYTHONHASHSEED": seed}, check=True, capture_output=True
        ).stdout
        for seed in ("1", "77")
    }
    assert len(texts) == 1
