/* The faces of a body near spheres, and the nearest points of the faces. */

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>
#include <stdint.h>

#include "_near.h"
#include "_triangle.h"

const char near_faces_doc[] = "near_faces(centres, reach, nodes, faces, spheres, near, weights, distances)\n--\n\n\
Write the pairs of a sphere and a face nearer than the sphere's reach, in the order of the spheres, then of the faces;\n\
return their number. Only so many are written as there is room in `spheres`.";

/* Weights of the nearest point of a face, and its distance from the centre; `INFINITY` beyond the reach. */
static double nearest_point(const double *centre, double reach, const double *nodes, const int64_t *face, float weight[3])
{
    float x[3][3];
    for (int i = 0; i < 3; i++) {
        double a = nodes[3 * face[0] + i] - centre[i], b = nodes[3 * face[1] + i] - centre[i];
        double c = nodes[3 * face[2] + i] - centre[i];
        if ((a > reach && b > reach && c > reach) || (a < -reach && b < -reach && c < -reach))
            return INFINITY;
        x[0][i] = (float)a, x[1][i] = (float)b, x[2][i] = (float)c;
    }
    nearest(x[0], x[1], x[2], weight);
    float square = 0.0f;
    for (int i = 0; i < 3; i++) {
        float away = weight[0] * x[0][i] + weight[1] * x[1][i] + weight[2] * x[2][i];
        square += away * away;
    }
    double distance = sqrt((double)square);
    return distance < reach ? distance : INFINITY;
}

PyObject *find_near_faces(PyObject *Py_UNUSED(module), PyObject *args)
{
    Py_buffer centres, reach, nodes, faces, spheres, near, weights, distances;
    if (!PyArg_ParseTuple(args, "y*y*y*y*w*w*w*w*", &centres, &reach, &nodes, &faces, &spheres, &near, &weights, &distances))
        return NULL;
    int64_t found = 0, room = (int64_t)(spheres.len / 8);
    for (int64_t s = 0; s < (int64_t)(reach.len / 8); s++)
        for (int64_t f = 0; f < (int64_t)(faces.len / 24); f++) {
            const int64_t *face = (const int64_t *)faces.buf + 3 * f;
            float weight[3];
            double distance = nearest_point((const double *)centres.buf + 3 * s, ((const double *)reach.buf)[s], nodes.buf,
                                            face, weight);
            if (isinf(distance))
                continue;
            if (found < room) {
                ((int64_t *)spheres.buf)[found] = s;
                ((double *)distances.buf)[found] = distance;
                for (int a = 0; a < 3; a++) {
                    ((int64_t *)near.buf)[3 * found + a] = face[a];
                    ((double *)weights.buf)[3 * found + a] = (double)weight[a];
                }
            }
            found++;
        }
    PyBuffer_Release(&centres);
    PyBuffer_Release(&reach);
    PyBuffer_Release(&nodes);
    PyBuffer_Release(&faces);
    PyBuffer_Release(&spheres);
    PyBuffer_Release(&near);
    PyBuffer_Release(&weights);
    PyBuffer_Release(&distances);
    return PyLong_FromLongLong(found);
}
