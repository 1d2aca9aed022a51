"""What every test shares: a kernel cache of the session's own."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.fixture(autouse=True, scope="session")
def session_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Keep the user's kernel cache out of the tests; subprocesses inherit the variable."""
    folder = tmp_path_factory.mktemp("softdyn-cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOFTDYN_CACHE_DIR", str(folder))
        yield folder
