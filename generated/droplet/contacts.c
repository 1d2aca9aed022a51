/* Contact law droplet: written by softdyn 0.1.0 with sympy 1.14.0; do not edit.
 *
 * Source: Princen 1983, doi:10.1016/0021-9797(83)90323-5; Reynolds' film; Brenner 1961 for the friction of spheres
 * Law 1f749852e49be335, 9fb2ccb7b9282ed1:
 *     a = sqrt(2)*sqrt(R)*sqrt(Abs(delta) + 1/(1/h + 1/R))
 *     F_ela = 4*pi*delta*sigma
 *     zeta = 3*pi*a**4*eta*(1/h + 1/R)**2*(R/(2*h) + 9*log(20*R/(9*h) + 1)/20 + 1)/(R*(12*R**2/(a**4*(1/h + 1/R)**2) + 1))
 *     F_adh = 0
 *     drag translation = 6*pi*R*eta
 * Left out, with the operations that each saved:
 *     no remote force: 164 -> 153
 * Operations, 364 in all:
 *     iteration: 31 add, 86 mul, 22 div, 1 sqrt, 1 call
 *     tangent: 33 add, 92 mul, 24 div, 1 sqrt, 1 call
 *     state: 8 add, 25 mul, 12 div, 1 sqrt, 1 call
 *     elastic: 2 mul
 *     weight: 3 add, 11 mul, 1 div
 *     side: 2 add, 2 mul, 2 div
 *     drag: 2 mul
 *
 * A C API that depends on math.h alone, for n contacts at given distances of their centres; see each function.
 *
 *   int64_t droplet_contacts(n, s, reach, overlaps, start, target, p, q, y, gap, force, slope)
 *   void droplet_state(n, reach, overlaps, gap, p, q, out)
 *   void droplet_energy(n, reach, overlaps, gap, p, q, points, nodes, weights, out)
 *   void droplet_drag(n, p, q, out), of n particles, with their own parameters in q
 *
 *   p: eta, sigma
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

#if defined(__FAST_MATH__)
#error "this code relies on IEEE arithmetic: compile it without -ffast-math"
#endif

#include <float.h>

#if FLT_EVAL_METHOD != 0
#error "this code relies on arithmetic that rounds to double: compile it with -msse2 -mfpmath=sse"
#endif

/* 2^k, for whole k from -1022 to 1023. */
static inline double _power_of_two(double k)
{
    /* the last bits of 2^52 + 2^51 + k are those of k */
    union { double number; uint64_t bits; } word = { k + 6755399441055744.0 };
    word.bits = (word.bits + 1023) << 52;
    return word.number;
}

/* The whole k for which x/2^k is from sqrt(1/2) to sqrt(2); x is positive, finite and not subnormal. */
static inline double _exponent(double x)
{
    union { double number; uint64_t bits; } word = { x };
    /* the bits of 1 less those of sqrt(1/2) carry into the exponent of what is above sqrt(2); then 2^52 + exponent */
    word.bits = (((word.bits + 0x95f619980c433) >> 52) & 0x7ff) | 0x4330000000000000;
    return word.number - 4503599627371519.0;
}

/* x/2^k, with the same k. */
static inline double _fraction(double x)
{
    union { double number; uint64_t bits; } word = { x };
    word.bits = ((word.bits + 0x95f619980c433) & 0xfffffffffffff) + 0x3fe6a09e667f3bcd;
    return word.number;
}

/* ln(2^k (1 + f)) + rest, for 1 + f from sqrt(1/2) to sqrt(2) and a small rest. */
static inline double _ln_near(double k, double f, double rest)
{
    const double s = f / (2.0 + f);
    const double z = s * s;
    const double z2 = z * z;
    const double even = 0.6666666666666666 + z2 * (0.28571428570803614 + z2 * (0.18181795640132906 + z2 * 0.13268773138656886));
    const double odd = 0.4000000000000088 + z2 * (0.22222222391713917 + z2 * (0.15386239702814658 + z2 * 0.13086626147840102));
    const double half = 0.5 * f * f;
    return k * 0.6931471805598903 - (half - (s * (half + z * (even + z * odd)) + (k * 5.497923018708371e-14 + rest)) - f);
}

/* ln(1 + x); -inf at -1, nan below. */
static inline double _lane_log1p(double x)
{
    /* 1 + x is total + lost, exactly */
    const double total = 1.0 + x;
    const double back = total - 1.0;
    const double lost = 1.0 - (total - back) + (x - back);
    const double k = _exponent(total);
    const double scaled = lost * _power_of_two(-k);
    /* what large numbers lose does not count, and 2^-k may be no number */
    const double small = x < 1.152921504606847e+18 ? scaled : 0.0;
    const double first = _fraction(total) - 1.0;
    const double f = first + small;
    const double value = _ln_near(k, f, small - (f - first));
    const double finite = x < INFINITY ? value : x;
    const double above = x > -1.0 ? finite : NAN;
    const double whole = x == -1.0 ? -INFINITY : above;
    /* keeps the sign of -0 */
    return x == 0.0 ? x : whole;
}

/* Solve y = target + s dy/dt for the gap of each of n contacts, y = (h/g - g/h)/2, at fixed distances of the centres.

   overlaps: sum of the radii less the distance; start: g; y: a guess, then the solution. gap, force, slope: h, F and
   dF/dr along the solution; the force is nan where there is none. Returns how many contacts have none. */
int64_t droplet_contacts(int64_t n, double s, double reach, const double *restrict overlaps, const double *restrict start, const double *restrict target, const double *restrict p, const double *restrict q, double *restrict y, double *restrict gap, double *restrict force, double *restrict slope)
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
    double a;
    double x4;
    double F_ela;
    double a_p2;
    double a_p4;
    double x2_p2;
    double x7;
    double R_p2;
    double x8;
    double x9;
    double x10;
    double x11;
    double x12;
    double x13;
    double zeta;
    double dF_ddelta;
    double dF_dh;
    double h_p2;
    double x15;
    double x33;
    double x16;
    double x17;
    double x18;
    double R_p4;
    double x19;
    double x20;
    double x21;
    double x22;
    double x23;
    double a_p3;
    double a_p6;
    double x22_p2;
    double log_zeta_h;
    double log_zeta_delta;
    double x24;
    double fading;
    double started;
    double ahead;
    double x26;
    double ahead_p2;
    double w;
    double w_h;
    double film;
    double film_h;
    double x28;
    double x29;
    double Y_h;
    double h_p3;
    double Y_hh;
    double x30;
    double rho;
    double rho_h;
    double x31;
    double x32;
    double H_h;
    const double eta = p[0];
    const double own_sigma = p[1];
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
                x0 = 1.0 / R;
                x1 = 1.0 / h;
                x2 = x0 + x1;
                x3 = 1.0 / x2;
                a = sqrt(2.0 * R * (x3 + fabs(delta)));
                x4 = 12.566370614359172 * own_sigma;
                F_ela = delta * x4;
                a_p2 = a * a;
                a_p4 = a_p2 * a_p2;
                x2_p2 = x2 * x2;
                x7 = 1.0 / (x2_p2 * a_p4);
                R_p2 = R * R;
                x8 = 12.0 * x7 * R_p2 + 1.0;
                x9 = 1.0 / x8;
                x10 = x1 * R;
                x11 = _lane_log1p(20.0 / 9.0 * x10);
                x12 = x10 / 2.0 + 0.45 * x11 + 1.0;
                x13 = x2_p2 * a_p4;
                zeta = 9.42477796076938 * x0 * x12 * x13 * x9 * eta;
                dF_ddelta = x4;
                dF_dh = 0.0;
                h_p2 = h * h;
                x15 = 1.0 / h_p2;
                x33 = R + h;
                const double x33_p2 = x33 * x33;
                x16 = x33_p2;
                x17 = 10.0 * R;
                x18 = 9.0 * x11;
                R_p4 = R_p2 * R_p2;
                x19 = R_p4 * h_p2;
                x20 = x16 * a_p4;
                x21 = 24.0 * x19 + x20;
                x22 = 12.0 * x19 + x20;
                x23 = x1 * x17 + x18 + 20.0;
                a_p3 = a_p2 * a;
                a_p6 = a_p3 * a_p3;
                x22_p2 = x22 * x22;
                log_zeta_h = x15 * x7 * x8 * R * (2.0 * x1 * x16 * x21 * a_p6 * (x18 * h + 20.0 * h + x17) / x22_p2 - x9 * (12.0 * x23 * x3 * x9 * R + x0 * x2 * x23 * a_p4 + 5.0 * x13 * (1.0 + 18.0 / (20.0 * x10 + 9.0)))) / (10.0 * x12);
                log_zeta_delta = 4.0 * x21 * R * (delta > 0.0 ? 1.0 : (delta < 0.0 ? -1.0 : 0.0)) / (x22 * a_p2);
                x24 = 1.0 / reach;
                fading = x24 * (2.0 * reach - 2.0 * h);
                started = 1.0 < fading ? 1.0 : fading;
                ahead = 0.0 > started ? 0.0 : started;
                x26 = 3.0 - 2.0 * ahead;
                ahead_p2 = ahead * ahead;
                w = x26 * ahead_p2;
                w_h = -2.0 * x24 * (2.0 * x26 * ahead - 2.0 * ahead_p2);
                film = pressed > 0.0 ? w : 1.0;
                film_h = pressed > 0.0 ? w_h : 0.0;
                x28 = 1.0 / g;
                x29 = g / 2.0;
                Y = x28 * h / 2.0 - x1 * x29;
                Y_h = x15 * x29 + x28 / 2.0;
                h_p3 = h_p2 * h;
                Y_hh = -g / h_p3;
                x30 = 1.0 / zeta;
                rho = F_ela * x30;
                rho_h = x30 * (dF_ddelta / 2.0 + dF_dh) - rho * (log_zeta_delta / 2.0 + log_zeta_h);
                x31 = rho * s;
                x32 = Y - y_star;
                const double H = x31 * Y_h + x32 * film;
                H_h = film * Y_h + rho_h * Y_h * s + Y_hh * x31 + film_h * x32;
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
            x0 = 1.0 / R;
            x1 = 1.0 / h;
            x2 = x0 + x1;
            x3 = 1.0 / x2;
            a = sqrt(2.0 * R * (x3 + fabs(delta)));
            x4 = 12.566370614359172 * own_sigma;
            F_ela = delta * x4;
            a_p2 = a * a;
            a_p4 = a_p2 * a_p2;
            x2_p2 = x2 * x2;
            x7 = 1.0 / (x2_p2 * a_p4);
            R_p2 = R * R;
            x8 = 12.0 * x7 * R_p2 + 1.0;
            x9 = 1.0 / x8;
            x10 = x1 * R;
            x11 = _lane_log1p(20.0 / 9.0 * x10);
            x12 = x10 / 2.0 + 0.45 * x11 + 1.0;
            x13 = x2_p2 * a_p4;
            zeta = 9.42477796076938 * x0 * x12 * x13 * x9 * eta;
            dF_ddelta = x4;
            dF_dh = 0.0;
            h_p2 = h * h;
            x15 = 1.0 / h_p2;
            const double x34 = R + h;
            const double x34_p2 = x34 * x34;
            x16 = x34_p2;
            x17 = 10.0 * R;
            x18 = 9.0 * x11;
            R_p4 = R_p2 * R_p2;
            x19 = R_p4 * h_p2;
            x20 = x16 * a_p4;
            x21 = 24.0 * x19 + x20;
            x22 = 12.0 * x19 + x20;
            x23 = x1 * x17 + x18 + 20.0;
            a_p3 = a_p2 * a;
            a_p6 = a_p3 * a_p3;
            x22_p2 = x22 * x22;
            log_zeta_h = x15 * x7 * x8 * R * (2.0 * x1 * x16 * x21 * a_p6 * (x18 * h + 20.0 * h + x17) / x22_p2 - x9 * (12.0 * x23 * x3 * x9 * R + x0 * x2 * x23 * a_p4 + 5.0 * x13 * (1.0 + 18.0 / (20.0 * x10 + 9.0)))) / (10.0 * x12);
            log_zeta_delta = 4.0 * x21 * R * (delta > 0.0 ? 1.0 : (delta < 0.0 ? -1.0 : 0.0)) / (x22 * a_p2);
            x24 = 1.0 / reach;
            fading = x24 * (2.0 * reach - 2.0 * h);
            started = 1.0 < fading ? 1.0 : fading;
            ahead = 0.0 > started ? 0.0 : started;
            x26 = 3.0 - 2.0 * ahead;
            ahead_p2 = ahead * ahead;
            w = x26 * ahead_p2;
            w_h = -2.0 * x24 * (2.0 * x26 * ahead - 2.0 * ahead_p2);
            film = pressed > 0.0 ? w : 1.0;
            film_h = pressed > 0.0 ? w_h : 0.0;
            const double grip = pressed > 0.0 ? 1.0 : w;
            const double grip_h = pressed > 0.0 ? 0.0 : w_h;
            x28 = 1.0 / g;
            x29 = g / 2.0;
            Y = x28 * h / 2.0 - x1 * x29;
            Y_h = x15 * x29 + x28 / 2.0;
            h_p3 = h_p2 * h;
            Y_hh = -g / h_p3;
            x30 = 1.0 / zeta;
            rho = F_ela * x30;
            x31 = dF_ddelta / 2.0;
            x32 = dF_dh + x31;
            rho_h = x30 * x32 - rho * (log_zeta_delta / 2.0 + log_zeta_h);
            const double rho_r = log_zeta_delta * rho / 2.0 - x30 * x31;
            x33 = Y_h * s;
            H_h = film * Y_h + Y_hh * rho * s + film_h * (Y - y_star) + rho_h * x33;
            const double H_r = rho_r * x33;
            const double h_r = -H_r / H_h;
            const double F = F_ela * grip;
            const double F_r = F_ela * grip_h * h_r + grip * (h_r * x32 - x31);
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

/* delta, a, F, friction, remote, C, dF_dh, dh_dt of n contacts: out[k*n + i] is quantity k of contact i. */
void droplet_state(int64_t n, double reach, const double *restrict overlaps, const double *restrict gap, const double *restrict p, const double *restrict q, double *restrict out)
{
    const double eta = p[0];
    const double own_sigma = p[1];
    for (int64_t i = 0; i < n; i++) {
        const double overlap = overlaps[i];
        const double h = gap[i];
        const double R = q[0 * n + i];
        const double delta = h / 2.0 + overlap / 2.0;
        const double pressed = delta >= 0.0 ? 1.0 : 0.0;
        const double x0 = 1.0 / R;
        const double x1 = 1.0 / h;
        const double x2 = x0 + x1;
        const double a = sqrt(2.0 * R * (fabs(delta) + 1.0 / x2));
        const double x3 = 12.566370614359172 * own_sigma;
        const double F_ela = delta * x3;
        const double x6 = x1 * R;
        const double R_p2 = R * R;
        const double a_p2 = a * a;
        const double a_p4 = a_p2 * a_p2;
        const double x2_p2 = x2 * x2;
        const double zeta = 9.42477796076938 * x0 * eta * x2_p2 * a_p4 * (x6 / 2.0 + 0.45 * _lane_log1p(20.0 / 9.0 * x6) + 1.0) / (12.0 * R_p2 / (x2_p2 * a_p4) + 1.0);
        const double dF_ddelta = x3;
        const double dF_dh = 0.0;
        const double C = dF_ddelta / 2.0;
        const double fading = (2.0 * reach - 2.0 * h) / reach;
        const double started = 1.0 < fading ? 1.0 : fading;
        const double ahead = 0.0 > started ? 0.0 : started;
        const double ahead_p2 = ahead * ahead;
        const double w = ahead_p2 * (3.0 - 2.0 * ahead);
        const double film = pressed > 0.0 ? w : 1.0;
        const double grip = pressed > 0.0 ? 1.0 : w;
        const double rho = F_ela / zeta;
        const double F = F_ela * grip;
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
    }
}

/* Stored energy grip U and its slope in h at fixed delta, of n contacts: out[i] and out[n + i].

   U = integral of 2 F_ela(a(h, d), d) dd from 0 to delta, by quadrature over the fractions nodes of delta. */
void droplet_energy(int64_t n, double reach, const double *restrict overlaps, const double *restrict gap, const double *restrict p, const double *restrict q, int64_t points, const double *restrict nodes, const double *restrict weights, double *restrict out)
{
    double delta;
    const double own_sigma = p[1];
    for (int64_t i = 0; i < n; i++) {
        const double h = gap[i];
        const double whole = 0.5 * (overlaps[i] + h);
        double U = 0.0;
        double U_h = 0.0;
        for (int64_t m = 0; m < points; m++) {
            delta = whole * nodes[m];
            const double F_ela = 12.566370614359172 * delta * own_sigma;
            const double dF_dh = 0.0;
            U += 2.0 * whole * weights[m] * F_ela;
            U_h += 2.0 * whole * weights[m] * dF_dh;
        }
        delta = whole;
        const double pressed = delta >= 0.0 ? 1.0 : 0.0;
        const double x0 = 1.0 / reach;
        const double fading = x0 * (2.0 * reach - 2.0 * h);
        const double started = 1.0 < fading ? 1.0 : fading;
        const double ahead = 0.0 > started ? 0.0 : started;
        const double x2 = 3.0 - 2.0 * ahead;
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
void droplet_drag(int64_t n, const double *restrict p, const double *restrict q, double *restrict out)
{
    const double eta = p[0];
    for (int64_t i = 0; i < n; i++) {
        const double R = q[0 * n + i];
        const double translation = 18.84955592153876 * R * eta;
        out[0 * n + i] = translation;
    }
}
