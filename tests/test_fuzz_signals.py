"""Runs that are interrupted at any moment: whole files or none, and the same run after --resume."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from softdyn.particles.results import load_particles
from softdyn.results.rerun import differences

SCENE = """law = "rognon_gay"
[parameters]
E = 1.0
eta = 1.0
[packing]
kind = "random"
count = 40
dimension = 2
fraction = 0.8
radii = [1.0, 1.4]
seed = 1
[contacts]
gap = 0.02
range = 0.5
[flow]
shear_rate = 1e-4
drag = 1.0
[until]
strain = 0.2
[output]
times = 5
[accuracy]
rtol = 1e-3
"""


@pytest.mark.slow
def test_a_run_that_is_stopped_at_any_moment_goes_on_to_the_same_end(tmp_path: Path) -> None:
    """SIGINT and SIGTERM by turns, until it is through; then its result is that of a run without a stop, to the bit."""
    (tmp_path / "scene.toml").write_text(SCENE, encoding="utf-8")
    command = [sys.executable, "-m", "softdyn", "run", "scene.toml", "-o"]
    began = time.monotonic()
    subprocess.run([*command, "whole.npz"], cwd=tmp_path, check=True, capture_output=True)
    took, random = time.monotonic() - began, np.random.default_rng(7)
    for attempt in range(12):
        run = subprocess.Popen(
            [*command, "stopped.npz", "--resume"],
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        time.sleep(took * random.uniform(0.05, 1.0))
        run.send_signal(signal.SIGINT if attempt % 2 else signal.SIGTERM)
        _, said = run.communicate(timeout=120)
        assert "Traceback" not in said or run.returncode < 0, said
        leftovers = {path.name for path in tmp_path.iterdir()}
        assert leftovers <= {"scene.toml", "whole.npz", "stopped.npz", "stopped.checkpoint.npz", "stopped.frames"}, (
            leftovers
        )
        if run.returncode == 0:
            break
    else:
        subprocess.run([*command, "stopped.npz", "--resume"], cwd=tmp_path, check=True, capture_output=True)
    whole, stopped = load_particles(tmp_path / "whole.npz"), load_particles(tmp_path / "stopped.npz")
    assert differences(whole, stopped) == {}
    assert {path.name for path in tmp_path.iterdir()} == {"scene.toml", "whole.npz", "stopped.npz"}
