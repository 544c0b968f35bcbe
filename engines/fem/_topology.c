/* Changes of a body's mesh: faces open, elements go, nodes part.

Elements keep their numbers, nodes too: where the elements around a node are no longer joined by faces, each further
group gets a copy of the node. Mass stays with the elements.
*/

#include "_solid.h"

static const int FACE[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}; /* outward, by the opposite corner */

void free_stars(Stars *stars)
{
    PyMem_RawFree(stars->nodes);
    PyMem_RawFree(stars->start);
    PyMem_RawFree(stars->element);
    PyMem_RawFree(stars->place);
}

/* Find the elements around all marked nodes (place 0 instead of -1); `place` is given and kept. */
int find_stars(const Body *body, int32_t *place, Stars *stars)
{
    int elements = 4 * body->blocks, count = 0;
    stars->place = place;
    for (int i = 0; i < body->nodes; i++)
        count += place[i] >= 0;
    stars->count = count;
    stars->nodes = PyMem_RawMalloc(sizeof(int32_t) * (size_t)(count + 1));
    stars->start = PyMem_RawCalloc((size_t)count + 2, sizeof(int32_t));
    stars->element = NULL;
    if (stars->nodes == NULL || stars->start == NULL)
        return -1;
    for (int i = 0, k = 0; i < body->nodes; i++)
        if (place[i] >= 0)
            stars->nodes[k] = i, place[i] = k++;
    int32_t *start = stars->start + 1; /* shifted by one while it is filled */
    for (int pass = 0; pass < 2; pass++) {
        for (int e = 0; e < elements; e++) {
            if (is_gone(body, e))
                continue;
            for (int a = 0; a < 4; a++) {
                int k = place[*corner_of(body, e, a)];
                if (k < 0)
                    continue;
                if (pass)
                    stars->element[start[k]++] = e;
                else
                    start[k + 1]++;
            }
        }
        if (pass)
            break;
        for (int k = 0; k < count; k++)
            start[k + 1] += start[k];
        stars->element = PyMem_RawMalloc(sizeof(int32_t) * (size_t)(start[count] + 1));
        if (stars->element == NULL)
            return -1;
    }
    return 0;
}

int32_t *no_places(const Body *body)
{
    int32_t *place = PyMem_RawMalloc(sizeof(int32_t) * (size_t)(body->node_room + 1));
    if (place != NULL)
        memset(place, 0xff, sizeof(int32_t) * (size_t)(body->node_room + 1));
    return place;
}

static void add_slot(Body *body, int face)
{
    int slot = body->faces++;
    body->across[face] = ~slot;
    body->owner[slot] = face;
}

static void write_slot(const Body *body, int face)
{
    int slot = ~body->across[face];
    for (int k = 0; k < 3; k++)
        body->surface[3 * slot + k] = *corner_of(body, face / 4, FACE[face % 4][k]);
}

/* Edge matrix of the resting element, column by column from corner 0; return its determinant. */
static double rest_edges(const Body *body, int element, double edges[9])
{
    const float *first = body->rest + 4 * *corner_of(body, element, 0);
    for (int a = 0; a < 3; a++)
        for (int i = 0; i < 3; i++)
            edges[3 * a + i] = (double)body->rest[4 * *corner_of(body, element, a + 1) + i] - (double)first[i];
    return edges[0] * (edges[4] * edges[8] - edges[5] * edges[7]) + edges[1] * (edges[5] * edges[6] - edges[3] * edges[8]) +
           edges[2] * (edges[3] * edges[7] - edges[4] * edges[6]);
}

/* Gradients of the shape functions of corners 1 to 3, row by row, of a resting element; return its volume. */
double rest_gradients(const Body *body, int element, double gradients[9])
{
    double edges[9], whole = rest_edges(body, element, edges);
    for (int a = 0; a < 3; a++) {
        const double *u = edges + 3 * ((a + 1) % 3), *v = edges + 3 * ((a + 2) % 3);
        for (int i = 0; i < 3; i++) {
            int j = (i + 1) % 3, k = (i + 2) % 3;
            gradients[3 * a + i] = (u[j] * v[k] - u[k] * v[j]) / whole;
        }
    }
    return whole / 6.0;
}

/* Norm of the sum of the dyads of all four gradients, 1/m^2: a bound of an element's stiffness over its mass. */
double sharpness_of(const double gradients[9])
{
    double last[3], square = 0.0;
    for (int i = 0; i < 3; i++)
        last[i] = -(gradients[i] + gradients[3 + i] + gradients[6 + i]);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            double sum = last[i] * last[j];
            for (int a = 0; a < 3; a++)
                sum += gradients[3 * a + i] * gradients[3 * a + j];
            square += sum * sum;
        }
    return sqrt(square);
}

/* Square of a frequency: a bound, over lambda, of that by which the mean volume around a node swings. */
static double bulk_rate(const Body *body, const Stars *stars, int k, double volume, double *scratch)
{
    double rate = 0.0;
    for (int s = stars->start[k]; s < stars->start[k + 1]; s++) {
        double gradients[9], size = rest_gradients(body, stars->element[s], gradients);
        for (int i = 0; i < 3; i++) {
            double last = 0.0;
            for (int a = 0; a < 3; a++) {
                scratch[3 * *corner_of(body, stars->element[s], a + 1) + i] += size * gradients[3 * a + i];
                last -= size * gradients[3 * a + i];
            }
            scratch[3 * *corner_of(body, stars->element[s], 0) + i] += last;
        }
    }
    for (int s = stars->start[k]; s < stars->start[k + 1]; s++)
        for (int a = 0; a < 4; a++) {
            int node = *corner_of(body, stars->element[s], a);
            double *g = scratch + 3 * node;
            if (body->mass[node] > 0.0f)
                rate += (g[0] * g[0] + g[1] * g[1] + g[2] * g[2]) / (double)body->mass[node];
            g[0] = g[1] = g[2] = 0.0;
        }
    return rate / volume;
}

/* Mass and volume of all nodes of the stars from their elements. */
static void weigh(Body *body, const Stars *stars)
{
    for (int k = 0; k < stars->count; k++) {
        int node = stars->nodes[k];
        double mass = 0.0, volume = 0.0;
        for (int s = stars->start[k]; s < stars->start[k + 1]; s++) {
            mass += 0.25 * (double)body->element_mass[stars->element[s]];
            volume += (double)body->volumes[stars->element[s]];
        }
        body->mass[node] = (float)mass;
        body->inverse_volume[node] = volume > 0.0 ? (float)(1.0 / volume) : 0.0f;
        int moves = mass > 0.0 && !(body->flags[node] & FIXED) && body->holder[node] < 0;
        body->inverse_mass[node] = moves ? (float)(1.0 / mass) : 0.0f;
        if (mass == 0.0)
            for (int i = 0; i < 4; i++)
                body->velocity[4 * node + i] = 0.0f;
    }
}

/* Limit lambda at the nodes of the stars: few elements around a node must not swing faster than the uncut mesh. */
static void limit_bulk(Body *body, const Stars *stars, double *scratch)
{
    float lambda = body->limits[0], most = body->limits[2];
    for (int k = 0; k < stars->count; k++) {
        int node = stars->nodes[k];
        if (body->inverse_volume[node] == 0.0f)
            continue;
        double share = (double)most / bulk_rate(body, stars, k, 1.0 / (double)body->inverse_volume[node], scratch);
        body->bulk[node] = share < 1.0 ? (float)share * lambda : lambda;
    }
}

/* Weigh the nodes of these elements anew. */
static int refresh(Body *body, const int32_t *elements, int count)
{
    int32_t *place = no_places(body);
    double *scratch = PyMem_RawCalloc(3 * (size_t)body->node_room, sizeof(double));
    Stars stars = {0};
    int failed = place == NULL || scratch == NULL;
    if (!failed) {
        for (int k = 0; k < count; k++)
            for (int a = 0; a < 4; a++)
                place[*corner_of(body, elements[k], a)] = 0;
        failed = find_stars(body, place, &stars);
    }
    if (!failed) {
        weigh(body, &stars);
        limit_bulk(body, &stars, scratch);
        free_stars(&stars);
    }
    PyMem_RawFree(scratch);
    return failed ? -1 : 0;
}

static int copy_node(Body *body, int node)
{
    int copy = body->nodes++;
    float *arrays[] = {body->rest, body->displacement, body->velocity, body->force};
    for (int k = 0; k < 4; k++)
        memcpy(arrays[k] + 4 * copy, arrays[k] + 4 * node, 4 * sizeof(float));
    body->holder[copy] = body->holder[node];
    body->origin[copy] = body->origin[node];
    body->flags[copy] = body->flags[node];
    body->bulk[copy] = body->bulk[node];
    return copy;
}

/* Group the elements around a node by the faces that join them; give each group but the first a copy of the node. */
static void part(Body *body, const Stars *stars, int k, int32_t *group, int32_t *stack)
{
    int node = stars->nodes[k];
    for (int s = stars->start[k]; s < stars->start[k + 1]; s++)
        group[stars->element[s]] = -1;
    for (int s = stars->start[k], groups = 0; s < stars->start[k + 1]; s++) {
        if (group[stars->element[s]] >= 0)
            continue;
        int own = groups++ ? copy_node(body, node) : node, depth = 0;
        group[stars->element[s]] = 0;
        stack[depth++] = stars->element[s];
        while (depth) {
            int e = stack[--depth];
            for (int a = 0; a < 4; a++) {
                int32_t *corner = corner_of(body, e, a);
                if (*corner == node) {
                    *corner = own;
                    continue;
                }
                int other = body->across[4 * e + a] >= 0 ? body->across[4 * e + a] / 4 : -1;
                if (other >= 0 && group[other] == -1)
                    group[other] = 0, stack[depth++] = other;
            }
        }
    }
    for (int s = stars->start[k]; s < stars->start[k + 1]; s++)
        group[stars->element[s]] = -2;
}

/* Part the marked nodes (place 0 instead of -1) where elements are no longer joined; takes `place`. */
static int part_nodes(Body *body, int32_t *place)
{
    int elements = 4 * body->blocks, failed = 0;
    Stars stars = {0};
    body->changes++;
    int32_t *group = PyMem_RawMalloc(sizeof(int32_t) * (size_t)elements * 2);
    if (group == NULL || find_stars(body, place, &stars))
        failed = 1;
    else {
        for (int e = 0; e < elements; e++)
            group[e] = -2; /* not around the node */
        for (int k = 0; k < stars.count; k++)
            part(body, &stars, k, group, group + elements);
        int around = stars.start[stars.count];
        for (int s = 0; s < around; s++)
            for (int a = 0; a < 4; a++)
                if (body->across[4 * stars.element[s] + a] < 0)
                    write_slot(body, 4 * stars.element[s] + a);
        failed = refresh(body, stars.element, around);
        for (int k = 0; k < stars.count && !failed; k++)
            if (stars.start[k] == stars.start[k + 1]) { /* no element is left */
                int node = stars.nodes[k];
                body->mass[node] = body->inverse_mass[node] = body->inverse_volume[node] = 0.0f;
                memset(body->velocity + 4 * node, 0, 4 * sizeof(float));
            }
        free_stars(&stars);
    }
    PyMem_RawFree(group);
    return failed ? -1 : 0;
}

/* Open faces between elements; return how many were closed, or -1 without memory. */
int open_faces(Body *body, const int32_t *faces, int count)
{
    int32_t *place = no_places(body);
    int opened = 0;
    if (place == NULL)
        return -1;
    for (int k = 0; k < count; k++) {
        int face = faces[k], other = body->across[face];
        if (other < 0)
            continue;
        opened++;
        add_slot(body, face);
        add_slot(body, other);
        write_slot(body, face);
        write_slot(body, other);
        for (int a = 0; a < 3; a++)
            place[*corner_of(body, face / 4, FACE[face % 4][a])] = 0;
    }
    if (!opened) {
        PyMem_RawFree(place);
        return 0;
    }
    return part_nodes(body, place) ? -1 : opened;
}

/* Let elements go; return how many were there, or -1 without memory. */
int remove_elements(Body *body, const int32_t *elements, int count)
{
    int32_t *place = no_places(body);
    int removed = 0;
    if (place == NULL)
        return -1;
    for (int k = 0; k < count; k++) {
        int e = elements[k];
        if (is_gone(body, e))
            continue;
        removed++;
        for (int a = 0; a < 4; a++) {
            int face = 4 * e + a, other = body->across[face];
            place[*corner_of(body, e, a)] = 0;
            if (other >= 0) {
                add_slot(body, other);
                write_slot(body, other);
                add_slot(body, face);
            }
            for (int i = 0; i < 3; i++)
                body->surface[3 * ~body->across[face] + i] = -1;
        }
        body->volumes[e] = body->element_mass[e] = 0.0f;
    }
    return part_nodes(body, place) ? -1 : removed;
}

/* Measure the sharpest element and the fastest swing of a mean volume over lambda, of all of the mesh. */
int measure(const Body *body, float *sharpness, float *rate)
{
    int32_t *place = no_places(body);
    double *scratch = PyMem_RawCalloc(3 * (size_t)body->node_room, sizeof(double)), sharpest = 0.0, fastest = 0.0;
    Stars stars = {0};
    if (place == NULL || scratch == NULL)
        return -1;
    for (int i = 0; i < body->nodes; i++)
        place[i] = 0;
    if (find_stars(body, place, &stars))
        return -1;
    for (int e = 0; e < 4 * body->blocks; e++) {
        double gradients[9];
        if (is_gone(body, e))
            continue;
        rest_gradients(body, e, gradients);
        double sharp = sharpness_of(gradients);
        sharpest = sharp > sharpest ? sharp : sharpest;
    }
    for (int k = 0; k < stars.count; k++) {
        double swing = bulk_rate(body, &stars, k, 1.0 / (double)body->inverse_volume[stars.nodes[k]], scratch);
        fastest = swing > fastest ? swing : fastest;
    }
    *sharpness = (float)sharpest, *rate = (float)fastest;
    free_stars(&stars);
    PyMem_RawFree(scratch);
    return 0;
}

/* Number the pieces of the body, joined by faces: labels by element, -1 of one that has gone. */
void label_pieces(const Body *body, int32_t *labels, int32_t *stack)
{
    int elements = 4 * body->blocks, pieces = 0;
    for (int e = 0; e < elements; e++)
        labels[e] = -1;
    for (int e = 0; e < elements; e++) {
        if (labels[e] >= 0 || is_gone(body, e))
            continue;
        int depth = 0;
        labels[e] = pieces;
        stack[depth++] = e;
        while (depth) {
            int here = stack[--depth];
            for (int a = 0; a < 4; a++) {
                int other = body->across[4 * here + a];
                if (other >= 0 && labels[other / 4] < 0)
                    labels[other / 4] = pieces, stack[depth++] = other / 4;
            }
        }
        pieces++;
    }
}
