// stages/geometry/targets.h: functions for instruction sets that not every processor has. The rest of the program runs on any;
// callers select them with isa.h.
#pragma once

#if defined(__x86_64__)
#define LAMINA_WIDE_KERNELS 1
#define LAMINA_AVX2 __attribute__((target("avx2,bmi,bmi2,popcnt")))
#define LAMINA_AVX512 __attribute__((target("avx512f,avx512dq,avx512vl,avx512bw,bmi,bmi2,popcnt")))

/// Around bodies for AVX-512: g++ 12 says of its own header that something in it is not initialized.
#if defined(__GNUC__) && !defined(__clang__)
#define LAMINA_AVX512_BEGIN                                                            \
  _Pragma("GCC diagnostic push") _Pragma("GCC diagnostic ignored \"-Wuninitialized\"") \
      _Pragma("GCC diagnostic ignored \"-Wmaybe-uninitialized\"")
#define LAMINA_AVX512_END _Pragma("GCC diagnostic pop")
#else
#define LAMINA_AVX512_BEGIN
#define LAMINA_AVX512_END
#endif
#endif

/// A body that is compiled once for each instruction set, within the functions that have the target.
#define LAMINA_BODY __attribute__((always_inline)) inline
