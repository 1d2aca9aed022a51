"""Tables and pictures of many runs say their units, where these are known."""

from __future__ import annotations

from pathlib import Path

import pytest
from matplotlib.figure import Figure

from softdyn.cli import main
from softdyn.rheology.column_units import head_of, tell_units, unit_of

SCENE = """
law = "droplet"
parameters = {{sigma = {sigma}, eta = {eta}}}
packing = {{count = 16, dimension = 2, fraction = 0.9, radii = [{small}, {large}], seed = 1}}
contacts = {{gap = {gap}, range = {reach}}}
flow = {{drag = 1.0, shear_rate = {rate}}}
until = {{strain = 0.04}}
output = {{times = 21}}
"""
PLAIN = {"sigma": "1.0", "eta": "1.0", "small": "1.0", "large": "1.4", "gap": "0.02", "reach": "0.5", "rate": "1e-3"}
SI = {
    **{"sigma": '"30 mN/m"', "eta": '"1 mPa s"', "small": '"10 um"', "large": '"14 um"', "gap": '"0.2 um"'},
    **{"reach": '"5 um"', "rate": "3000.0"},
}


def test_a_mean_its_error_and_its_last_value_have_one_unit() -> None:
    assert [unit_of(f"pressure{part}") for part in ("", "_error", "_end")] == ["Pa"] * 3
    assert head_of("coordination", "SI") == "coordination"
    assert head_of("viscosity", "SI") == "viscosity [Pa s]"
    assert head_of("viscosity", "") == "viscosity"


def test_titles_and_labels_say_units_of_what_is_in_si() -> None:
    figure = Figure()
    ax = figure.add_subplot()
    ax.set_title("shear stress")
    ax.set_xlabel("shear rate")
    ax.set_ylabel("strain")
    tell_units(figure.axes, "")
    assert ax.get_title() == "shear stress"
    tell_units(figure.axes, "SI")
    assert (ax.get_title(), ax.get_xlabel(), ax.get_ylabel()) == ("shear stress [Pa]", "shear rate [1/s]", "strain")


@pytest.mark.slow
@pytest.mark.parametrize(("numbers", "unit"), [(PLAIN, ""), (SI, " [Pa]")])
def test_the_table_of_a_sweep_says_its_units(numbers: dict[str, str], unit: str, tmp_path: Path) -> None:
    """Where the scene has some; plain numbers stay as they are."""
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE.format(**numbers), encoding="utf-8")
    assert main(["sweep", str(scene), "--vary", "drag=1,2", "-o", str(tmp_path / "t.csv")]) == 0
    heads = (tmp_path / "t.csv").read_text(encoding="utf-8").splitlines()[0].split(",")
    assert {f"pressure{unit}", f"shear_stress_end{unit}", "coordination"} <= set(heads)
    assert "varied_drag" in heads
