"""Contact law rognon_gay: written by softdyn 0.1.0 with sympy 1.14.0; do not edit.

Source: Rognon & Gay, arXiv:0803.1573, eqs. 3-5
Law b2a8534843dae832:
    a = sqrt(2)*sqrt(R)*sqrt(R*h/(R + h) + Abs(delta))
    F_ela = 4*E*a*delta/9
    zeta = 3*pi*a**4*eta*(R + h)**3/(2*R**3*h**3)
    F_adh = 0
Left out, with the operations that each saved:
    no remote force: 72 -> 71
Operations, 157 in all:
    gap_terms: 1 add, 1 mul, 1 div
    newton: 3 add, 11 mul, 1 div, 1 sqrt
    gap_rate: 2 add, 15 mul, 3 div, 1 sqrt
    slopes: 6 add, 36 mul, 8 div, 1 sqrt
    quantities: 10 add, 43 mul, 12 div, 1 sqrt

Functions: rognon_gay_evaluate, rognon_gay_solve_delta, rognon_gay_drive, rognon_gay_integrate, rognon_gay_passages, rognon_gay_sample, rognon_gay_runs.
p holds R, E, eta.
"""

from __future__ import annotations

from math import (  # noqa: F401
    acos, acosh, asin, asinh, atan, atanh, cos, cosh, erf, erfc, exp, expm1, fabs, inf, isfinite, log, log1p, nan, pow,
    sin, sinh, sqrt, tan, tanh,
)

import numba
from numpy import array as table
from numpy import empty  # noqa: F401
from numpy import ndarray as array  # noqa: F401

# IEEE arithmetic: no fastmath, and a division by zero gives inf or nan instead of raising
jit = numba.njit(cache=True, error_model="numpy", fastmath=False, nogil=True)

@jit
def _gap_terms(i: int, n: int, h: float, p: array, out: array) -> None:
    """What Newton's iteration for delta uses of the gap alone: out[k*n + i] is term k of state i."""
    R = p[0]
    gap0 = R * h / (R + h)
    out[0 * n + i] = gap0


@jit
def _newton(i: int, n: int, delta: float, F: float, terms: array, p: array, out: array) -> None:
    """A step of Newton's iteration for delta at a given gap: out[i] = (F_ela - F)/(dF_ela/d(delta))."""
    gap0 = terms[0 * n + i]
    R = p[0]
    E = p[1]
    x0 = fabs(delta)
    a = sqrt(2.0 * R * (gap0 + x0))
    a_p2 = a * a
    newton = a * (4.0 * delta * E * a - 9.0 * F) / (4.0 * E * (x0 * R + a_p2))
    out[i] = newton


@jit
def _gap_rate(i: int, h: float, delta: float, F: float, p: array, w: array, out: array) -> None:
    """w[i] = d(ln h)/dt (eq. 7)."""
    R = p[0]
    eta = p[2]
    x0 = R + h
    a = sqrt(2.0 * R * (R * h / x0 + fabs(delta)))
    R_p2 = R * R
    R_p3 = R_p2 * R
    a_p2 = a * a
    a_p4 = a_p2 * a_p2
    h_p2 = h * h
    h_p3 = h_p2 * h
    x0_p2 = x0 * x0
    x0_p3 = x0_p2 * x0
    zeta = 4.71238898038469 * eta * x0_p3 * a_p4 / (R_p3 * h_p3)
    dh_dt = -F / zeta
    w[i] = dh_dt / h


@jit
def _slopes(i: int, h: float, delta: float, F: float, p: array, out: array) -> None:
    """The Jacobian of the rates of the state (ln h, delta following from the force balance)."""
    R = p[0]
    E = p[1]
    eta = p[2]
    x0 = fabs(delta)
    x1 = R + h
    a = sqrt(2.0 * R * (R * h / x1 + x0))
    R_p2 = R * R
    R_p3 = R_p2 * R
    a_p2 = a * a
    a_p4 = a_p2 * a_p2
    h_p2 = h * h
    h_p3 = h_p2 * h
    x1_p2 = x1 * x1
    x1_p3 = x1_p2 * x1
    zeta = 4.71238898038469 * eta * x1_p3 * a_p4 / (R_p3 * h_p3)
    x3 = 1.0 / a
    x4 = (4.0 / 9.0) * E
    dF_ddelta = x4 * (x0 * x3 * R + a)
    x5 = 1.0 / x1_p2
    dF_dh = delta * x3 * x4 * x5 * R_p3
    dh_dt = -F / zeta
    x6 = 1.0 / h
    x7 = dF_dh / dF_ddelta
    x9 = R / a_p2
    slope_p11 = -dh_dt * x6 - dh_dt * (x5 * x6 * x9 * (4.0 * h * R_p2 - 3.0 * x1 * a_p2) - 4.0 * x7 * x9 * (1.0 if delta > 0.0 else (-1.0 if delta < 0.0 else 0.0)))
    slope_p21 = -x7 * h
    out[0 + i] = slope_p11
    out[8 + i] = slope_p21


@jit
def _quantities(i: int, n: int, h: float, delta: float, F: float, dF_dt: float, p: array, out: array) -> None:
    """a, F_ela, zeta, F_adh, C, D, dh_dt, ddelta_dt, dX_dt, X, lambda1, lambda2 at state i of n."""
    R = p[0]
    E = p[1]
    eta = p[2]
    x0 = fabs(delta)
    x1 = R + h
    a = sqrt(2.0 * R * (R * h / x1 + x0))
    x2 = (4.0 / 9.0) * E
    x3 = delta * x2
    F_ela = x3 * a
    R_p2 = R * R
    R_p3 = R_p2 * R
    a_p2 = a * a
    a_p4 = a_p2 * a_p2
    h_p2 = h * h
    h_p3 = h_p2 * h
    x1_p2 = x1 * x1
    x1_p3 = x1_p2 * x1
    zeta = 4.71238898038469 * eta * x1_p3 * a_p4 / (R_p3 * h_p3)
    F_adh = 0.0
    x5 = 1.0 / a
    dF_ddelta = x2 * (x0 * x5 * R + a)
    x6 = 1.0 / x1_p2
    x7 = x5 * x6 * R_p3
    dF_dh = x3 * x7
    C = dF_ddelta / 2.0
    D = C * zeta / (C + dF_dh)
    dh_dt = -F / zeta
    x8 = 1.0 / dF_ddelta
    ddelta_dt = x8 * (dF_dt - dF_dh * dh_dt)
    dX_dt = -F / D - dF_dt / C
    X = 2.0 * R + h - 2.0 * delta
    lambda1 = -x2 * x7 * x8 * h
    x10 = R / a_p2
    lambda2 = -h * (x10 * x6 * (4.0 * h * R_p2 - 3.0 * x1 * a_p2) / h - 4.0 * dF_dh * x10 * x8 * (1.0 if delta > 0.0 else (-1.0 if delta < 0.0 else 0.0)))
    out[0 * n + i] = a
    out[1 * n + i] = F_ela
    out[2 * n + i] = zeta
    out[3 * n + i] = F_adh
    out[4 * n + i] = C
    out[5 * n + i] = D
    out[6 * n + i] = dh_dt
    out[7 * n + i] = ddelta_dt
    out[8 * n + i] = dX_dt
    out[9 * n + i] = X
    out[10 * n + i] = lambda1
    out[11 * n + i] = lambda2


@jit
def _solve_delta(h: float, F: float, guess: float, p: array, w: array, terms: array) -> float:
    """The deflection at the gap h under the force F (eq. 1): Newton's iteration, kept between bounds.

    F_ela rises with delta and vanishes with it, so the sign of F bounds delta from one side, and the sign of each step
    from the other. Returns nan if there is no solution. Uses w[0], and of terms as many as the law has.
    """
    if F == 0.0:
        return 0.0
    low = 0.0 if F > 0.0 else -inf
    high = inf if F > 0.0 else 0.0
    _gap_terms(0, 1, h, p, terms)
    delta = guess
    if not (low < guess and guess < high):
        # start from the linear response, or from R where that is beyond R, or none, the stiffness having no bound
        _newton(0, 1, 0.0, F, terms, p, w)
        delta = -w[0]
        if not fabs(delta) < p[0] or delta == 0.0:
            delta = p[0] if F > 0.0 else -p[0]
    for iteration in range(400):
        _newton(0, 1, delta, F, terms, p, w)
        step = w[0]
        trial = delta - step
        # Newton's iteration converges quadratically: after a step of 1e-9 what is left is below rounding
        if fabs(step) <= 1e-9 * fabs(delta) and low <= trial and trial <= high:
            return trial
        residual = step
        if residual > 0.0:
            high = delta
        elif residual < 0.0:
            low = delta
        else:
            return nan
        if not (low < trial and trial < high):
            if high == inf or low == -inf:
                trial = 2.0 * delta
            elif low == 0.0 or high == 0.0:
                trial = 1e-3 * delta
            elif 0.5 * (low + high) == low or 0.5 * (low + high) == high:
                return delta
            else:
                trial = 0.5 * (low + high)
        delta = trial
    return nan


@jit
def _drive(t: float, table_t: array, table_F: array, segment: int, w: array) -> None:
    """What is given, and its rate of change, at the time t: w[0] and w[1]."""
    # linear between two rows
    start = table_t[segment]
    slope = (table_F[segment + 1] - table_F[segment]) / (table_t[segment + 1] - start)
    w[0] = table_F[segment] + slope * (t - start)
    w[1] = slope


@jit
def _given(t: float, table_t: array, table_F: array, segment: int) -> float:
    """What the integration needs of the drive at the time t: its value."""
    start = table_t[segment]
    slope = (table_F[segment + 1] - table_F[segment]) / (table_t[segment + 1] - start)
    return table_F[segment] + slope * (t - start)


@jit
def rognon_gay_evaluate(n: int, h: array, delta: array, F: array, dF_dt: array, p: array, out: array) -> None:
    """a, F_ela, zeta, F_adh, C, D, dh_dt, ddelta_dt, dX_dt, X, lambda1, lambda2 at n states: out[k*n + i] is quantity k at state i."""
    for i in range(n):
        _quantities(i, n, h[i], delta[i], F[i], dF_dt[i], p, out)


@jit
def rognon_gay_solve_delta(n: int, h: array, F: array, p: array, delta: array) -> None:
    """The deflection at n gaps under n forces, from guesses, or nan for that of the state before; nan if there is none."""
    w = empty(2)
    terms = empty(1)
    guess = nan
    for i in range(n):
        guess = guess if delta[i] != delta[i] else delta[i]
        delta[i] = _solve_delta(h[i], F[i], guess, p, w, terms)
        guess = delta[i]


@jit
def rognon_gay_drive(n: int, t: array, table_t: array, table_F: array, rows: int, value: array, rate: array) -> None:
    """What is given, and its rate of change, at n times, in increasing order."""
    w = empty(2)
    segment: int = 0
    for i in range(n):
        while segment < rows - 2 and t[i] >= table_t[segment + 1]:
            segment += 1
        _drive(t[i], table_t, table_F, segment, w)
        value[i] = w[0]
        rate[i] = w[1]




_NODES = table((0.0, 0.022479386438712497, 0.11467905316090424, 0.26578982278458946, 0.45284637366944464, 0.6473752828868303, 0.8197593082631076, 0.9437374394630779, 1.0))
_WEIGHTS = table((6435.0, -10269.771635486373, 6713.600026233208, -5199.222168253645, 4231.204479179782, -3470.1488650701895, 2771.535521741593, -2016.5723583443762, 804.375))
_INVERSE = table((22.24259996433592, -16.591130197062395, 8.118236017822703, -5.639723637389978, 4.735927090795289, -4.647608208611454, 5.527970024131676, -13.060996041930576, 7.090311673892601, 4.3599941420728205, -8.545188959239656, 4.6920195582474715, -3.631848592579311, 3.435551489028797, -4.015656325439553, 9.427491723502559, -2.0807353791506724, 5.124924766028432, 1.8811856479742912, -6.56903294216823, 3.9264353565757815, -3.3863518751042307, 3.803018407185814, -8.803581949472228, 0.9573357504593115, -1.8637038978972118, 4.350635666704743, 1.1041272031140856, -6.268039956795005, 4.160835466074826, -4.274300739417069, 9.613824007769752, -0.5407289808993253, 0.9703156119145759, -1.74911317938708, 4.215993576843231, 0.7723495369955398, -7.263244082291598, 5.806461483798834, -12.234234226309493, 0.33849233242014465, -0.5854993702775402, 0.9622684139381908, -1.7852268638042161, 4.633138954070064, 0.6099351296899472, -11.085659975292161, 19.11652897579454, -0.21314332000182057, 0.3623040837769572, -0.5721096798557673, 0.9708780178916415, -1.9608436116902346, 5.868786019458078, 0.5298083758173946, -44.55903248935456, 0.08012570308363981, -0.1353325797521185, 0.21071710374962413, -0.3474443618639409, 0.6573515746603226, -1.6102201966976866, 7.089657599491891, 32.5))
_QUADRATURE = table((0.0572544073721286, 0.12482395066493249, 0.17350739781725064, 0.19578608372624678, 0.1882587726945593, 0.15206531032339257, 0.09267907740148965, 0.015625))
_SLOPE_START = table((-64.0, 70.99500301886783, -9.097515706789968, 3.0398452598441437, -1.4519931522612475, 0.8329970067575939, -0.5253945230439019, 0.33205809662554375, -0.125))
_VALUE_PROBE = table((0.18989107933999777, -0.31596306961520165, 0.250288877906427, -0.29684903041710314, 0.7061810563740808, 0.5791621282707715, -0.16685094781148993, 0.08316403720092917, -0.029024131248411467))
_SLOPE_PROBE = table((-0.14484807076009093, 0.26548555931664297, -0.310746422732583, 0.7308813056886966, -6.515387609459459, 6.565537203893002, -0.7948031499501251, 0.2990161802065628, -0.09513499620264546))


@jit
def _between(theta: float, z: array) -> float:
    """A component at the fraction theta of a step, less its value at the start: barycentric interpolation."""
    above = 0.0
    below = _WEIGHTS[0] / theta
    if theta == 0.0:
        return 0.0
    for j in range(8):
        if theta == _NODES[j + 1]:
            return z[j]
        weight = _WEIGHTS[j + 1] / (theta - _NODES[j + 1])
        above += weight * z[j]
        below += weight
    return above / below


@jit
def _extrapolation(ratio: float, m: array, sums: array) -> None:
    """The matrix, by columns, from the stages of a step to those of the next, ratio times as long, by its polynomial."""
    for i in range(8):
        sums[i] = _WEIGHTS[0] / (1.0 + ratio * _NODES[i + 1])
    for j in range(8):
        for i in range(8):
            m[8 * j + i] = _WEIGHTS[j + 1] / (1.0 + ratio * _NODES[i + 1] - _NODES[j + 1])
            sums[i] += m[8 * j + i]
    for i in range(8):
        sums[i] = 1.0 / sums[i]
    for j in range(8):
        for i in range(8):
            m[8 * j + i] = m[8 * j + i] * sums[i]


@jit
def _predict(z: array, m: array, scratch: array) -> None:
    """Stages of the next step, measured from the end of the last, whose stages are z."""
    for i in range(8):
        scratch[i] = (m[0 + i] * z[0] + m[8 + i] * z[1]) + (m[16 + i] * z[2] + m[24 + i] * z[3]) + (m[32 + i] * z[4] + m[40 + i] * z[5]) + (m[48 + i] * z[6] + m[56 + i] * z[7])
    end = z[7]
    for i in range(8):
        z[i] = scratch[i] - end


@jit
def _invert(m: array) -> None:
    """Invert a matrix of 8 rows in place, by Gauss and Jordan: a poor inverse costs iterations, not accuracy."""
    for k in range(8):
        pivot = 1.0 / m[9 * k]
        m[9 * k] = 1.0
        for j in range(8):
            m[8 * k + j] = pivot * m[8 * k + j]
        for i in range(8):
            if i != k:
                factor = m[8 * i + k]
                m[8 * i + k] = 0.0
                for j in range(8):
                    m[8 * i + j] -= factor * m[8 * k + j]


@jit
def _left(apart: float, error: float) -> float:
    """The part of the error within a step that is left at its end.

    If the coefficients of the solution fall by a factor r from one order to the next, the end, of order 15, errs by r^7
    of what the polynomial, of order 9, does on the way; the two probes of the defect differ by some r. Where they do,
    or the step is long, r^7 is not reached: bounds that measured steps keep to.
    """
    left = apart * apart * apart + 30.0 * sqrt(error)
    return left if left < 1.0 else 1.0


@jit
def _deflections(small: float, h: array, F: array, delta: array, p: array, w: array, terms: array) -> None:
    """Deflections of 8 states at once, from guesses in delta: Newton's iteration, to an error of ``small``, relative.

    It converges quadratically, so that after a change of c1 and one of c2 there would be one of c2**3/c1**2.
    w, of 40 numbers: the last changes, stiffnesses, relative changes, the sizes that these are relative to, what is
    left to do.
    """
    # of an iteration that has just begun, whose change leaves about its square
    enough = sqrt(0.1 * small)
    for i in range(8):
        _gap_terms(i, 8, h[i], p, terms)
    for i in range(8):
        w[16 + i] = 0.0
        w[24 + i] = 1.0 / fabs(delta[i])
    for iteration in range(7):
        for i in range(8):
            _newton(i, 8, delta[i], F[i], terms, p, w)
        left = 0.0
        for i in range(8):
            delta[i] = delta[i] - w[i]
            size = fabs(w[i]) * w[24 + i]
            before = w[16 + i]
            w[32 + i] = 0.0 if size <= enough or size * size * size <= small * (before * before) else 1.0
            w[16 + i] = size
            left += w[32 + i]
        if left == 0.0:
            break
    # on the branch where F_ela rises from 0 with delta: a law may have others
    for i in range(8):
        if w[32 + i] != 0.0 or not (delta[i] * F[i] >= 0.0):
            delta[i] = _solve_delta(h[i], F[i], nan, p, w, terms)








@jit
def rognon_gay_integrate(t_end: float, u_stop: float, rtol: float, p: array, table_t: array, table_F: array, rows: int, capacity: int, state: array, steps: array) -> int:
    """Integrate the state, u = ln h, by collocation: Radau IIA with 8 stages, which is L-stable.

    A step is accepted if the defect of its polynomial, measured at two points, promises an error below rtol, relative,
    of h throughout the step. Steps end at the rows of a table, and where the force crosses zero.

    state, of 20 numbers: t, u, delta, step (0 at the start), steps accepted, rejected, passes of Newton's iteration, single
    rates, segment of the table, steps recorded by this call, largest step times rate of decay, whether the gap is settled,
    longest step allowed, whether ln h may serve as the independent variable, how many steps it did, and estimates of the
    errors of u and delta, the errors of all steps grown as the linearised equation has it; steps within which the force is
    not known, the time of the first of them, and steps that were shortened to know it. It is updated, and a further call
    goes on from it.
    steps, of 14*capacity numbers: for each step its start, its length, what ends it (0 nothing, 1 a row of the
    table, 2 the force crosses zero, 3 a film is reached), and for each component its value at the start and its 8 stages. Last, the estimated errors within the step, of u at a given time, and of the time at a given u.

    Returns 0 at t_end, 1 after the step in which u passes u_stop, 2 when steps is full, 3 at the end of the table;
    -1 if the step falls below rounding, -2 if t overflows, -3 if there is no rate at the start.
    """
    w = empty(4)
    work = empty(40)
    terms = empty(8)
    given = empty(8)
    h = empty(8)
    deflection = empty(8)
    before = empty(8)
    above = empty(8)
    below = empty(8)
    slopes = empty(16)
    m = empty(64)
    residual = empty(8)
    change = empty(8)
    u_z = empty(8)
    u_kept = empty(8)
    u_rate = empty(8)
    # copied by the first step, too, which goes on from none
    for i in range(8):
        before[i] = 0.0
        u_kept[i] = 0.0
    t = state[0]
    u = state[1]
    delta = state[2]
    dt = state[3]
    accepted = state[4]
    rejected = state[5]
    passes = state[6]
    singles = state[7]
    segment: int = int(state[8])
    u_astray = state[15]
    stiffest = state[10]
    settled = state[11]
    # the last step, of which the next one is predicted; 0 after what cannot be extrapolated
    last = 0.0
    last_error = 1.0
    fresh = 1.0
    crossing = inf
    shrink_only = 0.0
    u_dot = 0.0
    status: int = 2
    stored: int = 0
    while status == 2 and stored < capacity:
        if t >= table_t[segment + 1] and segment < rows - 2:
            segment += 1
            continue
        limit = table_t[segment + 1] if table_t[segment + 1] < t_end else t_end
        ending = 1.0 if table_t[segment + 1] < t_end else 0.0
        if t >= t_end:
            status = 0
            break
        if t >= table_t[rows - 1]:
            status = 3
            break
        if fresh == 1.0:
            # the rates where the run starts, or goes on after an event
            given[0] = _given(t, table_t, table_F, segment)
            for i in range(8):
                h[i] = exp(u)
                given[i] = given[0]
                deflection[i] = delta
            _deflections(1e-3 * rtol, h, given, deflection, p, work, terms)
            delta = deflection[0]
            for i in range(8):
                _gap_rate(i, h[i], deflection[i], given[i], p, u_rate, w)
            for i in range(8):
                _slopes(i, h[i], deflection[i], given[i], p, slopes)
            singles += 8.0
            u_dot = u_rate[0]
            if not isfinite(u_dot):
                status = -3
                break
            fresh = 0.0
            last = 0.0
            if dt == 0.0:
                speed = fabs(u_dot) + fabs(slopes[0])
                if speed > 0.0:
                    dt = 0.1 / speed
                else:
                    # nothing moves yet: look ahead until something does
                    dt = 1e-9 * (t_end - t) if isfinite(t_end) else 1e-200
                    moving: int = 0
                    while moving == 0 and dt < 1e200 and t + dt < limit:
                        given[0] = _given(t + dt, table_t, table_F, segment)
                        deflection[0] = _solve_delta(h[0], given[0], nan, p, w, terms)
                        _gap_rate(0, h[0], deflection[0], given[0], p, u_rate, w)
                        singles += 1.0
                        if fabs(u_rate[0]) * dt < 1e-3:
                            dt = 4.0 * dt
                        else:
                            moving = 1
        # land on the limit, and leave no sliver before it
        if crossing < limit:
            limit = crossing
            ending = 2.0
        step = dt if dt < state[12] else state[12]
        landing = 0.0
        if t + 1.01 * step >= limit:
            step = limit - t
            landing = 1.0
        if not isfinite(t + step):
            status = -2
            break
        if step <= 4.5e-16 * fabs(t):
            if landing == 1.0:
                t = limit
                if limit == crossing:
                    crossing = inf
                fresh = 1.0
                continue
            status = -1
            break
        # what is given, at the stages
        for i in range(8):
            given[i] = _given(t + _NODES[i + 1] * step, table_t, table_F, segment)
        # where the force crosses zero the law may have a kink: end a step there
        if crossing == inf:
            # its sign, not itself: products underflow
            value = _given(t, table_t, table_F, segment)
            side = 1.0 if value > 0.0 else -1.0 if value < 0.0 else 0.0
            earlier = t
            for i in range(8):
                later = t + _NODES[i + 1] * step
                if side * given[i] < 0.0:
                    while later - earlier > 4.5e-16 * fabs(later):
                        middle = 0.5 * (earlier + later)
                        if middle <= earlier or middle >= later:
                            break
                        if _given(middle, table_t, table_F, segment) * side > 0.0:
                            earlier = middle
                        else:
                            later = middle
                    crossing = later
                    break
                if given[i] != 0.0:
                    side = 1.0 if given[i] > 0.0 else -1.0
                earlier = later
            if crossing < inf:
                continue
        # predict the stages: by the last step's polynomial, unless far beyond it, or along the tangent, bent where it decays
        for i in range(8):
            u_z[i] = u_kept[i]
        for i in range(8):
            deflection[i] = before[i]
        wild: int = 0
        if last > 0.0 and step <= 2.0 * last:
            _extrapolation(step / last, m, above)
            _predict(u_z, m, above)
            _predict(deflection, m, above)
            for i in range(8):
                deflection[i] = delta + deflection[i]
            for i in range(8):
                if not fabs(u_z[i]) < 2.0:
                    wild += 1
        if step > 2.0 * last or wild > 0:
            for i in range(8):
                reach = _NODES[i + 1] * step
                u_z[i] = reach * u_dot / (1.0 - reach * slopes[7] if slopes[7] < 0.0 else 1.0)
                deflection[i] = delta
        # what no step can be held to: u itself is rounded
        rounding = 4.5e-16 * (1.0 + fabs(u))
        # Newton's iteration, its matrix renewed while it moves far
        moved = inf
        renew: int = 1
        turn: int = 0
        done: int = 0
        while turn < 10 and done == 0:
            turn += 1
            for i in range(8):
                h[i] = exp(u + u_z[i])
            _deflections(1e-3 * rtol, h, given, deflection, p, work, terms)
            for i in range(8):
                _gap_rate(i, h[i], deflection[i], given[i], p, u_rate, w)
            # without a deflection there is no rate, even of a law whose rate does not depend on it
            for i in range(8):
                u_rate[i] += 0.0 * deflection[i]
            if renew == 1:
                for i in range(8):
                    _slopes(i, h[i], deflection[i], given[i], p, slopes)
                for i in range(64):
                    m[i] = _INVERSE[i]
                for i in range(8):
                    m[9 * i] -= step * slopes[i]
                _invert(m)
            for i in range(8):
                residual[0 + i] = step * u_rate[i] - ((_INVERSE[0 + i] * u_z[0] + _INVERSE[8 + i] * u_z[1]) + (_INVERSE[16 + i] * u_z[2] + _INVERSE[24 + i] * u_z[3]) + (_INVERSE[32 + i] * u_z[4] + _INVERSE[40 + i] * u_z[5]) + (_INVERSE[48 + i] * u_z[6] + _INVERSE[56 + i] * u_z[7]))
            for i in range(8):
                change[i] = (m[0 + i] * residual[0] + m[8 + i] * residual[1]) + (m[16 + i] * residual[2] + m[24 + i] * residual[3]) + (m[32 + i] * residual[4] + m[40 + i] * residual[5]) + (m[48 + i] * residual[6] + m[56 + i] * residual[7])
            for i in range(8):
                u_z[i] += change[0 + i]
            for i in range(8):
                deflection[i] += slopes[8 + i] * change[i]
            total = 0.0
            for i in range(8):
                total += change[i] * change[i]
            moves = sqrt(total)
            renew = 1 if moves > 0.003 else 0
            contraction = moves / moved
            # 1e-2 of what a step may err, or what rounding leaves
            if moves <= 1e-2 * rtol or moves <= rounding:
                done = 1
            elif turn > 1 and contraction < 0.5 and moves * contraction / (1.0 - contraction) <= 1e-2 * rtol:
                done = 1
            elif not moves < 10.0 or (turn > 2 and contraction > 1.0):
                break
            moved = moves
        passes += float(turn)
        # what a further pass would correct
        unsolved = moves * contraction if contraction < 1.0 else moves
        if done == 0:
            rejected += 1.0
            last = 0.0
            shrink_only = 1.0
            dt = 0.25 * step
            continue
        # the defect of the polynomial at the start and at the probe, and the error that it makes
        probe_given = _given(t + 0.5501108282781375 * step, table_t, table_F, segment)
        u_probe = u
        u_late = 0.0
        u_defect = -step * u_dot
        for i in range(8):
            u_probe += _VALUE_PROBE[i + 1] * u_z[i]
            u_late += _SLOPE_PROBE[i + 1] * u_z[i]
            u_defect += _SLOPE_START[i + 1] * u_z[i]
        h_probe = exp(u_probe)
        delta_probe = _solve_delta(h_probe, probe_given, deflection[4], p, w, terms)
        _gap_rate(0, h_probe, delta_probe, probe_given, p, above, below)
        singles += 1.0
        d1 = 0.014424143230897014 * u_defect
        d2 = 0.07596008870469767 * (u_late - step * above[0])
        # written so that nan rejects the step
        error = fabs(d1) if fabs(d1) > fabs(d2) else fabs(d2)
        left = _left(fabs(d1 - d2) / error, error)
        # where the step is mildest: a law can be a thousand times stiffer at its end than on the way
        decay = -step * slopes[7]
        stiffest = decay if decay > stiffest else stiffest
        for i in range(7):
            decay = -step * slopes[i] if -step * slopes[i] < decay else decay
        u_error = error / (1.0 + 0.014424143230897014 * decay if decay > 0.0 else 1.0)
        error = u_error / (rtol + rounding)
        factor = 0.8 * pow(error if error > 1e-12 else 1e-12, -1.0 / 9.0)
        if not error <= 1.0:
            rejected += 1.0
            shrink_only = 1.0
            # an error that is nan leaves a factor above 1
            dt = step * (factor if factor > 0.2 and factor < 1.0 else 0.2)
            continue
        # the step stands
        base: int = 14 * stored
        steps[base] = t
        steps[base + 1] = step
        steps[base + 2] = ending if landing == 1.0 else 0.0
        steps[base + 3] = u
        for i in range(8):
            steps[base + 4 + i] = u_z[i]
            u_kept[i] = u_z[i]
        for i in range(8):
            before[i] = deflection[i] - delta
        # the errors so far grow, or decay, as a perturbation of the start of the step does, and its own joins them
        growth = 0.0
        for i in range(8):
            growth += _QUADRATURE[i] * slopes[i]
        growth = exp(step * growth)
        late = u_astray * (growth if growth > 1.0 else 1.0) + u_error
        u_astray = u_astray * growth + u_error * left + unsolved + 0.25 * rounding + 1.1e-16 * fabs((t + step) * u_dot)
        slowest = fabs(u_dot) if fabs(u_dot) < fabs(u_rate[7]) else fabs(u_rate[7])
        steps[base + 12] = late
        steps[base + 13] = late / slowest if slowest > 0.0 else inf
        accepted += 1.0
        u_new = u + u_z[7]
        if (u - u_stop) * (u_new - u_stop) <= 0.0:
            status = 1
        # the last stage is the end of the step; the last correction moves its rates along the Jacobian
        u_dot = u_rate[7] + slopes[7] * change[7]
        delta = deflection[7]
        resting = 1.0 if slopes[7] < 0.0 and fabs(u_dot) <= -rtol * slopes[7] else 0.0
        if resting > settled and steps[base + 2] == 0.0:
            steps[base + 2] = 3.0
        settled = resting
        u = u_new
        t = limit if landing == 1.0 else t + step
        stored += 1
        if last > 0.0:
            foresight = factor * step / last * pow(last_error / (error if error > 1e-12 else 1e-12), 1.0 / 9.0)
            factor = foresight if foresight < factor else factor
        factor = factor if factor < 8.0 else 8.0
        factor = factor if factor > 0.2 else 0.2
        factor = factor if shrink_only == 0.0 or factor < 1.0 else 1.0
        # a step shortened to land says nothing about the next
        dt = step * factor if landing == 0.0 or step * factor > dt else dt
        shrink_only = 0.0
        last = step
        last_error = error if error > 1e-2 else 1e-2
        if landing == 1.0 and ending > 0.0:
            fresh = 1.0
            if limit == crossing:
                crossing = inf
    state[0] = t
    state[1] = u
    state[2] = delta
    state[3] = dt
    state[4] = accepted
    state[5] = rejected
    state[6] = passes
    state[7] = singles
    state[8] = float(segment)
    state[9] = float(stored)
    state[10] = stiffest
    state[11] = settled
    state[15] = u_astray
    return status



@jit
def _values(theta: array, base: int, steps: array, out: array) -> None:
    """A component at 8 fractions of a step in time: its value, and 8 stages, are stored from base on."""
    for i in range(8):
        x = theta[i]
        below0 = _WEIGHTS[0] / x
        part1 = _WEIGHTS[1] / (x - _NODES[1])
        above1 = part1 * steps[base + 1]
        below1 = below0 + part1
        part2 = _WEIGHTS[2] / (x - _NODES[2])
        above2 = above1 + part2 * steps[base + 2]
        below2 = below1 + part2
        part3 = _WEIGHTS[3] / (x - _NODES[3])
        above3 = above2 + part3 * steps[base + 3]
        below3 = below2 + part3
        part4 = _WEIGHTS[4] / (x - _NODES[4])
        above4 = above3 + part4 * steps[base + 4]
        below4 = below3 + part4
        part5 = _WEIGHTS[5] / (x - _NODES[5])
        above5 = above4 + part5 * steps[base + 5]
        below5 = below4 + part5
        part6 = _WEIGHTS[6] / (x - _NODES[6])
        above6 = above5 + part6 * steps[base + 6]
        below6 = below5 + part6
        part7 = _WEIGHTS[7] / (x - _NODES[7])
        above7 = above6 + part7 * steps[base + 7]
        below7 = below6 + part7
        part8 = _WEIGHTS[8] / (x - _NODES[8])
        above8 = above7 + part8 * steps[base + 8]
        below8 = below7 + part8
        out[i] = steps[base] + above8 / below8
    for i in range(8):
        # where a node is hit
        if not isfinite(out[i]):
            out[i] = steps[base]
            for j in range(8):
                if theta[i] == _NODES[j + 1]:
                    out[i] = steps[base] + steps[base + 1 + j]


@jit
def _states(base: int, t: array, steps: array, u: array) -> None:
    """The state at 8 times, in increasing order, within a step."""
    theta = empty(8)
    for i in range(8):
        theta[i] = (t[i] - steps[base]) / steps[base + 1]
    _values(theta, base + 3, steps, u)


@jit
def rognon_gay_sample(n: int, t: array, stored: int, steps: array, out: array) -> None:
    """The state at n times, in increasing order, from the 14 numbers of each of the steps stored: out[k*n + i] is component k."""
    lane = empty(8)
    u = empty(8)
    at: int = 0
    i: int = 0
    while i < n:
        while at < stored - 1 and t[i] >= steps[14 * (at + 1)]:
            at += 1
        m: int = 1
        while m < 8 and i + m < n and (at == stored - 1 or t[i + m] < steps[14 * (at + 1)]):
            m += 1
        for k in range(8):
            lane[k] = t[i + k if k < m else i + m - 1]
        _states(14 * at, lane, steps, u)
        for k in range(m):
            out[0 * n + i + k] = u[k]
        i += m


@jit
def _passage(u: float, base: int, steps: array) -> float:
    """The time at which ln h passes u within a step in time, by bisection of its polynomial."""
    z = empty(8)
    for j in range(8):
        z[j] = steps[base + 4 + j]
    target = u - steps[base + 3]
    low = 0.0
    high = 1.0
    for iteration in range(60):
        middle = 0.5 * (low + high)
        value = _between(middle, z)
        if (value < target and z[7] > 0.0) or (value > target and z[7] < 0.0):
            low = middle
        else:
            high = middle
    return steps[base] + high * steps[base + 1]


@jit
def rognon_gay_passages(n: int, u: array, at: array, steps: array, out: array) -> None:
    """The times at which ln h passes n values, each within the step of a number."""
    for i in range(n):
        base: int = 14 * int(at[i])
        out[i] = _passage(u[i], base, steps)


@jit
def _write(small: float, i: int, m: int, total: int, t: array, u: array, delta: array, p: array, table_t: array, table_F: array, rows: int, work: array, terms: array, out: array) -> None:
    """Write m outputs, of 8 at most, from number i on: all that follows from the time and the state."""
    w = empty(2)
    h = empty(8)
    given = empty(8)
    rate = empty(8)
    segment: int = 0
    for k in range(8):
        lane: int = k if k < m else m - 1
        t[k] = t[lane]
        u[k] = u[lane]
        while segment < rows - 2 and t[k] >= table_t[segment + 1]:
            segment += 1
        _drive(t[k], table_t, table_F, segment, w)
        given[k] = w[0]
        rate[k] = w[1]
        h[k] = exp(u[k])
        delta[k] = delta[7]
    _deflections(small, h, given, delta, p, work, terms)
    for k in range(m):
        out[i + k] = t[k]
        out[total + i + k] = h[k]
        out[2 * total + i + k] = delta[k]
        out[3 * total + i + k] = given[k]
        out[4 * total + i + k] = rate[k]
        _quantities(5 * total + i + k, total, h[k], delta[k], given[k], rate[k], p, out)


@jit
def _collect(small: float, start: float, worst: array, j: int, first: int, count: int, total: int, at_gaps: int, targets: array, stored: int, steps: array, p: array, table_t: array, table_F: array, rows: int, out: array) -> int:
    """Write the outputs of a run from number j on, as far as the stored steps reach; returns how far that is."""
    lane = empty(8)
    t = empty(8)
    u = empty(8)
    delta = empty(8)
    z = empty(8)
    work = empty(40)
    terms = empty(8)
    # outputs gathered and not written yet
    gathered: int = 0
    delta[7] = out[2 * total + first + j - 1] if j > 0 else nan
    for at in range(stored):
        base: int = 14 * at
        begin = steps[base + 3]
        end = begin + steps[base + 11]
        last = steps[base] + steps[base + 1]
        m: int = 1
        while m > 0:
            m = 0
            if at_gaps == 1:
                # begin + (end - begin) rounds
                while gathered + m < 8 and j + m < count and (begin - targets[first + j + m]) * (end - targets[first + j + m]) <= 1e-15 * (1.0 + fabs(end)) * fabs(end - begin):
                    m += 1
            else:
                while gathered + m < 8 and j + m < count and targets[first + j + m] <= last:
                    m += 1
            if m == 0:
                continue
            for k in range(8):
                lane[k] = targets[first + j + (k if k < m else m - 1)]
            for k in range(m):
                t[gathered + k] = _passage(lane[k], base, steps) if at_gaps == 1 else lane[k]
                part = (t[gathered + k] - steps[base]) / steps[base + 1]
                for i in range(8):
                    z[i] = steps[base + 4 + i]
                u[gathered + k] = lane[k] if at_gaps == 1 else begin + _between(part, z)
            for k in range(m):
                # as far from the curve (t, h), where outputs are at gaps, as the smaller of the errors of h and of t
                error = steps[base + 12]
                late = steps[base + 13] / (t[gathered + k] - start)
                error = late if at_gaps == 1 and late < error else error
                if not error <= worst[0]:
                    worst[0] = error
            gathered += m
            j += m
            if gathered == 8:
                _write(small, first + j - 8, 8, total, t, u, delta, p, table_t, table_F, rows, work, terms, out)
                gathered = 0
    if gathered > 0:
        _write(small, first + j - gathered, gathered, total, t, u, delta, p, table_t, table_F, rows, work, terms, out)
    return j


@jit
def rognon_gay_runs(n: int, count: int, at_gaps: int, settings: array, runs: array, targets: array, table_t: array, table_F: array, rows: int, out: array) -> None:
    """Make n runs, each with its own parameters, start and end, and write the outputs asked for.

    settings: rtol, the time of the start, longest step, steps that a run may take, whether ln h may serve as the
    independent variable.
    runs: of each run t_end, u_stop, ln h, delta (which follows from the force here), 3 parameters.
    targets: the times, or with at_gaps = 1 the values of ln h, of the count outputs of each run, in the order of passage.
    out: t, h, delta, what is given, its rate, a, F_ela, zeta, F_adh, C, D, dh_dt, ddelta_dt, dX_dt, X, lambda1, lambda2, each n*count numbers; the status of each run, as
    rognon_gay_integrate returns it, or 10 if it took too many steps, 11 if the gap left the range of double precision;
    and the largest estimated error of its outputs, relative.
    What a run does not reach is left as it is.
    """
    state = empty(20)
    worst = empty(1)
    steps = empty(448)
    p = empty(3)
    for run in range(n):
        at: int = 7 * run
        for k in range(3):
            p[k] = runs[at + 4 + k]
        for k in range(20):
            state[k] = 0.0
        state[0] = settings[1]
        state[1] = runs[at + 2]
        state[2] = runs[at + 3]
        state[12] = settings[2]
        state[13] = settings[4]
        worst[0] = 0.0
        j: int = 0
        ended: int = 2
        while ended == 2:
            ended = rognon_gay_integrate(runs[at], runs[at + 1], settings[0], p, table_t, table_F, rows, 32, state, steps)
            j = _collect(1e-3 * settings[0], settings[1], worst, j, count * run, count, count * n, at_gaps, targets, int(state[9]), steps, p, table_t, table_F, rows, out)
            if ended == 2 and state[4] + state[5] > settings[3]:
                ended = 10
            elif ended == 2 and not fabs(state[1]) < 690.0:
                ended = 11
        if state[17] > 0.0:
            ended = 12
        out[17 * n * count + run] = float(ended)
        out[17 * n * count + n + run] = worst[0]
