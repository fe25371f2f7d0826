// stages/support/late/late.h: shared libraries that are loaded when a job first needs them.
//
// A program that is linked with Embree, libzip and libtiff loads them, and the ten libraries that these name, before its first
// line: most of the processor time of a small job. The headers beside this one declare, in namespace lamina, a pointer for each
// function that is used, of the function's own name: calls within the namespace mean it, and read as if it were linked.
#pragma once

#include <initializer_list>
#include <span>

#include "stages/data/status.h"

namespace lamina {

struct LateFunction {
  const char* name;
  void (*put)(void* address);  // into the pointer
};

/// Loads a library for good and finds its functions; whoever else loads or links it shares it.
///
/// file    as linking would have written it down: libzip.so.4
/// errors  kInternal: it is not installed, or another one than was compiled with; kMemory
Status load_library(const char* file, std::span<const LateFunction> functions);

}  // namespace lamina

/// For the lists of functions: the pointer's declaration, its definition, and what load_library() asks for.
#define LAMINA_LATE_DECLARED(function) extern decltype(&::function) function;
#define LAMINA_LATE_DEFINED(function) decltype(&::function) function = nullptr;
#define LAMINA_LATE_NAMED(function) \
  {#function, [](void* address) { function = reinterpret_cast<decltype(&::function)>(address); }},

/// For a list of functions: the definition of their pointers, and of the function that loads the library, once.
#define LAMINA_LATE_LIBRARY(functions, file, load)                                                                      \
  functions(LAMINA_LATE_DEFINED) Status load() {                                                                        \
    static const Status loaded = load_library(file, std::initializer_list<LateFunction>{functions(LAMINA_LATE_NAMED)}); \
    return loaded;                                                                                                      \
  }
