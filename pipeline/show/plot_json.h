// pipeline/show/plot_json.h: a plot as text, for the program that draws it as PNG.
#pragma once

#include <string>
#include <string_view>

#include "stages/data/status.h"
#include "stages/write/plot.h"

namespace lamina::pipeline {

/// One JSON object.
std::string plot_json(const write::Plot& plot);

/// The same back. errors  kUsage
Result<write::Plot> read_plot(std::string_view json);

}  // namespace lamina::pipeline
