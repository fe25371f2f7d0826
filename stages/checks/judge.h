// stages/checks/judge.h: what layers hold against what the meshes hold.
//
// codes   part-lost     a solid of which no layer has anything
//         volume        more or less planned than the meshes hold
//         bleed         the bleed takes away much of a part
//         layers-empty  empty layers amid a solid
//         tolerance     contours may move far
//         above-bed     a part that stands on nothing
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "stages/checks/tally.h"
#include "stages/data/layer.h"
#include "stages/data/mesh.h"
#include "stages/data/status.h"

namespace lamina::sanity {

/// How the job sees its solids.
struct Sampling {
  std::array<double, 2> pixel_mm{};  // 0 without pixels
  double thickest_mm = 0;            // of all layers
  std::array<double, 2> bleed_um{};  // along x and y; 0 where parts or edges have several
  double tolerance_um = 0;           // of contours
  double offset_mm = 0;              // of contours
  /// What was tallied are images of a finished job: without their bleed, and with the drops that they got.
  bool finished = false;
  bool bleeds = false;                // of a finished job
  bool drops_none = false;            // of a finished job: some part gets no drop, which is told already
  bool one_sided = false;             // steps lie inside or outside of the parts, on purpose
  std::span<const std::string> part;  // names of files
  /// What the solids of a group hold together, mm3, where shells overlap or lie inside out too; 0: the volumes of the meshes
  /// count. Asked only of groups that are doubted by those; where it fails, no volume is doubted (united.h).
  std::function<Result<double>(std::uint32_t group)> united_mm3 = {};
};

/// One warning for each part and kind at most; the worst of its copies is named.
/// errors  kInterrupted and kMemory of sampling.united_mm3
Status judge_solids(const Tally& tally, const Sampling& sampling, std::vector<Warning>& warnings);

/// filled  by layer: whether it has anything; of the whole job
void judge_layers(std::span<const Solid> solids, std::span<const std::uint8_t> filled,
                  const std::function<Layer(std::uint32_t)>& layer, std::vector<Warning>& warnings);

/// Contours may move by a fiftieth of a part's narrower side, at least 0.05 and at most 0.25 mm.
void judge_tolerance(std::span<const Solid> solids, const Sampling& sampling, std::vector<Warning>& warnings);

/// Parts that neither stand on the bed nor on the box of another solid; for printers that lay beads.
void judge_footing(std::span<const Solid> solids, const Sampling& sampling, std::vector<Warning>& warnings);

/// errors  kInput: why nothing at all is planned, and what to do; none if the solids do not explain it
Status check_anything(const Tally& tally, const Sampling& sampling);

}  // namespace lamina::sanity
