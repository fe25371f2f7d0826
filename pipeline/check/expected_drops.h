// pipeline/check/expected_drops.h: makes the drops of a layer again, by its image and the job, where images are the geometry.
//
// It uses the dose of the planner (stages/dose/) and nothing of the compiler of print programs, whose work these drops check.
#pragma once

#include <memory>
#include <string>

#include "pipeline/manifest/manifest.h"
#include "stages/data/machine.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

class DosePlan;

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

  /// The image of the geometry becomes the images of its drops, each within the one before. Usable from any thread.
  void apply(const Layer& layer, std::vector<Runs>& planes) const;

  /// "", or how the counts of a layer's record are not those of its image and its drops, in order.
  static std::string fault(const ManifestHead& head, const LayerRecord& record, const std::vector<Runs>& planes);

 private:
  std::unique_ptr<const DosePlan> dose_;  // none: images are those of drops
};

}  // namespace lamina::pipeline
