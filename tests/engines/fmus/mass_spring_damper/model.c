/* FMI 2.0 co-simulation: m a = F - c x - d v, F linear inside a communication step, by RK4 at 0.1 ms.
   It refuses to be driven in any other order than FMI 2.0 allows. The declarations are those of the functions used here alone. */
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

typedef int Status; /* 0 ok, 1 warning, 2 discard, 3 error, 4 fatal, 5 pending */
enum { OK, WARNING, DISCARD, ERROR, FATAL };
typedef void (*Logger)(void *, const char *, Status, const char *, const char *, ...);
typedef struct {
    Logger logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *finished;
    void *environment;
} Callbacks;

enum { F, X, V, A, M, C, D, X_MM, N_REALS };                             /* value references of reals */
enum { STEPS, FAULT, STAGE, N_INTEGERS };                                /* of integers */
enum { LOCKED, SEEN_LOCKED, N_BOOLEANS };                                /* of booleans */
enum { NO_FAULT, NAN_OUTPUT, DISCARD_STEP, ERROR_STEP, DISCARD_FORCE, FATAL_STEP, REFUSE_INIT, CRASH_STEP, CHANGING_OUTPUT }; /* values of FAULT */

typedef struct {
    double real[N_REALS];
    double slope; /* of F */
    double time;
#ifdef WITH_ADDRESS
    void *self; /* makes the bytes of equal states differ, as those of many FMUs do */
#endif
    int integer[N_INTEGERS];
    int boolean[N_BOOLEANS];
} Data;

typedef struct {
    Data data;
    enum { INSTANTIATED, INITIALISING, STEPPING, TERMINATED } mode;
    char name[64];
    const Callbacks *callbacks;
} Instance;

static Status complain(Instance *i, Status status, const char *text, double number) {
    i->callbacks->logger(i->callbacks->environment, i->name, status, "logStatus", "%s (%g)", text, number);
    return status;
}

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const Callbacks *callbacks, int visible, int logging) {
    (void)resources; (void)visible; (void)logging;
    if (type != 1 || strcmp(guid, "{trocar-mass-spring-damper}") != 0) return NULL;
    Instance *i = calloc(1, sizeof *i);
    strncpy(i->name, name, sizeof i->name - 1);
    i->callbacks = callbacks;
#ifdef WITH_ADDRESS
    i->data.self = i;
#endif
    i->data.real[M] = 1;
    i->data.real[C] = 10;
    i->data.real[D] = 0.1;
    return i;
}

void fmi2FreeInstance(void *c) { free(c); }

Status fmi2SetupExperiment(void *c, int has_tolerance, double tolerance, double start, int has_stop, double stop) {
    (void)c; (void)tolerance; (void)stop;
    return start == 0 && !has_stop && (has_tolerance == 0 || tolerance > 0) ? OK : ERROR;
}

Status fmi2EnterInitializationMode(void *c) {
    Instance *i = c;
    if (i->mode != INSTANTIATED) return complain(i, ERROR, "initialised twice", i->mode);
    if (i->data.integer[FAULT] == REFUSE_INIT) return complain(i, ERROR, "told to refuse", 0);
    i->mode = INITIALISING;
    return OK;
}

static void derive(const double *r, double force, double x, double v, double *dx, double *dv) {
    *dx = v;
    *dv = (force - r[C] * x - r[D] * v) / r[M];
}

static void update(Data *d) {
    double *r = d->real, dx;
    derive(r, r[F], r[X], r[V], &dx, &r[A]);
    r[X_MM] = 1000 * r[X];
    d->boolean[SEEN_LOCKED] = d->boolean[LOCKED];
}

Status fmi2ExitInitializationMode(void *c) {
    Instance *i = c;
    if (i->mode != INITIALISING) return complain(i, ERROR, "not initialising", i->mode);
    i->mode = STEPPING;
    update(&i->data);
    return OK;
}

Status fmi2Terminate(void *c) {
    Instance *i = c;
    if (i->mode != STEPPING) return ERROR;
    i->mode = TERMINATED;
    return complain(i, OK, "terminated", i->data.time);
}

Status fmi2SetReal(void *c, const unsigned *reference, size_t n, const double *value) {
    Instance *i = c;
    for (size_t k = 0; k < n; k++) {
        if (reference[k] >= N_REALS) return complain(i, ERROR, "no such real", reference[k]);
        if (reference[k] == F && i->data.integer[FAULT] == DISCARD_FORCE) return DISCARD;
        i->data.real[reference[k]] = value[k];
    }
    return OK;
}

Status fmi2GetReal(void *c, const unsigned *reference, size_t n, double *value) {
    Instance *i = c;
    for (size_t k = 0; k < n; k++) {
        if (reference[k] >= N_REALS) return complain(i, ERROR, "no such real", reference[k]);
        if (reference[k] == A && i->data.integer[FAULT] == CHANGING_OUTPUT) i->data.real[A] += 1e-3;
        value[k] = reference[k] == V && i->data.integer[FAULT] == NAN_OUTPUT && i->data.time > 0 ? NAN : i->data.real[reference[k]];
    }
    return OK;
}

#define ACCESS(Type, field, count)                                                                     \
    Status fmi2Set##Type(void *c, const unsigned *reference, size_t n, const int *value) {             \
        for (size_t k = 0; k < n; k++) {                                                               \
            if (reference[k] >= count) return complain(c, ERROR, "no such " #field, reference[k]);     \
            ((Instance *)c)->data.field[reference[k]] = value[k];                                      \
        }                                                                                              \
        return OK;                                                                                     \
    }                                                                                                  \
    Status fmi2Get##Type(void *c, const unsigned *reference, size_t n, int *value) {                   \
        for (size_t k = 0; k < n; k++) {                                                               \
            if (reference[k] >= count) return complain(c, ERROR, "no such " #field, reference[k]);     \
            value[k] = ((Instance *)c)->data.field[reference[k]];                                      \
        }                                                                                              \
        return OK;                                                                                     \
    }
ACCESS(Integer, integer, N_INTEGERS)
ACCESS(Boolean, boolean, N_BOOLEANS)

Status fmi2SetRealInputDerivatives(void *c, const unsigned *reference, size_t n, const int *order, const double *value) {
    Instance *i = c;
    if (n != 1 || reference[0] != F || order[0] != 1) return complain(i, ERROR, "no such derivative", (double)n);
    i->data.slope = value[0];
    return OK;
}

Status fmi2DoStep(void *c, double time, double h, int no_state_prior) {
    (void)no_state_prior;
    Instance *i = c;
    Data *d = &i->data;
    double *r = d->real;
    if (i->mode != STEPPING || fabs(time - d->time) > 1e-9) return complain(i, ERROR, "stepped at the wrong time", time);
    switch (d->integer[FAULT]) {
    case DISCARD_STEP: return complain(i, DISCARD, "told to discard", time);
    case ERROR_STEP: return complain(i, ERROR, "told to fail", time);
    case FATAL_STEP: return complain(i, FATAL, "told to die", time);
    case CRASH_STEP:
        if (time > 0.0495) *(volatile int *)0 = 1;
    }
    int n = (int)ceil(h / 1e-4 - 1e-9);
    double dt = h / n, x = r[X], v = r[V];
    for (int k = 0; k < n && !d->boolean[LOCKED]; k++) {
        double f = r[F] + d->slope * k * dt, half = d->slope * dt / 2;
        double x1, v1, x2, v2, x3, v3, x4, v4;
        derive(r, f, x, v, &x1, &v1);
        derive(r, f + half, x + dt / 2 * x1, v + dt / 2 * v1, &x2, &v2);
        derive(r, f + half, x + dt / 2 * x2, v + dt / 2 * v2, &x3, &v3);
        derive(r, f + 2 * half, x + dt * x3, v + dt * v3, &x4, &v4);
        x += dt / 6 * (x1 + 2 * x2 + 2 * x3 + x4);
        v += dt / 6 * (v1 + 2 * v2 + 2 * v3 + v4);
    }
    r[X] = x;
    r[V] = v;
    d->time = time + h;
    d->integer[STEPS]++;
    update(d);
    return OK;
}

Status fmi2GetRealStatus(void *c, int kind, double *value) {
    *value = ((Instance *)c)->data.time;
    return kind == 2 ? OK : DISCARD;
}

Status fmi2GetFMUstate(void *c, void **state) {
    if (!*state) *state = malloc(sizeof(Data));
    memcpy(*state, &((Instance *)c)->data, sizeof(Data));
    return OK;
}

Status fmi2SetFMUstate(void *c, void *state) {
    memcpy(&((Instance *)c)->data, state, sizeof(Data));
    return OK;
}

Status fmi2FreeFMUstate(void *c, void **state) {
    (void)c;
    free(*state);
    *state = NULL;
    return OK;
}

Status fmi2SerializedFMUstateSize(void *c, void *state, size_t *size) {
    (void)c; (void)state;
    *size = sizeof(Data);
    return OK;
}

Status fmi2SerializeFMUstate(void *c, void *state, char *bytes, size_t size) {
    (void)c;
    memcpy(bytes, state, size);
    return OK;
}

Status fmi2DeSerializeFMUstate(void *c, const char *bytes, size_t size, void **state) {
    if (size != sizeof(Data)) return complain(c, ERROR, "no state of this FMU", (double)size);
    *state = malloc(size);
    memcpy(*state, bytes, size);
    return OK;
}

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

#define UNUSED(Name) Status fmi2##Name(void) { return ERROR; }
UNUSED(SetDebugLogging) UNUSED(Reset) UNUSED(GetString) UNUSED(SetString) UNUSED(GetDirectionalDerivative) UNUSED(GetRealOutputDerivatives)
UNUSED(CancelStep) UNUSED(GetStatus) UNUSED(GetIntegerStatus) UNUSED(GetBooleanStatus) UNUSED(GetStringStatus)
