// stages/segment/design/job_text.h: the job files that lamina design writes.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stages/data/extruder.h"
#include "stages/segment/settings.h"

namespace lamina::segment {

/// The last comment before the keys.
inline constexpr std::string_view kDesignedJobRuns = "# lamina extrude PART.stl --job FILE.toml -o PART.gcode\n\n";

/// The keys of a job that fills with segmented lines, as a person would write them.
/// machine  as --machine takes it
std::string designed_job_text(const std::string& machine, const ExtruderProfile& used, const Settings& keys);

/// What fills a part between two heights.
struct DesignRange {
  double from_mm = 0, to_mm = 0;
  Settings keys;
};
/// The same with ranges of heights; what lies above them is filled as the last one.
/// ranges  not empty
std::string designed_job_text(const std::string& machine, const ExtruderProfile& used, const std::vector<DesignRange>& ranges);

/// "3 to 5.7 mm", as a summary names the pores of a range.
std::string heights_text(double from_mm, double to_mm);

}  // namespace lamina::segment
