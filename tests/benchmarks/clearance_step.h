/* A step of the driven crank-slider with clearance in joint B, by the general multiplier algorithm.
 *
 * Bodies and letters are those of crank_slider.c, and so is the order of elimination. Joint B has no rows but a
 * contact of Lankarani and Nikravesh's kind, the guide N holds the slider's height and angle: what is left are the
 * rod's angle and the slider's place. Every step ends with the projections of reference_solver/equations.py.
 */
#include <math.h>
#include <stdbool.h>

/* gcc leaves functions as long as these alone otherwise, which costs 7 %. */
#define INLINE static inline __attribute__((always_inline))

enum { COORDINATES = 9 };
enum { DRIVER, NORMAL, LOSS, CLIP, REMOVED, SUMS };
enum { FLIGHT, CONTACT, CLIPPED, PROBE, PROBE_ALONG }; /* phases; probes answer with a unit force */

typedef struct {
    double point_O, point_A, rod_A, rod_B;      /* m from each body's centre of mass, along the link */
    double m0, m1, m2, i0, i1, i2;              /* masses in kg and inertias in kg m^2 */
    double gravity, speed, start0, start2;      /* m/s^2, rad/s; angles of crank and slider at the start */
    double clearance, stiffness, factor, floor; /* m, N/m^1.5, damping factor, least approach speed in m/s */
    double longest, per_contact;                /* longest step in s, steps per contact */
} Parameters;

typedef struct { double g, rate, speed, depth, elastic, damper, push; } Gap;
typedef struct { double q[COORDINATES], v[COORDINATES], sums[SUMS]; Gap gap; } Motion;
typedef struct { int phase; double memory, began, duration, mobility, following; } Contact;

typedef struct { double ox, oy, ax, ay, cx, cy, bx, by; } Arms; /* bx, by: from the rod's centre to B */
typedef struct { double Ox, Oy, Ax, Ay, D, Ny, Nphi; } Rows;
typedef struct { double x1, y1, phi1, x2, y2; } Forces; /* on rod and slider in N, N m */

INLINE double larger(double a, double b) { return a > b ? a : b; }
INLINE double smaller(double a, double b) { return a < b ? a : b; }
INLINE double hertz(const Parameters *p, double depth) { return p->stiffness * (depth * sqrt(depth)); }

INLINE Arms arms(const Parameters *p, const double *q)
{
    const double cos0 = cos(q[2]), sin0 = sin(q[2]), cos1 = cos(q[5]), sin1 = sin(q[5]);
    return (Arms){-sin0 * p->point_O, cos0 * p->point_O, sin0 * p->point_A, -cos0 * p->point_A,
                  -sin1 * p->rod_A,   cos1 * p->rod_A,   cos1 * p->rod_B,   sin1 * p->rod_B};
}

/* Return 1 over the inertia of the rod's angle, with the centre that follows from it. */
INLINE double r_angle(const Parameters *p, const Arms e, bool *ok)
{
    const double mass = p->i1 + p->m1 * (e.cx * e.cx + e.cy * e.cy);
    *ok &= mass > 0;
    return 1 / mass;
}

/* Return gravity and a force on the pin, as rod and slider feel them. */
INLINE Forces forces(const Parameters *p, const Arms e, double Fx, double Fy)
{
    return (Forces){-Fx, -Fy - p->m1 * p->gravity, Fx * e.by - Fy * e.bx, Fx, Fy - p->m2 * p->gravity};
}

/* Write q'' and the rates of the sums: the driver's power, the normal force, losses by it and by clipping. */
INLINE void accelerations(const Parameters *p, const Contact *contact, const double *q, const double *v, double *a,
                          double *rates, bool *ok)
{
    const Arms e = arms(p, q);
    double nx = 0, ny = 0, normal = 0, along = 0, loss = 0, clip = 0;
    if (contact->phase != FLIGHT) {
        const double x = q[6] - q[3] - e.bx, y = q[7] - q[4] - e.by, distance = sqrt(x * x + y * y);
        nx = x / distance;
        ny = y / distance;
        const double rate = nx * (v[6] - v[3] + v[5] * e.by) + ny * (v[7] - v[4] - v[5] * e.bx);
        const double elastic = hertz(p, larger(distance - p->clearance, 0));
        const double damping = elastic * contact->memory * rate;
        normal = contact->phase == PROBE ? 1 : contact->phase >= CLIPPED ? 0 : elastic + damping;
        along = contact->phase == PROBE_ALONG ? 1 : 0;
        loss = contact->phase == CONTACT ? damping * rate : 0;
        clip = contact->phase == CLIPPED ? -elastic * rate : 0;
    }
    const Forces f = forces(p, e, -normal * nx + along * ny, -normal * ny - along * nx);
    /* omega^2 times the arms, then the rod's angular acceleration */
    const double s0 = v[2] * v[2], s1 = v[5] * v[5], x0 = s0 * e.oy, y0 = -s0 * e.ox;
    const double x1 = x0 + s0 * e.ay + s1 * e.cy, y1 = y0 - s0 * e.ax - s1 * e.cx;
    a[5] = (f.phi1 + e.cx * (p->m1 * x1 - f.x1) + e.cy * (p->m1 * y1 - f.y1)) * r_angle(p, e, ok);
    a[0] = x0;
    a[1] = y0;
    a[2] = 0;
    a[3] = x1 - e.cx * a[5];
    a[4] = y1 - e.cy * a[5];
    a[6] = f.x2 / p->m2;
    a[7] = 0;
    a[8] = 0;
    const double Ax = p->m1 * a[3] - f.x1, Ay = p->m1 * a[4] - f.y1;
    const double Ox = Ax + p->m0 * a[0], Oy = Ay + p->m0 * (a[1] + p->gravity);
    rates[DRIVER] = -(e.ox * Ox + e.oy * Oy + e.ax * Ax + e.ay * Ay) * p->speed;
    rates[NORMAL] = normal;
    rates[LOSS] = loss;
    rates[CLIP] = clip;
}

/* Write the least move in the norm of M that has these rows. */
INLINE void move(const Parameters *p, const Arms e, const Rows g, double *x, bool *ok)
{
    x[2] = g.D;
    x[0] = g.Ox - e.ox * x[2];
    x[1] = g.Oy - e.oy * x[2];
    const double x1 = g.Ax + x[0] - e.ax * x[2], y1 = g.Ay + x[1] - e.ay * x[2];
    x[5] = p->m1 * (e.cx * x1 + e.cy * y1) * r_angle(p, e, ok);
    x[3] = x1 - e.cx * x[5];
    x[4] = y1 - e.cy * x[5];
    x[6] = 0;
    x[7] = g.Ny;
    x[8] = g.Nphi;
}

/* Move q onto the constraints; return the energy removed. */
INLINE double project_q(const Parameters *p, const Contact *contact, double t, double *q, bool *ok)
{
    const Arms e = arms(p, q);
    double m[COORDINATES];
    move(p, e, (Rows){q[0] + e.oy, q[1] - e.ox, q[3] + e.cy - q[0] + e.ay, q[4] - e.cx - q[1] - e.ax,
                      q[2] - p->start0 - p->speed * t, q[7], q[8] - p->start2}, m, ok);
    const double x = q[6] - q[3] - e.bx, y = q[7] - q[4] - e.by;
    double pull = 0;
    if (contact->phase != FLIGHT) {
        const double distance = sqrt(x * x + y * y);
        pull = -hertz(p, larger(distance - p->clearance, 0)) / distance;
    }
    const Forces f = forces(p, e, pull * x, pull * y);
    for (int c = 0; c < COORDINATES; c++) q[c] -= m[c];
    return m[1] * p->m0 * p->gravity - m[3] * f.x1 - m[4] * f.y1 - m[5] * f.phi1 - m[7] * f.y2;
}

/* Move v onto the constraints where the arms are these; return the energy removed. */
INLINE double project_v(const Parameters *p, const Arms e, double *v, bool *ok)
{
    const double mass[COORDINATES] = {p->m0, p->m0, p->i0, p->m1, p->m1, p->i1, p->m2, p->m2, p->i2};
    double m[COORDINATES], removed = 0;
    move(p, e, (Rows){v[0] + e.ox * v[2], v[1] + e.oy * v[2], v[3] - v[0] + e.ax * v[2] + e.cx * v[5],
                      v[4] - v[1] + e.ay * v[2] + e.cy * v[5], v[2] - p->speed, v[7], v[8]}, m, ok);
    for (int c = 0; c < COORDINATES; c++) {
        const double old = v[c];
        v[c] -= m[c];
        removed += mass[c] / 2 * ((old - v[c]) * (old + v[c]));
    }
    return removed;
}

/* Return the gap of the pin in its bearing, as reference_solver/contact/force.py has it. */
INLINE Gap gap_of(const Parameters *p, const Contact *contact, const Arms e, const double *q, const double *v)
{
    const double x = q[6] - q[3] - e.bx, y = q[7] - q[4] - e.by, c = p->clearance, distance = sqrt(x * x + y * y);
    const double vx = v[6] - v[3] + v[5] * e.by, vy = v[7] - v[4] - v[5] * e.bx, rate = (x * vx + y * vy) / c;
    double elastic = 0, damper = 0, push = 0;
    if (contact->phase != FLIGHT) {
        elastic = hertz(p, larger(distance - c, 1e-12 * c));
        damper = elastic * contact->memory;
        push = 1 + damper / elastic * (rate * c / distance);
    }
    return (Gap){0.5 * (x * x + y * y - c * c) / c, rate, sqrt(vx * vx + vy * vy), distance - c,
                 elastic, damper, push};
}

/* Take an RK4 step of h, (11)-(13), and project; the sums of the new motion are those of the step alone. */
static bool step(const Parameters *p, const Contact *contact, double t, double h, const Motion *old, Motion *new)
{
    const double *q = old->q, *v = old->v;
    double x[COORDINATES], y2[COORDINATES], y3[COORDINATES], y4[COORDINATES];
    double a1[COORDINATES], a2[COORDINATES], a3[COORDINATES], a4[COORDINATES];
    double s1[REMOVED], s2[REMOVED], s3[REMOVED], s4[REMOVED];
    bool ok = true;
    accelerations(p, contact, q, v, a1, s1, &ok);
    for (int c = 0; c < COORDINATES; c++) { x[c] = q[c] + 0.5 * h * v[c]; y2[c] = v[c] + 0.5 * h * a1[c]; }
    accelerations(p, contact, x, y2, a2, s2, &ok);
    for (int c = 0; c < COORDINATES; c++) { x[c] = q[c] + 0.5 * h * y2[c]; y3[c] = v[c] + 0.5 * h * a2[c]; }
    accelerations(p, contact, x, y3, a3, s3, &ok);
    for (int c = 0; c < COORDINATES; c++) { x[c] = q[c] + h * y3[c]; y4[c] = v[c] + h * a3[c]; }
    accelerations(p, contact, x, y4, a4, s4, &ok);
    for (int c = 0; c < COORDINATES; c++) {
        new->q[c] = q[c] + h / 6 * (v[c] + 2 * (y2[c] + y3[c]) + y4[c]);
        new->v[c] = v[c] + h / 6 * (a1[c] + 2 * (a2[c] + a3[c]) + a4[c]);
    }
    for (int s = 0; s < REMOVED; s++) new->sums[s] = h / 6 * (s1[s] + 2 * (s2[s] + s3[s]) + s4[s]);
    new->sums[REMOVED] = project_q(p, contact, t + h, new->q, &ok);
    const Arms e = arms(p, new->q);
    new->sums[REMOVED] += project_v(p, e, new->v, &ok);
    new->gap = gap_of(p, contact, e, new->q, new->v);
    return ok;
}

/* Return the part of the pin's acceleration along n, or along t, that is linear in the accelerations. */
static double pin_acceleration(const Parameters *p, const Contact *contact, const Motion *m, bool tangential)
{
    const Arms e = arms(p, m->q);
    double a[COORDINATES], rates[REMOVED];
    bool ok = true;
    accelerations(p, contact, m->q, m->v, a, rates, &ok);
    const double x = m->q[6] - m->q[3] - e.bx, y = m->q[7] - m->q[4] - e.by, distance = sqrt(x * x + y * y);
    const double ax = a[6] - a[3] + a[5] * e.by, ay = a[7] - a[4] - a[5] * e.bx;
    return (tangential ? x * ay - y * ax : x * ax + y * ay) / distance;
}
