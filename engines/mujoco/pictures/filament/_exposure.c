/* What a sensor makes of a picture, in one pass: light that a lens loses, gains of colours, noise.

The same operations on single floats, in the same order, as in sensor.py, so both give the same bits. There each is a
pass over the picture, which takes five times as long.
*/

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>
#include <stdint.h>

enum { CHANNELS = 3, PICTURE = 0, LIGHT, GAINS, FOUND, NOISE, ARRAYS };

/* Replace the `count` drawn colours of a row. */
static void expose_row(uint8_t *restrict to, const float *restrict light, const float *restrict gains,
                       const float *restrict noise, float dark, Py_ssize_t count)
{
    if (noise)
        for (Py_ssize_t i = 0; i < count; i++) {
            float grey = (float)to[i] * light[i] * gains[i] + dark;
            grey = grey + sqrtf(grey) * noise[i] - (dark - 0.5f);
            to[i] = (uint8_t)(int)(grey < 0.0f ? 0.0f : grey > 255.0f ? 255.0f : grey);
        }
    else
        for (Py_ssize_t i = 0; i < count; i++) {
            float grey = (float)to[i] * light[i] * gains[i] + 0.5f;
            to[i] = (uint8_t)(int)(grey < 0.0f ? 0.0f : grey > 255.0f ? 255.0f : grey);
        }
}

static void expose(const Py_buffer *view, float dark)
{
    const Py_buffer *picture = &view[PICTURE];
    Py_ssize_t rows = picture->shape[0], columns = picture->shape[1], count = CHANNELS * columns;
    Py_ssize_t step = picture->strides[1];
    for (Py_ssize_t row = 0; row < rows; row++) {
        const uint8_t *from = (const uint8_t *)picture->buf + row * picture->strides[0];
        uint8_t *to = (uint8_t *)view[FOUND].buf + row * count;
        for (Py_ssize_t column = 0; column < columns; column++)
            for (int c = 0; c < CHANNELS; c++)
                to[CHANNELS * column + c] = from[column * step + c];
        const float *noise = view[NOISE].buf;
        expose_row(to, (const float *)view[LIGHT].buf + row * count, view[GAINS].buf, noise ? noise + row * count : NULL,
                   dark, count);
    }
}

/* Whether the arrays have the sizes of the picture. */
static int fits(const Py_buffer *view)
{
    const Py_buffer *picture = &view[PICTURE];
    if (picture->ndim != 3 || picture->itemsize != 1 || picture->shape[2] != CHANNELS || picture->strides[2] != 1)
        return 0;
    Py_ssize_t row = CHANNELS * picture->shape[1], all = row * picture->shape[0], size = sizeof(float);
    return view[LIGHT].len == all * size && view[GAINS].len == row * size && view[FOUND].len == all &&
           (!view[NOISE].buf || view[NOISE].len == all * size);
}

PyDoc_STRVAR(expose_doc, "expose(picture, light, gains, noise, dark, found)\n--\n\n\
Write into `found`, shape (height, width, 3), a picture of that shape, of which colours are next to each other.\n\n\
`light`: factors, float32, of the shape of the picture; `gains`: of a row; `noise`: of each colour, over the square\n\
root of its grey level and `dark`, or None.");

static PyObject *expose_method(PyObject *Py_UNUSED(module), PyObject *args)
{
    PyObject *given[ARRAYS];
    float dark;
    if (!PyArg_ParseTuple(args, "OOOOfO", &given[PICTURE], &given[LIGHT], &given[GAINS], &given[NOISE], &dark,
                          &given[FOUND]))
        return NULL;
    Py_buffer view[ARRAYS] = {{0}};
    int held = 0, failed = 0;
    for (; held < ARRAYS && !failed; held++) {
        int flags = held == PICTURE ? PyBUF_STRIDES : held == FOUND ? PyBUF_WRITABLE : PyBUF_SIMPLE;
        if (held == NOISE && given[NOISE] == Py_None)
            continue;
        failed = PyObject_GetBuffer(given[held], &view[held], flags) < 0;
    }
    if (!failed && !fits(view)) {
        PyErr_SetString(PyExc_ValueError, "arrays that do not have the sizes of the picture");
        failed = 1;
    }
    if (!failed) {
        Py_BEGIN_ALLOW_THREADS
        expose(view, dark);
        Py_END_ALLOW_THREADS
    }
    for (int i = 0; i < held; i++)
        if (view[i].obj)
            PyBuffer_Release(&view[i]);
    if (failed)
        return NULL;
    Py_RETURN_NONE;
}

static PyMethodDef methods[] = {
    {"expose", expose_method, METH_VARARGS, expose_doc},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT,
    .m_name = "engines.mujoco.pictures.filament._exposure",
    .m_doc = "What a sensor makes of a picture; see _exposure.c.",
    .m_size = -1,
    .m_methods = methods,
};

PyMODINIT_FUNC PyInit__exposure(void)
{
    return PyModule_Create(&definition);
}
