#include "stages/support/late/late.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <cerrno>
#include <cstdarg>
#include <cstdio>
#include <cstring>

#include "stages/data/shortage.h"
#include "stages/support/late/embree.h"
#include "stages/support/late/tiff.h"
#include "stages/support/late/zip.h"

namespace lamina {
namespace {

/// Orientation 0, which some programs write, is none: the default is taken.
int keep_first_message(TIFF*, void* user, const char*, const char* format, va_list arguments) {
  char text[256];
  std::vsnprintf(text, sizeof text, format, arguments);
  std::string& message = *static_cast<std::string*>(user);
  if (message.empty() && std::strstr(text, "Bad value 0 for \"Orientation\" tag") == nullptr) message = text;
  return 1;
}

/// The length of a single strip follows from the image.
int keep_warning_of_damage(TIFF* tiff, void* user, const char* module, const char* format, va_list arguments) {
  const bool harmless = std::strstr(format, "Unknown field") != nullptr ||
                        std::strstr(format, "is missing required \"StripByteCounts\" field, calc") != nullptr;
  return harmless ? 1 : keep_first_message(tiff, user, module, format, arguments);
}

}  // namespace

Status load_library(const char* file, std::span<const LateFunction> functions) {
  void* const library = ::dlopen(file, RTLD_LAZY | RTLD_LOCAL);
  if (library == nullptr) {
    const char* const reason = ::dlerror();
    // The loader reports shortages in words alone.
    if (std::strstr(reason, "Too many open files") != nullptr) return shortage(EMFILE);
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

LAMINA_LATE_LIBRARY(LAMINA_EMBREE, LAMINA_EMBREE_FILE, load_embree)
LAMINA_LATE_LIBRARY(LAMINA_ZIP, LAMINA_ZIP_FILE, load_zip)
static Status load_tiff();
LAMINA_LATE_LIBRARY(LAMINA_TIFF, LAMINA_TIFF_FILE, load_tiff)

TiffOptions strict_tiff_options(std::string& message) {
  if (const Status loaded = load_tiff(); !loaded) {
    message = loaded.error().message;
    if (loaded.error().fault == Fault::kMemory) errno = message.starts_with("out of memory") ? ENOMEM : EMFILE;
    return nullptr;
  }
  TiffOptions options(TIFFOpenOptionsAlloc());
  if (options == nullptr) return nullptr;
  TIFFOpenOptionsSetErrorHandlerExtR(options.get(), keep_first_message, &message);
  TIFFOpenOptionsSetWarningHandlerExtR(options.get(), keep_warning_of_damage, &message);
  return options;
}

}  // namespace lamina
