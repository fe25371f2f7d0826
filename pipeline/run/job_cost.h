// pipeline/run/job_cost.h: what a job of a powder printer uses up and costs, layer by layer.
#pragma once

#include <optional>

#include "pipeline/manifest/manifest.h"
#include "pipeline/plan/plan.h"
#include "stages/cost/account.h"
#include "stages/cost/part_pixels.h"
#include "stages/cost/powder_drops.h"

namespace lamina::pipeline {

struct ImageWork;
struct ImageNotes;

/// Of a job with a machine.
class JobCost {
 public:
  /// Parts are told apart where there are several, and anything has a price or their table is wanted.
  explicit JobCost(const Plan& plan);
  /// Of a finished job, whose parts are told apart if its layers say what is whose.
  JobCost(const Machine& machine, const Manifest& manifest);

  // --- from many threads at once
  /// Of a job with parts that are images, before these are united with its meshes: what each mesh sets.
  void weigh(const Layer& layer, const ImageWork& work, ImageNotes& notes) const;
  /// Counts the pixels of each part in a layer, and its drops where a saturation decides them. Beside images they are
  /// shared out by what each part sets for itself: exact where no pixel is of two parts.
  void count(const ImageWork& work, const ImageNotes& notes, LayerRecord& record) const;
  /// From one thread at a time. drops, microseconds  of its print program, with the drops that are spat
  void add(const LayerRecord& record, std::uint64_t drops, std::int64_t microseconds);
  const cost::Account& account() const { return account_; }
  /// Of a finished job of several materials whose drops a wish decides: what each got; empty of others. drop_pl  a drop
  const std::vector<cost::PowderDrops>& powders() const { return powders_; }
  double drop_pl() const { return drop_pl_; }

 private:
  void share_out(const ImageWork& work, const std::vector<std::uint64_t>& weights, LayerRecord& record) const;

  cost::Account account_;
  std::vector<cost::PowderDrops> powders_;
  double drop_pl_ = 0;
  const Plan* plan_ = nullptr;  // of a job whose parts are told apart
  std::optional<cost::PartPixels> windows_;
  bool saturates_ = false, several_ = false;  // drops are decided; pixels get more than one
  std::uint8_t full_ = 0;                     // level of a full voxel; 0: pixels are set or not
};

}  // namespace lamina::pipeline
