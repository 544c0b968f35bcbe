/* Heat in a body of linear tetrahedra at its resting shape; units are SI, temperatures are rises above the body's.

Linear finite elements with the capacity lumped at the nodes (Pennes, Analysis of tissue and arterial blood
temperatures in the resting human forearm, J. Appl. Physiol. 1, 1948), stepped explicitly. An element holds water that
boils off at 100 degrees; its dry residue may be hotter than its corners; see docs/decisions/0130-heat-in-tissue.md.
Sums run in the order of the elements and nothing is fused, so all processors have the same bits.
*/

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#define DAMAGES 2
#define SMALLEST_RISE 1e-12 /* K: less is none, and no denormal number */
#define LARGEST_DAMAGE 1e6f

enum { TISSUE, CHARRED, VAPORISED };

typedef struct {
    double capacity;          /* J/(m^3 K) */
    double conductivity;      /* W/(m K) */
    double perfusion;         /* W/(m^3 K) */
    double latent;            /* heat of all water, J/m^3 */
    double residue;           /* capacity of the dry residue, J/(m^3 K) */
    double dry_mass;          /* kg/m^3 */
    double body;              /* temperature of the body, degrees C */
    double boiling;           /* rises, K */
    double charring;
    double vaporising;
    double least_damaging;
    double damage[DAMAGES][2]; /* logarithm of the frequency factor (1/s), activation energy over the gas constant (K) */
} Tissue;

typedef struct {
    double given, perfused, boiled; /* J */
    double vaporised;               /* m^3 */
    double hottest;                 /* K, of nodes and dry elements at the end */
    double ash;                     /* dry mass of what was vaporised, kg */
} Book;

typedef struct {
    int nodes, elements;
    const int32_t *corners;   /* (elements, 4) */
    const uint8_t *kind;      /* (elements,): number of the tissue */
    const float *conductance; /* (elements, 6): between corners 01 02 03 12 13 23, W/K */
    const float *volume;      /* (elements,): 0 of an element that is no more */
    const float *capacity;    /* (nodes,), J/K */
    const float *power;       /* (elements,), W */
    double *rise;             /* (nodes,), K: small steps of large rises add up */
    float *water;             /* (elements,): share that is left */
    float *excess;            /* (elements,): of the dry residue over the mean of the corners, K */
    float *damage;            /* (DAMAGES, elements) */
    uint8_t *stage;           /* (elements,) */
    const uint8_t *bursts;    /* (elements,): whether steam takes a dry element away, as a cutting current does */
    float *flow;              /* (2, nodes): scratch */
} Body;

static const int PAIR[6][2] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};

/* e^x for |x| < 700: that of the C library differs from one to the other. */
static double exponential(double x)
{
    double k = floor(x * 1.4426950408889634 + 0.5);
    double r = (x - k * 6.93147180369123816490e-01) - k * 1.90821492927058770002e-10, sum = 1.0;
    for (int i = 13; i > 0; i--)
        sum = 1.0 + sum * r / (double)i;
    int64_t bits = ((int64_t)k + 1023) * ((int64_t)1 << 52);
    double scale;
    memcpy(&scale, &bits, sizeof scale);
    return sum * scale;
}

/* Let the proteins and cells of an element at `rise` take damage. */
static void spoil(const Body *body, const Tissue *tissue, int e, double rise, double seconds)
{
    double kelvin = tissue->body + rise + 273.15;
    for (int d = 0; d < DAMAGES; d++) {
        double log_rate = tissue->damage[d][0] - tissue->damage[d][1] / kelvin;
        float *damage = body->damage + (size_t)d * (size_t)body->elements + e;
        float now = *damage + (float)(seconds * exponential(log_rate > 50.0 ? 50.0 : log_rate < -50.0 ? -50.0 : log_rate));
        *damage = now < LARGEST_DAMAGE ? now : LARGEST_DAMAGE;
    }
}

/* Take the power of an element into its water or its dry residue; return what goes to its corners, W. */
static float absorb(const Body *body, const Tissue *tissue, int e, float mean, float seconds, Book *book)
{
    float power = body->power[e], volume = body->volume[e];
    book->given += (double)power * (double)seconds;
    if (body->water[e] > 0.0f) {
        float full = (float)tissue->latent * volume, share = 0.5f * (mean - (float)tissue->boiling) + 1.0f;
        share = share < 0.0f ? 0.0f : share > 1.0f ? 1.0f : share; /* from 2 K below boiling */
        float wanted = share * power * seconds, left = full * body->water[e];
        float boiled = wanted < left ? wanted : left;
        body->water[e] = wanted < left ? body->water[e] - boiled / full : 0.0f;
        book->boiled += (double)boiled;
        return power - boiled / seconds;
    }
    float conductance = 0.0f, capacity = (float)tissue->residue * volume;
    for (int k = 0; k < 6; k++)
        conductance += 2.0f * body->conductance[6 * (size_t)e + k];
    float before = body->excess[e], rate = seconds * conductance / capacity;
    float now = (before + seconds * power / capacity) / (1.0f + rate); /* implicit: stable for any element */
    body->excess[e] = (double)now > SMALLEST_RISE ? now : 0.0f;
    if (mean + now > (float)tissue->charring && body->stage[e] == TISSUE)
        body->stage[e] = CHARRED;
    int is_burst = body->bursts[e] && power > 0.0f;
    if ((is_burst || mean + now > (float)tissue->vaporising) && body->stage[e] != VAPORISED) {
        body->stage[e] = VAPORISED;
        book->vaporised += (double)volume;
        book->ash += tissue->dry_mass * (double)volume;
    }
    return conductance * now;
}

/* Set the flow of heat into every node, W. */
static void set_flows(const Body *body, const Tissue *tissues, float seconds, Book *book)
{
    const double *rise = body->rise;
    float *flow = body->flow;
    memset(flow, 0, sizeof(float) * (size_t)body->nodes);
    for (int e = 0; e < body->elements; e++) {
        const int32_t *at = body->corners + 4 * (size_t)e;
        const float *conductance = body->conductance + 6 * (size_t)e;
        float T[4] = {(float)rise[at[0]], (float)rise[at[1]], (float)rise[at[2]], (float)rise[at[3]]};
        float into[4] = {0.0f, 0.0f, 0.0f, 0.0f};
        if (body->volume[e] == 0.0f || (T[0] == 0.0f && T[1] == 0.0f && T[2] == 0.0f && T[3] == 0.0f &&
                                        body->power[e] == 0.0f && body->excess[e] == 0.0f))
            continue;
        const Tissue *tissue = tissues + body->kind[e];
        float perfusion = (float)(0.25 * tissue->perfusion);
        for (int k = 0; k < 6; k++) {
            int a = PAIR[k][0], b = PAIR[k][1];
            float through = conductance[k] * (T[a] - T[b]);
            into[a] -= through, into[b] += through;
        }
        if (body->damage[body->elements + e] < 1.0f) /* dead tissue has no flow of blood */
            for (int a = 0; a < 4; a++) {
                float lost = perfusion * body->volume[e] * T[a];
                into[a] -= lost;
                book->perfused += (double)(lost * seconds);
            }
        float mean = 0.25f * ((T[0] + T[1]) + (T[2] + T[3]));
        if (body->power[e] != 0.0f || body->water[e] == 0.0f) {
            float share = 0.25f * absorb(body, tissue, e, mean, seconds, book);
            for (int a = 0; a < 4; a++)
                into[a] += share;
        }
        double own = (double)(mean + body->excess[e]);
        if (own > tissue->least_damaging)
            spoil(body, tissue, e, own, (double)seconds);
        for (int a = 0; a < 4; a++)
            flow[at[a]] += into[a];
    }
}

/* Let nodes above boiling give their heat to the water of the elements around, in shares of the volume. */
static void boil_off(const Body *body, const Tissue *tissues, Book *book)
{
    float *wet = body->flow, *taken = body->flow + body->nodes;
    memset(wet, 0, sizeof(float) * 2 * (size_t)body->nodes);
    for (int e = 0; e < body->elements; e++)
        if (body->volume[e] > 0.0f && body->water[e] > 0.0f)
            for (int a = 0; a < 4; a++)
                wet[body->corners[4 * (size_t)e + a]] += body->volume[e];
    for (int e = 0; e < body->elements; e++) {
        if (body->volume[e] == 0.0f || body->water[e] == 0.0f)
            continue;
        const Tissue *tissue = tissues + body->kind[e];
        const int32_t *at = body->corners + 4 * (size_t)e;
        float offered[4], sum = 0.0f, full = (float)tissue->latent * body->volume[e];
        for (int a = 0; a < 4; a++) {
            float above = (float)(body->rise[at[a]] - tissue->boiling);
            offered[a] = above > 0.0f ? above * body->capacity[at[a]] * (body->volume[e] / wet[at[a]]) : 0.0f;
            sum += offered[a];
        }
        if (sum == 0.0f)
            continue;
        float left = full * body->water[e], share = sum < left ? 1.0f : left / sum;
        body->water[e] = sum < left ? body->water[e] - sum / full : 0.0f;
        book->boiled += (double)(share * sum);
        for (int a = 0; a < 4; a++)
            taken[at[a]] += share * offered[a];
    }
    for (int i = 0; i < body->nodes; i++)
        if (taken[i] > 0.0f)
            body->rise[i] -= (double)(taken[i] / body->capacity[i]);
}

static void advance_body(const Body *body, const Tissue *tissues, float seconds, int sub_steps, Book *book)
{
    for (int s = 0; s < sub_steps; s++) {
        set_flows(body, tissues, seconds, book);
        double hottest = 0.0;
        for (int i = 0; i < body->nodes; i++) {
            if (body->flow[i] == 0.0f)
                continue;
            double now = body->rise[i] + (double)(seconds * body->flow[i] / body->capacity[i]);
            body->rise[i] = fabs(now) > SMALLEST_RISE ? now : 0.0;
            hottest = now > hottest ? now : hottest;
        }
        if (hottest > tissues->boiling) /* water boils alike in all tissues */
            boil_off(body, tissues, book);
    }
    book->hottest = 0.0;
    for (int i = 0; i < body->nodes; i++)
        book->hottest = body->rise[i] > book->hottest ? body->rise[i] : book->hottest;
    for (int e = 0; e < body->elements; e++)
        if (body->excess[e] > 0.0f) {
            const int32_t *at = body->corners + 4 * (size_t)e;
            double own = 0.25 * (body->rise[at[0]] + body->rise[at[1]] + body->rise[at[2]] + body->rise[at[3]]);
            book->hottest = own + (double)body->excess[e] > book->hottest ? own + (double)body->excess[e] : book->hottest;
        }
}

#define MOST_BUFFERS 13

typedef struct {
    Py_buffer view[MOST_BUFFERS];
    int count;
} Buffers;

static void release(Buffers *buffers)
{
    while (buffers->count)
        PyBuffer_Release(buffers->view + --buffers->count);
}

/* Hold the arrays of a tuple; those from number `writable` on are written. Return 0 on success. */
static int hold(Buffers *buffers, PyObject *arrays, int count, int writable)
{
    buffers->count = 0;
    for (int i = 0; i < count; i++) {
        PyObject *array = PySequence_GetItem(arrays, i);
        if (array == NULL)
            return -1;
        int failed = PyObject_GetBuffer(array, buffers->view + i, i >= writable ? PyBUF_WRITABLE : PyBUF_SIMPLE);
        Py_DECREF(array);
        if (failed)
            return -1;
        buffers->count++;
    }
    return 0;
}

PyDoc_STRVAR(advance_doc, "advance(arrays, tissues, book, seconds, sub_steps)\n--\n\n\
Advance the heat of a body by sub-steps of `seconds`; add to the book. For the arrays see `Body`.");

static PyObject *advance(PyObject *Py_UNUSED(module), PyObject *args)
{
    PyObject *arrays;
    Py_buffer tissues, book;
    float seconds;
    int sub_steps;
    if (!PyArg_ParseTuple(args, "Oy*w*fi", &arrays, &tissues, &book, &seconds, &sub_steps))
        return NULL;
    Buffers held;
    int failed = hold(&held, arrays, 13, 7);
    if (!failed && (tissues.len % sizeof(Tissue) || book.len != sizeof(Book))) {
        PyErr_SetString(PyExc_ValueError, "constants of tissue, or its book, of another length");
        failed = 1;
    }
    if (!failed) {
        Py_buffer *view = held.view;
        Body body = {(int)(view[4].len / 4), (int)(view[3].len / 4), view[0].buf, view[1].buf, view[2].buf, view[3].buf,
                     view[4].buf, view[5].buf, view[7].buf, view[8].buf, view[9].buf, view[10].buf, view[11].buf,
                     view[6].buf, view[12].buf};
        Py_BEGIN_ALLOW_THREADS;
        advance_body(&body, tissues.buf, seconds, sub_steps, book.buf);
        Py_END_ALLOW_THREADS;
    }
    release(&held);
    PyBuffer_Release(&tissues);
    PyBuffer_Release(&book);
    if (failed)
        return NULL;
    Py_RETURN_NONE;
}

/* Set the conductances of the elements and the capacities of the nodes; return the fastest rate of an element, 1/s. */
static double bind_body(int elements, const int32_t *corners, const uint8_t *kind, const float *gradients,
                        const float *volume, const Tissue *tissues, double most, float *conductance, float *capacity)
{
    double fastest = 0.0;
    for (int e = 0; e < elements; e++) {
        const Tissue *tissue = tissues + kind[e];
        double g[4][3] = {{0.0, 0.0, 0.0}}, c[6], sum = 0.0, heat = 0.25 * tissue->capacity * (double)volume[e];
        for (int a = 1; a < 4; a++)
            for (int j = 0; j < 3; j++) {
                g[a][j] = (double)gradients[9 * (size_t)e + 3 * (a - 1) + j];
                g[0][j] -= g[a][j];
            }
        for (int k = 0; k < 6; k++) {
            const double *p = g[PAIR[k][0]], *q = g[PAIR[k][1]];
            c[k] = -tissue->conductivity * (double)volume[e] * (p[0] * q[0] + p[1] * q[1] + p[2] * q[2]);
            sum += 2.0 * c[k];
        }
        double rate = heat > 0.0 ? sum / heat : 0.0, share = rate > most ? most / rate : 1.0;
        fastest = share * rate > fastest ? share * rate : fastest;
        for (int k = 0; k < 6; k++)
            conductance[6 * (size_t)e + k] = heat > 0.0 ? (float)(share * c[k]) : 0.0f;
        for (int a = 0; a < 4; a++)
            capacity[corners[4 * (size_t)e + a]] += (float)heat;
    }
    return fastest;
}

PyDoc_STRVAR(bind_doc, "bind(arrays, tissues, most)\n--\n\n\
Set conductances and capacities from (corners, kinds, gradients, volumes, conductances, capacities); return the\n\
fastest rate at which an element evens out, 1/s. A sliver evens out at the rate `most`, 1/s.");

static PyObject *bind(PyObject *Py_UNUSED(module), PyObject *args)
{
    PyObject *arrays, *found = NULL;
    Py_buffer tissues;
    double most;
    if (!PyArg_ParseTuple(args, "Oy*d", &arrays, &tissues, &most))
        return NULL;
    Buffers held;
    if (!hold(&held, arrays, 6, 4)) {
        Py_buffer *view = held.view;
        memset(view[5].buf, 0, (size_t)view[5].len);
        found = PyFloat_FromDouble(bind_body((int)(view[3].len / 4), view[0].buf, view[1].buf, view[2].buf, view[3].buf,
                                             tissues.buf, most, view[4].buf, view[5].buf));
    }
    release(&held);
    PyBuffer_Release(&tissues);
    return found;
}

/* Set in each element the volume times the square of the current's density; return their sum. */
static double spread_current(int elements, const int32_t *corners, const float *volume, const double *nodes,
                             const double *poles, int count, double reach, float *weight)
{
    double total = 0.0;
    for (int e = 0; e < elements; e++) {
        double middle[3], J[3] = {0.0, 0.0, 0.0};
        int near = 0;
        weight[e] = 0.0f;
        if (volume[e] == 0.0f)
            continue;
        const int32_t *at = corners + 4 * (size_t)e;
        for (int k = 0; k < 3; k++)
            middle[k] = 0.25 * (nodes[3 * (size_t)at[0] + k] + nodes[3 * (size_t)at[1] + k] + nodes[3 * (size_t)at[2] + k] +
                                nodes[3 * (size_t)at[3] + k]);
        for (int p = 0; p < count; p++) {
            const double *pole = poles + 5 * p; /* centre, radius, current */
            double d[3] = {middle[0] - pole[0], middle[1] - pole[1], middle[2] - pole[2]};
            double r = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]), near_r = r > pole[3] ? r : pole[3];
            double strength = pole[4] / (near_r * near_r * (r > 1e-9 ? r : 1e-9));
            near |= r < reach;
            for (int k = 0; k < 3; k++)
                J[k] += strength * d[k];
        }
        if (near) {
            weight[e] = (float)((double)volume[e] * (J[0] * J[0] + J[1] * J[1] + J[2] * J[2]));
            total += (double)weight[e];
        }
    }
    return total;
}

PyDoc_STRVAR(spread_doc, "spread(arrays, reach)\n--\n\n\
Set the weights of elements with a middle nearer than `reach` (m) to a pole, from (corners, volumes, nodes, poles,\n\
weights); return the sum of the weights. A pole has centre, radius and current.");

static PyObject *spread(PyObject *Py_UNUSED(module), PyObject *args)
{
    PyObject *arrays, *found = NULL;
    double reach;
    if (!PyArg_ParseTuple(args, "Od", &arrays, &reach))
        return NULL;
    Buffers held;
    if (!hold(&held, arrays, 5, 4)) {
        Py_buffer *view = held.view;
        found = PyFloat_FromDouble(spread_current((int)(view[1].len / 4), view[0].buf, view[1].buf, view[2].buf, view[3].buf,
                                                  (int)(view[3].len / 40), reach, view[4].buf));
    }
    release(&held);
    return found;
}

static PyMethodDef methods[] = {
    {"advance", advance, METH_VARARGS, advance_doc},
    {"bind", bind, METH_VARARGS, bind_doc},
    {"spread", spread, METH_VARARGS, spread_doc},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT,
    .m_name = "engines.fem._heat",
    .m_doc = "Heat in soft bodies; see _heat.c.",
    .m_size = -1,
    .m_methods = methods,
};

PyMODINIT_FUNC PyInit__heat(void)
{
    return PyModule_Create(&definition);
}
