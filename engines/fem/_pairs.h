/* Vertices and faces of bodies that may meet; see _pairs.c. */

typedef struct {
    int32_t body, node;
} Vertex;

/* A face beside a vertex. */
typedef struct {
    int32_t body, slot, corner[3]; /* corners: vertices by number */
} Pair;

typedef struct {
    int bodies;
    Body *const *body;
    const double *middle; /* (bodies, 3): origins of their frames */
    double reach, skin;   /* m: distance of the pairs, and the part of it in which they may move */
    int are_known, vertices, room, pair_room;
    int *changes;         /* (bodies,): of the meshes when the pairs were found */
    Vertex *vertex;       /* (room,) */
    double moved;         /* m: bound of the way of all vertices since the pairs were found */
    double *place;        /* (room, 3): in the frame of all bodies */
    float *before;        /* (room, 3): displacements when the pairs were found */
    int32_t *start;       /* (room + 1,): first pair by vertex */
    Pair *pair;
    int uses;
    int32_t *used;        /* (room,): vertices of pairs and of their faces, ascending */
} Pairs;

/* Place of a node in the frame of all bodies. */
static inline void place_of(const Pairs *pairs, int body, int32_t node, double x[3])
{
    const Body *own = pairs->body[body];
    for (int i = 0; i < 3; i++)
        x[i] = pairs->middle[3 * body + i] + (double)own->rest[4 * node + i] + (double)own->displacement[4 * node + i];
}

void place_used(Pairs *pairs);
int have_moved(Pairs *pairs);
int find_pairs(Pairs *pairs);
void free_pairs(Pairs *pairs);
