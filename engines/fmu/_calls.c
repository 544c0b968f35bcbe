/* Calls of an FMU's functions through prepared buffers: all blocks of variables in one call from Python.

Results are those of `blocks.py` in every bit. Rare cases go back to Python: each method says by block and status how far it
got, and Python goes on from there, with all messages. The interpreter is free while functions of the FMU run.
*/

#define PY_SSIZE_T_CLEAN
#define NPY_NO_DEPRECATED_API NPY_2_0_API_VERSION
#include <Python.h>
#include <math.h>
#include <numpy/arrayobject.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

enum { WARNING = 1 }; /* highest status of a running simulation */
static const double LARGEST_EXACT = 9007199254740992.0;

typedef int (*Access2)(void *, const uint32_t *, size_t, void *);
typedef int (*Access3)(void *, const uint32_t *, size_t, void *, size_t);
/* FMI's noSetFMUStatePriorToCurrentPoint: as engines/fmu/instance.py has it. */
#define GOES_ON true

typedef int (*Step2)(void *, double, double, int);
typedef int (*Step3)(void *, double, double, bool, bool *, bool *, bool *, double *);
typedef int (*GetState)(void *, void **);
typedef int (*SizeOfState)(void *, void *, size_t *);
typedef int (*SerialiseState)(void *, void *, char *, size_t);

typedef struct {
    PyObject *port;
    Py_ssize_t size;
} Part;

typedef struct {
    void *function;
    PyObject *references, *raw, *values; /* bytes of uint32, and arrays */
    Part *parts;
    Py_ssize_t count, size; /* of parts, of numbers */
    int counted, discrete;  /* FMI 3 takes the number of values as well */
    int known;              /* whether the FMU has the numbers in `values` */
    int pending;
    char kind, width; /* of the C type: f, i, u or b, and bytes */
} Block;

typedef struct {
    PyObject_HEAD
    void *component;
    Py_ssize_t count;
    Block *blocks;
} Blocks;

static int is_double(const Block *block)
{
    return block->raw == block->values;
}

static int transfer(void *component, const Block *block)
{
    const uint32_t *references = (const uint32_t *)PyBytes_AS_STRING(block->references);
    size_t count = (size_t)PyBytes_GET_SIZE(block->references) / sizeof *references;
    void *raw = PyArray_DATA((PyArrayObject *)block->raw);
    if (block->counted)
        return ((Access3)block->function)(component, references, count, raw, (size_t)block->size);
    return ((Access2)block->function)(component, references, count, raw);
}

/* Return the numbers of a vector of doubles with `size` elements; NULL for any other object. */
static const double *numbers(PyObject *value, Py_ssize_t size)
{
    if (value == NULL || !PyArray_CheckExact(value))
        return NULL;
    PyArrayObject *array = (PyArrayObject *)value;
    if (PyArray_TYPE(array) != NPY_DOUBLE || PyArray_SIZE(array) != size || !PyArray_ISCARRAY_RO(array))
        return NULL;
    return PyArray_DATA(array);
}

/* Take a block's inputs at `tau`; return 0 for one that Python has to take. */
static int take(Block *block, PyObject *values, PyObject *rates, double tau)
{
    double *to = PyArray_DATA((PyArrayObject *)block->values);
    int same = block->known;
    for (Py_ssize_t i = 0; i < block->count; to += block->parts[i++].size) {
        const Part *part = &block->parts[i];
        const double *from = numbers(PyDict_GetItemWithError(values, part->port), part->size), *slope = NULL;
        PyObject *rate = block->discrete ? NULL : PyDict_GetItemWithError(rates, part->port);
        if (from == NULL || (rate != NULL && (slope = numbers(rate, part->size)) == NULL))
            return 0;
        if (!is_double(block))
            same = same && slope == NULL && !memcmp(to, from, (size_t)part->size * sizeof *to);
        else if (slope == NULL)
            memcpy(to, from, (size_t)part->size * sizeof *to);
        else
            for (Py_ssize_t k = 0; k < part->size; k++)
                to[k] = from[k] + tau * slope[k];
    }
    block->pending = is_double(block);
    block->known = 1;
    return block->pending || same;
}

#define NUMBERS(KIND, WIDTH) (16 * (KIND) + (WIDTH))
#define CONVERT(TYPE)                                       \
    for (Py_ssize_t i = 0; i < block->size; i++) {          \
        to[i] = (double)((const TYPE *)raw)[i];             \
        usable &= to[i] <= limit && to[i] >= -limit;        \
    }                                                       \
    break

/* Convert a block's outputs to doubles; return 0 for one beyond the numbers of ports. */
static int publish(const Block *block)
{
    const void *raw = PyArray_DATA((PyArrayObject *)block->raw);
    double *to = PyArray_DATA((PyArrayObject *)block->values);
    double limit = block->kind == 'f' ? 1.7976931348623157e308 : LARGEST_EXACT;
    int usable = 1;
    switch (block->kind == 'b' ? NUMBERS('u', 1) : NUMBERS(block->kind, block->width)) {
    case NUMBERS('f', 8): CONVERT(double);
    case NUMBERS('f', 4): CONVERT(float);
    case NUMBERS('i', 1): CONVERT(int8_t);
    case NUMBERS('i', 2): CONVERT(int16_t);
    case NUMBERS('i', 4): CONVERT(int32_t);
    case NUMBERS('i', 8): CONVERT(int64_t);
    case NUMBERS('u', 1): CONVERT(uint8_t);
    case NUMBERS('u', 2): CONVERT(uint16_t);
    case NUMBERS('u', 4): CONVERT(uint32_t);
    default: CONVERT(uint64_t);
    }
    return usable;
}

/* Take the inputs from block `first` on; return the first block that Python has to take, -1 with an error. */
static Py_ssize_t take_all(Blocks *self, PyObject *values, PyObject *rates, double tau, Py_ssize_t first)
{
    if (!PyDict_CheckExact(values) || !PyDict_CheckExact(rates)) {
        PyErr_SetString(PyExc_TypeError, "values and rates are dictionaries");
        return -1;
    }
    while (first < self->count && take(&self->blocks[first], values, rates, tau))
        first++;
    return PyErr_Occurred() ? -1 : first;
}

/* Set the blocks from `first` to `end`, or get them all; return the block at which it stopped. */
static Py_ssize_t set_all(const Blocks *self, Py_ssize_t first, Py_ssize_t end, int *status)
{
    while (first < end && (!self->blocks[first].pending || (*status = transfer(self->component, &self->blocks[first])) <= WARNING))
        first++;
    return first;
}

static Py_ssize_t get_all(const Blocks *self, int *status)
{
    Py_ssize_t at = 0;
    while (at < self->count && (*status = transfer(self->component, &self->blocks[at])) <= WARNING && publish(&self->blocks[at]))
        at++;
    return at;
}

/* Return how far a run over the blocks got: None for the end, or block and status. */
static PyObject *stopped(const Blocks *self, Py_ssize_t at, int status)
{
    if (at == self->count)
        Py_RETURN_NONE;
    return Py_BuildValue("ni", at, status > WARNING ? status : 0);
}

PyDoc_STRVAR(set_doc, "set(values, rates, tau, first)\n--\n\n\
Set the inputs `tau` seconds after the start of the step, from block `first` on.\n\n\
Return None, or the block at which it stopped with the FMU's status; 0: Python has to take this block's inputs.");

static PyObject *set(Blocks *self, PyObject *const *args, Py_ssize_t count)
{
    if (count != 4) {
        PyErr_SetString(PyExc_TypeError, "expected values and rates by port, tau, and the first block");
        return NULL;
    }
    double tau = PyFloat_AsDouble(args[2]);
    Py_ssize_t first = PyLong_AsSsize_t(args[3]), end, at;
    int status = 0;
    if (PyErr_Occurred() || (end = take_all(self, args[0], args[1], tau, first)) < 0)
        return NULL;
    Py_BEGIN_ALLOW_THREADS
    at = set_all(self, first, end, &status);
    Py_END_ALLOW_THREADS
    return stopped(self, at, status);
}

PyDoc_STRVAR(get_doc, "get()\n--\n\n\
Get the outputs and convert them to doubles.\n\n\
Return None, or the block at which it stopped with the FMU's status; 0: a number that ports do not take.");

static PyObject *get(Blocks *self, PyObject *Py_UNUSED(none))
{
    Py_ssize_t at;
    int status = 0;
    Py_BEGIN_ALLOW_THREADS
    at = get_all(self, &status);
    Py_END_ALLOW_THREADS
    return stopped(self, at, status);
}

PyDoc_STRVAR(step2_doc, "step2(outputs, function, values, rates, tau, now, size)\n--\n\n\
Set these inputs, call `fmi2DoStep` and get `outputs`.\n\n\
Return None, or the part at which it stopped (0: inputs, 1: step, 2: outputs) with its block and the FMU's status.");

static PyObject *step2(Blocks *self, PyObject *const *args, Py_ssize_t count)
{
    if (count != 7 || !PyObject_TypeCheck(args[0], Py_TYPE(self))) {
        PyErr_SetString(PyExc_TypeError, "expected outputs, function, values and rates by port, and three numbers");
        return NULL;
    }
    const Blocks *outputs = (const Blocks *)args[0];
    Step2 step = (Step2)PyLong_AsVoidPtr(args[1]);
    double tau = PyFloat_AsDouble(args[4]), now = PyFloat_AsDouble(args[5]), size = PyFloat_AsDouble(args[6]);
    int status = 0, part = 0;
    Py_ssize_t end, at;
    if (PyErr_Occurred() || (end = take_all(self, args[2], args[3], tau, 0)) < 0)
        return NULL;
    Py_BEGIN_ALLOW_THREADS
    at = set_all(self, 0, end, &status);
    if (at == self->count && (part = 1) && (status = step(self->component, now, size, GOES_ON)) <= WARNING) {
        at = get_all(outputs, &status);
        part = at == outputs->count ? 3 : 2;
    }
    Py_END_ALLOW_THREADS
    if (part == 3)
        Py_RETURN_NONE;
    return Py_BuildValue("ini", part, at, status > WARNING ? status : 0);
}

PyDoc_STRVAR(forget_doc, "forget()\n--\n\nTake all inputs as changed: the FMU has another state.");

static PyObject *forget(Blocks *self, PyObject *Py_UNUSED(none))
{
    for (Py_ssize_t i = 0; i < self->count; i++)
        self->blocks[i].known = 0;
    Py_RETURN_NONE;
}

/* Read a block from (function, counted, references, raw, values, discrete, ((port, size), ...)); -1 with an error. */
static int read_block(Block *block, PyObject *given)
{
    PyObject *address, *parts;
    if (!PyArg_ParseTuple(given, "OpSO!O!pO!", &address, &block->counted, &block->references, &PyArray_Type, &block->raw,
                          &PyArray_Type, &block->values, &block->discrete, &PyTuple_Type, &parts))
        goto wrong;
    Py_INCREF(block->references);
    Py_INCREF(block->raw);
    Py_INCREF(block->values);
    PyArrayObject *raw = (PyArrayObject *)block->raw;
    block->function = PyLong_AsVoidPtr(address);
    block->size = PyArray_SIZE(raw);
    block->kind = PyArray_DESCR(raw)->kind;
    block->width = (char)PyArray_ITEMSIZE(raw);
    block->parts = PyMem_Calloc((size_t)PyTuple_GET_SIZE(parts) + 1, sizeof(Part));
    if (block->function == NULL || block->parts == NULL || !PyArray_ISCARRAY(raw) || !numbers(block->values, block->size))
        return -1;
    Py_ssize_t left = block->size;
    for (Py_ssize_t i = 0; i < PyTuple_GET_SIZE(parts); i++) {
        Part *part = &block->parts[i];
        if (!PyArg_ParseTuple(PyTuple_GET_ITEM(parts, i), "Un", &part->port, &part->size)) {
            part->port = NULL;
            return -1;
        }
        Py_INCREF(part->port);
        block->count = i + 1;
        left -= part->size;
    }
    return left == 0 ? 0 : -1;
wrong:
    block->references = block->raw = block->values = NULL; /* borrowed until here */
    return -1;
}

static void deallocate(Blocks *self)
{
    for (Py_ssize_t i = 0; i < self->count; i++) {
        Block *block = &self->blocks[i];
        for (Py_ssize_t k = 0; k < block->count; k++)
            Py_DECREF(block->parts[k].port);
        PyMem_Free(block->parts);
        Py_XDECREF(block->references);
        Py_XDECREF(block->raw);
        Py_XDECREF(block->values);
    }
    PyMem_Free(self->blocks);
    Py_TYPE(self)->tp_free((PyObject *)self);
}

static PyObject *make(PyTypeObject *type, PyObject *args, PyObject *Py_UNUSED(named))
{
    PyObject *component, *given;
    if (!PyArg_ParseTuple(args, "OO!", &component, &PyTuple_Type, &given))
        return NULL;
    Blocks *self = (Blocks *)type->tp_alloc(type, 0);
    if (self == NULL)
        return NULL;
    self->component = PyLong_AsVoidPtr(component);
    self->blocks = PyMem_Calloc((size_t)PyTuple_GET_SIZE(given) + 1, sizeof(Block));
    int failed = self->blocks == NULL || PyErr_Occurred();
    while (!failed && self->count < PyTuple_GET_SIZE(given)) {
        Py_ssize_t at = self->count++;
        failed = read_block(&self->blocks[at], PyTuple_GET_ITEM(given, at)) < 0;
    }
    if (!failed)
        return (PyObject *)self;
    if (!PyErr_Occurred())
        PyErr_SetString(PyExc_ValueError, "not the buffers of a block");
    Py_DECREF(self);
    return NULL;
}

/* Read `count` arguments: addresses by the letters 'a' of `form`, doubles by 'd'; return 0 with an error. */
static int read_arguments(PyObject *const *args, Py_ssize_t count, const char *form, void **addresses, double *found)
{
    if (count != (Py_ssize_t)strlen(form)) {
        PyErr_Format(PyExc_TypeError, "expected %zd arguments", (Py_ssize_t)strlen(form));
        return 0;
    }
    for (Py_ssize_t i = 0; i < count; i++)
        if (form[i] == 'a')
            *addresses++ = PyLong_AsVoidPtr(args[i]);
        else
            *found++ = PyFloat_AsDouble(args[i]);
    return !PyErr_Occurred();
}

PyDoc_STRVAR(step3_doc, "step3(function, component, now, size)\n--\n\n\
Call `fmi3DoStep`. Return status, eventHandlingNeeded, terminateSimulation, earlyReturn and lastSuccessfulTime.");

static PyObject *step3(PyObject *Py_UNUSED(module), PyObject *const *args, Py_ssize_t count)
{
    void *address[2];
    double given[2], reached = 0.0;
    bool event = false, terminate = false, early = false;
    int status;
    if (!read_arguments(args, count, "aadd", address, given))
        return NULL;
    Py_BEGIN_ALLOW_THREADS
    status = ((Step3)address[0])(address[1], given[0], given[1], GOES_ON, &event, &terminate, &early, &reached);
    Py_END_ALLOW_THREADS
    return Py_BuildValue("iiiid", status, event, terminate, early, reached);
}

PyDoc_STRVAR(serialise_doc, "serialise(get, size, serialise, component, state)\n--\n\n\
Return the FMU's state as bytes, or the number of the failed function (0 to 2) and its status.\n\n\
`state`: address of a pointer to the state, reused by the FMU.");

static PyObject *serialise(PyObject *Py_UNUSED(module), PyObject *const *args, Py_ssize_t count)
{
    void *address[5];
    size_t size = 0;
    int status;
    if (!read_arguments(args, count, "aaaaa", address, NULL))
        return NULL;
    void *component = address[3], **state = address[4];
    if ((status = ((GetState)address[0])(component, state)) > WARNING)
        return Py_BuildValue("ii", 0, status);
    if ((status = ((SizeOfState)address[1])(component, *state, &size)) > WARNING)
        return Py_BuildValue("ii", 1, status);
    PyObject *bytes = PyBytes_FromStringAndSize(NULL, (Py_ssize_t)size);
    if (bytes == NULL)
        return NULL;
    memset(PyBytes_AS_STRING(bytes), 0, size); /* an FMU may leave gaps */
    if ((status = ((SerialiseState)address[2])(component, *state, PyBytes_AS_STRING(bytes), size)) > WARNING) {
        Py_DECREF(bytes);
        return Py_BuildValue("ii", 2, status);
    }
    return bytes;
}

static PyMethodDef block_methods[] = {
    {"set", (PyCFunction)(void (*)(void))set, METH_FASTCALL, set_doc},
    {"step2", (PyCFunction)(void (*)(void))step2, METH_FASTCALL, step2_doc},
    {"get", (PyCFunction)get, METH_NOARGS, get_doc},
    {"forget", (PyCFunction)forget, METH_NOARGS, forget_doc},
    {NULL, NULL, 0, NULL},
};

static PyTypeObject blocks_type = {
    PyVarObject_HEAD_INIT(NULL, 0)
    .tp_name = "engines.fmu._calls.Blocks",
    .tp_basicsize = sizeof(Blocks),
    .tp_dealloc = (destructor)deallocate,
    .tp_flags = Py_TPFLAGS_DEFAULT,
    .tp_doc = "Blocks of variables of an instance, set or got together.",
    .tp_methods = block_methods,
    .tp_new = make,
};

static PyMethodDef methods[] = {
    {"step3", (PyCFunction)(void (*)(void))step3, METH_FASTCALL, step3_doc},
    {"serialise", (PyCFunction)(void (*)(void))serialise, METH_FASTCALL, serialise_doc},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT,
    .m_name = "engines.fmu._calls",
    .m_doc = "Calls of an FMU's functions through prepared buffers; see _calls.c.",
    .m_size = -1,
    .m_methods = methods,
};

PyMODINIT_FUNC PyInit__calls(void)
{
    import_array();
    PyObject *module = PyModule_Create(&definition);
    if (module != NULL && PyModule_AddType(module, &blocks_type) < 0)
        Py_CLEAR(module);
    return module;
}
