/* The robot: commands to setpoints to inputs of MuJoCo's servos, as `engines.mujoco.arms.servos` has them.

   Every product and every sum is rounded as in the session, so the bits are the same: the compiler must not fuse
   them (-ffp-contract=off), and `FUSED` has the rows in which numpy's matrix product does. */

#include "robot.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

__asm__(
    ".section .rodata\n"
    ".balign 16\n"
    ".hidden trocar_model\n"
    ".globl trocar_model\n"
    "trocar_model:\n"
    ".incbin \"" MODEL_FILE "\"\n"
    ".previous\n");
extern const unsigned char trocar_model[];

/* MuJoCo's own handler writes MUJOCO_LOG.TXT into the working directory. */
static void ignore(const char *message) { (void)message; }

int robot_fail(Robot *robot, const char *format, ...)
{
    char message[400];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    robot->report(robot->to, message);
    return 0;
}

Robot *robot_create(Report report, void *to)
{
    Robot *robot = calloc(1, sizeof *robot);
    if (!robot) return NULL;
    robot->report = report;
    robot->to = to;
    if (!mju_user_warning) mju_user_warning = ignore;
    if (mj_version() != mjVERSION_HEADER) {
        robot_fail(robot, "MuJoCo %s is loaded, this FMU is compiled for version %d and has it beside its binary",
                   mj_versionString(), mjVERSION_HEADER);
        free(robot);
        return NULL;
    }
    robot->model = mj_loadModelBuffer(trocar_model, MODEL_SIZE);
    robot->data = robot->model ? mj_makeData(robot->model) : NULL;
    if (!robot->data) {
        robot_fail(robot, "MuJoCo cannot load the model of the robot");
        robot_free(robot);
        return NULL;
    }
    robot_reset(robot);
    return robot;
}

void robot_free(Robot *robot)
{
    if (!robot) return;
    if (robot->data) mj_deleteData(robot->data);
    if (robot->model) mj_deleteModel(robot->model);
    free(robot);
}

static void read_outputs(Robot *robot)
{
    double *outputs = robot->values + OUTPUTS_FROM;
    memset(outputs, 0, (VALUES - OUTPUTS_FROM) * sizeof *outputs);
    for (size_t i = 0; i < sizeof READ / sizeof *READ; i++) {
        const Term *term = READ + i;
        double source = term->source < SENSORS ? robot->data->sensordata[term->source]
                                               : robot->setpoint[term->source - SENSORS];
        outputs[term->target] += term->factor * source;
    }
}

void robot_reset(Robot *robot)
{
    mjData *data = robot->data;
    robot->steps = robot->start = 0.0;
    robot->pushed = robot->running = 0;
    memcpy(robot->values, VALUES_AT_START, sizeof VALUES_AT_START);
    memcpy(robot->setpoint, VALUES_AT_START, sizeof robot->setpoint);
    robot->model->opt.gravity[2] = -robot->values[GRAVITY];
    mj_resetData(robot->model, data);
    mj_setState(robot->model, data, PHYSICS_AT_START, mjSTATE_INTEGRATION);
    mj_forward(robot->model, data);  /* computes the efforts, which the state does not hold */
    mj_setState(robot->model, data, PHYSICS_AT_START, mjSTATE_INTEGRATION);
    mj_step1(robot->model, data);
    read_outputs(robot);
}

int robot_start(Robot *robot, double start)
{
    robot->start = start;
    robot->running = 1;
    return 1;
}

double robot_time(const Robot *robot) { return robot->start + robot->steps * PERIOD; }

/* Let the setpoints follow the commands, no faster than the joints may move. */
static void follow(Robot *robot)
{
    memcpy(robot->previous, robot->setpoint, sizeof robot->setpoint);
    for (int i = 0; i < DRIVES; i++) {
        double command = robot->values[i], last = robot->setpoint[i];
        if (command < LOWER[i]) command = LOWER[i];
        if (command > UPPER[i]) command = UPPER[i];
        if (command < last - WAY[i]) command = last - WAY[i];
        if (command > last + WAY[i]) command = last + WAY[i];
        robot->setpoint[i] = command;
        robot->effort[i] = SPRING[i] * (command - REST[i]);  /* what holds against the springs there */
    }
}

static void drive(Robot *robot)
{
    double *control = robot->data->ctrl;
    mju_zero(control, robot->model->nu);
    for (size_t i = 0; i < sizeof SERVO / sizeof *SERVO; i++) {
        const Term *term = SERVO + i;
        int part = term->source / DRIVES, drive = term->source % DRIVES;
        double source = (part == 0 ? robot->setpoint : part == 1 ? robot->previous : robot->effort)[drive];
        double *sum = control + term->target;
        *sum = FUSED[term->target] ? fma(term->factor, source, *sum) : *sum + term->factor * source;
    }
}

/* Let the forces and torques at the tips act in the next sub-step. */
static void push(Robot *robot)
{
    const double *wrench = robot->values + DRIVES;
    int pushes = 0;
    for (int i = 0; i < 6 * ARMS; i++) pushes |= wrench[i] != 0.0;
    if (!pushes && !robot->pushed) return;
    mjData *data = robot->data;
    mju_zero(data->qfrc_applied, robot->model->nv);
    for (int arm = 0; arm < ARMS; arm++, wrench += 6) {
        double force[3], torque[3];
        mju_mulMatVec3(force, BASE[arm], wrench);
        mju_mulMatVec3(torque, BASE[arm], wrench + 3);
        mj_applyFT(robot->model, data, force, torque, data->site_xpos + 3 * TIP[arm],
                   robot->model->site_bodyid[TIP[arm]], data->qfrc_applied);
    }
    robot->pushed = pushes;
}

static int unstable(const Robot *robot)
{
    const mjWarningStat *warning = robot->data->warning;
    for (int i = mjWARN_BADQPOS; i <= mjWARN_BADCTRL; i++)
        if (warning[i].number) return 1;
    return 0;
}

static int take_period(Robot *robot)
{
    if (robot->model->opt.gravity[2] != -robot->values[GRAVITY]) {
        robot->model->opt.gravity[2] = -robot->values[GRAVITY];
        mj_step1(robot->model, robot->data);  /* the last sub-step has prepared its forces */
    }
    follow(robot);
    drive(robot);
    for (int i = 0; i < SUB_STEPS; i++) {
        push(robot);
        mj_step2(robot->model, robot->data);
        mj_step1(robot->model, robot->data);
    }
    robot->steps += 1.0;
    if (unstable(robot))
        return robot_fail(robot, "the simulation is unstable at %.9g s: is a force at a tip too large?",
                          robot_time(robot));
    return 1;
}

int robot_step(Robot *robot, double t, double h)
{
    if (!robot->running) return robot_fail(robot, "a step before the end of the initialisation");
    double periods = rint(h / PERIOD);
    if (!(periods >= 1.0 && fabs(h - periods * PERIOD) <= 1e-6 * PERIOD))
        return robot_fail(robot, "a communication step of %.9g s; it must be a multiple of %.9g s", h, PERIOD);
    if (!(fabs(t - robot_time(robot)) <= 0.5 * PERIOD))
        return robot_fail(robot, "a step from %.9g s; the robot is at %.9g s", t, robot_time(robot));
    for (; periods > 0.0; periods -= 1.0)
        if (!take_period(robot)) return 0;
    read_outputs(robot);
    return 1;
}

int robot_set(Robot *robot, unsigned reference, double value)
{
    if (reference >= OUTPUTS_FROM) return robot_fail(robot, "value reference %u is no input or parameter", reference);
    if (!isfinite(value)) return robot_fail(robot, "'%s' is set to %g, expected a finite number", NAMES[reference], value);
    if (reference == GRAVITY && !(value >= 0.0 && value <= MOST_GRAVITY))
        return robot_fail(robot, "'gravity' is set to %g, allowed are 0 to %g m/s^2", value, MOST_GRAVITY);
    robot->values[reference] = value;
    return 1;
}

int robot_get(Robot *robot, unsigned reference, double *value)
{
    if (reference == VALUES) *value = robot_time(robot);
    else if (reference < VALUES) *value = robot->values[reference];
    else return robot_fail(robot, "there is no value reference %u", reference);
    return 1;
}

void robot_save(const Robot *robot, State *state)
{
    state->steps = robot->steps;
    memcpy(state->values, robot->values, sizeof state->values);
    memcpy(state->setpoint, robot->setpoint, sizeof state->setpoint);
    mj_getState(robot->model, robot->data, state->physics, mjSTATE_INTEGRATION);
}

int robot_restore(Robot *robot, const State *state)
{
    const double *numbers = (const double *)state;
    for (size_t i = 0; i < sizeof *state / sizeof *numbers; i++)
        if (!isfinite(numbers[i])) return robot_fail(robot, "a state with numbers that are not finite");
    robot->steps = state->steps;
    memcpy(robot->values, state->values, sizeof state->values);
    memcpy(robot->setpoint, state->setpoint, sizeof state->setpoint);
    robot->model->opt.gravity[2] = -robot->values[GRAVITY];
    robot->pushed = 1;  /* the state may hold a force */
    mj_resetData(robot->model, robot->data);
    mj_setState(robot->model, robot->data, state->physics, mjSTATE_INTEGRATION);
    mj_step1(robot->model, robot->data);
    return 1;
}
