"""Contact law rognon_gay: written by softdyn 0.1.0 with sympy 1.14.0; do not edit.

Source: Rognon & Gay, arXiv:0803.1573, eqs. 3-5
Law b2a8534843dae832:
    a = sqrt(2)*sqrt(R)*sqrt(R*h/(R + h) + Abs(delta))
    F_ela = 4*E*a*delta/9
    zeta = 3*pi*a**4*eta*(R + h)**3/(2*R**3*h**3)
    F_adh = 0
Left out, with the operations that each saved:
    one sign of delta: 72 -> 71
    constant force: 71 -> 67
    no remote force: 67 -> 66
    outputs asked for: 66 -> 54
Operations, 113 in all:
    gap_terms: 1 add, 1 mul, 1 div
    newton: 3 add, 11 mul, 1 div, 1 sqrt
    gap_rate: 2 add, 15 mul, 3 div, 1 sqrt
    slopes: 6 add, 33 mul, 8 div, 1 sqrt
    quantities: 4 add, 17 mul, 3 div, 1 sqrt

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
    a = sqrt(2.0 * R * (delta + gap0))
    a_p2 = a * a
    newton = a * (4.0 * delta * E * a - 9.0 * F) / (4.0 * E * (delta * R + a_p2))
    out[i] = newton


@jit
def _gap_rate(i: int, h: float, delta: float, F: float, p: array, w: array, out: array) -> None:
    """w[i] = d(ln h)/dt (eq. 7)."""
    R = p[0]
    eta = p[2]
    x0 = R + h
    a = sqrt(2.0 * R * (R * h / x0 + delta))
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
    x0 = R + h
    a = sqrt(2.0 * R * (R * h / x0 + delta))
    R_p2 = R * R
    R_p3 = R_p2 * R
    a_p2 = a * a
    a_p4 = a_p2 * a_p2
    h_p2 = h * h
    h_p3 = h_p2 * h
    x0_p2 = x0 * x0
    x0_p3 = x0_p2 * x0
    zeta = 4.71238898038469 * eta * x0_p3 * a_p4 / (R_p3 * h_p3)
    x2 = delta / a
    x3 = (4.0 / 9.0) * E
    dF_ddelta = x3 * (x2 * R + a)
    x4 = 1.0 / x0_p2
    dF_dh = x2 * x3 * x4 * R_p3
    dh_dt = -F / zeta
    x5 = 1.0 / h
    x6 = dF_dh / dF_ddelta
    x8 = R / a_p2
    slope_p11 = -dh_dt * x5 - dh_dt * (x4 * x5 * x8 * (4.0 * h * R_p2 - 3.0 * x0 * a_p2) - 4.0 * x6 * x8)
    slope_p21 = -x6 * h
    out[0 + i] = slope_p11
    out[8 + i] = slope_p21


@jit
def _quantities(i: int, n: int, h: float, delta: float, F: float, p: array, out: array) -> None:
    """a, X, dh_dt at state i of n."""
    R = p[0]
    eta = p[2]
    x0 = R + h
    a = sqrt(2.0 * R * (R * h / x0 + delta))
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
    X = 2.0 * R + h - 2.0 * delta
    out[0 * n + i] = a
    out[1 * n + i] = X
    out[2 * n + i] = dh_dt


@jit
def _solve_delta(h: float, F: float, guess: float, p: array, w: array, terms: array) -> float:
    """The deflection at the gap h under the force F (eq. 1): Newton's iteration, kept between bounds.

    F_ela rises with delta and vanishes with it, so the sign of F bounds delta from one side, and the sign of each step
    from the other. Returns nan if there is no solution. Uses w[0], and of terms as many as the law has.
    """
    if F == 0.0:
        return 0.0
    if not F > 0.0:
        return nan
    low = 0.0
    high = inf
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
def _drive(t: float, c: array, w: array) -> None:
    """What is given, and its rate of change, at the time t: w[0] and w[1]."""
    w[0] = c[0]
    w[1] = 0.0


@jit
def _given(t: float, c: array) -> float:
    """What the integration needs of the drive at the time t: its value."""
    return c[0]


@jit
def rognon_gay_evaluate(n: int, h: array, delta: array, F: array, p: array, out: array) -> None:
    """a, X, dh_dt at n states: out[k*n + i] is quantity k at state i."""
    for i in range(n):
        _quantities(i, n, h[i], delta[i], F[i], p, out)


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
def rognon_gay_drive(n: int, t: array, c: array, value: array, rate: array) -> None:
    """What is given, and its rate of change, at n times."""
    w = empty(2)
    for i in range(n):
        _drive(t[i], c, w)
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






_PANEL_NODES = table((0.0, 0.00564068897251171, 0.029482298647942485, 0.07141295311515884, 0.12983102555359105, 0.20249275505010406, 0.28660608625752704, 0.37893868864697805, 0.4759423084632349, 0.5738891609066858, 0.6690151950299599, 0.7576647390313427, 0.8364309606056102, 0.902286700679378, 0.9527004099058333, 0.9857305452631743, 1.0))
_PANEL_MATRIX = table((0.007235301724853019, 0.015615610626930135, 0.013889447595922167, 0.014784702548557295, 0.014224121134432586, 0.014607238756214272, 0.01433277315993944, 0.014534409809339744, 0.014384739299591932, 0.014495616951136705, 0.014414666613431004, 0.014471997295921675, 0.014433543485975468, 0.014456924123011956, 0.014445281892622617, 0.014448569508407165, -0.0027493708145090727, 0.01660495976708087, 0.035903565336952714, 0.03168240477452331, 0.03397215035788185, 0.03249682513955414, 0.03352198439034886, 0.032782219630435726, 0.033325118753550764, 0.03292598334318092, 0.03321585560301448, 0.03301132257474263, 0.03314815219252776, 0.03306510675919879, 0.0331064109387223, 0.03309475430506822, 0.002100702347262591, -0.0045072463319921425, 0.02538839832949902, 0.054794446891789084, 0.048318261684834614, 0.05185991629950392, 0.04956831991081548, 0.05115942791510456, 0.05001870825850086, 0.0508447210419596, 0.05025097786630105, 0.05066693240140568, 0.05039005222554691, 0.050557524788691244, 0.05047441093933825, 0.050497839810891954, -0.0017604335996887822, 0.003156219161791431, -0.0060423307751848445, 0.03323500120505139, 0.07153498381275242, 0.06314498256346184, 0.0677154008185616, 0.06477662053956487, 0.06679614063169931, 0.0653713897612247, 0.0663781693282376, 0.06568098613737422, 0.06614138509497654, 0.06586440550844476, 0.06600139698830845, 0.06596284996653407, 0.0015340429432776732, -0.0025575951442634542, 0.00399231870687158, -0.007357099450291352, 0.03984222411325774, 0.08548309546976601, 0.0755904350203091, 0.08092493104831254, 0.07753927582152155, 0.07982438923460797, 0.07825321717743476, 0.0793219511567272, 0.0786245962102955, 0.07904080207396165, 0.07883597713358326, 0.078893460902101, -0.0013644413983363766, 0.002192383863013407, -0.00313603607022378, 0.004667361918124389, -0.008414782176759113, 0.04495597570040661, 0.0961041789014644, 0.08517495079172857, 0.09098046545217824, 0.08736636827938737, 0.08974175814422738, 0.08817020023190572, 0.08917747070735528, 0.08858322823969564, 0.08887358192402663, 0.08879239637636975, 0.001227367496727992, -0.0019305457150417963, 0.002636479135452169, -0.003572765436976896, 0.0051781694920198, -0.009179462702116893, 0.0483796881901024, 0.10299087317692877, 0.0915294372554983, 0.09749565363611079, 0.09388036090115227, 0.09616675104467035, 0.09474088340120539, 0.09556782492909142, 0.09516791669583087, 0.09527914712767754, -0.0011102412314697347, 0.001723139202441361, -0.002289064961411087, 0.0029484291424280752, -0.0038784197959304276, 0.005513299347606251, -0.00962371764498473, 0.049981771880975176, 0.10587889281202502, 0.09440940345237585, 0.10022008605472309, 0.0968309388674198, 0.09885288821159718, 0.09771044613638198, 0.09825459522605771, 0.09810439411951584, 0.0010055558002473517, -0.0015469021193408718, 0.0020187698974517463, -0.0025214556712273442, 0.0031454676933429185, -0.0040514440669331695, 0.005663223634305088, -0.00973127584760146, 0.049700649695287834, 0.10465729104976508, 0.09370429350741881, 0.0990487944818116, 0.09610452161118532, 0.09769894805553203, 0.09695708936902714, 0.09715954485578392, -0.0009082327742196254, 0.001388693768649112, -0.0017907356411175192, 0.0021923856933222987, -0.0026478978008090672, 0.0032309229543971436, -0.004089123383508829, 0.005623302021047263, -0.009498128379475359, 0.04754711567495923, 0.09937272302083751, 0.08944176863503729, 0.09402632874204701, 0.09172778203579965, 0.0927566858450249, 0.09248089074433267, 0.000814325669727546, -0.0012397773008112176, 0.0015854821537460147, -0.0019150298807934162, 0.0022648127924096615, -0.0026738774673212735, 0.003205019931230007, -0.003990634198777001, 0.005394647256989609, -0.00893274570618816, 0.043603913405901217, 0.09022752007646619, 0.08178678035286203, 0.08534552220286679, 0.08386273363722285, 0.08424819892496124, -0.0007201887768419033, 0.0010931250228563454, -0.0013898078817764562, 0.0016631006237417605, -0.0019393149733442248, 0.002241503706645882, -0.0026000143543308167, 0.0030674919082657177, -0.0037574678865189516, 0.004983822775544288, -0.008055466060311168, 0.03802254052498339, 0.07757151038056528, 0.0710354219569268, 0.07334309959386263, 0.07277777261010113, 0.000621640417049082, -0.0009415334255432368, 0.001192223342056157, -0.0014175429545364483, 0.0016373113826125938, -0.0018662581273881647, 0.0021204632820150076, -0.002423290232239981, 0.002816662137150972, -0.0033917723585600206, 0.004401022916949567, -0.006896689406012607, 0.031017366988229423, 0.06188735260933147, 0.057602858800826655, 0.05851017655193003, -0.0005124597398071433, 0.0007750572593710607, -0.000978763309091329, 0.001158806521697092, -0.0013301506603758252, 0.001502639205220358, -0.0016853836484306012, 0.001889533942793337, -0.002132005346410297, 0.002443401813162559, -0.0028900073500311625, 0.003654080093427551, -0.005491976570686384, 0.022857063349338624, 0.04376720725512407, 0.04199264072248259, 0.00037966440690718865, -0.0005737211131896221, 0.0007233374125134429, -0.0008542353675455583, 0.0009769508438868596, -0.0010978970229017387, 0.0012223245428324668, -0.0013557647096008258, 0.001505375665118294, -0.0016820910342857597, 0.001905314885691106, -0.0022158006672853055, 0.0027219283267905887, -0.003860814116386124, 0.013850811708138568, 0.02385111347384286, -0.00015254349866809555, 0.00023043112599110504, -0.0002903301565011601, 0.00034251499572737, -0.0003911328501083284, 0.0004386265014118825, -0.0004868841036908332, 0.0005377407869578472, -0.0005933505200221833, 0.0006566471155787527, -0.000732146983634791, 0.0008276671570147568, -0.0009587306810952794, 0.0011628712539466287, -0.0015695126845426928, 0.00390625))
_PANEL_SLOPE_START = table((-256.0, 283.7358391264974, -35.93664825939723, 11.775271006467692, -5.490121732611385, 3.0825226053496944, -1.9420471760753084, 1.3232609872486811, -0.9539217715405877, 0.7169695352267428, -0.555740476780146, 0.4401135083131319, -0.35265839771685004, 0.2822272019684472, -0.22036979366033282, 0.15780363671004016, -0.0625))
_PANEL_SLOPE_PROBE = table((-0.12113097264196118, 0.20057900155860367, -0.1534869012464273, 0.15808007917856004, -0.19629808923565928, 0.2904034550290135, -0.535049102463803, 1.4454636782028374, -12.987390081702236, 13.014084987277846, -1.484365857603052, 0.5506928715881774, -0.28966105869251924, 0.17911783468994422, -0.11920006079343409, 0.07790094140134601, -0.029740724547235114))


@jit
def _panel_deflections(small: float, h: array, F: array, delta: array, p: array, w: array, terms: array) -> None:
    """Deflections of 16 states at once, from guesses in delta: Newton's iteration, to an error of ``small``, relative.

    It converges quadratically, so that after a change of c1 and one of c2 there would be one of c2**3/c1**2.
    w, of 80 numbers: the last changes, stiffnesses, relative changes, the sizes that these are relative to, what is
    left to do.
    """
    # of an iteration that has just begun, whose change leaves about its square
    enough = sqrt(0.1 * small)
    for i in range(16):
        _gap_terms(i, 16, h[i], p, terms)
    for i in range(16):
        w[32 + i] = 0.0
        w[48 + i] = 1.0 / fabs(delta[i])
    for iteration in range(7):
        for i in range(16):
            _newton(i, 16, delta[i], F[i], terms, p, w)
        left = 0.0
        for i in range(16):
            delta[i] = delta[i] - w[i]
            size = fabs(w[i]) * w[48 + i]
            before = w[32 + i]
            w[64 + i] = 0.0 if size <= enough or size * size * size <= small * (before * before) else 1.0
            w[32 + i] = size
            left += w[64 + i]
        if left == 0.0:
            break
    # on the branch where F_ela rises from 0 with delta: a law may have others
    for i in range(16):
        if w[64 + i] != 0.0 or not (delta[i] * F[i] >= 0.0):
            delta[i] = _solve_delta(h[i], F[i], nan, p, w, terms)


@jit
def _by_gap(t_end: float, u_stop: float, rtol: float, p: array, c: array, capacity: int, state: array, steps: array) -> int:
    """Integrate the time over u = ln h for as long as the gap moves; see rognon_gay_integrate.

    Where it hardly moves, state[13] is set to 0, for the time to take over as the independent variable.
    """
    w = empty(2)
    # along ln h: of its rate, and of the deflection
    slopes = empty(16)
    h = empty(16)
    F = empty(16)
    delta = empty(16)
    rate = empty(16)
    work = empty(80)
    terms = empty(16)
    dt = empty(16)
    z = empty(16)
    t = state[0]
    u = state[1]
    u_astray = state[15]
    # of the panel before: its length and its error
    last = 0.0
    last_error = 1.0
    stride = state[3]
    h[0] = exp(u)
    delta[0] = _solve_delta(h[0], c[0], state[2], p, w, terms)
    _gap_rate(0, h[0], delta[0], c[0], p, rate, w)
    _slopes(0, h[0], delta[0], c[0], p, slopes)
    u_dot = rate[0]
    deflection = delta[0]
    if stride == 0.0:
        stride = 1.5 * pow(1e9 * rtol, 1.0 / 17.0)
    for i in range(16):
        F[i] = c[0]
    stored: int = 0
    status: int = 2
    while stored < capacity and t < t_end:
        # of a rate that is hardly a number the time would overflow
        if not (fabs(u_dot) > 0.1 * fabs(slopes[0]) and fabs(u_dot) > 1e-290):
            state[13] = 0.0
            break
        stride = fabs(stride) if u_dot > 0.0 else -fabs(stride)
        landing = 0.0
        step = stride
        if (u_stop - u) * u_dot > 0.0 and fabs(u_stop - u) <= 1.01 * fabs(stride):
            step = u_stop - u
            landing = 1.0
        bend = 0.125 * step * slopes[8] / deflection if deflection != 0.0 else 0.0
        for i in range(16):
            h[i] = exp(u + _PANEL_NODES[i + 1] * step)
            # along a power of the gap, nearly
            power = 1.0 + bend * _PANEL_NODES[i + 1]
            power = power if power > 0.5 else 0.5
            power = power * power
            power = power * power
            delta[i] = deflection * power * power
        _panel_deflections(1e-3 * rtol, h, F, delta, p, work, terms)
        for i in range(16):
            _gap_rate(i, h[i], delta[i], F[i], p, rate, w)
        state[6] += 2.0
        astray: int = 0
        for i in range(16):
            # without a deflection there is no rate, even of a law whose rate does not depend on it
            dt[i] = step / (rate[i] + 0.0 * delta[i])
            if not dt[i] > 0.0:
                astray += 1
        for i in range(16):
            z[i] = (_PANEL_MATRIX[0 + i] * dt[0] + _PANEL_MATRIX[16 + i] * dt[1]) + (_PANEL_MATRIX[32 + i] * dt[2] + _PANEL_MATRIX[48 + i] * dt[3]) + (_PANEL_MATRIX[64 + i] * dt[4] + _PANEL_MATRIX[80 + i] * dt[5]) + (_PANEL_MATRIX[96 + i] * dt[6] + _PANEL_MATRIX[112 + i] * dt[7]) + (_PANEL_MATRIX[128 + i] * dt[8] + _PANEL_MATRIX[144 + i] * dt[9]) + (_PANEL_MATRIX[160 + i] * dt[10] + _PANEL_MATRIX[176 + i] * dt[11]) + (_PANEL_MATRIX[192 + i] * dt[12] + _PANEL_MATRIX[208 + i] * dt[13]) + (_PANEL_MATRIX[224 + i] * dt[14] + _PANEL_MATRIX[240 + i] * dt[15])
        # the defect of the polynomial at the start and at the probe, and the error that it makes
        defect = -step / u_dot
        late = 0.0
        for i in range(16):
            defect += _PANEL_SLOPE_START[i + 1] * z[i]
            late += _PANEL_SLOPE_PROBE[i + 1] * z[i]
        h_probe = exp(u + 0.5249157346849603 * step)
        delta_probe = _solve_delta(h_probe, c[0], 0.5 * (delta[7] + delta[8]), p, w, terms)
        _gap_rate(0, h_probe, delta_probe, c[0], p, work, w)
        state[7] += 1.0
        d1 = 0.0050262494109758835 * defect
        d2 = 0.03652541177259325 * (late - step / work[0])
        # written so that nan rejects the step
        longer = fabs(d1) if fabs(d1) > fabs(d2) else fabs(d2)
        # an error of the time is one of ln h by the rate
        fastest = fabs(u_dot) if fabs(u_dot) > fabs(rate[15]) else fabs(rate[15])
        error = longer * fastest / (rtol + 4.5e-16 * (1.0 + fabs(u)))
        factor = 0.9 * pow(error if error > 1e-12 else 1e-12, -1.0 / 17.0)
        if astray > 0 or not error <= 1.0:
            state[5] += 1.0
            stride = step * (factor if factor > 0.2 and factor < 1.0 and astray == 0 else 0.2)
            # where the rate vanishes on the way, time has to take over
            if fabs(stride) <= 1e-6:
                state[13] = 0.0
                break
            continue
        if not isfinite(t + z[15]):
            status = -2
            break
        base: int = 23 * stored
        steps[base] = t
        steps[base + 1] = z[15]
        steps[base + 2] = 0.0
        steps[base + 3] = u
        for i in range(16):
            steps[base + 4 + i] = z[i]
        steps[base + 20] = step
        # trajectories differ by a shift in time: its error is the sum over the steps, and that of u follows
        # and u is rounded, which shifts the time by that over the rate
        slowest = fabs(u_dot) if fabs(u_dot) < fabs(rate[15]) else fabs(rate[15])
        earlier = u_astray / fabs(u_dot) + 4.4e-16 * ((1.0 + fabs(u)) / slowest + fabs(t + z[15]))
        u_astray = (earlier + longer * _left(fabs(d1 - d2) / longer, longer * fastest)) * fabs(rate[15])
        steps[base + 21] = (earlier + longer) * fastest
        steps[base + 22] = earlier + longer
        stored += 1
        state[4] += 1.0
        state[14] += 1.0
        t = t + z[15]
        u = u_stop if landing == 1.0 else u + step
        u_dot = rate[15]
        deflection = delta[15]
        _slopes(0, h[15], deflection, c[0], p, slopes)
        if landing == 1.0 and t < t_end:
            status = 1
            break
        if last != 0.0:
            foresight = factor * fabs(step / last) * pow(last_error / (error if error > 1e-12 else 1e-12), 1.0 / 17.0)
            factor = foresight if foresight < factor else factor
        last = step
        last_error = error if error > 1e-2 else 1e-2
        stride = step * factor if fabs(step * factor) < 4.0 else 4.0
    if t >= t_end and status == 2:
        status = 0
    state[0] = t
    state[1] = u
    state[2] = deflection
    # the first step in time finds its own length
    state[3] = stride if state[13] == 1.0 else 0.0
    state[9] = float(stored)
    state[15] = u_astray
    return status






@jit
def rognon_gay_integrate(t_end: float, u_stop: float, rtol: float, p: array, c: array, capacity: int, state: array, steps: array) -> int:
    """Integrate the state, u = ln h, by collocation: Radau IIA with 8 stages, which is L-stable.

    A step is accepted if the defect of its polynomial, measured at two points, promises an error below rtol, relative,
    of h throughout the step. Steps end at the rows of a table, and where the force crosses zero.

    state, of 20 numbers: t, u, delta, step (0 at the start), steps accepted, rejected, passes of Newton's iteration, single
    rates, segment of the table, steps recorded by this call, largest step times rate of decay, whether the gap is settled,
    longest step allowed, whether ln h may serve as the independent variable, how many steps it did, and estimates of the
    errors of u and delta, the errors of all steps grown as the linearised equation has it; steps within which the force is
    not known, the time of the first of them, and steps that were shortened to know it. It is updated, and a further call
    goes on from it.
    steps, of 23*capacity numbers: for each step its start, its length, what ends it (0 nothing, 1 a row of the
    table, 2 the force crosses zero, 3 a film is reached), and for each component its value at the start and its 8 stages. Of a panel
    of the gap, ln h at its start and the times at its 16 nodes, from its start. Then its length in ln h; 0 of a step in time. Last, the estimated errors within the step, of u at a given time, and of the time at a given u.

    Returns 0 at t_end, 1 after the step in which u passes u_stop, 2 when steps is full, 3 at the end of the table;
    -1 if the step falls below rounding, -2 if t overflows, -3 if there is no rate at the start.
    """
    state[9] = 0.0
    if state[13] == 1.0:
        ended: int = _by_gap(t_end, u_stop, rtol, p, c, capacity, state, steps)
        if ended != 2 or state[9] == float(capacity):
            return ended
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
    stored: int = int(state[9])
    while status == 2 and stored < capacity:
        limit = t_end
        ending = 0.0
        if t >= t_end:
            status = 0
            break
        if fresh == 1.0:
            # the rates where the run starts, or goes on after an event
            given[0] = _given(t, c)
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
                        given[0] = _given(t + dt, c)
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
            given[i] = _given(t + _NODES[i + 1] * step, c)
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
        probe_given = _given(t + 0.5501108282781375 * step, c)
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
        base: int = 23 * stored
        steps[base] = t
        steps[base + 1] = step
        steps[base + 2] = ending if landing == 1.0 else 0.0
        steps[base + 3] = u
        for i in range(8):
            steps[base + 4 + i] = u_z[i]
            u_kept[i] = u_z[i]
        for i in range(8):
            before[i] = deflection[i] - delta
        steps[base + 20] = 0.0
        # the errors so far grow, or decay, as a perturbation of the start of the step does, and its own joins them
        growth = 0.0
        for i in range(8):
            growth += _QUADRATURE[i] * slopes[i]
        growth = exp(step * growth)
        late = u_astray * (growth if growth > 1.0 else 1.0) + u_error
        u_astray = u_astray * growth + u_error * left + unsolved + 0.25 * rounding + 1.1e-16 * fabs((t + step) * u_dot)
        slowest = fabs(u_dot) if fabs(u_dot) < fabs(u_rate[7]) else fabs(u_rate[7])
        steps[base + 21] = late
        steps[base + 22] = late / slowest if slowest > 0.0 else inf
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
    state[9] = float(stored)
    state[10] = stiffest
    state[11] = settled
    state[15] = u_astray
    return status




_PANEL_CHEBYSHEV = table((0.05940500842867555, -0.11335484212576429, 0.11311453403700521, -0.10188136514399497, 0.0964806652745314, -0.07977180900606219, 0.0702006736240793, -0.048530802591567036, 0.03619313443703034, -0.009895330690004773, -0.0034485189224496677, 0.0353176946542243, -0.04756540576951505, 0.09195979276338441, -0.10039503323331167, 0.22615666213978455, -0.2239850578760454, 0.062169388583668564, -0.11973117732095136, 0.095858469130211, -0.06626891262896334, 0.023481533890214484, 0.016030166990628484, -0.05956805562747903, 0.08912041092503738, -0.11506558245196645, 0.11874026187041992, -0.11713520848721426, 0.08940137339629894, -0.06358623584012477, 0.008281137360499815, 0.025569435887776115, -0.13557326059296984, 0.14827625491491436, 0.0627747915448232, -0.10545585912990205, 0.05932223861156992, 0.008191740173845162, -0.0690934915301728, 0.11505626672283138, -0.12345707536832813, 0.10211677658298535, -0.046128044157439145, -0.016131460300427947, 0.08070647841950175, -0.1124531994767381, 0.12196816676310503, -0.07918851825110493, 0.03159179763258936, 0.08786425367851113, -0.11768486191564917, 0.06206027200104957, -0.09372374370049348, 0.011192376506035747, 0.0733922928746669, -0.1234839081577155, 0.10538061665671683, -0.03653110394271798, -0.05597280085046234, 0.11476479601666666, -0.11981030317723822, 0.05676678622797491, 0.027471943754088783, -0.105827611176098, 0.1144295436120225, -0.07869625998385212, -0.051167549169300976, 0.09975465250865671, 0.06291940085695753, -0.07327110739151191, -0.035612765942874686, 0.11894323454490488, -0.10276192961922889, 0.006907680922427637, 0.09802728885864932, -0.11946217227503103, 0.048202807812152366, 0.06722546307132765, -0.12306388438290754, 0.08647942829631511, 0.0274925337888945, -0.10624044275950925, 0.11215168734484413, 0.019417915591076928, -0.08735513871648673, 0.062058114899098155, -0.054402334043166696, -0.08038279361024582, 0.12007966724073227, -0.02494211588469616, -0.10196532104981368, 0.10886895686316445, 0.005380636100223644, -0.11708805735421615, 0.08999188690852174, 0.03569046081485217, -0.12692610746336624, 0.06610384202533222, 0.05894841990944237, -0.12820489660612186, 0.008893152397426584, 0.07789648885283298, 0.06299228653953644, -0.0292145148589211, -0.10940242685903624, 0.08483663353371777, 0.07086823856549902, -0.11629335818088117, -0.011753535259955029, 0.12527930178664753, -0.045645473856419885, -0.09905776054790717, 0.097742219786329, 0.05755502079458837, -0.11971511300796517, 0.010824427508907955, 0.12508956895839546, -0.033929750036152194, -0.07017576486638359, 0.06200897490661758, -0.007134445794934285, -0.1255362487104098, 0.01682048568668984, 0.12161098599997094, -0.031113519774131404, -0.12115227779603839, 0.039789308473418834, 0.1143653909088051, -0.0545232624281398, -0.11285662057671746, 0.06010630151329791, 0.10173248086867015, -0.07931973890666609, -0.10371159729677842, 0.055374871230464986, 0.0635389116958803, 0.06312428892361918, 0.019714678804327073, -0.11842356363203713, -0.052545548077243154, 0.10498381279553518, 0.08592175873802936, -0.07729131531083085, -0.10606248416975306, 0.048624552808753815, 0.12381283917456194, -0.008643136026700238, -0.12158472660517965, -0.02245245254539865, 0.1234891994536786, 0.06766175911136721, -0.07274571731842111, -0.05758394612430851, 0.06187427430809957, 0.040874866805822536, -0.09792024949709614, -0.10903573445961036, 0.022316535412413168, 0.12200181007899888, 0.058087841161642, -0.08517356042541165, -0.11809265091307962, 0.002282423775657935, 0.11657455212092382, 0.07220742688675895, -0.07213102275583126, -0.1286895823779363, -0.022742500675441424, 0.08553234971571999, 0.052033220838369885, 0.06342321260349132, 0.06622503155727949, -0.056971603219319406, -0.1231847001241994, -0.06829566958506154, 0.05469766859969686, 0.1265324672893294, 0.07790492344423552, -0.04406654525198506, -0.12058403873426723, -0.07746898829264744, 0.04461591228274969, 0.12737490064772258, 0.09358556298803174, -0.023860280994793242, -0.09326036001352667, -0.04666749319673661, 0.061531891341892, 0.08204654725478353, -0.01408429473090539, -0.10255578205396505, -0.12542608893570198, -0.067916041430021, 0.03238260639529103, 0.109556150106438, 0.11312792953102607, 0.04026038087046504, -0.061377207461509375, -0.12628580980031698, -0.11203809256479762, -0.030609125244360432, 0.06460160825465633, 0.09550368029697691, 0.04128164817004893, 0.0642989524989542, 0.10412116447305632, 0.04018500956488355, -0.038114588627312394, -0.1002232249977097, -0.12170641574232245, -0.09419820568852942, -0.028199315085774935, 0.05048043690111287, 0.11152101207164168, 0.13106986867015763, 0.10234958999912395, 0.03662082620833413, -0.03813569393672145, -0.09259543330650732, -0.09183575315169072, -0.03563822985069594, 0.06034425914464996, 0.10873170638190353, 0.07518345509226862, 0.026303382460782294, -0.028619883302184644, -0.07932614092840698, -0.11619644116565929, -0.13246188102887443, -0.1250335716669926, -0.09567326027381406, -0.04994029050897433, 0.002800972425319581, 0.052542916534947734, 0.08798609857322329, 0.10233757204370214, 0.08163912238986677, 0.02938198382824243, 0.06996169729537498, 0.13633006093230632, 0.12571072322350174, 0.10873645557999681, 0.0863460321650538, 0.05991465021262164, 0.030932129924269757, 0.0012060231493956812, -0.027575485038370703, -0.05350560465254573, -0.07510102553325015, -0.09060177470859217, -0.09910157859303192, -0.09871618593282745, -0.08940302020877515, -0.0633636245803551, -0.02176947323477234, 0.03977051310357638, 0.07938033726532012, 0.07891612476669252, 0.07812229392584413, 0.07701093074865639, 0.07554298045579344, 0.07372600701637566, 0.07149841811042279, 0.06886363553348929, 0.06571558362338692, 0.062052946304902434, 0.05766383546870202, 0.05253960262052715, 0.04611809563357383, 0.038373369025066495, 0.025958455516956747, 0.008746870880713686))


@jit
def _coefficients(base: int, steps: array, out: array) -> None:
    """The time within a panel, from its start, by Chebyshev polynomials of 2 theta - 1."""
    for i in range(17):
        out[i] = (_PANEL_CHEBYSHEV[0 + i] * steps[base + 4] + _PANEL_CHEBYSHEV[17 + i] * steps[base + 5]) + (_PANEL_CHEBYSHEV[34 + i] * steps[base + 6] + _PANEL_CHEBYSHEV[51 + i] * steps[base + 7]) + (_PANEL_CHEBYSHEV[68 + i] * steps[base + 8] + _PANEL_CHEBYSHEV[85 + i] * steps[base + 9]) + (_PANEL_CHEBYSHEV[102 + i] * steps[base + 10] + _PANEL_CHEBYSHEV[119 + i] * steps[base + 11]) + (_PANEL_CHEBYSHEV[136 + i] * steps[base + 12] + _PANEL_CHEBYSHEV[153 + i] * steps[base + 13]) + (_PANEL_CHEBYSHEV[170 + i] * steps[base + 14] + _PANEL_CHEBYSHEV[187 + i] * steps[base + 15]) + (_PANEL_CHEBYSHEV[204 + i] * steps[base + 16] + _PANEL_CHEBYSHEV[221 + i] * steps[base + 17]) + (_PANEL_CHEBYSHEV[238 + i] * steps[base + 18] + _PANEL_CHEBYSHEV[255 + i] * steps[base + 19])


@jit
def _times_in_panel(theta: array, c: array, t: array) -> None:
    """The times, from the start of a panel, at 8 fractions of it: Clenshaw's recurrence."""
    for i in range(8):
        x = 2.0 * theta[i] - 1.0
        y = 2.0 * x
        b16 = c[16]
        b15 = c[15] + y * b16
        b14 = c[14] + (y * b15 - b16)
        b13 = c[13] + (y * b14 - b15)
        b12 = c[12] + (y * b13 - b14)
        b11 = c[11] + (y * b12 - b13)
        b10 = c[10] + (y * b11 - b12)
        b9 = c[9] + (y * b10 - b11)
        b8 = c[8] + (y * b9 - b10)
        b7 = c[7] + (y * b8 - b9)
        b6 = c[6] + (y * b7 - b8)
        b5 = c[5] + (y * b6 - b7)
        b4 = c[4] + (y * b5 - b6)
        b3 = c[3] + (y * b4 - b5)
        b2 = c[2] + (y * b3 - b4)
        b1 = c[1] + (y * b2 - b3)
        t[i] = c[0] + (x * b1 - b2)


@jit
def _fractions_of_panel(small: float, base: int, steps: array, t: array, c: array, theta: array) -> None:
    """The fractions of a panel at which 8 times, from its start, are reached: Halley's iteration between two nodes.

    It converges cubically, so that after a change of c1 and one of c2 there would be one of c2**4/c1**3.
    """
    low = empty(8)
    high = empty(8)
    f = empty(8)
    slope = empty(8)
    bend = empty(8)
    sizes = empty(8)
    at: int = 0
    for i in range(8):
        sizes[i] = 0.0
        while at > 0 and t[i] < steps[base + 3 + at]:
            at -= 1
        while at < 15 and t[i] > steps[base + 4 + at]:
            at += 1
        low[i] = 2.0 * _PANEL_NODES[at] - 1.0
        high[i] = 2.0 * _PANEL_NODES[at + 1] - 1.0
        start = steps[base + 3 + at] if at > 0 else 0.0
        theta[i] = low[i] + (high[i] - low[i]) * ((t[i] - start) / (steps[base + 4 + at] - start))
    for iteration in range(6):
        for i in range(8):
            x = theta[i]
            y = 2.0 * x
            b16 = c[16]
            b15 = c[15] + y * b16
            d15 = 2.0 * b16
            b14 = c[14] + (y * b15 - b16)
            d14 = 2.0 * b15 + (y * d15)
            e14 = 4.0 * d15
            b13 = c[13] + (y * b14 - b15)
            d13 = 2.0 * b14 + (y * d14 - d15)
            e13 = 4.0 * d14 + (y * e14)
            b12 = c[12] + (y * b13 - b14)
            d12 = 2.0 * b13 + (y * d13 - d14)
            e12 = 4.0 * d13 + (y * e13 - e14)
            b11 = c[11] + (y * b12 - b13)
            d11 = 2.0 * b12 + (y * d12 - d13)
            e11 = 4.0 * d12 + (y * e12 - e13)
            b10 = c[10] + (y * b11 - b12)
            d10 = 2.0 * b11 + (y * d11 - d12)
            e10 = 4.0 * d11 + (y * e11 - e12)
            b9 = c[9] + (y * b10 - b11)
            d9 = 2.0 * b10 + (y * d10 - d11)
            e9 = 4.0 * d10 + (y * e10 - e11)
            b8 = c[8] + (y * b9 - b10)
            d8 = 2.0 * b9 + (y * d9 - d10)
            e8 = 4.0 * d9 + (y * e9 - e10)
            b7 = c[7] + (y * b8 - b9)
            d7 = 2.0 * b8 + (y * d8 - d9)
            e7 = 4.0 * d8 + (y * e8 - e9)
            b6 = c[6] + (y * b7 - b8)
            d6 = 2.0 * b7 + (y * d7 - d8)
            e6 = 4.0 * d7 + (y * e7 - e8)
            b5 = c[5] + (y * b6 - b7)
            d5 = 2.0 * b6 + (y * d6 - d7)
            e5 = 4.0 * d6 + (y * e6 - e7)
            b4 = c[4] + (y * b5 - b6)
            d4 = 2.0 * b5 + (y * d5 - d6)
            e4 = 4.0 * d5 + (y * e5 - e6)
            b3 = c[3] + (y * b4 - b5)
            d3 = 2.0 * b4 + (y * d4 - d5)
            e3 = 4.0 * d4 + (y * e4 - e5)
            b2 = c[2] + (y * b3 - b4)
            d2 = 2.0 * b3 + (y * d3 - d4)
            e2 = 4.0 * d3 + (y * e3 - e4)
            b1 = c[1] + (y * b2 - b3)
            d1 = 2.0 * b2 + (y * d2 - d3)
            e1 = 4.0 * d2 + (y * e2 - e3)
            f[i] = c[0] + (x * b1 - b2) - t[i]
            slope[i] = b1 + (x * d1 - d2)
            bend[i] = 2.0 * d1 + (x * e1 - e2)
        left = 0.0
        for i in range(8):
            change = 2.0 * f[i] * slope[i] / (2.0 * slope[i] * slope[i] - f[i] * bend[i])
            x = theta[i] - change
            x = x if x > low[i] else low[i]
            theta[i] = x if x < high[i] else high[i]
            size = fabs(change)
            before = sizes[i]
            left += 0.0 if size <= 1e-6 or (size * size) * (size * size) <= small * (before * before * before) else 1.0
            sizes[i] = size
        if left == 0.0:
            break
    for i in range(8):
        theta[i] = 0.5 * (1.0 + theta[i])


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
def _states(small: float, base: int, t: array, steps: array, c: array, u: array) -> None:
    """The state at 8 times, in increasing order, within a step; c: the coefficients of a panel."""
    theta = empty(8)
    if steps[base + 20] != 0.0:
        for i in range(8):
            u[i] = t[i] - steps[base]
        _fractions_of_panel(small, base, steps, u, c, theta)
        for i in range(8):
            u[i] = steps[base + 3] + theta[i] * steps[base + 20]
        return
    for i in range(8):
        theta[i] = (t[i] - steps[base]) / steps[base + 1]
    _values(theta, base + 3, steps, u)


@jit
def rognon_gay_sample(n: int, t: array, stored: int, steps: array, out: array) -> None:
    """The state at n times, in increasing order, from the 23 numbers of each of the steps stored: out[k*n + i] is component k."""
    lane = empty(8)
    u = empty(8)
    c = empty(17)
    known: int = -1
    at: int = 0
    i: int = 0
    while i < n:
        while at < stored - 1 and t[i] >= steps[23 * (at + 1)]:
            at += 1
        if known != at and steps[23 * at + 20] != 0.0:
            known = at
            _coefficients(23 * at, steps, c)
        m: int = 1
        while m < 8 and i + m < n and (at == stored - 1 or t[i + m] < steps[23 * (at + 1)]):
            m += 1
        for k in range(8):
            lane[k] = t[i + k if k < m else i + m - 1]
        _states(1e-17, 23 * at, lane, steps, c, u)
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
    theta = empty(8)
    t = empty(8)
    c = empty(17)
    for i in range(n):
        base: int = 23 * int(at[i])
        if steps[base + 20] != 0.0:
            for k in range(8):
                theta[k] = (u[i] - steps[base + 3]) / steps[base + 20]
            _coefficients(base, steps, c)
            _times_in_panel(theta, c, t)
            out[i] = steps[base] + t[0]
            continue
        out[i] = _passage(u[i], base, steps)


@jit
def _write(small: float, i: int, m: int, total: int, t: array, u: array, delta: array, p: array, c: array, work: array, terms: array, out: array) -> None:
    """Write m outputs, of 8 at most, from number i on: all that follows from the time and the state."""
    w = empty(2)
    h = empty(8)
    given = empty(8)
    rate = empty(8)
    for k in range(8):
        lane: int = k if k < m else m - 1
        t[k] = t[lane]
        u[k] = u[lane]
        _drive(t[k], c, w)
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
        _quantities(5 * total + i + k, total, h[k], delta[k], given[k], p, out)


@jit
def _collect(small: float, start: float, worst: array, j: int, first: int, count: int, total: int, at_gaps: int, targets: array, stored: int, steps: array, p: array, c: array, out: array) -> int:
    """Write the outputs of a run from number j on, as far as the stored steps reach; returns how far that is."""
    lane = empty(8)
    t = empty(8)
    u = empty(8)
    found_u = empty(8)
    delta = empty(8)
    z = empty(8)
    work = empty(40)
    terms = empty(8)
    c_panel = empty(17)
    # outputs gathered and not written yet
    gathered: int = 0
    delta[7] = out[2 * total + first + j - 1] if j > 0 else nan
    for at in range(stored):
        base: int = 23 * at
        begin = steps[base + 3]
        panel = steps[base + 20]
        end = begin + (panel if panel != 0.0 else steps[base + 11])
        known: int = 0
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
            if panel != 0.0:
                if known == 0:
                    known = 1
                    _coefficients(base, steps, c_panel)
                if at_gaps == 1:
                    for k in range(8):
                        z[k] = (lane[k] - begin) / panel
                        found_u[k] = lane[k]
                    _times_in_panel(z, c_panel, lane)
                    for k in range(8):
                        lane[k] = steps[base] + lane[k]
                else:
                    _states(small, base, lane, steps, c_panel, found_u)
                for k in range(m):
                    t[gathered + k] = lane[k]
                    u[gathered + k] = found_u[k]
            else:
                for k in range(m):
                    t[gathered + k] = _passage(lane[k], base, steps) if at_gaps == 1 else lane[k]
                    for i in range(8):
                        z[i] = steps[base + 4 + i]
                    u[gathered + k] = lane[k] if at_gaps == 1 else begin + _between((lane[k] - steps[base]) / steps[base + 1], z)
            for k in range(m):
                # as far from the curve (t, h), where outputs are at gaps, as the smaller of the errors of h and of t
                error = steps[base + 21]
                late = steps[base + 22] / (t[gathered + k] - start)
                error = late if at_gaps == 1 and late < error else error
                if not error <= worst[0]:
                    worst[0] = error
            gathered += m
            j += m
            if gathered == 8:
                _write(small, first + j - 8, 8, total, t, u, delta, p, c, work, terms, out)
                gathered = 0
    if gathered > 0:
        _write(small, first + j - gathered, gathered, total, t, u, delta, p, c, work, terms, out)
    return j


@jit
def rognon_gay_runs(n: int, count: int, at_gaps: int, settings: array, runs: array, targets: array, out: array) -> None:
    """Make n runs, each with its own parameters, start and end, and write the outputs asked for.

    settings: rtol, the time of the start, longest step, steps that a run may take, whether ln h may serve as the
    independent variable.
    runs: of each run t_end, u_stop, ln h, delta (which follows from the force here), 3 parameters, 1 constants of the drive.
    targets: the times, or with at_gaps = 1 the values of ln h, of the count outputs of each run, in the order of passage.
    out: t, h, delta, what is given, its rate, a, X, dh_dt, each n*count numbers; the status of each run, as
    rognon_gay_integrate returns it, or 10 if it took too many steps, 11 if the gap left the range of double precision;
    and the largest estimated error of its outputs, relative.
    What a run does not reach is left as it is.
    """
    state = empty(20)
    worst = empty(1)
    steps = empty(736)
    p = empty(3)
    c = empty(1)
    for run in range(n):
        at: int = 8 * run
        for k in range(3):
            p[k] = runs[at + 4 + k]
        for k in range(1):
            c[k] = runs[at + 7 + k]
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
            ended = rognon_gay_integrate(runs[at], runs[at + 1], settings[0], p, c, 32, state, steps)
            j = _collect(1e-3 * settings[0], settings[1], worst, j, count * run, count, count * n, at_gaps, targets, int(state[9]), steps, p, c, out)
            if ended == 2 and state[4] + state[5] > settings[3]:
                ended = 10
            elif ended == 2 and not fabs(state[1]) < 690.0:
                ended = 11
        if state[17] > 0.0:
            ended = 12
        out[8 * n * count + run] = float(ended)
        out[8 * n * count + n + run] = worst[0]
