"""Two equal charged elastic spheres in an electrolyte: ``equal_spheres`` with the forces of DLVO.

Derjaguin's approximation turns the pressure between planes into the force between spheres, F_adh = pi R W(h) with
W(h) the integral of the pressure from h on (Israelachvili, Intermolecular and Surface Forces, 2011, chs. 11 to 14)::

    pressure(h) = Pi0 exp(-h/ell) - A/(6 pi h^3)       Pi0 = 64 n k T tanh^2(z e psi0/(4 k T))

Exact: the integral. Approximate: the double layers overlap weakly (h > ell, or psi0 below some 25 mV), the attraction
is not retarded (h below some 10 nm; beyond, the true one is weaker), and h << R, where alone these forces matter; the
spheres are taken as round, though flattened ones have more area close by: right for delta << ell.

Typical: silicone beads, R = 10 um, E = 100 kPa, in 1 mM salt at psi0 = 50 mV: ell = 10 nm, Pi0 = 33 kPa, A = 1e-20 J.
"""

from sympy import Symbol, exp, pi, sqrt

from softdyn.derive import ENERGY, LENGTH, PRESSURE, ContactLaw, E, F, Limit, R, delta, eta, h
from softdyn.derive.laws.equal_spheres import film, modulus, near
from softdyn.derive.laws.equal_spheres import law as equal_spheres

Pi0 = Symbol("Pi0", positive=True)  # pressure of the double layers, extrapolated to contact
ell = Symbol("ell", positive=True)  # Debye length
A = Symbol("A", positive=True)  # Hamaker's constant

repulsion = pi * R * Pi0 * ell
attraction = A * R / (12 * h**2)

law = ContactLaw(
    name="dlvo",
    description="equal_spheres with a double layer and van der Waals forces",
    source="Derjaguin-Landau-Verwey-Overbeek (Israelachvili 2011, chs. 11-14); equal_spheres",
    a=equal_spheres.a,
    F_ela=equal_spheres.F_ela,
    zeta=equal_spheres.zeta,
    F_adh=repulsion * exp(-h / ell) - attraction,
    unequal=equal_spheres.unequal,
    tangential=equal_spheres.tangential,
    parameters={**equal_spheres.parameters, Pi0: PRESSURE, ell: LENGTH, A: ENERGY},
    ranges=equal_spheres.ranges,
    typical={**equal_spheres.typical, Pi0: E / 3, ell: R / 1000, A: E * R**3 / 10**10},
    limits=(
        Limit(
            "far",  # attraction, in what may become a second minimum
            order=((delta, h, R), (ell, h)),
            claims={"a": 3 * sqrt(R * h) / 2, "zeta": near, "F_adh": -attraction},
        ),
        Limit(
            "Poiseuille",
            order=((delta, h, R), (ell, h), (A * R, F * h**2), (repulsion * exp(-h / ell), F)),
            claims={
                "zeta": near,
                "delta": F / (2 * modulus * sqrt(R * h)),
                "dh_dt": -F / near,
                "dX_dt": -F / near,
            },
        ),
        # Pi0 and E are of one order below, so that the repulsion's scale is E ell R
        Limit(
            "double layer",
            order=((h, ell, R), (A, E * ell * h**2)),
            claims={"F_adh": repulsion},
        ),
        Limit(
            "pushed apart",
            order=((delta, h, ell, R), (A, E * ell * h**2), (F, E * ell * R)),
            claims={"dh_dt": 2 * Pi0 * ell * h / (3 * eta * R), "dX_dt": 2 * Pi0 * ell * h / (3 * eta * R)},
        ),
        Limit(
            "contact",
            order=((h, ell, R), (E * ell * h**2, A)),
            claims={"F_adh": -attraction},
        ),
        Limit(
            "drawn together",
            order=((h, delta, R), (ell, h), (F * h**2, A * R), (repulsion * exp(-h / ell), attraction)),
            claims={"zeta": film, "dh_dt": -A * h / (48 * pi * eta * R * delta**2)},
        ),
    ),
)
