"""Contact law droplet: written by softdyn 0.1.0 with sympy 1.14.0; do not edit.

Source: Princen 1983, doi:10.1016/0021-9797(83)90323-5; Reynolds' film; Brenner 1961 for the friction of spheres
Law 1f749852e49be335, 9fb2ccb7b9282ed1:
    a = sqrt(2)*sqrt(R)*sqrt(Abs(delta) + 1/(1/h + 1/R))
    F_ela = 4*pi*delta*sigma
    zeta = 3*pi*a**4*eta*(1/h + 1/R)**2*(R/(2*h) + 9*log(20*R/(9*h) + 1)/20 + 1)/(R*(12*R**2/(a**4*(1/h + 1/R)**2) + 1))
    F_adh = 0
    drag translation = 6*pi*R*eta
Left out, with the operations that each saved:
    no remote force: 164 -> 153
Operations, 364 in all:
    iteration: 31 add, 86 mul, 22 div, 1 sqrt, 1 call
    tangent: 33 add, 92 mul, 24 div, 1 sqrt, 1 call
    state: 8 add, 25 mul, 12 div, 1 sqrt, 1 call
    elastic: 2 mul
    weight: 3 add, 11 mul, 1 div
    side: 2 add, 2 mul, 2 div
    drag: 2 mul

Functions: droplet_contacts, droplet_state, droplet_energy.
p holds eta, sigma; q holds R of each contact.
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
def _power_of_two(k):
    """2^k, for whole k from -1022 to 1023."""
    # the last bits of 2^52 + 2^51 + k are those of k
    bits = float64(k + 6755399441055744.0).view(int64)
    return int64((bits + 1023) << 52).view(float64)


@jit
def _exponent(x):
    """The whole k for which x/2^k is from sqrt(1/2) to sqrt(2); x is positive, finite and not subnormal."""
    # the bits of 1 less those of sqrt(1/2) carry into the exponent of what is above sqrt(2); then 2^52 + exponent
    bits = float64(x).view(int64) + 0x95f619980c433
    return int64(((bits >> 52) & 0x7ff) | 0x4330000000000000).view(float64) - 4503599627371519.0


@jit
def _fraction(x):
    """x/2^k, with the same k."""
    bits = float64(x).view(int64) + 0x95f619980c433
    return int64((bits & 0xfffffffffffff) + 0x3fe6a09e667f3bcd).view(float64)


@jit
def _ln_near(k: float, f: float, rest: float) -> float:
    """ln(2^k (1 + f)) + rest, for 1 + f from sqrt(1/2) to sqrt(2) and a small rest."""
    s = f / (2.0 + f)
    z = s * s
    z2 = z * z
    even = 0.6666666666666666 + z2 * (0.28571428570803614 + z2 * (0.18181795640132906 + z2 * 0.13268773138656886))
    odd = 0.4000000000000088 + z2 * (0.22222222391713917 + z2 * (0.15386239702814658 + z2 * 0.13086626147840102))
    half = 0.5 * f * f
    return k * 0.6931471805598903 - ((half - (s * (half + z * (even + z * odd)) + (k * 5.497923018708371e-14 + rest))) - f)


@jit
def _lane_log1p(x: float) -> float:
    """ln(1 + x); -inf at -1, nan below."""
    # 1 + x is total + lost, exactly
    total = 1.0 + x
    back = total - 1.0
    lost = (1.0 - (total - back)) + (x - back)
    k = _exponent(total)
    scaled = lost * _power_of_two(-k)
    # what large numbers lose does not count, and 2^-k may be no number
    small = scaled if x < 1.152921504606847e+18 else 0.0
    first = _fraction(total) - 1.0
    f = first + small
    value = _ln_near(k, f, small - (f - first))
    finite = value if x < inf else x
    above = finite if x > -1.0 else nan
    whole = -inf if x == -1.0 else above
    # keeps the sign of -0
    return x if x == 0.0 else whole


@jit
def droplet_contacts(n: int, s: float, reach: float, overlaps: array, start: array, target: array, p: array, q: array, y: array, gap: array, force: array, slope: array) -> int:
    """Solve y = target + s dy/dt for the gap of each of n contacts, y = (h/g - g/h)/2, at fixed distances of the centres.

    overlaps: sum of the radii less the distance; start: g; y: a guess, then the solution. gap, force, slope: h, F and
    dF/dr along the solution; the force is nan where there is none. Returns how many contacts have none.
    """
    eta = p[0]
    own_sigma = p[1]
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
                x0 = 1.0 / R
                x1 = 1.0 / h
                x2 = x0 + x1
                x3 = 1.0 / x2
                a = sqrt(2.0 * R * (x3 + fabs(delta)))
                x4 = 12.566370614359172 * own_sigma
                F_ela = delta * x4
                a_p2 = a * a
                a_p4 = a_p2 * a_p2
                x2_p2 = x2 * x2
                x7 = 1.0 / (x2_p2 * a_p4)
                R_p2 = R * R
                x8 = 12.0 * x7 * R_p2 + 1.0
                x9 = 1.0 / x8
                x10 = x1 * R
                x11 = _lane_log1p((20.0 / 9.0) * x10)
                x12 = x10 / 2.0 + 0.45 * x11 + 1.0
                x13 = x2_p2 * a_p4
                zeta = 9.42477796076938 * x0 * x12 * x13 * x9 * eta
                dF_ddelta = x4
                dF_dh = 0.0
                h_p2 = h * h
                x15 = 1.0 / h_p2
                x33 = R + h
                x33_p2 = x33 * x33
                x16 = x33_p2
                x17 = 10.0 * R
                x18 = 9.0 * x11
                R_p4 = R_p2 * R_p2
                x19 = R_p4 * h_p2
                x20 = x16 * a_p4
                x21 = 24.0 * x19 + x20
                x22 = 12.0 * x19 + x20
                x23 = x1 * x17 + x18 + 20.0
                a_p3 = a_p2 * a
                a_p6 = a_p3 * a_p3
                x22_p2 = x22 * x22
                log_zeta_h = x15 * x7 * x8 * R * (2.0 * x1 * x16 * x21 * a_p6 * (x18 * h + 20.0 * h + x17) / x22_p2 - x9 * (12.0 * x23 * x3 * x9 * R + x0 * x2 * x23 * a_p4 + 5.0 * x13 * (1.0 + 18.0 / (20.0 * x10 + 9.0)))) / (10.0 * x12)
                log_zeta_delta = 4.0 * x21 * R * (1.0 if delta > 0.0 else (-1.0 if delta < 0.0 else 0.0)) / (x22 * a_p2)
                x24 = 1.0 / reach
                fading = x24 * (2.0 * reach - 2.0 * h)
                started = (1.0 if 1.0 < fading else fading)
                ahead = (0.0 if 0.0 > started else started)
                x26 = 3.0 - 2.0 * ahead
                ahead_p2 = ahead * ahead
                w = x26 * ahead_p2
                w_h = -2.0 * x24 * (2.0 * x26 * ahead - 2.0 * ahead_p2)
                film = (w if pressed > 0.0 else 1.0)
                film_h = (w_h if pressed > 0.0 else 0.0)
                x28 = 1.0 / g
                x29 = g / 2.0
                Y = x28 * h / 2.0 - x1 * x29
                Y_h = x15 * x29 + x28 / 2.0
                h_p3 = h_p2 * h
                Y_hh = -g / h_p3
                x30 = 1.0 / zeta
                rho = F_ela * x30
                rho_h = x30 * (dF_ddelta / 2.0 + dF_dh) - rho * (log_zeta_delta / 2.0 + log_zeta_h)
                x31 = rho * s
                x32 = Y - y_star
                H = x31 * Y_h + x32 * film
                H_h = film * Y_h + rho_h * Y_h * s + Y_hh * x31 + film_h * x32
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
            x0 = 1.0 / R
            x1 = 1.0 / h
            x2 = x0 + x1
            x3 = 1.0 / x2
            a = sqrt(2.0 * R * (x3 + fabs(delta)))
            x4 = 12.566370614359172 * own_sigma
            F_ela = delta * x4
            a_p2 = a * a
            a_p4 = a_p2 * a_p2
            x2_p2 = x2 * x2
            x7 = 1.0 / (x2_p2 * a_p4)
            R_p2 = R * R
            x8 = 12.0 * x7 * R_p2 + 1.0
            x9 = 1.0 / x8
            x10 = x1 * R
            x11 = _lane_log1p((20.0 / 9.0) * x10)
            x12 = x10 / 2.0 + 0.45 * x11 + 1.0
            x13 = x2_p2 * a_p4
            zeta = 9.42477796076938 * x0 * x12 * x13 * x9 * eta
            dF_ddelta = x4
            dF_dh = 0.0
            h_p2 = h * h
            x15 = 1.0 / h_p2
            x34 = R + h
            x34_p2 = x34 * x34
            x16 = x34_p2
            x17 = 10.0 * R
            x18 = 9.0 * x11
            R_p4 = R_p2 * R_p2
            x19 = R_p4 * h_p2
            x20 = x16 * a_p4
            x21 = 24.0 * x19 + x20
            x22 = 12.0 * x19 + x20
            x23 = x1 * x17 + x18 + 20.0
            a_p3 = a_p2 * a
            a_p6 = a_p3 * a_p3
            x22_p2 = x22 * x22
            log_zeta_h = x15 * x7 * x8 * R * (2.0 * x1 * x16 * x21 * a_p6 * (x18 * h + 20.0 * h + x17) / x22_p2 - x9 * (12.0 * x23 * x3 * x9 * R + x0 * x2 * x23 * a_p4 + 5.0 * x13 * (1.0 + 18.0 / (20.0 * x10 + 9.0)))) / (10.0 * x12)
            log_zeta_delta = 4.0 * x21 * R * (1.0 if delta > 0.0 else (-1.0 if delta < 0.0 else 0.0)) / (x22 * a_p2)
            x24 = 1.0 / reach
            fading = x24 * (2.0 * reach - 2.0 * h)
            started = (1.0 if 1.0 < fading else fading)
            ahead = (0.0 if 0.0 > started else started)
            x26 = 3.0 - 2.0 * ahead
            ahead_p2 = ahead * ahead
            w = x26 * ahead_p2
            w_h = -2.0 * x24 * (2.0 * x26 * ahead - 2.0 * ahead_p2)
            film = (w if pressed > 0.0 else 1.0)
            film_h = (w_h if pressed > 0.0 else 0.0)
            grip = (1.0 if pressed > 0.0 else w)
            grip_h = (0.0 if pressed > 0.0 else w_h)
            x28 = 1.0 / g
            x29 = g / 2.0
            Y = x28 * h / 2.0 - x1 * x29
            Y_h = x15 * x29 + x28 / 2.0
            h_p3 = h_p2 * h
            Y_hh = -g / h_p3
            x30 = 1.0 / zeta
            rho = F_ela * x30
            x31 = dF_ddelta / 2.0
            x32 = dF_dh + x31
            rho_h = x30 * x32 - rho * (log_zeta_delta / 2.0 + log_zeta_h)
            rho_r = log_zeta_delta * rho / 2.0 - x30 * x31
            x33 = Y_h * s
            H_h = film * Y_h + Y_hh * rho * s + film_h * (Y - y_star) + rho_h * x33
            H_r = rho_r * x33
            h_r = -H_r / H_h
            F = F_ela * grip
            F_r = F_ela * grip_h * h_r + grip * (h_r * x32 - x31)
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
def droplet_state(n: int, reach: float, overlaps: array, gap: array, p: array, q: array, out: array) -> None:
    """delta, a, F, friction, remote, C, dF_dh, dh_dt of n contacts: out[k*n + i] is quantity k of contact i."""
    eta = p[0]
    own_sigma = p[1]
    for i in range(n):
        overlap = overlaps[i]
        h = gap[i]
        R = q[0 * n + i]
        delta = h / 2.0 + overlap / 2.0
        pressed = (1.0 if delta >= 0.0 else 0.0)
        x0 = 1.0 / R
        x1 = 1.0 / h
        x2 = x0 + x1
        a = sqrt(2.0 * R * (fabs(delta) + 1.0 / x2))
        x3 = 12.566370614359172 * own_sigma
        F_ela = delta * x3
        x6 = x1 * R
        R_p2 = R * R
        a_p2 = a * a
        a_p4 = a_p2 * a_p2
        x2_p2 = x2 * x2
        zeta = 9.42477796076938 * x0 * eta * x2_p2 * a_p4 * (x6 / 2.0 + 0.45 * _lane_log1p((20.0 / 9.0) * x6) + 1.0) / (12.0 * R_p2 / (x2_p2 * a_p4) + 1.0)
        dF_ddelta = x3
        dF_dh = 0.0
        C = dF_ddelta / 2.0
        fading = (2.0 * reach - 2.0 * h) / reach
        started = (1.0 if 1.0 < fading else fading)
        ahead = (0.0 if 0.0 > started else started)
        ahead_p2 = ahead * ahead
        w = ahead_p2 * (3.0 - 2.0 * ahead)
        film = (w if pressed > 0.0 else 1.0)
        grip = (1.0 if pressed > 0.0 else w)
        rho = F_ela / zeta
        F = F_ela * grip
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


@jit
def droplet_energy(n: int, reach: float, overlaps: array, gap: array, p: array, q: array, points: int, nodes: array, weights: array, out: array) -> None:
    """Stored energy grip U and its slope in h at fixed delta, of n contacts: out[i] and out[n + i].

    U = integral of 2 F_ela(a(h, d), d) dd from 0 to delta, by quadrature over the fractions nodes of delta.
    """
    own_sigma = p[1]
    for i in range(n):
        h = gap[i]
        whole = 0.5 * (overlaps[i] + h)
        U = 0.0
        U_h = 0.0
        for m in range(points):
            delta = whole * nodes[m]
            F_ela = 12.566370614359172 * delta * own_sigma
            dF_dh = 0.0
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
def droplet_drag(n: int, p: array, q: array, out: array) -> None:
    """What the fluid does to n particles alone, translation: out[k*n + i] is quantity k of particle i.

    In q stand the particles' own parameters, R the radius.
    """
    eta = p[0]
    for i in range(n):
        R = q[0 * n + i]
        translation = 18.84955592153876 * R * eta
        out[0 * n + i] = translation
