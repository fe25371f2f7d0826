#include "stages/support/late/late.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <cstring>

namespace lamina {

Status load_library(const char* file, std::span<const LateFunction> functions) {
  void* const library = ::dlopen(file, RTLD_LAZY | RTLD_LOCAL);
  if (library == nullptr) {
    const char* const reason = ::dlerror();
    // The loader tells of memory in words alone.
    for (const char* words : {"failed to map", "cannot map", "annot allocate", "cannot create"}) {
      if (std::strstr(reason, words) != nullptr) return out_of_memory();
    }
    return Error{Fault::kInternal, fmt::format("a library is missing ({}); install it", reason)};
  }
  for (const LateFunction& function : functions) {
    void* const address = ::dlsym(library, function.name);
    function.put(address);
    if (address == nullptr)
      return Error{Fault::kInternal,
                   fmt::format("{} has no {}; install the version that lamina was built with", file, function.name)};
  }
  return {};
}

}  // namespace lamina
