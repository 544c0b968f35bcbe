/* Forces of the elements of whole groups of BLOCKS blocks; included once for each kind of lanes, after `_lanes.h`. */

#define UNROLL _Pragma("GCC unroll 9")
#define SIDE_BY_SIDE 8

#define ROW(values, node) ((values) + 4u * (uint32_t)(node)) /* unsigned: one instruction less than with a sign */

/* Rows of the nodes that a corner has in one lane of each block. */
static inline Lanes rows_of(const float *values, const int32_t *node)
{
    return ROWS(ROW(values, node[0]), ROW(values, node[16]), ROW(values, node[32]), ROW(values, node[48]));
}

/* Gather the numbers of a corner's node, by lane. */
static inline void gather(const float *values, const int32_t *node, Lanes out[4])
{
    for (int l = 0; l < 4; l++)
        out[l] = rows_of(values, node + l);
    TRANSPOSE(out[0], out[1], out[2], out[3]);
}

/* Gather the last number of a corner's node, by lane. */
static inline Lanes gather_last(const float *values, const int32_t *node)
{
    return LAST(rows_of(values, node), rows_of(values, node + 1), rows_of(values, node + 2), rows_of(values, node + 3));
}

/* Add the force on each corner to its node, one after the other: two lanes may have a node in common. */
static inline void scatter(float *values, const int32_t *corner, Lanes force[4][3])
{
    Lanes row[4][4];
    UNROLL
    for (int a = 0; a < 4; a++) {
        Lanes x = force[a][0], y = force[a][1], z = force[a][2], w = ALL(0.0f);
        TRANSPOSE(x, y, z, w);
        row[a][0] = x, row[a][1] = y, row[a][2] = z, row[a][3] = w;
    }
    UNROLL
    for (int block = 0; block < BLOCKS; block++)
        UNROLL
        for (int k = 1; k <= 4; k++)
            UNROLL
            for (int l = 0; l < 4; l++) {
                float *at = ROW(values, corner[16 * block + 4 * (k % 4) + l]);
                STORE_ROW(at, ADD_ROWS(LOAD_ROW(at), ROW_OF(row[k % 4][l], block)));
            }
}

/* Where deformation gradients of the blocks from `b` on are kept, number by number for all of them. */
static inline float *kept_of(const Body *body, int b)
{
    return body->deformation + 36 * (size_t)b;
}

/* Set the deformation gradients of the blocks from `b` on, row by row. */
static inline void deform(const Body *body, int b, Lanes F[9])
{
    const int32_t *corner = body->corners + 16 * b;
    Lanes first[4], next[4];
    gather(body->displacement, corner, first);
    UNROLL
    for (int a = 0; a < 3; a++) {
        gather(body->displacement, corner + 4 * (a + 1), next);
        UNROLL
        for (int i = 0; i < 3; i++) {
            Lanes apart = SUB(next[i], first[i]);
            UNROLL
            for (int j = 0; j < 3; j++) {
                Lanes part = MUL(apart, load(body->gradients, b, 9, 3 * a + j));
                F[3 * i + j] = a == 0 ? part : ADD(F[3 * i + j], part);
            }
        }
    }
    UNROLL
    for (int i = 0; i < 9; i += 4)
        F[i] = ADD(F[i], ALL(1.0f));
}

/* Keep the deformation gradients, and add the present volumes of elements to their nodes, from block `first` to before
`last`. */
void add_volumes(const Body *body, int first, int last)
{
    for (int b = first; b < last; b += BLOCKS) {
        const int32_t *corner = body->corners + 16 * b;
        Lanes F[9];
        deform(body, b, F);
        UNROLL
        for (int i = 0; i < 9; i++)
            STORE_ALL(kept_of(body, b) + 4 * BLOCKS * i, F[i]);
        Lanes change = dot3(F[0], minor(F[4], F[8], F[5], F[7]), F[1], minor(F[5], F[6], F[3], F[8]), F[2],
                            minor(F[3], F[7], F[4], F[6]));
        change = MUL(load(body->volumes, b, 1, 0), change);
        float volume[4 * BLOCKS], *sum = body->force + 3;
        memcpy(volume, &change, sizeof volume);
        UNROLL
        for (int block = 0; block < BLOCKS; block++)
            UNROLL
            for (int l = 0; l < 4; l++) {
                const int32_t *node = corner + 16 * block + l;
                float more = volume[4 * block + l];
                UNROLL
                for (int a = 0; a < 16; a += 4)
                    *ROW(sum, node[a]) += more;
            }
    }
}

/* A group of blocks on its way through the stages. */
typedef struct {
    Lanes F[9], P[9];
} Group;

/* Take up the kept deformation gradients; set the stress of the energy, row by row. */
static inline void elastic_stress(const Body *body, int b, Group *group)
{
    const int32_t *corner = body->corners + 16 * b;
    Lanes *F = group->F, mu = load(body->shear, b, 1, 0), one = ALL(1.0f), square = one;
    Lanes pressures = gather_last(body->displacement, corner);
    UNROLL
    for (int a = 4; a < 16; a += 4)
        pressures = ADD(pressures, gather_last(body->displacement, corner + a));
    UNROLL
    for (int i = 0; i < 9; i++) {
        F[i] = LOAD_ALL(kept_of(body, b) + 4 * BLOCKS * i);
        square = ADD(square, MUL(F[i], F[i]));
    }
    Lanes stretch = MUL(mu, SUB(one, DIV(one, square)));
    Lanes squeeze = SUB(MUL(pressures, ALL(0.25f)), MUL(ALL(0.75f), mu));
    Lanes cofactor[9] = {minor(F[4], F[8], F[5], F[7]), minor(F[5], F[6], F[3], F[8]), minor(F[3], F[7], F[4], F[6]),
                         minor(F[2], F[7], F[1], F[8]), minor(F[0], F[8], F[2], F[6]), minor(F[1], F[6], F[0], F[7]),
                         minor(F[1], F[5], F[2], F[4]), minor(F[2], F[3], F[0], F[5]), minor(F[0], F[4], F[1], F[3])};
    UNROLL
    for (int i = 0; i < 9; i++)
        group->P[i] = ADD(MUL(stretch, F[i]), MUL(squeeze, cofactor[i]));
}

/* Write the Green strain of F: xx, yy, zz, yz, xz, xy. */
static inline void green_strain(const Lanes F[9], Lanes strain[6])
{
    static const int of[6][2] = {{0, 0}, {1, 1}, {2, 2}, {1, 2}, {0, 2}, {0, 1}};
    Lanes half = ALL(0.5f);
    UNROLL
    for (int k = 0; k < 6; k++) {
        int a = of[k][0], b = of[k][1];
        strain[k] = MUL(half, dot3(F[a], F[b], F[3 + a], F[3 + b], F[6 + a], F[6 + b]));
        if (k < 3)
            strain[k] = SUB(strain[k], half);
    }
}

/* Add F S to P, where S is the deviatoric stress of a branch; let its viscous strain follow. */
static inline void relax(Group *group, float *viscous, int b, Lanes stiffness, Lanes share)
{
    const Lanes *F = group->F;
    Lanes strain[6], S[6], *P = group->P;
    green_strain(F, strain);
    UNROLL
    for (int k = 0; k < 6; k++) {
        Lanes old = load(viscous, b, 6, k);
        Lanes now = ADD(old, MUL(share, SUB(strain[k], old)));
        store(viscous, b, 6, k, now);
        S[k] = MUL(stiffness, SUB(strain[k], now));
    }
    Lanes mean = MUL(ADD(ADD(S[0], S[1]), S[2]), ALL(1.0f / 3.0f));
    for (int k = 0; k < 3; k++)
        S[k] = SUB(S[k], mean);
    UNROLL
    for (int i = 0; i < 9; i += 3) { /* xx, yy, zz, yz, xz, xy */
        P[i] = ADD(P[i], dot3(F[i], S[0], F[i + 1], S[5], F[i + 2], S[4]));
        P[i + 1] = ADD(P[i + 1], dot3(F[i], S[5], F[i + 1], S[1], F[i + 2], S[3]));
        P[i + 2] = ADD(P[i + 2], dot3(F[i], S[4], F[i + 1], S[3], F[i + 2], S[2]));
    }
}

/* Add the forces of a stress to the nodes. */
static inline void add_stress(const Body *body, int b, const Lanes P[9])
{
    Lanes zero = ALL(0.0f), volume = SUB(zero, load(body->volumes, b, 1, 0)), force[4][3] = {{zero, zero, zero}};
    UNROLL
    for (int a = 0; a < 3; a++) {
        Lanes x = load(body->gradients, b, 9, 3 * a), y = load(body->gradients, b, 9, 3 * a + 1);
        Lanes z = load(body->gradients, b, 9, 3 * a + 2);
        UNROLL
        for (int i = 0; i < 3; i++) {
            force[a + 1][i] = MUL(volume, dot3(P[3 * i], x, P[3 * i + 1], y, P[3 * i + 2], z));
            force[0][i] = SUB(force[0][i], force[a + 1][i]);
        }
    }
    scatter(body->force, body->corners + 16 * b, force);
}

/* Add the forces of elements to their nodes, from block `first` to before `last`; viscous strains advance.

Some groups go side by side through one stage after the other: a processor has more to do at once than in one group. */
void add_forces(const Body *body, float seconds, int first, int last)
{
    Group group[SIDE_BY_SIDE];
    for (int start = first; start < last; start += SIDE_BY_SIDE * BLOCKS) {
        int end = start + SIDE_BY_SIDE * BLOCKS < last ? start + SIDE_BY_SIDE * BLOCKS : last;
        for (int b = start, k = 0; b < end; b += BLOCKS, k++)
            elastic_stress(body, b, group + k);
        for (int m = 0; m < body->branches; m++) {
            Lanes weight = ALL(1.5f * body->branch[2 * m]); /* 2 g times the shear modulus, 3/4 of the energy's mu */
            Lanes share = ALL(seconds / (seconds + body->branch[2 * m + 1])); /* implicit: stable for any time */
            float *viscous = body->strains + 24 * (size_t)m * (size_t)body->blocks;
            for (int b = start, k = 0; b < end; b += BLOCKS, k++)
                relax(group + k, viscous, b, MUL(load(body->shear, b, 1, 0), weight), share);
        }
        for (int b = start, k = 0; b < end; b += BLOCKS, k++)
            add_stress(body, b, group[k].P);
    }
}
