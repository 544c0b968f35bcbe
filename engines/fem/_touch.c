/* Bodies against each other and against themselves: no vertex enters a face, with Coulomb friction.

Each vertex of a surface meets the nearest face in front of it, or the one that it has just passed. Impulses act on the
vertex and, by the shares of the nearest point, against it on the nodes of the face; projected Gauss and Seidel as in
`_contact.c`. They take the speed of approach and give none back, so energy never grows, but for the slow recovery of a
depth. Edges do not meet edges.

Pairs are searched in a grid, with a skin: until a vertex has moved by half of it they hold every pair that may meet,
and what a vertex meets does not depend on when they were found. So a restored body goes on with the same bits.
*/

#include "_solid.h"
#include "_pairs.h"
#include "_triangle.h"
#include "_vectors.h"

#define ITERATIONS 6   /* at most */
#define SETTLED 1e-4   /* square of a pass's impulses over those of the first: enough */
#define RECOVERY 0.2   /* share of a depth that is undone in a sub-step */
#define FASTEST 0.05   /* m/s: of the recovery */
#define DEEPEST 0.3    /* of a vertex behind a face, over the height of the element there */
#define INTERIOR 1e-4f /* least share of each node at a point inside a face */
#define SAME_POINT 1e-7 /* m */
#define DIAGONAL 1.7321 /* a bit more than a diagonal over its way along each axis */
#define ROUNDING 1e-7  /* m: of a displacement in a sub-step */
#define MOST_FACES 64  /* that a vertex may meet: the first of them */

/* A vertex that meets a face. */
typedef struct {
    const Vertex *vertex;
    const Body *body, *other;
    const int32_t *node;   /* of the face */
    int other_body;
    double share[3], normal[3], gap, mass, friction, pushed, rubbed[3];
} Meeting;

struct Touch {
    Pairs pairs;
    const double *friction; /* (bodies,) */
    double *force;          /* (bodies, 3): mean of a step, N */
    double ahead;           /* m: from a face, for a vertex that may reach it in a sub-step */
    Meeting *meeting;
    int room;
};

Touch *new_touch(int count, Body *const *bodies, const double *middles, const double *frictions, double *forces,
                 double ahead, double skin)
{
    Touch *touch = PyMem_RawCalloc(1, sizeof(Touch));
    if (touch == NULL)
        return NULL;
    touch->pairs.bodies = count, touch->pairs.body = bodies, touch->pairs.middle = middles;
    touch->pairs.reach = ahead + skin, touch->pairs.skin = skin;
    touch->friction = frictions, touch->force = forces, touch->ahead = ahead;
    return touch;
}

void free_touch(Touch *touch)
{
    if (touch == NULL)
        return;
    free_pairs(&touch->pairs);
    PyMem_RawFree(touch->meeting);
    PyMem_RawFree(touch);
}

void forget_pairs(Touch *touch)
{
    touch->pairs.are_known = 0;
}

/* The point of a face nearest to a vertex. */
typedef struct {
    const Pair *pair;
    const double *corner[3];           /* of the face */
    double normal[3];
    double share[3], out[3], distance; /* from the point to the vertex */
    int is_inside;                     /* the face, not on its edge */
} Near;

/* Write the point of a face nearest to x; return 0 if it is too far, or the face has no area. */
static int look_at(const Touch *touch, const double *x, const Pair *pair, Near *near)
{
    double u[3], v[3];
    float corner[3][3], share[3], ahead = (float)touch->ahead;
    for (int a = 0; a < 3; a++)
        near->corner[a] = touch->pairs.place + 3 * pair->corner[a];
    for (int i = 0; i < 3; i++) {
        for (int a = 0; a < 3; a++)
            corner[a][i] = (float)(near->corner[a][i] - x[i]);
        if ((corner[0][i] > ahead && corner[1][i] > ahead && corner[2][i] > ahead) ||
            (corner[0][i] < -ahead && corner[1][i] < -ahead && corner[2][i] < -ahead))
            return 0;
    }
    nearest(corner[0], corner[1], corner[2], share);
    near->share[0] = 1.0 - (double)share[1] - (double)share[2];
    near->share[1] = (double)share[1], near->share[2] = (double)share[2];
    for (int i = 0; i < 3; i++) {
        u[i] = near->corner[1][i] - near->corner[0][i], v[i] = near->corner[2][i] - near->corner[0][i];
        near->out[i] = x[i] - near->corner[0][i] - near->share[1] * u[i] - near->share[2] * v[i];
    }
    near->pair = pair;
    near->distance = sqrt(dot(near->out, near->out));
    near->is_inside = share[0] > INTERIOR && share[1] > INTERIOR && share[2] > INTERIOR;
    if (near->distance > touch->ahead)
        return 0;
    cross(u, v, near->normal);
    return normalise(near->normal);
}

/* Weight of a face at a point of its edge or corner, which grows with its angle there. */
static double weight_at(const Near *near)
{
    for (int a = 0; a < 3; a++) {
        if (near->share[a] <= 1.0 - (double)INTERIOR)
            continue;
        double u[3], v[3];
        for (int i = 0; i < 3; i++) {
            u[i] = near->corner[(a + 1) % 3][i] - near->corner[a][i];
            v[i] = near->corner[(a + 2) % 3][i] - near->corner[a][i];
        }
        return normalise(u) && normalise(v) ? 1.0 - dot(u, v) : 0.0;
    }
    return 2.0;
}

/* Outward direction at the nearest point, on an edge or corner, as the sum of all faces there tells (Baerentzen, Aanaes,
Signed distance computation using the angle weighted pseudonormal, IEEE Trans. Vis. Comput. Graph. 11, 2005). */
static int direction_at(const Near *near, int count, const Near *best, double direction[3])
{
    memset(direction, 0, 3 * sizeof(double));
    for (int k = 0; k < count; k++) {
        double apart[3], weight;
        for (int i = 0; i < 3; i++)
            apart[i] = near[k].out[i] - best->out[i];
        if (near[k].pair->body != best->pair->body || dot(apart, apart) > SAME_POINT * SAME_POINT)
            continue;
        weight = weight_at(near + k);
        for (int i = 0; i < 3; i++)
            direction[i] += weight * near[k].normal[i];
    }
    return normalise(direction);
}

/* Height of the element behind a face, above it. */
static double height_behind(const Pairs *pairs, const Near *near)
{
    const Body *body = pairs->body[near->pair->body];
    int face = body->owner[near->pair->slot];
    double x[3], away[3];
    place_of(pairs, near->pair->body, *corner_of(body, face / 4, face % 4), x);
    for (int i = 0; i < 3; i++)
        away[i] = near->corner[0][i] - x[i];
    return dot(away, near->normal);
}

/* Whether a vertex and a face of another body belong to whole ties: they hold both together, and apart. */
static int are_tied(const Pairs *pairs, const Vertex *vertex, const Pair *pair)
{
    const Body *other = pairs->body[pair->body];
    const int32_t *node = other->surface + 3 * pair->slot;
    return vertex->body != pair->body && pairs->body[vertex->body]->flags[vertex->node] & TIED &&
           other->flags[node[0]] & other->flags[node[1]] & other->flags[node[2]] & TIED;
}

/* Whether neither a vertex nor all of a face of another body can move, and an instrument holds some of them: it keeps
them apart. What is left of the face would move by the push over its share, which may be small. */
static int are_clamped(const Body *body, int32_t vertex, const Body *other, const int32_t *node)
{
    int held = body->holder[vertex] >= 0, still = 0;
    for (int a = 0; a < 3; a++) {
        still |= other->inverse_mass[node[a]] == 0.0f;
        held |= other->holder[node[a]] >= 0;
    }
    return body != other && held && still && body->inverse_mass[vertex] == 0.0f;
}

/* Fill in whom vertex k meets; return 0 for nobody. */
static int meet(const Touch *touch, int k, Meeting *meeting)
{
    const Pairs *pairs = &touch->pairs;
    const Vertex *vertex = pairs->vertex + k;
    int found = 0, least = 0;
    double direction[3];
    Near near[MOST_FACES];
    for (int p = pairs->start[k]; p < pairs->start[k + 1] && found < MOST_FACES; p++)
        found += look_at(touch, pairs->place + 3 * k, pairs->pair + p, near + found);
    for (int n = 1; n < found; n++)
        least = near[n].distance < near[least].distance ? n : least;
    if (!found)
        return 0;
    const Near *best = near + least;
    if (are_tied(pairs, vertex, best->pair))
        return 0;
    memcpy(direction, best->normal, sizeof direction);
    if (!best->is_inside && !direction_at(near, found, best, direction))
        return 0;
    double side = dot(best->out, direction) < 0.0 ? -1.0 : 1.0;
    if (side < 0.0 && best->distance > DEEPEST * height_behind(pairs, best))
        return 0;
    meeting->vertex = vertex, meeting->body = pairs->body[vertex->body];
    meeting->other = pairs->body[best->pair->body], meeting->other_body = best->pair->body;
    meeting->node = meeting->other->surface + 3 * best->pair->slot;
    if (are_clamped(meeting->body, vertex->node, meeting->other, meeting->node))
        return 0;
    meeting->gap = side * best->distance;
    for (int i = 0; i < 3; i++) {
        int is_clear = !best->is_inside && best->distance > SAME_POINT;
        meeting->normal[i] = is_clear ? side * best->out[i] / best->distance : direction[i];
        meeting->share[i] = best->share[i];
    }
    double inverse = (double)meeting->body->inverse_mass[vertex->node];
    for (int a = 0; a < 3; a++)
        inverse += best->share[a] * best->share[a] * (double)meeting->other->inverse_mass[meeting->node[a]];
    double own = touch->friction[vertex->body], its = touch->friction[meeting->other_body];
    meeting->mass = 1.0 / inverse, meeting->friction = own < its ? own : its;
    meeting->pushed = 0.0;
    memset(meeting->rubbed, 0, sizeof meeting->rubbed);
    return inverse > 0.0;
}

/* Find the vertices that may meet faces in this sub-step; return how many. */
static int find_meetings(Touch *touch)
{
    const Pairs *pairs = &touch->pairs;
    int found = 0;
    for (int n = 0; n < pairs->uses; n++) {
        int k = pairs->used[n];
        if (pairs->start[k] < pairs->start[k + 1])
            found += meet(touch, k, touch->meeting + found);
    }
    return found;
}

/* Change the velocities of vertex and face towards no approach; keep normal and friction within their cone. Return the
square of the impulse. */
static double resolve(Meeting *meeting, double seconds)
{
    float *velocity = meeting->body->velocity + 4 * meeting->vertex->node;
    double apart[3], rub[3], impulse[3], square = 0.0, recovery = -RECOVERY * meeting->gap / seconds;
    for (int i = 0; i < 3; i++) {
        apart[i] = (double)velocity[i];
        for (int a = 0; a < 3; a++)
            apart[i] -= meeting->share[a] * (double)meeting->other->velocity[4 * meeting->node[a] + i];
    }
    double along = dot(apart, meeting->normal);
    double least = meeting->gap >= 0.0 ? -meeting->gap / seconds : recovery < FASTEST ? recovery : FASTEST;
    double pushed = meeting->pushed + (least - along) * meeting->mass;
    pushed = pushed > 0.0 ? pushed : 0.0;
    if (pushed == 0.0 && meeting->pushed == 0.0)
        return 0.0;
    for (int i = 0; i < 3; i++) {
        rub[i] = meeting->rubbed[i] - meeting->mass * (apart[i] - along * meeting->normal[i]);
        square += rub[i] * rub[i];
    }
    double most = meeting->friction * pushed, kept = square > most * most ? most / sqrt(square) : 1.0;
    for (int i = 0; i < 3; i++) {
        impulse[i] = (pushed - meeting->pushed) * meeting->normal[i] + kept * rub[i] - meeting->rubbed[i];
        meeting->rubbed[i] = kept * rub[i];
        velocity[i] = (float)((double)velocity[i] +
                              (double)meeting->body->inverse_mass[meeting->vertex->node] * impulse[i]);
        for (int a = 0; a < 3; a++) {
            int node = meeting->node[a];
            float *against = meeting->other->velocity + 4 * node + i;
            *against = (float)((double)*against -
                               meeting->share[a] * (double)meeting->other->inverse_mass[node] * impulse[i]);
        }
    }
    meeting->pushed = pushed;
    return dot(impulse, impulse);
}

/* Begin a step: no forces yet, and all vertices may have moved, as a body may have been moved by hand. */
void begin_touch(Touch *touch)
{
    touch->pairs.moved = INFINITY;
    memset(touch->force, 0, sizeof(double) * 3 * (size_t)touch->pairs.bodies);
}

/* Note how far a vertex has moved at most in a sub-step. */
void note_motion(Touch *touch, double seconds)
{
    float fastest = 0.0f;
    for (int b = 0; b < touch->pairs.bodies; b++)
        fastest = touch->pairs.body[b]->fastest > fastest ? touch->pairs.body[b]->fastest : fastest;
    touch->pairs.moved += DIAGONAL * (double)fastest * seconds + ROUNDING;
}

/* Stop the bodies at each other in a sub-step, a `share` of the step; return -1 without memory. */
int part_bodies(Touch *touch, double seconds, double share)
{
    Pairs *pairs = &touch->pairs;
    if (have_moved(pairs) && find_pairs(pairs))
        return -1;
    if (pairs->start[pairs->vertices] == 0)
        return 0;
    place_used(pairs);
    if (touch->room < pairs->vertices) {
        PyMem_RawFree(touch->meeting);
        touch->room = pairs->vertices;
        touch->meeting = PyMem_RawMalloc(sizeof(Meeting) * (size_t)touch->room);
        if (touch->meeting == NULL)
            return -1;
    }
    int found = find_meetings(touch);
    double first = 0.0, change = INFINITY;
    for (int pass = 0; pass < ITERATIONS && change > SETTLED * first; pass++) {
        change = 0.0;
        for (int k = 0; k < found; k++)
            change += resolve(touch->meeting + k, seconds);
        first = pass ? first : change;
    }
    for (int k = 0; k < found; k++) {
        const Meeting *meeting = touch->meeting + k;
        for (int i = 0; i < 3; i++) {
            double force = share * (meeting->pushed * meeting->normal[i] + meeting->rubbed[i]) / seconds;
            touch->force[3 * meeting->vertex->body + i] += force;
            touch->force[3 * meeting->other_body + i] -= force;
        }
    }
    return 0;
}
