"""Adding a target is adding a module and a folder of templates: here one that Python runs as it is."""

from __future__ import annotations

import math
import pkgutil
from pathlib import Path

import numpy as np
import pytest

from softdyn import kernels, targets, templates
from softdyn.derive import emit
from softdyn.derive.averaged_flow import averaged_flow
from softdyn.derive.contact_equations import ContactNeeds
from softdyn.derive.contact_kernel import contact_ir
from softdyn.elements import assembled, assembly, get_element_kernel
from softdyn.kernels import get_kernel
from softdyn.laws import law_of

MODULE = '''
"""Kernels in plain Python, for a test."""

import types

SUFFIX = ".txt"


def translate(body):
    return body


def available():
    return True


def identity():
    return {"toy": 1}


def build(name, source, made_by, functions):
    return {f"{name}{SUFFIX}": source.encode()}


def check(folder, name, functions):
    pass


def load(folder, name, functions, later=()):
    module = types.ModuleType(name)
    exec((folder / f"{name}{SUFFIX}").read_text(encoding="utf-8"), vars(module))
    return {function: getattr(module, f"{name}_{function}") for function in functions}
'''
TEMPLATE = '''"""{{ header }}"""
from __future__ import annotations
from math import *
from numpy import array as table, empty


def jit(function):
    return function


{{ body }}
'''


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    (tmp_path / "modules").mkdir()
    (tmp_path / "modules" / "plain.py").write_text(MODULE, encoding="utf-8")
    folder = tmp_path / "templates" / "plain"
    folder.mkdir(parents=True)
    for name in ("pair", "contacts", "elements"):
        (folder / f"{name}.txt.j2").write_text(TEMPLATE, encoding="utf-8")
    monkeypatch.setenv("SOFTDYN_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(targets, "__path__", [*targets.__path__, str(tmp_path / "modules")])
    monkeypatch.setattr(templates, "__path__", [*templates.__path__, str(tmp_path / "templates")])
    monkeypatch.setattr(kernels, "TARGETS", (*targets.TARGETS, "plain"))
    emit._environment.cache_clear()
    return "plain"


def test_the_list_of_targets_is_that_of_their_modules() -> None:
    assert {"c", "numba"} <= set(targets.TARGETS)
    assert sorted(targets.TARGETS + targets.PLUGINS) == sorted(m.name for m in pkgutil.iter_modules(targets.__path__))
    names = ("SUFFIX", "translate", "available", "identity", "build", "check", "load")
    assert all(
        hasattr(targets.target_module(target), name) for target in targets.TARGETS + targets.PLUGINS for name in names
    )


@pytest.mark.slow
def test_a_module_and_a_folder_of_templates_make_a_target(toy: str) -> None:
    """Its kernel gives the numbers of C's, bit for bit where no function of a library is called."""
    law = law_of("rognon_gay")
    h, force, p = np.geomspace(1e-6, 1.0, 9), np.full(9, 1e-3), np.ones(3)
    found = []
    for target in (toy, "c"):
        kernel = get_kernel(law, target, drive="table", outputs=("a", "zeta", "C", "D"))
        delta, out = np.full(9, math.nan), np.empty(4 * 9)
        kernel.functions.solve_delta(9, h, force, p, delta)
        kernel.functions.evaluate(9, h, delta, p, out)
        found.append(np.append(delta, out))
    assert np.array_equal(*found)
    form, given = averaged_flow(2, 1), []
    at, draw = np.array([[0.0, 0.0], [1.0, 0.2], [0.1, 0.9], [1.1, 1.2]]), np.random.default_rng(1).uniform
    corners, x, q, p = np.array([[0, 1, 2], [1, 3, 2]]), draw(0.5, 1.0, 12), draw(0.5, 1.0, 28), draw(0.5, 1.0, 3)
    for target in (toy, "c"):
        one = get_element_kernel(form, target)
        residual, matrix = assembled(one, assembly(one, at, corners, {1: corners}), x, q, p)
        given.append(np.append(residual, matrix.data))
    assert np.array_equal(*given)
    written = emit.write(contact_ir(law, ContactNeeds()), toy)
    assert written.suffix == ".txt"
    assert list(written.functions) == ["contacts", "state", "energy"]
    assert "def rognon_gay_contacts(" in written.text
