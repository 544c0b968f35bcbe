/* Messages as CDR, byte for byte as `rosbags` makes them, which takes ten to twenty times as long.

An encoder is made once for each type of message. One that meets a value which it does not take returns None, and the
caller lets `rosbags` encode or refuse the message: what is an error is said in one place.
*/

#define PY_SSIZE_T_CLEAN
#define NPY_NO_DEPRECATED_API NPY_2_0_API_VERSION
#include <Python.h>
#include <math.h>
#include <numpy/arrayobject.h>
#include <stdint.h>
#include <string.h>

#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "CDR is written as little-endian: the Python code is used here"
#endif

/* The representation CDR_LE of OMG DDSI-RTPS; what follows is aligned to where it ends. */
static const char CDR_LE[] = {0, 1, 0, 0};
enum { FIRST_ROOM = 256 };

/* Kinds of elements: those of numbers are letters of Python's `struct`. */
enum { STRING = 's', NESTED = 'm', NO_NUMBER = 0 };
/* How many elements a field has, if it is no array of fixed length. */
enum { ONE = -1, SEQUENCE = 0 };

typedef struct Encoder Encoder;

typedef struct {
    PyObject *name;
    Encoder *nested;
    Py_ssize_t count, size; /* size: bytes of a number */
    char kind, array;       /* array: what numpy calls numbers of this kind, or NO_NUMBER */
} Field;

struct Encoder {
    PyObject_VAR_HEAD
    int lists; /* whether lists of numbers are taken as arrays are */
    Field fields[];
};

typedef struct {
    PyObject *bytes;
    Py_ssize_t size;
} Writer;

/* Write `size` bytes, aligned; return 0 if there is no memory. */
static int put(Writer *writer, const void *from, Py_ssize_t size, Py_ssize_t alignment)
{
    Py_ssize_t gap = ((Py_ssize_t)sizeof CDR_LE - writer->size) & (alignment - 1);
    Py_ssize_t start = writer->size + gap, end = start + size;
    if (end > PyBytes_GET_SIZE(writer->bytes) && _PyBytes_Resize(&writer->bytes, end + end / 2) < 0)
        return 0;
    char *data = PyBytes_AS_STRING(writer->bytes);
    memset(data + writer->size, 0, gap);
    memcpy(data + start, from, size);
    writer->size = end;
    return 1;
}

static int put_length(Writer *writer, Py_ssize_t length)
{
    int32_t written = (int32_t)length;
    return length <= INT32_MAX && put(writer, &written, sizeof written, sizeof written);
}

static int put_string(Writer *writer, PyObject *value)
{
    Py_ssize_t length;
    const char *text = PyUnicode_AsUTF8AndSize(value, &length);
    return text != NULL && put_length(writer, length + 1) && put(writer, text, length + 1, 1);
}

static int put_float(Writer *writer, const Field *field, PyObject *value)
{
    double number = PyFloat_AsDouble(value);
    float single = (float)number;
    if (PyErr_Occurred())
        return 0;
    if (field->size == sizeof number)
        return put(writer, &number, sizeof number, sizeof number);
    return isinf(single) == isinf(number) && put(writer, &single, sizeof single, sizeof single);
}

static int put_integer(Writer *writer, const Field *field, PyObject *value)
{
    if (!PyLong_Check(value))
        return 0;
    int beyond = 64 - 8 * (int)field->size; /* bits that the field lacks */
    int64_t number, kept;
    if (field->array == 'i') {
        number = PyLong_AsLongLong(value);
        kept = (int64_t)((uint64_t)number << beyond) >> beyond;
    } else {
        number = (int64_t)PyLong_AsUnsignedLongLong(value);
        kept = (int64_t)((uint64_t)number << beyond >> beyond);
    }
    return !PyErr_Occurred() && kept == number && put(writer, &number, field->size, field->size);
}

static int put_bool(Writer *writer, PyObject *value)
{
    int is_true = PyObject_IsTrue(value);
    char written = (char)is_true;
    return is_true >= 0 && put(writer, &written, 1, 1);
}

static int put_array(Writer *writer, const Field *field, PyObject *value)
{
    PyArrayObject *array = (PyArrayObject *)value;
    Py_ssize_t count = PyArray_SIZE(array);
    if (PyArray_NDIM(array) != 1 || !PyArray_IS_C_CONTIGUOUS(array) || !PyArray_ISNOTSWAPPED(array) ||
        PyArray_DESCR(array)->kind != field->array || PyArray_ITEMSIZE(array) != field->size ||
        (field->count == SEQUENCE ? !put_length(writer, count) : count != field->count))
        return 0;
    return count == 0 || put(writer, PyArray_DATA(array), count * field->size, field->size);
}

static int put_message(Writer *writer, const Encoder *encoder, PyObject *message);

static int put_one(Writer *writer, const Field *field, PyObject *value)
{
    switch (field->array) {
    case 'f': return put_float(writer, field, value);
    case 'b': return put_bool(writer, value);
    case NO_NUMBER:
        return field->kind == STRING ? put_string(writer, value) : put_message(writer, field->nested, value);
    default: return put_integer(writer, field, value);
    }
}

static int put_many(Writer *writer, const Field *field, PyObject *value)
{
    PyObject *items = PySequence_Tuple(value);
    if (items == NULL)
        return 0;
    Py_ssize_t count = PyTuple_GET_SIZE(items);
    int done = field->count == SEQUENCE ? put_length(writer, count) : count == field->count;
    for (Py_ssize_t i = 0; done && i < count; i++)
        done = put_one(writer, field, PyTuple_GET_ITEM(items, i));
    Py_DECREF(items);
    return done;
}

static int put_field(Writer *writer, const Encoder *encoder, const Field *field, PyObject *value)
{
    if (field->count == ONE)
        return put_one(writer, field, value);
    if (field->array == NO_NUMBER)
        return put_many(writer, field, value);
    if (PyArray_Check(value))
        return put_array(writer, field, value);
    return encoder->lists && (PyList_Check(value) || PyTuple_Check(value)) && put_many(writer, field, value);
}

static int put_message(Writer *writer, const Encoder *encoder, PyObject *message)
{
    int done = 1;
    for (const Field *field = encoder->fields; done && field < encoder->fields + Py_SIZE(encoder); field++) {
        PyObject *value = PyObject_GetAttr(message, field->name);
        if (value == NULL)
            return 0;
        done = put_field(writer, encoder, field, value);
        Py_DECREF(value);
    }
    return done;
}

static PyObject *encode(Encoder *self, PyObject *message)
{
    Writer writer = {PyBytes_FromStringAndSize(NULL, FIRST_ROOM), sizeof CDR_LE};
    if (writer.bytes == NULL)
        return NULL;
    memcpy(PyBytes_AS_STRING(writer.bytes), CDR_LE, sizeof CDR_LE);
    if (put_message(&writer, self, message)) {
        _PyBytes_Resize(&writer.bytes, writer.size);
        return writer.bytes;
    }
    Py_XDECREF(writer.bytes);
    if (PyErr_Occurred() && PyErr_ExceptionMatches(PyExc_MemoryError))
        return NULL;
    PyErr_Clear();
    Py_RETURN_NONE;
}

/* Find size and numpy's letter of a kind of number; return 0 if it is none. */
static int number_of(Field *field)
{
    switch (field->kind) {
    case '?': return field->size = 1, field->array = 'b', 1;
    case 'b': return field->size = 1, field->array = 'i', 1;
    case 'B': return field->size = 1, field->array = 'u', 1;
    case 'i': return field->size = 4, field->array = 'i', 1;
    case 'I': return field->size = 4, field->array = 'u', 1;
    case 'q': return field->size = 8, field->array = 'i', 1;
    case 'Q': return field->size = 8, field->array = 'u', 1;
    case 'f': return field->size = 4, field->array = 'f', 1;
    case 'd': return field->size = 8, field->array = 'f', 1;
    default: return 0;
    }
}

static PyTypeObject ENCODER;

/* Read name, kind, count and encoder of a field; return 0, with an error, if it is none. */
static int field_of(PyObject *given, Field *field)
{
    PyObject *name, *nested;
    int kind;
    if (!PyArg_ParseTuple(given, "UCnO", &name, &kind, &field->count, &nested))
        return 0;
    field->kind = (char)kind;
    if (kind > 127 || field->count < ONE || (kind == NESTED) != PyObject_TypeCheck(nested, &ENCODER) ||
        (kind != NESTED && kind != STRING && !number_of(field))) {
        PyErr_Format(PyExc_ValueError, "field '%U' has no kind and count that a message may have", name);
        return 0;
    }
    field->name = Py_NewRef(name);
    PyUnicode_InternInPlace(&field->name);
    field->nested = kind == NESTED ? (Encoder *)Py_NewRef(nested) : NULL;
    return 1;
}

static PyObject *new_encoder(PyTypeObject *type, PyObject *args, PyObject *keywords)
{
    static char *names[] = {"", "lists", NULL};
    PyObject *given;
    int lists;
    if (!PyArg_ParseTupleAndKeywords(args, keywords, "O!p", names, &PyList_Type, &given, &lists))
        return NULL;
    Py_ssize_t count = PyList_GET_SIZE(given);
    Encoder *self = (Encoder *)type->tp_alloc(type, count); /* its fields are zero */
    if (self != NULL)
        self->lists = lists;
    for (Py_ssize_t i = 0; self != NULL && i < count; i++)
        if (!field_of(PyList_GET_ITEM(given, i), self->fields + i))
            Py_CLEAR(self);
    return (PyObject *)self;
}

static void free_encoder(Encoder *self)
{
    for (Py_ssize_t i = 0; i < Py_SIZE(self); i++) {
        Py_XDECREF(self->fields[i].name);
        Py_XDECREF(self->fields[i].nested);
    }
    Py_TYPE(self)->tp_free(self);
}

static PyMethodDef METHODS[] = {
    {"encode", (PyCFunction)encode, METH_O, "Return a message in CDR; None if it holds what this does not take."},
    {NULL, NULL, 0, NULL}};
static PyTypeObject ENCODER = {
    PyVarObject_HEAD_INIT(NULL, 0)
    .tp_name = "schemas._cdr.Encoder",
    .tp_doc = "Encodes messages of one type, made of their fields: name, kind, count, encoder of a message.",
    .tp_basicsize = sizeof(Encoder),
    .tp_itemsize = sizeof(Field),
    .tp_flags = Py_TPFLAGS_DEFAULT,
    .tp_new = new_encoder,
    .tp_dealloc = (destructor)free_encoder,
    .tp_methods = METHODS,
};
static PyModuleDef MODULE = {PyModuleDef_HEAD_INIT, "_cdr", NULL, -1, NULL, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__cdr(void)
{
    import_array();
    PyObject *module = PyType_Ready(&ENCODER) < 0 ? NULL : PyModule_Create(&MODULE);
    if (module != NULL && PyModule_AddObjectRef(module, "Encoder", (PyObject *)&ENCODER) < 0)
        Py_CLEAR(module);
    return module;
}
