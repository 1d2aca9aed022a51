"""A law against elastohydrodynamics: its film as it is pressed, pulled, and pulled after it was pressed.

The reference is that of ``elastohydrodynamics.json``: Reynolds' equation and an elastic half-space, where gaps are
small. There the state of a film is w/h, w = 2 delta, and friction and stiffness over those at delta = 0 depend on
nothing else. What is drawn of a law are its own expressions, at a gap where nothing but h and delta is left in them.
The remote force has no part in it.
"""

from __future__ import annotations

import json
import math
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from sympy import Expr

from softdyn.colours import BLUE, ORANGE
from softdyn.derive.law import is_dry, is_rigid, without_typical
from softdyn.derive.symbols import a, delta, h
from softdyn.mathtext import literal
from softdyn.study.figures import INK, paper_style
from softdyn.study.plane import deflection_at, parameter_values, vectorised

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from softdyn.derive.law import ContactLaw
    from softdyn.derive.regimes import Side

Array = NDArray[np.float64]

#: h/R at which laws are taken: far below the lengths that laws have, far above what rounding does to R + h.
GAP = 1e-9
#: How near an exponent in the gap must be to that of round surfaces.
NEAR = 0.01
#: Friction of round rigid surfaces times h, in units of eta R'^2: what the reference calls R' of a law.
ROUND = 6 * math.pi
#: The band around the reference, and the w/h between which the deviation is told.
BAND = 0.15
INSIDE = (-5.0, 3.0)
#: Points of a law's curve.
CURVE = 400
#: w/h that stands for no deflection, where a stiffness is needed.
LITTLE = 1e-6


@cache
def reference() -> dict[str, Any]:
    """What is known: rows of w/h, friction and elastic radius, and the film that is pressed and then pulled."""
    text = files("softdyn.study").joinpath("elastohydrodynamics.json").read_text(encoding="utf-8")
    kept: dict[str, Any] = json.loads(text)
    return kept


def applies(law: ContactLaw) -> bool:
    """Whether the reference describes a law: friction and elasticity, and at contact the friction of round surfaces.

    That is zeta ~ 1/h at delta = 0, whatever its constant, which may be that of spheres or of a sphere and a plane. It
    is not known of a law that gives no typical values of its parameters.
    """
    if is_rigid(law) or is_dry(law) or without_typical(law):
        return False
    return _goes_as(law, law.zeta, 0.0, -1.0)


def is_half_space(law: ContactLaw) -> bool:
    """Whether a law yields at contact as half-spaces do under lubrication pressure, F/delta ~ sqrt(h)."""
    return _goes_as(law, law.F_ela / delta, LITTLE, 0.5)


def _goes_as(law: ContactLaw, quantity: Expr, state: float, power: float) -> bool:
    """Whether a quantity goes as a power of h at a given w/h, two decades of gaps around :data:`GAP`."""
    values = [_at(law, quantity, gap, np.array([state]))[0] for gap in (GAP / 10, GAP, 10 * GAP)]
    with np.errstate(all="ignore"):
        return bool(np.all(np.abs(np.diff(np.log10(values)) - power) < NEAR))


def _at(law: ContactLaw, quantity: Expr, gap: float, states: Array) -> Array:
    """An expression of a law at a gap and at some w/h, in units of R, E and eta."""
    function = vectorised((h, delta), quantity.subs(a, law.a).subs(parameter_values(law)))
    with np.errstate(all="ignore"):
        return np.broadcast_to(function(np.full(states.shape, gap), gap * states / 2), states.shape).astype(float)


def friction(law: ContactLaw, states: Array) -> Array:
    """Friction of a law over that of rigid surfaces, its own at delta = 0, at some w/h."""
    return _at(law, law.zeta, GAP, states) / _at(law, law.zeta, GAP, np.zeros(1))


def stiffness(law: ContactLaw, states: Array) -> Array:
    """F/delta of a law over its limit at delta = 0, at some w/h other than 0: the elastic radius over that."""
    return _at(law, law.F_ela / delta, GAP, states) / _at(law, law.F_ela / delta, GAP, np.array([LITTLE]))


def deviation(law: ContactLaw) -> float:
    """Largest factor, above 1, between the friction of a law and the reference, within :data:`INSIDE`."""
    rows = np.array(reference()["rows"])
    rows = rows[(rows[:, 0] >= INSIDE[0]) & (rows[:, 0] <= INSIDE[1])]
    with np.errstate(all="ignore"):
        return float(np.exp(np.abs(np.log(friction(law, rows[:, 0]) / rows[:, 1])).max()))


def reversal(law: ContactLaw) -> tuple[Array, Array]:
    """What a law makes of the film that is pressed and then pulled.

    It starts at the gap, the deflection and the force of the reference, which give the units of both, and goes through
    the same forces.

    Returns
    -------
    t, h : arrays of shape (times,)
        Time in eta R'^2/F, R' as the law's rigid friction has it; gaps over the first.
    """
    kept = {name: np.array(values) for name, values in reference()["reversed"].items() if name != "about"}
    first, last = kept["centre"][[0, -1]]
    # the force that deflects the law at the start as the reference is
    start = _at(law, law.F_ela, GAP, np.array([kept["deflection"][0] / first]))[0]
    zeta = vectorised((h, delta), law.zeta.subs(a, law.a).subs(parameter_values(law)))
    rigid = _at(law, law.zeta, GAP, np.zeros(1))[0] * GAP

    def rate(t: float, growth: Array) -> Array:
        """Of ln h."""
        gap, force = GAP * np.exp(growth), np.interp(t, kept["t"], kept["force"])
        side: Side = "compression" if force > 0 else "tension"
        size = deflection_at(law, side, float(gap[0]), float(abs(force) * start))
        return np.asarray(-force * rigid / (ROUND * gap * zeta(gap, math.copysign(1.0, force) * size)))

    def opened(_t: float, growth: Array) -> float:
        return float(growth[0]) - math.log(last / first)

    opened.terminal = True  # type: ignore[attr-defined]
    # no step passes over a change of the force; where the law has no deflection any more, the run ends
    with np.errstate(all="ignore"):
        run = solve_ivp(rate, (0.0, kept["t"][-1]), [0.0], events=opened, rtol=1e-6, atol=1e-9, max_step=0.5)
    return run.t, np.exp(run.y[0])


# ---------------------------------------------------------------------------------------------------------- the figure


def draw(law: ContactLaw) -> Figure:
    """Draw a law over the reference: friction, elastic radius where it is that of half-spaces, and the reversal."""
    elastic = is_half_space(law)
    with paper_style():
        figure = Figure(figsize=(11, 4.2))
        FigureCanvasAgg(figure)
        panels = figure.subplots(1, 2 + elastic, gridspec_kw={"width_ratios": [1.2, *([1] * elastic), 1]})
        figure.subplots_adjust(left=0.06, right=0.985, top=0.92, bottom=0.125, wspace=0.24)
        draw_friction(panels[0], law)
        if elastic:
            draw_stiffness(panels[1], law)
        draw_reversal(panels[-1], law)
    return figure


def draw_friction(axes: Axes, law: ContactLaw) -> None:
    """Friction over that of rigid surfaces, and how it differs with the gap that films are pulled from."""
    rows = np.array(reference()["rows"])
    _draw_state(axes, law, rows[:, 0], rows[:, 1], friction)
    nearer = np.array(reference()["pulled from nearer"]["rows"])
    for gap, marker, name in zip(np.unique(nearer[:, 0]), "v^", ("half", "twice"), strict=True):
        _, x, values = nearer[nearer[:, 0] == gap].T
        axes.plot(x, values, marker, color=INK, mfc="white", ms=4.5, mew=0.8, label=f"pulled from {name} the gap")
    axes.set_yscale("log")
    axes.set_title(r"friction over the rigid one, $\zeta/\zeta_\mathrm{rigid}$")
    axes.legend(loc="upper left", frameon=False, handlelength=1.6)


def draw_stiffness(axes: Axes, law: ContactLaw) -> None:
    """F/delta over its limit at delta = 0, which is that of the elastic radius."""
    rows = np.array(reference()["rows"])
    _draw_state(axes, law, rows[:, 0], rows[:, 2] / np.interp(0.0, rows[:, 0], rows[:, 2]), stiffness)
    axes.set_title(r"elastic radius over that at $\delta = 0$")


def _draw_state(axes: Axes, law: ContactLaw, x: Array, values: Array, of_law: Any) -> None:
    along = np.sinh(np.linspace(np.arcsinh(x[0]), np.arcsinh(x[-1]), CURVE))
    axes.plot(along, of_law(law, along), color=BLUE, lw=1.6, label=literal(law.name), zorder=3)
    axes.plot(x, values, "o", color=INK, ms=3.2, label="elastohydrodynamics", zorder=4)
    axes.fill_between(
        x, (1 - BAND) * values, (1 + BAND) * values, color=INK, alpha=0.13, lw=0, label=f"± {BAND:.0%} of it"
    )
    axes.axvline(0, color="#BBBBBB", lw=0.6, zorder=0.5)
    axes.set_xscale("asinh", linear_width=1)
    ticks = [-8, -4, -2, -1, 0, 1, 2, 4, 8, 20]
    axes.set_xticks(ticks, [f"{tick}".replace("-", "−") for tick in ticks])
    axes.minorticks_off()
    axes.set_xlim(1.15 * x[0], 1.15 * x[-1])
    axes.set_xlabel(r"pulled $\longleftarrow$   $w/h = 2\delta/h$   $\longrightarrow$ pressed")


def draw_reversal(axes: Axes, law: ContactLaw) -> None:
    """The gaps of a film that was pressed and is pulled, over time."""
    kept = reference()["reversed"]
    first = kept["centre"][0]
    axes.plot(*reversal(law), color=BLUE, lw=1.6, label=literal(law.name))
    axes.plot(kept["t"], np.array(kept["centre"]) / first, color=INK, lw=1.4, label="reference, centre")
    axes.plot(
        kept["t"], np.array(kept["smallest"]) / first, color=ORANGE, lw=1.4, ls=(0, (4, 2)), label="reference, smallest"
    )
    axes.set_yscale("log")
    axes.set_yticks([0.5, 1, 2, 4], ["0.5", "1", "2", "4"])
    axes.minorticks_off()
    axes.set_ylim(0.4, 3 * kept["centre"][-1] / first)  # with room for the legend
    axes.set_title("pressed, then pulled: gap over the first")
    axes.set_xlabel(r"time from the reversal, in $\eta R^{\prime\,2}/F$")
    axes.legend(loc="upper left", frameon=False, handlelength=1.6)
