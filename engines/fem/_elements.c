/* Elastic and viscous forces of the elements of a body.

Energy density of Smith, de Goes, Kim, Stable Neo-Hookean Flesh Simulation (ACM Trans. Graph. 37, 2018), equation 14.
Its volumetric part is that of the mean volume change around each node (Bonet, Burton, A simple average nodal pressure
tetrahedral element, Commun. Numer. Methods Eng. 14, 1998), against locking: forces are still those of an energy. A
branch of a generalised Maxwell model bears 2 mu g dev(E - e), with the Green strain E and a viscous strain e of its
own that follows E with the time constant of the branch.
*/

#include "_solid.h"
#include "_lanes.h"
#include "_forces.h"

typedef struct {
    void (*add_volumes)(const Body *, int, int);
    void (*add_forces)(const Body *, float, int, int);
    int blocks; /* at a time */
} Kind;

/* Kinds of lanes of this processor, the widest first. */
static int kinds_here(Kind kinds[3])
{
    int count = 0;
#ifdef HAS_AVX
    if (__builtin_cpu_supports("avx512f"))
        kinds[count++] = (Kind){add_volumes_avx512, add_forces_avx512, 4};
    if (__builtin_cpu_supports("avx"))
        kinds[count++] = (Kind){add_volumes_avx, add_forces_avx, 2};
#endif
    kinds[count++] = (Kind){add_volumes, add_forces, 1};
    return count;
}

/* Set the pressure at every node by the volume around. */
static void set_pressures(const Body *body)
{
    float *force = body->force, *displacement = body->displacement;
    for (int i = 0; i < body->nodes; i++) {
        displacement[4 * i + 3] = body->bulk[i] * (force[4 * i + 3] * body->inverse_volume[i] - 1.0f);
        force[4 * i + 3] = 0.0f;
    }
}

/* Set the forces of all elements on the nodes; viscous strains advance by `seconds`. */
void elastic_forces(const Body *body, float seconds)
{
    Kind kinds[3];
    int count = kinds_here(kinds), first = 0;
    memset(body->force, 0, sizeof(float) * 4 * (size_t)body->nodes);
    for (int k = 0; k < count; k++) {
        int last = body->blocks / kinds[k].blocks * kinds[k].blocks;
        kinds[k].add_volumes(body, first, last);
        first = last;
    }
    set_pressures(body);
    first = 0;
    for (int k = 0; k < count; k++) {
        int last = body->blocks / kinds[k].blocks * kinds[k].blocks;
        kinds[k].add_forces(body, seconds, first, last);
        first = last;
    }
}
