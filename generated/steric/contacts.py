"""Contact law steric: written by softdyn 0.1.0 with sympy 1.14.0; do not edit.

Source: Alexander 1977; de Gennes, Adv. Colloid Interface Sci. 27 (1987) 189; equal_spheres
Law 75c5daff457f09fe, 88b3d9c088ee178a:
    a = Piecewise((sqrt(R)*sqrt(delta + 1/(1/h + 1/R) + 5/((2*delta + 4/(1/h + 1/R))*(1/h + 1/R)**2)), delta >= 0), (3*sqrt(R)*sqrt(1/(-delta + 1/(1/h + 1/R)))/(2*(1/h + 1/R)), True))
    F_ela = 4*E*delta*Piecewise((a, delta >= 0), (sqrt(5)*sqrt(-4*R*delta + 5*a**2)/5, True))/(3*(1 - nu**2))
    zeta = 3*pi*R*eta*(R/(2*h) + 9*log(20*R/(9*h) + 1)/20 + 1)*Piecewise((32*a**4*(1/h + 1/R)**2/(3*R**2*(15411789*R**6/(4096*a**12*(1/h + 1/R)**6) + 1701*R**2/(16*a**4*(1/h + 1/R)**2) + 4)), delta >= 0), (1/(9*R/(4*a**2*(1/h + 1/R)) + (4455*R**2/(8*a**4*(1/h + 1/R)**2) - 495*R/(a**2*(1/h + 1/R)) + 110)/(729*R**2/(16*a**4*(1/h + 1/R)**2) - 81*R/(2*a**2*(1/h + 1/R)) + 29)), True))
    unequal = (4*R*size_ratio*(-4*(size_ratio + 1/5)*(1048576*size_ratio**8 + 4)/9 + 4)/(R*(22 - 68*size_ratio) + 16*h*size_ratio) + R/(2*h) + (size_ratio + 1/5)*(65536*size_ratio**8*log(20*R/(9*h) + 1) + (1 - 65536*size_ratio**8)*log(4*R/(9*h) + 1)) + 1)/(R/(2*h) + 9*log(20*R/(9*h) + 1)/20 + 1)
    F_adh = Piecewise((2*pi*L*Pi0*R*(8*2**(1/4)*L**(5/4)/(5*h**(5/4)) - 48/35 + 2**(1/4)*h**(7/4)/(7*L**(7/4))), h < 2*L), (0, True))
    sliding = pi*R*eta*(8/5 - 12*size_ratio/5)*log(R/h + 1) + pi*eta*Piecewise((-9*R/(4*(1/h + 1/R)) + a**2, delta >= 0), (9*R*(-1 + 4*a**2*(1/h + 1/R)/(9*R))/(4*(3 + 4*a**2*(1/h + 1/R)/(3*R))*(1/h + 1/R)), True))/h
    coupling = 3*pi*R**2*eta*log(R/h + 1)/5
    rolling = 3*pi*R**3*eta*log(R/h + 1)/5
    k_t = 2*E*Piecewise((a, delta >= 0), (18*sqrt(R)/(sqrt(1/h + 1/R)*(9*R/(4*a**2*(1/h + 1/R)) + 11)), True))/((2 - nu)*(nu + 1))
    drag translation = 6*pi*R*eta
    drag rotation = 8*pi*R**3*eta
Operations, 1929 in all:
    iteration: 130 add, 312 mul, 52 div, 16 sqrt, 2 call
    tangent: 195 add, 483 mul, 71 div, 20 sqrt, 3 call
    state: 97 add, 270 mul, 40 div, 16 sqrt, 3 call
    elastic: 16 add, 46 mul, 8 div, 4 sqrt
    weight: 3 add, 11 mul, 1 div
    side: 25 add, 67 mul, 20 div, 9 sqrt, 2 call
    drag: 7 mul

Functions: steric_contacts, steric_state, steric_energy.
p holds E, eta, L, Pi0, nu, undragged_p1; q holds R, size_ratio of each contact.
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
def steric_contacts(n: int, s: float, reach: float, overlaps: array, start: array, target: array, p: array, q: array, y: array, gap: array, force: array, slope: array, more: array) -> int:
    """Solve y = target + s dy/dt for the gap of each of n contacts, y = (h/g - g/h)/2, at fixed distances of the centres.

    overlaps: sum of the radii less the distance; start: g; y: a guess, then the solution. gap, force, slope: h, F and
    dF/dr along the solution; the force is nan where there is none. Returns how many contacts have none.
    more[k*n + i] is quantity k of contact i: keep, keep_r, stiff, stiff_r, roll, roll_r, lever, lever_r.
    """
    E = p[0]
    eta = p[1]
    own_L = p[2]
    own_Pi0 = p[3]
    own_nu = p[4]
    undragged_p1 = p[5]
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
            R = q_lane[0 + k]
            size_ratio = q_lane[16 + k]
            x0 = 1.0 / R
            x1 = 1.0 / h
            x2 = x0 + x1
            x2_p2 = x2 * x2
            x4 = 1.0 / x2_p2
            a = sqrt(R * (5.0 * x4 * (x0 / 4.0 + x1 / 4.0) + 1.0 / x2))
            x5 = x1 * R
            x7 = x5 / 2.0
            x8 = x7 + 1.0
            x6 = _lane_log1p((20.0 / 9.0) * x5)
            x9 = 0.45 * x6 + x8
            x10 = size_ratio + 0.2
            size_ratio_p2 = size_ratio * size_ratio
            size_ratio_p4 = size_ratio_p2 * size_ratio_p2
            size_ratio_p8 = size_ratio_p4 * size_ratio_p4
            x12 = 65536.0 * size_ratio_p8
            x13 = 4.0 * size_ratio * R * (4.0 - (4.0 / 9.0) * x10 * (1048576.0 * size_ratio_p8 + 4.0)) / (R * (22.0 - 68.0 * size_ratio) + 16.0 * size_ratio * h) + x10 * (x12 * x6 + (1.0 - x12) * _lane_log1p((4.0 / 9.0) * x5))
            of_radii = (x13 + x8) / x9
            excess = x13 + x7
            R_p2 = R * R
            R_p3 = R_p2 * R
            R_p6 = R_p3 * R_p3
            a_p2 = a * a
            a_p4 = a_p2 * a_p2
            a_p3 = a_p2 * a
            a_p6 = a_p3 * a_p3
            a_p12 = a_p6 * a_p6
            x2_p3 = x2_p2 * x2
            x2_p6 = x2_p3 * x2_p3
            zeta = 100.53096491487338 * x0 * x9 * eta * of_radii * x2_p2 * a_p4 * (excess + undragged_p1) / ((excess + 1.0) * (3762.643798828125 * R_p6 / (x2_p6 * a_p12) + 106.3125 * x4 * R_p2 / a_p4 + 4.0))
            x15 = 1.189207115002721
            F_adh = (0.17951958020513104 * R * own_L * own_Pi0 * (5.0 * x15 * h * sqrt(h * sqrt(h)) / (own_L * sqrt(own_L * sqrt(own_L))) + 56.0 * x15 * own_L * sqrt(sqrt(own_L)) / (h * sqrt(sqrt(h))) - 48.0) if h < 2.0 * own_L else 0.0)
            x16 = 1.0 / g
            x17 = g / 2.0
            Y = x16 * h / 2.0 - x1 * x17
            h_p2 = h * h
            Y_h = x16 / 2.0 + x17 / h_p2
            side = Y - F_adh * Y_h * s / zeta - y_star
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
                x71 = 1.189207115002721
                x72 = own_L * sqrt(sqrt(own_L))
                x73 = 1.0 / (own_L * sqrt(own_L * sqrt(own_L)))
                x74 = 3.141592653589793 * R * own_Pi0
                x75 = 2.0 * own_L
                F_adh = ((2.0 / 35.0) * x74 * own_L * (5.0 * x71 * x73 * h * sqrt(h * sqrt(h)) + 56.0 * x71 * x72 / (h * sqrt(sqrt(h))) - 48.0) if h < x75 else 0.0)
                delta_p2 = delta * delta
                x79 = x62 * delta_p2
                x80 = delta * x51
                x81 = delta_p2 * R_p2
                x77 = x11 * h_p2
                x82 = delta_p2 * h_p2
                x83 = 3.0 * x68 + 8.0 * x77 + 4.0 * x79 + 8.0 * x80 + 2.0 * x81 + 2.0 * x82
                x84 = 1.0 / a
                x85 = 2.0 * x62
                x86 = delta * x44
                x120 = x85 + x86
                x120_p2 = x120 * x120
                x87 = 1.0 / x120_p2
                x88 = x84 * x87
                x89 = 5.0 * a_p2
                x90 = h * a_p2
                x91 = 1.0 / (x62 - x86)
                x92 = x10 * x91 / x13
                dF_ddelta = x14 * (x11 * x83 * x88 / 3.0 + x9 if delta >= 0.0 else (2.0 / 15.0) * x92 * (x59 * x90 + 12.0 * x79 + 12.0 * x81 - delta * x89 * h - x11 * x89 - 12.0 * x80))
                x44_p2 = x44 * x44
                x93 = 1.0 / x44_p2
                x94 = 9.0 * h
                x95 = delta * x94 * R_p2 + x85 * delta_p2 + 9.0 * x68 + 9.0 * x77 + x81 + x82
                x96 = 1.0 / x44
                x97 = x1 * x96
                x98 = x97 * R * (x62 - x44 * x6)
                dF_dh = (2.0 / 3.0) * x15 * (x88 * x93 * x95 * R_p3 if delta >= 0.0 else x92 * x98 * a_p2)
                x99 = 20.0 * R
                x101 = R_p4 * h_p2
                a_p8 = a_p4 * a_p4
                x44_p4 = x44_p2 * x44_p2
                x100 = x44_p4 * a_p8
                R_p8 = R_p4 * R_p4
                R_p12 = R_p6 * R_p6
                h_p4 = h_p2 * h_p2
                h_p6 = h_p3 * h_p3
                x44_p3 = x44_p2 * x44
                x44_p6 = x44_p3 * x44_p3
                x102 = 243.0 * (190269.0 * R_p8 * h_p4 + 1792.0 * x100) / (15411789.0 * R_p12 * h_p6 + 16384.0 * x44_p6 * a_p12 + 435456.0 * x100 * x101)
                x103 = 1.0 / a_p2
                x104 = x101 * x102 + 1.0
                x105 = x94 + x99
                x106 = 1.0 / x70
                x107 = 116.0 * a_p2
                x108 = x44 * a
                x109 = 440.0 * a_p4
                x110 = a * (8.0 * x106 * x108 * (x107 * R + x107 * h - 81.0 * x51) + x84 - 48.0 * x108 * x58 * (x109 * R_p2 + x109 * h_p2 + 621.0 * x101 + 880.0 * x63 - 1146.0 * x68 * a_p2 - 1146.0 * x67))
                log_zeta_h = excess_h * x39 * (1.0 - undragged_p1) / x38 + of_radii_h + (2.0 * R * (x103 * x104 * x87 * x93 * x95 * R_p2 - x102 * x96 * h * R_p4 - 5.0 * x33 * (1.0 + 18.0 / (x1 * x99 + 9.0)) / (x1 * x59 + x60 + 20.0) - x97) if delta >= 0.0 else 2.0 * x106 * (x64 * R + x64 * h + x65 * h - x51 * x69 - 324.0 * x66) + x110 * x91 * x98 + x96 + (220.0 * R + 180.0 * h + x105 * x60) / (x105 * x61) - x1 - 3.0 * x58 * (19872.0 * x90 * R_p5 + x47 * R_p2 + 14080.0 * x62 * a_p6 + x47 * h_p2 + x49 * h_p2 + x101 * x56 - 36672.0 * x55 * h - 9168.0 * x53 - x54 * x68))
                log_zeta_delta = (x103 * x104 * x83 * x87 * R if delta >= 0.0 else x110 / x8)
                remote_h = (x71 * x74 * x75 * (x73 * sqrt(h * sqrt(h)) / 4.0 - 2.0 * x72 / (h_p2 * sqrt(sqrt(h)))) if h < x75 else 0.0)
                remote_delta = 0.0
                x111 = 1.0 / reach
                fading = x111 * (2.0 * reach - 2.0 * h)
                started = (1.0 if 1.0 < fading else fading)
                ahead = (0.0 if 0.0 > started else started)
                x113 = 3.0 - 2.0 * ahead
                ahead_p2 = ahead * ahead
                w = x113 * ahead_p2
                w_h = -2.0 * x111 * (2.0 * x113 * ahead - 2.0 * ahead_p2)
                film = (w if pressed > 0.0 else 1.0)
                film_h = (w_h if pressed > 0.0 else 0.0)
                x115 = 1.0 / g
                x116 = g / 2.0
                Y = x115 * h / 2.0 - x1 * x116
                Y_h = x115 / 2.0 + x116 * x33
                Y_hh = -g / h_p3
                x117 = 1.0 / zeta
                rho = -x117 * (F_adh * film - F_ela)
                rho_h = x117 * (dF_ddelta / 2.0 + dF_dh - F_adh * film_h - film * (remote_delta / 2.0 + remote_h)) - rho * (log_zeta_delta / 2.0 + log_zeta_h)
                x118 = rho * s
                x119 = Y - y_star
                H = x118 * Y_h + x119 * film
                H_h = film * Y_h + rho_h * Y_h * s + Y_hh * x118 + film_h * x119
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
            x78 = 1.189207115002721
            x79 = own_L * sqrt(sqrt(own_L))
            x80 = 1.0 / (own_L * sqrt(own_L * sqrt(own_L)))
            x81 = 3.141592653589793 * R * own_Pi0
            x82 = 2.0 * own_L
            F_adh = ((2.0 / 35.0) * x81 * own_L * (5.0 * x78 * x80 * h * sqrt(h * sqrt(h)) + 56.0 * x78 * x79 / (h * sqrt(sqrt(h))) - 48.0) if h < x82 else 0.0)
            delta_p2 = delta * delta
            x86 = x66 * delta_p2
            x87 = delta * x54
            x88 = delta_p2 * R_p2
            x84 = x12 * h_p2
            x89 = delta_p2 * h_p2
            x90 = 3.0 * x72 + 8.0 * x84 + 4.0 * x86 + 8.0 * x87 + 2.0 * x88 + 2.0 * x89
            x91 = 1.0 / a
            x92 = 2.0 * x66
            x93 = delta * x75
            x168 = x92 + x93
            x168_p2 = x168 * x168
            x94 = 1.0 / x168_p2
            x95 = x91 * x94
            x96 = 5.0 * a_p2
            x97 = h * a_p2
            x98 = 1.0 / (x66 - x93)
            x99 = x11 * x98 / x14
            dF_ddelta = x15 * (x10 + x12 * x90 * x95 / 3.0 if delta >= 0.0 else (2.0 / 15.0) * x99 * (x62 * x97 + 12.0 * x86 + 12.0 * x88 - delta * x96 * h - x12 * x96 - 12.0 * x87))
            x75_p2 = x75 * x75
            x100 = 1.0 / x75_p2
            x101 = 9.0 * h
            x102 = x101 * R_p2
            x103 = x92 * delta_p2 + delta * x102 + 9.0 * x72 + 9.0 * x84 + x88 + x89
            x104 = x100 * x103 * x95 * R_p3
            x105 = 1.0 / x75
            x106 = x105 * x2
            x107 = x106 * R * (x66 - x7 * x75)
            dF_dh = (2.0 / 3.0) * x16 * (x104 if delta >= 0.0 else x107 * x99 * a_p2)
            x108 = 20.0 * R
            x109 = h * R_p4
            x111 = R_p4 * h_p2
            a_p8 = a_p4 * a_p4
            x75_p4 = x75_p2 * x75_p2
            x110 = x75_p4 * a_p8
            R_p8 = R_p4 * R_p4
            R_p12 = R_p6 * R_p6
            h_p4 = h_p2 * h_p2
            h_p6 = h_p3 * h_p3
            x75_p3 = x75_p2 * x75
            x75_p6 = x75_p3 * x75_p3
            x112 = 243.0 * (190269.0 * R_p8 * h_p4 + 1792.0 * x110) / (15411789.0 * R_p12 * h_p6 + 16384.0 * x75_p6 * a_p12 + 435456.0 * x110 * x111)
            x113 = 1.0 / a_p2
            x114 = x111 * x112 + 1.0
            x115 = x101 + x108
            x116 = 1.0 / x74
            x117 = h * R_p3
            x118 = 116.0 * a_p2
            x119 = x75 * a
            x120 = 440.0 * a_p4
            x121 = 8.0 * x116 * x119 * (x118 * R + x118 * h - 81.0 * x54) + x91 - 48.0 * x119 * x61 * (x120 * R_p2 + x120 * h_p2 + 621.0 * x111 + 880.0 * x67 - 1146.0 * x72 * a_p2 - 1146.0 * x71)
            x122 = x107 * x98 * a
            log_zeta_h = excess_h * x41 * (1.0 - undragged_p1) / x42 + of_radii_h + (2.0 * R * (x100 * x103 * x113 * x114 * x94 * R_p2 - x105 * x109 * x112 - x106 - 5.0 * x36 * (1.0 + 18.0 / (x108 * x2 + 9.0)) / (x2 * x62 + x64 + 20.0)) if delta >= 0.0 else x105 + 2.0 * x116 * (x68 * R + x68 * h + x69 * h - x54 * x73 - 324.0 * x70) + x121 * x122 + (220.0 * R + 180.0 * h + x115 * x64) / (x115 * x65) - x2 - 3.0 * x61 * (19872.0 * x97 * R_p5 + x49 * R_p2 + 14080.0 * x66 * a_p6 + x49 * h_p2 + x51 * h_p2 + x111 * x58 - 36672.0 * x117 * a_p4 - 9168.0 * x56 - x57 * x72))
            x123 = x90 * R
            x124 = a / x9
            log_zeta_delta = (x113 * x114 * x123 * x94 if delta >= 0.0 else x121 * x124)
            remote_h = (x78 * x81 * x82 * (x80 * sqrt(h * sqrt(h)) / 4.0 - 2.0 * x79 / (h_p2 * sqrt(sqrt(h)))) if h < x82 else 0.0)
            remote_delta = 0.0
            x125 = 1.0 / reach
            fading = x125 * (2.0 * reach - 2.0 * h)
            started = (1.0 if 1.0 < fading else fading)
            ahead = (0.0 if 0.0 > started else started)
            x127 = 3.0 - 2.0 * ahead
            ahead_p2 = ahead * ahead
            w = x127 * ahead_p2
            w_h = -2.0 * x125 * (2.0 * x127 * ahead - 2.0 * ahead_p2)
            film = (w if pressed > 0.0 else 1.0)
            film_h = (w_h if pressed > 0.0 else 0.0)
            grip = (1.0 if pressed > 0.0 else w)
            grip_h = (0.0 if pressed > 0.0 else w_h)
            x129 = 1.0 / g
            x130 = g / 2.0
            Y = x129 * h / 2.0 - x130 * x2
            Y_h = x129 / 2.0 + x130 * x36
            Y_hh = -g / h_p3
            x131 = 1.0 / zeta
            rho = -x131 * (F_adh * film - F_ela)
            x132 = log_zeta_delta / 2.0
            x133 = dF_ddelta / 2.0
            rho_h = x131 * (dF_dh + x133 - F_adh * film_h - film * (remote_delta / 2.0 + remote_h)) - rho * (log_zeta_h + x132)
            rho_r = rho * x132 - x131 * (dF_ddelta - remote_delta * film) / 2.0
            x134 = Y_h * s
            H_h = film * Y_h + Y_hh * rho * s + film_h * (Y - y_star) + rho_h * x134
            H_r = rho_r * x134
            h_r = -H_r / H_h
            F = F_ela * grip
            F_r = F_ela * grip_h * h_r + grip * (h_r * (dF_dh + x133) - x133)
            a_h = (x104 if delta >= 0.0 else x122) / 2.0
            a_delta = (x123 * x95 / 4.0 if delta >= 0.0 else x124 / 2.0)
            x135 = _lane_log1p(x17)
            x136 = 32.0 * x135
            x137 = 48.0 * size_ratio
            x138 = 48.0 * x29
            x139 = x135 * R_p2
            x140 = 4.0 * a_p2
            x141 = x102 + x140 * x75
            x142 = x66 * a_p2
            x143 = R_p2 * a_p2
            x144 = 288.0 * x135
            x145 = 432.0 * x135
            x146 = 128.0 * x135
            x147 = x135 * size_ratio
            x148 = 192.0 * x147
            sliding = x105 * x77 * (x2 * (x108 * a_p2 + x63 * a_p2 + x136 * x53 + x136 * x54 - x135 * x137 * x53 - x138 * x139 - 45.0 * x54) if delta >= 0.0 else R * (x117 * x144 + 256.0 * x135 * x142 + 60.0 * x142 + x143 * x146 + 60.0 * x143 + x144 * x72 + x146 * x60 - x145 * x29 * R_p3 - x145 * x72 * size_ratio - 135.0 * x117 - 384.0 * x142 * x147 - x143 * x148 - x148 * x60) / x141) / 20.0
            x149 = 0.6 * x77
            coupling = x139 * x149
            x150 = x149 * R_p3
            rolling = x135 * x150
            x151 = x4 * R
            x152 = E / ((own_nu + 1.0) * (2.0 - own_nu))
            k_t = x152 * (2.0 * a if delta >= 0.0 else 36.0 * x0 / ((2.25 * x113 * x151 + 11.0) * sqrt(x3)))
            x153 = a_h * h_p3
            x154 = 40.0 * a
            x155 = 4.0 * x1 * x3 * a_p2 - 9.0
            x156 = 1.0 / (x1 * x140 * x3 + 9.0)
            x157 = x155 * x156
            sliding_h = x77 * (x100 * x36 * (x138 * R_p3 + 80.0 * a_h * x53 * a + a_h * x154 * x54 + x137 * x72 + x153 * x154 + 13.0 * x72 - 32.0 * x117 - 40.0 * x142 - 20.0 * x143 - 20.0 * x60) / 20.0 if delta >= 0.0 else x2 * (6.0 * a_h * x156 * a * (1.0 - x157) + 0.75 * x156 * x36 * x4 * (x140 * x157 + x151 * x155 - x140) - 0.8 * x2 * R_p2 * (2.0 - 3.0 * size_ratio) / (x17 + 1.0) - 0.75 * x157 * x17 * x4))
            coupling_h = -x106 * x150
            rolling_h = -x106 * x149 * R_p4
            x158 = sqrt(x75)
            x159 = 44.0 * a_p3
            x169 = x102 + 44.0 * x76
            x169_p2 = x169 * x169
            x160 = a / x169_p2
            k_t_h = x152 * (2.0 * a_h if delta >= 0.0 else 72.0 * x160 * R_p2 * (36.0 * x153 * R + x159 * R + 36.0 * a_h * x72 + x159 * h - x102 * a) / (x158 * sqrt(h)))
            x141_p2 = x141 * x141
            sliding_delta = a_delta * x77 * a * (2.0 * x2 if delta >= 0.0 else 108.0 * x109 / x141_p2)
            coupling_delta = 0.0
            rolling_delta = 0.0
            k_t_delta = a_delta * x152 * (2.0 if delta >= 0.0 else 2592.0 * x158 * x160 * R_p3 * h * sqrt(h))
            friction_t = w * sliding
            x161 = friction_t + k_t * s
            keep = friction_t / x161
            stiff = keep * k_t
            x162 = 1.0 / sliding
            x163 = 1.0 - x31
            coupling_p2 = coupling * coupling
            x164 = rolling - x162 * x163 * coupling_p2
            roll = x164 * w
            lever = coupling * x162
            x165 = h_r / 2.0 - 0.5
            sliding_r = h_r * sliding_h + sliding_delta * x165
            coupling_r = coupling_delta * x165 + coupling_h * h_r
            rolling_r = h_r * rolling_h + rolling_delta * x165
            k_t_r = h_r * k_t_h + k_t_delta * x165
            x166 = h_r * w_h
            friction_t_r = x166 * sliding + sliding_r * w
            x161_p2 = x161 * x161
            keep_r = s * (friction_t_r * k_t - k_t_r * friction_t) / x161_p2
            stiff_r = keep_r * k_t + k_t_r * keep
            x167 = -lever * sliding_r
            lever_r = x162 * (coupling_r + x167)
            roll_r = w * (rolling_r - lever * x163 * (2.0 * coupling_r + x167)) + x164 * x166
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
def steric_state(n: int, reach: float, overlaps: array, gap: array, p: array, q: array, out: array) -> None:
    """delta, a, F, friction, remote, C, dF_dh, dh_dt, F_by_gap, F_by_distance, friction_t, roll, k_t, k_t_h, k_t_delta of n contacts: out[k*n + i] is quantity k of contact i."""
    E = p[0]
    eta = p[1]
    own_L = p[2]
    own_Pi0 = p[3]
    own_nu = p[4]
    undragged_p1 = p[5]
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
        x53 = 1.189207115002721
        F_adh = (0.17951958020513104 * R * own_L * own_Pi0 * (5.0 * x53 * h * sqrt(h * sqrt(h)) / (own_L * sqrt(own_L * sqrt(own_L))) + 56.0 * x53 * own_L * sqrt(sqrt(own_L)) / (h * sqrt(sqrt(h))) - 48.0) if h < 2.0 * own_L else 0.0)
        delta_p2 = delta * delta
        x56 = x45 * delta_p2
        x57 = delta * x38
        x58 = delta_p2 * R_p2
        x54 = x12 * h_p2
        x59 = delta_p2 * h_p2
        x60 = 2.0 * x45
        x61 = delta * x50
        x93 = x60 + x61
        x93_p2 = x93 * x93
        x62 = 1.0 / (x93_p2 * a)
        x63 = x62 * (3.0 * x49 + 8.0 * x54 + 4.0 * x56 + 8.0 * x57 + 2.0 * x58 + 2.0 * x59)
        x64 = 5.0 * a_p2
        x65 = 1.0 / (x45 - x61)
        x66 = x11 * x65 / x14
        dF_ddelta = x15 * (x10 + x12 * x63 / 3.0 if delta >= 0.0 else (2.0 / 15.0) * x66 * (x42 * h * a_p2 + 12.0 * x56 + 12.0 * x58 - delta * x64 * h - x12 * x64 - 12.0 * x57))
        x67 = x44 * R_p2
        x50_p2 = x50 * x50
        x68 = x62 * R_p3 * (x60 * delta_p2 + delta * x67 + 9.0 * x49 + 9.0 * x54 + x58 + x59) / x50_p2
        x69 = 1.0 / x50
        x70 = x17 * x69 * (x45 - x50 * x8)
        dF_dh = (2.0 / 3.0) * x16 * (x68 if delta >= 0.0 else x66 * x70 * a_p2)
        x71 = dF_ddelta / 2.0
        C = x71
        x72 = 1.0 / reach
        fading = x72 * (2.0 * reach - 2.0 * h)
        started = (1.0 if 1.0 < fading else fading)
        ahead = (0.0 if 0.0 > started else started)
        x74 = 3.0 - 2.0 * ahead
        ahead_p2 = ahead * ahead
        w = x74 * ahead_p2
        w_h = -2.0 * x72 * (2.0 * x74 * ahead - 2.0 * ahead_p2)
        film = (w if pressed > 0.0 else 1.0)
        grip = (1.0 if pressed > 0.0 else w)
        grip_h = (0.0 if pressed > 0.0 else w_h)
        rho = -(F_adh * film - F_ela) / zeta
        F = F_ela * grip
        F_by_gap = F_ela * grip_h + grip * (dF_dh + x71)
        F_by_distance = -x71 * grip
        friction = w * zeta
        remote = F_adh * w
        dh_dt = -rho / film
        a_h = (x68 if delta >= 0.0 else x65 * x70 * a) / 2.0
        a_delta = (x63 * R / 4.0 if delta >= 0.0 else a / (2.0 * x9))
        x76 = _lane_log1p(x17)
        x77 = 32.0 * x76
        x78 = x76 * size_ratio
        x79 = x76 * R_p2
        x80 = 60.0 * a_p2
        x81 = 288.0 * x76
        x82 = x45 * a_p2
        x83 = x76 * R_p3
        x84 = 128.0 * a_p2
        x85 = x76 * h_p2
        x86 = 192.0 * size_ratio * a_p2
        sliding = x52 * x69 * (x3 * (20.0 * R * a_p2 + x43 * a_p2 + x37 * x77 + x38 * x77 - 48.0 * x25 * x79 - 48.0 * x37 * x78 - 45.0 * x38) if delta >= 0.0 else R * (x80 * R_p2 + x45 * x80 + x47 * x81 + x49 * x81 + 256.0 * x76 * x82 + x79 * x84 + x84 * x85 - 432.0 * x25 * x83 - 135.0 * x47 - 432.0 * x49 * x78 - 384.0 * x78 * x82 - x79 * x86 - x85 * x86) / (4.0 * x51 + x67)) / 20.0
        x87 = 0.6 * x52
        coupling = x79 * x87
        rolling = x83 * x87
        x88 = E / ((own_nu + 1.0) * (2.0 - own_nu))
        k_t = x88 * (2.0 * a if delta >= 0.0 else 36.0 * x1 / ((2.25 * x5 * R / a_p2 + 11.0) * sqrt(x4)))
        x89 = sqrt(x50)
        x90 = 44.0 * a_p3
        x91 = 36.0 * a_h
        x94 = 44.0 * x51 + x67
        x94_p2 = x94 * x94
        x92 = a / x94_p2
        k_t_h = x88 * (2.0 * a_h if delta >= 0.0 else 72.0 * x92 * R_p2 * (x91 * R * h_p3 + x90 * R + x90 * h + x49 * x91 - x67 * a) / (x89 * sqrt(h)))
        k_t_delta = a_delta * x88 * (2.0 if delta >= 0.0 else 2592.0 * x89 * x92 * R_p3 * h * sqrt(h))
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
def steric_energy(n: int, reach: float, overlaps: array, gap: array, p: array, q: array, points: int, nodes: array, weights: array, out: array) -> None:
    """Stored energy grip U and its slope in h at fixed delta, of n contacts: out[i] and out[n + i].

    U = integral of 2 F_ela(a(h, d), d) dd from 0 to delta, by quadrature over the fractions nodes of delta.
    """
    E = p[0]
    own_nu = p[4]
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
def steric_drag(n: int, p: array, q: array, out: array) -> None:
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
