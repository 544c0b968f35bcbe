/* Forces of the elements of two blocks at a time, for processors with AVX: the same bits in less time. */

#include "_solid.h"

#ifdef HAS_AVX
#include <immintrin.h>
#ifdef __clang__
#pragma clang attribute push(__attribute__((target("avx"))), apply_to = function)
#else
#pragma GCC target("avx")
#endif
#define TWO_BLOCKS
#define add_volumes add_volumes_avx
#define add_forces add_forces_avx
#include "_lanes.h"
#include "_forces.h"
#ifdef __clang__
#pragma clang attribute pop
#endif
#endif
