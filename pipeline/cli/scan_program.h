// pipeline/cli/scan_program.h: asks lamina-scan, which has a package of its own.
#pragma once

#include <string>

#include "stages/data/status.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

/// What lamina-scan sees, as JSON; its picture goes to a file, if one is named.
/// errors  of lamina-scan; kUsage: it is not installed; kOutput
Result<std::string> scanned(const std::string& what, const Json& request, const std::string& picture);

}  // namespace lamina::pipeline
