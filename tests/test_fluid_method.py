"""Linear solvers, Newton's method and steps in time of the fluid, on equations whose solutions are known."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.sparse import bmat, csc_matrix, csr_matrix, diags, eye, hstack, kron
from scipy.sparse.linalg import splu

from softdyn.bench.fluid_bench import cavity
from softdyn.errors import IntegrationError
from softdyn.fluid.flow_system import prepared
from softdyn.fluid.fluid_run import solver_arrays, solver_from
from softdyn.fluid.fronts import FrontFactor, fronts_of
from softdyn.fluid.linear_solvers import LINEAR_RESIDUAL, NAMES, LinearFailed, LinearSolver, dissected, scales_of
from softdyn.fluid.march import FlowState, FlowStep, Stepping, begun, march
from softdyn.fluid.newton import MUST, NewtonFailed, solve
from softdyn.fluid.time_steps import derivative, error_share, length_to, next_length, predicted
from softdyn.fluid.unknowns import Unknowns, unknowns_of

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

NONE = np.empty((0, 2), dtype=np.int64)


def grid(n: int) -> tuple[csr_matrix, Array]:
    """Laplace's matrix of n x n points, and their places."""
    line = diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(n, n))
    place = np.stack(np.meshgrid(np.arange(n), np.arange(n), indexing="ij"), axis=-1).reshape(-1, 2)
    return csr_matrix(kron(line, eye(n)) + kron(eye(n), line)), place.astype(float)


def test_nested_dissection_is_an_order_with_less_fill_than_that_of_columns() -> None:
    # velocities at all points, pressures at every second one along each axis, as Taylor and Hood's elements have them
    n = 41
    matrix, places = grid(n)
    slope = diags([-1.0, -2.0, 2.0, 1.0], [-2, -1, 1, 2], shape=(n, n)).tocsr()[::2]
    mean = diags([1.0, 2.0, 4.0, 2.0, 1.0], [-2, -1, 0, 1, 2], shape=(n, n)).tocsr()[::2]
    divergence = hstack([kron(slope, mean), kron(mean, slope)])
    saddle = csc_matrix(bmat([[kron(np.eye(2), matrix), divergence.T], [divergence, None]]))[:-1, :-1]
    places = np.vstack([places, places, 2 * grid((n + 1) // 2)[1]])[:-1]
    order, _ = dissected(csr_matrix(abs(saddle) @ abs(saddle)), places)
    assert np.array_equal(np.sort(order), np.arange(len(places)))
    options = {"SymmetricMode": True}
    ordered = splu(csc_matrix(saddle[order][:, order]), permc_spec="NATURAL", diag_pivot_thresh=0.0, options=options)
    usual = splu(saddle)
    assert ordered.L.nnz + ordered.U.nnz < 0.7 * (usual.L.nnz + usual.U.nnz)


def test_places_that_cannot_be_told_apart_are_not_cut() -> None:
    matrix, _ = grid(10)
    assert np.array_equal(np.sort(dissected(matrix, np.zeros((100, 2)))[0]), np.arange(100))


def test_a_zero_on_the_diagonal_is_no_obstacle() -> None:
    # the pivots stand beside it; in this order the first one is 0
    matrix = csc_matrix([[0.0, 1.0, 0.0, 3.0], [1.0, 0.0, 2.0, 0.0], [0.0, 2.0, 0.0, 1.0], [3.0, 0.0, 1.0, 0.0]])
    solver = LinearSolver(np.zeros(4, dtype=np.int64))
    solver.factorise(matrix)
    right = np.array([1.0, 2.0, 3.0, 4.0])
    assert matrix @ solver.solve(right) == pytest.approx(right)


def test_fronts_solve_as_superlu_does_and_leave_to_it_what_is_singular_part_by_part() -> None:
    matrix, places = grid(17)
    drift = diags([-0.3, 0.3], [-1, 1], shape=matrix.shape)
    order, starts = dissected(csr_matrix(matrix), places)
    lopsided = csc_matrix(csr_matrix(matrix + drift.multiply(matrix != 0))[order][:, order])
    right = np.random.default_rng(2).uniform(-1, 1, len(places))
    found = FrontFactor(fronts_of(lopsided, starts), lopsided.data).solve(right)
    np.testing.assert_allclose(found, splu(lopsided).solve(right), rtol=1e-11)
    swap = csc_matrix([[0.0, 2.0, 0.0], [1.0, 0.0, 3.0], [0.0, 1.0, 1.0]])
    solver = LinearSolver(np.zeros(3, dtype=np.int64), starts=np.arange(4))
    solver.factorise(swap)
    assert swap @ solver.solve(np.array([1.0, 2.0, 3.0])) == pytest.approx([1.0, 2.0, 3.0])
    assert solver.counts["pivoted"] == 1
    assert NAMES[solver.way] == "SuperLU"


def nearly_singular() -> tuple[csc_matrix, Indices, Array]:
    """Squares whose graph's Laplacian hardly resists an even motion: of a condition of 1e10, beyond float32."""
    matrix, places = grid(17)
    links = matrix - diags(matrix.diagonal())
    laplacian = csr_matrix(links - diags(np.asarray(links.sum(axis=1)).ravel()) + 1e-9 * diags(np.ones(len(places))))
    order, starts = dissected(laplacian, places)
    return csc_matrix(laplacian[order][:, order]), starts, np.random.default_rng(3).uniform(-1, 1, len(places))


def test_what_is_lost_in_single_precision_double_precision_solves_from_then_on() -> None:
    matrix, starts, right = nearly_singular()
    solver = LinearSolver(np.zeros(len(right), dtype=np.int64), starts=starts)
    solver.factorise(matrix)
    assert NAMES[solver.way] == "fronts, in single precision"
    solver.solve(right)
    assert NAMES[solver.way] == "fronts"
    assert solver.counts["factorisations"] == 1
    assert solver.counts["pivoted"] == 0
    assert solver.worst <= LINEAR_RESIDUAL
    solver.factorise(matrix)
    assert NAMES[solver.way] == "fronts"
    told, arrays = solver_arrays(solver)
    again = LinearSolver(solver.kinds, starts=starts)
    solver_from(again, told, arrays)
    assert NAMES[again.way] == "fronts"
    assert np.array_equal(again.solve(right), solver.solve(right))


@pytest.mark.parametrize(("unit", "force"), [(1e-200, 1e-100), (1.0, 1e-100), (1e60, 1.0), (1e150, 1e250)])
def test_single_precision_solves_in_any_units(unit: float, force: float) -> None:
    """Their numbers are far beyond those that float32 has."""
    matrix, places = grid(9)
    order, starts = dissected(csr_matrix(matrix), places)
    right = np.random.default_rng(4).uniform(-1, 1, len(places))
    solver = LinearSolver(np.zeros(len(places), dtype=np.int64), starts=starts)
    plain = csc_matrix(csr_matrix(matrix)[order][:, order])
    solver.factorise(plain * unit)
    found = solver.solve(right * force)
    assert NAMES[solver.way] == "fronts, in single precision"
    assert plain @ (found * (unit / force)) == pytest.approx(right, rel=1e-11, abs=1e-11)


def test_a_singular_matrix_is_refused() -> None:
    solver = LinearSolver(np.zeros(2, dtype=np.int64))
    solver.factorise(csc_matrix([[1.0, 1.0], [1.0, 1.0]]))
    with pytest.raises(LinearFailed, match="singular"):
        solver.solve(np.array([1.0, 0.0]))
    with pytest.raises(LinearFailed, match="no numbers"):
        solver.factorise(csc_matrix([[1.0, np.nan], [1.0, 1.0]]))


@dataclass
class Curved:
    """The matrix of a grid times x, plus x^3 times a strength, is a right side; in other units."""

    matrix: csr_matrix
    right: Array
    strength: float
    force: float = 1.0
    length: float = 1.0

    def residual(self, x: Array) -> Array:
        y = x / self.length
        return self.force * (self.matrix @ y + self.strength * y**3 - self.right)

    def linearised(self, x: Array) -> tuple[Array, csr_matrix]:
        y = x / self.length
        jacobian = self.matrix + diags(3 * self.strength * y**2)
        return self.residual(x), csr_matrix(jacobian) * (self.force / self.length)


def all_free(matrix: csr_matrix, places: Array) -> Unknowns:
    kinds = np.zeros(len(places), dtype=np.int64)
    return unknowns_of(matrix, kinds, places, np.empty(0, dtype=np.int64), NONE, np.empty((0, 2)))


def test_newton_meets_its_residual_in_all_units_alike() -> None:
    matrix, places = grid(12)
    right = np.random.default_rng(1).uniform(-1, 1, 144)
    unknowns = all_free(matrix, places)
    found = []
    for force, length in ((1.0, 1.0), (2.0**40, 2.0**-30), (2.0**-100, 2.0**60)):
        solver = LinearSolver(unknowns.free_kinds, starts=unknowns.starts)
        solution = solve(Curved(matrix, right, 5.0, force, length), unknowns, solver, np.zeros(144))
        assert solution.measure <= MUST
        found.append((solution.x / length, solution.iterations, solution.measure))
    assert all(
        np.array_equal(x, found[0][0]) and rest == found[0][1:]
        for x, *rest in map(list, found)
        for rest in [tuple(rest)]
    )
    y = found[0][0]
    assert matrix @ y + 5 * y**3 == pytest.approx(right, abs=1e-11)


def test_a_factor_serves_many_steps_of_one_length_and_each_meets_its_residual() -> None:
    """Of a lid that starts to move at Re = 1000; without that, each step would need at least one."""
    system = prepared(cavity(8, "P2-P1"))
    solver = LinearSolver(system.unknowns.free_kinds, starts=system.unknowns.starts)
    state = FlowState(0.0, 0.01, [0.0], [np.zeros(len(system.unknowns.kinds))])
    measures: list[float] = []
    stepping = Stepping(order=1, rtol=1.0, dt=0.01)
    march(system, solver, state, 0.3, 0.3, stepping, lambda step: measures.append(step.solution.measure))
    assert len(measures) == state.counts["steps"] == 30
    assert max(measures) <= MUST
    assert 3 * solver.counts["factorisations"] <= 30


class Arctangent:
    """arctan x = 0: from x = 3 Newton's steps without a search grow without bound."""

    def residual(self, x: Array) -> Array:
        return np.arctan(x)

    def linearised(self, x: Array) -> tuple[Array, csr_matrix]:
        return self.residual(x), csr_matrix(np.diag(1 / (1 + x**2)))


def test_the_line_search_keeps_newton_from_leaving() -> None:
    unknowns = all_free(csr_matrix([[1.0]]), np.zeros((1, 2)))
    solution = solve(Arctangent(), unknowns, LinearSolver(unknowns.free_kinds, starts=unknowns.starts), np.array([3.0]))
    assert solution.x[0] == pytest.approx(0, abs=1e-9)


class Above:
    """x^2 + 1 = 0, which no number solves; the second row is met."""

    def residual(self, x: Array) -> Array:
        return np.array([x[1] - 2.0, x[0] ** 2 + 1])

    def linearised(self, x: Array) -> tuple[Array, csr_matrix]:
        entries = np.array([0.0, 1.0, 2 * x[0], 0.0])
        return self.residual(x), csr_matrix((entries, [0, 1, 0, 1], [0, 2, 4]))


def test_a_residual_that_cannot_be_met_is_an_error_that_tells_the_row() -> None:
    unknowns = all_free(csr_matrix(np.ones((2, 2))), np.array([[0.0, 0.0], [1.0, 0.0]]))
    with pytest.raises(NewtonFailed) as caught:
        solve(Above(), unknowns, LinearSolver(unknowns.free_kinds, starts=unknowns.starts), np.array([2.0, 0.0]))
    assert caught.value.row == 1
    assert caught.value.measure > MUST


@given(angle=st.floats(0, 2 * math.pi), second=st.floats(0.2, 3), value=st.floats(-2, 2))
@settings(max_examples=30, deadline=None)
def test_a_wall_with_slip_may_lie_anyhow(angle: float, second: float, value: float) -> None:
    """Springs between three points in the plane: the middle one slides along a wall, another has two walls."""
    springs = csr_matrix(kron(np.eye(2), np.array([[2.0, -1.0, 0.0], [-1.0, 3.0, -1.0], [0.0, -1.0, 2.0]])))
    kinds, places = np.zeros(6, dtype=np.int64), np.tile(np.arange(3.0), 2)[:, None] * [1.0, 0.0]
    normal = np.array([math.cos(angle), math.sin(angle)])
    other = np.array([math.cos(angle + second), math.sin(angle + second)])
    slipping = np.array([[1, 4], [2, 5], [2, 5]])
    normals = np.array([normal, normal, other])
    unknowns = unknowns_of(springs, kinds, places, np.array([0]), slipping, normals)
    pull = np.array([0.0, 0.3, 0.0, 1.0, -0.7, 0.0])

    class Springs:
        def residual(self, x: Array) -> Array:
            return springs @ x - pull

        def linearised(self, x: Array) -> tuple[Array, csr_matrix]:
            return self.residual(x), springs

    given_values = np.array([0.5, value, 0.2, -0.1])
    guess = unknowns.all_of(np.zeros(unknowns.basis.shape[1]), given_values)
    found = solve(Springs(), unknowns, LinearSolver(unknowns.free_kinds, starts=unknowns.starts), guess)
    u, reaction = found.x.reshape(2, 3).T, found.residual.reshape(2, 3).T
    assert u[0, 0] == pytest.approx(0.5)
    assert u[1] @ normal == pytest.approx(value)
    if abs(math.sin(second)) > 1e-6:
        assert [u[2] @ normal, u[2] @ other] == pytest.approx([0.2, -0.1], abs=1e-6)
    # a wall without friction pushes along its normal alone, and nothing pushes what is free
    assert reaction[1] @ [-normal[1], normal[0]] == pytest.approx(0, abs=1e-9)
    assert reaction[0, 1] == pytest.approx(0, abs=1e-9)


def test_fluxes_of_a_fluid_at_rest_need_no_digits() -> None:
    """A pressure that weight balances: velocities are rounding, and so are fluxes; yet the residual is met."""
    matrix = csr_matrix([[2.0, -1.0, 1.0], [-1.0, 2.0, -1.0], [1.0, -1.0, 0.0]])
    kinds = np.array([0, 0, 1])
    scales = scales_of(abs(matrix), np.array([1e-17, 0.0, 1.0]), np.array([0.0, 0.0, 1e-17]), kinds)
    assert scales[0] == pytest.approx(1)
    assert 1e-17 / scales[1] < 1e-11


@given(
    gaps=st.lists(st.floats(0.1, 3), min_size=2, max_size=3),
    weights=st.lists(st.floats(-2, 2), min_size=3, max_size=3),
)
def test_the_derivative_is_exact_for_polynomials_of_the_order(gaps: list[float], weights: list[float]) -> None:
    times = list(-np.cumsum(gaps))
    order = len(times)
    polynomial = np.polynomial.Polynomial(weights[: order + 1])
    rate, past = derivative(times, 0.0)
    found = rate * polynomial(0.0) + sum(w * polynomial(t) for w, t in zip(past, times, strict=True))
    assert found == pytest.approx(polynomial.deriv()(0.0), abs=1e-9)


def test_the_share_of_the_error_is_that_of_a_power_one_above() -> None:
    """For u = t^3 BDF2's error and the prediction's are known: nothing is left but the share."""
    times, t = [-0.7, -1.1, -2.5], 0.0
    rate, past = derivative(times[:2], t)
    # u' is given exactly: what the step makes of it
    made = (0.0 - sum(w * one**3 for w, one in zip(past, times[:2], strict=True))) / rate
    guess = float(predicted(times, [np.array([one**3]) for one in times], t)[0])
    assert error_share(times, t, 2) * (made - guess) == pytest.approx(made - t**3)


def test_lengths_end_at_goals_without_slivers() -> None:
    assert length_to(0.0, 1.0, 1.005) == (1.005, 1.005)
    assert length_to(0.0, 1.0, 1.5) == (0.75, 0.75)
    assert length_to(0.0, 1.0, 10.0) == (1.0, 1.0)
    assert next_length(1.0, 1.0, 2) == 0.9 or next_length(1.0, 1.0, 2) == 1.0
    assert next_length(1.0, 1e-9, 2) == 2.0
    assert next_length(1.0, 8.0, 2) == pytest.approx(0.45)


@dataclass
class Pendulum:
    """A point on a circle that a spring pulls along it: a velocity, and a pressure that keeps a flux given.

    u' = -u + p + cos t , u + w = sin t , w' = -2 w : so w is known, u = sin t - w, and p = u' + u - cos t.
    """

    unknowns: Unknowns
    nonlinear: float = 0.0

    def given(self, t: float) -> Array:
        return np.empty(0)

    def equations(self, t: float, rate: float, past: Array) -> Any:
        strength = self.nonlinear

        class At:
            def residual(self, x: Array) -> Array:
                u, w, p = x
                return np.array(
                    [
                        rate * u + past[0] + u + strength * u**3 - p - math.cos(t),
                        rate * w + past[1] + 2 * w,
                        u + w - math.sin(t),
                    ]
                )

            def linearised(self, x: Array) -> tuple[Array, csr_matrix]:
                jacobian = [[rate + 1 + 3 * strength * x[0] ** 2, 0, -1], [0, rate + 2, 0], [1, 1, 0]]
                return self.residual(x), csr_matrix(np.array(jacobian, dtype=float))

        return At()

    def exact(self, t: float) -> Array:
        w = math.exp(-2 * t)
        u = math.sin(t) - w
        return np.array([u, w, math.cos(t) + 2 * w + u + self.nonlinear * u**3 - math.cos(t)])


def run(stepping: Stepping, until: float = 2.0, nonlinear: float = 0.3) -> tuple[FlowState, Pendulum, list[FlowStep]]:
    pattern = csr_matrix(np.array([[1.0, 0, 1], [0, 1, 0], [1, 1, 0]]))
    places = np.array([[0.0, 0], [1, 0], [2, 0]])
    none = np.empty(0, dtype=np.int64)
    unknowns = unknowns_of(pattern, np.array([0, 0, 1]), places, none, NONE, np.empty((0, 2)))
    flow, solver = Pendulum(unknowns, nonlinear), LinearSolver(unknowns.free_kinds, starts=unknowns.starts)
    steps: list[FlowStep] = []
    state = begun(flow, solver, flow.exact(0.0), until, stepping)
    march(flow, solver, state, until, until, stepping, steps.append)
    return state, flow, steps


@pytest.mark.parametrize(("order", "least"), [(1, 0.95), (2, 1.95)])
def test_steps_of_a_given_length_converge_with_the_order_of_the_method(order: int, least: float) -> None:
    errors = []
    for dt in (0.02, 0.01):
        state, flow, _ = run(Stepping(order, 1e-4, dt))
        errors.append(np.abs(state.xs[0] - flow.exact(2.0)))
    assert np.log2(errors[0] / errors[1]).min() > least


@pytest.mark.parametrize("order", [1, 2])
def test_adaptive_steps_follow_the_tolerance(order: int) -> None:
    errors, counts = [], []
    for rtol in (1e-4, 1e-5, 1e-6):
        state, flow, steps = run(Stepping(order, rtol))
        assert state.t == 2.0
        assert all(step.error <= 1 for step in steps if not math.isnan(step.error))
        errors.append(np.abs(state.xs[0] - flow.exact(2.0))[:2].max())
        counts.append(state.counts["steps"])
    # the error of a step goes with rtol, of which there are rtol^(-1/(order + 1))
    assert errors[2] < 0.2 * errors[0]
    assert errors[2] < 100 * 1e-6 ** (order / (order + 1))
    assert counts[2] < 1.5 * counts[0] * 100 ** (1 / (order + 1))


def test_a_start_that_does_not_fit_is_made_to() -> None:
    stepping = Stepping(2, 1e-6)
    _, flow, _ = run(stepping)
    solver = LinearSolver(flow.unknowns.free_kinds)
    given_start = flow.exact(0.0) + np.array([0.4, 0.0, 7.0])
    fitted = begun(flow, solver, given_start, 2.0, stepping)
    assert fitted.xs[0] == pytest.approx(flow.exact(0.0), abs=1e-5)


def test_a_step_that_cannot_be_made_is_an_error_that_tells_when() -> None:
    """The solution of u' = u^2 ends at t = 1."""
    unknowns = all_free(csr_matrix([[1.0]]), np.zeros((1, 2)))

    class Growing(Pendulum):
        def equations(self, t: float, rate: float, past: Array) -> Any:
            class At:
                def residual(self, x: Array) -> Array:
                    return rate * x + past - x**2

                def linearised(self, x: Array) -> tuple[Array, csr_matrix]:
                    return self.residual(x), csr_matrix(np.diag(rate - 2 * x))

            return At()

    growing, solver, stepping = (
        Growing(unknowns),
        LinearSolver(unknowns.free_kinds, starts=unknowns.starts),
        Stepping(2, 1e-4),
    )
    state = begun(growing, solver, np.array([1.0]), 2.0, stepping)
    with pytest.raises(IntegrationError, match=r"cannot go on at t=(1|0\.99\d*|1\.0\d*), however short"):
        march(growing, solver, state, 2.0, 2.0, stepping, lambda step: None)


@pytest.mark.slow
@pytest.mark.parametrize("slip", [False, True])
def test_blocks_solve_what_factors_do(monkeypatch: pytest.MonkeyPatch, slip: bool) -> None:
    """A cavity in three dimensions, in time, with or without friction at its sides: the same twice, to the bit."""
    pytest.importorskip("pyamg")
    from softdyn.fluid import Boundary, FluidScene, MeshSection, krylov, simulate

    sides = ["left", "right", "front", "back"]
    walls = [Boundary("bottom", velocity=[0.0] * 3)]
    walls += [Boundary(sides, slip=True) if slip else Boundary(sides, velocity=[0.0] * 3)]
    scene = FluidScene(
        density=1.0, viscosity=0.01, mesh=MeshSection(box=[1.0] * 3, cells=[3] * 3), until_t=0.1, dt=0.05, times=2,
        boundary=[Boundary("top", velocity=[1.0, 0.0, 0.0]), *walls],
    )  # fmt: skip
    by_factors = simulate(scene)
    monkeypatch.setitem(krylov.LARGE, 3, 0)
    one, other = simulate(scene), simulate(scene)
    assert one.stats["linear_solver"] == "GMRES, by blocks"
    assert one.stats["linear_pivoted"] == 0
    assert one.u == pytest.approx(by_factors.u, abs=1e-9)
    assert np.array_equal(one.u, other.u)
    assert np.array_equal(one.p, other.p)
    assert one.momentum_imbalance.max() < 1e-10
