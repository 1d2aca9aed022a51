"""Numbers with units: read exactly, held against the dimension that a key or a law declares, and alike in all doors."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import softdyn
from softdyn.errors import SceneError
from softdyn.particles.mechanisms.gravity import Gravity
from softdyn.scene.key_words import schema
from softdyn.scene.units import PREFIXES, UNITS, plain, powers_of, quantity, read_unit

LENGTH = powers_of("length")
TOLD: list[tuple[str, float, tuple[int, int, int]]] = [
    ("um", 1e-6, (0, 1, 0)),
    ("\N{MICRO SIGN}m", 1e-6, (0, 1, 0)),
    ("mN/m", 1e-3, (1, 0, -2)),
    ("mPa s", 1e-3, (1, -1, -1)),
    ("mPa\N{MIDDLE DOT}s", 1e-3, (1, -1, -1)),
    ("cP", 1e-3, (1, -1, -1)),
    ("Pa*s", 1.0, (1, -1, -1)),
    ("m s^-1", 1.0, (0, 1, -1)),
    ("m s\N{SUPERSCRIPT MINUS}\N{SUPERSCRIPT ONE}", 1.0, (0, 1, -1)),
    ("1/s", 1.0, (0, 0, -1)),
    ("g/cm^3", 1e3, (1, -3, 0)),
    ("dyn/cm", 1e-3, (1, 0, -2)),
    ("kg m^2/s^2", 1.0, (1, 2, -2)),
    ("%", 1e-2, (0, 0, 0)),
    ("min", 60.0, (0, 0, 1)),
]


@pytest.mark.parametrize(("text", "size", "powers"), TOLD)
def test_units_are_read(text: str, size: float, powers: tuple[int, int, int]) -> None:
    unit = read_unit(text)
    assert float(unit.size) == size
    assert unit.powers == powers


@given(
    st.decimals(allow_nan=False, allow_infinity=False, min_value=-(10**6), max_value=10**6, places=6),
    st.sampled_from(sorted(PREFIXES)),
    st.sampled_from(sorted(UNITS)),
)
def test_a_quantity_is_rounded_once(number: Any, prefix: str, name: str) -> None:
    """As the decimal number in SI units that it is, to the last bit."""
    size, powers = UNITS[name]
    exact = Fraction(str(number)) * Fraction(size) * Fraction(10) ** PREFIXES[prefix]
    if prefix + name in UNITS or prefix + name in ("min", "atm"):
        return  # has a meaning of its own
    assert quantity("x", f"{number} {prefix}{name}", None) == float(exact)
    assert read_unit(prefix + name).powers == powers


@pytest.mark.parametrize("text", ["", "foo", "5", "m^", "m//s", "umm", "K", "m/"])
def test_what_is_no_unit_is_refused(text: str) -> None:
    with pytest.raises(SceneError, match="unit"):
        read_unit(text)


def test_expressions_and_plain_numbers_stay_as_they_are() -> None:
    for value in ("2*t", "1e-3*(1 + sin(t))", "2e-5 - 1e-7*t", "t", 3.0, 5, None, {"file": "5 um.csv"}, (1.0, 2.0)):
        assert plain("x", value, LENGTH) is value or plain("x", value, LENGTH) == value
    assert plain("x", ["1 um", 2.0], LENGTH) == [1e-6, 2.0]


def scene(**changed: Any) -> softdyn.Scene:
    told: dict[str, Any] = {
        "law": "droplet", "parameters": {"R": "50 um", "eta": "1 mPa s", "sigma": "30 mN/m"}, "h": "1 um",
        "force": "20 nN", "until_t": "1 ms",
    }  # fmt: skip
    return softdyn.Scene(**{**told, **changed})


def test_python_and_files_take_units_and_give_what_si_numbers_give(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(
        'law = "droplet"\nparameters = {R = "50 um", eta = "1 mPa s", sigma = "30 mN/m"}\npair = {h = "1 um"}\n'
        'drive = {force = "20 nN"}\nuntil = {t = "1 ms"}\n'
    )
    bare = softdyn.Scene(
        law="droplet", parameters={"R": 50e-6, "eta": 1e-3, "sigma": 0.03}, h=1e-6, force=20e-9, until_t=1e-3
    )
    assert scene() == bare
    assert softdyn.read_scene(path) == bare
    spring = scene(force=None, spring={"stiffness": "0.05 N/m", "base": "101 um"})
    assert spring.spring == {"stiffness": 0.05, "base": 101e-6}
    falling = Gravity(["0 m/s^2", "-9.81 m/s^2"], density="1.05 g/cm^3")  # type: ignore[list-item, arg-type]
    assert (falling.acceleration, falling.density) == ([0.0, -9.81], 1050.0)


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"h": "1 Pa"}, r"\[pair\] h = '1 Pa' is in Pa, and m is needed"),
    ({"h": "1 furlong"}, r"\[pair\] h = '1 furlong': .*'furlong' is not known"),
    (
        {"parameters": {"R": "50 um", "eta": "1 mPa", "sigma": 0.03}},
        r"\[parameters\] eta = '1 mPa' is in Pa, and Pa s is",
    ),
    ({"force": "1 nN/m"}, r"\[drive\] force = '1 nN/m' is in N/m, and N is needed"),
    ({"force": None, "spring": {"stiffness": "1 N", "base": 1.0}}, r"spring: stiffness = '1 N' is in N, and N/m"),
]


@pytest.mark.parametrize(("changed", "words"), REFUSED)
def test_a_unit_of_another_dimension_is_refused(changed: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        scene(**changed)


def test_the_schema_for_editors_knows_units() -> None:
    fastjsonschema = pytest.importorskip("fastjsonschema")
    valid = fastjsonschema.compile(schema())
    told = {
        "law": "droplet", "parameters": {"R": "50 um", "eta": "1 mPa s", "sigma": 0.03}, "pair": {"h": "1 um"},
        "drive": {"force": "20 nN"}, "until": {"t": "1 ms"},
    }  # fmt: skip
    valid(told)
    with pytest.raises(fastjsonschema.JsonSchemaException):
        valid({**told, "pair": {"h": "soon"}})


def test_quantities_of_pint_are_taken() -> None:
    pint = pytest.importorskip("pint")
    unit = pint.UnitRegistry()
    made = scene(h=1 * unit.um, parameters={"R": 50 * unit.um, "eta": 1 * unit.cP, "sigma": 30 * unit.mN / unit.m})
    assert made.h == pytest.approx(1e-6, rel=1e-15)
    assert made.parameters == pytest.approx({"R": 50e-6, "eta": 1e-3, "sigma": 0.03}, rel=1e-15)
    with pytest.raises(SceneError, match="kelvin is no unit of mass, length or time"):
        scene(h=1 * unit.K)
    with pytest.raises(SceneError, match="is in Pa, and m is needed"):
        scene(h=1 * unit.Pa)
