/* Contact law steric: written by softdyn 0.1.0 with sympy 1.14.0; do not edit.
 *
 * Source: Alexander 1977; de Gennes, Adv. Colloid Interface Sci. 27 (1987) 189; equal_spheres
 * Law 8934d7f84e49ea39:
 *     a = sqrt(R)*sqrt(Abs(delta) + 1/(1/h + 1/R) + 5/((1/h + 1/R)**2*(2*Abs(delta) + 4/(1/h + 1/R))))
 *     F_ela = 4*E*a*delta/(3*(1 - nu**2))
 *     zeta = 8*pi*a**4*eta*(1/h + 1/R)**2*(R/(2*h) + 9*log(20*R/(9*h) + 1)/20 + 1)/(R*(18225*R**3/(128*a**6*(1/h + 1/R)**3) + 1))
 *     F_adh = Piecewise((2*pi*L*Pi0*R*(8*2**(1/4)*L**(5/4)/(5*h**(5/4)) - 48/35 + 2**(1/4)*h**(7/4)/(7*L**(7/4))), h < 2*L), (0, True))
 * Left out, with the operations that each saved:
 *     one sign of delta: 225 -> 223
 *     constant force: 223 -> 219
 *     outputs asked for: 219 -> 201
 * Operations, 366 in all:
 *     balance: 13 add, 33 mul, 7 div, 1 sqrt
 *     gap_rate: 10 add, 33 mul, 8 div, 1 sqrt, 5 call
 *     slopes: 40 add, 126 mul, 21 div, 1 sqrt, 7 call
 *     quantities: 12 add, 34 mul, 8 div, 1 sqrt, 5 call
 *
 * A C API that depends on math.h alone; all arrays are of the lengths given, and may not overlap.
 *
 *   void steric_evaluate(n, h, delta, F, p, out)
 *       a, X, dh_dt at n states; out holds them one after the other, n each.
 *   void steric_solve_delta(n, h, F, p, delta)
 *       The deflection at n gaps under n forces; on entry delta holds guesses, or nan for that of the state before.
 *   void steric_drive(n, t, c, value, rate)
 *       The external force at n times.
 *   int64_t steric_integrate(t_end, u_stop, rtol, p, c, capacity, state, steps)
 *       The state from one time on; see there.
 *   void steric_passages(n, u, at, steps, out)
 *       The times at which ln h passes n values within given steps.
 *   void steric_sample(n, t, stored, steps, out)
 *       The state at n times, from the steps.
 *
 *   p: R, E, eta, L, Pi0, nu
 *   c: the force
 */
#include <math.h>
#include <stdint.h>

#if defined(__FAST_MATH__)
#error "this code relies on IEEE arithmetic: compile it without -ffast-math"
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
static const double _MATRIX[64] = {
    0.028802823892616743, 0.061680826212949943, 0.055285563267234654, 0.05830068605753936,
    0.05668200898480084, 0.05754303201724311, 0.057146971559234025, 0.0572544073721286,
    -0.010821698052015636, 0.0633079054352858, 0.13457201985444417, 0.12047766147733864,
    0.12704316148341016, 0.12374099223938748, 0.12522069473806977, 0.12482395066493249,
    0.008069010203851382, -0.016766167621301963, 0.08883018189912993, 0.18641428431849139,
    0.16808837041936572, 0.17595155228374013, 0.17264331318806794, 0.17350739781725064,
    -0.006493073596535741, 0.011276575963180064, -0.02032248583700904, 0.10143090415741593,
    0.2092022487638381, 0.19081981374722284, 0.1974144361397373, 0.19578608372624678,
    0.005300041017295122, -0.008575400848083276, 0.012631022220423707, -0.021196196398555057,
    0.099187005744833, 0.19945688894319688, 0.18521078469685745, 0.1882587726945593,
    -0.004223309650009842, 0.006607056898423003, -0.008970025754042578, 0.012247274295397013,
    -0.019275308810543568, 0.08243702475750181, 0.15862128747389664, 0.15206531032339257,
    0.003069413349140929, -0.004723817373991893, 0.0061809009170075415, -0.007798637777900809,
    0.010069646505165038, -0.014724795758020657, 0.05371248744655011, 0.09267907740148965,
    -0.0012238207256304553, 0.0018720744944425464, -0.0024173537825988994, 0.0029703975397181405,
    -0.003621850204038951, 0.00453480003283603, -0.006232535779335354, 0.015625,
};
static const double _POWERS[72] = {
    -0.22846422013505335, 0.1850897535747451, -0.23582081997972, 0.9532316380774069,
    0.25013414867381245, -0.09207607235985078, 0.04827666589865964, -0.01708984375,
    -1.8169587583727254, 1.425631696375798, -1.6189489238471655, -1.5286388011415366,
    3.099837256779687, -0.9726618084010183, 0.4888877761069608, -0.1708984375,
    8.299490649731032, -7.032440683930033, 10.059171206875751, -10.481352867302109,
    3.513059126845215, 1.057201966648256, -0.8008715863681131, 0.3076171875,
    15.983944802687716, -10.864260754367306, 3.993981388193102, 8.191458200051803,
    -15.095735271262601, 11.597337302383426, -6.116295980186141, 2.1533203125,
    -45.52288420757575, 37.418986280822736, -38.23991314738859, 33.24792617216414,
    -19.69838579975891, 6.532894478231333, -0.80893627649496, 1.4575089257189037e-39,
    -33.758764202374415, 17.410379417518143, -2.410648918641197, -12.817228853617559,
    22.317113424630126, -22.600580986157627, 16.294300431142524, -6.0908203125,
    77.56815322909841, -56.79663545294092, 48.72602435523336, -40.24794743973546,
    29.490461528420308, -18.324331004322836, 9.438766971747134, -2.9326171875,
    19.591778158059423, -7.971750359526636, 0.03561645429526057, 6.1544094547072925,
    -10.321215410147214, 11.975905492175219, -10.666892227063347, 4.6083984375,
    -40.116295451118646, 26.22500010247347, -20.3094615947408, 16.528142496796022,
    -13.555269004180428, 10.826310631803098, -7.8772357747827195, 3.14208984375,
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

/* The elastic force and its derivative along delta: w[i] = F_ela, out[i] = dF_ela/d(delta). */
static inline void _balance(int64_t i, double h, double delta, const double *restrict p, double *restrict w, double *restrict out)
{
    const double R = p[0];
    const double E = p[1];
    const double nu = p[5];
    const double x0 = 1.0 / h + 1.0 / R;
    const double x1 = 1.0 / x0;
    const double x0_p2 = x0 * x0;
    const double a = sqrt(R * (delta + x1 + 5.0 / (x0_p2 * (2.0 * delta + 4.0 * x1))));
    const double nu_p2 = nu * nu;
    const double x2 = E / (1.0 - nu_p2);
    const double F_ela = 4.0 / 3.0 * delta * x2 * a;
    const double x3 = R * h;
    const double x9 = delta * (R + h) + 2.0 * x3;
    const double x5 = 8.0 * delta;
    const double delta_p2 = delta * delta;
    const double x8 = 2.0 * delta_p2;
    const double R_p2 = R * R;
    const double h_p2 = h * h;
    const double x9_p2 = x9 * x9;
    const double dF_ddelta = x2 * (delta * R * (3.0 * R_p2 * h_p2 + x5 * h * R_p2 + x8 * R_p2 + x5 * R * h_p2 + 4.0 * x3 * delta_p2 + x8 * h_p2) / (x9_p2 * a) + 4.0 * a) / 3.0;
    w[i] = F_ela;
    out[i] = dF_ddelta;
}

/* w[i] = d(ln h)/dt (eq. 7). */
static inline void _gap_rate(int64_t i, double h, double delta, double F, const double *restrict p, double *restrict w, const double *restrict out)
{
    const double R = p[0];
    const double eta = p[2];
    const double L = p[3];
    const double Pi0 = p[4];
    const double x0 = 1.0 / R;
    const double x1 = 1.0 / h;
    const double x2 = x0 + x1;
    const double x3 = 1.0 / x2;
    const double x2_p2 = x2 * x2;
    const double a = sqrt(R * (delta + x3 + 5.0 / (x2_p2 * (2.0 * delta + 4.0 * x3))));
    const double x5 = x1 * R;
    const double R_p2 = R * R;
    const double R_p3 = R_p2 * R;
    const double a_p2 = a * a;
    const double a_p4 = a_p2 * a_p2;
    const double a_p3 = a_p2 * a;
    const double a_p6 = a_p3 * a_p3;
    const double x2_p3 = x2_p2 * x2;
    const double zeta = 25.132741228718345 * x0 * eta * x2_p2 * a_p4 * (x5 / 2.0 + 0.45 * log1p(20.0 / 9.0 * x5) + 1.0) / (142.3828125 * R_p3 / (x2_p3 * a_p6) + 1.0);
    const double x6 = 1.189207115002721;
    const double F_adh = h < 2.0 * L ? 0.17951958020513104 * L * Pi0 * R * (56.0 * x6 * pow(L, 1.25) * pow(h, -1.25) + 5.0 * x6 * pow(L, -1.75) * pow(h, 1.75) - 48.0) : 0.0;
    const double dh_dt = (F_adh - F) / zeta;
    w[i] = dh_dt / h;
}

/* The Jacobian of the rates of the state (ln h, delta following from the force balance). */
static inline void _slopes(int64_t i, double h, double delta, double F, const double *restrict p, double *restrict out)
{
    const double R = p[0];
    const double E = p[1];
    const double eta = p[2];
    const double L = p[3];
    const double Pi0 = p[4];
    const double nu = p[5];
    const double x0 = 1.0 / R;
    const double x1 = 1.0 / h;
    const double x2 = x0 + x1;
    const double x3 = 1.0 / x2;
    const double x2_p2 = x2 * x2;
    const double x5 = 1.0 / x2_p2;
    const double a = sqrt(R * (delta + x3 + 5.0 * x5 / (2.0 * delta + 4.0 * x3)));
    const double R_p2 = R * R;
    const double R_p3 = R_p2 * R;
    const double a_p2 = a * a;
    const double a_p3 = a_p2 * a;
    const double a_p6 = a_p3 * a_p3;
    const double x2_p3 = x2_p2 * x2;
    const double x8 = R_p3 / (x2_p3 * a_p6);
    const double x9 = 142.3828125 * x8 + 1.0;
    const double x10 = x1 * R;
    const double x11 = log1p(20.0 / 9.0 * x10);
    const double x12 = x10 / 2.0 + 0.45 * x11 + 1.0;
    const double a_p4 = a_p2 * a_p2;
    const double x14 = x2_p2 * a_p4;
    const double zeta = 25.132741228718345 * x0 * x12 * x14 * eta / x9;
    const double x15 = 1.189207115002721;
    const double x16 = pow(L, -1.75);
    const double x17 = pow(L, 1.25);
    const double x18 = 3.141592653589793 * Pi0 * R;
    const double x19 = 2.0 * L;
    const double F_adh = h < x19 ? 2.0 / 35.0 * x18 * L * (5.0 * x15 * x16 * pow(h, 1.75) + 56.0 * x15 * x17 * pow(h, -1.25) - 48.0) : 0.0;
    const double x21 = R * h;
    const double x22 = 2.0 * x21;
    const double x23 = R + h;
    const double x50 = delta * x23 + x22;
    const double x50_p2 = x50 * x50;
    const double x24 = 1.0 / x50_p2;
    const double x25 = delta * x24 / a;
    const double x26 = 8.0 * delta;
    const double h_p2 = h * h;
    const double x28 = R * h_p2;
    const double x31 = h * R_p2;
    const double delta_p2 = delta * delta;
    const double x32 = delta_p2 * R_p2;
    const double x33 = R_p2 * h_p2;
    const double x34 = delta_p2 * h_p2;
    const double x35 = R * (4.0 * x21 * delta_p2 + x26 * x28 + x26 * x31 + 2.0 * x32 + 3.0 * x33 + 2.0 * x34);
    const double nu_p2 = nu * nu;
    const double x36 = E / (1.0 - nu_p2);
    const double dF_ddelta = x36 * (4.0 * a + x25 * x35) / 3.0;
    const double x37 = 9.0 * delta;
    const double x38 = x22 * delta_p2 + x28 * x37 + x31 * x37 + x32 + 9.0 * x33 + x34;
    const double x23_p2 = x23 * x23;
    const double dF_dh = 2.0 / 3.0 * x25 * x36 * x38 * R_p3 / x23_p2;
    const double x39 = 1.0 / zeta;
    const double dh_dt = x39 * (F_adh - F);
    const double x40 = 1.0 / a_p2;
    const double R_p6 = R_p3 * R_p3;
    const double h_p3 = h_p2 * h;
    const double x41 = R_p6 * h_p3;
    const double x23_p3 = x23_p2 * x23;
    const double x43 = x23_p3 * a_p6;
    const double x44 = 18225.0 * x41 + 128.0 * x43;
    const double x45 = x24 * (91125.0 * x41 + 256.0 * x43);
    const double x46 = 10.0 * R;
    const double x47 = 9.0 * x11;
    const double x48 = 1.0 / (18225.0 * x8 + 128.0);
    const double x49 = x1 * x46 + x47 + 20.0;
    const double a_p8 = a_p4 * a_p4;
    const double x44_p2 = x44 * x44;
    const double slope_p11 = x39 * (h < x19 ? x15 * x18 * x19 * (x16 * pow(h, 0.75) / 4.0 - 2.0 * x17 * pow(h, -2.25)) : 0.0) - dh_dt * x1 - dh_dt * (6.4 * x5 * x9 * R * (x1 * x38 * x45 * x23_p3 * a_p8 * (x47 * h + 20.0 * h + x46) / x44_p2 - x48 * (54675.0 * x40 * x48 * x49 * x5 * R_p2 + 2.0 * x0 * x2 * x49 * a_p4 + 10.0 * x14 * (1.0 + 18.0 / (20.0 * x10 + 9.0)))) / (x12 * a_p4 * h_p2) - dF_dh * x35 * x40 * x45 / (2.0 * x44 * dF_ddelta));
    out[0 + i] = slope_p11;
}

/* a, X, dh_dt at state i of n. */
static inline void _quantities(int64_t i, int64_t n, double h, double delta, double F, const double *restrict p, double *restrict out)
{
    const double R = p[0];
    const double eta = p[2];
    const double L = p[3];
    const double Pi0 = p[4];
    const double x0 = 1.0 / R;
    const double x1 = 1.0 / h;
    const double x2 = x0 + x1;
    const double x3 = 1.0 / x2;
    const double x5 = 2.0 * delta;
    const double x2_p2 = x2 * x2;
    const double a = sqrt(R * (delta + x3 + 5.0 / (x2_p2 * (4.0 * x3 + x5))));
    const double x6 = x1 * R;
    const double R_p2 = R * R;
    const double R_p3 = R_p2 * R;
    const double a_p2 = a * a;
    const double a_p4 = a_p2 * a_p2;
    const double a_p3 = a_p2 * a;
    const double a_p6 = a_p3 * a_p3;
    const double x2_p3 = x2_p2 * x2;
    const double zeta = 25.132741228718345 * x0 * eta * x2_p2 * a_p4 * (x6 / 2.0 + 0.45 * log1p(20.0 / 9.0 * x6) + 1.0) / (142.3828125 * R_p3 / (x2_p3 * a_p6) + 1.0);
    const double x7 = 1.189207115002721;
    const double F_adh = h < 2.0 * L ? 0.17951958020513104 * L * Pi0 * R * (56.0 * x7 * pow(L, 1.25) * pow(h, -1.25) + 5.0 * x7 * pow(L, -1.75) * pow(h, 1.75) - 48.0) : 0.0;
    const double dh_dt = (F_adh - F) / zeta;
    const double X = 2.0 * R + h - x5;
    out[0 * n + i] = a;
    out[1 * n + i] = X;
    out[2 * n + i] = dh_dt;
}

/* The deflection at the gap h under the force F (eq. 1): Newton's iteration, kept between bounds.

   F_ela rises with delta and vanishes with it, so the sign of F bounds delta from one side. Returns nan if there is no
   solution. Uses w[0] and w[1]. */
static inline double _solve_delta(double h, double F, double guess, const double *restrict p, double *restrict w)
{
    if (F == 0.0) {
        return 0.0;
    }
    if (!(F > 0.0)) {
        return NAN;
    }
    double low = 0.0;
    double high = INFINITY;
    double stiffness[1];
    double delta = guess;
    if (!(low < guess && guess < high)) {
        /* start from the linear response, or from R where that is beyond R */
        _balance(0, h, 0.0, p, w, stiffness);
        delta = F / stiffness[0];
        if (!(fabs(delta) < p[0])) {
            delta = F > 0.0 ? p[0] : -p[0];
        }
    }
    for (int64_t iteration = 0; iteration < 400; iteration++) {
        _balance(0, h, delta, p, w, stiffness);
        const double residual = w[0] - F;
        const double step = residual / stiffness[0];
        double trial = delta - step;
        /* Newton's iteration converges quadratically: after a step of 1e-9 what is left is below rounding */
        if (fabs(step) <= 1e-09 * fabs(delta) && low <= trial && trial <= high) {
            return stiffness[0] > 0.0 ? trial : NAN;
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

/* What is given, and its rate of change, at the time t: w[0] and w[1]. */
static inline void _drive(double t, const double *restrict c, double *restrict w)
{
    w[0] = c[0];
    w[1] = 0.0;
}

/* a, X, dh_dt at n states: out[k*n + i] is quantity k at state i. */
void steric_evaluate(int64_t n, const double *restrict h, const double *restrict delta, const double *restrict F, const double *restrict p, double *restrict out)
{
    for (int64_t i = 0; i < n; i++) {
        _quantities(i, n, h[i], delta[i], F[i], p, out);
    }
}

/* The deflection at n gaps under n forces, from guesses, or nan for that of the state before; nan if there is none. */
void steric_solve_delta(int64_t n, const double *restrict h, const double *restrict F, const double *restrict p, double *restrict delta)
{
    double w[2];
    double guess = NAN;
    for (int64_t i = 0; i < n; i++) {
        guess = delta[i] != delta[i] ? guess : delta[i];
        delta[i] = _solve_delta(h[i], F[i], guess, p, w);
        guess = delta[i];
    }
}

/* What is given, and its rate of change, at n times. */
void steric_drive(int64_t n, const double *restrict t, const double *restrict c, double *restrict value, double *restrict rate)
{
    double w[2];
    for (int64_t i = 0; i < n; i++) {
        _drive(t[i], c, w);
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

/* Stages of a step that is ratio times as long as the last one, whose stages are z, by its polynomial. */
static inline void _predict(double ratio, double *restrict z, double *restrict above, double *restrict below)
{
    for (int64_t i = 0; i < 8; i++) {
        above[i] = 0.0;
        below[i] = _WEIGHTS[0] / (1.0 + ratio * _NODES[i + 1]);
    }
    for (int64_t j = 0; j < 8; j++) {
        for (int64_t i = 0; i < 8; i++) {
            const double weight = _WEIGHTS[j + 1] / (1.0 + ratio * _NODES[i + 1] - _NODES[j + 1]);
            above[i] += weight * z[j];
            below[i] += weight;
        }
    }
    const double end = z[7];
    for (int64_t i = 0; i < 8; i++) {
        z[i] = above[i] / below[i] - end;
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

/* Deflections of the 8 stages, from those that delta holds: Newton's iteration on all of them at once. */
static inline void _deflections(const double *restrict h, const double *restrict F, double *restrict delta, const double *restrict p, double *restrict w, double *restrict force, double *restrict stiffness)
{
    for (int64_t iteration = 0; iteration < 6; iteration++) {
        for (int64_t i = 0; i < 8; i++) {
            _balance(i, h[i], delta[i], p, force, stiffness);
        }
        for (int64_t i = 0; i < 8; i++) {
            force[i] = (force[i] - F[i]) / stiffness[i];
            delta[i] = delta[i] - force[i];
        }
        int64_t moving = 0;
        for (int64_t i = 0; i < 8; i++) {
            if (!(fabs(force[i]) <= 1e-09 * fabs(delta[i]))) {
                moving += 1;
            }
        }
        if (moving == 0) {
            break;
        }
    }
    /* on the branch where F_ela rises from 0 with delta: a law may have others */
    for (int64_t i = 0; i < 8; i++) {
        if (!(fabs(force[i]) <= 1e-09 * fabs(delta[i]) && delta[i] * F[i] >= 0.0 && stiffness[i] > 0.0)) {
            delta[i] = _solve_delta(h[i], F[i], NAN, p, w);
        }
    }
}

/* The times at which ln h passes n values, each within the step of a number, by bisection of its polynomial. */
void steric_passages(int64_t n, const double *restrict u, const double *restrict at, const double *restrict steps, double *restrict out)
{
    double z[8];
    for (int64_t i = 0; i < n; i++) {
        const int64_t base = 15 * (int64_t)at[i];
        if (steps[base + 12] != 0.0) {
            for (int64_t j = 0; j < 8; j++) {
                z[j] = steps[base + 4 + j];
            }
            const double theta = (u[i] - steps[base + 3]) / steps[base + 12];
            out[i] = steps[base] + _between(theta, z);
            continue;
        }
        for (int64_t j = 0; j < 8; j++) {
            z[j] = steps[base + 4 + j];
        }
        const double target = u[i] - steps[base + 3];
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
        out[i] = steps[base] + high * steps[base + 1];
    }
}

/* The fraction of a step in ln h at which the time t, from its start, is reached: Newton's iteration.

   powers: the time as a polynomial of 2 theta - 1, which rises. */
static inline double _gap_at(double t, const double *restrict z, const double *restrict powers)
{
    double low = -1.0;
    double high = 1.0;
    double before = 0.0;
    double x = 1.0;
    for (int64_t j = 0; j < 8; j++) {
        if (z[j] >= t) {
            low = 2.0 * _NODES[j] - 1.0;
            high = 2.0 * _NODES[j + 1] - 1.0;
            x = z[j] > before ? low + (high - low) * (t - before) / (z[j] - before) : high;
            break;
        }
        before = z[j];
    }
    for (int64_t iteration = 0; iteration < 20; iteration++) {
        double value = powers[8];
        double slope = 0.0;
        for (int64_t k = 0; k < 8; k++) {
            slope = slope * x + value;
            value = value * x + powers[7 - k];
        }
        const double change = (value - t) / slope;
        if (value > t) {
            high = x;
        } else {
            low = x;
        }
        const double trial = x - change;
        x = low <= trial && trial <= high ? trial : 0.5 * (low + high);
        if (fabs(change) <= 1e-08) {
            break;
        }
    }
    return 0.5 * (1.0 + x);
}

/* The state at n times, in increasing order, from the 15 numbers of each of the steps stored: out[k*n + i] is component k. */
void steric_sample(int64_t n, const double *restrict t, int64_t stored, const double *restrict steps, double *restrict out)
{
    double z[8];
    double powers[9];
    int64_t known = -1;
    int64_t at = 0;
    for (int64_t i = 0; i < n; i++) {
        while (at < stored - 1 && t[i] >= steps[15 * (at + 1)]) {
            at += 1;
        }
        if (steps[15 * at + 12] != 0.0) {
            if (known != at) {
                known = at;
                for (int64_t j = 0; j < 8; j++) {
                    z[j] = steps[15 * at + 4 + j];
                }
                for (int64_t k = 0; k < 9; k++) {
                    powers[k] = 0.0;
                    for (int64_t j = 0; j < 8; j++) {
                        powers[k] += _POWERS[8 * k + j] * z[j];
                    }
                }
            }
            const double part = _gap_at(t[i] - steps[15 * at], z, powers);
            out[i] = steps[15 * at + 3] + part * steps[15 * at + 12];
            continue;
        }
        const double theta = (t[i] - steps[15 * at]) / steps[15 * at + 1];
        for (int64_t j = 0; j < 8; j++) {
            z[j] = steps[15 * at + 4 + j];
        }
        out[0 * n + i] = steps[15 * at + 3] + _between(theta, z);
    }
}

/* Integrate the state, u = ln h, by collocation: Radau IIA with 8 stages, which is L-stable.

   A step is accepted if the defect of its polynomial, measured at two points, promises an error below rtol, relative,
   of h throughout the step. Steps end at the rows of a table, and where the force crosses zero.

   state, of 17 numbers: t, u, delta, step (0 at the start), steps accepted, rejected, passes of Newton's iteration, single
   rates, segment of the table, steps recorded by this call, largest step times rate of decay, whether the gap is settled,
   longest step allowed, whether ln h may serve as the independent variable, how many steps it did, and estimates of the
   errors of u and delta, the errors of all steps grown as the linearised equation has it. It is updated, and a further
   call goes on from it.
   steps, of 15*capacity numbers: for each step its start, its length, what ends it (0 nothing, 1 a row of the
   table, 2 the force crosses zero, 3 a film is reached), and for each component its value at the start and its 8 stages. Then, the length of the step in ln h if that
   is the independent variable, when the stages are times, or 0. Last, the estimated errors within the step, of u at a given time, and of the time at a given u.

   Returns 0 at t_end, 1 after the step in which u passes u_stop, 2 when steps is full, 3 at the end of the table;
   -1 if the step falls below rounding, -2 if t overflows, -3 if there is no rate at the start. */
int64_t steric_integrate(double t_end, double u_stop, double rtol, const double *restrict p, const double *restrict c, int64_t capacity, double *restrict state, double *restrict steps)
{
    double landing;
    double step;
    double u_defect;
    double u_late;
    double h_probe;
    double d1;
    double d2;
    double error;
    double late;
    double factor;
    double moves;
    double contraction;
    double w[4];
    double given[8];
    double h[8];
    double deflection[8];
    double before[8];
    double above[8];
    double below[8];
    double slopes[8];
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
    double u_astray = state[15];
    double stiffest = state[10];
    double settled = state[11];
    /* the last step, of which the next one is predicted; 0 after what cannot be extrapolated */
    double last = 0.0;
    double last_error = 1.0;
    double fresh = 1.0;
    double crossing = INFINITY;
    double shrink_only = 0.0;
    double stride = 0.5;
    double u_dot = 0.0;
    int64_t status = 2;
    int64_t stored = 0;
    while (status == 2 && stored < capacity) {
        double limit = t_end;
        double ending = 0.0;
        if (t >= t_end) {
            status = 0;
            break;
        }
        if (fresh == 1.0) {
            /* the rates where the run starts, or goes on after an event */
            _drive(t, c, w);
            for (int64_t i = 0; i < 8; i++) {
                h[i] = exp(u);
                given[i] = w[0];
                deflection[i] = delta;
            }
            _deflections(h, given, deflection, p, w, above, below);
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
                        _drive(t + dt, c, w);
                        given[0] = w[0];
                        deflection[0] = _solve_delta(h[0], given[0], NAN, p, w);
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
        /* while the gap moves, it serves as the independent variable: its time is an integral, without iterations; */
        /* of a rate that is hardly a number it would overflow */
        if (state[13] == 1.0 && fabs(u_dot) > 0.1 * fabs(slopes[7]) && fabs(u_dot) > 1e-290) {
            stride = u_dot > 0.0 ? fabs(stride) : -fabs(stride);
            landing = 0.0;
            step = stride;
            if ((u_stop - u) * u_dot > 0.0 && fabs(u_stop - u) <= 1.01 * fabs(stride)) {
                step = u_stop - u;
                landing = 1.0;
            }
            for (int64_t i = 0; i < 8; i++) {
                h[i] = exp(u + _NODES[i + 1] * step);
                given[i] = c[0];
                deflection[i] = delta;
            }
            _deflections(h, given, deflection, p, w, above, below);
            for (int64_t i = 0; i < 8; i++) {
                _gap_rate(i, h[i], deflection[i], given[i], p, u_rate, w);
            }
            passes += 1.0;
            int64_t astray = 0;
            /* without a deflection there is no rate, even of a law whose rate does not depend on it */
            for (int64_t i = 0; i < 8; i++) {
                u_z[i] = 0.0;
                above[i] = step / (u_rate[i] + 0.0 * deflection[i]);
                if (!(above[i] > 0.0)) {
                    astray += 1;
                }
            }
            for (int64_t j = 0; j < 8; j++) {
                for (int64_t i = 0; i < 8; i++) {
                    u_z[i] += _MATRIX[8 * j + i] * above[j];
                }
            }
            u_defect = -step / u_dot;
            u_late = 0.0;
            for (int64_t i = 0; i < 8; i++) {
                u_defect += _SLOPE_START[i + 1] * u_z[i];
                u_late += _SLOPE_PROBE[i + 1] * u_z[i];
            }
            h_probe = exp(u + 0.5501108282781375 * step);
            _gap_rate(0, h_probe, _solve_delta(h_probe, c[0], deflection[4], p, w), c[0], p, below, w);
            singles += 1.0;
            d1 = 0.014424143230897014 * u_defect;
            d2 = 0.07596008870469767 * (u_late - step / below[0]);
            error = fabs(d1) > fabs(d2) ? fabs(d1) : fabs(d2);
            /* an error of the time is one of ln h by the rate */
            const double fastest = fabs(u_dot) > fabs(u_rate[7]) ? fabs(u_dot) : fabs(u_rate[7]);
            late = error;
            error = error * fastest / (rtol + 4.5e-16 * (1.0 + fabs(u)));
            factor = 0.9 * pow(error > 1e-12 ? error : 1e-12, -1.0 / 9.0);
            if (astray > 0 || !(error <= 1.0)) {
                rejected += 1.0;
                stride = step * (factor > 0.2 && factor < 1.0 && astray == 0 ? factor : 0.2);
                /* where the rate vanishes on the way, time has to take over */
                state[13] = fabs(stride) > 1e-06 ? 1.0 : 0.0;
                continue;
            }
            if (!isfinite(t + u_z[7])) {
                status = -2;
                break;
            }
            const int64_t here = 15 * stored;
            steps[here] = t;
            steps[here + 1] = u_z[7];
            steps[here + 2] = 0.0;
            steps[here + 3] = u;
            for (int64_t i = 0; i < 8; i++) {
                steps[here + 4 + i] = u_z[i];
            }
            steps[here + 12] = step;
            /* trajectories differ by a shift in time: its error is the sum over the steps, and that of u follows */
            const double earlier = u_astray / fabs(u_dot) + 1.1e-16 * ((1.0 + fabs(u)) / fastest + fabs(t + u_z[7]));
            u_astray = (earlier + late * _left(fabs(d1 - d2) / late, late * fastest)) * fabs(u_rate[7]);
            steps[here + 13] = (earlier + late) * fastest;
            steps[here + 14] = earlier + late;
            stored += 1;
            accepted += 1.0;
            state[14] += 1.0;
            t = t + u_z[7];
            u = landing == 1.0 ? u_stop : u + step;
            u_dot = u_rate[7];
            delta = deflection[7];
            _slopes(7, h[7], delta, c[0], p, slopes);
            factor = factor < 8.0 ? factor : 8.0;
            stride = fabs(step * factor) < 3.0 ? step * factor : 3.0;
            dt = 0.1 / (fabs(u_dot) + fabs(slopes[7]));
            last = 0.0;
            if (t < t_end && landing == 1.0) {
                status = 1;
            }
            continue;
        }
        /* land on the limit, and leave no sliver before it */
        if (crossing < limit) {
            limit = crossing;
            ending = 2.0;
        }
        step = dt < state[12] ? dt : state[12];
        landing = 0.0;
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
            _drive(t + _NODES[i + 1] * step, c, w);
            given[i] = w[0];
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
            _predict(step / last, u_z, above, below);
            _predict(step / last, deflection, above, below);
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
            _deflections(h, given, deflection, p, w, above, below);
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
                residual[0 + i] = step * u_rate[i];
            }
            for (int64_t j = 0; j < 8; j++) {
                for (int64_t i = 0; i < 8; i++) {
                    residual[0 + i] -= _INVERSE[8 * j + i] * u_z[j];
                }
            }
            for (int64_t i = 0; i < 8; i++) {
                change[i] = 0.0;
            }
            for (int64_t j = 0; j < 8; j++) {
                for (int64_t i = 0; i < 8; i++) {
                    change[i] += m[8 * j + i] * residual[j];
                }
            }
            for (int64_t i = 0; i < 8; i++) {
                u_z[i] += change[0 + i];
            }
            double total = 0.0;
            for (int64_t i = 0; i < 8; i++) {
                total += change[i] * change[i];
            }
            moves = sqrt(total);
            renew = moves > 0.03 ? 1 : 0;
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
        _drive(t + 0.5501108282781375 * step, c, w);
        const double probe_given = w[0];
        double u_probe = u;
        u_late = 0.0;
        u_defect = -step * u_dot;
        for (int64_t i = 0; i < 8; i++) {
            u_probe += _VALUE_PROBE[i + 1] * u_z[i];
            u_late += _SLOPE_PROBE[i + 1] * u_z[i];
            u_defect += _SLOPE_START[i + 1] * u_z[i];
        }
        h_probe = exp(u_probe);
        const double delta_probe = _solve_delta(h_probe, probe_given, deflection[4], p, w);
        _gap_rate(0, h_probe, delta_probe, probe_given, p, above, below);
        singles += 1.0;
        d1 = 0.014424143230897014 * u_defect;
        d2 = 0.07596008870469767 * (u_late - step * above[0]);
        /* written so that nan rejects the step */
        error = fabs(d1) > fabs(d2) ? fabs(d1) : fabs(d2);
        const double left = _left(fabs(d1 - d2) / error, error);
        /* where the step is mildest: a law can be a thousand times stiffer at its end than on the way */
        double decay = -step * slopes[7];
        stiffest = decay > stiffest ? decay : stiffest;
        for (int64_t i = 0; i < 7; i++) {
            decay = -step * slopes[i] < decay ? -step * slopes[i] : decay;
        }
        const double u_error = error / (decay > 0.0 ? 1.0 + 0.014424143230897014 * decay : 1.0);
        error = u_error / (rtol + rounding);
        factor = 0.9 * pow(error > 1e-12 ? error : 1e-12, -1.0 / 9.0);
        if (!(error <= 1.0)) {
            rejected += 1.0;
            shrink_only = 1.0;
            /* an error that is nan leaves a factor above 1 */
            dt = step * (factor > 0.2 && factor < 1.0 ? factor : 0.2);
            continue;
        }
        /* the step stands */
        const int64_t base = 15 * stored;
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
        steps[base + 12] = 0.0;
        /* the errors so far grow, or decay, as a perturbation of the start of the step does, and its own joins them */
        double growth = 0.0;
        for (int64_t i = 0; i < 8; i++) {
            growth += _QUADRATURE[i] * slopes[i];
        }
        growth = exp(step * growth);
        late = u_astray * (growth > 1.0 ? growth : 1.0) + u_error;
        u_astray = u_astray * growth + u_error * left + unsolved + 0.25 * rounding + 1.1e-16 * fabs((t + step) * u_dot);
        const double slowest = fabs(u_dot) < fabs(u_rate[7]) ? fabs(u_dot) : fabs(u_rate[7]);
        steps[base + 13] = late;
        steps[base + 14] = slowest > 0.0 ? late / slowest : INFINITY;
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
    state[9] = (double)stored;
    state[10] = stiffest;
    state[11] = settled;
    state[15] = u_astray;
    return status;
}
