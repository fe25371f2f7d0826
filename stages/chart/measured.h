// stages/chart/measured.h: what lamina-scan read off a chart, in the words of a profile.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stages/data/machine.h"
#include "stages/data/status.h"

namespace lamina::chart {

/// Takes over what was read: head.blocked, head.row_offset_um and head.dot_gain_um. Nozzles that the chart does not have, for
/// the controller cannot fire them, stay blocked. Rows are told apart where the head has several. reading  JSON of lamina-scan
/// machine  that printed the chart, changed
/// returns  lines for people
/// errors   kInput: no such reading
Result<std::vector<std::string>> take_over(std::string_view reading, Machine& machine);

}  // namespace lamina::chart
