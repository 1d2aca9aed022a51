"""Cones are cut, joined and compared exactly: no scaling is lost, and none is counted twice."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from softdyn.derive.cones import (
    Cone,
    cut,
    dot,
    facets,
    hull_normals,
    merged,
    normals,
    orthants,
    primitive,
    shared_facets,
    split,
)

whole = st.integers(-6, 6)


def coordinates(cone: Cone, point: tuple[int, ...]) -> list[Fraction]:
    """Return what a point is in terms of the rays, by Cramer's rule."""
    columns = [list(ray) for ray in cone]
    volume = determinant(columns)
    return [Fraction(determinant([*columns[:i], list(point), *columns[i + 1 :]]), volume) for i in range(len(cone))]


def determinant(columns: list[list[int]]) -> int:
    if len(columns) == 1:
        return columns[0][0]
    return sum(
        (-1) ** i * x * determinant([column[:i] + column[i + 1 :] for column in columns[1:]])
        for i, x in enumerate(columns[0])
        if x
    )


def inside(cone: Cone, point: tuple[int, ...]) -> bool:
    return all(x > 0 for x in coordinates(cone, point))


def on(cone: Cone, point: tuple[int, ...]) -> bool:
    return all(x >= 0 for x in coordinates(cone, point))


@st.composite
def cones(draw: st.DrawFn) -> Cone:
    dimension = draw(st.integers(2, 4))
    rays = tuple(primitive(draw(st.tuples(*[whole] * dimension))) for _ in range(dimension))
    assume(determinant([list(ray) for ray in rays]) != 0)
    return rays


@st.composite
def cuts(draw: st.DrawFn) -> tuple[Cone, tuple[int, ...], tuple[int, ...]]:
    """Return a cone, the normal of a hyperplane and a point of the cone."""
    cone = draw(cones())
    normal = draw(st.tuples(*[whole] * len(cone)))
    weights = draw(st.tuples(*[st.integers(1, 9)] * len(cone)))
    point = tuple(sum(w * x for w, x in zip(weights, parts, strict=True)) for parts in zip(*cone, strict=True))
    return cone, normal, point


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(cuts())
def test_cutting_loses_no_point_and_counts_none_twice(drawn: tuple[Cone, tuple[int, ...], tuple[int, ...]]) -> None:
    cone, normal, point = drawn
    above, below = split(cone, [dot(normal, ray) for ray in cone])
    assert all(determinant([list(ray) for ray in part]) != 0 for part in above + below)
    for parts, sign in ((above, 1), (below, -1)):
        assert all(sign * dot(normal, ray) >= 0 for part in parts for ray in part)
        assert sum(inside(part, point) for part in parts) <= 1
        if dot(normal, point) != 0:
            assert any(on(part, point) for part in parts) == (sign * dot(normal, point) > 0)
    assert any(on(part, point) for part in above + below)
    assert all(on(cone, ray) for part in above + below for ray in part)


@settings(max_examples=100, deadline=None)
@given(cones())
def test_each_normal_is_that_of_the_facet_opposite_to_a_ray(cone: Cone) -> None:
    for i, normal in enumerate(normals(cone)):
        assert [dot(normal, ray) > 0 for ray in cone] == [i == j for j in range(len(cone))]
        assert [dot(normal, ray) == 0 for ray in cone] == [i != j for j in range(len(cone))]
        assert primitive(normal) == normal


@settings(max_examples=100, deadline=None)
@given(st.lists(st.fractions(-9, 9, max_denominator=12), min_size=1, max_size=4), st.fractions(Fraction(1, 9), 9))
def test_a_direction_has_one_shortest_vector(vector: list[Fraction], factor: Fraction) -> None:
    assert primitive(vector) == primitive([factor * x for x in vector])
    assert all(isinstance(x, int) for x in primitive(vector))


@given(st.integers(2, 4), st.tuples(*[whole.filter(bool)] * 4))
def test_the_orthants_cover_the_space(dimension: int, point: tuple[int, ...]) -> None:
    assert sum(inside(cone, point[:dimension]) for cone in orthants(dimension)) == 1
    half = orthants(dimension, positive=(dimension - 1,))
    assert sum(inside(cone, point[:dimension]) for cone in half) == (point[dimension - 1] > 0)


@st.composite
def subdivisions(draw: st.DrawFn) -> tuple[list[tuple[list[Cone], object]], list[tuple[int, ...]]]:
    """Return space cut by some planes and labelled at random, and points of it."""
    dimension = draw(st.integers(2, 3))
    parts = orthants(dimension, positive=(2,) if dimension == 3 else ())
    for normal in draw(st.lists(st.tuples(*[st.integers(-2, 2)] * dimension), max_size=3)):
        parts = [piece for part in parts for side in split(part, [dot(normal, ray) for ray in part]) for piece in side]
    labels = draw(st.lists(st.integers(0, 2), min_size=len(parts), max_size=len(parts)))
    up = st.integers(1, 97)
    points = draw(st.lists(st.tuples(st.integers(-97, 97), st.integers(-97, 97), up), min_size=5, max_size=5))
    return [([part], label) for part, label in zip(parts, labels, strict=True)], [p[:dimension] for p in points]


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(subdivisions())
def test_joined_regions_are_convex_and_lose_no_point(
    drawn: tuple[list[tuple[list[Cone], object]], list[tuple[int, ...]]],
) -> None:
    groups, points = drawn
    joined = merged(groups)
    assert len(joined) <= len(groups)
    for point in points:
        before = {label for cones, label in groups if any(inside(cone, point) for cone in cones)}
        holding = [(region, label) for region, label in joined if any(inside(cone, point) for cone in region)]
        assert len(holding) <= 1
        if before:
            assert {label for _, label in holding} == before
        # convex: in the hull of a region means in the region
        for region, _ in joined:
            in_hull = all(dot(normal, point) >= 0 for normal in hull_normals(region))
            assert in_hull == any(on(cone, point) for cone in region)
    # nothing is left to join: between two regions of one label there is some of another
    for i, (one, label) in enumerate(joined):
        for other, same in joined[i + 1 :]:
            if same == label:
                rest = [cone for region, _ in joined for cone in region if region is not one and region is not other]
                assert cut(rest, hull_normals([*one, *other]))


def test_neighbours_of_one_label_are_joined() -> None:
    """Four quadrants: two and two, three that make no convex region, all."""
    quadrants = orthants(2)

    def sizes(*labels: int) -> list[int]:
        return sorted(len(cones) for cones, _ in merged([([q], k) for q, k in zip(quadrants, labels, strict=True)]))

    beside = [i for i in range(1, 4) if set(quadrants[0]) & set(quadrants[i])]
    assert len(beside) == 2
    assert sizes(*(0 if i in (0, beside[0]) else 1 for i in range(4))) == [2, 2]
    (across,) = {1, 2, 3} - set(beside)
    assert sizes(*(0 if i in (0, across) else i for i in range(4))) == [1, 1, 1, 1]
    assert sizes(*(int(i == across) for i in range(4))) == [1, 1, 2]
    assert sizes(0, 0, 0, 0) == [4]


@settings(max_examples=60, deadline=None)
@given(subdivisions())
def test_regions_touch_along_the_facets_that_are_said(
    drawn: tuple[list[tuple[list[Cone], object]], list[tuple[int, ...]]],
) -> None:
    regions = [region for region, _ in merged(drawn[0])]
    for i, one in enumerate(regions):
        for other in regions[i + 1 :]:
            found = shared_facets(one, other)
            assert {tuple(-x for x in normal) for normal in found} == set(shared_facets(other, one))
            # two convex regions without a common point inside share one facet at most
            assert len(found) <= 1
            for normal in found:
                assert all(dot(normal, ray) >= 0 for cone in one for ray in cone)
                assert all(dot(normal, ray) <= 0 for cone in other for ray in cone)
            full = {frozenset(facet) for facet in facets(one)} & {frozenset(facet) for facet in facets(other)}
            # a facet that a cone of the one has in common with a cone of the other is part of what they share
            assert not full or found


@settings(max_examples=60, deadline=None)
@given(cuts())
def test_what_only_touches_a_half_space_is_left_out(drawn: tuple[Cone, tuple[int, ...], tuple[int, ...]]) -> None:
    cone, normal, point = drawn
    assume(any(normal))
    kept = cut([cone], [normal])
    assert any(on(part, point) for part in kept) == (dot(normal, point) >= 0)
    touching = cut([cone], [tuple(-x for x in normals(cone)[0])])
    assert touching == []
