/* FMI 2.0 co-simulation of the robot. Types as in fmi2TypesPlatform.h and fmi2FunctionTypes.h of the standard. */

#include <stdlib.h>
#include <string.h>

#include "robot.h"

#define FMI __attribute__((visibility("default")))
#define UNUSED(x) (void)(x)

typedef enum { OK, WARNING, DISCARD, ERROR, FATAL, PENDING } Status;
typedef void (*Logger)(void *environment, const char *name, Status status, const char *category,
                       const char *message, ...);
typedef struct {
    Logger logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, Status);
    void *environment;
} Callbacks;

typedef struct {
    Robot *robot;
    Callbacks callbacks;
    char *name;
    double start;
} Instance;

static void report(void *to, const char *message)
{
    Instance *instance = to;
    if (instance->callbacks.logger)
        instance->callbacks.logger(instance->callbacks.environment, instance->name, ERROR, "logStatusError", "%s",
                                   message);
}

static Status as_status(int succeeded) { return succeeded ? OK : ERROR; }

static Status absent(Instance *instance, const char *function)
{
    return as_status(robot_fail(instance->robot, "%s: the robot has no such variables or capability", function));
}

FMI const char *fmi2GetTypesPlatform(void) { return "default"; }
FMI const char *fmi2GetVersion(void) { return "2.0"; }

FMI void fmi2FreeInstance(Instance *instance)
{
    if (!instance) return;
    robot_free(instance->robot);
    free(instance->name);
    free(instance);
}

FMI Instance *fmi2Instantiate(const char *name, int type, const char *token, const char *resources,
                              const Callbacks *callbacks, int visible, int logging)
{
    UNUSED(resources), UNUSED(visible), UNUSED(logging);
    Instance *instance = calloc(1, sizeof *instance);
    if (!instance) return NULL;
    if (callbacks) instance->callbacks = *callbacks;
    instance->name = strdup(name ? name : "");
    if (type != 1) report(instance, "the robot is for co-simulation, not for model exchange");
    else if (!token || strcmp(token, TOKEN)) report(instance, "the GUID is that of another FMU");
    else instance->robot = robot_create(report, instance);
    if (!instance->robot) {
        fmi2FreeInstance(instance);
        return NULL;
    }
    return instance;
}

FMI Status fmi2SetDebugLogging(Instance *instance, int on, size_t count, const char *const *categories)
{
    UNUSED(instance), UNUSED(on), UNUSED(count), UNUSED(categories);
    return OK;
}

FMI Status fmi2SetupExperiment(Instance *instance, int has_tolerance, double tolerance, double start, int has_stop,
                               double stop)
{
    UNUSED(has_tolerance), UNUSED(tolerance), UNUSED(has_stop), UNUSED(stop);
    instance->start = start;
    return OK;
}

FMI Status fmi2EnterInitializationMode(Instance *instance) { UNUSED(instance); return OK; }
FMI Status fmi2ExitInitializationMode(Instance *instance)
{
    return as_status(robot_start(instance->robot, instance->start));
}

FMI Status fmi2Terminate(Instance *instance) { instance->robot->running = 0; return OK; }
FMI Status fmi2Reset(Instance *instance) { robot_reset(instance->robot); return OK; }

FMI Status fmi2GetReal(Instance *instance, const unsigned *references, size_t count, double *values)
{
    for (size_t i = 0; i < count; i++)
        if (!robot_get(instance->robot, references[i], values + i)) return ERROR;
    return OK;
}

FMI Status fmi2SetReal(Instance *instance, const unsigned *references, size_t count, const double *values)
{
    for (size_t i = 0; i < count; i++)
        if (!robot_set(instance->robot, references[i], values[i])) return ERROR;
    return OK;
}

#define NONE_OF(function, type)                                                                                 \
    FMI Status function(Instance *instance, const unsigned *references, size_t count, type values)              \
    {                                                                                                           \
        UNUSED(references), UNUSED(values);                                                                     \
        return count ? absent(instance, #function) : OK;                                                        \
    }
NONE_OF(fmi2GetInteger, int *)
NONE_OF(fmi2GetBoolean, int *)
NONE_OF(fmi2GetString, const char **)
NONE_OF(fmi2SetInteger, const int *)
NONE_OF(fmi2SetBoolean, const int *)
NONE_OF(fmi2SetString, const char *const *)

FMI Status fmi2GetFMUstate(Instance *instance, State **state)
{
    if (!*state && !(*state = malloc(sizeof **state))) return ERROR;
    robot_save(instance->robot, *state);
    return OK;
}

FMI Status fmi2SetFMUstate(Instance *instance, const State *state)
{
    return as_status(robot_restore(instance->robot, state));
}

FMI Status fmi2FreeFMUstate(Instance *instance, State **state)
{
    UNUSED(instance);
    free(*state);
    *state = NULL;
    return OK;
}

FMI Status fmi2SerializedFMUstateSize(Instance *instance, const State *state, size_t *size)
{
    UNUSED(instance), UNUSED(state);
    *size = sizeof *state;
    return OK;
}

FMI Status fmi2SerializeFMUstate(Instance *instance, const State *state, char *bytes, size_t size)
{
    if (size != sizeof *state) return as_status(robot_fail(instance->robot, "a state has %zu bytes", sizeof *state));
    memcpy(bytes, state, size);
    return OK;
}

FMI Status fmi2DeSerializeFMUstate(Instance *instance, const char *bytes, size_t size, State **state)
{
    if (size != sizeof **state)
        return as_status(robot_fail(instance->robot, "%zu bytes are no state, which has %zu", size, sizeof **state));
    if (!*state && !(*state = malloc(size))) return ERROR;
    memcpy(*state, bytes, size);
    return OK;
}

FMI Status fmi2GetDirectionalDerivative(Instance *instance) { return absent(instance, "fmi2GetDirectionalDerivative"); }
FMI Status fmi2SetRealInputDerivatives(Instance *instance) { return absent(instance, "fmi2SetRealInputDerivatives"); }
FMI Status fmi2GetRealOutputDerivatives(Instance *instance) { return absent(instance, "fmi2GetRealOutputDerivatives"); }

FMI Status fmi2DoStep(Instance *instance, double t, double h, int keeps)
{
    UNUSED(keeps);
    return as_status(robot_step(instance->robot, t, h));
}

FMI Status fmi2CancelStep(Instance *instance) { return absent(instance, "fmi2CancelStep"); }

FMI Status fmi2GetStatus(Instance *instance, int kind, Status *value)
{
    UNUSED(instance), UNUSED(kind), UNUSED(value);
    return DISCARD;
}

FMI Status fmi2GetRealStatus(Instance *instance, int kind, double *value)
{
    if (kind != 2) return DISCARD;
    *value = robot_time(instance->robot); /* fmi2LastSuccessfulTime */
    return OK;
}

FMI Status fmi2GetIntegerStatus(Instance *instance, int kind, int *value)
{
    UNUSED(instance), UNUSED(kind), UNUSED(value);
    return DISCARD;
}

FMI Status fmi2GetBooleanStatus(Instance *instance, int kind, int *value)
{
    UNUSED(instance);
    if (kind != 3) return DISCARD;
    *value = 0; /* fmi2Terminated: the robot never asks for the end */
    return OK;
}

FMI Status fmi2GetStringStatus(Instance *instance, int kind, const char **value)
{
    UNUSED(instance), UNUSED(kind), UNUSED(value);
    return DISCARD;
}
