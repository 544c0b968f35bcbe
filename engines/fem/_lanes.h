/* Numbers of single precision side by side: one of each element of BLOCKS blocks of four.

Every operation is one of IEEE 754 on each lane, so all processors and compilers give the same bits. A `Row` has the
four numbers of one node.
*/

#if (defined(__SSE2__) || defined(_M_X64)) && !defined(TROCAR_PLAIN_LANES)
#include <emmintrin.h>

typedef __m128 Row;
#define LOAD_ROW(p) _mm_load_ps(p)
#define STORE_ROW(p, a) _mm_store_ps(p, a)
#define ADD_ROWS(a, b) _mm_add_ps(a, b)
#define LARGER_ROW(a, b) _mm_max_ps(a, b)
/* Each number between -most and most; what is no number stays. */
#define LIMITED_ROW(a, most) _mm_max_ps(_mm_set1_ps(-(most)), _mm_min_ps(_mm_set1_ps(most), a))

#ifdef FOUR_BLOCKS
#define BLOCKS 4
typedef __m512 Lanes;
#define WITH(a, p, block) _mm512_insertf32x4(a, _mm_load_ps(p), block)
#define ROWS(p, q, r, s) WITH(WITH(WITH(_mm512_castps128_ps512(_mm_load_ps(p)), q, 1), r, 2), s, 3)
#define ROW_OF(a, block)                                                                                               \
    ((block) == 0   ? _mm512_castps512_ps128(a)                                                                        \
     : (block) == 1 ? _mm512_extractf32x4_ps(a, 1)                                                                     \
     : (block) == 2 ? _mm512_extractf32x4_ps(a, 2)                                                                     \
                    : _mm512_extractf32x4_ps(a, 3))
#define LOAD_ALL(p) _mm512_loadu_ps(p)
#define STORE_ALL(p, a) _mm512_storeu_ps(p, a)
#define ALL(x) _mm512_set1_ps(x)
#define ADD(a, b) _mm512_add_ps(a, b)
#define SUB(a, b) _mm512_sub_ps(a, b)
#define MUL(a, b) _mm512_mul_ps(a, b)
#define DIV(a, b) _mm512_div_ps(a, b)
#define LOW_PAIRS(a, b) _mm512_unpacklo_ps(a, b)
#define HIGH_PAIRS(a, b) _mm512_unpackhi_ps(a, b)
#define FIRST_HALVES(a, b) _mm512_shuffle_ps(a, b, 0x44)
#define LAST_HALVES(a, b) _mm512_shuffle_ps(a, b, 0xee)

#elif defined(TWO_BLOCKS)
#define BLOCKS 2
typedef __m256 Lanes;
#define ROWS(p, q, r, s) _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_load_ps(p)), _mm_load_ps(q), 1)
#define ROW_OF(a, block) ((block) ? _mm256_extractf128_ps(a, 1) : _mm256_castps256_ps128(a))
#define ALL(x) _mm256_set1_ps(x)
#define ADD(a, b) _mm256_add_ps(a, b)
#define SUB(a, b) _mm256_sub_ps(a, b)
#define MUL(a, b) _mm256_mul_ps(a, b)
#define DIV(a, b) _mm256_div_ps(a, b)
#define LOAD_ALL(p) _mm256_loadu_ps(p)
#define STORE_ALL(p, a) _mm256_storeu_ps(p, a)
#define LOW_PAIRS(a, b) _mm256_unpacklo_ps(a, b)
#define HIGH_PAIRS(a, b) _mm256_unpackhi_ps(a, b)
#define FIRST_HALVES(a, b) _mm256_shuffle_ps(a, b, 0x44)
#define LAST_HALVES(a, b) _mm256_shuffle_ps(a, b, 0xee)

#else

#define BLOCKS 1
typedef __m128 Lanes;
#define ROWS(p, q, r, s) _mm_load_ps(p)
#define ROW_OF(a, block) (a)
#define LOAD_ALL(p) _mm_load_ps(p)
#define STORE_ALL(p, a) _mm_store_ps(p, a)
#define ALL(x) _mm_set1_ps(x)
#define ADD(a, b) _mm_add_ps(a, b)
#define SUB(a, b) _mm_sub_ps(a, b)
#define MUL(a, b) _mm_mul_ps(a, b)
#define DIV(a, b) _mm_div_ps(a, b)
#define LOW_PAIRS(a, b) _mm_unpacklo_ps(a, b)
#define HIGH_PAIRS(a, b) _mm_unpackhi_ps(a, b)
#define FIRST_HALVES(a, b) _mm_shuffle_ps(a, b, 0x44)
#define LAST_HALVES(a, b) _mm_shuffle_ps(a, b, 0xee)
#endif

#define TRANSPOSE(a, b, c, d)                                                                                          \
    do {                                                                                                               \
        Lanes e_ = LOW_PAIRS(a, b), f_ = HIGH_PAIRS(a, b), g_ = LOW_PAIRS(c, d), h_ = HIGH_PAIRS(c, d);                \
        (a) = FIRST_HALVES(e_, g_), (b) = LAST_HALVES(e_, g_);                                                         \
        (c) = FIRST_HALVES(f_, h_), (d) = LAST_HALVES(f_, h_);                                                         \
    } while (0)
/* The last numbers of four rows. */
#define LAST(a, b, c, d) LAST_HALVES(HIGH_PAIRS(a, b), HIGH_PAIRS(c, d))

#else

typedef struct {
    float at[4];
} Lanes;
typedef Lanes Row;

#define BLOCKS 1

static inline Lanes LOAD_ROW(const float *p)
{
    Lanes r = {{p[0], p[1], p[2], p[3]}};
    return r;
}

static inline void STORE_ROW(float *p, Lanes a)
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
#define ROWS(p, q, r, s) LOAD_ROW(p)
#define ROW_OF(a, block) (a)
#define LOAD_ALL(p) LOAD_ROW(p)
#define STORE_ALL(p, a) STORE_ROW(p, a)
#define ADD_ROWS(a, b) ADD(a, b)

static inline Lanes LARGER_ROW(Lanes a, Lanes b)
{
    for (int i = 0; i < 4; i++)
        b.at[i] = a.at[i] > b.at[i] ? a.at[i] : b.at[i];
    return b;
}

static inline Lanes LIMITED_ROW(Lanes a, float most)
{
    for (int i = 0; i < 4; i++)
        a.at[i] = a.at[i] > most ? most : a.at[i] < -most ? -most : a.at[i];
    return a;
}

static inline Lanes LAST(Lanes a, Lanes b, Lanes c, Lanes d)
{
    Lanes r = {{a.at[3], b.at[3], c.at[3], d.at[3]}};
    return r;
}

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

/* Load number `k` of every element of the blocks from `b` on, which have `size` numbers each. */
static inline Lanes load(const float *values, int b, int size, int k)
{
    const float *p = values + 4 * ((size_t)size * (size_t)b + (size_t)k);
    return ROWS(p, p + 4 * size, p + 8 * size, p + 12 * size);
}

static inline void store(float *values, int b, int size, int k, Lanes a)
{
    float *p = values + 4 * ((size_t)size * (size_t)b + (size_t)k);
    for (int block = 0; block < BLOCKS; block++)
        STORE_ROW(p + 4 * size * block, ROW_OF(a, block));
}

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
