"""Potentials: what follows from a declaration, its limits, kernels on two targets, and what is refused."""

import math
from dataclasses import replace
from itertools import pairwise

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sympy import Float, Function, Rational, S, Symbol, exp, lambdify, log, oo, sqrt

from softdyn.api import check
from softdyn.cli import main
from softdyn.derive.dimensions import ENERGY, FORCE, LENGTH
from softdyn.derive.law import Limit
from softdyn.derive.potential import Potential, age, contact, r, sample_values
from softdyn.derive.potential_limits import check_potential_limits
from softdyn.errors import LawError, SceneError
from softdyn.laws import find, find_potential, load_potential, stock_potentials
from softdyn.particles.potential_kernels import activities, energies_and_forces, get_potential_kernel
from softdyn.study.potential_text import at_typical_values

STOCK = sorted(stock_potentials())
e, d = Symbol("e", positive=True), Symbol("d", positive=True)
WELL = Potential("well", e * (r / d - 1) ** 2, parameters={e: ENERGY, d: LENGTH}, typical={e: 1, d: 2})


def stock(name: str) -> Potential:
    """A stock potential."""
    return load_potential(find_potential(name))[0]


def in_50_digits(potential: Potential, at: float, touching: float) -> list[mpmath.mpf]:
    """U and minus its first three derivatives, by Taylor's series of the declared energy, with 60 digits."""
    values = {**sample_values(potential), contact: Rational(touching)}
    with mpmath.workdps(60):
        energy = lambdify([r], potential.energy.subs({x: v for x, v in values.items() if x != r}), "mpmath")
        series = mpmath.taylor(energy, mpmath.mpf(at), 3)
        return [series[0], -series[1], -2 * series[2], -6 * series[3]]


def distances(potential: Potential) -> np.ndarray:
    """Distances within the domain of a potential, near its rest and far, at typical values."""
    low, high = (float(S(end).subs(sample_values(potential))) for end in potential.domain)
    if np.isinf(high):
        return np.array([1.0, 1.5, 1.9999, 2.0001, 2.5, 4.0, 9.0])
    return low + (high - low) * np.array([1e-3, 0.2, 0.4999, 0.50001, 0.7, 0.99, 0.999999])


@pytest.mark.parametrize(("name", "target"), [*((name, "c") for name in STOCK), ("fene", "numba")])
def test_kernels_are_the_declared_energy_and_its_derivatives(name: str, target: str) -> None:
    """To a few roundings of the sum of their terms' sizes, where terms cancel; both targets give the same bits."""
    potential, kernel = stock(name), get_potential_kernel(name, target)
    values = sample_values(potential)
    p = np.array([float(values[symbol]) for symbol in potential.parameters])
    at = distances(potential)
    found = energies_and_forces(kernel, p, at, np.full(len(at), 1.5))
    for k, (distance, *those) in enumerate(zip(at, *found, strict=True)):
        exact = in_50_digits(potential, distance, 1.5)
        # each is as uncertain as the distance is: by its slope times a rounding
        for one, (value, slope) in zip(those, pairwise(exact), strict=False):
            assert abs(one - value) < 1e-14 * (abs(value) + abs(slope) * distance), (name, k)
    if target == "numba":
        other = energies_and_forces(get_potential_kernel(name, "c"), p, at, np.full(len(at), 1.5))
        assert np.array_equal(found, other)


def test_small_extensions_and_energies_lose_no_digits() -> None:
    """A spring that is hardly stretched has k x^2/2 to rounding, where log(1 - x^2) would leave one digit."""
    kernel = get_potential_kernel("fene")
    at = np.array([2 + 2.0**-24])
    U, F, _ = energies_and_forces(kernel, np.array([1.0, 1.0, 2.0]), at, at)
    assert U[0] == pytest.approx(2.0**-49, rel=1e-13)
    assert F[0] == pytest.approx(-(2.0**-24), rel=1e-13)


def test_beyond_its_domain_a_potential_has_no_value() -> None:
    kernel = get_potential_kernel("fene")
    at = np.array([1.0, 1.0001, 2.9999, 3.0, 3.5])
    for values in energies_and_forces(kernel, np.array([1.0, 1.0, 2.0]), at, at):
        assert np.array_equal(np.isfinite(values), [False, True, True, False, False])


@settings(max_examples=40, deadline=None)
@given(st.floats(0.5, 6.0), st.floats(0.1, 10.0), st.floats(0.2, 6.0))
def test_forces_are_minus_the_slope_of_the_energy(at: float, depth: float, width: float) -> None:
    """By differences of the kernel's own energies: an error of h^2 U'''/6 and of rounding over h."""
    kernel, h = get_potential_kernel("morse"), 1e-5
    three = np.array([at - h, at, at + h])
    U, F, F_r = energies_and_forces(kernel, np.array([depth, width, 2.0]), three, three)
    largest = np.exp(2 * width * abs(at - 2.0)) if at < 2 else 1.0
    scale = 10 * depth * width * largest
    assert (U[0] - U[2]) / (2 * h) == pytest.approx(F[1], abs=scale * (width**2 * h**2 * 10 + 1e-16 / h * 4 / width))
    assert (F[2] - F[0]) / (2 * h) == pytest.approx(
        F_r[1], abs=scale * width * (width**2 * h**2 * 20 + 1e-16 / h * 4 / width)
    )


def test_activation_grows_with_age_and_shear_rate() -> None:
    """(1 - exp(-age/tau)) s^2/(1 + s^2), and its slope in the age; 1 of a potential without."""
    kernel, p = get_potential_kernel("platelet"), np.array([1.0, 4.0, 2.0, 0.5, 3.0])
    ages = np.array([0.0, 1e-9, 0.5, 50.0])
    factor, slope = activities(kernel, p, -6.0, ages)
    assert factor == pytest.approx(-np.expm1(-ages / 0.5) * 0.8, rel=1e-14, abs=1e-300)
    assert slope == pytest.approx(np.exp(-ages / 0.5) / 0.5 * 0.8, rel=1e-14)
    factor, slope = activities(get_potential_kernel("morse"), np.array([1.0, 4.0, 2.0]), 1.0, ages)
    assert (factor == 1).all()
    assert (slope == 0).all()


@pytest.mark.parametrize("name", STOCK)
def test_claims_of_stock_potentials_are_proved(name: str) -> None:
    findings = check(name)
    assert findings
    assert {finding.verdict for finding in findings} == {"proved"}


def test_wrong_claims_are_disproved_with_the_ratio() -> None:
    De, b, at = (Symbol(name, positive=True) for name in ("De", "b", "d"))
    half = Limit("rest", order=(r - at, 1 / b), claims={"F": -De * b**2 * (r - at)})
    wrong = replace(stock("morse"), limits=(half,))
    (finding,) = check_potential_limits(wrong)
    assert finding.verdict == "disproved"
    assert finding.ratio == 2


def test_commands_list_check_and_derive(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["potentials"]) == 0
    assert "fene           a spring that cannot be stretched beyond a length" in capsys.readouterr().out
    assert main(["check", "fene"]) == 0
    assert "3 proved" in capsys.readouterr().out
    assert main(["derive", "lennard_jones"]) == 0
    assert "F = 24*epsilon*sigma**6*(-r**6 + 2*sigma**6)/r**13" in capsys.readouterr().out
    assert main(["regimes", "morse"]) != 0
    assert "'morse' is a potential" in capsys.readouterr().err


def test_ten_lines_in_a_file_are_a_potential(tmp_path, capsys: pytest.CaptureFixture[str]) -> None:
    """As in the documentation: declared, checked and run."""
    file = tmp_path / "soft_core.py"
    file.write_text(
        "from sympy import Symbol, exp\n"
        "from softdyn.derive.dimensions import ENERGY, LENGTH\n"
        "from softdyn.derive.law import Limit\n"
        "from softdyn.derive.potential import Potential, r\n"
        'A, w = Symbol("A", positive=True), Symbol("w", positive=True)\n'
        'soft_core = Potential("soft_core", A * exp(-((r / w) ** 2)), parameters={A: ENERGY, w: LENGTH},\n'
        '    limits=(Limit("near", order=(r, w), claims={"F": 2 * A * r / w**2}),))\n'
    )
    assert main(["check", str(file)]) == 0
    assert "1 proved" in capsys.readouterr().out
    one = np.array([1.0])
    U, F, F_r = energies_and_forces(get_potential_kernel(file), np.array([2.0, 1.0]), one, one)
    assert (U[0], F[0], F_r[0]) == pytest.approx((2 / np.e, 4 / np.e, -4 / np.e), rel=1e-14)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"energy": e * r}, "the dimension .*; energy is expected"),
        ({"energy": e * exp(-r)}, "must be dimensionless"),
        ({"energy": e * Symbol("rr") / d}, "symbol 'rr' is not allowed here; .*; did you mean 'r'"),
        ({"energy": e * Symbol("r") / d}, "this 'r' is another symbol than softdyn's"),
        ({"energy": e * Float(0.5) * r / d}, "0.5.* is inexact"),
        ({"energy": e * Function("f")(r / d)}, "is an undefined function"),
        ({"energy": e * exp(-age)}, "age may stand in activation alone"),
        ({"energy": e}, "does not depend on the distance r: it makes no force"),
        ({"energy": 1.5}, "is a float, not a sympy expression"),
        ({"name": "My well"}, "must be a lower-case identifier"),
        ({"activation": age}, "activation: age has the dimension time"),
        ({"activation": r / d}, "symbol 'r' is not allowed here"),
        ({"domain": (0, e)}, "domain: e has the dimension energy; length is expected"),
        ({"domain": d}, "needs two distances"),
        ({"parameters": {e: ENERGY, d: LENGTH, Symbol("contact", positive=True): LENGTH}}, "may use already"),
        ({"parameters": {e: ENERGY, d: LENGTH, Symbol("F", real=True): FORCE}}, "one of the paper's symbols"),
        ({"typical": {e: 1, d: -2}}, "d = -2 lies outside its range"),
        ({"limits": (Limit("x", order=(r, e), claims={}),)}, "compares energy with length"),
        ({"limits": (Limit("x", order=(r, d), claims={"zeta": d}),)}, "cannot claim 'zeta'; one can claim 'U', 'F'"),
        ({"limits": (Limit("x", order=(r, d), claims={"F": e}),)}, "has the dimension energy; force is expected"),
        ({"limits": (Limit("x", order=(r + sqrt(r * d), d), claims={}),)}, "is no product of powers"),
    ],
)
def test_wrong_declarations_are_refused(changes: dict, message: str) -> None:
    with pytest.raises(LawError, match=message):
        replace(WELL, **changes)


def test_all_faults_are_told_at_once() -> None:
    with pytest.raises(LawError, match="potential 'well' has 2 faults"):
        Potential("well", e * log(r), parameters={e: ENERGY}, domain=(0, oo), typical={d: 1})


def test_names_that_mean_nothing_are_refused() -> None:
    with pytest.raises(SceneError, match="unknown potential 'mors'; did you mean 'morse'"):
        find_potential("mors")
    with pytest.raises(SceneError, match="a potential must be a name, a path or a Potential, not 3"):
        find_potential(3)
    with pytest.raises(SceneError, match="'morse' is a potential, and a law is asked for"):
        find("morse")


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        # at De = 1, b = 4, d = 2: the force falls least at r = d + ln(2)/b
        ("morse", {"rest": 2.0, "stiffness": 32.0, "pull_off": 2.0, "pulled_to": 2 + math.log(2) / 4}),
        # at epsilon = 1, sigma = 2: r = 2^(1/6) sigma, and (26/7)^(1/6) sigma
        (
            "lennard_jones",
            {
                "rest": 2 ** (7 / 6),
                "stiffness": 72 / 2 ** (1 / 3) / 4,
                "pull_off": 12 * ((7 / 26) ** (7 / 6) - 2 * (7 / 26) ** (13 / 6)),
                "pulled_to": 2 * (26 / 7) ** (1 / 6),
            },
        ),
        ("hooke", {"rest": 2.0, "stiffness": 1.0}),
        ("fene", {"rest": 2.0, "stiffness": 1.0}),
        ("yukawa", {}),
    ],
)
def test_what_is_asked_first_of_a_potential(name: str, expected: dict[str, float]) -> None:
    """Against formulas by hand; a bond that hardens up to its end has no force that parts it."""
    found = at_typical_values(stock(name))
    assert found.keys() == expected.keys()
    for key, value in expected.items():
        # a minimum is found to the root of the rounding
        assert found[key] == pytest.approx(value, rel=1e-6 if key == "pulled_to" else 1e-9), key


def test_what_is_asked_first_is_found_in_any_unit() -> None:
    """Of Morse's potential in metres, whose well is nanometres wide."""
    morse = stock("morse")
    depth, steep, place = (Symbol(one, positive=True) for one in ("De", "b", "d"))
    found = at_typical_values(replace(morse, typical={depth: 1, steep: 4 * 10**9, place: Rational(2, 10**9)}))
    assert found["rest"] == pytest.approx(2e-9, rel=1e-9)
    assert found["pulled_to"] == pytest.approx((2 + math.log(2) / 4) * 1e-9, rel=1e-6)
    assert found["pull_off"] == pytest.approx(2e9, rel=1e-9)


def test_who_asks_regimes_of_a_potential_is_told_what_there_is() -> None:
    with pytest.raises(SceneError, match=r"softdyn derive morse tells .* softdyn check morse"):
        find("morse")
