"""The permeability of a bed of spheres: k = d^2 c^3/(180 phi^2), d = 2 r.

Carman, Trans. Inst. Chem. Eng. 15 (1937) 150, after Kozeny (1927). Ergun's bed is 180/150 as permeable as Re -> 0.
"""

from softdyn.derive.closure import Closure, c, phi, r
from softdyn.derive.law import Limit

closure = Closure(
    name="carman_kozeny",
    gives="permeability",
    description="permeability of a packed bed",
    source="Carman 1937, Trans. Inst. Chem. Eng. 15, 150",
    expression=(2 * r) ** 2 * c**3 / (180 * phi**2),
    limits=(
        Limit("open", order=(phi, 1), claims={"permeability": r**2 / (45 * phi**2)}),
        Limit("closed", order=(c, 1), claims={"permeability": r**2 * c**3 / 45}),
    ),
)
