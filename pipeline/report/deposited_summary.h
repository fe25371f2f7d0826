// pipeline/report/deposited_summary.h: what toolpaths of segmented lines deposit, as lines of a summary and as JSON.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "stages/data/extruder.h"
#include "stages/data/toolpaths.h"
#include "stages/segment/predict.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

/// The layers of a range of heights with segmented lines.
struct DepositedRange {
  std::string heights;  // "3 to 5.7 mm", above the bottoms of parts, "" for all
  PoreCounts pores;
  double area_mm2 = 0;  // within the contours, over all layers
};

/// Lines of a summary: name, text.
using Lines = std::vector<std::pair<std::string, std::string>>;

/// Adds stretches, porosity, pores and speeds that are not reached to a summary, and the same numbers to its object.
/// sums    of the job. points_first_layer  of segmented lines in its first layer
void report_deposited(const DepositedSums& sums, const std::vector<DepositedRange>& ranges, const Extruder& machine,
                      std::uint64_t points_first_layer, Lines& lines, Json& facts);

/// What 100 % of extrusion is, and how many layers are left out at the top, before anything is laid; as above.
/// cut_at  "middle" or "top", the place of a layer that decides whether it is empty
void report_bead(const Extruder& machine, std::uint32_t left_out, std::string_view cut_at, Lines& lines, Json& facts);

/// "612 stretches are too short for 400 mm/s2: ..." if most of the speed is missed; else "".
std::string speed_warning(const ShortIntervals& shorts, const Extruder& machine);

}  // namespace lamina::pipeline
