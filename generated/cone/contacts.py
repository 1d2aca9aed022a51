"""Contact law cone: written by softdyn 0.1.0 with sympy 1.14.0; do not edit.

Source: Sneddon, Int. J. Eng. Sci. 3 (1965) 47; friction of arXiv:0803.1573
Law 477bece85fee419c, 38dbbd0c7a1c46a1:
    a = sqrt(2)*R*sqrt(h)/sqrt(R + h) + 2*Abs(delta)/(pi*m)
    F_ela = E*a*delta
    zeta = 3*pi*a**4*eta*(R + h)**3/(2*R**3*h**3)
    F_adh = 0
    drag translation = 6*pi*R*eta
Left out, with the operations that each saved:
    no remote force: 132 -> 121
Operations, 336 in all:
    iteration: 23 add, 61 mul, 22 div, 3 sqrt
    tangent: 25 add, 67 mul, 24 div, 3 sqrt
    state: 11 add, 41 mul, 11 div, 3 sqrt
    elastic: 2 add, 11 mul, 3 div, 3 sqrt
    weight: 3 add, 11 mul, 1 div
    side: 2 add, 2 mul, 2 div
    drag: 2 mul

Functions: cone_contacts, cone_state, cone_energy.
p holds E, eta, m, undragged_p1; q holds R of each contact.
"""

from __future__ import annotations

from math import (  # noqa: F401
    acos, acosh, asin, asinh, atan, atanh, cos, cosh, erf, erfc, exp, expm1, fabs, inf, isfinite, log, log1p, nan, pow,
    sin, sinh, sqrt, tan, tanh,
)

import numba
from numpy import empty, float64, int64  # noqa: F401
from numpy import ndarray as array  # noqa: F401

# IEEE arithmetic: no fastmath, and a division by zero gives inf or nan instead of raising
jit = numba.njit(cache=True, error_model="numpy", fastmath=False, nogil=True)

@jit
def cone_contacts(n: int, s: float, reach: float, overlaps: array, start: array, target: array, p: array, q: array, y: array, gap: array, force: array, slope: array) -> int:
    """Solve y = target + s dy/dt for the gap of each of n contacts, y = (h/g - g/h)/2, at fixed distances of the centres.

    overlaps: sum of the radii less the distance; start: g; y: a guess, then the solution. gap, force, slope: h, F and
    dF/dr along the solution; the force is nan where there is none. Returns how many contacts have none.
    """
    E = p[0]
    eta = p[1]
    own_m = p[2]
    undragged_p1 = p[3]
    overlap_lane = empty(16)
    g_lane = empty(16)
    target_lane = empty(16)
    y_lane = empty(16)
    low_lane = empty(16)
    high_lane = empty(16)
    open_lane = empty(16)
    pressed_lane = empty(16)
    h_lane = empty(16)
    F_lane = empty(16)
    F_r_lane = empty(16)
    q_lane = empty(16)
    unsolved: int = 0
    base: int = 0
    while base < n:
        # the last block is filled up with copies of the last contact
        for k in range(16):
            i: int = base + k if base + k < n else n - 1
            overlap_lane[k] = overlaps[i]
            g_lane[k] = start[i]
            target_lane[k] = target[i]
            y_lane[k] = y[i]
            low_lane[k] = -inf
            high_lane[k] = inf
            open_lane[k] = 1.0
            q_lane[0 + k] = q[0 * n + i]
        # pressed or pulled: H rises with the gap, so its sign at delta = 0 tells, and the weights stay what they are
        for k in range(16):
            overlap = overlap_lane[k]
            g = g_lane[k]
            y_star = target_lane[k]
            h = -overlap if overlap < 0.0 else g
            Y = h / (2.0 * g) - g / (2.0 * h)
            side = Y - y_star
            pressed_lane[k] = 1.0 if overlap >= 0.0 else (1.0 if side <= 0.0 else 0.0)
        left = 16.0
        round: int = 0
        while left > 0.0 and round < 100:
            for k in range(16):
                overlap = overlap_lane[k]
                g = g_lane[k]
                y_star = target_lane[k]
                y_now = y_lane[k]
                size = fabs(y_now)
                factor = size + sqrt(1.0 + y_now * y_now)
                grown = g * factor
                shrunk = g / factor
                h = grown if y_now > 0.0 else shrunk
                pressed = pressed_lane[k]
                R = q_lane[0 + k]
                delta = h / 2.0 + overlap / 2.0
                x0 = 0.3183098861837907 / own_m
                x1 = 2.0 * x0 * fabs(delta)
                x2 = 1.4142135623730951
                x3 = sqrt(h)
                x4 = R + h
                a = x2 * x3 * R / sqrt(x4) + x1
                x5 = delta * E
                F_ela = x5 * a
                x6 = 1.0 / h
                excess = x6 * R
                h_p2 = h * h
                x7 = 1.0 / h_p2
                excess_h = -x7 * R
                h_p3 = h_p2 * h
                x8 = 1.0 / h_p3
                x9 = excess + undragged_p1
                x10 = 1.0 / (excess + 1.0)
                R_p2 = R * R
                R_p3 = R_p2 * R
                a_p2 = a * a
                a_p4 = a_p2 * a_p2
                x4_p2 = x4 * x4
                x4_p3 = x4_p2 * x4
                zeta = 4.71238898038469 * x10 * x8 * x9 * eta * x4_p3 * a_p4 / R_p3
                dF_ddelta = E * (a + x1)
                x11 = x2 * R_p2 / (x3 * x4 * sqrt(x4))
                dF_dh = x11 * x5 / 2.0
                x12 = 1.0 / a
                log_zeta_h = excess_h * x10 * (1.0 - undragged_p1) / x9 + 2.0 * x11 * x12 + 3.0 / x4 - 3.0 * x6
                log_zeta_delta = 8.0 * x0 * x12 * (1.0 if delta > 0.0 else (-1.0 if delta < 0.0 else 0.0))
                x13 = 1.0 / reach
                fading = x13 * (2.0 * reach - 2.0 * h)
                started = (1.0 if 1.0 < fading else fading)
                ahead = (0.0 if 0.0 > started else started)
                x15 = 3.0 - 2.0 * ahead
                ahead_p2 = ahead * ahead
                w = x15 * ahead_p2
                w_h = -2.0 * x13 * (2.0 * x15 * ahead - 2.0 * ahead_p2)
                film = (w if pressed > 0.0 else 1.0)
                film_h = (w_h if pressed > 0.0 else 0.0)
                x17 = 1.0 / g
                x18 = g / 2.0
                Y = x17 * h / 2.0 - x18 * x6
                Y_h = x17 / 2.0 + x18 * x7
                Y_hh = -x8 * g
                x19 = 1.0 / zeta
                rho = F_ela * x19
                rho_h = x19 * (dF_ddelta / 2.0 + dF_dh) - rho * (log_zeta_delta / 2.0 + log_zeta_h)
                x20 = rho * s
                x21 = Y - y_star
                H = x20 * Y_h + x21 * film
                H_h = film * Y_h + rho_h * Y_h * s + Y_hh * x20 + film_h * x21
                step = -H * Y_h / H_h
                low_before = low_lane[k]
                high_before = high_lane[k]
                low = y_now if H < 0.0 else low_before
                high = y_now if H > 0.0 else high_before
                # a gap changes by a factor of a few at most in one iteration; plain selections, one at a time: C
                # compilers vectorise no others
                most = 1.0 + size
                least = -most
                above = most if step > most else step
                bounded = least if step < least else above
                trial = y_now + bounded
                outward = most if H < 0.0 else least
                aside = y_now + outward
                middle = 0.5 * (low + high)
                safe = middle if fabs(middle) < inf else aside
                over = trial if low < trial else safe
                inside = over if trial < high else safe
                # quadratic convergence: after such a step what is left is below rounding
                beyond = fabs(step) - 1e-8 * most
                width = high - low - 1e-12 * most
                unsettled = beyond if beyond < width else width
                last = y_now + step
                ended = last if beyond <= 0.0 else y_now
                new_y = ended if unsettled <= 0.0 else inside
                is_open = open_lane[k]
                y_lane[k] = new_y if is_open > 0.0 else y_now
                low_lane[k] = low
                high_lane[k] = high
                open_lane[k] = 0.0 if unsettled <= 0.0 else is_open
            left = 0.0
            for k in range(16):
                left += open_lane[k]
            round += 1
        for k in range(16):
            overlap = overlap_lane[k]
            g = g_lane[k]
            y_now = y_lane[k]
            y_star = target_lane[k]
            factor = fabs(y_now) + sqrt(1.0 + y_now * y_now)
            grown = g * factor
            shrunk = g / factor
            h = grown if y_now > 0.0 else shrunk
            pressed = pressed_lane[k]
            R = q_lane[0 + k]
            delta = h / 2.0 + overlap / 2.0
            x0 = 0.3183098861837907 / own_m
            x1 = 2.0 * x0 * fabs(delta)
            x2 = 1.4142135623730951
            x3 = sqrt(h)
            x4 = R + h
            a = x2 * x3 * R / sqrt(x4) + x1
            x5 = delta * E
            F_ela = x5 * a
            x6 = 1.0 / h
            excess = x6 * R
            h_p2 = h * h
            x7 = 1.0 / h_p2
            excess_h = -x7 * R
            h_p3 = h_p2 * h
            x8 = 1.0 / h_p3
            x9 = excess + undragged_p1
            x10 = 1.0 / (excess + 1.0)
            R_p2 = R * R
            R_p3 = R_p2 * R
            a_p2 = a * a
            a_p4 = a_p2 * a_p2
            x4_p2 = x4 * x4
            x4_p3 = x4_p2 * x4
            zeta = 4.71238898038469 * x10 * x8 * x9 * eta * x4_p3 * a_p4 / R_p3
            dF_ddelta = E * (a + x1)
            x11 = x2 * R_p2 / (x3 * x4 * sqrt(x4))
            dF_dh = x11 * x5 / 2.0
            x12 = 1.0 / a
            log_zeta_h = excess_h * x10 * (1.0 - undragged_p1) / x9 + 2.0 * x11 * x12 + 3.0 / x4 - 3.0 * x6
            log_zeta_delta = 8.0 * x0 * x12 * (1.0 if delta > 0.0 else (-1.0 if delta < 0.0 else 0.0))
            x13 = 1.0 / reach
            fading = x13 * (2.0 * reach - 2.0 * h)
            started = (1.0 if 1.0 < fading else fading)
            ahead = (0.0 if 0.0 > started else started)
            x15 = 3.0 - 2.0 * ahead
            ahead_p2 = ahead * ahead
            w = x15 * ahead_p2
            w_h = -2.0 * x13 * (2.0 * x15 * ahead - 2.0 * ahead_p2)
            film = (w if pressed > 0.0 else 1.0)
            film_h = (w_h if pressed > 0.0 else 0.0)
            grip = (1.0 if pressed > 0.0 else w)
            grip_h = (0.0 if pressed > 0.0 else w_h)
            x17 = 1.0 / g
            x18 = g / 2.0
            Y = x17 * h / 2.0 - x18 * x6
            Y_h = x17 / 2.0 + x18 * x7
            Y_hh = -x8 * g
            x19 = 1.0 / zeta
            rho = F_ela * x19
            x20 = dF_ddelta / 2.0
            x21 = dF_dh + x20
            rho_h = x19 * x21 - rho * (log_zeta_delta / 2.0 + log_zeta_h)
            rho_r = log_zeta_delta * rho / 2.0 - x19 * x20
            x22 = Y_h * s
            H_h = film * Y_h + Y_hh * rho * s + film_h * (Y - y_star) + rho_h * x22
            H_r = rho_r * x22
            h_r = -H_r / H_h
            F = F_ela * grip
            F_r = F_ela * grip_h * h_r + grip * (h_r * x21 - x20)
            h_lane[k] = h
            F_lane[k] = F if open_lane[k] == 0.0 else nan
            F_r_lane[k] = F_r
        count: int = 16 if base + 16 < n else n - base
        for k in range(count):
            i: int = base + k
            y[i] = y_lane[k]
            gap[i] = h_lane[k]
            force[i] = F_lane[k]
            slope[i] = F_r_lane[k]
            unsolved += 0 if isfinite(F_lane[k]) and isfinite(F_r_lane[k]) else 1
        base += 16
    return unsolved


@jit
def cone_state(n: int, reach: float, overlaps: array, gap: array, p: array, q: array, out: array) -> None:
    """delta, a, F, friction, remote, C, dF_dh, dh_dt, F_by_gap, F_by_distance of n contacts: out[k*n + i] is quantity k of contact i."""
    E = p[0]
    eta = p[1]
    own_m = p[2]
    undragged_p1 = p[3]
    for i in range(n):
        overlap = overlaps[i]
        h = gap[i]
        R = q[0 * n + i]
        delta = h / 2.0 + overlap / 2.0
        pressed = (1.0 if delta >= 0.0 else 0.0)
        x0 = 0.6366197723675814 * fabs(delta) / own_m
        x1 = 1.4142135623730951
        x2 = sqrt(h)
        x3 = R + h
        a = x1 * x2 * R / sqrt(x3) + x0
        x4 = delta * E
        F_ela = x4 * a
        excess = R / h
        R_p2 = R * R
        R_p3 = R_p2 * R
        a_p2 = a * a
        a_p4 = a_p2 * a_p2
        h_p2 = h * h
        h_p3 = h_p2 * h
        x3_p2 = x3 * x3
        x3_p3 = x3_p2 * x3
        zeta = 4.71238898038469 * eta * x3_p3 * a_p4 * (excess + undragged_p1) / (R_p3 * h_p3 * (excess + 1.0))
        dF_ddelta = E * (a + x0)
        dF_dh = x1 * x4 * R_p2 / (2.0 * x2 * x3 * sqrt(x3))
        x5 = dF_ddelta / 2.0
        C = x5
        x6 = 1.0 / reach
        fading = x6 * (2.0 * reach - 2.0 * h)
        started = (1.0 if 1.0 < fading else fading)
        ahead = (0.0 if 0.0 > started else started)
        x8 = 3.0 - 2.0 * ahead
        ahead_p2 = ahead * ahead
        w = x8 * ahead_p2
        w_h = -2.0 * x6 * (2.0 * x8 * ahead - 2.0 * ahead_p2)
        film = (w if pressed > 0.0 else 1.0)
        grip = (1.0 if pressed > 0.0 else w)
        grip_h = (0.0 if pressed > 0.0 else w_h)
        rho = F_ela / zeta
        F = F_ela * grip
        F_by_gap = F_ela * grip_h + grip * (dF_dh + x5)
        F_by_distance = -x5 * grip
        friction = w * zeta
        remote = 0.0
        dh_dt = -rho / film
        out[0 * n + i] = delta
        out[1 * n + i] = a
        out[2 * n + i] = F
        out[3 * n + i] = friction
        out[4 * n + i] = remote
        out[5 * n + i] = C
        out[6 * n + i] = dF_dh
        out[7 * n + i] = dh_dt
        out[8 * n + i] = F_by_gap
        out[9 * n + i] = F_by_distance


@jit
def cone_energy(n: int, reach: float, overlaps: array, gap: array, p: array, q: array, points: int, nodes: array, weights: array, out: array) -> None:
    """Stored energy grip U and its slope in h at fixed delta, of n contacts: out[i] and out[n + i].

    U = integral of 2 F_ela(a(h, d), d) dd from 0 to delta, by quadrature over the fractions nodes of delta.
    """
    E = p[0]
    own_m = p[2]
    for i in range(n):
        h = gap[i]
        whole = 0.5 * (overlaps[i] + h)
        U = 0.0
        U_h = 0.0
        for m in range(points):
            delta = whole * nodes[m]
            R = q[0 * n + i]
            x0 = 1.4142135623730951
            x1 = sqrt(h)
            x2 = R + h
            a = x0 * x1 * R / sqrt(x2) + 0.6366197723675814 * fabs(delta) / own_m
            x3 = delta * E
            F_ela = x3 * a
            R_p2 = R * R
            dF_dh = x0 * x3 * R_p2 / (2.0 * x1 * x2 * sqrt(x2))
            U += 2.0 * whole * weights[m] * F_ela
            U_h += 2.0 * whole * weights[m] * dF_dh
        delta = whole
        pressed = (1.0 if delta >= 0.0 else 0.0)
        x0 = 1.0 / reach
        fading = x0 * (2.0 * reach - 2.0 * h)
        started = (1.0 if 1.0 < fading else fading)
        ahead = (0.0 if 0.0 > started else started)
        x2 = 3.0 - 2.0 * ahead
        ahead_p2 = ahead * ahead
        w = x2 * ahead_p2
        w_h = -2.0 * x0 * (2.0 * x2 * ahead - 2.0 * ahead_p2)
        grip = (1.0 if pressed > 0.0 else w)
        grip_h = (0.0 if pressed > 0.0 else w_h)
        out[i] = grip * U
        out[n + i] = grip * U_h + grip_h * U


@jit
def cone_drag(n: int, p: array, q: array, out: array) -> None:
    """What the fluid does to n particles alone, translation: out[k*n + i] is quantity k of particle i.

    In q stand the particles' own parameters, R the radius.
    """
    eta = p[1]
    for i in range(n):
        R = q[0 * n + i]
        translation = 18.84955592153876 * R * eta
        out[0 * n + i] = translation
