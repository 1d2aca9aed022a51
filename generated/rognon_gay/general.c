/* Contact law rognon_gay: written by softdyn 0.1.0 with sympy 1.14.0; do not edit.
 *
 * Source: Rognon & Gay, arXiv:0803.1573, eqs. 3-5
 * Law b2a8534843dae832:
 *     a = sqrt(2)*sqrt(R)*sqrt(R*h/(R + h) + Abs(delta))
 *     F_ela = 4*E*a*delta/9
 *     zeta = 3*pi*a**4*eta*(R + h)**3/(2*R**3*h**3)
 *     F_adh = 0
 * Left out, with the operations that each saved:
 *     no remote force: 72 -> 71
 * Operations, 157 in all:
 *     gap_terms: 1 add, 1 mul, 1 div
 *     newton: 3 add, 11 mul, 1 div, 1 sqrt
 *     gap_rate: 2 add, 15 mul, 3 div, 1 sqrt
 *     slopes: 6 add, 36 mul, 8 div, 1 sqrt
 *     quantities: 10 add, 43 mul, 12 div, 1 sqrt
 *
 * A C API that depends on math.h alone; all arrays are of the lengths given, and may not overlap.
 *
 *   void rognon_gay_evaluate(n, h, delta, F, dF_dt, p, out)
 *       a, F_ela, zeta, F_adh, C, D, dh_dt, ddelta_dt, dX_dt, X, lambda1, lambda2 at n states; out holds them one after the other, n each.
 *   void rognon_gay_solve_delta(n, h, F, p, delta)
 *       The deflection at n gaps under n forces; on entry delta holds guesses, or nan for that of the state before.
 *   void rognon_gay_drive(n, t, table_t, table_F, rows, value, rate)
 *       The external force at n times, in increasing order.
 *   int64_t rognon_gay_integrate(t_end, u_stop, rtol, p, table_t, table_F, rows, capacity, state, steps)
 *       The state from one time on; see there.
 *   void rognon_gay_passages(n, u, at, steps, out)
 *       The times at which ln h passes n values within given steps.
 *   void rognon_gay_sample(n, t, stored, steps, out)
 *       The state at n times, from the steps.
 *   void rognon_gay_runs(n, count, at_gaps, settings, runs, targets, table_t, table_F, rows, out)
 *       n runs with their outputs; see there.
 *
 *   p: R, E, eta
 */
#include <math.h>
#include <stdint.h>

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__) || \
    defined(__ASSOCIATIVE_MATH__) || defined(__RECIPROCAL_MATH__) || defined(__NO_SIGNED_ZEROS__)
#error "this code relies on IEEE arithmetic: compile it without -ffast-math and its parts"
#endif

static const double _NODES[9] = {
    0.0, 0.022479386438712497, 0.11467905316090424, 0.26578982278458946,
    0.45284637366944464, 0.6473752828868303, 0.8197593082631076, 0.9437374394630779,
    1.0,
};
static const double _WEIGHTS[9] = {
    6435.0, -10269.771635486373, 6713.600026233208, -5199.222168253645,
    4231.204479179782, -3470.1488650701895, 2771.535521741593, -2016.5723583443762,
    804.375,
};
static const double _INVERSE[64] = {
    22.24259996433592, -16.591130197062395, 8.118236017822703, -5.639723637389978,
    4.735927090795289, -4.647608208611454, 5.527970024131676, -13.060996041930576,
    7.090311673892601, 4.3599941420728205, -8.545188959239656, 4.6920195582474715,
    -3.631848592579311, 3.435551489028797, -4.015656325439553, 9.427491723502559,
    -2.0807353791506724, 5.124924766028432, 1.8811856479742912, -6.56903294216823,
    3.9264353565757815, -3.3863518751042307, 3.803018407185814, -8.803581949472228,
    0.9573357504593115, -1.8637038978972118, 4.350635666704743, 1.1041272031140856,
    -6.268039956795005, 4.160835466074826, -4.274300739417069, 9.613824007769752,
    -0.5407289808993253, 0.9703156119145759, -1.74911317938708, 4.215993576843231,
    0.7723495369955398, -7.263244082291598, 5.806461483798834, -12.234234226309493,
    0.33849233242014465, -0.5854993702775402, 0.9622684139381908, -1.7852268638042161,
    4.633138954070064, 0.6099351296899472, -11.085659975292161, 19.11652897579454,
    -0.21314332000182057, 0.3623040837769572, -0.5721096798557673, 0.9708780178916415,
    -1.9608436116902346, 5.868786019458078, 0.5298083758173946, -44.55903248935456,
    0.08012570308363981, -0.1353325797521185, 0.21071710374962413, -0.3474443618639409,
    0.6573515746603226, -1.6102201966976866, 7.089657599491891, 32.5,
};
static const double _QUADRATURE[8] = {
    0.0572544073721286, 0.12482395066493249, 0.17350739781725064, 0.19578608372624678,
    0.1882587726945593, 0.15206531032339257, 0.09267907740148965, 0.015625,
};
static const double _SLOPE_START[9] = {
    -64.0, 70.99500301886783, -9.097515706789968, 3.0398452598441437,
    -1.4519931522612475, 0.8329970067575939, -0.5253945230439019, 0.33205809662554375,
    -0.125,
};
static const double _VALUE_PROBE[9] = {
    0.18989107933999777, -0.31596306961520165, 0.250288877906427, -0.29684903041710314,
    0.7061810563740808, 0.5791621282707715, -0.16685094781148993, 0.08316403720092917,
    -0.029024131248411467,
};
static const double _SLOPE_PROBE[9] = {
    -0.14484807076009093, 0.26548555931664297, -0.310746422732583, 0.7308813056886966,
    -6.515387609459459, 6.565537203893002, -0.7948031499501251, 0.2990161802065628,
    -0.09513499620264546,
};

/* What Newton's iteration for delta uses of the gap alone: out[k*n + i] is term k of state i. */
static inline void _gap_terms(int64_t i, int64_t n, double h, const double *restrict p, double *restrict out)
{
    const double R = p[0];
    const double gap0 = R * h / (R + h);
    out[0 * n + i] = gap0;
}

/* A step of Newton's iteration for delta at a given gap: out[i] = (F_ela - F)/(dF_ela/d(delta)). */
static inline void _newton(int64_t i, int64_t n, double delta, double F, const double *restrict terms, const double *restrict p, double *restrict out)
{
    const double gap0 = terms[0 * n + i];
    const double R = p[0];
    const double E = p[1];
    const double x0 = fabs(delta);
    const double a = sqrt(2.0 * R * (gap0 + x0));
    const double a_p2 = a * a;
    const double newton = a * (4.0 * delta * E * a - 9.0 * F) / (4.0 * E * (x0 * R + a_p2));
    out[i] = newton;
}

/* w[i] = d(ln h)/dt (eq. 7). */
static inline void _gap_rate(int64_t i, double h, double delta, double F, const double *restrict p, double *restrict w, const double *restrict out)
{
    (void)out;
    const double R = p[0];
    const double eta = p[2];
    const double x0 = R + h;
    const double a = sqrt(2.0 * R * (R * h / x0 + fabs(delta)));
    const double R_p2 = R * R;
    const double R_p3 = R_p2 * R;
    const double a_p2 = a * a;
    const double a_p4 = a_p2 * a_p2;
    const double h_p2 = h * h;
    const double h_p3 = h_p2 * h;
    const double x0_p2 = x0 * x0;
    const double x0_p3 = x0_p2 * x0;
    const double zeta = 4.71238898038469 * eta * x0_p3 * a_p4 / (R_p3 * h_p3);
    const double dh_dt = -F / zeta;
    w[i] = dh_dt / h;
}

/* The Jacobian of the rates of the state (ln h, delta following from the force balance). */
static inline void _slopes(int64_t i, double h, double delta, double F, const double *restrict p, double *restrict out)
{
    const double R = p[0];
    const double E = p[1];
    const double eta = p[2];
    const double x0 = fabs(delta);
    const double x1 = R + h;
    const double a = sqrt(2.0 * R * (R * h / x1 + x0));
    const double R_p2 = R * R;
    const double R_p3 = R_p2 * R;
    const double a_p2 = a * a;
    const double a_p4 = a_p2 * a_p2;
    const double h_p2 = h * h;
    const double h_p3 = h_p2 * h;
    const double x1_p2 = x1 * x1;
    const double x1_p3 = x1_p2 * x1;
    const double zeta = 4.71238898038469 * eta * x1_p3 * a_p4 / (R_p3 * h_p3);
    const double x3 = 1.0 / a;
    const double x4 = 4.0 / 9.0 * E;
    const double dF_ddelta = x4 * (x0 * x3 * R + a);
    const double x5 = 1.0 / x1_p2;
    const double dF_dh = delta * x3 * x4 * x5 * R_p3;
    const double dh_dt = -F / zeta;
    const double x6 = 1.0 / h;
    const double x7 = dF_dh / dF_ddelta;
    const double x9 = R / a_p2;
    const double slope_p11 = -dh_dt * x6 - dh_dt * (x5 * x6 * x9 * (4.0 * h * R_p2 - 3.0 * x1 * a_p2) - 4.0 * x7 * x9 * (delta > 0.0 ? 1.0 : (delta < 0.0 ? -1.0 : 0.0)));
    const double slope_p21 = -x7 * h;
    out[0 + i] = slope_p11;
    out[8 + i] = slope_p21;
}

/* a, F_ela, zeta, F_adh, C, D, dh_dt, ddelta_dt, dX_dt, X, lambda1, lambda2 at state i of n. */
static inline void _quantities(int64_t i, int64_t n, double h, double delta, double F, double dF_dt, const double *restrict p, double *restrict out)
{
    const double R = p[0];
    const double E = p[1];
    const double eta = p[2];
    const double x0 = fabs(delta);
    const double x1 = R + h;
    const double a = sqrt(2.0 * R * (R * h / x1 + x0));
    const double x2 = 4.0 / 9.0 * E;
    const double x3 = delta * x2;
    const double F_ela = x3 * a;
    const double R_p2 = R * R;
    const double R_p3 = R_p2 * R;
    const double a_p2 = a * a;
    const double a_p4 = a_p2 * a_p2;
    const double h_p2 = h * h;
    const double h_p3 = h_p2 * h;
    const double x1_p2 = x1 * x1;
    const double x1_p3 = x1_p2 * x1;
    const double zeta = 4.71238898038469 * eta * x1_p3 * a_p4 / (R_p3 * h_p3);
    const double F_adh = 0.0;
    const double x5 = 1.0 / a;
    const double dF_ddelta = x2 * (x0 * x5 * R + a);
    const double x6 = 1.0 / x1_p2;
    const double x7 = x5 * x6 * R_p3;
    const double dF_dh = x3 * x7;
    const double C = dF_ddelta / 2.0;
    const double D = C * zeta / (C + dF_dh);
    const double dh_dt = -F / zeta;
    const double x8 = 1.0 / dF_ddelta;
    const double ddelta_dt = x8 * (dF_dt - dF_dh * dh_dt);
    const double dX_dt = -F / D - dF_dt / C;
    const double X = 2.0 * R + h - 2.0 * delta;
    const double lambda1 = -x2 * x7 * x8 * h;
    const double x10 = R / a_p2;
    const double lambda2 = -h * (x10 * x6 * (4.0 * h * R_p2 - 3.0 * x1 * a_p2) / h - 4.0 * dF_dh * x10 * x8 * (delta > 0.0 ? 1.0 : (delta < 0.0 ? -1.0 : 0.0)));
    out[0 * n + i] = a;
    out[1 * n + i] = F_ela;
    out[2 * n + i] = zeta;
    out[3 * n + i] = F_adh;
    out[4 * n + i] = C;
    out[5 * n + i] = D;
    out[6 * n + i] = dh_dt;
    out[7 * n + i] = ddelta_dt;
    out[8 * n + i] = dX_dt;
    out[9 * n + i] = X;
    out[10 * n + i] = lambda1;
    out[11 * n + i] = lambda2;
}

/* The deflection at the gap h under the force F (eq. 1): Newton's iteration, kept between bounds.

   F_ela rises with delta and vanishes with it, so the sign of F bounds delta from one side, and the sign of each step
   from the other. Returns nan if there is no solution. Uses w[0], and of terms as many as the law has. */
static inline double _solve_delta(double h, double F, double guess, const double *restrict p, double *restrict w, double *restrict terms)
{
    if (F == 0.0) {
        return 0.0;
    }
    double low = F > 0.0 ? 0.0 : -INFINITY;
    double high = F > 0.0 ? INFINITY : 0.0;
    _gap_terms(0, 1, h, p, terms);
    double delta = guess;
    if (!(low < guess && guess < high)) {
        /* start from the linear response, or from R where that is beyond R, or none, the stiffness having no bound */
        _newton(0, 1, 0.0, F, terms, p, w);
        delta = -w[0];
        if (!(fabs(delta) < p[0]) || delta == 0.0) {
            delta = F > 0.0 ? p[0] : -p[0];
        }
    }
    for (int64_t iteration = 0; iteration < 400; iteration++) {
        _newton(0, 1, delta, F, terms, p, w);
        const double step = w[0];
        double trial = delta - step;
        /* Newton's iteration converges quadratically: after a step of 1e-9 what is left is below rounding */
        if (fabs(step) <= 1e-09 * fabs(delta) && low <= trial && trial <= high) {
            return trial;
        }
        const double residual = step;
        if (residual > 0.0) {
            high = delta;
        } else if (residual < 0.0) {
            low = delta;
        } else {
            return NAN;
        }
        if (!(low < trial && trial < high)) {
            if (high == INFINITY || low == -INFINITY) {
                trial = 2.0 * delta;
            } else if (low == 0.0 || high == 0.0) {
                trial = 0.001 * delta;
            } else if (0.5 * (low + high) == low || 0.5 * (low + high) == high) {
                return delta;
            } else {
                trial = 0.5 * (low + high);
            }
        }
        delta = trial;
    }
    return NAN;
}

/* What is given, and its rate of change, at the time t: w[0] and w[1]. */
static inline void _drive(double t, const double *restrict table_t, const double *restrict table_F, int64_t segment, double *restrict w)
{
    /* linear between two rows */
    const double start = table_t[segment];
    const double slope = (table_F[segment + 1] - table_F[segment]) / (table_t[segment + 1] - start);
    w[0] = table_F[segment] + slope * (t - start);
    w[1] = slope;
}

/* What the integration needs of the drive at the time t: its value. */
static inline double _given(double t, const double *restrict table_t, const double *restrict table_F, int64_t segment)
{
    const double start = table_t[segment];
    const double slope = (table_F[segment + 1] - table_F[segment]) / (table_t[segment + 1] - start);
    return table_F[segment] + slope * (t - start);
}

/* a, F_ela, zeta, F_adh, C, D, dh_dt, ddelta_dt, dX_dt, X, lambda1, lambda2 at n states: out[k*n + i] is quantity k at state i. */
void rognon_gay_evaluate(int64_t n, const double *restrict h, const double *restrict delta, const double *restrict F, const double *restrict dF_dt, const double *restrict p, double *restrict out)
{
    for (int64_t i = 0; i < n; i++) {
        _quantities(i, n, h[i], delta[i], F[i], dF_dt[i], p, out);
    }
}

/* The deflection at n gaps under n forces, from guesses, or nan for that of the state before; nan if there is none. */
void rognon_gay_solve_delta(int64_t n, const double *restrict h, const double *restrict F, const double *restrict p, double *restrict delta)
{
    double w[2];
    double terms[1];
    double guess = NAN;
    for (int64_t i = 0; i < n; i++) {
        guess = delta[i] != delta[i] ? guess : delta[i];
        delta[i] = _solve_delta(h[i], F[i], guess, p, w, terms);
        guess = delta[i];
    }
}

/* What is given, and its rate of change, at n times, in increasing order. */
void rognon_gay_drive(int64_t n, const double *restrict t, const double *restrict table_t, const double *restrict table_F, int64_t rows, double *restrict value, double *restrict rate)
{
    double w[2];
    int64_t segment = 0;
    for (int64_t i = 0; i < n; i++) {
        while (segment < rows - 2 && t[i] >= table_t[segment + 1]) {
            segment += 1;
        }
        _drive(t[i], table_t, table_F, segment, w);
        value[i] = w[0];
        rate[i] = w[1];
    }
}

/* A component at the fraction theta of a step, less its value at the start: barycentric interpolation. */
static inline double _between(double theta, const double *restrict z)
{
    double above = 0.0;
    double below = _WEIGHTS[0] / theta;
    if (theta == 0.0) {
        return 0.0;
    }
    for (int64_t j = 0; j < 8; j++) {
        if (theta == _NODES[j + 1]) {
            return z[j];
        }
        const double weight = _WEIGHTS[j + 1] / (theta - _NODES[j + 1]);
        above += weight * z[j];
        below += weight;
    }
    return above / below;
}

/* The matrix, by columns, from the stages of a step to those of the next, ratio times as long, by its polynomial. */
static inline void _extrapolation(double ratio, double *restrict m, double *restrict sums)
{
    for (int64_t i = 0; i < 8; i++) {
        sums[i] = _WEIGHTS[0] / (1.0 + ratio * _NODES[i + 1]);
    }
    for (int64_t j = 0; j < 8; j++) {
        for (int64_t i = 0; i < 8; i++) {
            m[8 * j + i] = _WEIGHTS[j + 1] / (1.0 + ratio * _NODES[i + 1] - _NODES[j + 1]);
            sums[i] += m[8 * j + i];
        }
    }
    for (int64_t i = 0; i < 8; i++) {
        sums[i] = 1.0 / sums[i];
    }
    for (int64_t j = 0; j < 8; j++) {
        for (int64_t i = 0; i < 8; i++) {
            m[8 * j + i] = m[8 * j + i] * sums[i];
        }
    }
}

/* Stages of the next step, measured from the end of the last, whose stages are z. */
static inline void _predict(double *restrict z, const double *restrict m, double *restrict scratch)
{
    for (int64_t i = 0; i < 8; i++) {
        scratch[i] = m[0 + i] * z[0] + m[8 + i] * z[1] + (m[16 + i] * z[2] + m[24 + i] * z[3]) + (m[32 + i] * z[4] + m[40 + i] * z[5]) + (m[48 + i] * z[6] + m[56 + i] * z[7]);
    }
    const double end = z[7];
    for (int64_t i = 0; i < 8; i++) {
        z[i] = scratch[i] - end;
    }
}

/* Invert a matrix of 8 rows in place, by Gauss and Jordan: a poor inverse costs iterations, not accuracy. */
static inline void _invert(double *restrict m)
{
    for (int64_t k = 0; k < 8; k++) {
        const double pivot = 1.0 / m[9 * k];
        m[9 * k] = 1.0;
        for (int64_t j = 0; j < 8; j++) {
            m[8 * k + j] = pivot * m[8 * k + j];
        }
        for (int64_t i = 0; i < 8; i++) {
            if (i != k) {
                const double factor = m[8 * i + k];
                m[8 * i + k] = 0.0;
                for (int64_t j = 0; j < 8; j++) {
                    m[8 * i + j] -= factor * m[8 * k + j];
                }
            }
        }
    }
}

/* The part of the error within a step that is left at its end.

   If the coefficients of the solution fall by a factor r from one order to the next, the end, of order 15, errs by r^7
   of what the polynomial, of order 9, does on the way; the two probes of the defect differ by some r. Where they do,
   or the step is long, r^7 is not reached: bounds that measured steps keep to. */
static inline double _left(double apart, double error)
{
    const double left = apart * apart * apart + 30.0 * sqrt(error);
    return left < 1.0 ? left : 1.0;
}

/* Deflections of 8 states at once, from guesses in delta: Newton's iteration, to an error of ``small``, relative.

   It converges quadratically, so that after a change of c1 and one of c2 there would be one of c2**3/c1**2.
   w, of 40 numbers: the last changes, stiffnesses, relative changes, the sizes that these are relative to, what is
   left to do. */
static inline void _deflections(double small, const double *restrict h, const double *restrict F, double *restrict delta, const double *restrict p, double *restrict w, double *restrict terms)
{
    /* of an iteration that has just begun, whose change leaves about its square */
    const double enough = sqrt(0.1 * small);
    for (int64_t i = 0; i < 8; i++) {
        _gap_terms(i, 8, h[i], p, terms);
    }
    for (int64_t i = 0; i < 8; i++) {
        w[16 + i] = 0.0;
        w[24 + i] = 1.0 / fabs(delta[i]);
    }
    for (int64_t iteration = 0; iteration < 7; iteration++) {
        for (int64_t i = 0; i < 8; i++) {
            _newton(i, 8, delta[i], F[i], terms, p, w);
        }
        double left = 0.0;
        for (int64_t i = 0; i < 8; i++) {
            delta[i] = delta[i] - w[i];
            const double size = fabs(w[i]) * w[24 + i];
            const double before = w[16 + i];
            w[32 + i] = size <= enough || size * size * size <= small * (before * before) ? 0.0 : 1.0;
            w[16 + i] = size;
            left += w[32 + i];
        }
        if (left == 0.0) {
            break;
        }
    }
    /* on the branch where F_ela rises from 0 with delta: a law may have others */
    for (int64_t i = 0; i < 8; i++) {
        if (w[32 + i] != 0.0 || !(delta[i] * F[i] >= 0.0)) {
            delta[i] = _solve_delta(h[i], F[i], NAN, p, w, terms);
        }
    }
}

/* Integrate the state, u = ln h, by collocation: Radau IIA with 8 stages, which is L-stable.

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
   -1 if the step falls below rounding, -2 if t overflows, -3 if there is no rate at the start. */
int64_t rognon_gay_integrate(double t_end, double u_stop, double rtol, const double *restrict p, const double *restrict table_t, const double *restrict table_F, int64_t rows, int64_t capacity, double *restrict state, double *restrict steps)
{
    double moves;
    double contraction;
    double w[4];
    double work[40];
    double terms[8];
    double given[8];
    double h[8];
    double deflection[8];
    double before[8];
    double above[8];
    double below[8];
    double slopes[16];
    double m[64];
    double residual[8];
    double change[8];
    double u_z[8];
    double u_kept[8];
    double u_rate[8];
    /* copied by the first step, too, which goes on from none */
    for (int64_t i = 0; i < 8; i++) {
        before[i] = 0.0;
        u_kept[i] = 0.0;
    }
    double t = state[0];
    double u = state[1];
    double delta = state[2];
    double dt = state[3];
    double accepted = state[4];
    double rejected = state[5];
    double passes = state[6];
    double singles = state[7];
    int64_t segment = (int64_t)state[8];
    double u_astray = state[15];
    double stiffest = state[10];
    double settled = state[11];
    /* the last step, of which the next one is predicted; 0 after what cannot be extrapolated */
    double last = 0.0;
    double last_error = 1.0;
    double fresh = 1.0;
    double crossing = INFINITY;
    double shrink_only = 0.0;
    double u_dot = 0.0;
    int64_t status = 2;
    int64_t stored = 0;
    while (status == 2 && stored < capacity) {
        if (t >= table_t[segment + 1] && segment < rows - 2) {
            segment += 1;
            continue;
        }
        double limit = table_t[segment + 1] < t_end ? table_t[segment + 1] : t_end;
        double ending = table_t[segment + 1] < t_end ? 1.0 : 0.0;
        if (t >= t_end) {
            status = 0;
            break;
        }
        if (t >= table_t[rows - 1]) {
            status = 3;
            break;
        }
        if (fresh == 1.0) {
            /* the rates where the run starts, or goes on after an event */
            given[0] = _given(t, table_t, table_F, segment);
            for (int64_t i = 0; i < 8; i++) {
                h[i] = exp(u);
                given[i] = given[0];
                deflection[i] = delta;
            }
            _deflections(0.001 * rtol, h, given, deflection, p, work, terms);
            delta = deflection[0];
            for (int64_t i = 0; i < 8; i++) {
                _gap_rate(i, h[i], deflection[i], given[i], p, u_rate, w);
            }
            for (int64_t i = 0; i < 8; i++) {
                _slopes(i, h[i], deflection[i], given[i], p, slopes);
            }
            singles += 8.0;
            u_dot = u_rate[0];
            if (!isfinite(u_dot)) {
                status = -3;
                break;
            }
            fresh = 0.0;
            last = 0.0;
            if (dt == 0.0) {
                const double speed = fabs(u_dot) + fabs(slopes[0]);
                if (speed > 0.0) {
                    dt = 0.1 / speed;
                } else {
                    /* nothing moves yet: look ahead until something does */
                    dt = isfinite(t_end) ? 1e-09 * (t_end - t) : 1e-200;
                    int64_t moving = 0;
                    while (moving == 0 && dt < 1e+200 && t + dt < limit) {
                        given[0] = _given(t + dt, table_t, table_F, segment);
                        deflection[0] = _solve_delta(h[0], given[0], NAN, p, w, terms);
                        _gap_rate(0, h[0], deflection[0], given[0], p, u_rate, w);
                        singles += 1.0;
                        if (fabs(u_rate[0]) * dt < 0.001) {
                            dt = 4.0 * dt;
                        } else {
                            moving = 1;
                        }
                    }
                }
            }
        }
        /* land on the limit, and leave no sliver before it */
        if (crossing < limit) {
            limit = crossing;
            ending = 2.0;
        }
        double step = dt < state[12] ? dt : state[12];
        double landing = 0.0;
        if (t + 1.01 * step >= limit) {
            step = limit - t;
            landing = 1.0;
        }
        if (!isfinite(t + step)) {
            status = -2;
            break;
        }
        if (step <= 4.5e-16 * fabs(t)) {
            if (landing == 1.0) {
                t = limit;
                if (limit == crossing) {
                    crossing = INFINITY;
                }
                fresh = 1.0;
                continue;
            }
            status = -1;
            break;
        }
        /* what is given, at the stages */
        for (int64_t i = 0; i < 8; i++) {
            given[i] = _given(t + _NODES[i + 1] * step, table_t, table_F, segment);
        }
        /* where the force crosses zero the law may have a kink: end a step there */
        if (crossing == INFINITY) {
            /* its sign, not itself: products underflow */
            const double value = _given(t, table_t, table_F, segment);
            double side = value > 0.0 ? 1.0 : (value < 0.0 ? -1.0 : 0.0);
            double earlier = t;
            for (int64_t i = 0; i < 8; i++) {
                double later = t + _NODES[i + 1] * step;
                if (side * given[i] < 0.0) {
                    while (later - earlier > 4.5e-16 * fabs(later)) {
                        const double middle = 0.5 * (earlier + later);
                        if (middle <= earlier || middle >= later) {
                            break;
                        }
                        if (_given(middle, table_t, table_F, segment) * side > 0.0) {
                            earlier = middle;
                        } else {
                            later = middle;
                        }
                    }
                    crossing = later;
                    break;
                }
                if (given[i] != 0.0) {
                    side = given[i] > 0.0 ? 1.0 : -1.0;
                }
                earlier = later;
            }
            if (crossing < INFINITY) {
                continue;
            }
        }
        /* predict the stages: by the last step's polynomial, unless far beyond it, or along the tangent, bent where it decays */
        for (int64_t i = 0; i < 8; i++) {
            u_z[i] = u_kept[i];
        }
        for (int64_t i = 0; i < 8; i++) {
            deflection[i] = before[i];
        }
        int64_t wild = 0;
        if (last > 0.0 && step <= 2.0 * last) {
            _extrapolation(step / last, m, above);
            _predict(u_z, m, above);
            _predict(deflection, m, above);
            for (int64_t i = 0; i < 8; i++) {
                deflection[i] = delta + deflection[i];
            }
            for (int64_t i = 0; i < 8; i++) {
                if (!(fabs(u_z[i]) < 2.0)) {
                    wild += 1;
                }
            }
        }
        if (step > 2.0 * last || wild > 0) {
            for (int64_t i = 0; i < 8; i++) {
                const double reach = _NODES[i + 1] * step;
                u_z[i] = reach * u_dot / (slopes[7] < 0.0 ? 1.0 - reach * slopes[7] : 1.0);
                deflection[i] = delta;
            }
        }
        /* what no step can be held to: u itself is rounded */
        const double rounding = 4.5e-16 * (1.0 + fabs(u));
        /* Newton's iteration, its matrix renewed while it moves far */
        double moved = INFINITY;
        int64_t renew = 1;
        int64_t turn = 0;
        int64_t done = 0;
        while (turn < 10 && done == 0) {
            turn += 1;
            for (int64_t i = 0; i < 8; i++) {
                h[i] = exp(u + u_z[i]);
            }
            _deflections(0.001 * rtol, h, given, deflection, p, work, terms);
            for (int64_t i = 0; i < 8; i++) {
                _gap_rate(i, h[i], deflection[i], given[i], p, u_rate, w);
            }
            /* without a deflection there is no rate, even of a law whose rate does not depend on it */
            for (int64_t i = 0; i < 8; i++) {
                u_rate[i] += 0.0 * deflection[i];
            }
            if (renew == 1) {
                for (int64_t i = 0; i < 8; i++) {
                    _slopes(i, h[i], deflection[i], given[i], p, slopes);
                }
                for (int64_t i = 0; i < 64; i++) {
                    m[i] = _INVERSE[i];
                }
                for (int64_t i = 0; i < 8; i++) {
                    m[9 * i] -= step * slopes[i];
                }
                _invert(m);
            }
            for (int64_t i = 0; i < 8; i++) {
                residual[0 + i] = step * u_rate[i] - (_INVERSE[0 + i] * u_z[0] + _INVERSE[8 + i] * u_z[1] + (_INVERSE[16 + i] * u_z[2] + _INVERSE[24 + i] * u_z[3]) + (_INVERSE[32 + i] * u_z[4] + _INVERSE[40 + i] * u_z[5]) + (_INVERSE[48 + i] * u_z[6] + _INVERSE[56 + i] * u_z[7]));
            }
            for (int64_t i = 0; i < 8; i++) {
                change[i] = m[0 + i] * residual[0] + m[8 + i] * residual[1] + (m[16 + i] * residual[2] + m[24 + i] * residual[3]) + (m[32 + i] * residual[4] + m[40 + i] * residual[5]) + (m[48 + i] * residual[6] + m[56 + i] * residual[7]);
            }
            for (int64_t i = 0; i < 8; i++) {
                u_z[i] += change[0 + i];
            }
            for (int64_t i = 0; i < 8; i++) {
                deflection[i] += slopes[8 + i] * change[i];
            }
            double total = 0.0;
            for (int64_t i = 0; i < 8; i++) {
                total += change[i] * change[i];
            }
            moves = sqrt(total);
            renew = moves > 0.003 ? 1 : 0;
            contraction = moves / moved;
            /* 1e-2 of what a step may err, or what rounding leaves */
            if (moves <= 0.01 * rtol || moves <= rounding) {
                done = 1;
            } else if (turn > 1 && contraction < 0.5 && moves * contraction / (1.0 - contraction) <= 0.01 * rtol) {
                done = 1;
            } else if (!(moves < 10.0) || (turn > 2 && contraction > 1.0)) {
                break;
            }
            moved = moves;
        }
        passes += (double)turn;
        /* what a further pass would correct */
        const double unsolved = contraction < 1.0 ? moves * contraction : moves;
        if (done == 0) {
            rejected += 1.0;
            last = 0.0;
            shrink_only = 1.0;
            dt = 0.25 * step;
            continue;
        }
        /* the defect of the polynomial at the start and at the probe, and the error that it makes */
        const double probe_given = _given(t + 0.5501108282781375 * step, table_t, table_F, segment);
        double u_probe = u;
        double u_late = 0.0;
        double u_defect = -step * u_dot;
        for (int64_t i = 0; i < 8; i++) {
            u_probe += _VALUE_PROBE[i + 1] * u_z[i];
            u_late += _SLOPE_PROBE[i + 1] * u_z[i];
            u_defect += _SLOPE_START[i + 1] * u_z[i];
        }
        const double h_probe = exp(u_probe);
        const double delta_probe = _solve_delta(h_probe, probe_given, deflection[4], p, w, terms);
        _gap_rate(0, h_probe, delta_probe, probe_given, p, above, below);
        singles += 1.0;
        const double d1 = 0.014424143230897014 * u_defect;
        const double d2 = 0.07596008870469767 * (u_late - step * above[0]);
        /* written so that nan rejects the step */
        double error = fabs(d1) > fabs(d2) ? fabs(d1) : fabs(d2);
        const double left = _left(fabs(d1 - d2) / error, error);
        /* where the step is mildest: a law can be a thousand times stiffer at its end than on the way */
        double decay = -step * slopes[7];
        stiffest = decay > stiffest ? decay : stiffest;
        for (int64_t i = 0; i < 7; i++) {
            decay = -step * slopes[i] < decay ? -step * slopes[i] : decay;
        }
        const double u_error = error / (decay > 0.0 ? 1.0 + 0.014424143230897014 * decay : 1.0);
        error = u_error / (rtol + rounding);
        double factor = 0.8 * pow(error > 1e-12 ? error : 1e-12, -1.0 / 9.0);
        if (!(error <= 1.0)) {
            rejected += 1.0;
            shrink_only = 1.0;
            /* an error that is nan leaves a factor above 1 */
            dt = step * (factor > 0.2 && factor < 1.0 ? factor : 0.2);
            continue;
        }
        /* the step stands */
        const int64_t base = 14 * stored;
        steps[base] = t;
        steps[base + 1] = step;
        steps[base + 2] = landing == 1.0 ? ending : 0.0;
        steps[base + 3] = u;
        for (int64_t i = 0; i < 8; i++) {
            steps[base + 4 + i] = u_z[i];
            u_kept[i] = u_z[i];
        }
        for (int64_t i = 0; i < 8; i++) {
            before[i] = deflection[i] - delta;
        }
        /* the errors so far grow, or decay, as a perturbation of the start of the step does, and its own joins them */
        double growth = 0.0;
        for (int64_t i = 0; i < 8; i++) {
            growth += _QUADRATURE[i] * slopes[i];
        }
        growth = exp(step * growth);
        const double late = u_astray * (growth > 1.0 ? growth : 1.0) + u_error;
        u_astray = u_astray * growth + u_error * left + unsolved + 0.25 * rounding + 1.1e-16 * fabs((t + step) * u_dot);
        const double slowest = fabs(u_dot) < fabs(u_rate[7]) ? fabs(u_dot) : fabs(u_rate[7]);
        steps[base + 12] = late;
        steps[base + 13] = slowest > 0.0 ? late / slowest : INFINITY;
        accepted += 1.0;
        const double u_new = u + u_z[7];
        if ((u - u_stop) * (u_new - u_stop) <= 0.0) {
            status = 1;
        }
        /* the last stage is the end of the step; the last correction moves its rates along the Jacobian */
        u_dot = u_rate[7] + slopes[7] * change[7];
        delta = deflection[7];
        const double resting = slopes[7] < 0.0 && fabs(u_dot) <= -rtol * slopes[7] ? 1.0 : 0.0;
        if (resting > settled && steps[base + 2] == 0.0) {
            steps[base + 2] = 3.0;
        }
        settled = resting;
        u = u_new;
        t = landing == 1.0 ? limit : t + step;
        stored += 1;
        if (last > 0.0) {
            const double foresight = factor * step / last * pow(last_error / (error > 1e-12 ? error : 1e-12), 1.0 / 9.0);
            factor = foresight < factor ? foresight : factor;
        }
        factor = factor < 8.0 ? factor : 8.0;
        factor = factor > 0.2 ? factor : 0.2;
        factor = shrink_only == 0.0 || factor < 1.0 ? factor : 1.0;
        /* a step shortened to land says nothing about the next */
        dt = landing == 0.0 || step * factor > dt ? step * factor : dt;
        shrink_only = 0.0;
        last = step;
        last_error = error > 0.01 ? error : 0.01;
        if (landing == 1.0 && ending > 0.0) {
            fresh = 1.0;
            if (limit == crossing) {
                crossing = INFINITY;
            }
        }
    }
    state[0] = t;
    state[1] = u;
    state[2] = delta;
    state[3] = dt;
    state[4] = accepted;
    state[5] = rejected;
    state[6] = passes;
    state[7] = singles;
    state[8] = (double)segment;
    state[9] = (double)stored;
    state[10] = stiffest;
    state[11] = settled;
    state[15] = u_astray;
    return status;
}

/* A component at 8 fractions of a step in time: its value, and 8 stages, are stored from base on. */
static inline void _values(const double *restrict theta, int64_t base, const double *restrict steps, double *restrict out)
{
    for (int64_t i = 0; i < 8; i++) {
        const double x = theta[i];
        const double below0 = _WEIGHTS[0] / x;
        const double part1 = _WEIGHTS[1] / (x - _NODES[1]);
        const double above1 = part1 * steps[base + 1];
        const double below1 = below0 + part1;
        const double part2 = _WEIGHTS[2] / (x - _NODES[2]);
        const double above2 = above1 + part2 * steps[base + 2];
        const double below2 = below1 + part2;
        const double part3 = _WEIGHTS[3] / (x - _NODES[3]);
        const double above3 = above2 + part3 * steps[base + 3];
        const double below3 = below2 + part3;
        const double part4 = _WEIGHTS[4] / (x - _NODES[4]);
        const double above4 = above3 + part4 * steps[base + 4];
        const double below4 = below3 + part4;
        const double part5 = _WEIGHTS[5] / (x - _NODES[5]);
        const double above5 = above4 + part5 * steps[base + 5];
        const double below5 = below4 + part5;
        const double part6 = _WEIGHTS[6] / (x - _NODES[6]);
        const double above6 = above5 + part6 * steps[base + 6];
        const double below6 = below5 + part6;
        const double part7 = _WEIGHTS[7] / (x - _NODES[7]);
        const double above7 = above6 + part7 * steps[base + 7];
        const double below7 = below6 + part7;
        const double part8 = _WEIGHTS[8] / (x - _NODES[8]);
        const double above8 = above7 + part8 * steps[base + 8];
        const double below8 = below7 + part8;
        out[i] = steps[base] + above8 / below8;
    }
    for (int64_t i = 0; i < 8; i++) {
        /* where a node is hit */
        if (!isfinite(out[i])) {
            out[i] = steps[base];
            for (int64_t j = 0; j < 8; j++) {
                if (theta[i] == _NODES[j + 1]) {
                    out[i] = steps[base] + steps[base + 1 + j];
                }
            }
        }
    }
}

/* The state at 8 times, in increasing order, within a step. */
static inline void _states(int64_t base, const double *restrict t, const double *restrict steps, double *restrict u)
{
    double theta[8];
    for (int64_t i = 0; i < 8; i++) {
        theta[i] = (t[i] - steps[base]) / steps[base + 1];
    }
    _values(theta, base + 3, steps, u);
}

/* The state at n times, in increasing order, from the 14 numbers of each of the steps stored: out[k*n + i] is component k. */
void rognon_gay_sample(int64_t n, const double *restrict t, int64_t stored, const double *restrict steps, double *restrict out)
{
    double lane[8];
    double u[8];
    int64_t at = 0;
    int64_t i = 0;
    while (i < n) {
        while (at < stored - 1 && t[i] >= steps[14 * (at + 1)]) {
            at += 1;
        }
        int64_t m = 1;
        while (m < 8 && i + m < n && (at == stored - 1 || t[i + m] < steps[14 * (at + 1)])) {
            m += 1;
        }
        for (int64_t k = 0; k < 8; k++) {
            lane[k] = t[k < m ? i + k : i + m - 1];
        }
        _states(14 * at, lane, steps, u);
        for (int64_t k = 0; k < m; k++) {
            out[0 * n + i + k] = u[k];
        }
        i += m;
    }
}

/* The time at which ln h passes u within a step in time, by bisection of its polynomial. */
static inline double _passage(double u, int64_t base, const double *restrict steps)
{
    double z[8];
    for (int64_t j = 0; j < 8; j++) {
        z[j] = steps[base + 4 + j];
    }
    const double target = u - steps[base + 3];
    double low = 0.0;
    double high = 1.0;
    for (int64_t iteration = 0; iteration < 60; iteration++) {
        const double middle = 0.5 * (low + high);
        const double value = _between(middle, z);
        if ((value < target && z[7] > 0.0) || (value > target && z[7] < 0.0)) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return steps[base] + high * steps[base + 1];
}

/* The times at which ln h passes n values, each within the step of a number. */
void rognon_gay_passages(int64_t n, const double *restrict u, const double *restrict at, const double *restrict steps, double *restrict out)
{
    for (int64_t i = 0; i < n; i++) {
        const int64_t base = 14 * (int64_t)at[i];
        out[i] = _passage(u[i], base, steps);
    }
}

/* Write m outputs, of 8 at most, from number i on: all that follows from the time and the state. */
static inline void _write(double small, int64_t i, int64_t m, int64_t total, double *restrict t, double *restrict u, double *restrict delta, const double *restrict p, const double *restrict table_t, const double *restrict table_F, int64_t rows, double *restrict work, double *restrict terms, double *restrict out)
{
    double w[2];
    double h[8];
    double given[8];
    double rate[8];
    int64_t segment = 0;
    for (int64_t k = 0; k < 8; k++) {
        const int64_t lane = k < m ? k : m - 1;
        t[k] = t[lane];
        u[k] = u[lane];
        while (segment < rows - 2 && t[k] >= table_t[segment + 1]) {
            segment += 1;
        }
        _drive(t[k], table_t, table_F, segment, w);
        given[k] = w[0];
        rate[k] = w[1];
        h[k] = exp(u[k]);
        delta[k] = delta[7];
    }
    _deflections(small, h, given, delta, p, work, terms);
    for (int64_t k = 0; k < m; k++) {
        out[i + k] = t[k];
        out[total + i + k] = h[k];
        out[2 * total + i + k] = delta[k];
        out[3 * total + i + k] = given[k];
        out[4 * total + i + k] = rate[k];
        _quantities(5 * total + i + k, total, h[k], delta[k], given[k], rate[k], p, out);
    }
}

/* Write the outputs of a run from number j on, as far as the stored steps reach; returns how far that is. */
static inline int64_t _collect(double small, double start, double *restrict worst, int64_t j, int64_t first, int64_t count, int64_t total, int64_t at_gaps, const double *restrict targets, int64_t stored, const double *restrict steps, const double *restrict p, const double *restrict table_t, const double *restrict table_F, int64_t rows, double *restrict out)
{
    double lane[8];
    double t[8];
    double u[8];
    double delta[8];
    double z[8];
    double work[40];
    double terms[8];
    /* outputs gathered and not written yet */
    int64_t gathered = 0;
    delta[7] = j > 0 ? out[2 * total + first + j - 1] : NAN;
    for (int64_t at = 0; at < stored; at++) {
        const int64_t base = 14 * at;
        const double begin = steps[base + 3];
        const double end = begin + steps[base + 11];
        const double last = steps[base] + steps[base + 1];
        int64_t m = 1;
        while (m > 0) {
            m = 0;
            if (at_gaps == 1) {
                /* begin + (end - begin) rounds */
                while (gathered + m < 8 && j + m < count && (begin - targets[first + j + m]) * (end - targets[first + j + m]) <= 1e-15 * (1.0 + fabs(end)) * fabs(end - begin)) {
                    m += 1;
                }
            } else {
                while (gathered + m < 8 && j + m < count && targets[first + j + m] <= last) {
                    m += 1;
                }
            }
            if (m == 0) {
                continue;
            }
            for (int64_t k = 0; k < 8; k++) {
                lane[k] = targets[first + j + (k < m ? k : m - 1)];
            }
            for (int64_t k = 0; k < m; k++) {
                t[gathered + k] = at_gaps == 1 ? _passage(lane[k], base, steps) : lane[k];
                const double part = (t[gathered + k] - steps[base]) / steps[base + 1];
                for (int64_t i = 0; i < 8; i++) {
                    z[i] = steps[base + 4 + i];
                }
                u[gathered + k] = at_gaps == 1 ? lane[k] : begin + _between(part, z);
            }
            for (int64_t k = 0; k < m; k++) {
                /* as far from the curve (t, h), where outputs are at gaps, as the smaller of the errors of h and of t */
                double error = steps[base + 12];
                const double late = steps[base + 13] / (t[gathered + k] - start);
                error = at_gaps == 1 && late < error ? late : error;
                if (!(error <= worst[0])) {
                    worst[0] = error;
                }
            }
            gathered += m;
            j += m;
            if (gathered == 8) {
                _write(small, first + j - 8, 8, total, t, u, delta, p, table_t, table_F, rows, work, terms, out);
                gathered = 0;
            }
        }
    }
    if (gathered > 0) {
        _write(small, first + j - gathered, gathered, total, t, u, delta, p, table_t, table_F, rows, work, terms, out);
    }
    return j;
}

/* Make n runs, each with its own parameters, start and end, and write the outputs asked for.

   settings: rtol, the time of the start, longest step, steps that a run may take, whether ln h may serve as the
   independent variable.
   runs: of each run t_end, u_stop, ln h, delta (which follows from the force here), 3 parameters.
   targets: the times, or with at_gaps = 1 the values of ln h, of the count outputs of each run, in the order of passage.
   out: t, h, delta, what is given, its rate, a, F_ela, zeta, F_adh, C, D, dh_dt, ddelta_dt, dX_dt, X, lambda1, lambda2, each n*count numbers; the status of each run, as
   rognon_gay_integrate returns it, or 10 if it took too many steps, 11 if the gap left the range of double precision;
   and the largest estimated error of its outputs, relative.
   What a run does not reach is left as it is. */
void rognon_gay_runs(int64_t n, int64_t count, int64_t at_gaps, const double *restrict settings, const double *restrict runs, const double *restrict targets, const double *restrict table_t, const double *restrict table_F, int64_t rows, double *restrict out)
{
    double state[20];
    double worst[1];
    double steps[448];
    double p[3];
    for (int64_t run = 0; run < n; run++) {
        const int64_t at = 7 * run;
        for (int64_t k = 0; k < 3; k++) {
            p[k] = runs[at + 4 + k];
        }
        for (int64_t k = 0; k < 20; k++) {
            state[k] = 0.0;
        }
        state[0] = settings[1];
        state[1] = runs[at + 2];
        state[2] = runs[at + 3];
        state[12] = settings[2];
        state[13] = settings[4];
        worst[0] = 0.0;
        int64_t j = 0;
        int64_t ended = 2;
        while (ended == 2) {
            ended = rognon_gay_integrate(runs[at], runs[at + 1], settings[0], p, table_t, table_F, rows, 32, state, steps);
            j = _collect(0.001 * settings[0], settings[1], worst, j, count * run, count, count * n, at_gaps, targets, (int64_t)state[9], steps, p, table_t, table_F, rows, out);
            if (ended == 2 && state[4] + state[5] > settings[3]) {
                ended = 10;
            } else if (ended == 2 && !(fabs(state[1]) < 690.0)) {
                ended = 11;
            }
        }
        if (state[17] > 0.0) {
            ended = 12;
        }
        out[17 * n * count + run] = (double)ended;
        out[17 * n * count + n + run] = worst[0];
    }
}
