/* Faces open where a blade has swept, and where tissue is stretched too far.

A face opens if the line between the middles of its two elements is crossed, so a cut without holes leaves no bridges.
Its nodes are moved onto the cut first, as far as no element becomes sharper than the body's limit, for which the
sub-steps are made: both sides are smooth. Mass stays with the elements.
*/

#include "_solid.h"
#include "_vectors.h"

#define SAME_SIDE 0.35     /* sine of the least angle between faces of different sides of the surface */
#define LEAST_ALONG 0.5    /* sine of the least angle between cut and surface for a move along the surface */
#define EDGE_SLACK 1e-9    /* of a triangle's edges, in its own coordinates: neighbours leave no gap */
#define BOX_SLACK 1e-8     /* m: of a box around triangles, more than the slack of their edges */
#define POWER_ITERATIONS 12
#define PATCH 2.5 /* half a side of a patch of a tear, over an edge of its element */

/* Middle of an element of the uncut mesh: moved nodes must not carry it across what has been swept already. */
static void middle_of(const Body *body, int element, double middle[3])
{
    for (int i = 0; i < 3; i++)
        middle[i] = (double)body->middles[3 * element + i];
}

/* Whether the way from a to b crosses a triangle: Moeller, Trumbore, Fast, minimum storage ray/triangle intersection,
J. Graphics Tools 2 (1997). */
static int crosses(const double a[3], const double b[3], const double *triangle)
{
    double way[3], u[3], v[3], from[3], p[3], q[3];
    for (int i = 0; i < 3; i++) {
        double first = triangle[i];
        way[i] = b[i] - a[i], u[i] = triangle[3 + i] - first, v[i] = triangle[6 + i] - first, from[i] = a[i] - first;
    }
    cross(way, v, p);
    double whole = dot(u, p);
    if (whole == 0.0)
        return 0;
    cross(from, u, q);
    double s = dot(from, p) / whole, t = dot(way, q) / whole, along = dot(v, q) / whole;
    return s >= -EDGE_SLACK && t >= -EDGE_SLACK && s + t <= 1.0 + EDGE_SLACK && along >= 0.0 && along < 1.0;
}

static int has_corner(const Body *body, int element, int32_t node)
{
    for (int a = 0; a < 4; a++)
        if (*corner_of(body, element, a) == node)
            return 1;
    return 0;
}

/* Mean deformation gradient, less the unit matrix, of the elements around a node; return how many there are. */
static int mean_strain(const Body *body, int32_t node, const int32_t *elements, int count, double mean[9])
{
    double whole = 0.0;
    int found = 0;
    memset(mean, 0, 9 * sizeof(double));
    for (int k = 0; k < count; k++) {
        int e = elements[k];
        if (!has_corner(body, e, node))
            continue;
        double gradients[9], volume = rest_gradients(body, e, gradients);
        const float *first = body->displacement + 4 * *corner_of(body, e, 0);
        for (int a = 0; a < 3; a++)
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++)
                    mean[3 * i + j] += volume * gradients[3 * a + j] *
                                       ((double)body->displacement[4 * *corner_of(body, e, a + 1) + i] - (double)first[i]);
        whole += volume;
        found++;
    }
    for (int i = 0; i < 9; i++)
        mean[i] /= whole > 0.0 ? whole : 1.0;
    return found;
}

/* Collect up to three directions across which the node must not move: the sides of the surface around it. */
static int sides_at(const Body *body, int32_t node, const int32_t *elements, int count, double sides[9])
{
    int found = 0;
    for (int k = 0; k < count; k++)
        for (int a = 0; a < 4 && found < 3; a++) {
            int face = 4 * elements[k] + a;
            if (body->across[face] >= 0)
                continue;
            const int32_t *corner = body->surface + 3 * ~body->across[face];
            if (corner[0] != node && corner[1] != node && corner[2] != node)
                continue;
            double u[3], v[3], normal[3];
            for (int i = 0; i < 3; i++) {
                u[i] = (double)body->rest[4 * corner[1] + i] - (double)body->rest[4 * corner[0] + i];
                v[i] = (double)body->rest[4 * corner[2] + i] - (double)body->rest[4 * corner[0] + i];
            }
            cross(u, v, normal);
            double size = sqrt(dot(normal, normal));
            for (int i = 0; i < 3; i++)
                normal[i] /= size;
            for (int s = 0; s < found; s++) {
                double along = dot(normal, sides + 3 * s);
                for (int i = 0; i < 3; i++)
                    normal[i] -= along * sides[3 * s + i];
            }
            size = sqrt(dot(normal, normal));
            if (size < SAME_SIDE)
                continue;
            for (int i = 0; i < 3; i++)
                sides[3 * found + i] = normal[i] / size;
            found++;
        }
    return found;
}

/* Whether all elements around a node are well shaped; with `write`, note their new shapes. */
static int is_fit(Body *body, int32_t node, const int32_t *elements, int count, int write)
{
    for (int k = 0; k < count; k++) {
        int e = elements[k];
        if (!has_corner(body, e, node))
            continue;
        double gradients[9], volume = rest_gradients(body, e, gradients);
        if (!(volume > 0.0) || !(sharpness_of(gradients) <= (double)body->limits[1]))
            return 0;
        if (write) {
            body->volumes[e] = (float)volume;
            for (int i = 0; i < 9; i++)
                body->gradients[36 * (e / 4) + 4 * i + e % 4] = (float)gradients[i];
        }
    }
    return 1;
}

/* Move a node along the surface onto the plane of a triangle, as far as its elements allow. */
static void place_on(Body *body, int32_t node, const double *triangle, const int32_t *elements, int count)
{
    static const double shares[3] = {1.0, 0.6, 0.3};
    double u[3], v[3], normal[3], sides[9], mean[9], from[3];
    float *rest = body->rest + 4 * node, before[3] = {rest[0], rest[1], rest[2]};
    for (int i = 0; i < 3; i++) {
        u[i] = triangle[3 + i] - triangle[i], v[i] = triangle[6 + i] - triangle[i];
        from[i] = (double)before[i] - triangle[i];
    }
    cross(u, v, normal);
    double size = sqrt(dot(normal, normal));
    if (size == 0.0 || !mean_strain(body, node, elements, count, mean))
        return;
    for (int i = 0; i < 3; i++)
        normal[i] /= size;
    double off = dot(normal, from);
    int fixed = sides_at(body, node, elements, count, sides);
    for (int s = 0; s < fixed; s++) {
        double along = dot(normal, sides + 3 * s);
        for (int i = 0; i < 3; i++)
            normal[i] -= along * sides[3 * s + i];
    }
    size = dot(normal, normal);
    if (size < LEAST_ALONG * LEAST_ALONG)
        return;
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 3; i++)
            rest[i] = (float)((double)before[i] - shares[k] * off * normal[i] / size);
        if (!is_fit(body, node, elements, count, 0))
            continue;
        is_fit(body, node, elements, count, 1);
        body->flags[node] |= PLACED;
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                body->displacement[4 * node + i] += (float)(mean[3 * i + j] * (double)(rest[j] - before[j]));
        return;
    }
    memcpy(rest, before, sizeof before);
}

/* Whether the way from a to b may meet what a box contains. */
static int may_meet(const double a[3], const double b[3], const double low[3], const double high[3])
{
    int beside = 0;
    for (int i = 0; i < 3; i++) {
        double least = low[i] - BOX_SLACK, most = high[i] + BOX_SLACK;
        beside |= (a[i] < least && b[i] < least) || (a[i] > most && b[i] > most);
    }
    return !beside;
}

/* Number of the first triangle on the way between the middles of two elements, or -1. */
static int first_crossed(const double a[3], const double b[3], const double *triangles, int count)
{
    for (int t = 0; t < count; t++)
        if (crosses(a, b, triangles + 9 * t))
            return t;
    return -1;
}

/* Open what swept triangles (count, 3, 3), in the resting body, separate; return how many faces, or -1. */
int cut_along(Body *body, const double *triangles, int count)
{
    double low[3], high[3];
    for (int i = 0; i < 3; i++) {
        low[i] = INFINITY, high[i] = -INFINITY;
        for (int k = 0; k < 3 * count; k++) {
            low[i] = triangles[3 * k + i] < low[i] ? triangles[3 * k + i] : low[i];
            high[i] = triangles[3 * k + i] > high[i] ? triangles[3 * k + i] : high[i];
        }
    }
    double around = (double)body->limits[3];
    int elements = 4 * body->blocks, near = 0, found = 0, opened = -1;
    int32_t *close = PyMem_RawMalloc(sizeof(int32_t) * (size_t)elements);
    int32_t *faces = PyMem_RawMalloc(sizeof(int32_t) * (size_t)elements * 8), *by = faces + 4 * elements;
    if (close != NULL && faces != NULL) {
        for (int e = 0; e < elements; e++) {
            double a[3], b[3];
            if (is_gone(body, e))
                continue;
            middle_of(body, e, a);
            int is_far = 0;
            for (int i = 0; i < 3; i++)
                is_far |= a[i] < low[i] - around || a[i] > high[i] + around;
            if (is_far)
                continue;
            close[near++] = e;
            for (int f = 4 * e; f < 4 * e + 4; f++) {
                if (body->across[f] < 0)
                    continue;
                middle_of(body, body->across[f] / 4, b);
                int t = may_meet(a, b, low, high) ? first_crossed(a, b, triangles, count) : -1;
                if (t >= 0)
                    faces[found] = f, by[found++] = t;
            }
        }
        for (int k = 0; k < found; k++)
            for (int a = 0; a < 4; a++) {
                int32_t node = *corner_of(body, faces[k] / 4, a);
                if (a != faces[k] % 4 && !(body->flags[node] & PLACED))
                    place_on(body, node, triangles + 9 * by[k], close, near);
            }
        opened = found ? open_faces(body, faces, found) : 0;
    }
    PyMem_RawFree(close);
    PyMem_RawFree(faces);
    return opened;
}

/* Cubic root of a positive number, by Newton's method: that of libm differs from one to the other. */
static double cbrt_of(double x)
{
    double y = sqrt(sqrt(x)), last = 0.0;
    for (int k = 0; k < 60 && y != last; k++)
        last = y, y = (2.0 * y + x / (y * y)) / 3.0;
    return y;
}

/* Right Cauchy-Green tensor of an element, xx, yy, zz, yz, xz, xy. */
static void cauchy_green(const Body *body, int element, double C[6])
{
    static const int of[6][2] = {{0, 0}, {1, 1}, {2, 2}, {1, 2}, {0, 2}, {0, 1}};
    const float *first = body->displacement + 4 * *corner_of(body, element, 0);
    double F[9] = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
    for (int a = 0; a < 3; a++)
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                F[3 * i + j] += (double)body->gradients[36 * (element / 4) + 4 * (3 * a + j) + element % 4] *
                                (double)(body->displacement[4 * *corner_of(body, element, a + 1) + i] - first[i]);
    for (int k = 0; k < 6; k++) {
        int a = of[k][0], b = of[k][1];
        C[k] = F[a] * F[b] + F[3 + a] * F[3 + b] + F[6 + a] * F[6 + b];
    }
}

static void times(const double C[6], const double v[3], double out[3])
{
    out[0] = C[0] * v[0] + C[5] * v[1] + C[4] * v[2];
    out[1] = C[5] * v[0] + C[1] * v[1] + C[3] * v[2];
    out[2] = C[4] * v[0] + C[3] * v[1] + C[2] * v[2];
}

/* Square of the largest stretch of an element and its direction in the resting body, 0 if it is below `least`; no
function of libm, for the same bits. */
static double largest_stretch(const double C[6], double least, double v[3])
{
    double next[3];
    double a = C[0] - 1.0, b = C[1] - 1.0, c = C[2] - 1.0;
    double strain = a * a + b * b + c * c + 2.0 * (C[3] * C[3] + C[4] * C[4] + C[5] * C[5]);
    if (strain < (least - 1.0) * (least - 1.0))
        return 0.0; /* the norm of C - 1 bounds its largest eigenvalue */
    int start = C[0] >= C[1] ? (C[0] >= C[2] ? 0 : 2) : (C[1] >= C[2] ? 1 : 2);
    for (int i = 0; i < 3; i++)
        v[i] = i == start ? 1.0 : 0.0;
    double square = 0.0;
    for (int k = 0; k < POWER_ITERATIONS; k++) {
        times(C, v, next);
        square = sqrt(dot(next, next));
        for (int i = 0; i < 3; i++)
            v[i] = next[i] / square;
    }
    return square < least ? 0.0 : square;
}

/* Inner face of an element across which the tissue is stretched most, or -1. */
static int stretched_face(const Body *body, int element)
{
    double C[6], gradients[9], most = 0.0;
    int found = -1;
    cauchy_green(body, element, C);
    rest_gradients(body, element, gradients);
    for (int a = 0; a < 4; a++) {
        if (body->across[4 * element + a] < 0)
            continue;
        double n[3], pulled[3]; /* the gradient of a corner is normal to the opposite face */
        for (int i = 0; i < 3; i++)
            n[i] = a ? gradients[3 * (a - 1) + i] : -(gradients[i] + gradients[3 + i] + gradients[6 + i]);
        times(C, n, pulled);
        double stretch = dot(n, pulled) / dot(n, n);
        if (stretch > most)
            most = stretch, found = 4 * element + a;
    }
    return found;
}

/* Edge of a regular tetrahedron of the element's volume. */
static double edge_of(const Body *body, int element)
{
    return cbrt_of(6.0 * 1.4142135623730951 * (double)body->volumes[element]);
}

/* Energy of distortion that an element sets free by each area of tear: its density times the element's edge. */
static double release(const Body *body, int element)
{
    double C[6];
    cauchy_green(body, element, C);
    return 0.5 * (double)body->shear[element] * (C[0] + C[1] + C[2] - 3.0) * edge_of(body, element);
}

/* Whether an element tears: `at_end` of a tear by its toughness, if there is one, else by its stretch. */
static double tearing(const Body *body, const Limits *limits, int element, int at_end)
{
    double C[6], v[3];
    if (at_end && limits->toughness > 0.0) {
        double free = release(body, element);
        return free >= limits->toughness ? free : 0.0;
    }
    cauchy_green(body, element, C);
    return largest_stretch(C, limits->stretch * limits->stretch, v);
}

/* Mean right Cauchy-Green tensor of an element and of those that share a node with it. */
static void mean_cauchy_green(const Body *body, int element, double mean[6])
{
    memset(mean, 0, 6 * sizeof(double));
    for (int e = 0; e < 4 * body->blocks; e++) {
        double C[6];
        int is_near = 0;
        for (int a = 0; a < 4; a++)
            is_near |= has_corner(body, element, *corner_of(body, e, a));
        if (!is_near || is_gone(body, e))
            continue;
        cauchy_green(body, e, C);
        for (int i = 0; i < 6; i++)
            mean[i] += (double)body->volumes[e] * C[i];
    }
    double whole = (mean[0] + mean[1] + mean[2]) / 3.0;
    for (int i = 0; i < 6; i++)
        mean[i] *= whole > 0.0 ? 4.0 / whole : 1.0; /* the scale is none of the direction's */
}

/* Write two triangles around the end of a tear in an element, or around its middle, across its largest stretch. */
static void write_patch(const Body *body, int element, const uint8_t *is_end, double *triangles)
{
    double C[6], v[3] = {1.0, 0.0, 0.0}, u[3], w[3], middle[3] = {0.0, 0.0, 0.0}, half = PATCH * edge_of(body, element);
    int count = 0;
    for (int a = 0; a < 4; a++) {
        int32_t node = *corner_of(body, element, a);
        for (int i = 0; i < 3 && is_end[node]; i++)
            middle[i] += (double)body->rest[4 * node + i];
        count += is_end[node] != 0;
    }
    if (count)
        for (int i = 0; i < 3; i++)
            middle[i] /= count;
    else
        middle_of(body, element, middle);
    mean_cauchy_green(body, element, C);
    largest_stretch(C, 1.0, v);
    int least = fabs(v[0]) < fabs(v[1]) ? (fabs(v[0]) < fabs(v[2]) ? 0 : 2) : (fabs(v[1]) < fabs(v[2]) ? 1 : 2);
    double axis[3] = {least == 0 ? 1.0 : 0.0, least == 1 ? 1.0 : 0.0, least == 2 ? 1.0 : 0.0};
    cross(v, axis, u);
    normalise(u);
    cross(v, u, w);
    static const double sign[6][2] = {{-1.0, -1.0}, {1.0, -1.0}, {1.0, 1.0}, {-1.0, -1.0}, {1.0, 1.0}, {-1.0, 1.0}};
    for (int k = 0; k < 6; k++)
        for (int i = 0; i < 3; i++)
            triangles[3 * k + i] = middle[i] + half * (sign[k][0] * u[i] + sign[k][1] * w[i]);
}

/* Mark the nodes of faces that were opened. */
static void mark_ends(const Body *body, uint8_t *is_end)
{
    for (int slot = body->skin; slot < body->faces; slot++)
        for (int a = 0; a < 3 && body->surface[3 * slot] >= 0; a++)
            is_end[body->surface[3 * slot + a]] = 1;
}

/* Choose the element that tears: the first of those at ends of tears, else of all; -1: none. */
static int choose(const Body *body, const Limits *limits, const uint8_t *is_end)
{
    int chosen[2] = {-1, -1};
    double most[2] = {0.0, 0.0};
    for (int e = 0; e < 4 * body->blocks; e++) {
        int at_end = 0;
        for (int a = 0; a < 4; a++)
            at_end |= is_end[*corner_of(body, e, a)];
        double value = is_gone(body, e) ? 0.0 : tearing(body, limits, e, at_end);
        if (value > most[at_end])
            most[at_end] = value, chosen[at_end] = e;
    }
    return chosen[1] >= 0 ? chosen[1] : chosen[0];
}

/* Let the tissue tear: a tear runs on at its end, across the largest stretch, or begins where that is largest. One
patch at a time, since it relaxes all around. Return how many faces have been opened, or -1 without memory. */
int tear_on(Body *body, const Limits *limits)
{
    double triangles[18];
    uint8_t *is_end = PyMem_RawCalloc((size_t)body->node_room + 1, 1);
    if (is_end == NULL)
        return -1;
    mark_ends(body, is_end);
    int opened = 0, element = choose(body, limits, is_end);
    if (element >= 0) {
        write_patch(body, element, is_end, triangles);
        opened = cut_along(body, triangles, 2);
        int32_t face = opened ? -1 : stretched_face(body, element);
        opened = face >= 0 ? open_faces(body, &face, 1) : opened;
    }
    PyMem_RawFree(is_end);
    return opened;
}
