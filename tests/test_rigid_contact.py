"""The contact of rigid grains, derived: mobilities, the projections' fixed points, Newton's step, and both targets."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from test_contact_dynamics import pile

from softdyn.derive import rigid_contact as derived
from softdyn.derive.rigid_contact_kernel import rigid_ir
from softdyn.particles.contact_dynamics.rigid_kernel import get_rigid_kernel


@pytest.mark.parametrize("d", [1, 2, 3])
def test_mobilities_are_the_change_of_the_relative_velocity_by_a_unit_impulse(d):
    """W = H M^-1 H^T, written out for two bodies with numbers, as rigid-body mechanics has it."""
    rng = np.random.default_rng(d)
    n = rng.normal(size=d)
    n /= np.linalg.norm(n)
    m, gyration, R = rng.uniform(0.5, 2, 2), 0.4, rng.uniform(0.5, 2, 2)
    contact = derived.rigid_contact(d)
    values = {
        derived.light_i: 1 / m[0], derived.light_j: 1 / m[1],
        derived.loose_i: 1 / (gyration * m[0]), derived.loose_j: 1 / (gyration * m[1]),
    }  # fmt: skip
    w_n, w_t = (float(w.subs(values)) for w in contact.mobilities)
    for P in np.eye(d):
        arms = R[0] * n, -R[1] * n
        U = P / m[1] + P / m[0]
        for arm, mass, radius in zip(arms, m, R, strict=True):
            embedded = [np.append(vector, np.zeros(3 - d)) for vector in (arm, P)]
            # torque of +-P about the centre, and the velocity at the contact that the rotation makes
            omega = np.cross(*embedded) / (gyration * mass * radius**2)
            U = U + np.cross(omega, embedded[0])[:d]
        along = (P @ n) * n
        assert pytest.approx(w_n * along + w_t * (P - along), abs=1e-14) == U


@pytest.mark.parametrize("d", [2, 3])
def test_fixed_points_of_the_projections_are_the_laws_of_signorini_and_coulomb(d):
    step = derived.projection(d)
    n = derived.rigid_contact(d).n
    rng = np.random.default_rng(3)

    def projected(P, U, mu, bound):
        values = dict(zip([*n, *step.P, *step.U], [*normal, *P, *U], strict=True))
        values |= {derived.mu: mu, derived.bound: bound, derived.w_n: 2.0, derived.w_t: 7.0}
        for symbol, expr in step.definitions.items():
            values[symbol] = expr.subs(values)
        return np.array([values[symbol] for symbol in step.new], dtype=float)

    for _ in range(2):
        normal = rng.normal(size=d)
        normal /= np.linalg.norm(normal)
        tangent = rng.normal(size=d)
        tangent -= (tangent @ normal) * normal
        tangent /= np.linalg.norm(tangent)
        for P, U, mu, bound in [
            (0 * normal, 1.5 * normal + tangent, 0.3, -1.0),  # apart, faster than it must
            (2 * normal, -0.5 * normal, 0.3, 0.5),  # pressed, and does not slide
            (2 * normal + 0.5 * tangent, -0.5 * normal, 0.3, 0.5),  # within the cone
            (2 * normal - 0.6 * tangent, -0.5 * normal + 4 * tangent, 0.3, 0.5),  # slides, and is opposed
            (2 * normal, 3 * tangent, 0.0, 0.0),  # without friction
        ]:
            assert projected(P, U, mu, bound) == pytest.approx(P, abs=1e-14)
        # what violates one of the laws changes
        dragged = projected(2 * normal + 0.6 * tangent, 4 * tangent, 0.3, 0.0)
        assert tangent @ dragged == pytest.approx(0.6 - 4 / 7)
        assert np.linalg.norm(projected(0 * normal, -normal, 0.3, 0.0)) > 0.1


@pytest.mark.parametrize(("d", "slides"), [(1, False), (2, False), (2, True), (3, False), (3, True)])
def test_newtons_step_is_that_of_the_projections_own_finite_differences(d, slides):
    """P' = P - A G - D (U' - U) solves G + G_P dP + G_U dU + dP/rho = 0, G_P and G_U by differences."""
    rho, mu, w_n, w_t = 40.0, 0.3, 2.0, 7.0
    P = np.array([2.0, 0.9, 0.0][:d])
    U = np.array([-0.3, -1.4, 0.0][:d])
    soft = 0.2
    q_n = P[0] - (U[0] + 0.5) / w_n
    q_t = P[1:] - U[1:] / w_t
    if not slides:
        mu = 3.0

    def G(P, U):
        normal = P[0] - (U[0] + 0.5) / w_n
        p = (normal + np.hypot(normal, 2 * soft)) / 2
        q = P[1:] - U[1:] / w_t
        q = q * min(1.0, mu * p / np.linalg.norm(q)) if d > 1 else q
        return P - np.array([p, *q])

    # the frame has q_t along its second axis: so it is here, but for a third component that rotates it
    size = 1e-6
    steps = size * np.eye(d)
    by_P = np.column_stack([(G(P + e, U) - G(P - e, U)) / (2 * size) for e in steps])
    by_U = np.column_stack([(G(P, U + e) - G(P, U - e)) / (2 * size) for e in steps])
    p = (q_n + np.hypot(q_n, 2 * soft)) / 2
    values = {
        derived.P_n: p, derived.yielding: (1 + q_n / np.hypot(q_n, 2 * soft)) / 2, derived.rho: rho, derived.mu: mu,
        derived.w_n: w_n, derived.w_t: w_t, derived.length: np.linalg.norm(q_t) if d > 1 else 1.0,
    }  # fmt: skip
    branch = derived.linearised(d, slides)
    A, D = (np.array(matrix.subs(values), dtype=float) for matrix in (branch.A, branch.D))
    inverse = np.linalg.inv(by_P + np.eye(d) / rho)
    assert pytest.approx(inverse, rel=1e-6, abs=1e-6) == A
    assert pytest.approx(inverse @ by_U, rel=1e-6, abs=1e-6) == D


def test_the_smoothed_law_tends_to_signorinis():
    definitions = derived.projection(2, smooth=True).definitions
    for q, exact in ((1.0, 1.0), (-1.0, 0.0)):
        values = {derived.pressed: sympy.Rational(q), derived.soft: sympy.Rational(1, 10**8)}
        values[derived.root] = definitions[derived.root].subs(values)
        assert float(abs(definitions[derived.P_n].subs(values) - exact)) < 2e-16


@pytest.mark.slow
@pytest.mark.parametrize("d", [1, 2, pytest.param(3, marks=pytest.mark.slow)])
def test_both_targets_agree(d):
    made = []
    for target in ("c", "numba"):
        problem = pile(d, target)
        impulses, changes = np.zeros_like(problem.normals), np.empty((5, 2))
        v = problem.velocities(impulses)
        kernel = problem.kernel
        kernel.sweeps(
            len(problem), 5, 0.0, problem.first, problem.second, *problem.laws, problem.inverse.reshape(-1),
            impulses.reshape(-1), v.reshape(-1), changes.reshape(-1),
        )  # fmt: skip
        made.append((impulses, v, changes))
    for one, other in zip(*made, strict=True):
        np.testing.assert_array_equal(one, other)
    assert np.abs(made[0][0]).max() > 0


def test_the_kernel_says_what_it_is_made_of():
    ir = rigid_ir(2)
    declared = dict(ir.provenance.declaration)
    assert declared["w_t"] == "light_i + light_j + loose_i + loose_j"
    assert ir.functions["project"].takes[:2] == ("n_x", "n_y")
    assert get_rigid_kernel(2).operations["sweep"] == sum(
        sum(ir.functions[name].operations.values()) for name in ("slip", "project", "kick")
    )
