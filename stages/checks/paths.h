// stages/checks/paths.h: warnings of contours and toolpaths, reported by layers.
//
// codes   chains-open  cuts of layers stay open
//         undivided    segmented lines are too short for the requested pores
//         no-bead      none fits
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/layer.h"
#include "stages/data/status.h"

namespace lamina::checks {

/// Counts the layers with a fault and names the first.
struct ReportedLayers {
  std::uint32_t count = 0;
  std::string first;  // "layer 12 at z 0.300 mm"
  std::uint32_t index = 0;
  double z_mm = 0;
  void add(const Layer& layer);
  /// Only if there are any.
  void warn(std::string_view code, std::string text, std::vector<Warning>& warnings) const;
};

/// What toolpaths lack.
struct PathWarnings {
  ReportedLayers open, undivided;

  /// A layer's open chains of cuts, its segmented lines and its thin stretches.
  void add(const Layer& layer, std::uint64_t open_chains, std::uint64_t lines, std::uint64_t thin);
  /// fills  whether walls or lines are requested. moves  of the parts, of all layers. layers  of the job
  void report(bool fills, std::uint64_t moves, std::uint32_t layers, std::vector<Warning>& warnings) const;
};

}  // namespace lamina::checks
