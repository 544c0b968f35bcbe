/* Vectors of three numbers in double precision. */

static inline double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void cross(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

/* Scale to length 1; return 0 for no direction. */
static inline int normalise(double v[3])
{
    double size = sqrt(dot(v, v));
    if (size == 0.0)
        return 0;
    for (int i = 0; i < 3; i++)
        v[i] /= size;
    return 1;
}

static inline double distance(const double a[3], const double b[3])
{
    double off[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    return sqrt(dot(off, off));
}
