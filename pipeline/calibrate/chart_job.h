// pipeline/calibrate/chart_job.h: charts and counted drops as print jobs, their readings, and the profile that follows from
// them.
#pragma once

#include <atomic>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/machine/profiles.h"
#include "pipeline/report/summary.h"
#include "stages/data/chart.h"
#include "stages/data/machine.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

struct ChartRequest {
  std::string machine, directory;  // as --machine and -o take them
  std::uint64_t drops = 0;         // to be weighed; 0: a chart
  double layer_mm = 0.1;
  bool overwrite = false;
};

/// Writes DIR/images, DIR/machine.toml, DIR/print (as lamina jet does) and, last, DIR/chart.json or DIR/drops.json.
/// errors  kUsage: that file is there already, without overwrite; no room on the bed; kOutput; those of run
Result<Summary> write_chart_job(const ChartRequest& request, const std::atomic<bool>& cancel);

/// A profile's file with what was measured. errors  kInput: the measurements make it invalid
Result<std::string> measured_profile(const Machine& machine);

/// Takes over what was read: head.blocked, head.row_offset_um and head.dot_gain_um. Nozzles that the chart does not have, for
/// the controller cannot fire them, stay blocked. Rows are distinguished if the head has several. Uncertain offsets
/// change nothing; their number is reported.
/// reading  JSON of lamina-scan
/// chart    that was read
/// machine  that printed the chart, changed
/// returns  lines for people
/// errors   kInternal: no such reading
Result<std::vector<std::string>> take_over(std::string_view reading, const Chart& chart, Machine& machine);

/// Per cent of the voids that drops on so many per cent of the pixels fill; 0 if the layer's thickness is not known.
double saturation_of(double pixels_percent, const Chart& chart, const Machine& machine);

}  // namespace lamina::pipeline
