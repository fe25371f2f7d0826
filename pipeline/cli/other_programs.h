// pipeline/cli/other_programs.h: what lamina-preview and lamina-scan make, which have packages of their own.
#pragma once

#include <string>

#include "stages/data/plot.h"
#include "stages/data/status.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

// --- the option --plot FILE
/// Checks a plot's name: empty, or .svg or .png in an existing folder. errors  kUsage, kOutput
Status check_plot_name(const std::string& path);

/// The content of such a file. errors  kInternal: lamina-preview is missing
Result<std::string> plot_text(const std::string& path, const Plot& plot);

/// Writes an .svg, or a .png drawn by lamina-preview. errors  kOutput; kInternal: lamina-preview is missing
Status write_plot(const std::string& path, const Plot& plot);

// --- photographs
/// What lamina-scan sees, as JSON; its picture goes to a file, if one is named.
/// errors  of lamina-scan; kUsage: it is not installed; kOutput
Result<std::string> scanned(const std::string& what, const Json& request, const std::string& picture);

}  // namespace lamina::pipeline
