#include "stages/data/handles/late.h"

#include <dlfcn.h>
#include <fmt/format.h>

namespace lamina {

Status load_library(const char* file, std::span<const LateFunction> functions) {
  void* const library = ::dlopen(file, RTLD_LAZY | RTLD_LOCAL);
  if (library == nullptr) return Error{Fault::kInternal, fmt::format("a library is missing ({}); install it", ::dlerror())};
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
