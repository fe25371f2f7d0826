// pipeline/check/expected_drops.h: the drops that the images of a layer stand for, as rows of bits and as totals.
//
// Where images are the geometry, the drops are made again by the dose of the planner (stages/dose/). Nothing here is of the compiler of
// print programs, whose work these drops check.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "pipeline/manifest/manifest.h"
#include "stages/data/bit_rows.h"
#include "stages/data/machine.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"
#include "stages/dose/layer_drops.h"
#include "stages/geometry/drop_rows.h"
#include "stages/geometry/run_rows.h"

namespace lamina::pipeline {

class DosePlan;

/// The drops of a layer; keeps its capacity for the next one.
class LayerDrops {
 public:
  /// The pixels with at least one drop, two, ...: borrowed from the images and from this object.
  std::span<const BitRows* const> planes() const { return planes_; }
  std::uint64_t pixels = 0;   // with any drop
  std::uint64_t drops = 0;    // of all pixels
  std::uint32_t maximum = 0;  // of any pixel
  std::uint64_t requested = 0;  // by the target, as LayerRecord has it; of drops that are made again

 private:
  friend class ExpectedDrops;
  dose::DropWork work_;
  Runs second_;  // scratch
  std::vector<RunRows> runs_;
  std::vector<DropPlane> made_;
  std::vector<const BitRows*> planes_;
};

class ExpectedDrops {
 public:
  /// Leaves images as they are.
  ExpectedDrops();
  ExpectedDrops(ExpectedDrops&&) noexcept;
  ExpectedDrops& operator=(ExpectedDrops&&) noexcept;
  ~ExpectedDrops();

  /// machine  of the job
  /// errors   kVerification: the job's text cannot be read
  static Result<ExpectedDrops> of(const ManifestHead& head, const Machine& machine);
  /// The same by the machine's profile in the job's directory. errors  of machine_of_job
  static Result<ExpectedDrops> of(const std::string& directory, const ManifestHead& head);

  /// Whether drops are made again from images of the geometry.
  bool remakes() const { return dose_ != nullptr; }
  /// images  of the drops, each within the one before, or one of the geometry; outlive the use of `drops`
  /// errors  kVerification: "layer 3: ...", the job's dose cannot be computed; `drops` are then none
  Status make(const Layer& layer, std::span<const Runs> images, LayerDrops& drops) const;
  /// The same as runs, for pictures: the image of the geometry becomes the images of its drops.
  Status apply(const Layer& layer, std::vector<Runs>& images) const;

  /// "", or how the counts of a layer's record are not those of its image and its drops, in order.
  static std::string fault(const ManifestHead& head, const LayerRecord& record, const LayerDrops& drops);

 private:
  std::unique_ptr<const DosePlan> dose_;  // none: images are those of drops
  std::uint32_t max_drops_ = 1;
};

}  // namespace lamina::pipeline
