"""How far two laws are from each other: friction, deflection and time of approach over the plane of gap and force.

Both are computed by their kernels, in units of R, E and eta, with their own parameters at typical values; the times by
quadrature. Where both have leading forms in one region of the plane, the ratio of these is exact.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import IntegrationError, SceneError
from softdyn.kernels import Kernel, get_kernel
from softdyn.laws import law_of
from softdyn.pair.quadrature import times_at_gaps
from softdyn.pair.states import deflection, evaluate

if TYPE_CHECKING:
    from softdyn.derive import ContactLaw
    from softdyn.derive.regimes import Regime

Array = NDArray[np.float64]

#: h/R and kappa = F/(E R^2) at which two laws are compared.
GAPS = (1e2, 1e1, 1.0, 1e-1, 1e-2, 1e-3, 1e-4)
KAPPAS = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1)

#: Quantities whose leading forms are compared.
FORMS = ("zeta", "delta", "dh_dt")
#: Decades over which regions of the plane are looked for, h/R and kappa, and points per decade.
REACH = ((-24, 12), (-36, 0))
DENSITY = 2
#: A point is within a regime where each small/large of its conditions is below this: two laws whose crossovers lie at
#: other constants, up to the square of it, then share no point between these.
WITHIN = 1 / 30


@dataclass(frozen=True)
class SharedRegion:
    """A region of the plane in which both laws have leading forms.

    Attributes
    ----------
    first, second : str
        The regimes' names.
    conditions : tuple of str
        What holds in both.
    ratios : dict from str to str
        first/second, for zeta, delta and dh_dt: exact to leading order.
    """

    first: str
    second: str
    conditions: tuple[str, ...]
    ratios: dict[str, str]


@dataclass(frozen=True)
class Comparison:
    """Ratios first/second of two laws, in compression.

    Attributes
    ----------
    first, second : str
    parameters : dict from str to float
        In units of R, E and eta.
    gaps, kappas : tuple of float
    zeta, delta, time : tuples of rows, one for each kappa, of one ratio for each gap
        ``time`` is that from the first gap on, under constant force; None where one of the laws has no such value.
    reasons : tuple of str
        Why values are missing.
    regions : tuple of SharedRegion
    """

    first: str
    second: str
    parameters: dict[str, float]
    gaps: tuple[float, ...]
    kappas: tuple[float, ...]
    zeta: tuple[tuple[float | None, ...], ...]
    delta: tuple[tuple[float | None, ...], ...]
    time: tuple[tuple[float | None, ...], ...]
    reasons: tuple[str, ...]
    regions: tuple[SharedRegion, ...]

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain data."""
        return asdict(self)

    def text(self) -> str:
        """Return tables of the ratios."""
        return "\n".join(_lines(self)) + "\n"


def compare(first: Any, second: Any, gaps: Sequence[float] = GAPS, kappas: Sequence[float] = KAPPAS) -> Comparison:
    """Compare two laws over the plane of gap and force.

    Parameters
    ----------
    first, second : str, Path or ContactLaw
        Names of stock laws, law files, or laws.
    gaps : sequence of float
        h/R, in the order of approach; the time runs from the first on.
    kappas : sequence of float
        F/(E R^2) > 0.

    Returns
    -------
    Comparison

    Raises
    ------
    LawError, SceneError, CompileError
        SceneError if the gaps or the forces are none of the kind, if a law lacks friction or deflection, or if a
        parameter of one name means different things in the two laws.
    """
    if len(gaps) < 2 or not all(0 < low < high for high, low in itertools.pairwise(gaps)):
        raise SceneError(f"compare: gaps must be two or more, positive and falling, not {list(gaps)}")
    if not kappas or not all(kappa > 0 for kappa in kappas):
        raise SceneError(f"compare: kappas must be positive, not {list(kappas)}")
    laws = [law_of(law) for law in (first, second)]
    parameters = _parameters(laws)
    tables = [_table(law, parameters, gaps, kappas) for law in laws]
    values: dict[str, Any] = {
        name: tuple(_ratios(one, other) for one, other in zip(*(table[name] for table in tables), strict=True))
        for name in ("zeta", "delta", "time")
    }
    return Comparison(
        laws[0].name,
        laws[1].name,
        parameters,
        tuple(gaps),
        tuple(kappas),
        **values,
        reasons=tuple(reason for table in tables for reason in table["reasons"]),
        regions=tuple(_shared_regions(*laws)),
    )


def comparison_text(first: Any, second: Any) -> str:
    """Compare two laws; the result as text."""
    return compare(first, second).text()


def _parameters(laws: Sequence[ContactLaw]) -> dict[str, float]:
    """Typical values of all parameters of the laws; those that several laws have are the same."""
    from softdyn.derive.law import is_dry, is_rigid
    from softdyn.derive.symbols import COMMON_PARAMETERS
    from softdyn.study.plane import parameter_values

    found: dict[str, float] = {symbol.name: 1.0 for symbol in COMMON_PARAMETERS}
    dimensions: dict[str, Any] = {}
    for law in laws:
        if is_dry(law) or is_rigid(law):
            raise SceneError(f"compare: {law.name} has no {'friction' if is_dry(law) else 'deflection'} to compare")
        for symbol, dimension in law.parameters.items():
            if dimensions.setdefault(symbol.name, dimension) != dimension:
                raise SceneError(
                    f"compare: the parameter {symbol.name} is a {dimensions[symbol.name]} in {laws[0].name}, and a "
                    f"{dimension} in {law.name}; rename one of them"
                )
        for symbol, value in parameter_values(law).items():
            found.setdefault(symbol.name, value)
    return found


def _table(
    law: ContactLaw, parameters: dict[str, float], gaps: Sequence[float], kappas: Sequence[float]
) -> dict[str, Any]:
    """Values of zeta, delta and the time at each force (rows) and gap; nan where there are none, and why."""
    kernel = get_kernel(law, outputs=("zeta", "dh_dt"))
    p = np.array([parameters[name] for name in kernel.parameters])
    h = np.array(gaps, dtype=float)
    rows: dict[str, list[Any]] = {"zeta": [], "delta": [], "time": [], "reasons": []}
    for kappa in kappas:
        F = np.full(len(h), float(kappa))
        delta = deflection(kernel, h, F, p)
        rows["delta"].append(delta)
        rows["zeta"].append(evaluate(kernel, h, delta, {"F": F, "dF_dt": np.zeros(len(h))}, p)["zeta"])
        times, reason = _times(kernel, p, float(kappa), h)
        rows["time"].append(times)
        if reason:
            rows["reasons"].append(f"{law.name}, kappa = {kappa:g}: {reason}")
    return rows


def _times(kernel: Kernel, p: Array, kappa: float, h: Array) -> tuple[Array, str]:
    """Times from the first gap to each, as far as the approach goes, and what ends it."""
    times = np.full(len(h), math.nan)
    total = 0.0
    for i, (start, end) in enumerate(itertools.pairwise(h)):
        try:
            total += times_at_gaps(kernel, p, kappa, np.array([start, end]))[0][1]
        except IntegrationError as error:
            return times, str(error)
        times[i + 1] = total
    return times, ""


def _ratios(one: Array, other: Array) -> tuple[float | None, ...]:
    return tuple(float(ratio) if math.isfinite(ratio) else None for ratio in one / other)


# ------------------------------------------------------------------------------------------------ where both are known


def _shared_regions(first: ContactLaw, second: ContactLaw) -> Iterator[SharedRegion]:
    """Regions of the plane that a regime of one law shares with a regime of the other."""
    from sympy import powsimp

    from softdyn.findings import regimes_of

    diagrams = [regimes_of(law) for law in (first, second)]
    X, Y = (np.arange(low * DENSITY, high * DENSITY + 1) / DENSITY for low, high in REACH)
    gaps, forces = (10.0**grid for grid in np.meshgrid(X, Y))
    within = [
        [(regime, _holds(diagram.law, regime, gaps, forces)) for regime in _of_the_model(diagram.regimes)]
        for diagram in diagrams
    ]
    for (one, here), (other, there) in itertools.product(*within):
        if not (here & there).any():
            continue
        ratios = {
            name: str(powsimp(one.forms[name].leading / other.forms[name].leading))
            for name in FORMS
            if name in one.forms and name in other.forms
        }
        conditions = dict.fromkeys(str(condition) for regime in (one, other) for condition in regime.conditions)
        yield SharedRegion(one.name, other.name, tuple(conditions), ratios)


def _of_the_model(regimes: Sequence[Regime]) -> list[Regime]:
    return [regime for regime in regimes if regime.side == "compression" and regime.inside and regime.forms]


def _holds(law: ContactLaw, regime: Regime, gaps: Array, forces: Array) -> NDArray[np.bool_]:
    """Where a regime's conditions hold, and delta < R, at the law's typical parameters."""
    from softdyn.derive.forms import force
    from softdyn.derive.law import typical_values
    from softdyn.derive.symbols import COMMON_PARAMETERS, h
    from softdyn.study.plane import vectorised

    units = {**dict.fromkeys(COMMON_PARAMETERS, 1), **typical_values(law)}
    ratios = [condition.ratio for condition in regime.conditions]
    if "delta" in regime.forms:
        ratios.append(regime.delta)
    holds = np.ones(gaps.shape, dtype=bool)
    for ratio in ratios:
        holds &= vectorised((h, force), ratio.subs(units))(gaps, forces) < WITHIN
    return holds


# ---------------------------------------------------------------------------------------------------------------- text

TITLES = {
    "zeta": "friction zeta",
    "delta": "deflection delta",
    "time": "time to approach, from h/R = {start:g}, at constant force",
}


def _lines(comparison: Comparison) -> Iterator[str]:
    first, second = comparison.first, comparison.second
    yield f"{first}/{second}, in compression"
    own = {name: value for name, value in comparison.parameters.items() if name not in ("R", "E", "eta")}
    if own:
        yield f"in units of R, E and eta: {', '.join(f'{name} = {value:g}' for name, value in own.items())}"
    for name, title in TITLES.items():
        yield ""
        yield title.format(start=comparison.gaps[0])
        yield f"{'kappa':>9} | h/R = " + " ".join(f"{gap:<8g}" for gap in comparison.gaps).rstrip()
        for kappa, row in zip(comparison.kappas, getattr(comparison, name), strict=True):
            cells = (f"{'-':8}" if value is None else f"{value:<8.4g}" for value in row)
            yield f"{kappa:9.0e} |       " + " ".join(cells).rstrip()
    if comparison.reasons:
        yield ""
        yield from (f"no time: {reason}" for reason in comparison.reasons)
    if comparison.regions:
        yield ""
        yield "exact ratios of the leading forms"
    for region in comparison.regions:
        yield f"  {_names(first, second, region)}: {', '.join(region.conditions)}"
        yield from (f"    {name:6} {ratio}" for name, ratio in region.ratios.items())


def _names(first: str, second: str, region: SharedRegion) -> str:
    if region.first == region.second:
        return region.first
    return f"{first} {region.first}, {second} {region.second}"
