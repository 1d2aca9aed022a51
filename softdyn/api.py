"""What ``import softdyn`` offers, loaded on first use."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, Protocol, cast, overload

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.fitting.fit import fit
from softdyn.fitting.fit_result import Fit
from softdyn.laws import law_of, law_or_closure_of, potential_named
from softdyn.pair.batch import Batch, simulate_batch
from softdyn.pair.pair_run import simulate_pair
from softdyn.results.pair_result import PairResult
from softdyn.results.registry import load_result, scene_of
from softdyn.scene.pair_drive import DRIVES
from softdyn.scene.pair_scene import Scene
from softdyn.scene.pair_scene import read_scene as read_pair_scene
from softdyn.scene.reading import is_fluid_scene, is_particle_scene, is_suspension_scene, read_toml
from softdyn.scene.time_tables import Table
from softdyn.words import suggestion

if TYPE_CHECKING:
    from softdyn.derive import ContactLaw
    from softdyn.derive.closure import Closure
    from softdyn.derive.closure_regimes import ClosureDiagram
    from softdyn.derive.films import Films
    from softdyn.derive.limits import Finding
    from softdyn.derive.potential import Potential
    from softdyn.derive.regimes import Diagram
    from softdyn.fluid import FluidScene
    from softdyn.particles import ParticleScene
    from softdyn.suspension import SuspensionScene

P = ParamSpec("P")

__all__ = [
    "Batch",
    "Fit",
    "PairResult",
    "Scene",
    "Table",
    "check",
    "films",
    "fit",
    "load_result",
    "read_scene",
    "regimes",
    "scene_of",
    "simulate",
    "write_report",
]


def read_scene(path: str | Path) -> Scene | ParticleScene | FluidScene | SuspensionScene:
    """Read a scene file, of two particles, of many, of a fluid, or of grains in one.

    Raises
    ------
    SceneError
        If the file cannot be read, is not TOML (with the line), or holds an unknown or missing key.

    Examples
    --------
    >>> from pathlib import Path
    >>> import softdyn
    >>> text = '''
    ... law = "rognon_gay"
    ... parameters = {R = 1.0, E = 1.0, eta = 1.0}
    ... pair = {h = 1.0}
    ... drive = {force = 0.01}
    ... until = {h = 0.1}
    ... '''
    >>> _ = Path("scene.toml").write_text(text, encoding="utf-8")
    >>> softdyn.simulate(softdyn.read_scene("scene.toml")).h[-1].item()
    0.1
    """
    content = read_toml(Path(path))
    if is_suspension_scene(content):
        from softdyn import suspension

        return suspension.read_scene(path)
    if is_fluid_scene(content):
        from softdyn import fluid

        return fluid.read_scene(path)
    if not is_particle_scene(content):
        return read_pair_scene(path)
    from softdyn import particles

    return particles.read_scene(path)


class _Simulate(Protocol[P]):
    """What :func:`simulate` takes, for type checkers and completion: a scene, or the fields of one."""

    @overload
    def __call__(
        self, scene: Scene | ParticleScene | FluidScene | str | Path, *, progress: Callable[..., None] | None = None
    ) -> Any: ...

    @overload
    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> Any: ...


def _with_fields_of(_: Callable[P, Scene]) -> Callable[[Callable[..., Any]], _Simulate[P]]:
    """Type a function by the fields of a class; it stays what it is."""
    return lambda function: cast(_Simulate[P], function)


@_with_fields_of(Scene)
def simulate(
    scene: Scene | ParticleScene | FluidScene | str | Path | None = None,
    *,
    progress: Callable[..., None] | None = None,
    **keywords: Any,
) -> Any:
    """Simulate a scene, or many at once.

    Parameters
    ----------
    scene : Scene, ParticleScene or FluidScene, or path of a scene file, optional
    progress : function, optional
        Called now and then: with (t, h) during a run, with (runs done, runs) where there are many; of many particles
        with (t, steps, iterations), of a fluid with the residual, too. Only with ``scene``.
    **keywords
        The fields of :class:`softdyn.Scene`, in the place of ``scene``; ``softdyn keys`` tells them. A numpy array, of
        shape (runs,), as h, delta, a force or velocity, a parameter or a constant, here or in a Scene, makes so many
        runs, in one call; several arrays are taken value by value. (A table of forces is a pair of arrays.)

    Returns
    -------
    PairResult, or Batch of many runs; ParticleResult of many particles; FluidResult of a fluid

    Raises
    ------
    SceneError, LawError, CompileError, IntegrationError

    Examples
    --------
    >>> import softdyn
    >>> result = softdyn.simulate(
    ...     law="rognon_gay", parameters={"R": 1, "E": 1, "eta": 1}, h=100, force=1e-2, until_h=1e-3, gaps=6
    ... )
    >>> result.h.round(4)
    array([1.e+02, 1.e+01, 1.e+00, 1.e-01, 1.e-02, 1.e-03])

    Three forces at once; the time at which the gap is 1e-3:

    >>> import numpy as np
    >>> many = softdyn.simulate(
    ...     law="rognon_gay", parameters={"R": 1, "E": 1, "eta": 1}, h=100, force=np.array([1e-6, 1e-4, 1e-2]),
    ...     until_h=1e-3,
    ... )
    >>> many.t.shape
    (3, 1)
    """
    if scene is not None:
        if keywords:
            raise SceneError(f"simulate takes a scene or its fields, not both (here {', '.join(keywords)})")
        given = read_scene(scene) if isinstance(scene, (str, Path)) else scene
        if isinstance(given, Scene):
            return _simulate_fields({field.name: getattr(given, field.name) for field in fields(given)}, progress)
        from softdyn import particles

        if isinstance(given, particles.ParticleScene):
            return particles.simulate(given, progress)
        from softdyn import fluid

        if isinstance(given, fluid.FluidScene):
            from softdyn import suspension

            if isinstance(given, suspension.SuspensionScene):
                return suspension.simulate(given, progress)
            return fluid.simulate(given, progress)
        raise SceneError(f"simulate takes a scene, or the path of a scene file, not {given!r}")
    known = [field.name for field in fields(Scene)]
    for name in keywords:
        if name not in known:
            raise SceneError(f"simulate: unknown keyword {name!r}{suggestion(name, known)}")
    missing = [name for name in ("law", "parameters", "h") if name not in keywords]
    missing += [] if set(DRIVES) & set(keywords) else ["force"]
    if missing:
        raise SceneError(f"simulate needs {', '.join(missing)}")
    return _simulate_fields(keywords, None)


def _simulate_fields(given: dict[str, Any], progress: Callable[..., None] | None) -> Any:
    """One run, or as many as there are values in arrays."""
    varied = _varied(given)
    if varied:
        return simulate_batch(Scene(**_first(given)), varied, progress)
    return simulate_pair(Scene(**given), progress)


#: Numbers of a scene that may be arrays.
VARIABLE = ("h", "delta", "force", "velocity")


def _varied(keywords: dict[str, Any]) -> dict[str, NDArray[np.float64]]:
    """Arrays among the fields of a scene: the values that many runs are to have."""
    given = {name: keywords[name] for name in VARIABLE if name in keywords}
    for field in ("parameters", "constants"):
        if isinstance(keywords.get(field), Mapping):
            given |= keywords[field]
    arrays = {name: value for name, value in given.items() if isinstance(value, np.ndarray) and value.ndim}
    for name, value in arrays.items():
        # complex numbers and masks would lose a part in silence
        real = np.issubdtype(value.dtype, np.floating) or np.issubdtype(value.dtype, np.integer)
        if isinstance(value, np.ma.MaskedArray):
            raise SceneError(f"{name} is a masked array: give those values that are to be run, {name}.compressed()")
        if value.ndim != 1 or not len(value) or not real:
            raise SceneError(
                f"{name} is an array of shape {value.shape} and type {value.dtype}: one row of real numbers is needed"
            )
    lengths = {name: len(value) for name, value in arrays.items()}
    if len(set(lengths.values())) > 1:
        words = ", ".join(f"{length} of {name}" for name, length in lengths.items())
        raise SceneError(f"arrays are taken value by value, and have as many values each; here there are {words}")
    return {name: np.asarray(value, dtype=float) for name, value in arrays.items()}


def _first(keywords: dict[str, Any]) -> dict[str, Any]:
    """Fields of the first of many runs."""

    def one(value: Any) -> Any:
        return float(value[0]) if isinstance(value, np.ndarray) and value.ndim else value

    def each(name: str, value: Any) -> Any:
        if name in ("parameters", "constants") and isinstance(value, Mapping):
            return {key: one(number) for key, number in value.items()}
        return one(value) if name in VARIABLE else value

    return {name: each(name, value) for name, value in keywords.items()}


def check(law: ContactLaw | Closure | Potential | str | Path) -> list[Finding]:
    """Prove or disprove the limits that a law, a closure or a potential claims.

    Parameters
    ----------
    law : ContactLaw, Closure, Potential or str
        Or a stock one's name, ``path/law.py``, or ``path/law.py:name``.

    Returns
    -------
    list of Finding
        Verdict and evidence for each claim.

    Raises
    ------
    LawError, SceneError
        If there is no such law, or if it is faulty.

    Examples
    --------
    >>> import softdyn
    >>> found = softdyn.check("rognon_gay")
    >>> {finding.verdict for finding in found}
    {'proved'}
    """
    potential = potential_named(law)
    if potential is not None:
        from softdyn.derive.potential_limits import check_potential_limits

        return check_potential_limits(potential)
    given: Any = law_or_closure_of(law)  # type: ignore[arg-type]
    if type(given).__name__ == "Closure":
        from softdyn.derive.closure_limits import check_closure_limits

        return check_closure_limits(given)
    from softdyn.findings import limits_of

    return limits_of(given)


@overload
def regimes(law: ContactLaw | str | Path) -> Diagram: ...


@overload
def regimes(law: Closure) -> ClosureDiagram: ...


def regimes(law: ContactLaw | Closure | str | Path) -> Diagram | ClosureDiagram:
    """Find the asymptotic regimes of a law in the plane of gap and force, or of a closure in that of Re and fraction.

    Parameters
    ----------
    law : ContactLaw, Closure or str

    Returns
    -------
    Diagram, or ClosureDiagram of a closure

    Raises
    ------
    LawError, SceneError
        If there is no such law, or if it is faulty.

    Examples
    --------
    >>> import softdyn
    >>> softdyn.regimes("rognon_gay").regime("Poiseuille").forms["zeta"].leading
    6*pi*R**2*eta/h
    """
    given: Any = law_or_closure_of(law)
    if type(given).__name__ == "Closure":
        from softdyn.derive.closure_regimes import discover_closure

        return discover_closure(given)
    from softdyn.findings import regimes_of

    return regimes_of(given)


def films(law: ContactLaw | str | Path) -> Films | None:
    """Find the equilibrium films of a law, their stability and relaxation rates; None if it has no remote force.

    Parameters
    ----------
    law : ContactLaw or str

    Raises
    ------
    LawError, SceneError
        If there is no such law, or if it is faulty.

    Examples
    --------
    >>> import softdyn
    >>> films = softdyn.films("soap_film")
    >>> films.h_eq
    """
    from softdyn.findings import films_of, regimes_of

    return films_of(regimes_of(law_of(law)))


def write_report(law: ContactLaw | Closure | str | Path, path: str | Path) -> None:
    """Write all that is known of a law, or of a closure, as one self-contained web page.

    Parameters
    ----------
    law : ContactLaw, Closure or str
    path : path
        Of the page, .html.

    Raises
    ------
    LawError, SceneError
        If there is no such law, if it is faulty, or if the page cannot be written.

    Examples
    --------
    >>> import softdyn
    >>> softdyn.write_report("einstein", "page.html")
    """
    given: Any = law_or_closure_of(law)
    if type(given).__name__ == "Closure":
        from softdyn.study.closure_page import write_closure_report

        return write_closure_report(given, Path(path))
    from softdyn.study.law_page import write_report as write

    return write(given, Path(path))
