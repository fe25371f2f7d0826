// stages/formats/plot/plot.h: plots as SVG, and as JSON for the PNG renderer (picture/).
#pragma once

#include <string>
#include <string_view>

#include "stages/data/plot.h"
#include "stages/data/status.h"

namespace lamina::formats {

/// An SVG file.
std::string plot_svg(const Plot& plot);

/// One JSON object.
std::string plot_json(const Plot& plot);

/// Parses that JSON. errors  kUsage
Result<Plot> read_plot(std::string_view json);

}  // namespace lamina::formats
