/* Bodies that touch each other and themselves, in Python. */

#include "_solid.h"

typedef struct {
    PyObject_HEAD
    PyObject *solids; /* a tuple */
    Body **body;
    Way *ways;
    Py_buffer held[3];
    int count, buffers;
    Touch *touch;
    Attach *attach;
    Py_buffer ties[5];
    int tied; /* buffers of ties */
} Together;

static int initialise(Together *self, PyObject *args, PyObject *Py_UNUSED(named))
{
    PyObject *solids, *arrays[3];
    double ahead, skin;
    if (self->touch || !PyArg_ParseTuple(args, "O!OOOdd", &PyTuple_Type, &solids, arrays, arrays + 1, arrays + 2, &ahead,
                                         &skin))
        return -1;
    self->count = (int)PyTuple_GET_SIZE(solids);
    self->body = PyMem_RawCalloc((size_t)self->count, sizeof(Body *));
    self->ways = PyMem_RawCalloc((size_t)self->count, sizeof(Way));
    if (self->body == NULL || self->ways == NULL)
        return PyErr_NoMemory(), -1;
    for (int b = 0; b < self->count; b++) {
        PyObject *solid = PyTuple_GET_ITEM(solids, b);
        if (!PyObject_TypeCheck(solid, &solid_type))
            return PyErr_SetString(PyExc_TypeError, "bodies are `Solid`s"), -1;
        self->body[b] = &((Solid *)solid)->body;
    }
    for (; self->buffers < 3; self->buffers++)
        if (PyObject_GetBuffer(arrays[self->buffers], self->held + self->buffers,
                               self->buffers == 2 ? PyBUF_WRITABLE : PyBUF_SIMPLE))
            return -1;
    self->touch = new_touch(self->count, self->body, self->held[0].buf, self->held[1].buf, self->held[2].buf, ahead, skin);
    if (self->touch == NULL)
        return PyErr_NoMemory(), -1;
    Py_INCREF(solids);
    self->solids = solids;
    return 0;
}

PyDoc_STRVAR(advance_doc, "advance(arguments)\n--\n\nAdvance all bodies, each with its arguments of `Solid.advance`, of \
as many sub-steps;\nreturn how many faces have been cut open.");

static PyObject *advance(Together *self, PyObject *arguments)
{
    Course course;
    int read = 0, opened = -1;
    if (!PyTuple_Check(arguments) || PyTuple_GET_SIZE(arguments) != self->count)
        return PyErr_Format(PyExc_ValueError, "arguments are those of %d bodies", self->count);
    while (read < self->count && !read_way((Solid *)PyTuple_GET_ITEM(self->solids, read), PyTuple_GET_ITEM(arguments, read),
                                           self->ways + read, &course))
        read++;
    if (read == self->count) {
        Py_BEGIN_ALLOW_THREADS;
        opened = advance_bodies(self->ways, self->count, &course, self->touch, self->attach);
        Py_END_ALLOW_THREADS;
        if (opened < 0)
            PyErr_NoMemory();
    }
    while (read)
        release_way(self->ways + --read);
    return opened < 0 ? NULL : PyLong_FromLong(opened);
}

PyDoc_STRVAR(forget_doc, "forget()\n--\n\nSearch anew in the next step: the bodies were moved by hand.");

static PyObject *forget(Together *self, PyObject *Py_UNUSED(none))
{
    forget_pairs(self->touch);
    Py_RETURN_NONE;
}

PyDoc_STRVAR(attach_doc, "attach(place, rest, law, widest, force)\n--\n\nLet ties hold nodes of a body to faces of \
another; for the arrays see `Attach`.");

static PyObject *attach(Together *self, PyObject *args)
{
    PyObject *arrays[5];
    if (self->tied || !PyArg_ParseTuple(args, "OOOOO", arrays, arrays + 1, arrays + 2, arrays + 3, arrays + 4))
        return self->tied ? PyErr_Format(PyExc_ValueError, "ties are stated once") : NULL;
    for (; self->tied < 5; self->tied++)
        if (PyObject_GetBuffer(arrays[self->tied], self->ties + self->tied, self->tied > 2 ? PyBUF_WRITABLE : PyBUF_SIMPLE))
            return NULL;
    const Py_buffer *at = self->ties;
    self->attach = new_attach((int)(at[3].len / 8), self->body, self->held[0].buf, at[0].buf, at[1].buf, at[2].buf,
                              at[3].buf, at[4].buf);
    if (self->attach == NULL)
        return PyErr_NoMemory();
    Py_RETURN_NONE;
}

static void finish(Together *self)
{
    free_touch(self->touch);
    free_attach(self->attach);
    while (self->tied)
        PyBuffer_Release(self->ties + --self->tied);
    while (self->buffers)
        PyBuffer_Release(self->held + --self->buffers);
    PyMem_RawFree(self->body);
    PyMem_RawFree(self->ways);
    Py_XDECREF(self->solids);
    Py_TYPE(self)->tp_free((PyObject *)self);
}

static PyMethodDef methods[] = {
    {"advance", (PyCFunction)advance, METH_O, advance_doc},
    {"attach", (PyCFunction)attach, METH_VARARGS, attach_doc},
    {"forget", (PyCFunction)forget, METH_NOARGS, forget_doc},
    {NULL, NULL, 0, NULL},
};

PyTypeObject together_type = {
    PyVarObject_HEAD_INIT(NULL, 0).tp_name = "engines.fem._solid.Together",
    .tp_doc = PyDoc_STR("Bodies over the arrays of `engines.fem.together.Together`, which checks them."),
    .tp_basicsize = sizeof(Together),
    .tp_flags = Py_TPFLAGS_DEFAULT,
    .tp_new = PyType_GenericNew,
    .tp_init = (initproc)initialise,
    .tp_dealloc = (destructor)finish,
    .tp_methods = methods,
};
