"""The generated contact kernel: its equation, its tangent, and its manners at the extremes."""

from __future__ import annotations

import itertools
import math
from typing import Any

import mpmath
import numpy as np
import pytest
from invented_laws import GENERAL, LAWS
from kernels_by_text import compile_c, import_text
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from sympy import Abs, Rational, Symbol, diff, exp, lambdify, limit, log, oo, simplify, sqrt

from softdyn.derive import DIMENSIONLESS, FORCE, LENGTH, ContactLaw, E, R, a, delta, eta, h
from softdyn.derive.contact_equations import STATE, ContactNeeds, g, stage_equation
from softdyn.derive.contact_kernel import contact_ir
from softdyn.derive.emit import emit
from softdyn.derive.law import sample_values
from softdyn.derive.laws.rognon_gay import law as rognon_gay
from softdyn.derive.soundness import relative_slope
from softdyn.errors import LawError
from softdyn.laws import find, load, stock_laws
from softdyn.particles.contact_kernels import ContactKernel, get_contact_kernel
from softdyn.particles.geometry import Box, bare_contacts, directions, find_pairs, lattice
from softdyn.particles.method import ERROR, NODES, STAGES, WEIGHTS
from softdyn.targets import TARGETS
from softdyn.traits import traits_of

Array = NDArray[np.float64]

low, step, s_own = Symbol("low", positive=True), Symbol("step", positive=True), Symbol("g", positive=True)
#: A law whose parameters have the names of the kernel's own variables.
awkward = ContactLaw(
    name="awkward",
    a=sqrt(2 * R * (R * h / (R + h) + Abs(delta))),
    F_ela=Rational(4, 9) * E * a * delta,
    zeta=step * eta * a**4 / h**3,
    F_adh=low * exp(-h / s_own),
    parameters={low: FORCE, step: DIMENSIONLESS, s_own: LENGTH},
)


def solve(
    kernel: ContactKernel, s: float, overlap: Array, start: Array, target: Array, y: Array, p: Array, q: Any = None
) -> tuple[int, Array, Array, Array, Array]:
    """y, gap, force and tangent, and how many contacts have none."""
    y = y.copy()
    gap, F, F_r = np.empty_like(y), np.empty_like(y), np.empty_like(y)
    reach = (0.5,) if kernel.fading else ()
    rows = np.empty(0) if q is None else np.ascontiguousarray(q).reshape(-1)
    unsolved = kernel.contacts(len(y), float(s), *reach, overlap, start, target, p, rows, y, gap, F, F_r)
    return unsolved, y, gap, F, F_r


def states(seed: int, n: int, nearest: float = -4.0) -> tuple[Array, Array]:
    """Overlaps and gaps of contacts that are pressed and pulled."""
    draw = np.random.default_rng(seed)
    start = 10 ** draw.uniform(nearest, -0.5, n)
    deflection = 10 ** draw.uniform(-4, -1, n) * draw.choice([1, 1, -0.3], n)
    return 2 * deflection - start + 0.1 * draw.uniform(-1, 1, n) * start, start


def test_the_state_maps_the_gap_onto_all_numbers() -> None:
    """It grows with the gap, from minus to plus infinity, and equals ln(h/g) to second order."""
    assert diff(STATE, h).is_positive
    assert [limit(STATE, h, end, "+" if end == 0 else "-") for end in (0, oo)] == [-oo, oo]
    assert diff(STATE, h).subs(h, g) == 1 / g
    assert simplify(diff(STATE, h, 2).subs(h, g) + 1 / g**2) == 0


@pytest.mark.slow
def test_the_derivation_checks_itself() -> None:
    assert [symbol.name for symbol in stage_equation()] == [
        "rho",
        "rho_h",
        "rho_r",
        "H",
        "H_h",
        "H_r",
        "h_r",
        "F",
        "F_r",
        "F_by_gap",
        "F_by_distance",
    ]


@pytest.mark.parametrize("fading", [False, True])
@pytest.mark.parametrize("s", [0.0, 1e-3, 1.0, 1e3, 1e8])
def test_the_solution_solves_the_equation_in_thirty_digits(s: float, fading: bool) -> None:
    """F (y - y*) + s y_h F_ela/zeta = 0 for the law as printed in the paper; the residual against the sum of its terms.

    In a contact with a range, the film of a pressed one fades, f = w, and the force of a pulled one, F = w F_ela.
    """
    kernel = get_contact_kernel("rognon_gay", "c", fading=fading)
    overlap, start = states(3, 200, -2.0)
    draw = np.random.default_rng(4)
    target = draw.uniform(-0.5, 0.5, 200)
    unsolved, _y, gap, F, _ = solve(kernel, s, overlap, start, target, target, np.ones(3))
    assert unsolved == 0
    worst = 0.0
    with mpmath.workdps(30):
        for values in zip(overlap.tolist(), start.tolist(), target.tolist(), gap.tolist(), F.tolist(), strict=True):
            over, first, aim, here, force = map(mpmath.mpf, values)
            deflection = (over + here) / 2
            bar = here / (1 + here)
            radius = mpmath.sqrt(2 * (bar + abs(deflection)))
            elastic = mpmath.mpf(4) / 9 * radius * deflection
            zeta = 3 * mpmath.pi * radius**4 / (2 * bar**3)
            ahead = max(0, min(1, 2 * (mpmath.mpf(0.5) - here) / mpmath.mpf(0.5)))
            fade = ahead**2 * (3 - 2 * ahead) if fading else 1
            weight, grip = (1, fade) if deflection < 0 else (fade, 1)
            state = (here / first - first / here) / 2
            rate = mpmath.mpf(s) * (1 / first + first / here**2) / 2 / zeta
            # what one unit in the last place of h or of the overlap changes in the force counts as rounding
            rounding = rate * radius * (abs(over) + here)
            size = weight * (abs(state) + abs(aim)) + rate * abs(elastic) + rounding + mpmath.mpf(1e-300)
            worst = max(worst, float(abs(weight * (state - aim) + rate * elastic) / size))
            assert abs(force - grip * elastic) <= 1e-12 * (abs(elastic) + radius * (abs(over) + here))
    assert worst < 1e-12


@pytest.mark.parametrize("s", [0.0, 1e-2, 1.0, 1e2, 1e4])
@pytest.mark.parametrize(
    ("name", "fading"),
    [*((name, False) for name in [*LAWS, *GENERAL, "awkward"]), ("rognon_gay", True), ("screened", True)],
)
def test_the_tangent_is_the_derivative_of_the_force(name: str, s: float, fading: bool) -> None:
    """Central differences: their error is of the order step^2, and rounding/step."""
    law = {**LAWS, **GENERAL, "awkward": awkward}[name]
    kernel = get_contact_kernel(law, "c", fading=fading)
    values = {"R": 1.0, "E": 1.0, "eta": 1.0, "strength": 1e-3, "ell": 0.1, "tilt": 0.5, "rim": 0.3, "brush": 0.02}
    values |= {"thickness": 0.1, "softness": 0.8, "work": 1e-3}
    p = np.array([{**values, "low": 1e-3, "step": 3.0, "g": 0.1}[name] for name in kernel.uniform])
    overlap, start = states(5, 300, -2.0)
    kept = np.abs(overlap + start) > 1e-3  # away from the kink at delta = 0
    overlap, start = overlap[kept], start[kept]
    nothing = np.zeros(len(start))
    unsolved, y, _gap, _F, F_r = solve(kernel, s, overlap, start, nothing, nothing, p)
    assert unsolved == 0
    step = 1e-5 * start
    ahead = solve(kernel, s, overlap + step, start, nothing, y, p)[3]
    behind = solve(kernel, s, overlap - step, start, nothing, y, p)[3]
    difference = -(ahead - behind) / (2 * step)  # r falls as the overlap rises
    close = np.abs(difference - F_r) <= 1e-4 * np.abs(F_r) + 1e-6 * np.abs(F_r).max()
    # the few others sit at a kink of the law: a branch, or the edge of the range
    assert np.mean(close) > 0.98


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
def test_no_step_makes_a_gap_that_is_none(target: str) -> None:
    """Any step, any motion of the centres, gaps from 1e-9 to 1e2: each gap is positive and finite, or nan."""
    kernel = get_contact_kernel("rognon_gay", target, fading=False)
    draw = np.random.default_rng(6)
    n = 20_000
    start = 10 ** draw.uniform(-9, 2, n)
    overlap = draw.uniform(-3, 1.5, n) * 10 ** draw.uniform(-8, 0.3, n)
    target_y = draw.standard_normal(n) * 10 ** draw.uniform(-3, 3, n)
    for s in (0.0, 1e-8, 1.0, 1e8, 1e16):
        unsolved, _y, gap, F, F_r = solve(kernel, s, overlap, start, target_y, draw.standard_normal(n), np.ones(3))
        good = np.isfinite(F) & np.isfinite(F_r)
        assert int(np.sum(~good)) == unsolved
        assert unsolved <= 1e-3 * n
        assert np.all(gap[good] > 0)
        assert np.all(np.isfinite(gap[good]))


def test_a_contact_beyond_its_range_exerts_no_force() -> None:
    """Whatever the step: the surfaces of a pressed one are undeformed, one that was pulled relaxes by itself."""
    kernel = get_contact_kernel("rognon_gay", "c", fading=True)
    apart = np.linspace(0.51, 2.0, 40)
    for s in (1e-3, 1.0, 1e5):
        unsolved, _, gap, F, F_r = solve(kernel, s, -apart, np.full(40, 0.6), np.zeros(40), np.zeros(40), np.ones(3))
        assert unsolved == 0
        pressed = apart < 0.6
        np.testing.assert_allclose(gap[pressed], apart[pressed], rtol=1e-12)
        assert np.all(gap[~pressed] <= apart[~pressed] * (1 + 1e-12))
        assert np.abs(F).max() < 1e-13
        assert np.abs(F_r).max() < 1e-9


def test_the_force_of_a_pulled_contact_vanishes_with_its_range() -> None:
    """At a given deflection, in a short step: F = w F_ela, with w <= 48 left^2 and |F_ela| <= 4e-3 here."""
    kernel = get_contact_kernel("rognon_gay", "c", fading=True)
    left = np.geomspace(1e-6, 0.2, 30)  # to the range of 0.5
    gap, nothing = 0.5 - left, np.zeros(30)
    F = solve(kernel, 1e-6, -0.02 - gap, gap, nothing, nothing, np.ones(3))[3]
    assert np.all(F <= 0)
    assert np.all(np.abs(F) <= 4e-3 * 48 * left**2 * (1 + 1e-6) + 1e-12)
    assert F[-1] < -1e-3


def test_lanes_do_not_depend_on_their_neighbours() -> None:
    """Any number of contacts, in any order, to the bit."""
    kernel = get_contact_kernel("rognon_gay", "c", fading=False)
    overlap, start = states(7, 37)
    nothing = np.zeros(37)
    together = solve(kernel, 3.0, overlap, start, nothing, nothing, np.ones(3))
    for c in range(37):
        one = slice(c, c + 1)
        alone = solve(kernel, 3.0, overlap[one], start[one], nothing[one], nothing[one], np.ones(3))
        assert [values[c] for values in together[1:]] == [values[0] for values in alone[1:]]


def test_varying_parameters_are_those_of_each_contact() -> None:
    kernel = get_contact_kernel("rognon_gay", "c", varying=("R", "E"))
    assert (kernel.uniform, kernel.varying) == (("eta",), ("R", "E"))
    plain = get_contact_kernel("rognon_gay", "c")
    overlap, start = states(8, 20)
    nothing = np.zeros(20)
    q = np.random.default_rng(9).uniform(0.5, 2, (2, 20))
    mixed = solve(kernel, 2.0, overlap, start, nothing, nothing, np.ones(1), q)
    for c in range(20):
        one = slice(c, c + 1)
        alone = solve(plain, 2.0, overlap[one], start[one], nothing[one], nothing[one], np.array([*q[:, c], 1.0]))
        assert mixed[3][c] == pytest.approx(alone[3][0], rel=1e-14)


@pytest.mark.parametrize("target", TARGETS)
def test_the_text_stands_alone(target: str, tmp_path: Any) -> None:
    """It compiles by itself, says where it comes from, and holds no remote force where the law has none."""
    needs = ContactNeeds(varying=("R",), fading=True)
    text, remote = (emit(contact_ir(law, needs), target) for law in (rognon_gay, LAWS["screened"]))
    assert "arXiv:0803.1573" in text
    code, with_remote = (one.split("#include" if target == "c" else "import numba", 1)[1] for one in (text, remote))
    assert "F_adh" not in code
    assert "F_adh" in with_remote
    library = compile_c(text, tmp_path) if target == "c" else import_text(text, tmp_path)
    assert library.rognon_gay_contacts
    assert contact_ir(rognon_gay, ContactNeeds()).savings[0].rule == "no range"


def test_unknown_parameters_are_refused() -> None:
    with pytest.raises(LawError, match="'K' is no parameter; there are R, E, eta"):
        contact_ir(rognon_gay, ContactNeeds(varying=("K",)))


def test_the_method_is_of_order_three_l_stable_and_stiffly_accurate() -> None:
    """The order conditions; no growth on the imaginary axis, none left at infinity; the estimate has order 2."""
    c, A, b = NODES, STAGES, WEIGHTS
    np.testing.assert_allclose(A.sum(axis=1), c, rtol=1e-14)
    conditions = [b.sum() - 1, b @ c - 1 / 2, b @ c**2 - 1 / 3, b @ A @ c - 1 / 6]
    assert np.abs(conditions).max() < 1e-15
    assert np.array_equal(A[-1], b)
    assert 1 - b @ np.linalg.solve(A, np.ones(3)) == pytest.approx(0, abs=1e-14)
    frequencies = 1j * np.geomspace(0.01, 1e4, 400)
    growth = [abs(1 + z * b @ np.linalg.solve(np.eye(3) - z * A, np.ones(3))) for z in frequencies]
    assert max(growth) <= 1 + 1e-14
    assert abs(ERROR.sum()) + abs(ERROR @ c) < 1e-15 < abs(ERROR @ c**2)


@pytest.mark.parametrize("strain", [0.0, 0.3, 0.5, 1.7, -4.2])
@pytest.mark.parametrize("d", [2, 3])
def test_pairs_are_found_in_a_sheared_box(d: int, strain: float) -> None:
    """Against all pairs of all images, with positions that have left the box by several lengths."""
    draw = np.random.default_rng(10)
    lengths = np.array([9.0, 8.0, 8.5])[:d]
    box = Box(lengths, 1.0)
    cell = lattice(box, strain)
    radii = draw.uniform(0.5, 0.8, 40)
    x = draw.uniform(0, 1, (40, d)) @ cell.T + draw.integers(-3, 4, (40, d)) @ cell.T
    i, j, shift = find_pairs(x, radii, box, strain, (), 0.4)
    found = {(int(a), int(b), *map(int, s)) for a, b, s in zip(i, j, shift, strict=True)}
    assert len(found) == len(i) > 15
    ranges = [range(-20, 21)] * d
    images = np.array(np.meshgrid(*ranges)).reshape(d, -1).T
    tree = cKDTree(images @ cell.T)
    expected = set()
    for one in range(40):
        for other in range(one + 1, 40):
            near = tree.query_ball_point(x[one] - x[other], radii[one] + radii[other] + 0.4)
            expected |= {(one, other, *map(int, images[k])) for k in near}
    assert found == expected
    n, r = directions(bare_contacts(i, j, shift, radii), x, cell, ())
    np.testing.assert_allclose(n * r[:, None], x[j] + shift @ cell.T - x[i], atol=1e-12)
    assert math.isclose(np.linalg.norm(n, axis=1).max(), 1)


def test_contacts_span_any_number_of_boxes() -> None:
    """Positions are never wrapped: a particle that was carried 40000 boxes further still meets those that were not."""
    box = Box(np.array([9.0, 8.0]))
    x = np.array([[1.0, 1.0], [3.1 + 9.0 * 40_000, 1.0]])
    contacts = bare_contacts(*find_pairs(x, np.ones(2), box, 0.0, (), 0.4), np.ones(2))
    assert contacts.shift.tolist() == [[-40_000, 0]]
    assert directions(contacts, x, lattice(box, 0.0), ())[1] == pytest.approx(2.1)


@pytest.mark.parametrize("name", [name for name in stock_laws() if traits_of(name).kind == "film"])
def test_relative_slopes_of_the_friction_are_those_of_its_logarithm(name: str) -> None:
    """As kernels have them, factor by factor and without the sums that cancel: in fifty digits, on both sides."""
    law, _ = load(find(name))
    numbers = {R: 1, E: 1, eta: 1, **sample_values(law)}
    radius = lambdify((h, delta), law.a.subs(numbers), "mpmath")
    for variable in (a, h, delta):
        slope, exact = relative_slope(law.zeta, variable), diff(log(law.zeta), variable)
        found, expected = (lambdify((a, h, delta), expr.subs(numbers), "mpmath") for expr in (slope, exact))
        with mpmath.workdps(50):
            for gap, depth in itertools.product(("1e-9", "0.01", "1", "50"), ("-0.3", "-1e-9", "1e-9", "0.3")):
                state = mpmath.mpf(gap), mpmath.mpf(depth)
                at = radius(*state), *state
                assert mpmath.almosteq(found(*at), expected(*at), 1e-45, 1e-60), (variable, state)
