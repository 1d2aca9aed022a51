"""Two rigid spheres in a viscous fluid: what is left of ``equal_spheres`` as E -> infinity.

Lubrication alone: the centres follow the gap, dX/dt = dh/dt = -F/zeta, with Brenner's friction of two equal spheres.
"""

from sympy import pi

from softdyn.derive import F, Limit, R, eta, h
from softdyn.derive.laws.equal_spheres import law as equal_spheres
from softdyn.derive.one_sided import rigid

near = 3 * pi * eta * R**2 / (2 * h)

law = rigid(
    equal_spheres,
    name="lubrication_rigid",
    description="two rigid spheres, lubrication alone: equal_spheres as E -> infinity",
    source="Brenner 1961, doi:10.1016/0009-2509(61)80035-3",
    limits=(
        Limit("Stokes", order=(R, h), claims={"zeta": 3 * pi * eta * R, "dh_dt": -F / (3 * pi * eta * R)}),
        Limit(
            "Poiseuille",
            order=(h, R),
            claims={"zeta": near, "D": near, "dh_dt": -F / near, "dX_dt": -F / near},
        ),
    ),
)
