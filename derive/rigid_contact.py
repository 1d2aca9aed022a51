"""The contact of two rigid grains: its frame, its mobilities, the laws of Signorini and Coulomb as projections.

Input: the dimension of space. Output: expressions in Cartesian components, for any two round grains.

Coordinates of a grain are its position and R theta; its velocities are (v, s), s = R omega, with the masses m and
I/R^2. The relative velocity at the contact, of j against i, is U = H (v, s), and impulses P, from i to j, change
velocities by M^-1 H^T P. For round grains W = H M^-1 H^T is

    W = w_n n n^T + w_t (1 - n n^T),

so that the contact by itself is solved by two projections: with g the gap at the start of a step of length dt,

    P_n = max(0, q_n),                  q_n = P_n - (U_n + g/dt)/w_n         (Signorini)
    P_t = q_t min(1, mu P_n/|q_t|),     q_t = P_t - U_t/w_t                  (Coulomb)

Their fixed points are 0 <= P_n, U_n + g/dt >= 0, one of them zero, and |P_t| <= mu P_n, opposite to U_t where grains
slide (Alart & Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353; Jean, ibid. 177 (1999) 235).

A step of Newton's method for all contacts together takes the derivatives of these projections. They are singular where
impulses are not unique, as in a wedge or between many grains. So each step keeps the impulses near to the last ones, as
the proximal point method does: with G(P, U) what the projections change,

    G + G_P (P' - P) + G_U (U' - U) + (P' - P)/rho = 0    =>    P' = P - A G - D (U' - U) ,

A = (G_P + 1/rho)^-1, D = A G_U, whose fixed points are the same for any rho.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from sympy import Expr, Max, Piecewise, Symbol, cancel, diag, eye, simplify, sqrt, symbols, zeros
from sympy import ImmutableMatrix as Matrix

AXES = "xyz"

#: Inverse masses of the two grains: of translation 1/m, and of rotation R^2/I.
light_i, light_j = symbols("light_i light_j", nonnegative=True)
loose_i, loose_j = symbols("loose_i loose_j", nonnegative=True)
#: Mobilities along the normal and across it.
w_n, w_t = symbols("w_n w_t", positive=True)
#: Lowest velocity of separation that is allowed, with its sign turned: g/dt, or less the rebound.
bound = Symbol("bound", real=True)
#: Coefficient of friction.
mu = Symbol("mu", nonnegative=True)
#: Weight of the proximal term.
rho = Symbol("rho", positive=True)
#: What tells which of the laws' branches holds.
pressed, slack = Symbol("pressed", real=True), Symbol("slack", real=True)


def vector(name: str, count: int) -> Matrix:
    """A column of symbols: name_x, name_y, ..."""
    return Matrix([Symbol(f"{name}_{axis}", real=True) for axis in AXES[:count]])


def turns(d: int) -> int:
    """How many rotations a grain has."""
    return (0, 1, 3)[d - 1]


@dataclass(frozen=True)
class RigidContact:
    """What follows for the contact of two round grains.

    Attributes
    ----------
    n : Matrix, shape (d, 1)
        The normal, a unit vector from i to j.
    velocities : Matrix, shape (2 width, 1)
        v and s of grain i, then those of grain j.
    H : Matrix, shape (d, 2 width)
    W : Matrix, shape (d, d)
    mobilities : tuple of Expr
        w_n and w_t.
    """

    n: Matrix
    velocities: Matrix
    H: Matrix
    W: Matrix
    mobilities: tuple[Expr, Expr]


def cross(one: Matrix, other: Matrix) -> Matrix:
    """Return the product of a rotation and a vector, in any dimension."""
    if len(one) == 3:
        return Matrix(one).cross(Matrix(other))
    if len(one) == 1:
        return Matrix([-one[0] * other[1], one[0] * other[0]])
    return zeros(len(other), 1).as_immutable()


@lru_cache(maxsize=3)
def rigid_contact(d: int) -> RigidContact:
    """Kinematics and mobilities of a contact in d dimensions.

    Raises
    ------
    AssertionError
        If W is not isotropic across the normal.
    """
    n = vector("n", d)
    v = [vector(f"v_{grain}", d) for grain in "ij"]
    s = [Matrix([Symbol(f"s_{grain}_{axis}", real=True) for axis in AXES[3 - turns(d) :]]) for grain in "ij"]
    R = symbols("R_i R_j", positive=True)
    # the point of contact is at R_i n from the one centre, and at -R_j n from the other
    at = [v[k] + cross(s[k] / R[k], (1 - 2 * k) * R[k] * n) for k in range(2)]
    velocities = Matrix([*v[0], *s[0], *v[1], *s[1]])
    H = Matrix(simplify(at[1] - at[0])).jacobian(velocities)
    inverse = diag(*[light_i] * d, *[loose_i] * turns(d), *[light_j] * d, *[loose_j] * turns(d))
    W = Matrix(H * inverse * H.T)
    along = on_sphere((n.T * W * n)[0], n)
    across = on_sphere(W.trace() - along, n) / (d - 1) if d > 1 else along
    rest = W - along * n * n.T - across * (eye(d) - n * n.T)
    assert all(on_sphere(entry, n) == 0 for entry in rest), "the mobility of round grains is isotropic"
    return RigidContact(n, velocities, H, W, (along, cancel(across)))


def on_sphere(expr: Expr, n: Matrix) -> Expr:
    """An expression polynomial in n, with n.n = 1 used to take the last component's squares out."""
    last, square = n[-1], 1 - sum(component**2 for component in n[:-1])
    terms = expr.expand().as_poly(last)
    if terms is None:
        return expr.expand()
    return sum(c * square ** (k // 2) * last ** (k % 2) for (k,), c in terms.terms()).expand()


@dataclass(frozen=True)
class Projection:
    """What one contact does, given its velocity U and its impulse P, in Cartesian components.

    Attributes
    ----------
    U, P, q, new : Matrix, shape (d, 1)
        Symbols of the velocity, of the impulse, of q_t, and of the projected impulse.
    definitions : dict from Symbol to Expr
        ``pressed`` (q_n), ``P_n``, q, ``across`` (q_t squared), ``slack`` ((mu P_n)^2 less that) and ``new``, in order.
    """

    U: Matrix
    P: Matrix
    q: Matrix
    new: Matrix
    definitions: dict[Symbol, Expr]


#: The projected normal impulse, |q_t|^2, and the factor of q_t.
P_n, across, shrink = symbols("P_n across shrink", real=True)
#: Normal parts of velocity and impulse.
U_n, before = symbols("U_n before", real=True)
#: Impulse over which the projections are smoothed, its part in the root, and dP_n/dq_n.
soft = Symbol("soft", nonnegative=True)
root, yielding = symbols("root yielding", real=True)


@lru_cache(maxsize=6)
def projection(d: int, smooth: bool = False) -> Projection:
    """The contact by itself: Signorini's and Coulomb's laws as projections of P - U/w.

    Where it is smooth, P_n (U_n + g/dt)/w_n = soft^2 instead of 0 (Chen & Harker, SIAM J. Matrix Anal. Appl. 14 (1993)
    1168): P_n = (q_n + sqrt(q_n^2 + 4 soft^2))/2, whose slope is ``yielding``.
    """
    n = rigid_contact(d).n
    U, P, q, new = (vector(name, d) for name in ("U", "P", "q", "new"))
    definitions: dict[Symbol, Expr] = {
        U_n: (n.T * U)[0],
        before: (n.T * P)[0],
        pressed: before - (U_n + bound) / w_n,
        P_n: Max(0, pressed),
    }
    if smooth:
        size = sqrt(pressed**2 + 4 * soft**2)
        exact = (pressed + size) / 2
        hidden = 2 * soft**2 / (size - pressed)  # the same, where the sum cancels
        assert cancel(exact - hidden) == 0
        del definitions[P_n]
        definitions[root] = size
        either = (exact.subs(size, root), pressed > 0), (hidden.subs(size, root), soft > 0), (0, True)
        definitions[P_n] = Piecewise(*either)
        definitions[yielding] = Piecewise((exact.diff(pressed).subs(size, root), root > 0), (0, True))
    if d == 1:
        definitions[new[0]] = P_n * n[0]
        return Projection(U, P, q, new, definitions)
    definitions |= dict(zip(q, P - before * n - (U - U_n * n) / w_t, strict=True))
    definitions |= {
        across: (q.T * q)[0],
        slack: (mu * P_n) ** 2 - across,
        shrink: Piecewise((1, slack > 0), (0, across <= 0), (mu * P_n / sqrt(across), True)),
    }
    definitions |= dict(zip(new, P_n * n + shrink * q, strict=True))
    return Projection(U, P, q, new, definitions)


@dataclass(frozen=True)
class Linearised:
    """A branch of Newton's step, P' = P - A G - D (U' - U), in a frame: n, the direction of q_t, and across both.

    Attributes
    ----------
    A, D : Matrix, shape (d, d)
        In ``P_n``, its slope ``yielding``, and ``length`` (|q_t|).
    """

    A: Matrix
    D: Matrix


#: |q_t|.
length = Symbol("length", positive=True)


@lru_cache(maxsize=6)
def linearised(d: int, slides: bool) -> Linearised:
    """Newton's step for a contact that sticks or slides: the projections' derivatives, and the weight.

    The second component of q_t vanishes in this frame after differentiation.
    """
    P, U = (Matrix(symbols(f"{name}_:{d}", real=True)) for name in ("P", "U"))
    normal = Matrix([P[0] - (U[0] + bound) / w_n])
    q = [P[k] - U[k] / w_t for k in range(1, d)]
    tangential = q
    if slides:
        size = sqrt(sum(component**2 for component in q))
        tangential = [mu * P_n * component / size for component in q]
    G = P - Matrix([P_n, *tangential])
    frame = {P[1]: length + U[1] / w_t} if d > 1 else {}
    frame |= {P[2]: U[2] / w_t} if d > 2 else {}
    # P_n is a function of the first row of q alone
    by_P, by_U = (
        Matrix((G.jacobian(of) + yielding * G.diff(P_n) * normal.jacobian(of)).subs(frame).applyfunc(cancel))
        for of in (P, U)
    )
    A = Matrix(by_P + eye(d) / rho).inv().applyfunc(cancel)
    return Linearised(A, Matrix(A * by_U).applyfunc(cancel))


def frame_of(d: int) -> Matrix:
    """The frame of a contact that slides, as columns: n, q_t/|q_t|, and in three dimensions their product."""
    n, q = rigid_contact(d).n, projection(d).q
    if d == 1:
        return n
    along = q / length
    return n.row_join(along) if d == 2 else n.row_join(along).row_join(n.cross(along))
