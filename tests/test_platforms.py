"""What differs on Windows and macOS, as far as it can be tried on another system."""

from __future__ import annotations

import ast
import math
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import pytest

import softdyn
from softdyn import cache
from softdyn.cli import main
from softdyn.kernels import choose_target
from softdyn.peak_memory import peak_memory
from softdyn.targets import c as c_target

HOME = Path(softdyn.__file__).parent
SOURCES = [*HOME.rglob("*.py"), *(HOME.parent / "derive").rglob("*.py")]


@pytest.fixture
def windows(monkeypatch: pytest.MonkeyPatch) -> Iterator[pytest.MonkeyPatch]:
    monkeypatch.setattr(sys, "platform", "win32")
    c_target.compiler.cache_clear()
    monkeypatch.delenv("CC", raising=False)
    yield monkeypatch
    c_target.compiler.cache_clear()


def test_without_cc_windows_has_no_compiler_and_takes_numba(windows: pytest.MonkeyPatch) -> None:
    """Whatever is on PATH: what is usual there takes other options."""
    assert c_target.compiler() is None
    assert choose_target("auto") == "numba"


def test_cc_may_have_folders_with_spaces_on_windows(windows: pytest.MonkeyPatch) -> None:
    words = c_target.words_of_command(r'"C:\Program Files\mingw64\bin\gcc.exe" -m64')
    assert words == [r"C:\Program Files\mingw64\bin\gcc.exe", "-m64"]
    windows.setenv("CC", f'"{sys.executable}" -m ziglang cc')
    assert c_target.compiler() == (sys.executable, "-m", "ziglang", "cc")


def test_the_cache_waits_for_a_lock_of_windows_however_long(windows: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """There a call gives up after ten seconds; it is made again, and the lock is let go after a fault, too."""
    asked: list[str] = []

    def locking(descriptor: int, mode: str, count: int) -> None:
        asked.append(mode)
        if len(asked) < 3:
            raise OSError(36, "resource deadlock avoided")

    windows.setitem(sys.modules, "msvcrt", SimpleNamespace(locking=locking, LK_LOCK="lock", LK_UNLCK="unlock"))

    def fail_within() -> None:
        with cache._locked(tmp_path / "lock"):
            assert asked == ["lock"] * 3
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail_within()
    assert asked == ["lock"] * 3 + ["unlock"]


def test_the_cache_does_not_wait_for_a_lock_that_windows_cannot_give(
    windows: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """As where a share knows no locks: another attempt would be answered alike, for ever."""

    def locking(descriptor: int, mode: str, count: int) -> None:
        if mode == "lock":
            raise OSError(22, "invalid argument")

    windows.setitem(sys.modules, "msvcrt", SimpleNamespace(locking=locking, LK_LOCK="lock", LK_UNLCK="unlock"))
    with pytest.raises(OSError, match="invalid argument"), cache._locked(tmp_path / "lock"):
        pass


def test_memory_is_not_told_where_the_system_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "resource", None)
    assert math.isnan(peak_memory())
    monkeypatch.undo()
    if find_spec("resource"):
        assert peak_memory() > 1e6


def calls(path: Path) -> list[tuple[str, set[str | None], str]]:
    """Name, keywords and text of each call in a file."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return [
        (node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", ""),
         {keyword.arg for keyword in node.keywords}, ast.unparse(node))
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
    ]  # fmt: skip


def test_text_is_utf_8_and_nothing_is_forked_or_bound_to_one_system() -> None:
    """Systems have encodings of their own; only Linux forks safely; and modules of one system are asked for late."""
    for path in SOURCES:
        for name, keywords, text in calls(path):
            if name in ("read_text", "write_text"):
                assert "encoding" in keywords, f"{path}: {text}"
            assert name not in ("fork", "forkpty"), f"{path}: {text}"
            if name in ("get_context", "set_start_method"):
                assert "spawn" in text, f"{path}: {text}"
        tops = ast.parse(path.read_text(encoding="utf-8")).body
        named = {one.name for node in tops if isinstance(node, ast.Import) for one in node.names}
        assert not named & {"fcntl", "grp", "pwd", "resource", "msvcrt", "termios"}, path


TARGETS = ("x86_64-windows-gnu", "aarch64-macos", "x86_64-macos")


@pytest.mark.slow
@pytest.mark.skipif(find_spec("ziglang") is None, reason="ziglang is not installed, which compiles for other systems")
@pytest.mark.parametrize("system", TARGETS)
def test_kernels_compile_for_other_systems(system: str, tmp_path: Path) -> None:
    """By clang, with the flags of this machine's kernels; they are libraries with the kernel's functions."""
    for law, *scene in (("droplet",), ("equal_spheres", "--scene", "emulsion")):
        assert main(["generate", law, *scene, "--target", "c", "-o", str(tmp_path)]) == 0
    for source in tmp_path.glob("*.c"):
        if source.stem.endswith("_example"):
            continue
        library = source.with_suffix(".dll" if "windows" in system else ".dylib")
        command = [sys.executable, "-m", "ziglang", "cc", "-target", system, *c_target.FLAGS, "-o", str(library)]
        subprocess.run([*command, str(source), "-lm"], check=True)
        assert library.read_bytes()[:2] == (b"MZ" if "windows" in system else b"\xcf\xfa")
        function = b"droplet_integrate" if source.stem == "droplet" else b"equal_spheres_contacts"
        assert function in library.read_bytes()
