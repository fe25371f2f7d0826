// pipeline/run/part_counter.h: the pixels and drops of each part in the layers of a powder job, for its costs.
#pragma once

#include <optional>
#include <vector>

#include "pipeline/manifest/record.h"
#include "pipeline/plan/plan.h"
#include "pipeline/report/image_observers.h"
#include "stages/cost/part_pixels.h"

namespace lamina::pipeline {

struct ImageWork;

/// Counts nothing unless costs of parts are reported one by one (reported_parts). Usable from many threads at once.
class PartCounter {
 public:
  /// The plan has a machine and must outlive this object.
  explicit PartCounter(const Plan& plan);

  /// Of a job with parts that are images, before these are added to its meshes: the pixels that each mesh sets.
  void weigh(const Layer& layer, const ImageWork& work, ImageNotes& notes) const;
  /// Counts the pixels of each part in a layer, and its drops where a saturation decides them. Next to images they are
  /// divided in proportion to what each part sets by itself: exact where no pixel is of two parts.
  void count(const ImageWork& work, const ImageNotes& notes, LayerRecord& record) const;

 private:
  void share_out(const ImageWork& work, const std::vector<std::uint64_t>& weights, LayerRecord& record) const;

  const Plan& plan_;
  std::optional<cost::PartPixels> windows_;
  bool saturates_ = false, several_ = false;  // drops are decided; pixels get more than one
  std::uint8_t full_ = 0;                     // level of a full voxel; 0: pixels are set or not
};

}  // namespace lamina::pipeline
