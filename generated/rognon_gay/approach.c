/* Contact law rognon_gay: written by softdyn 0.1.0 with sympy 1.14.0; do not edit.
 *
 * Source: Rognon & Gay, arXiv:0803.1573, eqs. 3-5
 * Law b2a8534843dae832:
 *     a = sqrt(2)*sqrt(R)*sqrt(R*h/(R + h) + Abs(delta))
 *     F_ela = 4*E*a*delta/9
 *     zeta = 3*pi*a**4*eta*(R + h)**3/(2*R**3*h**3)
 *     F_adh = 0
 * Left out, with the operations that each saved:
 *     one sign of delta: 67 -> 66
 *     constant force: 66 -> 62
 *     no remote force: 62 -> 61
 *     outputs asked for: 61 -> 32
 * Operations, 60 in all:
 *     balance: 3 add, 8 mul, 2 div, 1 sqrt
 *     gap_rate: 2 add, 15 mul, 3 div, 1 sqrt
 *     quantities: 4 add, 17 mul, 3 div, 1 sqrt
 *
 * A C API that depends on math.h alone; all arrays are of the lengths given, and may not overlap.
 *
 *   void rognon_gay_evaluate(n, h, delta, F, p, out)
 *       a, X, dh_dt at n states; out holds them one after the other, n each.
 *   void rognon_gay_solve_delta(n, h, F, p, delta)
 *       The deflection at n gaps under n forces; on entry delta holds guesses, or nan.
 *   int64_t rognon_gay_integrate(t_end, u_stop, rtol, p, c, capacity, state, steps)
 *       The gap from one time on; see there.
 *
 *   p: R, E, eta
 *   c: the force
 */
#include <math.h>
#include <stdint.h>

#if defined(__FAST_MATH__)
#error "this code relies on IEEE arithmetic: compile it without -ffast-math"
#endif

/* The elastic force and its derivative along delta: w = F_ela, dF_ela/d(delta). */
static inline void _balance(double h, double delta, const double *p, double *w)
{
    const double R = p[0];
    const double E = p[1];
    const double a = sqrt(2.0 * R * (R * h / (R + h) + delta));
    const double x0 = 4.0 / 9.0 * E;
    const double F_ela = delta * x0 * a;
    const double dF_ddelta = x0 * (delta * R / a + a);
    w[0] = F_ela;
    w[1] = dF_ddelta;
}

/* dh/dt (eq. 7). */
static inline double _gap_rate(double h, double delta, double F, const double *p)
{
    const double R = p[0];
    const double eta = p[2];
    const double x0 = R + h;
    const double a = sqrt(2.0 * R * (R * h / x0 + delta));
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
    return dh_dt;
}

/* a, X, dh_dt at state i of n. */
static inline void _quantities(int64_t i, int64_t n, double h, double delta, double F, const double *p, double *out)
{
    const double R = p[0];
    const double eta = p[2];
    const double x0 = R + h;
    const double a = sqrt(2.0 * R * (R * h / x0 + delta));
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
    const double X = 2.0 * R + h - 2.0 * delta;
    out[0 * n + i] = a;
    out[1 * n + i] = X;
    out[2 * n + i] = dh_dt;
}

/* The deflection at the gap h under the force F (eq. 1): Newton's iteration, kept between bounds.

   F_ela rises with delta and vanishes with it, so the sign of F bounds delta from one side. Returns nan if there is no
   solution. */
static inline double _solve_delta(double h, double F, double guess, const double *p, double *w)
{
    if (F == 0.0) {
        return 0.0;
    }
    if (!(F > 0.0)) {
        return NAN;
    }
    double low = 0.0;
    double high = INFINITY;
    double delta = guess;
    if (!(low < guess && guess < high)) {
        /* start from the linear response, or from R where that is beyond R */
        _balance(h, 0.0, p, w);
        delta = F / w[1];
        if (!(fabs(delta) < p[0])) {
            delta = F > 0.0 ? p[0] : -p[0];
        }
    }
    for (int64_t iteration = 0; iteration < 400; iteration++) {
        _balance(h, delta, p, w);
        const double residual = w[0] - F;
        const double step = residual / w[1];
        double trial = delta - step;
        /* Newton's iteration converges quadratically: after a step of 1e-9 what is left is below rounding */
        if (fabs(step) <= 1e-09 * fabs(delta) && low <= trial && trial <= high) {
            return trial;
        }
        if (residual > 0.0) {
            high = delta;
        } else if (residual < 0.0) {
            low = delta;
        } else {
            return residual == 0.0 ? delta : NAN;
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

/* du/dt for u = ln h (eq. 7), the deflection following from the force balance; it is kept in w[2]. */
static inline double _rate(double u, const double *p, const double *c, double *w)
{
    const double h = exp(u);
    const double F = c[0];
    const double delta = _solve_delta(h, F, w[2], p, w);
    w[2] = delta;
    return _gap_rate(h, delta, F, p) / h;
}

/* a, X, dh_dt at n states: out[k*n + i] is quantity k at state i. */
void rognon_gay_evaluate(int64_t n, const double *h, const double *delta, const double *F, const double *p, double *out)
{
    for (int64_t i = 0; i < n; i++) {
        _quantities(i, n, h[i], delta[i], F[i], p, out);
    }
}

/* The deflection at n gaps under n forces; nan where there is none. */
void rognon_gay_solve_delta(int64_t n, const double *h, const double *F, const double *p, double *delta)
{
    double w[2];
    for (int64_t i = 0; i < n; i++) {
        delta[i] = _solve_delta(h[i], F[i], delta[i], p, w);
    }
}

/* Integrate u = ln h by DOP853, steps adapted to the relative error rtol of h, and record the dense output.

   state, of 11 numbers: t, u, delta, step (0 at the start), du/dt, steps accepted, rejected, rates evaluated, segment of
   the table, whether F crosses zero at t, steps recorded by this call. It is updated, and a further call goes on from it.
   steps, of 10*capacity numbers: for each step its start, its length, u at its start, 7 coefficients.

   Returns 0 at t_end, 1 after the step in which u passes u_stop, 2 when steps is full, 3 at the end of the force table;
   -1 if the step falls below rounding, -2 if t overflows, -3 if there is no rate at the start. */
int64_t rognon_gay_integrate(double t_end, double u_stop, double rtol, const double *p, const double *c, int64_t capacity, double *state, double *steps)
{
    double w[3];
    double t = state[0];
    double u = state[1];
    w[2] = state[2];
    double dt = state[3];
    double k1 = state[4];
    double accepted = state[5];
    double rejected = state[6];
    double evaluations = state[7];
    const double limit = t_end;
    double grow = 3.0;
    int64_t status = 2;
    int64_t stored = 0;
    if (dt == 0.0) {
        k1 = _rate(u, p, c, w);
        evaluations += 1.0;
        if (k1 != 0.0) {
            dt = 0.01 / fabs(k1);
        } else {
            /* nothing moves yet: look ahead until something does */
            dt = isfinite(t_end) ? 1e-09 * (t_end - t) : 1e-200;
            while (fabs(_rate(u, p, c, w)) * dt < 0.001 && dt < 1e+200 && t + dt < t_end) {
                dt = 4.0 * dt;
                evaluations += 1.0;
            }
            w[2] = state[2];
        }
    }
    if (!isfinite(k1)) {
        status = -3;
    }
    while (status == 2 && stored < capacity) {
        if (t >= t_end) {
            status = 0;
            break;
        }
        /* land on the limit, and leave no sliver before it */
        double step = dt;
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
                continue;
            }
            status = -1;
            break;
        }
        const double guess = w[2];
        const double k2 = _rate(u + step * (0.05260015195876773 * k1), p, c, w);
        const double k3 = _rate(u + step * (0.0197250569845379 * k1 + 0.0591751709536137 * k2), p, c, w);
        const double k4 = _rate(u + step * (0.02958758547680685 * k1 + 0.08876275643042054 * k3), p, c, w);
        const double k5 = _rate(u + step * (0.2413651341592667 * k1 - 0.8845494793282861 * k3 + 0.924834003261792 * k4), p, c, w);
        const double k6 = _rate(u + step * (0.037037037037037035 * k1 + 0.17082860872947386 * k4 + 0.12546768756682242 * k5), p, c, w);
        const double k7 = _rate(u + step * (0.037109375 * k1 + 0.17025221101954405 * k4 + 0.06021653898045596 * k5 - 0.017578125 * k6), p, c, w);
        const double k8 = _rate(u + step * (0.03709200011850479 * k1 + 0.17038392571223998 * k4 + 0.10726203044637328 * k5 - 0.015319437748624402 * k6 + 0.008273789163814023 * k7), p, c, w);
        const double k9 = _rate(u + step * (0.6241109587160757 * k1 - 3.3608926294469414 * k4 - 0.868219346841726 * k5 + 27.59209969944671 * k6 + 20.154067550477894 * k7 - 43.48988418106996 * k8), p, c, w);
        const double k10 = _rate(u + step * (0.47766253643826434 * k1 - 2.4881146199716677 * k4 - 0.590290826836843 * k5 + 21.230051448181193 * k6 + 15.279233632882423 * k7 - 33.28821096898486 * k8 - 0.020331201708508627 * k9), p, c, w);
        const double k11 = _rate(u + step * (-0.9371424300859873 * k1 + 5.186372428844064 * k4 + 1.0914373489967295 * k5 - 8.149787010746927 * k6 - 18.52006565999696 * k7 + 22.739487099350505 * k8 + 2.4936055526796523 * k9 - 3.0467644718982196 * k10), p, c, w);
        const double k12 = _rate(u + step * (2.273310147516538 * k1 - 10.53449546673725 * k4 - 2.0008720582248625 * k5 - 17.9589318631188 * k6 + 27.94888452941996 * k7 - 2.8589982771350235 * k8 - 8.87285693353063 * k9 + 12.360567175794303 * k10 + 0.6433927460157636 * k11), p, c, w);
        const double u_new = u + step * (0.054293734116568765 * k1 + 4.450312892752409 * k6 + 1.8915178993145003 * k7 - 5.801203960010585 * k8 + 0.3111643669578199 * k9 - 0.1521609496625161 * k10 + 0.20136540080403034 * k11 + 0.04471061572777259 * k12);
        const double t_new = landing == 1.0 ? limit : t + step;
        const double k13 = _rate(u_new, p, c, w);
        evaluations += 12.0;
        /* error of order 8, from estimators of order 5 and 3 */
        const double error5 = 0.01312004499419488 * k1 - 1.2251564463762044 * k6 - 0.4957589496572502 * k7 + 1.6643771824549864 * k8 - 0.35032884874997366 * k9 + 0.3341791187130175 * k10 + 0.08192320648511571 * k11 - 0.022355307863886294 * k12;
        const double error3 = -0.18980075407240762 * k1 + 4.450312892752409 * k6 + 1.8915178993145003 * k7 - 5.801203960010585 * k8 - 0.4226823213237919 * k9 - 0.1521609496625161 * k10 + 0.20136540080403034 * k11 + 0.02265179219836082 * k12;
        const double weight = error5 * error5 + 0.01 * error3 * error3;
        const double error = weight > 0.0 ? step * error5 * error5 / (rtol * sqrt(weight)) : weight;
        double shrink = 0.9 * pow(error, -0.125);
        /* written so that nan rejects the step */
        if (!(error <= 1.0)) {
            rejected += 1.0;
            grow = 1.0;
            dt = step * (shrink > 0.2 ? shrink : 0.2);
            w[2] = guess;
            continue;
        }
        const double k14 = _rate(u + step * (0.056167502283047954 * k1 + 0.25350021021662483 * k7 - 0.2462390374708025 * k8 - 0.12419142326381637 * k9 + 0.15329179827876568 * k10 + 0.00820105229563469 * k11 + 0.007567897660545699 * k12 - 0.008298 * k13), p, c, w);
        const double k15 = _rate(u + step * (0.03183464816350214 * k1 + 0.028300909672366776 * k6 + 0.053541988307438566 * k7 - 0.05492374857139099 * k8 - 0.00010834732869724932 * k11 + 0.0003825710908356584 * k12 - 0.00034046500868740456 * k13 + 0.1413124436746325 * k14), p, c, w);
        const double k16 = _rate(u + step * (-0.42889630158379194 * k1 - 4.697621415361164 * k6 + 7.683421196062599 * k7 + 4.06898981839711 * k8 + 0.3567271874552811 * k9 - 0.0013990241651590145 * k13 + 2.9475147891527724 * k14 - 9.15095847217987 * k15), p, c, w);
        /* the dense output, in Hairer's form */
        const double b0 = u_new - u;
        const double b1 = step * k1 - b0;
        const double b2 = 2.0 * b0 - step * (k1 + k13);
        const double b3 = step * (-8.428938276109013 * k1 + 0.5667149535193777 * k6 - 3.0689499459498917 * k7 + 2.38466765651207 * k8 + 2.117034582445028 * k9 - 0.871391583777973 * k10 + 2.2404374302607883 * k11 + 0.6315787787694688 * k12 - 0.08899033645133331 * k13 + 18.148505520854727 * k14 - 9.194632392478356 * k15 - 4.436036387594894 * k16);
        const double b4 = step * (10.427508642579134 * k1 + 242.28349177525817 * k6 + 165.20045171727028 * k7 - 374.5467547226902 * k8 - 22.113666853125306 * k9 + 7.733432668472264 * k10 - 30.674084731089398 * k11 - 9.332130526430229 * k12 + 15.697238121770845 * k13 - 31.139403219565178 * k14 - 9.35292435884448 * k15 + 35.81684148639408 * k16);
        const double b5 = step * (19.985053242002433 * k1 - 387.0373087493518 * k6 - 189.17813819516758 * k7 + 527.8081592054236 * k8 - 11.57390253995963 * k9 + 6.8812326946963 * k10 - 1.0006050966910838 * k11 + 0.7777137798053443 * k12 - 2.778205752353508 * k13 - 60.19669523126412 * k14 + 84.32040550667716 * k15 + 11.99229113618279 * k16);
        const double b6 = step * (-25.69393346270375 * k1 - 154.18974869023643 * k6 - 231.5293791760455 * k7 + 357.6391179106141 * k8 + 93.40532418362432 * k9 - 37.45832313645163 * k10 + 104.0996495089623 * k11 + 29.8402934266605 * k12 - 43.53345659001114 * k13 + 96.32455395918828 * k14 - 39.17726167561544 * k15 - 149.72683625798564 * k16);
        /* its defect in the middle of the step: the estimators above vanish now and then where the error does not */
        const double middle_u = u + 0.5 * (b0 + 0.5 * (b1 + 0.5 * (b2 + 0.5 * (b3 + 0.5 * (b4 + 0.5 * (b5 + 0.5 * b6))))));
        const double middle_k = _rate(middle_u, p, c, w);
        evaluations += 3.0 + 1.0;
        const double defect = 2.0 * fabs(b0 + 0.25 * b2 + 0.0625 * b4 + 0.015625 * b6 - step * middle_k) / rtol;
        if (!(defect <= 1.0)) {
            rejected += 1.0;
            grow = 1.0;
            shrink = 0.9 * pow(defect, -0.125);
            dt = step * (shrink > 0.2 ? shrink : 0.2);
            w[2] = guess;
            continue;
        }
        const int64_t base = 10 * stored;
        steps[base] = t;
        steps[base + 1] = step;
        steps[base + 2] = u;
        steps[base + 3] = b0;
        steps[base + 4] = b1;
        steps[base + 5] = b2;
        steps[base + 6] = b3;
        steps[base + 7] = b4;
        steps[base + 8] = b5;
        steps[base + 9] = b6;
        stored += 1;
        accepted += 1.0;
        if ((u - u_stop) * (u_new - u_stop) <= 0.0) {
            status = 1;
        }
        t = t_new;
        u = u_new;
        k1 = k13;
        const double h = exp(u);
        w[2] = _solve_delta(h, c[0], w[2], p, w);
        const double factor = shrink < grow ? shrink : grow;
        /* a step shortened to land says nothing about the next */
        dt = landing == 0.0 || step * factor > dt ? step * factor : dt;
        grow = 3.0;
    }
    state[0] = t;
    state[1] = u;
    state[2] = w[2];
    state[3] = dt;
    state[4] = k1;
    state[5] = accepted;
    state[6] = rejected;
    state[7] = evaluations;
    state[10] = (double)stored;
    return status;
}
