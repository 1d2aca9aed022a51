/* Contact law equal_spheres: written by softdyn 0.1.0 with sympy 1.14.0; do not edit.
 *
 * Source: Brenner 1961, doi:10.1016/0009-2509(61)80035-3; Hertz (Johnson 1985, ch. 4); structure of arXiv:0803.1573
 * Law a1b3b5f85522bbe7:
 *     a = Piecewise((sqrt(R)*sqrt(delta + 1/(1/h + 1/R) + 5/((2*delta + 4/(1/h + 1/R))*(1/h + 1/R)**2)), delta >= 0), (3*sqrt(R)*sqrt(1/(-delta + 1/(1/h + 1/R)))/(2*(1/h + 1/R)), True))
 *     F_ela = 4*E*delta*Piecewise((a, delta >= 0), (sqrt(5)*sqrt(-4*R*delta + 5*a**2)/5, True))/(3*(1 - nu**2))
 *     zeta = 3*pi*R*eta*(R/(2*h) + 9*log(20*R/(9*h) + 1)/20 + 1)*Piecewise((32*a**4*(1/h + 1/R)**2/(3*R**2*(15411789*R**6/(4096*a**12*(1/h + 1/R)**6) + 1701*R**2/(16*a**4*(1/h + 1/R)**2) + 4)), delta >= 0), (1/(9*R/(4*a**2*(1/h + 1/R)) + (4455*R**2/(8*a**4*(1/h + 1/R)**2) - 495*R/(a**2*(1/h + 1/R)) + 110)/(729*R**2/(16*a**4*(1/h + 1/R)**2) - 81*R/(2*a**2*(1/h + 1/R)) + 29)), True))
 *     F_adh = 0
 * Left out, with the operations that each saved:
 *     no remote force: 357 -> 356
 * Operations, 897 in all:
 *     gap_terms: 2 add, 19 mul, 4 div
 *     newton: 20 add, 38 mul, 6 div, 4 sqrt
 *     gap_rate: 26 add, 78 mul, 12 div, 3 sqrt, 1 call
 *     slopes: 76 add, 216 mul, 34 div, 5 sqrt, 1 call
 *     quantities: 81 add, 227 mul, 39 div, 4 sqrt, 1 call
 *
 * A C API that depends on math.h alone; all arrays are of the lengths given, and may not overlap.
 *
 *   void equal_spheres_evaluate(n, h, delta, F, dF_dt, p, out)
 *       a, F_ela, zeta, F_adh, C, D, dh_dt, ddelta_dt, dX_dt, X, lambda1, lambda2 at n states; out holds them one after the other, n each.
 *   void equal_spheres_solve_delta(n, h, F, p, delta)
 *       The deflection at n gaps under n forces; on entry delta holds guesses, or nan for that of the state before.
 *   void equal_spheres_drive(n, t, table_t, table_F, rows, value, rate)
 *       The external force at n times, in increasing order.
 *   int64_t equal_spheres_integrate(t_end, u_stop, rtol, p, table_t, table_F, rows, capacity, state, steps)
 *       The state from one time on; see there.
 *   void equal_spheres_passages(n, u, at, steps, out)
 *       The times at which ln h passes n values within given steps.
 *   void equal_spheres_sample(n, t, stored, steps, out)
 *       The state at n times, from the steps.
 *   void equal_spheres_runs(n, count, at_gaps, settings, runs, targets, table_t, table_F, rows, out)
 *       n runs with their outputs; see there.
 *
 *   p: R, E, eta, nu
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
    const double x0 = 1.0 / h + 1.0 / R;
    const double x1 = 1.0 / x0;
    const double gap0 = x1;
    const double x0_p2 = x0 * x0;
    const double gap1 = 5.0 / x0_p2;
    const double gap2 = 4.0 * x1;
    const double gap3 = 1.5 * x1;
    const double x2 = R * h;
    const double gap4 = 2.0 * x2;
    const double x3 = R + h;
    const double gap5 = x3;
    const double R_p2 = R * R;
    const double h_p2 = h * h;
    const double gap6 = 3.0 * R_p2 * h_p2;
    const double gap7 = 2.0 * h_p2;
    const double gap8 = 4.0 * x2;
    const double gap9 = 8.0 * R * h_p2;
    const double x6 = h * R_p2;
    const double gap10 = 8.0 * x6;
    const double gap11 = x2;
    const double gap12 = -x3;
    const double gap13 = -12.0 * x6;
    const double gap14 = -5.0 * h;
    const double gap15 = 10.0 * x2;
    const double gap16 = 12.0 * x2;
    out[0 * n + i] = gap0;
    out[1 * n + i] = gap1;
    out[2 * n + i] = gap2;
    out[3 * n + i] = gap3;
    out[4 * n + i] = gap4;
    out[5 * n + i] = gap5;
    out[6 * n + i] = gap6;
    out[7 * n + i] = gap7;
    out[8 * n + i] = gap8;
    out[9 * n + i] = gap9;
    out[10 * n + i] = gap10;
    out[11 * n + i] = gap11;
    out[12 * n + i] = gap12;
    out[13 * n + i] = gap13;
    out[14 * n + i] = gap14;
    out[15 * n + i] = gap15;
    out[16 * n + i] = gap16;
}

/* A step of Newton's iteration for delta at a given gap: out[i] = (F_ela - F)/(dF_ela/d(delta)), out[n + i] = dF_ela/d(delta). */
static inline void _newton(int64_t i, int64_t n, double delta, double F, const double *restrict terms, const double *restrict p, double *restrict out)
{
    const double gap0 = terms[0 * n + i];
    const double gap1 = terms[1 * n + i];
    const double gap2 = terms[2 * n + i];
    const double gap3 = terms[3 * n + i];
    const double gap4 = terms[4 * n + i];
    const double gap5 = terms[5 * n + i];
    const double gap6 = terms[6 * n + i];
    const double gap7 = terms[7 * n + i];
    const double gap8 = terms[8 * n + i];
    const double gap9 = terms[9 * n + i];
    const double gap10 = terms[10 * n + i];
    const double gap11 = terms[11 * n + i];
    const double gap12 = terms[12 * n + i];
    const double gap13 = terms[13 * n + i];
    const double gap14 = terms[14 * n + i];
    const double gap15 = terms[15 * n + i];
    const double gap16 = terms[16 * n + i];
    const double R = p[0];
    const double E = p[1];
    const double own_nu = p[3];
    const double a = (delta >= 0.0 ? sqrt(delta + gap0 + gap1 / (2.0 * delta + gap2)) : gap3 / sqrt(gap0 - delta)) * sqrt(R);
    const double x9 = delta * gap5 + gap4;
    const double x1 = 4.0 / 3.0 * a;
    const double R_p2 = R * R;
    const double delta_p2 = delta * delta;
    const double x3 = delta_p2 * R_p2;
    const double x4 = delta * R;
    const double x5 = 2.23606797749979;
    const double a_p2 = a * a;
    const double x7 = sqrt(5.0 * a_p2 - 4.0 * x4);
    const double own_nu_p2 = own_nu * own_nu;
    const double x8 = E / (1.0 - own_nu_p2);
    const double x9_p2 = x9 * x9;
    const double dF_ddelta = x8 * (delta >= 0.0 ? x1 + x4 * (gap7 * delta_p2 + gap8 * delta_p2 + delta * gap10 + delta * gap9 + gap6 + 2.0 * x3) / (3.0 * x9_p2 * a) : 2.0 / 15.0 * x5 * (delta * gap14 * a_p2 + gap15 * a_p2 + gap16 * delta_p2 + delta * gap13 + 12.0 * x3 - 5.0 * x4 * a_p2) / (x7 * (delta * gap12 + gap11)));
    const double newton = (delta * x8 * (delta >= 0.0 ? x1 : 4.0 / 15.0 * x5 * x7) - F) / dF_ddelta;
    out[i] = newton;
    out[n + i] = dF_ddelta;
}

/* w[i] = d(ln h)/dt (eq. 7). */
static inline void _gap_rate(int64_t i, double h, double delta, double F, const double *restrict p, double *restrict w, const double *restrict out)
{
    const double R = p[0];
    const double eta = p[2];
    const double x0 = 1.0 / R;
    const double x1 = 1.0 / h;
    const double x2 = x0 + x1;
    const double x3 = 1.0 / x2;
    const double x2_p2 = x2 * x2;
    const double x5 = 1.0 / x2_p2;
    const double a = (delta >= 0.0 ? sqrt(delta + x3 + 5.0 * x5 / (2.0 * delta + 4.0 * x3)) : 1.5 * x3 / sqrt(x3 - delta)) * sqrt(R);
    const double x8 = x1 * R;
    const double x9 = log1p(20.0 / 9.0 * x8);
    const double a_p2 = a * a;
    const double a_p3 = a_p2 * a;
    const double a_p6 = a_p3 * a_p3;
    const double x15 = 7040.0 * a_p6;
    const double x18 = 21120.0 * a_p6;
    const double a_p4 = a_p2 * a_p2;
    const double x20 = 27504.0 * a_p4;
    const double x21 = 29808.0 * a_p2;
    const double x22 = 464.0 * a_p4;
    const double x23 = 648.0 * a_p2;
    const double R_p2 = R * R;
    const double R_p3 = R_p2 * R;
    const double R_p4 = R_p2 * R_p2;
    const double R_p5 = R_p3 * R_p2;
    const double R_p6 = R_p3 * R_p3;
    const double a_p12 = a_p6 * a_p6;
    const double h_p2 = h * h;
    const double h_p3 = h_p2 * h;
    const double x2_p3 = x2_p2 * x2;
    const double x2_p6 = x2_p3 * x2_p3;
    const double zeta = 3.141592653589793 * eta * (delta >= 0.0 ? 32.0 * x0 * x2_p2 * a_p4 * (x8 / 2.0 + 0.45 * x9 + 1.0) / (3762.643798828125 * R_p6 / (x2_p6 * a_p12) + 106.3125 * x5 * R_p2 / a_p4 + 4.0) : 0.6 * x8 * a_p2 * (R + h) * (10.0 * R + 9.0 * x9 * h + 20.0 * h) * (729.0 * R_p4 * h_p2 + x22 * R_p2 + 928.0 * R * h * a_p4 + x22 * h_p2 - x23 * h * R_p3 - x23 * R_p2 * h_p2) / (6561.0 * R_p6 * h_p3 + x21 * R_p5 * h_p2 + x21 * R_p4 * h_p3 + x15 * R_p3 + x18 * h * R_p2 + x18 * R * h_p2 + x15 * h_p3 - x20 * h * R_p4 - 55008.0 * R_p3 * a_p4 * h_p2 - x20 * R_p2 * h_p3));
    const double dh_dt = -F / zeta;
    w[i] = dh_dt / h;
}

/* The Jacobian of the rates of the state (ln h, delta following from the force balance). */
static inline void _slopes(int64_t i, double h, double delta, double F, const double *restrict p, double *restrict out)
{
    const double R = p[0];
    const double E = p[1];
    const double eta = p[2];
    const double own_nu = p[3];
    const double x0 = 1.0 / R;
    const double x1 = 1.0 / h;
    const double x2 = x0 + x1;
    const double x3 = 1.0 / x2;
    const double x2_p2 = x2 * x2;
    const double x5 = 1.0 / x2_p2;
    const double x6 = 2.0 * delta;
    const double x8 = x3 - delta;
    const double a = (delta >= 0.0 ? sqrt(delta + x3 + 5.0 * x5 / (4.0 * x3 + x6)) : 1.5 * x3 / sqrt(x8)) * sqrt(R);
    const double a_p2 = a * a;
    const double a_p4 = a_p2 * a_p2;
    const double x11 = 1.0 / a_p4;
    const double x12 = x11 * x5;
    const double R_p2 = R * R;
    const double x13 = x12 * R_p2;
    const double R_p3 = R_p2 * R;
    const double R_p6 = R_p3 * R_p3;
    const double a_p3 = a_p2 * a;
    const double a_p6 = a_p3 * a_p3;
    const double a_p12 = a_p6 * a_p6;
    const double x2_p3 = x2_p2 * x2;
    const double x2_p6 = x2_p3 * x2_p3;
    const double x15 = R_p6 / (x2_p6 * a_p12);
    const double x16 = 106.3125 * x13 + 3762.643798828125 * x15 + 4.0;
    const double x17 = x1 * R;
    const double x18 = log1p(20.0 / 9.0 * x17);
    const double x19 = x17 / 2.0 + 0.45 * x18 + 1.0;
    const double x20 = x2_p2 * a_p4;
    const double x21 = R + h;
    const double x24 = 7040.0 * a_p6;
    const double x27 = 21120.0 * a_p6;
    const double x28 = h * R_p2;
    const double x30 = 27504.0 * a_p4;
    const double x32 = 29808.0 * a_p2;
    const double R_p4 = R_p2 * R_p2;
    const double R_p5 = R_p3 * R_p2;
    const double h_p2 = h * h;
    const double h_p3 = h_p2 * h;
    const double x33 = 6561.0 * R_p6 * h_p3 + x32 * R_p5 * h_p2 + x32 * R_p4 * h_p3 + x24 * R_p3 + x27 * R * h_p2 + x24 * h_p3 + x27 * x28 - x30 * h * R_p4 - 55008.0 * R_p3 * a_p4 * h_p2 - x30 * R_p2 * h_p3;
    const double x34 = 10.0 * R;
    const double x35 = 9.0 * x18;
    const double x36 = x35 * h + 20.0 * h + x34;
    const double x37 = R * h;
    const double x38 = 464.0 * a_p4;
    const double x39 = 648.0 * a_p2;
    const double x40 = R_p2 * h_p2;
    const double x41 = 729.0 * R_p4 * h_p2 + x38 * R_p2 + 928.0 * x37 * a_p4 + x38 * h_p2 - x39 * h * R_p3 - x39 * x40;
    const double x42 = x17 * a_p2;
    const double zeta = 3.141592653589793 * eta * (delta >= 0.0 ? 32.0 * x0 * x19 * x20 / x16 : 0.6 * x21 * x36 * x41 * x42 / x33);
    const double x43 = delta * R;
    const double delta_p2 = delta * delta;
    const double x46 = x37 * delta_p2;
    const double x47 = delta * x28;
    const double x48 = delta_p2 * R_p2;
    const double x44 = x43 * h_p2;
    const double x49 = delta_p2 * h_p2;
    const double x50 = 3.0 * x40 + 8.0 * x44 + 4.0 * x46 + 8.0 * x47 + 2.0 * x48 + 2.0 * x49;
    const double x51 = 1.0 / a;
    const double x52 = 2.0 * x37;
    const double x53 = delta * x21;
    const double x88 = x52 + x53;
    const double x88_p2 = x88 * x88;
    const double x54 = 1.0 / x88_p2;
    const double x55 = x51 * x54;
    const double x56 = 5.0 * a_p2;
    const double x57 = 1.0 / (x37 - x53);
    const double x58 = x57 * sqrt(5.0) / sqrt(5.0 * a_p2 - 4.0 * x43);
    const double own_nu_p2 = own_nu * own_nu;
    const double x59 = E / (1.0 - own_nu_p2);
    const double dF_ddelta = x59 * (delta >= 0.0 ? 4.0 / 3.0 * a + x43 * x50 * x55 / 3.0 : 2.0 / 15.0 * x58 * (x34 * h * a_p2 + 12.0 * x46 + 12.0 * x48 - delta * x56 * h - x43 * x56 - 12.0 * x47));
    const double x21_p2 = x21 * x21;
    const double x60 = x55 * (x52 * delta_p2 + 9.0 * x40 + 9.0 * x44 + 9.0 * x47 + x48 + x49) / x21_p2;
    const double x61 = 1.0 / x21;
    const double x62 = x61 * (x37 - x21 * x6);
    const double dF_dh = 2.0 / 3.0 * delta * x59 * (delta >= 0.0 ? x60 * R_p3 : x42 * x58 * x62);
    const double dh_dt = -F / zeta;
    const double x68 = 1.0 / a_p2;
    const double x69 = x3 * x68;
    const double x70 = x69 * R;
    const double x71 = 729.0 * x13 + 464.0 - 648.0 * x70;
    const double x72 = 1.0 / x71;
    const double x73 = 81.0 * x13 + 16.0 - 72.0 * x70;
    const double x74 = x72 * x73;
    const double x89 = 2.25 * x70 + 110.0 * x74;
    const double x63 = 1.0 / R_p2;
    const double x64 = 1.0 / (435456.0 * x13 + 15411789.0 * x15 + 16384.0);
    const double a_p8 = a_p4 * a_p4;
    const double x2_p4 = x2_p2 * x2_p2;
    const double x65 = 243.0 * x64 * (190269.0 * R_p4 / (x2_p4 * a_p8) + 1792.0);
    const double x66 = x63 * x2_p2 * a_p3 + x51 * x65;
    const double x67 = x16 * x64;
    const double x75 = 9.0 * x70;
    const double x76 = x75 - 4.0;
    const double x77 = -x76;
    const double x71_p2 = x71 * x71;
    const double x78 = x73 / x71_p2;
    const double x79 = x33 * x61 / (x36 * x41);
    const double x80 = dF_dh / dF_ddelta;
    const double x81 = 1.0 / (20.0 * x17 + 9.0);
    const double x82 = x1 * x34 + x35 + 20.0;
    const double x83 = x82 * R;
    const double x84 = 880.0 * x72;
    const double x85 = 7920.0 * x78;
    const double x86 = 1.0 / (440.0 * x74 + x75);
    const double x87 = x68 * x86;
    const double a_p5 = a_p3 * a_p2;
    const double x89_p2 = x89 * x89;
    const double slope_p11 = -dh_dt * x1 - dh_dt * (R * (delta >= 0.0 ? 409.6 * x12 * x67 * (x60 * x66 * x82 * R_p4 - (5.0 * x20 * (18.0 * x81 + 1.0) + x83 * (x2 * x63 * a_p4 + x3 * x65)) / h_p2) / x19 : x79 * x87 * (9.0 * x57 * x62 * x69 * x83 * x86 * (1.0 - x76 * x85 - x77 * x84) - x1 * (9.0 * x5 * x82 * x87 * (x76 * x84 + x77 * x85 + 1.0) + 180.0 * x81 + 10.0))) - x80 * (delta >= 0.0 ? 4096.0 * x5 * x50 * x54 * x66 * x67 * R_p3 / a_p5 : 22.5 * x11 * x19 * x3 * x37 * x79 * (0.5 - 440.0 * x72 * x77 - 3960.0 * x76 * x78) / (x8 * x89_p2)));
    const double slope_p21 = -x80 * h;
    out[0 + i] = slope_p11;
    out[8 + i] = slope_p21;
}

/* a, F_ela, zeta, F_adh, C, D, dh_dt, ddelta_dt, dX_dt, X, lambda1, lambda2 at state i of n. */
static inline void _quantities(int64_t i, int64_t n, double h, double delta, double F, double dF_dt, const double *restrict p, double *restrict out)
{
    const double R = p[0];
    const double E = p[1];
    const double eta = p[2];
    const double own_nu = p[3];
    const double x0 = 1.0 / R;
    const double x1 = 1.0 / h;
    const double x2 = x0 + x1;
    const double x3 = 1.0 / x2;
    const double x2_p2 = x2 * x2;
    const double x5 = 1.0 / x2_p2;
    const double x6 = 2.0 * delta;
    const double x8 = x3 - delta;
    const double a = (delta >= 0.0 ? sqrt(delta + x3 + 5.0 * x5 / (4.0 * x3 + x6)) : 1.5 * x3 / sqrt(x8)) * sqrt(R);
    const double x9 = 4.0 / 3.0 * a;
    const double x10 = 2.23606797749979;
    const double x11 = delta * R;
    const double a_p2 = a * a;
    const double x13 = sqrt(5.0 * a_p2 - 4.0 * x11);
    const double own_nu_p2 = own_nu * own_nu;
    const double x15 = E / (1.0 - own_nu_p2);
    const double x16 = delta * x15;
    const double F_ela = x16 * (delta >= 0.0 ? x9 : 4.0 / 15.0 * x10 * x13);
    const double a_p4 = a_p2 * a_p2;
    const double x19 = 1.0 / a_p4;
    const double x20 = x19 * x5;
    const double R_p2 = R * R;
    const double x21 = x20 * R_p2;
    const double R_p3 = R_p2 * R;
    const double R_p6 = R_p3 * R_p3;
    const double a_p3 = a_p2 * a;
    const double a_p6 = a_p3 * a_p3;
    const double a_p12 = a_p6 * a_p6;
    const double x2_p3 = x2_p2 * x2;
    const double x2_p6 = x2_p3 * x2_p3;
    const double x23 = R_p6 / (x2_p6 * a_p12);
    const double x24 = 106.3125 * x21 + 3762.643798828125 * x23 + 4.0;
    const double x25 = x1 * R;
    const double x26 = log1p(20.0 / 9.0 * x25);
    const double x27 = x25 / 2.0 + 0.45 * x26 + 1.0;
    const double x28 = x2_p2 * a_p4;
    const double x29 = R + h;
    const double x32 = 7040.0 * a_p6;
    const double x35 = 21120.0 * a_p6;
    const double x36 = h * R_p2;
    const double x38 = 27504.0 * a_p4;
    const double x39 = 29808.0 * a_p2;
    const double R_p4 = R_p2 * R_p2;
    const double R_p5 = R_p3 * R_p2;
    const double h_p2 = h * h;
    const double h_p3 = h_p2 * h;
    const double x40 = 6561.0 * R_p6 * h_p3 + x39 * R_p5 * h_p2 + x39 * R_p4 * h_p3 + x32 * R_p3 + x35 * R * h_p2 + x32 * h_p3 + x35 * x36 - x38 * h * R_p4 - 55008.0 * R_p3 * a_p4 * h_p2 - x38 * R_p2 * h_p3;
    const double x41 = 10.0 * R;
    const double x42 = 9.0 * x26;
    const double x43 = x42 * h + 20.0 * h + x41;
    const double x44 = R * h;
    const double x45 = 464.0 * a_p4;
    const double x46 = 648.0 * a_p2;
    const double x47 = R_p2 * h_p2;
    const double x48 = 729.0 * R_p4 * h_p2 + x45 * R_p2 + 928.0 * x44 * a_p4 + x45 * h_p2 - x46 * h * R_p3 - x46 * x47;
    const double x49 = x25 * a_p2;
    const double zeta = 3.141592653589793 * eta * (delta >= 0.0 ? 32.0 * x0 * x27 * x28 / x24 : 0.6 * x29 * x43 * x48 * x49 / x40);
    const double F_adh = 0.0;
    const double delta_p2 = delta * delta;
    const double x52 = x44 * delta_p2;
    const double x53 = delta * x36;
    const double x54 = delta_p2 * R_p2;
    const double x50 = x11 * h_p2;
    const double x55 = delta_p2 * h_p2;
    const double x56 = 3.0 * x47 + 8.0 * x50 + 4.0 * x52 + 8.0 * x53 + 2.0 * x54 + 2.0 * x55;
    const double x57 = 1.0 / a;
    const double x58 = 2.0 * x44;
    const double x59 = delta * x29;
    const double x94 = x58 + x59;
    const double x94_p2 = x94 * x94;
    const double x60 = 1.0 / x94_p2;
    const double x61 = x57 * x60;
    const double x62 = 5.0 * a_p2;
    const double x63 = 1.0 / (x44 - x59);
    const double x64 = x10 * x63 / x13;
    const double dF_ddelta = x15 * (delta >= 0.0 ? x11 * x56 * x61 / 3.0 + x9 : 2.0 / 15.0 * x64 * (x41 * h * a_p2 + 12.0 * x52 + 12.0 * x54 - delta * x62 * h - x11 * x62 - 12.0 * x53));
    const double x29_p2 = x29 * x29;
    const double x65 = x61 * (x58 * delta_p2 + 9.0 * x47 + 9.0 * x50 + 9.0 * x53 + x54 + x55) / x29_p2;
    const double x66 = 1.0 / x29;
    const double x67 = x66 * (x44 - x29 * x6);
    const double x68 = delta >= 0.0 ? x65 * R_p3 : x49 * x64 * x67;
    const double dF_dh = 2.0 / 3.0 * x16 * x68;
    const double C = dF_ddelta / 2.0;
    const double D = C * zeta / (C + dF_dh);
    const double dh_dt = -F / zeta;
    const double x69 = 1.0 / dF_ddelta;
    const double ddelta_dt = x69 * (dF_dt - dF_dh * dh_dt);
    const double dX_dt = -F / D - dF_dt / C;
    const double X = 2.0 * R + h - x6;
    const double lambda1 = 2.0 * x68 * x69 * E * h / (3.0 * own_nu_p2 - 3.0);
    const double x75 = 1.0 / a_p2;
    const double x76 = x3 * x75;
    const double x77 = x76 * R;
    const double x78 = 729.0 * x21 + 464.0 - 648.0 * x77;
    const double x79 = 1.0 / x78;
    const double x80 = 81.0 * x21 + 16.0 - 72.0 * x77;
    const double x81 = x79 * x80;
    const double x95 = 2.25 * x77 + 110.0 * x81;
    const double x70 = 1.0 / R_p2;
    const double x71 = 1.0 / (435456.0 * x21 + 15411789.0 * x23 + 16384.0);
    const double a_p8 = a_p4 * a_p4;
    const double x2_p4 = x2_p2 * x2_p2;
    const double x72 = 243.0 * x71 * (190269.0 * R_p4 / (x2_p4 * a_p8) + 1792.0);
    const double x73 = x70 * x2_p2 * a_p3 + x57 * x72;
    const double x74 = x24 * x71;
    const double x82 = 9.0 * x77;
    const double x83 = x82 - 4.0;
    const double x84 = -x83;
    const double x78_p2 = x78 * x78;
    const double x85 = x80 / x78_p2;
    const double x86 = x40 * x66 / (x43 * x48);
    const double x87 = 1.0 / (20.0 * x25 + 9.0);
    const double x88 = x1 * x41 + x42 + 20.0;
    const double x89 = x88 * R;
    const double x90 = 880.0 * x79;
    const double x91 = 7920.0 * x85;
    const double x92 = 1.0 / (440.0 * x81 + x82);
    const double x93 = x75 * x92;
    const double a_p5 = a_p3 * a_p2;
    const double x95_p2 = x95 * x95;
    const double lambda2 = -h * (R * (delta >= 0.0 ? 409.6 * x20 * x74 * (x65 * x73 * x88 * R_p4 - (5.0 * x28 * (18.0 * x87 + 1.0) + x89 * (x2 * x70 * a_p4 + x3 * x72)) / h_p2) / x27 : x86 * x93 * (9.0 * x63 * x67 * x76 * x89 * x92 * (1.0 - x83 * x91 - x84 * x90) - x1 * (9.0 * x5 * x88 * x93 * (x83 * x90 + x84 * x91 + 1.0) + 180.0 * x87 + 10.0))) - dF_dh * x69 * (delta >= 0.0 ? 4096.0 * x5 * x56 * x60 * x73 * x74 * R_p3 / a_p5 : 22.5 * x19 * x27 * x3 * x44 * x86 * (0.5 - 440.0 * x79 * x84 - 3960.0 * x83 * x85) / (x8 * x95_p2)));
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
   from the other. Returns nan if there is no solution. Uses w[0] and w[1], and of terms as many as the law has. */
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
            return w[1] > 0.0 ? trial : NAN;
        }
        const double residual = step * w[1];
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
void equal_spheres_evaluate(int64_t n, const double *restrict h, const double *restrict delta, const double *restrict F, const double *restrict dF_dt, const double *restrict p, double *restrict out)
{
    for (int64_t i = 0; i < n; i++) {
        _quantities(i, n, h[i], delta[i], F[i], dF_dt[i], p, out);
    }
}

/* The deflection at n gaps under n forces, from guesses, or nan for that of the state before; nan if there is none. */
void equal_spheres_solve_delta(int64_t n, const double *restrict h, const double *restrict F, const double *restrict p, double *restrict delta)
{
    double w[2];
    double terms[17];
    double guess = NAN;
    for (int64_t i = 0; i < n; i++) {
        guess = delta[i] != delta[i] ? guess : delta[i];
        delta[i] = _solve_delta(h[i], F[i], guess, p, w, terms);
        guess = delta[i];
    }
}

/* What is given, and its rate of change, at n times, in increasing order. */
void equal_spheres_drive(int64_t n, const double *restrict t, const double *restrict table_t, const double *restrict table_F, int64_t rows, double *restrict value, double *restrict rate)
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
        if (w[32 + i] != 0.0 || !(delta[i] * F[i] >= 0.0 && w[8 + i] > 0.0)) {
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
int64_t equal_spheres_integrate(double t_end, double u_stop, double rtol, const double *restrict p, const double *restrict table_t, const double *restrict table_F, int64_t rows, int64_t capacity, double *restrict state, double *restrict steps)
{
    double moves;
    double contraction;
    double w[4];
    double work[40];
    double terms[136];
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
void equal_spheres_sample(int64_t n, const double *restrict t, int64_t stored, const double *restrict steps, double *restrict out)
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
void equal_spheres_passages(int64_t n, const double *restrict u, const double *restrict at, const double *restrict steps, double *restrict out)
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
    double terms[136];
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
   runs: of each run t_end, u_stop, ln h, delta (which follows from the force here), 4 parameters.
   targets: the times, or with at_gaps = 1 the values of ln h, of the count outputs of each run, in the order of passage.
   out: t, h, delta, what is given, its rate, a, F_ela, zeta, F_adh, C, D, dh_dt, ddelta_dt, dX_dt, X, lambda1, lambda2, each n*count numbers; the status of each run, as
   equal_spheres_integrate returns it, or 10 if it took too many steps, 11 if the gap left the range of double precision;
   and the largest estimated error of its outputs, relative.
   What a run does not reach is left as it is. */
void equal_spheres_runs(int64_t n, int64_t count, int64_t at_gaps, const double *restrict settings, const double *restrict runs, const double *restrict targets, const double *restrict table_t, const double *restrict table_F, int64_t rows, double *restrict out)
{
    double state[20];
    double worst[1];
    double steps[448];
    double p[4];
    for (int64_t run = 0; run < n; run++) {
        const int64_t at = 8 * run;
        for (int64_t k = 0; k < 4; k++) {
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
            ended = equal_spheres_integrate(runs[at], runs[at + 1], settings[0], p, table_t, table_F, rows, 32, state, steps);
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
