/* Attachments: ties between nodes of one body and faces of another, which give way (Camacho, Ortiz, Computational
modelling of impact damage in brittle materials, Int. J. Solids Struct. 33, 1996).

A tie bears any push, and a pull or shear up to its strength. Pulled harder it opens, and the farther it has been
opened the less it bears: nothing at twice its work over its strength. Below its widest opening it bears in proportion
to its opening. So the work of separation is the work of the tie. Impulses by projected Gauss and Seidel, as in
`_touch.c`: any sub-step will do. Work is taken and none given back, but for the recovery of an opening.

Where an instrument holds nodes of both sides, a push is borne by the instrument: what is left of the face would move by
the push over its share, which may be small.

Where one of two bodies pushes every so many sub-steps, its push comes in one of them: strength bounds the impulse of a
tie over all of these, its cycle.
*/

#include "_solid.h"
#include "_vectors.h"

#define ITERATIONS 8   /* at most */
#define SETTLED 1e-5   /* square of a pass's impulses over those of the first: enough */
#define RECOVERY 0.01  /* s: time in which an opening is undone; its speed is energy that was not there before */
#define AT_LIMIT 0.999
#define INTACT 0.05    /* of the last opening: below, an opening is the play of the method */

typedef struct {
    const Body *body, *other;
    int32_t node;
    const int32_t *face; /* nodes */
    int cycle; /* sub-steps */
    int is_there;   /* in this step: it has not parted, and its tissue is there */
    int is_whole;
    int is_clamped; /* nodes of both sides cannot move, as an instrument holds them */
    float *velocity, *against[3]; /* of the node, and of the nodes of the face */
    double own, its[3]; /* inverse masses of these */
    double normal[3], turn[3][3]; /* how a motion of each node of the face along the normal turns the normal */
    double mass[9], open[3], recovery[3], opening, most, pushed[3];
} Tie;

struct Attach {
    int count;
    Body *const *body;
    const double *middle;  /* (bodies, 3): origins of their frames */
    const int32_t *place;  /* (count, 4): body, element times 4 plus corner, other body, slot of its face */
    const double *rest;    /* (count, 4): shares of the face's nodes; from there to the node, along the normal */
    const double *law;     /* (count, 2): strength, N; opening at which the tie bears nothing, m */
    double *widest;        /* (count,): opening, m; infinite: has parted */
    double *force;         /* (count, 3): mean force on the node in a step, N */
    Tie *tie;
};

Attach *new_attach(int count, Body *const *body, const double *middle, const int32_t *place, const double *rest,
                   const double *law, double *widest, double *force)
{
    Attach *attach = PyMem_RawCalloc(1, sizeof(Attach));
    if (attach == NULL)
        return NULL;
    *attach = (Attach){count, body, middle, place, rest, law, widest, force, NULL};
    attach->tie = PyMem_RawCalloc((size_t)count + 1, sizeof(Tie));
    if (attach->tie == NULL) {
        PyMem_RawFree(attach);
        return NULL;
    }
    return attach;
}

void free_attach(Attach *attach)
{
    if (attach == NULL)
        return;
    PyMem_RawFree(attach->tie);
    PyMem_RawFree(attach);
}

/* Find the nodes of a tie; return 0 for one that has parted, or whose tissue has gone. */
static int find_nodes(const Attach *attach, int k)
{
    const int32_t *place = attach->place + 4 * k;
    Tie *tie = attach->tie + k;
    tie->body = attach->body[place[0]], tie->other = attach->body[place[2]];
    tie->face = tie->other->surface + 3 * place[3];
    if (isinf(attach->widest[k]) || is_gone(tie->body, place[1] / 4) || tie->face[0] < 0) {
        attach->widest[k] = INFINITY;
        return 0;
    }
    tie->node = *corner_of(tie->body, place[1] / 4, place[1] % 4);
    tie->velocity = tie->body->velocity + 4 * tie->node, tie->own = (double)tie->body->inverse_mass[tie->node];
    for (int a = 0; a < 3; a++) {
        tie->against[a] = tie->other->velocity + 4 * tie->face[a];
        tie->its[a] = (double)tie->other->inverse_mass[tie->face[a]];
    }
    return 1;
}

/* Whether neither the node nor all of the face can move, and an instrument holds some of them. */
static int is_clamped(const Tie *tie)
{
    int held = tie->body->holder[tie->node] >= 0, still = 0;
    for (int a = 0; a < 3; a++) {
        still |= tie->other->inverse_mass[tie->face[a]] == 0.0f;
        held |= tie->other->holder[tie->face[a]] >= 0;
    }
    return held && still && tie->body->inverse_mass[tie->node] == 0.0f;
}

/* Find the nodes of whole ties, which stay the same in a step, and mark them: between them there is no contact. */
void begin_attach(Attach *attach, int bodies)
{
    memset(attach->force, 0, sizeof(double) * 3 * (size_t)attach->count);
    for (int b = 0; b < bodies; b++)
        for (int i = 0; i < attach->body[b]->nodes; i++)
            attach->body[b]->flags[i] &= (uint8_t)~TIED;
    for (int k = 0; k < attach->count; k++) {
        Tie *tie = attach->tie + k;
        tie->is_there = find_nodes(attach, k);
        if (tie->is_there) {
            tie->is_clamped = is_clamped(tie);
            tie->body->flags[tie->node] |= TIED;
            for (int a = 0; a < 3; a++)
                tie->other->flags[tie->face[a]] |= TIED;
            tie->cycle = tie->body->every > tie->other->every ? tie->body->every : tie->other->every;
        }
    }
}

static void place_of(const Attach *attach, int body, int32_t node, double x[3])
{
    const Body *own = attach->body[body];
    for (int i = 0; i < 3; i++)
        x[i] = attach->middle[3 * body + i] + (double)own->rest[4 * node + i] + (double)own->displacement[4 * node + i];
}

/* Invert a symmetric matrix; return 0 for one that is singular. */
static int invert(const double m[9], double out[9])
{
    double a = m[4] * m[8] - m[5] * m[5], b = m[2] * m[5] - m[1] * m[8], c = m[1] * m[5] - m[2] * m[4];
    double whole = m[0] * a + m[1] * b + m[2] * c;
    if (!(whole > 0.0))
        return 0;
    out[0] = a / whole, out[1] = out[3] = b / whole, out[2] = out[6] = c / whole;
    out[4] = (m[0] * m[8] - m[2] * m[2]) / whole, out[5] = out[7] = (m[1] * m[2] - m[0] * m[5]) / whole;
    out[8] = (m[0] * m[4] - m[1] * m[1]) / whole;
    return 1;
}

/* Set how the normal of a face turns, and the mass of a tie: a shear across a gap turns the face as well. */
static int weigh(Tie *tie, const double *rest, double corner[3][3], double twice)
{
    double inverse[9] = {0.0};
    inverse[0] = inverse[4] = inverse[8] = tie->own;
    for (int a = 0; a < 3; a++) {
        double edge[3], its = tie->its[a], *turn = tie->turn[a];
        for (int i = 0; i < 3; i++)
            edge[i] = (corner[(a + 2) % 3][i] - corner[(a + 1) % 3][i]) / twice;
        cross(tie->normal, edge, turn);
        for (int i = 0; i < 3; i++)
            turn[i] *= rest[3];
        for (int i = 0; i < 3; i++)
            for (int j = i; j < 3; j++) /* `invert` reads no more */
                inverse[3 * i + j] += its * ((i == j ? rest[a] * rest[a] : 0.0) + turn[i] * turn[j] -
                                             rest[a] * (turn[i] * tie->normal[j] + tie->normal[i] * turn[j]));
    }
    return invert(inverse, tie->mass);
}

/* Opening and strength of a tie now; return 0 for one that bears nothing. */
static int open_tie(const Attach *attach, int k, double seconds)
{
    const int32_t *place = attach->place + 4 * k;
    const double *rest = attach->rest + 4 * k;
    Tie *tie = attach->tie + k;
    double corner[3][3], x[3], u[3], v[3];
    if (!tie->is_there || isinf(attach->widest[k]))
        return 0;
    place_of(attach, place[0], tie->node, x);
    for (int a = 0; a < 3; a++)
        place_of(attach, place[2], tie->face[a], corner[a]);
    for (int i = 0; i < 3; i++)
        u[i] = corner[1][i] - corner[0][i], v[i] = corner[2][i] - corner[0][i];
    cross(u, v, tie->normal);
    double twice = sqrt(dot(tie->normal, tie->normal));
    if (!normalise(tie->normal) || !weigh(tie, rest, corner, twice))
        return 0;
    for (int i = 0; i < 3; i++)
        tie->open[i] = x[i] - rest[0] * corner[0][i] - rest[1] * corner[1][i] - rest[2] * corner[2][i] -
                       rest[3] * tie->normal[i];
    for (int i = 0; i < 3; i++)
        tie->recovery[i] = tie->open[i] / RECOVERY;
    double push = dot(tie->open, tie->normal);
    tie->opening = sqrt(fmax(0.0, dot(tie->open, tie->open) - (push < 0.0 ? push * push : 0.0)));
    double last = attach->law[2 * k + 1], widest = attach->widest[k], bears = 1.0 - widest / last;
    if (widest > INTACT * last && tie->opening < widest)
        bears *= tie->opening / widest;
    tie->most = seconds * tie->cycle * attach->law[2 * k] * bears;
    return 1;
}

/* Size of the pull and shear in an impulse; a push along the normal is none. */
static double pull_of(const Tie *tie, const double impulse[3])
{
    double along = dot(impulse, tie->normal), square = dot(impulse, impulse) - (along > 0.0 ? along * along : 0.0);
    return sqrt(square > 0.0 ? square : 0.0);
}

/* Speed at which a tie opens. */
static void opening_speed(const Tie *tie, const double *rest, double speed[3])
{
    for (int i = 0; i < 3; i++)
        speed[i] = (double)tie->velocity[i];
    for (int a = 0; a < 3; a++) {
        const float *v = tie->against[a];
        double along = (double)v[0] * tie->normal[0] + (double)v[1] * tie->normal[1] + (double)v[2] * tie->normal[2];
        for (int i = 0; i < 3; i++)
            speed[i] += along * tie->turn[a][i] - rest[a] * (double)v[i];
    }
}

/* Change the velocities by an impulse on the node, and against it on the face. */
static void strike(const Tie *tie, const double *rest, const double impulse[3])
{
    for (int i = 0; i < 3; i++)
        tie->velocity[i] = (float)((double)tie->velocity[i] + tie->own * impulse[i]);
    for (int a = 0; a < 3; a++) {
        float *against = tie->against[a];
        double its = tie->its[a], turning = dot(tie->turn[a], impulse);
        for (int i = 0; i < 3; i++)
            against[i] = (float)((double)against[i] + its * (turning * tie->normal[i] - rest[a] * impulse[i]));
    }
}

/* Change the velocities of node and face towards no opening; return the square of the impulse. */
static double resolve(const Attach *attach, int k)
{
    const double *rest = attach->rest + 4 * k;
    Tie *tie = attach->tie + k;
    double wanted[3], change[3], speed[3];
    opening_speed(tie, rest, speed);
    for (int i = 0; i < 3; i++)
        speed[i] += tie->recovery[i];
    for (int i = 0; i < 3; i++)
        wanted[i] = tie->pushed[i] - dot(tie->mass + 3 * i, speed);
    double along = dot(wanted, tie->normal), push = along > 0.0 ? along : 0.0, pull = pull_of(tie, wanted);
    double kept = pull > tie->most ? tie->most / pull : 1.0;
    for (int i = 0; i < 3; i++) {
        double along_normal = push * tie->normal[i];
        double impulse = (tie->is_clamped ? 0.0 : along_normal) + kept * (wanted[i] - along_normal);
        change[i] = impulse - tie->pushed[i];
        tie->pushed[i] = impulse;
    }
    strike(tie, rest, change);
    return dot(change, change);
}

/* Hold the bodies together in a sub-step, a `share` of the step. */
void hold_together(Attach *attach, int sub_step, double seconds, double share)
{
    double first = 0.0, change = INFINITY;
    for (int k = 0; k < attach->count; k++) {
        Tie *tie = attach->tie + k;
        tie->is_whole = open_tie(attach, k, seconds);
        if (!tie->is_whole)
            continue;
        if (sub_step % tie->cycle == 0)
            memset(tie->pushed, 0, sizeof tie->pushed);
    }
    for (int pass = 0; pass < ITERATIONS && change > SETTLED * first; pass++) {
        change = 0.0;
        for (int k = 0; k < attach->count; k++)
            change += attach->tie[k].is_whole ? resolve(attach, k) : 0.0;
        first = pass ? first : change;
    }
    for (int k = 0; k < attach->count; k++) {
        const Tie *tie = attach->tie + k;
        if (!tie->is_whole || (sub_step + 1) % tie->cycle)
            continue;
        if (tie->opening > attach->widest[k] && pull_of(tie, tie->pushed) >= AT_LIMIT * tie->most)
            attach->widest[k] = tie->opening < attach->law[2 * k + 1] ? tie->opening : INFINITY;
        for (int i = 0; i < 3; i++)
            attach->force[3 * k + i] += share * tie->pushed[i] / seconds;
    }
}
