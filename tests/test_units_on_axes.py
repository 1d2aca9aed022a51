"""Pictures tell units where the numbers of a run are known to be in SI units."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import softdyn
from softdyn import Scene, particles
from softdyn.fluid import Boundary, FluidScene, MeshSection
from softdyn.particles import ParticleScene

PAIR = {"R": "50 um", "E": "1 kPa", "eta": 1e-3}


def test_a_number_with_a_unit_says_that_all_are_in_si_units() -> None:
    plain = {"R": 5e-5, "E": 1e3, "eta": 1e-3}
    one = Scene(law="rognon_gay", parameters=PAIR, h=1e-5, force=1e-9, until_t=1.0)
    assert one.units == "SI"
    assert replace(one, h=2e-5).units == "SI"
    other = Scene(law="rognon_gay", parameters=plain, h=1e-5, force=1e-9, until_t=1.0)
    assert other.units is None
    assert Scene(law="rognon_gay", parameters=plain, h="10 um", force="1e-9*sin(t)", until_t=1.0).units == "SI"
    assert Scene(law="rognon_gay", parameters=plain, h=1e-5, force="1e-9*sin(t)", until_t=1.0).units is None
    assert Scene(law="rognon_gay", parameters=plain, h=1e-5, force=1e-9, until_t=1.0, units="SI").units == "SI"
    lists = ParticleScene(
        "rognon_gay", {"E": 1.0, "eta": 1.0}, positions=[["1 mm", 0], [0, 0.1]], radii=0.01, until_t=1.0
    )
    assert lists.units == "SI"
    with pytest.raises(softdyn.SceneError, match="unknown units 'cgs'"):
        softdyn.simulate(replace(other, units="cgs"))


def test_axes_of_two_particles_have_units_also_when_the_result_is_read_back(tmp_path: Path) -> None:
    result = softdyn.simulate(
        law="rognon_gay", parameters=PAIR, h="10 um", force="1 nN", until_t="1 s", times=9, quantities=["X", "a", "F"]
    )
    result.save(tmp_path / "pair.npz")
    for one in (result, softdyn.load_result(tmp_path / "pair.npz")):
        figure = one.plot(panels=["h", "F"])
        assert [axes.get_ylabel() for axes in figure.axes] == ["gap $h$ [m]", "force $F$ [N]"]
        assert figure.axes[-1].get_xlabel() == "time $t$ [s]"
    plain = softdyn.simulate(law="rognon_gay", parameters={"R": 1, "E": 1, "eta": 1}, h=1, force=1e-3, until_t=1.0)
    assert [axes.get_xlabel() for axes in plain.plot(panels=["h"]).axes] == ["time $t$"]


def test_axes_of_many_particles_and_of_fluids_have_units() -> None:
    scene = ParticleScene(
        "rognon_gay", {"E": "1 kPa", "eta": 1e-3}, positions=[[0.0, 0.0], [2.1e-3, 0.0]], radii=1e-3, gap=1e-4,
        range=1e-3, drag=1.0, until_t=1.0, times=3,
    )  # fmt: skip
    figure = particles.simulate(scene).plot(panels=["network", "energy"])
    labels = {text for axes in figure.axes for text in (axes.get_xlabel(), axes.get_ylabel())}
    assert {"$x$ [m]", "$y$ [m]", "energy since the start [J]", "time $t$ [s]"} <= labels
    lid = Boundary(on=["left", "right", "bottom", "top"], velocity=[0, 0])
    fluid = FluidScene("1 mPa s", MeshSection(box=[1.0, 1.0], cells=[2, 2]), boundary=[lid], steady=True)
    assert fluid.units == "SI"
    drawn = softdyn.simulate(fluid).plot(panels=["speed", "pressure"])
    assert {axes.get_title(loc="left") for axes in drawn.axes} >= {"speed $|u|$ [m/s]", "pressure [Pa]"}
