/* States of the tips of several arms at once: what robots/tips.py has in numpy, to the bit. */

#include "_kinematics.h"

#define POSES 5 /* of an arm: its base, then its tip as commanded and as measured, each in the base and outside */

/* The same as `numbers` of an array that may be written. */
static double *place(PyObject *object, npy_intp size)
{
    const double *found = numbers(object, size);
    return found != NULL && PyArray_ISWRITEABLE((PyArrayObject *)object) ? (double *)found : NULL;
}

const char tips_doc[] =
    "tips(chain, state, tips, twists, jacobian): `robots.tips.Tips.update` of one arm; returns whether it is done.";

PyObject *tips(PyObject *module, PyObject *const *args, Py_ssize_t count)
{
    (void)module;
    Chain chain;
    const double *state;
    double *poses, *twists, *jacobian, frames[16 * (MOST + 1)];
    if (count != 5 || !read_chain(args[0], &chain) || (state = numbers(args[1], 6 * chain.n)) == NULL ||
        (poses = place(args[2], 32)) == NULL || (twists = place(args[3], 12)) == NULL ||
        (jacobian = place(args[4], 6 * chain.n)) == NULL)
        Py_RETURN_FALSE;
    npy_intp n = chain.n;
    const npy_intp upright[3] = {0, n, 1}, column[3] = {0, 1, 0};
    for (int i = 0; i < 2; i++) { /* the Jacobian of the second, as measured, stays */
        const double *q = state + 3 * n * i;
        find_frames(&chain, q, frames);
        find_jacobian(&chain, frames, jacobian);
        multiply(1, 6, n, 1, jacobian, upright, q + n, column, twists + 6 * i, column);
        memcpy(poses + 16 * i, frames + 16 * n, 16 * sizeof(double));
    }
    Py_RETURN_TRUE;
}

/* Write position and quaternion; return whether both are numbers. */
static int write_pose(const double *pose, double *written)
{
    written[0] = pose[3], written[1] = pose[7], written[2] = pose[11];
    quaternion_of(pose, written + 3);
    return isfinite(written[3]);
}

const char tip_poses_doc[] =
    "tip_poses(base, tips, poses): `robots.tips.tip_poses`; returns whether it is done.";

PyObject *tip_poses(PyObject *module, PyObject *const *args, Py_ssize_t count)
{
    (void)module;
    const double *base, *tip;
    double *poses, outside[16];
    if (count != 3 || !PyArray_Check(args[0]))
        Py_RETURN_FALSE;
    npy_intp arms = PyArray_SIZE((PyArrayObject *)args[0]) / 16;
    if ((base = numbers(args[0], 16 * arms)) == NULL || (tip = numbers(args[1], 32 * arms)) == NULL ||
        (poses = place(args[2], 7 * POSES * arms)) == NULL)
        Py_RETURN_FALSE;
    for (npy_intp i = 0; i < arms; i++, base += 16) {
        int done = write_pose(base, poses);
        poses += 7;
        for (int k = 0; k < 2; k++, tip += 16, poses += 14) {
            multiply(1, 4, 4, 4, base, SQUARE, tip, SQUARE, outside, SQUARE);
            done = done && write_pose(tip, poses) && write_pose(outside, poses + 7);
        }
        if (!done)
            Py_RETURN_FALSE;
    }
    Py_RETURN_TRUE;
}
