// pipeline/cli/plot_file.h: --plot FILE of the commands that draw one.
#pragma once

#include <string>

#include "stages/data/picture/plot.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// Whether a plot can have this name: empty, or .svg or .png in a folder that there is. errors  kUsage, kOutput
Status check_plot_name(const std::string& path);

/// Writes an .svg, or a .png that lamina-preview draws. errors  kOutput; kInternal: no such program
Status write_plot(const std::string& path, const Plot& plot);

}  // namespace lamina::pipeline
