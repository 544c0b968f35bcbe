/* FMI 2.0 co-simulation: a ventilated patient whose diaphragm carries an organ; docs/how-to/breathing.md.

   One lung and one chest wall, about the end of expiration (pressures against PEEP, volumes against rest):

     airway      R dV/dt = p - V / C - U / B          p: of the ventilator, R: airway, C: lung, B: rib cage
     rib cage    U = V - A x                          the volume that the diaphragm does not make room for
     diaphragm   m dv/dt = A U / B - k x - d v + F    k: abdomen behind it, F: force of the organ along the way

   The ventilator is controlled by pressure: a smooth rise, a plateau, a smooth fall. The implicit midpoint rule
   keeps the account of energy of this linear model to rounding, in steps of at most 1 ms with a held force. */
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
enum { INPUTS = 3, STATES = 7 };
enum { FORCE, /* three inputs */
       POSITION = 3, VELOCITY = 6, /* three outputs each */
       EXCURSION = 9, PRESSURE, FLOW, VOLUME, BY_VENTILATOR, TO_ORGAN, STORED, LOST, /* outputs */
       DIRECTION, /* three parameters */
       DRIVING_PRESSURE = DIRECTION + 3, RATE, INSPIRATION, RISE, RESISTANCE, LUNG, RIB_CAGE, AREA, MASS, STIFFNESS,
       DAMPING, /* parameters */
       REALS };
enum { TIME, V, X, SPEED, W_VENTILATOR, W_ORGAN, W_LOST }; /* the state */

static const double LONGEST_STEP = 1e-3, PI = 3.14159265358979323846;

typedef struct {
    double real[REALS];
    double state[STATES];
} Data;

typedef struct {
    Data data;
    int mode; /* 0 instantiated, 1 initialising, 2 stepping, 3 terminated */
} Instance;

/* pressure of the ventilator above PEEP; each breath begins with a rise */
static double pressure(const double *r, double time) {
    double breath = 1 / r[RATE], rise = r[RISE], end = r[INSPIRATION] * breath, t = fmod(time, breath);
    double share = t < rise ? t / rise : t < end ? 1 : t < end + rise ? 1 - (t - end) / rise : 0;
    return r[DRIVING_PRESSURE] * 0.5 * (1 - cos(PI * share));
}

/* force of the organ along the way of the diaphragm */
static double along(const double *r) {
    return r[FORCE] * r[DIRECTION] + r[FORCE + 1] * r[DIRECTION + 1] + r[FORCE + 2] * r[DIRECTION + 2];
}

/* a step by the middle values of V, x and v, which solve three linear equations one after the other */
static void integrate(Data *d, double h) {
    const double *r = d->real;
    double *s = d->state, half = 0.5 * h, p = pressure(r, s[TIME] + half), force = along(r);
    double area = r[AREA], compliance = r[RIB_CAGE], g = half / r[RESISTANCE];
    double room = 1 + g * (1 / r[LUNG] + 1 / compliance);
    double a = (s[V] + g * p) / room, b = g * area / (compliance * room); /* V = a + b x in the middle */
    double spring = r[STIFFNESS] + area * (area - b) / compliance, push = force + area * a / compliance;
    double v = (s[SPEED] + half / r[MASS] * (push - spring * s[X])) /
               (1 + half / r[MASS] * (r[DAMPING] + half * spring));
    double x = s[X] + half * v, volume = a + b * x, flow = (volume - s[V]) / half;
    s[TIME] += h;
    s[V] += h * flow;
    s[X] += h * v;
    s[SPEED] += 2 * (v - s[SPEED]);
    s[W_VENTILATOR] += h * p * flow;
    s[W_ORGAN] -= h * force * v;
    s[W_LOST] += h * (r[RESISTANCE] * flow * flow + r[DAMPING] * v * v);
}

static void update(Data *d) {
    double *r = d->real, area = r[AREA];
    const double *s = d->state;
    double ribs = s[V] - area * s[X];
    for (int i = 0; i < 3; i++) {
        r[POSITION + i] = s[X] * r[DIRECTION + i];
        r[VELOCITY + i] = s[SPEED] * r[DIRECTION + i];
    }
    r[EXCURSION] = s[X];
    r[PRESSURE] = pressure(r, s[TIME]);
    r[FLOW] = (r[PRESSURE] - s[V] / r[LUNG] - ribs / r[RIB_CAGE]) / r[RESISTANCE];
    r[VOLUME] = s[V];
    r[BY_VENTILATOR] = s[W_VENTILATOR];
    r[TO_ORGAN] = s[W_ORGAN];
    r[STORED] = 0.5 * (s[V] * s[V] / r[LUNG] + ribs * ribs / r[RIB_CAGE] + r[STIFFNESS] * s[X] * s[X] +
                       r[MASS] * s[SPEED] * s[SPEED]);
    r[LOST] = s[W_LOST];
}

FMI void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const void *callbacks, int visible, int logging) {
    (void)name; (void)resources; (void)callbacks; (void)visible; (void)logging;
    if (type != 1 || strcmp(guid, "{trocar-breathing-1}") != 0) return NULL;
    static const double defaults[] = {1, 0, 0, 1000, 0.2, 0.33, 0.3, 1e+06, 1e-06, 1e-06, 0.025, 1.5, 900, 60};
    Instance *i = calloc(1, sizeof *i);
    if (i) memcpy(i->data.real + DIRECTION, defaults, sizeof defaults);
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

FMI Status fmi2ExitInitializationMode(void *c) {
    Instance *i = c;
    const double *r = i->data.real;
    double way = r[DIRECTION] * r[DIRECTION] + r[DIRECTION + 1] * r[DIRECTION + 1] + r[DIRECTION + 2] * r[DIRECTION + 2];
    int is_positive = 1;
    for (int k = RATE; k < REALS; k++) is_positive &= r[k] > 0;
    if (i->mode != 1 || !is_positive || fabs(way - 1) > 1e-9 || r[INSPIRATION] + r[RISE] * r[RATE] > 1) return ERROR;
    i->mode = 2;
    update(&i->data);
    return OK;
}

FMI Status fmi2Terminate(void *c) {
    ((Instance *)c)->mode = 3;
    return OK;
}

FMI Status fmi2Reset(void *c) {
    Instance *i = c;
    Instance *fresh = fmi2Instantiate("", 1, "{trocar-breathing-1}", "", NULL, 0, 0);
    if (!fresh) return ERROR;
    *i = *fresh;
    free(fresh);
    return OK;
}

FMI Status fmi2SetReal(void *c, const unsigned *reference, size_t n, const double *value) {
    Instance *i = c;
    for (size_t k = 0; k < n; k++) {
        unsigned one = reference[k];
        if (one >= REALS || (one >= INPUTS && !(one >= DIRECTION && i->mode < 2))) return ERROR;
        i->data.real[one] = value[k];
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

FMI Status fmi2DoStep(void *c, double point, double size, int is_kept) {
    (void)is_kept;
    Instance *i = c;
    Data *d = &i->data;
    if (i->mode != 2 || !(size > 0)) return ERROR;
    int count = (int)ceil(size / LONGEST_STEP - 1e-6);
    if (count < 1) count = 1;
    d->state[TIME] = point;
    for (int k = 0; k < count; k++) integrate(d, size / count);
    d->state[TIME] = point + size;
    update(d);
    return isfinite(d->state[X]) ? OK : ERROR;
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

FMI Status fmi2SetRealInputDerivatives(void *c, const unsigned *reference, size_t n, const int *order, const double *value) {
    (void)c; (void)reference; (void)order; (void)value;
    return n ? ERROR : OK;
}
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
