/* A virtual machine with a touch probe, for LinuxCNC (uspace).
 *
 * Joint motor positions in; the real machine with its planted errors; the ball against real boxes; the
 * probe's bit out. The component knows bodies and errors only: no plan, no touch list, no expected reading.
 *
 * It stands in the servo thread before `motion-controller`, so that the probe input and the feedback which
 * motion reads in one cycle belong to the same instant:
 *
 *     addf probe                       motor-pos-cmd of the last cycle = where the machine is now
 *     addf motion-command-handler
 *     addf motion-controller           reads motor-pos-fb and probe-input, latches, plans the next cycle
 *
 * Everything it knows comes from one text file, named at load time: `loadrt probe world=/path/world.txt`.
 * The words of that file are listed at `read_world` below. Units inside: mm, radian. Frames: all frames
 * coincide with R when every axis stands at 0, so that a carrier's transform is the plain product of the
 * motions below it.
 *
 * What counts as contact, gap <= 0:
 *     ball   signed distance from the ball's centre to a box or cylinder, less the effective radius
 *     stem   the stylus as a capsule (radius, from the ball's centre to the probe's body)
 *     body   flat-ended cylinders (probe body, spindle nose): touching yes or no
 * The effective radius is ball radius - pretravel - noise of this touch: both make the trigger late along
 * the normal of contact. The noise of a touch is drawn once and stays until the ball has been clear by
 * `redraw_gap` (0.05 mm or 10 sigma), so that press and release of one touch agree and nothing chatters.
 */
#include "rtapi.h"
#include "rtapi_app.h"
#include "hal.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <stdint.h>

MODULE_DESCRIPTION("virtual machine with planted errors and a touch probe");
MODULE_LICENSE("GPL");

static char *world = "";
RTAPI_MP_STRING(world, "text file that describes machine, blocks and probe");

#define AXES 9          /* joints of the machine */
#define SHAPES 96       /* boxes and cylinders */
#define HARMONICS 32
#define BODIES 8        /* cylinders of the tool above the stylus */
#define TOUCHES 20000   /* rows kept for the report */
#define NAME 64

/* ------------------------------------------------------------------------------------- small geometry */

typedef struct { double x, y, z; } vec;
typedef struct { double m[3][3]; } rot;
typedef struct { rot r; vec t; } frame;

static vec V(double x, double y, double z) { vec v = {x, y, z}; return v; }
static vec add(vec a, vec b) { return V(a.x + b.x, a.y + b.y, a.z + b.z); }
static vec sub(vec a, vec b) { return V(a.x - b.x, a.y - b.y, a.z - b.z); }
static vec mul(double k, vec a) { return V(k * a.x, k * a.y, k * a.z); }
static double dot(vec a, vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static vec cross(vec a, vec b) {
    return V(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
static double length(vec a) { return sqrt(dot(a, a)); }
static vec turn(const rot *r, vec a) {
    return V(r->m[0][0] * a.x + r->m[0][1] * a.y + r->m[0][2] * a.z,
             r->m[1][0] * a.x + r->m[1][1] * a.y + r->m[1][2] * a.z,
             r->m[2][0] * a.x + r->m[2][1] * a.y + r->m[2][2] * a.z);
}
static vec turn_back(const rot *r, vec a) {
    return V(r->m[0][0] * a.x + r->m[1][0] * a.y + r->m[2][0] * a.z,
             r->m[0][1] * a.x + r->m[1][1] * a.y + r->m[2][1] * a.z,
             r->m[0][2] * a.x + r->m[1][2] * a.y + r->m[2][2] * a.z);
}
static rot product(const rot *a, const rot *b) {
    rot c;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            c.m[i][j] = a->m[i][0] * b->m[0][j] + a->m[i][1] * b->m[1][j] + a->m[i][2] * b->m[2][j];
    return c;
}
static frame compose(const frame *a, const frame *b) {
    frame c;
    c.r = product(&a->r, &b->r);
    c.t = add(a->t, turn(&a->r, b->t));
    return c;
}
static frame still(void) {
    frame f = {{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}, {0, 0, 0}};
    return f;
}
static frame shifted(vec t) { frame f = still(); f.t = t; return f; }
/* f turned about a point instead of the origin: Trans(p) f Trans(-p) */
static frame about(vec p, frame f) {
    f.t = add(f.t, sub(p, turn(&f.r, p)));
    return f;
}
static rot rotation(vec k, double angle) { /* Rodrigues; k is a unit vector */
    double c = cos(angle), s = sin(angle), v = 1 - c;
    rot r = {{{k.x * k.x * v + c, k.x * k.y * v - k.z * s, k.x * k.z * v + k.y * s},
              {k.y * k.x * v + k.z * s, k.y * k.y * v + c, k.y * k.z * v - k.x * s},
              {k.z * k.x * v - k.y * s, k.z * k.y * v + k.x * s, k.z * k.z * v + c}}};
    return r;
}
/* E(d, w) = Trans(d) Rz(c) Ry(b) Rx(a), e = dx dy dz a b c */
static frame error_frame(const double e[6]) {
    rot x = rotation(V(1, 0, 0), e[3]), y = rotation(V(0, 1, 0), e[4]), z = rotation(V(0, 0, 1), e[5]);
    rot yx = product(&y, &x);
    frame f;
    f.r = product(&z, &yx);
    f.t = V(e[0], e[1], e[2]);
    return f;
}

/* ------------------------------------------------------------------------------------------ the world */

typedef struct {
    char letter;
    int parent;              /* index of an axis, -1 the base */
    int rotary, on_tool_side;
    vec direction, point;
    double sense, origin;    /* origin: machine coordinate at which this axis stands at 0 in R */
    double before[6], after[6];
    double scale;            /* linear: what it carries stands scale * coordinate further along its direction */
} axis_t;

typedef struct {
    int axis, of, dof, k;    /* before[dof] of `axis` gains c cos(k q_of) + s sin(k q_of) */
    double c, s;
} harmonic_t;

typedef struct {
    char name[NAME];
    int is_block, is_cylinder, is_sphere, carrier;
    vec centre;              /* in the carrier's frame */
    rot turn;                /* shape axes -> carrier */
    vec half;                /* box: half edges. Cylinder about its own z: x = radius, z = half height. Sphere: x = radius */
    double reach;            /* radius of the sphere around it */
} shape_t;

typedef struct { double from, to, radius; } body_t; /* along the tool's axis, from the ball's centre up */

static struct {
    int axes, shapes, harmonics, bodies;
    axis_t axis[AXES];
    shape_t shape[SHAPES];
    harmonic_t harmonic[HARMONICS];
    body_t body[BODIES];
    int tool;                          /* axis that carries the tool */
    vec ball, up;                      /* ball's centre and direction to the spindle, in the tool's frame */
    double ball_radius, stem_radius, stem_length, pretravel;
    double touch_sigma, visit_sigma;
    uint64_t seed;
    int edge;                          /* latch: 1 interpolates the crossing, 0 plain servo cycles */
    vec reference;                     /* where workpiece-side errors stand */
    char report[512];
} w;

/* ------------------------------------------------------------------------------------------- pins, state */

typedef struct {
    hal_float_t *cmd[AXES], *fb[AXES];
    hal_bit_t *contact, *stem_touched;
    hal_u32_t *touches, *block_touches, *solid_touches, *stem_touches, *collisions, *visits;
    hal_float_t *overtravel_max, *gap, *ball[3], *longer;
} pins_t;

typedef struct { double q[AXES]; double overtravel; int shape; char kind; uint32_t cycle; } touch_t;

static pins_t *pins;
static int comp_id;
static touch_t *touches;
static int touch_count;
static double last[AXES];
static int started, touching, redraw_due, turning;
static uint32_t cycles;
static double touch_noise, redraw_gap;
static vec visit_noise;
static double longer;           /* the stylus that is clamped, mm beyond the world file's: a person changes it */
static uint64_t random_state;

/* splitmix64: one seed, one stream, the same on every machine */
static uint64_t random_bits(void) {
    uint64_t z = (random_state += 0x9e3779b97f4a7c15ull);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
    return z ^ (z >> 31);
}
static double normal(void) { /* Box and Muller, one of the pair */
    double u = ((random_bits() >> 11) + 1) * 0x1p-53, v = (random_bits() >> 11) * 0x1p-53;
    return sqrt(-2 * log(u)) * cos(2 * M_PI * v);
}
static void draw_visit(void) {
    if (w.visit_sigma > 0)
        visit_noise = V(w.visit_sigma * normal(), w.visit_sigma * normal(), w.visit_sigma * normal());
}
static void draw_touch(void) {
    if (w.touch_sigma > 0) touch_noise = w.touch_sigma * normal();
}

/* --------------------------------------------------------------------------------------- kinematics */

/* Motion of one axis with its errors: E_before . motion . E_after.
 * The coordinate means "tool over workpiece": a linear axis below the workpiece moves its carriage by
 * minus the coordinate. Errors of workpiece-side axes stand at the reference point, those of tool-side
 * axes at the axis's own point; `after` turns with the axis. */
static frame axis_motion(int i, const double *q) {
    const axis_t *a = &w.axis[i];
    double e[6];
    memcpy(e, a->before, sizeof e);
    for (int h = 0; h < w.harmonics; h++) {
        const harmonic_t *m = &w.harmonic[h];
        if (m->axis != i) continue;
        double angle = m->k * q[m->of] * (w.axis[m->of].rotary ? M_PI / 180 : 1);
        e[m->dof] += m->c * cos(angle) + m->s * sin(angle);
    }
    vec at = a->on_tool_side ? a->point : w.reference;
    frame before = about(at, error_frame(e)), after = about(at, error_frame(a->after)), move;
    if (a->rotary) {
        move = still();
        move.r = rotation(a->direction, a->sense * q[i] * M_PI / 180);
        move = about(a->point, move);
    } else {
        move = shifted(mul((a->on_tool_side ? q[i] : -q[i]) + a->scale * q[i], a->direction));
    }
    frame f = compose(&before, &move);
    return compose(&f, &after);
}

/* Place of what each axis carries, in R. Parents are placed first, whatever the order of the joints:
 * those are X Y Z A B C, while a chain may hang C between X and Y. */
static int order[AXES];
static void place_all(const double *q, frame *of) {
    for (int k = 0; k < w.axes; k++) {
        int i = order[k];
        frame m = axis_motion(i, q);
        of[i] = w.axis[i].parent < 0 ? m : compose(&of[w.axis[i].parent], &m);
    }
}

/* ----------------------------------------------------------------------------------------- distances */

static double max2(double a, double b) { return a > b ? a : b; }
static double min2(double a, double b) { return a < b ? a : b; }

/* Exact signed distance of a point (in the shape's own axes) to the shape: positive outside, faces,
 * edges and corners included. */
static double distance(const shape_t *s, vec p) {
    if (s->is_sphere) return length(p) - s->half.x;
    if (s->is_cylinder) {
        double r = sqrt(p.x * p.x + p.y * p.y) - s->half.x, h = fabs(p.z) - s->half.z;
        double ro = max2(r, 0), ho = max2(h, 0);
        return sqrt(ro * ro + ho * ho) + min2(max2(r, h), 0);
    }
    double x = fabs(p.x) - s->half.x, y = fabs(p.y) - s->half.y, z = fabs(p.z) - s->half.z;
    double xo = max2(x, 0), yo = max2(y, 0), zo = max2(z, 0);
    return sqrt(xo * xo + yo * yo + zo * zo) + min2(max2(x, max2(y, z)), 0);
}

/* Least signed distance along a segment. The shapes are convex, so the distance is convex in the
 * parameter and a golden section finds the least. */
static double segment_distance(const shape_t *s, vec a, vec b) {
    const double g = 0.6180339887498949;
    vec d = sub(b, a);
    double lo = 0, hi = 1, u = 1 - g, v = g;
    double fu = distance(s, add(a, mul(u, d))), fv = distance(s, add(a, mul(v, d)));
    for (int i = 0; i < 45; i++) {
        if (fu <= fv) { hi = v; v = u; fv = fu; u = hi - g * (hi - lo); fu = distance(s, add(a, mul(u, d))); }
        else          { lo = u; u = v; fu = fv; v = lo + g * (hi - lo); fv = distance(s, add(a, mul(v, d))); }
    }
    double f = min2(fu, fv);
    return min2(f, min2(distance(s, a), distance(s, b)));
}

/* Do a flat-ended cylinder (foot a, head b, radius r) and a shape meet? In the shape's own axes; both are
 * convex and their nearest points are simple, so projecting to and fro converges to the closest pair. "No"
 * is certain: a plane between the two was found. Reached only when the capsule around the cylinder already
 * meets the shape. */
static vec clamp_across(vec v, double r) {
    double l = length(v);
    return l > r ? mul(r / l, v) : v;
}
static double clamp(double x, double low, double high) { return x < low ? low : x > high ? high : x; }
static vec nearest_in_shape(const shape_t *s, vec p) {
    if (s->is_sphere) return clamp_across(p, s->half.x);
    double z = clamp(p.z, -s->half.z, s->half.z);
    if (!s->is_cylinder) return V(clamp(p.x, -s->half.x, s->half.x), clamp(p.y, -s->half.y, s->half.y), z);
    return add(clamp_across(V(p.x, p.y, 0), s->half.x), V(0, 0, z));
}
static double reach_of_shape(const shape_t *s, vec d) { /* largest d.x in the shape */
    if (s->is_sphere) return s->half.x * length(d);
    if (s->is_cylinder) return s->half.x * sqrt(d.x * d.x + d.y * d.y) + s->half.z * fabs(d.z);
    return s->half.x * fabs(d.x) + s->half.y * fabs(d.y) + s->half.z * fabs(d.z);
}
static int meet(const shape_t *s, vec a, vec b, double r) {
    double l = length(sub(b, a));
    vec n = mul(1 / l, sub(b, a)), p = mul(0.5, add(a, b)), q, d = V(0, 0, 0);
    for (int i = 0; i < 3000; i++) {
        q = nearest_in_shape(s, p);
        vec v = sub(q, a);
        double h = dot(v, n);
        p = add(add(a, mul(clamp(h, 0, l), n)), clamp_across(sub(v, mul(h, n)), r));
        d = sub(p, q);
        if (dot(d, d) < 1e-12) return 1;
        double least = min2(dot(a, d), dot(b, d)) - r * length(sub(d, mul(dot(d, n), n)));
        if (least > reach_of_shape(s, d)) return 0;
    }
    return 1;                   /* undecided: they graze */
}

/* ------------------------------------------------------------------------------------------- contact */

typedef struct { double gap, ball_gap; int shape; char kind; vec ball; } contact_t; /* kind: b all, s tem, c ollision */

static contact_t contact_at(const double *q) {
    frame at[AXES];
    contact_t c;
    place_all(q, at);
    frame tool = w.tool < 0 ? still() : at[w.tool];
    vec tip = sub(w.ball, mul(longer, w.up));
    vec ball = add(add(turn(&tool.r, tip), tool.t), visit_noise), up = turn(&tool.r, w.up);
    double stem = w.stem_length > 0 ? w.stem_length + longer : 0;
    double radius = w.ball_radius - w.pretravel - touch_noise;
    c.ball = ball;
    c.gap = c.ball_gap = 1e9;
    c.shape = -1;
    c.kind = 'b';
    for (int i = 0; i < w.shapes; i++) {
        const shape_t *s = &w.shape[i];
        vec p = ball, u = up;
        if (s->carrier >= 0) {
            p = turn_back(&at[s->carrier].r, sub(p, at[s->carrier].t));
            u = turn_back(&at[s->carrier].r, u);
        }
        p = turn_back(&s->turn, sub(p, s->centre));
        u = turn_back(&s->turn, u);
        double g = distance(s, p) - radius;
        if (g < c.ball_gap) c.ball_gap = g;
        if (g < c.gap) { c.gap = g; c.shape = i; c.kind = 'b'; }
        if (stem > 0) {
            vec end = add(p, mul(stem, u));
            vec mid = mul(0.5, add(p, end));
            if (length(mid) - stem / 2 - s->reach - w.stem_radius < c.gap) {
                g = segment_distance(s, p, end) - w.stem_radius;
                if (g < c.gap) { c.gap = g; c.shape = i; c.kind = 's'; }
            }
        }
        for (int k = 0; k < w.bodies; k++) {
            const body_t *b = &w.body[k];
            vec foot = add(p, mul(b->from + longer, u)), head = add(p, mul(b->to + longer, u));
            if (length(mul(0.5, add(foot, head))) - (b->to - b->from) / 2 - s->reach - b->radius > 0) continue;
            if (segment_distance(s, foot, head) - b->radius > 0) continue;
            if (meet(s, foot, head, b->radius) && c.gap > -1) { c.gap = -1; c.shape = i; c.kind = 'c'; }
        }
    }
    return c;
}

/* ----------------------------------------------------------------------------------- once per servo cycle */

static void update(void *arg, long period) {
    double now[AXES], fb[AXES];
    (void)arg; (void)period;
    for (int i = 0; i < w.axes; i++) {
        now[i] = *pins->cmd[i] - w.axis[i].origin;
        fb[i] = now[i];
    }
    cycles++;
    longer = *pins->longer;
    if (!started) { memcpy(last, now, sizeof now); started = 1; }

    /* an index visit ends when the rotary axes stand still again: then the next random place is drawn */
    int turns = 0;
    for (int i = 0; i < w.axes; i++)
        if (w.axis[i].rotary && fabs(now[i] - last[i]) > 1e-9) turns = 1;
    if (turning && !turns) { draw_visit(); (*pins->visits)++; }
    turning = turns;

    contact_t c = contact_at(now);
    int hit = c.gap <= 0;
    if (hit != touching) {
        contact_t at = c;
        if (w.edge) {
            /* The ball crossed the trigger point inside this cycle. The joints move straight between two
             * cycles (to within the curvature of 1 ms), so the crossing is bisected on that segment and
             * offered as the feedback of this one cycle, in which motion latches. */
            double lo = 0, hi = 1;
            for (int n = 0; n < 60; n++) {
                double mid = (lo + hi) / 2;
                for (int i = 0; i < w.axes; i++) fb[i] = last[i] + mid * (now[i] - last[i]);
                contact_t m = contact_at(fb);
                if ((m.gap <= 0) == hit) { hi = mid; at = m; } else lo = mid;
            }
            for (int i = 0; i < w.axes; i++) fb[i] = last[i] + hi * (now[i] - last[i]);
        }
        if (hit) {
            (*pins->touches)++;
            if (at.kind == 's') (*pins->stem_touches)++;
            else if (at.kind == 'c') (*pins->collisions)++;
            else if (w.shape[at.shape].is_block) (*pins->block_touches)++;
            else (*pins->solid_touches)++;
            if (at.kind != 'b') *pins->stem_touched = 1;
            if (touches && touch_count < TOUCHES) {
                touch_t *t = &touches[touch_count++];
                memcpy(t->q, fb, sizeof fb);
                t->shape = at.shape;
                t->kind = at.kind;
                t->overtravel = 0;
                t->cycle = cycles;
            }
        } else redraw_due = 1;
    }
    if (hit) {
        /* how far the ball went on past the trigger; of stem and body only the fact is known */
        double depth = c.kind == 'c' ? 0 : -c.gap;
        if (depth > *pins->overtravel_max) *pins->overtravel_max = depth;
        if (touches && touch_count > 0 && depth > touches[touch_count - 1].overtravel)
            touches[touch_count - 1].overtravel = depth;
    } else if (redraw_due && c.gap > redraw_gap) { draw_touch(); redraw_due = 0; }
    touching = hit;

    *pins->contact = hit;
    *pins->gap = c.gap;
    *pins->ball[0] = c.ball.x;
    *pins->ball[1] = c.ball.y;
    *pins->ball[2] = c.ball.z;
    for (int i = 0; i < w.axes; i++) *pins->fb[i] = fb[i] + w.axis[i].origin;
    memcpy(last, now, sizeof now);
}

/* ------------------------------------------------------------------------------------ reading the world */

static int axis_named(const char *s) {
    for (int i = 0; i < w.axes; i++)
        if (s[0] == w.axis[i].letter && !s[1]) return i;
    return -2;
}
/* "base" is -1, an unknown letter -2 */
static int carrier_named(const char *s) { return strcmp(s, "base") ? axis_named(s) : -1; }

static int numbers(char **p, double *out, int n) {
    for (int i = 0; i < n; i++) {
        char *end;
        out[i] = strtod(*p, &end);
        if (end == *p) return 0;
        *p = end;
    }
    return 1;
}
static int word(char **p, char *out, int size) {
    int n = 0, used = 0;
    if (sscanf(*p, "%63s%n", out, &used) != 1 || (int)strlen(out) >= size) return 0;
    n = used;
    *p += n;
    return 1;
}
static vec unit(vec a) { double l = length(a); return l > 0 ? mul(1 / l, a) : V(0, 0, 1); }

/* One statement per line; # starts a comment. Axes must stand in the order of the joints; lines with
 * letters come after the axes.
 *     axis L linear|rotary PARENT workpiece|tool  direction(3) point(3) sense origin
 *     before L dx dy dz a b c         after L ...                  (mm, rad)
 *     scale L value                                                (linear axes)
 *     harmonic L OF dof k cos sin                                  (dof 0..5 = dx dy dz a b c)
 *     reference x y z
 *     tool L ball(3) up(3)            ball_radius r                stem radius length
 *     body from to radius                                          (along `up` from the ball's centre)
 *     box NAME block|solid CARRIER centre(3) size(3)  pivot(3) shift(3) tilt(3)
 *     cylinder NAME solid CARRIER foot(3) direction(3) radius height
 *     sphere NAME block CARRIER centre(3) radius
 *     noise touch visit               seed n      pretravel mm     latch edge|servo     report PATH
 * A displaced box: p' = pivot + shift + Rz(c) Ry(b) Rx(a) (p - pivot).                                    */
static int read_line(char *p) {
    char key[NAME], name[NAME], kind[NAME], parent[NAME], side[NAME];
    double d[24];
    int i;
    if (!word(&p, key, NAME)) return 1;
    if (!strcmp(key, "axis")) {
        axis_t *a = &w.axis[w.axes];
        if (w.axes == AXES || !word(&p, name, NAME) || !word(&p, kind, NAME) || !word(&p, parent, NAME) ||
            !word(&p, side, NAME) || !numbers(&p, d, 8)) return 0;
        memset(a, 0, sizeof *a);
        a->letter = name[0];
        a->rotary = !strcmp(kind, "rotary");
        a->on_tool_side = !strcmp(side, "tool");
        a->direction = unit(V(d[0], d[1], d[2]));
        a->point = V(d[3], d[4], d[5]);
        a->sense = d[6];
        a->origin = d[7];
        a->parent = parent[0] && !parent[1] ? parent[0] : -1;     /* a letter for now: see read_world */
        w.axes++;
        return 1;
    }
    if (!strcmp(key, "before") || !strcmp(key, "after")) {
        if (!word(&p, name, NAME) || (i = axis_named(name)) < 0 || !numbers(&p, d, 6)) return 0;
        memcpy(key[0] == 'b' ? w.axis[i].before : w.axis[i].after, d, 6 * sizeof(double));
        return 1;
    }
    if (!strcmp(key, "scale")) {
        if (!word(&p, name, NAME) || (i = axis_named(name)) < 0 || w.axis[i].rotary || !numbers(&p, d, 1)) return 0;
        w.axis[i].scale = d[0];
        return 1;
    }
    if (!strcmp(key, "harmonic")) {
        harmonic_t *h = &w.harmonic[w.harmonics];
        if (w.harmonics == HARMONICS || !word(&p, name, NAME) || (h->axis = axis_named(name)) < 0 ||
            !word(&p, kind, NAME) || (h->of = axis_named(kind)) < 0 || !numbers(&p, d, 4)) return 0;
        h->dof = (int)d[0];
        h->k = (int)d[1];
        h->c = d[2];
        h->s = d[3];
        w.harmonics++;
        return h->dof >= 0 && h->dof < 6;
    }
    if (!strcmp(key, "reference")) { if (!numbers(&p, d, 3)) return 0; w.reference = V(d[0], d[1], d[2]); return 1; }
    if (!strcmp(key, "tool")) {
        if (!word(&p, name, NAME) || (w.tool = carrier_named(name)) < -1 || !numbers(&p, d, 6)) return 0;
        w.ball = V(d[0], d[1], d[2]);
        w.up = unit(V(d[3], d[4], d[5]));
        return 1;
    }
    if (!strcmp(key, "ball_radius")) return numbers(&p, &w.ball_radius, 1);
    if (!strcmp(key, "pretravel")) return numbers(&p, &w.pretravel, 1);
    if (!strcmp(key, "stem")) return numbers(&p, &w.stem_radius, 1) && numbers(&p, &w.stem_length, 1);
    if (!strcmp(key, "noise")) return numbers(&p, &w.touch_sigma, 1) && numbers(&p, &w.visit_sigma, 1);
    if (!strcmp(key, "seed")) { w.seed = strtoull(p, NULL, 10); return 1; }
    if (!strcmp(key, "latch")) { if (!word(&p, name, NAME)) return 0; w.edge = !strcmp(name, "edge"); return 1; }
    if (!strcmp(key, "report")) return sscanf(p, " %511[^\n]", w.report) == 1;
    if (!strcmp(key, "body")) {
        body_t *b = &w.body[w.bodies];
        if (w.bodies == BODIES || !numbers(&p, d, 3)) return 0;
        b->from = d[0]; b->to = d[1]; b->radius = d[2];
        w.bodies++;
        return 1;
    }
    if (!strcmp(key, "box") || !strcmp(key, "cylinder") || !strcmp(key, "sphere")) {
        shape_t *s = &w.shape[w.shapes];
        if (w.shapes == SHAPES || !word(&p, s->name, NAME) || !word(&p, kind, NAME) || !word(&p, parent, NAME) ||
            (s->carrier = carrier_named(parent)) < -1) return 0;
        s->is_block = !strcmp(kind, "block");
        s->is_cylinder = key[0] == 'c';
        s->is_sphere = key[0] == 's';
        if (s->is_sphere) {
            double none[6] = {0, 0, 0, 0, 0, 0};
            if (!numbers(&p, d, 4)) return 0;
            s->turn = error_frame(none).r;
            s->centre = V(d[0], d[1], d[2]);
            s->half = V(d[3], d[3], d[3]);
            s->reach = d[3];
        } else if (s->is_cylinder) {
            if (!numbers(&p, d, 8)) return 0;
            vec z = unit(V(d[3], d[4], d[5]));
            vec x = unit(fabs(z.x) < 0.9 ? cross(z, V(1, 0, 0)) : cross(z, V(0, 1, 0))), y = cross(z, x);
            rot r = {{{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}}};
            s->turn = r;
            s->centre = add(V(d[0], d[1], d[2]), mul(d[7] / 2, z));
            s->half = V(d[6], d[6], d[7] / 2);
            s->reach = sqrt(d[6] * d[6] + d[7] * d[7] / 4);
        } else {
            if (!numbers(&p, d, 15)) return 0;
            double e[6] = {0, 0, 0, d[12], d[13], d[14]};
            vec pivot = V(d[6], d[7], d[8]);
            s->turn = error_frame(e).r;
            s->centre = add(add(pivot, V(d[9], d[10], d[11])), turn(&s->turn, sub(V(d[0], d[1], d[2]), pivot)));
            s->half = V(d[3] / 2, d[4] / 2, d[5] / 2);
            s->reach = length(s->half);
        }
        w.shapes++;
        return 1;
    }
    return 0;
}

static int read_world(const char *path) {
    char line[1024];
    int number = 0;
    FILE *f = fopen(path, "r");
    if (!f) { rtapi_print_msg(RTAPI_MSG_ERR, "probe: cannot open world file '%s'\n", path); return -1; }
    w.edge = 1;
    w.seed = 1;
    w.tool = -1;
    while (fgets(line, sizeof line, f)) {
        number++;
        char *hash = strchr(line, '#');
        if (hash) *hash = 0;
        if (!read_line(line)) {
            rtapi_print_msg(RTAPI_MSG_ERR, "probe: %s line %d is not understood: %s\n", path, number, line);
            fclose(f);
            return -1;
        }
    }
    fclose(f);
    /* letters of the parents -> indices */
    for (int i = 0; i < w.axes; i++) {
        if (w.axis[i].parent < 0) continue;
        char name[2] = {(char)w.axis[i].parent, 0};
        if ((w.axis[i].parent = axis_named(name)) < 0) {
            rtapi_print_msg(RTAPI_MSG_ERR, "probe: axis %c hangs on unknown %s\n", w.axis[i].letter, name);
            return -1;
        }
    }
    return w.axes > 0 ? 0 : -1;
}

/* Parents first. */
static int sort_chain(void) {
    int placed[AXES] = {0}, n = 0;
    for (int round = 0; round < w.axes; round++)
        for (int i = 0; i < w.axes; i++)
            if (!placed[i] && (w.axis[i].parent < 0 || placed[w.axis[i].parent])) { placed[i] = 1; order[n++] = i; }
    return n == w.axes ? 0 : -1;
}

/* --------------------------------------------------------------------------------------------- life */

static void write_report(void) {
    FILE *f;
    if (!w.report[0] || !(f = fopen(w.report, "w"))) return;
    fprintf(f, "n,cycle,kind,what,overtravel_mm");
    for (int i = 0; i < w.axes; i++) fprintf(f, ",%c", w.axis[i].letter);
    fprintf(f, "\n");
    for (int k = 0; k < touch_count; k++) {
        const touch_t *t = &touches[k];
        fprintf(f, "%d,%u,%s,%s,%.6f", k + 1, t->cycle, t->kind == 'b' ? "ball" : t->kind == 's' ? "stem" : "collision",
                t->shape >= 0 ? w.shape[t->shape].name : "", t->overtravel);
        for (int i = 0; i < w.axes; i++) fprintf(f, ",%.9f", t->q[i]);
        fprintf(f, "\n");
    }
    fclose(f);
}

int rtapi_app_main(void) {
    comp_id = hal_init("probe");
    if (comp_id < 0) return comp_id;
    if (read_world(world) || sort_chain()) goto fail;
    random_state = w.seed;
    redraw_gap = max2(0.05, 10 * w.touch_sigma);
    draw_touch();
    draw_visit();
    touches = calloc(TOUCHES, sizeof *touches);
    pins = hal_malloc(sizeof *pins);
    if (!pins) goto fail;
    for (int i = 0; i < w.axes; i++)
        if (hal_pin_float_newf(HAL_IN, &pins->cmd[i], comp_id, "probe.%d.motor-pos-cmd", i) ||
            hal_pin_float_newf(HAL_OUT, &pins->fb[i], comp_id, "probe.%d.motor-pos-fb", i)) goto fail;
    if (hal_pin_bit_newf(HAL_OUT, &pins->contact, comp_id, "probe.contact") ||
        hal_pin_bit_newf(HAL_OUT, &pins->stem_touched, comp_id, "probe.stem-touched") ||
        hal_pin_u32_newf(HAL_OUT, &pins->touches, comp_id, "probe.touches") ||
        hal_pin_u32_newf(HAL_OUT, &pins->block_touches, comp_id, "probe.block-touches") ||
        hal_pin_u32_newf(HAL_OUT, &pins->solid_touches, comp_id, "probe.solid-touches") ||
        hal_pin_u32_newf(HAL_OUT, &pins->stem_touches, comp_id, "probe.stem-touches") ||
        hal_pin_u32_newf(HAL_OUT, &pins->collisions, comp_id, "probe.collisions") ||
        hal_pin_u32_newf(HAL_OUT, &pins->visits, comp_id, "probe.visits") ||
        hal_pin_float_newf(HAL_OUT, &pins->overtravel_max, comp_id, "probe.overtravel-max") ||
        hal_pin_float_newf(HAL_OUT, &pins->gap, comp_id, "probe.gap") ||
        hal_pin_float_newf(HAL_IN, &pins->longer, comp_id, "probe.longer") ||
        hal_pin_float_newf(HAL_OUT, &pins->ball[0], comp_id, "probe.ball-x") ||
        hal_pin_float_newf(HAL_OUT, &pins->ball[1], comp_id, "probe.ball-y") ||
        hal_pin_float_newf(HAL_OUT, &pins->ball[2], comp_id, "probe.ball-z")) goto fail;
    if (hal_export_funct("probe", update, NULL, 1, 0, comp_id)) goto fail;
    return hal_ready(comp_id) ? -1 : 0;
fail:
    hal_exit(comp_id);
    return -1;
}

void rtapi_app_exit(void) {
    write_report();
    free(touches);
    hal_exit(comp_id);
}
