"""Contact law steric: written by softdyn 0.1.0 with sympy 1.14.0; do not edit.

Source: Alexander 1977; de Gennes, Adv. Colloid Interface Sci. 27 (1987) 189; equal_spheres
Law 75c5daff457f09fe:
    a = Piecewise((sqrt(R)*sqrt(delta + 1/(1/h + 1/R) + 5/((2*delta + 4/(1/h + 1/R))*(1/h + 1/R)**2)), delta >= 0), (3*sqrt(R)*sqrt(1/(-delta + 1/(1/h + 1/R)))/(2*(1/h + 1/R)), True))
    F_ela = 4*E*delta*Piecewise((a, delta >= 0), (sqrt(5)*sqrt(-4*R*delta + 5*a**2)/5, True))/(3*(1 - nu**2))
    zeta = 3*pi*R*eta*(R/(2*h) + 9*log(20*R/(9*h) + 1)/20 + 1)*Piecewise((32*a**4*(1/h + 1/R)**2/(3*R**2*(15411789*R**6/(4096*a**12*(1/h + 1/R)**6) + 1701*R**2/(16*a**4*(1/h + 1/R)**2) + 4)), delta >= 0), (1/(9*R/(4*a**2*(1/h + 1/R)) + (4455*R**2/(8*a**4*(1/h + 1/R)**2) - 495*R/(a**2*(1/h + 1/R)) + 110)/(729*R**2/(16*a**4*(1/h + 1/R)**2) - 81*R/(2*a**2*(1/h + 1/R)) + 29)), True))
    F_adh = Piecewise((2*pi*L*Pi0*R*(8*2**(1/4)*L**(5/4)/(5*h**(5/4)) - 48/35 + 2**(1/4)*h**(7/4)/(7*L**(7/4))), h < 2*L), (0, True))
Operations, 1019 in all:
    gap_terms: 2 add, 19 mul, 4 div
    newton: 20 add, 38 mul, 6 div, 4 sqrt
    gap_rate: 29 add, 93 mul, 14 div, 11 sqrt, 1 call
    slopes: 81 add, 242 mul, 38 div, 17 sqrt, 1 call
    quantities: 86 add, 252 mul, 44 div, 16 sqrt, 1 call

Functions: steric_evaluate, steric_solve_delta, steric_drive, steric_integrate, steric_passages, steric_sample, steric_runs.
p holds R, E, eta, L, Pi0, nu.
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
    x0 = 1.0 / h + 1.0 / R
    x1 = 1.0 / x0
    gap0 = x1
    x0_p2 = x0 * x0
    gap1 = 5.0 / x0_p2
    gap2 = 4.0 * x1
    gap3 = 1.5 * x1
    x2 = R * h
    gap4 = 2.0 * x2
    x3 = R + h
    gap5 = x3
    R_p2 = R * R
    h_p2 = h * h
    gap6 = 3.0 * R_p2 * h_p2
    gap7 = 2.0 * h_p2
    gap8 = 4.0 * x2
    gap9 = 8.0 * R * h_p2
    x6 = h * R_p2
    gap10 = 8.0 * x6
    gap11 = x2
    gap12 = -x3
    gap13 = -12.0 * x6
    gap14 = -5.0 * h
    gap15 = 10.0 * x2
    gap16 = 12.0 * x2
    out[0 * n + i] = gap0
    out[1 * n + i] = gap1
    out[2 * n + i] = gap2
    out[3 * n + i] = gap3
    out[4 * n + i] = gap4
    out[5 * n + i] = gap5
    out[6 * n + i] = gap6
    out[7 * n + i] = gap7
    out[8 * n + i] = gap8
    out[9 * n + i] = gap9
    out[10 * n + i] = gap10
    out[11 * n + i] = gap11
    out[12 * n + i] = gap12
    out[13 * n + i] = gap13
    out[14 * n + i] = gap14
    out[15 * n + i] = gap15
    out[16 * n + i] = gap16


@jit
def _newton(i: int, n: int, delta: float, F: float, terms: array, p: array, out: array) -> None:
    """A step of Newton's iteration for delta at a given gap: out[i] = (F_ela - F)/(dF_ela/d(delta)), out[n + i] = dF_ela/d(delta)."""
    gap0 = terms[0 * n + i]
    gap1 = terms[1 * n + i]
    gap2 = terms[2 * n + i]
    gap3 = terms[3 * n + i]
    gap4 = terms[4 * n + i]
    gap5 = terms[5 * n + i]
    gap6 = terms[6 * n + i]
    gap7 = terms[7 * n + i]
    gap8 = terms[8 * n + i]
    gap9 = terms[9 * n + i]
    gap10 = terms[10 * n + i]
    gap11 = terms[11 * n + i]
    gap12 = terms[12 * n + i]
    gap13 = terms[13 * n + i]
    gap14 = terms[14 * n + i]
    gap15 = terms[15 * n + i]
    gap16 = terms[16 * n + i]
    R = p[0]
    E = p[1]
    own_nu = p[5]
    a = (sqrt(delta + gap0 + gap1 / (2.0 * delta + gap2)) if delta >= 0.0 else gap3 / sqrt(gap0 - delta)) * sqrt(R)
    x9 = delta * gap5 + gap4
    x1 = (4.0 / 3.0) * a
    R_p2 = R * R
    delta_p2 = delta * delta
    x3 = delta_p2 * R_p2
    x4 = delta * R
    x5 = 2.23606797749979
    a_p2 = a * a
    x7 = sqrt(5.0 * a_p2 - 4.0 * x4)
    own_nu_p2 = own_nu * own_nu
    x8 = E / (1.0 - own_nu_p2)
    x9_p2 = x9 * x9
    dF_ddelta = x8 * (x1 + x4 * (gap7 * delta_p2 + gap8 * delta_p2 + delta * gap10 + delta * gap9 + gap6 + 2.0 * x3) / (3.0 * x9_p2 * a) if delta >= 0.0 else (2.0 / 15.0) * x5 * (delta * gap14 * a_p2 + gap15 * a_p2 + gap16 * delta_p2 + delta * gap13 + 12.0 * x3 - 5.0 * x4 * a_p2) / (x7 * (delta * gap12 + gap11)))
    newton = (delta * x8 * (x1 if delta >= 0.0 else (4.0 / 15.0) * x5 * x7) - F) / dF_ddelta
    out[i] = newton
    out[n + i] = dF_ddelta


@jit
def _gap_rate(i: int, h: float, delta: float, F: float, p: array, w: array, out: array) -> None:
    """w[i] = d(ln h)/dt (eq. 7)."""
    R = p[0]
    eta = p[2]
    own_L = p[3]
    own_Pi0 = p[4]
    x0 = 1.0 / R
    x1 = 1.0 / h
    x2 = x0 + x1
    x3 = 1.0 / x2
    x2_p2 = x2 * x2
    x5 = 1.0 / x2_p2
    a = (sqrt(delta + x3 + 5.0 * x5 / (2.0 * delta + 4.0 * x3)) if delta >= 0.0 else 1.5 * x3 / sqrt(x3 - delta)) * sqrt(R)
    x8 = x1 * R
    x9 = log1p((20.0 / 9.0) * x8)
    a_p2 = a * a
    a_p3 = a_p2 * a
    a_p6 = a_p3 * a_p3
    x15 = 7040.0 * a_p6
    x18 = 21120.0 * a_p6
    a_p4 = a_p2 * a_p2
    x20 = 27504.0 * a_p4
    x21 = 29808.0 * a_p2
    x22 = 464.0 * a_p4
    x23 = 648.0 * a_p2
    R_p2 = R * R
    R_p3 = R_p2 * R
    R_p4 = R_p2 * R_p2
    R_p5 = R_p3 * R_p2
    R_p6 = R_p3 * R_p3
    a_p12 = a_p6 * a_p6
    h_p2 = h * h
    h_p3 = h_p2 * h
    x2_p3 = x2_p2 * x2
    x2_p6 = x2_p3 * x2_p3
    zeta = 3.141592653589793 * eta * (32.0 * x0 * x2_p2 * a_p4 * (x8 / 2.0 + 0.45 * x9 + 1.0) / (3762.643798828125 * R_p6 / (x2_p6 * a_p12) + 106.3125 * x5 * R_p2 / a_p4 + 4.0) if delta >= 0.0 else 0.6 * x8 * a_p2 * (R + h) * (10.0 * R + 9.0 * x9 * h + 20.0 * h) * (729.0 * R_p4 * h_p2 + x22 * R_p2 + 928.0 * R * h * a_p4 + x22 * h_p2 - x23 * h * R_p3 - x23 * R_p2 * h_p2) / (6561.0 * R_p6 * h_p3 + x21 * R_p5 * h_p2 + x21 * R_p4 * h_p3 + x15 * R_p3 + x18 * h * R_p2 + x18 * R * h_p2 + x15 * h_p3 - x20 * h * R_p4 - 55008.0 * R_p3 * a_p4 * h_p2 - x20 * R_p2 * h_p3))
    x24 = 1.189207115002721
    F_adh = (0.17951958020513104 * R * own_L * own_Pi0 * (5.0 * x24 * h * sqrt(h * sqrt(h)) / (own_L * sqrt(own_L * sqrt(own_L))) + 56.0 * x24 * own_L * sqrt(sqrt(own_L)) / (h * sqrt(sqrt(h))) - 48.0) if h < 2.0 * own_L else 0.0)
    dh_dt = (F_adh - F) / zeta
    w[i] = dh_dt / h


@jit
def _slopes(i: int, h: float, delta: float, F: float, p: array, out: array) -> None:
    """The Jacobian of the rates of the state (ln h, delta following from the force balance)."""
    R = p[0]
    E = p[1]
    eta = p[2]
    own_L = p[3]
    own_Pi0 = p[4]
    own_nu = p[5]
    x0 = 1.0 / R
    x1 = 1.0 / h
    x2 = x0 + x1
    x3 = 1.0 / x2
    x2_p2 = x2 * x2
    x5 = 1.0 / x2_p2
    x6 = 2.0 * delta
    x8 = x3 - delta
    a = (sqrt(delta + x3 + 5.0 * x5 / (4.0 * x3 + x6)) if delta >= 0.0 else 1.5 * x3 / sqrt(x8)) * sqrt(R)
    a_p2 = a * a
    a_p4 = a_p2 * a_p2
    x11 = 1.0 / a_p4
    x12 = x11 * x5
    R_p2 = R * R
    x13 = x12 * R_p2
    R_p3 = R_p2 * R
    R_p6 = R_p3 * R_p3
    a_p3 = a_p2 * a
    a_p6 = a_p3 * a_p3
    a_p12 = a_p6 * a_p6
    x2_p3 = x2_p2 * x2
    x2_p6 = x2_p3 * x2_p3
    x15 = R_p6 / (x2_p6 * a_p12)
    x16 = 106.3125 * x13 + 3762.643798828125 * x15 + 4.0
    x17 = x1 * R
    x18 = log1p((20.0 / 9.0) * x17)
    x19 = x17 / 2.0 + 0.45 * x18 + 1.0
    x20 = x2_p2 * a_p4
    x21 = R + h
    x24 = 7040.0 * a_p6
    x27 = 21120.0 * a_p6
    x28 = h * R_p2
    x30 = 27504.0 * a_p4
    x32 = 29808.0 * a_p2
    R_p4 = R_p2 * R_p2
    R_p5 = R_p3 * R_p2
    h_p2 = h * h
    h_p3 = h_p2 * h
    x33 = 6561.0 * R_p6 * h_p3 + x32 * R_p5 * h_p2 + x32 * R_p4 * h_p3 + x24 * R_p3 + x27 * R * h_p2 + x24 * h_p3 + x27 * x28 - x30 * h * R_p4 - 55008.0 * R_p3 * a_p4 * h_p2 - x30 * R_p2 * h_p3
    x34 = 10.0 * R
    x35 = 9.0 * x18
    x36 = x35 * h + 20.0 * h + x34
    x37 = R * h
    x38 = 464.0 * a_p4
    x39 = 648.0 * a_p2
    x40 = R_p2 * h_p2
    x41 = 729.0 * R_p4 * h_p2 + x38 * R_p2 + 928.0 * x37 * a_p4 + x38 * h_p2 - x39 * h * R_p3 - x39 * x40
    x42 = x17 * a_p2
    zeta = 3.141592653589793 * eta * (32.0 * x0 * x19 * x20 / x16 if delta >= 0.0 else 0.6 * x21 * x36 * x41 * x42 / x33)
    x43 = 1.189207115002721
    x44 = own_L * sqrt(sqrt(own_L))
    x45 = 1.0 / (own_L * sqrt(own_L * sqrt(own_L)))
    x46 = 3.141592653589793 * R * own_Pi0
    x47 = 2.0 * own_L
    F_adh = ((2.0 / 35.0) * x46 * own_L * (5.0 * x43 * x45 * h * sqrt(h * sqrt(h)) + 56.0 * x43 * x44 / (h * sqrt(sqrt(h))) - 48.0) if h < x47 else 0.0)
    x49 = delta * R
    delta_p2 = delta * delta
    x52 = x37 * delta_p2
    x53 = delta * x28
    x54 = delta_p2 * R_p2
    x50 = x49 * h_p2
    x55 = delta_p2 * h_p2
    x56 = 3.0 * x40 + 8.0 * x50 + 4.0 * x52 + 8.0 * x53 + 2.0 * x54 + 2.0 * x55
    x57 = 1.0 / a
    x58 = 2.0 * x37
    x59 = delta * x21
    x95 = x58 + x59
    x95_p2 = x95 * x95
    x60 = 1.0 / x95_p2
    x61 = x57 * x60
    x62 = 5.0 * a_p2
    x63 = 1.0 / (x37 - x59)
    x64 = x63 * sqrt(5.0) / sqrt(5.0 * a_p2 - 4.0 * x49)
    own_nu_p2 = own_nu * own_nu
    x65 = E / (1.0 - own_nu_p2)
    dF_ddelta = x65 * ((4.0 / 3.0) * a + x49 * x56 * x61 / 3.0 if delta >= 0.0 else (2.0 / 15.0) * x64 * (x34 * h * a_p2 + 12.0 * x52 + 12.0 * x54 - delta * x62 * h - x49 * x62 - 12.0 * x53))
    x21_p2 = x21 * x21
    x66 = x61 * (x58 * delta_p2 + 9.0 * x40 + 9.0 * x50 + 9.0 * x53 + x54 + x55) / x21_p2
    x67 = 1.0 / x21
    x68 = x67 * (x37 - x21 * x6)
    dF_dh = (2.0 / 3.0) * delta * x65 * (x66 * R_p3 if delta >= 0.0 else x42 * x64 * x68)
    x69 = 1.0 / zeta
    dh_dt = x69 * (F_adh - F)
    x75 = 1.0 / a_p2
    x76 = x3 * x75
    x77 = x76 * R
    x78 = 729.0 * x13 + 464.0 - 648.0 * x77
    x79 = 1.0 / x78
    x80 = 81.0 * x13 + 16.0 - 72.0 * x77
    x81 = x79 * x80
    x96 = 2.25 * x77 + 110.0 * x81
    x70 = 1.0 / R_p2
    x71 = 1.0 / (435456.0 * x13 + 15411789.0 * x15 + 16384.0)
    a_p8 = a_p4 * a_p4
    x2_p4 = x2_p2 * x2_p2
    x72 = 243.0 * x71 * (190269.0 * R_p4 / (x2_p4 * a_p8) + 1792.0)
    x73 = x70 * x2_p2 * a_p3 + x57 * x72
    x74 = x16 * x71
    x82 = 9.0 * x77
    x83 = x82 - 4.0
    x84 = -x83
    x78_p2 = x78 * x78
    x85 = x80 / x78_p2
    x86 = x33 * x67 / (x36 * x41)
    x87 = dF_dh / dF_ddelta
    x88 = 1.0 / (20.0 * x17 + 9.0)
    x89 = x1 * x34 + x35 + 20.0
    x90 = x89 * R
    x91 = 880.0 * x79
    x92 = 7920.0 * x85
    x93 = 1.0 / (440.0 * x81 + x82)
    x94 = x75 * x93
    a_p5 = a_p3 * a_p2
    x96_p2 = x96 * x96
    slope_p11 = x69 * (x43 * x46 * x47 * (x45 * sqrt(h * sqrt(h)) / 4.0 - 2.0 * x44 / (h_p2 * sqrt(sqrt(h)))) if h < x47 else 0.0) - dh_dt * x1 - dh_dt * (R * (409.6 * x12 * x74 * (x66 * x73 * x89 * R_p4 - (5.0 * x20 * (18.0 * x88 + 1.0) + x90 * (x2 * x70 * a_p4 + x3 * x72)) / h_p2) / x19 if delta >= 0.0 else x86 * x94 * (9.0 * x63 * x68 * x76 * x90 * x93 * (1.0 - x83 * x92 - x84 * x91) - x1 * (9.0 * x5 * x89 * x94 * (x83 * x91 + x84 * x92 + 1.0) + 180.0 * x88 + 10.0))) - x87 * (4096.0 * x5 * x56 * x60 * x73 * x74 * R_p3 / a_p5 if delta >= 0.0 else 22.5 * x11 * x19 * x3 * x37 * x86 * (0.5 - 440.0 * x79 * x84 - 3960.0 * x83 * x85) / (x8 * x96_p2)))
    slope_p21 = -x87 * h
    out[0 + i] = slope_p11
    out[8 + i] = slope_p21


@jit
def _quantities(i: int, n: int, h: float, delta: float, F: float, dF_dt: float, p: array, out: array) -> None:
    """a, F_ela, zeta, F_adh, C, D, dh_dt, ddelta_dt, dX_dt, X, lambda1, lambda2 at state i of n."""
    R = p[0]
    E = p[1]
    eta = p[2]
    own_L = p[3]
    own_Pi0 = p[4]
    own_nu = p[5]
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
    x15 = E / (1.0 - own_nu_p2)
    x16 = delta * x15
    F_ela = x16 * (x9 if delta >= 0.0 else (4.0 / 15.0) * x10 * x13)
    a_p4 = a_p2 * a_p2
    x19 = 1.0 / a_p4
    x20 = x19 * x5
    R_p2 = R * R
    x21 = x20 * R_p2
    R_p3 = R_p2 * R
    R_p6 = R_p3 * R_p3
    a_p3 = a_p2 * a
    a_p6 = a_p3 * a_p3
    a_p12 = a_p6 * a_p6
    x2_p3 = x2_p2 * x2
    x2_p6 = x2_p3 * x2_p3
    x23 = R_p6 / (x2_p6 * a_p12)
    x24 = 106.3125 * x21 + 3762.643798828125 * x23 + 4.0
    x25 = x1 * R
    x26 = log1p((20.0 / 9.0) * x25)
    x27 = x25 / 2.0 + 0.45 * x26 + 1.0
    x28 = x2_p2 * a_p4
    x29 = R + h
    x32 = 7040.0 * a_p6
    x35 = 21120.0 * a_p6
    x36 = h * R_p2
    x38 = 27504.0 * a_p4
    x39 = 29808.0 * a_p2
    R_p4 = R_p2 * R_p2
    R_p5 = R_p3 * R_p2
    h_p2 = h * h
    h_p3 = h_p2 * h
    x40 = 6561.0 * R_p6 * h_p3 + x39 * R_p5 * h_p2 + x39 * R_p4 * h_p3 + x32 * R_p3 + x35 * R * h_p2 + x32 * h_p3 + x35 * x36 - x38 * h * R_p4 - 55008.0 * R_p3 * a_p4 * h_p2 - x38 * R_p2 * h_p3
    x41 = 10.0 * R
    x42 = 9.0 * x26
    x43 = x42 * h + 20.0 * h + x41
    x44 = R * h
    x45 = 464.0 * a_p4
    x46 = 648.0 * a_p2
    x47 = R_p2 * h_p2
    x48 = 729.0 * R_p4 * h_p2 + x45 * R_p2 + 928.0 * x44 * a_p4 + x45 * h_p2 - x46 * h * R_p3 - x46 * x47
    x49 = x25 * a_p2
    zeta = 3.141592653589793 * eta * (32.0 * x0 * x27 * x28 / x24 if delta >= 0.0 else 0.6 * x29 * x43 * x48 * x49 / x40)
    x50 = 1.189207115002721
    x51 = own_L * sqrt(sqrt(own_L))
    x52 = 1.0 / (own_L * sqrt(own_L * sqrt(own_L)))
    x53 = 3.141592653589793 * R * own_Pi0
    x54 = 2.0 * own_L
    F_adh = ((2.0 / 35.0) * x53 * own_L * (5.0 * x50 * x52 * h * sqrt(h * sqrt(h)) + 56.0 * x50 * x51 / (h * sqrt(sqrt(h))) - 48.0) if h < x54 else 0.0)
    delta_p2 = delta * delta
    x58 = x44 * delta_p2
    x59 = delta * x36
    x60 = delta_p2 * R_p2
    x56 = x11 * h_p2
    x61 = delta_p2 * h_p2
    x62 = 3.0 * x47 + 8.0 * x56 + 4.0 * x58 + 8.0 * x59 + 2.0 * x60 + 2.0 * x61
    x63 = 1.0 / a
    x64 = 2.0 * x44
    x65 = delta * x29
    x101 = x64 + x65
    x101_p2 = x101 * x101
    x66 = 1.0 / x101_p2
    x67 = x63 * x66
    x68 = 5.0 * a_p2
    x69 = 1.0 / (x44 - x65)
    x70 = x10 * x69 / x13
    dF_ddelta = x15 * (x11 * x62 * x67 / 3.0 + x9 if delta >= 0.0 else (2.0 / 15.0) * x70 * (x41 * h * a_p2 + 12.0 * x58 + 12.0 * x60 - delta * x68 * h - x11 * x68 - 12.0 * x59))
    x29_p2 = x29 * x29
    x71 = x67 * (x64 * delta_p2 + 9.0 * x47 + 9.0 * x56 + 9.0 * x59 + x60 + x61) / x29_p2
    x72 = 1.0 / x29
    x73 = x72 * (x44 - x29 * x6)
    x74 = (x71 * R_p3 if delta >= 0.0 else x49 * x70 * x73)
    dF_dh = (2.0 / 3.0) * x16 * x74
    C = dF_ddelta / 2.0
    D = C * zeta / (C + dF_dh)
    x75 = F - F_adh
    dh_dt = -x75 / zeta
    x76 = 1.0 / dF_ddelta
    ddelta_dt = x76 * (dF_dt - dF_dh * dh_dt)
    dX_dt = -x75 / D - dF_dt / C
    X = 2.0 * R + h - x6
    lambda1 = 2.0 * x74 * x76 * E * h / (3.0 * own_nu_p2 - 3.0)
    x82 = 1.0 / a_p2
    x83 = x3 * x82
    x84 = x83 * R
    x85 = 729.0 * x21 + 464.0 - 648.0 * x84
    x86 = 1.0 / x85
    x87 = 81.0 * x21 + 16.0 - 72.0 * x84
    x88 = x86 * x87
    x102 = 2.25 * x84 + 110.0 * x88
    x77 = 1.0 / R_p2
    x78 = 1.0 / (435456.0 * x21 + 15411789.0 * x23 + 16384.0)
    a_p8 = a_p4 * a_p4
    x2_p4 = x2_p2 * x2_p2
    x79 = 243.0 * x78 * (190269.0 * R_p4 / (x2_p4 * a_p8) + 1792.0)
    x80 = x77 * x2_p2 * a_p3 + x63 * x79
    x81 = x24 * x78
    x89 = 9.0 * x84
    x90 = x89 - 4.0
    x91 = -x90
    x85_p2 = x85 * x85
    x92 = x87 / x85_p2
    x93 = x40 * x72 / (x43 * x48)
    x94 = 1.0 / (20.0 * x25 + 9.0)
    x95 = x1 * x41 + x42 + 20.0
    x96 = x95 * R
    x97 = 880.0 * x86
    x98 = 7920.0 * x92
    x99 = 1.0 / (440.0 * x88 + x89)
    x100 = x82 * x99
    a_p5 = a_p3 * a_p2
    x102_p2 = x102 * x102
    lambda2 = -h * (R * (409.6 * x20 * x81 * (x71 * x80 * x95 * R_p4 - (5.0 * x28 * (18.0 * x94 + 1.0) + x96 * (x2 * x77 * a_p4 + x3 * x79)) / h_p2) / x27 if delta >= 0.0 else x100 * x93 * (9.0 * x69 * x73 * x83 * x96 * x99 * (1.0 - x90 * x98 - x91 * x97) - x1 * (9.0 * x100 * x5 * x95 * (x90 * x97 + x91 * x98 + 1.0) + 180.0 * x94 + 10.0))) - dF_dh * x76 * (4096.0 * x5 * x62 * x66 * x80 * x81 * R_p3 / a_p5 if delta >= 0.0 else 22.5 * x19 * x27 * x3 * x44 * x93 * (0.5 - 440.0 * x86 * x91 - 3960.0 * x90 * x92) / (x102_p2 * x8))) - h * (x50 * x53 * x54 * (x52 * sqrt(h * sqrt(h)) / 4.0 - 2.0 * x51 / (h_p2 * sqrt(sqrt(h)))) if h < x54 else 0.0) / x75
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
    from the other. Returns nan if there is no solution. Uses w[0] and w[1], and of terms as many as the law has.
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
            return trial if w[1] > 0.0 else nan
        residual = step * w[1]
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
def steric_evaluate(n: int, h: array, delta: array, F: array, dF_dt: array, p: array, out: array) -> None:
    """a, F_ela, zeta, F_adh, C, D, dh_dt, ddelta_dt, dX_dt, X, lambda1, lambda2 at n states: out[k*n + i] is quantity k at state i."""
    for i in range(n):
        _quantities(i, n, h[i], delta[i], F[i], dF_dt[i], p, out)


@jit
def steric_solve_delta(n: int, h: array, F: array, p: array, delta: array) -> None:
    """The deflection at n gaps under n forces, from guesses, or nan for that of the state before; nan if there is none."""
    w = empty(2)
    terms = empty(17)
    guess = nan
    for i in range(n):
        guess = guess if delta[i] != delta[i] else delta[i]
        delta[i] = _solve_delta(h[i], F[i], guess, p, w, terms)
        guess = delta[i]


@jit
def steric_drive(n: int, t: array, table_t: array, table_F: array, rows: int, value: array, rate: array) -> None:
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
        if w[32 + i] != 0.0 or not (delta[i] * F[i] >= 0.0 and w[8 + i] > 0.0):
            delta[i] = _solve_delta(h[i], F[i], nan, p, w, terms)








@jit
def steric_integrate(t_end: float, u_stop: float, rtol: float, p: array, table_t: array, table_F: array, rows: int, capacity: int, state: array, steps: array) -> int:
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
    terms = empty(136)
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
def steric_sample(n: int, t: array, stored: int, steps: array, out: array) -> None:
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
def steric_passages(n: int, u: array, at: array, steps: array, out: array) -> None:
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
    terms = empty(136)
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
def steric_runs(n: int, count: int, at_gaps: int, settings: array, runs: array, targets: array, table_t: array, table_F: array, rows: int, out: array) -> None:
    """Make n runs, each with its own parameters, start and end, and write the outputs asked for.

    settings: rtol, the time of the start, longest step, steps that a run may take, whether ln h may serve as the
    independent variable.
    runs: of each run t_end, u_stop, ln h, delta (which follows from the force here), 6 parameters.
    targets: the times, or with at_gaps = 1 the values of ln h, of the count outputs of each run, in the order of passage.
    out: t, h, delta, what is given, its rate, a, F_ela, zeta, F_adh, C, D, dh_dt, ddelta_dt, dX_dt, X, lambda1, lambda2, each n*count numbers; the status of each run, as
    steric_integrate returns it, or 10 if it took too many steps, 11 if the gap left the range of double precision;
    and the largest estimated error of its outputs, relative.
    What a run does not reach is left as it is.
    """
    state = empty(20)
    worst = empty(1)
    steps = empty(448)
    p = empty(6)
    for run in range(n):
        at: int = 10 * run
        for k in range(6):
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
            ended = steric_integrate(runs[at], runs[at + 1], settings[0], p, table_t, table_F, rows, 32, state, steps)
            j = _collect(1e-3 * settings[0], settings[1], worst, j, count * run, count, count * n, at_gaps, targets, int(state[9]), steps, p, table_t, table_F, rows, out)
            if ended == 2 and state[4] + state[5] > settings[3]:
                ended = 10
            elif ended == 2 and not fabs(state[1]) < 690.0:
                ended = 11
        if state[17] > 0.0:
            ended = 12
        out[17 * n * count + run] = float(ended)
        out[17 * n * count + n + run] = worst[0]
