/* Faces near spheres; see _near.c. */

extern const char near_faces_doc[], closest_on_faces_doc[], sum_at_nodes_doc[];
PyObject *find_near_faces(PyObject *module, PyObject *args);
PyObject *closest_on_faces(PyObject *module, PyObject *args);
PyObject *sum_at_nodes(PyObject *module, PyObject *args);
