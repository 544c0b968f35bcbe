/* A step of bodies: all of their sub-steps side by side, with the instruments in each.

Velocities, then displacements advance by each sub-step, with forces of the displacements before. The elements of a
body push every so many sub-steps, for all of these (Tuckerman, Berne, Martyna, Reversible multiple time scale molecular
dynamics, J. Chem. Phys. 97, 1992): alone it goes as with one sub-step of that length. Contacts and ties act in every
sub-step. A body with a blade in it pushes in every sub-step: what an edge bears is bounded in each.
*/

#include "_solid.h"
#include "_lanes.h"

#define LARGEST_MOVE 0.25f

/* Move the nodes that a sphere holds with the sphere; write the force on the sphere. */
static void carry(const Way *way, int sub_step, float seconds, float gravity)
{
    const Body *body = way->body;
    const Spheres *spheres = &way->spheres;
    for (int n = 0; n < way->carries; n++) {
        int i = way->carried[n], sphere = body->holder[i];
        const double *here = spheres->path + 3 * (sub_step * spheres->count + sphere), *next = here + 3 * spheres->count;
        double *force = spheres->force + 3 * (sub_step * spheres->count + sphere);
        for (int k = 0; k < 3; k++) {
            float now = (float)((next[k] - here[k]) / (double)seconds), *v = body->velocity + 4 * i + k;
            float weight = k == 2 ? gravity * body->limits[4] * body->mass[i] : 0.0f;
            force[k] += (double)(body->force[4 * i + k] - weight - body->mass[i] * (now - *v) / seconds);
            *v = now;
        }
    }
}

/* Largest of the first three numbers; infinite if one of `sum`, which is 0 for finite numbers, is not. */
static float largest_of(Row most, Row sum)
{
    float values[4], sums[4], found = 0.0f;
    memcpy(values, &most, sizeof values);
    memcpy(sums, &sum, sizeof sums);
    for (int i = 0; i < 3; i++)
        found = sums[i] != 0.0f ? INFINITY : values[i] > found ? values[i] : found;
    return found;
}

/* Move the nodes; of a body that may be cut by no more in a sub-step than a part of the least height of an element. */
static void move(Body *body, float seconds)
{
    Row zero = ALL(0.0f), most = zero, sum = zero;
    float sharpness = body->limits[1], fastest = LARGEST_MOVE / (sqrtf(sharpness) * seconds * (float)body->every);
    float *velocity = body->velocity, *displacement = body->displacement;
    size_t numbers = 4 * (size_t)body->nodes;
    for (size_t k = 0; k < numbers && sharpness > 0.0f; k += 4)
        STORE_ROW(velocity + k, LIMITED_ROW(LOAD_ROW(velocity + k), fastest));
    for (size_t k = 0; k < numbers; k += 4) {
        Row v = LOAD_ROW(velocity + k);
        STORE_ROW(displacement + k, ADD(LOAD_ROW(displacement + k), MUL(ALL(seconds), v)));
        most = LARGER_ROW(LARGER_ROW(v, SUB(zero, v)), most);
        sum = ADD(sum, MUL(zero, v));
    }
    body->fastest = largest_of(most, sum);
}

static void accelerate(const Body *body, float seconds, float gravity, float drag)
{
    const float falls[4] = {0.0f, 0.0f, seconds * gravity * body->limits[4], 0.0f}, *force = body->force;
    const float *inverse = body->inverse_mass;
    float *velocity = body->velocity;
    Lanes kept = ALL(1.0f - drag * seconds), fall;
    memcpy(&fall, falls, sizeof falls);
    for (size_t i = 0; i < (size_t)body->nodes; i++) {
        if (inverse[i] == 0.0f)
            continue;
        float *v = velocity + 4 * i;
        Lanes push = MUL(ALL(seconds * inverse[i]), LOAD_ROW(force + 4 * i));
        STORE_ROW(v, SUB(ADD(MUL(kept, LOAD_ROW(v)), push), fall));
    }
}

static void end_way(Way *way)
{
    PyMem_RawFree(way->path);
    PyMem_RawFree(way->near);
    PyMem_RawFree(way->carried);
    PyMem_RawFree(way->beside);
    PyMem_RawFree(way->begun);
    PyMem_RawFree(way->impulses);
    PyMem_RawFree(way->triangles);
}

static int is_cutting(const Edges *edges)
{
    for (int k = 0; k < edges->count * edges->samples; k++)
        if (edges->element[k] != -1)
            return 1;
    return 0;
}

/* Find memory for a step, and the faces and nodes that may be touched in it. */
static int begin_way(Way *way, int sub_steps, float seconds)
{
    const Body *body = way->body;
    Spheres *spheres = &way->spheres;
    int numbers = 3 * spheres->count;
    size_t fronts = 3 * (size_t)(way->edges.count * way->edges.samples + 1);
    way->path = PyMem_RawMalloc(sizeof(double) * ((size_t)(sub_steps + 1) * (size_t)numbers + 1));
    way->near_room = body->faces + 2;
    way->near = PyMem_RawMalloc(sizeof(int) * (size_t)(spheres->count + 1) * (size_t)way->near_room);
    way->carried = PyMem_RawMalloc(sizeof(int32_t) * (size_t)(body->nodes + 1));
    way->beside = PyMem_RawMalloc(sizeof(int32_t) * (2 * (size_t)body->boxes * (size_t)body->nodes + 1));
    way->begun = PyMem_RawCalloc(fronts, sizeof(double));
    way->impulses = PyMem_RawCalloc(fronts, sizeof(double));
    way->triangles = PyMem_RawCalloc(6 * fronts, sizeof(double));
    if (!way->path || !way->near || !way->carried || !way->beside || !way->begun || !way->impulses || !way->triangles)
        return -1;
    for (int i = 0; i < (sub_steps + 1) * numbers; i++)
        way->path[i] = spheres->path[i] - way->middle[i % 3];
    spheres->path = way->path;
    memset(spheres->force, 0, sizeof(double) * (size_t)sub_steps * (size_t)numbers);
    for (int i = 0; i < body->nodes; i++)
        if (body->holder[i] >= 0)
            way->carried[way->carries++] = i;
    if (find_all_near(body, spheres, sub_steps, way->near, way->near_room))
        return -1;
    way->besides = find_beside(body, (double)seconds * sub_steps, way->beside);
    engage(body, spheres, &way->edges, sub_steps, way->begun);
    way->body->every = is_cutting(&way->edges) ? 1 : way->every;
    return 0;
}

/* Set the velocities at the end of a sub-step, but for what other bodies and boxes do. */
static void push(const Way *way, const Course *course, int sub_step)
{
    if (sub_step % way->body->every == 0) {
        float seconds = course->seconds * (float)way->body->every;
        elastic_forces(way->body, seconds);
        accelerate(way->body, seconds, course->gravity, way->drag);
    }
    carry(way, sub_step, course->seconds, course->gravity);
    for (int s = 0; s < way->spheres.count; s++) {
        const int *found = way->near + s * way->near_room;
        if (*found)
            press(way->body, &way->spheres, s, sub_step, course->seconds, found + 1, *found);
    }
    slice(way->body, &way->spheres, &way->edges, sub_step, course->seconds, way->impulses);
}

/* Cut along what the edges have swept; return how many faces have been opened, or -1 without memory. */
static int finish_way(Way *way, int sub_steps)
{
    Body *body = way->body;
    for (int i = 0; i < 3 * body->boxes; i++)
        body->support[i] /= sub_steps;
    int swept = sweep(body, &way->spheres, &way->edges, sub_steps, way->begun, way->triangles);
    return swept ? cut_along(body, way->triangles, swept) : 0;
}

/* Advance bodies, which touch each other with `touch` and hang together by `attach`; return how many faces have been
opened, or -1 without memory. */
int advance_bodies(Way *ways, int count, const Course *course, Touch *touch, Attach *attach)
{
    int failed = 0, opened = 0;
    for (int b = 0; b < count; b++)
        failed |= begin_way(ways + b, course->sub_steps, course->seconds);
    if (touch)
        begin_touch(touch);
    if (attach)
        begin_attach(attach, count);
    for (int k = 0; k < course->sub_steps && !failed; k++) {
        for (int b = 0; b < count; b++)
            push(ways + b, course, k);
        failed = touch ? part_bodies(touch, (double)course->seconds, 1.0 / course->sub_steps) : 0;
        if (attach)
            hold_together(attach, k, (double)course->seconds, 1.0 / course->sub_steps);
        for (int b = 0; b < count; b++) {
            rest_on(ways[b].body, ways[b].beside, ways[b].besides, (double)course->seconds);
            tie(ways[b].body);
            move(ways[b].body, course->seconds);
            follow(ways[b].body, &ways[b].spheres, &ways[b].edges, k, course->seconds, ways[b].impulses);
        }
        if (touch)
            note_motion(touch, (double)course->seconds);
    }
    for (int b = 0; b < count && !failed; b++) {
        int found = finish_way(ways + b, course->sub_steps);
        failed = found < 0, opened += found;
    }
    for (int b = 0; b < count; b++)
        end_way(ways + b);
    return failed ? -1 : opened;
}
