/* Contact law soap_film: written by softdyn 0.1.0 with sympy 1.14.0; do not edit.
 *
 * Source: Bergeron 1999, doi:10.1088/0953-8984/11/19/201; droplet
 * Law 6bd00ef615be7c1f, 3f944401bbdd72b3:
 *     a = sqrt(2)*sqrt(R)*Piecewise((sqrt(delta + 1/(1/h + 1/R)), delta >= 0), (sqrt(1/(-delta + 1/(1/h + 1/R)))/(1/h + 1/R), True))
 *     F_ela = 4*pi*delta*sigma
 *     zeta = 3*pi*R*eta*(R/(2*h) + 9*log(20*R/(9*h) + 1)/20 + 1)*Piecewise(((1 + 2*a**2*(1/h + 1/R)/R)*(1 - a**2*(1/h + 1/R)/R + a**4*(1/h + 1/R)**2/(4*R**2))/(4 + a**2*(1/h + 1/R)/(2*R)) + a**2*(1/h + 1/R)/(2*R), delta >= 0), (1/(2*R/(a**2*(1/h + 1/R)) + (440*R**2/(a**4*(1/h + 1/R)**2) - 440*R/(a**2*(1/h + 1/R)) + 110)/(36*R**2/(a**4*(1/h + 1/R)**2) - 36*R/(a**2*(1/h + 1/R)) + 29)), True))
 *     unequal = (4*R*size_ratio*(-4*(size_ratio + 1/5)*(1048576*size_ratio**8 + 4)/9 + 4)/(R*(22 - 68*size_ratio) + 16*h*size_ratio) + R/(2*h) + (size_ratio + 1/5)*(65536*size_ratio**8*log(20*R/(9*h) + 1) + (1 - 65536*size_ratio**8)*log(4*R/(9*h) + 1)) + 1)/(R/(2*h) + 9*log(20*R/(9*h) + 1)/20 + 1)
 *     F_adh = pi*Pi0*Piecewise((R*ell - 2*R/(1/h + 1/R) + a**2, delta >= 0), (a**2*ell*(1/(2*h) + 1/(2*R)), True))*exp(-h/ell)
 *     drag translation = 6*pi*R*eta
 * Operations, 1278 in all:
 *     iteration: 142 add, 265 mul, 40 div, 3 sqrt, 3 call
 *     tangent: 146 add, 272 mul, 42 div, 3 sqrt, 3 call
 *     state: 54 add, 129 mul, 18 div, 3 sqrt, 3 call
 *     elastic: 2 mul
 *     weight: 3 add, 11 mul, 1 div
 *     side: 34 add, 79 mul, 15 div, 2 sqrt, 3 call
 *     drag: 2 mul
 *
 * A C API that depends on math.h alone, for n contacts at given distances of their centres; see each function.
 *
 *   int64_t soap_film_contacts(n, s, reach, overlaps, start, target, p, q, y, gap, force, slope)
 *   void soap_film_state(n, reach, overlaps, gap, p, q, out)
 *   void soap_film_energy(n, reach, overlaps, gap, p, q, points, nodes, weights, out)
 *   void soap_film_drag(n, p, q, out), of n particles, with their own parameters in q
 *
 *   p: eta, Pi0, ell, sigma, undragged_p1
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
   dF/dr along the solution; the force is nan where there is none. Returns how many contacts have none. */
int64_t soap_film_contacts(int64_t n, double s, double reach, const double *restrict overlaps, const double *restrict start, const double *restrict target, const double *restrict p, const double *restrict q, double *restrict y, double *restrict gap, double *restrict force, double *restrict slope)
{
    int64_t i;
    double overlap;
    double g;
    double y_star;
    double h;
    double R;
    double size_ratio;
    double x0;
    double x1;
    double a;
    double x2;
    double x3;
    double x5;
    double x6;
    double size_ratio_p2;
    double size_ratio_p4;
    double size_ratio_p8;
    double x8;
    double x9;
    double of_radii;
    double excess;
    double R_p2;
    double a_p2;
    double a_p3;
    double a_p6;
    double x17;
    double a_p4;
    double x20;
    double h_p2;
    double x21;
    double R_p3;
    double R_p4;
    double R_p5;
    double R_p6;
    double h_p3;
    double zeta;
    double F_adh;
    double x23;
    double Y;
    double Y_h;
    double y_now;
    double factor;
    double grown;
    double shrunk;
    double pressed;
    double delta;
    double F_ela;
    double x7;
    double x10;
    double x11;
    double x12;
    double x13;
    double x15;
    double x16;
    double x18;
    double x19;
    double x24;
    double x25;
    double x26;
    double x18_p2;
    double x27;
    double of_radii_h;
    double excess_h;
    double x28;
    double x29;
    double x30;
    double x31;
    double x34;
    double x38;
    double x36;
    double x39;
    double x40;
    double x41;
    double x43;
    double x44;
    double x46;
    double x47;
    double x48;
    double x49;
    double x50;
    double x53;
    double x54;
    double x55;
    double x56;
    double x57;
    double x58;
    double x59;
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
    double x73;
    double x74;
    double x75;
    double x76;
    double x77;
    double x78;
    double x79;
    double x80;
    double x81;
    double dF_ddelta;
    double dF_dh;
    double x82;
    double x83;
    double x84;
    double x85;
    double x86;
    double x87;
    double x88;
    double x89;
    double x90;
    double x91;
    double x92;
    double x93;
    double x94;
    double x95;
    double x96;
    double x97;
    double log_zeta_h;
    double x98;
    double x99;
    double log_zeta_delta;
    double x100;
    double remote_h;
    double remote_delta;
    double x101;
    double fading;
    double started;
    double ahead;
    double x103;
    double ahead_p2;
    double w;
    double w_h;
    double film;
    double film_h;
    double x105;
    double x106;
    double Y_hh;
    double x107;
    double rho;
    double rho_h;
    double x108;
    double x109;
    double H_h;
    const double eta = p[0];
    const double own_Pi0 = p[1];
    const double own_ell = p[2];
    const double own_sigma = p[3];
    const double undragged_p1 = p[4];
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
            R = q_lane[0 + k];
            size_ratio = q_lane[16 + k];
            x0 = 1.0 / h;
            x1 = x0 + 1.0 / R;
            a = sqrt(2.0 * R) / sqrt(x1);
            x2 = x0 * R;
            x3 = _lane_log1p(20.0 / 9.0 * x2);
            const double x4 = x2 / 2.0;
            x5 = x4 + 1.0;
            x6 = size_ratio + 0.2;
            size_ratio_p2 = size_ratio * size_ratio;
            size_ratio_p4 = size_ratio_p2 * size_ratio_p2;
            size_ratio_p8 = size_ratio_p4 * size_ratio_p4;
            x8 = 65536.0 * size_ratio_p8;
            x9 = 4.0 * size_ratio * R * (4.0 - 4.0 / 9.0 * x6 * (1048576.0 * size_ratio_p8 + 4.0)) / (R * (22.0 - 68.0 * size_ratio) + 16.0 * size_ratio * h) + x6 * (x3 * x8 + (1.0 - x8) * _lane_log1p(4.0 / 9.0 * x2));
            of_radii = (x5 + x9) / (0.45 * x3 + x5);
            excess = x4 + x9;
            R_p2 = R * R;
            const double x14 = h * R_p2;
            a_p2 = a * a;
            a_p3 = a_p2 * a;
            a_p6 = a_p3 * a_p3;
            x17 = 3.0 * a_p6;
            a_p4 = a_p2 * a_p2;
            x20 = 3.0 * a_p4;
            h_p2 = h * h;
            x21 = 6.0 * h_p2;
            R_p3 = R_p2 * R;
            R_p4 = R_p2 * R_p2;
            R_p5 = R_p3 * R_p2;
            R_p6 = R_p3 * R_p3;
            h_p3 = h_p2 * h;
            zeta = 0.47123889803846897 * eta * of_radii * (excess + undragged_p1) * (10.0 * R + 9.0 * x3 * h + 20.0 * h) * (2.0 * R_p6 * h_p3 + x21 * R_p5 * a_p2 + 6.0 * R_p4 * a_p2 * h_p3 + R_p3 * a_p6 + x17 * R * h_p2 + a_p6 * h_p3 + x14 * x17 - x20 * h * R_p4 - x21 * R_p3 * a_p4 - x20 * R_p2 * h_p3) / (R_p3 * h_p3 * (excess + 1.0) * (R * a_p2 + h * a_p2 + 8.0 * x14));
            F_adh = 3.141592653589793 * own_Pi0 * (R * own_ell + a_p2 - 2.0 * R / x1) * _lane_exp(-h / own_ell);
            const double x22 = 1.0 / g;
            x23 = g / 2.0;
            Y = x22 * h / 2.0 - x0 * x23;
            Y_h = x22 / 2.0 + x23 / h_p2;
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
                size_ratio = q_lane[16 + k];
                delta = h / 2.0 + overlap / 2.0;
                x0 = 1.0 / R;
                x1 = 1.0 / h;
                x2 = x0 + x1;
                x3 = 1.0 / x2;
                x5 = x3 - delta;
                a = (delta >= 0.0 ? sqrt(delta + x3) : x3 / sqrt(x5)) * sqrt(2.0 * R);
                x6 = 12.566370614359172 * own_sigma;
                F_ela = delta * x6;
                x7 = x1 * R;
                x8 = 20.0 / 9.0 * x7;
                x9 = _lane_log1p(x8);
                x10 = x7 / 2.0;
                x11 = x10 + 1.0;
                x12 = 1.0 / (x11 + 0.45 * x9);
                x13 = size_ratio + 0.2;
                size_ratio_p2 = size_ratio * size_ratio;
                size_ratio_p4 = size_ratio_p2 * size_ratio_p2;
                size_ratio_p8 = size_ratio_p4 * size_ratio_p4;
                x15 = 65536.0 * size_ratio_p8;
                x16 = 1.0 - x15;
                x17 = 4.0 / 9.0 * x7;
                x18 = R * (22.0 - 68.0 * size_ratio) + 16.0 * size_ratio * h;
                x19 = R * (4.0 - 4.0 / 9.0 * x13 * (1048576.0 * size_ratio_p8 + 4.0));
                x20 = 4.0 * x19 * size_ratio / x18 + x13 * (x15 * x9 + x16 * _lane_log1p(x17));
                x21 = x11 + x20;
                of_radii = x12 * x21;
                h_p2 = h * h;
                x23 = 1.0 / h_p2;
                x24 = x23 * R;
                x25 = x24 / 2.0;
                x26 = x24 / (x8 + 1.0);
                x18_p2 = x18 * x18;
                x27 = x13 * (-(1310720.0 / 9.0) * x26 * size_ratio_p8 - 4.0 / 9.0 * x16 * x24 / (x17 + 1.0)) - 64.0 * x19 * size_ratio_p2 / x18_p2 - x25;
                of_radii_h = x12 * (x25 + x26) + x27 / x21;
                excess = x10 + x20;
                excess_h = x27;
                x28 = excess + undragged_p1;
                x29 = 1.0 / (excess + 1.0);
                x30 = 9.0 * h;
                x31 = 10.0 * R + 20.0 * h + x30 * x9;
                h_p3 = h_p2 * h;
                x34 = 1.0 / h_p3;
                a_p2 = a * a;
                x38 = R * a_p2;
                R_p2 = R * R;
                x36 = 8.0 * R_p2;
                x39 = h * a_p2;
                x40 = x38 + x39;
                x41 = 1.0 / (x36 * h + x40);
                R_p3 = R_p2 * R;
                a_p3 = a_p2 * a;
                a_p6 = a_p3 * a_p3;
                x43 = R_p3 * a_p6;
                x44 = a_p6 * h_p3;
                R_p6 = R_p3 * R_p3;
                x46 = R_p6 * h_p3;
                x47 = a_p6 * h_p2;
                x48 = x47 * R;
                x49 = R_p2 * a_p6;
                x50 = 3.0 * h;
                R_p4 = R_p2 * R_p2;
                a_p4 = a_p2 * a_p2;
                x53 = R_p4 * a_p4;
                x54 = R_p2 * a_p4;
                x55 = x54 * h_p3;
                x56 = a_p4 * h_p2;
                x57 = x56 * R_p3;
                x58 = 6.0 * a_p2;
                x59 = R_p4 * h_p3;
                R_p5 = R_p3 * R_p2;
                x61 = R_p5 * h_p2;
                x62 = x43 + x44 + 2.0 * x46 + 3.0 * x48 + x49 * x50 + x58 * x59 + x58 * x61 - x50 * x53 - 3.0 * x55 - 6.0 * x57;
                x63 = 165.0 * x47;
                x64 = 165.0 * x49;
                x65 = 191.0 * x53;
                x66 = 184.0 * a_p2;
                x67 = 1.0 / (x63 * R + x64 * h + 55.0 * x43 + 55.0 * x44 + 36.0 * x46 + x59 * x66 + x61 * x66 - x65 * h - 191.0 * x55 - 382.0 * x57);
                x68 = R + h;
                x69 = R * h;
                x70 = x69 * a_p4;
                x71 = R_p4 * h_p2;
                x72 = x39 * R_p3;
                x73 = 36.0 * R_p2;
                x74 = a_p2 * h_p2;
                x75 = 29.0 * x54 + 29.0 * x56 + 58.0 * x70 + 36.0 * x71 - 36.0 * x72 - x73 * x74;
                zeta = 3.141592653589793 * x28 * x29 * x31 * eta * of_radii * (delta >= 0.0 ? 0.15 * x34 * x41 * x62 / R_p3 : 0.075 * x1 * x38 * x67 * x68 * x75);
                x76 = R * own_ell;
                x77 = 2.0 * R;
                x78 = a_p2 / 2.0;
                x79 = x2 * x78 * own_ell;
                x80 = 1.0 / own_ell;
                x81 = 3.141592653589793 * own_Pi0 * _lane_exp(-x80 * h);
                F_adh = x81 * (delta >= 0.0 ? a_p2 + x76 - x3 * x77 : x79);
                dF_ddelta = x6;
                dF_dh = 0.0;
                x82 = 20.0 * R + x30;
                x83 = (220.0 * R + 180.0 * h + 9.0 * x82 * x9) / (x31 * x82);
                x84 = x69 * a_p6;
                x85 = R_p6 * h_p2;
                x86 = h * R_p3 * a_p4;
                x87 = x39 * R_p5;
                x88 = x54 * h_p2;
                x89 = 1.0 / x62;
                x90 = 3.0 * x89;
                x91 = 1.0 / x68;
                x92 = x74 * R_p2;
                x93 = 29.0 * a_p4;
                x94 = 2.0 / x75;
                x95 = delta * x68;
                x96 = x68 * a;
                x97 = a * (x94 * x96 * (29.0 * x38 + 29.0 * x39 - 18.0 * h * R_p2) + 1.0 / a - x67 * x96 * (165.0 * x54 + 165.0 * x56 + 330.0 * x70 + 184.0 * x71 - 382.0 * x72 - 382.0 * x92));
                log_zeta_h = excess_h * x29 * (1.0 - undragged_p1) / x28 + of_radii_h + (delta >= 0.0 ? 2.0 * x91 * R_p3 * (x90 * (x54 + x56 + 2.0 * x70 + 2.0 * x71 - 2.0 * x72 - 2.0 * x92) - x41) + x83 + x90 * (x47 + x49 + x58 * x71 + 2.0 * x84 + 2.0 * x85 + 4.0 * x87 - x53 - 4.0 * x86 - 3.0 * x88) - 3.0 * x1 - x41 * (a_p2 + x36) : x7 * x91 * x97 * (x69 - 2.0 * x95) / (x69 - x95) + x83 + x91 + x94 * (36.0 * h * R_p4 + x93 * R + x93 * h - 18.0 * R_p3 * a_p2 - x39 * x73) - x1 - x67 * (552.0 * x71 * a_p2 + x63 + x64 + 330.0 * x84 + 108.0 * x85 + 368.0 * x87 - x65 - 764.0 * x86 - 573.0 * x88));
                x98 = 48.0 * a_p2;
                x99 = 1.0 / x5;
                log_zeta_delta = delta >= 0.0 ? x41 * x68 * x77 * x89 * (6.0 * x49 * h + 21.0 * x53 * h + 2.0 * x43 + 2.0 * x44 + 46.0 * x46 + 6.0 * x48 + 21.0 * x55 + 42.0 * x57 - x59 * x98 - x61 * x98) : x97 * x99;
                x100 = 2.0 * h;
                remote_h = x81 * (delta >= 0.0 ? -x80 * x91 * (own_ell * R_p2 + x76 * h + x40 - x100 * R_p2) : -x0 * x23 * x68 * x78 * (delta * R * own_ell + R * h_p2 - delta * h_p2 - delta * x69) / (R * h - delta * R - delta * h));
                remote_delta = x81 * (delta >= 0.0 ? x77 : x79 * x99);
                x101 = 1.0 / reach;
                fading = x101 * (2.0 * reach - x100);
                started = 1.0 < fading ? 1.0 : fading;
                ahead = 0.0 > started ? 0.0 : started;
                x103 = 3.0 - 2.0 * ahead;
                ahead_p2 = ahead * ahead;
                w = x103 * ahead_p2;
                w_h = -2.0 * x101 * (2.0 * x103 * ahead - 2.0 * ahead_p2);
                film = pressed > 0.0 ? w : 1.0;
                film_h = pressed > 0.0 ? w_h : 0.0;
                x105 = 1.0 / g;
                x106 = g / 2.0;
                Y = x105 * h / 2.0 - x1 * x106;
                Y_h = x105 / 2.0 + x106 * x23;
                Y_hh = -x34 * g;
                x107 = 1.0 / zeta;
                rho = -x107 * (F_adh * film - F_ela);
                rho_h = x107 * (dF_ddelta / 2.0 + dF_dh - F_adh * film_h - film * (remote_delta / 2.0 + remote_h)) - rho * (log_zeta_delta / 2.0 + log_zeta_h);
                x108 = rho * s;
                x109 = Y - y_star;
                const double H = x108 * Y_h + x109 * film;
                H_h = film * Y_h + rho_h * Y_h * s + Y_hh * x108 + film_h * x109;
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
            x0 = 1.0 / R;
            x1 = 1.0 / h;
            x2 = x0 + x1;
            x3 = 1.0 / x2;
            x5 = x3 - delta;
            a = (delta >= 0.0 ? sqrt(delta + x3) : x3 / sqrt(x5)) * sqrt(2.0 * R);
            x6 = 12.566370614359172 * own_sigma;
            F_ela = delta * x6;
            x7 = x1 * R;
            x8 = 20.0 / 9.0 * x7;
            x9 = _lane_log1p(x8);
            x10 = x7 / 2.0;
            x11 = x10 + 1.0;
            x12 = 1.0 / (x11 + 0.45 * x9);
            x13 = size_ratio + 0.2;
            size_ratio_p2 = size_ratio * size_ratio;
            size_ratio_p4 = size_ratio_p2 * size_ratio_p2;
            size_ratio_p8 = size_ratio_p4 * size_ratio_p4;
            x15 = 65536.0 * size_ratio_p8;
            x16 = 1.0 - x15;
            x17 = 4.0 / 9.0 * x7;
            x18 = R * (22.0 - 68.0 * size_ratio) + 16.0 * size_ratio * h;
            x19 = R * (4.0 - 4.0 / 9.0 * x13 * (1048576.0 * size_ratio_p8 + 4.0));
            x20 = 4.0 * x19 * size_ratio / x18 + x13 * (x15 * x9 + x16 * _lane_log1p(x17));
            x21 = x11 + x20;
            of_radii = x12 * x21;
            h_p2 = h * h;
            x23 = 1.0 / h_p2;
            x24 = x23 * R;
            x25 = x24 / 2.0;
            x26 = x24 / (x8 + 1.0);
            x18_p2 = x18 * x18;
            x27 = x13 * (-(1310720.0 / 9.0) * x26 * size_ratio_p8 - 4.0 / 9.0 * x16 * x24 / (x17 + 1.0)) - 64.0 * x19 * size_ratio_p2 / x18_p2 - x25;
            of_radii_h = x12 * (x25 + x26) + x27 / x21;
            excess = x10 + x20;
            excess_h = x27;
            x28 = excess + undragged_p1;
            x29 = 1.0 / (excess + 1.0);
            x30 = 9.0 * h;
            x31 = 10.0 * R + 20.0 * h + x30 * x9;
            h_p3 = h_p2 * h;
            x34 = 1.0 / h_p3;
            a_p2 = a * a;
            x38 = R * a_p2;
            R_p2 = R * R;
            x36 = 8.0 * R_p2;
            x39 = h * a_p2;
            x40 = x38 + x39;
            x41 = 1.0 / (x36 * h + x40);
            R_p3 = R_p2 * R;
            a_p3 = a_p2 * a;
            a_p6 = a_p3 * a_p3;
            x43 = R_p3 * a_p6;
            x44 = a_p6 * h_p3;
            R_p6 = R_p3 * R_p3;
            x46 = R_p6 * h_p3;
            x47 = a_p6 * h_p2;
            x48 = x47 * R;
            x49 = R_p2 * a_p6;
            x50 = 3.0 * h;
            R_p4 = R_p2 * R_p2;
            a_p4 = a_p2 * a_p2;
            x53 = R_p4 * a_p4;
            x54 = R_p2 * a_p4;
            x55 = x54 * h_p3;
            x56 = a_p4 * h_p2;
            x57 = x56 * R_p3;
            x58 = 6.0 * a_p2;
            x59 = R_p4 * h_p3;
            R_p5 = R_p3 * R_p2;
            x61 = R_p5 * h_p2;
            x62 = x43 + x44 + 2.0 * x46 + 3.0 * x48 + x49 * x50 + x58 * x59 + x58 * x61 - x50 * x53 - 3.0 * x55 - 6.0 * x57;
            x63 = 165.0 * x47;
            x64 = 165.0 * x49;
            x65 = 191.0 * x53;
            x66 = 184.0 * a_p2;
            x67 = 1.0 / (x63 * R + x64 * h + 55.0 * x43 + 55.0 * x44 + 36.0 * x46 + x59 * x66 + x61 * x66 - x65 * h - 191.0 * x55 - 382.0 * x57);
            x68 = R + h;
            x69 = R * h;
            x70 = x69 * a_p4;
            x71 = R_p4 * h_p2;
            x72 = x39 * R_p3;
            x73 = 36.0 * R_p2;
            x74 = a_p2 * h_p2;
            x75 = 29.0 * x54 + 29.0 * x56 + 58.0 * x70 + 36.0 * x71 - 36.0 * x72 - x73 * x74;
            zeta = 3.141592653589793 * x28 * x29 * x31 * eta * of_radii * (delta >= 0.0 ? 0.15 * x34 * x41 * x62 / R_p3 : 0.075 * x1 * x38 * x67 * x68 * x75);
            x76 = R * own_ell;
            x77 = 2.0 * R;
            x78 = a_p2 / 2.0;
            x79 = x2 * x78 * own_ell;
            x80 = 1.0 / own_ell;
            x81 = 3.141592653589793 * own_Pi0 * _lane_exp(-x80 * h);
            F_adh = x81 * (delta >= 0.0 ? a_p2 + x76 - x3 * x77 : x79);
            dF_ddelta = x6;
            dF_dh = 0.0;
            x82 = 20.0 * R + x30;
            x83 = (220.0 * R + 180.0 * h + 9.0 * x82 * x9) / (x31 * x82);
            x84 = x69 * a_p6;
            x85 = R_p6 * h_p2;
            x86 = h * R_p3 * a_p4;
            x87 = x39 * R_p5;
            x88 = x54 * h_p2;
            x89 = 1.0 / x62;
            x90 = 3.0 * x89;
            x91 = 1.0 / x68;
            x92 = x74 * R_p2;
            x93 = 29.0 * a_p4;
            x94 = 2.0 / x75;
            x95 = delta * x68;
            x96 = x68 * a;
            x97 = a * (x94 * x96 * (29.0 * x38 + 29.0 * x39 - 18.0 * h * R_p2) + 1.0 / a - x67 * x96 * (165.0 * x54 + 165.0 * x56 + 330.0 * x70 + 184.0 * x71 - 382.0 * x72 - 382.0 * x92));
            log_zeta_h = excess_h * x29 * (1.0 - undragged_p1) / x28 + of_radii_h + (delta >= 0.0 ? 2.0 * x91 * R_p3 * (x90 * (x54 + x56 + 2.0 * x70 + 2.0 * x71 - 2.0 * x72 - 2.0 * x92) - x41) + x83 + x90 * (x47 + x49 + x58 * x71 + 2.0 * x84 + 2.0 * x85 + 4.0 * x87 - x53 - 4.0 * x86 - 3.0 * x88) - 3.0 * x1 - x41 * (a_p2 + x36) : x7 * x91 * x97 * (x69 - 2.0 * x95) / (x69 - x95) + x83 + x91 + x94 * (36.0 * h * R_p4 + x93 * R + x93 * h - 18.0 * R_p3 * a_p2 - x39 * x73) - x1 - x67 * (552.0 * x71 * a_p2 + x63 + x64 + 330.0 * x84 + 108.0 * x85 + 368.0 * x87 - x65 - 764.0 * x86 - 573.0 * x88));
            x98 = 48.0 * a_p2;
            x99 = 1.0 / x5;
            log_zeta_delta = delta >= 0.0 ? x41 * x68 * x77 * x89 * (6.0 * x49 * h + 21.0 * x53 * h + 2.0 * x43 + 2.0 * x44 + 46.0 * x46 + 6.0 * x48 + 21.0 * x55 + 42.0 * x57 - x59 * x98 - x61 * x98) : x97 * x99;
            x100 = 2.0 * h;
            remote_h = x81 * (delta >= 0.0 ? -x80 * x91 * (own_ell * R_p2 + x76 * h + x40 - x100 * R_p2) : -x0 * x23 * x68 * x78 * (delta * R * own_ell + R * h_p2 - delta * h_p2 - delta * x69) / (R * h - delta * R - delta * h));
            remote_delta = x81 * (delta >= 0.0 ? x77 : x79 * x99);
            x101 = 1.0 / reach;
            fading = x101 * (2.0 * reach - x100);
            started = 1.0 < fading ? 1.0 : fading;
            ahead = 0.0 > started ? 0.0 : started;
            x103 = 3.0 - 2.0 * ahead;
            ahead_p2 = ahead * ahead;
            w = x103 * ahead_p2;
            w_h = -2.0 * x101 * (2.0 * x103 * ahead - 2.0 * ahead_p2);
            film = pressed > 0.0 ? w : 1.0;
            film_h = pressed > 0.0 ? w_h : 0.0;
            const double grip = pressed > 0.0 ? 1.0 : w;
            const double grip_h = pressed > 0.0 ? 0.0 : w_h;
            x105 = 1.0 / g;
            x106 = g / 2.0;
            Y = x105 * h / 2.0 - x1 * x106;
            Y_h = x105 / 2.0 + x106 * x23;
            Y_hh = -x34 * g;
            x107 = 1.0 / zeta;
            rho = -x107 * (F_adh * film - F_ela);
            x108 = log_zeta_delta / 2.0;
            x109 = dF_ddelta / 2.0;
            rho_h = x107 * (dF_dh + x109 - F_adh * film_h - film * (remote_delta / 2.0 + remote_h)) - rho * (log_zeta_h + x108);
            const double rho_r = rho * x108 - x107 * (dF_ddelta - remote_delta * film) / 2.0;
            const double x110 = Y_h * s;
            H_h = film * Y_h + Y_hh * rho * s + film_h * (Y - y_star) + rho_h * x110;
            const double H_r = rho_r * x110;
            const double h_r = -H_r / H_h;
            const double F = F_ela * grip;
            const double F_r = F_ela * grip_h * h_r + grip * (h_r * (dF_dh + x109) - x109);
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
void soap_film_state(int64_t n, double reach, const double *restrict overlaps, const double *restrict gap, const double *restrict p, const double *restrict q, double *restrict out)
{
    const double eta = p[0];
    const double own_Pi0 = p[1];
    const double own_ell = p[2];
    const double own_sigma = p[3];
    const double undragged_p1 = p[4];
    for (int64_t i = 0; i < n; i++) {
        const double overlap = overlaps[i];
        const double h = gap[i];
        const double R = q[0 * n + i];
        const double size_ratio = q[1 * n + i];
        const double delta = h / 2.0 + overlap / 2.0;
        const double pressed = delta >= 0.0 ? 1.0 : 0.0;
        const double x1 = 1.0 / h;
        const double x2 = x1 + 1.0 / R;
        const double x3 = 1.0 / x2;
        const double a = (delta >= 0.0 ? sqrt(delta + x3) : x3 / sqrt(x3 - delta)) * sqrt(2.0 * R);
        const double x4 = 12.566370614359172 * own_sigma;
        const double F_ela = delta * x4;
        const double x5 = x1 * R;
        const double x6 = _lane_log1p(20.0 / 9.0 * x5);
        const double x7 = x5 / 2.0;
        const double x8 = x7 + 1.0;
        const double x9 = size_ratio + 0.2;
        const double size_ratio_p2 = size_ratio * size_ratio;
        const double size_ratio_p4 = size_ratio_p2 * size_ratio_p2;
        const double size_ratio_p8 = size_ratio_p4 * size_ratio_p4;
        const double x11 = 65536.0 * size_ratio_p8;
        const double x12 = 4.0 * size_ratio * R * (4.0 - 4.0 / 9.0 * x9 * (1048576.0 * size_ratio_p8 + 4.0)) / (R * (22.0 - 68.0 * size_ratio) + 16.0 * size_ratio * h) + x9 * (x11 * x6 + (1.0 - x11) * _lane_log1p(4.0 / 9.0 * x5));
        const double of_radii = (x12 + x8) / (0.45 * x6 + x8);
        const double excess = x12 + x7;
        const double a_p2 = a * a;
        const double x16 = R * a_p2;
        const double x17 = h * a_p2;
        const double R_p2 = R * R;
        const double x19 = h * R_p2;
        const double R_p3 = R_p2 * R;
        const double a_p3 = a_p2 * a;
        const double a_p6 = a_p3 * a_p3;
        const double x21 = R_p3 * a_p6;
        const double h_p2 = h * h;
        const double h_p3 = h_p2 * h;
        const double x22 = a_p6 * h_p3;
        const double R_p6 = R_p3 * R_p3;
        const double x23 = R_p6 * h_p3;
        const double x24 = 3.0 * a_p6;
        const double x26 = R * h_p2;
        const double a_p4 = a_p2 * a_p2;
        const double x28 = 3.0 * a_p4;
        const double R_p4 = R_p2 * R_p2;
        const double x30 = h * R_p4;
        const double x31 = R_p2 * h_p3;
        const double x32 = 6.0 * h_p2;
        const double x33 = R_p3 * a_p4;
        const double x34 = R_p4 * a_p2 * h_p3;
        const double R_p5 = R_p3 * R_p2;
        const double x35 = R_p5 * a_p2;
        const double x36 = 165.0 * a_p6;
        const double x37 = 191.0 * a_p4;
        const double x38 = 29.0 * a_p4;
        const double x39 = 36.0 * h_p2;
        const double zeta = 3.141592653589793 * eta * of_radii * (excess + undragged_p1) * (10.0 * R + 9.0 * x6 * h + 20.0 * h) * (delta >= 0.0 ? 0.15 * (x19 * x24 + x21 + x22 + 2.0 * x23 + x24 * x26 + x32 * x35 + 6.0 * x34 - x28 * x30 - x28 * x31 - x32 * x33) / (R_p3 * h_p3 * (x16 + x17 + 8.0 * x19)) : 0.075 * x1 * x16 * (R + h) * (x39 * R_p4 + x38 * R_p2 + 58.0 * R * h * a_p4 + x38 * h_p2 - 36.0 * x17 * R_p3 - x39 * R_p2 * a_p2) / (184.0 * x35 * h_p2 + x19 * x36 + 55.0 * x21 + 55.0 * x22 + 36.0 * x23 + x26 * x36 + 184.0 * x34 - 382.0 * x33 * h_p2 - x30 * x37 - x31 * x37)) / (excess + 1.0);
        const double F_adh = 3.141592653589793 * own_Pi0 * (delta >= 0.0 ? R * own_ell + a_p2 - 2.0 * x3 * R : x2 * own_ell * a_p2 / 2.0) * _lane_exp(-h / own_ell);
        const double dF_ddelta = x4;
        const double dF_dh = 0.0;
        const double x40 = dF_ddelta / 2.0;
        const double C = x40;
        const double x41 = 1.0 / reach;
        const double fading = x41 * (2.0 * reach - 2.0 * h);
        const double started = 1.0 < fading ? 1.0 : fading;
        const double ahead = 0.0 > started ? 0.0 : started;
        const double x43 = 3.0 - 2.0 * ahead;
        const double ahead_p2 = ahead * ahead;
        const double w = x43 * ahead_p2;
        const double w_h = -2.0 * x41 * (2.0 * x43 * ahead - 2.0 * ahead_p2);
        const double film = pressed > 0.0 ? w : 1.0;
        const double grip = pressed > 0.0 ? 1.0 : w;
        const double grip_h = pressed > 0.0 ? 0.0 : w_h;
        const double rho = -(F_adh * film - F_ela) / zeta;
        const double F = F_ela * grip;
        const double F_by_gap = F_ela * grip_h + grip * (dF_dh + x40);
        const double F_by_distance = -x40 * grip;
        const double friction = w * zeta;
        const double remote = F_adh * w;
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
void soap_film_energy(int64_t n, double reach, const double *restrict overlaps, const double *restrict gap, const double *restrict p, const double *restrict q, int64_t points, const double *restrict nodes, const double *restrict weights, double *restrict out)
{
    double delta;
    const double own_sigma = p[3];
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
void soap_film_drag(int64_t n, const double *restrict p, const double *restrict q, double *restrict out)
{
    const double eta = p[0];
    for (int64_t i = 0; i < n; i++) {
        const double R = q[0 * n + i];
        const double translation = 18.84955592153876 * R * eta;
        out[0 * n + i] = translation;
    }
}
