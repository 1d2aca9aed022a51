"""Figures of some panels that are asked for by name, as a publication needs them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from matplotlib import rc_context
from matplotlib.figure import Figure

from softdyn.errors import SceneError
from softdyn.words import suggestion

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Widths of figures, in inches: of a column of a journal, and of a page.
WIDTHS = {"column": 3.4, "page": 7.0}
#: Below this width letters are smaller, and legends have fewer columns.
NARROW, SMALL = 5.0, 8.0


class Panel(NamedTuple):
    """What draws into axes, and how tall it is over its width."""

    draw: Callable[[Axes], None]
    tall: float = 0.62


def inches(width: str | float) -> float:
    """Width of a figure in inches.

    Raises
    ------
    SceneError
    """
    found = WIDTHS.get(width) if isinstance(width, str) else float(width)
    if found is None or not found > 0:
        raise SceneError(f"width must be one of {', '.join(WIDTHS)}, or a number of inches, not {width!r}")
    return found


def root_of(ax: Axes) -> Figure:
    """The figure that axes stand in."""
    whole = ax.get_figure(root=True)
    assert whole is not None
    return whole


def chosen_panels(
    known: Mapping[str, Panel], names: Sequence[str] | None, width: str | float, ax: Axes | None
) -> Figure:
    """Draw panels below one another, or a single one into axes.

    Parameters
    ----------
    known : mapping from str to Panel
        All that there are of a result.
    names : sequence of str, or None
        Which, in their order.
    width : "column", "page" or number
        Of the figure; a number is in inches.
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib.figure.Figure
        That of ``ax``, if it is given; else a new one, which belongs to no window.

    Raises
    ------
    SceneError
        If a panel is unknown, or if ``ax`` is to hold several.
    """
    if isinstance(names, str) or not names:
        raise SceneError(f"panels is a list of some of {', '.join(known)}, not {names!r}")
    for name in names:
        if name not in known:
            raise SceneError(f"panel {name!r}: the result has none{suggestion(name, list(known))}")
    if ax is not None:
        if len(names) != 1:
            raise SceneError(f"ax takes a single panel, as panels=[{next(iter(known))!r}], and here are {len(names)}")
        known[names[0]].draw(ax)
        return root_of(ax)
    wide = inches(width)
    heights = [known[name].tall * wide for name in names]
    with rc_context({"font.size": SMALL} if wide < NARROW else {}):
        figure = Figure(figsize=(wide, sum(heights)), layout="constrained")
        grid = figure.add_gridspec(len(names), 1, height_ratios=heights)
        for k, name in enumerate(names):
            known[name].draw(figure.add_subplot(grid[k]))
        # axes whose proportions are fixed have room for their labels in the second layout only
        figure.draw_without_rendering()
    return figure
