/* The closed form of robots/dvrk/inverse.py for one pose that is not singular; what each part means stands there.

Vectors of all branches are arrays as numpy would have them: its loops are called with the same strides. */

#include "_kinematics.h"

#define BRANCHES 4
#define RIGID 0.999e-6 /* a little less than there: what is nearer to its bound is left to the Python code */
#define FAR 1e3
#define POINT 1e-9
#define ACCEPTED 0.785 /* rad, a little less than 45 degrees: as with RIGID */

typedef double Vectors[BRANCHES][3];

/* What the closed form takes from a chain: `_Form.numbers`. */
typedef struct {
    const double *from_tip;     /* (4, 4) */
    const double *theta;        /* of the joints after the insertion */
    const double *offsets;      /* d of the roll, d of the insertion, a of the wrist yaw */
    const double *lowest, *highest, *middle, *tolerance, *velocity; /* (n,) each */
} Form;

static int read_form(PyObject *object, npy_intp n, Form *form)
{
    const double *limits;
    if (!PyTuple_Check(object) || PyTuple_GET_SIZE(object) != 4 ||
        (form->from_tip = numbers(PyTuple_GET_ITEM(object, 0), 16)) == NULL ||
        (form->theta = numbers(PyTuple_GET_ITEM(object, 1), n - 3)) == NULL ||
        (form->offsets = numbers(PyTuple_GET_ITEM(object, 2), 3)) == NULL ||
        (limits = numbers(PyTuple_GET_ITEM(object, 3), 5 * n)) == NULL)
        return 0;
    form->lowest = limits, form->highest = limits + n, form->middle = limits + 2 * n;
    form->tolerance = limits + 3 * n, form->velocity = limits + 4 * n;
    return 1;
}

/* A sum as `np.add.reduce` has it. */
static double sum(npy_intp n, const double *a)
{
    double total = 0.0;
    char *args[3] = {(char *)&total, (char *)a, (char *)&total};
    npy_intp steps[3] = {0, DOUBLE, 0};
    loops.add.call(args, &n, steps, loops.add.data);
    return total;
}

static double length(const double *a)
{
    double squares[3] = {a[0] * a[0], a[1] * a[1], a[2] * a[2]};
    return sqrt(sum(3, squares));
}

static void cross(const double *a, npy_intp as, const double *b, npy_intp bs, double *c)
{
    for (int k = 0; k < 3; k++) {
        int next = (k + 1) % 3, last = (k + 2) % 3;
        c[k] = a[next * as] * b[last * bs] - a[last * as] * b[next * bs];
    }
}

/* c = f(a, b) for `count` numbers; strides in numbers. */
static void each(const Loop *loop, npy_intp count, const double *a, npy_intp as, const double *b, npy_intp bs, double *c,
                 npy_intp cs)
{
    char *args[3] = {(char *)a, (char *)b, (char *)c};
    npy_intp steps[3] = {as * DOUBLE, bs * DOUBLE, cs * DOUBLE};
    loop->call(args, &count, steps, loop->data);
}

static const double *matrix(PyObject *object)
{
    return PyArray_Check(object) && PyArray_NDIM((PyArrayObject *)object) == 2 ? numbers(object, 16) : NULL;
}

/* Say whether `_goals` would take the pose, and is not near to refusing it. */
static int is_rigid(const double *pose)
{
    double columns[3][3], normal[3];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            columns[i][k] = pose[4 * k + i];
    for (int i = 0; i < 3; i++) {
        if (!(fabs(pose[4 * i + 3]) <= FAR) || !(fabs(pose[12 + i]) <= RIGID))
            return 0;
        for (int j = 0; j < 3; j++) {
            double product = columns[i][0] * columns[j][0] + columns[i][1] * columns[j][1] + columns[i][2] * columns[j][2];
            if (!(fabs(product - (i == j)) <= RIGID))
                return 0;
        }
    }
    cross(columns[0], 1, columns[1], 1, normal);
    return fabs(pose[15] - 1.0) <= RIGID &&
           normal[0] * columns[2][0] + normal[1] * columns[2][1] + normal[2] * columns[2][2] > 0.0;
}

/* `_shaft_joints`: yaw, pitch and insertion into q, (count, n); the axes x3 and y3. */
static void shaft_joints(const Form *form, int count, npy_intp n, Vectors shaft, const double *depth, double *q,
                         Vectors x3, Vectors y3)
{
    double ahead[BRANCHES], down[BRANCHES], across[BRANCHES], cosines[2], sines[2];
    npy_intp two = 2, steps[2] = {DOUBLE, DOUBLE};
    for (int i = 0; i < count; i++)
        ahead[i] = -shaft[i][2], down[i] = -shaft[i][1];
    each(&loops.arctan2, count, &shaft[0][0], 3, ahead, 1, q, n);
    each(&loops.hypot, count, &shaft[0][0], 3, &shaft[0][2], 3, across, 1);
    each(&loops.arctan2, count, down, 1, across, 1, q + 1, n);
    for (int i = 0; i < count; i++) {
        q[i * n + 2] = depth[i] - form->offsets[0] - form->offsets[1];
        char *to_cosines[2] = {(char *)(q + i * n), (char *)cosines}, *to_sines[2] = {(char *)(q + i * n), (char *)sines};
        loops.sine.call(to_sines, &two, steps, loops.sine.data);
        loops.cosine.call(to_cosines, &two, steps, loops.cosine.data);
        x3[i][0] = -sines[0] * sines[1], x3[i][1] = -cosines[1], x3[i][2] = cosines[0] * sines[1];
        cross(shaft[i], 1, x3[i], 1, y3[i]);
    }
}

/* `_psm_branches` of the wrist yaw link's pose, (4, 6). Return 0 where it is singular. */
static int wrist_branches(const Form *form, const double *end, double *q)
{
    const double *x6 = end, *y6 = end + 1, *yaw = end + 2, *centre = end + 3;
    double across[3], depth[4], up[4], along[4], far, off = dot(3, centre, 4, yaw, 4);
    Vectors x5, z5, shaft, x3, y3;
    for (int k = 0; k < 3; k++)
        across[k] = centre[4 * k] - off * yaw[4 * k];
    if (!((far = length(across)) > POINT))
        return 0;
    for (int i = 0; i < 4; i++) {
        double wrist[3], sign = i % 2 ? -1.0 : 1.0, side = i / 2 ? -1.0 : 1.0;
        for (int k = 0; k < 3; k++) {
            x5[i][k] = across[k] / far * sign;
            wrist[k] = centre[4 * k] - form->offsets[2] * x5[i][k];
        }
        cross(x5[i], 1, yaw, 4, z5[i]);
        if (!(length(wrist) > POINT))
            return 0;
        double bent = dot(3, wrist, 1, z5[i], 1);
        for (int k = 0; k < 3; k++)
            shaft[i][k] = wrist[k] - bent * z5[i][k];
        double size = length(shaft[i]);
        for (int k = 0; k < 3; k++)
            shaft[i][k] = shaft[i][k] / size * side;
        depth[i] = dot(3, shaft[i], 1, wrist, 1);
    }
    shaft_joints(form, 4, 6, shaft, depth, q, x3, y3);
    for (int i = 0; i < 4; i++)
        up[i] = -dot(3, z5[i], 1, x3[i], 1), along[i] = dot(3, z5[i], 1, y3[i], 1);
    each(&loops.arctan2, 4, up, 1, along, 1, q + 3, 6);
    for (int i = 0; i < 4; i++) {
        double ahead[3];
        cross(z5[i], 1, shaft[i], 1, ahead);
        up[i] = -dot(3, x5[i], 1, shaft[i], 1), along[i] = dot(3, x5[i], 1, ahead, 1);
    }
    each(&loops.arctan2, 4, up, 1, along, 1, q + 4, 6);
    for (int i = 0; i < 4; i++)
        up[i] = -dot(3, y6, 4, x5[i], 1), along[i] = dot(3, x6, 4, x5[i], 1);
    each(&loops.arctan2, 4, up, 1, along, 1, q + 5, 6);
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < 3; k++)
            q[6 * i + 3 + k] -= form->theta[k];
    return 1;
}

/* `_branches_without_wrist` of the tip's and the last link's pose, (2, 4). Return 0 where it is singular. */
static int branches_without_wrist(const Chain *chain, const Form *form, const double *pose, const double *end, double *q)
{
    const double *x = end, *y = end + 1;
    double position[3] = {pose[3], pose[7], pose[11]}, depth[2], up[2], along[2], turn[2], far = length(position);
    Vectors shaft, x3, y3;
    if (!(far > POINT))
        return 0;
    for (int i = 0; i < 2; i++) {
        for (int k = 0; k < 3; k++)
            shaft[i][k] = position[k] / far * (i ? -1.0 : 1.0);
        depth[i] = dot(3, shaft[i], 1, pose + 3, 4) - chain->tip[11];
    }
    shaft_joints(form, 2, 4, shaft, depth, q, x3, y3);
    for (int i = 0; i < 2; i++) {
        up[i] = dot(3, x, 4, y3[i], 1) - dot(3, y, 4, x3[i], 1);
        along[i] = dot(3, x, 4, x3[i], 1) + dot(3, y, 4, y3[i], 1);
    }
    each(&loops.arctan2, 2, up, 1, along, 1, turn, 1);
    for (int i = 0; i < 2; i++)
        q[4 * i + 3] = turn[i] - form->theta[0];
    return 1;
}

/* `_unwind` of one branch. */
static void unwind(const Chain *chain, const Form *form, const double *near, double *q)
{
    const double turn = 2.0 * NPY_PI;
    for (npy_intp i = 0; i < chain->n; i++) {
        if (chain->slides[i] != 0.0)
            continue;
        double nearest = q[i] + turn * rint((near[i] - q[i]) / turn);
        double central = q[i] + turn * rint((form->middle[i] - q[i]) / turn);
        q[i] = nearest >= form->lowest[i] && nearest <= form->highest[i] ? nearest : central;
    }
}

/* Return the cost of one branch; infinite beyond the joint ranges. */
static double cost_of(const Chain *chain, const Form *form, const double *near, const double *q)
{
    double costs[MOST];
    for (npy_intp i = 0; i < chain->n; i++) {
        if (!(chain->lower[i] - q[i] <= form->tolerance[i] && q[i] - chain->upper[i] <= form->tolerance[i]))
            return NPY_INFINITY;
        double time = (q[i] - near[i]) / form->velocity[i];
        costs[i] = time * time;
    }
    return sum(chain->n, costs);
}

/* Say whether the orientation reached is well within what four joints may miss: `_check_orientation`. */
static int is_near(const double *reached, const double *asked)
{
    double squares = 0.0;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            squares += (reached[4 * i + k] - asked[4 * i + k]) * (reached[4 * i + k] - asked[4 * i + k]);
    return 2.0 * asin(fmin(sqrt(squares / 8.0), 1.0)) < ACCEPTED;
}

const char inverse_doc[] = "inverse(chain, form, pose, near): `robots.dvrk.inverse.inverse` of one pose, shape (4, 4).";

PyObject *inverse(PyObject *module, PyObject *const *args, Py_ssize_t count)
{
    (void)module;
    Chain chain;
    Form form;
    const double *pose, *near;
    if (count != 4 || !read_chain(args[0], &chain) || (chain.n != 4 && chain.n != 6) ||
        !read_form(args[1], chain.n, &form) || (pose = matrix(args[2])) == NULL || (near = vector(args[3], chain.n)) == NULL ||
        !is_rigid(pose))
        Py_RETURN_NONE;
    npy_intp n = chain.n;
    double end[16], branches[BRANCHES * MOST], found[MOST], poses[16 * (MOST + 1)], least = NPY_INFINITY;
    const double *best = NULL;
    multiply(1, 4, 4, 4, pose, SQUARE, form.from_tip, SQUARE, end, SQUARE);
    if (!(n == 6 ? wrist_branches(&form, end, branches) : branches_without_wrist(&chain, &form, pose, end, branches)))
        Py_RETURN_NONE;
    for (double *q = branches; q < branches + n * (n == 6 ? 4 : 2); q += n) {
        unwind(&chain, &form, near, q);
        double cost = cost_of(&chain, &form, near, q);
        if (cost < least)
            least = cost, best = q;
    }
    if (best == NULL) /* out of reach, or not finite */
        Py_RETURN_NONE;
    for (npy_intp i = 0; i < n; i++)
        found[i] = best[i] < chain.lower[i] ? chain.lower[i] : best[i] > chain.upper[i] ? chain.upper[i] : best[i];
    if (n == 4) {
        find_frames(&chain, found, poses);
        if (!is_near(poses + 64, pose))
            Py_RETURN_NONE;
    }
    return array_of(n, found);
}
