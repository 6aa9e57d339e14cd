/* A step of the driven crank-slider with clearance in joint B, by the general multiplier algorithm.
 *
 * Bodies and letters are those of crank_slider.c, and so is the order of elimination: O, A, D. Joint B has no rows
 * but a contact of Lankarani and Nikravesh's kind; the guide N holds the slider's height and angle, and its rows
 * meet no others. Every step ends with the projections of reference_solver/equations.py.
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
    double w0, w1, w2, k0, k1, k2;              /* their inverses */
    double gravity, speed, start0, start2;      /* m/s^2, rad/s; angles of crank and slider at the start */
    double tolerance;                           /* of pivots, relative */
    double clearance, stiffness, factor, floor; /* m, N/m^1.5, damping factor, least approach speed in m/s */
    double longest, per_contact;                /* longest step in s, steps per contact */
} Parameters;

typedef struct { double g, rate, speed, depth, elastic, damper, push; } Gap;
typedef struct { double q[COORDINATES], v[COORDINATES], sums[SUMS]; Gap gap; } Motion;
typedef struct { int phase; double memory, began, duration, mobility, following; } Contact;

typedef struct { double ox, oy, ax, ay, cx, cy, bx, by; } Arms; /* bx, by: from the rod's centre to B */
typedef struct { double Ox, Oy, Ax, Ay, D; } Rows;
typedef struct { double x3, y3, phi3, x6, y6; } Free; /* M^-1 F of rod and slider */
typedef struct {
    double k_ox, k_oy, k_ax, k_ay, k_cx, k_cy, r_Ox, r_Oy, r_Ax, r_Ay, r_D;
    double l_Oy, l_AxOx, l_AyOx, l_DOx, l_AxOy, l_AyOy, l_DOy, l_Ay, l_DAx, l_DAy;
} Factors;

INLINE double larger(double a, double b) { return a > b ? a : b; }
INLINE double smaller(double a, double b) { return a < b ? a : b; }
INLINE double hertz(const Parameters *p, double depth) { return p->stiffness * (depth * sqrt(depth)); }

INLINE Arms arms(const Parameters *p, const double *q)
{
    const double cos0 = cos(q[2]), sin0 = sin(q[2]), cos1 = cos(q[5]), sin1 = sin(q[5]);
    return (Arms){-sin0 * p->point_O, cos0 * p->point_O, sin0 * p->point_A, -cos0 * p->point_A,
                  -sin1 * p->rod_A,   cos1 * p->rod_A,   cos1 * p->rod_B,   sin1 * p->rod_B};
}

/* Factor B M^-1 B^T; ok becomes false when a pivot is mere round-off. */
INLINE Factors factored(const Parameters *p, const Arms e, bool *ok)
{
    const double k_ox = p->k0 * e.ox, k_oy = p->k0 * e.oy, k_ax = p->k0 * e.ax, k_ay = p->k0 * e.ay;
    const double k_cx = p->k1 * e.cx, k_cy = p->k1 * e.cy;
    const double Oxx = p->w0 + k_ox * e.ox, Oyx = k_oy * e.ox, Oyy = p->w0 + k_oy * e.oy;
    const double AxOx = k_ax * e.ox - p->w0, AxOy = k_ax * e.oy, AyOx = k_ay * e.ox, AyOy = k_ay * e.oy - p->w0;
    const double Axx = p->w0 + p->w1 + k_ax * e.ax + k_cx * e.cx, Ayx = k_ay * e.ax + k_cy * e.cx;
    const double Ayy = p->w0 + p->w1 + k_ay * e.ay + k_cy * e.cy;
    /* O */
    const double r_Ox = 1 / Oxx, l_Oy = Oyx * r_Ox, l_AxOx = AxOx * r_Ox, l_AyOx = AyOx * r_Ox;
    const double l_DOx = k_ox * r_Ox;
    const double D_Oy = Oyy - l_Oy * Oyx, AxOy_ = AxOy - l_AxOx * Oyx, AyOy_ = AyOy - l_AyOx * Oyx;
    const double DOy_ = k_oy - l_DOx * Oyx, r_Oy = 1 / D_Oy;
    const double l_AxOy = AxOy_ * r_Oy, l_AyOy = AyOy_ * r_Oy, l_DOy = DOy_ * r_Oy;
    const double D_Ax = Axx - l_AxOx * AxOx - l_AxOy * AxOy_, Ayx_O = Ayx - l_AyOx * AxOx - l_AyOy * AxOy_;
    const double Ayy_O = Ayy - l_AyOx * AyOx - l_AyOy * AyOy_;
    const double DAx = k_ax - l_DOx * AxOx - l_DOy * AxOy_, DAy = k_ay - l_DOx * AyOx - l_DOy * AyOy_;
    const double DD = p->k0 - l_DOx * k_ox - l_DOy * DOy_;
    /* A */
    const double r_Ax = 1 / D_Ax, l_Ay = Ayx_O * r_Ax, l_DAx = DAx * r_Ax, D_Ay = Ayy_O - l_Ay * Ayx_O;
    const double DAy_ = DAy - l_DAx * Ayx_O, r_Ay = 1 / D_Ay, l_DAy = DAy_ * r_Ay;
    /* D */
    const double D_D = DD - l_DAx * DAx - l_DAy * DAy_;
    *ok &= (Oxx > p->tolerance * Oxx) & (D_Oy > p->tolerance * Oyy) & (D_Ax > p->tolerance * Axx)
         & (D_Ay > p->tolerance * Ayy) & (D_D > p->tolerance * p->k0);
    return (Factors){k_ox, k_oy, k_ax, k_ay, k_cx, k_cy, r_Ox, r_Oy, r_Ax, r_Ay, 1 / D_D,
                     l_Oy, l_AxOx, l_AyOx, l_DOx, l_AxOy, l_AyOy, l_DOy, l_Ay, l_DAx, l_DAy};
}

/* Solve with the factors. */
INLINE Rows solved(const Factors f, Rows z)
{
    z.Oy -= f.l_Oy * z.Ox;
    z.Ax -= f.l_AxOx * z.Ox + f.l_AxOy * z.Oy;
    z.Ay -= f.l_AyOx * z.Ox + f.l_AyOy * z.Oy + f.l_Ay * z.Ax;
    z.D -= f.l_DOx * z.Ox + f.l_DOy * z.Oy + f.l_DAx * z.Ax + f.l_DAy * z.Ay;
    z.D *= f.r_D;
    z.Ay = z.Ay * f.r_Ay - f.l_DAy * z.D;
    z.Ax = z.Ax * f.r_Ax - f.l_Ay * z.Ay - f.l_DAx * z.D;
    z.Oy = z.Oy * f.r_Oy - f.l_AxOy * z.Ax - f.l_AyOy * z.Ay - f.l_DOy * z.D;
    z.Ox = z.Ox * f.r_Ox - f.l_Oy * z.Oy - f.l_AxOx * z.Ax - f.l_AyOx * z.Ay - f.l_DOx * z.D;
    return z;
}

/* Return what gravity and a force on the pin do to rod and slider, (3). */
INLINE Free freely(const Parameters *p, const Arms e, double Fx, double Fy)
{
    return (Free){-p->w1 * Fx, p->w1 * (-Fy - p->m1 * p->gravity), p->k1 * (Fx * e.by - Fy * e.bx),
                  p->w2 * Fx, p->w2 * (Fy - p->m2 * p->gravity)};
}

/* Write q'' and the rates of the sums: the driver's power, the normal force, losses by it and by clipping. */
INLINE void accelerations(const Parameters *p, const Contact *contact, const double *q, const double *v, double *a,
                          double *rates, bool *ok)
{
    const Arms e = arms(p, q);
    const Factors k = factored(p, e, ok);
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
    const Free f = freely(p, e, -normal * nx + along * ny, -normal * ny - along * nx);
    /* (5), (7), (8): omega^2 times the arms, less the free accelerations */
    const double s0 = v[2] * v[2], s1 = v[5] * v[5];
    const Rows m = solved(k, (Rows){s0 * e.oy, p->gravity - s0 * e.ox,
                                    s0 * e.ay + s1 * e.cy - f.x3 - e.cx * f.phi3,
                                    -s0 * e.ax - s1 * e.cx - p->gravity - f.y3 - e.cy * f.phi3, 0});
    const double N = -f.y6 * p->m2;
    /* (9), (10) */
    a[0] = p->w0 * (m.Ox - m.Ax);
    a[1] = p->w0 * (m.Oy - m.Ay) - p->gravity;
    a[2] = k.k_ox * m.Ox + k.k_oy * m.Oy + k.k_ax * m.Ax + k.k_ay * m.Ay + p->k0 * m.D;
    a[3] = f.x3 + p->w1 * m.Ax;
    a[4] = f.y3 + p->w1 * m.Ay;
    a[5] = f.phi3 + k.k_cx * m.Ax + k.k_cy * m.Ay;
    a[6] = f.x6;
    a[7] = f.y6 + p->w2 * N;
    a[8] = 0;
    rates[DRIVER] = m.D * p->speed;
    rates[NORMAL] = normal;
    rates[LOSS] = loss;
    rates[CLIP] = clip;
}

/* Move x by -M^-1 B^T {mu}, of which N's are mu_y and mu_phi. */
INLINE void move(const Parameters *p, const Factors k, const Rows m, double mu_y, double mu_phi, double *x)
{
    x[0] -= p->w0 * (m.Ox - m.Ax);
    x[1] -= p->w0 * (m.Oy - m.Ay);
    x[2] -= k.k_ox * m.Ox + k.k_oy * m.Oy + k.k_ax * m.Ax + k.k_ay * m.Ay + p->k0 * m.D;
    x[3] -= p->w1 * m.Ax;
    x[4] -= p->w1 * m.Ay;
    x[5] -= k.k_cx * m.Ax + k.k_cy * m.Ay;
    x[7] -= p->w2 * mu_y;
    x[8] -= p->k2 * mu_phi;
}

/* Move q onto the constraints; return the energy removed. */
INLINE double project_q(const Parameters *p, const Contact *contact, double t, double *q, bool *ok)
{
    const Arms e = arms(p, q);
    const Factors k = factored(p, e, ok);
    const Rows m = solved(k, (Rows){q[0] + e.oy, q[1] - e.ox, q[3] + e.cy - q[0] + e.ay,
                                    q[4] - e.cx - q[1] - e.ax, q[2] - p->start0 - p->speed * t});
    const double mu_y = q[7] * p->m2, mu_phi = (q[8] - p->start2) * p->i2;
    const double x = q[6] - q[3] - e.bx, y = q[7] - q[4] - e.by;
    double pull = 0;
    if (contact->phase != FLIGHT) {
        const double distance = sqrt(x * x + y * y);
        pull = -hertz(p, larger(distance - p->clearance, 0)) / distance;
    }
    const Free f = freely(p, e, pull * x, pull * y);
    move(p, k, m, mu_y, mu_phi, q);
    return m.Oy * p->gravity - m.Ax * (f.x3 + e.cx * f.phi3) - m.Ay * (f.y3 + p->gravity + e.cy * f.phi3)
         - mu_y * f.y6;
}

/* Move v onto the constraints where the arms are these; return the energy removed. */
INLINE double project_v(const Parameters *p, const Arms e, double *v, bool *ok)
{
    const double mass[COORDINATES] = {p->m0, p->m0, p->i0, p->m1, p->m1, p->i1, p->m2, p->m2, p->i2};
    const Factors k = factored(p, e, ok);
    const Rows m = solved(k, (Rows){v[0] + e.ox * v[2], v[1] + e.oy * v[2],
                                    v[3] - v[0] + e.ax * v[2] + e.cx * v[5],
                                    v[4] - v[1] + e.ay * v[2] + e.cy * v[5], v[2] - p->speed});
    double old[COORDINATES], removed = 0;
    for (int c = 0; c < COORDINATES; c++) old[c] = v[c];
    move(p, k, m, v[7] * p->m2, v[8] * p->i2, v);
    for (int c = 0; c < COORDINATES; c++) removed += mass[c] / 2 * ((old[c] - v[c]) * (old[c] + v[c]));
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
