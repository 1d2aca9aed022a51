"""The coefficients of Radau IIA: against the textbook's, and against what defines them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from softdyn.derive.radau import STAGES, Collocation, radau_iia


def matrix(method: Collocation) -> NDArray[np.float64]:
    """Return the Runge-Kutta matrix."""
    stages = len(method.nodes) - 1
    return np.linalg.inv(np.array(method.inverse).reshape(stages, stages).T)


def test_two_and_three_stages_are_those_of_the_textbook() -> None:
    """Hairer & Wanner II, tables IV.5.5 and IV.5.6."""
    np.testing.assert_allclose(radau_iia(2).nodes, [0, 1 / 3, 1], rtol=1e-15)
    np.testing.assert_allclose(matrix(radau_iia(2)), [[5 / 12, -1 / 12], [3 / 4, 1 / 4]], rtol=1e-14)
    root = math.sqrt(6)
    np.testing.assert_allclose(radau_iia(3).nodes, [0, (4 - root) / 10, (4 + root) / 10, 1], rtol=1e-15)
    np.testing.assert_allclose(
        matrix(radau_iia(3)),
        [
            [(88 - 7 * root) / 360, (296 - 169 * root) / 1800, (-2 + 3 * root) / 225],
            [(296 + 169 * root) / 1800, (88 + 7 * root) / 360, (-2 - 3 * root) / 225],
            [(16 - root) / 36, (16 + root) / 36, 1 / 9],
        ],
        rtol=1e-13,
    )


def test_the_last_row_integrates_polynomials_up_to_degree_fourteen() -> None:
    """Order 2s - 1 = 15 at the end of a step."""
    method = radau_iia()
    weights, nodes = matrix(method)[-1], np.array(method.nodes[1:])
    for degree in range(2 * STAGES - 1):
        assert weights @ nodes**degree == pytest.approx(1 / (degree + 1), rel=1e-12)
    assert abs(weights @ nodes ** (2 * STAGES - 1) * (2 * STAGES) - 1) > 1e-10


def test_it_is_l_stable() -> None:
    """R(z) = 1 + z b (I - z A)^-1 1 is at most 1 in size on the imaginary axis, and vanishes at infinity."""
    A = matrix(radau_iia())
    identity, one = np.eye(STAGES), np.ones(STAGES)
    for y in np.geomspace(1e-2, 1e6, 200):
        value = 1 + 1j * y * A[-1] @ np.linalg.solve(identity - 1j * y * A, one)
        assert abs(value) <= 1 + 1e-9
    assert abs(1 - 1e9 * A[-1] @ np.linalg.solve(identity + 1e9 * A, one)) < 1e-7


def test_weights_interpolate_and_differentiate_polynomials() -> None:
    method = radau_iia()
    points = np.array(method.nodes)
    for degree in range(1, STAGES + 1):
        values = points**degree
        assert np.dot(method.value_probe, values) == pytest.approx(method.probe**degree, rel=1e-12)
        assert np.dot(method.slope_probe, values) == pytest.approx(degree * method.probe ** (degree - 1), rel=1e-11)
        assert np.dot(method.slope_start, values) == pytest.approx(float(degree == 1), abs=1e-12)
    product = np.array([np.prod([x - y for y in points if y != x]) for x in points])
    np.testing.assert_allclose(np.array(method.weights) * product, 1, rtol=1e-12)


def test_the_error_is_the_integral_of_the_defect() -> None:
    """For u' = g(t) the defect is K M(theta) if g is of degree s: its polynomial errs by the integral of K M."""
    method = radau_iia()
    nodes = np.poly1d(np.poly(method.nodes[1:]))
    grid = np.linspace(0, 1, 20_001)
    largest = np.max(np.abs(nodes.integ()(grid)))
    assert method.error_start == pytest.approx(largest / abs(nodes(0.0)), rel=1e-6)
    assert method.error_probe == pytest.approx(largest / abs(nodes(method.probe)), rel=1e-6)
    assert abs(nodes(0.0)) == np.max(np.abs(nodes(grid)))
