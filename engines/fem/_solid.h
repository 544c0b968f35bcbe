/* A soft body of linear tetrahedra, and the spheres that press it; units are SI, in single precision.

Nodes have four numbers each, the fourth of a displacement is the pressure at the node, that of a force the sum of
volumes around it. Elements stand in blocks of four: number k of corner, gradient, or strain of the element in lane l
is at 4 k + l.
*/

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#define MOST_BRANCHES 4
#define MOST_CONTACTS 512 /* of one sphere */

typedef struct {
    int nodes, blocks, faces, branches;
    const float *rest;           /* (nodes, 4) */
    float *displacement;         /* (nodes, 4) */
    float *velocity;             /* (nodes, 4) */
    float *force;                /* (nodes, 4) */
    const float *inverse_mass;   /* (nodes,): 0 of an anchored node */
    const float *inverse_volume; /* (nodes,): of all elements around */
    const float *bulk;           /* (nodes,): Lame's lambda of the energy */
    const int32_t *holder;       /* (nodes,): the sphere that holds the node, or -1 */
    const int32_t *corners;      /* (blocks, 4, 4) */
    const float *gradients;      /* (blocks, 9, 4): of the shape functions of corners 1 to 3 */
    const float *volumes;        /* (blocks, 4): 0 of a lane without an element */
    const float *shear;          /* (blocks, 4): Lame's mu of the energy */
    float *strains;              /* (branches, blocks, 6, 4): viscous strains */
    const float *branch;         /* (branches, 2): share of the shear modulus, relaxation time */
    const int32_t *surface;      /* (faces, 3) */
} Body;

typedef struct {
    int count;
    const double *path;   /* (sub_steps + 1, count, 3): centres, in the frame of `rest` */
    const double *radius; /* (count,) */
    const uint8_t *free;  /* (count,): 0 of a sphere that passes through the body */
    double *force;        /* (sub_steps, count, 3): on the spheres, on their way to the next place */
    float friction;
} Spheres;

void elastic_forces(const Body *body, float seconds);
void press(const Body *body, const Spheres *spheres, int sphere, int sub_step, float seconds, const int *near, int count);
int find_near(const Body *body, const Spheres *spheres, int sphere, int sub_steps, int *near, int most);
