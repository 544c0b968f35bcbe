/* FMI 3.0 co-simulation with event mode: a ball under constant gravity, exactly, from bounce to bounce; it also has an array of
   structural size, a kick at a scheduled time and a discrete input. It refuses to be driven in any other order than FMI 3.0 allows.
   The declarations are those of the functions used here alone. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef int Status; /* 0 ok, 1 warning, 2 discard, 3 error, 4 fatal */
enum { OK, WARNING, DISCARD, ERROR, FATAL };
typedef void (*Logger)(void *, Status, const char *, const char *);
enum { MOST = 8 };

/* value references, shared by all types in FMI 3 */
enum { TIME, H, V, G, E, KICK_TIME, KICK, BOUNCES, FROZEN, SIZE, U, Y, STATE, GAIN, ENDS_AT, DOWN, BIG, SEEN_FROZEN, STAY };

typedef struct {
    double time, h, v, g, e, kick_time, kick, ends_at, u[MOST];
    float gain;
    int32_t bounces;
    int64_t big;
    uint64_t size;
    bool frozen, kicked, resting, stay;
} Data;

typedef struct {
    Data data;
    enum { INSTANTIATED, CONFIGURING, INITIALISING, EVENT, STEP, TERMINATED } mode;
    bool event_mode, early_return;
    void *environment;
    Logger log;
} Instance;

static Status complain(Instance *i, Status status, const char *text) {
    i->log(i->environment, status, "logStatusError", text);
    return status;
}

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging, bool event_mode, bool early_return,
                                  const unsigned *intermediate, size_t n_intermediate, void *environment, Logger log, void *update) {
    (void)name; (void)resources; (void)visible; (void)logging; (void)intermediate; (void)update;
    if (strcmp(token, "{trocar-bouncing-ball}") != 0 || n_intermediate) {
        log(environment, ERROR, "logStatusError", "wrong token");
        return NULL;
    }
#ifdef NO_EVENT_MODE /* whatever its modelDescription.xml says */
    if (event_mode) {
        log(environment, ERROR, "logStatusError", "no event mode here");
        return NULL;
    }
#endif
    Instance *i = calloc(1, sizeof *i);
    i->event_mode = event_mode;
    i->early_return = early_return;
    i->environment = environment;
    i->log = log;
    i->data = (Data){.h = 1, .g = -9.81, .e = 0.7, .kick_time = INFINITY, .ends_at = INFINITY, .gain = 2, .size = 3};
    return i;
}

void fmi3FreeInstance(void *c) { free(c); }

Status fmi3EnterConfigurationMode(void *c) { return ((Instance *)c)->mode == INSTANTIATED ? (((Instance *)c)->mode = CONFIGURING, OK) : ERROR; }
Status fmi3ExitConfigurationMode(void *c) { return ((Instance *)c)->mode == CONFIGURING ? (((Instance *)c)->mode = INSTANTIATED, OK) : ERROR; }

Status fmi3EnterInitializationMode(void *c, bool has_tolerance, double tolerance, double start, bool has_stop, double stop) {
    (void)stop;
    Instance *i = c;
    if (i->mode != INSTANTIATED || start != 0 || has_stop || (has_tolerance && tolerance <= 0)) return complain(i, ERROR, "cannot initialise");
    i->mode = INITIALISING;
    return OK;
}

Status fmi3ExitInitializationMode(void *c) {
    Instance *i = c;
    if (i->mode != INITIALISING) return complain(i, ERROR, "not initialising");
    i->mode = i->event_mode ? EVENT : STEP;
    return OK;
}

Status fmi3EnterEventMode(void *c) {
    Instance *i = c;
    if (i->mode != STEP || !i->event_mode) return complain(i, ERROR, "no event here");
    i->mode = EVENT;
    return OK;
}

Status fmi3EnterStepMode(void *c) {
    Instance *i = c;
    if (i->mode != EVENT) return complain(i, ERROR, "not in event mode");
    i->mode = STEP;
    return OK;
}

Status fmi3Terminate(void *c) {
    Instance *i = c;
    if (i->mode != STEP && i->mode != EVENT) return complain(i, ERROR, "cannot terminate");
    i->mode = TERMINATED;
    return OK;
}

static void bounce(Data *d) {
    d->h = 0;
    d->v = -d->e * d->v;
    d->bounces++;
    if (d->v < 1e-2) d->v = 0, d->resting = true;
}

static void kick(Data *d) {
    d->v += d->kick;
    d->kicked = true;
    d->resting = false;
}

Status fmi3UpdateDiscreteStates(void *c, bool *again, bool *terminate, bool *nominals, bool *states, bool *scheduled, double *next) {
    Instance *i = c;
    Data *d = &i->data;
    if (i->mode != EVENT) return complain(i, ERROR, "no event to update");
    *again = *terminate = *nominals = *states = false;
    if (d->h <= 0 && d->v < 0) bounce(d), *again = *states = true;
    if (!d->kicked && d->time >= d->kick_time) kick(d), *again = *states = true;
    if (d->stay) *again = true;
    *terminate = d->time >= d->ends_at;
    *scheduled = !d->kicked && isfinite(d->kick_time);
    *next = *scheduled ? d->kick_time : 0;
    return OK;
}

/* Time until the ball is at the ground. */
static double fall(const Data *d) { return (-d->v - sqrt(d->v * d->v - 2 * d->g * fmax(d->h, 0))) / d->g; }

static void fly(Data *d, double dt) {
    if (!d->frozen && !d->resting) {
        d->h += d->v * dt + d->g * dt * dt / 2;
        d->v += d->g * dt;
    }
    d->time += dt;
}

Status fmi3DoStep(void *c, double time, double step, bool no_state_prior, bool *event, bool *terminate, bool *early, double *reached) {
    (void)no_state_prior;
    Instance *i = c;
    Data *d = &i->data;
    if (i->mode != STEP || fabs(time - d->time) > 1e-9 || step <= 0) return complain(i, ERROR, "stepped at the wrong time or in the wrong mode");
    if (i->event_mode && !d->kicked && time + step > d->kick_time + 1e-12) return complain(i, ERROR, "stepped over a scheduled event");
    double end = time + step;
    *event = *terminate = *early = false;
    while (!d->frozen && !d->resting && d->time + fall(d) <= end) {
        fly(d, fall(d));
        d->h = 0;
        if (i->event_mode) {
            *event = true;
            *early = i->early_return && d->time < end;
            if (!*early) break;
            *reached = d->time;
            return OK;
        }
        bounce(d);
    }
    fly(d, end - d->time);
    d->time = *reached = end;
    *terminate = !i->event_mode && end >= d->ends_at;
    return OK;
}

static Status float64(Instance *i, unsigned reference, double *value, bool set, size_t *used) {
    Data *d = &i->data;
    double *scalars[] = {[H] = &d->h, [V] = &d->v, [G] = &d->g, [E] = &d->e, [KICK_TIME] = &d->kick_time, [KICK] = &d->kick, [ENDS_AT] = &d->ends_at};
    *used = 1;
    if (reference == U) {
        *used = d->size;
        memcpy(set ? d->u : value, set ? value : d->u, d->size * sizeof(double));
    } else if (reference == Y && !set) {
        *used = d->size;
        for (size_t k = 0; k < d->size; k++) value[k] = d->gain * d->u[k];
    } else if (reference == STATE && !set) {
        *used = 2;
        value[0] = d->h, value[1] = d->v;
    } else if (reference < sizeof scalars / sizeof *scalars && scalars[reference]) {
        *(set ? scalars[reference] : value) = *(set ? value : scalars[reference]);
    } else {
        return complain(i, ERROR, "no such Float64");
    }
    return OK;
}

Status fmi3SetFloat64(void *c, const unsigned *reference, size_t n, const double *value, size_t n_values) {
    size_t used, at = 0;
    for (size_t k = 0; k < n; k++, at += used)
        if (float64(c, reference[k], (double *)value + at, true, &used) != OK) return ERROR;
    return at == n_values ? OK : complain(c, ERROR, "wrong number of values");
}

Status fmi3GetFloat64(void *c, const unsigned *reference, size_t n, double *value, size_t n_values) {
    size_t used, at = 0;
    for (size_t k = 0; k < n; k++, at += used)
        if (float64(c, reference[k], value + at, false, &used) != OK) return ERROR;
    return at == n_values ? OK : complain(c, ERROR, "wrong number of values");
}

#define ACCESS(Type, ctype, vr, field, legal)                                                                        \
    Status fmi3Set##Type(void *c, const unsigned *reference, size_t n, const ctype *value, size_t n_values) {        \
        Instance *i = c;                                                                                             \
        if (n != 1 || n_values != 1 || reference[0] != vr || !(legal)) return complain(i, ERROR, "cannot set " #vr); \
        i->data.field = value[0];                                                                                    \
        return OK;                                                                                                   \
    }
ACCESS(Float32, float, GAIN, gain, i->mode == INSTANTIATED)
ACCESS(Int64, int64_t, BIG, big, i->mode == INSTANTIATED)
ACCESS(UInt64, uint64_t, SIZE, size, i->mode == CONFIGURING && value[0] <= MOST)

Status fmi3SetBoolean(void *c, const unsigned *reference, size_t n, const bool *value, size_t n_values) {
    Instance *i = c;
    bool stay = reference[0] == STAY && i->mode == INSTANTIATED;
    bool frozen = reference[0] == FROZEN && (i->mode == INSTANTIATED || (i->event_mode ? i->mode == EVENT : i->mode == STEP));
    if (n != 1 || n_values != 1 || !(stay || frozen)) return complain(i, ERROR, "discrete inputs are set in event mode");
    *(stay ? &i->data.stay : &i->data.frozen) = value[0];
    return OK;
}

Status fmi3GetBoolean(void *c, const unsigned *reference, size_t n, bool *value, size_t n_values) {
    if (n != 1 || n_values != 1 || reference[0] != SEEN_FROZEN) return ERROR;
    value[0] = ((Instance *)c)->data.frozen;
    return OK;
}

Status fmi3GetInt32(void *c, const unsigned *reference, size_t n, int32_t *value, size_t n_values) {
    if (n != 1 || n_values != 1 || reference[0] != BOUNCES) return ERROR;
    value[0] = ((Instance *)c)->data.bounces;
    return OK;
}

Status fmi3GetInt64(void *c, const unsigned *reference, size_t n, int64_t *value, size_t n_values) {
    if (n != 1 || n_values != 1 || reference[0] != DOWN) return ERROR;
    value[0] = ((Instance *)c)->data.big;
    return OK;
}

Status fmi3GetFMUState(void *c, void **state) {
    if (!*state) *state = malloc(sizeof(Data));
    memcpy(*state, &((Instance *)c)->data, sizeof(Data));
    return OK;
}

Status fmi3SetFMUState(void *c, void *state) {
    memcpy(&((Instance *)c)->data, state, sizeof(Data));
    return OK;
}

Status fmi3FreeFMUState(void *c, void **state) {
    (void)c;
    free(*state);
    *state = NULL;
    return OK;
}

Status fmi3SerializedFMUStateSize(void *c, void *state, size_t *size) {
    (void)c; (void)state;
    *size = sizeof(Data);
    return OK;
}

Status fmi3SerializeFMUState(void *c, void *state, uint8_t *bytes, size_t size) {
    (void)c;
    memcpy(bytes, state, size);
    return OK;
}

Status fmi3DeserializeFMUState(void *c, const uint8_t *bytes, size_t size, void **state) {
    if (size != sizeof(Data)) return complain(c, ERROR, "no state of this FMU");
    *state = malloc(size);
    memcpy(*state, bytes, size);
    return OK;
}

const char *fmi3GetVersion(void) { return "3.0"; }

#define UNUSED(Name) Status fmi3##Name(void) { return ERROR; }
UNUSED(SetDebugLogging) UNUSED(Reset) UNUSED(InstantiateModelExchange) UNUSED(InstantiateScheduledExecution)
UNUSED(GetFloat32) UNUSED(GetInt8) UNUSED(GetUInt8) UNUSED(GetInt16) UNUSED(GetUInt16) UNUSED(GetUInt32) UNUSED(GetUInt64) UNUSED(GetString) UNUSED(GetBinary)
UNUSED(GetClock) UNUSED(SetInt8) UNUSED(SetUInt8) UNUSED(SetInt16) UNUSED(SetUInt16) UNUSED(SetInt32) UNUSED(SetUInt32) UNUSED(SetString) UNUSED(SetBinary)
UNUSED(SetClock) UNUSED(GetNumberOfVariableDependencies) UNUSED(GetVariableDependencies) UNUSED(GetDirectionalDerivative) UNUSED(GetAdjointDerivative)
UNUSED(GetIntervalDecimal) UNUSED(GetIntervalFraction) UNUSED(GetShiftDecimal) UNUSED(GetShiftFraction) UNUSED(SetIntervalDecimal)
UNUSED(SetIntervalFraction) UNUSED(SetShiftDecimal) UNUSED(SetShiftFraction) UNUSED(EvaluateDiscreteStates) UNUSED(GetOutputDerivatives)
UNUSED(EnterContinuousTimeMode) UNUSED(CompletedIntegratorStep) UNUSED(SetTime) UNUSED(SetContinuousStates) UNUSED(GetContinuousStateDerivatives)
UNUSED(GetEventIndicators) UNUSED(GetContinuousStates) UNUSED(GetNominalsOfContinuousStates) UNUSED(GetNumberOfEventIndicators)
UNUSED(GetNumberOfContinuousStates) UNUSED(ActivateModelPartition)
