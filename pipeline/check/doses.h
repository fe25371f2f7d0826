// pipeline/check/doses.h: checks a manifest's counts of pixels and requested drops against images, job and profile.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "pipeline/job/job.h"
#include "pipeline/manifest/manifest.h"
#include "stages/data/machine.h"

namespace lamina::pipeline {

/// Works by the formulas of docs/theory/saturation.md in floating point and shares nothing with stages/dose/, which has decided
/// the drops. What follows from images alone is held exactly: levels of voxels, and the pixels to be filled where each gets a
/// drop. Where fewer fall, those pixels lie between what the images have and what the boxes of the parts hold.
class DoseCheck {
 public:
  /// head  outlives this object. machine  of the job; null without one
  DoseCheck(const ManifestHead& head, const Machine* machine);

  /// Adds the layers that lie or are thick as none of the job can.
  void check_heights(const Manifest& manifest, Faults& faults) const;

  /// Empty, or what is wrong. set  pixels with any drop; levels  sum of the levels of the layer's image, of a job that has them
  std::string fault(const LayerRecord& record, std::uint64_t set, std::uint64_t levels) const;

 private:
  struct RequestedRange {
    double minimum = 1, maximum = 1;  // drops a full pixel, of any part, in shell or core
  };
  std::optional<RequestedRange> requested_range(const Layer& layer) const;
  std::string fault_of_target(const LayerRecord& record) const;
  std::string fault_of_dosed(const LayerRecord& record, std::uint64_t set) const;
  double max_pixels(const Layer& layer) const;

  const ManifestHead& head_;
  const Machine* machine_;
  std::optional<Job> job_;  // none: its text cannot be read
};

}  // namespace lamina::pipeline
