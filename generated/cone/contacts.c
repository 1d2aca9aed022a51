/* Contact law cone: written by softdyn 0.1.0 with sympy 1.14.0; do not edit.
 *
 * Source: Sneddon, Int. J. Eng. Sci. 3 (1965) 47; friction of arXiv:0803.1573
 * Law 477bece85fee419c, 38dbbd0c7a1c46a1:
 *     a = sqrt(2)*R*sqrt(h)/sqrt(R + h) + 2*Abs(delta)/(pi*m)
 *     F_ela = E*a*delta
 *     zeta = 3*pi*a**4*eta*(R + h)**3/(2*R**3*h**3)
 *     F_adh = 0
 *     drag translation = 6*pi*R*eta
 * Left out, with the operations that each saved:
 *     no remote force: 132 -> 121
 * Operations, 336 in all:
 *     iteration: 23 add, 61 mul, 22 div, 3 sqrt
 *     tangent: 25 add, 67 mul, 24 div, 3 sqrt
 *     state: 11 add, 41 mul, 11 div, 3 sqrt
 *     elastic: 2 add, 11 mul, 3 div, 3 sqrt
 *     weight: 3 add, 11 mul, 1 div
 *     side: 2 add, 2 mul, 2 div
 *     drag: 2 mul
 *
 * A C API that depends on math.h alone, for n contacts at given distances of their centres; see each function.
 *
 *   int64_t cone_contacts(n, s, reach, overlaps, start, target, p, q, y, gap, force, slope)
 *   void cone_state(n, reach, overlaps, gap, p, q, out)
 *   void cone_energy(n, reach, overlaps, gap, p, q, points, nodes, weights, out)
 *   void cone_drag(n, p, q, out), of n particles, with their own parameters in q
 *
 *   p: E, eta, m, undragged_p1
 *   q: R, n of each
 *   reach: the range of a contact, whose force fades from half of it on
 */
#if defined(__GNUC__) && !defined(__clang__)
/* gcc finds control flow in the loops over lanes, and does not vectorise them, if it threads jumps through selections, or
   if it may not compute what is not selected; that raises flags, which nobody reads, and changes no value */
#pragma GCC optimize("no-thread-jumps", "no-trapping-math")
#endif

#include <math.h>
#include <stdint.h>

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__) || \
    defined(__ASSOCIATIVE_MATH__) || defined(__RECIPROCAL_MATH__) || defined(__NO_SIGNED_ZEROS__)
#error "this code relies on IEEE arithmetic: compile it without -ffast-math and its parts"
#endif

/* Solve y = target + s dy/dt for the gap of each of n contacts, y = (h/g - g/h)/2, at fixed distances of the centres.

   overlaps: sum of the radii less the distance; start: g; y: a guess, then the solution. gap, force, slope: h, F and
   dF/dr along the solution; the force is nan where there is none. Returns how many contacts have none. */
int64_t cone_contacts(int64_t n, double s, double reach, const double *restrict overlaps, const double *restrict start, const double *restrict target, const double *restrict p, const double *restrict q, double *restrict y, double *restrict gap, double *restrict force, double *restrict slope)
{
    int64_t i;
    double overlap;
    double g;
    double y_star;
    double h;
    double Y;
    double y_now;
    double factor;
    double grown;
    double shrunk;
    double pressed;
    double R;
    double delta;
    double x0;
    double x1;
    double x2;
    double x3;
    double x4;
    double a;
    double x5;
    double F_ela;
    double x6;
    double excess;
    double h_p2;
    double x7;
    double excess_h;
    double h_p3;
    double x8;
    double x9;
    double x10;
    double R_p2;
    double R_p3;
    double a_p2;
    double a_p4;
    double x4_p2;
    double x4_p3;
    double zeta;
    double dF_ddelta;
    double x11;
    double dF_dh;
    double x12;
    double log_zeta_h;
    double log_zeta_delta;
    double x13;
    double fading;
    double started;
    double ahead;
    double x15;
    double ahead_p2;
    double w;
    double w_h;
    double film;
    double film_h;
    double x17;
    double x18;
    double Y_h;
    double Y_hh;
    double x19;
    double rho;
    double rho_h;
    double x20;
    double x21;
    double H_h;
    const double E = p[0];
    const double eta = p[1];
    const double own_m = p[2];
    const double undragged_p1 = p[3];
    double overlap_lane[16];
    double g_lane[16];
    double target_lane[16];
    double y_lane[16];
    double low_lane[16];
    double high_lane[16];
    double open_lane[16];
    double pressed_lane[16];
    double h_lane[16];
    double F_lane[16];
    double F_r_lane[16];
    double q_lane[16];
    int64_t unsolved = 0;
    int64_t base = 0;
    while (base < n) {
        /* the last block is filled up with copies of the last contact */
        for (int64_t k = 0; k < 16; k++) {
            i = base + k < n ? base + k : n - 1;
            overlap_lane[k] = overlaps[i];
            g_lane[k] = start[i];
            target_lane[k] = target[i];
            y_lane[k] = y[i];
            low_lane[k] = -INFINITY;
            high_lane[k] = INFINITY;
            open_lane[k] = 1.0;
            q_lane[0 + k] = q[0 * n + i];
        }
        /* pressed or pulled: H rises with the gap, so its sign at delta = 0 tells, and the weights stay what they are */
        for (int64_t k = 0; k < 16; k++) {
            overlap = overlap_lane[k];
            g = g_lane[k];
            y_star = target_lane[k];
            h = overlap < 0.0 ? -overlap : g;
            Y = h / (2.0 * g) - g / (2.0 * h);
            const double side = Y - y_star;
            pressed_lane[k] = overlap >= 0.0 ? 1.0 : (side <= 0.0 ? 1.0 : 0.0);
        }
        double left = 16.0;
        int64_t round = 0;
        while (left > 0.0 && round < 100) {
            for (int64_t k = 0; k < 16; k++) {
                overlap = overlap_lane[k];
                g = g_lane[k];
                y_star = target_lane[k];
                y_now = y_lane[k];
                const double size = fabs(y_now);
                factor = size + sqrt(1.0 + y_now * y_now);
                grown = g * factor;
                shrunk = g / factor;
                h = y_now > 0.0 ? grown : shrunk;
                pressed = pressed_lane[k];
                R = q_lane[0 + k];
                delta = h / 2.0 + overlap / 2.0;
                x0 = 0.3183098861837907 / own_m;
                x1 = 2.0 * x0 * fabs(delta);
                x2 = 1.4142135623730951;
                x3 = sqrt(h);
                x4 = R + h;
                a = x2 * x3 * R / sqrt(x4) + x1;
                x5 = delta * E;
                F_ela = x5 * a;
                x6 = 1.0 / h;
                excess = x6 * R;
                h_p2 = h * h;
                x7 = 1.0 / h_p2;
                excess_h = -x7 * R;
                h_p3 = h_p2 * h;
                x8 = 1.0 / h_p3;
                x9 = excess + undragged_p1;
                x10 = 1.0 / (excess + 1.0);
                R_p2 = R * R;
                R_p3 = R_p2 * R;
                a_p2 = a * a;
                a_p4 = a_p2 * a_p2;
                x4_p2 = x4 * x4;
                x4_p3 = x4_p2 * x4;
                zeta = 4.71238898038469 * x10 * x8 * x9 * eta * x4_p3 * a_p4 / R_p3;
                dF_ddelta = E * (a + x1);
                x11 = x2 * R_p2 / (x3 * x4 * sqrt(x4));
                dF_dh = x11 * x5 / 2.0;
                x12 = 1.0 / a;
                log_zeta_h = excess_h * x10 * (1.0 - undragged_p1) / x9 + 2.0 * x11 * x12 + 3.0 / x4 - 3.0 * x6;
                log_zeta_delta = 8.0 * x0 * x12 * (delta > 0.0 ? 1.0 : (delta < 0.0 ? -1.0 : 0.0));
                x13 = 1.0 / reach;
                fading = x13 * (2.0 * reach - 2.0 * h);
                started = 1.0 < fading ? 1.0 : fading;
                ahead = 0.0 > started ? 0.0 : started;
                x15 = 3.0 - 2.0 * ahead;
                ahead_p2 = ahead * ahead;
                w = x15 * ahead_p2;
                w_h = -2.0 * x13 * (2.0 * x15 * ahead - 2.0 * ahead_p2);
                film = pressed > 0.0 ? w : 1.0;
                film_h = pressed > 0.0 ? w_h : 0.0;
                x17 = 1.0 / g;
                x18 = g / 2.0;
                Y = x17 * h / 2.0 - x18 * x6;
                Y_h = x17 / 2.0 + x18 * x7;
                Y_hh = -x8 * g;
                x19 = 1.0 / zeta;
                rho = F_ela * x19;
                rho_h = x19 * (dF_ddelta / 2.0 + dF_dh) - rho * (log_zeta_delta / 2.0 + log_zeta_h);
                x20 = rho * s;
                x21 = Y - y_star;
                const double H = x20 * Y_h + x21 * film;
                H_h = film * Y_h + rho_h * Y_h * s + Y_hh * x20 + film_h * x21;
                const double step = -H * Y_h / H_h;
                const double low_before = low_lane[k];
                const double high_before = high_lane[k];
                const double low = H < 0.0 ? y_now : low_before;
                const double high = H > 0.0 ? y_now : high_before;
                /* a gap changes by a factor of a few at most in one iteration; plain selections, one at a time: C */
                /* compilers vectorise no others */
                const double most = 1.0 + size;
                const double least = -most;
                const double above = step > most ? most : step;
                const double bounded = step < least ? least : above;
                const double trial = y_now + bounded;
                const double outward = H < 0.0 ? most : least;
                const double aside = y_now + outward;
                const double middle = 0.5 * (low + high);
                const double safe = fabs(middle) < INFINITY ? middle : aside;
                const double over = low < trial ? trial : safe;
                const double inside = trial < high ? over : safe;
                /* quadratic convergence: after such a step what is left is below rounding */
                const double beyond = fabs(step) - 1e-08 * most;
                const double width = high - low - 1e-12 * most;
                const double unsettled = beyond < width ? beyond : width;
                const double last = y_now + step;
                const double ended = beyond <= 0.0 ? last : y_now;
                const double new_y = unsettled <= 0.0 ? ended : inside;
                const double is_open = open_lane[k];
                y_lane[k] = is_open > 0.0 ? new_y : y_now;
                low_lane[k] = low;
                high_lane[k] = high;
                open_lane[k] = unsettled <= 0.0 ? 0.0 : is_open;
            }
            left = 0.0;
            for (int64_t k = 0; k < 16; k++) {
                left += open_lane[k];
            }
            round += 1;
        }
        for (int64_t k = 0; k < 16; k++) {
            overlap = overlap_lane[k];
            g = g_lane[k];
            y_now = y_lane[k];
            y_star = target_lane[k];
            factor = fabs(y_now) + sqrt(1.0 + y_now * y_now);
            grown = g * factor;
            shrunk = g / factor;
            h = y_now > 0.0 ? grown : shrunk;
            pressed = pressed_lane[k];
            R = q_lane[0 + k];
            delta = h / 2.0 + overlap / 2.0;
            x0 = 0.3183098861837907 / own_m;
            x1 = 2.0 * x0 * fabs(delta);
            x2 = 1.4142135623730951;
            x3 = sqrt(h);
            x4 = R + h;
            a = x2 * x3 * R / sqrt(x4) + x1;
            x5 = delta * E;
            F_ela = x5 * a;
            x6 = 1.0 / h;
            excess = x6 * R;
            h_p2 = h * h;
            x7 = 1.0 / h_p2;
            excess_h = -x7 * R;
            h_p3 = h_p2 * h;
            x8 = 1.0 / h_p3;
            x9 = excess + undragged_p1;
            x10 = 1.0 / (excess + 1.0);
            R_p2 = R * R;
            R_p3 = R_p2 * R;
            a_p2 = a * a;
            a_p4 = a_p2 * a_p2;
            x4_p2 = x4 * x4;
            x4_p3 = x4_p2 * x4;
            zeta = 4.71238898038469 * x10 * x8 * x9 * eta * x4_p3 * a_p4 / R_p3;
            dF_ddelta = E * (a + x1);
            x11 = x2 * R_p2 / (x3 * x4 * sqrt(x4));
            dF_dh = x11 * x5 / 2.0;
            x12 = 1.0 / a;
            log_zeta_h = excess_h * x10 * (1.0 - undragged_p1) / x9 + 2.0 * x11 * x12 + 3.0 / x4 - 3.0 * x6;
            log_zeta_delta = 8.0 * x0 * x12 * (delta > 0.0 ? 1.0 : (delta < 0.0 ? -1.0 : 0.0));
            x13 = 1.0 / reach;
            fading = x13 * (2.0 * reach - 2.0 * h);
            started = 1.0 < fading ? 1.0 : fading;
            ahead = 0.0 > started ? 0.0 : started;
            x15 = 3.0 - 2.0 * ahead;
            ahead_p2 = ahead * ahead;
            w = x15 * ahead_p2;
            w_h = -2.0 * x13 * (2.0 * x15 * ahead - 2.0 * ahead_p2);
            film = pressed > 0.0 ? w : 1.0;
            film_h = pressed > 0.0 ? w_h : 0.0;
            const double grip = pressed > 0.0 ? 1.0 : w;
            const double grip_h = pressed > 0.0 ? 0.0 : w_h;
            x17 = 1.0 / g;
            x18 = g / 2.0;
            Y = x17 * h / 2.0 - x18 * x6;
            Y_h = x17 / 2.0 + x18 * x7;
            Y_hh = -x8 * g;
            x19 = 1.0 / zeta;
            rho = F_ela * x19;
            x20 = dF_ddelta / 2.0;
            x21 = dF_dh + x20;
            rho_h = x19 * x21 - rho * (log_zeta_delta / 2.0 + log_zeta_h);
            const double rho_r = log_zeta_delta * rho / 2.0 - x19 * x20;
            const double x22 = Y_h * s;
            H_h = film * Y_h + Y_hh * rho * s + film_h * (Y - y_star) + rho_h * x22;
            const double H_r = rho_r * x22;
            const double h_r = -H_r / H_h;
            const double F = F_ela * grip;
            const double F_r = F_ela * grip_h * h_r + grip * (h_r * x21 - x20);
            h_lane[k] = h;
            F_lane[k] = open_lane[k] == 0.0 ? F : NAN;
            F_r_lane[k] = F_r;
        }
        const int64_t count = base + 16 < n ? 16 : n - base;
        for (int64_t k = 0; k < count; k++) {
            i = base + k;
            y[i] = y_lane[k];
            gap[i] = h_lane[k];
            force[i] = F_lane[k];
            slope[i] = F_r_lane[k];
            unsolved += isfinite(F_lane[k]) && isfinite(F_r_lane[k]) ? 0 : 1;
        }
        base += 16;
    }
    return unsolved;
}

/* delta, a, F, friction, remote, C, dF_dh, dh_dt, F_by_gap, F_by_distance of n contacts: out[k*n + i] is quantity k of contact i. */
void cone_state(int64_t n, double reach, const double *restrict overlaps, const double *restrict gap, const double *restrict p, const double *restrict q, double *restrict out)
{
    const double E = p[0];
    const double eta = p[1];
    const double own_m = p[2];
    const double undragged_p1 = p[3];
    for (int64_t i = 0; i < n; i++) {
        const double overlap = overlaps[i];
        const double h = gap[i];
        const double R = q[0 * n + i];
        const double delta = h / 2.0 + overlap / 2.0;
        const double pressed = delta >= 0.0 ? 1.0 : 0.0;
        const double x0 = 0.6366197723675814 * fabs(delta) / own_m;
        const double x1 = 1.4142135623730951;
        const double x2 = sqrt(h);
        const double x3 = R + h;
        const double a = x1 * x2 * R / sqrt(x3) + x0;
        const double x4 = delta * E;
        const double F_ela = x4 * a;
        const double excess = R / h;
        const double R_p2 = R * R;
        const double R_p3 = R_p2 * R;
        const double a_p2 = a * a;
        const double a_p4 = a_p2 * a_p2;
        const double h_p2 = h * h;
        const double h_p3 = h_p2 * h;
        const double x3_p2 = x3 * x3;
        const double x3_p3 = x3_p2 * x3;
        const double zeta = 4.71238898038469 * eta * x3_p3 * a_p4 * (excess + undragged_p1) / (R_p3 * h_p3 * (excess + 1.0));
        const double dF_ddelta = E * (a + x0);
        const double dF_dh = x1 * x4 * R_p2 / (2.0 * x2 * x3 * sqrt(x3));
        const double x5 = dF_ddelta / 2.0;
        const double C = x5;
        const double x6 = 1.0 / reach;
        const double fading = x6 * (2.0 * reach - 2.0 * h);
        const double started = 1.0 < fading ? 1.0 : fading;
        const double ahead = 0.0 > started ? 0.0 : started;
        const double x8 = 3.0 - 2.0 * ahead;
        const double ahead_p2 = ahead * ahead;
        const double w = x8 * ahead_p2;
        const double w_h = -2.0 * x6 * (2.0 * x8 * ahead - 2.0 * ahead_p2);
        const double film = pressed > 0.0 ? w : 1.0;
        const double grip = pressed > 0.0 ? 1.0 : w;
        const double grip_h = pressed > 0.0 ? 0.0 : w_h;
        const double rho = F_ela / zeta;
        const double F = F_ela * grip;
        const double F_by_gap = F_ela * grip_h + grip * (dF_dh + x5);
        const double F_by_distance = -x5 * grip;
        const double friction = w * zeta;
        const double remote = 0.0;
        const double dh_dt = -rho / film;
        out[0 * n + i] = delta;
        out[1 * n + i] = a;
        out[2 * n + i] = F;
        out[3 * n + i] = friction;
        out[4 * n + i] = remote;
        out[5 * n + i] = C;
        out[6 * n + i] = dF_dh;
        out[7 * n + i] = dh_dt;
        out[8 * n + i] = F_by_gap;
        out[9 * n + i] = F_by_distance;
    }
}

/* Stored energy grip U and its slope in h at fixed delta, of n contacts: out[i] and out[n + i].

   U = integral of 2 F_ela(a(h, d), d) dd from 0 to delta, by quadrature over the fractions nodes of delta. */
void cone_energy(int64_t n, double reach, const double *restrict overlaps, const double *restrict gap, const double *restrict p, const double *restrict q, int64_t points, const double *restrict nodes, const double *restrict weights, double *restrict out)
{
    double delta;
    double x0;
    double x2;
    const double E = p[0];
    const double own_m = p[2];
    for (int64_t i = 0; i < n; i++) {
        const double h = gap[i];
        const double whole = 0.5 * (overlaps[i] + h);
        double U = 0.0;
        double U_h = 0.0;
        for (int64_t m = 0; m < points; m++) {
            delta = whole * nodes[m];
            const double R = q[0 * n + i];
            x0 = 1.4142135623730951;
            const double x1 = sqrt(h);
            x2 = R + h;
            const double a = x0 * x1 * R / sqrt(x2) + 0.6366197723675814 * fabs(delta) / own_m;
            const double x3 = delta * E;
            const double F_ela = x3 * a;
            const double R_p2 = R * R;
            const double dF_dh = x0 * x3 * R_p2 / (2.0 * x1 * x2 * sqrt(x2));
            U += 2.0 * whole * weights[m] * F_ela;
            U_h += 2.0 * whole * weights[m] * dF_dh;
        }
        delta = whole;
        const double pressed = delta >= 0.0 ? 1.0 : 0.0;
        x0 = 1.0 / reach;
        const double fading = x0 * (2.0 * reach - 2.0 * h);
        const double started = 1.0 < fading ? 1.0 : fading;
        const double ahead = 0.0 > started ? 0.0 : started;
        x2 = 3.0 - 2.0 * ahead;
        const double ahead_p2 = ahead * ahead;
        const double w = x2 * ahead_p2;
        const double w_h = -2.0 * x0 * (2.0 * x2 * ahead - 2.0 * ahead_p2);
        const double grip = pressed > 0.0 ? 1.0 : w;
        const double grip_h = pressed > 0.0 ? 0.0 : w_h;
        out[i] = grip * U;
        out[n + i] = grip * U_h + grip_h * U;
    }
}

/* What the fluid does to n particles alone, translation: out[k*n + i] is quantity k of particle i.

   In q stand the particles' own parameters, R the radius. */
void cone_drag(int64_t n, const double *restrict p, const double *restrict q, double *restrict out)
{
    const double eta = p[1];
    for (int64_t i = 0; i < n; i++) {
        const double R = q[0 * n + i];
        const double translation = 18.84955592153876 * R * eta;
        out[0 * n + i] = translation;
    }
}
