"""Fitting a law to curves that were measured."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from softdyn.errors import SceneError
from softdyn.fitting.curve_data import ERROR, FLOW_COLUMNS, LENGTH, PAIR_COLUMNS, STIFFNESS, CurveData, read_curve
from softdyn.fitting.fit_result import Fit
from softdyn.fitting.least_squares import (
    LOSSES,
    Direction,
    Model,
    Parameter,
    Profile,
    Solution,
    profile,
    solve,
    undetermined,
)
from softdyn.fitting.pair_model import (
    OF_DRIVE,
    PairModel,
    curves_of,
    free_parameters,
    plain_numbers,
    scene_fields,
    sigma_of,
    static_parameters,
)
from softdyn.fitting.static_model import SHIFT, StaticModel
from softdyn.scene.pair_scene import Scene
from softdyn.scene.units import Powers, in_base_units
from softdyn.words import suggestion

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw

Array = NDArray[np.float64]

#: What drives where nothing moves.
STATIC = "static"

#: Laws of flow, by the names that a command line likes.
FLOW_LAWS = {"herschel-bulkley": "Herschel-Bulkley", "power-law": "power law"}
#: Odds by which a fit is off by chance; one that is less likely than that does not describe the data.
BY_CHANCE = 1e-6
#: Rates of a curve of a law of flow.
LINES = 200


def fit(
    law: Any,
    data: Any,
    *,
    free: Sequence[str] | Mapping[str, tuple[float, float] | None] | None = None,
    parameters: Mapping[str, Any] | None = None,
    h: Any = None,
    drive: Mapping[str, Any] | str | None = None,
    delta: Any = None,
    constants: Mapping[str, Any] | None = None,
    loss: str = "linear",
    profiles: bool = True,
    target: str = "auto",
) -> Fit:
    """Fit a law to curves that were measured, and tell how well each parameter is known.

    Trajectories are integrated, with their derivatives by the parameters (:mod:`softdyn.pair.sensitivities`), and the
    sum of the squares of what the data differ by, in standard errors, is made least.

    Parameters
    ----------
    law : ContactLaw, str, Path or Scene
        A law of contacts, a scene of two particles, which has all that follows, or a law of flow: "herschel-bulkley" or
        "power-law".
    data : path, mapping from str to array, or list of these
        A table with headings, as ``t [s]``, ``F [nN]``, or arrays by such names: t, and at least one of h, X, delta, a
        and F; standard errors as F_error, where they are known. Where a heading has a unit, numbers become those of SI
        units. Several curves are fitted at once. Of a flow curve: rate, stress and stress_error. Where nothing moves: h
        and F.
    free : list of str, or mapping from str to (low, high) or None
        What is fitted: parameters of the law, "h" and "delta" at the start (of each curve its own), "stiffness" of a
        spring, a "force", "velocity" or "position" that is a number, constants of the drive; where nothing moves,
        "shift", which is added to the gaps of a curve.
    parameters : mapping from str to number
        Of the law; where the fit starts, of those that are free. With units, "50 um", or in the units of the data.
        Parameters that are not given have the law's typical values if they are free.
    h : number
        Gap at the start, or one for each curve.
    drive : mapping, or "static"
        What drives the pair, one of force, velocity, position and spring, as a scene has it; or the name of a column:
        ``{"spring": {"stiffness": "0.05 N/m", "base": "Z"}}``, "-Z" if Z grows on approach. A position or a base that
        is a column counts from its first row, where the pair is at the gap h, not deflected. With ``"speed"``, of a
        base or a position that is a column, no column of times is needed. "static": nothing moves, and at each gap h
        the law has one force F.
    delta : number
        Deflection at the start, if the drive is a velocity.
    constants : mapping from str to number
        Of expressions in the drive.
    loss : "linear", "soft_l1", "huber" or "cauchy"
        All but the first give less weight to points that are far off.
    profiles : bool
        Whether to find the intervals by profiles, which takes as long again, and more.
    target : "auto", "c" or "numba"

    Returns
    -------
    Fit

    Raises
    ------
    SceneError, LawError, CompileError, IntegrationError

    Examples
    --------
    The viscosity, from how fast a film drains:

    >>> import softdyn
    >>> spheres = {"R": 1.0, "E": 1.0, "eta": 1.0}
    >>> run = softdyn.simulate(
    ...     law="rognon_gay", parameters=spheres, h=0.1, force=1e-3, until_t=1e5, times=[0, 2e4, 4e4, 6e4, 8e4, 1e5]
    ... )
    >>> found = softdyn.fit(
    ...     "rognon_gay", {"t": run.t, "h": run.h}, free=["eta"], parameters={**spheres, "eta": 2.0}, h=0.1,
    ...     drive={"force": 1e-3},
    ... )
    >>> round(found.values["eta"], 6)
    1.0
    """
    if loss not in LOSSES:
        raise SceneError(f"loss must be one of {', '.join(LOSSES)}, not {loss!r}")
    several = list(data) if isinstance(data, (list, tuple)) else [data]
    if not several:
        raise SceneError("there are no data to fit")
    if isinstance(law, str) and law.lower().replace(" ", "-") in FLOW_LAWS:
        given = (free, parameters, h, drive, delta, constants)
        if any(one is not None for one in given):
            raise SceneError(f"{law}: all parameters of a law of flow are fitted, and nothing else is given")
        return _fit_flow(FLOW_LAWS[law.lower().replace(" ", "-")], several, loss, profiles)
    scene = {} if not isinstance(law, Scene) else scene_fields(law)
    told = {"parameters": parameters, "h": h, "delta": delta, "constants": constants, "target": target}
    if free is None:
        raise SceneError("free names what is fitted, as free=['A', 'h']")
    if drive == STATIC:
        if isinstance(law, Scene) or h is not None or delta is not None or constants:
            raise SceneError(f"drive={STATIC!r}: a law, its parameters and {SHIFT} are all that it takes")
        return _fit_static(law, several, free, parameters or {}, loss, profiles)
    if isinstance(drive, str):
        raise SceneError(f"drive is a mapping, as {{'force': 1e-9}}, or {STATIC!r}, not {drive!r}")
    for name in drive or {}:
        if name not in (*OF_DRIVE, "spring", "speed"):
            raise SceneError(f"drive: unknown {name!r}{suggestion(name, ('force', 'velocity', 'position', 'spring'))}")
    given_all = {"law": law, **scene, **{k: v for k, v in told.items() if v is not None}, **(drive or {})}
    return _fit_pair(given_all, several, free, loss, profiles)


def _fit_pair(given: dict[str, Any], data: list[Any], free: Any, loss: str, profiles: bool) -> Fit:
    """A law of contacts, and trajectories."""
    from softdyn.derive.law import parameters_of, plain_ranges
    from softdyn.laws import law_of

    law = law_of(given["law"])
    if given.get("h") is None:
        raise SceneError("a fit needs h, the gap at the start; a guess will do if h is free")
    given, dimensions = _plain(law, given, free)
    numbers = {**given["constants"], **given["parameters"]}
    curves = curves_of(data, given, numbers)
    positive = [symbol.name for symbol in parameters_of(law) if symbol.is_positive]
    parameters, places = free_parameters(free, curves, positive, plain_ranges(law))
    model = PairModel(curves, places)
    measured, sigma, groups = sigma_of(curves)
    solution = solve(model, parameters, measured, sigma, groups, loss)

    units = {}
    if all(curve.data.with_units for curve in curves):
        of_start = dict.fromkeys(("h", "delta"), dimensions["R"]) | OF_DRIVE | {"stiffness": STIFFNESS}
        known = {**of_start, **dimensions}
        units = {shown: in_base_units(known[name]) for shown, (_, name) in places.items() if name in known}
        units = {name: "" if unit.startswith("a number") else unit for name, unit in units.items()}
    arrays: dict[str, Array] = {}
    about = []
    place = 0
    for n, curve in enumerate(curves, start=1):
        arrays[f"t_{n}"] = np.array(curve.scene.times)[curve.order]
        for name in curve.measured:
            end = place + len(curve.order)
            arrays |= _compared(f"{name}_{n}", measured[place:end], solution, slice(place, end))
            place = end
        about.append({"name": curve.data.name, "abscissa": "t", "quantities": list(curve.measured)})
    kept = {name: value for name, value in numbers.items() if name not in places}
    found = _told(model, solution, measured, profiles)
    kernel = next(iter(model.kernels.values()))
    mixed = _mixed([curve.data for curve in curves])
    return _result(kernel.law, kernel.target, kept, solution, found, arrays, about, units, mixed)


def _plain(law: ContactLaw, given: Mapping[str, Any], free: Any) -> tuple[dict[str, Any], dict[str, Powers]]:
    """What is given, as numbers, with typical values of what is free and not given; and the parameters' dimensions."""
    from softdyn.derive.law import dimensions_for, parameters_of, typical_values

    symbols = parameters_of(law)
    dimensions: dict[str, Powers] = {
        symbol.name: (of.mass, of.length, of.time) for symbol, of in dimensions_for(law).items() if symbol in symbols
    }
    unknown = [name for name in given.get("parameters") or {} if name not in dimensions]
    if unknown:
        hints = (f"{name!r} is not a parameter of the law{suggestion(name, list(dimensions))}" for name in unknown)
        raise SceneError(f"[parameters] {', '.join(hints)}")
    made = plain_numbers({**given, "parameters": dict(given.get("parameters") or {})}, dimensions)
    for symbol, value in typical_values(law).items():
        if symbol in symbols and symbol.name in free and symbol.name not in made["parameters"]:
            made["parameters"][symbol.name] = _in_units(float(value), dimensions[symbol.name], made["parameters"])
    return made, dimensions


def _mixed(curves: Sequence[CurveData]) -> tuple[str, ...]:
    """Words about curves of which some columns have units, and some none."""
    return tuple(
        f"{curve.name}: {', '.join(name for name in curve.columns if name not in curve.with_units)} "
        "without a unit, where others have one: taken as in SI units"
        for curve in curves
        if curve.with_units and len(curve.with_units) < len(curve.columns)
    )


def _fit_static(law: Any, data: list[Any], free: Any, given: Mapping[str, Any], loss: str, profiles: bool) -> Fit:
    """A law of contacts where nothing moves: forces at gaps."""
    from softdyn.derive.law import parameters_of, plain_ranges
    from softdyn.laws import law_of

    law = law_of(law)
    given, dimensions = _plain(law, {"parameters": given}, [name for name in free if name != SHIFT])
    columns = {name: PAIR_COLUMNS[name] for name in ("h", "F")}
    curves = [read_curve(one, n, columns, {}) for n, one in enumerate(data, start=1)]
    for curve in curves:
        missing = [name for name in columns if name not in curve.columns]
        if missing:
            raise SceneError(f"data {curve.name}: {' and '.join(missing)} missing: where nothing moves, gap and force")
    # how fast a film drains does not matter, nor what it takes
    needed = {symbol.name for expr in (law.F_ela, law.F_adh, law.a) for symbol in expr.free_symbols}
    symbols = [symbol for symbol in parameters_of(law) if symbol.name in needed]
    numbers = {
        **dict.fromkeys((symbol.name for symbol in parameters_of(law)), math.nan),
        **given["parameters"],
        SHIFT: 0.0,
    }
    missing = [symbol.name for symbol in symbols if math.isnan(numbers[symbol.name])]
    if missing:
        raise SceneError(f"[parameters] {', '.join(missing)} missing: the law {law.name} needs it")
    positive = [symbol.name for symbol in symbols if symbol.is_positive]
    known = {name: value for name, value in numbers.items() if name == SHIFT or name in needed}
    parameters, places = static_parameters(free, known, len(curves), positive, plain_ranges(law))
    model = StaticModel(law, curves, numbers, places)
    measured = np.concatenate([curve.columns["F"] for curve in curves])
    sigma = np.concatenate([_error_of(curve, "F") for curve in curves])
    groups = np.concatenate([np.full(len(curve.columns["F"]), n) for n, curve in enumerate(curves)])
    solution = solve(model, parameters, measured, sigma, groups, loss)
    arrays: dict[str, Array] = {}
    for n, curve in enumerate(curves):
        rows = slice(int(model.starts[n]), int(model.starts[n + 1]))
        arrays[f"h_{n + 1}"] = curve.columns["h"]
        arrays |= _compared(f"F_{n + 1}", measured[rows], solution, rows)
    about = [{"name": curve.name, "abscissa": "h", "quantities": ["F"]} for curve in curves]
    units = {}
    if all(curve.with_units for curve in curves):
        of = {**dimensions, SHIFT: LENGTH}
        units = {shown: in_base_units(of[name]) for shown, (_, name) in places.items()}
        units = {name: "" if unit.startswith("a number") else unit for name, unit in units.items()}
    kept = {name: value for name, value in known.items() if name not in places and name != SHIFT}
    found = _told(model, solution, measured, profiles)
    return _result(law.name, "", kept, solution, found, arrays, about, units, _mixed(curves))


def _in_units(value: float, of: Powers, parameters: Mapping[str, float]) -> float:
    """A typical value, which is told in units of R, E and eta."""
    from softdyn.derive.dimensions import Dimension, powers_of_units

    powers = powers_of_units(Dimension(*of))
    missing = [name for name, power in zip(("R", "E", "eta"), powers, strict=True) if power and name not in parameters]
    if missing:
        raise SceneError(f"[parameters] {', '.join(missing)} is missing: typical values are in units of R, E and eta")
    units = (parameters[name] ** float(power) for name, power in zip(("R", "E", "eta"), powers, strict=True) if power)
    return value * float(math.prod(units))


def _fit_flow(law: str, data: list[Any], loss: str, profiles: bool) -> Fit:
    """A law of flow."""
    from softdyn.rheology.flow_laws import fit_flow_law, parameters_of, stress_and_slopes

    curves = [read_curve(one, n, FLOW_COLUMNS, {}) for n, one in enumerate(data, start=1)]
    for curve in curves:
        missing = [name for name in FLOW_COLUMNS if name not in curve.columns]
        if missing:
            raise SceneError(
                f"data {curve.name}: {' and '.join(missing)} missing; there are {', '.join(curve.columns)}"
            )
        if not (curve.columns["rate"] > 0).all():
            raise SceneError(f"data {curve.name}: rates must be positive")
    rates = np.concatenate([curve.columns["rate"] for curve in curves])
    measured = np.concatenate([curve.columns["stress"] for curve in curves])
    sigma = np.concatenate([_error_of(curve, "stress") for curve in curves])
    groups = np.concatenate([np.full(len(curve.columns["rate"]), n) for n, curve in enumerate(curves)])
    size = float(np.abs(measured).max())
    guess = fit_flow_law(law, rates, measured, np.where(np.isnan(sigma), 0.01 * size, sigma))
    parameters = [_flow_parameter(str(symbol), guess.values[str(symbol)]) for symbol in parameters_of(law)]

    def model(values: Array) -> tuple[Array, Array]:
        return stress_and_slopes(law, rates, values)

    solution = solve(model, parameters, measured, sigma, groups, loss)
    arrays: dict[str, Array] = {}
    place = 0
    for n, curve in enumerate(curves, start=1):
        end = place + len(curve.columns["rate"])
        arrays[f"rate_{n}"] = curve.columns["rate"]
        arrays |= _compared(f"stress_{n}", measured[place:end], solution, slice(place, end))
        place = end
    about = [{"name": curve.name, "abscissa": "rate", "quantities": ["stress"]} for curve in curves]
    units = {}
    if all(curve.with_units for curve in curves):
        units = {"sigma_y": "Pa", "K": f"Pa s^{solution.values['n']:.3g}"}
    return _result(law, "", {}, solution, _told(model, solution, measured, profiles), arrays, about, units, ())


def _error_of(curve: CurveData, name: str) -> Array:
    return curve.columns.get(f"{name}{ERROR}", np.full(len(curve.columns[name]), math.nan))


def _flow_parameter(name: str, value: float) -> Parameter:
    """A yield stress may be none, and then comes out on either side of 0; the others are positive."""
    return Parameter(name, value, by_log=False) if name == "sigma_y" else Parameter(name, max(value, 1e-300), low=0.0)


def _compared(name: str, measured: Array, solution: Solution, rows: slice) -> dict[str, Array]:
    return {name: measured, f"{name}_fit": solution.fitted[rows], f"{name}_error": solution.sigma[rows]}


def _told(model: Model, solution: Solution, measured: Array, profiles: bool) -> dict[str, Profile]:
    """Profiles of all parameters, if they are asked for."""
    names = [one.name for one in solution.parameters]
    return {name: profile(model, solution, measured, i) for i, name in enumerate(names)} if profiles else {}


def _misfit(solution: Solution) -> list[str]:
    """Words on a fit that is further off than errors of the data explain."""
    if solution.estimated or solution.loss != "linear" or not solution.dof:
        return []
    if chi2.sf(solution.chi2, solution.dof) >= BY_CHANCE:
        return []
    return [
        f"the law does not describe the data within their errors: chi2/dof is {solution.chi2 / solution.dof:.3g}, and "
        "errors and intervals of the parameters mean little; look at what is left over, at units, and at what is held"
    ]


def _result(
    law: str,
    target: str,
    kept: Mapping[str, float],
    solution: Solution,
    profiles: Mapping[str, Profile],
    arrays: dict[str, Array],
    curves: list[dict[str, Any]],
    units: Mapping[str, str],
    warnings: tuple[str, ...],
) -> Fit:
    names = tuple(one.name for one in solution.parameters)
    intervals = {**solution.intervals(), **{name: (one.low, one.high) for name, one in profiles.items()}}
    for name, one in profiles.items():
        arrays |= {f"profile_{name}": one.values, f"profile_{name}_chi2": one.rise}
    scale = np.array(
        [one.outer(float(x)) if one.by_log else 1.0 for one, x in zip(solution.parameters, solution.x, strict=True)]
    )
    bounds = [
        f"{name} is at a bound, {solution.values[name]:.4g}: its error says little" for name in solution.at_bounds
    ]
    return Fit(
        law=law,
        target=target,
        parameters=dict(kept),
        names=names,
        values=solution.values,
        errors=solution.errors,
        intervals=intervals,
        covariance=solution.covariance * np.outer(scale, scale),
        chi2=solution.chi2,
        dof=solution.dof,
        undetermined=tuple(direction_words(moved, known) for moved, known in undetermined(solution)),
        warnings=(*warnings, *bounds, *_misfit(solution)),
        about={
            "curves": curves, "loss": solution.loss, "evaluations": solution.evaluations,
            "estimated": solution.estimated, "units": dict(units),
            "linear": [one.name for one in solution.parameters if not one.by_log],
        },
        arrays=arrays,
    )  # fmt: skip


#: A factor larger than this is not told: the error is of the linearised problem.
LARGEST_FACTOR = 100.0
#: A smaller change is told in per cent.
SMALL_CHANGE = 0.5


def direction_words(moved: Direction, known: Direction | None) -> str:
    """Words for a direction that the data do not determine, and for what they do of the same parameters."""
    changes = [_change(name, moved.error * power) for name, power in moved.powers.items()]
    alone = len(changes) == 1
    words = f"{changes[0]} changes" if alone else f"{', '.join(changes[:-1])} and {changes[-1]}, together, change"
    words = f"{words} chi2 by 1 only"
    if known is None:
        return words
    product = " ".join(name if power == 1 else f"{name}^{power:.3g}" for name, power in known.powers.items())
    return f"{words}; known is {product}, to {100 * known.error:.2g} %"


def _change(name: str, size: float) -> str:
    """Words for a change of a logarithm."""
    way = "up" if size > 0 else "down"
    if abs(size) < SMALL_CHANGE:
        return f"{name} {way} by {100 * abs(math.expm1(size)):.2g} %"
    factor = f"{math.exp(abs(size)):.2g}" if abs(size) < math.log(LARGEST_FACTOR) else f"more than {LARGEST_FACTOR:g}"
    return f"{name} {way} by a factor of {factor}"
