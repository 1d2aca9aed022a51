"""Contact law steric: written by softdyn 0.1.0 with sympy 1.14.0; do not edit.

Source: Alexander 1977; de Gennes, Adv. Colloid Interface Sci. 27 (1987) 189; equal_spheres
Law 8934d7f84e49ea39, cf5d87a34f5fdf67:
    a = sqrt(R)*sqrt(Abs(delta) + 1/(1/h + 1/R) + 5/((1/h + 1/R)**2*(2*Abs(delta) + 4/(1/h + 1/R))))
    F_ela = 4*E*a*delta/(3*(1 - nu**2))
    zeta = 8*pi*a**4*eta*(1/h + 1/R)**2*(R/(2*h) + 9*log(20*R/(9*h) + 1)/20 + 1)/(R*(18225*R**3/(128*a**6*(1/h + 1/R)**3) + 1))
    F_adh = Piecewise((2*pi*L*Pi0*R*(8*2**(1/4)*L**(5/4)/(5*h**(5/4)) - 48/35 + 2**(1/4)*h**(7/4)/(7*L**(7/4))), h < 2*L), (0, True))
    sliding = pi*R*eta*(8/5 - 12*size_ratio/5)*log(R/h + 1) + pi*eta*(-9*R/(4*(1/h + 1/R)) + a**2)/h
    coupling = 3*pi*R**2*eta*log(R/h + 1)/5
    rolling = 3*pi*R**3*eta*log(R/h + 1)/5
    k_t = 2*E*a/((2 - nu)*(nu + 1))
    drag translation = 6*pi*R*eta
    drag rotation = 8*pi*R**3*eta
Operations, 1003 in all:
    iteration: 54 add, 158 mul, 36 div, 13 sqrt, 1 call
    tangent: 90 add, 249 mul, 47 div, 13 sqrt, 2 call
    state: 37 add, 115 mul, 24 div, 9 sqrt, 2 call
    elastic: 12 add, 33 mul, 6 div, 1 sqrt
    weight: 3 add, 11 mul, 1 div
    side: 12 add, 40 mul, 17 div, 9 sqrt, 1 call
    drag: 7 mul

Functions: steric_contacts, steric_state, steric_energy.
p holds E, eta, L, Pi0, nu; q holds R, size_ratio of each contact.
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
            x0 = 1.0 / R
            x1 = 1.0 / h
            x2 = x0 + x1
            x2_p2 = x2 * x2
            a = sqrt(R * (1.0 / x2 + 5.0 * (x0 / 4.0 + x1 / 4.0) / x2_p2))
            x4 = x1 * R
            R_p2 = R * R
            R_p3 = R_p2 * R
            a_p2 = a * a
            a_p4 = a_p2 * a_p2
            a_p3 = a_p2 * a
            a_p6 = a_p3 * a_p3
            x2_p3 = x2_p2 * x2
            zeta = 25.132741228718345 * x0 * eta * x2_p2 * a_p4 * (x4 / 2.0 + 0.45 * _lane_log1p((20.0 / 9.0) * x4) + 1.0) / (142.3828125 * R_p3 / (x2_p3 * a_p6) + 1.0)
            x5 = 1.189207115002721
            F_adh = (0.17951958020513104 * R * own_L * own_Pi0 * (5.0 * x5 * h * sqrt(h * sqrt(h)) / (own_L * sqrt(own_L * sqrt(own_L))) + 56.0 * x5 * own_L * sqrt(sqrt(own_L)) / (h * sqrt(sqrt(h))) - 48.0) if h < 2.0 * own_L else 0.0)
            x6 = 1.0 / g
            x7 = g / 2.0
            Y = x6 * h / 2.0 - x1 * x7
            h_p2 = h * h
            Y_h = x6 / 2.0 + x7 / h_p2
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
                delta = h / 2.0 + overlap / 2.0
                x0 = fabs(delta)
                x1 = 1.0 / R
                x2 = 1.0 / h
                x3 = x1 + x2
                x4 = 1.0 / x3
                x3_p2 = x3 * x3
                x6 = 1.0 / x3_p2
                a = sqrt(R * (x0 + x4 + 5.0 * x6 / (2.0 * x0 + 4.0 * x4)))
                own_nu_p2 = own_nu * own_nu
                x7 = E / (1.0 - own_nu_p2)
                x8 = delta * x7
                F_ela = (4.0 / 3.0) * x8 * a
                R_p2 = R * R
                R_p3 = R_p2 * R
                a_p2 = a * a
                a_p3 = a_p2 * a
                a_p6 = a_p3 * a_p3
                x3_p3 = x3_p2 * x3
                x11 = R_p3 / (x3_p3 * a_p6)
                x12 = 142.3828125 * x11 + 1.0
                x13 = x2 * R
                x14 = _lane_log1p((20.0 / 9.0) * x13)
                x15 = x13 / 2.0 + 0.45 * x14 + 1.0
                a_p4 = a_p2 * a_p2
                x17 = x3_p2 * a_p4
                zeta = 25.132741228718345 * x1 * x15 * x17 * eta / x12
                x18 = 1.189207115002721
                x19 = own_L * sqrt(sqrt(own_L))
                x20 = 1.0 / (own_L * sqrt(own_L * sqrt(own_L)))
                x21 = 3.141592653589793 * R * own_Pi0
                x22 = 2.0 * own_L
                F_adh = ((2.0 / 35.0) * x21 * own_L * (5.0 * x18 * x20 * h * sqrt(h * sqrt(h)) + 56.0 * x18 * x19 / (h * sqrt(sqrt(h))) - 48.0) if h < x22 else 0.0)
                x24 = 2.0 * h
                x25 = x24 * R
                x26 = R + h
                x62 = x0 * x26 + x25
                x62_p2 = x62 * x62
                x27 = 1.0 / x62_p2
                x28 = x27 / a
                delta_p2 = delta * delta
                x31 = delta_p2 * R_p2
                h_p2 = h * h
                x33 = R_p2 * h_p2
                x34 = delta_p2 * h_p2
                x35 = 8.0 * x0
                x36 = R * h_p2
                x37 = h * R_p2
                x38 = R * (4.0 * R * h * delta_p2 + 2.0 * x31 + 3.0 * x33 + 2.0 * x34 + x35 * x36 + x35 * x37)
                dF_ddelta = x7 * (4.0 * a + x0 * x28 * x38) / 3.0
                x39 = 9.0 * x0
                x40 = x25 * delta_p2 + x31 + 9.0 * x33 + x34 + x36 * x39 + x37 * x39
                x26_p2 = x26 * x26
                dF_dh = (2.0 / 3.0) * x28 * x40 * x8 * R_p3 / x26_p2
                x41 = 1.0 / h_p2
                R_p6 = R_p3 * R_p3
                h_p3 = h_p2 * h
                x44 = R_p6 * h_p3
                x26_p3 = x26_p2 * x26
                x45 = x26_p3 * a_p6
                x46 = 18225.0 * x44 + 128.0 * x45
                x47 = 10.0 * R
                x48 = 9.0 * x14
                x49 = x27 * (91125.0 * x44 + 256.0 * x45)
                x50 = 1.0 / (18225.0 * x11 + 128.0)
                x51 = x2 * x47 + x48 + 20.0
                x52 = 1.0 / a_p2
                a_p8 = a_p4 * a_p4
                x46_p2 = x46 * x46
                log_zeta_h = 6.4 * x12 * x41 * x6 * R * (x2 * x40 * x49 * x26_p3 * a_p8 * (x48 * h + 20.0 * h + x47) / x46_p2 - x50 * (54675.0 * x50 * x51 * x52 * x6 * R_p2 + 2.0 * x1 * x3 * x51 * a_p4 + 10.0 * x17 * (1.0 + 18.0 / (20.0 * x13 + 9.0)))) / (x15 * a_p4)
                log_zeta_delta = x38 * x49 * x52 * (1.0 if delta > 0.0 else (-1.0 if delta < 0.0 else 0.0)) / (2.0 * x46)
                remote_h = (x18 * x21 * x22 * (x20 * sqrt(h * sqrt(h)) / 4.0 - 2.0 * x19 / (h_p2 * sqrt(sqrt(h)))) if h < x22 else 0.0)
                remote_delta = 0.0
                x53 = 1.0 / reach
                fading = x53 * (2.0 * reach - x24)
                started = (1.0 if 1.0 < fading else fading)
                ahead = (0.0 if 0.0 > started else started)
                x55 = 3.0 - 2.0 * ahead
                ahead_p2 = ahead * ahead
                w = x55 * ahead_p2
                w_h = -2.0 * x53 * (2.0 * x55 * ahead - 2.0 * ahead_p2)
                film = (w if pressed > 0.0 else 1.0)
                film_h = (w_h if pressed > 0.0 else 0.0)
                x57 = 1.0 / g
                x58 = g / 2.0
                Y = x57 * h / 2.0 - x2 * x58
                Y_h = x41 * x58 + x57 / 2.0
                Y_hh = -g / h_p3
                x59 = 1.0 / zeta
                rho = x59 * (F_ela - F_adh * film)
                rho_h = x59 * (dF_ddelta / 2.0 + dF_dh - F_adh * film_h - film * (remote_delta / 2.0 + remote_h)) - rho * (log_zeta_delta / 2.0 + log_zeta_h)
                x60 = rho * s
                x61 = Y - y_star
                H = x60 * Y_h + x61 * film
                H_h = film * Y_h + rho_h * Y_h * s + Y_hh * x60 + film_h * x61
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
            x0 = fabs(delta)
            x1 = 1.0 / R
            x2 = 1.0 / h
            x3 = x1 + x2
            x4 = 1.0 / x3
            x3_p2 = x3 * x3
            x6 = 1.0 / x3_p2
            a = sqrt(R * (x0 + x4 + 5.0 * x6 / (2.0 * x0 + 4.0 * x4)))
            own_nu_p2 = own_nu * own_nu
            x7 = E / (1.0 - own_nu_p2)
            x8 = delta * x7
            F_ela = (4.0 / 3.0) * x8 * a
            R_p2 = R * R
            R_p3 = R_p2 * R
            a_p2 = a * a
            a_p3 = a_p2 * a
            a_p6 = a_p3 * a_p3
            x3_p3 = x3_p2 * x3
            x11 = R_p3 / (x3_p3 * a_p6)
            x12 = 142.3828125 * x11 + 1.0
            x13 = x2 * R
            x14 = _lane_log1p((20.0 / 9.0) * x13)
            x15 = x13 / 2.0 + 0.45 * x14 + 1.0
            a_p4 = a_p2 * a_p2
            x17 = x3_p2 * a_p4
            x18 = 3.141592653589793 * eta
            zeta = 8.0 * x1 * x15 * x17 * x18 / x12
            x19 = 1.189207115002721
            x20 = own_L * sqrt(sqrt(own_L))
            x21 = 1.0 / (own_L * sqrt(own_L * sqrt(own_L)))
            x22 = 3.141592653589793 * R * own_Pi0
            x23 = 2.0 * own_L
            F_adh = ((2.0 / 35.0) * x22 * own_L * (5.0 * x19 * x21 * h * sqrt(h * sqrt(h)) + 56.0 * x19 * x20 / (h * sqrt(sqrt(h))) - 48.0) if h < x23 else 0.0)
            x25 = 2.0 * h
            x26 = x25 * R
            x27 = R + h
            x94 = x0 * x27 + x26
            x94_p2 = x94 * x94
            x28 = 1.0 / x94_p2
            x29 = x28 / a
            x31 = R * h
            delta_p2 = delta * delta
            x33 = delta_p2 * R_p2
            h_p2 = h * h
            x35 = R_p2 * h_p2
            x36 = delta_p2 * h_p2
            x37 = 8.0 * x0
            x38 = R * h_p2
            x39 = h * R_p2
            x40 = R * (4.0 * x31 * delta_p2 + 2.0 * x33 + 3.0 * x35 + 2.0 * x36 + x37 * x38 + x37 * x39)
            x41 = x29 * x40
            dF_ddelta = x7 * (4.0 * a + x0 * x41) / 3.0
            x27_p2 = x27 * x27
            x42 = 1.0 / x27_p2
            x43 = 9.0 * x0
            x44 = x26 * delta_p2 + x33 + 9.0 * x35 + x36 + x38 * x43 + x39 * x43
            x45 = x29 * x42 * x44 * R_p3
            dF_dh = (2.0 / 3.0) * x45 * x8
            x46 = 1.0 / h_p2
            R_p6 = R_p3 * R_p3
            h_p3 = h_p2 * h
            x49 = R_p6 * h_p3
            x27_p3 = x27_p2 * x27
            x50 = x27_p3 * a_p6
            x51 = 18225.0 * x49 + 128.0 * x50
            x52 = 10.0 * R
            x53 = 20.0 * h
            x54 = 9.0 * x14
            x55 = x28 * (91125.0 * x49 + 256.0 * x50)
            x56 = 1.0 / (18225.0 * x11 + 128.0)
            x57 = x2 * x52 + x54 + 20.0
            x59 = 1.0 / a_p2
            a_p8 = a_p4 * a_p4
            x51_p2 = x51 * x51
            log_zeta_h = 6.4 * x12 * x46 * x6 * R * (x2 * x44 * x55 * x27_p3 * a_p8 * (x54 * h + x52 + x53) / x51_p2 - x56 * (54675.0 * x56 * x57 * x59 * x6 * R_p2 + 2.0 * x1 * x3 * x57 * a_p4 + 10.0 * x17 * (1.0 + 18.0 / (20.0 * x13 + 9.0)))) / (x15 * a_p4)
            x60 = (1.0 if delta > 0.0 else (-1.0 if delta < 0.0 else 0.0))
            log_zeta_delta = x40 * x55 * x59 * x60 / (2.0 * x51)
            remote_h = (x19 * x22 * x23 * (x21 * sqrt(h * sqrt(h)) / 4.0 - 2.0 * x20 / (h_p2 * sqrt(sqrt(h)))) if h < x23 else 0.0)
            remote_delta = 0.0
            x61 = 1.0 / reach
            fading = x61 * (2.0 * reach - x25)
            started = (1.0 if 1.0 < fading else fading)
            ahead = (0.0 if 0.0 > started else started)
            x63 = 3.0 - 2.0 * ahead
            ahead_p2 = ahead * ahead
            w = x63 * ahead_p2
            w_h = -2.0 * x61 * (2.0 * x63 * ahead - 2.0 * ahead_p2)
            film = (w if pressed > 0.0 else 1.0)
            film_h = (w_h if pressed > 0.0 else 0.0)
            grip = (1.0 if pressed > 0.0 else w)
            grip_h = (0.0 if pressed > 0.0 else w_h)
            x65 = 1.0 / g
            x66 = g / 2.0
            Y = x65 * h / 2.0 - x2 * x66
            Y_h = x46 * x66 + x65 / 2.0
            Y_hh = -g / h_p3
            x67 = 1.0 / zeta
            rho = x67 * (F_ela - F_adh * film)
            x68 = log_zeta_delta / 2.0
            x69 = dF_ddelta / 2.0
            rho_h = x67 * (dF_dh + x69 - F_adh * film_h - film * (remote_delta / 2.0 + remote_h)) - rho * (log_zeta_h + x68)
            rho_r = rho * x68 - x67 * (dF_ddelta - remote_delta * film) / 2.0
            x70 = Y_h * s
            H_h = film * Y_h + Y_hh * rho * s + film_h * (Y - y_star) + rho_h * x70
            H_r = rho_r * x70
            h_r = -H_r / H_h
            F = F_ela * grip
            F_r = F_ela * grip_h * h_r + grip * (h_r * (dF_dh + x69) - x69)
            a_h = x45 / 2.0
            a_delta = x41 * x60 / 4.0
            x71 = 20.0 * a_p2
            x72 = _lane_log1p(x13)
            x73 = 32.0 * x72
            x74 = 48.0 * size_ratio
            x75 = x72 * x74
            x76 = x18 / 20.0
            x77 = x2 / x27
            sliding = x76 * x77 * (x71 * R + x53 * a_p2 + x38 * x73 + x39 * x73 - x38 * x75 - x39 * x75 - 45.0 * x39)
            x78 = 0.6 * x18
            x79 = x72 * x78
            coupling = x79 * R_p2
            rolling = x79 * R_p3
            x80 = 2.0 * a
            x81 = E / ((own_nu + 1.0) * (2.0 - own_nu))
            k_t = x80 * x81
            x82 = h * R_p3
            x83 = a_h * a
            x84 = 40.0 * x83
            sliding_h = x42 * x46 * x76 * (x84 * h_p3 + x35 * x74 + 13.0 * x35 + 80.0 * x38 * x83 + x39 * x84 + x74 * x82 - x71 * R_p2 - 40.0 * x31 * a_p2 - x71 * h_p2 - 32.0 * x82)
            x85 = x77 * x78
            coupling_h = -x85 * R_p3
            R_p4 = R_p2 * R_p2
            rolling_h = -x85 * R_p4
            x86 = 2.0 * x81
            k_t_h = a_h * x86
            sliding_delta = a_delta * x18 * x2 * x80
            coupling_delta = 0.0
            rolling_delta = 0.0
            k_t_delta = a_delta * x86
            friction_t = w * sliding
            x87 = friction_t + k_t * s
            keep = friction_t / x87
            stiff = keep * k_t
            x88 = 1.0 / sliding
            x89 = 1.0 - 4.0 * size_ratio
            coupling_p2 = coupling * coupling
            x90 = rolling - x88 * x89 * coupling_p2
            roll = x90 * w
            lever = coupling * x88
            x91 = h_r / 2.0 - 0.5
            sliding_r = h_r * sliding_h + sliding_delta * x91
            coupling_r = coupling_delta * x91 + coupling_h * h_r
            rolling_r = h_r * rolling_h + rolling_delta * x91
            k_t_r = h_r * k_t_h + k_t_delta * x91
            x92 = h_r * w_h
            friction_t_r = x92 * sliding + sliding_r * w
            x87_p2 = x87 * x87
            keep_r = s * (friction_t_r * k_t - k_t_r * friction_t) / x87_p2
            stiff_r = keep_r * k_t + k_t_r * keep
            x93 = -lever * sliding_r
            lever_r = x88 * (coupling_r + x93)
            roll_r = w * (rolling_r - lever * x89 * (2.0 * coupling_r + x93)) + x90 * x92
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
    """delta, a, F, friction, remote, C, dF_dh, dh_dt, friction_t, roll, k_t, k_t_h, k_t_delta of n contacts: out[k*n + i] is quantity k of contact i."""
    E = p[0]
    eta = p[1]
    own_L = p[2]
    own_Pi0 = p[3]
    own_nu = p[4]
    for i in range(n):
        overlap = overlaps[i]
        h = gap[i]
        R = q[0 * n + i]
        size_ratio = q[1 * n + i]
        delta = h / 2.0 + overlap / 2.0
        pressed = (1.0 if delta >= 0.0 else 0.0)
        x0 = fabs(delta)
        x1 = 1.0 / R
        x2 = 1.0 / h
        x3 = x1 + x2
        x4 = 1.0 / x3
        x3_p2 = x3 * x3
        a = sqrt(R * (x0 + x4 + 5.0 / (x3_p2 * (2.0 * x0 + 4.0 * x4))))
        own_nu_p2 = own_nu * own_nu
        x6 = E / (1.0 - own_nu_p2)
        x7 = delta * x6
        F_ela = (4.0 / 3.0) * x7 * a
        x9 = x2 * R
        x10 = 3.141592653589793 * eta
        R_p2 = R * R
        R_p3 = R_p2 * R
        a_p2 = a * a
        a_p4 = a_p2 * a_p2
        a_p3 = a_p2 * a
        a_p6 = a_p3 * a_p3
        x3_p3 = x3_p2 * x3
        zeta = 8.0 * x1 * x10 * x3_p2 * a_p4 * (x9 / 2.0 + 0.45 * _lane_log1p((20.0 / 9.0) * x9) + 1.0) / (142.3828125 * R_p3 / (x3_p3 * a_p6) + 1.0)
        x11 = 1.189207115002721
        F_adh = (0.17951958020513104 * R * own_L * own_Pi0 * (5.0 * x11 * h * sqrt(h * sqrt(h)) / (own_L * sqrt(own_L * sqrt(own_L))) + 56.0 * x11 * own_L * sqrt(sqrt(own_L)) / (h * sqrt(sqrt(h))) - 48.0) if h < 2.0 * own_L else 0.0)
        delta_p2 = delta * delta
        x14 = delta_p2 * R_p2
        h_p2 = h * h
        x16 = R_p2 * h_p2
        x17 = delta_p2 * h_p2
        x18 = 8.0 * x0
        x19 = R * h_p2
        x20 = h * R_p2
        x21 = 2.0 * h
        x22 = x21 * R
        x23 = R + h
        x35 = x0 * x23 + x22
        x35_p2 = x35 * x35
        x24 = 1.0 / (x35_p2 * a)
        x25 = x24 * R * (4.0 * R * h * delta_p2 + 2.0 * x14 + 3.0 * x16 + 2.0 * x17 + x18 * x19 + x18 * x20)
        dF_ddelta = x6 * (4.0 * a + x0 * x25) / 3.0
        x26 = 9.0 * x0
        x23_p2 = x23 * x23
        x27 = x24 * R_p3 * (x22 * delta_p2 + x14 + 9.0 * x16 + x17 + x19 * x26 + x20 * x26) / x23_p2
        dF_dh = (2.0 / 3.0) * x27 * x7
        C = dF_ddelta / 2.0
        fading = (2.0 * reach - x21) / reach
        started = (1.0 if 1.0 < fading else fading)
        ahead = (0.0 if 0.0 > started else started)
        ahead_p2 = ahead * ahead
        w = ahead_p2 * (3.0 - 2.0 * ahead)
        film = (w if pressed > 0.0 else 1.0)
        grip = (1.0 if pressed > 0.0 else w)
        rho = (F_ela - F_adh * film) / zeta
        F = F_ela * grip
        friction = w * zeta
        remote = F_adh * w
        dh_dt = -rho / film
        a_h = x27 / 2.0
        a_delta = x25 * (1.0 if delta > 0.0 else (-1.0 if delta < 0.0 else 0.0)) / 4.0
        x29 = 20.0 * a_p2
        x30 = _lane_log1p(x9)
        x31 = 32.0 * x30
        x32 = 48.0 * x30 * size_ratio
        sliding = x10 * x2 * (x29 * R + x29 * h + x19 * x31 + x20 * x31 - x19 * x32 - x20 * x32 - 45.0 * x20) / (20.0 * x23)
        x33 = 0.6 * x10 * x30
        coupling = x33 * R_p2
        rolling = x33 * R_p3
        x34 = 2.0 * E / ((own_nu + 1.0) * (2.0 - own_nu))
        k_t = x34 * a
        k_t_h = a_h * x34
        k_t_delta = a_delta * x34
        friction_t = w * sliding
        coupling_p2 = coupling * coupling
        roll = w * (rolling - coupling_p2 * (1.0 - 4.0 * size_ratio) / sliding)
        out[0 * n + i] = delta
        out[1 * n + i] = a
        out[2 * n + i] = F
        out[3 * n + i] = friction
        out[4 * n + i] = remote
        out[5 * n + i] = C
        out[6 * n + i] = dF_dh
        out[7 * n + i] = dh_dt
        out[8 * n + i] = friction_t
        out[9 * n + i] = roll
        out[10 * n + i] = k_t
        out[11 * n + i] = k_t_h
        out[12 * n + i] = k_t_delta


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
            x0 = fabs(delta)
            x1 = 1.0 / h + 1.0 / R
            x2 = 1.0 / x1
            x1_p2 = x1 * x1
            a = sqrt(R * (x0 + x2 + 5.0 / (x1_p2 * (2.0 * x0 + 4.0 * x2))))
            own_nu_p2 = own_nu * own_nu
            x3 = delta * E / (1.0 - own_nu_p2)
            F_ela = (4.0 / 3.0) * x3 * a
            x4 = R + h
            x5 = 2.0 * R * h
            x10 = x0 * x4 + x5
            h_p2 = h * h
            x9 = 9.0 * h_p2
            R_p2 = R * R
            R_p3 = R_p2 * R
            delta_p2 = delta * delta
            x10_p2 = x10 * x10
            x4_p2 = x4 * x4
            dF_dh = (2.0 / 3.0) * x3 * R_p3 * (delta_p2 * R_p2 + 9.0 * x0 * h * R_p2 + x9 * R_p2 + x0 * x9 * R + delta_p2 * h_p2 + x5 * delta_p2) / (x10_p2 * x4_p2 * a)
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
