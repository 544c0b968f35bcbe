/* Elastic and viscous forces of the elements of a body.

Energy density of Smith, de Goes, Kim, Stable Neo-Hookean Flesh Simulation (ACM Trans. Graph. 37, 2018), equation 14.
Its volumetric part is that of the mean volume change around each node (Bonet, Burton, A simple average nodal pressure
tetrahedral element, Commun. Numer. Methods Eng. 14, 1998), against locking: forces are still those of an energy. A
branch of a generalised Maxwell model bears 2 mu g dev(E - e), with the Green strain E and a viscous strain e of its
own that follows E with the time constant of the branch.
*/

#include "_solid.h"
#include "_lanes.h"

/* Gather the numbers of four nodes, by lane. */
static inline void gather(const float *values, const int32_t *node, Lanes out[4])
{
    Lanes a = LOAD(values + 4 * node[0]), b = LOAD(values + 4 * node[1]);
    Lanes c = LOAD(values + 4 * node[2]), d = LOAD(values + 4 * node[3]);
    TRANSPOSE(a, b, c, d);
    out[0] = a, out[1] = b, out[2] = c, out[3] = d;
}

/* Add to the numbers of four nodes, one after the other: two lanes may have a node in common. */
static inline void scatter(float *values, const int32_t *node, Lanes x, Lanes y, Lanes z)
{
    Lanes w = ALL(0.0f);
    TRANSPOSE(x, y, z, w);
    STORE(values + 4 * node[0], ADD(LOAD(values + 4 * node[0]), x));
    STORE(values + 4 * node[1], ADD(LOAD(values + 4 * node[1]), y));
    STORE(values + 4 * node[2], ADD(LOAD(values + 4 * node[2]), z));
    STORE(values + 4 * node[3], ADD(LOAD(values + 4 * node[3]), w));
}

/* Deformation gradient of a block, row by row; return the sum of the corners' pressures. */
static inline Lanes deformation(const Body *body, int block, Lanes F[9])
{
    const int32_t *corner = body->corners + 16 * block;
    const float *gradient = body->gradients + 36 * block;
    Lanes first[4], next[4];
    gather(body->displacement, corner, first);
    Lanes pressure = first[3];
    for (int a = 0; a < 3; a++) {
        gather(body->displacement, corner + 4 * (a + 1), next);
        pressure = ADD(pressure, next[3]);
        for (int i = 0; i < 3; i++) {
            Lanes apart = SUB(next[i], first[i]);
            for (int j = 0; j < 3; j++) {
                Lanes part = MUL(apart, LOAD(gradient + 4 * (3 * a + j)));
                F[3 * i + j] = a == 0 ? part : ADD(F[3 * i + j], part);
            }
        }
    }
    for (int i = 0; i < 9; i += 4)
        F[i] = ADD(F[i], ALL(1.0f));
    return pressure;
}

/* Set the pressure at every node. */
static void set_pressures(const Body *body)
{
    float *force = body->force, *displacement = body->displacement;
    for (int b = 0; b < body->blocks; b++) {
        const int32_t *corner = body->corners + 16 * b;
        Lanes F[9];
        deformation(body, b, F);
        Lanes change = dot3(F[0], minor(F[4], F[8], F[5], F[7]), F[1], minor(F[5], F[6], F[3], F[8]), F[2],
                            minor(F[3], F[7], F[4], F[6]));
        float volume[4];
        memcpy(volume, body->volumes + 4 * b, sizeof volume);
        float changes[4];
        memcpy(changes, &change, sizeof changes);
        for (int l = 0; l < 4; l++)
            for (int a = 0; a < 4; a++)
                force[4 * corner[4 * a + l] + 3] += volume[l] * changes[l];
    }
    for (int i = 0; i < body->nodes; i++) {
        displacement[4 * i + 3] = body->bulk[i] * (force[4 * i + 3] * body->inverse_volume[i] - 1.0f);
        force[4 * i + 3] = 0.0f;
    }
}

/* Add F S to P, where S is the deviatoric stress of a branch; let its viscous strain follow. */
static inline void relax(const Lanes F[9], const Lanes strain[6], float *viscous, Lanes stiffness, Lanes share, Lanes P[9])
{
    Lanes S[6];
    for (int k = 0; k < 6; k++) {
        Lanes old = LOAD(viscous + 4 * k);
        Lanes now = ADD(old, MUL(share, SUB(strain[k], old)));
        STORE(viscous + 4 * k, now);
        S[k] = MUL(stiffness, SUB(strain[k], now));
    }
    Lanes mean = MUL(ADD(ADD(S[0], S[1]), S[2]), ALL(1.0f / 3.0f));
    for (int k = 0; k < 3; k++)
        S[k] = SUB(S[k], mean);
    for (int i = 0; i < 9; i += 3) { /* xx, yy, zz, yz, xz, xy */
        P[i] = ADD(P[i], dot3(F[i], S[0], F[i + 1], S[5], F[i + 2], S[4]));
        P[i + 1] = ADD(P[i + 1], dot3(F[i], S[5], F[i + 1], S[1], F[i + 2], S[3]));
        P[i + 2] = ADD(P[i + 2], dot3(F[i], S[4], F[i + 1], S[3], F[i + 2], S[2]));
    }
}

/* Write the Green strain of F: xx, yy, zz, yz, xz, xy. */
static inline void green_strain(const Lanes F[9], Lanes strain[6])
{
    static const int of[6][2] = {{0, 0}, {1, 1}, {2, 2}, {1, 2}, {0, 2}, {0, 1}};
    Lanes half = ALL(0.5f);
    for (int k = 0; k < 6; k++) {
        int a = of[k][0], b = of[k][1];
        strain[k] = MUL(half, dot3(F[a], F[b], F[3 + a], F[3 + b], F[6 + a], F[6 + b]));
        if (k < 3)
            strain[k] = SUB(strain[k], half);
    }
}

/* Set the forces of all elements on the nodes; viscous strains advance by `seconds`. */
void elastic_forces(const Body *body, float seconds)
{
    memset(body->force, 0, sizeof(float) * 4 * (size_t)body->nodes);
    set_pressures(body);
    Lanes one = ALL(1.0f), zero = ALL(0.0f), share[MOST_BRANCHES], weight[MOST_BRANCHES];
    for (int m = 0; m < body->branches; m++) {
        weight[m] = ALL(1.5f * body->branch[2 * m]); /* 2 g times the shear modulus, 3/4 of the energy's mu */
        share[m] = ALL(seconds / (seconds + body->branch[2 * m + 1])); /* implicit: stable for any time constant */
    }
    for (int b = 0; b < body->blocks; b++) {
        const int32_t *corner = body->corners + 16 * b;
        const float *gradient = body->gradients + 36 * b;
        Lanes F[9], P[9];
        Lanes pressure = MUL(deformation(body, b, F), ALL(0.25f));
        Lanes mu = LOAD(body->shear + 4 * b);
        Lanes square = one;
        for (int i = 0; i < 9; i++)
            square = ADD(square, MUL(F[i], F[i]));
        Lanes stretch = MUL(mu, SUB(one, DIV(one, square)));
        Lanes squeeze = SUB(pressure, MUL(ALL(0.75f), mu));
        Lanes cofactor[9] = {minor(F[4], F[8], F[5], F[7]), minor(F[5], F[6], F[3], F[8]), minor(F[3], F[7], F[4], F[6]),
                             minor(F[2], F[7], F[1], F[8]), minor(F[0], F[8], F[2], F[6]), minor(F[1], F[6], F[0], F[7]),
                             minor(F[1], F[5], F[2], F[4]), minor(F[2], F[3], F[0], F[5]), minor(F[0], F[4], F[1], F[3])};
        for (int i = 0; i < 9; i++)
            P[i] = ADD(MUL(stretch, F[i]), MUL(squeeze, cofactor[i]));
        if (body->branches) {
            Lanes strain[6];
            green_strain(F, strain);
            for (int m = 0; m < body->branches; m++)
                relax(F, strain, body->strains + 24 * ((size_t)m * body->blocks + b), MUL(mu, weight[m]), share[m], P);
        }
        Lanes volume = SUB(zero, LOAD(body->volumes + 4 * b)), sum[3] = {zero, zero, zero};
        for (int a = 0; a < 3; a++) {
            Lanes x = LOAD(gradient + 12 * a), y = LOAD(gradient + 12 * a + 4), z = LOAD(gradient + 12 * a + 8), force[3];
            for (int i = 0; i < 3; i++) {
                force[i] = MUL(volume, dot3(P[3 * i], x, P[3 * i + 1], y, P[3 * i + 2], z));
                sum[i] = SUB(sum[i], force[i]);
            }
            scatter(body->force, corner + 4 * (a + 1), force[0], force[1], force[2]);
        }
        scatter(body->force, corner, sum[0], sum[1], sum[2]);
    }
}
