/* The faces of a body near spheres, the nearest points of the faces, and what of it a press needs.

`closest_on_faces` and `sum_at_nodes` have the bits of engines/tissue/probes/place.py and near_faces.py: the sums of three
products that numpy's einsum forms begin with the first and the last.
*/

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

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

/* Get the numbers of an array of 64-bit integers; return -1 with an error for another type. */
static int get_integers(PyObject *array, Py_buffer *buffer)
{
    if (PyObject_GetBuffer(array, buffer, PyBUF_FORMAT | PyBUF_C_CONTIGUOUS))
        return -1;
    if (buffer->itemsize == 8 && buffer->format && strchr("lq", buffer->format[0]))
        return 0;
    PyErr_Format(PyExc_TypeError, "faces are of type int64, not '%s' in the buffer protocol", buffer->format);
    PyBuffer_Release(buffer);
    return -1;
}

PyObject *find_near_faces(PyObject *Py_UNUSED(module), PyObject *args)
{
    Py_buffer centres, reach, nodes, faces, spheres, near, weights, distances;
    PyObject *corners = PyTuple_GET_SIZE(args) > 3 ? PyTuple_GET_ITEM(args, 3) : Py_None, *unused;
    if (get_integers(corners, &faces))
        return NULL;
    if (!PyArg_ParseTuple(args, "y*y*y*Ow*w*w*w*", &centres, &reach, &nodes, &unused, &spheres, &near, &weights,
                          &distances)) {
        PyBuffer_Release(&faces);
        return NULL;
    }
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

static double dot_like_einsum(const double *a, const double *b)
{
    return (a[0] * b[0] + a[2] * b[2]) + a[1] * b[1];
}

static void cross3(const double *a, const double *b, double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

/* Barycentric coordinates of the point of a face nearest to `point`, and the distance; with `normal`, a unit vector. */
static double closest_on_face(const double *point, const double *corner, double weight[3], double normal[3])
{
    double edge[3][3], from[3][3], c[3], area[3], product[3], candidate[4][3] = {{0.0}}, best = INFINITY;
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++) {
            edge[k][i] = corner[3 * ((k + 1) % 3) + i] - corner[3 * k + i];
            from[k][i] = point[i] - corner[3 * k + i];
        }
    for (int i = 0; i < 3; i++)
        c[i] = corner[6 + i] - corner[i];
    cross3(edge[0], c, area);
    double square = dot_like_einsum(area, area);
    cross3(edge[0], from[0], product);
    double on_c = dot_like_einsum(product, area) / square;
    cross3(from[0], c, product);
    double on_b = dot_like_einsum(product, area) / square;
    candidate[0][0] = 1.0 - on_b - on_c, candidate[0][1] = on_b, candidate[0][2] = on_c;
    for (int k = 0; k < 3; k++) {
        double along = dot_like_einsum(from[k], edge[k]) / dot_like_einsum(edge[k], edge[k]);
        along = along > 0.0 ? along : 0.0;
        along = along < 1.0 ? along : 1.0;
        candidate[k + 1][k] = 1.0 - along, candidate[k + 1][(k + 1) % 3] = along;
    }
    int is_inside = candidate[0][0] >= 0.0 && on_b >= 0.0 && on_c >= 0.0, found = 1;
    for (int k = is_inside ? 0 : 1; k < 4; k++) {
        double away[3];
        for (int i = 0; i < 3; i++) {
            double at = candidate[k][0] * corner[i] + candidate[k][1] * corner[3 + i];
            away[i] = at + candidate[k][2] * corner[6 + i] - point[i];
        }
        double distance = sqrt(away[0] * away[0] + away[1] * away[1] + away[2] * away[2]);
        if (distance < best)
            best = distance, found = k;
    }
    memcpy(weight, candidate[found], 3 * sizeof(double));
    double size = sqrt(area[0] * area[0] + area[1] * area[1] + area[2] * area[2]);
    for (int i = 0; i < 3; i++)
        normal[i] = area[i] / size;
    return best;
}

const char closest_on_faces_doc[] = "closest_on_faces(point, corners, weights, distances, normals)\n--\n\n\
Write barycentric coordinates and distances of the points of faces nearest to `point`, and the faces' normals.";

PyObject *closest_on_faces(PyObject *Py_UNUSED(module), PyObject *args)
{
    Py_buffer point, corners, weights, distances, normals;
    if (!PyArg_ParseTuple(args, "y*y*w*w*w*", &point, &corners, &weights, &distances, &normals))
        return NULL;
    for (Py_ssize_t f = 0; f < distances.len / 8; f++)
        ((double *)distances.buf)[f] = closest_on_face(point.buf, (const double *)corners.buf + 9 * f,
                                                       (double *)weights.buf + 3 * f, (double *)normals.buf + 3 * f);
    PyBuffer_Release(&point);
    PyBuffer_Release(&corners);
    PyBuffer_Release(&weights);
    PyBuffer_Release(&distances);
    PyBuffer_Release(&normals);
    Py_RETURN_NONE;
}

/* Add parts at a node to those of the nodes found so far, in ascending order; return how many there are now. */
static Py_ssize_t add_part(int64_t *nodes, double *parts, Py_ssize_t count, int64_t node, double part, double first_part)
{
    Py_ssize_t k = count;
    while (k > 0 && nodes[k - 1] > node)
        k--;
    if (k == 0 || nodes[k - 1] != node) {
        memmove(nodes + k + 1, nodes + k, sizeof(int64_t) * (size_t)(count - k));
        memmove(parts + 2 * (k + 1), parts + 2 * k, 2 * sizeof(double) * (size_t)(count - k));
        nodes[k] = node, parts[2 * k] = parts[2 * k + 1] = 0.0;
        k++, count++;
    }
    parts[2 * k - 2] += part, parts[2 * k - 1] += first_part;
    return count;
}

const char sum_at_nodes_doc[] = "sum_at_nodes(faces, weights, first, first_weights, nodes, parts)\n--\n\n\
Write the nodes of the faces, ascending, the sums of their weights, and those of the face `first` alone, shape (k, 2);\n\
return their number.";

PyObject *sum_at_nodes(PyObject *Py_UNUSED(module), PyObject *args)
{
    Py_buffer faces, weights, first_weights, nodes, parts;
    Py_ssize_t first, count = 0;
    if (!PyArg_ParseTuple(args, "y*y*ny*w*w*", &faces, &weights, &first, &first_weights, &nodes, &parts))
        return NULL;
    for (Py_ssize_t k = 0; k < faces.len / 8; k++)
        count = add_part(nodes.buf, parts.buf, count, ((const int64_t *)faces.buf)[k], ((const double *)weights.buf)[k],
                         k / 3 == first ? ((const double *)first_weights.buf)[k % 3] : 0.0);
    PyBuffer_Release(&faces);
    PyBuffer_Release(&weights);
    PyBuffer_Release(&first_weights);
    PyBuffer_Release(&nodes);
    PyBuffer_Release(&parts);
    return PyLong_FromSsize_t(count);
}
