"""Units on the axes of pictures, of runs whose numbers are in SI units."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from softdyn.results.result import Result


def tell_units(axes: Iterable[Axes], result: Result, units: Mapping[str, str]) -> None:
    """Put units behind labels and titles, if the numbers of a run are known to be in SI units.

    Parameters
    ----------
    axes : iterable of Axes
    result : Result
    units : mapping from str to str
        Of labels, and of titles that stand in the place of one, their units.
    """
    if result.units != "SI":
        return
    for one in axes:
        for axis in (one.xaxis, one.yaxis):
            text = axis.get_label_text()
            if text in units:
                axis.set_label_text(f"{text} [{units[text]}]")
        title = one.get_title(loc="left")
        if title in units:
            one.set_title(f"{title} [{units[title]}]", loc="left", fontsize="medium")
