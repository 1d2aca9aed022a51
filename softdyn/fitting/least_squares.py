"""Least squares with what they tell: errors, correlations, profiles, and what the data do not determine.

Positive parameters are fitted by their logarithm: their errors are relative, they cannot become negative, and nothing
depends on units. Known errors of the data are taken as they are; unknown ones are estimated from the residuals, of each
quantity of each curve by itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import IntegrationError, SceneError

Array = NDArray[np.float64]
#: What a model gives at values of the parameters: its values at the points, and their slopes by the parameters.
Model = Callable[[Array], tuple[Array, Array]]

LOSSES = ("linear", "soft_l1", "huber", "cauchy")
#: Turns of estimating the errors of the data.
TURNS = 4
#: A positive parameter may change by so many powers of e from where the fit starts.
FARTHEST = 30.0
#: A relative error of more than this, at two standard errors: the data do not determine the parameter.
UNKNOWN = 1.0
#: Probability of intervals.
CONFIDENCE = 0.95
#: Steps of a profile, in standard errors; then each is as much longer as the one before.
PROFILE_STEPS = (0.7, 1.4, 2.1, 2.8)
LONGER = 1.7
MOST_STEPS = 7
#: Longest first step in a logarithm; and evaluations of a fit that is to be sure.
FIRST_STEP, PATIENT = math.log(2.0), 300
#: A rise of so many limits is too far beyond; and how often what lies between is halved.
STEEP, HALVINGS = 4.0, 6
#: The profile of a positive parameter goes no farther than this factor from its value.
FARTHEST_PROFILE = 1e3


@dataclass(frozen=True)
class Parameter:
    """A parameter that is fitted: where the fit starts, within which bounds, and whether by its logarithm."""

    name: str
    start: float
    low: float = -math.inf
    high: float = math.inf
    by_log: bool = True

    def inner(self, value: float) -> float:
        """The number that is varied."""
        return math.log(value) if self.by_log else value

    def outer(self, x: float) -> float:
        """The parameter's value."""
        return math.exp(x) if self.by_log else x

    @property
    def bounds(self) -> tuple[float, float]:
        """Bounds of the number that is varied."""
        if not self.by_log:
            return self.low, self.high
        x = self.inner(self.start)
        low = self.inner(self.low) if self.low > 0 else -math.inf
        high = self.inner(self.high) if self.high < math.inf else math.inf
        return max(low, x - FARTHEST), min(high, x + FARTHEST)


@dataclass(frozen=True)
class Solution:
    """Where the squares are least.

    Attributes
    ----------
    parameters : tuple of Parameter
    x : array, shape (parameters,)
        The numbers that were varied.
    fitted : array, shape (points,)
    sigma : array, shape (points,)
        Standard errors of the data, given or estimated.
    jacobian : array, shape (points, parameters)
        Of the residuals, fitted less measured over sigma, by x.
    covariance : array, shape (parameters, parameters)
        Of x.
    chi2 : float
        Sum of the squares of the residuals.
    least : float
        What is least: chi2, or what a robust loss has in its place.
    loss : str
    dof : int
    estimated : bool
        Whether an error of the data was not given.
    evaluations : int
    at_bounds : tuple of str
    """

    parameters: tuple[Parameter, ...]
    x: Array
    fitted: Array
    sigma: Array
    jacobian: Array
    covariance: Array
    chi2: float
    least: float
    loss: str
    dof: int
    estimated: bool
    evaluations: int
    at_bounds: tuple[str, ...]

    @property
    def values(self) -> dict[str, float]:
        return {one.name: one.outer(float(x)) for one, x in zip(self.parameters, self.x, strict=True)}

    @property
    def errors(self) -> dict[str, float]:
        """Standard errors."""
        spread = np.sqrt(np.diag(self.covariance))
        return {
            one.name: float(s) * (one.outer(float(x)) if one.by_log else 1.0)
            for one, x, s in zip(self.parameters, self.x, spread, strict=True)
        }

    @property
    def correlation(self) -> Array:
        spread = np.sqrt(np.diag(self.covariance))
        found: Array = self.covariance / np.outer(spread, spread)
        return found

    @property
    def quantile(self) -> float:
        """Standard errors to either side within which a parameter is, with the probability of intervals."""
        from scipy.stats import norm, t

        high = (1 + CONFIDENCE) / 2
        return float(t.ppf(high, self.dof) if self.estimated and self.dof > 0 else norm.ppf(high))

    def intervals(self) -> dict[str, tuple[float, float]]:
        """By the standard errors of x: of a positive parameter around its logarithm."""
        reach = self.quantile * np.sqrt(np.diag(self.covariance))
        return {
            one.name: (one.outer(float(x - r)), _outer_or_inf(one, float(x + r)))
            for one, x, r in zip(self.parameters, self.x, reach, strict=True)
        }


def _outer_or_inf(one: Parameter, x: float) -> float:
    return math.inf if one.by_log and x > 700 else one.outer(x)


class _Residuals:
    """Residuals of a model, and their Jacobian, each computed once where both are asked for."""

    def __init__(self, model: Model, parameters: Sequence[Parameter], measured: Array, sigma: Array) -> None:
        self.model, self.parameters, self.measured, self.sigma = model, parameters, measured, sigma
        self.evaluations = 0
        self.known: tuple[bytes, Array, Array] | None = None
        self.largest: float | None = None

    def at(self, x: Array) -> tuple[Array, Array]:
        """Values and slopes by x."""
        key = x.tobytes()
        if self.known is None or self.known[0] != key:
            self.evaluations += 1
            outer = np.array([one.outer(float(v)) for one, v in zip(self.parameters, x, strict=True)])
            values, slopes = self.model(outer)
            turned = slopes * np.where([one.by_log for one in self.parameters], outer, 1.0)
            if not (np.isfinite(values).all() and np.isfinite(turned).all()):
                raise IntegrationError("the model has no finite value there")
            self.known = key, values, turned
        return self.known[1], self.known[2]

    def __call__(self, x: Array) -> Array:
        try:
            values, _ = self.at(x)
        except (IntegrationError, SceneError):
            if self.largest is None:  # where the fit starts
                raise
            # too far: a run that cannot be made is worse than any that could
            return np.full(len(self.measured), 10 * self.largest)
        found = (values - self.measured) / self.sigma
        size = float(np.max(np.abs(found)))
        self.largest = size if self.largest is None else max(self.largest, size)
        return found

    def jacobian(self, x: Array) -> Array:
        return self.at(x)[1] / self.sigma[:, None]


def solve(
    model: Model,
    parameters: Sequence[Parameter],
    measured: Array,
    sigma: Array,
    groups: NDArray[np.int64],
    loss: str = "linear",
) -> Solution:
    """Fit a model to points.

    Parameters
    ----------
    model : function of the values, shape (parameters,)
        Returns values, shape (points,), and slopes, shape (points, parameters).
    parameters : sequence of Parameter
    measured, sigma : array, shape (points,)
        sigma is nan where the error of the data is not known.
    groups : array of int, shape (points,)
        Points of one group have one unknown error.
    loss : str
        Of :data:`LOSSES`: all but "linear" give less weight to points far off, in standard errors.

    Raises
    ------
    SceneError, IntegrationError
        If the points are too few, or if the model cannot be computed where the fit starts.
    """
    parameters = tuple(parameters)
    dof = len(measured) - len(parameters)
    unknown = np.isnan(sigma)
    if dof < (1 if unknown.any() else 0):
        raise SceneError(f"{len(measured)} points do not determine {len(parameters)} parameters and their own scatter")
    x = np.array([one.inner(one.start) for one in parameters])
    guess = np.array(sigma, dtype=float)
    for group in np.unique(groups[unknown]):
        size = float(np.std(measured[groups == group])) or float(np.max(np.abs(measured[groups == group]))) or 1.0
        guess[groups == group] = size
    evaluations, fixed = 0, not unknown.any()
    for turn in range(TURNS if not fixed else 1):
        residuals, x = _minimised(model, parameters, measured, guess, x, loss if turn or fixed else _first(loss))
        evaluations += residuals.evaluations
        if fixed:
            break
        off = residuals.at(x)[0] - measured
        new = _scatter(off, groups, unknown, guess, dof / len(measured), robust=loss != "linear")
        settled = bool(np.all(np.abs(new / guess - 1) < 0.01))
        guess = new
        if settled or (len(np.unique(groups)) == 1 and loss == "linear"):
            break
    J = residuals.at(x)[1] / guess[:, None]
    fitted = residuals.at(x)[0]
    off = (fitted - measured) / guess
    at_bounds = tuple(
        one.name
        for one, v in zip(parameters, x, strict=True)
        if min(abs(v - one.bounds[0]), abs(v - one.bounds[1])) < 1e-6 * max(1.0, abs(v))
    )
    return Solution(
        parameters, x, fitted, guess, J, _covariance(J, off, loss), float(off @ off),
        _total(off, loss), loss, dof, bool(unknown.any()), evaluations, at_bounds,
    )  # fmt: skip


def _first(loss: str) -> str:
    """The loss of the first turn, in which errors are not known yet: of one that is robust, its mildest form."""
    return loss if loss == "linear" else "soft_l1"


def _minimised(
    model: Model,
    parameters: tuple[Parameter, ...],
    measured: Array,
    sigma: Array,
    x: Array,
    loss: str,
    tolerance: float = 1e-9,
    most: int = 1000,
) -> tuple[_Residuals, Array]:
    from scipy.optimize import least_squares

    residuals = _Residuals(model, parameters, measured, sigma)
    low, high = np.array([one.bounds for one in parameters]).T
    inside = np.clip(x, low, high)
    # a start on a bound has no way out
    width = np.where(np.isfinite(high - low), high - low, 1.0)
    inside = np.clip(inside, low + 1e-9 * width, high - 1e-9 * width)
    found = least_squares(
        residuals, inside, jac=residuals.jacobian, bounds=(low, high), x_scale="jac", loss=loss,
        xtol=tolerance, ftol=tolerance, gtol=1e-12, max_nfev=most,
    )  # fmt: skip
    return residuals, found.x


def _total(off: Array, loss: str) -> float:
    """What is least: the sum of the squares, or of what the loss has in their place."""
    z = off**2
    if loss == "soft_l1":
        z = 2 * (np.sqrt(1 + z) - 1)
    elif loss == "huber":
        z = np.where(z <= 1, z, 2 * np.sqrt(z) - 1)
    elif loss == "cauchy":
        z = np.log1p(z)
    return float(z.sum())


def _scatter(
    off: Array, groups: NDArray[np.int64], unknown: NDArray[np.bool_], sigma: Array, share: float, *, robust: bool
) -> Array:
    """Errors of the data from their residuals, of each group by itself."""
    new = sigma.copy()
    for group in np.unique(groups[unknown]):
        own = groups == group
        if robust:
            size = 1.4826 * float(np.median(np.abs(off[own])))
        else:
            size = math.sqrt(float(np.mean(off[own] ** 2)) / share)
        new[own] = size or float(np.finfo(float).eps) * max(float(np.max(np.abs(off))), 1e-300)
    return new


def _covariance(J: Array, off: Array, loss: str) -> Array:
    """Inverse of J^T J; of a robust loss with the weights that it gives, between which the scatter stands."""
    weights = np.ones(len(off))
    if loss != "linear":
        z = off**2
        slope = {"soft_l1": 1 / np.sqrt(1 + z), "cauchy": 1 / (1 + z)}
        weights = slope[loss] if loss in slope else np.where(z <= 1, 1.0, 1 / np.maximum(np.sqrt(z), 1.0))
    bread = _inverse(np.sqrt(weights)[:, None] * J)
    if loss == "linear":
        return bread
    scattered = (weights * off)[:, None] * J
    found: Array = bread @ (scattered.T @ scattered) @ bread
    return found


def _inverse(J: Array) -> Array:
    """Inverse of J^T J; a direction that is lost is known to nothing, not to all."""
    scale = np.linalg.norm(J, axis=0)
    scale = np.where(scale > 0, scale, 1e-12 * (scale.max() or 1.0))
    _, sizes, directions = np.linalg.svd(J / scale, full_matrices=False)
    turned = directions.T / np.maximum(sizes, 1e-10 * max(sizes[0], 1e-300))
    found: Array = turned @ turned.T / np.outer(scale, scale)
    return found


# --- what the data do not determine ---


@dataclass(frozen=True)
class Direction:
    """A combination of parameters, by the powers (of others than positive ones by the parts) in which they change.

    Attributes
    ----------
    powers : mapping from str to float
        The largest is 1.
    error : float
        Relative standard error: of the product of the powers, where the combination is one that is known; of a change
        along it else.
    """

    powers: Mapping[str, float]
    error: float


def _relative(solution: Solution) -> tuple[Array, Array]:
    """Covariance of relative changes, and what these are relative to."""
    scale = np.array(
        [1.0 if one.by_log else abs(x) or 1.0 for one, x in zip(solution.parameters, solution.x, strict=True)]
    )
    return solution.covariance / np.outer(scale, scale), scale


#: Parameters take part in a direction that moves them by this part of their own errors at least.
TAKES_PART = 0.3


def undetermined(solution: Solution) -> list[tuple[Direction, Direction | None]]:
    """Directions in which the parameters can move by as much as themselves, and what is known of these parameters.

    Returns
    -------
    list of (Direction, Direction or None)
        The direction that is not determined; the best known combination of the parameters that take part in it.
    """
    covariance, scale = _relative(solution)
    names = [one.name for one in solution.parameters]
    sizes, directions = np.linalg.eigh(covariance)
    found = []
    for size, direction in zip(sizes[::-1], directions.T[::-1], strict=True):
        error = math.sqrt(max(float(size), 0.0))
        if 2 * error < UNKNOWN:
            break
        parts = direction / direction[int(np.argmax(np.abs(direction)))]
        shares = np.abs(direction) * error / np.sqrt(np.diag(covariance))
        taking = [i for i, share in enumerate(shares) if share >= TAKES_PART * shares.max()]
        moved = Direction({names[i]: float(parts[i]) for i in taking}, error * float(np.max(np.abs(direction))))
        known = None
        if len(taking) > 1:
            way, best = _best_known(solution.jacobian * scale, taking)
            if 2 * best < UNKNOWN:
                known = Direction({names[i]: float(w) for i, w in zip(taking, way, strict=True)}, best)
        found.append((moved, known))
    return found


def _best_known(J: Array, taking: list[int]) -> tuple[Array, float]:
    """The combination of some parameters that is known best, whatever the others are, and its error.

    From the Jacobian, of which the covariance has lost what is small against what is not known at all.
    """
    others = [i for i in range(J.shape[1]) if i not in taking]
    basis, _ = np.linalg.qr(J[:, others])
    own = J[:, taking] - basis @ (basis.T @ J[:, taking])
    _, sizes, ways = np.linalg.svd(own, full_matrices=False)
    largest = float(ways[0][int(np.argmax(np.abs(ways[0])))])
    return ways[0] / largest, 1 / (float(sizes[0]) * abs(largest)) if sizes[0] > 0 else math.inf


# --- profiles ---


@dataclass(frozen=True)
class Profile:
    """The least squares with one parameter held, all others fitted.

    Attributes
    ----------
    values : array, shape (points,)
        Of the parameter, rising.
    rise : array, shape (points,)
        Of chi2 above its least value.
    low, high : float
        Within which the parameter is, with the probability of intervals; infinite, or the bound, where it rises to no
        more.
    """

    values: Array
    rise: Array
    low: float
    high: float


class _Held(NamedTuple):
    """With one held, the others fitted: its distance from the best fit, the rise of chi2, and all parameters."""

    shift: float
    rise: float
    x: Array


def profile(model: Model, solution: Solution, measured: Array, number: int) -> Profile:
    """Profile of a parameter, at the errors of the data that were found.

    Parameters
    ----------
    model : Model
    solution : Solution
        The best fit, from which the profile goes to both sides.
    measured : array, shape (points,)
        What was measured, in the model's units.
    number : int
        Which of the fitted parameters.
    """
    one = solution.parameters[number]
    spread = math.sqrt(float(solution.covariance[number, number]))
    limit = solution.quantile**2
    points = {0.0: 0.0}
    ends = []

    def attempt(shift: float, near: _Held) -> _Held:
        try:
            found = _held(model, solution, measured, number, shift, near.x, limit)
        except (IntegrationError, SceneError):
            return _Held(shift, math.inf, near.x)
        points[shift] = found.rise
        return found

    for side in (-1.0, 1.0):
        bound = one.bounds[0 if side < 0 else 1]
        reach, end, before = 0.0, side * math.inf, _Held(0.0, 0.0, solution.x)
        for k in range(MOST_STEPS):
            reach = PROFILE_STEPS[k] if k < len(PROFILE_STEPS) else reach * LONGER
            shift = side * reach * spread
            if one.by_log:
                # along a curved valley a long step would lead nowhere
                shift = side * min(abs(shift), FIRST_STEP * LONGER**k)
            if one.by_log and abs(shift) > math.log(FARTHEST_PROFILE):
                if k and abs(before.shift) >= math.log(FARTHEST_PROFILE):
                    break
                shift = side * math.log(FARTHEST_PROFILE)
            out = (solution.x[number] + shift - bound) * side >= 0
            shift = bound - solution.x[number] if out else shift
            before, here = _narrowed(attempt, before, attempt(shift, before), limit)
            if here.rise >= limit:
                if math.isfinite(here.rise):
                    # chi2 is nearly a parabola: its root is nearly straight
                    low, high = math.sqrt(max(before.rise, 0.0)), math.sqrt(here.rise)
                    part = (math.sqrt(limit) - low) / (high - low)
                    end = before.shift + part * (here.shift - before.shift)
                break
            before = here
            if out:
                # at a bound that somebody has set, or as far as anybody looks
                edge = one.low if side < 0 else one.high
                end = shift if math.isfinite(edge) and (edge > 0 or not one.by_log) else end
                break
        ends.append(end)
    shifts = np.array(sorted(points))
    values = [one.outer(float(solution.x[number] + s)) for s in shifts]
    low, high = (solution.x[number] + end for end in ends)
    outer = (0.0 if one.by_log and low == -math.inf else one.outer(low), _outer_or_inf(one, float(high)))
    return Profile(np.array(values), np.array([points[s] for s in shifts]), *outer)


def _narrowed(
    attempt: Callable[[float, _Held], _Held], before: _Held, here: _Held, limit: float
) -> tuple[_Held, _Held]:
    """Two points between which the limit is crossed, halved while the second is too far beyond, or its fit fails."""
    for _ in range(HALVINGS):
        if here.rise <= STEEP * limit:
            break
        between = attempt((before.shift + here.shift) / 2, before)
        before, here = (between, here) if between.rise < limit else (before, between)
    return before, here


def _held(
    model: Model, solution: Solution, measured: Array, number: int, shift: float, x: Array, limit: float
) -> _Held:
    """The others fitted, with one held.

    What ends a profile, a rise to the limit, is tried again with more patience, and from another start, too.
    """
    one = solution.parameters[number]
    at = float(solution.x[number]) + shift
    others = [i for i in range(len(solution.x)) if i != number]
    if not others:
        values, _ = model(np.array([one.outer(at)]))
        off = (values - measured) / solution.sigma
        return _Held(shift, _total(off, solution.loss) - solution.least, np.array([at]))

    def rest(outer: Array) -> tuple[Array, Array]:
        values, slopes = model(np.insert(outer, number, one.outer(at)))
        return values, slopes[:, others]

    kept = tuple(solution.parameters[i] for i in others)

    def fitted(start: Array, most: int) -> _Held:
        residuals, found = _minimised(rest, kept, measured, solution.sigma, start, solution.loss, 1e-6, most)
        return _Held(shift, _total(residuals(found), solution.loss) - solution.least, np.insert(found, number, at))

    moved = x[others] + solution.covariance[others, number] / solution.covariance[number, number] * (at - x[number])
    best = fitted(moved, 30)
    if best.rise >= limit:
        starts = (best.x[others], x[others])
        best = min(best, *(fitted(start, PATIENT) for start in starts), key=lambda one: one.rise)
    return best
