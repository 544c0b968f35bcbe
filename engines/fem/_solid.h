/* A soft body of linear tetrahedra, and the spheres that press it; units are SI, in single precision.

Nodes have four numbers each, the fourth of a displacement is the pressure at the node, that of a force the sum of
volumes around it. Elements stand in blocks of four: number k of corner, gradient, or strain of the element in lane l
is at 4 k + l. Face 4 e + k of element e is opposite to its corner k.
*/

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#define MOST_BRANCHES 4
#define MOST_CONTACTS 512 /* of one sphere */
#define MOST_SAMPLES 64   /* of one edge */

typedef struct {
    int nodes, blocks, faces, branches;
    int changes;                 /* of the mesh since the start */
    int every;                   /* sub-steps between its elastic forces in this step */
    float fastest;               /* largest part of a velocity along an axis when the nodes moved last */
    int node_room;               /* a body that may be cut has room for a node of its own at every corner */
    int skin;                    /* faces of the uncut mesh */
    float *rest;                 /* (nodes, 4) */
    float *displacement;         /* (nodes, 4) */
    float *velocity;             /* (nodes, 4) */
    float *force;                /* (nodes, 4) */
    float *mass;                 /* (nodes,) */
    float *inverse_mass;         /* (nodes,): 0 of an anchored, held or loose node */
    float *inverse_volume;       /* (nodes,): of all elements around */
    float *bulk;                 /* (nodes,): Lame's lambda of the energy */
    int32_t *holder;             /* (nodes,): the sphere that holds the node, or -1 */
    int32_t *origin;             /* (nodes,): the node of the uncut mesh */
    uint8_t *flags;              /* (nodes,): FIXED, PLACED */
    int32_t *corners;            /* (blocks, 4, 4) */
    float *gradients;            /* (blocks, 9, 4): of the shape functions of corners 1 to 3 */
    float *volumes;              /* (blocks, 4): 0 of a lane without an element */
    float *element_mass;         /* (blocks, 4) */
    float *shear;                /* (blocks, 4): Lame's mu of the energy */
    float *strains;              /* (branches, blocks, 6, 4): viscous strains */
    float *deformation;          /* (blocks, 9, 4): gradients, for the forces of a sub-step alone */
    const float *branch;         /* (branches, 2): share of the shear modulus, relaxation time */
    int32_t *across;             /* (4 blocks, 4): the face on the other side, or ~slot of a face of the surface */
    int32_t *surface;            /* (faces, 3): nodes by slot; -1 of a face that has gone */
    int32_t *owner;              /* (faces,): face of an element by slot */
    const float *middles;        /* (4 blocks, 3): of the elements of the uncut mesh */
    int ties;                    /* most pairs of tied nodes */
    int32_t *tied;               /* (ties, 2): nodes; -1 after the last pair */
    const float *limits;         /* (5,): lambda; largest sharpness, bulk rate and edge (m) of the uncut mesh; weight over
                                    mass and gravity */
    int boxes;                   /* that do not move */
    const double *box;           /* (boxes, 16): middle, axes row by row, half edges, friction */
    double *support;             /* (boxes, 3): mean force of the body on each in a step, N */
} Body;

enum { FIXED = 1, PLACED = 2, TIED = 4 }; /* anchored; moved onto a cut; tied to another body */

typedef struct {
    int count;
    const double *path;   /* (sub_steps + 1, count, 3): centres, in the frame of `rest` */
    const double *radius; /* (count,) */
    const uint8_t *free;  /* (count,): 0 of a sphere that passes through the body */
    double *force;        /* (sub_steps, count, 3): on the spheres, on their way to the next place */
    float friction;
} Spheres;

/* Edges of blades: each has `samples` points from one sphere to another. */
typedef struct {
    int count, samples;
    const int32_t *ends; /* (count, 2): spheres */
    const double *toughness; /* (count,): J/m^2; infinite of a blunt edge; negative of one that passes through */
    int32_t *element;    /* (count, samples): where the front of the cut is; -1: nowhere; -2 - e: it has left e */
    double *front;       /* (count, samples, 3): the front of the cut in the resting body */
    double *ahead;       /* (count, samples, 3): direction of its advance, a unit vector */
    double *area;        /* (1,): swept so far, m^2 */
} Edges;

/* What tissue bears before it tears. */
typedef struct {
    double stretch;   /* largest principal stretch */
    double toughness; /* J/m^2, at the end of a tear; 0: the stretch counts there too */
} Limits;

#define WAY_BUFFERS 11

/* A body on its way through a step: its instruments, and memory. */
typedef struct {
    Body *body;
    Spheres spheres;
    Edges edges;
    float drag;        /* damping over mass, 1/s */
    int every;         /* sub-steps between the elastic forces */
    const double *middle; /* of the body, in the frame in which the path is given */
    double *path;      /* in the frame of the body */
    int *near;         /* faces near the spheres: for each how many, and which */
    int near_room;     /* of each sphere */
    int32_t *carried;  /* nodes that spheres hold */
    int carries;       /* how many */
    int32_t *beside;   /* boxes and nodes near them */
    int besides;       /* their pairs */
    double *begun;     /* fronts at the start, (edges, samples, 3) */
    double *impulses;  /* (edges, samples, 3) */
    double *triangles; /* (2 edges samples, 3, 3) */
    Py_buffer held[WAY_BUFFERS];
} Way;

typedef struct {
    int sub_steps;
    float seconds, gravity; /* of a sub-step; along -z */
} Course;

typedef struct {
    PyObject_HEAD
    Body body;
    Py_buffer held[27];
    int count;
    void *memory; /* of `deformation` */
} Solid;

typedef struct Touch Touch; /* of bodies among each other */
typedef struct Attach Attach;

/* Elements around some nodes: those of nodes[k] are element[start[k]] to element[start[k + 1] - 1], ascending. */
typedef struct {
    int count;
    int32_t *nodes, *start, *element, *place; /* place: number in `nodes` by node, or -1 */
} Stars;

extern PyTypeObject solid_type, together_type;

static inline int32_t *corner_of(const Body *body, int element, int corner)
{
    return body->corners + 16 * (element / 4) + 4 * corner + element % 4;
}

static inline int is_gone(const Body *body, int element)
{
    return body->volumes[element] == 0.0f;
}

void tie(const Body *body);

#if defined(__GNUC__) && defined(__x86_64__) && !defined(TROCAR_PLAIN_LANES) && !defined(TROCAR_NARROW_LANES)
#define HAS_AVX /* in the compiler; the processor is asked */
#endif

void elastic_forces(const Body *body, float seconds);
void add_volumes(const Body *body, int first, int last);
void add_volumes_avx(const Body *body, int first, int last);
void add_forces(const Body *body, float seconds, int first, int last);
void add_forces_avx(const Body *body, float seconds, int first, int last);
void add_volumes_avx512(const Body *body, int first, int last);
void add_forces_avx512(const Body *body, float seconds, int first, int last);
void press(const Body *body, const Spheres *spheres, int sphere, int sub_step, float seconds, const int *near, int count);
int find_all_near(const Body *body, const Spheres *spheres, int sub_steps, int *near, int room);

int find_beside(const Body *body, double seconds, int32_t *beside);
void rest_on(const Body *body, const int32_t *beside, int count, double seconds);

int advance_bodies(Way *ways, int count, const Course *course, Touch *touch, Attach *attach);
int read_way(Solid *self, PyObject *args, Way *way, Course *course);
void release_way(Way *way);

Touch *new_touch(int count, Body *const *bodies, const double *middles, const double *frictions, double *forces,
                 double ahead, double skin);
void free_touch(Touch *touch);
void forget_pairs(Touch *touch);
void begin_touch(Touch *touch);
int part_bodies(Touch *touch, double seconds, double share);
void note_motion(Touch *touch, double seconds);

Attach *new_attach(int count, Body *const *body, const double *middle, const int32_t *place, const double *rest,
                   const double *law, double *widest, double *force);
void free_attach(Attach *attach);
void begin_attach(Attach *attach, int bodies);
void hold_together(Attach *attach, int sub_step, double seconds, double share);

int find_stars(const Body *body, int32_t *place, Stars *stars);
void free_stars(Stars *stars);
int32_t *no_places(const Body *body);
int open_faces(Body *body, const int32_t *faces, int count);
int remove_elements(Body *body, const int32_t *elements, int count);
int measure(const Body *body, float *sharpness, float *bulk_rate);
int tear_on(Body *body, const Limits *limits);
void label_pieces(const Body *body, int32_t *labels, int32_t *stack);
int cut_along(Body *body, const double *triangles, int count);

double rest_gradients(const Body *body, int element, double gradients[9]);
double sharpness_of(const double gradients[9]);

void engage(const Body *body, const Spheres *spheres, const Edges *edges, int sub_steps, double *begun);
void slice(const Body *body, const Spheres *spheres, const Edges *edges, int sub_step, float seconds, double *impulses);
void follow(const Body *body, const Spheres *spheres, const Edges *edges, int sub_step, float seconds,
            const double *impulses);
int sweep(const Body *body, const Spheres *spheres, const Edges *edges, int sub_steps, const double *begun,
          double *triangles);
