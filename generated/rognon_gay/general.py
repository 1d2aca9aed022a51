"""Contact law rognon_gay: written by softdyn 0.1.0 with sympy 1.14.0; do not edit.

Source: Rognon & Gay, arXiv:0803.1573, eqs. 3-5
Law b2a8534843dae832:
    a = sqrt(2)*sqrt(R)*sqrt(R*h/(R + h) + Abs(delta))
    F_ela = 4*E*a*delta/9
    zeta = 3*pi*a**4*eta*(R + h)**3/(2*R**3*h**3)
    F_adh = 0
Left out, with the operations that each saved:
    no remote force: 67 -> 66
Operations, 101 in all:
    balance: 3 add, 8 mul, 2 div, 1 sqrt
    gap_rate: 2 add, 15 mul, 3 div, 1 sqrt
    quantities: 10 add, 43 mul, 12 div, 1 sqrt

Functions: rognon_gay_evaluate, rognon_gay_solve_delta, rognon_gay_force, rognon_gay_integrate.
p holds R, E, eta.
"""

from __future__ import annotations

from math import (  # noqa: F401
    acos, acosh, asin, asinh, atan, atanh, cos, cosh, erf, erfc, exp, expm1, fabs, inf, isfinite, log, log1p, nan, pow,
    sin, sinh, sqrt, tan, tanh,
)

import numba
from numpy import empty  # noqa: F401
from numpy import ndarray as array  # noqa: F401

# IEEE arithmetic: no fastmath, and a division by zero gives inf or nan instead of raising
jit = numba.njit(cache=True, error_model="numpy", fastmath=False, nogil=True)

@jit
def _balance(h: float, delta: float, p: array, w: array) -> None:
    """The elastic force and its derivative along delta: w = F_ela, dF_ela/d(delta)."""
    R = p[0]
    E = p[1]
    x0 = fabs(delta)
    a = sqrt(2.0 * R * (R * h / (R + h) + x0))
    x1 = (4.0 / 9.0) * E
    F_ela = delta * x1 * a
    dF_ddelta = x1 * (x0 * R / a + a)
    w[0] = F_ela
    w[1] = dF_ddelta


@jit
def _gap_rate(h: float, delta: float, F: float, p: array) -> float:
    """dh/dt (eq. 7)."""
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
    return dh_dt


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
def _solve_delta(h: float, F: float, guess: float, p: array, w: array) -> float:
    """The deflection at the gap h under the force F (eq. 1): Newton's iteration, kept between bounds.

    F_ela rises with delta and vanishes with it, so the sign of F bounds delta from one side. Returns nan if there is no
    solution.
    """
    if F == 0.0:
        return 0.0
    low = 0.0 if F > 0.0 else -inf
    high = inf if F > 0.0 else 0.0
    delta = guess
    if not (low < guess and guess < high):
        # start from the linear response, or from R where that is beyond R
        _balance(h, 0.0, p, w)
        delta = F / w[1]
        if not fabs(delta) < p[0]:
            delta = p[0] if F > 0.0 else -p[0]
    for iteration in range(400):
        _balance(h, delta, p, w)
        residual = w[0] - F
        step = residual / w[1]
        trial = delta - step
        # Newton's iteration converges quadratically: after a step of 1e-9 what is left is below rounding
        if fabs(step) <= 1e-9 * fabs(delta) and low <= trial and trial <= high:
            return trial
        if residual > 0.0:
            high = delta
        elif residual < 0.0:
            low = delta
        else:
            return delta if residual == 0.0 else nan
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
def _force(t: float, table_t: array, table_F: array, segment: int, w: array) -> None:
    """The external force and its rate of change, linear between two rows of the table: w = F_ext, dF_ext/dt."""
    start = table_t[segment]
    slope = (table_F[segment + 1] - table_F[segment]) / (table_t[segment + 1] - start)
    w[0] = table_F[segment] + slope * (t - start)
    w[1] = slope


@jit
def _rate(t: float, u: float, p: array, table_t: array, table_F: array, segment: int, w: array) -> float:
    """du/dt for u = ln h (eq. 7), the deflection following from the force balance; it is kept in w[2]."""
    h = exp(u)
    _force(t, table_t, table_F, segment, w)
    F = w[0]
    delta = _solve_delta(h, F, w[2], p, w)
    w[2] = delta
    return _gap_rate(h, delta, F, p) / h


@jit
def rognon_gay_evaluate(n: int, h: array, delta: array, F: array, dF_dt: array, p: array, out: array) -> None:
    """a, F_ela, zeta, F_adh, C, D, dh_dt, ddelta_dt, dX_dt, X, lambda1, lambda2 at n states: out[k*n + i] is quantity k at state i."""
    for i in range(n):
        _quantities(i, n, h[i], delta[i], F[i], dF_dt[i], p, out)


@jit
def rognon_gay_solve_delta(n: int, h: array, F: array, p: array, delta: array) -> None:
    """The deflection at n gaps under n forces; nan where there is none."""
    w = empty(2)
    for i in range(n):
        delta[i] = _solve_delta(h[i], F[i], delta[i], p, w)


@jit
def rognon_gay_force(n: int, t: array, table_t: array, table_F: array, rows: int, F: array, dF_dt: array) -> None:
    """The external force and its rate of change at n times, in increasing order."""
    w = empty(2)
    segment: int = 0
    for i in range(n):
        while segment < rows - 2 and t[i] >= table_t[segment + 1]:
            segment += 1
        _force(t[i], table_t, table_F, segment, w)
        F[i] = w[0]
        dF_dt[i] = w[1]


@jit
def rognon_gay_integrate(t_end: float, u_stop: float, rtol: float, p: array, table_t: array, table_F: array, rows: int, capacity: int, state: array, steps: array) -> int:
    """Integrate u = ln h by DOP853, steps adapted to the relative error rtol of h, and record the dense output.

    state, of 11 numbers: t, u, delta, step (0 at the start), du/dt, steps accepted, rejected, rates evaluated, segment of
    the table, whether F crosses zero at t, steps recorded by this call. It is updated, and a further call goes on from it.
    steps, of 10*capacity numbers: for each step its start, its length, u at its start, 7 coefficients.

    Returns 0 at t_end, 1 after the step in which u passes u_stop, 2 when steps is full, 3 at the end of the force table;
    -1 if the step falls below rounding, -2 if t overflows, -3 if there is no rate at the start.
    """
    w = empty(3)
    t = state[0]
    u = state[1]
    w[2] = state[2]
    dt = state[3]
    k1 = state[4]
    accepted = state[5]
    rejected = state[6]
    evaluations = state[7]
    segment: int = int(state[8])
    at_zero = state[9]
    zero = inf
    limit = t_end
    grow = 3.0
    status: int = 2
    stored: int = 0
    if dt == 0.0:
        k1 = _rate(t, u, p, table_t, table_F, segment, w)
        evaluations += 1.0
        if k1 != 0.0:
            dt = 0.01 / fabs(k1)
        else:
            # nothing moves yet: look ahead until something does
            dt = 1e-9 * (t_end - t) if isfinite(t_end) else 1e-200
            while fabs(_rate(t + dt, u, p, table_t, table_F, segment, w)) * dt < 1e-3 and dt < 1e200 and t + dt < t_end:
                dt = 4.0 * dt
                evaluations += 1.0
            w[2] = state[2]
        _force(t, table_t, table_F, segment, w)
        at_zero = 1.0 if w[0] == 0.0 else 0.0
    if not isfinite(k1):
        status = -3
    while status == 2 and stored < capacity:
        if t >= table_t[segment + 1] and segment < rows - 2:
            segment += 1
            continue
        limit = table_t[segment + 1] if table_t[segment + 1] < t_end else t_end
        limit = zero if zero < limit else limit
        if t >= t_end:
            status = 0
            break
        if t >= table_t[rows - 1]:
            status = 3
            break
        # land on the limit, and leave no sliver before it
        step = dt
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
                continue
            status = -1
            break
        guess = w[2]
        k2 = _rate(t + 0.05260015195876773 * step, u + step * (0.05260015195876773 * k1), p, table_t, table_F, segment, w)
        k3 = _rate(t + 0.0789002279381516 * step, u + step * (0.0197250569845379 * k1 + 0.0591751709536137 * k2), p, table_t, table_F, segment, w)
        k4 = _rate(t + 0.1183503419072274 * step, u + step * (0.02958758547680685 * k1 + 0.08876275643042054 * k3), p, table_t, table_F, segment, w)
        k5 = _rate(t + 0.2816496580927726 * step, u + step * (0.2413651341592667 * k1 - 0.8845494793282861 * k3 + 0.924834003261792 * k4), p, table_t, table_F, segment, w)
        k6 = _rate(t + 0.3333333333333333 * step, u + step * (0.037037037037037035 * k1 + 0.17082860872947386 * k4 + 0.12546768756682242 * k5), p, table_t, table_F, segment, w)
        k7 = _rate(t + 0.25 * step, u + step * (0.037109375 * k1 + 0.17025221101954405 * k4 + 0.06021653898045596 * k5 - 0.017578125 * k6), p, table_t, table_F, segment, w)
        k8 = _rate(t + 0.3076923076923077 * step, u + step * (0.03709200011850479 * k1 + 0.17038392571223998 * k4 + 0.10726203044637328 * k5 - 0.015319437748624402 * k6 + 0.008273789163814023 * k7), p, table_t, table_F, segment, w)
        k9 = _rate(t + 0.6512820512820513 * step, u + step * (0.6241109587160757 * k1 - 3.3608926294469414 * k4 - 0.868219346841726 * k5 + 27.59209969944671 * k6 + 20.154067550477894 * k7 - 43.48988418106996 * k8), p, table_t, table_F, segment, w)
        k10 = _rate(t + 0.6 * step, u + step * (0.47766253643826434 * k1 - 2.4881146199716677 * k4 - 0.590290826836843 * k5 + 21.230051448181193 * k6 + 15.279233632882423 * k7 - 33.28821096898486 * k8 - 0.020331201708508627 * k9), p, table_t, table_F, segment, w)
        k11 = _rate(t + 0.8571428571428571 * step, u + step * (-0.9371424300859873 * k1 + 5.186372428844064 * k4 + 1.0914373489967295 * k5 - 8.149787010746927 * k6 - 18.52006565999696 * k7 + 22.739487099350505 * k8 + 2.4936055526796523 * k9 - 3.0467644718982196 * k10), p, table_t, table_F, segment, w)
        k12 = _rate(t + 1.0 * step, u + step * (2.273310147516538 * k1 - 10.53449546673725 * k4 - 2.0008720582248625 * k5 - 17.9589318631188 * k6 + 27.94888452941996 * k7 - 2.8589982771350235 * k8 - 8.87285693353063 * k9 + 12.360567175794303 * k10 + 0.6433927460157636 * k11), p, table_t, table_F, segment, w)
        u_new = u + step * (0.054293734116568765 * k1 + 4.450312892752409 * k6 + 1.8915178993145003 * k7 - 5.801203960010585 * k8 + 0.3111643669578199 * k9 - 0.1521609496625161 * k10 + 0.20136540080403034 * k11 + 0.04471061572777259 * k12)
        t_new = limit if landing == 1.0 else t + step
        k13 = _rate(t_new, u_new, p, table_t, table_F, segment, w)
        evaluations += 12.0
        # error of order 8, from estimators of order 5 and 3
        error5 = 0.01312004499419488 * k1 - 1.2251564463762044 * k6 - 0.4957589496572502 * k7 + 1.6643771824549864 * k8 - 0.35032884874997366 * k9 + 0.3341791187130175 * k10 + 0.08192320648511571 * k11 - 0.022355307863886294 * k12
        error3 = -0.18980075407240762 * k1 + 4.450312892752409 * k6 + 1.8915178993145003 * k7 - 5.801203960010585 * k8 - 0.4226823213237919 * k9 - 0.1521609496625161 * k10 + 0.20136540080403034 * k11 + 0.02265179219836082 * k12
        weight = error5 * error5 + 0.01 * error3 * error3
        error = step * error5 * error5 / (rtol * sqrt(weight)) if weight > 0.0 else weight
        shrink = 0.9 * pow(error, -0.125)
        # written so that nan rejects the step
        if not error <= 1.0:
            rejected += 1.0
            grow = 1.0
            dt = step * (shrink if shrink > 0.2 else 0.2)
            w[2] = guess
            continue
        k14 = _rate(t + 0.1 * step, u + step * (0.056167502283047954 * k1 + 0.25350021021662483 * k7 - 0.2462390374708025 * k8 - 0.12419142326381637 * k9 + 0.15329179827876568 * k10 + 0.00820105229563469 * k11 + 0.007567897660545699 * k12 - 0.008298 * k13), p, table_t, table_F, segment, w)
        k15 = _rate(t + 0.2 * step, u + step * (0.03183464816350214 * k1 + 0.028300909672366776 * k6 + 0.053541988307438566 * k7 - 0.05492374857139099 * k8 - 0.00010834732869724932 * k11 + 0.0003825710908356584 * k12 - 0.00034046500868740456 * k13 + 0.1413124436746325 * k14), p, table_t, table_F, segment, w)
        k16 = _rate(t + 0.7777777777777778 * step, u + step * (-0.42889630158379194 * k1 - 4.697621415361164 * k6 + 7.683421196062599 * k7 + 4.06898981839711 * k8 + 0.3567271874552811 * k9 - 0.0013990241651590145 * k13 + 2.9475147891527724 * k14 - 9.15095847217987 * k15), p, table_t, table_F, segment, w)
        # the dense output, in Hairer's form
        b0 = u_new - u
        b1 = step * k1 - b0
        b2 = 2.0 * b0 - step * (k1 + k13)
        b3 = step * (-8.428938276109013 * k1 + 0.5667149535193777 * k6 - 3.0689499459498917 * k7 + 2.38466765651207 * k8 + 2.117034582445028 * k9 - 0.871391583777973 * k10 + 2.2404374302607883 * k11 + 0.6315787787694688 * k12 - 0.08899033645133331 * k13 + 18.148505520854727 * k14 - 9.194632392478356 * k15 - 4.436036387594894 * k16)
        b4 = step * (10.427508642579134 * k1 + 242.28349177525817 * k6 + 165.20045171727028 * k7 - 374.5467547226902 * k8 - 22.113666853125306 * k9 + 7.733432668472264 * k10 - 30.674084731089398 * k11 - 9.332130526430229 * k12 + 15.697238121770845 * k13 - 31.139403219565178 * k14 - 9.35292435884448 * k15 + 35.81684148639408 * k16)
        b5 = step * (19.985053242002433 * k1 - 387.0373087493518 * k6 - 189.17813819516758 * k7 + 527.8081592054236 * k8 - 11.57390253995963 * k9 + 6.8812326946963 * k10 - 1.0006050966910838 * k11 + 0.7777137798053443 * k12 - 2.778205752353508 * k13 - 60.19669523126412 * k14 + 84.32040550667716 * k15 + 11.99229113618279 * k16)
        b6 = step * (-25.69393346270375 * k1 - 154.18974869023643 * k6 - 231.5293791760455 * k7 + 357.6391179106141 * k8 + 93.40532418362432 * k9 - 37.45832313645163 * k10 + 104.0996495089623 * k11 + 29.8402934266605 * k12 - 43.53345659001114 * k13 + 96.32455395918828 * k14 - 39.17726167561544 * k15 - 149.72683625798564 * k16)
        # its defect in the middle of the step: the estimators above vanish now and then where the error does not
        middle_u = u + 0.5 * (b0 + 0.5 * (b1 + 0.5 * (b2 + 0.5 * (b3 + 0.5 * (b4 + 0.5 * (b5 + 0.5 * b6))))))
        middle_k = _rate(t + 0.5 * step, middle_u, p, table_t, table_F, segment, w)
        evaluations += 3.0 + 1.0
        defect = 2.0 * fabs(b0 + 0.25 * b2 + 0.0625 * b4 + 0.015625 * b6 - step * middle_k) / rtol
        if not defect <= 1.0:
            rejected += 1.0
            grow = 1.0
            shrink = 0.9 * pow(defect, -0.125)
            dt = step * (shrink if shrink > 0.2 else 0.2)
            w[2] = guess
            continue
        # the law has a kink where F crosses zero: end a step there
        before = t if at_zero == 0.0 else t + 1e-3 * step
        _force(before, table_t, table_F, segment, w)
        force_before = w[0]
        _force(t_new, table_t, table_F, segment, w)
        if force_before * w[0] < 0.0 and zero == inf:
            after = t_new
            while after - before > 4.5e-16 * fabs(after):
                middle = 0.5 * (before + after)
                if middle <= before or middle >= after:
                    break
                _force(middle, table_t, table_F, segment, w)
                if w[0] * force_before > 0.0:
                    before = middle
                else:
                    after = middle
            if after - t > 4.5e-16 * fabs(t):
                zero = after
                w[2] = guess
                continue
        at_zero = 0.0
        if t_new == zero:
            at_zero = 1.0
            zero = inf
        base: int = 10 * stored
        steps[base] = t
        steps[base + 1] = step
        steps[base + 2] = u
        steps[base + 3] = b0
        steps[base + 4] = b1
        steps[base + 5] = b2
        steps[base + 6] = b3
        steps[base + 7] = b4
        steps[base + 8] = b5
        steps[base + 9] = b6
        stored += 1
        accepted += 1.0
        if (u - u_stop) * (u_new - u_stop) <= 0.0:
            status = 1
        t = t_new
        u = u_new
        k1 = k13
        h = exp(u)
        _force(t, table_t, table_F, segment, w)
        w[2] = _solve_delta(h, w[0], w[2], p, w)
        factor = shrink if shrink < grow else grow
        # a step shortened to land says nothing about the next
        dt = step * factor if landing == 0.0 or step * factor > dt else dt
        grow = 3.0
    state[0] = t
    state[1] = u
    state[2] = w[2]
    state[3] = dt
    state[4] = k1
    state[5] = accepted
    state[6] = rejected
    state[7] = evaluations
    state[8] = float(segment)
    state[9] = at_zero
    state[10] = float(stored)
    return status
