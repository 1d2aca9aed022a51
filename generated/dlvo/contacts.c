/* Contact law dlvo: written by softdyn 0.1.0 with sympy 1.14.0; do not edit.
 *
 * Source: Derjaguin-Landau-Verwey-Overbeek (Israelachvili 2011, chs. 11-14); equal_spheres
 * Law 9810adb843c12266, cf5d87a34f5fdf67:
 *     a = sqrt(R)*sqrt(Abs(delta) + 1/(1/h + 1/R) + 5/((1/h + 1/R)**2*(2*Abs(delta) + 4/(1/h + 1/R))))
 *     F_ela = 4*E*a*delta/(3*(1 - nu**2))
 *     zeta = 8*pi*a**4*eta*(1/h + 1/R)**2*(R/(2*h) + 9*log(20*R/(9*h) + 1)/20 + 1)/(R*(18225*R**3/(128*a**6*(1/h + 1/R)**3) + 1))
 *     F_adh = -A*R/(12*h**2) + pi*Pi0*R*ell*exp(-h/ell)
 *     sliding = pi*R*eta*(8/5 - 12*size_ratio/5)*log(R/h + 1) + pi*eta*(-9*R/(4*(1/h + 1/R)) + a**2)/h
 *     coupling = 3*pi*R**2*eta*log(R/h + 1)/5
 *     rolling = 3*pi*R**3*eta*log(R/h + 1)/5
 *     k_t = 2*E*a/((2 - nu)*(nu + 1))
 *     drag translation = 6*pi*R*eta
 *     drag rotation = 8*pi*R**3*eta
 * Operations, 910 in all:
 *     iteration: 53 add, 142 mul, 35 div, 1 sqrt, 2 call
 *     tangent: 89 add, 233 mul, 46 div, 1 sqrt, 3 call
 *     state: 36 add, 105 mul, 24 div, 1 sqrt, 3 call
 *     elastic: 12 add, 33 mul, 6 div, 1 sqrt
 *     weight: 3 add, 11 mul, 1 div
 *     side: 11 add, 31 mul, 17 div, 1 sqrt, 2 call
 *     drag: 7 mul
 *
 * A C API that depends on math.h alone, for n contacts at given distances of their centres; see each function.
 *
 *   int64_t dlvo_contacts(n, s, reach, overlaps, start, target, p, q, y, gap, force, slope, more)
 *   void dlvo_state(n, reach, overlaps, gap, p, q, out)
 *   void dlvo_energy(n, reach, overlaps, gap, p, q, points, nodes, weights, out)
 *   void dlvo_drag(n, p, q, out), of n particles, with their own parameters in q
 *
 *   p: E, eta, A, Pi0, ell, nu
 *   q: R, size_ratio, n of each
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

/* The whole number nearest to x, for |x| < 2^51. */
static inline double _nearest(double x)
{
    return x + 6755399441055744.0 - 6755399441055744.0;
}

/* exp(r + rest) - 1, for |r| up to ln(2)/2 and a rest below its rounding. */
static inline double _exp_near(double r, double rest)
{
    const double r2 = r * r;
    const double even = 0.5 + r2 * (0.04166666666666667 + r2 * (0.0013888888888883752 + r2 * (2.4801587325533363e-05 + r2 * (2.7557273661348637e-07 + r2 * 2.0914679376583935e-09))));
    const double odd = 0.1666666666666667 + r2 * (0.008333333333326141 + r2 * (0.00019841269874800493 + r2 * (2.7557255425746435e-06 + r2 * 2.510520637395701e-08)));
    return r + (r2 * (even + r * odd) + rest);
}

/* exp x. */
static inline double _lane_exp(double x)
{
    /* beyond these bounds the result is infinite, or rounds to its limit */
    const double below = x < 710.0 ? x : 710.0;
    const double bounded = below > -746.0 ? below : -746.0;
    const double k = _nearest(bounded * 1.4426950408889634);
    const double first = bounded - k * 0.6931471805598903;
    const double r = first - k * 5.497923018708371e-14;
    const double change = _exp_near(r, first - r - k * 5.497923018708371e-14);
    /* 2^k may be no number, but these two factors of it are */
    const double half = _nearest(0.5 * k);
    const double other = k - half;
    const double value = (1.0 + change) * _power_of_two(half) * _power_of_two(other);
    return x == x ? value : x;
}

/* Solve y = target + s dy/dt for the gap of each of n contacts, y = (h/g - g/h)/2, at fixed distances of the centres.

   overlaps: sum of the radii less the distance; start: g; y: a guess, then the solution. gap, force, slope: h, F and
   dF/dr along the solution; the force is nan where there is none. Returns how many contacts have none.
   more[k*n + i] is quantity k of contact i: keep, keep_r, stiff, stiff_r, roll, roll_r, lever, lever_r. */
int64_t dlvo_contacts(int64_t n, double s, double reach, const double *restrict overlaps, const double *restrict start, const double *restrict target, const double *restrict p, const double *restrict q, double *restrict y, double *restrict gap, double *restrict force, double *restrict slope, double *restrict more)
{
    int64_t i;
    double overlap;
    double g;
    double y_star;
    double h;
    double R;
    double x0;
    double x1;
    double x2;
    double a;
    double x4;
    double R_p2;
    double R_p3;
    double a_p2;
    double a_p4;
    double a_p3;
    double a_p6;
    double zeta;
    double h_p2;
    double F_adh;
    double x6;
    double x7;
    double Y;
    double Y_h;
    double y_now;
    double factor;
    double grown;
    double shrunk;
    double pressed;
    double delta;
    double x3;
    double x3_p2;
    double own_nu_p2;
    double x8;
    double F_ela;
    double x3_p3;
    double x11;
    double x12;
    double x13;
    double x14;
    double x15;
    double x17;
    double x20;
    double x21;
    double x22;
    double x23;
    double x24;
    double x25;
    double delta_p2;
    double x28;
    double x30;
    double x31;
    double x32;
    double x33;
    double x34;
    double dF_ddelta;
    double x35;
    double x36;
    double dF_dh;
    double R_p6;
    double h_p3;
    double x39;
    double x40;
    double x41;
    double x44;
    double x45;
    double x46;
    double x47;
    double a_p8;
    double log_zeta_h;
    double log_zeta_delta;
    double x48;
    double remote_h;
    double remote_delta;
    double x49;
    double fading;
    double started;
    double ahead;
    double x51;
    double ahead_p2;
    double w;
    double w_h;
    double film;
    double film_h;
    double x54;
    double Y_hh;
    double x55;
    double rho;
    double rho_h;
    double x56;
    double x57;
    double H_h;
    const double E = p[0];
    const double eta = p[1];
    const double own_A = p[2];
    const double own_Pi0 = p[3];
    const double own_ell = p[4];
    const double own_nu = p[5];
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
    double q_lane[32];
    double more_lane[128];
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
            q_lane[16 + k] = q[1 * n + i];
        }
        /* pressed or pulled: H rises with the gap, so its sign at delta = 0 tells, and the weights stay what they are */
        for (int64_t k = 0; k < 16; k++) {
            overlap = overlap_lane[k];
            g = g_lane[k];
            y_star = target_lane[k];
            h = overlap < 0.0 ? -overlap : g;
            R = q_lane[0 + k];
            x0 = 1.0 / R;
            x1 = 1.0 / h;
            x2 = x0 + x1;
            const double x2_p2 = x2 * x2;
            a = sqrt(R * (1.0 / x2 + 5.0 * (x0 / 4.0 + x1 / 4.0) / x2_p2));
            x4 = x1 * R;
            R_p2 = R * R;
            R_p3 = R_p2 * R;
            a_p2 = a * a;
            a_p4 = a_p2 * a_p2;
            a_p3 = a_p2 * a;
            a_p6 = a_p3 * a_p3;
            const double x2_p3 = x2_p2 * x2;
            zeta = 25.132741228718345 * x0 * eta * x2_p2 * a_p4 * (x4 / 2.0 + 0.45 * _lane_log1p(20.0 / 9.0 * x4) + 1.0) / (142.3828125 * R_p3 / (x2_p3 * a_p6) + 1.0);
            h_p2 = h * h;
            const double x5 = 1.0 / h_p2;
            F_adh = R * (3.141592653589793 * own_Pi0 * own_ell * _lane_exp(-h / own_ell) - x5 * own_A / 12.0);
            x6 = 1.0 / g;
            x7 = g / 2.0;
            Y = x6 * h / 2.0 - x1 * x7;
            Y_h = x5 * x7 + x6 / 2.0;
            const double side = Y - F_adh * Y_h * s / zeta - y_star;
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
                x0 = fabs(delta);
                x1 = 1.0 / R;
                x2 = 1.0 / h;
                x3 = x1 + x2;
                x4 = 1.0 / x3;
                x3_p2 = x3 * x3;
                x6 = 1.0 / x3_p2;
                a = sqrt(R * (x0 + x4 + 5.0 * x6 / (2.0 * x0 + 4.0 * x4)));
                own_nu_p2 = own_nu * own_nu;
                x7 = E / (1.0 - own_nu_p2);
                x8 = delta * x7;
                F_ela = 4.0 / 3.0 * x8 * a;
                R_p2 = R * R;
                R_p3 = R_p2 * R;
                a_p2 = a * a;
                a_p3 = a_p2 * a;
                a_p6 = a_p3 * a_p3;
                x3_p3 = x3_p2 * x3;
                x11 = R_p3 / (x3_p3 * a_p6);
                x12 = 142.3828125 * x11 + 1.0;
                x13 = x2 * R;
                x14 = _lane_log1p(20.0 / 9.0 * x13);
                x15 = x13 / 2.0 + 0.45 * x14 + 1.0;
                a_p4 = a_p2 * a_p2;
                x17 = x3_p2 * a_p4;
                zeta = 25.132741228718345 * x1 * x15 * x17 * eta / x12;
                h_p2 = h * h;
                const double x19 = 1.0 / h_p2;
                x20 = 3.141592653589793 * own_Pi0 * _lane_exp(-h / own_ell);
                F_adh = R * (x20 * own_ell - x19 * own_A / 12.0);
                x21 = 2.0 * h;
                x22 = x21 * R;
                x23 = R + h;
                const double x58 = x0 * x23 + x22;
                const double x58_p2 = x58 * x58;
                x24 = 1.0 / x58_p2;
                x25 = x24 / a;
                delta_p2 = delta * delta;
                x28 = delta_p2 * R_p2;
                const double x29 = R_p2 * h_p2;
                x30 = delta_p2 * h_p2;
                x31 = 8.0 * x0;
                x32 = R * h_p2;
                x33 = h * R_p2;
                x34 = R * (4.0 * R * h * delta_p2 + 2.0 * x28 + 3.0 * x29 + 2.0 * x30 + x31 * x32 + x31 * x33);
                dF_ddelta = x7 * (4.0 * a + x0 * x25 * x34) / 3.0;
                x35 = 9.0 * x0;
                x36 = x22 * delta_p2 + x28 + 9.0 * x29 + x30 + x32 * x35 + x33 * x35;
                const double x23_p2 = x23 * x23;
                dF_dh = 2.0 / 3.0 * x25 * x36 * x8 * R_p3 / x23_p2;
                R_p6 = R_p3 * R_p3;
                h_p3 = h_p2 * h;
                x39 = R_p6 * h_p3;
                const double x23_p3 = x23_p2 * x23;
                x40 = x23_p3 * a_p6;
                x41 = 18225.0 * x39 + 128.0 * x40;
                const double x42 = 10.0 * R;
                const double x43 = 9.0 * x14;
                x44 = x24 * (91125.0 * x39 + 256.0 * x40);
                x45 = 1.0 / (18225.0 * x11 + 128.0);
                x46 = x2 * x42 + x43 + 20.0;
                x47 = 1.0 / a_p2;
                a_p8 = a_p4 * a_p4;
                const double x41_p2 = x41 * x41;
                log_zeta_h = 6.4 * x12 * x19 * x6 * R * (x2 * x36 * x44 * x23_p3 * a_p8 * (x43 * h + 20.0 * h + x42) / x41_p2 - x45 * (54675.0 * x45 * x46 * x47 * x6 * R_p2 + 2.0 * x1 * x3 * x46 * a_p4 + 10.0 * x17 * (1.0 + 18.0 / (20.0 * x13 + 9.0)))) / (x15 * a_p4);
                log_zeta_delta = x34 * x44 * x47 * (delta > 0.0 ? 1.0 : (delta < 0.0 ? -1.0 : 0.0)) / (2.0 * x41);
                x48 = 1.0 / h_p3;
                remote_h = R * (x48 * own_A / 6.0 - x20);
                remote_delta = 0.0;
                x49 = 1.0 / reach;
                fading = x49 * (2.0 * reach - x21);
                started = 1.0 < fading ? 1.0 : fading;
                ahead = 0.0 > started ? 0.0 : started;
                x51 = 3.0 - 2.0 * ahead;
                ahead_p2 = ahead * ahead;
                w = x51 * ahead_p2;
                w_h = -2.0 * x49 * (2.0 * x51 * ahead - 2.0 * ahead_p2);
                film = pressed > 0.0 ? w : 1.0;
                film_h = pressed > 0.0 ? w_h : 0.0;
                const double x53 = 1.0 / g;
                x54 = g / 2.0;
                Y = x53 * h / 2.0 - x2 * x54;
                Y_h = x19 * x54 + x53 / 2.0;
                Y_hh = -x48 * g;
                x55 = 1.0 / zeta;
                rho = x55 * (F_ela - F_adh * film);
                rho_h = x55 * (dF_ddelta / 2.0 + dF_dh - F_adh * film_h - film * (remote_delta / 2.0 + remote_h)) - rho * (log_zeta_delta / 2.0 + log_zeta_h);
                x56 = rho * s;
                x57 = Y - y_star;
                const double H = x56 * Y_h + x57 * film;
                H_h = film * Y_h + rho_h * Y_h * s + Y_hh * x56 + film_h * x57;
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
            const double size_ratio = q_lane[16 + k];
            delta = h / 2.0 + overlap / 2.0;
            x0 = fabs(delta);
            x1 = 1.0 / R;
            x2 = 1.0 / h;
            x3 = x1 + x2;
            x4 = 1.0 / x3;
            x3_p2 = x3 * x3;
            x6 = 1.0 / x3_p2;
            a = sqrt(R * (x0 + x4 + 5.0 * x6 / (2.0 * x0 + 4.0 * x4)));
            own_nu_p2 = own_nu * own_nu;
            x7 = E / (1.0 - own_nu_p2);
            x8 = delta * x7;
            F_ela = 4.0 / 3.0 * x8 * a;
            R_p2 = R * R;
            R_p3 = R_p2 * R;
            a_p2 = a * a;
            a_p3 = a_p2 * a;
            a_p6 = a_p3 * a_p3;
            x3_p3 = x3_p2 * x3;
            x11 = R_p3 / (x3_p3 * a_p6);
            x12 = 142.3828125 * x11 + 1.0;
            x13 = x2 * R;
            x14 = _lane_log1p(20.0 / 9.0 * x13);
            x15 = x13 / 2.0 + 0.45 * x14 + 1.0;
            a_p4 = a_p2 * a_p2;
            x17 = x3_p2 * a_p4;
            const double x18 = 3.141592653589793 * eta;
            zeta = 8.0 * x1 * x15 * x17 * x18 / x12;
            h_p2 = h * h;
            x20 = 1.0 / h_p2;
            x21 = 3.141592653589793 * own_Pi0 * _lane_exp(-h / own_ell);
            F_adh = R * (x21 * own_ell - x20 * own_A / 12.0);
            x22 = 2.0 * h;
            x23 = x22 * R;
            x24 = R + h;
            const double x90 = x0 * x24 + x23;
            const double x90_p2 = x90 * x90;
            x25 = 1.0 / x90_p2;
            const double x26 = x25 / a;
            x28 = R * h;
            delta_p2 = delta * delta;
            x30 = delta_p2 * R_p2;
            x31 = R_p2 * h_p2;
            x32 = delta_p2 * h_p2;
            x33 = 8.0 * x0;
            x34 = R * h_p2;
            x35 = h * R_p2;
            x36 = R * (4.0 * x28 * delta_p2 + 2.0 * x30 + 3.0 * x31 + 2.0 * x32 + x33 * x34 + x33 * x35);
            const double x37 = x26 * x36;
            dF_ddelta = x7 * (4.0 * a + x0 * x37) / 3.0;
            const double x24_p2 = x24 * x24;
            const double x38 = 1.0 / x24_p2;
            x39 = 9.0 * x0;
            x40 = x23 * delta_p2 + x30 + 9.0 * x31 + x32 + x34 * x39 + x35 * x39;
            x41 = x26 * x38 * x40 * R_p3;
            dF_dh = 2.0 / 3.0 * x41 * x8;
            R_p6 = R_p3 * R_p3;
            h_p3 = h_p2 * h;
            x44 = R_p6 * h_p3;
            const double x24_p3 = x24_p2 * x24;
            x45 = x24_p3 * a_p6;
            x46 = 18225.0 * x44 + 128.0 * x45;
            x47 = 10.0 * R;
            x48 = 20.0 * h;
            x49 = 9.0 * x14;
            const double x50 = x25 * (91125.0 * x44 + 256.0 * x45);
            x51 = 1.0 / (18225.0 * x11 + 128.0);
            const double x52 = x2 * x47 + x49 + 20.0;
            x54 = 1.0 / a_p2;
            a_p8 = a_p4 * a_p4;
            const double x46_p2 = x46 * x46;
            log_zeta_h = 6.4 * x12 * x20 * x6 * R * (x2 * x40 * x50 * x24_p3 * a_p8 * (x49 * h + x47 + x48) / x46_p2 - x51 * (54675.0 * x51 * x52 * x54 * x6 * R_p2 + 2.0 * x1 * x3 * x52 * a_p4 + 10.0 * x17 * (1.0 + 18.0 / (20.0 * x13 + 9.0)))) / (x15 * a_p4);
            x55 = delta > 0.0 ? 1.0 : (delta < 0.0 ? -1.0 : 0.0);
            log_zeta_delta = x36 * x50 * x54 * x55 / (2.0 * x46);
            x56 = 1.0 / h_p3;
            remote_h = R * (x56 * own_A / 6.0 - x21);
            remote_delta = 0.0;
            x57 = 1.0 / reach;
            fading = x57 * (2.0 * reach - x22);
            started = 1.0 < fading ? 1.0 : fading;
            ahead = 0.0 > started ? 0.0 : started;
            const double x59 = 3.0 - 2.0 * ahead;
            ahead_p2 = ahead * ahead;
            w = x59 * ahead_p2;
            w_h = -2.0 * x57 * (2.0 * x59 * ahead - 2.0 * ahead_p2);
            film = pressed > 0.0 ? w : 1.0;
            film_h = pressed > 0.0 ? w_h : 0.0;
            const double grip = pressed > 0.0 ? 1.0 : w;
            const double grip_h = pressed > 0.0 ? 0.0 : w_h;
            const double x61 = 1.0 / g;
            const double x62 = g / 2.0;
            Y = x61 * h / 2.0 - x2 * x62;
            Y_h = x20 * x62 + x61 / 2.0;
            Y_hh = -x56 * g;
            const double x63 = 1.0 / zeta;
            rho = x63 * (F_ela - F_adh * film);
            const double x64 = log_zeta_delta / 2.0;
            const double x65 = dF_ddelta / 2.0;
            rho_h = x63 * (dF_dh + x65 - F_adh * film_h - film * (remote_delta / 2.0 + remote_h)) - rho * (log_zeta_h + x64);
            const double rho_r = rho * x64 - x63 * (dF_ddelta - remote_delta * film) / 2.0;
            const double x66 = Y_h * s;
            H_h = film * Y_h + Y_hh * rho * s + film_h * (Y - y_star) + rho_h * x66;
            const double H_r = rho_r * x66;
            const double h_r = -H_r / H_h;
            const double F = F_ela * grip;
            const double F_r = F_ela * grip_h * h_r + grip * (h_r * (dF_dh + x65) - x65);
            const double a_h = x41 / 2.0;
            const double a_delta = x37 * x55 / 4.0;
            const double x67 = 20.0 * a_p2;
            const double x68 = _lane_log1p(x13);
            const double x69 = 32.0 * x68;
            const double x70 = 48.0 * size_ratio;
            const double x71 = x68 * x70;
            const double x72 = x18 / 20.0;
            const double x73 = x2 / x24;
            const double sliding = x72 * x73 * (x67 * R + x48 * a_p2 + x34 * x69 + x35 * x69 - x34 * x71 - x35 * x71 - 45.0 * x35);
            const double x74 = 0.6 * x18;
            const double x75 = x68 * x74;
            const double coupling = x75 * R_p2;
            const double rolling = x75 * R_p3;
            const double x76 = 2.0 * a;
            const double x77 = E / ((own_nu + 1.0) * (2.0 - own_nu));
            const double k_t = x76 * x77;
            const double x78 = h * R_p3;
            const double x79 = a_h * a;
            const double x80 = 40.0 * x79;
            const double sliding_h = x20 * x38 * x72 * (x80 * h_p3 + x31 * x70 + 13.0 * x31 + 80.0 * x34 * x79 + x35 * x80 + x70 * x78 - x67 * R_p2 - 40.0 * x28 * a_p2 - x67 * h_p2 - 32.0 * x78);
            const double x81 = x73 * x74;
            const double coupling_h = -x81 * R_p3;
            const double R_p4 = R_p2 * R_p2;
            const double rolling_h = -x81 * R_p4;
            const double x82 = 2.0 * x77;
            const double k_t_h = a_h * x82;
            const double sliding_delta = a_delta * x18 * x2 * x76;
            const double coupling_delta = 0.0;
            const double rolling_delta = 0.0;
            const double k_t_delta = a_delta * x82;
            const double friction_t = w * sliding;
            const double x83 = friction_t + k_t * s;
            const double keep = friction_t / x83;
            const double stiff = keep * k_t;
            const double x84 = 1.0 / sliding;
            const double x85 = 1.0 - 4.0 * size_ratio;
            const double coupling_p2 = coupling * coupling;
            const double x86 = rolling - x84 * x85 * coupling_p2;
            const double roll = x86 * w;
            const double lever = coupling * x84;
            const double x87 = h_r / 2.0 - 0.5;
            const double sliding_r = h_r * sliding_h + sliding_delta * x87;
            const double coupling_r = coupling_delta * x87 + coupling_h * h_r;
            const double rolling_r = h_r * rolling_h + rolling_delta * x87;
            const double k_t_r = h_r * k_t_h + k_t_delta * x87;
            const double x88 = h_r * w_h;
            const double friction_t_r = x88 * sliding + sliding_r * w;
            const double x83_p2 = x83 * x83;
            const double keep_r = s * (friction_t_r * k_t - k_t_r * friction_t) / x83_p2;
            const double stiff_r = keep_r * k_t + k_t_r * keep;
            const double x89 = -lever * sliding_r;
            const double lever_r = x84 * (coupling_r + x89);
            const double roll_r = w * (rolling_r - lever * x85 * (2.0 * coupling_r + x89)) + x86 * x88;
            h_lane[k] = h;
            F_lane[k] = open_lane[k] == 0.0 ? F : NAN;
            F_r_lane[k] = F_r;
            more_lane[0 + k] = keep;
            more_lane[16 + k] = keep_r;
            more_lane[32 + k] = stiff;
            more_lane[48 + k] = stiff_r;
            more_lane[64 + k] = roll;
            more_lane[80 + k] = roll_r;
            more_lane[96 + k] = lever;
            more_lane[112 + k] = lever_r;
        }
        const int64_t count = base + 16 < n ? 16 : n - base;
        for (int64_t k = 0; k < count; k++) {
            i = base + k;
            y[i] = y_lane[k];
            gap[i] = h_lane[k];
            force[i] = F_lane[k];
            slope[i] = F_r_lane[k];
            more[0 * n + i] = more_lane[0 + k];
            more[1 * n + i] = more_lane[16 + k];
            more[2 * n + i] = more_lane[32 + k];
            more[3 * n + i] = more_lane[48 + k];
            more[4 * n + i] = more_lane[64 + k];
            more[5 * n + i] = more_lane[80 + k];
            more[6 * n + i] = more_lane[96 + k];
            more[7 * n + i] = more_lane[112 + k];
            unsolved += isfinite(F_lane[k]) && isfinite(F_r_lane[k]) ? 0 : 1;
        }
        base += 16;
    }
    return unsolved;
}

/* delta, a, F, friction, remote, C, dF_dh, dh_dt, friction_t, roll, k_t, k_t_h, k_t_delta of n contacts: out[k*n + i] is quantity k of contact i. */
void dlvo_state(int64_t n, double reach, const double *restrict overlaps, const double *restrict gap, const double *restrict p, const double *restrict q, double *restrict out)
{
    const double E = p[0];
    const double eta = p[1];
    const double own_A = p[2];
    const double own_Pi0 = p[3];
    const double own_ell = p[4];
    const double own_nu = p[5];
    for (int64_t i = 0; i < n; i++) {
        const double overlap = overlaps[i];
        const double h = gap[i];
        const double R = q[0 * n + i];
        const double size_ratio = q[1 * n + i];
        const double delta = h / 2.0 + overlap / 2.0;
        const double pressed = delta >= 0.0 ? 1.0 : 0.0;
        const double x0 = fabs(delta);
        const double x1 = 1.0 / R;
        const double x2 = 1.0 / h;
        const double x3 = x1 + x2;
        const double x4 = 1.0 / x3;
        const double x3_p2 = x3 * x3;
        const double a = sqrt(R * (x0 + x4 + 5.0 / (x3_p2 * (2.0 * x0 + 4.0 * x4))));
        const double own_nu_p2 = own_nu * own_nu;
        const double x6 = E / (1.0 - own_nu_p2);
        const double x7 = delta * x6;
        const double F_ela = 4.0 / 3.0 * x7 * a;
        const double x9 = x2 * R;
        const double x10 = 3.141592653589793 * eta;
        const double R_p2 = R * R;
        const double R_p3 = R_p2 * R;
        const double a_p2 = a * a;
        const double a_p4 = a_p2 * a_p2;
        const double a_p3 = a_p2 * a;
        const double a_p6 = a_p3 * a_p3;
        const double x3_p3 = x3_p2 * x3;
        const double zeta = 8.0 * x1 * x10 * x3_p2 * a_p4 * (x9 / 2.0 + 0.45 * _lane_log1p(20.0 / 9.0 * x9) + 1.0) / (142.3828125 * R_p3 / (x3_p3 * a_p6) + 1.0);
        const double h_p2 = h * h;
        const double F_adh = R * (3.141592653589793 * own_Pi0 * own_ell * _lane_exp(-h / own_ell) - own_A / (12.0 * h_p2));
        const double delta_p2 = delta * delta;
        const double x14 = delta_p2 * R_p2;
        const double x15 = R_p2 * h_p2;
        const double x16 = delta_p2 * h_p2;
        const double x17 = 8.0 * x0;
        const double x18 = R * h_p2;
        const double x19 = h * R_p2;
        const double x20 = 2.0 * h;
        const double x21 = x20 * R;
        const double x22 = R + h;
        const double x34 = x0 * x22 + x21;
        const double x34_p2 = x34 * x34;
        const double x23 = 1.0 / (x34_p2 * a);
        const double x24 = x23 * R * (4.0 * R * h * delta_p2 + 2.0 * x14 + 3.0 * x15 + 2.0 * x16 + x17 * x18 + x17 * x19);
        const double dF_ddelta = x6 * (4.0 * a + x0 * x24) / 3.0;
        const double x25 = 9.0 * x0;
        const double x22_p2 = x22 * x22;
        const double x26 = x23 * R_p3 * (x21 * delta_p2 + x14 + 9.0 * x15 + x16 + x18 * x25 + x19 * x25) / x22_p2;
        const double dF_dh = 2.0 / 3.0 * x26 * x7;
        const double C = dF_ddelta / 2.0;
        const double fading = (2.0 * reach - x20) / reach;
        const double started = 1.0 < fading ? 1.0 : fading;
        const double ahead = 0.0 > started ? 0.0 : started;
        const double ahead_p2 = ahead * ahead;
        const double w = ahead_p2 * (3.0 - 2.0 * ahead);
        const double film = pressed > 0.0 ? w : 1.0;
        const double grip = pressed > 0.0 ? 1.0 : w;
        const double rho = (F_ela - F_adh * film) / zeta;
        const double F = F_ela * grip;
        const double friction = w * zeta;
        const double remote = F_adh * w;
        const double dh_dt = -rho / film;
        const double a_h = x26 / 2.0;
        const double a_delta = x24 * (delta > 0.0 ? 1.0 : (delta < 0.0 ? -1.0 : 0.0)) / 4.0;
        const double x28 = 20.0 * a_p2;
        const double x29 = _lane_log1p(x9);
        const double x30 = 32.0 * x29;
        const double x31 = 48.0 * x29 * size_ratio;
        const double sliding = x10 * x2 * (x28 * R + x28 * h + x18 * x30 + x19 * x30 - x18 * x31 - x19 * x31 - 45.0 * x19) / (20.0 * x22);
        const double x32 = 0.6 * x10 * x29;
        const double coupling = x32 * R_p2;
        const double rolling = x32 * R_p3;
        const double x33 = 2.0 * E / ((own_nu + 1.0) * (2.0 - own_nu));
        const double k_t = x33 * a;
        const double k_t_h = a_h * x33;
        const double k_t_delta = a_delta * x33;
        const double friction_t = w * sliding;
        const double coupling_p2 = coupling * coupling;
        const double roll = w * (rolling - coupling_p2 * (1.0 - 4.0 * size_ratio) / sliding);
        out[0 * n + i] = delta;
        out[1 * n + i] = a;
        out[2 * n + i] = F;
        out[3 * n + i] = friction;
        out[4 * n + i] = remote;
        out[5 * n + i] = C;
        out[6 * n + i] = dF_dh;
        out[7 * n + i] = dh_dt;
        out[8 * n + i] = friction_t;
        out[9 * n + i] = roll;
        out[10 * n + i] = k_t;
        out[11 * n + i] = k_t_h;
        out[12 * n + i] = k_t_delta;
    }
}

/* Stored energy grip U and its slope in h at fixed delta, of n contacts: out[i] and out[n + i].

   U = integral of 2 F_ela(a(h, d), d) dd from 0 to delta, by quadrature over the fractions nodes of delta. */
void dlvo_energy(int64_t n, double reach, const double *restrict overlaps, const double *restrict gap, const double *restrict p, const double *restrict q, int64_t points, const double *restrict nodes, const double *restrict weights, double *restrict out)
{
    double delta;
    double x0;
    double x2;
    const double E = p[0];
    const double own_nu = p[5];
    for (int64_t i = 0; i < n; i++) {
        const double h = gap[i];
        const double whole = 0.5 * (overlaps[i] + h);
        double U = 0.0;
        double U_h = 0.0;
        for (int64_t m = 0; m < points; m++) {
            delta = whole * nodes[m];
            const double R = q[0 * n + i];
            x0 = fabs(delta);
            const double x1 = 1.0 / h + 1.0 / R;
            x2 = 1.0 / x1;
            const double x1_p2 = x1 * x1;
            const double a = sqrt(R * (x0 + x2 + 5.0 / (x1_p2 * (2.0 * x0 + 4.0 * x2))));
            const double own_nu_p2 = own_nu * own_nu;
            const double x3 = delta * E / (1.0 - own_nu_p2);
            const double F_ela = 4.0 / 3.0 * x3 * a;
            const double x4 = R + h;
            const double x5 = 2.0 * R * h;
            const double x10 = x0 * x4 + x5;
            const double h_p2 = h * h;
            const double x9 = 9.0 * h_p2;
            const double R_p2 = R * R;
            const double R_p3 = R_p2 * R;
            const double delta_p2 = delta * delta;
            const double x10_p2 = x10 * x10;
            const double x4_p2 = x4 * x4;
            const double dF_dh = 2.0 / 3.0 * x3 * R_p3 * (delta_p2 * R_p2 + 9.0 * x0 * h * R_p2 + x9 * R_p2 + x0 * x9 * R + delta_p2 * h_p2 + x5 * delta_p2) / (x10_p2 * x4_p2 * a);
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

/* What the fluid does to n particles alone, translation, rotation: out[k*n + i] is quantity k of particle i.

   In q stand the particles' own parameters, R the radius. */
void dlvo_drag(int64_t n, const double *restrict p, const double *restrict q, double *restrict out)
{
    const double eta = p[1];
    for (int64_t i = 0; i < n; i++) {
        const double R = q[0 * n + i];
        const double x0 = 3.141592653589793 * eta;
        const double translation = 6.0 * x0 * R;
        const double R_p2 = R * R;
        const double R_p3 = R_p2 * R;
        const double rotation = 8.0 * x0 * R_p3;
        out[0 * n + i] = translation;
        out[1 * n + i] = rotation;
    }
}
