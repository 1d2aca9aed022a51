"""Coulomb friction as a return map, with its consistent tangent.

Surfaces that touch are joined by a tangential spring (Cundall & Strack 1979, doi:10.1680/geot.1979.29.1.47): its force
T follows their slip s, the displacement of one along the other in the contact's rotating frame, with the stiffness k_t.
Coulomb's law lets them slide by gamma along T, so that |T| <= mu N::

    T = T_trial - k_t gamma T/|T| ,   gamma >= 0 ,   |T| <= mu N ,   gamma (|T| - mu N) = 0 ,   T_trial = T_0 + k_t s

Where |T_trial| <= mu N nothing slides. Elsewhere the two are parallel, |T| = mu N, and ::

    T = keep T_trial ,   keep = mu N/|T_trial| ,   gamma = (|T_trial| - mu N)/k_t

What slides dissipates |T| gamma. Rolling and twisting are resisted by springs of the same kind, whose forces have the
levers R: their largest moments are fractions of R N.
"""

from __future__ import annotations

from functools import cache

from sympy import Expr, Piecewise, Symbol, simplify, sqrt

#: Size of the trial force, and the largest force; what is kept of the trial force.
size, most = Symbol("size", nonnegative=True), Symbol("most", nonnegative=True)
keep = Symbol("keep", nonnegative=True)
mu, N = Symbol("mu", nonnegative=True), Symbol("N", nonnegative=True)


@cache
def return_map() -> Expr:
    """Factor ``keep`` of the trial force, a function of its ``size`` and of the ``most`` that friction bears.

    Raises
    ------
    AssertionError
        If it is not the solution of Coulomb's law.
    """
    k_t, gamma = Symbol("k_t", positive=True), Symbol("gamma", nonnegative=True)
    trial, bound = Symbol("trial", positive=True), Symbol("bound", nonnegative=True)
    sliding = bound / trial
    # along T_trial, of the length trial: T = trial - k_t gamma, at the bound
    slid = (trial - bound) / k_t
    assert simplify(sliding * trial - (trial - k_t * gamma).subs(gamma, slid)) == 0, "the return map is wrong"
    return Piecewise((most / size, size > most), (1, True))


@cache
def tangent() -> dict[str, Expr]:
    """Consistent tangent of the return map, where it slides.

    Returns
    -------
    dict
        ``along`` and ``across``: dT/dT_trial along T_trial, and across it, in units of 1; ``by_N``: d|T|/dN.

    Raises
    ------
    AssertionError
        If these are not the derivatives.
    """
    x, y = Symbol("x", positive=True), Symbol("y", real=True)
    length = sqrt(x**2 + y**2)
    force = [mu * N * x / length, mu * N * y / length]
    found = {"along": x * 0, "across": mu * N / size, "by_N": mu}
    assert simplify(force[0].diff(x).subs(y, 0) - found["along"]) == 0, "the tangent along the slip is wrong"
    assert simplify(force[1].diff(y).subs(y, 0) - found["across"].subs(size, x)) == 0, "that across it is wrong"
    assert simplify(force[0].diff(N).subs(y, 0) - found["by_N"]) == 0, "that by the normal force is wrong"
    return found
