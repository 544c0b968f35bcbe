/* The point of a triangle nearest to the origin. */

static inline float dotf(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Barycentric coordinates of the point of a triangle nearest to the origin: Ericson, Real-Time Collision Detection
(2005), section 5.1.5. */
static inline void nearest(const float a[3], const float b[3], const float c[3], float share[3])
{
    float ab[3], ac[3];
    for (int i = 0; i < 3; i++)
        ab[i] = b[i] - a[i], ac[i] = c[i] - a[i];
    float d1 = -dotf(ab, a), d2 = -dotf(ac, a), d3 = -dotf(ab, b), d4 = -dotf(ac, b), d5 = -dotf(ab, c), d6 = -dotf(ac, c);
    float va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
    float along = 0.0f;
    share[0] = share[1] = share[2] = 0.0f;
    if (d1 <= 0.0f && d2 <= 0.0f)
        share[0] = 1.0f;
    else if (d3 >= 0.0f && d4 <= d3)
        share[1] = 1.0f;
    else if (vc <= 0.0f && d1 >= 0.0f && d3 <= 0.0f)
        along = d1 / (d1 - d3), share[0] = 1.0f - along, share[1] = along;
    else if (d6 >= 0.0f && d5 <= d6)
        share[2] = 1.0f;
    else if (vb <= 0.0f && d2 >= 0.0f && d6 <= 0.0f)
        along = d2 / (d2 - d6), share[0] = 1.0f - along, share[2] = along;
    else if (va <= 0.0f && d4 >= d3 && d5 >= d6)
        along = (d4 - d3) / ((d4 - d3) + (d5 - d6)), share[1] = 1.0f - along, share[2] = along;
    else {
        float all = va + vb + vc;
        share[1] = vb / all, share[2] = vc / all, share[0] = 1.0f - share[1] - share[2];
    }
}
