"""From a law and what a scene needs to a loaded kernel.

Input: a law, the scene's needs, a target. Output: a :class:`Kernel`. Two caches stand in between: manifests, from the
request to the generated source, spare the derivation (and the import of sympy); entries, from the source to the
compiled kernel, spare the compilation.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache as memoize
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import softdyn
from softdyn import cache
from softdyn.errors import SceneError
from softdyn.laws import LawReference, digest, find, package_folder
from softdyn.scene.numbers import Range
from softdyn.targets import PLUGINS, TARGETS, LoadError, target_module

#: Functions of a kernel by their names, as attributes.
Functions = SimpleNamespace


@dataclass(frozen=True)
class Kernel:
    """A loaded kernel and what is known of it.

    Attributes
    ----------
    law, target : str
    fingerprint : str
        Digest of the law's equations.
    parameters : tuple of str
        What its array ``p`` holds.
    outputs, inputs : tuple of str
        What ``evaluate`` computes, and of what besides h and delta.
    components : int
        Of the state: ln h, and delta unless the force is given.
    width : int
        Numbers that describe a step.
    key : str
        Its name in the cache.
    path : Path
        Its source.
    compile_s : float
        Time spent on deriving, building and loading it.
    functions : namespace
        ``evaluate(n, h, delta, *inputs, p, out)``, ``solve_delta(n, h, F, p, delta)``,
        ``drive(n, t, *drive, value, rate)``, ``integrate(t_end, u_stop, rtol, p, *drive, capacity, state, steps)``,
        ``passages(n, u, at, steps, out)``, ``sample(n, t, stored, steps, out)`` and
        ``runs(n, count, at_gaps, settings, runs, targets, *table, out)``.
    dry : bool
        Whether the law is that of a dry contact: no gap, no friction.
    pressed_only : bool
        Whether the law says nothing of surfaces that are pulled, delta < 0.
    tabulated : bool
        Whether the law has splines through points, which have a range.
    kinked : bool
        Whether the law has kinks or jumps elsewhere than at delta = 0, where steps end anyway.
    ranges : mapping from str to (low, high, whether low is left out, whether high is)
        Within which some of the parameters must lie; others are positive, if ``positive`` names them.
    """

    law: str
    target: str
    fingerprint: str
    parameters: tuple[str, ...]
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    components: int
    width: int
    key: str
    path: Path
    compile_s: float
    functions: Functions
    positive: tuple[str, ...]
    dry: bool
    pressed_only: bool
    tabulated: bool
    kinked: bool
    ranges: Mapping[str, Range]


#: Functions of kernels that this process has loaded, and how their entries then stood.
_functions: dict[Path, tuple[cache.Stand | None, Functions]] = {}


def choose_target(target: str) -> str:
    """Resolve "auto": C where there is a compiler, else numba, which is said on stderr.

    Raises
    ------
    SceneError
        If the target is unknown.
    """
    if target in TARGETS:
        return target
    if target in PLUGINS:
        raise SceneError(f"target {target!r} runs scenes of many particles: softdyn run SCENE --engine {target}")
    if target != "auto":
        raise SceneError(f"unknown target {target!r}; there are auto, {', '.join(TARGETS)}")
    from softdyn.targets import c

    if c.available():
        return "c"
    print("softdyn: no C compiler found ($CC, cc, gcc, clang); using numba", file=sys.stderr)
    return "numba"


def get_kernel(
    law: Any,
    target: str = "auto",
    *,
    drive: str | tuple[Any, ...] = "constant",
    control: str = "force",
    deflection: str = "either",
    fixed: Mapping[str, str] | None = None,
    outputs: tuple[str, ...] = ("a", "X"),
    sensitive: tuple[str, ...] = (),
) -> Kernel:
    """Kernel of a law for a scene's needs, from the cache or made now.

    Parameters
    ----------
    law : str, Path or ContactLaw
        A stock law's name, a law file, or a law.
    target : "auto", "c" or "numba"
    drive, control, deflection, fixed, outputs, sensitive
        See :class:`softdyn.derive.pair_equations.Needs`.

    Raises
    ------
    LawError, SceneError, CompileError
    """
    start = time.perf_counter()
    target = choose_target(target)
    needs = {
        "drive": drive,
        "control": control,
        "deflection": deflection,
        "fixed": dict(fixed or {}),
        "outputs": outputs,
        "sensitive": sensitive,
    }
    manifest = manifest_of(find(law), target, needs, "manifest", make_manifest)
    key, entry, functions = loaded(target, manifest)
    return Kernel(
        law=manifest["name"],
        target=target,
        fingerprint=manifest["fingerprint"],
        parameters=tuple(manifest["parameters"]),
        outputs=tuple(manifest["outputs"]),
        inputs=tuple(manifest["inputs"]),
        components=manifest["components"],
        width=manifest["width"],
        key=key,
        path=entry / f"{manifest['name']}{manifest['suffix']}",
        compile_s=time.perf_counter() - start,
        functions=functions,
        positive=tuple(manifest["positive"]),
        dry=manifest["dry"],
        pressed_only=manifest["pressed_only"],
        tabulated=manifest["tabulated"],
        kinked=manifest["kinked"],
        ranges=manifest["ranges"],
    )


def loaded(target: str, manifest: Mapping[str, Any]) -> tuple[str, Path, Functions]:
    """Build a kernel, or find it in the cache, and load it: once in a process, while its entry stands as it did.

    An entry is published after it was seen to load, in a process of its own; one that does not load is made anew, once.

    Parameters
    ----------
    target : str
    manifest : mapping
        With ``name``, ``source``, ``functions``, the signatures of what the kernel must have, each as
        ``name_function``, and maybe ``later``, those of which few scenes have a use.

    Returns
    -------
    key : str
    entry : Path
    functions : namespace

    Raises
    ------
    CompileError, SceneError
    """
    back_end = target_module(target)
    name, source, made_by, functions = manifest["name"], manifest["source"], back_end.identity(), manifest["functions"]
    key = _key_of(source, made_by)

    def load(entry: Path) -> tuple[str, Path, Functions]:
        stand, known = cache.found_as(entry), _functions.get(entry)
        if stand is None or known is None or known[0] != stand:
            found = back_end.load(entry, name, functions, manifest.get("later", ()))
            known = _functions[entry] = stand, Functions(**found)
        return key, entry, known[1]

    entry = cache.read(target, key)
    if entry is not None:
        try:
            if not cache.note(entry).get("loads"):
                back_end.check(entry, name, tuple(functions))
            return load(entry)
        except LoadError:
            cache.evict(target, key)
    files = back_end.build(name, source, made_by, tuple(functions))
    return load(cache.publish(target, key, files, {"made_by": made_by, "loads": True}))


#: Keys of kernels by their sources, with what they are made by.
_keys: dict[str, tuple[Mapping[str, Any], str]] = {}


def _key_of(source: str, made_by: Mapping[str, Any]) -> str:
    """Key of a compiled kernel. A digest of the source and of all macros of a compiler takes longer than a short run.

    What a kernel is made by is looked up once in a process, and is the same object ever after.
    """
    known = _keys.get(source)
    if known is None or known[0] is not made_by:
        known = _keys[source] = made_by, cache.key_of(source, made_by)
    return known[1]


@memoize
def tool_digest() -> str:
    """Digest of what writes kernels: the derivation stage, the templates, what asks them, and the versions that matter.

    The folders are found as they are imported: beside this file there may be links to them, or none where a checkout
    makes no links.
    """
    here = Path(__file__).parent
    files = {
        f"softdyn/{name}": here / name
        for name in (
            "kernels.py",
            "elements.py",
            "particles/contact_kernels.py",
            "particles/potential_kernels.py",
            "particles/explicit/grain_kernels.py",
            "particles/contact_dynamics/rigid_kernel.py",
            "laws.py",
            "expression.py",
            "enclosure.py",
        )
    }
    files |= {f"softdyn/targets/{path.name}": path for path in (here / "targets").glob("*.py")}
    for package, ending in (("derive", "*.py"), ("templates", "*.j2")):
        folder = package_folder(package)
        files |= {f"{package}/{path.relative_to(folder).as_posix()}": path for path in folder.rglob(ending)}
    total = sha256(f"{softdyn.__version__} sympy {version('sympy')}".encode())
    for name, path in sorted(files.items()):
        total.update(f"\n{name} {digest(path)}".encode())
    return total.hexdigest()


def manifest_of(
    reference: LawReference, target: str, needs: dict[str, Any], kind: str, make: Callable[..., dict[str, Any]]
) -> dict[str, Any]:
    """Return the source of a kernel of a kind, and what must be known to call it: from the cache, or from ``make``.

    Parameters
    ----------
    reference : LawReference
        The law.
    target : str
    needs : dict
        What a scene needs of the kernel, plain data.
    kind : str
        Of kernel.
    make : function of reference, target and needs
        Derives the manifest.
    """
    if reference.law is not None:
        from softdyn.derive.law import law_hash, particles_hash

        identity = ["object", law_hash(reference.law), particles_hash(reference.law)]
    elif reference.path is not None:
        identity = ["file", str(reference.path), reference.name]
    else:
        identity = ["stock", reference.name]
    return kept_manifest(kind, identity, target, needs, lambda: make(reference, target, needs))


def kept_manifest(
    kind: str, identity: Any, target: str, needs: Mapping[str, Any], make: Callable[[], dict[str, Any]]
) -> dict[str, Any]:
    """Return the manifest of what is told by ``identity``: from the cache, while what it depends on stands, or made.

    Parameters
    ----------
    kind : str
        Of kernel.
    identity : plain data
        Tells what the kernel is derived from.
    target : str
    needs : mapping
        What a scene needs of the kernel, plain data.
    make : function
        Derives the manifest, a mapping of plain data; ``depends`` are the files that it depends on, with their digests.
    """
    key = cache.key_of(kind, identity, target, needs, tool_digest())
    entry = cache.read("manifests", key)
    if entry is not None:
        with suppress(OSError):  # another process may replace it in this very moment
            manifest = _manifest_in(entry)
            if all(digest(file) == expected for file, expected in manifest["depends"].items()):
                return manifest
    manifest = make()
    out_of_date = entry is not None
    cache.publish("manifests", key, {"manifest.json": json.dumps(manifest).encode()}, replace=out_of_date)
    return manifest


#: Manifests that this process has read, and how their entries then stood.
_manifests: dict[Path, tuple[cache.Stand | None, dict[str, Any]]] = {}


def _manifest_in(entry: Path) -> dict[str, Any]:
    """The manifest of an entry that was found whole, read once while it stands as it did."""
    stand, known = cache.found_as(entry), _manifests.get(entry)
    if known is None or known[0] != stand:
        known = _manifests[entry] = stand, json.loads((entry / "manifest.json").read_text(encoding="utf-8"))
    return known[1]


def make_manifest(reference: LawReference, target: str, needs: Mapping[str, Any]) -> dict[str, Any]:
    """Derive a kernel, which takes the derivation stage, and so sympy.

    Parameters
    ----------
    reference : LawReference
        The law.
    target : str
    needs : mapping
        Fields of :class:`softdyn.derive.pair_equations.Needs`.
    """
    from softdyn.derive.branches import has_kinks
    from softdyn.derive.checks import pressed_only
    from softdyn.derive.emit import write
    from softdyn.derive.law import expressions, is_dry, parameters_of, plain_ranges
    from softdyn.derive.pair_equations import Needs
    from softdyn.derive.pair_kernel import kernel_ir
    from softdyn.laws import load
    from softdyn.table_ranges import has_tables

    law, depends = load(reference)
    ir = kernel_ir(law, Needs(**needs))
    written = write(ir, target)
    return {
        "name": ir.name,
        "fingerprint": ir.provenance.fingerprint,
        "drive": ir.settings["drive"],
        "constants": ir.settings["constants"],
        "parameters": ir.arrays["p"],
        "outputs": ir.settings["outputs"],
        "inputs": ir.settings["inputs"],
        "components": ir.settings["components"],
        "width": ir.settings["width"],
        "dry": is_dry(law),
        "pressed_only": pressed_only(law),
        "tabulated": has_tables(law),
        "kinked": has_kinks(*expressions(law).values()),
        "positive": [symbol.name for symbol in parameters_of(law) if symbol.is_positive],
        "ranges": plain_ranges(law),
        "savings": [[saving.rule, saving.before, saving.after] for saving in ir.savings],
        "source": written.text,
        "suffix": written.suffix,
        "functions": written.functions,
        "later": ["runs"],
        "depends": depends,
    }
