/* Texts and bytes, FMI 2.0 or 3.0 (-DFMI=3): `said` is the text and the number of steps, `mirrored` the bytes in reverse
   order and the number of steps. In FMI 3.0 inputs change in event mode alone, and `events` counts these. The declarations
   are those of the functions used here alone. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifndef FMI
#define FMI 2
#endif

typedef int Status; /* 0 ok, 1 warning, 2 discard, 3 error, 4 fatal */
enum { OK, WARNING, DISCARD, ERROR };
enum { TEXT = 1, FRAME, SAID, MIRRORED, EVENTS, FAULT };
enum { NO_FAULT, NOT_UTF8, NO_ADDRESS };
enum { MOST = 100 };

typedef struct {
    char text[MOST], said[MOST + 20];
    uint8_t frame[MOST], mirrored[MOST + 1];
    size_t size;
    int steps, events, fault, is_stepping;
} Notes;

static void *make(void)
{
    Notes *notes = calloc(1, sizeof *notes);
    strcpy(notes->text, "nothing");
    return notes;
}

static const char *said(Notes *notes)
{
    snprintf(notes->said, sizeof notes->said, "%s, step %d", notes->text, notes->steps);
    return notes->fault == NO_ADDRESS ? NULL : notes->fault == NOT_UTF8 ? "\xff" : notes->said;
}

static Status set_text(Notes *notes, const char *text)
{
    if (notes->is_stepping || strlen(text) >= MOST) return ERROR;
    strcpy(notes->text, text);
    return OK;
}

#if FMI == 2
void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const void *callbacks, int visible, int logging)
{
    (void)name; (void)type; (void)guid; (void)resources; (void)callbacks; (void)visible; (void)logging;
    return make();
}
void fmi2FreeInstance(Notes *notes) { free(notes); }
Status fmi2SetupExperiment(Notes *notes, int d, double tolerance, double t0, int e, double t1)
{
    (void)notes; (void)d; (void)tolerance; (void)t0; (void)e; (void)t1;
    return OK;
}
Status fmi2EnterInitializationMode(Notes *notes) { (void)notes; return OK; }
Status fmi2ExitInitializationMode(Notes *notes) { (void)notes; return OK; }
Status fmi2DoStep(Notes *notes, double t, double h, int keeps) { (void)t; (void)h; (void)keeps; notes->steps++; return OK; }
Status fmi2SetString(Notes *notes, const unsigned *reference, size_t n, const char *const *value)
{
    return n == 1 && *reference == TEXT ? set_text(notes, *value) : ERROR;
}
Status fmi2GetString(Notes *notes, const unsigned *reference, size_t n, const char **value)
{
    (void)n;
    *value = *reference == TEXT ? notes->text : said(notes);
    return OK;
}
#else
void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging, bool events)
{
    (void)name; (void)token; (void)resources; (void)visible; (void)logging;
    return events ? make() : NULL;
}
void fmi3FreeInstance(Notes *notes) { free(notes); }
Status fmi3EnterInitializationMode(Notes *notes) { (void)notes; return OK; }
Status fmi3ExitInitializationMode(Notes *notes) { (void)notes; return OK; }
Status fmi3EnterEventMode(Notes *notes) { notes->is_stepping = 0; notes->events++; return OK; }
Status fmi3EnterStepMode(Notes *notes) { notes->is_stepping = 1; return OK; }
Status fmi3UpdateDiscreteStates(Notes *notes, bool *again, bool *ends, bool *nominals, bool *states, bool *scheduled, double *next)
{
    (void)notes;
    *again = *ends = *nominals = *states = *scheduled = false;
    *next = 0;
    return OK;
}
Status fmi3DoStep(Notes *notes, double t, double h, bool keeps, bool *event, bool *ends, bool *early, double *reached)
{
    (void)keeps;
    notes->steps++;
    *event = *ends = *early = false;
    *reached = t + h;
    return OK;
}
Status fmi3SetString(Notes *notes, const unsigned *reference, size_t n, const char *const *value, size_t count)
{
    return n == 1 && count == 1 && *reference == TEXT ? set_text(notes, *value) : ERROR;
}
Status fmi3GetString(Notes *notes, const unsigned *reference, size_t n, const char **value, size_t count)
{
    *value = *reference == TEXT ? notes->text : said(notes);
    return n == 1 && count == 1 ? OK : ERROR;
}
Status fmi3SetBinary(Notes *notes, const unsigned *reference, size_t n, const size_t *size, const uint8_t *const *value, size_t count)
{
    if (n != 1 || count != 1 || notes->is_stepping || *reference != FRAME || *size > MOST) return ERROR;
    notes->size = *size;
    memcpy(notes->frame, *value, *size);
    return OK;
}
Status fmi3GetBinary(Notes *notes, const unsigned *reference, size_t n, size_t *size, const uint8_t **value, size_t count)
{
    if (*reference == FRAME) {
        *size = notes->size, *value = notes->frame;
    } else {
        for (size_t k = 0; k < notes->size; k++) notes->mirrored[k] = notes->frame[notes->size - 1 - k];
        notes->mirrored[notes->size] = (uint8_t)notes->steps;
        *size = notes->size + 1, *value = notes->fault == NO_ADDRESS ? NULL : notes->mirrored;
    }
    return n == 1 && count == 1 ? OK : ERROR;
}
Status fmi3GetInt32(Notes *notes, const unsigned *reference, size_t n, int32_t *value, size_t count)
{
    *value = notes->events;
    return n == 1 && count == 1 && *reference == EVENTS ? OK : ERROR;
}
Status fmi3SetInt32(Notes *notes, const unsigned *reference, size_t n, const int32_t *value, size_t count)
{
    notes->fault = *value;
    return n == 1 && count == 1 && *reference == FAULT ? OK : ERROR;
}
Status fmi3GetFMUState(Notes *notes, void **state)
{
    if (!*state) *state = malloc(sizeof *notes);
    memcpy(*state, notes, sizeof *notes);
    return OK;
}
Status fmi3SetFMUState(Notes *notes, void *state) { memcpy(notes, state, sizeof *notes); return OK; }
Status fmi3FreeFMUState(Notes *notes, void **state) { (void)notes; free(*state); *state = NULL; return OK; }
Status fmi3SerializedFMUStateSize(Notes *notes, void *state, size_t *n) { (void)state; *n = sizeof *notes; return OK; }
Status fmi3SerializeFMUState(Notes *notes, void *state, uint8_t *bytes, size_t n) { (void)notes; memcpy(bytes, state, n); return OK; }
Status fmi3DeserializeFMUState(Notes *notes, const uint8_t *bytes, size_t n, void **state)
{
    (void)notes;
    *state = malloc(n);
    memcpy(*state, bytes, n);
    return OK;
}
#endif
