/* FMI 3.0 co-simulation with two terminals: a spring with a damper, which takes angle and speed and gives the torque into
   it, and an inertia, which takes a torque and gives angle and speed. The declarations are those of the functions used here
   alone. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef int Status; /* 0 ok, 1 warning, 2 discard, 3 error, 4 fatal */
enum { OK, WARNING, DISCARD, ERROR };
enum { TIME, PHI, W, TAU, STIFFNESS, DAMPING, PUSH, ANGLE, SPEED, INERTIA, N_REALS };

typedef struct {
    double real[N_REALS];
} Flanges;

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging)
{
    (void)name; (void)token; (void)resources; (void)visible; (void)logging;
    Flanges *f = calloc(1, sizeof *f);
    f->real[STIFFNESS] = 50;
    f->real[INERTIA] = 0.02;
    return f;
}
void fmi3FreeInstance(Flanges *f) { free(f); }
Status fmi3EnterInitializationMode(Flanges *f) { (void)f; return OK; }
Status fmi3ExitInitializationMode(Flanges *f) { (void)f; return OK; }
Status fmi3Terminate(Flanges *f) { (void)f; return OK; }

Status fmi3SetFloat64(Flanges *f, const unsigned *reference, size_t n, const double *value, size_t count)
{
    if (n != count) return ERROR;
    for (size_t k = 0; k < n; k++) f->real[reference[k]] = value[k];
    return OK;
}
Status fmi3GetFloat64(Flanges *f, const unsigned *reference, size_t n, double *value, size_t count)
{
    if (n != count) return ERROR;
    f->real[TAU] = f->real[STIFFNESS] * f->real[PHI] + f->real[DAMPING] * f->real[W];
    for (size_t k = 0; k < n; k++) value[k] = f->real[reference[k]];
    return OK;
}
Status fmi3GetDirectionalDerivative(Flanges *f, const unsigned *unknown, size_t nu, const unsigned *known, size_t nk,
                                    const double *seed, size_t ns, double *result, size_t nr)
{
    if (nu != 1 || nk != 1 || ns != 1 || nr != 1 || *unknown != TAU) return ERROR;
    *result = *seed * (*known == PHI ? f->real[STIFFNESS] : *known == W ? f->real[DAMPING] : 0);
    return OK;
}
Status fmi3DoStep(Flanges *f, double t, double h, bool keeps, bool *event, bool *ends, bool *early, double *reached)
{
    (void)keeps;
    double *r = f->real, before = r[SPEED];
    r[SPEED] += h * r[PUSH] / r[INERTIA];
    r[ANGLE] += 0.5 * h * (before + r[SPEED]);
    *event = *ends = *early = false;
    *reached = r[TIME] = t + h;
    return OK;
}
Status fmi3GetFMUState(Flanges *f, void **state)
{
    if (!*state) *state = malloc(sizeof *f);
    memcpy(*state, f, sizeof *f);
    return OK;
}
Status fmi3SetFMUState(Flanges *f, void *state) { memcpy(f, state, sizeof *f); return OK; }
Status fmi3FreeFMUState(Flanges *f, void **state) { (void)f; free(*state); *state = NULL; return OK; }
Status fmi3SerializedFMUStateSize(Flanges *f, void *state, size_t *n) { (void)state; *n = sizeof *f; return OK; }
Status fmi3SerializeFMUState(Flanges *f, void *state, uint8_t *bytes, size_t n) { (void)f; memcpy(bytes, state, n); return OK; }
Status fmi3DeserializeFMUState(Flanges *f, const uint8_t *bytes, size_t n, void **state)
{
    (void)f;
    *state = malloc(n);
    memcpy(*state, bytes, n);
    return OK;
}
