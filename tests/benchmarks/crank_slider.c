/* The driven crank-slider by the general multiplier algorithm, written out by hand: what a C loop costs.
 *
 * Bodies 0 crank, 1 rod, 2 slider; constraints O, A, B (two rows each), guide N, driver D. The guide's moment
 * meets no other row and stays zero. B M^-1 B^T is factored by L D L^T in the order N, B, O, A, D. Letters in
 * small print (ox, ay, ...) are the entries of B under the angles; gravity cancels in rows A and B.
 */
#include <math.h>
#include <stdbool.h>

enum { COORDINATES = 9 };

typedef struct {
    double point_O, point_A, rod_A, rod_B; /* m from each body's centre of mass, along the link */
    double w0, w1, w2;                     /* inverse masses in 1/kg */
    double k0, k1;                         /* inverse inertias in 1/(kg m^2) */
    double gravity, speed;                 /* m/s^2, rad/s */
    double tolerance;                      /* of pivots, relative */
} Parameters;

/* Write q'' and return the driver's torque; ok becomes false when a pivot is mere round-off. */
static inline double accelerations(const Parameters p, const double *q, const double *v, double *a, bool *ok)
{
    const double cos0 = cos(q[2]), sin0 = sin(q[2]), cos1 = cos(q[5]), sin1 = sin(q[5]);
    const double ox = -sin0 * p.point_O, oy = cos0 * p.point_O, ax = sin0 * p.point_A, ay = -cos0 * p.point_A;
    const double cx = -sin1 * p.rod_A, cy = cos1 * p.rod_A, dx = sin1 * p.rod_B, dy = -cos1 * p.rod_B;
    const double k_ox = p.k0 * ox, k_oy = p.k0 * oy, k_ax = p.k0 * ax, k_ay = p.k0 * ay;
    const double k_cx = p.k1 * cx, k_cy = p.k1 * cy, k_dx = p.k1 * dx, k_dy = p.k1 * dy;

    /* B M^-1 B^T */
    const double Oxx = p.w0 + k_ox * ox, Oyx = k_oy * ox, Oyy = p.w0 + k_oy * oy;
    const double AxOx = k_ax * ox - p.w0, AxOy = k_ax * oy, AyOx = k_ay * ox, AyOy = k_ay * oy - p.w0;
    const double Axx = p.w0 + p.w1 + k_ax * ax + k_cx * cx, Ayx = k_ay * ax + k_cy * cx;
    const double Ayy = p.w0 + p.w1 + k_ay * ay + k_cy * cy;
    const double AxBx = k_cx * dx - p.w1, AxBy = k_cx * dy, AyBx = k_cy * dx, AyBy = k_cy * dy - p.w1;
    const double Bxx = p.w1 + p.w2 + k_dx * dx, Byx = k_dy * dx, Byy = p.w1 + p.w2 + k_dy * dy;

    /* N */
    const double ByN = p.w2 / p.w2, Byy_N = Byy - ByN * p.w2;
    /* B */
    const double r_Bx = 1 / Bxx, l_By = Byx * r_Bx, l_AxBx = AxBx * r_Bx, l_AyBx = AyBx * r_Bx;
    const double D_By = Byy_N - l_By * Byx, AxBy_ = AxBy - l_AxBx * Byx, AyBy_ = AyBy - l_AyBx * Byx;
    const double r_By = 1 / D_By, l_AxBy = AxBy_ * r_By, l_AyBy = AyBy_ * r_By;
    const double Axx_B = Axx - l_AxBx * AxBx - l_AxBy * AxBy_, Ayx_B = Ayx - l_AyBx * AxBx - l_AyBy * AxBy_;
    const double Ayy_B = Ayy - l_AyBx * AyBx - l_AyBy * AyBy_;
    /* O */
    const double r_Ox = 1 / Oxx, l_Oy = Oyx * r_Ox, l_AxOx = AxOx * r_Ox, l_AyOx = AyOx * r_Ox;
    const double l_DOx = k_ox * r_Ox, D_Oy = Oyy - l_Oy * Oyx, AxOy_ = AxOy - l_AxOx * Oyx;
    const double AyOy_ = AyOy - l_AyOx * Oyx, DOy_ = k_oy - l_DOx * Oyx, r_Oy = 1 / D_Oy;
    const double l_AxOy = AxOy_ * r_Oy, l_AyOy = AyOy_ * r_Oy, l_DOy = DOy_ * r_Oy;
    const double D_Ax = Axx_B - l_AxOx * AxOx - l_AxOy * AxOy_;
    const double Ayx_O = Ayx_B - l_AyOx * AxOx - l_AyOy * AxOy_;
    const double Ayy_O = Ayy_B - l_AyOx * AyOx - l_AyOy * AyOy_;
    const double DAx = k_ax - l_DOx * AxOx - l_DOy * AxOy_, DAy = k_ay - l_DOx * AyOx - l_DOy * AyOy_;
    const double DD = p.k0 - l_DOx * k_ox - l_DOy * DOy_;
    /* A */
    const double r_Ax = 1 / D_Ax, l_Ay = Ayx_O * r_Ax, l_DAx = DAx * r_Ax, D_Ay = Ayy_O - l_Ay * Ayx_O;
    const double DAy_ = DAy - l_DAx * Ayx_O, r_Ay = 1 / D_Ay, l_DAy = DAy_ * r_Ay;
    /* D */
    const double D_D = DD - l_DAx * DAx - l_DAy * DAy_;
    *ok &= (Bxx > p.tolerance * Bxx) & (D_By > p.tolerance * Byy) & (Oxx > p.tolerance * Oxx)
         & (D_Oy > p.tolerance * Oyy) & (D_Ax > p.tolerance * Axx) & (D_Ay > p.tolerance * Ayy)
         & (D_D > p.tolerance * p.k0);

    /* right-hand side: omega^2 times the arms, and gravity; forward substitution */
    const double s0 = v[2] * v[2], s1 = v[5] * v[5];
    const double z_N = p.gravity, z_Bx = s1 * dy, z_By = -s1 * dx - ByN * z_N - l_By * z_Bx;
    const double z_Ox = s0 * oy, z_Oy = p.gravity - s0 * ox - l_Oy * z_Ox;
    const double z_Ax = s0 * ay + s1 * cy - l_AxBx * z_Bx - l_AxBy * z_By - l_AxOx * z_Ox - l_AxOy * z_Oy;
    const double z_Ay = -s0 * ax - s1 * cx - l_AyBx * z_Bx - l_AyBy * z_By - l_AyOx * z_Ox - l_AyOy * z_Oy
                      - l_Ay * z_Ax;
    const double z_D = -l_DOx * z_Ox - l_DOy * z_Oy - l_DAx * z_Ax - l_DAy * z_Ay;
    /* back substitution */
    const double D = z_D / D_D;
    const double Ay = z_Ay * r_Ay - l_DAy * D, Ax = z_Ax * r_Ax - l_Ay * Ay - l_DAx * D;
    const double Oy = z_Oy * r_Oy - l_AxOy * Ax - l_AyOy * Ay - l_DOy * D;
    const double Ox = z_Ox * r_Ox - l_Oy * Oy - l_AxOx * Ax - l_AyOx * Ay - l_DOx * D;
    const double By = z_By * r_By - l_AxBy * Ax - l_AyBy * Ay;
    const double Bx = z_Bx * r_Bx - l_By * By - l_AxBx * Ax - l_AyBx * Ay;
    const double N = z_N / p.w2 - ByN * By;

    a[0] = p.w0 * (Ox - Ax);
    a[1] = p.w0 * (Oy - Ay) - p.gravity;
    a[2] = k_ox * Ox + k_oy * Oy + k_ax * Ax + k_ay * Ay + p.k0 * D;
    a[3] = p.w1 * (Ax - Bx);
    a[4] = p.w1 * (Ay - By) - p.gravity;
    a[5] = k_cx * Ax + k_cy * Ay + k_dx * Bx + k_dy * By;
    a[6] = p.w2 * Bx;
    a[7] = p.w2 * (By + N) - p.gravity;
    a[8] = 0;
    return D;
}

/* Take count RK4 steps of size h in place, rounding carried on; write the driver's work, return the steps done. */
long advance(const Parameters *parameters, double *q_io, double *v_io, double h, long count, double *work)
{
    const Parameters p = *parameters;
    double q[COORDINATES], v[COORDINATES], lost_q[COORDINATES] = {0}, lost_v[COORDINATES] = {0};
    double x2[COORDINATES], y2[COORDINATES], y3[COORDINATES], y4[COORDINATES];
    double a1[COORDINATES], a2[COORDINATES], a3[COORDINATES], a4[COORDINATES];
    long done = 0;
    for (int c = 0; c < COORDINATES; c++) { q[c] = q_io[c]; v[c] = v_io[c]; }
    *work = 0;
    for (; done < count; done++) {
        bool ok = true;
        const double torque1 = accelerations(p, q, v, a1, &ok);
        for (int c = 0; c < COORDINATES; c++) { x2[c] = q[c] + 0.5 * h * v[c]; y2[c] = v[c] + 0.5 * h * a1[c]; }
        const double torque2 = accelerations(p, x2, y2, a2, &ok);
        for (int c = 0; c < COORDINATES; c++) { x2[c] = q[c] + 0.5 * h * y2[c]; y3[c] = v[c] + 0.5 * h * a2[c]; }
        const double torque3 = accelerations(p, x2, y3, a3, &ok);
        for (int c = 0; c < COORDINATES; c++) { x2[c] = q[c] + h * y3[c]; y4[c] = v[c] + h * a3[c]; }
        const double torque4 = accelerations(p, x2, y4, a4, &ok);
        if (!ok)
            break;
        for (int c = 0; c < COORDINATES; c++) {
            const double dq = h / 6 * (v[c] + 2 * (y2[c] + y3[c]) + y4[c]) + lost_q[c], new_q = q[c] + dq;
            const double dv = h / 6 * (a1[c] + 2 * (a2[c] + a3[c]) + a4[c]) + lost_v[c], new_v = v[c] + dv;
            lost_q[c] = dq - (new_q - q[c]);
            lost_v[c] = dv - (new_v - v[c]);
            q[c] = new_q;
            v[c] = new_v;
        }
        *work += p.speed * h / 6 * (torque1 + 2 * (torque2 + torque3) + torque4);
    }
    for (int c = 0; c < COORDINATES; c++) { q_io[c] = q[c]; v_io[c] = v[c]; }
    return done;
}
