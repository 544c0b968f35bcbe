/* Ties of a clip: pairs of nodes that come together and stay together. Their common momentum is kept. */

#include "_solid.h"

#define GAP 1e-4f          /* distance at which a pair stays, m */
#define CLOSING_TIME 0.05f /* time in which the rest of the distance falls by a factor of e, s */

void tie(const Body *body)
{
    for (int t = 0; t < body->ties && body->tied[2 * t] >= 0; t++) {
        int a = body->tied[2 * t], b = body->tied[2 * t + 1];
        float d[3], square = 0.0f, *u = body->velocity + 4 * a, *v = body->velocity + 4 * b;
        float w = body->inverse_mass[a] + body->inverse_mass[b];
        if (w == 0.0f)
            continue;
        for (int k = 0; k < 3; k++) {
            d[k] = body->rest[4 * b + k] + body->displacement[4 * b + k] - body->rest[4 * a + k] - body->displacement[4 * a + k];
            square += d[k] * d[k];
        }
        float length = sqrtf(square), rate = length > 0.0f ? (length - GAP) / (length * CLOSING_TIME) : 0.0f;
        for (int k = 0; k < 3; k++) {
            float wanted = -rate * d[k] - (v[k] - u[k]);
            u[k] -= body->inverse_mass[a] / w * wanted;
            v[k] += body->inverse_mass[b] / w * wanted;
        }
    }
}
