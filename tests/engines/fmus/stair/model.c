/* FMI 2.0 co-simulation: a counter that rises every second from 1 and ends the simulation when it has reached `last`.
   It has only the functions that this takes. Compiled with
   -DALL_FUNCTIONS it has the others as well, which FMPy asks for
   -DADDING_CLOCK  it goes by a clock of its own, to which it adds 0.1 s a time, as FMUs of 20-sim do
   -DNO_STEP       it lacks fmi2DoStep
   -DNEEDS_LIBRARY it needs a library that is not there */
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

typedef int Status; /* 0 ok, 1 warning, 2 discard, 3 error, 4 fatal, 5 pending */
enum { OK, WARNING, DISCARD, ERROR };
enum { COUNTER, LAST, TICKS };                          /* value references of integers */
enum { LAST_SUCCESSFUL_TIME = 2, TERMINATED = 3 };      /* fmi2StatusKind */
#define INTERNAL 0.1

typedef struct {
    double time;
    int integer[3], over;
} Instance;

#ifdef NEEDS_LIBRARY
int needed_of_elsewhere(void);
int needed(void) { return needed_of_elsewhere(); }
#endif

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const void *callbacks, int visible, int logging) {
    (void)name; (void)resources; (void)callbacks; (void)visible; (void)logging;
    if (type != 1 || strcmp(guid, "{trocar-stair}") != 0) return NULL;
    Instance *i = calloc(1, sizeof *i);
    i->integer[COUNTER] = 1;
    i->integer[LAST] = 10;
    return i;
}

void fmi2FreeInstance(void *c) { free(c); }
Status fmi2SetupExperiment(void *c, int has_tolerance, double tolerance, double start, int has_stop, double stop) {
    (void)c; (void)has_tolerance; (void)tolerance; (void)has_stop; (void)stop;
    return start == 0 ? OK : ERROR;
}
Status fmi2EnterInitializationMode(void *c) { (void)c; return OK; }
Status fmi2ExitInitializationMode(void *c) { (void)c; return OK; }
Status fmi2Terminate(void *c) { (void)c; return OK; }

Status fmi2SetInteger(void *c, const unsigned *reference, size_t n, const int *value) {
    for (size_t k = 0; k < n; k++) ((Instance *)c)->integer[reference[k]] = value[k];
    return OK;
}

Status fmi2GetInteger(void *c, const unsigned *reference, size_t n, int *value) {
    for (size_t k = 0; k < n; k++) value[k] = ((Instance *)c)->integer[reference[k]];
    return OK;
}

#ifndef NO_STEP
Status fmi2DoStep(void *c, double time, double h, int no_state_prior) {
    (void)no_state_prior;
    Instance *i = c;
    if (i->over) return ERROR; /* a simulation that has ended is stepped no more */
#ifdef ADDING_CLOCK
    for (; i->time < time + h; i->integer[TICKS]++) i->time += INTERNAL;
#else
    i->integer[TICKS] += (int)round(h / INTERNAL);
    i->time = time + h;
#endif
    i->integer[COUNTER] = 1 + (int)floor(i->time + 1e-9);
    if (i->integer[COUNTER] < i->integer[LAST]) return OK;
    i->integer[COUNTER] = i->integer[LAST];
    i->time = i->integer[LAST] - 1;
    i->over = 1;
    return DISCARD;
}
#endif

Status fmi2GetRealStatus(void *c, int kind, double *value) {
    *value = ((Instance *)c)->time;
    return kind == LAST_SUCCESSFUL_TIME ? OK : DISCARD;
}

Status fmi2GetBooleanStatus(void *c, int kind, int *value) {
    *value = ((Instance *)c)->over;
    return kind == TERMINATED ? OK : DISCARD;
}

#ifdef ALL_FUNCTIONS
#define UNUSED(Name) Status fmi2##Name(void) { return ERROR; }
UNUSED(GetTypesPlatform) UNUSED(GetVersion) UNUSED(SetDebugLogging) UNUSED(Reset) UNUSED(GetReal) UNUSED(SetReal) UNUSED(GetBoolean) UNUSED(SetBoolean)
UNUSED(GetString) UNUSED(SetString) UNUSED(GetFMUstate) UNUSED(SetFMUstate) UNUSED(FreeFMUstate) UNUSED(SerializedFMUstateSize)
UNUSED(SerializeFMUstate) UNUSED(DeSerializeFMUstate) UNUSED(GetDirectionalDerivative) UNUSED(SetRealInputDerivatives)
UNUSED(GetRealOutputDerivatives) UNUSED(CancelStep) UNUSED(GetStatus) UNUSED(GetIntegerStatus) UNUSED(GetStringStatus)
#endif
