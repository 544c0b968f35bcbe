/* Kinematics, to the bit as robots/ has it in numpy, without the cost of numpy's calls.

Sines, products of matrices and solutions are those of numpy's own inner loops, which its ufuncs hold, called with
the shapes and strides that numpy would call them with: so they have numpy's bits on every processor and with every
BLAS. All else is sums, products, quotients and square roots, which IEEE 754 fixes, in the order of the Python code;
the compiler must not fuse them (hatch_build.py).

Only the usual case is here. A function returns None wherever an argument is not an array of the expected size, a
number is not finite, or a joint would leave its range; the Python code then does all, and raises what is to be raised.
*/

#define TROCAR_KINEMATICS_MODULE
#include "_kinematics.h"

Loops loops;
const npy_intp SQUARE[3] = {0, 4, 1};

/* Find the loop of doubles of a ufunc; return 0, with an ImportError, if there is none. */
static int find(PyObject *module, const char *name, Loop *loop)
{
    PyObject *found = PyObject_GetAttrString(module, name);
    if (found == NULL)
        return 0;
    loop->call = NULL;
    if (PyObject_TypeCheck(found, &PyUFunc_Type)) {
        PyUFuncObject *ufunc = (PyUFuncObject *)found;
        for (int i = 0; i < ufunc->ntypes && loop->call == NULL; i++) {
            int doubles = 0;
            for (int k = 0; k < ufunc->nargs; k++)
                doubles += ufunc->types[i * ufunc->nargs + k] == NPY_DOUBLE;
            if (doubles == ufunc->nargs) {
                loop->call = ufunc->functions[i];
                loop->data = ufunc->data == NULL ? NULL : (void *)ufunc->data[i];
            }
        }
    }
    Py_DECREF(found); /* numpy keeps it */
    if (loop->call != NULL)
        return 1;
    PyErr_Format(PyExc_ImportError, "numpy has no loop of doubles for %s; the Python code is used instead", name);
    return 0;
}

void multiply(npy_intp times, npy_intp m, npy_intp n, npy_intp p, const double *a, const npy_intp *as, const double *b,
              const npy_intp *bs, double *c, const npy_intp *cs)
{
    char *args[3] = {(char *)a, (char *)b, (char *)c};
    npy_intp dimensions[4] = {times, m, n, p};
    npy_intp steps[9] = {as[0] * DOUBLE, bs[0] * DOUBLE, cs[0] * DOUBLE, as[1] * DOUBLE, as[2] * DOUBLE,
                         bs[1] * DOUBLE, bs[2] * DOUBLE, cs[1] * DOUBLE, cs[2] * DOUBLE};
    loops.matmul.call(args, dimensions, steps, loops.matmul.data);
}

double dot(npy_intp n, const double *a, npy_intp as, const double *b, npy_intp bs)
{
    double result;
    char *args[3] = {(char *)a, (char *)b, (char *)&result};
    npy_intp dimensions[2] = {1, n}, steps[5] = {0, 0, 0, as * DOUBLE, bs * DOUBLE};
    loops.vecdot.call(args, dimensions, steps, loops.vecdot.data);
    return result;
}

const double *numbers(PyObject *object, npy_intp size)
{
    if (!PyArray_Check(object))
        return NULL;
    PyArrayObject *array = (PyArrayObject *)object;
    if (PyArray_TYPE(array) != NPY_DOUBLE || !PyArray_ISCARRAY_RO(array) || PyArray_SIZE(array) != size)
        return NULL;
    return PyArray_DATA(array);
}

const double *vector(PyObject *object, npy_intp size)
{
    return PyArray_Check(object) && PyArray_NDIM((PyArrayObject *)object) == 1 ? numbers(object, size) : NULL;
}

int read_chain(PyObject *object, Chain *chain)
{
    if (!PyTuple_Check(object) || PyTuple_GET_SIZE(object) != 5 || !PyArray_Check(PyTuple_GET_ITEM(object, 2)))
        return 0;
    npy_intp n = chain->n = PyArray_SIZE((PyArrayObject *)PyTuple_GET_ITEM(object, 2));
    return 0 < n && n <= MOST && (chain->basis = numbers(PyTuple_GET_ITEM(object, 0), 48 * n)) != NULL &&
           (chain->tip = numbers(PyTuple_GET_ITEM(object, 1), 16)) != NULL &&
           (chain->lower = numbers(PyTuple_GET_ITEM(object, 2), n)) != NULL &&
           (chain->upper = numbers(PyTuple_GET_ITEM(object, 3), n)) != NULL &&
           (chain->slides = numbers(PyTuple_GET_ITEM(object, 4), n)) != NULL;
}

void find_frames(const Chain *chain, const double *q, double *poses)
{
    npy_intp n = chain->n, steps[2] = {DOUBLE, 3 * DOUBLE};
    double factors[MOST][3], links[MOST][16];
    const npy_intp row[3] = {3, 3, 1}, table[3] = {48, 16, 1}, link[3] = {16, 16, 1};
    char *cosines[2] = {(char *)q, (char *)&factors[0][1]}, *sines[2] = {(char *)q, (char *)&factors[0][2]};
    loops.cosine.call(cosines, &n, steps, loops.cosine.data);
    loops.sine.call(sines, &n, steps, loops.sine.data);
    for (npy_intp i = 0; i < n; i++) {
        factors[i][0] = 1.0;
        if (chain->slides[i] != 0.0)
            factors[i][2] = q[i];
    }
    multiply(n, 1, 3, 16, factors[0], row, chain->basis, table, links[0], link);
    memcpy(poses, links[0], sizeof links[0]);
    for (npy_intp i = 0; i < n; i++)
        multiply(1, 4, 4, 4, poses + 16 * i, SQUARE, i + 1 < n ? links[i + 1] : chain->tip, SQUARE,
                 poses + 16 * (i + 1), SQUARE);
}

/* Write the unit quaternion of the matrix in the corner of a pose: `_from_rows` of rotation.py. */
void quaternion_of(const double *pose, double *q)
{
    double a = pose[0], b = pose[1], c = pose[2], d = pose[4], e = pose[5], f = pose[6], g = pose[8], h = pose[9],
           i = pose[10];
    double largest = 1 + a - e - i, x = largest, y = b + d, z = c + g, w = h - f, square;
    if ((square = 1 - a + e - i) > largest)
        largest = square, x = b + d, y = square, z = f + h, w = c - g;
    if ((square = 1 - a - e + i) > largest)
        largest = square, x = c + g, y = f + h, z = square, w = d - b;
    if ((square = 1 + a + e + i) > largest)
        x = h - f, y = c - g, z = d - b, w = square;
    double length = sqrt(x * x + y * y + z * z + w * w);
    q[0] = x / length, q[1] = y / length, q[2] = z / length, q[3] = w / length;
}

/* Write the rotation vector from a pose to the quaternion `goal`: `turn_to` of rotation.py. */
static void turn_to(const double *goal, const double *pose, double *vector)
{
    double from[4];
    quaternion_of(pose, from);
    double ax = goal[0], ay = goal[1], az = goal[2], aw = goal[3];
    double bx = -from[0], by = -from[1], bz = -from[2], bw = from[3];
    double x = aw * bx + ax * bw + ay * bz - az * by, y = aw * by - ax * bz + ay * bw + az * bx;
    double z = aw * bz + ax * by - ay * bx + az * bw, w = aw * bw - ax * bx - ay * by - az * bz;
    if (!(w >= 0.0))
        x = -x, y = -y, z = -z, w = -w;
    double length = sqrt(x * x + y * y + z * z);
    double scale = length < 1e-6 ? 2.0 / w : 2.0 * atan2(length, w) / length;
    vector[0] = scale * x, vector[1] = scale * y, vector[2] = scale * z;
}

/* Write the Jacobian, (6, n): `SerialChain.jacobian`. */
void find_jacobian(const Chain *chain, const double *poses, double *jacobian)
{
    npy_intp n = chain->n;
    const double *tip = poses + 16 * n;
    for (npy_intp i = 0; i < n; i++) {
        const double *pose = poses + 16 * i;
        double axis[3] = {pose[2], pose[6], pose[10]};
        double arm[3] = {tip[3] - pose[3], tip[7] - pose[7], tip[11] - pose[11]};
        int slides = chain->slides[i] != 0.0;
        for (int k = 0; k < 3; k++) {
            int next = (k + 1) % 3, last = (k + 2) % 3;
            jacobian[k * n + i] = slides ? axis[k] : axis[next] * arm[last] - axis[last] * arm[next];
            jacobian[(k + 3) * n + i] = slides ? 0.0 : axis[k];
        }
    }
}

/* Write a correction: `_correction` of inverse_kinematics.py. Return 0 where it is not the usual case. */
static int correct(const Chain *chain, const double *q, const double *poses, const double *error, double added,
                   double weight, double *correction)
{
    npy_intp n = chain->n;
    double jacobian[6 * MOST], normal[MOST * MOST], gradient[MOST], move[MOST];
    const npy_intp upright[3] = {0, n, 1}, across[3] = {0, 1, n}, column[3] = {0, 1, 0};
    find_jacobian(chain, poses, jacobian);
    for (npy_intp i = 3 * n; i < 6 * n; i++)
        jacobian[i] *= weight;
    multiply(1, n, 6, n, jacobian, across, jacobian, upright, normal, upright);
    for (npy_intp i = 0; i < n; i++)
        normal[i * (n + 1)] += added;
    multiply(1, n, 6, 1, jacobian, across, error, column, gradient, column);
    char *args[3] = {(char *)normal, (char *)gradient, (char *)move};
    npy_intp dimensions[2] = {1, n}, steps[7] = {0, 0, 0, n * DOUBLE, DOUBLE, DOUBLE, DOUBLE};
    loops.solve.call(args, dimensions, steps, loops.solve.data);
    for (npy_intp i = 0; i < n; i++) {
        double reached = q[i] + move[i];
        if (!(chain->lower[i] < reached && reached < chain->upper[i]))
            return 0;
        correction[i] = reached - q[i];
    }
    return 1;
}

PyObject *array_of(npy_intp n, const double *values)
{
    PyObject *result = PyArray_SimpleNew(1, &n, NPY_DOUBLE);
    if (result != NULL)
        memcpy(PyArray_DATA((PyArrayObject *)result), values, n * sizeof(double));
    return result;
}

PyDoc_STRVAR(frames_doc, "frames(chain, q): poses of all links and the tip, shape (n + 1, 4, 4), at q, shape (n,).");

static PyObject *frames(PyObject *module, PyObject *const *args, Py_ssize_t count)
{
    Chain chain;
    const double *q;
    if (count != 2 || !read_chain(args[0], &chain) || (q = vector(args[1], chain.n)) == NULL)
        Py_RETURN_NONE;
    npy_intp shape[3] = {chain.n + 1, 4, 4};
    PyObject *result = PyArray_SimpleNew(3, shape, NPY_DOUBLE);
    if (result != NULL)
        find_frames(&chain, q, PyArray_DATA((PyArrayObject *)result));
    return result;
}

PyDoc_STRVAR(pursue_doc,
             "pursue(chain, q, position, orientation, largest_move, length, damping, met, corrections):\n"
             "`robots.inverse_kinematics.pursue`, with its constants; `met` is the square of a length.");

static PyObject *pursue(PyObject *module, PyObject *const *args, Py_ssize_t count)
{
    Chain chain;
    const double *q, *position, *orientation, *largest;
    if (count != 9 || !read_chain(args[0], &chain) || (q = vector(args[1], chain.n)) == NULL ||
        (position = vector(args[2], 3)) == NULL || (orientation = vector(args[3], 4)) == NULL ||
        (largest = vector(args[4], chain.n)) == NULL)
        Py_RETURN_NONE;
    double length = PyFloat_AsDouble(args[5]), damping = PyFloat_AsDouble(args[6]), met = PyFloat_AsDouble(args[7]);
    long corrections = PyLong_AsLong(args[8]);
    if (PyErr_Occurred())
        return NULL;
    npy_intp n = chain.n;
    double found[MOST], move[MOST], poses[16 * (MOST + 1)], error[6];
    memcpy(found, q, n * sizeof(double));
    while (corrections-- > 0) {
        find_frames(&chain, found, poses);
        const double *tip = poses + 16 * n;
        turn_to(orientation, tip, error + 3);
        for (int k = 0; k < 3; k++) {
            error[k] = position[k] - tip[4 * k + 3];
            error[k + 3] = length * error[k + 3];
        }
        double squared = dot(6, error, 1, error, 1);
        if (squared < met)
            break;
        if (!isfinite(squared) || !correct(&chain, found, poses, error, 0.5 * squared + damping, length, move))
            Py_RETURN_NONE;
        double share = 0.0;
        for (npy_intp i = 0; i < n; i++) {
            move[i] = found[i] + move[i] - q[i];
            share = fmax(share, fabs(move[i] / largest[i]));
        }
        for (npy_intp i = 0; i < n; i++)
            found[i] = q[i] + move[i] / fmax(1.0, share);
        if (share >= 1.0)
            break;
    }
    return array_of(n, found);
}

static PyMethodDef functions[] = {
    {"frames", (PyCFunction)(void (*)(void))frames, METH_FASTCALL, frames_doc},
    {"pursue", (PyCFunction)(void (*)(void))pursue, METH_FASTCALL, pursue_doc},
    {"inverse", (PyCFunction)(void (*)(void))inverse, METH_FASTCALL, inverse_doc},
    {"tips", (PyCFunction)(void (*)(void))tips, METH_FASTCALL, tips_doc},
    {"tip_poses", (PyCFunction)(void (*)(void))tip_poses, METH_FASTCALL, tip_poses_doc},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT,
    .m_name = "robots._kinematics",
    .m_doc = "Kinematics of one configuration; see _kinematics.c.",
    .m_size = -1,
    .m_methods = functions,
};

PyMODINIT_FUNC PyInit__kinematics(void)
{
    import_array();
    import_umath();
    PyObject *numpy = PyImport_ImportModule("numpy"), *linalg = PyImport_ImportModule("numpy.linalg._umath_linalg");
    int found = numpy != NULL && linalg != NULL && find(numpy, "cos", &loops.cosine) && find(numpy, "sin", &loops.sine) &&
                find(numpy, "arctan2", &loops.arctan2) && find(numpy, "hypot", &loops.hypot) &&
                find(numpy, "add", &loops.add) && find(numpy, "matmul", &loops.matmul) &&
                find(numpy, "vecdot", &loops.vecdot) && find(linalg, "solve1", &loops.solve);
    Py_XDECREF(numpy);
    Py_XDECREF(linalg);
    return found ? PyModule_Create(&definition) : NULL;
}
