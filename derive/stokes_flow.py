"""Averaged Stokes flow through grains at rest, with drag: a weak form, declared.

With c the fluid's volume fraction and v its velocity, the flux is u = c v, which is that of the mixture, as the grains
do not move, and

    div u = 0 ,     -div(2 eta D(u)) + c grad p + k u = c b ,

where -k u is the drag of the grains, a force per volume: k = beta/c where that is beta times their slip. Velocity and
pressure are linear on the same elements, which alone is unstable. The residual of the momentum balance, whose second
derivatives vanish there, is tested by the gradient of the pressure's test function, times

    tau = 1/(eta/h^2 + k) ,     1/h^2 = sum of |grad lambda_i|^2 over the shape functions:

h^2/(4 eta) of an equilateral triangle of side h (Hughes, Franca & Balestra, Comput. Methods Appl. Mech. Eng. 59 (1986)
85). Drag is part of it: without, a bed loses mass, for tau then exceeds what the drag lets the flow do.
"""

from __future__ import annotations

from sympy import Symbol

from softdyn.derive.weak_form import FINENESS, Field, WeakForm, divergence, dot, symmetric


def averaged_stokes(dimension: int, drag: bool = True) -> WeakForm:
    """Averaged Stokes flow in two or three dimensions: fields u and p, coefficients c, eta, drag k and body force b.

    Parameters
    ----------
    dimension : 2 or 3
    drag : bool
        Whether grains resist the flow. A form without is what the rules leave of one with, where k is absent.
    """
    u, p = Field("u", dimension, vector=True), Field("p", dimension)
    c, eta, k, b = Field("c", dimension), Field("eta", dimension), Field("k", dimension), Field("b", dimension, True)
    v, q = u.test, p.test
    tau = Symbol("tau", positive=True)

    resisted = k.value * u.value if drag else 0 * u.value
    # div(2 eta D(u)) is 2 D(u) grad eta, as D(u) is constant on an element
    balance = c.value * p.gradient + resisted - c.value * b.value - 2 * symmetric(u.gradient) * eta.gradient
    terms = {
        "viscosity": 2 * eta.value * dot(symmetric(u.gradient), symmetric(v.gradient)),
        "pressure": c.value * dot(p.gradient, v.value),
        "drag": dot(resisted, v.value),
        "body force": -c.value * dot(b.value, v.value),
        "continuity": q.value * divergence(u),
        "stabilisation": tau * dot(q.gradient, balance),
    }
    return WeakForm(
        name="averaged_stokes",
        dimension=dimension,
        fields=(u, p),
        coefficients=(c, eta, *((k,) if drag else ()), b),
        terms={name: term for name, term in terms.items() if term != 0},
        quantities={tau: 1 / (eta.mean * FINENESS + (k.mean if drag else 0))},
        source="averaged momentum and mass of a fluid among grains (Anderson & Jackson 1967), stabilised",
    )
