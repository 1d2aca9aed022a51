"""Units of what tables and pictures of many runs tell, where their numbers are known to be in SI units."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Of columns; means have an error, a last value and extremes of the same unit.
COLUMNS = {
    **dict.fromkeys(("shear_stress", "contact_stress", "fluid_stress", "pressure", "N1", "N2"), "Pa"),
    **dict.fromkeys(("G_storage", "G_loss", "G_loss_contacts", "G_loss_fluid", "G"), "Pa"),
    **dict.fromkeys(("bulk_modulus", "shear_modulus"), "Pa"),
    **{"viscosity": "Pa s", "shear_rate": "1/s", "varied_shear_rate": "1/s", "varied_frequency": "rad/s"},
    **{"J": "1/Pa", "time": "s", "t_end": "s"},
}
PARTS = ("_error", "_end", "_min", "_max")
#: Of titles and labels in pictures.
WORDS = {
    "shear stress": "Pa",
    "pressure of the particles": "Pa",
    "pressure": "Pa",
    "normal stress differences $N_1$, $N_2$": "Pa",
    "normal stress difference $N_1$": "Pa",
    "shear rate": "1/s",
    "angular frequency": "rad/s",
    "moduli $G'$ (filled) and $G''$ (open)": "Pa",
    "relaxation modulus $G(t)$": "Pa",
    "compliance, strain over stress": "1/Pa",
    "time since the step": "s",
    "time since the end of the ramp": "s",
    "bulk (filled) and shear modulus (open)": "Pa",
}


def unit_of(column: str) -> str:
    """Unit of a column in SI; empty of what has none, or of what is not known here."""
    for part in PARTS:
        column = column.removesuffix(part) if column.removesuffix(part) in COLUMNS else column
    return COLUMNS.get(column, "")


def head_of(column: str, units: str) -> str:
    """A column's head, with its unit if numbers are in SI units (``units`` is "SI")."""
    unit = unit_of(column) if units == "SI" else ""
    return f"{column} [{unit}]" if unit else column


def tell_units(axes: Iterable[Axes], units: str) -> None:
    """Put units behind titles and labels, if numbers are in SI units."""
    if units != "SI":
        return
    for one in axes:
        for text in (one.title, one.xaxis.label, one.yaxis.label):
            if text.get_text() in WORDS:
                text.set_text(f"{text.get_text()} [{WORDS[text.get_text()]}]")
