// stages/geometry/targets.h: functions for instruction sets that not every processor has. The rest of the program runs on any;
// who calls them asks isa.h.
#pragma once

#if defined(__x86_64__)
#define LAMINA_WIDE_KERNELS 1
#define LAMINA_AVX2 __attribute__((target("avx2,bmi,bmi2,popcnt")))
#define LAMINA_AVX512 __attribute__((target("avx512f,avx512dq,avx512vl,avx512bw,bmi,bmi2,popcnt")))
#endif

/// A body that is compiled once for each instruction set, within the functions that have the target.
#define LAMINA_BODY __attribute__((always_inline)) inline
