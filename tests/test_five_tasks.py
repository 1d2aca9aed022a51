"""What a stranger does with README and site alone, in the lines of own code that the project promises."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softdyn.cli import main

pytestmark = pytest.mark.slow


def lines_of(text: str) -> int:
    return len([line for line in text.splitlines() if line.strip()])


LAW = """
from sympy import Abs, Rational, Symbol, exp, pi, sqrt
from softdyn.derive import FORCE, LENGTH, ContactLaw, E, R, a, delta, eta, h
hbar = R*h/(R + h)
A, lam = Symbol("A", positive=True), Symbol("lam", positive=True)
law = ContactLaw(
    name="film", a=sqrt(2*R*(hbar + Abs(delta))), F_ela=Rational(4, 9)*E*a*delta,
    zeta=3*pi*eta*a**4/(2*hbar**3), F_adh=A*exp(-h/lam),
    parameters={A: FORCE, lam: LENGTH}, typical={A: E*R**2/10**4, lam: R/1000},
)
"""


def test_an_own_law_with_its_regimes_and_a_figure_takes_twelve_lines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The law, and two commands."""
    monkeypatch.chdir(tmp_path)
    Path("film.py").write_text(LAW, encoding="utf-8")
    commands = ["regimes film.py", "regimes film.py --plot film.pdf"]
    assert lines_of(LAW) + len(commands) <= 12
    for command in commands:
        assert main(command.split()) == 0
    told = capsys.readouterr().out
    assert "6 regimes of h and F in compression" in told
    assert Path("film.pdf").read_bytes().startswith(b"%PDF")


SCENE = """
law = "droplet"
parameters = {sigma = 1.0, eta = 1.0}
packing = {count = 16, dimension = 2, fraction = 0.9, radii = [1.0, 1.4], seed = 1}
contacts = {gap = 0.02, range = 0.5}
flow = {drag = 1.0, shear_rate = 1e-3}
until = {strain = 0.2}
output = {times = 41}
"""


def test_a_flow_curve_over_three_fractions_on_a_cluster_takes_a_scene_and_a_command(tmp_path: Path) -> None:
    """Each task of the printed SLURM script is that command, too, and so is what gathers them."""
    (tmp_path / "scene.toml").write_text(SCENE, encoding="utf-8")
    command = [
        sys.executable, "-m", "softdyn", "flow-curve", "scene.toml", "--rates", "1e-3,2e-3,4e-3",
        "--vary", "packing.fraction=0.85,0.9,0.95", "-o", "flow.csv",
    ]  # fmt: skip
    script = subprocess.run([*command, "--array"], cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert "#SBATCH --array=0-8" in script
    assert "--task" in script
    for task in range(9):
        subprocess.run([*command, "--task", str(task)], cwd=tmp_path, check=True, capture_output=True)
    subprocess.run([*command, "--gather"], cwd=tmp_path, check=True, capture_output=True)
    head, *rows = (tmp_path / "flow.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == 9
    assert {"shear_stress", "shear_stress_error"} <= {name.split(" ")[0] for name in head.split(",")}


FIT = """
import softdyn
known = {"R": "10 um", "E": "100 kPa", "eta": "1 mPa s", "nu": 0.5, "Pi0": "30 kPa", "L": "15 nm"}
cantilever = {"spring": {"stiffness": "0.05 N/m", "base": "Z"}}
fit = softdyn.fit("steric", "afm.csv", free=["Pi0", "L", "h"], parameters=known, h="240 nm", drive=cantilever)
print(fit)
"""


def test_a_fit_of_an_afm_curve_with_uncertainties_takes_five_lines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of the file of the site's tutorial, whose brushes have 50 kPa and 20 nm, from 250 nm."""
    assert lines_of(FIT) <= 5
    monkeypatch.chdir(tmp_path)
    shutil.copy(Path(__file__).parent.parent / ".docs" / "tutorials" / "afm.csv", "afm.csv")
    names: dict[str, Any] = {}
    exec(compile(FIT, "fit", "exec"), names)
    fit = names["fit"]
    told = capsys.readouterr().out
    for name, truth in {"Pi0": 5e4, "L": 20e-9, "h": 250e-9}.items():
        assert name in told
        # a right one is further away once in ten thousand; and the curve tells each to a tenth
        assert abs(fit.values[name] - truth) < 4 * fit.errors[name]
        assert fit.errors[name] < 0.1 * truth


def test_moduli_over_frequency_take_one_command(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(SCENE, encoding="utf-8")
    command = [
        sys.executable, "-m", "softdyn", "oscillate", "scene.toml", "--frequency", "1e-3,1e-2,1e-1",
        "--amplitude", "1e-3", "-o", "moduli.csv",
    ]  # fmt: skip
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    head, *rows = (tmp_path / "moduli.csv").read_text(encoding="utf-8").splitlines()
    columns = zip(*(row.split(",") for row in rows), strict=True)
    table = dict(zip([name.split(" ")[0] for name in head.split(",")], columns, strict=True))
    assert len(rows) == 3
    assert {"G_storage_error", "G_loss_error"} <= table.keys()
    assert (np.array([table["G_storage"], table["G_loss"]], float) > 0).all()


PROGRAM = """
#include <stdio.h>
#include "droplet.h"
int main(void)
{
    const droplet_parameters p = {.R = 1.0, .eta = 1.0, .sigma = 1.0};
    printf("%g\\n", p.sigma);
    return 0;
}
"""


@pytest.mark.skipif(not shutil.which("cc"), reason="there is no C compiler")
def test_a_kernel_in_an_own_program_takes_a_command_and_a_compile(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "softdyn", "generate", "droplet", "--target", "c", "-o", "."]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    (tmp_path / "own.c").write_text(PROGRAM, encoding="utf-8")
    subprocess.run(["cc", "droplet.c", "own.c", "-lm", "-o", "own"], cwd=tmp_path, check=True)
    assert subprocess.run([tmp_path / "own"], capture_output=True, text=True, check=True).stdout == "1\n"
