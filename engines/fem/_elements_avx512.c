/* Forces of the elements of four blocks at a time, for processors with AVX-512: the same bits in less time. */

#include "_solid.h"

#ifdef HAS_AVX
#include <immintrin.h>
#ifdef __clang__
#pragma clang attribute push(__attribute__((target("avx512f"))), apply_to = function)
#else
#pragma GCC target("avx512f")
#endif
#define FOUR_BLOCKS
#define add_volumes add_volumes_avx512
#define add_forces add_forces_avx512
#include "_lanes.h"
#include "_forces.h"
#ifdef __clang__
#pragma clang attribute pop
#endif
#endif
