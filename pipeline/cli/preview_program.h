// pipeline/cli/preview_program.h: lamina-preview, which makes pictures with libraries that no other command should load.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stages/data/status.h"

namespace lamina::pipeline {

/// Hands the process over to the program. Returns only if it cannot be started.
Error hand_over_to_preview(const std::vector<std::string>& arguments);

/// Runs the program as a filter: `input` on its standard input.
/// returns what it writes to standard output; if it fails, that is its error. errors  kInternal: it cannot be started
Result<std::string> filter_by_preview(const std::string& argument, std::string_view input);

}  // namespace lamina::pipeline
