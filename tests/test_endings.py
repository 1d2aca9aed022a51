"""How commands end: whatever file they are given, with one message and a status of its own, never with a traceback."""

from __future__ import annotations

import io
import json
import os
import pickle
import signal
import stat
import struct
import subprocess
import sys
import threading
import time
import warnings
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softdyn
from softdyn import archive, endings, signals
from softdyn.cli import main
from softdyn.errors import SceneError
from softdyn.results.whole_files import written_whole
from softdyn.terminal import plain

SCENE = """
law = "rognon_gay"
parameters = {R = 1.0, E = 1.0, eta = 1.0}
pair = {h = 1.0}
drive = {force = 0.01}
until = {h = 0.1}
output = {gaps = 5}
"""
MANY = """
law = "rognon_gay"
parameters = {E = 1.0, eta = 1.0}
until = {t = 1.0}
[particles]
positions = [[0.0], [1.99]]
radii = [1.0, 1.0]
[flow]
drag = 1.0
"""


def npy(header: bytes, content: bytes = b"", version: int = 1) -> bytes:
    """File of one array, with any header."""
    length = struct.pack("<H" if version == 1 else "<I", len(header))
    return b"\x93NUMPY" + bytes([version, 0]) + length + header + content


def header(descr: str, shape: str, more: str = "") -> bytes:
    return f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}{more}}}".encode()


def zipped(content: bytes, method: int = zipfile.ZIP_STORED, name: str = "about.npy") -> bytes:
    """Archive of one file."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", method) as made:
        made.writestr(name, content)
    return file.getvalue()


def changed(whole: bytes, local: int, central: int, value: bytes) -> bytes:
    """Archive of one file with bytes of both of its headers changed."""
    start = whole.index(b"PK\x01\x02") + central
    whole = whole[:start] + value + whole[start + len(value) :]
    return whole[:local] + value + whole[local + len(value) :]


def bomb() -> bytes:
    """Array of many zeros, which takes a thousandth of that, and says that it is 8 GB."""
    made = zipped(npy(header("'<f8'", "(30000000,)"), bytes(2**24)), zipfile.ZIP_DEFLATED)
    return changed(made, 22, 24, struct.pack("<I", 2**32 - 2))


def whole_result(**changes: object) -> bytes:
    """Result of a run of two particles, with some of its arrays replaced."""
    about = {
        "law": "rognon_gay", "target": "c", "parameters": {"R": 1.0}, "stopped_by": "h", "stats": {}, "warnings": [],
        "events": [],
    }  # fmt: skip
    file = io.BytesIO()
    content = {"about": np.array(json.dumps(about)), **{name: np.ones(3) for name in ("t", "h", "delta")}, **changes}
    np.savez(file, allow_pickle=True, **content)  # type: ignore[arg-type]
    return file.getvalue()


#: What a file may hold that none of the commands can use, whatever it is called.
CONTENT: dict[str, bytes] = {
    "empty": b"",
    "noise": np.random.default_rng(0).bytes(5000),
    "text": b"what is this?\n",
    "nul": bytes(100),
    "deep json": b"[" * 100_000,
    "deep objects": b'{"a":' * 50_000,
    "utf-16": "law".encode("utf-16"),
    "an old zip": b"PK\x05\x06" + bytes(18),
    "no array": zipped(b"hello", name="readme.txt"),
    "not an array": zipped(b"hello"),
    "bomb": bomb(),
    "encrypted": changed(zipped(npy(header("'<f8'", "(1,)"), bytes(8))), 6, 8, b"\x01\x00"),
    "lzma": zipped(npy(header("'<f8'", "(1,)"), bytes(8)), zipfile.ZIP_LZMA),
    "unknown compression": changed(zipped(npy(header("'<f8'", "(1,)"), bytes(8))), 8, 10, struct.pack("<H", 77)),
    "damaged deflate": (lambda z: z[:60] + b"\xff\xff\xff" + z[63:])(
        zipped(npy(header("'<f8'", "(1000,)"), np.arange(1000.0).tobytes()), zipfile.ZIP_DEFLATED)
    ),
    "wrong checksum": zipped(npy(header("'<f8'", "(1,)"), b"12345678")).replace(b"12345678", b"12345679", 1),
    "header of 2 GB": zipped(b"\x93NUMPY\x02\x00" + struct.pack("<I", 2**31 - 1) + b"{'descr'"),
    "exabytes": zipped(npy(header("'<f8'", "(1152921504606846976,)"))),
    "negative shape": zipped(npy(header("'<f8'", "(-1,)"), bytes(8))),
    "shape of words": zipped(npy(header("'<f8'", "('a',)"), bytes(8))),
    "true shape": zipped(npy(header("'<f8'", "(True,)"), bytes(8))),
    "deep header": zipped(npy(b"(" * 9000)),
    "a header of python": zipped(npy(b"__import__('os').system('touch owned')")),
    "unknown version": zipped(npy(header("'<f8'", "(1,)"), bytes(8), 9)),
    "no version": zipped(b"\x93NUMPY"),
    "many dimensions": zipped(npy(header("'<f8'", "(" + "1," * 70 + ")"), bytes(8))),
    "structured": zipped(npy(header("[('a', '<f8')]", "(1,)"), bytes(8))),
    "pickled": whole_result(t=np.array([{"a": 1}, None, 3], dtype=object)),
    "a pickle": pickle.dumps({"about": 1}),
    "complex": whole_result(h=np.ones(3, complex)),
    "dates": whole_result(h=np.array(["2020"] * 3, "datetime64[D]")),
    "words": whole_result(h=np.array(["a", "b", "c"])),
    "shapes that differ": whole_result(h=np.ones(4)),
    "a matrix": whole_result(h=np.ones((3, 3))),
    "no rows": whole_result(t=np.ones(0), h=np.ones(0), delta=np.ones(0)),
    "no about": zipped(npy(header("'<f8'", "(1,)"), bytes(8)), name="t.npy"),
    "about is a number": whole_result(about=np.array(1.0)),
    "about is a list": whole_result(about=np.array("[1, 2]")),
    "about is null": whole_result(about=np.array("null")),
    "about is deep": whole_result(about=np.array("[" * 100_000)),
    "stats is a list": whole_result(about=np.array(json.dumps(
        {"law": "a", "target": "c", "parameters": {}, "stopped_by": "h", "stats": [1], "warnings": []}))),
    "a number of a million digits": b'{"t": ' + b"1" * 10**6 + b"}",
    "no signs": whole_result(about=np.frombuffer(b"\xff\xff\xff\x7f", "<U1")),
    "particles of nothing": whole_result(about=np.array('{"kind": "particles"}')),
}  # fmt: skip

COMMANDS: dict[str, tuple[str, list[str]]] = {
    "derive": (".py", ["derive", "FILE"]),
    "check": (".py", ["check", "FILE"]),
    "regimes": (".py", ["regimes", "FILE"]),
    "report": (".py", ["report", "FILE", "-o", "OUT.html"]),
    "compare": (".py", ["compare", "rognon_gay", "FILE"]),
    "generate": (".py", ["generate", "FILE", "--target", "c"]),
    "generate --scene": (".toml", ["generate", "rognon_gay", "--target", "c", "--scene", "FILE"]),
    "run": (".toml", ["run", "FILE"]),
    "sweep": (".toml", ["sweep", "FILE", "--vary", "force=1,2", "-o", "OUT.npz"]),
    "convert": (".npz", ["convert", "FILE", "-o", "OUT.csv"]),
    "convert json": (".json", ["convert", "FILE", "-o", "OUT.csv"]),
    "plot": (".npz", ["plot", "FILE", "-o", "OUT.png"]),
    "plot json": (".json", ["plot", "FILE", "-o", "OUT.png"]),
}


def refused(capsys: pytest.CaptureFixture[str], arguments: list[str], status: int = 2) -> str:
    """Message of a command that must end with a status, and say why in one paragraph."""
    assert main(arguments) == status
    out, err = capsys.readouterr()
    assert out == ""
    assert "Traceback" not in err
    if arguments[0] == "sweep":  # which says first how large it is
        err = err[err.index("softdyn: error: ") :]
    assert err.startswith("softdyn: error: ")
    assert "\n\n" not in err
    return err


def arguments_for(command: str, path: Path) -> list[str]:
    return [word.replace("FILE", str(path)).replace("OUT", str(path.parent / "out")) for word in COMMANDS[command][1]]


@pytest.mark.parametrize("content", list(CONTENT))
@pytest.mark.parametrize("command", list(COMMANDS))
def test_a_file_of_another_kind_is_refused_by_name(
    command: str, content: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"file{COMMANDS[command][0]}"
    path.write_bytes(CONTENT[content])
    said = refused(capsys, arguments_for(command, path))
    assert path.name in said
    assert list(tmp_path.iterdir()) == [path], "nothing is left behind"


@pytest.mark.parametrize("command", list(COMMANDS))
def test_what_is_no_file_is_refused_by_name(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / f"file{COMMANDS[command][0]}"
    assert path.name in refused(capsys, arguments_for(command, path))
    path.mkdir()
    assert path.name in refused(capsys, arguments_for(command, path))
    path.rmdir()
    path.symlink_to(path)  # to itself
    assert path.name in refused(capsys, arguments_for(command, path))


@pytest.mark.skipif(not hasattr(os, "getuid") or os.getuid() == 0, reason="root may read everything")
@pytest.mark.parametrize("command", list(COMMANDS))
def test_what_may_not_be_read_is_refused_by_name(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"file{COMMANDS[command][0]}"
    path.write_text("secret")
    path.chmod(0)
    assert path.name in refused(capsys, arguments_for(command, path))


@pytest.mark.parametrize("content", list(CONTENT))
def test_a_checkpoint_of_another_kind_is_refused_by_name(
    content: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(MANY)
    (tmp_path / "out.checkpoint.npz").write_bytes(CONTENT[content])
    assert "out.checkpoint.npz" in refused(capsys, ["run", str(scene), "-o", str(tmp_path / "out.npz"), "--resume"])


@pytest.mark.parametrize("content", list(CONTENT))
def test_particles_of_a_file_of_another_kind_are_refused_by_name(
    content: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for ending in (".npz", ".csv"):
        scene = tmp_path / "scene.toml"
        scene.write_text(MANY.replace("positions = [[0.0], [1.99]]\nradii = [1.0, 1.0]", f'file = "file{ending}"'))
        (tmp_path / f"file{ending}").write_bytes(CONTENT[content])
        assert f"file{ending}" in refused(capsys, ["run", str(scene)])


@pytest.mark.parametrize("content", list(CONTENT))
def test_parts_of_a_sweep_of_another_kind_are_refused_by_name(
    content: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from softdyn.pair import sweep
    from softdyn.scene.pair_scene import read_scene

    (tmp_path / "scene.toml").write_text(SCENE)
    scene, values = read_scene(tmp_path / "scene.toml"), {"force": np.array([0.01, 0.02])}
    parts = tmp_path / "out.npz.parts"
    sweep._found(parts, sweep._identity(scene, values), {0})
    command = ["sweep", str(tmp_path / "scene.toml"), "--vary", "force=0.01,0.02", "-o", str(tmp_path / "out.npz")]
    note = (parts / "sweep.json").read_bytes()
    for name in ("0.npz", "sweep.json"):
        (parts / "sweep.json").write_bytes(note)
        (parts / name).write_bytes(CONTENT[content])
        said = refused(capsys, command)
        assert "out.npz.parts" in said


@given(data=st.data())
def test_a_result_in_which_bytes_were_changed_is_read_or_refused(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    content = bytearray(whole_result())
    for _ in range(data.draw(st.integers(1, 5))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path_factory.mktemp("changed") / "result.npz"
    path.write_bytes(content[: data.draw(st.integers(1, len(content)))] if data.draw(st.booleans()) else content)
    try:
        result = softdyn.load_result(path)
    except SceneError:
        return
    assert len(result) == 3


@pytest.mark.parametrize("array", [
    np.arange(6.0).reshape(2, 3), np.asfortranarray(np.arange(6).reshape(2, 3)), np.arange(3, dtype=">i4"),
    np.array(["a", "été", ""]), np.array(True), np.zeros((0, 3)), np.array("word"),
])  # fmt: skip
@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_arrays_are_read_as_they_were_written(save: Callable[..., None], array: np.ndarray, tmp_path: Path) -> None:
    save(tmp_path / "a.npz", x=array)
    found = archive.read_arrays(tmp_path / "a.npz")["x"]
    np.testing.assert_array_equal(found, array)
    assert found.dtype.isnative
    assert found.flags.c_contiguous
    assert found.flags.writeable


# ---------------------------------------------------------------- what is left


@pytest.mark.parametrize(
    ("error", "status", "words"),
    [
        (MemoryError("Unable to allocate 8.00 TiB"), 3, "not enough memory for this: Unable to allocate 8.00 TiB"),
        (RecursionError("maximum recursion depth exceeded"), 3, "nested too deeply"),
        (SceneError("no law"), 2, "no law"),
        (OSError(28, "No space left on device", "a.npz"), 2, "No space left on device: a.npz"),
        (ValueError("embedded null byte"), 2, "NUL character"),
        (zlib.error("a surprise"), 70, "a fault of softdyn's own, error: a surprise"),
        (AssertionError(), 70, "a fault of softdyn's own, AssertionError: no more is said"),
    ],
)
def test_what_is_left_has_a_message_and_a_status_of_its_own(
    error: Exception, status: int, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail() -> int:
        raise error

    assert endings.ended(fail, ["run", "x.toml"], lambda: "") == status
    said = capsys.readouterr().err
    assert words in said
    assert f"\n  {status} " in endings.STATUSES
    if status == endings.FAULT:
        path = Path(said.split("report it with ")[1].split(",")[0])
        report = path.read_text(encoding="utf-8")
        path.unlink()
        assert "Traceback" in report
        assert "in fail" in report
        assert "['run', 'x.toml']" in report
        assert softdyn.__version__ in report


def test_the_statuses_are_in_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--help"])
    assert endings.STATUSES in capsys.readouterr().out


@pytest.mark.parametrize("key", ['law = "a\\u0000b.py"', 'drive = {force = {file = "a\\u0000"}}', '"a\\U00000000" = 1'])
@pytest.mark.parametrize("base", [SCENE, MANY])
def test_a_nul_in_a_scene_is_named(key: str, base: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "scene.toml").write_text(
        base.replace('law = "rognon_gay"', key).replace("drive = {force = 0.01}\n", "")
    )
    said = refused(capsys, ["run", str(tmp_path / "scene.toml")])
    assert "NUL" in said
    assert "\0" not in said


def test_friction_beyond_the_largest_number_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An infinite friction times a rate of 0 is no power."""
    (tmp_path / "scene.toml").write_text(
        'law = "rognon_gay"\nparameters = {E = 1.0, eta = 1e99}\nuntil = {t = 1.0}\nflow = {drag = 1.0}\n'
        "particles = {positions = [[0.0], [2.1e30]], radii = 1e30}\ncontacts = {gap = 1.0, range = 1e30}\n"
    )
    said = refused(capsys, ["run", str(tmp_path / "scene.toml")])
    assert "the friction of the contact of particles 0 and 1 is beyond the largest number" in said


SIZES = st.sampled_from([10.0**k for k in (-300, -200, -99, -30, -3, 0, 3, 30, 99, 200, 300)])


@pytest.mark.slow
@given(data=st.data())
@settings(max_examples=60, deadline=None)
def test_particles_of_numbers_of_any_size_end_in_words(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Run, or refused; warnings of numpy are errors in tests, and would be a fault."""
    size = data.draw(SIZES)
    one = lambda: data.draw(st.one_of(st.just(1.0), SIZES))  # noqa: E731
    path = tmp_path_factory.mktemp("sizes") / "scene.toml"
    path.write_text(
        f'law = "rognon_gay"\nparameters = {{E = {one()}, eta = {one()}}}\nuntil = {{t = {one()}}}\n'
        f"flow = {{drag = {one()}}}\nparticles = {{positions = [[0.0], [{2.1 * size!r}]], radii = {size}}}\n"
        f"contacts = {{gap = {one()}, range = {one()}}}\n"
    )
    assert main(["run", str(path)]) in (0, 2)


def test_what_a_library_warns_of_is_told_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    def warn() -> int:
        warnings.simplefilter("always")
        warnings.warn("overflow encountered\nin multiply", RuntimeWarning, stacklevel=1)
        return 0

    assert endings.ended(warn, [], lambda: "") == 0
    said = capsys.readouterr().err
    assert said.startswith("softdyn: warning: overflow encountered in multiply (RuntimeWarning, test_endings.py:")
    assert said.count("\n") == 1


# ---------------------------------------------------------------- closed streams


def shell(line: str, **options: object) -> subprocess.CompletedProcess[str]:
    command = ["bash", "-c", line.replace("softdyn", f"{sys.executable} -m softdyn")]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=120, **options)  # type: ignore[call-overload]


@pytest.mark.slow
@pytest.mark.parametrize("command", ["softdyn laws", "softdyn --help", "softdyn derive rognon_gay", "softdyn run x"])
@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-", "<&- >&- 2>&-", "2>/dev/full", "| head -n 1", "| true"])
def test_closed_streams_are_no_fault(command: str, closed: str) -> None:
    done = shell(f"{command} {closed}; echo ${{PIPESTATUS[0]}}")
    assert int(done.stdout.splitlines()[-1]) == (2 if command == "softdyn run x" else 0)
    assert "Traceback" not in done.stderr
    assert "Exception ignored" not in done.stderr


@pytest.mark.slow
def test_a_file_does_not_take_the_place_of_a_closed_stream(tmp_path: Path) -> None:
    """The first file to be opened would get its number, and with it what is printed."""
    (tmp_path / "scene.toml").write_text(SCENE)
    done = shell("softdyn run scene.toml -o a.json <&- >&- 2>&-", cwd=tmp_path)
    assert done.returncode == 0
    assert softdyn.load_result(tmp_path / "a.json").h[-1] == pytest.approx(0.1)


# ---------------------------------------------------------------- signals


@pytest.mark.parametrize(("sent", "status", "word"), [
    (signal.SIGTERM, 143, "terminated"), (signal.SIGINT, 130, "interrupted"),
])  # fmt: skip
def test_a_signal_ends_a_command_with_its_conventional_status(
    sent: signal.Signals, status: int, word: str, capsys: pytest.CaptureFixture[str]
) -> None:
    def wait() -> int:
        os.kill(os.getpid(), sent)
        time.sleep(10)
        return 0

    assert endings.ended(wait, [], lambda: "; its state is in x") == status
    assert capsys.readouterr().err == f"softdyn: {word}; its state is in x\n"
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_a_handler_of_somebody_elses_is_left_alone() -> None:
    mine = lambda *_: None  # noqa: E731
    before = signal.signal(signal.SIGTERM, mine)
    try:
        with signals.terminable():
            assert signal.getsignal(signal.SIGTERM) is mine
    finally:
        signal.signal(signal.SIGTERM, before)


def test_what_is_in_the_middle_comes_to_its_end_however_often_it_is_asked_to_terminate() -> None:
    """A pool of processes that ends may ask twice; and once a checkpoint is being written nothing breaks that off."""
    done = []

    def work() -> None:
        with signals.held_back() as let_go:
            for _ in range(3):
                os.kill(os.getpid(), signal.SIGTERM)
                done.append("part")
            let_go()

    with signals.terminable():
        with pytest.raises(signals.Terminated):
            work()
        os.kill(os.getpid(), signal.SIGTERM)
        done.append("checkpoint")
    assert done == [*["part"] * 3, "checkpoint"]
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_a_user_who_insists_is_heard() -> None:
    done = []

    def work() -> None:
        with signals.held_back():
            for _ in range(3):
                os.kill(os.getpid(), signal.SIGINT)
                done.append("part")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert done == ["part"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_other_threads_run_commands_too() -> None:
    found: list[int] = []
    thread = threading.Thread(target=lambda: found.append(endings.ended(lambda: 0, [], lambda: "")))
    thread.start()
    thread.join()
    assert found == [0]


# ---------------------------------------------------------------- files that are written


@pytest.mark.parametrize("mask", [0o022, 0o077, 0o002])
def test_files_follow_the_umask_which_nobody_changes(mask: int, tmp_path: Path) -> None:
    """Not even for a moment: other threads write files, too."""
    before = os.umask(mask)
    changed: list[int] = []
    patch = pytest.MonkeyPatch()
    patch.setattr(os, "umask", changed.append)
    try:
        with written_whole(tmp_path / "a.txt") as temporary:
            temporary.write_text("a")
    finally:
        patch.undo()
        os.umask(before)
    assert changed == []
    assert stat.S_IMODE((tmp_path / "a.txt").stat().st_mode) == 0o666 & ~mask


# ---------------------------------------------------------------- words of others


@pytest.mark.slow
@given(st.text())
def test_nothing_is_left_that_a_terminal_obeys(text: str) -> None:
    found = plain(text)
    assert not any(
        sign != "\n" and sign != "\t" and not (sign.isprintable() or sign.isspace()) for sign in found if sign < "\xa0"
    )
    assert not set(found) & set("\r\x1b\x7f\x9b\u202e\u2066\u200b\ufeff\u2028")
    assert plain(found) == found


def test_plain_text_stays_as_it_is() -> None:
    assert plain("κ = F/(E R²) – 10⁻⁶\tη\n") == "κ = F/(E R²) – 10⁻⁶\tη\n"


LAW = """
from sympy import Rational, pi, sqrt
from softdyn.derive import ContactLaw, E, Limit, R, a, delta, eta, h
law = ContactLaw(name="mine", description={words!r}, source={words!r}, a=sqrt(2*R*h),
    F_ela=Rational(4, 9)*E*a*delta, zeta=3*pi*eta*a**4/(2*h**3),
    limits=[Limit({words!r}, order=(delta, h, R), claims={{"zeta": 6*pi*eta*R**2/h}})])
"""


@pytest.mark.parametrize("command", ["check", "derive", "generate"])
def test_words_of_a_law_do_not_reach_the_terminal_as_orders(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "law.py").write_text(LAW.format(words='\x1b[2J\x07 \u202egnp.exe\r\x9b31m $x$ */ """ \\'))
    more = ["--target", "c"] if command == "generate" else []
    assert main([command, str(tmp_path / "law.py"), *more]) in (0, 1)
    said = capsys.readouterr()
    assert plain(said.out + said.err) == said.out + said.err


@pytest.mark.slow
@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_signs_that_an_encoding_lacks_are_spelled_out(encoding: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "softdyn", "derive", "rognon_gay", "--format", "latex"],
        env={**os.environ, "PYTHONIOENCODING": encoding}, capture_output=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, b"")
    said = subprocess.run(
        [sys.executable, "-m", "softdyn", "run", "κ\x1b.toml"],
        env={**os.environ, "PYTHONIOENCODING": encoding}, capture_output=True, check=False,
    )  # fmt: skip
    assert said.returncode == 2
    assert b"Traceback" not in said.stderr
    assert b"\x1b" not in said.stderr
