"""A dilute suspension of spheres: eta (1 + 5/2 phi).

Einstein, Ann. Phys. 324 (1906) 289, as he corrected it in Ann. Phys. 339 (1911) 591. Exact to first order in phi.
"""

from sympy import Rational

from softdyn.derive.closure import Closure, eta, phi, viscosity
from softdyn.derive.law import Limit

dilute = Rational(5, 2) * phi

closure = Closure(
    name="einstein",
    gives="viscosity",
    description="viscosity of a dilute suspension",
    source="Einstein 1906, 1911, doi:10.1002/andp.19063240204",
    expression=eta * (1 + dilute),
    limits=(Limit("dilute", order=(phi, 1), claims={"viscosity": eta, viscosity / eta - 1: dilute}),),
)
