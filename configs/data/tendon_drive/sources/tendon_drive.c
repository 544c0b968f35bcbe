/* FMI 2.0 co-simulation: motor, capstan and cable of an instrument's insertion; docs/how-to/tendon.md.

   Everything is at the cable, in m and N: the capstan turns rotor angle into cable length. With x, v of the
   motor, X, V of the joint, s = x - X, and u its part beyond half of the backlash (0 within):

     tension   T = max(0, 1 + a (v - V) sign u) k u                     (Hunt and Crossley 1975)
     friction  R = b v + (F + p |T|) z,   dz/dt = (v - |v| z) / l       (Dahl 1968)
     motor     m dv/dt = M - R - T,   M = P (c - x) + D (c' - v), at most torque constant and current allow

   The command c and the joint's motion are lines within a communication step. The account of energy is
   integrated with the motion, by RK4 with steps of at most 20 us. */
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#define FMI __declspec(dllexport)
#else
#define FMI __attribute__((visibility("default")))
#endif

typedef int Status; /* 0 ok, 1 warning, 2 discard, 3 error, 4 fatal, 5 pending */
enum { OK, WARNING, DISCARD, ERROR };
enum { INPUTS = 3, STATES = 6 };
enum { COMMAND, POSITION, VELOCITY, /* inputs */
       FORCE, MOTOR_POSITION, MOTOR_FORCE, STRETCH, BY_MOTOR, TO_JOINT, STORED, LOST, /* outputs */
       ROTOR_INERTIA, RATIO, TORQUE_CONSTANT, LARGEST_CURRENT, GAIN, RATE_GAIN, VISCOUS, COULOMB, PULLEY_LOSS,
       PRESLIDING, STIFFNESS, CABLE_DAMPING, BACKLASH, START, /* parameters */
       REALS };
enum { X, V, Z, W_MOTOR, W_JOINT, W_LOST }; /* the state that is integrated */

static const double LONGEST_STEP = 20e-6;

typedef struct {
    double real[REALS];
    double slope[INPUTS];
    double state[STATES];
} Data;

typedef struct {
    Data data;
    int mode; /* 0 instantiated, 1 initialising, 2 stepping, 3 terminated */
} Instance;

typedef struct {
    double tension, beyond, friction, motor;
} Forces;

static double sign(double value) { return (value > 0) - (value < 0); }

static double beyond(const Data *d, double stretch) {
    double half = 0.5 * d->real[BACKLASH];
    return stretch > half ? stretch - half : stretch < -half ? stretch + half : 0;
}

static double mass(const Data *d) { return d->real[ROTOR_INERTIA] * d->real[RATIO] * d->real[RATIO]; }

/* in[] has the command, the joint's position and velocity */
static Forces forces(const Data *d, const double *state, const double *in, double command_slope) {
    const double *r = d->real;
    Forces f;
    f.beyond = beyond(d, state[X] - in[POSITION]);
    double rise = 1 + r[CABLE_DAMPING] * (state[V] - in[VELOCITY]) * sign(f.beyond);
    f.tension = rise > 0 ? r[STIFFNESS] * f.beyond * rise : 0;
    f.friction = r[VISCOUS] * state[V] + (r[COULOMB] + r[PULLEY_LOSS] * fabs(f.tension)) * state[Z];
    double largest = r[LARGEST_CURRENT] * r[TORQUE_CONSTANT] * r[RATIO];
    double asked = r[GAIN] * (in[COMMAND] - state[X]) + r[RATE_GAIN] * (command_slope - state[V]);
    f.motor = asked > largest ? largest : asked < -largest ? -largest : asked;
    return f;
}

static void derive(const Data *d, const double *state, double tau, double *rate) {
    double in[INPUTS];
    for (int i = 0; i < INPUTS; i++) in[i] = d->real[i] + tau * d->slope[i];
    Forces f = forces(d, state, in, d->slope[COMMAND]);
    double v = state[V];
    rate[X] = v;
    rate[V] = (f.motor - f.friction - f.tension) / mass(d);
    rate[Z] = (v - fabs(v) * state[Z]) / d->real[PRESLIDING];
    rate[W_MOTOR] = f.motor * v;
    rate[W_JOINT] = f.tension * in[VELOCITY];
    rate[W_LOST] = f.friction * v + (f.tension - d->real[STIFFNESS] * f.beyond) * (v - in[VELOCITY]);
}

static void integrate(Data *d, double tau, double h) {
    static const double share[] = {0, 0.5, 0.5, 1}, weight[] = {1, 2, 2, 1};
    double rate[4][STATES], state[STATES];
    for (int k = 0; k < 4; k++) {
        for (int i = 0; i < STATES; i++) state[i] = d->state[i] + (k ? share[k] * h * rate[k - 1][i] : 0);
        derive(d, state, tau + share[k] * h, rate[k]);
    }
    for (int i = 0; i < STATES; i++) {
        double sum = 0;
        for (int k = 0; k < 4; k++) sum += weight[k] * rate[k][i];
        d->state[i] += h / 6 * sum;
    }
}

/* outputs from states and inputs; the joint's position may have jumped since the last step */
static void update(Data *d) {
    double *r = d->real;
    const double *state = d->state;
    Forces f = forces(d, state, r, d->slope[COMMAND]);
    r[FORCE] = f.tension;
    r[MOTOR_POSITION] = state[X];
    r[MOTOR_FORCE] = f.motor;
    r[STRETCH] = state[X] - r[POSITION];
    r[BY_MOTOR] = state[W_MOTOR];
    r[TO_JOINT] = state[W_JOINT];
    r[STORED] = 0.5 * (mass(d) * state[V] * state[V] + r[STIFFNESS] * f.beyond * f.beyond);
    r[LOST] = state[W_LOST];
}

/* a position that jumps stretches the cable at once, by work of the joint */
static void move_joint(Data *d, double position) {
    double before = beyond(d, d->state[X] - d->real[POSITION]), after = beyond(d, d->state[X] - position);
    d->state[W_JOINT] -= 0.5 * d->real[STIFFNESS] * (after * after - before * before);
    d->real[POSITION] = position;
}

FMI void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const void *callbacks, int visible, int logging) {
    (void)name; (void)resources; (void)callbacks; (void)visible; (void)logging;
    if (type != 1 || strcmp(guid, "{trocar-tendon-drive-1}") != 0) return NULL;
    static const double defaults[] = {1.0e-6, 336.6, 0.0438, 0.67, 6000, 200, 2.69, 0.596, 0.1, 50e-6, 50e3, 2, 0.2e-3, 0};
    Instance *i = calloc(1, sizeof *i);
    if (i) memcpy(i->data.real + ROTOR_INERTIA, defaults, sizeof defaults);
    return i;
}

FMI void fmi2FreeInstance(void *c) { free(c); }

FMI Status fmi2SetupExperiment(void *c, int has_tolerance, double tolerance, double start, int has_stop, double stop) {
    (void)c; (void)has_tolerance; (void)tolerance; (void)start; (void)has_stop; (void)stop;
    return OK;
}

FMI Status fmi2EnterInitializationMode(void *c) {
    Instance *i = c;
    if (i->mode != 0) return ERROR;
    i->mode = 1;
    return OK;
}

/* the motor starts where the joint does: at `start` */
FMI Status fmi2ExitInitializationMode(void *c) {
    Instance *i = c;
    double *r = i->data.real;
    if (i->mode != 1 || !(mass(&i->data) > 0 && r[PRESLIDING] > 0 && r[STIFFNESS] >= 0 && r[BACKLASH] >= 0)) return ERROR;
    i->mode = 2;
    i->data.state[X] = r[COMMAND] = r[POSITION] = r[START];
    update(&i->data);
    return OK;
}

FMI Status fmi2Terminate(void *c) {
    ((Instance *)c)->mode = 3;
    return OK;
}

FMI Status fmi2Reset(void *c) {
    Instance *i = c;
    Instance *fresh = fmi2Instantiate("", 1, "{trocar-tendon-drive-1}", "", NULL, 0, 0);
    if (!fresh) return ERROR;
    *i = *fresh;
    free(fresh);
    return OK;
}

FMI Status fmi2SetReal(void *c, const unsigned *reference, size_t n, const double *value) {
    Instance *i = c;
    for (size_t k = 0; k < n; k++) {
        unsigned one = reference[k];
        int is_parameter = one >= ROTOR_INERTIA && one < REALS;
        if (one >= INPUTS && !(is_parameter && i->mode < 2)) return ERROR;
        if (one == POSITION && i->mode == 2) move_joint(&i->data, value[k]);
        else i->data.real[one] = value[k];
        if (one < INPUTS) i->data.slope[one] = 0;
    }
    return OK;
}

FMI Status fmi2GetReal(void *c, const unsigned *reference, size_t n, double *value) {
    for (size_t k = 0; k < n; k++) {
        if (reference[k] >= REALS) return ERROR;
        value[k] = ((Instance *)c)->data.real[reference[k]];
    }
    return OK;
}

FMI Status fmi2SetRealInputDerivatives(void *c, const unsigned *reference, size_t n, const int *order, const double *value) {
    for (size_t k = 0; k < n; k++) {
        if (reference[k] >= INPUTS || order[k] != 1) return ERROR;
        ((Instance *)c)->data.slope[reference[k]] = value[k];
    }
    return OK;
}

FMI Status fmi2DoStep(void *c, double point, double size, int is_kept) {
    (void)point; (void)is_kept;
    Instance *i = c;
    Data *d = &i->data;
    if (i->mode != 2 || !(size > 0)) return ERROR;
    int count = (int)ceil(size / LONGEST_STEP - 1e-6);
    if (count < 1) count = 1;
    for (int k = 0; k < count; k++) integrate(d, size * k / count, size / count);
    for (int k = 0; k < INPUTS; k++) d->real[k] += size * d->slope[k];
    update(d);
    return isfinite(d->state[X]) ? OK : ERROR;
}

/* slopes of the force and the stretch over the joint's position and velocity, with the state held */
FMI Status fmi2GetDirectionalDerivative(void *c, const unsigned *unknown, size_t n, const unsigned *known, size_t m, const double *seed, double *result) {
    const Data *d = &((Instance *)c)->data;
    const double *r = d->real;
    double u = beyond(d, d->state[X] - r[POSITION]);
    double rise = 1 + r[CABLE_DAMPING] * (d->state[V] - r[VELOCITY]) * sign(u);
    for (size_t k = 0; k < n; k++) {
        if (unknown[k] != FORCE && unknown[k] != STRETCH) return ERROR;
        result[k] = 0;
        for (size_t j = 0; j < m; j++) {
            if (known[j] != POSITION && known[j] != VELOCITY) return ERROR;
            double slope = unknown[k] == STRETCH ? -(known[j] == POSITION)
                         : rise <= 0 || (u == 0 && r[BACKLASH] > 0) ? 0
                         : known[j] == POSITION  ? -r[STIFFNESS] * rise
                                                 : -r[STIFFNESS] * r[CABLE_DAMPING] * fabs(u);
            result[k] += slope * seed[j];
        }
    }
    return OK;
}

FMI Status fmi2GetFMUstate(void *c, void **state) {
    if (!*state) *state = malloc(sizeof(Data));
    if (!*state) return ERROR;
    memcpy(*state, &((Instance *)c)->data, sizeof(Data));
    return OK;
}

FMI Status fmi2SetFMUstate(void *c, void *state) {
    memcpy(&((Instance *)c)->data, state, sizeof(Data));
    return OK;
}

FMI Status fmi2FreeFMUstate(void *c, void **state) {
    (void)c;
    free(*state);
    *state = NULL;
    return OK;
}

FMI Status fmi2SerializedFMUstateSize(void *c, void *state, size_t *size) {
    (void)c; (void)state;
    *size = sizeof(Data);
    return OK;
}

FMI Status fmi2SerializeFMUstate(void *c, void *state, char *bytes, size_t size) {
    (void)c;
    if (size < sizeof(Data)) return ERROR;
    memcpy(bytes, state, sizeof(Data));
    return OK;
}

FMI Status fmi2DeSerializeFMUstate(void *c, const char *bytes, size_t size, void **state) {
    if (size != sizeof(Data)) return ERROR;
    *state = NULL;
    if (fmi2GetFMUstate(c, state) != OK) return ERROR;
    memcpy(*state, bytes, size);
    return OK;
}

/* the rest of FMI 2.0 */
FMI const char *fmi2GetTypesPlatform(void) { return "default"; }
FMI const char *fmi2GetVersion(void) { return "2.0"; }
FMI Status fmi2SetDebugLogging(void *c, int on, size_t n, const char *const *categories) {
    (void)c; (void)on; (void)n; (void)categories;
    return OK;
}

#define ACCESS(Type, T)                                                                  \
    FMI Status fmi2Get##Type(void *c, const unsigned *reference, size_t n, T *value) {   \
        (void)c; (void)reference; (void)value;                                           \
        return n ? ERROR : OK;                                                           \
    }                                                                                    \
    FMI Status fmi2Set##Type(void *c, const unsigned *reference, size_t n, const T *value) { \
        (void)c; (void)reference; (void)value;                                           \
        return n ? ERROR : OK;                                                           \
    }
ACCESS(Integer, int)
ACCESS(Boolean, int)
ACCESS(String, char *)

FMI Status fmi2GetRealOutputDerivatives(void *c, const unsigned *reference, size_t n, const int *order, double *value) {
    (void)c; (void)reference; (void)order; (void)value;
    return n ? ERROR : OK;
}
FMI Status fmi2CancelStep(void *c) { (void)c; return ERROR; }

#define STATUS(Type, T)                                               \
    FMI Status fmi2Get##Type##Status(void *c, int kind, T *value) {   \
        (void)c; (void)kind; (void)value;                             \
        return DISCARD;                                               \
    }
STATUS(, Status)
STATUS(Real, double)
STATUS(Integer, int)
STATUS(Boolean, int)
STATUS(String, const char *)
