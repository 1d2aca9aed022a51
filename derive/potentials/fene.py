"""A spring that cannot be stretched beyond Q: F = -k x/(1 - (x/Q)^2), x = r - d.

Finitely extensible, non-linear, elastic: Warner, Ind. Eng. Chem. Fundam. 11 (1972) 379, of polymers, where d = 0.
"""

from sympy import Symbol, log

from softdyn.derive.dimensions import FORCE, LENGTH
from softdyn.derive.law import Limit
from softdyn.derive.potential import Potential, r

k = Symbol("k", positive=True)  # stiffness of small extensions
Q = Symbol("Q", positive=True)  # largest extension
d = Symbol("d", nonnegative=True)  # length at rest

potential = Potential(
    name="fene",
    description="a spring that cannot be stretched beyond a length",
    source="Warner 1972, doi:10.1021/i160043a017",
    energy=-k * Q**2 / 2 * log(1 - ((r - d) / Q) ** 2),
    parameters={k: FORCE / LENGTH, Q: LENGTH, d: LENGTH},
    domain=(d - Q, d + Q),
    typical={k: 1, Q: 1, d: 2},
    limits=(
        Limit("Hooke", order=(r - d, Q), claims={"U": k * (r - d) ** 2 / 2, "F": -k * (r - d)}),
        Limit("stretched", order=(d + Q - r, Q), claims={"F": -k * Q**2 / (2 * (d + Q - r))}),
    ),
)
