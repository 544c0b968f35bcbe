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

/* Number of the first blocks that go two at a time. */
static int paired_blocks(const Body *body)
{
#ifdef HAS_AVX
    return __builtin_cpu_supports("avx") ? body->blocks & ~1 : 0;
#else
    (void)body;
    return 0;
#endif
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
    int paired = paired_blocks(body);
    memset(body->force, 0, sizeof(float) * 4 * (size_t)body->nodes);
#ifdef HAS_AVX
    add_volumes_avx(body, 0, paired);
#endif
    add_volumes(body, paired, body->blocks);
    set_pressures(body);
#ifdef HAS_AVX
    add_forces_avx(body, seconds, 0, paired);
#endif
    add_forces(body, seconds, paired, body->blocks);
}
