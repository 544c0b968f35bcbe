/* Faces near spheres; see _near.c. */

extern const char near_faces_doc[];
PyObject *find_near_faces(PyObject *module, PyObject *args);
