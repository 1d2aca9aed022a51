"""A sphere alone in a viscous fluid, without inertia: what laws of contact and closures of the fluid both start from.

Stokes, Trans. Camb. Philos. Soc. 9 (1851) 8.
"""

from sympy import Expr, pi

from softdyn.derive.symbols import eta


def drag_of_sphere(radius: Expr) -> Expr:
    """Stokes' drag, force/velocity: 6 pi eta r."""
    return 6 * pi * eta * radius


def torque_of_sphere(radius: Expr) -> Expr:
    """Its resistance to a rotation, torque/angular velocity: 8 pi eta r^3."""
    return 8 * pi * eta * radius**3
