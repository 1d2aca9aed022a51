"""A shell that asks is told what may come next: commands, laws, scenes, keys, files."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from softdyn.cli import main

pytest.importorskip("argcomplete")


def offered(line: str, folder: Path) -> set[str]:
    """What a shell is told at the end of a line; asked as a shell asks, of a process of its own."""
    told = folder / "told"
    asked = {
        "_ARGCOMPLETE": "1", "COMP_LINE": line, "COMP_POINT": str(len(line)), "COMP_TYPE": "9",
        "_ARGCOMPLETE_IFS": "\n", "_ARGCOMPLETE_SUPPRESS_SPACE": "1", "_ARGCOMPLETE_STDOUT_FILENAME": str(told),
    }  # fmt: skip
    command = [sys.executable, "-m", "softdyn"]
    subprocess.run(command, cwd=folder, env={**os.environ, **asked}, check=True, capture_output=True)
    return {word.strip() for word in told.read_text().split("\n") if word.strip()}


@pytest.mark.slow
def test_commands_laws_scenes_keys_and_files_are_offered(tmp_path: Path) -> None:
    (tmp_path / "drop_of_mine.py").touch()
    (tmp_path / "mine.toml").touch()
    (tmp_path / "notes.txt").touch()
    assert "fit" in offered("softdyn fi", tmp_path)
    assert {"droplet", "drop_of_mine.py"} <= offered("softdyn check dro", tmp_path)
    assert "ergun" in offered("softdyn check er", tmp_path)
    scenes = offered("softdyn run ", tmp_path)
    assert {"emulsion", "mine.toml"} <= scenes
    assert "notes.txt" not in scenes
    assert "range" in offered("softdyn keys ran", tmp_path)
    assert "--free" in offered("softdyn fit dlvo data.csv --fr", tmp_path)


def test_nothing_is_answered_to_whoever_does_not_ask(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("_ARGCOMPLETE", raising=False)
    assert main(["laws"]) == 0
    assert "dlvo" in capsys.readouterr().out
