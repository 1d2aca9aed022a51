"""Contact law droplet: written by softdyn 0.1.0 with sympy 1.14.0; do not edit.

Source: Princen 1983, doi:10.1016/0021-9797(83)90323-5; Reynolds' film; Brenner 1961 for the friction of spheres
Law bbf87643f46d45d4, 3f944401bbdd72b3:
    a = sqrt(2)*sqrt(R)*Piecewise((sqrt(delta + 1/(1/h + 1/R)), delta >= 0), (sqrt(1/(-delta + 1/(1/h + 1/R)))/(1/h + 1/R), True))
    F_ela = 4*pi*delta*sigma
    zeta = 3*pi*R*eta*(R/(2*h) + 9*log(20*R/(9*h) + 1)/20 + 1)*Piecewise(((1 + 2*a**2*(1/h + 1/R)/R)*(1 - a**2*(1/h + 1/R)/R + a**4*(1/h + 1/R)**2/(4*R**2))/(4 + a**2*(1/h + 1/R)/(2*R)) + a**2*(1/h + 1/R)/(2*R), delta >= 0), (1/(2*R/(a**2*(1/h + 1/R)) + (440*R**2/(a**4*(1/h + 1/R)**2) - 440*R/(a**2*(1/h + 1/R)) + 110)/(36*R**2/(a**4*(1/h + 1/R)**2) - 36*R/(a**2*(1/h + 1/R)) + 29)), True))
    unequal = (4*R*size_ratio*(-4*(size_ratio + 1/5)*(1048576*size_ratio**8 + 4)/9 + 4)/(R*(22 - 68*size_ratio) + 16*h*size_ratio) + R/(2*h) + (size_ratio + 1/5)*(65536*size_ratio**8*log(20*R/(9*h) + 1) + (1 - 65536*size_ratio**8)*log(4*R/(9*h) + 1)) + 1)/(R/(2*h) + 9*log(20*R/(9*h) + 1)/20 + 1)
    F_adh = 0
    drag translation = 6*pi*R*eta
Left out, with the operations that each saved:
    no remote force: 425 -> 414
Operations, 1030 in all:
    iteration: 128 add, 233 mul, 36 div, 3 sqrt, 2 call
    tangent: 130 add, 239 mul, 38 div, 3 sqrt, 2 call
    state: 51 add, 119 mul, 16 div, 3 sqrt, 2 call
    elastic: 2 mul
    weight: 3 add, 11 mul, 1 div
    side: 2 add, 2 mul, 2 div
    drag: 2 mul

Functions: droplet_contacts, droplet_state, droplet_energy.
p holds eta, sigma, undragged_p1; q holds R, size_ratio of each contact.
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
    undragged_p1 = p[2]
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
    q_lane = empty(32)
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
            q_lane[16 + k] = q[1 * n + i]
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
                size_ratio = q_lane[16 + k]
                delta = h / 2.0 + overlap / 2.0
                x0 = 1.0 / h
                x1 = 1.0 / (x0 + 1.0 / R)
                x3 = x1 - delta
                a = (sqrt(delta + x1) if delta >= 0.0 else x1 / sqrt(x3)) * sqrt(2.0 * R)
                x4 = 12.566370614359172 * own_sigma
                F_ela = delta * x4
                x5 = x0 * R
                x6 = (20.0 / 9.0) * x5
                x7 = _lane_log1p(x6)
                x8 = x5 / 2.0
                x9 = x8 + 1.0
                x10 = 1.0 / (0.45 * x7 + x9)
                x11 = size_ratio + 0.2
                size_ratio_p2 = size_ratio * size_ratio
                size_ratio_p4 = size_ratio_p2 * size_ratio_p2
                size_ratio_p8 = size_ratio_p4 * size_ratio_p4
                x13 = 65536.0 * size_ratio_p8
                x14 = 1.0 - x13
                x15 = (4.0 / 9.0) * x5
                x16 = R * (22.0 - 68.0 * size_ratio) + 16.0 * size_ratio * h
                x17 = R * (4.0 - (4.0 / 9.0) * x11 * (1048576.0 * size_ratio_p8 + 4.0))
                x18 = 4.0 * x17 * size_ratio / x16 + x11 * (x13 * x7 + x14 * _lane_log1p(x15))
                x19 = x18 + x9
                of_radii = x10 * x19
                h_p2 = h * h
                x21 = 1.0 / h_p2
                x22 = x21 * R
                x23 = x22 / 2.0
                x24 = x22 / (x6 + 1.0)
                x16_p2 = x16 * x16
                x25 = x11 * (-(1310720.0 / 9.0) * x24 * size_ratio_p8 - (4.0 / 9.0) * x14 * x22 / (x15 + 1.0)) - 64.0 * x17 * size_ratio_p2 / x16_p2 - x23
                of_radii_h = x10 * (x23 + x24) + x25 / x19
                excess = x18 + x8
                excess_h = x25
                x26 = excess + undragged_p1
                x27 = 1.0 / (excess + 1.0)
                x28 = 9.0 * h
                x29 = 10.0 * R + 20.0 * h + x28 * x7
                h_p3 = h_p2 * h
                x32 = 1.0 / h_p3
                a_p2 = a * a
                x34 = R * a_p2
                x35 = h * a_p2
                R_p2 = R * R
                x37 = 8.0 * R_p2
                x38 = 1.0 / (x37 * h + x34 + x35)
                R_p3 = R_p2 * R
                a_p3 = a_p2 * a
                a_p6 = a_p3 * a_p3
                x40 = R_p3 * a_p6
                x41 = a_p6 * h_p3
                R_p6 = R_p3 * R_p3
                x43 = R_p6 * h_p3
                x44 = a_p6 * h_p2
                x45 = x44 * R
                x46 = R_p2 * a_p6
                x47 = 3.0 * h
                R_p4 = R_p2 * R_p2
                a_p4 = a_p2 * a_p2
                x50 = R_p4 * a_p4
                x51 = R_p2 * a_p4
                x52 = x51 * h_p3
                x53 = a_p4 * h_p2
                x54 = x53 * R_p3
                x55 = 6.0 * a_p2
                x56 = R_p4 * h_p3
                R_p5 = R_p3 * R_p2
                x58 = R_p5 * h_p2
                x59 = x40 + x41 + 2.0 * x43 + 3.0 * x45 + x46 * x47 + x55 * x56 + x55 * x58 - x47 * x50 - 3.0 * x52 - 6.0 * x54
                x60 = 165.0 * x44
                x61 = 165.0 * x46
                x62 = 191.0 * x50
                x63 = 184.0 * a_p2
                x64 = 1.0 / (x60 * R + x61 * h + 55.0 * x40 + 55.0 * x41 + 36.0 * x43 + x56 * x63 + x58 * x63 - x62 * h - 191.0 * x52 - 382.0 * x54)
                x65 = R + h
                x66 = R * h
                x67 = x66 * a_p4
                x68 = R_p4 * h_p2
                x69 = x35 * R_p3
                x70 = 36.0 * R_p2
                x71 = a_p2 * h_p2
                x72 = 29.0 * x51 + 29.0 * x53 + 58.0 * x67 + 36.0 * x68 - 36.0 * x69 - x70 * x71
                zeta = 3.141592653589793 * x26 * x27 * x29 * eta * of_radii * (0.15 * x32 * x38 * x59 / R_p3 if delta >= 0.0 else 0.075 * x0 * x34 * x64 * x65 * x72)
                dF_ddelta = x4
                dF_dh = 0.0
                x73 = 20.0 * R + x28
                x74 = (220.0 * R + 180.0 * h + 9.0 * x7 * x73) / (x29 * x73)
                x75 = x66 * a_p6
                x76 = R_p6 * h_p2
                x77 = h * R_p3 * a_p4
                x78 = x35 * R_p5
                x79 = x51 * h_p2
                x80 = 1.0 / x59
                x81 = 3.0 * x80
                x82 = 1.0 / x65
                x83 = x71 * R_p2
                x84 = 29.0 * a_p4
                x85 = 2.0 / x72
                x86 = delta * x65
                x87 = x65 * a
                x88 = a * (x85 * x87 * (29.0 * x34 + 29.0 * x35 - 18.0 * h * R_p2) + 1.0 / a - x64 * x87 * (165.0 * x51 + 165.0 * x53 + 330.0 * x67 + 184.0 * x68 - 382.0 * x69 - 382.0 * x83))
                log_zeta_h = excess_h * x27 * (1.0 - undragged_p1) / x26 + of_radii_h + (2.0 * x82 * R_p3 * (x81 * (x51 + x53 + 2.0 * x67 + 2.0 * x68 - 2.0 * x69 - 2.0 * x83) - x38) + x74 + x81 * (x44 + x46 + x55 * x68 + 2.0 * x75 + 2.0 * x76 + 4.0 * x78 - x50 - 4.0 * x77 - 3.0 * x79) - 3.0 * x0 - x38 * (a_p2 + x37) if delta >= 0.0 else x5 * x82 * x88 * (x66 - 2.0 * x86) / (x66 - x86) + x74 + x82 + x85 * (36.0 * h * R_p4 + x84 * R + x84 * h - 18.0 * R_p3 * a_p2 - x35 * x70) - x0 - x64 * (552.0 * x68 * a_p2 + x60 + x61 + 330.0 * x75 + 108.0 * x76 + 368.0 * x78 - x62 - 764.0 * x77 - 573.0 * x79))
                x89 = 48.0 * a_p2
                log_zeta_delta = (2.0 * x38 * x65 * x80 * R * (6.0 * x46 * h + 21.0 * x50 * h + 2.0 * x40 + 2.0 * x41 + 46.0 * x43 + 6.0 * x45 + 21.0 * x52 + 42.0 * x54 - x56 * x89 - x58 * x89) if delta >= 0.0 else x88 / x3)
                x90 = 1.0 / reach
                fading = x90 * (2.0 * reach - 2.0 * h)
                started = (1.0 if 1.0 < fading else fading)
                ahead = (0.0 if 0.0 > started else started)
                x92 = 3.0 - 2.0 * ahead
                ahead_p2 = ahead * ahead
                w = x92 * ahead_p2
                w_h = -2.0 * x90 * (2.0 * x92 * ahead - 2.0 * ahead_p2)
                film = (w if pressed > 0.0 else 1.0)
                film_h = (w_h if pressed > 0.0 else 0.0)
                x94 = 1.0 / g
                x95 = g / 2.0
                Y = x94 * h / 2.0 - x0 * x95
                Y_h = x21 * x95 + x94 / 2.0
                Y_hh = -x32 * g
                x96 = 1.0 / zeta
                rho = F_ela * x96
                rho_h = x96 * (dF_ddelta / 2.0 + dF_dh) - rho * (log_zeta_delta / 2.0 + log_zeta_h)
                x97 = rho * s
                x98 = Y - y_star
                H = x97 * Y_h + x98 * film
                H_h = film * Y_h + rho_h * Y_h * s + Y_hh * x97 + film_h * x98
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
            size_ratio = q_lane[16 + k]
            delta = h / 2.0 + overlap / 2.0
            x0 = 1.0 / h
            x1 = 1.0 / (x0 + 1.0 / R)
            x3 = x1 - delta
            a = (sqrt(delta + x1) if delta >= 0.0 else x1 / sqrt(x3)) * sqrt(2.0 * R)
            x4 = 12.566370614359172 * own_sigma
            F_ela = delta * x4
            x5 = x0 * R
            x6 = (20.0 / 9.0) * x5
            x7 = _lane_log1p(x6)
            x8 = x5 / 2.0
            x9 = x8 + 1.0
            x10 = 1.0 / (0.45 * x7 + x9)
            x11 = size_ratio + 0.2
            size_ratio_p2 = size_ratio * size_ratio
            size_ratio_p4 = size_ratio_p2 * size_ratio_p2
            size_ratio_p8 = size_ratio_p4 * size_ratio_p4
            x13 = 65536.0 * size_ratio_p8
            x14 = 1.0 - x13
            x15 = (4.0 / 9.0) * x5
            x16 = R * (22.0 - 68.0 * size_ratio) + 16.0 * size_ratio * h
            x17 = R * (4.0 - (4.0 / 9.0) * x11 * (1048576.0 * size_ratio_p8 + 4.0))
            x18 = 4.0 * x17 * size_ratio / x16 + x11 * (x13 * x7 + x14 * _lane_log1p(x15))
            x19 = x18 + x9
            of_radii = x10 * x19
            h_p2 = h * h
            x21 = 1.0 / h_p2
            x22 = x21 * R
            x23 = x22 / 2.0
            x24 = x22 / (x6 + 1.0)
            x16_p2 = x16 * x16
            x25 = x11 * (-(1310720.0 / 9.0) * x24 * size_ratio_p8 - (4.0 / 9.0) * x14 * x22 / (x15 + 1.0)) - 64.0 * x17 * size_ratio_p2 / x16_p2 - x23
            of_radii_h = x10 * (x23 + x24) + x25 / x19
            excess = x18 + x8
            excess_h = x25
            x26 = excess + undragged_p1
            x27 = 1.0 / (excess + 1.0)
            x28 = 9.0 * h
            x29 = 10.0 * R + 20.0 * h + x28 * x7
            h_p3 = h_p2 * h
            x32 = 1.0 / h_p3
            a_p2 = a * a
            x34 = R * a_p2
            x35 = h * a_p2
            R_p2 = R * R
            x37 = 8.0 * R_p2
            x38 = 1.0 / (x37 * h + x34 + x35)
            R_p3 = R_p2 * R
            a_p3 = a_p2 * a
            a_p6 = a_p3 * a_p3
            x40 = R_p3 * a_p6
            x41 = a_p6 * h_p3
            R_p6 = R_p3 * R_p3
            x43 = R_p6 * h_p3
            x44 = a_p6 * h_p2
            x45 = x44 * R
            x46 = R_p2 * a_p6
            x47 = 3.0 * h
            R_p4 = R_p2 * R_p2
            a_p4 = a_p2 * a_p2
            x50 = R_p4 * a_p4
            x51 = R_p2 * a_p4
            x52 = x51 * h_p3
            x53 = a_p4 * h_p2
            x54 = x53 * R_p3
            x55 = 6.0 * a_p2
            x56 = R_p4 * h_p3
            R_p5 = R_p3 * R_p2
            x58 = R_p5 * h_p2
            x59 = x40 + x41 + 2.0 * x43 + 3.0 * x45 + x46 * x47 + x55 * x56 + x55 * x58 - x47 * x50 - 3.0 * x52 - 6.0 * x54
            x60 = 165.0 * x44
            x61 = 165.0 * x46
            x62 = 191.0 * x50
            x63 = 184.0 * a_p2
            x64 = 1.0 / (x60 * R + x61 * h + 55.0 * x40 + 55.0 * x41 + 36.0 * x43 + x56 * x63 + x58 * x63 - x62 * h - 191.0 * x52 - 382.0 * x54)
            x65 = R + h
            x66 = R * h
            x67 = x66 * a_p4
            x68 = R_p4 * h_p2
            x69 = x35 * R_p3
            x70 = 36.0 * R_p2
            x71 = a_p2 * h_p2
            x72 = 29.0 * x51 + 29.0 * x53 + 58.0 * x67 + 36.0 * x68 - 36.0 * x69 - x70 * x71
            zeta = 3.141592653589793 * x26 * x27 * x29 * eta * of_radii * (0.15 * x32 * x38 * x59 / R_p3 if delta >= 0.0 else 0.075 * x0 * x34 * x64 * x65 * x72)
            dF_ddelta = x4
            dF_dh = 0.0
            x73 = 20.0 * R + x28
            x74 = (220.0 * R + 180.0 * h + 9.0 * x7 * x73) / (x29 * x73)
            x75 = x66 * a_p6
            x76 = R_p6 * h_p2
            x77 = h * R_p3 * a_p4
            x78 = x35 * R_p5
            x79 = x51 * h_p2
            x80 = 1.0 / x59
            x81 = 3.0 * x80
            x82 = 1.0 / x65
            x83 = x71 * R_p2
            x84 = 29.0 * a_p4
            x85 = 2.0 / x72
            x86 = delta * x65
            x87 = x65 * a
            x88 = a * (x85 * x87 * (29.0 * x34 + 29.0 * x35 - 18.0 * h * R_p2) + 1.0 / a - x64 * x87 * (165.0 * x51 + 165.0 * x53 + 330.0 * x67 + 184.0 * x68 - 382.0 * x69 - 382.0 * x83))
            log_zeta_h = excess_h * x27 * (1.0 - undragged_p1) / x26 + of_radii_h + (2.0 * x82 * R_p3 * (x81 * (x51 + x53 + 2.0 * x67 + 2.0 * x68 - 2.0 * x69 - 2.0 * x83) - x38) + x74 + x81 * (x44 + x46 + x55 * x68 + 2.0 * x75 + 2.0 * x76 + 4.0 * x78 - x50 - 4.0 * x77 - 3.0 * x79) - 3.0 * x0 - x38 * (a_p2 + x37) if delta >= 0.0 else x5 * x82 * x88 * (x66 - 2.0 * x86) / (x66 - x86) + x74 + x82 + x85 * (36.0 * h * R_p4 + x84 * R + x84 * h - 18.0 * R_p3 * a_p2 - x35 * x70) - x0 - x64 * (552.0 * x68 * a_p2 + x60 + x61 + 330.0 * x75 + 108.0 * x76 + 368.0 * x78 - x62 - 764.0 * x77 - 573.0 * x79))
            x89 = 48.0 * a_p2
            log_zeta_delta = (2.0 * x38 * x65 * x80 * R * (6.0 * x46 * h + 21.0 * x50 * h + 2.0 * x40 + 2.0 * x41 + 46.0 * x43 + 6.0 * x45 + 21.0 * x52 + 42.0 * x54 - x56 * x89 - x58 * x89) if delta >= 0.0 else x88 / x3)
            x90 = 1.0 / reach
            fading = x90 * (2.0 * reach - 2.0 * h)
            started = (1.0 if 1.0 < fading else fading)
            ahead = (0.0 if 0.0 > started else started)
            x92 = 3.0 - 2.0 * ahead
            ahead_p2 = ahead * ahead
            w = x92 * ahead_p2
            w_h = -2.0 * x90 * (2.0 * x92 * ahead - 2.0 * ahead_p2)
            film = (w if pressed > 0.0 else 1.0)
            film_h = (w_h if pressed > 0.0 else 0.0)
            grip = (1.0 if pressed > 0.0 else w)
            grip_h = (0.0 if pressed > 0.0 else w_h)
            x94 = 1.0 / g
            x95 = g / 2.0
            Y = x94 * h / 2.0 - x0 * x95
            Y_h = x21 * x95 + x94 / 2.0
            Y_hh = -x32 * g
            x96 = 1.0 / zeta
            rho = F_ela * x96
            x97 = dF_ddelta / 2.0
            x98 = dF_dh + x97
            rho_h = x96 * x98 - rho * (log_zeta_delta / 2.0 + log_zeta_h)
            rho_r = log_zeta_delta * rho / 2.0 - x96 * x97
            x99 = Y_h * s
            H_h = film * Y_h + Y_hh * rho * s + film_h * (Y - y_star) + rho_h * x99
            H_r = rho_r * x99
            h_r = -H_r / H_h
            F = F_ela * grip
            F_r = F_ela * grip_h * h_r + grip * (h_r * x98 - x97)
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
    """delta, a, F, friction, remote, C, dF_dh, dh_dt, F_by_gap, F_by_distance of n contacts: out[k*n + i] is quantity k of contact i."""
    eta = p[0]
    own_sigma = p[1]
    undragged_p1 = p[2]
    for i in range(n):
        overlap = overlaps[i]
        h = gap[i]
        R = q[0 * n + i]
        size_ratio = q[1 * n + i]
        delta = h / 2.0 + overlap / 2.0
        pressed = (1.0 if delta >= 0.0 else 0.0)
        x1 = 1.0 / h
        x2 = 1.0 / (x1 + 1.0 / R)
        a = (sqrt(delta + x2) if delta >= 0.0 else x2 / sqrt(x2 - delta)) * sqrt(2.0 * R)
        x3 = 12.566370614359172 * own_sigma
        F_ela = delta * x3
        x4 = x1 * R
        x5 = _lane_log1p((20.0 / 9.0) * x4)
        x6 = x4 / 2.0
        x7 = x6 + 1.0
        x8 = size_ratio + 0.2
        size_ratio_p2 = size_ratio * size_ratio
        size_ratio_p4 = size_ratio_p2 * size_ratio_p2
        size_ratio_p8 = size_ratio_p4 * size_ratio_p4
        x10 = 65536.0 * size_ratio_p8
        x11 = 4.0 * size_ratio * R * (4.0 - (4.0 / 9.0) * x8 * (1048576.0 * size_ratio_p8 + 4.0)) / (R * (22.0 - 68.0 * size_ratio) + 16.0 * size_ratio * h) + x8 * (x10 * x5 + (1.0 - x10) * _lane_log1p((4.0 / 9.0) * x4))
        of_radii = (x11 + x7) / (0.45 * x5 + x7)
        excess = x11 + x6
        a_p2 = a * a
        x15 = R * a_p2
        x16 = h * a_p2
        R_p2 = R * R
        x18 = h * R_p2
        R_p3 = R_p2 * R
        a_p3 = a_p2 * a
        a_p6 = a_p3 * a_p3
        x20 = R_p3 * a_p6
        h_p2 = h * h
        h_p3 = h_p2 * h
        x21 = a_p6 * h_p3
        R_p6 = R_p3 * R_p3
        x22 = R_p6 * h_p3
        x23 = 3.0 * a_p6
        x25 = R * h_p2
        a_p4 = a_p2 * a_p2
        x27 = 3.0 * a_p4
        R_p4 = R_p2 * R_p2
        x29 = h * R_p4
        x30 = R_p2 * h_p3
        x31 = 6.0 * h_p2
        x32 = R_p3 * a_p4
        x33 = R_p4 * a_p2 * h_p3
        R_p5 = R_p3 * R_p2
        x34 = R_p5 * a_p2
        x35 = 165.0 * a_p6
        x36 = 191.0 * a_p4
        x37 = 29.0 * a_p4
        x38 = 36.0 * h_p2
        zeta = 3.141592653589793 * eta * of_radii * (excess + undragged_p1) * (10.0 * R + 9.0 * x5 * h + 20.0 * h) * (0.15 * (x18 * x23 + x20 + x21 + 2.0 * x22 + x23 * x25 + x31 * x34 + 6.0 * x33 - x27 * x29 - x27 * x30 - x31 * x32) / (R_p3 * h_p3 * (x15 + x16 + 8.0 * x18)) if delta >= 0.0 else 0.075 * x1 * x15 * (R + h) * (x38 * R_p4 + x37 * R_p2 + 58.0 * R * h * a_p4 + x37 * h_p2 - 36.0 * x16 * R_p3 - x38 * R_p2 * a_p2) / (184.0 * x34 * h_p2 + x18 * x35 + 55.0 * x20 + 55.0 * x21 + 36.0 * x22 + x25 * x35 + 184.0 * x33 - 382.0 * x32 * h_p2 - x29 * x36 - x30 * x36)) / (excess + 1.0)
        dF_ddelta = x3
        dF_dh = 0.0
        x39 = dF_ddelta / 2.0
        C = x39
        x40 = 1.0 / reach
        fading = x40 * (2.0 * reach - 2.0 * h)
        started = (1.0 if 1.0 < fading else fading)
        ahead = (0.0 if 0.0 > started else started)
        x42 = 3.0 - 2.0 * ahead
        ahead_p2 = ahead * ahead
        w = x42 * ahead_p2
        w_h = -2.0 * x40 * (2.0 * x42 * ahead - 2.0 * ahead_p2)
        film = (w if pressed > 0.0 else 1.0)
        grip = (1.0 if pressed > 0.0 else w)
        grip_h = (0.0 if pressed > 0.0 else w_h)
        rho = F_ela / zeta
        F = F_ela * grip
        F_by_gap = F_ela * grip_h + grip * (dF_dh + x39)
        F_by_distance = -x39 * grip
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
