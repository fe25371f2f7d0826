// pipeline/calibrate/chart_job.h: charts and counted drops as print jobs, and the profile that follows from them.
#pragma once

#include <atomic>
#include <string>

#include "pipeline/machine/profiles.h"
#include "pipeline/report/summary.h"
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

}  // namespace lamina::pipeline
