/* Nodes of a body against boxes that do not move: no node enters a box, with Coulomb friction.

A node has a velocity of its own, so one projection is exact: out of the box it approaches by its gap at most, inside
it comes out. What slips loses the friction's share of the push.
*/

#include "_solid.h"

#define AHEAD 1e-3      /* m: contacts that may close within a step */
#define RECOVERY 0.2    /* share of a depth that is undone in a sub-step */
#define FASTEST 0.05    /* m/s: out of a box, else tissue that begins inside would be thrown */

/* Signed distance of a node from a box, negative inside, and the direction out of it. */
static double distance_to(const Body *body, const double *box, int node, double normal[3])
{
    double local[3], least[3] = {0.0, 0.0, 0.0}, square = 0.0;
    for (int j = 0; j < 3; j++) {
        local[j] = 0.0;
        for (int i = 0; i < 3; i++)
            local[j] += box[3 + 3 * i + j] *
                        ((double)body->rest[4 * node + i] - box[i] + (double)body->displacement[4 * node + i]);
        double half = box[12 + j];
        least[j] = local[j] > half ? local[j] - half : local[j] < -half ? local[j] + half : 0.0;
        square += least[j] * least[j];
    }
    double distance = sqrt(square);
    if (distance == 0.0) {
        int side = 0;
        for (int j = 1; j < 3; j++)
            side = box[12 + j] - fabs(local[j]) < box[12 + side] - fabs(local[side]) ? j : side;
        distance = fabs(local[side]) - box[12 + side];
        least[side] = local[side] < 0.0 ? distance : -distance;
        square = distance * distance;
        if (square == 0.0)
            least[side] = local[side] < 0.0 ? -1.0 : 1.0, square = 1.0;
    }
    double size = sqrt(square);
    for (int i = 0; i < 3; i++)
        normal[i] = (box[3 + 3 * i] * least[0] + box[4 + 3 * i] * least[1] + box[5 + 3 * i] * least[2]) / size;
    return distance;
}

/* Write the pairs of a box and a node that may meet within `seconds`; return how many. Forces begin at 0. */
int find_beside(const Body *body, double seconds, int32_t *beside)
{
    int found = 0;
    double normal[3];
    memset(body->support, 0, sizeof(double) * 3 * (size_t)body->boxes);
    for (int b = 0; b < body->boxes; b++)
        for (int i = 0; i < body->nodes; i++) {
            const float *v = body->velocity + 4 * i;
            double way = 2.0 * seconds * sqrt((double)(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]));
            if (body->inverse_mass[i] > 0.0f && distance_to(body, body->box + 16 * b, i, normal) < AHEAD + way)
                beside[2 * found] = b, beside[2 * found + 1] = i, found++;
        }
    return found;
}

/* Stop nodes at the boxes; add the forces on the boxes. */
void rest_on(const Body *body, const int32_t *beside, int count, double seconds)
{
    for (int p = 0; p < count; p++) {
        int b = beside[2 * p], node = beside[2 * p + 1];
        const double *box = body->box + 16 * b;
        float *velocity = body->velocity + 4 * node;
        double normal[3], along = 0.0, square = 0.0, slip[3];
        double gap = distance_to(body, box, node, normal), least = -gap / seconds;
        if (gap < 0.0)
            least = RECOVERY * least < FASTEST ? RECOVERY * least : FASTEST;
        for (int i = 0; i < 3; i++)
            along += normal[i] * (double)velocity[i];
        if (!(along < least))
            continue;
        for (int i = 0; i < 3; i++) {
            slip[i] = (double)velocity[i] - along * normal[i];
            square += slip[i] * slip[i];
        }
        double lost = box[15] * (least - along), size = sqrt(square), kept = size > lost ? 1.0 - lost / size : 0.0;
        for (int i = 0; i < 3; i++) {
            float after = (float)(least * normal[i] + kept * slip[i]);
            body->support[3 * b + i] += (double)body->mass[node] * ((double)velocity[i] - (double)after) / seconds;
            velocity[i] = after;
        }
    }
}
