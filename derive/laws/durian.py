"""The bubble model: linear springs where bubbles overlap, and a drag on each, without inertia.

Durian, Phys. Rev. Lett. 75 (1995) 4780; Phys. Rev. E 55 (1997) 1739: two bubbles that overlap by x = R_i + R_j - r push
each other apart with F_0 x/(2 <R>) = k x, whatever their own radii, and each is dragged against the mean flow around
it, b (v_i - <v>). In its mean-field form, that of this law's drag, <v> is the affine flow. Steady shear has a yield
stress, and a power of the rate above it. Lengths, forces and times are those of <R>, k <R> and b/k.
"""

from sympy import Symbol, sqrt

from softdyn.derive import FORCE, FRICTION, LENGTH, ContactLaw, Drag, E, F, Limit, R, delta, eta

k = Symbol("k", positive=True)  # stiffness, force over overlap
b = Symbol("b", positive=True)  # drag, force over velocity

law = ContactLaw(
    name="durian",
    description="the bubble model: springs where bubbles overlap, and a drag against the flow",
    source="Durian 1995, doi:10.1103/PhysRevLett.75.4780",
    a=sqrt(R * delta),
    F_ela=2 * k * delta,
    zeta=0,
    drag=Drag(translation=b, rotation=b * R**2),
    parameters={k: FORCE / LENGTH, b: FRICTION},
    typical={k: E * R, b: eta * R},
    limits=(Limit("spring", order=(delta, R), claims={"F": 2 * k * delta, "delta": F / (2 * k), "C": k}),),
)
