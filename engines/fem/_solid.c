/* Total-Lagrangian explicit dynamics of a soft body (Miller, Joldes, Lance, Wittek, Total Lagrangian explicit dynamics
finite element algorithm for computing soft tissue deformation, Commun. Numer. Methods Eng. 23, 2007).

See docs/decisions/0125-tissue-of-our-own.md; `_step.c` advances.
*/

#include "_solid.h"

#define CACHE_LINE 64 /* bytes: what crosses the end of one costs twice */

/* Read the arguments of `advance`: a way through a step, whose buffers are held until `release_way`. */
int read_way(Solid *self, PyObject *args, Way *way, Course *course)
{
    Py_buffer *held = way->held;
    memset(way, 0, sizeof *way);
    if (!PyArg_ParseTuple(args, "y*y*y*y*w*ffiffiy*y*w*w*w*w*", held, held + 10, held + 1, held + 2, held + 3,
                          &way->spheres.friction, &course->seconds, &course->sub_steps, &course->gravity, &way->drag,
                          &way->every, held + 4, held + 9, held + 5, held + 6, held + 7, held + 8))
        return -1;
    Spheres *spheres = &way->spheres;
    Edges *edges = &way->edges;
    way->body = &self->body;
    spheres->count = (int)(held[1].len / (Py_ssize_t)sizeof(double));
    spheres->path = held[0].buf, way->middle = held[10].buf, spheres->radius = held[1].buf, spheres->free = held[2].buf;
    spheres->force = held[3].buf;
    edges->count = (int)(held[4].len / 8);
    edges->samples = edges->count ? (int)(held[5].len / 4) / edges->count : 0;
    edges->ends = held[4].buf, edges->element = held[5].buf, edges->front = held[6].buf, edges->ahead = held[7].buf;
    edges->area = held[8].buf, edges->toughness = held[9].buf;
    if (edges->samples <= MOST_SAMPLES && way->every > 0 && course->sub_steps % way->every == 0)
        return 0;
    release_way(way);
    PyErr_Format(PyExc_ValueError, "at most %d samples along an edge, and forces every whole part of the sub-steps",
                 MOST_SAMPLES);
    return -1;
}

void release_way(Way *way)
{
    for (int k = 0; k < WAY_BUFFERS; k++)
        PyBuffer_Release(way->held + k);
}

PyDoc_STRVAR(advance_doc, "advance(path, middle, radius, free, force, friction, seconds, sub_steps, gravity, drag, every, \
ends, toughness, element, front, ahead, area)\n--\n\n\
Advance by sub-steps of `seconds` while spheres go along `path`, shape (sub_steps + 1, n, 3), m, in the frame in which\n\
`middle` is the body's; write the force on each sphere to `force`, shape (sub_steps, n, 3), N. The elements push `every` so many\n\
sub-steps. The last arguments are edges of blades: `ends`, shape (e, 2), are\n\
spheres; `toughness`, shape (e,), J/m^2, infinite of a blunt edge, negative of one that passes through; `element`,\n\
shape (e, samples), `front` and `ahead`, shape (e, samples, 3), and `area` are their state.\n\
Return how many faces have been cut open.");

static PyObject *advance(Solid *self, PyObject *args)
{
    Way way;
    Course course;
    int opened;
    if (read_way(self, args, &way, &course))
        return NULL;
    Py_BEGIN_ALLOW_THREADS;
    opened = advance_bodies(&way, 1, &course, NULL, NULL);
    Py_END_ALLOW_THREADS;
    release_way(&way);
    return opened < 0 ? PyErr_NoMemory() : PyLong_FromLong(opened);
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

typedef int (*Change)(Body *, const int32_t *, int);

/* Apply a change to numbers, each below `most`, given as an array of 32 bits. */
static PyObject *change(Solid *self, PyObject *numbers, Change apply, int most)
{
    Py_buffer given;
    int changed = -1;
    if (PyObject_GetBuffer(numbers, &given, PyBUF_SIMPLE))
        return NULL;
    const int32_t *number = given.buf;
    int count = (int)(given.len / 4), valid = self->body.node_room == 16 * self->body.blocks;
    for (int k = 0; k < count; k++)
        valid &= number[k] >= 0 && number[k] < most;
    if (valid)
        changed = apply(&self->body, number, count);
    PyBuffer_Release(&given);
    if (!valid)
        return PyErr_Format(PyExc_ValueError, "numbers are 0 to %d, in a body with room for its pieces", most - 1);
    return changed < 0 ? PyErr_NoMemory() : PyLong_FromLong(changed);
}

PyDoc_STRVAR(open_doc, "open(faces)\n--\n\nOpen faces between elements; return how many were closed.");

static PyObject *open_method(Solid *self, PyObject *faces)
{
    return change(self, faces, open_faces, 16 * self->body.blocks);
}

PyDoc_STRVAR(remove_doc, "remove(elements)\n--\n\nLet elements go; return how many were there.");

static PyObject *remove_method(Solid *self, PyObject *elements)
{
    return change(self, elements, remove_elements, 4 * self->body.blocks);
}

PyDoc_STRVAR(tear_doc, "tear(stretch, toughness)\n--\n\nOpen faces at the ends of tears, by `toughness` (J/m^2; 0: by \
`stretch`), or where the stretch is largest\nand beyond `stretch`; return how many.");

static PyObject *tear(Solid *self, PyObject *args)
{
    Limits limits;
    if (!PyArg_ParseTuple(args, "dd", &limits.stretch, &limits.toughness))
        return NULL;
    int opened = tear_on(&self->body, &limits);
    return opened < 0 ? PyErr_NoMemory() : PyLong_FromLong(opened);
}

PyDoc_STRVAR(measure_doc, "measure()\n--\n\nReturn the largest sharpness of an element, 1/m^2, and the fastest swing of \
a mean volume\nover lambda, 1/s^2/Pa.");

static PyObject *measure_method(Solid *self, PyObject *Py_UNUSED(none))
{
    float sharpness, rate;
    if (measure(&self->body, &sharpness, &rate))
        return PyErr_NoMemory();
    return Py_BuildValue("ff", sharpness, rate);
}

PyDoc_STRVAR(pieces_doc, "pieces(labels)\n--\n\nNumber the pieces of the body by element; -1: an element that has gone.");

static PyObject *pieces(Solid *self, PyObject *labels)
{
    Py_buffer given;
    int32_t *stack = PyMem_RawMalloc(sizeof(int32_t) * 4 * (size_t)self->body.blocks);
    if (stack == NULL)
        return PyErr_NoMemory();
    if (PyObject_GetBuffer(labels, &given, PyBUF_WRITABLE) == 0) {
        label_pieces(&self->body, given.buf, stack);
        PyBuffer_Release(&given);
    }
    PyMem_RawFree(stack);
    if (PyErr_Occurred())
        return NULL;
    Py_RETURN_NONE;
}

static PyObject *get_counts(Solid *self, void *Py_UNUSED(closure))
{
    return Py_BuildValue("ii", self->body.nodes, self->body.faces);
}

static int set_counts(Solid *self, PyObject *counts, void *Py_UNUSED(closure))
{
    int nodes, faces;
    if (!PyArg_ParseTuple(counts, "ii", &nodes, &faces))
        return -1;
    if (nodes < 0 || nodes > self->body.node_room || faces < 0 || faces > 16 * self->body.blocks) {
        PyErr_SetString(PyExc_ValueError, "more nodes or faces than there is room for");
        return -1;
    }
    self->body.nodes = nodes, self->body.faces = faces;
    return 0;
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

/* Set a field of the body to the next array, and `size` to its bytes; else return from the function. */
#define NEXT(field, writable)                                                                                          \
    if ((body->field = array_of(self, arrays, writable, &size)) == NULL)                                               \
    return -1

static int initialise(Solid *self, PyObject *args, PyObject *Py_UNUSED(named))
{
    PyObject *arrays;
    Py_ssize_t size;
    Body *body = &self->body;
    if (!PyArg_ParseTuple(args, "Oii", &arrays, &body->nodes, &body->faces))
        return -1;
    NEXT(rest, 1);
    body->node_room = (int)(size / 16), body->skin = body->faces;
    NEXT(displacement, 1);
    NEXT(velocity, 1);
    NEXT(force, 1);
    NEXT(mass, 1);
    NEXT(inverse_mass, 1);
    NEXT(inverse_volume, 1);
    NEXT(bulk, 1);
    NEXT(holder, 1);
    NEXT(origin, 1);
    NEXT(flags, 1);
    NEXT(corners, 1);
    body->blocks = (int)(size / 64);
    NEXT(gradients, 1);
    NEXT(volumes, 1);
    NEXT(element_mass, 1);
    NEXT(shear, 1);
    NEXT(strains, 1);
    NEXT(branch, 0);
    body->branches = (int)(size / 8);
    NEXT(across, 1);
    NEXT(surface, 1);
    NEXT(owner, 1);
    NEXT(middles, 0);
    NEXT(limits, 0);
    NEXT(tied, 0);
    body->ties = (int)(size / 8);
    NEXT(box, 0);
    body->boxes = (int)(size / 128);
    NEXT(support, 1);
    self->memory = PyMem_RawMalloc(sizeof(float) * 36 * (size_t)body->blocks + CACHE_LINE);
    body->deformation = (float *)(((uintptr_t)self->memory + CACHE_LINE) & ~(uintptr_t)(CACHE_LINE - 1));
    if (self->memory == NULL)
        return PyErr_NoMemory(), -1;
    return 0;
}

static void finish(Solid *self)
{
    while (self->count)
        PyBuffer_Release(self->held + --self->count);
    PyMem_RawFree(self->memory);
    Py_TYPE(self)->tp_free((PyObject *)self);
}

static PyMethodDef methods[] = {
    {"advance", (PyCFunction)advance, METH_VARARGS, advance_doc},
    {"forces", (PyCFunction)forces, METH_O, forces_doc},
    {"open", (PyCFunction)open_method, METH_O, open_doc},
    {"remove", (PyCFunction)remove_method, METH_O, remove_doc},
    {"tear", (PyCFunction)tear, METH_VARARGS, tear_doc},
    {"measure", (PyCFunction)measure_method, METH_NOARGS, measure_doc},
    {"pieces", (PyCFunction)pieces, METH_O, pieces_doc},
    {NULL, NULL, 0, NULL},
};

static PyGetSetDef fields[] = {
    {"counts", (getter)get_counts, (setter)set_counts, "Numbers of nodes and of faces of the surface.", NULL},
    {NULL, NULL, NULL, NULL, NULL},
};

PyTypeObject solid_type = {
    PyVarObject_HEAD_INIT(NULL, 0).tp_name = "engines.fem._solid.Solid",
    .tp_doc = PyDoc_STR("A body over the arrays of `engines.fem.solid.Solid`, which checks them."),
    .tp_basicsize = sizeof(Solid),
    .tp_flags = Py_TPFLAGS_DEFAULT,
    .tp_new = PyType_GenericNew,
    .tp_init = (initproc)initialise,
    .tp_dealloc = (destructor)finish,
    .tp_methods = methods,
    .tp_getset = fields,
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
    if (module == NULL || PyModule_AddType(module, &solid_type) < 0 || PyModule_AddType(module, &together_type) < 0)
        return NULL;
    return module;
}
