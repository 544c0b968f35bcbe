/* FMI 3.0 co-simulation of the robot. Types as in fmi3PlatformTypes.h and fmi3FunctionTypes.h of the standard. */

#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "robot.h"

#define FMI __attribute__((visibility("default")))
#define UNUSED(x) (void)(x)

typedef enum { OK, WARNING, DISCARD, ERROR, FATAL } Status;
typedef void (*Log)(void *environment, Status status, const char *category, const char *message);

typedef struct {
    Robot *robot;
    Log log;
    void *environment;
} Instance;

static void report(void *to, const char *message)
{
    Instance *instance = to;
    if (instance->log) instance->log(instance->environment, ERROR, "logStatusError", message);
}

static Status as_status(int succeeded) { return succeeded ? OK : ERROR; }

FMI const char *fmi3GetVersion(void) { return "3.0"; }

FMI void fmi3FreeInstance(Instance *instance)
{
    if (!instance) return;
    robot_free(instance->robot);
    free(instance);
}

FMI Instance *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                          bool logging, bool events, bool early, const unsigned *intermediate,
                                          size_t count, void *environment, Log log, void *update)
{
    UNUSED(name), UNUSED(resources), UNUSED(visible), UNUSED(logging), UNUSED(early), UNUSED(intermediate);
    UNUSED(count), UNUSED(update);
    Instance *instance = calloc(1, sizeof *instance);
    if (!instance) return NULL;
    instance->log = log;
    instance->environment = environment;
    if (!token || strcmp(token, TOKEN)) report(instance, "the instantiation token is that of another FMU");
    else if (events) report(instance, "the robot has no event mode");
    else instance->robot = robot_create(report, instance);
    if (!instance->robot) {
        fmi3FreeInstance(instance);
        return NULL;
    }
    return instance;
}

FMI Instance *fmi3InstantiateModelExchange(void) { return NULL; }
FMI Instance *fmi3InstantiateScheduledExecution(void) { return NULL; }

FMI Status fmi3SetDebugLogging(Instance *instance, bool on, size_t count, const char *const *categories)
{
    UNUSED(instance), UNUSED(on), UNUSED(count), UNUSED(categories);
    return OK;
}

FMI Status fmi3EnterInitializationMode(Instance *instance, bool has_tolerance, double tolerance, double start,
                                       bool has_stop, double stop)
{
    UNUSED(has_tolerance), UNUSED(tolerance), UNUSED(has_stop), UNUSED(stop);
    instance->robot->start = start;
    return OK;
}

FMI Status fmi3ExitInitializationMode(Instance *instance)
{
    return as_status(robot_start(instance->robot, instance->robot->start));
}

FMI Status fmi3Terminate(Instance *instance) { instance->robot->running = 0; return OK; }
FMI Status fmi3Reset(Instance *instance) { robot_reset(instance->robot); return OK; }

FMI Status fmi3GetFloat64(Instance *instance, const unsigned *references, size_t count, double *values, size_t size)
{
    UNUSED(size);
    for (size_t i = 0; i < count; i++)
        if (!robot_get(instance->robot, references[i], values + i)) return ERROR;
    return OK;
}

FMI Status fmi3SetFloat64(Instance *instance, const unsigned *references, size_t count, const double *values,
                          size_t size)
{
    UNUSED(size);
    for (size_t i = 0; i < count; i++)
        if (!robot_set(instance->robot, references[i], values[i])) return ERROR;
    return OK;
}

FMI Status fmi3GetFMUState(Instance *instance, State **state)
{
    if (!*state && !(*state = malloc(sizeof **state))) return ERROR;
    robot_save(instance->robot, *state);
    return OK;
}

FMI Status fmi3SetFMUState(Instance *instance, const State *state)
{
    return as_status(robot_restore(instance->robot, state));
}

FMI Status fmi3FreeFMUState(Instance *instance, State **state)
{
    UNUSED(instance);
    free(*state);
    *state = NULL;
    return OK;
}

FMI Status fmi3SerializedFMUStateSize(Instance *instance, const State *state, size_t *size)
{
    UNUSED(instance), UNUSED(state);
    *size = sizeof *state;
    return OK;
}

FMI Status fmi3SerializeFMUState(Instance *instance, const State *state, uint8_t *bytes, size_t size)
{
    if (size != sizeof *state) return as_status(robot_fail(instance->robot, "a state has %zu bytes", sizeof *state));
    memcpy(bytes, state, size);
    return OK;
}

FMI Status fmi3DeserializeFMUState(Instance *instance, const uint8_t *bytes, size_t size, State **state)
{
    if (size != sizeof **state)
        return as_status(robot_fail(instance->robot, "%zu bytes are no state, which has %zu", size, sizeof **state));
    if (!*state && !(*state = malloc(size))) return ERROR;
    memcpy(*state, bytes, size);
    return OK;
}

FMI Status fmi3DoStep(Instance *instance, double t, double h, bool keeps, bool *event, bool *end, bool *early,
                      double *reached)
{
    UNUSED(keeps);
    *event = *end = *early = false;
    int succeeded = robot_step(instance->robot, t, h);
    *reached = robot_time(instance->robot);
    return as_status(succeeded);
}

/* All others: the robot has no such variables, or has not the capability. */
#define NONE(function)                                                                                           \
    FMI Status fmi3##function(Instance *instance)                                                                \
    {                                                                                                            \
        return as_status(robot_fail(instance->robot, "fmi3%s: the robot has no such variables or capability",    \
                                    #function));                                                                 \
    }
#define NONE_OF(type) NONE(Get##type) NONE(Set##type)
NONE_OF(Float32) NONE_OF(Int8) NONE_OF(UInt8) NONE_OF(Int16) NONE_OF(UInt16) NONE_OF(Int32) NONE_OF(UInt32)
NONE_OF(Int64) NONE_OF(UInt64) NONE_OF(Boolean) NONE_OF(String) NONE_OF(Binary) NONE_OF(Clock)
NONE_OF(IntervalDecimal) NONE_OF(IntervalFraction) NONE_OF(ShiftDecimal) NONE_OF(ShiftFraction)
NONE(GetNumberOfVariableDependencies) NONE(GetVariableDependencies) NONE(GetDirectionalDerivative)
NONE(GetAdjointDerivative) NONE(GetOutputDerivatives) NONE(EnterConfigurationMode) NONE(ExitConfigurationMode)
NONE(EnterEventMode) NONE(EvaluateDiscreteStates) NONE(UpdateDiscreteStates) NONE(EnterContinuousTimeMode)
NONE(CompletedIntegratorStep) NONE(SetTime) NONE(SetContinuousStates) NONE(GetContinuousStateDerivatives)
NONE(GetEventIndicators) NONE(GetContinuousStates) NONE(GetNominalsOfContinuousStates)
NONE(GetNumberOfEventIndicators) NONE(GetNumberOfContinuousStates) NONE(EnterStepMode) NONE(ActivateModelPartition)
