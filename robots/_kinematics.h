/* What the compiled kinematics share: numpy's inner loops, and the numbers of a chain. */

#define PY_SSIZE_T_CLEAN
#define NPY_NO_DEPRECATED_API NPY_2_0_API_VERSION
#define PY_ARRAY_UNIQUE_SYMBOL trocar_array_api
#define PY_UFUNC_UNIQUE_SYMBOL trocar_ufunc_api
#ifndef TROCAR_KINEMATICS_MODULE /* the file that fills numpy's tables of functions */
#define NO_IMPORT_ARRAY
#define NO_IMPORT_UFUNC
#endif
#include <Python.h>
#include <numpy/arrayobject.h>
#include <numpy/ufuncobject.h>
#include <math.h>
#include <string.h>

#define MOST 8 /* joints of a chain */
#define DOUBLE ((npy_intp)sizeof(double))

/* An inner loop of a ufunc, for doubles. */
typedef struct {
    PyUFuncGenericFunction call;
    void *data;
} Loop;

typedef struct {
    Loop cosine, sine, arctan2, hypot, add, matmul, vecdot, solve;
} Loops;

extern Loops loops;

/* A chain, as `SerialChain.numbers` has it. */
typedef struct {
    npy_intp n;
    const double *basis;         /* (n, 3, 16) */
    const double *tip;           /* (4, 4) */
    const double *lower, *upper; /* (n,) */
    const double *slides;        /* (n,): 1 of a prismatic joint */
} Chain;

/* c (m, p) = a (m, n) b (n, p), `times` times; strides in numbers, the first of each for the next of many. */
void multiply(npy_intp times, npy_intp m, npy_intp n, npy_intp p, const double *a, const npy_intp *as, const double *b,
              const npy_intp *bs, double *c, const npy_intp *cs);

extern const npy_intp SQUARE[3]; /* strides of a matrix, shape (4, 4) */

/* The product of two vectors of n numbers that stand `as` and `bs` numbers apart. */
double dot(npy_intp n, const double *a, npy_intp as, const double *b, npy_intp bs);

/* Return the numbers of a contiguous array of doubles of this size; NULL if `object` is none. */
const double *numbers(PyObject *object, npy_intp size);

/* The same of an array of one dimension. */
const double *vector(PyObject *object, npy_intp size);

/* Read `SerialChain.numbers`; return 0 if `object` is something else. */
int read_chain(PyObject *object, Chain *chain);

/* Write the poses of all links and the tip, (n + 1, 4, 4): `_Workspace.frames` of serial_chain.py. */
void find_frames(const Chain *chain, const double *q, double *poses);

/* Write the Jacobian, (6, n), from these: `SerialChain.jacobian`. */
void find_jacobian(const Chain *chain, const double *poses, double *jacobian);

/* Write the unit quaternion of the matrix in the corner of a pose: `_from_rows` of rotation.py. */
void quaternion_of(const double *pose, double *q);

/* Return a new array of n doubles. */
PyObject *array_of(npy_intp n, const double *values);

extern const char inverse_doc[];
PyObject *inverse(PyObject *module, PyObject *const *args, Py_ssize_t count); /* _closed_form.c */

extern const char tips_doc[], tip_poses_doc[];
PyObject *tips(PyObject *module, PyObject *const *args, Py_ssize_t count);      /* _tips.c */
PyObject *tip_poses(PyObject *module, PyObject *const *args, Py_ssize_t count); /* _tips.c */
