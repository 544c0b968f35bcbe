/* Spheres against the faces of a body: no face enters a sphere, with Coulomb friction.

Impulses at the points of the faces that are nearest to the centre, by projected Gauss and Seidel (Moreau, Numerical
aspects of the sweeping process, Comput. Methods Appl. Mech. Eng. 177, 1999). A sphere moves as told, whatever the
force. A sphere has one contact for each nearest point; faces that share the point share the contact.
*/

#include "_solid.h"
#include "_triangle.h"

#define AHEAD 1e-3f     /* of the surface, m: contacts that may close within a step */
#define ITERATIONS 6
#define RECOVERY 0.2f   /* share of a penetration that is undone in a sub-step */
#define SAME_POINT 1e-7f /* m */
#define DEEPEST 0.5f     /* of a centre behind a face, in radii */
#define LEVER 0.2f       /* share of the free nodes in a contact beside a held node below which the push no longer grows */

typedef struct {
    const int32_t *node; /* three */
    float share[3], point[3], normal[3], gap, mass, pushed, rubbed[3];
} Contact;

static inline void position(const Body *body, int32_t node, float x[3])
{
    for (int i = 0; i < 3; i++)
        x[i] = body->rest[4 * node + i] + body->displacement[4 * node + i];
}

/* The box that a sphere may touch within a step. */
static void sweep_box(const Spheres *spheres, int sphere, int sub_steps, float low[3], float high[3])
{
    for (int i = 0; i < 3; i++) {
        double least = INFINITY, largest = -INFINITY;
        for (int k = 0; k <= sub_steps; k++) {
            double x = spheres->path[3 * (k * spheres->count + sphere) + i];
            least = x < least ? x : least, largest = x > largest ? x : largest;
        }
        float reach = (float)spheres->radius[sphere] + 2.0f * AHEAD;
        low[i] = (float)least - reach, high[i] = (float)largest + reach;
    }
}

/* The box around all nodes. */
static void body_box(const Body *body, float low[3], float high[3])
{
    low[0] = low[1] = low[2] = INFINITY, high[0] = high[1] = high[2] = -INFINITY;
    for (int n = 0; n < body->nodes; n++) {
        float x[3];
        position(body, n, x);
        for (int i = 0; i < 3; i++)
            low[i] = x[i] < low[i] ? x[i] : low[i], high[i] = x[i] > high[i] ? x[i] : high[i];
    }
}

/* Write the lower and upper ends of each face, (6, faces); those of a face that has gone are beyond all boxes. */
static void face_boxes(const Body *body, float *ends)
{
    for (int t = 0; t < body->faces; t++) {
        const int32_t *node = body->surface + 3 * t;
        float low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
        for (int a = 0; a < 3 && node[0] >= 0; a++) {
            float x[3];
            position(body, node[a], x);
            for (int i = 0; i < 3; i++)
                low[i] = x[i] < low[i] ? x[i] : low[i], high[i] = x[i] > high[i] ? x[i] : high[i];
        }
        for (int i = 0; i < 3; i++)
            ends[i * body->faces + t] = low[i], ends[(3 + i) * body->faces + t] = high[i];
    }
}

/* Write the faces whose boxes meet a box, after their number. */
static void meet_box(const Body *body, const float *ends, const float low[3], const float high[3], int *near)
{
    int found = 0, faces = body->faces;
    const float *least = ends, *most = ends + 3 * faces;
    for (int t = 0; t < faces; t++) {
        near[1 + found] = t;
        found += (least[t] <= high[0]) & (most[t] >= low[0]) & (least[faces + t] <= high[1]) &
                 (most[faces + t] >= low[1]) & (least[2 * faces + t] <= high[2]) & (most[2 * faces + t] >= low[2]);
    }
    near[0] = found;
}

/* Write for each sphere the faces that it may touch within a step, after their number, `room` apart; return -1 without
memory. */
int find_all_near(const Body *body, const Spheres *spheres, int sub_steps, int *near, int room)
{
    float bottom[3], top[3], *ends = NULL;
    body_box(body, bottom, top);
    for (int s = 0; s < spheres->count; s++) {
        float low[3], high[3];
        int meets = spheres->free[s];
        sweep_box(spheres, s, sub_steps, low, high);
        for (int i = 0; i < 3; i++)
            meets &= bottom[i] <= high[i] && top[i] >= low[i];
        near[room * s] = 0;
        if (!meets)
            continue;
        if (ends == NULL) {
            ends = PyMem_RawMalloc(sizeof(float) * 6 * (size_t)(body->faces + 1));
            if (ends == NULL)
                return -1;
            face_boxes(body, ends);
        }
        meet_box(body, ends, low, high, near + room * s);
    }
    PyMem_RawFree(ends);
    return 0;
}

/* Fill in the contact of a face with a sphere at `centre`; return whether there is one. */
static int touch(const Body *body, const int32_t *node, const double *centre, float radius, Contact *contact)
{
    float x[3][3], normal[3], away[3], inverse = 0.0f, lightest = 0.0f;
    int has_held = 0;
    for (int a = 0; a < 3; a++)
        for (int i = 0; i < 3; i++)
            x[a][i] = (float)((double)body->rest[4 * node[a] + i] - centre[i]) + body->displacement[4 * node[a] + i];
    nearest(x[0], x[1], x[2], contact->share);
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        normal[i] = (x[1][j] - x[0][j]) * (x[2][k] - x[0][k]) - (x[1][k] - x[0][k]) * (x[2][j] - x[0][j]);
        away[i] = contact->share[0] * x[0][i] + contact->share[1] * x[1][i] + contact->share[2] * x[2][i];
        contact->point[i] = away[i];
    }
    float distance = sqrtf(dotf(away, away));
    if (!(distance < radius + AHEAD) || distance < SAME_POINT)
        return 0;
    float side = dotf(away, normal) > 0.0f ? -1.0f : 1.0f; /* -1: the centre is behind the face */
    if (side < 0.0f && distance > DEEPEST * radius)
        return 0; /* a face of the far side */
    for (int a = 0; a < 3; a++) {
        float free = body->inverse_mass[node[a]];
        inverse += contact->share[a] * contact->share[a] * free;
        lightest = free > lightest ? free : lightest, has_held |= free == 0.0f;
    }
    if (inverse <= 0.0f)
        return 0;
    if (has_held && inverse < LEVER * LEVER * lightest)
        inverse = LEVER * LEVER * lightest; /* beside a held node no push on the others stops a sphere */
    contact->node = node;
    for (int i = 0; i < 3; i++)
        contact->normal[i] = side * away[i] / distance; /* out of the sphere */
    contact->gap = side * distance - radius;
    contact->mass = 1.0f / inverse;
    contact->pushed = 0.0f;
    memset(contact->rubbed, 0, sizeof contact->rubbed);
    return 1;
}

static int is_known(const Contact *contacts, int count, const Contact *other)
{
    for (int k = 0; k < count; k++) {
        float apart[3];
        for (int i = 0; i < 3; i++)
            apart[i] = contacts[k].point[i] - other->point[i];
        if (dotf(apart, apart) < SAME_POINT * SAME_POINT)
            return 1;
    }
    return 0;
}

/* Change the velocities of a contact's nodes towards no approach; keep normal and friction within their cone. */
static void resolve(const Body *body, Contact *contact, const float moving[3], float seconds, float friction)
{
    const int32_t *node = contact->node;
    float apart[3], impulse[3], rub[3];
    for (int i = 0; i < 3; i++) {
        apart[i] = -moving[i];
        for (int a = 0; a < 3; a++)
            apart[i] += contact->share[a] * body->velocity[4 * node[a] + i];
    }
    float along = dotf(apart, contact->normal);
    float least = contact->gap > 0.0f ? -contact->gap / seconds : -RECOVERY * contact->gap / seconds;
    float pushed = contact->pushed + (least - along) * contact->mass;
    pushed = pushed > 0.0f ? pushed : 0.0f;
    for (int i = 0; i < 3; i++)
        rub[i] = contact->rubbed[i] - contact->mass * (apart[i] - along * contact->normal[i]);
    float size = sqrtf(dotf(rub, rub)), most = friction * pushed;
    float kept = size > most ? most / size : 1.0f;
    for (int i = 0; i < 3; i++) {
        impulse[i] = (pushed - contact->pushed) * contact->normal[i] + kept * rub[i] - contact->rubbed[i];
        contact->rubbed[i] = kept * rub[i];
    }
    contact->pushed = pushed;
    for (int a = 0; a < 3; a++) {
        float inverse = contact->share[a] * body->inverse_mass[node[a]];
        for (int i = 0; i < 3; i++)
            body->velocity[4 * node[a] + i] += inverse * impulse[i];
    }
}

/* Let a sphere push the body on its way from one place of its path to the next; write the force on the sphere. */
void press(const Body *body, const Spheres *spheres, int sphere, int sub_step, float seconds, const int *near, int count)
{
    Contact contacts[MOST_CONTACTS];
    const double *here = spheres->path + 3 * (sub_step * spheres->count + sphere), *next = here + 3 * spheres->count;
    double *force = spheres->force + 3 * (sub_step * spheres->count + sphere);
    float moving[3];
    for (int i = 0; i < 3; i++)
        moving[i] = (float)((next[i] - here[i]) / (double)seconds);
    int found = 0;
    for (int k = 0; k < count && found < MOST_CONTACTS; k++)
        if (touch(body, body->surface + 3 * near[k], here, (float)spheres->radius[sphere], contacts + found) &&
            !is_known(contacts, found, contacts + found))
            found++;
    for (int pass = 0; pass < ITERATIONS; pass++)
        for (int k = 0; k < found; k++)
            resolve(body, contacts + k, moving, seconds, spheres->friction);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < found; k++) {
            double push = (double)(contacts[k].pushed * contacts[k].normal[i] + contacts[k].rubbed[i]) / (double)seconds;
            force[i] -= push;
            for (int a = 0; a < 3; a++) { /* a jaw feels what presses on the nodes that it holds */
                int holder = body->holder[contacts[k].node[a]];
                if (holder >= 0)
                    spheres->force[3 * (sub_step * spheres->count + holder) + i] += (double)contacts[k].share[a] * push;
            }
        }
}
