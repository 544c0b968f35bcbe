/* Sharp edges in a body: what an edge slips through is cut.

An edge is a line of samples between two spheres, which go where the instrument goes. In the tissue each sample has a
front, the point of the resting body up to which it has cut. The front resists like dry friction: the edge carries the
tissue along until the force is toughness times width, then it slips, and the front follows. So the work of cutting is
toughness times swept area. An edge pushes forward only; backwards it leaves its cut. A blunt edge never slips.
*/

#include "_solid.h"
#include "_vectors.h"

#define ITERATIONS 6
#define INSIDE -1e-6    /* least shape function of a point in an element */
#define IN_CUT -0.5     /* the same, beyond a face that has been cut: the front runs along it */
#define TURNING 2e-4    /* way over which the direction of a front turns, m */
#define AT_LIMIT 0.999
#define BEARS 4.5  /* square of the norm of F, 3 at rest, up to which an element bears a front's whole force */
#define FAILS 6.5  /* the same, from which it bears none */

typedef struct {
    int32_t node[4];
    double share[4], weight[4], edge[3], forward[3], goal[3], mass, width, impulse[3];
    double most, borne; /* impulse of slipping, and its part that the mesh bears */
} Front;

static int is_blunt(const Edges *edges, int edge)
{
    return isinf(edges->toughness[edge]);
}

/* Place of a sample at an end of a sub-step. */
static void sample_at(const Spheres *spheres, const Edges *edges, int edge, double along, int place, double x[3])
{
    const double *centre = spheres->path + 3 * (place * spheres->count);
    const double *a = centre + 3 * edges->ends[2 * edge], *b = centre + 3 * edges->ends[2 * edge + 1];
    for (int i = 0; i < 3; i++)
        x[i] = (1.0 - along) * a[i] + along * b[i];
}

/* Direction of an edge; return its length. */
static double edge_line(const Spheres *spheres, const Edges *edges, int edge, int place, double line[3])
{
    double a[3];
    sample_at(spheres, edges, edge, 0.0, place, a);
    sample_at(spheres, edges, edge, 1.0, place, line);
    for (int i = 0; i < 3; i++)
        line[i] -= a[i];
    double length = sqrt(dot(line, line));
    normalise(line);
    return length;
}

/* Shape functions of an element at a point of the resting body. */
static void shares_at(const Body *body, int element, const double X[3], double share[4])
{
    const float *first = body->rest + 4 * *corner_of(body, element, 0);
    share[0] = 1.0;
    for (int a = 0; a < 3; a++) {
        share[a + 1] = 0.0;
        for (int i = 0; i < 3; i++)
            share[a + 1] += (double)body->gradients[36 * (element / 4) + 4 * (3 * a + i) + element % 4] *
                            (X[i] - (double)first[i]);
        share[0] -= share[a + 1];
    }
}

/* Present place of a point of an element. */
static void place_of(const Body *body, int element, const double share[4], double x[3])
{
    for (int i = 0; i < 3; i++) {
        x[i] = 0.0;
        for (int a = 0; a < 4; a++) {
            int node = *corner_of(body, element, a);
            x[i] += share[a] * ((double)body->rest[4 * node + i] + (double)body->displacement[4 * node + i]);
        }
    }
}

/* Edge matrix of the present element, column by column. */
static void present_edges(const Body *body, int element, double edges[9])
{
    int first = *corner_of(body, element, 0);
    for (int a = 0; a < 3; a++) {
        int node = *corner_of(body, element, a + 1);
        for (int i = 0; i < 3; i++)
            edges[3 * a + i] = (double)(body->rest[4 * node + i] - body->rest[4 * first + i]) +
                               (double)(body->displacement[4 * node + i] - body->displacement[4 * first + i]);
    }
}

/* Coordinates of a vector along the present edges; return 0 for a flat element. */
static int along_edges(const double edges[9], const double v[3], double out[3])
{
    double whole = 0.0;
    for (int a = 0; a < 3; a++) {
        const double *p = edges + 3 * ((a + 1) % 3), *q = edges + 3 * ((a + 2) % 3);
        double n[3] = {p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]};
        whole = dot(edges + 3 * a, n);
        if (whole == 0.0)
            return 0;
        out[a] = dot(v, n) / whole;
    }
    return 1;
}

/* Turn a vector of the present body into the resting body, by an element. */
static void to_rest(const Body *body, int element, const double v[3], double out[3])
{
    double edges[9], share[3];
    out[0] = out[1] = out[2] = 0.0;
    present_edges(body, element, edges);
    if (!along_edges(edges, v, share))
        return;
    int first = *corner_of(body, element, 0);
    for (int a = 0; a < 3; a++)
        for (int i = 0; i < 3; i++)
            out[i] += share[a] * (double)(body->rest[4 * *corner_of(body, element, a + 1) + i] - body->rest[4 * first + i]);
}

/* Turn a vector of the resting body into the present body, by an element. */
static void to_present(const Body *body, int element, const double v[3], double out[3])
{
    int first = *corner_of(body, element, 0);
    for (int i = 0; i < 3; i++)
        out[i] = v[i];
    for (int a = 0; a < 3; a++) {
        int node = *corner_of(body, element, a + 1);
        double share = 0.0;
        for (int i = 0; i < 3; i++)
            share += (double)body->gradients[36 * (element / 4) + 4 * (3 * a + i) + element % 4] * v[i];
        for (int i = 0; i < 3; i++)
            out[i] += share * (double)(body->displacement[4 * node + i] - body->displacement[4 * first + i]);
    }
}

/* Go to the element with the point X of the resting body; return -2 - e where it leaves the body from e. */
static int walk(const Body *body, int element, const double X[3])
{
    for (int k = 0; k < 256; k++) {
        double share[4];
        int least = 0;
        shares_at(body, element, X, share);
        for (int a = 1; a < 4; a++)
            least = share[a] < share[least] ? a : least;
        int other = body->across[4 * element + least];
        if (share[least] >= (other >= 0 || ~other < body->skin ? INSIDE : IN_CUT))
            return element;
        if (other < 0)
            return -2 - element;
        element = other / 4;
    }
    return -2 - element;
}

/* Write the elements near all of an edge's samples at the start of a step; return how many. */
static int elements_near(const Body *body, const Spheres *spheres, const Edges *edges, int edge, int32_t *near)
{
    double a[3], b[3], low[3], high[3];
    sample_at(spheres, edges, edge, 0.0, 0, a);
    sample_at(spheres, edges, edge, 1.0, 0, b);
    for (int i = 0; i < 3; i++)
        low[i] = a[i] < b[i] ? a[i] : b[i], high[i] = a[i] < b[i] ? b[i] : a[i];
    int found = 0;
    for (int e = 0; e < 4 * body->blocks; e++) {
        int outside = is_gone(body, e);
        for (int i = 0; i < 3 && !outside; i++) {
            double least = INFINITY, most = -INFINITY;
            for (int c = 0; c < 4; c++) {
                int node = *corner_of(body, e, c);
                double x = (double)body->rest[4 * node + i] + (double)body->displacement[4 * node + i];
                least = x < least ? x : least, most = x > most ? x : most;
            }
            outside = least > high[i] || most < low[i];
        }
        if (!outside)
            near[found++] = e;
    }
    return found;
}

/* Let a sample at `x` that enters an element start to cut along `way`; write where it has come from to `begun`. */
static int enter(const Body *body, int element, const double x[3], const double way[3], double *front, double *ahead,
                 double *begun)
{
    int first = *corner_of(body, element, 0);
    double edges[9], share[3], from[3];
    for (int i = 0; i < 3; i++)
        from[i] = x[i] - (double)body->rest[4 * first + i] - (double)body->displacement[4 * first + i];
    present_edges(body, element, edges);
    if (!along_edges(edges, from, share))
        return 0;
    if (share[0] < 0.0 || share[1] < 0.0 || share[2] < 0.0 || share[0] + share[1] + share[2] > 1.0)
        return 0;
    to_rest(body, element, way, ahead);
    for (int i = 0; i < 3; i++) {
        front[i] = (double)body->rest[4 * first + i];
        for (int a = 0; a < 3; a++)
            front[i] += share[a] * (double)(body->rest[4 * *corner_of(body, element, a + 1) + i] - body->rest[4 * first + i]);
        begun[i] = front[i] - ahead[i];
    }
    return normalise(ahead);
}

/* Let samples enter the body, and leave it where they are no longer at their front; note where all fronts are. */
void engage(const Body *body, const Spheres *spheres, const Edges *edges, int sub_steps, double *begun)
{
    int32_t *near = PyMem_RawMalloc(sizeof(int32_t) * 4 * (size_t)body->blocks);
    for (int edge = 0; edge < edges->count && near != NULL; edge++) {
        double line[3];
        int found = -1;
        edge_line(spheres, edges, edge, 0, line);
        for (int s = 0; s < edges->samples && edges->toughness[edge] < 0.0; s++)
            edges->element[edge * edges->samples + s] = -1;
        if (edges->toughness[edge] < 0.0)
            continue;
        for (int s = 0; s < edges->samples; s++) {
            int k = edge * edges->samples + s;
            double along = (s + 0.5) / edges->samples, x[3], next[3], way[3];
            double *front = edges->front + 3 * k, *ahead = edges->ahead + 3 * k;
            sample_at(spheres, edges, edge, along, 0, x);
            if (edges->element[k] >= 0) {
                double share[4], at[3], forward[3];
                shares_at(body, edges->element[k], front, share);
                place_of(body, edges->element[k], share, at);
                to_present(body, edges->element[k], ahead, forward);
                normalise(forward);
                for (int i = 0; i < 3; i++)
                    at[i] = x[i] - at[i];
                double back = dot(at, forward), off;
                for (int i = 0; i < 3; i++)
                    at[i] -= back * forward[i];
                off = dot(at, line);
                if (dot(at, at) - off * off > (double)(body->limits[3] * body->limits[3]) ||
                    is_gone(body, edges->element[k]))
                    edges->element[k] = -1; /* it is elsewhere: not in its cut */
            }
            if (edges->element[k] < 0) {
                int has_left = edges->element[k] != -1;
                double last[3] = {front[0], front[1], front[2]};
                edges->element[k] = -1;
                sample_at(spheres, edges, edge, along, sub_steps, next);
                for (int i = 0; i < 3; i++)
                    way[i] = next[i] - x[i];
                double slide = dot(way, line);
                for (int i = 0; i < 3; i++)
                    way[i] -= slide * line[i];
                if (dot(way, way) == 0.0)
                    continue;
                if (found < 0)
                    found = elements_near(body, spheres, edges, edge, near);
                for (int n = 0; n < found; n++)
                    if (enter(body, near[n], x, way, front, ahead, begun + 3 * k)) {
                        edges->element[k] = near[n];
                        if (has_left && distance(last, front) < (double)body->limits[3])
                            memcpy(begun + 3 * k, last, sizeof last); /* it has come back: no hole in what is swept */
                        break;
                    }
            } else
                memcpy(begun + 3 * k, front, 3 * sizeof(double));
        }
    }
    PyMem_RawFree(near);
}

/* Share of a front's force that an element bears: the mesh is too coarse for the strain at a sharp edge. */
static double bearing(const Body *body, int element)
{
    double now[9], square = 0.0;
    present_edges(body, element, now);
    const float *g = body->gradients + 36 * (element / 4) + element % 4;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            double F = 0.0;
            for (int a = 0; a < 3; a++)
                F += now[3 * a + i] * (double)g[4 * (3 * a + j)];
            square += F * F;
        }
    double share = (FAILS - square) / (FAILS - BEARS);
    return share > 1.0 ? 1.0 : share < 0.0 ? 0.0 : share;
}

/* Fill in the front of a sample for a sub-step; return 0 if there is none. */
static int prepare(const Body *body, const Spheres *spheres, const Edges *edges, int edge, int s, int sub_step,
                   double seconds, Front *front)
{
    int k = edge * edges->samples + s, element = edges->element[k];
    if (element < 0 || is_gone(body, element))
        return 0;
    double x[3], goal[3], inverse = 0.0, along = (s + 0.5) / edges->samples;
    double length = edge_line(spheres, edges, edge, sub_step + 1, front->edge);
    shares_at(body, element, edges->front + 3 * k, front->share);
    place_of(body, element, front->share, x);
    to_present(body, element, edges->ahead + 3 * k, front->forward);
    normalise(front->forward);
    sample_at(spheres, edges, edge, along, sub_step + 1, goal);
    for (int i = 0; i < 3; i++)
        front->goal[i] = (goal[i] - x[i]) / seconds;
    for (int a = 0; a < 4; a++) {
        front->node[a] = *corner_of(body, element, a);
        front->weight[a] = front->share[a] * (double)body->inverse_mass[front->node[a]];
        inverse += front->share[a] * front->share[a] * (double)body->inverse_mass[front->node[a]];
    }
    front->mass = inverse > 0.0 ? 1.0 / inverse : 0.0;
    front->width = length / edges->samples;
    if (is_blunt(edges, edge))
        front->most = front->borne = INFINITY;
    else {
        front->most = edges->toughness[edge] * front->width * seconds;
        front->borne = front->most * bearing(body, element);
    }
    front->impulse[0] = front->impulse[1] = front->impulse[2] = 0.0;
    return front->mass > 0.0;
}

/* Push a front towards its edge, across the edge, forward only, by no more than its limit. */
static void push(const Body *body, Front *front)
{
    double wanted[3], slide;
    for (int i = 0; i < 3; i++) {
        wanted[i] = front->goal[i];
        for (int a = 0; a < 4; a++)
            wanted[i] -= front->share[a] * (double)body->velocity[4 * front->node[a] + i];
    }
    slide = dot(wanted, front->edge);
    for (int i = 0; i < 3; i++)
        wanted[i] = front->impulse[i] + front->mass * (wanted[i] - slide * front->edge[i]);
    double size = sqrt(dot(wanted, wanted)), kept = size > front->borne ? front->borne / size : 1.0;
    if (dot(wanted, front->forward) < 0.0)
        kept = 0.0;
    for (int i = 0; i < 3; i++) {
        double change = kept * wanted[i] - front->impulse[i];
        front->impulse[i] += change;
        for (int a = 0; a < 4; a++)
            body->velocity[4 * front->node[a] + i] += (float)(front->weight[a] * change);
    }
}

/* Let the edges carry the tissue along in a sub-step; write the impulses, and add the forces on the spheres. */
void slice(const Body *body, const Spheres *spheres, const Edges *edges, int sub_step, float seconds, double *impulses)
{
    for (int edge = 0; edge < edges->count; edge++) {
        Front fronts[MOST_SAMPLES];
        int which[MOST_SAMPLES], found = 0;
        for (int s = 0; s < edges->samples; s++)
            if (prepare(body, spheres, edges, edge, s, sub_step, (double)seconds, fronts + found))
                which[found++] = s;
        for (int pass = 0; pass < ITERATIONS; pass++)
            for (int k = 0; k < found; k++)
                push(body, fronts + k);
        double *force = spheres->force + 3 * sub_step * spheres->count;
        for (int k = 0; k < found; k++) {
            double along = (which[k] + 0.5) / edges->samples, size = sqrt(dot(fronts[k].impulse, fronts[k].impulse));
            int slips = size >= AT_LIMIT * fronts[k].borne && dot(fronts[k].goal, fronts[k].forward) > 0.0;
            for (int i = 0; i < 3; i++) {
                double on = -(slips ? fronts[k].most * fronts[k].forward[i] : fronts[k].impulse[i]) / (double)seconds;
                force[3 * edges->ends[2 * edge] + i] += (1.0 - along) * on;
                force[3 * edges->ends[2 * edge + 1] + i] += along * on;
            }
            memcpy(impulses + 3 * (edge * edges->samples + which[k]), fronts[k].impulse, sizeof fronts[k].impulse);
        }
    }
}

/* After the nodes have moved: let the fronts that slip come up to their edges. */
void follow(const Body *body, const Spheres *spheres, const Edges *edges, int sub_step, float seconds,
            const double *impulses)
{
    for (int edge = 0; edge < edges->count; edge++)
        for (int s = 0; s < edges->samples; s++) {
            int k = edge * edges->samples + s;
            Front front;
            if (!prepare(body, spheres, edges, edge, s, sub_step, (double)seconds, &front))
                continue;
            const double *impulse = impulses + 3 * k;
            double *ahead = edges->ahead + 3 * k, gap[3], advance[3], slide = dot(front.goal, front.edge);
            for (int i = 0; i < 3; i++)
                gap[i] = (front.goal[i] - slide * front.edge[i]) * (double)seconds;
            double slip = sqrt(dot(gap, gap));
            to_rest(body, edges->element[k], gap, advance);
            if (sqrt(dot(impulse, impulse)) < AT_LIMIT * front.borne || dot(advance, ahead) <= 0.0)
                slip = gap[0] = gap[1] = gap[2] = 0.0; /* it sticks */
            for (int i = 0; i < 3; i++)
                gap[i] += slide * front.edge[i] * (double)seconds; /* along itself an edge slides freely */
            to_rest(body, edges->element[k], gap, advance);
            *edges->area += slip * front.width;
            for (int i = 0; i < 3; i++) {
                edges->front[3 * k + i] += advance[i];
                if (slip > 0.0)
                    ahead[i] = TURNING * ahead[i] + advance[i];
            }
            normalise(ahead);
            edges->element[k] = walk(body, edges->element[k], edges->front + 3 * k);
        }
}

/* Where a sample beside `k`, which is not in the body, would be in the resting body. */
static void beside(const Body *body, const Spheres *spheres, const Edges *edges, int edge, int from, int to, int place,
                   const double *X, double out[3])
{
    int element = edges->element[edge * edges->samples + from];
    double a[3], b[3], way[3];
    sample_at(spheres, edges, edge, (from + 0.5) / edges->samples, place, a);
    sample_at(spheres, edges, edge, (to + 0.5) / edges->samples, place, b);
    for (int i = 0; i < 3; i++)
        b[i] -= a[i];
    to_rest(body, element >= 0 ? element : -2 - element, b, way);
    for (int i = 0; i < 3; i++)
        out[i] = X[i] + way[i];
}

/* Write the triangles that the edges have swept in a step, in the resting body; return how many. */
int sweep(const Body *body, const Spheres *spheres, const Edges *edges, int sub_steps, const double *begun,
          double *triangles)
{
    int found = 0;
    for (int edge = 0; edge < edges->count; edge++)
        for (int s = 0; s + 1 < edges->samples && !is_blunt(edges, edge); s++) {
            int k = edge * edges->samples + s, in[2] = {edges->element[k] != -1, edges->element[k + 1] != -1};
            double corner[4][3]; /* before and after, of both samples */
            if (!in[0] && !in[1])
                continue;
            for (int n = 0; n < 2; n++) {
                int own = in[n] ? n : 1 - n;
                const double *old = begun + 3 * (k + own), *new = edges->front + 3 * (k + own);
                if (in[n]) {
                    memcpy(corner[2 * n], old, 3 * sizeof(double));
                    memcpy(corner[2 * n + 1], new, 3 * sizeof(double));
                } else {
                    beside(body, spheres, edges, edge, s + own, s + n, 0, old, corner[2 * n]);
                    beside(body, spheres, edges, edge, s + own, s + n, sub_steps, new, corner[2 * n + 1]);
                }
            }
            double moved = 0.0;
            for (int i = 0; i < 3; i++) {
                double a = corner[1][i] - corner[0][i], b = corner[3][i] - corner[2][i];
                moved += a * a + b * b;
            }
            if (moved < 1e-18)
                continue;
            double *t = triangles + 9 * found;
            memcpy(t, corner[0], sizeof corner[0]), memcpy(t + 3, corner[2], sizeof corner[0]);
            memcpy(t + 6, corner[3], sizeof corner[0]), memcpy(t + 9, corner[0], sizeof corner[0]);
            memcpy(t + 12, corner[3], sizeof corner[0]), memcpy(t + 15, corner[1], sizeof corner[0]);
            found += 2;
        }
    return found;
}
