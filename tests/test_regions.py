"""Open regions of scalings are cut exactly, and a form grows on one if and only if its generators say so."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from softdyn.derive.cones import Normal, dot
from softdyn.derive.regions import Region, combination, cut_by, form_with, lifted, space

whole = st.integers(-4, 4)


@st.composite
def cuts(draw: st.DrawFn) -> tuple[int, list[Normal]]:
    """Forms to cut a space by, none of them zero."""
    dimension = draw(st.integers(2, 4))
    form = st.tuples(*[whole] * dimension).filter(any)
    return dimension, draw(st.lists(form, min_size=1, max_size=6))


def above(dimension: int, forms: list[Normal]) -> Region | None:
    """Where all of some forms grow."""
    region: Region | None = space(dimension)
    for form in forms:
        region = cut_by(region, form)[0] if region is not None else None
    return region


def lowest(form: Normal, forms: list[Normal], on: list[Normal]) -> float:
    """Least value of a form in a box, where others are not negative and some vanish: by linear programming."""
    found = linprog(
        np.array(form, float),
        A_ub=-np.array(forms, float),
        b_ub=np.zeros(len(forms)),
        A_eq=np.array(on, float) if on else None,
        b_eq=np.zeros(len(on)) if on else None,
        bounds=[(-1, 1)] * len(form),
    )
    return float(found.fun)


@settings(max_examples=150, deadline=None)
@given(cuts(), st.data())
def test_generators_tell_whether_a_form_grows(drawn: tuple[int, list[Normal]], data: st.DataObject) -> None:
    """A form is nowhere negative on a region's closure if it is not on its rays and lines, and only then."""
    dimension, forms = drawn
    region = above(dimension, forms)
    inner = linprog(
        [0.0] * dimension + [-1.0],
        A_ub=np.hstack([-np.array(forms, float), np.ones((len(forms), 1))]),
        b_ub=np.zeros(len(forms)),
        bounds=[(-1, 1)] * dimension + [(None, 1)],
    )
    assert (region is None) == (-inner.fun < 1e-9)
    if region is None:
        return
    assert all(dot(form, region.inner) > 0 for form in forms)
    trial = data.draw(st.tuples(*[whole] * dimension))
    assert all(dot(trial, ray) >= 0 for ray in region.generators) == (lowest(trial, forms, []) > -1e-9)
    _, on, _ = cut_by(region, forms[0])
    assert on is None or forms[0] not in region.strict


@settings(max_examples=150, deadline=None)
@given(cuts(), st.data())
def test_the_three_pieces_of_a_cut_are_the_region(drawn: tuple[int, list[Normal]], data: st.DataObject) -> None:
    dimension, forms = drawn
    region = above(dimension, forms)
    if region is None:
        return
    normal = data.draw(st.tuples(*[whole] * dimension).filter(any))
    high, on, low = cut_by(region, normal)
    least, most = lowest(normal, forms, []), -lowest(tuple(-x for x in normal), forms, [])
    assert (high is not None) == (most > 1e-9)
    assert (low is not None) == (least < -1e-9)
    if high is not None:
        assert all(dot(form, high.inner) > 0 for form in (*forms, normal))
    if on is not None:
        assert all(dot(form, on.inner) > 0 for form in forms)
        assert all(dot(normal, ray) == 0 for ray in on.generators)
        trial = data.draw(st.tuples(*[whole] * dimension))
        assert all(dot(trial, ray) >= 0 for ray in on.generators) == (lowest(trial, forms, [normal]) > -1e-9)
    if high is not None and low is not None:
        assert on is not None


@settings(max_examples=100, deadline=None)
@given(cuts(), st.data())
def test_a_form_is_found_from_its_values(drawn: tuple[int, list[Normal]], data: st.DataObject) -> None:
    dimension, forms = drawn
    region = above(dimension, forms)
    if region is None:
        return
    form = data.draw(st.tuples(*[whole] * dimension))
    values = [dot(form, ray) for ray in region.generators]
    found = [dot(form_with(values, region.generators), ray) for ray in region.generators]
    scale = next((Fraction(x, y) for x, y in zip(found, values, strict=True) if y), Fraction(1))
    assert scale > 0
    assert all(x == scale * y for x, y in zip(found, values, strict=True))
    # with factors that are not negative, of the forms that bound the region: Farkas' lemma
    if any(values) and all(value >= 0 for value in values):
        rows = [[dot(normal, ray) for ray in region.generators] for normal in region.strict]
        factors = combination(values, rows, dimension)
        assert factors is not None
        assert all(factor > 0 for factor in factors.values())
        total = [sum(factor * rows[k][i] for k, factor in factors.items()) for i in range(len(values))]
        assert total == values


def test_values_of_no_form_are_refused() -> None:
    with pytest.raises(ValueError, match="no linear form"):
        form_with([1, 1], [(1, 0), (-1, 0)])


def test_a_dimension_more_is_free() -> None:
    region = above(2, [(1, 0), (-1, 1)])
    assert region is not None
    free = lifted(region)
    assert (0, 0, 1) in free.lines
    assert free.strict == ((1, 0, 0), (-1, 1, 0))
