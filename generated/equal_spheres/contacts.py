"""Contact law equal_spheres: written by softdyn 0.1.0 with sympy 1.14.0; do not edit.

Source: Brenner 1961, doi:10.1016/0009-2509(61)80035-3; Hertz (Johnson 1985, ch. 4); structure of arXiv:0803.1573
Law a1b3b5f85522bbe7, 88b3d9c088ee178a:
    a = Piecewise((sqrt(R)*sqrt(delta + 1/(1/h + 1/R) + 5/((2*delta + 4/(1/h + 1/R))*(1/h + 1/R)**2)), delta >= 0), (3*sqrt(R)*sqrt(1/(-delta + 1/(1/h + 1/R)))/(2*(1/h + 1/R)), True))
    F_ela = 4*E*delta*Piecewise((a, delta >= 0), (sqrt(5)*sqrt(-4*R*delta + 5*a**2)/5, True))/(3*(1 - nu**2))
    zeta = 3*pi*R*eta*(R/(2*h) + 9*log(20*R/(9*h) + 1)/20 + 1)*Piecewise((32*a**4*(1/h + 1/R)**2/(3*R**2*(15411789*R**6/(4096*a**12*(1/h + 1/R)**6) + 1701*R**2/(16*a**4*(1/h + 1/R)**2) + 4)), delta >= 0), (1/(9*R/(4*a**2*(1/h + 1/R)) + (4455*R**2/(8*a**4*(1/h + 1/R)**2) - 495*R/(a**2*(1/h + 1/R)) + 110)/(729*R**2/(16*a**4*(1/h + 1/R)**2) - 81*R/(2*a**2*(1/h + 1/R)) + 29)), True))
    unequal = (4*R*size_ratio*(-4*(size_ratio + 1/5)*(1048576*size_ratio**8 + 4)/9 + 4)/(R*(22 - 68*size_ratio) + 16*h*size_ratio) + R/(2*h) + (size_ratio + 1/5)*(65536*size_ratio**8*log(20*R/(9*h) + 1) + (1 - 65536*size_ratio**8)*log(4*R/(9*h) + 1)) + 1)/(R/(2*h) + 9*log(20*R/(9*h) + 1)/20 + 1)
    F_adh = 0
    sliding = pi*R*eta*(8/5 - 12*size_ratio/5)*log(R/h + 1) + pi*eta*Piecewise((-9*R/(4*(1/h + 1/R)) + a**2, delta >= 0), (9*R*(-1 + 4*a**2*(1/h + 1/R)/(9*R))/(4*(3 + 4*a**2*(1/h + 1/R)/(3*R))*(1/h + 1/R)), True))/h
    coupling = 3*pi*R**2*eta*log(R/h + 1)/5
    rolling = 3*pi*R**3*eta*log(R/h + 1)/5
    k_t = 2*E*Piecewise((a, delta >= 0), (18*sqrt(R)/(sqrt(1/h + 1/R)*(9*R/(4*a**2*(1/h + 1/R)) + 11)), True))/((2 - nu)*(nu + 1))
    drag translation = 6*pi*R*eta
    drag rotation = 8*pi*R**3*eta
Left out, with the operations that each saved:
    no remote force: 731 -> 720
Operations, 1677 in all:
    iteration: 123 add, 285 mul, 47 div, 4 sqrt, 2 call
    tangent: 186 add, 455 mul, 66 div, 8 sqrt, 3 call
    state: 94 add, 253 mul, 38 div, 8 sqrt, 3 call
    elastic: 16 add, 46 mul, 8 div, 4 sqrt
    weight: 3 add, 11 mul, 1 div
    side: 2 add, 2 mul, 2 div
    drag: 7 mul

Functions: equal_spheres_contacts, equal_spheres_state, equal_spheres_energy.
p holds E, eta, nu, undragged_p1; q holds R, size_ratio of each contact.
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
def equal_spheres_contacts(n: int, s: float, reach: float, overlaps: array, start: array, target: array, p: array, q: array, y: array, gap: array, force: array, slope: array, more: array) -> int:
    """Solve y = target + s dy/dt for the gap of each of n contacts, y = (h/g - g/h)/2, at fixed distances of the centres.

    overlaps: sum of the radii less the distance; start: g; y: a guess, then the solution. gap, force, slope: h, F and
    dF/dr along the solution; the force is nan where there is none. Returns how many contacts have none.
    more[k*n + i] is quantity k of contact i: keep, keep_r, stiff, stiff_r, roll, roll_r, lever, lever_r.
    """
    E = p[0]
    eta = p[1]
    own_nu = p[2]
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
    q_lane = empty(32)
    more_lane = empty(128)
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
                x0 = 1.0 / R
                x1 = 1.0 / h
                x2 = x0 + x1
                x3 = 1.0 / x2
                x2_p2 = x2 * x2
                x5 = 1.0 / x2_p2
                x6 = 2.0 * delta
                x8 = x3 - delta
                a = (sqrt(delta + x3 + 5.0 * x5 / (4.0 * x3 + x6)) if delta >= 0.0 else 1.5 * x3 / sqrt(x8)) * sqrt(R)
                x9 = (4.0 / 3.0) * a
                x10 = 2.23606797749979
                x11 = delta * R
                a_p2 = a * a
                x13 = sqrt(5.0 * a_p2 - 4.0 * x11)
                own_nu_p2 = own_nu * own_nu
                x14 = E / (1.0 - own_nu_p2)
                x15 = delta * x14
                F_ela = x15 * (x9 if delta >= 0.0 else (4.0 / 15.0) * x10 * x13)
                x16 = x1 * R
                x17 = (20.0 / 9.0) * x16
                x18 = _lane_log1p(x17)
                x19 = x16 / 2.0
                x20 = x19 + 1.0
                x21 = 0.45 * x18 + x20
                x22 = 1.0 / x21
                x23 = size_ratio + 0.2
                size_ratio_p2 = size_ratio * size_ratio
                size_ratio_p4 = size_ratio_p2 * size_ratio_p2
                size_ratio_p8 = size_ratio_p4 * size_ratio_p4
                x25 = 65536.0 * size_ratio_p8
                x26 = 1.0 - x25
                x27 = (4.0 / 9.0) * x16
                x28 = R * (22.0 - 68.0 * size_ratio) + 16.0 * size_ratio * h
                x29 = R * (4.0 - (4.0 / 9.0) * x23 * (1048576.0 * size_ratio_p8 + 4.0))
                x30 = 4.0 * x29 * size_ratio / x28 + x23 * (x18 * x25 + x26 * _lane_log1p(x27))
                x31 = x20 + x30
                of_radii = x22 * x31
                h_p2 = h * h
                x33 = 1.0 / h_p2
                x34 = x33 * R
                x35 = x34 / 2.0
                x36 = x34 / (x17 + 1.0)
                x28_p2 = x28 * x28
                x37 = x23 * (-(1310720.0 / 9.0) * x36 * size_ratio_p8 - (4.0 / 9.0) * x26 * x34 / (x27 + 1.0)) - 64.0 * x29 * size_ratio_p2 / x28_p2 - x35
                of_radii_h = x22 * (x35 + x36) + x37 / x31
                excess = x19 + x30
                excess_h = x37
                x38 = excess + undragged_p1
                x39 = 1.0 / (excess + 1.0)
                x44 = R + h
                a_p3 = a_p2 * a
                a_p6 = a_p3 * a_p3
                x47 = 7040.0 * a_p6
                R_p2 = R * R
                R_p3 = R_p2 * R
                R_p6 = R_p3 * R_p3
                x49 = 6561.0 * R_p6
                x50 = 21120.0 * a_p6
                x51 = h * R_p2
                R_p4 = R_p2 * R_p2
                a_p4 = a_p2 * a_p2
                x53 = R_p4 * a_p4
                x54 = 27504.0 * a_p4
                x55 = R_p3 * a_p4
                x56 = 29808.0 * a_p2
                R_p5 = R_p3 * R_p2
                h_p3 = h_p2 * h
                x58 = 1.0 / (x56 * R_p5 * h_p2 + x56 * R_p4 * h_p3 + x47 * R_p3 + x50 * R * h_p2 + x47 * h_p3 + x49 * h_p3 + x50 * x51 - x54 * R_p2 * h_p3 - 55008.0 * x55 * h_p2 - 27504.0 * x53 * h)
                x59 = 10.0 * R
                x60 = 9.0 * x18
                x61 = x60 * h + 20.0 * h + x59
                x62 = R * h
                x63 = x62 * a_p4
                x64 = 464.0 * a_p4
                x65 = 729.0 * R_p4
                x66 = R_p3 * a_p2
                x67 = x66 * h
                x68 = R_p2 * h_p2
                x69 = 648.0 * a_p2
                x70 = x64 * R_p2 + x64 * h_p2 + x65 * h_p2 + 928.0 * x63 - 648.0 * x67 - x68 * x69
                a_p12 = a_p6 * a_p6
                x2_p3 = x2_p2 * x2
                x2_p6 = x2_p3 * x2_p3
                zeta = 3.141592653589793 * x38 * x39 * eta * of_radii * (32.0 * x0 * x21 * x2_p2 * a_p4 / (3762.643798828125 * R_p6 / (x2_p6 * a_p12) + 106.3125 * x5 * R_p2 / a_p4 + 4.0) if delta >= 0.0 else 0.6 * x16 * x44 * x58 * x61 * x70 * a_p2)
                delta_p2 = delta * delta
                x73 = x62 * delta_p2
                x74 = delta * x51
                x75 = delta_p2 * R_p2
                x71 = x11 * h_p2
                x76 = delta_p2 * h_p2
                x77 = 3.0 * x68 + 8.0 * x71 + 4.0 * x73 + 8.0 * x74 + 2.0 * x75 + 2.0 * x76
                x78 = 1.0 / a
                x79 = 2.0 * x62
                x80 = delta * x44
                x114 = x79 + x80
                x114_p2 = x114 * x114
                x81 = 1.0 / x114_p2
                x82 = x78 * x81
                x83 = 5.0 * a_p2
                x84 = h * a_p2
                x85 = 1.0 / (x62 - x80)
                x86 = x10 * x85 / x13
                dF_ddelta = x14 * (x11 * x77 * x82 / 3.0 + x9 if delta >= 0.0 else (2.0 / 15.0) * x86 * (x59 * x84 + 12.0 * x73 + 12.0 * x75 - delta * x83 * h - x11 * x83 - 12.0 * x74))
                x44_p2 = x44 * x44
                x87 = 1.0 / x44_p2
                x88 = 9.0 * h
                x89 = delta * x88 * R_p2 + x79 * delta_p2 + 9.0 * x68 + 9.0 * x71 + x75 + x76
                x90 = 1.0 / x44
                x91 = x1 * x90
                x92 = x91 * R * (x62 - x44 * x6)
                dF_dh = (2.0 / 3.0) * x15 * (x82 * x87 * x89 * R_p3 if delta >= 0.0 else x86 * x92 * a_p2)
                x93 = 20.0 * R
                x95 = R_p4 * h_p2
                a_p8 = a_p4 * a_p4
                x44_p4 = x44_p2 * x44_p2
                x94 = x44_p4 * a_p8
                R_p8 = R_p4 * R_p4
                R_p12 = R_p6 * R_p6
                h_p4 = h_p2 * h_p2
                h_p6 = h_p3 * h_p3
                x44_p3 = x44_p2 * x44
                x44_p6 = x44_p3 * x44_p3
                x96 = 243.0 * (190269.0 * R_p8 * h_p4 + 1792.0 * x94) / (15411789.0 * R_p12 * h_p6 + 16384.0 * x44_p6 * a_p12 + 435456.0 * x94 * x95)
                x97 = 1.0 / a_p2
                x98 = x95 * x96 + 1.0
                x99 = x88 + x93
                x100 = 1.0 / x70
                x101 = 116.0 * a_p2
                x102 = x44 * a
                x103 = 440.0 * a_p4
                x104 = a * (8.0 * x100 * x102 * (x101 * R + x101 * h - 81.0 * x51) + x78 - 48.0 * x102 * x58 * (x103 * R_p2 + x103 * h_p2 + 880.0 * x63 + 621.0 * x95 - 1146.0 * x68 * a_p2 - 1146.0 * x67))
                log_zeta_h = excess_h * x39 * (1.0 - undragged_p1) / x38 + of_radii_h + (2.0 * R * (x81 * x87 * x89 * x97 * x98 * R_p2 - x90 * x96 * h * R_p4 - 5.0 * x33 * (1.0 + 18.0 / (x1 * x93 + 9.0)) / (x1 * x59 + x60 + 20.0) - x91) if delta >= 0.0 else 2.0 * x100 * (x64 * R + x64 * h + x65 * h - x51 * x69 - 324.0 * x66) + x104 * x85 * x92 + x90 + (220.0 * R + 180.0 * h + x60 * x99) / (x61 * x99) - x1 - 3.0 * x58 * (19872.0 * x84 * R_p5 + x47 * R_p2 + 14080.0 * x62 * a_p6 + x47 * h_p2 + x49 * h_p2 + x56 * x95 - 36672.0 * x55 * h - 9168.0 * x53 - x54 * x68))
                log_zeta_delta = (x77 * x81 * x97 * x98 * R if delta >= 0.0 else x104 / x8)
                x105 = 1.0 / reach
                fading = x105 * (2.0 * reach - 2.0 * h)
                started = (1.0 if 1.0 < fading else fading)
                ahead = (0.0 if 0.0 > started else started)
                x107 = 3.0 - 2.0 * ahead
                ahead_p2 = ahead * ahead
                w = x107 * ahead_p2
                w_h = -2.0 * x105 * (2.0 * x107 * ahead - 2.0 * ahead_p2)
                film = (w if pressed > 0.0 else 1.0)
                film_h = (w_h if pressed > 0.0 else 0.0)
                x109 = 1.0 / g
                x110 = g / 2.0
                Y = x109 * h / 2.0 - x1 * x110
                Y_h = x109 / 2.0 + x110 * x33
                Y_hh = -g / h_p3
                x111 = 1.0 / zeta
                rho = F_ela * x111
                rho_h = x111 * (dF_ddelta / 2.0 + dF_dh) - rho * (log_zeta_delta / 2.0 + log_zeta_h)
                x112 = rho * s
                x113 = Y - y_star
                H = x112 * Y_h + x113 * film
                H_h = film * Y_h + rho_h * Y_h * s + Y_hh * x112 + film_h * x113
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
            x0 = sqrt(R)
            x1 = 1.0 / R
            x2 = 1.0 / h
            x3 = x1 + x2
            x4 = 1.0 / x3
            x3_p2 = x3 * x3
            x6 = 1.0 / x3_p2
            x7 = 2.0 * delta
            x9 = x4 - delta
            a = x0 * (sqrt(delta + x4 + 5.0 * x6 / (4.0 * x4 + x7)) if delta >= 0.0 else 1.5 * x4 / sqrt(x9))
            x10 = (4.0 / 3.0) * a
            x11 = 2.23606797749979
            x12 = delta * R
            a_p2 = a * a
            x14 = sqrt(5.0 * a_p2 - 4.0 * x12)
            own_nu_p2 = own_nu * own_nu
            x15 = E / (1.0 - own_nu_p2)
            x16 = delta * x15
            F_ela = x16 * (x10 if delta >= 0.0 else (4.0 / 15.0) * x11 * x14)
            x17 = x2 * R
            x18 = (20.0 / 9.0) * x17
            x19 = _lane_log1p(x18)
            x20 = x17 / 2.0
            x21 = x20 + 1.0
            x22 = 0.45 * x19 + x21
            x23 = 1.0 / x22
            x24 = size_ratio + 0.2
            size_ratio_p2 = size_ratio * size_ratio
            size_ratio_p4 = size_ratio_p2 * size_ratio_p2
            size_ratio_p8 = size_ratio_p4 * size_ratio_p4
            x26 = 65536.0 * size_ratio_p8
            x27 = 1.0 - x26
            x28 = (4.0 / 9.0) * x17
            x29 = size_ratio * h
            x30 = R * (22.0 - 68.0 * size_ratio) + 16.0 * x29
            x31 = 4.0 * size_ratio
            x32 = R * (4.0 - (4.0 / 9.0) * x24 * (1048576.0 * size_ratio_p8 + 4.0))
            x33 = x24 * (x19 * x26 + x27 * _lane_log1p(x28)) + x31 * x32 / x30
            x34 = x21 + x33
            of_radii = x23 * x34
            h_p2 = h * h
            x36 = 1.0 / h_p2
            x37 = x36 * R
            x38 = x37 / 2.0
            x39 = x37 / (x18 + 1.0)
            x30_p2 = x30 * x30
            x40 = x24 * (-(1310720.0 / 9.0) * x39 * size_ratio_p8 - (4.0 / 9.0) * x27 * x37 / (x28 + 1.0)) - 64.0 * x32 * size_ratio_p2 / x30_p2 - x38
            of_radii_h = x23 * (x38 + x39) + x40 / x34
            excess = x20 + x33
            excess_h = x40
            x41 = 1.0 / (excess + 1.0)
            x42 = excess + undragged_p1
            a_p3 = a_p2 * a
            a_p6 = a_p3 * a_p3
            x49 = 7040.0 * a_p6
            R_p2 = R * R
            R_p3 = R_p2 * R
            R_p6 = R_p3 * R_p3
            x51 = 6561.0 * R_p6
            x52 = 21120.0 * a_p6
            x53 = R * h_p2
            x54 = h * R_p2
            R_p4 = R_p2 * R_p2
            a_p4 = a_p2 * a_p2
            x56 = R_p4 * a_p4
            x57 = 27504.0 * a_p4
            x58 = 29808.0 * a_p2
            x60 = a_p2 * h_p2
            R_p5 = R_p3 * R_p2
            h_p3 = h_p2 * h
            x61 = 1.0 / (29808.0 * x60 * R_p5 + x58 * R_p4 * h_p3 + x49 * R_p3 + x49 * h_p3 + x51 * h_p3 + x52 * x53 + x52 * x54 - 55008.0 * R_p3 * a_p4 * h_p2 - x57 * R_p2 * h_p3 - 27504.0 * x56 * h)
            x62 = 10.0 * R
            x63 = 20.0 * h
            x64 = 9.0 * x19
            x65 = x64 * h + x62 + x63
            x66 = R * h
            x67 = x66 * a_p4
            x68 = 464.0 * a_p4
            x69 = 729.0 * R_p4
            x70 = R_p3 * a_p2
            x71 = x70 * h
            x72 = R_p2 * h_p2
            x73 = 648.0 * a_p2
            x74 = x68 * R_p2 + x68 * h_p2 + x69 * h_p2 + 928.0 * x67 - 648.0 * x71 - x72 * x73
            x75 = R + h
            x76 = x75 * a_p2
            x77 = 3.141592653589793 * eta
            a_p12 = a_p6 * a_p6
            x3_p3 = x3_p2 * x3
            x3_p6 = x3_p3 * x3_p3
            zeta = x41 * x42 * x77 * of_radii * (32.0 * x1 * x22 * x3_p2 * a_p4 / (3762.643798828125 * R_p6 / (x3_p6 * a_p12) + 106.3125 * x6 * R_p2 / a_p4 + 4.0) if delta >= 0.0 else 0.6 * x17 * x61 * x65 * x74 * x76)
            delta_p2 = delta * delta
            x80 = x66 * delta_p2
            x81 = delta * x54
            x82 = delta_p2 * R_p2
            x78 = x12 * h_p2
            x83 = delta_p2 * h_p2
            x84 = 3.0 * x72 + 8.0 * x78 + 4.0 * x80 + 8.0 * x81 + 2.0 * x82 + 2.0 * x83
            x85 = 1.0 / a
            x86 = 2.0 * x66
            x87 = delta * x75
            x162 = x86 + x87
            x162_p2 = x162 * x162
            x88 = 1.0 / x162_p2
            x89 = x85 * x88
            x90 = 5.0 * a_p2
            x91 = h * a_p2
            x92 = 1.0 / (x66 - x87)
            x93 = x11 * x92 / x14
            dF_ddelta = x15 * (x10 + x12 * x84 * x89 / 3.0 if delta >= 0.0 else (2.0 / 15.0) * x93 * (x62 * x91 + 12.0 * x80 + 12.0 * x82 - delta * x90 * h - x12 * x90 - 12.0 * x81))
            x75_p2 = x75 * x75
            x94 = 1.0 / x75_p2
            x95 = 9.0 * h
            x96 = x95 * R_p2
            x97 = x86 * delta_p2 + delta * x96 + 9.0 * x72 + 9.0 * x78 + x82 + x83
            x98 = x89 * x94 * x97 * R_p3
            x99 = 1.0 / x75
            x100 = x2 * x99
            x101 = x100 * R * (x66 - x7 * x75)
            dF_dh = (2.0 / 3.0) * x16 * (x98 if delta >= 0.0 else x101 * x93 * a_p2)
            x102 = 20.0 * R
            x103 = h * R_p4
            x105 = R_p4 * h_p2
            a_p8 = a_p4 * a_p4
            x75_p4 = x75_p2 * x75_p2
            x104 = x75_p4 * a_p8
            R_p8 = R_p4 * R_p4
            R_p12 = R_p6 * R_p6
            h_p4 = h_p2 * h_p2
            h_p6 = h_p3 * h_p3
            x75_p3 = x75_p2 * x75
            x75_p6 = x75_p3 * x75_p3
            x106 = 243.0 * (190269.0 * R_p8 * h_p4 + 1792.0 * x104) / (15411789.0 * R_p12 * h_p6 + 16384.0 * x75_p6 * a_p12 + 435456.0 * x104 * x105)
            x107 = 1.0 / a_p2
            x108 = x105 * x106 + 1.0
            x109 = x102 + x95
            x110 = 1.0 / x74
            x111 = h * R_p3
            x112 = 116.0 * a_p2
            x113 = x75 * a
            x114 = 440.0 * a_p4
            x115 = 8.0 * x110 * x113 * (x112 * R + x112 * h - 81.0 * x54) + x85 - 48.0 * x113 * x61 * (x114 * R_p2 + x114 * h_p2 + 621.0 * x105 + 880.0 * x67 - 1146.0 * x72 * a_p2 - 1146.0 * x71)
            x116 = x101 * x92 * a
            log_zeta_h = excess_h * x41 * (1.0 - undragged_p1) / x42 + of_radii_h + (2.0 * R * (x107 * x108 * x88 * x94 * x97 * R_p2 - x100 - x103 * x106 * x99 - 5.0 * x36 * (1.0 + 18.0 / (x102 * x2 + 9.0)) / (x2 * x62 + x64 + 20.0)) if delta >= 0.0 else 2.0 * x110 * (x68 * R + x68 * h + x69 * h - x54 * x73 - 324.0 * x70) + x115 * x116 + x99 + (220.0 * R + 180.0 * h + x109 * x64) / (x109 * x65) - x2 - 3.0 * x61 * (19872.0 * x91 * R_p5 + x49 * R_p2 + 14080.0 * x66 * a_p6 + x49 * h_p2 + x51 * h_p2 + x105 * x58 - 36672.0 * x111 * a_p4 - 9168.0 * x56 - x57 * x72))
            x117 = x84 * R
            x118 = a / x9
            log_zeta_delta = (x107 * x108 * x117 * x88 if delta >= 0.0 else x115 * x118)
            x119 = 1.0 / reach
            fading = x119 * (2.0 * reach - 2.0 * h)
            started = (1.0 if 1.0 < fading else fading)
            ahead = (0.0 if 0.0 > started else started)
            x121 = 3.0 - 2.0 * ahead
            ahead_p2 = ahead * ahead
            w = x121 * ahead_p2
            w_h = -2.0 * x119 * (2.0 * x121 * ahead - 2.0 * ahead_p2)
            film = (w if pressed > 0.0 else 1.0)
            film_h = (w_h if pressed > 0.0 else 0.0)
            grip = (1.0 if pressed > 0.0 else w)
            grip_h = (0.0 if pressed > 0.0 else w_h)
            x123 = 1.0 / g
            x124 = g / 2.0
            Y = x123 * h / 2.0 - x124 * x2
            Y_h = x123 / 2.0 + x124 * x36
            Y_hh = -g / h_p3
            x125 = 1.0 / zeta
            rho = F_ela * x125
            x126 = dF_ddelta / 2.0
            x127 = dF_dh + x126
            rho_h = x125 * x127 - rho * (log_zeta_delta / 2.0 + log_zeta_h)
            rho_r = log_zeta_delta * rho / 2.0 - x125 * x126
            x128 = Y_h * s
            H_h = film * Y_h + Y_hh * rho * s + film_h * (Y - y_star) + rho_h * x128
            H_r = rho_r * x128
            h_r = -H_r / H_h
            F = F_ela * grip
            F_r = F_ela * grip_h * h_r + grip * (h_r * x127 - x126)
            a_h = (x98 if delta >= 0.0 else x116) / 2.0
            a_delta = (x117 * x89 / 4.0 if delta >= 0.0 else x118 / 2.0)
            x129 = _lane_log1p(x17)
            x130 = 32.0 * x129
            x131 = 48.0 * size_ratio
            x132 = 48.0 * x29
            x133 = x129 * R_p2
            x134 = 4.0 * a_p2
            x135 = x134 * x75 + x96
            x136 = x66 * a_p2
            x137 = R_p2 * a_p2
            x138 = 288.0 * x129
            x139 = 432.0 * x129
            x140 = 128.0 * x129
            x141 = x129 * size_ratio
            x142 = 192.0 * x141
            sliding = x77 * x99 * (x2 * (x102 * a_p2 + x63 * a_p2 + x130 * x53 + x130 * x54 - x129 * x131 * x53 - x132 * x133 - 45.0 * x54) if delta >= 0.0 else R * (x111 * x138 + 256.0 * x129 * x136 + 60.0 * x136 + x137 * x140 + 60.0 * x137 + x138 * x72 + x140 * x60 - x139 * x29 * R_p3 - x139 * x72 * size_ratio - 135.0 * x111 - 384.0 * x136 * x141 - x137 * x142 - x142 * x60) / x135) / 20.0
            x143 = 0.6 * x77
            coupling = x133 * x143
            x144 = x143 * R_p3
            rolling = x129 * x144
            x145 = x4 * R
            x146 = E / ((own_nu + 1.0) * (2.0 - own_nu))
            k_t = x146 * (2.0 * a if delta >= 0.0 else 36.0 * x0 / ((2.25 * x107 * x145 + 11.0) * sqrt(x3)))
            x147 = a_h * h_p3
            x148 = 40.0 * a
            x149 = 4.0 * x1 * x3 * a_p2 - 9.0
            x150 = 1.0 / (x1 * x134 * x3 + 9.0)
            x151 = x149 * x150
            sliding_h = x77 * (x36 * x94 * (x132 * R_p3 + 80.0 * a_h * x53 * a + a_h * x148 * x54 + x131 * x72 + x147 * x148 + 13.0 * x72 - 32.0 * x111 - 40.0 * x136 - 20.0 * x137 - 20.0 * x60) / 20.0 if delta >= 0.0 else x2 * (6.0 * a_h * x150 * a * (1.0 - x151) + 0.75 * x150 * x36 * x4 * (x134 * x151 + x145 * x149 - x134) - 0.8 * x2 * R_p2 * (2.0 - 3.0 * size_ratio) / (x17 + 1.0) - 0.75 * x151 * x17 * x4))
            coupling_h = -x100 * x144
            rolling_h = -x100 * x143 * R_p4
            x152 = sqrt(x75)
            x153 = 44.0 * a_p3
            x163 = 44.0 * x76 + x96
            x163_p2 = x163 * x163
            x154 = a / x163_p2
            k_t_h = x146 * (2.0 * a_h if delta >= 0.0 else 72.0 * x154 * R_p2 * (36.0 * x147 * R + x153 * R + 36.0 * a_h * x72 + x153 * h - x96 * a) / (x152 * sqrt(h)))
            x135_p2 = x135 * x135
            sliding_delta = a_delta * x77 * a * (2.0 * x2 if delta >= 0.0 else 108.0 * x103 / x135_p2)
            coupling_delta = 0.0
            rolling_delta = 0.0
            k_t_delta = a_delta * x146 * (2.0 if delta >= 0.0 else 2592.0 * x152 * x154 * R_p3 * h * sqrt(h))
            friction_t = w * sliding
            x155 = friction_t + k_t * s
            keep = friction_t / x155
            stiff = keep * k_t
            x156 = 1.0 / sliding
            x157 = 1.0 - x31
            coupling_p2 = coupling * coupling
            x158 = rolling - x156 * x157 * coupling_p2
            roll = x158 * w
            lever = coupling * x156
            x159 = h_r / 2.0 - 0.5
            sliding_r = h_r * sliding_h + sliding_delta * x159
            coupling_r = coupling_delta * x159 + coupling_h * h_r
            rolling_r = h_r * rolling_h + rolling_delta * x159
            k_t_r = h_r * k_t_h + k_t_delta * x159
            x160 = h_r * w_h
            friction_t_r = x160 * sliding + sliding_r * w
            x155_p2 = x155 * x155
            keep_r = s * (friction_t_r * k_t - k_t_r * friction_t) / x155_p2
            stiff_r = keep_r * k_t + k_t_r * keep
            x161 = -lever * sliding_r
            lever_r = x156 * (coupling_r + x161)
            roll_r = w * (rolling_r - lever * x157 * (2.0 * coupling_r + x161)) + x158 * x160
            h_lane[k] = h
            F_lane[k] = F if open_lane[k] == 0.0 else nan
            F_r_lane[k] = F_r
            more_lane[0 + k] = keep
            more_lane[16 + k] = keep_r
            more_lane[32 + k] = stiff
            more_lane[48 + k] = stiff_r
            more_lane[64 + k] = roll
            more_lane[80 + k] = roll_r
            more_lane[96 + k] = lever
            more_lane[112 + k] = lever_r
        count: int = 16 if base + 16 < n else n - base
        for k in range(count):
            i: int = base + k
            y[i] = y_lane[k]
            gap[i] = h_lane[k]
            force[i] = F_lane[k]
            slope[i] = F_r_lane[k]
            more[0 * n + i] = more_lane[0 + k]
            more[1 * n + i] = more_lane[16 + k]
            more[2 * n + i] = more_lane[32 + k]
            more[3 * n + i] = more_lane[48 + k]
            more[4 * n + i] = more_lane[64 + k]
            more[5 * n + i] = more_lane[80 + k]
            more[6 * n + i] = more_lane[96 + k]
            more[7 * n + i] = more_lane[112 + k]
            unsolved += 0 if isfinite(F_lane[k]) and isfinite(F_r_lane[k]) else 1
        base += 16
    return unsolved


@jit
def equal_spheres_state(n: int, reach: float, overlaps: array, gap: array, p: array, q: array, out: array) -> None:
    """delta, a, F, friction, remote, C, dF_dh, dh_dt, F_by_gap, F_by_distance, friction_t, roll, k_t, k_t_h, k_t_delta of n contacts: out[k*n + i] is quantity k of contact i."""
    E = p[0]
    eta = p[1]
    own_nu = p[2]
    undragged_p1 = p[3]
    for i in range(n):
        overlap = overlaps[i]
        h = gap[i]
        R = q[0 * n + i]
        size_ratio = q[1 * n + i]
        delta = h / 2.0 + overlap / 2.0
        pressed = (1.0 if delta >= 0.0 else 0.0)
        x1 = sqrt(R)
        x2 = 1.0 / R
        x3 = 1.0 / h
        x4 = x2 + x3
        x5 = 1.0 / x4
        x4_p2 = x4 * x4
        x7 = 1.0 / x4_p2
        x8 = 2.0 * delta
        x9 = x5 - delta
        a = x1 * (sqrt(delta + x5 + 5.0 * x7 / (4.0 * x5 + x8)) if delta >= 0.0 else 1.5 * x5 / sqrt(x9))
        x10 = (4.0 / 3.0) * a
        x11 = 2.23606797749979
        x12 = delta * R
        a_p2 = a * a
        x14 = sqrt(5.0 * a_p2 - 4.0 * x12)
        own_nu_p2 = own_nu * own_nu
        x15 = E / (1.0 - own_nu_p2)
        x16 = delta * x15
        F_ela = x16 * (x10 if delta >= 0.0 else (4.0 / 15.0) * x11 * x14)
        x17 = x3 * R
        x19 = x17 / 2.0
        x20 = x19 + 1.0
        x18 = _lane_log1p((20.0 / 9.0) * x17)
        x21 = 0.45 * x18 + x20
        x22 = size_ratio + 0.2
        size_ratio_p2 = size_ratio * size_ratio
        size_ratio_p4 = size_ratio_p2 * size_ratio_p2
        size_ratio_p8 = size_ratio_p4 * size_ratio_p4
        x24 = 65536.0 * size_ratio_p8
        x25 = size_ratio * h
        x26 = 4.0 * size_ratio
        x27 = x26 * R * (4.0 - (4.0 / 9.0) * x22 * (1048576.0 * size_ratio_p8 + 4.0)) / (R * (22.0 - 68.0 * size_ratio) + 16.0 * x25) + x22 * (x18 * x24 + (1.0 - x24) * _lane_log1p((4.0 / 9.0) * x17))
        of_radii = (x20 + x27) / x21
        excess = x19 + x27
        a_p3 = a_p2 * a
        a_p6 = a_p3 * a_p3
        x33 = 7040.0 * a_p6
        x35 = 21120.0 * a_p6
        h_p2 = h * h
        x37 = R * h_p2
        R_p2 = R * R
        x38 = h * R_p2
        a_p4 = a_p2 * a_p2
        x40 = 27504.0 * a_p4
        x41 = 29808.0 * a_p2
        x42 = 10.0 * R
        x43 = 20.0 * h
        x44 = 9.0 * h
        x45 = R * h
        x46 = 464.0 * a_p4
        R_p3 = R_p2 * R
        x47 = h * R_p3
        x48 = 648.0 * a_p2
        x49 = R_p2 * h_p2
        x50 = R + h
        x51 = x50 * a_p2
        x52 = 3.141592653589793 * eta
        R_p4 = R_p2 * R_p2
        R_p5 = R_p3 * R_p2
        R_p6 = R_p3 * R_p3
        a_p12 = a_p6 * a_p6
        h_p3 = h_p2 * h
        x4_p3 = x4_p2 * x4
        x4_p6 = x4_p3 * x4_p3
        zeta = x52 * of_radii * (excess + undragged_p1) * (32.0 * x2 * x21 * x4_p2 * a_p4 / (3762.643798828125 * R_p6 / (x4_p6 * a_p12) + 106.3125 * x7 * R_p2 / a_p4 + 4.0) if delta >= 0.0 else 0.6 * x17 * x51 * (x18 * x44 + x42 + x43) * (729.0 * R_p4 * h_p2 + x46 * R_p2 + 928.0 * x45 * a_p4 + x46 * h_p2 - x47 * x48 - x48 * x49) / (6561.0 * R_p6 * h_p3 + x41 * R_p5 * h_p2 + x41 * R_p4 * h_p3 + x33 * R_p3 + x33 * h_p3 + x35 * x37 + x35 * x38 - x40 * h * R_p4 - 55008.0 * R_p3 * a_p4 * h_p2 - x40 * R_p2 * h_p3)) / (excess + 1.0)
        delta_p2 = delta * delta
        x55 = x45 * delta_p2
        x56 = delta * x38
        x57 = delta_p2 * R_p2
        x53 = x12 * h_p2
        x58 = delta_p2 * h_p2
        x59 = 2.0 * x45
        x60 = delta * x50
        x92 = x59 + x60
        x92_p2 = x92 * x92
        x61 = 1.0 / (x92_p2 * a)
        x62 = x61 * (3.0 * x49 + 8.0 * x53 + 4.0 * x55 + 8.0 * x56 + 2.0 * x57 + 2.0 * x58)
        x63 = 5.0 * a_p2
        x64 = 1.0 / (x45 - x60)
        x65 = x11 * x64 / x14
        dF_ddelta = x15 * (x10 + x12 * x62 / 3.0 if delta >= 0.0 else (2.0 / 15.0) * x65 * (x42 * h * a_p2 + 12.0 * x55 + 12.0 * x57 - delta * x63 * h - x12 * x63 - 12.0 * x56))
        x66 = x44 * R_p2
        x50_p2 = x50 * x50
        x67 = x61 * R_p3 * (x59 * delta_p2 + delta * x66 + 9.0 * x49 + 9.0 * x53 + x57 + x58) / x50_p2
        x68 = 1.0 / x50
        x69 = x17 * x68 * (x45 - x50 * x8)
        dF_dh = (2.0 / 3.0) * x16 * (x67 if delta >= 0.0 else x65 * x69 * a_p2)
        x70 = dF_ddelta / 2.0
        C = x70
        x71 = 1.0 / reach
        fading = x71 * (2.0 * reach - 2.0 * h)
        started = (1.0 if 1.0 < fading else fading)
        ahead = (0.0 if 0.0 > started else started)
        x73 = 3.0 - 2.0 * ahead
        ahead_p2 = ahead * ahead
        w = x73 * ahead_p2
        w_h = -2.0 * x71 * (2.0 * x73 * ahead - 2.0 * ahead_p2)
        film = (w if pressed > 0.0 else 1.0)
        grip = (1.0 if pressed > 0.0 else w)
        grip_h = (0.0 if pressed > 0.0 else w_h)
        rho = F_ela / zeta
        F = F_ela * grip
        F_by_gap = F_ela * grip_h + grip * (dF_dh + x70)
        F_by_distance = -x70 * grip
        friction = w * zeta
        remote = 0.0
        dh_dt = -rho / film
        a_h = (x67 if delta >= 0.0 else x64 * x69 * a) / 2.0
        a_delta = (x62 * R / 4.0 if delta >= 0.0 else a / (2.0 * x9))
        x75 = _lane_log1p(x17)
        x76 = 32.0 * x75
        x77 = x75 * size_ratio
        x78 = x75 * R_p2
        x79 = 60.0 * a_p2
        x80 = 288.0 * x75
        x81 = x45 * a_p2
        x82 = x75 * R_p3
        x83 = 128.0 * a_p2
        x84 = x75 * h_p2
        x85 = 192.0 * size_ratio * a_p2
        sliding = x52 * x68 * (x3 * (20.0 * R * a_p2 + x43 * a_p2 + x37 * x76 + x38 * x76 - 48.0 * x25 * x78 - 48.0 * x37 * x77 - 45.0 * x38) if delta >= 0.0 else R * (x79 * R_p2 + x45 * x79 + x47 * x80 + x49 * x80 + 256.0 * x75 * x81 + x78 * x83 + x83 * x84 - 432.0 * x25 * x82 - 135.0 * x47 - 432.0 * x49 * x77 - 384.0 * x77 * x81 - x78 * x85 - x84 * x85) / (4.0 * x51 + x66)) / 20.0
        x86 = 0.6 * x52
        coupling = x78 * x86
        rolling = x82 * x86
        x87 = E / ((own_nu + 1.0) * (2.0 - own_nu))
        k_t = x87 * (2.0 * a if delta >= 0.0 else 36.0 * x1 / ((2.25 * x5 * R / a_p2 + 11.0) * sqrt(x4)))
        x88 = sqrt(x50)
        x89 = 44.0 * a_p3
        x90 = 36.0 * a_h
        x93 = 44.0 * x51 + x66
        x93_p2 = x93 * x93
        x91 = a / x93_p2
        k_t_h = x87 * (2.0 * a_h if delta >= 0.0 else 72.0 * x91 * R_p2 * (x90 * R * h_p3 + x89 * R + x89 * h + x49 * x90 - x66 * a) / (x88 * sqrt(h)))
        k_t_delta = a_delta * x87 * (2.0 if delta >= 0.0 else 2592.0 * x88 * x91 * R_p3 * h * sqrt(h))
        friction_t = w * sliding
        coupling_p2 = coupling * coupling
        roll = w * (rolling - coupling_p2 * (1.0 - x26) / sliding)
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
        out[10 * n + i] = friction_t
        out[11 * n + i] = roll
        out[12 * n + i] = k_t
        out[13 * n + i] = k_t_h
        out[14 * n + i] = k_t_delta


@jit
def equal_spheres_energy(n: int, reach: float, overlaps: array, gap: array, p: array, q: array, points: int, nodes: array, weights: array, out: array) -> None:
    """Stored energy grip U and its slope in h at fixed delta, of n contacts: out[i] and out[n + i].

    U = integral of 2 F_ela(a(h, d), d) dd from 0 to delta, by quadrature over the fractions nodes of delta.
    """
    E = p[0]
    own_nu = p[2]
    for i in range(n):
        h = gap[i]
        whole = 0.5 * (overlaps[i] + h)
        U = 0.0
        U_h = 0.0
        for m in range(points):
            delta = whole * nodes[m]
            R = q[0 * n + i]
            x0 = 1.0 / h
            x1 = x0 + 1.0 / R
            x2 = 1.0 / x1
            x3 = 2.0 * delta
            x1_p2 = x1 * x1
            a = (sqrt(delta + x2 + 5.0 / (x1_p2 * (4.0 * x2 + x3))) if delta >= 0.0 else 1.5 * x2 / sqrt(x2 - delta)) * sqrt(R)
            x5 = 2.23606797749979
            x6 = delta * R
            a_p2 = a * a
            x8 = sqrt(5.0 * a_p2 - 4.0 * x6)
            own_nu_p2 = own_nu * own_nu
            x9 = delta * E / (1.0 - own_nu_p2)
            F_ela = x9 * ((4.0 / 3.0) * a if delta >= 0.0 else (4.0 / 15.0) * x5 * x8)
            x11 = R * h
            x12 = 2.0 * x11
            x10 = R + h
            x13 = delta * x10
            x18 = x12 + x13
            h_p2 = h * h
            x17 = 9.0 * h_p2
            R_p2 = R * R
            R_p3 = R_p2 * R
            delta_p2 = delta * delta
            x10_p2 = x10 * x10
            x18_p2 = x18 * x18
            dF_dh = (2.0 / 3.0) * x9 * (R_p3 * (delta_p2 * R_p2 + 9.0 * delta * h * R_p2 + x17 * R_p2 + delta_p2 * h_p2 + x12 * delta_p2 + x17 * x6) / (x10_p2 * x18_p2 * a) if delta >= 0.0 else x0 * x5 * R * a_p2 * (x11 - x10 * x3) / (x10 * x8 * (x11 - x13)))
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
def equal_spheres_drag(n: int, p: array, q: array, out: array) -> None:
    """What the fluid does to n particles alone, translation, rotation: out[k*n + i] is quantity k of particle i.

    In q stand the particles' own parameters, R the radius.
    """
    eta = p[1]
    for i in range(n):
        R = q[0 * n + i]
        x0 = 3.141592653589793 * eta
        translation = 6.0 * x0 * R
        R_p2 = R * R
        R_p3 = R_p2 * R
        rotation = 8.0 * x0 * R_p3
        out[0 * n + i] = translation
        out[1 * n + i] = rotation
