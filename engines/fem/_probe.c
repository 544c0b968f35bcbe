/* The spheres of a bond through a whole step: predicted motion, yield of the springs in series, reaction and work.

`ForceSide` of hub/participant/bond.py for all sub-steps at once, without a virtual coupling. Units are SI, in double
precision.
*/

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "_near.h"

#define FOLLOW_S 6e-3 /* time constant of the yield: less than a hand feels, more than a node swings */

enum { HOLD, VELOCITY, SLOPE };

typedef struct {
    PyObject_HEAD
    Py_buffer kept[20];
    int count;
    int spheres, size, sub_steps, all, first, points, terms, prediction, is_mean;
    double *motion;     /* position (3 spheres), velocity (size), its slope (size), reaction at the end (3 spheres) */
    double *clock;      /* duration of the last step, whether there was one, work */
    double *reaction;   /* (size,): output */
    double *offset;     /* (spheres, 3): yield of the springs in series */
    double *force;      /* (spheres, 3): mean force of the instrument in the last step */
    double *target;     /* (spheres, 3): centres on the instrument at the end of the step */
    double *position;   /* (spheres, 3): centres in the tissue at the end of the step */
    double *spring;     /* direction (3) and yield of the spring under the first sphere */
    double *law;        /* (3, points): forces, yields of the spring, yields of the mesh */
    double *series;     /* (terms, 2): relaxing moduli over the long-term modulus, and their times; 0: none */
    double *relaxing;   /* (terms + 1,): forces of the terms, elastic force */
    double *compliance; /* (2, 3, 3): of the spring in series with the held spheres, zeros: none; share of the mesh in
                           all yield */
    const uint8_t *held;   /* (spheres,) */
    double *path;          /* (sub_steps + 1, all, 3): of all probes */
    const double *tissue;  /* (sub_steps, all, 3): force of the tissue on the spheres of all probes */
} Probe;

static inline double dot3(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Interpolate `values` at `x` between the increasing numbers `at`; constant beyond. */
static double interpolate(double x, const double *at, const double *values, int points)
{
    if (!(x < at[points - 1]))
        return values[points - 1];
    int low = 0, high = points - 1;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (at[middle] <= x)
            low = middle;
        else
            high = middle;
    }
    return values[low] + (x - at[low]) / (at[high] - at[low]) * (values[high] - values[low]);
}

/* Return the force that bears the present dent when all has relaxed: the series of the tissue, solved for it. */
static double elastic_force(Probe *self, double force)
{
    double *elastic = self->relaxing + self->terms, before = *elastic, stiffness = 1.0;
    for (int i = 0; i < self->terms; i++) {
        double share = self->series[2 * i], kept = self->series[2 * i + 1] / (self->series[2 * i + 1] + self->clock[0]);
        force -= kept * (self->relaxing[i] - share * before);
        stiffness += kept * share;
    }
    *elastic = force / stiffness;
    for (int i = 0; i < self->terms; i++) {
        double kept = self->series[2 * i + 1] / (self->series[2 * i + 1] + self->clock[0]);
        self->relaxing[i] = kept * (self->relaxing[i] + self->series[2 * i] * (*elastic - before));
    }
    return *elastic;
}

/* Let the spring under a single sphere follow the force: an open loop's law, so the rate is that of the closed loop, by
the mesh's part of all yield. */
static void follow(Probe *self, double rate)
{
    double force = elastic_force(self, dot3(self->force, self->spring));
    force = force > 0.0 ? force : 0.0;
    const double *forces = self->law, *yields = forces + self->points, *mesh_yields = yields + self->points;
    double wanted = interpolate(force, forces, yields, self->points);
    double mesh = interpolate(force, forces, mesh_yields, self->points);
    double whole = wanted + mesh, *yielded = self->spring + 3;
    *yielded += rate * (whole > 0.0 ? mesh / whole : 1.0) * (wanted - *yielded);
    for (int i = 0; i < 3; i++)
        self->offset[i] = *yielded * self->spring[i];
}

/* Let the held spheres yield to their common pull, at the rate of the closed loop, and the others come back.

The pull is that at the end of the last step: its mean has the inertia of the held nodes in it, which yields anew. */
static void yield_to_pull(Probe *self, double rate)
{
    const double *force = self->motion + 3 * self->spheres + 2 * self->size;
    double pull[3] = {0.0, 0.0, 0.0};
    for (int s = 0; s < self->spheres; s++)
        for (int i = 0; i < 3; i++)
            pull[i] += self->held[s] ? force[3 * s + i] : 0.0;
    for (int s = 0; s < self->spheres; s++) {
        double *offset = self->offset + 3 * s, lacking[3];
        for (int i = 0; i < 3; i++)
            lacking[i] = dot3(self->compliance + 3 * i, pull) - offset[i];
        for (int i = 0; i < 3; i++)
            offset[i] += rate * (self->held[s] ? dot3(self->compliance + 9 + 3 * i, lacking) : -offset[i]);
    }
}

/* Position of a coordinate of the instrument, `tau` seconds into the step. */
static inline double predicted(const Probe *self, int i, double tau)
{
    const double *x = self->motion, *v = x + 3 * self->spheres, *a = v + self->size;
    return self->prediction == HOLD ? x[i] : x[i] + tau * (v[i] + 0.5 * tau * a[i]);
}

PyDoc_STRVAR(begin_doc, "begin(position, velocity, seconds)\n--\n\n\
Write the ways of the spheres in a step of `seconds` to the path; motion: of the instrument at its start.");

static PyObject *begin(Probe *self, PyObject *args)
{
    Py_buffer place, speed;
    double seconds;
    if (!PyArg_ParseTuple(args, "y*y*d", &place, &speed, &seconds))
        return NULL;
    int n = 3 * self->spheres, fits = place.len >= 8 * n && speed.len == 8 * self->size;
    if (fits) {
        double *x = self->motion, *v = x + n, *a = v + self->size, *spring = a + self->size;
        const double *now = place.buf, *rate = speed.buf;
        if (self->clock[1] > 0.0) {
            for (int i = 0; i < n; i++)
                self->clock[2] += spring[i] * (now[i] - predicted(self, i, self->clock[0]));
            for (int i = 0; i < self->size; i++)
                a[i] = self->prediction == SLOPE ? (rate[i] - v[i]) / seconds : 0.0;
        }
        memcpy(x, now, sizeof(double) * (size_t)n);
        memcpy(v, rate, sizeof(double) * (size_t)self->size);
        self->clock[0] = seconds, self->clock[1] = 1.0;
        double share = seconds < FOLLOW_S ? seconds / FOLLOW_S : 1.0;
        for (int i = 0; i < n; i++) /* the offset before, for now */
            self->position[i] = self->offset[i];
        if (self->points > 0)
            follow(self, share);
        else
            yield_to_pull(self, share);
        for (int k = 0; k <= self->sub_steps; k++) {
            double part = (double)k / self->sub_steps, *path = self->path + 3 * (k * self->all + self->first);
            for (int i = 0; i < n; i++)
                path[i] = predicted(self, i, part * seconds) -
                          (self->position[i] + part * (self->offset[i] - self->position[i]));
        }
        for (int i = 0; i < n; i++) {
            self->target[i] = predicted(self, i, seconds);
            self->position[i] = self->target[i] - self->offset[i];
        }
    }
    PyBuffer_Release(&place);
    PyBuffer_Release(&speed);
    if (!fits)
        return PyErr_Format(PyExc_ValueError, "a probe of %d spheres got a motion of another size", self->spheres);
    Py_RETURN_NONE;
}

PyDoc_STRVAR(end_doc, "end()\n--\n\nSet reaction, work and mean force of the step from the forces of the tissue; \
return whether they are finite.");

static PyObject *end(Probe *self, PyObject *Py_UNUSED(nothing))
{
    int n = 3 * self->spheres;
    double dt = self->clock[0] / self->sub_steps, work = 0.0;
    double *v = self->motion + n, *a = v + self->size, *spring = a + self->size;
    for (int i = 0; i < n; i++)
        self->force[i] = 0.0;
    for (int k = 0; k < self->sub_steps; k++) {
        const double *tissue = self->tissue + 3 * (k * self->all + self->first);
        for (int i = 0; i < n; i++) {
            self->force[i] -= tissue[i];
            work -= self->prediction == HOLD ? 0.0 : dt * tissue[i] * (v[i] + (k + 0.5) * dt * a[i]);
            spring[i] = -tissue[i];
        }
    }
    self->clock[2] += work;
    int is_finite = isfinite(work);
    for (int i = 0; i < n; i++) {
        self->force[i] /= self->sub_steps;
        self->reaction[i] = -(self->is_mean ? self->force[i] : spring[i]);
        is_finite &= isfinite(self->force[i]) != 0;
    }
    return PyBool_FromLong(is_finite);
}

static int initialise(Probe *self, PyObject *args, PyObject *Py_UNUSED(named))
{
    PyObject *arrays;
    if (!PyArg_ParseTuple(args, "Oiip", &arrays, &self->first, &self->prediction, &self->is_mean))
        return -1;
    void *at[15];
    Py_ssize_t bytes[15];
    for (int i = 0; i < 15; i++) {
        PyObject *array = PySequence_GetItem(arrays, i);
        if (array == NULL)
            return -1;
        Py_buffer *kept = self->kept + self->count;
        int failed = PyObject_GetBuffer(array, kept, PyBUF_WRITABLE);
        Py_DECREF(array);
        if (failed)
            return -1;
        self->count++;
        at[i] = kept->buf, bytes[i] = kept->len;
    }
    self->motion = at[0], self->clock = at[1], self->reaction = at[2], self->offset = at[3], self->force = at[4];
    self->target = at[5], self->position = at[6], self->spring = at[7], self->law = at[8], self->compliance = at[9];
    self->held = at[10], self->series = at[11], self->relaxing = at[12], self->path = at[13], self->tissue = at[14];
    self->size = (int)(bytes[2] / 8), self->spheres = (int)(bytes[3] / 24), self->points = (int)(bytes[8] / 24);
    self->terms = (int)(bytes[11] / 16);
    self->sub_steps = (int)(bytes[14] / (bytes[13] - bytes[14])), self->all = (int)((bytes[13] - bytes[14]) / 24);
    return 0;
}

static void finish(Probe *self)
{
    while (self->count)
        PyBuffer_Release(self->kept + --self->count);
    Py_TYPE(self)->tp_free((PyObject *)self);
}

static PyMethodDef methods[] = {
    {"begin", (PyCFunction)begin, METH_VARARGS, begin_doc},
    {"end", (PyCFunction)end, METH_NOARGS, end_doc},
    {NULL, NULL, 0, NULL},
};

static PyTypeObject probe_type = {
    PyVarObject_HEAD_INIT(NULL, 0).tp_name = "engines.fem._probe.Probe",
    .tp_doc = PyDoc_STR("The spheres of a bond over the arrays of `engines.fem.probe.Probe`."),
    .tp_basicsize = sizeof(Probe),
    .tp_flags = Py_TPFLAGS_DEFAULT,
    .tp_new = PyType_GenericNew,
    .tp_init = (initproc)initialise,
    .tp_dealloc = (destructor)finish,
    .tp_methods = methods,
};

static PyMethodDef functions[] = {
    {"near_faces", find_near_faces, METH_VARARGS, near_faces_doc},
    {"closest_on_faces", closest_on_faces, METH_VARARGS, closest_on_faces_doc},
    {"sum_at_nodes", sum_at_nodes, METH_VARARGS, sum_at_nodes_doc},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT,
    .m_name = "engines.fem._probe",
    .m_doc = "Spheres of probes; see _probe.c.",
    .m_size = -1,
    .m_methods = functions,
};

PyMODINIT_FUNC PyInit__probe(void)
{
    PyObject *module = PyModule_Create(&definition);
    if (module == NULL || PyModule_AddType(module, &probe_type) < 0)
        return NULL;
    return module;
}
