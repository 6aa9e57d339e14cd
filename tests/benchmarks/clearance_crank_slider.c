/* The run of the driven crank-slider with clearance in joint B, written out by hand: what a C loop costs.
 *
 * It is the loop of reference_solver/contact/loop.py for one contact: touch, release and the law's change of sign
 * are located, and steps are graded into and out of contact. The step itself is in clearance_step.h.
 */
#include "clearance_step.h"

enum { STEPS_BETWEEN_PROBES = 16, HALVED = 20 };
enum { NONE = -1, GONE, TURNED }; /* events: touch or release, the law's change of sign */
typedef struct { double time, what, rate, depth, sums[SUMS]; } Event;

/* Return a number that is positive past the event. */
INLINE double alarm(const Contact *contact, const Gap *gap, int event)
{
    if (event == GONE)
        return contact->phase == FLIGHT ? gap->g : -gap->g;
    if (contact->phase == FLIGHT)
        return -1;
    return contact->phase == CONTACT ? -gap->push : gap->push;
}

/* Return an event other than skip that has happened. */
INLINE int first_alarm(const Contact *contact, const Gap *gap, int skip)
{
    for (int event = GONE; event <= TURNED; event++)
        if (event != skip && alarm(contact, gap, event) > 0)
            return event;
    return NONE;
}

/* Return the alarm of an event after a step of h, left in new. */
static double value_at(const Parameters *p, const Contact *contact, double t, double h, const Motion *old,
                       Motion *new, int event)
{
    return step(p, contact, t, h, old, new) ? alarm(contact, &new->gap, event) : NAN;
}

/* Return the step that ends on an event within h: touch and release by Newton, the sign's change by Illinois. */
static double locate(const Parameters *p, const Contact *contact, double t, double h, const Motion *old,
                     Motion *new, int event)
{
    double high = h, high_value = value_at(p, contact, t, h, old, new, event), low = 0, low_value = 0;
    double trial = high, value = high_value;
    if (event == TURNED && (low_value = value_at(p, contact, t, 0, old, new, event)) > 0)
        return 0;
    for (int k = 0; k < 100; k++) {
        const double resolution = 4e-16 * (t + trial) + 1e-300;
        if (high - low <= resolution)
            break;
        if (event == GONE) { /* aimed past the event by rounding, so as to end on its far side */
            const double rate = contact->phase == FLIGHT ? new->gap.rate : -new->gap.rate;
            trial = rate > 0 ? trial - value / rate + resolution : low;
        } else
            trial = high - high_value * (high - low) / (high_value - low_value);
        if (!(low < trial && trial < high))
            trial = 0.5 * (low + high);
        value = value_at(p, contact, t, trial, old, new, event);
        if (value == 0 || (event == GONE && value > 0 && value <= 4 * resolution * fabs(new->gap.rate)))
            return trial;
        if (value > 0) { high = trial; high_value = value; low_value *= 0.5; }
        else { low = trial; low_value = value; high_value *= 0.5; }
    }
    value_at(p, contact, t, high, old, new, event);
    return high;
}

/* Return the time within a step at which the cubic through both ends' g and rates peaks. */
static double peak(const Gap *gap, const Gap *new_gap, double h)
{
    const double rise = gap->rate, fall = new_gap->rate, mean = (new_gap->g - gap->g) / h;
    const double curve = 3 * mean - 2 * rise - fall, cubic = rise + fall - 2 * mean;
    const double root = sqrt(larger(curve * curve - 3 * cubic * rise, 0));
    const double x = curve < root ? -rise / (curve - root) : 0.5;
    return h * smaller(larger(x, 0), 1);
}

/* Return the first event within a step of h, and shorten the step to it. */
static int cut(const Parameters *p, const Contact *contact, double t, double *h, const Motion *old, Motion *new)
{
    int event = first_alarm(contact, &new->gap, NONE);
    if (event == NONE) { /* the pin has turned back: has it touched and left? */
        const double nearest = peak(&old->gap, &new->gap, *h);
        if (!(value_at(p, contact, t, nearest, old, new, GONE) > 0)) {
            value_at(p, contact, t, *h, old, new, GONE);
            return NONE;
        }
        event = GONE;
        *h = nearest;
    }
    for (int other = event; other != NONE; other = first_alarm(contact, &new->gap, event)) {
        const double shorter = locate(p, contact, t, *h, old, new, other);
        if (other != event && shorter >= *h)
            break;
        event = other;
        *h = shorter;
    }
    return event;
}

/* Look up the mobilities: the pin's answers to unit forces that push it inwards and along its wall. */
static void probe(const Parameters *p, Contact *contact, const Motion *m)
{
    Contact flying = *contact, inwards = *contact, along = *contact;
    flying.phase = FLIGHT;
    inwards.phase = PROBE;
    along.phase = PROBE_ALONG;
    contact->mobility = pin_acceleration(p, &flying, m, false) - pin_acceleration(p, &inwards, m, false);
    contact->following = pin_acceleration(p, &flying, m, true) - pin_acceleration(p, &along, m, true);
}

/* Return whether a pin that moves inwards at both ends of a step of h may have been out in between. */
INLINE bool has_bulged(const Contact *contact, const Gap *gap, const Gap *new_gap, double h)
{
    if (contact->phase != FLIGHT || !(gap->rate < 0 && new_gap->rate < 0))
        return false;
    const double steepest = 1.5 * (new_gap->g - gap->g) / h - 0.25 * (gap->rate + new_gap->rate);
    const double excess = steepest - 0.25 * smaller(gap->rate, new_gap->rate);
    return excess > 0 && larger(gap->g, new_gap->g) + excess * h > 0;
}

/* Change the phase at an event; return what happened: 1 touch, -1 release, 2 clip, 3 resume. */
static int switched(const Parameters *p, Contact *contact, double t, const Motion *m, int event)
{
    if (event == TURNED) {
        contact->phase = contact->phase == CONTACT ? CLIPPED : CONTACT;
        return contact->phase == CLIPPED ? 2 : 3;
    }
    if (contact->phase != FLIGHT) {
        contact->phase = FLIGHT;
        return -1;
    }
    /* The mobility tells how long the contact will take. */
    const double speed = larger(m->gap.rate, p->floor);
    probe(p, contact, m);
    contact->phase = CONTACT;
    contact->memory = p->factor / speed;
    contact->began = t;
    contact->duration = 3 * pow(2.5 * speed * speed / (2 * p->stiffness * contact->mobility), 0.4) / speed;
    return 1;
}

/* Change the phase at an event and write the event into the log. */
static void note(const Parameters *p, Contact *contact, double t, const Motion *m, int event, Event *entry)
{
    entry->time = t;
    entry->what = switched(p, contact, t, m, event);
    entry->rate = m->gap.rate;
    entry->depth = m->gap.depth;
    for (int s = 0; s < SUMS; s++) entry->sums[s] = m->sums[s];
}

/* Return the step at a distance in time from an end of a contact. */
INLINE double graded(double h, double duration, double distance)
{
    return smaller(h, h * h / duration + 2 * h * sqrt(larger(distance, 0) / duration));
}

/* Return the longest step that the phase allows. */
INLINE double step_length(const Parameters *p, const Contact *contact, const Gap *gap, double t)
{
    double h = p->longest;
    if (contact->phase == FLIGHT) /* a quarter of the way across */
        return gap->speed * h > 0.25 * p->clearance ? 0.25 * p->clearance / gap->speed : h;
    double duration = contact->duration;
    const double depth = larger(gap->depth, 0), pressing = gap->elastic * larger(1, gap->push);
    const double swing = sqrt(larger(pressing, 0) * contact->following / p->clearance);
    if (swing > 0)
        h = smaller(h, 2 * M_PI / (swing * p->per_contact));
    const double rate = contact->mobility * gap->damper;
    if (rate > 0)
        h = smaller(h, smaller(0.5, 200 / p->per_contact) / rate);
    if (depth > 0)
        duration = smaller(duration, M_PI / sqrt(1.5 * gap->elastic / depth * contact->mobility));
    const double shortest = duration / p->per_contact;
    h = smaller(h, graded(shortest, duration, t - contact->began));
    return gap->rate < 0 ? smaller(h, graded(shortest, duration, -depth / gap->rate)) : h;
}

/* Run from q and v in place to the end; write the sums and the events, return the steps, -1 for a failed one. */
long run(const Parameters *parameters, double *q, double *v, double end, double *sums, Event *log, long rows,
         long *events)
{
    const Parameters p = *parameters;
    Contact contact = {FLIGHT};
    Motion m = {.sums = {0}}, new;
    double t = 0, lost = 0;
    long steps = 0;
    for (int c = 0; c < COORDINATES; c++) { m.q[c] = q[c]; m.v[c] = v[c]; }
    m.gap = gap_of(&p, &contact, arms(&p, q), q, v);
    *events = 0;
    for (int event = first_alarm(&contact, &m.gap, NONE); event != NONE && *events < rows;
         event = first_alarm(&contact, &m.gap, event)) /* closed at the start */
        note(&p, &contact, t, &m, event, &log[(*events)++]);
    while (t < end && *events < rows) {
        if (contact.phase != FLIGHT && steps % STEPS_BETWEEN_PROBES == 0)
            probe(&p, &contact, &m);
        double h = step_length(&p, &contact, &m.gap, t);
        bool last = t + h >= end - 1e-6 * h;
        if (last)
            h = end - t;
        bool ok = step(&p, &contact, t, h, &m, &new);
        for (int i = 0; i < HALVED && ok && has_bulged(&contact, &m.gap, &new.gap, h); i++) {
            h *= 0.5;
            last = false;
            ok = step(&p, &contact, t, h, &m, &new);
        }
        if (!ok || !isfinite(new.gap.depth))
            return -1;
        int event = NONE;
        const bool back = contact.phase == FLIGHT && m.gap.rate > 0 && new.gap.rate < 0;
        if (back || first_alarm(&contact, &new.gap, NONE) != NONE) {
            const double whole = h;
            event = cut(&p, &contact, t, &h, &m, &new);
            last = last && h == whole;
        }
        const double change = h + lost, new_t = last ? end : t + change;
        lost = last ? 0 : change - (new_t - t);
        t = new_t;
        for (int s = 0; s < SUMS; s++) new.sums[s] += m.sums[s];
        m = new;
        steps++;
        if (event != NONE)
            note(&p, &contact, t, &m, event, &log[(*events)++]);
    }
    for (int c = 0; c < COORDINATES; c++) { q[c] = m.q[c]; v[c] = m.v[c]; }
    for (int s = 0; s < SUMS; s++) sums[s] = m.sums[s];
    return steps;
}
