// stages/formats/chart/chart.h: chart.json, a calibration chart of a powder printer.
#pragma once

#include <string>
#include <string_view>

#include "stages/data/chart.h"
#include "stages/data/status.h"

namespace lamina {

/// The chart as JSON, and back. errors  kInput: what is no chart, or has boxes outside of the image; begins with `where`
std::string chart_text(const Chart& chart);
Result<Chart> read_chart(std::string_view text, const std::string& where);

}  // namespace lamina
