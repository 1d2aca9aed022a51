/* Contact law droplet: written by softdyn 0.1.0 with sympy 1.14.0; do not edit.
 *
 * Source: Princen 1983, doi:10.1016/0021-9797(83)90323-5; Reynolds' film; Brenner 1961 for the friction of spheres
 * Law bbf87643f46d45d4, 3f944401bbdd72b3:
 *     a = sqrt(2)*sqrt(R)*Piecewise((sqrt(delta + 1/(1/h + 1/R)), delta >= 0), (sqrt(1/(-delta + 1/(1/h + 1/R)))/(1/h + 1/R), True))
 *     F_ela = 4*pi*delta*sigma
 *     zeta = 3*pi*R*eta*(R/(2*h) + 9*log(20*R/(9*h) + 1)/20 + 1)*Piecewise(((1 + 2*a**2*(1/h + 1/R)/R)*(1 - a**2*(1/h + 1/R)/R + a**4*(1/h + 1/R)**2/(4*R**2))/(4 + a**2*(1/h + 1/R)/(2*R)) + a**2*(1/h + 1/R)/(2*R), delta >= 0), (1/(2*R/(a**2*(1/h + 1/R)) + (440*R**2/(a**4*(1/h + 1/R)**2) - 440*R/(a**2*(1/h + 1/R)) + 110)/(36*R**2/(a**4*(1/h + 1/R)**2) - 36*R/(a**2*(1/h + 1/R)) + 29)), True))
 *     unequal = (4*R*size_ratio*(-4*(size_ratio + 1/5)*(1048576*size_ratio**8 + 4)/9 + 4)/(R*(22 - 68*size_ratio) + 16*h*size_ratio) + R/(2*h) + (size_ratio + 1/5)*(65536*size_ratio**8*log(20*R/(9*h) + 1) + (1 - 65536*size_ratio**8)*log(4*R/(9*h) + 1)) + 1)/(R/(2*h) + 9*log(20*R/(9*h) + 1)/20 + 1)
 *     F_adh = 0
 *     drag translation = 6*pi*R*eta
 * Left out, with the operations that each saved:
 *     no remote force: 425 -> 414
 * Operations, 1030 in all:
 *     iteration: 128 add, 233 mul, 36 div, 3 sqrt, 2 call
 *     tangent: 130 add, 239 mul, 38 div, 3 sqrt, 2 call
 *     state: 51 add, 119 mul, 16 div, 3 sqrt, 2 call
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
 *   p: eta, sigma, undragged_p1
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

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__) || \
    defined(__ASSOCIATIVE_MATH__) || defined(__RECIPROCAL_MATH__) || defined(__NO_SIGNED_ZEROS__)
#error "this code relies on IEEE arithmetic: compile it without -ffast-math and its parts"
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
    double size_ratio;
    double delta;
    double x0;
    double x1;
    double x3;
    double a;
    double x4;
    double F_ela;
    double x5;
    double x6;
    double x7;
    double x8;
    double x9;
    double x10;
    double x11;
    double size_ratio_p2;
    double size_ratio_p4;
    double size_ratio_p8;
    double x13;
    double x14;
    double x15;
    double x16;
    double x17;
    double x18;
    double x19;
    double of_radii;
    double h_p2;
    double x21;
    double x22;
    double x23;
    double x24;
    double x16_p2;
    double x25;
    double of_radii_h;
    double excess;
    double excess_h;
    double x26;
    double x27;
    double x28;
    double x29;
    double h_p3;
    double x32;
    double a_p2;
    double x34;
    double x35;
    double R_p2;
    double x37;
    double x38;
    double R_p3;
    double a_p3;
    double a_p6;
    double x40;
    double x41;
    double R_p6;
    double x43;
    double x44;
    double x45;
    double x46;
    double x47;
    double R_p4;
    double a_p4;
    double x50;
    double x51;
    double x52;
    double x53;
    double x54;
    double x55;
    double x56;
    double R_p5;
    double x58;
    double x59;
    double x60;
    double x61;
    double x62;
    double x63;
    double x64;
    double x65;
    double x66;
    double x67;
    double x68;
    double x69;
    double x70;
    double x71;
    double x72;
    double zeta;
    double dF_ddelta;
    double dF_dh;
    double x73;
    double x74;
    double x75;
    double x76;
    double x77;
    double x78;
    double x79;
    double x80;
    double x81;
    double x82;
    double x83;
    double x84;
    double x85;
    double x86;
    double x87;
    double x88;
    double log_zeta_h;
    double x89;
    double log_zeta_delta;
    double x90;
    double fading;
    double started;
    double ahead;
    double x92;
    double ahead_p2;
    double w;
    double w_h;
    double film;
    double film_h;
    double x94;
    double x95;
    double Y_h;
    double Y_hh;
    double x96;
    double rho;
    double rho_h;
    double x97;
    double x98;
    double H_h;
    const double eta = p[0];
    const double own_sigma = p[1];
    const double undragged_p1 = p[2];
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
                size_ratio = q_lane[16 + k];
                delta = h / 2.0 + overlap / 2.0;
                x0 = 1.0 / h;
                x1 = 1.0 / (x0 + 1.0 / R);
                x3 = x1 - delta;
                a = (delta >= 0.0 ? sqrt(delta + x1) : x1 / sqrt(x3)) * sqrt(2.0 * R);
                x4 = 12.566370614359172 * own_sigma;
                F_ela = delta * x4;
                x5 = x0 * R;
                x6 = 20.0 / 9.0 * x5;
                x7 = _lane_log1p(x6);
                x8 = x5 / 2.0;
                x9 = x8 + 1.0;
                x10 = 1.0 / (0.45 * x7 + x9);
                x11 = size_ratio + 0.2;
                size_ratio_p2 = size_ratio * size_ratio;
                size_ratio_p4 = size_ratio_p2 * size_ratio_p2;
                size_ratio_p8 = size_ratio_p4 * size_ratio_p4;
                x13 = 65536.0 * size_ratio_p8;
                x14 = 1.0 - x13;
                x15 = 4.0 / 9.0 * x5;
                x16 = R * (22.0 - 68.0 * size_ratio) + 16.0 * size_ratio * h;
                x17 = R * (4.0 - 4.0 / 9.0 * x11 * (1048576.0 * size_ratio_p8 + 4.0));
                x18 = 4.0 * x17 * size_ratio / x16 + x11 * (x13 * x7 + x14 * _lane_log1p(x15));
                x19 = x18 + x9;
                of_radii = x10 * x19;
                h_p2 = h * h;
                x21 = 1.0 / h_p2;
                x22 = x21 * R;
                x23 = x22 / 2.0;
                x24 = x22 / (x6 + 1.0);
                x16_p2 = x16 * x16;
                x25 = x11 * (-(1310720.0 / 9.0) * x24 * size_ratio_p8 - 4.0 / 9.0 * x14 * x22 / (x15 + 1.0)) - 64.0 * x17 * size_ratio_p2 / x16_p2 - x23;
                of_radii_h = x10 * (x23 + x24) + x25 / x19;
                excess = x18 + x8;
                excess_h = x25;
                x26 = excess + undragged_p1;
                x27 = 1.0 / (excess + 1.0);
                x28 = 9.0 * h;
                x29 = 10.0 * R + 20.0 * h + x28 * x7;
                h_p3 = h_p2 * h;
                x32 = 1.0 / h_p3;
                a_p2 = a * a;
                x34 = R * a_p2;
                x35 = h * a_p2;
                R_p2 = R * R;
                x37 = 8.0 * R_p2;
                x38 = 1.0 / (x37 * h + x34 + x35);
                R_p3 = R_p2 * R;
                a_p3 = a_p2 * a;
                a_p6 = a_p3 * a_p3;
                x40 = R_p3 * a_p6;
                x41 = a_p6 * h_p3;
                R_p6 = R_p3 * R_p3;
                x43 = R_p6 * h_p3;
                x44 = a_p6 * h_p2;
                x45 = x44 * R;
                x46 = R_p2 * a_p6;
                x47 = 3.0 * h;
                R_p4 = R_p2 * R_p2;
                a_p4 = a_p2 * a_p2;
                x50 = R_p4 * a_p4;
                x51 = R_p2 * a_p4;
                x52 = x51 * h_p3;
                x53 = a_p4 * h_p2;
                x54 = x53 * R_p3;
                x55 = 6.0 * a_p2;
                x56 = R_p4 * h_p3;
                R_p5 = R_p3 * R_p2;
                x58 = R_p5 * h_p2;
                x59 = x40 + x41 + 2.0 * x43 + 3.0 * x45 + x46 * x47 + x55 * x56 + x55 * x58 - x47 * x50 - 3.0 * x52 - 6.0 * x54;
                x60 = 165.0 * x44;
                x61 = 165.0 * x46;
                x62 = 191.0 * x50;
                x63 = 184.0 * a_p2;
                x64 = 1.0 / (x60 * R + x61 * h + 55.0 * x40 + 55.0 * x41 + 36.0 * x43 + x56 * x63 + x58 * x63 - x62 * h - 191.0 * x52 - 382.0 * x54);
                x65 = R + h;
                x66 = R * h;
                x67 = x66 * a_p4;
                x68 = R_p4 * h_p2;
                x69 = x35 * R_p3;
                x70 = 36.0 * R_p2;
                x71 = a_p2 * h_p2;
                x72 = 29.0 * x51 + 29.0 * x53 + 58.0 * x67 + 36.0 * x68 - 36.0 * x69 - x70 * x71;
                zeta = 3.141592653589793 * x26 * x27 * x29 * eta * of_radii * (delta >= 0.0 ? 0.15 * x32 * x38 * x59 / R_p3 : 0.075 * x0 * x34 * x64 * x65 * x72);
                dF_ddelta = x4;
                dF_dh = 0.0;
                x73 = 20.0 * R + x28;
                x74 = (220.0 * R + 180.0 * h + 9.0 * x7 * x73) / (x29 * x73);
                x75 = x66 * a_p6;
                x76 = R_p6 * h_p2;
                x77 = h * R_p3 * a_p4;
                x78 = x35 * R_p5;
                x79 = x51 * h_p2;
                x80 = 1.0 / x59;
                x81 = 3.0 * x80;
                x82 = 1.0 / x65;
                x83 = x71 * R_p2;
                x84 = 29.0 * a_p4;
                x85 = 2.0 / x72;
                x86 = delta * x65;
                x87 = x65 * a;
                x88 = a * (x85 * x87 * (29.0 * x34 + 29.0 * x35 - 18.0 * h * R_p2) + 1.0 / a - x64 * x87 * (165.0 * x51 + 165.0 * x53 + 330.0 * x67 + 184.0 * x68 - 382.0 * x69 - 382.0 * x83));
                log_zeta_h = excess_h * x27 * (1.0 - undragged_p1) / x26 + of_radii_h + (delta >= 0.0 ? 2.0 * x82 * R_p3 * (x81 * (x51 + x53 + 2.0 * x67 + 2.0 * x68 - 2.0 * x69 - 2.0 * x83) - x38) + x74 + x81 * (x44 + x46 + x55 * x68 + 2.0 * x75 + 2.0 * x76 + 4.0 * x78 - x50 - 4.0 * x77 - 3.0 * x79) - 3.0 * x0 - x38 * (a_p2 + x37) : x5 * x82 * x88 * (x66 - 2.0 * x86) / (x66 - x86) + x74 + x82 + x85 * (36.0 * h * R_p4 + x84 * R + x84 * h - 18.0 * R_p3 * a_p2 - x35 * x70) - x0 - x64 * (552.0 * x68 * a_p2 + x60 + x61 + 330.0 * x75 + 108.0 * x76 + 368.0 * x78 - x62 - 764.0 * x77 - 573.0 * x79));
                x89 = 48.0 * a_p2;
                log_zeta_delta = delta >= 0.0 ? 2.0 * x38 * x65 * x80 * R * (6.0 * x46 * h + 21.0 * x50 * h + 2.0 * x40 + 2.0 * x41 + 46.0 * x43 + 6.0 * x45 + 21.0 * x52 + 42.0 * x54 - x56 * x89 - x58 * x89) : x88 / x3;
                x90 = 1.0 / reach;
                fading = x90 * (2.0 * reach - 2.0 * h);
                started = 1.0 < fading ? 1.0 : fading;
                ahead = 0.0 > started ? 0.0 : started;
                x92 = 3.0 - 2.0 * ahead;
                ahead_p2 = ahead * ahead;
                w = x92 * ahead_p2;
                w_h = -2.0 * x90 * (2.0 * x92 * ahead - 2.0 * ahead_p2);
                film = pressed > 0.0 ? w : 1.0;
                film_h = pressed > 0.0 ? w_h : 0.0;
                x94 = 1.0 / g;
                x95 = g / 2.0;
                Y = x94 * h / 2.0 - x0 * x95;
                Y_h = x21 * x95 + x94 / 2.0;
                Y_hh = -x32 * g;
                x96 = 1.0 / zeta;
                rho = F_ela * x96;
                rho_h = x96 * (dF_ddelta / 2.0 + dF_dh) - rho * (log_zeta_delta / 2.0 + log_zeta_h);
                x97 = rho * s;
                x98 = Y - y_star;
                const double H = x97 * Y_h + x98 * film;
                H_h = film * Y_h + rho_h * Y_h * s + Y_hh * x97 + film_h * x98;
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
            size_ratio = q_lane[16 + k];
            delta = h / 2.0 + overlap / 2.0;
            x0 = 1.0 / h;
            x1 = 1.0 / (x0 + 1.0 / R);
            x3 = x1 - delta;
            a = (delta >= 0.0 ? sqrt(delta + x1) : x1 / sqrt(x3)) * sqrt(2.0 * R);
            x4 = 12.566370614359172 * own_sigma;
            F_ela = delta * x4;
            x5 = x0 * R;
            x6 = 20.0 / 9.0 * x5;
            x7 = _lane_log1p(x6);
            x8 = x5 / 2.0;
            x9 = x8 + 1.0;
            x10 = 1.0 / (0.45 * x7 + x9);
            x11 = size_ratio + 0.2;
            size_ratio_p2 = size_ratio * size_ratio;
            size_ratio_p4 = size_ratio_p2 * size_ratio_p2;
            size_ratio_p8 = size_ratio_p4 * size_ratio_p4;
            x13 = 65536.0 * size_ratio_p8;
            x14 = 1.0 - x13;
            x15 = 4.0 / 9.0 * x5;
            x16 = R * (22.0 - 68.0 * size_ratio) + 16.0 * size_ratio * h;
            x17 = R * (4.0 - 4.0 / 9.0 * x11 * (1048576.0 * size_ratio_p8 + 4.0));
            x18 = 4.0 * x17 * size_ratio / x16 + x11 * (x13 * x7 + x14 * _lane_log1p(x15));
            x19 = x18 + x9;
            of_radii = x10 * x19;
            h_p2 = h * h;
            x21 = 1.0 / h_p2;
            x22 = x21 * R;
            x23 = x22 / 2.0;
            x24 = x22 / (x6 + 1.0);
            x16_p2 = x16 * x16;
            x25 = x11 * (-(1310720.0 / 9.0) * x24 * size_ratio_p8 - 4.0 / 9.0 * x14 * x22 / (x15 + 1.0)) - 64.0 * x17 * size_ratio_p2 / x16_p2 - x23;
            of_radii_h = x10 * (x23 + x24) + x25 / x19;
            excess = x18 + x8;
            excess_h = x25;
            x26 = excess + undragged_p1;
            x27 = 1.0 / (excess + 1.0);
            x28 = 9.0 * h;
            x29 = 10.0 * R + 20.0 * h + x28 * x7;
            h_p3 = h_p2 * h;
            x32 = 1.0 / h_p3;
            a_p2 = a * a;
            x34 = R * a_p2;
            x35 = h * a_p2;
            R_p2 = R * R;
            x37 = 8.0 * R_p2;
            x38 = 1.0 / (x37 * h + x34 + x35);
            R_p3 = R_p2 * R;
            a_p3 = a_p2 * a;
            a_p6 = a_p3 * a_p3;
            x40 = R_p3 * a_p6;
            x41 = a_p6 * h_p3;
            R_p6 = R_p3 * R_p3;
            x43 = R_p6 * h_p3;
            x44 = a_p6 * h_p2;
            x45 = x44 * R;
            x46 = R_p2 * a_p6;
            x47 = 3.0 * h;
            R_p4 = R_p2 * R_p2;
            a_p4 = a_p2 * a_p2;
            x50 = R_p4 * a_p4;
            x51 = R_p2 * a_p4;
            x52 = x51 * h_p3;
            x53 = a_p4 * h_p2;
            x54 = x53 * R_p3;
            x55 = 6.0 * a_p2;
            x56 = R_p4 * h_p3;
            R_p5 = R_p3 * R_p2;
            x58 = R_p5 * h_p2;
            x59 = x40 + x41 + 2.0 * x43 + 3.0 * x45 + x46 * x47 + x55 * x56 + x55 * x58 - x47 * x50 - 3.0 * x52 - 6.0 * x54;
            x60 = 165.0 * x44;
            x61 = 165.0 * x46;
            x62 = 191.0 * x50;
            x63 = 184.0 * a_p2;
            x64 = 1.0 / (x60 * R + x61 * h + 55.0 * x40 + 55.0 * x41 + 36.0 * x43 + x56 * x63 + x58 * x63 - x62 * h - 191.0 * x52 - 382.0 * x54);
            x65 = R + h;
            x66 = R * h;
            x67 = x66 * a_p4;
            x68 = R_p4 * h_p2;
            x69 = x35 * R_p3;
            x70 = 36.0 * R_p2;
            x71 = a_p2 * h_p2;
            x72 = 29.0 * x51 + 29.0 * x53 + 58.0 * x67 + 36.0 * x68 - 36.0 * x69 - x70 * x71;
            zeta = 3.141592653589793 * x26 * x27 * x29 * eta * of_radii * (delta >= 0.0 ? 0.15 * x32 * x38 * x59 / R_p3 : 0.075 * x0 * x34 * x64 * x65 * x72);
            dF_ddelta = x4;
            dF_dh = 0.0;
            x73 = 20.0 * R + x28;
            x74 = (220.0 * R + 180.0 * h + 9.0 * x7 * x73) / (x29 * x73);
            x75 = x66 * a_p6;
            x76 = R_p6 * h_p2;
            x77 = h * R_p3 * a_p4;
            x78 = x35 * R_p5;
            x79 = x51 * h_p2;
            x80 = 1.0 / x59;
            x81 = 3.0 * x80;
            x82 = 1.0 / x65;
            x83 = x71 * R_p2;
            x84 = 29.0 * a_p4;
            x85 = 2.0 / x72;
            x86 = delta * x65;
            x87 = x65 * a;
            x88 = a * (x85 * x87 * (29.0 * x34 + 29.0 * x35 - 18.0 * h * R_p2) + 1.0 / a - x64 * x87 * (165.0 * x51 + 165.0 * x53 + 330.0 * x67 + 184.0 * x68 - 382.0 * x69 - 382.0 * x83));
            log_zeta_h = excess_h * x27 * (1.0 - undragged_p1) / x26 + of_radii_h + (delta >= 0.0 ? 2.0 * x82 * R_p3 * (x81 * (x51 + x53 + 2.0 * x67 + 2.0 * x68 - 2.0 * x69 - 2.0 * x83) - x38) + x74 + x81 * (x44 + x46 + x55 * x68 + 2.0 * x75 + 2.0 * x76 + 4.0 * x78 - x50 - 4.0 * x77 - 3.0 * x79) - 3.0 * x0 - x38 * (a_p2 + x37) : x5 * x82 * x88 * (x66 - 2.0 * x86) / (x66 - x86) + x74 + x82 + x85 * (36.0 * h * R_p4 + x84 * R + x84 * h - 18.0 * R_p3 * a_p2 - x35 * x70) - x0 - x64 * (552.0 * x68 * a_p2 + x60 + x61 + 330.0 * x75 + 108.0 * x76 + 368.0 * x78 - x62 - 764.0 * x77 - 573.0 * x79));
            x89 = 48.0 * a_p2;
            log_zeta_delta = delta >= 0.0 ? 2.0 * x38 * x65 * x80 * R * (6.0 * x46 * h + 21.0 * x50 * h + 2.0 * x40 + 2.0 * x41 + 46.0 * x43 + 6.0 * x45 + 21.0 * x52 + 42.0 * x54 - x56 * x89 - x58 * x89) : x88 / x3;
            x90 = 1.0 / reach;
            fading = x90 * (2.0 * reach - 2.0 * h);
            started = 1.0 < fading ? 1.0 : fading;
            ahead = 0.0 > started ? 0.0 : started;
            x92 = 3.0 - 2.0 * ahead;
            ahead_p2 = ahead * ahead;
            w = x92 * ahead_p2;
            w_h = -2.0 * x90 * (2.0 * x92 * ahead - 2.0 * ahead_p2);
            film = pressed > 0.0 ? w : 1.0;
            film_h = pressed > 0.0 ? w_h : 0.0;
            const double grip = pressed > 0.0 ? 1.0 : w;
            const double grip_h = pressed > 0.0 ? 0.0 : w_h;
            x94 = 1.0 / g;
            x95 = g / 2.0;
            Y = x94 * h / 2.0 - x0 * x95;
            Y_h = x21 * x95 + x94 / 2.0;
            Y_hh = -x32 * g;
            x96 = 1.0 / zeta;
            rho = F_ela * x96;
            x97 = dF_ddelta / 2.0;
            x98 = dF_dh + x97;
            rho_h = x96 * x98 - rho * (log_zeta_delta / 2.0 + log_zeta_h);
            const double rho_r = log_zeta_delta * rho / 2.0 - x96 * x97;
            const double x99 = Y_h * s;
            H_h = film * Y_h + Y_hh * rho * s + film_h * (Y - y_star) + rho_h * x99;
            const double H_r = rho_r * x99;
            const double h_r = -H_r / H_h;
            const double F = F_ela * grip;
            const double F_r = F_ela * grip_h * h_r + grip * (h_r * x98 - x97);
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
void droplet_state(int64_t n, double reach, const double *restrict overlaps, const double *restrict gap, const double *restrict p, const double *restrict q, double *restrict out)
{
    const double eta = p[0];
    const double own_sigma = p[1];
    const double undragged_p1 = p[2];
    for (int64_t i = 0; i < n; i++) {
        const double overlap = overlaps[i];
        const double h = gap[i];
        const double R = q[0 * n + i];
        const double size_ratio = q[1 * n + i];
        const double delta = h / 2.0 + overlap / 2.0;
        const double pressed = delta >= 0.0 ? 1.0 : 0.0;
        const double x1 = 1.0 / h;
        const double x2 = 1.0 / (x1 + 1.0 / R);
        const double a = (delta >= 0.0 ? sqrt(delta + x2) : x2 / sqrt(x2 - delta)) * sqrt(2.0 * R);
        const double x3 = 12.566370614359172 * own_sigma;
        const double F_ela = delta * x3;
        const double x4 = x1 * R;
        const double x5 = _lane_log1p(20.0 / 9.0 * x4);
        const double x6 = x4 / 2.0;
        const double x7 = x6 + 1.0;
        const double x8 = size_ratio + 0.2;
        const double size_ratio_p2 = size_ratio * size_ratio;
        const double size_ratio_p4 = size_ratio_p2 * size_ratio_p2;
        const double size_ratio_p8 = size_ratio_p4 * size_ratio_p4;
        const double x10 = 65536.0 * size_ratio_p8;
        const double x11 = 4.0 * size_ratio * R * (4.0 - 4.0 / 9.0 * x8 * (1048576.0 * size_ratio_p8 + 4.0)) / (R * (22.0 - 68.0 * size_ratio) + 16.0 * size_ratio * h) + x8 * (x10 * x5 + (1.0 - x10) * _lane_log1p(4.0 / 9.0 * x4));
        const double of_radii = (x11 + x7) / (0.45 * x5 + x7);
        const double excess = x11 + x6;
        const double a_p2 = a * a;
        const double x15 = R * a_p2;
        const double x16 = h * a_p2;
        const double R_p2 = R * R;
        const double x18 = h * R_p2;
        const double R_p3 = R_p2 * R;
        const double a_p3 = a_p2 * a;
        const double a_p6 = a_p3 * a_p3;
        const double x20 = R_p3 * a_p6;
        const double h_p2 = h * h;
        const double h_p3 = h_p2 * h;
        const double x21 = a_p6 * h_p3;
        const double R_p6 = R_p3 * R_p3;
        const double x22 = R_p6 * h_p3;
        const double x23 = 3.0 * a_p6;
        const double x25 = R * h_p2;
        const double a_p4 = a_p2 * a_p2;
        const double x27 = 3.0 * a_p4;
        const double R_p4 = R_p2 * R_p2;
        const double x29 = h * R_p4;
        const double x30 = R_p2 * h_p3;
        const double x31 = 6.0 * h_p2;
        const double x32 = R_p3 * a_p4;
        const double x33 = R_p4 * a_p2 * h_p3;
        const double R_p5 = R_p3 * R_p2;
        const double x34 = R_p5 * a_p2;
        const double x35 = 165.0 * a_p6;
        const double x36 = 191.0 * a_p4;
        const double x37 = 29.0 * a_p4;
        const double x38 = 36.0 * h_p2;
        const double zeta = 3.141592653589793 * eta * of_radii * (excess + undragged_p1) * (10.0 * R + 9.0 * x5 * h + 20.0 * h) * (delta >= 0.0 ? 0.15 * (x18 * x23 + x20 + x21 + 2.0 * x22 + x23 * x25 + x31 * x34 + 6.0 * x33 - x27 * x29 - x27 * x30 - x31 * x32) / (R_p3 * h_p3 * (x15 + x16 + 8.0 * x18)) : 0.075 * x1 * x15 * (R + h) * (x38 * R_p4 + x37 * R_p2 + 58.0 * R * h * a_p4 + x37 * h_p2 - 36.0 * x16 * R_p3 - x38 * R_p2 * a_p2) / (184.0 * x34 * h_p2 + x18 * x35 + 55.0 * x20 + 55.0 * x21 + 36.0 * x22 + x25 * x35 + 184.0 * x33 - 382.0 * x32 * h_p2 - x29 * x36 - x30 * x36)) / (excess + 1.0);
        const double dF_ddelta = x3;
        const double dF_dh = 0.0;
        const double x39 = dF_ddelta / 2.0;
        const double C = x39;
        const double x40 = 1.0 / reach;
        const double fading = x40 * (2.0 * reach - 2.0 * h);
        const double started = 1.0 < fading ? 1.0 : fading;
        const double ahead = 0.0 > started ? 0.0 : started;
        const double x42 = 3.0 - 2.0 * ahead;
        const double ahead_p2 = ahead * ahead;
        const double w = x42 * ahead_p2;
        const double w_h = -2.0 * x40 * (2.0 * x42 * ahead - 2.0 * ahead_p2);
        const double film = pressed > 0.0 ? w : 1.0;
        const double grip = pressed > 0.0 ? 1.0 : w;
        const double grip_h = pressed > 0.0 ? 0.0 : w_h;
        const double rho = F_ela / zeta;
        const double F = F_ela * grip;
        const double F_by_gap = F_ela * grip_h + grip * (dF_dh + x39);
        const double F_by_distance = -x39 * grip;
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
