"""How much of the tool a run of many particles meets: what a newcomer reads who follows one."""

from __future__ import annotations

import sys
from pathlib import Path
from types import FrameType
from typing import Any

import softdyn
from softdyn.particles import ParticleScene, random_packing

#: Functions and methods by name, and their modules; nested functions, comprehensions and lambdas are not counted. Some
#: six of them are met where the cache was made just now alone.
MOST_FUNCTIONS, MOST_MODULES = 232, 46


def packed() -> ParticleScene:
    x, radii, box = random_packing(40, 2, 0.8, [1.0, 1.4], 1)
    return ParticleScene(
        law="rognon_gay", parameters={"E": 1.0, "eta": 1.0}, positions=x, radii=radii, box=list(box), gap=0.02,
        range=0.4, shear_rate=1e-3, drag=1.0, until_t=200.0, rtol=1e-3,
    )  # fmt: skip


def test_a_run_of_a_sheared_packing_meets_few_functions_in_few_modules() -> None:
    """From ``simulate`` to the result, with the kernel in the cache."""
    home, scene = str(Path(softdyn.__file__).parent), packed()
    softdyn.simulate(packed())
    met: set[tuple[str, str]] = set()

    def note(frame: FrameType, event: str, argument: Any) -> None:
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(home) and "<" not in code.co_qualname:
            met.add((code.co_filename, code.co_qualname))

    sys.setprofile(note)
    try:
        softdyn.simulate(scene)
    finally:
        sys.setprofile(None)
    assert len(met) <= MOST_FUNCTIONS, sorted(met)
    assert len({module for module, _ in met}) <= MOST_MODULES, sorted({module for module, _ in met})
