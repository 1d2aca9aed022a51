"""Shape functions and quadrature on simplices: partitions of one, and exact to the degrees that they claim."""

from __future__ import annotations

from itertools import product
from math import factorial, prod

import numpy as np
import pytest
from sympy import Symbol, simplify

from softdyn.derive.simplices import node_count, rule, shape_functions, slopes_at, values_at


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("degree", range(9))
def test_a_rule_integrates_every_monomial_of_its_degree(d: int, degree: int) -> None:
    """Integral of prod lambda_i^a_i, over the measure: d! prod a_i!/(d + sum a_i)!."""
    weights, points = rule(d, degree)
    assert min(weights) > 0
    assert min(min(point) for point in points) >= 0
    np.testing.assert_allclose(np.sum(points, axis=1), 1, rtol=0, atol=4e-16)
    for powers in product(range(degree + 1), repeat=d + 1):
        if sum(powers) > degree:
            continue
        exact = factorial(d) * prod(map(factorial, powers)) / factorial(d + sum(powers))
        found = sum(
            w * prod(x**a for x, a in zip(point, powers, strict=True)) for w, point in zip(weights, points, strict=True)
        )
        assert found == pytest.approx(exact, rel=1e-13)


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("order", [1, 2])
def test_shape_functions_are_one_at_their_node_and_add_up_to_one(d: int, order: int) -> None:
    shapes, places = shape_functions(d, order)
    corners = [tuple(float(i == j) for j in range(d + 1)) for i in range(d + 1)]
    middles = [
        tuple((a + b) / 2 for a, b in zip(corners[i], corners[j], strict=True))
        for i in range(d + 1)
        for j in range(i + 1, d + 1)
    ]
    nodes = tuple(corners + (middles if order == 2 else []))
    count = node_count(d, order)
    assert np.array_equal(np.reshape(values_at(d, order, nodes), (count, count)), np.eye(count))
    x = [Symbol(f"x{i}") for i in range(d)]
    at = dict(zip(places, [*x, 1 - sum(x)], strict=True))
    assert simplify(sum(shapes).subs(at)) == 1
    # along an edge nothing changes but what its ends say
    slopes = np.reshape(slopes_at(d, order, nodes), (count, count, d + 1))
    np.testing.assert_allclose(np.sum(slopes[:, :, :] - slopes[:, :, :1], axis=1), 0, atol=1e-14)
