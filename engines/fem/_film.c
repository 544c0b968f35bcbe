/* A film of liquid on a surface of triangles, in whole parts of QUANTUM m^3, so that none is ever lost to rounding.

Each node has the liquid of a third of the faces around. It runs down with the flux of a thin film, rho g h^3 / (3 mu)
times the slope (Nusselt, Die Oberflaechenkondensation des Wasserdampfes, VDI-Z. 60, 1916), between the cells of nodes
with linear elements, upwind, explicitly. The slope is that of the liquid's level, so hollows fill and level out. See
docs/decisions/0132-bleeding.md.
*/

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#define QUANTUM 1e-18  /* m^3 */
#define LEVELLED 0.125 /* part of the difference of two levels that evens out in a step: each node has some six neighbours */
#define LEAST_FILM 2e-6 /* m: a thinner film stays where it is */

typedef struct {
    double mobility; /* rho g / (3 mu), 1/(m s) */
    double hanging;  /* thickest film on a surface that looks down, m */
    double down;     /* upward part of the normal below which a surface looks down */
    double thinner;  /* mobility of saline over that of the liquid */
} Liquid;

typedef struct {
    int nodes, faces;
    const int32_t *corners; /* (faces, 3); -1: no face */
    const double *place;    /* (nodes, 3), m */
    int64_t *amount;        /* (nodes,), in QUANTUM */
    double *area;           /* (nodes,), m^2: scratch, as all that follows */
    double *rise;           /* (nodes,): of the level by liquid, 1/m^2; 0 of a surface that looks down */
    double *level;          /* (nodes,), m */
    double *volume;         /* (nodes,): liquid before the step, m^3 */
    double *outflow;        /* (nodes,), m^3 */
    double *through;        /* (faces, 3): from a corner to the next one, m^3 */
    int32_t *wet;           /* (faces,): faces with liquid at a corner */
    int64_t *saline;        /* (nodes,): part of `amount` that is saline, well mixed with the rest; NULL: there is none */
} Film;

static void subtract(const double *a, const double *b, double *d)
{
    for (int k = 0; k < 3; k++)
        d[k] = a[k] - b[k];
}

static double dot(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Set `normal` to twice the area of a face along its normal; return its length, m^2. */
static double span(const Film *film, const int32_t *at, double *normal)
{
    double a[3], b[3];
    subtract(film->place + 3 * (size_t)at[1], film->place + 3 * (size_t)at[0], a);
    subtract(film->place + 3 * (size_t)at[2], film->place + 3 * (size_t)at[0], b);
    for (int k = 0; k < 3; k++)
        normal[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
    return sqrt(dot(normal, normal));
}

/* List the faces with liquid at a corner, with areas and levels of their nodes; return their number. */
static int measure(Film *film, double down)
{
    int count = 0;
    memset(film->area, 0, sizeof(double) * (size_t)film->nodes);
    memset(film->rise, 0, sizeof(double) * (size_t)film->nodes);
    for (int f = 0; f < film->faces; f++) {
        const int32_t *at = film->corners + 3 * (size_t)f;
        double normal[3];
        if (at[0] < 0 || !(film->amount[at[0]] | film->amount[at[1]] | film->amount[at[2]]))
            continue;
        double share = span(film, at, normal) / 6.0;
        film->wet[count++] = f;
        for (int c = 0; c < 3; c++) {
            film->area[at[c]] += share;
            film->rise[at[c]] += normal[2] / 6.0; /* first area times the upward part of the normal */
            film->outflow[at[c]] = -1.0;
        }
    }
    for (int k = 0; k < count; k++)
        for (int c = 0; c < 3; c++) {
            int node = film->corners[3 * film->wet[k] + c];
            double area = film->area[node];
            if (film->outflow[node] == 0.0)
                continue;
            film->rise[node] = area > 0.0 && film->rise[node] >= down * area ? 1.0 / area : 0.0;
            film->volume[node] = QUANTUM * (double)film->amount[node];
            film->level[node] = film->place[3 * (size_t)node + 2] + film->rise[node] * film->volume[node];
            film->outflow[node] = 0.0;
        }
    return count;
}

/* Return the mobility of the liquid at a node: fluidities mix by volume. */
static double mobility_at(const Film *film, const Liquid *liquid, int node)
{
    if (!film->saline || !film->saline[node])
        return liquid->mobility;
    double share = (double)film->saline[node] / (double)film->amount[node];
    return liquid->mobility * (1.0 + share * (liquid->thinner - 1.0));
}

/* Take `taken` from a node; return the saline in it. */
static int64_t take(Film *film, int node, int64_t taken)
{
    int64_t saline = 0;
    if (film->saline && film->saline[node]) {
        int64_t there = film->saline[node], rest = film->amount[node] - there;
        saline = (int64_t)((double)taken * ((double)there / (double)film->amount[node]));
        saline = saline < taken - rest ? taken - rest : saline;
        saline = saline > there ? there : saline > taken ? taken : saline;
        film->saline[node] -= saline;
    }
    film->amount[node] -= taken;
    return saline;
}

/* Return the liquid that flows from one corner of a face to another in `seconds`, m^3. */
static double flow_between(const Film *film, const Liquid *liquid, int from, int to, double weight, double seconds)
{
    double thickness = film->volume[from] / film->area[from];
    double fall = film->level[from] - film->level[to];
    double flow = seconds * mobility_at(film, liquid, from) * thickness * thickness * thickness * weight * fall;
    double rise = film->rise[from] + film->rise[to];
    double most = rise > 0.0 ? LEVELLED * fall / rise : flow;
    return thickness <= LEAST_FILM ? 0.0 : flow < most ? flow : most;
}

/* Set the flow through each wet face, positive from a corner to the next one. */
static void set_flows(Film *film, const Liquid *liquid, int count, double seconds)
{
    for (int k = 0; k < count; k++) {
        const int32_t *at = film->corners + 3 * (size_t)film->wet[k];
        double normal[3], twice = span(film, at, normal);
        for (int c = 0; c < 3; c++) {
            int here = at[c], next = at[(c + 1) % 3], apex = at[(c + 2) % 3];
            double a[3], b[3], *flow = film->through + 3 * (size_t)k + c;
            subtract(film->place + 3 * (size_t)here, film->place + 3 * (size_t)apex, a);
            subtract(film->place + 3 * (size_t)next, film->place + 3 * (size_t)apex, b);
            double weight = twice > 0.0 ? 0.5 * dot(a, b) / twice : 0.0;
            *flow = 0.0;
            if (!(weight > 0.0)) /* an obtuse angle would let liquid climb */
                continue;
            int is_higher = film->level[here] > film->level[next];
            double found = flow_between(film, liquid, is_higher ? here : next, is_higher ? next : here, weight, seconds);
            film->outflow[is_higher ? here : next] += found;
            *flow = is_higher ? found : -found;
        }
    }
}

/* Move the liquid: no node gives more than it has. */
static void apply_flows(Film *film, int count)
{
    for (int k = 0; k < count; k++) {
        const int32_t *at = film->corners + 3 * (size_t)film->wet[k];
        for (int c = 0; c < 3; c++) {
            double flow = film->through[3 * k + c];
            int from = flow > 0.0 ? at[c] : at[(c + 1) % 3], to = flow > 0.0 ? at[(c + 1) % 3] : at[c];
            if (flow == 0.0)
                continue;
            double share = film->outflow[from] > film->volume[from] ? film->volume[from] / film->outflow[from] : 1.0;
            int64_t taken = (int64_t)(share * fabs(flow) / QUANTUM);
            taken = taken < film->amount[from] ? taken : film->amount[from];
            int64_t saline = take(film, from, taken);
            film->amount[to] += taken;
            if (saline)
                film->saline[to] += saline;
        }
    }
}

/* Let what is too thick drip off nodes that were wet before; return how much. */
static int64_t drip(Film *film, const Liquid *liquid, int count)
{
    int64_t dripped = 0;
    for (int k = 0; k < count; k++)
        for (int c = 0; c < 3; c++) {
            int node = film->corners[3 * film->wet[k] + c];
            int64_t most = (int64_t)(liquid->hanging * film->area[node] / QUANTUM);
            if (film->volume[node] > 0.0 && film->rise[node] == 0.0 && film->amount[node] > most) {
                dripped += film->amount[node] - most;
                take(film, node, film->amount[node] - most);
            }
        }
    return dripped;
}

/* Let the liquid run for a step of `seconds`; return how much drips off, in QUANTUM. */
static int64_t run(Film *film, const Liquid *liquid, double seconds)
{
    int count = measure(film, liquid->down);
    set_flows(film, liquid, count, seconds);
    apply_flows(film, count);
    return drip(film, liquid, count);
}

typedef struct {
    Py_buffer view[12];
    int count;
} Buffers;

static void release(Buffers *held)
{
    while (held->count)
        PyBuffer_Release(held->view + --held->count);
}

/* Hold the arrays of a tuple, of which those from `written` on are written; return 0 on success. */
static int hold(Buffers *held, PyObject *arrays, int expected, int written)
{
    held->count = 0;
    if (!PyTuple_Check(arrays) || PyTuple_GET_SIZE(arrays) != expected) {
        PyErr_Format(PyExc_TypeError, "expected a tuple of %d arrays", expected);
        return -1;
    }
    for (int k = 0; k < expected; k++, held->count++)
        if (PyObject_GetBuffer(PyTuple_GET_ITEM(arrays, k), held->view + k, k < written ? PyBUF_SIMPLE : PyBUF_WRITABLE))
            return -1;
    return 0;
}

static Film film_of(const Py_buffer *view)
{
    return (Film){(int)(view[2].len / 8), (int)(view[0].len / 12), view[0].buf, view[1].buf, view[2].buf, view[3].buf,
                  view[4].buf, view[5].buf, view[6].buf, view[7].buf, view[8].buf, view[9].buf, NULL};
}

PyDoc_STRVAR(run_doc, "run(arrays, mobility, hanging, down, thinner, seconds, sub_steps)\n--\n\n\
Let the film run by sub-steps of `seconds`; return how much drips off. For arrays and numbers see `Film`, `Liquid`;\n\
the array of saline may be left out.");

static PyObject *run_method(PyObject *Py_UNUSED(module), PyObject *args)
{
    PyObject *arrays;
    Liquid liquid;
    double seconds;
    int sub_steps;
    int64_t dripped = 0;
    if (!PyArg_ParseTuple(args, "Odddddi", &arrays, &liquid.mobility, &liquid.hanging, &liquid.down, &liquid.thinner,
                          &seconds, &sub_steps) ||
        !PyTuple_Check(arrays))
        return NULL;
    Buffers held;
    int count = PyTuple_GET_SIZE(arrays) == 11 ? 11 : 10;
    int failed = hold(&held, arrays, count, 2);
    if (!failed) {
        Film film = film_of(held.view);
        film.saline = count == 11 ? held.view[10].buf : NULL;
        for (int k = 0; k < sub_steps; k++)
            dripped += run(&film, &liquid, seconds);
    }
    release(&held);
    return failed ? NULL : PyLong_FromLongLong(dripped);
}

PyDoc_STRVAR(emit_doc, "emit(arrays, seconds)\n--\n\n\
Add to the film what faces emit, from (corners, places, velocities, rates, amounts): velocity (m/s) out of the face,\n\
shape (faces,); write the flow of each face (m^3/s) to `rates`. Return how much has been added.");

static PyObject *emit(PyObject *Py_UNUSED(module), PyObject *args)
{
    PyObject *arrays;
    double seconds;
    int64_t total = 0;
    if (!PyArg_ParseTuple(args, "Od", &arrays, &seconds))
        return NULL;
    Buffers held;
    int failed = hold(&held, arrays, 5, 3);
    if (!failed) {
        Film film = {.faces = (int)(held.view[0].len / 12), .corners = held.view[0].buf, .place = held.view[1].buf,
                     .amount = held.view[4].buf};
        const double *velocity = held.view[2].buf;
        double *rate = held.view[3].buf, normal[3];
        for (int f = 0; f < film.faces; f++) {
            const int32_t *at = film.corners + 3 * (size_t)f;
            rate[f] = velocity[f] > 0.0 && at[0] >= 0 ? 0.5 * velocity[f] * span(&film, at, normal) : 0.0;
            int64_t third = (int64_t)(rate[f] * seconds / (3.0 * QUANTUM));
            for (int c = 0; c < 3 && third; c++)
                film.amount[at[c]] += third;
            total += 3 * third;
        }
    }
    release(&held);
    return failed ? NULL : PyLong_FromLongLong(total);
}

PyDoc_STRVAR(measure_doc, "measure(arrays, step)\n--\n\n\
Write the thickness of the film at every node, in steps of `step` (m), at most 255. The arrays are those of\n\
`run`, and the thickness.");

static PyObject *measure_method(PyObject *Py_UNUSED(module), PyObject *args)
{
    PyObject *arrays;
    double step;
    if (!PyArg_ParseTuple(args, "Od", &arrays, &step))
        return NULL;
    Buffers held;
    int failed = hold(&held, arrays, 11, 2);
    if (!failed) {
        Film film = film_of(held.view);
        uint8_t *thickness = held.view[10].buf;
        measure(&film, 0.0);
        for (int i = 0; i < film.nodes; i++) {
            double steps = film.amount[i] && film.area[i] > 0.0 ? QUANTUM * (double)film.amount[i] / (film.area[i] * step) : 0.0;
            thickness[i] = steps > 254.0 ? 255 : (uint8_t)(steps + 0.5);
        }
    }
    release(&held);
    if (failed)
        return NULL;
    Py_RETURN_NONE;
}

static PyMethodDef methods[] = {
    {"measure", measure_method, METH_VARARGS, measure_doc},
    {"run", run_method, METH_VARARGS, run_doc},
    {"emit", emit, METH_VARARGS, emit_doc},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT,
    .m_name = "engines.fem._film",
    .m_doc = "Films of liquid on surfaces; see _film.c.",
    .m_size = -1,
    .m_methods = methods,
};

PyMODINIT_FUNC PyInit__film(void)
{
    return PyModule_Create(&definition);
}
