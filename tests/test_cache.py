"""The kernel cache: whole entries or none, whoever races, whatever was left behind, and keys that forget nothing."""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import stat
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from softdyn import cache, kernels
from softdyn.derive import emit, pair_kernel
from softdyn.endings import EXHAUSTED, explained
from softdyn.errors import CompileError, SceneError
from softdyn.kernels import Kernel, choose_target, get_kernel
from softdyn.targets import c as c_target

LAW = """
from softdyn.derive import ContactLaw, E, R, a, delta, eta, h
{imports}
law = ContactLaw("{name}", a=2*R, F_ela={factor}*E*a*delta, zeta=6*eta*R**2/h)
"""


@pytest.fixture
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give a test a cache of its own."""
    folder = tmp_path / "cache"
    monkeypatch.setenv(cache.VARIABLE, str(folder))
    return folder


@pytest.fixture(autouse=True, scope="module")
def derived_once() -> Iterator[None]:
    """Derive each law once, and compile as quickly: what is tried here is what is kept, in a hundred empty caches."""
    kernel_ir, emit_write = pair_kernel.kernel_ir, emit.write
    derived: dict[Any, Any] = {}
    written: dict[Any, Any] = {}

    def derive(law: Any, needs: Any) -> Any:
        key = repr((law, needs))
        if key not in derived:
            derived[key] = kernel_ir(law, needs)
        return derived[key]

    def write(ir: Any, target: str) -> Any:
        key = id(ir), target  # what is derived stays, and its id with it
        if key not in written:
            written[key] = emit_write(ir, target)
        return written[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(c_target, "FLAGS", tuple("-O0" if flag == "-O1" else flag for flag in c_target.FLAGS))
        patch.setattr(pair_kernel, "kernel_ir", derive)
        patch.setattr(emit, "write", write)
        yield


def forget() -> None:
    c_target.compiler.cache_clear()
    c_target.identity_of.cache_clear()


@pytest.fixture
def forget_compiler() -> Iterator[None]:
    """Let the compiler be looked for anew, before and after a test that changes it."""
    forget()
    yield
    forget()


def write_law(folder: Path, factor: str = "1", imports: str = "", name: str = "mine") -> Path:
    """Write a law file."""
    path = folder / "law.py"
    path.write_text(LAW.format(factor=factor, imports=imports, name=name), encoding="utf-8")
    return path


def force_at_one(kernel: Kernel) -> float:
    """Return F_ela at h = delta = R = E = 1, which is 2 times the law's factor."""
    out = np.empty(len(kernel.outputs))
    one = np.ones(1)
    kernel.functions.evaluate(1, one, one, *(one for _ in kernel.inputs), np.ones(len(kernel.parameters)), out)
    return float(out[kernel.outputs.index("F_ela")])


def build(law: Any, target: str = "c") -> Kernel:
    """Return a law's kernel with F_ela among its outputs."""
    return get_kernel(law, target, outputs=("F_ela",))


def entries(folder: Path, kind: str) -> list[Path]:
    """Return what is in one part of a cache, hidden files included, but for the lock."""
    found = sorted((folder / kind).iterdir()) if (folder / kind).is_dir() else []
    return [path for path in found if path.name != ".lock"]


# ---------------------------------------------------------------- entries


def test_what_is_published_is_read_back_whole(empty_cache: Path) -> None:
    files = {"one.txt": b"one", "two.bin": bytes(range(256))}
    path = cache.publish("things", "key", files, {"note": 1})
    assert cache.read("things", "key") == path == empty_cache / "things" / "key"
    assert {name: (path / name).read_bytes() for name in files} == files
    assert json.loads((path / "entry.json").read_text())["note"] == 1
    assert cache.read("things", "another") is None
    assert cache.read("other", "key") is None


DAMAGES: dict[str, Callable[[Path], object]] = {
    "truncated": lambda path: (path / "one.txt").write_bytes(b"o"),
    "altered": lambda path: (path / "one.txt").write_bytes(b"two"),
    "emptied": lambda path: (path / "one.txt").write_bytes(b""),
    "file missing": lambda path: (path / "one.txt").unlink(),
    "no index": lambda path: (path / "entry.json").unlink(),
    "half an index": lambda path: (path / "entry.json").write_text('{"digests": {"one'),
    "foreign index": lambda path: (path / "entry.json").write_text("[1, 2]"),
    "foreign digests": lambda path: (path / "entry.json").write_text('{"digests": [1]}'),
    "index is no text": lambda path: (path / "entry.json").write_bytes(b"\xff\xfe\x00"),
}


@pytest.mark.parametrize("damage", list(DAMAGES))
def test_a_damaged_entry_is_a_miss_and_is_replaced(damage: str, empty_cache: Path) -> None:
    path = cache.publish("things", "key", {"one.txt": b"one"})
    DAMAGES[damage](path)
    assert cache.read("things", "key") is None
    assert cache.publish("things", "key", {"one.txt": b"one"}) == path
    assert cache.read("things", "key") == path
    assert (path / "one.txt").read_bytes() == b"one"
    assert entries(empty_cache, "things") == [path], "nothing is left of the damaged entry"


def test_a_file_in_the_place_of_an_entry_is_a_miss(empty_cache: Path) -> None:
    (empty_cache / "things").mkdir(parents=True)
    (empty_cache / "things" / "key").write_text("not a folder")
    assert cache.read("things", "key") is None
    path = cache.publish("things", "key", {"one.txt": b"one"})
    assert (path / "one.txt").read_bytes() == b"one"


def test_a_process_that_died_while_writing_leaves_no_entry(empty_cache: Path) -> None:
    """It leaves a folder under another name, which is nobody's entry."""
    unfinished = empty_cache / "things" / ".abandoned"
    unfinished.mkdir(parents=True)
    (unfinished / "one.txt").write_text("on")
    assert cache.read("things", "key") is None
    cache.publish("things", "key", {"one.txt": b"one"})
    assert cache.read("things", "key") is not None


def test_the_faster_of_two_is_kept(empty_cache: Path) -> None:
    first = cache.publish("things", "key", {"one.txt": b"first"})
    second = cache.publish("things", "key", {"one.txt": b"second"})
    assert first == second
    assert (first / "one.txt").read_bytes() == b"first"


def test_an_entry_that_is_out_of_date_is_replaced(empty_cache: Path) -> None:
    cache.publish("things", "key", {"one.txt": b"one"})
    path = cache.publish("things", "key", {"two.txt": b"two"}, replace=True)
    assert cache.read("things", "key") == path
    assert sorted(file.name for file in path.iterdir()) == ["entry.json", "two.txt"]


@pytest.mark.slow
@given(st.lists(st.one_of(st.text(), st.integers(), st.lists(st.text())), min_size=1, max_size=3), st.integers(0, 2))
def test_a_key_changes_with_every_part(parts: list[Any], which: int) -> None:
    changed = list(parts)
    changed[which % len(parts)] = [changed[which % len(parts)]]
    assert cache.key_of(*parts) != cache.key_of(*changed)
    assert cache.key_of(*parts) == cache.key_of(*parts)
    assert cache.key_of(*parts, "") != cache.key_of(*parts)


def test_a_key_does_not_depend_on_the_order_of_a_mapping() -> None:
    assert cache.key_of({"a": 1, "b": 2}) == cache.key_of({"b": 2, "a": 1})


# ---------------------------------------------------------------- the folder


def test_the_folder_is_the_users_alone(empty_cache: Path) -> None:
    mask = os.umask(0)
    try:
        cache.publish("things", "key", {"one.txt": b"one"})
    finally:
        os.umask(mask)
    for folder in (empty_cache, empty_cache / "things", empty_cache / "things" / "key"):
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700, folder


def test_a_folder_of_somebody_else_is_refused(empty_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Loading code that another user put there would run it."""
    empty_cache.mkdir()
    monkeypatch.setattr(os, "getuid", lambda: empty_cache.stat().st_uid + 1)
    with pytest.raises(SceneError, match="belongs to another user; set SOFTDYN_CACHE_DIR"):
        cache.folder()


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path / "file" / "cache"))
    with pytest.raises(SceneError, match=r"cannot make the kernel cache .*file/cache.*set SOFTDYN_CACHE_DIR"):
        cache.folder()


def test_without_the_variable_the_folder_is_that_of_the_platform(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(cache.VARIABLE)
    monkeypatch.setattr("platformdirs.user_cache_path", lambda *_, **__: tmp_path / "of the platform")
    assert cache.folder() == tmp_path / "of the platform"


# ---------------------------------------------------------------- what others could have written


def level(folder: Path, name: str) -> Path:
    """Path of a level of the only entry of a kind."""
    return {"cache": folder, "kind": folder / "things", "entry": folder / "things" / "key"}[name]


@pytest.mark.parametrize("mode", [0o720, 0o702, 0o775, 0o777, 0o1777])
@pytest.mark.parametrize("where", ["cache", "kind", "entry"])
def test_what_others_can_write_is_refused_at_each_level(where: str, mode: int, empty_cache: Path) -> None:
    cache.publish("things", "key", {"one.txt": b"one"})
    path = level(empty_cache, where)
    path.chmod(mode)
    with pytest.raises(SceneError, match=rf"{path} can be written by others \(mode {mode:04o}\)") as refused:
        cache.read("things", "key")
    assert "chmod go-w" in str(refused.value)
    assert cache.VARIABLE in str(refused.value)
    if where != "entry":
        with pytest.raises(SceneError, match="can be written by others"):
            cache.publish("things", "another", {"one.txt": b"two"})


@pytest.mark.parametrize("where", ["kind", "entry"])
def test_what_belongs_to_another_user_is_refused_at_each_level(
    where: str, empty_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the cache itself: see above."""
    cache.publish("things", "key", {"one.txt": b"one"})
    foreign, lstat = level(empty_cache, where), Path.lstat

    def of_another(path: Path) -> os.stat_result:
        info = list(lstat(path))
        info[stat.ST_UID] += 1 if path == foreign else 0
        return os.stat_result(info)

    monkeypatch.setattr(Path, "lstat", of_another)
    with pytest.raises(SceneError, match=f"{foreign} belongs to another user"):
        cache.read("things", "key")


@pytest.mark.parametrize("where", ["kind", "entry"])
def test_a_level_that_is_a_link_is_refused(where: str, empty_cache: Path, tmp_path: Path) -> None:
    cache.publish("things", "key", {"one.txt": b"one"})
    path = level(empty_cache, where)
    path.rename(tmp_path / "elsewhere")
    path.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(SceneError, match=f"{path} is a link to {tmp_path}/elsewhere"):
        cache.read("things", "key")


@pytest.mark.parametrize("name", ["one.txt", "entry.json"])
def test_a_file_that_others_can_write_or_that_is_a_link_is_refused(
    name: str, empty_cache: Path, tmp_path: Path
) -> None:
    file = cache.publish("things", "key", {"one.txt": b"one"}) / name
    file.chmod(0o666)
    with pytest.raises(SceneError, match=rf"{name} can be written by others \(mode 0666\)"):
        cache.read("things", "key")
    file.chmod(0o600)
    file.rename(tmp_path / name)
    file.symlink_to(tmp_path / name)
    with pytest.raises(SceneError, match=f"{name} is a link"):
        cache.read("things", "key")


def test_a_link_to_a_cache_of_ones_own_is_followed(empty_cache: Path, tmp_path: Path) -> None:
    (tmp_path / "large disk").mkdir(mode=0o700)
    empty_cache.symlink_to(tmp_path / "large disk")
    cache.publish("things", "key", {"one.txt": b"one"})
    assert cache.read("things", "key") is not None
    (tmp_path / "large disk").chmod(0o777)
    with pytest.raises(SceneError, match="large disk can be written by others"):
        cache.read("things", "key")


@pytest.mark.parametrize("way", ["plain", "by a link"])
def test_a_folder_above_in_which_others_can_rename_is_refused(
    way: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They could put a folder of theirs in the place of the cache; a sticky bit keeps them from that."""
    above = tmp_path / "above"
    (above / "between").mkdir(parents=True)
    if way == "by a link":
        (tmp_path / "link").symlink_to(above / "between")
    monkeypatch.setenv(cache.VARIABLE, str((tmp_path / "link" if way == "by a link" else above / "between") / "cache"))
    cache.publish("things", "key", {"one.txt": b"one"})
    above.chmod(0o777)
    with pytest.raises(SceneError, match=rf"lies below {above}, where others can replace it \(mode 0777\)"):
        cache.folder()
    above.chmod(0o1777)
    assert cache.read("things", "key") is not None


def test_folders_above_that_are_missing_are_made_for_the_user_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path / "a" / "b" / "cache"))
    mask = os.umask(0)
    try:
        cache.folder()
    finally:
        os.umask(mask)
    assert stat.S_IMODE((tmp_path / "a").stat().st_mode) == 0o700


@pytest.mark.slow
@pytest.mark.parametrize("part", ["manifests", "c"])
def test_a_kernel_that_others_could_have_planted_is_not_run(part: str, empty_cache: Path, tmp_path: Path) -> None:
    """Manifests hold source that is compiled, so they are as dangerous as libraries."""
    law = write_law(tmp_path)
    build(law)
    (entry,) = entries(empty_cache, part)
    entry.chmod(0o757)
    with pytest.raises(SceneError, match=f"{entry} can be written by others"):
        build(law)


# ---------------------------------------------------------------- kernels

RACER = """
import sys, time
import numpy as np
from softdyn.kernels import get_kernel
while time.time() < float(sys.argv[3]):
    pass
kernel = get_kernel(sys.argv[1], sys.argv[2], outputs=("F_ela",))
out, one = np.empty(1), np.ones(1)
kernel.functions.evaluate(1, one, one, np.ones(3), out)
print(kernel.key, out[0])
"""


def race(law: str, target: str, racers: int) -> list[tuple[str, str]]:
    """Build one kernel in several processes at once; return key and value of each."""
    start = str(time.time() + 1.0)
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", RACER, law, target, start], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        for _ in range(racers)
    ]
    results = [process.communicate(timeout=200) for process in processes]
    assert [process.returncode for process in processes] == [0] * racers, [err for _, err in results]
    assert all(err == "" for _, err in results)
    return [tuple(out.split()) for out, _ in results]  # type: ignore[misc]


@pytest.fixture(scope="module")
def numba_cache(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path, list[tuple[str, str]]]:
    """A law, a cache with its numba kernel, and what that gives: numba compiles for long."""
    folder = tmp_path_factory.mktemp("numba")
    law = str(write_law(folder, factor="3"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(cache.VARIABLE, str(folder / "cache"))
        return law, folder / "cache", race(law, "numba", 1)


@pytest.mark.slow
def test_racing_processes_leave_one_whole_entry(empty_cache: Path, tmp_path: Path) -> None:
    law = str(write_law(tmp_path, factor="3"))
    results = race(law, "c", 3)
    assert len(set(results)) == 1
    key, value = results[0]
    assert float(value) == 6.0
    assert [path.name for path in entries(empty_cache, "c")] == [key]
    assert cache.read("c", key) is not None
    assert len(entries(empty_cache, "manifests")) == 1


@pytest.mark.slow
def test_racing_processes_share_a_numba_kernel(empty_cache: Path, tmp_path: Path) -> None:
    law = str(write_law(tmp_path, factor="3"))
    results = race(law, "numba", 4)
    assert len(set(results)) == 1
    assert float(results[0][1]) == 6.0
    assert [path.name for path in entries(empty_cache, "numba")] == [results[0][0]]
    # what the racers left in numba's own cache serves those who come later
    assert race(law, "numba", 1) == results[:1]


INTERRUPTED = """
import sys
import numpy as np
from softdyn import kernels
from softdyn.targets import numba as target
def interrupted(functions):
    solve_delta = next(function for function in functions if function.__name__.endswith("solve_delta"))
    none = np.empty(0)
    solve_delta(0, none, none, np.ones(3), none)
    sys.exit(0)
target._compile = interrupted
kernels.get_kernel(sys.argv[1], "numba", outputs=("F_ela",))
"""


@pytest.mark.slow
def test_a_numba_kernel_half_compiled_is_completed_and_kept(empty_cache: Path, tmp_path: Path) -> None:
    """A process that ends while numba compiles leaves some functions in its cache: the rest builds on them."""
    law = str(write_law(tmp_path, factor="3"))
    subprocess.run([sys.executable, "-c", INTERRUPTED, law], check=True)
    first = race(law, "numba", 1)
    assert float(first[0][1]) == 6.0
    assert race(law, "numba", 1) == first


@pytest.mark.slow
def test_racing_with_a_damaged_entry_in_the_way(empty_cache: Path, tmp_path: Path) -> None:
    law = str(write_law(tmp_path, factor="3"))
    kernel = build(law)
    (kernel.path.parent / "mine.so").write_bytes(b"not a library")
    results = race(law, "c", 3)
    assert {float(value) for _, value in results} == {6.0}
    assert [path.name for path in entries(empty_cache, "c")] == [kernel.key]
    assert cache.read("c", kernel.key) is not None


REPAIRER = """
import sys, time
from softdyn import cache
for i in range(int(sys.argv[1])):
    while time.time() < float(sys.argv[2]) + 0.01 * i:
        pass
    path = cache.read("things", f"key{i}") or cache.publish("things", f"key{i}", {"one": b"x" * 1000})
    assert (path / "one").read_bytes() == b"x" * 1000, "gone again"
"""


@pytest.mark.slow
def test_many_may_repair_a_damaged_entry_at_once(empty_cache: Path) -> None:
    """A hundred times over, so that the moments in which they meet are all met."""
    count = 100
    for i in range(count):
        path = cache.publish("things", f"key{i}", {"one": b"x" * 1000})
        (path / "one").write_bytes(b"damaged")
    arguments = [sys.executable, "-c", REPAIRER, str(count), str(time.time() + 1.0)]
    processes = [subprocess.Popen(arguments, stderr=subprocess.PIPE, text=True) for _ in range(4)]
    errors = [process.communicate(timeout=100)[1] for process in processes]
    assert errors == [""] * 4
    assert all(cache.read("things", f"key{i}") is not None for i in range(count))


@pytest.mark.parametrize("part", ["manifests", "c"])
@pytest.mark.parametrize("damage", ["truncated", "emptied", "removed", "index removed"])
def test_a_damaged_kernel_is_built_anew(damage: str, part: str, empty_cache: Path, tmp_path: Path) -> None:
    law = write_law(tmp_path, factor="5")
    first = build(law)
    # a library in use must not be truncated in place: give the damage to a copy, as a crashed disk would leave it
    (entry,) = entries(empty_cache, part)
    victim = entry / ("manifest.json" if part == "manifests" else "mine.so")
    content = victim.read_bytes()
    victim.unlink()
    if damage == "truncated":
        victim.write_bytes(content[: len(content) // 2])
    elif damage == "emptied":
        victim.write_bytes(b"")
    elif damage == "index removed":
        victim.write_bytes(content)
        (entry / "entry.json").unlink()
    again = build(law)
    assert again.key == first.key
    assert force_at_one(again) == 10.0
    assert cache.read("c", again.key) is not None


def test_a_cached_kernel_is_neither_derived_nor_compiled_again(
    empty_cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    law = write_law(tmp_path)
    first = build(law)
    monkeypatch.setattr(kernels, "make_manifest", lambda *_: pytest.fail("derived again"))
    monkeypatch.setattr(c_target, "build", lambda *_: pytest.fail("compiled again"))
    assert build(law).key == first.key


@pytest.mark.slow
def test_a_process_loads_a_kernel_once_while_it_stands_as_it_did(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is parsed or loaded again; but where others could come to write, it is refused all the same."""
    build("rognon_gay")
    first = build("rognon_gay")
    with monkeypatch.context() as patch:
        patch.setattr(cache, "_read_note", lambda *_: pytest.fail("parsed again"))
        patch.setattr(kernels.json, "loads", lambda *_: pytest.fail("parsed again"))
        patch.setattr(c_target, "library_of", lambda *_: pytest.fail("loaded again"))
        assert build("rognon_gay").functions is first.functions
    first.path.parent.chmod(0o777)
    with pytest.raises(SceneError, match="can be written by others"):
        build("rognon_gay")


def test_too_little_memory_to_load_a_library_is_told_and_costs_no_entry(
    empty_cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a loader says of it, under a limit of the address space, is no fault of the library's."""
    law = write_law(tmp_path)
    first = build(law)

    def full(path: str) -> None:
        raise OSError(f"{path}: failed to map segment from shared object")

    with monkeypatch.context() as patch:
        patch.setattr(ctypes, "CDLL", full)
        patch.setattr(kernels, "_functions", {})
        with pytest.raises(MemoryError, match="a kernel cannot be loaded"):
            build(law)
    assert explained(MemoryError("a kernel cannot be loaded"))[0] == EXHAUSTED
    missing = ImportError("numpy is broken: libm.so.6: failed to map segment from shared object")
    assert explained(missing)[0] == EXHAUSTED
    assert cache.read("c", first.key) is not None
    assert build(law).key == first.key


@pytest.mark.slow
def test_a_cached_kernel_needs_no_sympy(empty_cache: Path, tmp_path: Path) -> None:
    law = write_law(tmp_path)
    build(law)
    code = """
    import sys
    from softdyn.kernels import get_kernel
    get_kernel(sys.argv[1], "c", outputs=("F_ela",))
    print([name for name in ("sympy", "jinja2", "mpmath", "matplotlib", "numba", "scipy") if name in sys.modules])
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code), str(law)], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


def spoiled(library: bytes, how: str) -> bytes:
    """Library that does not load: of other bytes, cut short so that mapping it ends a process, or empty."""
    return {"wrong bytes": b"not a library", "cut short": library[: len(library) // 3], "empty": b""}[how]


#: What is there, and whether it is noted that it loads; what was seen to load was not cut short then.
SPOILED = [
    ("wrong bytes", False), ("cut short", False), ("without its functions", False),
    ("wrong bytes", True), ("without its functions", True),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("how", "noted"), SPOILED)
def test_a_library_that_does_not_load_is_made_anew(
    how: str, noted: bool, empty_cache: Path, tmp_path: Path, forget_compiler: None
) -> None:
    """Whole by its digests, and yet of no use: as a compiler may have left it, or another softdyn."""
    law = write_law(tmp_path, factor="5")
    first = build(law)
    source, library = (first.path.with_suffix(ending).read_bytes() for ending in (".c", ".so"))
    if how == "without its functions":
        made = c_target.build("mine", "int nothing;", c_target.identity())
        library = made["mine.so"]
    else:
        library = spoiled(library, how)
    # another inode at another place, since this process holds the library of that path
    cache.evict("c", first.key)
    note = {"loads": True} if noted else {}
    cache.publish("c", first.key, {"mine.c": source, "mine.so": library}, note)
    code = (
        "import sys; from softdyn.kernels import get_kernel;"
        "k = get_kernel(sys.argv[1], 'c', outputs=('F_ela',)); print(k.key)"
    )
    for _ in range(2):
        done = subprocess.run([sys.executable, "-c", code, str(law)], capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout.strip(), done.stderr) == (0, first.key, "")
    assert (empty_cache / "c" / first.key / "mine.so").read_bytes() != library


@pytest.mark.parametrize("how", ["wrong bytes", "cut short", "empty"])
def test_a_compiler_whose_library_does_not_load_is_reported_and_nothing_is_kept(
    how: str, empty_cache: Path, tmp_path: Path, other_compiler: Callable[[str], None]
) -> None:
    spoil = {
        "wrong bytes": 'echo "not a library" > "$out"',
        "cut short": 'truncate -s $(( $(stat -c %s "$out") / 3 )) "$out"',
        "empty": ': > "$out"',
    }[how]
    find = 'for x in "$@"; do [ "$last" = -o ] && out=$x; last=$x; done'
    other_compiler(f'for x in "$@"; do [ "$x" = -E ] && exec REAL "$@"; done\nREAL "$@"; {find}; {spoil}')
    with pytest.raises(CompileError, match=r"(?s)made a library that does not load:.*mine.c -lm\n."):
        build(write_law(tmp_path))
    assert entries(empty_cache, "c") == []


@pytest.mark.slow
@pytest.mark.parametrize(("ending", "how"), [(".nbi", "cut short"), (".nbc", "cut short"), (".nbi", "wrong bytes")])
def test_what_numba_kept_is_made_anew_where_it_does_not_load(
    ending: str, how: str, empty_cache: Path, numba_cache: tuple[str, Path, list[tuple[str, str]]]
) -> None:
    law, kept, results = numba_cache
    shutil.copytree(kept, empty_cache)
    (entry,) = entries(empty_cache, "numba")
    victims = [path for path in entry.rglob(f"*{ending}") if path.suffix == ending]
    assert victims
    for path in victims:
        path.write_bytes(spoiled(path.read_bytes(), how))
    assert race(law, "numba", 1) == results


@pytest.mark.slow
def test_what_numba_keeps_where_others_can_write_is_not_run(
    empty_cache: Path, numba_cache: tuple[str, Path, list[tuple[str, str]]]
) -> None:
    law, kept, _ = numba_cache
    shutil.copytree(kept, empty_cache)
    (entry,) = entries(empty_cache, "numba")
    (entry / "__pycache__").chmod(0o777)
    with pytest.raises(SceneError, match="__pycache__ can be written by others"):
        build(law, "numba")


# ---------------------------------------------------------------- laws that change


@pytest.fixture(params=[False, True], ids=["bytecode", "no bytecode"])
def bytecode(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whether Python keeps bytecode beside what it imports, as it does unless its environment forbids that."""
    monkeypatch.setattr(sys, "dont_write_bytecode", request.param)


def test_an_edited_law_is_derived_anew(empty_cache: Path, tmp_path: Path, bytecode: None) -> None:
    assert force_at_one(build(write_law(tmp_path, factor="1"))) == 2.0
    assert force_at_one(build(write_law(tmp_path, factor="7"))) == 14.0
    assert force_at_one(build(write_law(tmp_path, factor="1"))) == 2.0
    assert not list(tmp_path.glob("**/__pycache__"))


@pytest.mark.slow
def test_an_edited_module_that_a_law_imports_is_noticed(empty_cache: Path, tmp_path: Path, bytecode: None) -> None:
    law = write_law(tmp_path, factor="helper.FACTOR", imports="import helper")
    helper = tmp_path / "helper.py"
    for factor in (2, 3):
        # same length, same second: only the content tells
        helper.write_text(f"FACTOR = {factor}\n")
        os.utime(helper, (1e9, 1e9))
        assert force_at_one(build(law)) == 2.0 * factor
    assert "helper" not in sys.modules


def test_an_edited_module_that_an_imported_module_imports_is_noticed(empty_cache: Path, tmp_path: Path) -> None:
    law = write_law(tmp_path, factor="helper.FACTOR", imports="import helper")
    (tmp_path / "helper.py").write_text("from deep.numbers import FACTOR\n")
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "__init__.py").write_text("")
    for factor in (2, 30):
        (tmp_path / "deep" / "numbers.py").write_text(f"FACTOR = {factor}\n")
        assert force_at_one(build(law)) == 2.0 * factor


def test_two_laws_of_one_name_do_not_meet(empty_cache: Path, tmp_path: Path) -> None:
    values = []
    for factor in ("2", "3"):
        folder = tmp_path / factor
        folder.mkdir()
        values.append(build(write_law(folder, factor=factor)))
    assert [force_at_one(kernel) for kernel in values] == [4.0, 6.0]
    assert values[0].key != values[1].key


# ---------------------------------------------------------------- keys


@pytest.mark.slow
def test_each_need_has_its_kernel(empty_cache: Path) -> None:
    keys = {
        get_kernel("rognon_gay", "c", **needs).key  # type: ignore[arg-type]
        for needs in (
            {},
            {"deflection": "compression"},
            {"drive": "table"},
            {"outputs": ("X", "a")},
            {"fixed": {"R": "1"}},
            {"fixed": {"R": "2"}},
        )
    }
    assert len(keys) == 6


@pytest.fixture
def other_compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, forget_compiler: None) -> Callable[[str], None]:
    """Set $CC to a script that does something before, or in the place of, the real compiler."""
    real = c_target.compiler()
    assert real is not None

    def use(text: str) -> None:
        path = tmp_path / "cc-script"
        path.write_text(f"#!/bin/sh\n{text.replace('REAL', ' '.join(real))}\n")
        path.chmod(0o755)
        monkeypatch.setenv("CC", str(path))
        forget()

    return use


@pytest.mark.slow
def test_another_compiler_makes_another_kernel(
    empty_cache: Path, tmp_path: Path, other_compiler: Callable[[str], None]
) -> None:
    """The compiler's version is in what its preprocessor predefines."""
    law = write_law(tmp_path)
    plain = build(law)
    other_compiler('exec REAL "$@"')
    same_by_script = build(law)
    other_compiler('exec REAL -D__VERSION_OF_TOMORROW__=1 "$@"')
    newer = build(law)
    assert len({plain.key, same_by_script.key, newer.key}) == 3
    assert {force_at_one(kernel) for kernel in (plain, same_by_script, newer)} == {2.0}


def test_other_flags_make_another_kernel(empty_cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    law = write_law(tmp_path)
    plain = build(law)
    monkeypatch.setattr(c_target, "FLAGS", (*c_target.FLAGS, "-g"))
    assert build(law).key != plain.key


def test_the_flags_keep_ieee_arithmetic() -> None:
    made_by = c_target.identity()
    assert "-ffp-contract=off" in made_by["flags"]
    assert not {"-ffast-math", "-Ofast", "-funsafe-math-optimizations"} & set(made_by["flags"])
    assert "__FAST_MATH__" not in made_by["macros"]


@pytest.mark.parametrize(
    ("flag", "how"),
    [
        ("-ffast-math", "flag"), ("-Ofast", "flag"), ("-ffinite-math-only", "flag"), ("-fassociative-math", "flag"),
        ("-ffast-math", "script"), ("-ffinite-math-only", "script"), ("-funsafe-math-optimizations", "script"),
    ],
)  # fmt: skip
def test_a_compiler_told_to_break_ieee_arithmetic_is_refused(
    flag: str,
    how: str,
    empty_cache: Path,
    tmp_path: Path,
    other_compiler: Callable[[str], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """By its own macros, where the flag is hidden in a script."""
    other_compiler(f'exec REAL {flag if how == "script" else ""} "$@"')
    if how == "flag":
        monkeypatch.setenv("CC", f"{os.environ['CC']} {flag}")
        forget()
    with pytest.raises(CompileError, match="rely on IEEE arithmetic, and the C compiler is told otherwise"):
        build(write_law(tmp_path))
    assert entries(empty_cache, "c") == []


@pytest.mark.parametrize(
    "changed", ["derive/law.py", "derive/laws/cone.py", "templates/c/pair.c.j2", "kernels.py", "targets/c.py"]
)
def test_two_checkouts_that_share_a_cache_have_digests_of_their_own(
    changed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever differs between them, and where the rooms are no folders beside the package, as without links."""
    from softdyn import laws

    digests = []
    for checkout in ("one", "other"):
        for package in ("derive", "templates"):
            shutil.copytree(laws.package_folder(package), tmp_path / checkout / package)
        shutil.copytree(Path(kernels.__file__).parent, tmp_path / checkout, symlinks=True, dirs_exist_ok=True,
                        ignore=lambda *_: ["derive", "templates", "__pycache__"])  # fmt: skip
        if checkout == "other":
            with (tmp_path / checkout / changed).open("a", encoding="utf-8") as file:
                file.write("\n")
        with monkeypatch.context() as patch:
            patch.setattr(kernels, "package_folder", (tmp_path / checkout).joinpath)
            patch.setattr(kernels, "__file__", str(tmp_path / checkout / "kernels.py"))
            digests.append(kernels.tool_digest.__wrapped__())
    assert digests[0] != digests[1]


# ---------------------------------------------------------------- compilers that fail


def test_a_compile_error_carries_the_command_and_the_compilers_words(
    empty_cache: Path, tmp_path: Path, other_compiler: Callable[[str], None], users_compiler: None
) -> None:
    other_compiler(
        'for x in "$@"; do [ "$x" = -E ] && exec REAL "$@"; done\necho "kernel.c:7: error: flux capacitor" >&2; exit 3'
    )
    with pytest.raises(CompileError) as failed:
        build(write_law(tmp_path))
    text = str(failed.value)
    assert "kernel.c:7: error: flux capacitor" in text
    assert f"{tmp_path}/cc-script -std=c99 -O3" in text
    assert "mine.c -lm" in text
    assert entries(empty_cache, "c") == []


def test_a_silent_failure_is_told_by_its_exit_status(
    empty_cache: Path, tmp_path: Path, other_compiler: Callable[[str], None]
) -> None:
    other_compiler('for x in "$@"; do [ "$x" = -E ] && exec REAL "$@"; done\nexit 41')
    with pytest.raises(CompileError, match="it printed nothing, and exited with 41"):
        build(write_law(tmp_path))


def test_a_compiler_that_makes_nothing_has_failed(
    empty_cache: Path, tmp_path: Path, other_compiler: Callable[[str], None]
) -> None:
    """Success without a library is none."""
    other_compiler('for x in "$@"; do [ "$x" = -E ] && exec REAL "$@"; done\nexit 0')
    with pytest.raises(CompileError, match="the C compiler failed"):
        build(write_law(tmp_path))


def test_a_compiler_that_does_not_work_at_all_is_named(
    empty_cache: Path, tmp_path: Path, other_compiler: Callable[[str], None]
) -> None:
    other_compiler('echo "license expired" >&2; exit 1')
    with pytest.raises(CompileError, match=r"(?s)does not work:.*cc-script.*license expired"):
        build(write_law(tmp_path))


def test_a_compiler_that_hangs_is_given_up(
    empty_cache: Path, tmp_path: Path, other_compiler: Callable[[str], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(c_target, "TIMEOUT", 0.5)
    other_compiler("exec sleep 30")
    with pytest.raises(CompileError, match=r"(?s)could not run the C compiler:.*timed out"):
        build(write_law(tmp_path))


def test_a_compiler_without_march_native_is_used_without(
    empty_cache: Path, tmp_path: Path, other_compiler: Callable[[str], None]
) -> None:
    other_compiler('for x in "$@"; do [ "$x" = -march=native ] && exit 1; done\nexec REAL "$@"')
    assert "-march=native" not in c_target.identity()["flags"]
    assert force_at_one(build(write_law(tmp_path))) == 2.0


@pytest.fixture
def no_compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, forget_compiler: None) -> None:
    """Leave no compiler on PATH."""
    monkeypatch.delenv("CC", raising=False)
    (tmp_path / "nothing").mkdir()
    monkeypatch.setenv("PATH", str(tmp_path / "nothing"))
    c_target.compiler.cache_clear()


@pytest.mark.usefixtures("no_compiler")
def test_without_a_compiler_target_c_is_refused(empty_cache: Path, tmp_path: Path) -> None:
    with pytest.raises(CompileError) as refused:
        build(write_law(tmp_path))
    assert str(refused.value) == (
        "target 'c' needs a C compiler: none of cc, gcc, clang is on PATH, and CC is not set; "
        "install one, or use target 'numba'"
    )


@pytest.mark.usefixtures("no_compiler")
def test_without_a_compiler_auto_is_numba_and_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    assert choose_target("auto") == "numba"
    said = capsys.readouterr()
    assert said.err == "softdyn: no C compiler found ($CC, cc, gcc, clang); using numba\n"
    assert said.out == ""


def test_with_a_compiler_auto_is_c_and_says_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    assert choose_target("auto") == "c"
    assert capsys.readouterr() == ("", "")


def test_a_failing_compiler_is_an_error_under_auto_too(
    empty_cache: Path, tmp_path: Path, other_compiler: Callable[[str], None], capsys: pytest.CaptureFixture[str]
) -> None:
    """The target never changes after a failure, in silence or otherwise."""
    other_compiler("exit 1")
    with pytest.raises(CompileError):
        build(write_law(tmp_path), "auto")
    assert "numba" not in capsys.readouterr().err


def test_an_unknown_target_is_refused() -> None:
    with pytest.raises(SceneError, match="unknown target 'fortran'; there are auto, c, numba"):
        choose_target("fortran")


@pytest.mark.usefixtures("forget_compiler")
def test_a_compiler_that_CC_names_wrongly_is_reported(
    empty_cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", "no-such-compiler --flag")
    forget()
    with pytest.raises(CompileError, match="CC is no-such-compiler --flag"):
        build(write_law(tmp_path))


# ---------------------------------------------------------------- what is loaded


def test_the_library_is_what_was_compiled(empty_cache: Path, tmp_path: Path) -> None:
    """The entry holds source and library; the C API of its head works from ctypes alone."""
    kernel = build(write_law(tmp_path, factor="4"))
    assert sorted(path.name for path in kernel.path.parent.iterdir()) == ["entry.json", "mine.c", "mine.so"]
    assert kernel.path.name == "mine.c"
    library = ctypes.CDLL(str(kernel.path.with_suffix(".so")))
    one, p, out = np.ones(1), np.ones(3), np.empty(1)
    library.mine_evaluate(ctypes.c_int64(1), *(ctypes.c_void_p(x.ctypes.data) for x in (one, one, p, out)))
    # 4 E a delta, with a = 2 R
    assert out[0] == 8.0


@pytest.mark.slow
def test_numba_kernels_keep_their_flags_in_their_text(empty_cache: Path, tmp_path: Path) -> None:
    """Numba's own cache would not notice other flags; the text is the key."""
    kernel = build(write_law(tmp_path), "numba")
    text = kernel.path.read_text(encoding="utf-8")
    assert 'numba.njit(cache=True, error_model="numpy", fastmath=False, nogil=True)' in text
    assert any(path.suffix == ".nbi" for path in kernel.path.parent.rglob("*"))
    assert force_at_one(kernel) == 2.0
