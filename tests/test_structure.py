"""Structure by freud, as the page on many particles shows it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

PAGE = Path(__file__).parent.parent / ".docs" / "particles.md"


@pytest.mark.slow
def test_a_lattice_has_its_structure_by_freud() -> None:
    """g(r) is 0 below the distance of neighbours, and peaks there; each particle's sixfold order is 1."""
    pytest.importorskip("freud", reason="freud-analysis is not installed")
    section = PAGE.read_text(encoding="utf-8").split("## Structure, by freud")[1]
    (code,) = re.findall(r"```py\n(.*?)```", section, flags=re.DOTALL)
    names: dict[str, Any] = {}
    exec(compile(code, str(PAGE), "exec"), names)
    np.testing.assert_allclose(names["psi6"], 1.0, rtol=1e-4)
    at, g = names["rdf"].bin_centers, names["rdf"].rdf
    width = at[1] - at[0]
    first = at[np.flatnonzero(g)[0]]
    assert abs(first - 1.96) <= width
    # six neighbours in the first peak: 2 pi r n g(r) dr
    density = 2 / (np.sqrt(3) * 1.96**2)
    near = at < 2.5
    assert np.sum(2 * np.pi * at[near] * density * g[near] * width) == pytest.approx(6, rel=0.02)
