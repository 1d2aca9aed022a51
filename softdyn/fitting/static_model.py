"""Forces at given gaps where nothing moves, as functions of what is fitted.

Where nothing moves the fluid transmits no force: the elastic force and the remote one are the same,

    F_ela(a, delta) = F_adh(a, h) = F,   a = a(h, delta),

which has the deflection and the force at each gap. Their derivatives by a parameter p follow from the first equation,
d(delta)/dp = -(dF_ela/dp - dF_adh/dp)/(dF_ela/d(delta) - dF_adh/d(delta)), with what sympy derives of the law.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import IntegrationError, SceneError
from softdyn.fitting.curve_data import CurveData

if TYPE_CHECKING:
    from sympy import Expr

    from softdyn.derive.law import ContactLaw

Array = NDArray[np.float64]

#: What is added to all gaps of a curve: where surfaces touch is seldom known.
SHIFT = "shift"
#: A bracket of the deflection starts at this part of R, and is doubled so often at most; then it is halved.
LEAST, DOUBLED, HALVED = 1e-12, 40, 52


class StaticModel:
    """Forces at the gaps of all curves, and their slopes, as a fit takes them.

    Parameters
    ----------
    law : ContactLaw
        With a remote force.
    curves : sequence of CurveData
        With columns h and F.
    numbers : mapping from str to float
        All parameters of the law, and ``SHIFT``.
    places : mapping from str to (curve or None, str)
        What is varied, in this order: of which curve, and the name in ``numbers``.

    Raises
    ------
    SceneError
        If the law has no static force at a gap.
    """

    def __init__(
        self,
        law: ContactLaw,
        curves: Sequence[CurveData],
        numbers: Mapping[str, float],
        places: Mapping[str, tuple[int | None, str]],
    ) -> None:
        _require_static(law)
        self.curves, self.numbers, self.places = curves, dict(numbers), dict(places)
        self.forces = _forces(law, [name for _, name in places.values() if name != SHIFT])
        self.starts = np.concatenate([[0], np.cumsum([len(curve.columns["h"]) for curve in curves])])

    def __call__(self, values: Array) -> tuple[Array, Array]:
        found = np.empty(self.starts[-1])
        slopes = np.zeros((self.starts[-1], len(values)))
        for n, curve in enumerate(self.curves):
            here = [k for k, (owner, _) in enumerate(self.places.values()) if owner in (None, n)]
            names = [list(self.places.values())[k][1] for k in here]
            numbers = {**self.numbers, **dict(zip(names, (float(values[k]) for k in here), strict=True))}
            rows = slice(self.starts[n], self.starts[n + 1])
            gap = curve.columns["h"] + numbers[SHIFT]
            found[rows], slopes[rows, here] = self.forces(gap, numbers, names)
        return found, slopes


def _require_static(law: ContactLaw) -> None:
    from softdyn.derive.law import is_dry

    if is_dry(law) or law.F_adh == 0:
        raise SceneError(
            f"the law {law.name} has no remote force, F_adh: where nothing moves it has none at a gap; fit what moves, "
            "with a drive"
        )


def _forces(
    law: ContactLaw, names: Sequence[str]
) -> Callable[[Array, Mapping[str, float], Sequence[str]], tuple[Array, Array]]:
    """Force at gaps, and its derivatives, with the law's expressions as sympy derives them."""
    from sympy import diff, lambdify

    from softdyn.derive.law import is_rigid, parameters_of
    from softdyn.derive.special import IN_NUMPY
    from softdyn.derive.symbols import a, delta, h

    symbols = list(parameters_of(law))
    varied = {symbol.name: symbol for symbol in symbols if symbol.name in names}
    remote = law.F_adh.subs(a, law.a)
    rigid = is_rigid(law)
    off = delta if rigid else law.F_ela.subs(a, law.a) - remote

    def function(expr: Expr) -> Callable[..., Array]:
        made = lambdify([h, delta, *symbols], expr, [IN_NUMPY, "numpy"])
        return lambda gap, bent, numbers: np.broadcast_to(made(gap, bent, *numbers), gap.shape)

    balance, steep = function(off), function(diff(off, delta))
    force, by_bend = function(remote), function(diff(remote, delta))
    by = {name: (function(diff(off, x)), function(diff(remote, x))) for name, x in {**varied, SHIFT: h}.items()}

    def forces(gap: Array, numbers: Mapping[str, float], wanted: Sequence[str]) -> tuple[Array, Array]:
        if not (gap > 0).all():
            k = int(np.argmin(gap))
            raise IntegrationError(f"the gap of row {k + 1} is {gap[k]:.4g}: a film has a positive one")
        values = [numbers[symbol.name] for symbol in symbols]
        size = numbers["R"] if "R" in numbers else float(gap.max())
        with np.errstate(all="ignore"):
            bent = np.zeros_like(gap) if rigid else _root(lambda x: balance(gap, x, values), gap, size)
            slopes = np.empty((len(gap), len(wanted)))
            for k, name in enumerate(wanted):
                of_balance, of_force = by[name]
                bending = -of_balance(gap, bent, values) / steep(gap, bent, values)
                slopes[:, k] = of_force(gap, bent, values) + by_bend(gap, bent, values) * bending
            return np.array(force(gap, bent, values)), slopes

    return forces


def _root(balance: Callable[[Array], Array], gap: Array, size: float) -> Array:
    """Deflection of least size at which elastic and remote force are the same, at each gap.

    Raises
    ------
    IntegrationError
        If there is none: the surfaces would jump into contact.
    """
    way = np.where(balance(np.zeros_like(gap)) > 0, -1.0, 1.0)
    near, far = np.zeros_like(gap), np.full_like(gap, LEAST * size)
    open_ = balance(near) != 0
    far = np.where(open_, far, 0.0)
    for _ in range(DOUBLED):
        beyond = open_ & ~(way * balance(way * far) >= 0)
        if not beyond.any():
            break
        near, far = np.where(beyond, far, near), np.where(beyond, 2 * far, far)
    else:
        k = int(np.argmax(beyond))
        raise IntegrationError(f"no deflection bears the remote force at the gap {gap[k]:.4g}: surfaces would jump")
    for _ in range(HALVED):
        middle = (near + far) / 2
        under = way * balance(way * middle) < 0
        near, far = np.where(under, middle, near), np.where(under, far, middle)
    return way * (near + far) / 2
