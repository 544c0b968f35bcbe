/* Model exchange, FMI 2.0 or 3.0 (-DFMI=3): h'' = u - g above the ground, a bounce at h = 0 (an event indicator), and a
   count of ticks every 0.25 s (a time event). The declarations are those of the functions used here alone. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#ifndef FMI
#define FMI 2
#endif

typedef int Status; /* 0 ok, 1 warning, 2 discard, 3 error, 4 fatal */
enum { OK, WARNING, DISCARD, ERROR };
enum { TIME, H, V, DER_H, DER_V, G, E, U, LOW, N_REALS };
enum { NO_FAULT, ERROR_BELOW_LOW, DISCARD_BELOW_LOW, END_AT_TICK };

typedef struct {
    double real[N_REALS], tick;
    int bounces, ticks, fault, held, was_held, completed;
    int in_event_mode;
} Hopper;

static void *make(void) {
    Hopper *hopper = calloc(1, sizeof *hopper);
    hopper->real[H] = 1;
    hopper->real[G] = 9.81;
    hopper->real[E] = 0.5;
    hopper->real[LOW] = -1e9;
    hopper->tick = 0.25;
    hopper->in_event_mode = 1;
    return hopper;
}

static Status derive(Hopper *m) {
    double *r = m->real;
    if (r[H] < r[LOW] && m->fault == ERROR_BELOW_LOW) return ERROR;
    if (r[H] < r[LOW] && m->fault == DISCARD_BELOW_LOW) return DISCARD;
    r[DER_H] = m->held ? 0 : r[V];
    r[DER_V] = m->held ? 0 : r[U] - r[G];
    return OK;
}

/* Returns whether the simulation shall end. */
static int handle_event(Hopper *m) {
    double *r = m->real;
    if (r[H] <= 0 && r[V] < 0) {
        r[H] = 0;
        r[V] *= -r[E];
        m->bounces++;
    }
    m->was_held = m->held;
    if (r[TIME] < m->tick - 1e-9) return 0;
    m->ticks++;
    m->tick += 0.25;
    return m->fault == END_AT_TICK && m->ticks == 3;
}

static Status get_reals(Hopper *m, const unsigned *reference, size_t n, double *value) {
    if (derive(m) == ERROR) return ERROR;
    for (size_t k = 0; k < n; k++) value[k] = m->real[reference[k]];
    return OK;
}

static Status set_reals(Hopper *m, const unsigned *reference, size_t n, const double *value) {
    for (size_t k = 0; k < n; k++) {
        if (reference[k] == G && !m->in_event_mode) return ERROR; /* a tunable parameter */
        m->real[reference[k]] = value[k];
    }
    return OK;
}

static int *whole(Hopper *m, unsigned reference) {
    int *all[] = {&m->bounces, &m->ticks, &m->fault, &m->held, &m->was_held, &m->completed};
    return all[reference - 20];
}

#define NAME_(prefix, name) prefix##name
#if FMI == 2
#define F(name) fmi2##name
typedef int Bool;
typedef struct { int again, ends, nominals, states, scheduled; double next; } EventInfo;
void *fmi2Instantiate(const char *name, int type, const char *guid) {
    (void)name;
    return type == 0 && !strcmp(guid, "{trocar-hopper}") ? make() : NULL;
}
Status fmi2SetupExperiment(void) { return OK; }
Status fmi2EnterInitializationMode(void) { return OK; }
Status fmi2NewDiscreteStates(Hopper *m, EventInfo *info) {
    memset(info, 0, sizeof *info);
    info->ends = handle_event(m);
    info->states = info->scheduled = 1;
    info->next = m->tick;
    return m->in_event_mode ? OK : ERROR;
}
Status fmi2GetReal(Hopper *m, const unsigned *r, size_t n, double *v) { return get_reals(m, r, n, v); }
Status fmi2SetReal(Hopper *m, const unsigned *r, size_t n, const double *v) { return set_reals(m, r, n, v); }
Status fmi2GetInteger(Hopper *m, const unsigned *r, size_t n, int *v) {
    for (size_t k = 0; k < n; k++) v[k] = *whole(m, r[k]);
    return OK;
}
Status fmi2SetInteger(Hopper *m, const unsigned *r, size_t n, const int *v) {
    for (size_t k = 0; k < n; k++) {
        if (!m->in_event_mode) return ERROR;
        *whole(m, r[k]) = v[k];
    }
    return OK;
}
#define STATE(verb) fmi2##verb##FMUstate
#define DESERIALIZE fmi2DeSerializeFMUstate
#define DERIVATIVES fmi2GetDerivatives
#else
#define F(name) fmi3##name
typedef bool Bool;
void *fmi3InstantiateModelExchange(const char *name, const char *token) {
    (void)name;
    return !strcmp(token, "{trocar-hopper}") ? make() : NULL;
}
Status fmi3EnterInitializationMode(void) { return OK; }
Status fmi3UpdateDiscreteStates(Hopper *m, bool *again, bool *ends, bool *nominals, bool *states, bool *scheduled, double *next) {
    *again = *nominals = false;
    *ends = handle_event(m);
    *states = *scheduled = true;
    *next = m->tick;
    return m->in_event_mode ? OK : ERROR;
}
Status fmi3GetFloat64(Hopper *m, const unsigned *r, size_t n, double *v) { return get_reals(m, r, n, v); }
Status fmi3SetFloat64(Hopper *m, const unsigned *r, size_t n, const double *v) { return set_reals(m, r, n, v); }
Status fmi3GetInt32(Hopper *m, const unsigned *r, size_t n, int *v) {
    for (size_t k = 0; k < n; k++) v[k] = *whole(m, r[k]);
    return OK;
}
Status fmi3SetInt32(Hopper *m, const unsigned *r, size_t n, const int *v) {
    for (size_t k = 0; k < n; k++) {
        if (!m->in_event_mode) return ERROR;
        *whole(m, r[k]) = v[k];
    }
    return OK;
}
Status fmi3GetNumberOfContinuousStates(Hopper *m, size_t *n) { (void)m; *n = 2; return OK; }
Status fmi3GetNumberOfEventIndicators(Hopper *m, size_t *n) { (void)m; *n = 1; return OK; }
#define STATE(verb) fmi3##verb##FMUState
#define DESERIALIZE fmi3DeserializeFMUState
#define DERIVATIVES fmi3GetContinuousStateDerivatives
#endif

Status F(ExitInitializationMode)(Hopper *m) { (void)m; return OK; }
Status F(EnterEventMode)(Hopper *m) { m->in_event_mode = 1; return OK; }
Status F(EnterContinuousTimeMode)(Hopper *m) { m->in_event_mode = 0; return OK; }
Status F(Terminate)(Hopper *m) { (void)m; return OK; }
void F(FreeInstance)(Hopper *m) { free(m); }
Status F(SetTime)(Hopper *m, double t) { m->real[TIME] = t; return OK; }
Status F(SetContinuousStates)(Hopper *m, const double *x, size_t n) { memcpy(m->real + H, x, n * sizeof *x); return OK; }
Status F(GetContinuousStates)(Hopper *m, double *x, size_t n) { memcpy(x, m->real + H, n * sizeof *x); return OK; }
Status F(GetNominalsOfContinuousStates)(Hopper *m, double *x, size_t n) { (void)m; for (size_t k = 0; k < n; k++) x[k] = 1; return OK; }
Status F(GetEventIndicators)(Hopper *m, double *z, size_t n) { (void)n; z[0] = m->real[H] == 0 && m->real[V] > 0 ? 1e-12 : m->real[H]; return OK; }
Status DERIVATIVES(Hopper *m, double *dx, size_t n) {
    Status status = derive(m);
    memcpy(dx, m->real + DER_H, n * sizeof *dx);
    return status;
}
Status F(CompletedIntegratorStep)(Hopper *m, Bool keeps, Bool *event, Bool *end) {
    (void)keeps;
    m->completed++;
    *event = *end = 0;
    return OK;
}
Status STATE(Get)(Hopper *m, void **state) {
    if (!*state) *state = malloc(sizeof *m);
    memcpy(*state, m, sizeof *m);
    return OK;
}
Status STATE(Set)(Hopper *m, void *state) { memcpy(m, state, sizeof *m); return OK; }
Status STATE(Free)(Hopper *m, void **state) { (void)m; free(*state); *state = NULL; return OK; }
#if FMI == 2
Status fmi2SerializedFMUstateSize(Hopper *m, void *state, size_t *n) { (void)m; (void)state; *n = sizeof *m; return OK; }
#else
Status fmi3SerializedFMUStateSize(Hopper *m, void *state, size_t *n) { (void)m; (void)state; *n = sizeof *m; return OK; }
#endif
Status STATE(Serialize)(Hopper *m, void *state, char *bytes, size_t n) { (void)m; memcpy(bytes, state, n); return OK; }
Status DESERIALIZE(Hopper *m, const char *bytes, size_t n, void **state) {
    (void)m;
    *state = malloc(n);
    memcpy(*state, bytes, n);
    return OK;
}
