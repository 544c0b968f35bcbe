/* Four numbers of single precision side by side: one of each of four elements.

Every operation is one of IEEE 754 on each lane, so all processors and compilers give the same bits.
*/

#if (defined(__SSE2__) || defined(_M_X64)) && !defined(TROCAR_PLAIN_LANES)
#include <emmintrin.h>

typedef __m128 Lanes;
#define LOAD(p) _mm_load_ps(p)
#define STORE(p, a) _mm_store_ps(p, a)
#define ALL(x) _mm_set1_ps(x)
#define ADD(a, b) _mm_add_ps(a, b)
#define SUB(a, b) _mm_sub_ps(a, b)
#define MUL(a, b) _mm_mul_ps(a, b)
#define DIV(a, b) _mm_div_ps(a, b)
#define TRANSPOSE(a, b, c, d) _MM_TRANSPOSE4_PS(a, b, c, d)

#else

typedef struct {
    float at[4];
} Lanes;

static inline Lanes LOAD(const float *p)
{
    Lanes r = {{p[0], p[1], p[2], p[3]}};
    return r;
}

static inline void STORE(float *p, Lanes a)
{
    for (int i = 0; i < 4; i++)
        p[i] = a.at[i];
}

static inline Lanes ALL(float x)
{
    Lanes r = {{x, x, x, x}};
    return r;
}

#define LANEWISE(name, operation)                                                                                      \
    static inline Lanes name(Lanes a, Lanes b)                                                                         \
    {                                                                                                                  \
        for (int i = 0; i < 4; i++)                                                                                    \
            a.at[i] = a.at[i] operation b.at[i];                                                                       \
        return a;                                                                                                      \
    }
LANEWISE(ADD, +)
LANEWISE(SUB, -)
LANEWISE(MUL, *)
LANEWISE(DIV, /)

#define TRANSPOSE(a, b, c, d)                                                                                          \
    do {                                                                                                               \
        Lanes rows_[4] = {a, b, c, d};                                                                                 \
        for (int i_ = 0; i_ < 4; i_++) {                                                                               \
            (a).at[i_] = rows_[i_].at[0];                                                                              \
            (b).at[i_] = rows_[i_].at[1];                                                                              \
            (c).at[i_] = rows_[i_].at[2];                                                                              \
            (d).at[i_] = rows_[i_].at[3];                                                                              \
        }                                                                                                              \
    } while (0)
#endif

/* a b - c d */
static inline Lanes minor(Lanes a, Lanes b, Lanes c, Lanes d)
{
    return SUB(MUL(a, b), MUL(c, d));
}

/* a b + c d + e f */
static inline Lanes dot3(Lanes a, Lanes b, Lanes c, Lanes d, Lanes e, Lanes f)
{
    return ADD(ADD(MUL(a, b), MUL(c, d)), MUL(e, f));
}
