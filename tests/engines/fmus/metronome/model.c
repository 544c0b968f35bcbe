/* FMI 3.0 co-simulation with clocks: `beat` every 0.1 s from 0.05 s on, `echo` a countdown of 0.025 s after every second
   beat, `hit` triggered from outside, `bell` rings at every second hit. A clocked variable may be touched at ticks of its
   clock alone. The declarations are those of the functions used here alone. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef int Status; /* 0 ok, 1 warning, 2 discard, 3 error, 4 fatal */
enum { OK, WARNING, DISCARD, ERROR };
enum { BEAT = 1, ECHO, HIT, BELL, N_CLOCKS };
enum { BEATS = 10, ECHOES, HITS, LEVEL = 20, SAMPLED };

typedef struct {
    double time, level, sampled;
    int beats, echoes, hits;
    bool active[N_CLOCKS], in_event_mode, counts_down;
} Metronome;

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging, bool events) {
    (void)name; (void)resources; (void)visible; (void)logging;
    if (!events || strcmp(token, "{trocar-metronome}")) return NULL;
    Metronome *m = calloc(1, sizeof *m);
    m->in_event_mode = true;
    return m;
}
void fmi3FreeInstance(Metronome *m) { free(m); }
Status fmi3EnterInitializationMode(Metronome *m) { (void)m; return OK; }
Status fmi3ExitInitializationMode(Metronome *m) { (void)m; return OK; }
Status fmi3EnterEventMode(Metronome *m) { m->in_event_mode = true; return OK; }
Status fmi3EnterStepMode(Metronome *m) { m->in_event_mode = false; return OK; }
Status fmi3Terminate(Metronome *m) { (void)m; return OK; }

Status fmi3SetClock(Metronome *m, const unsigned *reference, size_t n, const bool *value) {
    for (size_t k = 0; k < n; k++) {
        unsigned clock = reference[k];
        if (!m->in_event_mode || !value[k] || clock > HIT) return ERROR;
        m->active[clock] = true;
        if (clock == BEAT && ++m->beats % 2 == 0) m->counts_down = true;
        if (clock == ECHO) m->echoes++;
        if (clock == HIT) m->active[BELL] = ++m->hits % 2 == 0;
    }
    return OK;
}
Status fmi3GetClock(Metronome *m, const unsigned *reference, size_t n, bool *value) {
    for (size_t k = 0; k < n; k++) value[k] = m->active[reference[k]];
    return OK;
}
Status fmi3GetIntervalDecimal(Metronome *m, const unsigned *reference, size_t n, double *interval, int *qualifier) {
    if (n != 1 || reference[0] != ECHO || !m->in_event_mode) return ERROR;
    interval[0] = 0.025;
    qualifier[0] = m->counts_down ? 2 : 1;
    m->counts_down = false;
    return OK;
}
Status fmi3UpdateDiscreteStates(Metronome *m, bool *again, bool *ends, bool *nominals, bool *states, bool *scheduled, double *next) {
    *again = *ends = *nominals = *states = *scheduled = false;
    *next = 0;
    memset(m->active, 0, sizeof m->active);
    return m->in_event_mode ? OK : ERROR;
}
Status fmi3GetInt32(Metronome *m, const unsigned *reference, size_t n, int32_t *value) {
    for (size_t k = 0; k < n; k++) {
        unsigned clock = reference[k] - BEATS + BEAT;
        if (!m->active[clock]) return ERROR;
        value[k] = clock == BEAT ? m->beats : clock == ECHO ? m->echoes : m->hits;
    }
    return OK;
}
Status fmi3SetFloat64(Metronome *m, const unsigned *reference, size_t n, const double *value) {
    if (n != 1 || reference[0] != LEVEL || !m->active[BEAT]) return ERROR;
    m->level = value[0];
    return OK;
}
Status fmi3GetFloat64(Metronome *m, const unsigned *reference, size_t n, double *value) {
    if (n != 1 || reference[0] != SAMPLED || !m->active[BEAT]) return ERROR;
    value[0] = m->sampled = 2 * m->level;
    return OK;
}
Status fmi3DoStep(Metronome *m, double t, double h, bool keeps, bool *event, bool *ends, bool *early, double *reached) {
    (void)keeps;
    if (m->in_event_mode) return ERROR;
    *event = *ends = *early = false;
    *reached = m->time = t + h;
    return OK;
}
Status fmi3GetFMUState(Metronome *m, void **state) {
    if (!*state) *state = malloc(sizeof *m);
    memcpy(*state, m, sizeof *m);
    return OK;
}
Status fmi3SetFMUState(Metronome *m, void *state) { memcpy(m, state, sizeof *m); return OK; }
Status fmi3FreeFMUState(Metronome *m, void **state) { (void)m; free(*state); *state = NULL; return OK; }
Status fmi3SerializedFMUStateSize(Metronome *m, void *state, size_t *n) { (void)state; *n = sizeof *m; return OK; }
Status fmi3SerializeFMUState(Metronome *m, void *state, uint8_t *bytes, size_t n) { (void)m; memcpy(bytes, state, n); return OK; }
Status fmi3DeserializeFMUState(Metronome *m, const uint8_t *bytes, size_t n, void **state) {
    (void)m;
    *state = malloc(n);
    memcpy(*state, bytes, n);
    return OK;
}
