// stages/program/vats.h: whether the powder of a job is in the vats, and where it pauses for them to be filled.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "stages/data/layer.h"
#include "stages/data/machine.h"
#include "stages/data/status.h"

namespace lamina::program {

/// Empties the vats of a profile layer by layer, as its programs feed: dose x thickness, rounded as they spell it, and the base
/// of powder below the first layer. Vats of depth 0 never run empty.
class VatPlan {
 public:
  /// machine  outlives this object; its vats are full
  explicit VatPlan(const Machine& machine) : machine_(machine), left_(machine.powder.vat_depth_mm) {}

  /// Whether a profile states a depth at all.
  static bool has_depths(const Machine& machine);

  /// The next layer of the job, from the first one. feeds  vats, a bit each, that give to it in equal parts
  void add(const Layer& layer, std::uint32_t feeds);

  /// Layers before which all vats have to be filled, in order, by the rule `pause`.
  const std::vector<std::uint32_t>& refills() const { return refills_; }
  /// errors  kUsage: by the rule `refuse`, the layer for which a vat is empty, and what the job takes of it; by either, a layer
  ///         that takes more than a full vat
  Status status() const;

 private:
  const Machine& machine_;
  std::array<double, 2> left_, needed_{0, 0};
  std::vector<std::uint32_t> refills_;
  Layer empty_{};  // for which a vat is empty, or too small
  std::uint32_t vat_ = 0;
  bool empties_ = false, too_small_ = false;
};

}  // namespace lamina::program
