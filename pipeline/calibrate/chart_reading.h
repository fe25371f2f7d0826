// pipeline/calibrate/chart_reading.h: the readings of lamina-scan from a chart, as keys of a machine profile.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stages/data/chart.h"
#include "stages/data/machine.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// Takes over what was read: head.blocked, head.row_offset_um and head.dot_gain_um. Nozzles that the chart does not have, for
/// the controller cannot fire them, stay blocked. Rows are told apart where the head has several. Offsets that cannot be told
/// change nothing; their number is told.
/// reading  JSON of lamina-scan
/// chart    that was read
/// machine  that printed the chart, changed
/// returns  lines for people
/// errors   kInternal: no such reading
Result<std::vector<std::string>> take_over(std::string_view reading, const Chart& chart, Machine& machine);

/// Per cent of the voids that drops on so many per cent of the pixels fill; 0 if the layer's thickness is not known.
double saturation_of(double pixels_percent, const Chart& chart, const Machine& machine);

}  // namespace lamina::pipeline
