"""What every test shares: a kernel cache of the session's own."""

from __future__ import annotations

import os
import shutil
import signal
import tempfile
from collections.abc import Iterator

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


def pytest_configure(config: pytest.Config) -> None:
    """Keep the user's kernel cache out of the tests, from their collection on; subprocesses inherit the variable.

    One for all processes that share the tests, lest each builds the same kernels. CI's default and slow tests share
    one, in $SOFTDYN_TESTS_CACHE.
    """
    if "PYTEST_XDIST_WORKER" in os.environ:
        return
    folder = os.environ.get("SOFTDYN_TESTS_CACHE")
    if folder is None:
        folder = tempfile.mkdtemp(prefix="softdyn-tests-")
        # libraries that are loaded stay on Windows
        config.add_cleanup(lambda: shutil.rmtree(folder, ignore_errors=True))
    os.environ["SOFTDYN_CACHE_DIR"] = folder


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
