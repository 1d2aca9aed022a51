"""A sphere alone in a viscous fluid: F = 6 pi eta r slip, C_d = 24/Re.

Stokes, Trans. Camb. Philos. Soc. 9 (1851) 8. Exact as Re -> 0, for a grain far from any other.
"""

from softdyn.derive.closure import Closure, Re, r
from softdyn.derive.law import Limit
from softdyn.derive.sphere import drag_of_sphere

alone = drag_of_sphere(r)

closure = Closure(
    name="stokes",
    gives="drag",
    description="drag on a sphere alone, without inertia",
    source="Stokes 1851, Trans. Camb. Philos. Soc. 9, 8",
    expression=alone,
    limits=(Limit("Stokes", order=(Re, 1), claims={"drag": alone, "C_d": 24 / Re}),),
)
