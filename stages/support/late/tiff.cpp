#include "stages/support/late/tiff.h"

#include <cstdarg>
#include <cstdio>
#include <cstring>

namespace lamina {

static Status load_tiff();
LAMINA_LATE_LIBRARY(LAMINA_TIFF, LAMINA_TIFF_FILE, load_tiff)

namespace {

int keep_first_message(TIFF*, void* user, const char*, const char* format, va_list arguments) {
  std::string& message = *static_cast<std::string*>(user);
  if (!message.empty()) return 1;
  char text[256];
  std::vsnprintf(text, sizeof text, format, arguments);
  message = text;
  return 1;
}

int keep_warning_of_damage(TIFF* tiff, void* user, const char* module, const char* format, va_list arguments) {
  const bool harmless = std::strstr(format, "Unknown field") != nullptr;
  return harmless ? 1 : keep_first_message(tiff, user, module, format, arguments);
}

}  // namespace

TiffOptions strict_tiff_options(std::string& message) {
  if (const Status loaded = load_tiff(); !loaded) {
    if (loaded.error().fault != Fault::kMemory) message = loaded.error().message;
    return nullptr;
  }
  TiffOptions options(TIFFOpenOptionsAlloc());
  if (options == nullptr) return nullptr;
  TIFFOpenOptionsSetErrorHandlerExtR(options.get(), keep_first_message, &message);
  TIFFOpenOptionsSetWarningHandlerExtR(options.get(), keep_warning_of_damage, &message);
  return options;
}

}  // namespace lamina
