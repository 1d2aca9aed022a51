"""The command line: what it prints, its exit status, and one clear message where it refuses."""

import json
import os
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import softdyn
from softdyn.cli import main
from softdyn.scene.stock_scenes import particle_scenes, stock_scenes

SCENE = """
law = "rognon_gay"
[parameters]
R = 1.0
E = 1.0
eta = 1.0
[pair]
h = 100.0
[drive]
force = "1e-2*(1 + 0.5*sin(w*t))"
[constants]
w = 1e-5
[until]
h = 1e-3
[output]
times = 50
[accuracy]
rtol = 1e-9
"""

LAW = """
from sympy import Abs, Rational, pi, sqrt
from softdyn.derive import ContactLaw, E, Limit, R, a, delta, eta, h

hbar = R*h/(R + h)
{extra}
law = ContactLaw(
    name="mine",
    a=sqrt(2*R*(hbar + Abs(delta))),
    F_ela=Rational(4, 9)*E*a*delta,
    zeta={zeta},
    limits=[Limit("Poiseuille", order=(delta, h, R), claims={{"zeta": {claim}}})],
)
"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE)
    return path


def write_law(
    folder: Path, zeta: str = "3*pi*eta*a**4/(2*hbar**3)", claim: str = "6*pi*eta*R**2/h", extra: str = ""
) -> str:
    path = folder / "mine.py"
    path.write_text(LAW.format(zeta=zeta, claim=claim, extra=extra))
    return str(path)


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Message of a command that must end with exit status 2 and print nothing else."""
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("softdyn: error: ")
    assert "Traceback" not in err
    return err


def test_run_prints_one_json_object(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", str(scene), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["status"] == "success"
    assert result["law"] == "rognon_gay"
    assert result["target"] in ("c", "numba")
    for name in ("t", "h", "delta", "X", "a", "F"):
        assert len(result[name]) == 50
    assert {"steps", "rejected", "evaluations", "force_residual", "wall_s", "compile_s", "kernel"} <= set(
        result["stats"]
    )
    assert result["h"][0] == 100.0
    assert result["h"][-1] == 1e-3
    X = 2 + np.array(result["h"]) - 2 * np.array(result["delta"])
    np.testing.assert_allclose(result["X"], X, rtol=1e-15)
    F = 1e-2 * (1 + 0.5 * np.sin(1e-5 * np.array(result["t"])))
    np.testing.assert_allclose(result["F"], F, rtol=1e-14)


@pytest.mark.slow
def test_the_command_and_the_api_agree(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", str(scene), "-o", str(tmp_path / "result.npz")]) == 0
    assert "wrote" in capsys.readouterr().out
    saved, again = softdyn.load_result(tmp_path / "result.npz"), softdyn.simulate(scene)
    np.testing.assert_array_equal(saved.h, again.h)


def test_plot_writes_a_picture(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["run", str(scene), "-o", str(tmp_path / "result.json")])
    assert main(["plot", str(tmp_path / "result.json")]) == 0
    assert (tmp_path / "result.png").read_bytes().startswith(b"\x89PNG")
    capsys.readouterr()
    assert "the ending must be" in refused(capsys, "plot", str(tmp_path / "result.json"), "-o", "picture.bmp")


def test_laws_lists_the_stock_laws(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["laws"]) == 0
    assert "rognon_gay" in capsys.readouterr().out


@pytest.mark.parametrize("form", ["text", "latex", "json"])
def test_derive_shows_any_law_then_this_law(form: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["derive", "rognon_gay", "--format", form]) == 0
    text = capsys.readouterr().out
    if form == "json":
        data = json.loads(text)
        assert data["this law"]["C"]["text"] == "2*E*(R*Abs(delta)/a + a)/9"
        assert data["any law"]["stiffness"]["text"] == "C = F_a*a_delta/2 + F_delta/2"
        assert data["any law"]["friction"]["text"] == "D = C*zeta/(C + F_a*a_h)"
        assert len(data["Jacobians of this law, d(rates)/d(state)"]["h, delta"]["text"]) == 2
    else:
        for word in {"text": ["D = C*zeta/(C + F_a*a_h)", "dX_dt", "J[1, 1]"], "latex": [r"\dot{X}", r"\zeta"]}[form]:
            assert word in text


@pytest.mark.slow
def test_check_proves_and_refutes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "rognon_gay"]) == 0
    assert "12 proved" in capsys.readouterr().out
    wrong = write_law(tmp_path, claim="3*pi*eta*R**2/h")
    assert main(["check", wrong]) == 1
    assert "found/claimed tends to 2, not to 1" in capsys.readouterr().out
    assert main(["check", wrong, "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert (found["disproved"], found["limits"][0]["ratio"]) == (1, "2")
    steeper = write_law(tmp_path, zeta="3*pi*eta*a**4/(2*hbar**3)*sqrt(R/h)")
    assert main(["check", steeper + ":law"]) == 1
    assert "which tends to infinity" in capsys.readouterr().out


@pytest.mark.slow
def test_generate_reports_what_each_rule_saved(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        main(["generate", "rognon_gay", "--target", "c", "--scene", str(scene), "-o", str(tmp_path), "--fix", "R=1"])
        == 0
    )
    report = capsys.readouterr().out
    for rule in ("no remote force", "fixed parameters", "outputs asked for"):
        assert rule in report
    text = (tmp_path / "rognon_gay_scene_R1.c").read_text()
    assert "double R " not in text
    assert main(["generate", "rognon_gay", "--target", "numba"]) == 0
    captured = capsys.readouterr()
    compile(captured.out, "kernel", "exec")
    assert "no remote force" in captured.err
    assert "NAME=VALUE" in refused(capsys, "generate", "rognon_gay", "--target", "c", "--fix", "R")
    assert "'Q' cannot be fixed" in refused(capsys, "generate", "rognon_gay", "--target", "c", "--fix", "Q=1")
    assert "needs LAW and --target" in refused(capsys, "generate", "rognon_gay")


@pytest.mark.slow
def test_kernels_of_one_law_for_several_ends_are_files_of_their_own(scene: Path, tmp_path: Path) -> None:
    """None is written over another; and those in Python are called as a module may be."""
    many = tmp_path / "my scene-2.toml"
    many.write_text(
        'law = "rognon_gay"\nparameters = {E = 1.0, eta = 1.0}\nuntil = {t = 1.0}\nflow = {drag = 1.0}\n'
        "particles = {positions = [[0.0], [1.99]], radii = [1.0, 1.0]}\n"
    )
    wanted = {
        "rognon_gay": [],
        "rognon_gay_scene": ["--scene", str(scene)],
        "rognon_gay_my_scene_2_contacts": ["--scene", str(many)],
        "rognon_gay_R1p5em3": ["--fix", "R=1.5e-3"],
        "rognon_gay_R1p5e3": ["--fix", "R=1.5e3"],
        "rognon_gay_scene_R2_E1": ["--scene", str(scene), "--fix", "R=2", "--fix", "E=1"],
    }
    folder = tmp_path / "kernels"
    for more in wanted.values():
        assert main(["generate", "rognon_gay", "--target", "numba", "-o", str(folder), *more]) == 0
    texts = {path.stem: path.read_text(encoding="utf-8") for path in folder.iterdir()}
    assert set(texts) == set(wanted)
    assert len(set(texts.values())) == len(wanted)
    assert all(name.isidentifier() for name in texts)


@pytest.mark.slow
def test_generated_files_are_what_the_tool_writes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["generate", "--stock", "--check"]) == 0
    assert capsys.readouterr().out == ""


@pytest.mark.slow
def test_a_changed_generated_file_is_a_difference(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from softdyn import stock

    monkeypatch.setattr(stock, "GENERATED", tmp_path)
    monkeypatch.setattr(stock, "stock_laws", lambda: ["rognon_gay"])
    assert main(["generate", "--stock"]) == 0
    changed = tmp_path / "rognon_gay" / "approach.c"
    original = changed.read_text()
    changed.write_text(original.replace("sqrt", "cbrt", 1))
    capsys.readouterr()
    assert main(["generate", "--stock", "--check"]) == 1
    assert "generated/rognon_gay/approach.c" in capsys.readouterr().out
    stamp = (tmp_path / "rognon_gay" / "general.c").stat().st_mtime_ns
    assert main(["generate", "--stock"]) == 0
    assert capsys.readouterr().out == "wrote generated/rognon_gay/approach.c\n"
    assert changed.read_text() == original
    assert (tmp_path / "rognon_gay" / "general.c").stat().st_mtime_ns == stamp  # unchanged files are not rewritten
    (tmp_path / "rognon_gay" / "old.c").write_text("of a kernel that is no more")
    capsys.readouterr()
    assert main(["generate", "--stock", "--check"]) == 1
    assert "generated/rognon_gay/old.c would not be written" in capsys.readouterr().out
    assert main(["generate", "--stock"]) == 0
    assert capsys.readouterr().out == "removed generated/rognon_gay/old.c\n"


def test_generated_files_are_those_of_a_checkout(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from softdyn import stock

    monkeypatch.setattr(stock, "GENERATED", tmp_path / "none")
    assert main(["generate", "--stock", "--check"]) == 2
    assert "generated/ belongs to a checkout of softdyn" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["check", "rognon_gya"], "did you mean 'rognon_gay'"),
        (["check", "missing.py"], "there is no file"),
        (["run", "missing.toml"], "cannot read the scene"),
        (["plot", "missing.npz"], "cannot read"),
        (["plot", "."], "cannot read .: results are read back from .json and .npz"),
        (["run", "missing.toml", "-o", "result.xls"], "the ending must be one of .json, .npz, .csv"),
        (["generate", "--stock", "--target", "c"], "takes --check and nothing else"),
    ],
)
def test_refusals(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert message in refused(capsys, *arguments)


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        ("1/0", "line 6: ZeroDivisionError"),
        ("x = (", "line"),
        ("import nonesuch_module", "No module named 'nonesuch_module'"),
        ("raise SystemExit(0)", "SystemExit"),
    ],
)
def test_a_law_file_that_fails_is_named_with_its_line(
    extra: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said = refused(capsys, "check", write_law(tmp_path, extra=extra))
    assert "mine.py" in said
    assert message in said


def test_a_faulty_law_is_refused_with_every_fault(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = refused(capsys, "check", write_law(tmp_path, zeta="0.5*eta*a*delta/h"))
    assert "law 'mine' has 2 faults" in said
    assert "Rational(1, 2)" in said
    assert "symbol 'delta' is not allowed here" in said


def test_a_law_file_without_the_law_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "its laws are law" in refused(capsys, "check", write_law(tmp_path) + ":other")
    (tmp_path / "empty.py").write_text("")
    assert "no ContactLaw" in refused(capsys, "check", str(tmp_path / "empty.py"))


def test_large_forces_are_warned_of_on_stderr(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene.write_text(SCENE.replace("1e-2*(", "2*("))
    assert main(["run", str(scene), "--json"]) == 0
    captured = capsys.readouterr()
    assert "softdyn: warning: kappa = F/(E R^2) reaches" in captured.err
    assert json.loads(captured.out)["warnings"]


@pytest.mark.slow
def test_a_run_that_cannot_reach_its_end_is_an_error(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene.write_text(SCENE.replace("1e-2*(1 ", "-1e-2*(1 "))
    said = refused(capsys, "run", str(scene), "--json")
    assert "the force moves the gap the other way" in said


@pytest.mark.parametrize("where", ["folder", "file_as_folder"])
def test_output_that_cannot_be_written_leaves_nothing(
    where: str, scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if where == "folder":
        (target := tmp_path / "taken.npz").mkdir()
    else:
        (tmp_path / "file").write_text("")
        target = tmp_path / "file" / "result.npz"
    before = sorted(tmp_path.iterdir())
    assert "cannot write" in refused(capsys, "run", str(scene), "-o", str(target))
    assert sorted(tmp_path.iterdir()) == before


def shell(*arguments: str, **options: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "softdyn", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=120, **options)  # type: ignore[call-overload]


def seconds_of_children() -> float:
    """Processor time of all processes started and ended so far, and of what they started in turn."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["json", "npz", "csv"])
def test_a_disk_that_fills_leaves_nothing_half_written(suffix: str, scene: Path, tmp_path: Path) -> None:
    """A limit on the size of files stands for a full disk: both fail in write, on the way."""
    scene.write_text(SCENE.replace("times = 50", "times = 20000"))
    main(["run", str(scene), "--json"])  # the kernel is in the cache: only the result is written
    target = tmp_path / "out" / f"result.{suffix}"
    limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))  # noqa: E731
    done = shell("run", str(scene), "-o", str(target), preexec_fn=limit)
    assert done.returncode == 2
    assert f"softdyn: error: cannot write {target}" in done.stderr
    assert list(target.parent.iterdir()) == []


@pytest.mark.slow
def test_a_full_standard_output_is_an_error(scene: Path) -> None:
    if not os.path.exists("/dev/full"):
        pytest.skip("no /dev/full here")
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "softdyn", "run", str(scene), "--json"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert done.returncode == 2
    assert "No space left" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.slow
def test_a_reader_that_leaves_is_no_error() -> None:
    line = f"{sys.executable} -m softdyn derive rognon_gay | head -n 1"
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert "rognon_gay" in done.stdout


@pytest.mark.slow
def test_a_cached_scene_imports_no_sympy_jinja2_matplotlib_and_is_quick(scene: Path) -> None:
    """The promise is half a second from the shell, of processor time: what else the machine does is not ours.

    The best of three runs is compared with it.
    """
    assert shell("run", str(scene)).returncode == 0
    code = (
        "import sys; from softdyn.cli import main; main(sys.argv[1:]);"
        "heavy = {'sympy', 'jinja2', 'matplotlib', 'scipy', 'numba', 'softdyn.derive'} & set(sys.modules);"
        "print('imported', sorted(heavy))"
    )
    target = [] if softdyn.simulate(scene).target == "c" else ["numba"]
    done = subprocess.run([sys.executable, "-c", code, "run", str(scene)], capture_output=True, text=True, check=True)
    assert f"imported {target}" in done.stdout
    if not target:
        seconds = []
        for _ in range(3):
            start = seconds_of_children()
            shell("run", str(scene))
            seconds.append(seconds_of_children() - start)
        assert min(seconds) < 0.5


@pytest.mark.slow
def test_a_cached_scene_of_many_particles_imports_no_sympy(tmp_path: Path) -> None:
    """What is asked of its law besides the kernel is kept, too."""
    assert main(["run", "two", "-o", str(tmp_path / "first.npz")]) == 0
    code = (
        "import sys; from softdyn.cli import main; main(sys.argv[1:]);"
        "heavy = {'sympy', 'jinja2', 'matplotlib', 'softdyn.derive'} & set(sys.modules);"
        "print('imported', sorted(heavy))"
    )
    again = [sys.executable, "-c", code, "run", "two", "-o", str(tmp_path / "again.npz")]
    assert "imported []" in subprocess.run(again, capture_output=True, text=True, check=True).stdout


def test_importing_softdyn_imports_nothing_heavy() -> None:
    code = "import sys, softdyn; print(sorted({'numpy', 'sympy', 'scipy', 'numba', 'matplotlib'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_scenes_are_listed_and_printed_to_start_from(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenes"]) == 0
    listed = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert listed.keys() == stock_scenes().keys()
    assert listed["two"] == "Two particles pushed together"
    for name, path in stock_scenes().items():
        assert main(["scenes", name]) == 0
        assert capsys.readouterr().out == path.read_text(encoding="utf-8")
    assert main(["scenes", "cylinde"]) == 2
    assert "did you mean 'cylinder'?" in capsys.readouterr().err


@pytest.mark.slow
def test_a_new_law_is_ready_in_some_seconds(tmp_path: Path) -> None:
    """From a cold cache, C target: derive, emit, compile, run; in at most twenty times what importing sympy takes."""
    from softdyn.targets import c

    if not c.available():
        pytest.skip("no C compiler here")
    write_law(tmp_path, zeta="5*pi*eta*a**4/(2*hbar**3)")
    (tmp_path / "scene.toml").write_text(SCENE.replace('"rognon_gay"', '"mine.py"'))
    environment = {**os.environ, "SOFTDYN_CACHE_DIR": str(tmp_path / "cold")}
    start = seconds_of_children()
    subprocess.run([sys.executable, "-c", "import sympy"], check=True)
    imported = seconds_of_children()
    done = shell("run", str(tmp_path / "scene.toml"), env=environment)
    assert done.returncode == 0, done.stderr
    assert seconds_of_children() - imported < 20 * (imported - start)


def test_help_shows_every_command_with_examples() -> None:
    done = shell("--help")
    for word in (
        "laws",
        "derive",
        "check",
        "generate",
        "run",
        "sweep",
        "plot",
        "bench",
        "stress",
        "reproduce",
        "examples:",
        "exit status",
    ):
        assert word in done.stdout
    of_run = shell("run", "--help")
    assert of_run.returncode == 0
    assert all(name in of_run.stdout for name in particle_scenes())
    assert shell("--version").stdout == f"softdyn {softdyn.__version__}\n"
    cited = shell("--cite").stdout
    assert f"version = {{{softdyn.__version__}}}" in cited
    assert "0803.1573" in cited
    assert "0901.0171" in cited
    assert cited.count("{") == cited.count("}")


@pytest.mark.slow
def test_generate_writes_the_contact_kernel_of_a_scene_of_many(capsys: pytest.CaptureFixture[str]) -> None:
    """With what the scene needs: droplets of two sizes, with drag, that do not slide."""
    from softdyn.scene.stock_scenes import particle_scenes

    assert main(["generate", "equal_spheres", "--target", "c", "--scene", str(particle_scenes()["emulsion"])]) == 0
    text = capsys.readouterr().out
    assert "equal_spheres_contacts(n, s, reach, overlaps" in text
    assert "drag translation = 6*pi*R*eta" in text
    assert "drag rotation" not in text
    assert "q: R, size_ratio, n of each" in text
