/* Attachments: ties between nodes of one body and faces of another, which give way (Camacho, Ortiz, Computational
modelling of impact damage in brittle materials, Int. J. Solids Struct. 33, 1996).

A tie bears any push, and a pull or shear up to its strength. Pulled harder it opens, and the farther it has been
opened the less it bears: nothing at twice its work over its strength. Below its widest opening it bears in proportion
to its opening. So the work of separation is the work of the tie. Impulses by projected Gauss and Seidel, as in
`_touch.c`: any sub-step will do. Work is taken and none given back, but for the recovery of an opening.
*/

#include "_solid.h"
#include "_vectors.h"

#define ITERATIONS 8   /* at most */
#define SETTLED 1e-5   /* square of a pass's impulses over those of the first: enough */
#define RECOVERY 0.2   /* share of an opening that is undone in a sub-step */
#define FASTEST 0.1    /* m/s: of the recovery */
#define AT_LIMIT 0.999
#define INTACT 0.05    /* of the last opening: below, an opening is the play of the method */

typedef struct {
    const Body *body, *other;
    int32_t node;
    const int32_t *face; /* nodes */
    double mass, normal[3], open[3], opening, most, pushed[3];
} Tie;

struct Attach {
    int count;
    Body *const *body;
    const double *middle;  /* (bodies, 3): origins of their frames */
    const int32_t *place;  /* (count, 4): body, element times 4 plus corner, other body, slot of its face */
    const double *rest;    /* (count, 6): shares of the face's nodes; from there to the node, in the frame of the face */
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
    return 1;
}

/* Mark the nodes of whole ties: between them there is no contact. */
void begin_attach(Attach *attach, int bodies)
{
    memset(attach->force, 0, sizeof(double) * 3 * (size_t)attach->count);
    for (int b = 0; b < bodies; b++)
        for (int i = 0; i < attach->body[b]->nodes; i++)
            attach->body[b]->flags[i] &= (uint8_t)~TIED;
    for (int k = 0; k < attach->count; k++)
        if (find_nodes(attach, k)) {
            const Tie *tie = attach->tie + k;
            tie->body->flags[tie->node] |= TIED;
            for (int a = 0; a < 3; a++)
                tie->other->flags[tie->face[a]] |= TIED;
        }
}

static void place_of(const Attach *attach, int body, int32_t node, double x[3])
{
    const Body *own = attach->body[body];
    for (int i = 0; i < 3; i++)
        x[i] = attach->middle[3 * body + i] + (double)own->rest[4 * node + i] + (double)own->displacement[4 * node + i];
}

/* Opening and strength of a tie now; return 0 for one that bears nothing. */
static int open_tie(const Attach *attach, int k, double seconds)
{
    const int32_t *place = attach->place + 4 * k;
    const double *rest = attach->rest + 6 * k;
    Tie *tie = attach->tie + k;
    double corner[3][3], x[3], u[3], v[3], w[3], inverse;
    if (!find_nodes(attach, k))
        return 0;
    place_of(attach, place[0], tie->node, x);
    for (int a = 0; a < 3; a++)
        place_of(attach, place[2], tie->face[a], corner[a]);
    for (int i = 0; i < 3; i++)
        u[i] = corner[1][i] - corner[0][i], v[i] = corner[2][i] - corner[0][i];
    cross(u, v, tie->normal);
    if (!normalise(tie->normal) || !normalise(u))
        return 0;
    cross(tie->normal, u, w);
    for (int i = 0; i < 3; i++)
        tie->open[i] = x[i] - rest[0] * corner[0][i] - rest[1] * corner[1][i] - rest[2] * corner[2][i] -
                       (rest[3] * u[i] + rest[4] * w[i] + rest[5] * tie->normal[i]);
    double push = dot(tie->open, tie->normal);
    tie->opening = sqrt(fmax(0.0, dot(tie->open, tie->open) - (push < 0.0 ? push * push : 0.0)));
    inverse = (double)tie->body->inverse_mass[tie->node];
    for (int a = 0; a < 3; a++)
        inverse += rest[a] * rest[a] * (double)tie->other->inverse_mass[tie->face[a]];
    tie->mass = inverse > 0.0 ? 1.0 / inverse : 0.0;
    double last = attach->law[2 * k + 1], widest = attach->widest[k], bears = 1.0 - widest / last;
    if (widest > INTACT * last && tie->opening < widest)
        bears *= tie->opening / widest;
    tie->most = seconds * attach->law[2 * k] * bears;
    memset(tie->pushed, 0, sizeof tie->pushed);
    return 1;
}

/* Size of the pull and shear in an impulse; a push along the normal is none. */
static double pull_of(const Tie *tie, const double impulse[3])
{
    double along = dot(impulse, tie->normal), square = dot(impulse, impulse) - (along > 0.0 ? along * along : 0.0);
    return sqrt(square > 0.0 ? square : 0.0);
}

/* Change the velocities of node and face towards no opening; return the square of the impulse. */
static double resolve(const Attach *attach, int k, double seconds)
{
    const double *rest = attach->rest + 6 * k;
    Tie *tie = attach->tie + k;
    float *velocity = tie->body->velocity + 4 * tie->node;
    double wanted[3], change[3], size = sqrt(dot(tie->open, tie->open));
    double rate = RECOVERY / seconds * size > FASTEST ? FASTEST / size : RECOVERY / seconds;
    for (int i = 0; i < 3; i++) {
        double apart = (double)velocity[i];
        for (int a = 0; a < 3; a++)
            apart -= rest[a] * (double)tie->other->velocity[4 * tie->face[a] + i];
        wanted[i] = tie->pushed[i] - tie->mass * (rate * tie->open[i] + apart);
    }
    double along = dot(wanted, tie->normal), push = along > 0.0 ? along : 0.0, pull = pull_of(tie, wanted);
    double kept = pull > tie->most ? tie->most / pull : 1.0;
    for (int i = 0; i < 3; i++) {
        double impulse = push * tie->normal[i] + kept * (wanted[i] - push * tie->normal[i]);
        change[i] = impulse - tie->pushed[i];
        tie->pushed[i] = impulse;
        velocity[i] = (float)((double)velocity[i] + (double)tie->body->inverse_mass[tie->node] * change[i]);
        for (int a = 0; a < 3; a++) {
            float *against = tie->other->velocity + 4 * tie->face[a] + i;
            double inverse = (double)tie->other->inverse_mass[tie->face[a]];
            *against = (float)((double)*against - rest[a] * inverse * change[i]);
        }
    }
    return dot(change, change);
}

/* Hold the bodies together in a sub-step, a `share` of the step. */
void hold_together(Attach *attach, double seconds, double share)
{
    double first = 0.0, change = INFINITY;
    for (int k = 0; k < attach->count; k++)
        if (!open_tie(attach, k, seconds))
            attach->tie[k].mass = 0.0;
    for (int pass = 0; pass < ITERATIONS && change > SETTLED * first; pass++) {
        change = 0.0;
        for (int k = 0; k < attach->count; k++)
            change += attach->tie[k].mass > 0.0 ? resolve(attach, k, seconds) : 0.0;
        first = pass ? first : change;
    }
    for (int k = 0; k < attach->count; k++) {
        const Tie *tie = attach->tie + k;
        if (tie->mass == 0.0)
            continue;
        if (tie->opening > attach->widest[k] && pull_of(tie, tie->pushed) >= AT_LIMIT * tie->most)
            attach->widest[k] = tie->opening < attach->law[2 * k + 1] ? tie->opening : INFINITY;
        for (int i = 0; i < 3; i++)
            attach->force[3 * k + i] += share * tie->pushed[i] / seconds;
    }
}
