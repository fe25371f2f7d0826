// stages/checks/records.h: judges a whole job by the records of its layers, without meshes: shards that are joined.
//
// codes   empty, layers-empty, lost-pixels, rows-capped, cover-top, mixed-powders; volumes, lost parts and bleeds are not in
// records
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "stages/data/layer.h"
#include "stages/data/mesh.h"
#include "stages/data/status.h"

namespace lamina::checks {

/// Of all layers of an image job, in their order.
class LayerRecords {
 public:
  void add(const Layer& layer, std::uint64_t set_pixels, std::uint64_t lost_pixels, std::uint32_t capped_rows);

  /// Lost pixels and capped rows.
  void report(std::span<const PartSummary> parts, std::vector<Warning>& warnings) const;

  /// Those and the rest. parts  of the manifest: a layer within the height of one is expected to have pixels
  /// thins  beads or a dose may leave layers empty on purpose
  /// errors kInput: no layer has a pixel, and that is not allowed
  Status check(std::span<const PartSummary> parts, bool thins, bool allow_empty, std::vector<Warning>& warnings) const;

 private:
  std::vector<Layer> layers_;
  std::vector<std::uint8_t> filled_;  // by layer
  std::uint64_t lost_ = 0, capped_ = 0;
  std::uint32_t capped_layers_ = 0;
  Layer first_capped_{};
};

/// Pixels of blocked nozzles that nothing fires; no warning if there are none.
void warn_of_lost_pixels(std::uint64_t pixels, std::vector<Warning>& warnings);

/// Of a job whose steps lie inside of its parts and whose last layer covers them: where it is empty, or was left out.
/// height  nm, of the parts
void warn_of_open_top(const Layer& last, std::int64_t height, std::vector<Warning>& warnings);

/// No warning if there are none.
void warn_of_unfed(const UnfedPowder& powder, std::vector<Warning>& warnings);

/// Refuses the warnings of a strict job. errors  kVerification with all of them on one line
Status refuse_warnings(std::span<const Warning> warnings);

}  // namespace lamina::checks
