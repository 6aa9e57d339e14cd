/* The driven crank-slider by the general multiplier algorithm, written out by hand: what a C loop costs.
 *
 * Bodies 0 crank, 1 rod, 2 slider; constraints O, A, B (two rows each), guide N, driver D. The guide's moment
 * meets no other row and stays zero. As in reference_solver/factorisation.py coordinates that follow from others go
 * first: D gives the crank's angle, O, A and B the centres. What is left is the rod's angle, and N between it and
 * nothing else. Letters in small print (ox, ay, ...) are the entries of B under the angles.
 */
#include <math.h>
#include <stdbool.h>

enum { COORDINATES = 9 };

typedef struct {
    double point_O, point_A, rod_A, rod_B; /* m from each body's centre of mass, along the link */
    double m0, m1, m2, i1;                 /* masses in kg, the rod's inertia in kg m^2 */
    double gravity, speed;                 /* m/s^2, rad/s */
    double tolerance;                      /* of the condition's reciprocal */
} Parameters;

/* Write q'' and return the driver's torque; ok becomes false where constraints depend on each other. */
static inline double accelerations(const Parameters p, const double *q, const double *v, double *a, bool *ok)
{
    const double cos0 = cos(q[2]), sin0 = sin(q[2]), cos1 = cos(q[5]), sin1 = sin(q[5]);
    const double ox = -sin0 * p.point_O, oy = cos0 * p.point_O, ax = sin0 * p.point_A, ay = -cos0 * p.point_A;
    const double cx = -sin1 * p.rod_A, cy = cos1 * p.rod_A, dx = sin1 * p.rod_B, dy = -cos1 * p.rod_B;
    const double s0 = v[2] * v[2], s1 = v[5] * v[5], bx = cx + dx, by = cy + dy;

    /* the centres' accelerations without the rod's angular one, of which the others are -cx, -cy, -bx, -by */
    const double x0 = s0 * oy, y0 = -s0 * ox;
    const double x1 = x0 + s0 * ay + s1 * cy, y1 = y0 - s0 * ax - s1 * cx, x2 = x1 + s1 * dy, y2 = y1 - s1 * dx;
    /* the rod's angle, and N */
    const double mass = p.i1 + p.m1 * (cx * cx + cy * cy) + p.m2 * (bx * bx + by * by);
    const double force = p.m1 * (cx * x1 + cy * (y1 + p.gravity)) + p.m2 * (bx * x2 + by * (y2 + p.gravity));
    const double r_mass = 1 / mass, r_N = 1 / (by * by), N = (by * force - mass * y2) * r_N;
    *ok &= p.tolerance * (COORDINATES + mass * r_N / p.m2) < 1;

    a[5] = (force - by * N) * r_mass;
    a[0] = x0;
    a[1] = y0;
    a[2] = 0;
    a[3] = x1 - cx * a[5];
    a[4] = y1 - cy * a[5];
    a[6] = x2 - bx * a[5];
    a[7] = y2 - by * a[5];
    a[8] = 0;
    const double Bx = p.m2 * a[6], By = p.m2 * (a[7] + p.gravity) - N;
    const double Ax = Bx + p.m1 * a[3], Ay = By + p.m1 * (a[4] + p.gravity);
    const double Ox = Ax + p.m0 * a[0], Oy = Ay + p.m0 * (a[1] + p.gravity);
    return -(ox * Ox + oy * Oy + ax * Ax + ay * Ay);
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
