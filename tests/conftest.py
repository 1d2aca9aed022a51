"""What every test shares: a kernel cache of the session's own."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import Phase, settings

from softdyn.targets import c, lammps

# an example that fails is told without being run a few hundred times more, traced: slow ones would take hours
settings.register_profile("untraced", phases=set(Phase) - {Phase.explain})
settings.load_profile("untraced")

# a shell that starts the tests in the background has them ignore interrupts, and so all that they start
signal.signal(signal.SIGINT, signal.default_int_handler)

#: What users compile with.
FLAGS = {target: target.FLAGS for target in (c, lammps)}


@pytest.fixture(autouse=True, scope="session")
def session_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Keep the user's kernel cache out of the tests; subprocesses inherit the variable.

    CI's default and slow tests share one, in $SOFTDYN_TESTS_CACHE.
    """
    base = tmp_path_factory.getbasetemp()
    # one for all processes that share the tests, lest each builds the same kernels
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "softdyn-cache"
    folder = Path(os.environ.get("SOFTDYN_TESTS_CACHE", folder))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOFTDYN_CACHE_DIR", str(folder))
        yield folder


@pytest.fixture(autouse=True, scope="session")
def quick_compiler(request: pytest.FixtureRequest) -> Iterator[None]:
    """Compile kernels of the default run with -O1, in a quarter of the time: most run for less than they compile.

    IEEE arithmetic, without contraction, rounds alike at any level. Slow tests, and what is run as a process of its
    own, compile as users do; so do tests that go on from what such a process did, by ``users_compiler``.
    """
    with pytest.MonkeyPatch.context() as patch:
        if request.config.getoption("markexpr") == "not slow":
            for target, flags in FLAGS.items():
                patch.setattr(target, "FLAGS", tuple("-O1" if flag == "-O3" else flag for flag in flags))
        yield


@pytest.fixture
def users_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compile as users do: a checkpoint belongs to the kernel that it was made with."""
    for target, flags in FLAGS.items():
        monkeypatch.setattr(target, "FLAGS", flags)
