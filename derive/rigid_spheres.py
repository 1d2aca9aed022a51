"""Friction of two rigid spheres that approach, equal or not, and of a sphere and a wall.

Two free spheres of radii R1 and R2 under equal and opposite forces along the line of their centres: force over the
rate at which they approach, relative to what it is far apart, 6 pi eta R1 R2/(R1 + R2) = 3 pi eta R. A wall is R2 ->
oo, at rest. With R = 2 R1 R2/(R1 + R2) and the size ratio R1 R2/(R1 + R2)^2, p/4 below, the exact solution (Brenner,
Chem. Eng. Sci. 16 (1961) 242; Maude, Br. J. Appl. Phys. 12 (1961) 293) has

- near contact R/(2h) + (4 + 5 p)/20 ln(R/h) (Jeffrey & Onishi, J. Fluid Mech. 139 (1984) 261), as the form below;
- far apart 1 + 3 R/(2h) of two spheres, as below, and 1 + 9 R/(16 h) of a sphere and a wall, below 1 + 53 R/(90 h);
  one changes into the other where the gap is about the larger radius.

In between it is a fit: within 0.7 % for any two radii, and h from 1e-3 to 1e2 smaller radii.
"""

from sympy import Expr, Rational, log

from softdyn.derive.symbols import R, h, size_ratio

p: Expr = 4 * size_ratio  # 1 of equal spheres, 0 of a sphere and a wall
_logarithm = (4 + 5 * p) / 20
_equal = p**8  # of two equal spheres one logarithm is enough
_between = _equal * log(1 + 20 * R / (9 * h)) + (1 - _equal) * log(1 + 4 * R / (9 * h))
_remaining = 1 - _logarithm * (4 + 16 * _equal) / 9  # of the slope 3/2

#: Friction of two rigid spheres, by that of spheres far apart.
brenner_unequal: Expr = (
    1 + R / (2 * h) + _logarithm * _between + _remaining * 4 * p * R / (4 * p * h + (22 - 17 * p) * R)
)
#: The same of two equal ones.
brenner: Expr = 1 + R / (2 * h) + Rational(9, 20) * log(1 + 20 * R / (9 * h))
#: What the friction of two spheres is over that of two equal ones with the same R.
unequal: Expr = brenner_unequal / brenner
