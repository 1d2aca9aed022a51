"""What is written beside a kernel in C: a header for C and C++, and an example that compiles, runs and is right."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from softdyn.cli import main
from softdyn.kernels import get_kernel
from softdyn.pair.states import deflection, evaluate
from softdyn.pair_layout import STATE

ZIG = [sys.executable, "-m", "ziglang", "cc"] if find_spec("ziglang") else []
STRICT = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
#: clang is also what the wheel ziglang holds.
FOUND = {
    "gcc": ["gcc"] if shutil.which("gcc") else [],
    "clang": ["clang"] if shutil.which("clang") else ZIG,
}
COMPILERS = [
    pytest.param(name, marks=() if command else pytest.mark.skip(reason=f"there is no {name}"))
    for name, command in FOUND.items()
]
pytestmark = pytest.mark.skipif(not any(FOUND.values()), reason="there is no C compiler")


def lifted(folder: Path, *arguments: str) -> str:
    """Name of a kernel that was written into a folder."""
    assert main(["generate", *arguments, "--target", "c", "-o", str(folder)]) == 0
    (header,) = folder.glob("*.h")
    return header.stem


def printed(folder: Path, stem: str, compiler: str) -> dict[str, np.ndarray]:
    """What the example prints, by its heads."""
    sources = [f"{stem}.c", f"{stem}_example.c"]
    command = [*FOUND[compiler], "-std=c99", "-O1", "-ffp-contract=off", *STRICT, *sources, "-lm", "-o", "example"]
    subprocess.run(command, cwd=folder, check=True)
    done = subprocess.run([folder / "example"], check=True, capture_output=True, text=True)
    heads, *rows = done.stdout.splitlines()
    values = np.array([[float(word) for word in row.split()] for row in rows]).T.copy()
    return dict(zip(heads.split(), values, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_example_of_a_law_gives_what_the_kernel_gives_here(compiler: str, tmp_path: Path) -> None:
    stem = lifted(tmp_path, "rognon_gay")
    found = printed(tmp_path, stem, compiler)
    kernel = get_kernel("rognon_gay", "c", drive="table")
    text = (tmp_path / f"{stem}_example.c").read_text()
    p = np.array([float(re.search(rf"\.{name} = ([^,}}]+)", text)[1]) for name in kernel.parameters])  # type: ignore[index]
    F, still = np.full(3, 1e-3), np.zeros(3)
    delta = deflection(kernel, found["h"], F, p)
    np.testing.assert_array_equal(found["delta"], delta)
    expected = evaluate(kernel, found["h"], delta, {"F": F, "dF_dt": still}, p)
    for name in kernel.outputs:
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_example_of_a_scene_of_many_solves_a_contact(compiler: str, tmp_path: Path) -> None:
    found = printed(tmp_path, lifted(tmp_path, "droplet", "--scene", "emulsion"), compiler)
    # pressed: a film that thins, a force that pushes, and falls as the two part
    assert 0 < found["gap"][0] < 0.02
    assert found["force"][0] > 0 > found["slope"][0]


#: Laws whose kernels leave out something that others have: terms of the gap, dashpots, tension, deflection.
KINDS = ("droplet", "durian", "hertz_dry", "lubrication_rigid")


@pytest.mark.slow
@pytest.mark.parametrize("law", KINDS)
def test_kernels_have_no_warnings(law: str, tmp_path: Path) -> None:
    """By every compiler here: kernels of a pair, where the law has one, and of many particles, optimised and not."""
    kinds: list[list[str]] = [["--scene", "emulsion"], *([[]] if law != "dmt" else [])]
    for kind in kinds:
        lifted(tmp_path, law, *kind)
        for command in filter(None, FOUND.values()):
            for level in ("-O0", "-O3"):
                sources = sorted(path.name for path in tmp_path.glob("*.c"))
                subprocess.run([*command, "-std=c99", level, *STRICT, "-c", *sources], cwd=tmp_path, check=True)
        for path in tmp_path.iterdir():
            path.unlink()


@pytest.mark.slow
@pytest.mark.parametrize(
    "compiler",
    [
        pytest.param(c, marks=() if shutil.which(c) else pytest.mark.skip(reason=f"there is no {c}"))
        for c in ("g++", "clang++")
    ],
)
@pytest.mark.parametrize("arguments", [("rognon_gay",), ("equal_spheres", "--scene", "emulsion")])
def test_a_header_is_for_cpp_too_and_its_structs_are_arrays(
    arguments: tuple[str, ...], compiler: str, tmp_path: Path
) -> None:
    stem = lifted(tmp_path, *arguments)
    law = arguments[0]
    size = (
        f'static_assert(sizeof({law}_state) == {len(STATE)} * sizeof(double), "padded");' if len(arguments) == 1 else ""
    )
    (tmp_path / "use.cpp").write_text(f'#include "{stem}.h"\n#include "{stem}.h"\n{size}\nint main() {{ return 0; }}\n')
    subprocess.run([compiler, "-std=c++17", *STRICT, "-c", "use.cpp"], cwd=tmp_path, check=True)


def test_numba_has_no_files_beside(tmp_path: Path) -> None:
    assert main(["generate", "rognon_gay", "--target", "numba", "-o", str(tmp_path)]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["rognon_gay.py"]
