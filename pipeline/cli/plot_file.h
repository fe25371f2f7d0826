// pipeline/cli/plot_file.h: the option --plot FILE.
#pragma once

#include <string>

#include "stages/data/plot.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// Checks a plot's name: empty, or .svg or .png in an existing folder. errors  kUsage, kOutput
Status check_plot_name(const std::string& path);

/// The content of such a file. errors  kInternal: lamina-preview is missing
Result<std::string> plot_text(const std::string& path, const Plot& plot);

/// Writes an .svg, or a .png drawn by lamina-preview. errors  kOutput; kInternal: lamina-preview is missing
Status write_plot(const std::string& path, const Plot& plot);

}  // namespace lamina::pipeline
