/* The robot behind the functions of FMI: MuJoCo's model, and the drives of its joints.

   Variables stand in one array of doubles, `Robot.values`; a value reference is a place in this array. First the
   inputs, then gravity, then the outputs. `tables.h` is generated with every FMU: sizes, limits and matrices. */

#ifndef TROCAR_ROBOT_H
#define TROCAR_ROBOT_H

#include <mujoco/mujoco.h>
#include <stddef.h>

#include "tables.h"

typedef void (*Report)(void *to, const char *message);

/* The state of a robot in one piece: what FMI's states hold, and what is serialised. */
typedef struct {
    double steps;             /* periods since the start */
    double values[VALUES];    /* all variables */
    double setpoint[DRIVES];  /* of the drives, rad and m */
    double physics[PHYSICS];  /* MuJoCo's integration state */
} State;

typedef struct {
    mjModel *model;
    mjData *data;
    double steps;
    double start;             /* time of the first step, s */
    double values[VALUES];
    double setpoint[DRIVES], previous[DRIVES], effort[DRIVES];
    int pushed;               /* whether a force acts at a tip */
    int running;              /* initialised, and not terminated */
    Report report;            /* takes messages of errors */
    void *to;
} Robot;

/* Each returns whether it succeeded; a failure has been reported. */
Robot *robot_create(Report report, void *to);
void robot_free(Robot *robot);
void robot_reset(Robot *robot);
int robot_start(Robot *robot, double start);
int robot_step(Robot *robot, double t, double h);
int robot_set(Robot *robot, unsigned reference, double value);
int robot_get(Robot *robot, unsigned reference, double *value);
void robot_save(const Robot *robot, State *state);
int robot_restore(Robot *robot, const State *state);
int robot_fail(Robot *robot, const char *format, ...);
double robot_time(const Robot *robot);

#endif
