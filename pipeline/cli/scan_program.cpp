#include "pipeline/cli/scan_program.h"

#include "stages/support/io/file.h"
#include "stages/support/io/other_program.h"

namespace lamina::pipeline {

Result<std::string> scanned(const std::string& what, const Json& request, const std::string& picture) {
  auto text = filter("lamina-scan", what, json_line(request));
  if (!text && text.error().message.starts_with("lamina-scan: "))
    return Error{Fault::kUsage, "photographs are read by lamina-scan, which is not installed; install the package lamina-scan"};
  if (!text) return text;
  const std::size_t end = text->find('\n') + 1;
  if (!picture.empty()) {
    if (Status status = write_file(picture, std::string_view(*text).substr(end)); !status) return status.error();
  }
  return text->substr(0, end);
}

}  // namespace lamina::pipeline
