"""The viscosity of the mixture in MigFlow's slides: eta (1 + 5/2 phi + 5 phi^2).

The first coefficient is Einstein's. The second is theirs: Batchelor has 6.2 with Brownian motion, and 5 is 25/31 of it.
"""

from softdyn.derive.closure import Closure, eta, phi, viscosity
from softdyn.derive.closures.einstein import dilute
from softdyn.derive.law import Limit

closure = Closure(
    name="slides_viscosity",
    gives="viscosity",
    description="viscosity of the mixture in MigFlow's slides",
    source="slides on MigFlow",
    expression=eta * (1 + dilute + 5 * phi**2),
    limits=(Limit("Einstein", order=(phi, 1), claims={viscosity / eta - 1: dilute}),),
)
