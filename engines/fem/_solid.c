/* Total-Lagrangian explicit dynamics of a soft body (Miller, Joldes, Lance, Wittek, Total Lagrangian explicit dynamics
finite element algorithm for computing soft tissue deformation, Commun. Numer. Methods Eng. 23, 2007).

Velocities, then displacements advance by each sub-step, with forces of the displacements before. See
docs/decisions/0125-tissue-of-our-own.md.
*/

#include "_solid.h"

#define MOST_NEAR 16384 /* faces near one sphere: all of the largest mesh */

typedef struct {
    PyObject_HEAD
    Body body;
    Py_buffer held[16];
    int count;
} Solid;

/* Move the nodes that a sphere holds with the sphere; write the force on the sphere. */
static void carry(const Body *body, const Spheres *spheres, int sub_step, float seconds, const float *mass, float gravity)
{
    for (int i = 0; i < body->nodes; i++) {
        int sphere = body->holder[i];
        if (sphere < 0)
            continue;
        const double *here = spheres->path + 3 * (sub_step * spheres->count + sphere), *next = here + 3 * spheres->count;
        double *force = spheres->force + 3 * (sub_step * spheres->count + sphere);
        for (int k = 0; k < 3; k++) {
            float now = (float)((next[k] - here[k]) / (double)seconds), *v = body->velocity + 4 * i + k;
            float weight = k == 2 ? gravity * mass[i] : 0.0f;
            force[k] += (double)(body->force[4 * i + k] - weight - mass[i] * (now - *v) / seconds);
            *v = now;
        }
    }
}

static void move(const Body *body, float seconds)
{
    for (int i = 0; i < body->nodes; i++)
        for (int k = 0; k < 3; k++)
            body->displacement[4 * i + k] += seconds * body->velocity[4 * i + k];
}

static void accelerate(const Body *body, float seconds, float gravity, float drag)
{
    float kept = 1.0f - drag * seconds;
    for (int i = 0; i < body->nodes; i++) {
        if (body->inverse_mass[i] == 0.0f)
            continue;
        float share = seconds * body->inverse_mass[i], *v = body->velocity + 4 * i;
        const float *f = body->force + 4 * i;
        v[0] = kept * v[0] + share * f[0];
        v[1] = kept * v[1] + share * f[1];
        v[2] = kept * v[2] + share * f[2] - seconds * gravity;
    }
}

PyDoc_STRVAR(advance_doc, "advance(path, radius, free, force, friction, mass, seconds, sub_steps, gravity, drag)\n--\n\n\
Advance by sub-steps of `seconds` while spheres go along `path`, shape (sub_steps + 1, n, 3), m; add the force on each\n\
sphere to `force`, shape (sub_steps, n, 3), N. `mass`: shape (nodes,), kg, also of held nodes.");

static PyObject *advance(Solid *self, PyObject *args)
{
    Py_buffer path, radius, free_, force, mass;
    Spheres spheres;
    float seconds, gravity, drag;
    int sub_steps;
    if (!PyArg_ParseTuple(args, "y*y*y*w*fy*fiff", &path, &radius, &free_, &force, &spheres.friction, &mass, &seconds,
                          &sub_steps, &gravity, &drag))
        return NULL;
    const Body *body = &self->body;
    spheres.count = (int)(radius.len / (Py_ssize_t)sizeof(double));
    spheres.path = path.buf, spheres.radius = radius.buf, spheres.free = free_.buf, spheres.force = force.buf;
    int *near = PyMem_Malloc(sizeof(int) * (size_t)(spheres.count + 1) * (MOST_NEAR + 1));
    if (near != NULL) {
        Py_BEGIN_ALLOW_THREADS;
        for (int s = 0; s < spheres.count; s++) {
            int *found = near + s * (MOST_NEAR + 1);
            *found = spheres.free[s] ? find_near(body, &spheres, s, sub_steps, found + 1, MOST_NEAR) : 0;
        }
        for (int k = 0; k < sub_steps; k++) {
            elastic_forces(body, seconds);
            accelerate(body, seconds, gravity, drag);
            carry(body, &spheres, k, seconds, mass.buf, gravity);
            for (int s = 0; s < spheres.count; s++) {
                int *found = near + s * (MOST_NEAR + 1);
                if (*found)
                    press(body, &spheres, s, k, seconds, found + 1, *found);
            }
            move(body, seconds);
        }
        Py_END_ALLOW_THREADS;
        PyMem_Free(near);
    }
    PyBuffer_Release(&path);
    PyBuffer_Release(&radius);
    PyBuffer_Release(&free_);
    PyBuffer_Release(&force);
    PyBuffer_Release(&mass);
    if (near == NULL)
        return PyErr_NoMemory();
    Py_RETURN_NONE;
}

PyDoc_STRVAR(forces_doc, "forces(seconds)\n--\n\nSet the forces of the elements on the nodes, N; viscous strains \
advance by `seconds`.");

static PyObject *forces(Solid *self, PyObject *seconds)
{
    double step = PyFloat_AsDouble(seconds);
    if (PyErr_Occurred())
        return NULL;
    elastic_forces(&self->body, (float)step);
    Py_RETURN_NONE;
}

/* Take an array of the body from a sequence; it is kept until the body goes. */
static void *array_of(Solid *self, PyObject *arrays, int writable, Py_ssize_t *bytes)
{
    PyObject *array = PySequence_GetItem(arrays, self->count);
    if (array == NULL)
        return NULL;
    Py_buffer *held = self->held + self->count;
    int failed = PyObject_GetBuffer(array, held, writable ? PyBUF_WRITABLE : PyBUF_SIMPLE);
    Py_DECREF(array);
    if (failed)
        return NULL;
    self->count++;
    *bytes = held->len;
    return held->buf;
}

static int initialise(Solid *self, PyObject *args, PyObject *Py_UNUSED(named))
{
    PyObject *arrays;
    Py_ssize_t n, size, b, f, m;
    Body *body = &self->body;
    if (!PyArg_ParseTuple(args, "O", &arrays))
        return -1;
    if ((body->rest = array_of(self, arrays, 0, &n)) == NULL ||
        (body->displacement = array_of(self, arrays, 1, &size)) == NULL ||
        (body->velocity = array_of(self, arrays, 1, &size)) == NULL ||
        (body->force = array_of(self, arrays, 1, &size)) == NULL ||
        (body->inverse_mass = array_of(self, arrays, 0, &size)) == NULL ||
        (body->inverse_volume = array_of(self, arrays, 0, &size)) == NULL ||
        (body->bulk = array_of(self, arrays, 0, &size)) == NULL ||
        (body->holder = array_of(self, arrays, 0, &size)) == NULL ||
        (body->corners = array_of(self, arrays, 0, &b)) == NULL ||
        (body->gradients = array_of(self, arrays, 0, &size)) == NULL ||
        (body->volumes = array_of(self, arrays, 0, &size)) == NULL ||
        (body->shear = array_of(self, arrays, 0, &size)) == NULL ||
        (body->strains = array_of(self, arrays, 1, &size)) == NULL ||
        (body->branch = array_of(self, arrays, 0, &m)) == NULL ||
        (body->surface = array_of(self, arrays, 0, &f)) == NULL)
        return -1;
    body->nodes = (int)(n / 16), body->blocks = (int)(b / 64);
    body->branches = (int)(m / 8), body->faces = (int)(f / 12);
    return 0;
}

static void finish(Solid *self)
{
    while (self->count)
        PyBuffer_Release(self->held + --self->count);
    Py_TYPE(self)->tp_free((PyObject *)self);
}

static PyMethodDef methods[] = {
    {"advance", (PyCFunction)advance, METH_VARARGS, advance_doc},
    {"forces", (PyCFunction)forces, METH_O, forces_doc},
    {NULL, NULL, 0, NULL},
};

static PyTypeObject solid_type = {
    PyVarObject_HEAD_INIT(NULL, 0).tp_name = "engines.fem._solid.Solid",
    .tp_doc = PyDoc_STR("A body over the arrays of `engines.fem.solid.Solid`, which checks them."),
    .tp_basicsize = sizeof(Solid),
    .tp_flags = Py_TPFLAGS_DEFAULT,
    .tp_new = PyType_GenericNew,
    .tp_init = (initproc)initialise,
    .tp_dealloc = (destructor)finish,
    .tp_methods = methods,
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT,
    .m_name = "engines.fem._solid",
    .m_doc = "Soft bodies; see _solid.c.",
    .m_size = -1,
};

PyMODINIT_FUNC PyInit__solid(void)
{
    PyObject *module = PyModule_Create(&definition);
    if (module == NULL || PyModule_AddType(module, &solid_type) < 0)
        return NULL;
    return module;
}
