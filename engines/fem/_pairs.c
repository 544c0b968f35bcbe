/* Vertices and faces of the surfaces of bodies that are near each other, by a grid of the vertices.

Nodes that share an element with a node of the face are no vertices for it: the elements keep them apart. Elements
without a neighbour have neither vertices nor faces.
*/

#include "_solid.h"
#include "_pairs.h"
#include "_triangle.h"

#define LARGEST_M 100.0 /* extent of all bodies: beyond, they are lost */
#define MOST_CELLS 32   /* along an axis */

typedef struct {
    double low[3], cell;
    int count[3];
    int32_t *start, *vertex; /* vertices by cell */
} Grid;

/* Whether a vertex has moved so far that pairs are missing, or a mesh has changed. */
int have_moved(Pairs *pairs)
{
    float most = 0.25f * (float)(pairs->skin * pairs->skin), largest = 0.0f;
    if (!pairs->are_known)
        return 1;
    for (int b = 0; b < pairs->bodies; b++)
        if (pairs->changes[b] != pairs->body[b]->changes)
            return 1;
    if (pairs->moved < 0.499 * pairs->skin)
        return 0;
    for (int k = 0; k < pairs->vertices; k++) {
        const float *now = pairs->body[pairs->vertex[k].body]->displacement + 4 * pairs->vertex[k].node;
        const float *before = pairs->before + 3 * k;
        float x = now[0] - before[0], y = now[1] - before[1], z = now[2] - before[2], square = x * x + y * y + z * z;
        if (!(square <= most))
            return 1;
        largest = square > largest ? square : largest;
    }
    pairs->moved = sqrt((double)largest);
    return 0;
}

/* Bring the places of the vertices up to date that have pairs, or belong to the faces of pairs. */
void place_used(Pairs *pairs)
{
    for (int n = 0; n < pairs->uses; n++) {
        const Vertex *vertex = pairs->vertex + pairs->used[n];
        place_of(pairs, vertex->body, vertex->node, pairs->place + 3 * pairs->used[n]);
    }
}

static void place_vertices(Pairs *pairs)
{
    for (int k = 0; k < pairs->vertices; k++)
        place_of(pairs, pairs->vertex[k].body, pairs->vertex[k].node, pairs->place + 3 * k);
}

void free_pairs(Pairs *pairs)
{
    PyMem_RawFree(pairs->place);
    PyMem_RawFree(pairs->changes);
    PyMem_RawFree(pairs->vertex);
    PyMem_RawFree(pairs->before);
    PyMem_RawFree(pairs->start);
    PyMem_RawFree(pairs->used);
    PyMem_RawFree(pairs->pair);
}

/* Whether a face of the surface is there, on an element that is joined to another. */
static int is_joined(const Body *body, int slot)
{
    if (body->surface[3 * slot] < 0)
        return 0;
    const int32_t *across = body->across + 4 * (body->owner[slot] / 4);
    return across[0] >= 0 || across[1] >= 0 || across[2] >= 0 || across[3] >= 0 || body->blocks == 1;
}

/* Let `room` hold all vertices. */
static int find_room(Pairs *pairs)
{
    int most = 0;
    for (int b = 0; b < pairs->bodies; b++)
        most += pairs->body[b]->nodes;
    if (pairs->changes == NULL)
        pairs->changes = PyMem_RawMalloc(sizeof(int) * (size_t)pairs->bodies);
    if (pairs->room < most) {
        PyMem_RawFree(pairs->vertex);
        PyMem_RawFree(pairs->place);
        PyMem_RawFree(pairs->before);
        PyMem_RawFree(pairs->start);
        PyMem_RawFree(pairs->used);
        pairs->room = most;
        pairs->used = PyMem_RawMalloc(sizeof(int32_t) * (size_t)most);
        pairs->vertex = PyMem_RawMalloc(sizeof(Vertex) * (size_t)most);
        pairs->place = PyMem_RawMalloc(sizeof(double) * 3 * (size_t)most);
        pairs->before = PyMem_RawMalloc(sizeof(float) * 3 * (size_t)most);
        pairs->start = PyMem_RawMalloc(sizeof(int32_t) * ((size_t)most + 1));
    }
    return pairs->changes && pairs->vertex && pairs->place && pairs->before && pairs->start && pairs->used ? 0 : -1;
}

/* Collect the vertices of a body, and mark them as 0 among -1 in `place`. */
static void add_vertices(Pairs *pairs, int body, int32_t *place)
{
    const Body *own = pairs->body[body];
    for (int f = 0; f < own->faces; f++)
        if (is_joined(own, f))
            for (int a = 0; a < 3; a++)
                place[own->surface[3 * f + a]] = 0;
    for (int32_t i = 0; i < own->nodes; i++)
        if (place[i] == 0) {
            int k = pairs->vertices++;
            pairs->vertex[k].body = body, pairs->vertex[k].node = i;
            memcpy(pairs->before + 3 * k, own->displacement + 4 * i, 3 * sizeof(float));
        }
}

static int cell_of(const Grid *grid, double x, int axis)
{
    int cell = (int)((x - grid->low[axis]) / grid->cell);
    return cell < 0 ? 0 : cell >= grid->count[axis] ? grid->count[axis] - 1 : cell;
}

/* Sort the vertices into cells; return 0 where there are none to sort, or -1 without memory. */
static int make_grid(const Pairs *pairs, Grid *grid)
{
    double high[3] = {-INFINITY, -INFINITY, -INFINITY}, longest = 0.0;
    grid->low[0] = grid->low[1] = grid->low[2] = INFINITY;
    for (int k = 0; k < pairs->vertices; k++) {
        const double *x = pairs->place + 3 * k;
        for (int i = 0; i < 3; i++) {
            if (!isfinite(x[i]))
                return 0;
            grid->low[i] = x[i] < grid->low[i] ? x[i] : grid->low[i], high[i] = x[i] > high[i] ? x[i] : high[i];
        }
    }
    for (int i = 0; i < 3; i++)
        longest = high[i] - grid->low[i] > longest ? high[i] - grid->low[i] : longest;
    if (!(longest > 0.0 && longest < LARGEST_M))
        return 0;
    grid->cell = longest / MOST_CELLS > 2.0 * pairs->reach ? longest / MOST_CELLS : 2.0 * pairs->reach;
    int cells = 1;
    for (int i = 0; i < 3; i++) {
        grid->count[i] = (int)((high[i] - grid->low[i]) / grid->cell) + 1;
        cells *= grid->count[i];
    }
    grid->start = PyMem_RawCalloc((size_t)cells + 2, sizeof(int32_t));
    grid->vertex = PyMem_RawMalloc(sizeof(int32_t) * (size_t)(pairs->vertices + 1));
    if (grid->start == NULL || grid->vertex == NULL)
        return -1;
    for (int pass = 0; pass < 2; pass++) {
        int32_t *start = grid->start + 1; /* shifted by one while it is filled */
        for (int32_t k = 0; k < pairs->vertices; k++) {
            const double *x = pairs->place + 3 * k;
            int cell = (cell_of(grid, x[2], 2) * grid->count[1] + cell_of(grid, x[1], 1)) * grid->count[0] +
                       cell_of(grid, x[0], 0);
            if (pass)
                grid->vertex[start[cell]++] = k;
            else
                start[cell + 1]++;
        }
        for (int c = 0; c < cells && !pass; c++)
            start[c + 1] += start[c];
    }
    return 1;
}

/* Whether a node shares an element with a node of the face. */
static int are_neighbours(const Body *body, const Stars *stars, int32_t node, const int32_t *face)
{
    int k = stars->place[node];
    for (int s = stars->start[k]; s < stars->start[k + 1]; s++)
        for (int a = 0; a < 4; a++) {
            int32_t corner = *corner_of(body, stars->element[s], a);
            if (corner == face[0] || corner == face[1] || corner == face[2])
                return 1;
        }
    return 0;
}

/* Whether a vertex is within reach of a face with these corners. */
static int is_near(const Pairs *pairs, int32_t vertex, const double *const corner[3])
{
    const double *x = pairs->place + 3 * vertex;
    float near[3][3], share[3], square = 0.0f, reach = (float)pairs->reach;
    for (int i = 0; i < 3; i++) {
        for (int a = 0; a < 3; a++)
            near[a][i] = (float)(corner[a][i] - x[i]);
        if ((near[0][i] > reach && near[1][i] > reach && near[2][i] > reach) ||
            (near[0][i] < -reach && near[1][i] < -reach && near[2][i] < -reach))
            return 0;
    }
    nearest(near[0], near[1], near[2], share);
    for (int i = 0; i < 3; i++) {
        float away = share[0] * near[0][i] + share[1] * near[1][i] + share[2] * near[2][i];
        square += away * away;
    }
    return square < reach * reach;
}

/* Pairs in the order of their faces, with their vertices. */
typedef struct {
    int count, room;
    Pair *pair;
    int32_t *vertex;
} Found;

static int append(Found *found, int32_t vertex, const Pair *pair)
{
    if (found->count == found->room) {
        int room = 2 * found->room + 1024;
        Pair *pairs = PyMem_RawRealloc(found->pair, sizeof(Pair) * (size_t)room);
        found->pair = pairs ? pairs : found->pair;
        int32_t *numbers = PyMem_RawRealloc(found->vertex, sizeof(int32_t) * (size_t)room);
        found->vertex = numbers ? numbers : found->vertex;
        if (pairs == NULL || numbers == NULL)
            return -1;
        found->room = room;
    }
    found->pair[found->count] = *pair;
    found->vertex[found->count++] = vertex;
    return 0;
}

/* Find the vertices near a face; `first`: number of the first vertex of its body. */
static int look_around(const Pairs *pairs, const Grid *grid, const Stars *stars, int first, int body, int slot, Found *found)
{
    const Body *own = pairs->body[body];
    const int32_t *face = own->surface + 3 * slot;
    const double *corner[3];
    Pair pair = {.body = body, .slot = slot};
    int low[3], high[3];
    for (int a = 0; a < 3; a++) {
        pair.corner[a] = first + stars->place[face[a]];
        corner[a] = pairs->place + 3 * pair.corner[a];
    }
    for (int i = 0; i < 3; i++) {
        double least = fmin(fmin(corner[0][i], corner[1][i]), corner[2][i]) - pairs->reach;
        double most = fmax(fmax(corner[0][i], corner[1][i]), corner[2][i]) + pairs->reach;
        low[i] = cell_of(grid, least, i), high[i] = cell_of(grid, most, i);
    }
    for (int z = low[2]; z <= high[2]; z++)
        for (int y = low[1]; y <= high[1]; y++) {
            int row = (z * grid->count[1] + y) * grid->count[0];
            for (int s = grid->start[row + low[0]]; s < grid->start[row + high[0] + 1]; s++) {
                int32_t vertex = grid->vertex[s], node = pairs->vertex[vertex].node;
                int is_own = pairs->vertex[vertex].body == body;
                if (is_own && (node == face[0] || node == face[1] || node == face[2]))
                    continue;
                if (!is_near(pairs, vertex, corner) || (is_own && are_neighbours(own, stars, node, face)))
                    continue;
                if (append(found, vertex, &pair))
                    return -1;
            }
        }
    return 0;
}

/* Sort what was found by vertex, faces of one vertex in the order of their slots. */
static int sort_pairs(Pairs *pairs, const Found *found)
{
    if (pairs->pair_room < found->count) {
        PyMem_RawFree(pairs->pair);
        pairs->pair_room = found->room;
        pairs->pair = PyMem_RawMalloc(sizeof(Pair) * (size_t)found->room);
        if (pairs->pair == NULL)
            return -1;
    }
    int32_t *start = pairs->start;
    memset(start, 0, sizeof(int32_t) * (size_t)(pairs->vertices + 1));
    for (int p = 0; p < found->count; p++)
        start[found->vertex[p] + 1]++;
    for (int k = 0; k < pairs->vertices; k++)
        start[k + 1] += start[k];
    for (int p = 0; p < found->count; p++)
        pairs->pair[start[found->vertex[p]]++] = found->pair[p];
    for (int k = pairs->vertices; k > 0; k--) /* each has come to the start of the next */
        start[k] = start[k - 1];
    start[0] = 0;
    return 0;
}

/* Collect the vertices of the pairs and of their faces. */
static void find_used(Pairs *pairs)
{
    for (int k = 0; k < pairs->vertices; k++)
        pairs->used[k] = pairs->start[k] < pairs->start[k + 1];
    for (int p = 0; p < pairs->start[pairs->vertices]; p++)
        for (int a = 0; a < 3; a++)
            pairs->used[pairs->pair[p].corner[a]] = 1;
    pairs->uses = 0;
    for (int k = 0; k < pairs->vertices; k++)
        if (pairs->used[k])
            pairs->used[pairs->uses++] = k;
}

/* Find the vertices near all faces; return -1 without memory. */
static int look_everywhere(const Pairs *pairs, const Grid *grid, const Stars *stars, Found *found)
{
    for (int b = 0, first = 0; b < pairs->bodies; first += stars[b++].count)
        for (int f = 0; f < pairs->body[b]->faces; f++)
            if (is_joined(pairs->body[b], f) && look_around(pairs, grid, stars + b, first, b, f, found))
                return -1;
    return 0;
}

/* Find all pairs anew; return -1 without memory. */
int find_pairs(Pairs *pairs)
{
    Grid grid = {.start = NULL};
    Found found = {0};
    Stars *stars = PyMem_RawCalloc((size_t)pairs->bodies, sizeof(Stars));
    int failed = stars == NULL || find_room(pairs);
    pairs->vertices = 0;
    for (int b = 0; b < pairs->bodies && !failed; b++) {
        int32_t *place = no_places(pairs->body[b]);
        failed = place == NULL;
        if (!failed) {
            add_vertices(pairs, b, place);
            failed = find_stars(pairs->body[b], place, stars + b);
        }
    }
    if (!failed) {
        place_vertices(pairs);
        int made = make_grid(pairs, &grid);
        failed = made < 0 || (made && look_everywhere(pairs, &grid, stars, &found)) || sort_pairs(pairs, &found);
    }
    if (!failed)
        find_used(pairs);
    for (int b = 0; b < pairs->bodies && !failed; b++)
        pairs->changes[b] = pairs->body[b]->changes;
    pairs->are_known = !failed;
    pairs->moved = 0.0;
    for (int b = 0; b < pairs->bodies && stars; b++)
        free_stars(stars + b);
    PyMem_RawFree(stars);
    PyMem_RawFree(grid.start);
    PyMem_RawFree(grid.vertex);
    PyMem_RawFree(found.pair);
    PyMem_RawFree(found.vertex);
    return failed ? -1 : 0;
}
