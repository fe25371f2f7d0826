// stages/replay/totals.h: totals of programs against the job and its record: drops and times, vats that feed, material.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "stages/data/layer.h"
#include "stages/data/machine.h"
#include "stages/data/status.h"
#include "stages/replay/count.h"

namespace lamina::replay {

/// Compares a program's numbers with what is recorded of it; a time of 0 is not recorded.
/// errors  kVerification: the first that differs: drops, sweeps, added sweeps, times
Status check_count(const Machine& machine, const Count& reported, const Count& found);

/// One bit per vat that must feed a layer, by the machine's rule; 0 if the rule refuses. An empty layer counts as the
/// first material.
/// set  pixels of each material
/// vat  of each material
std::uint32_t vats_wanted(const Machine& machine, std::span<const std::uint64_t> set, std::span<const std::uint32_t> vat);

/// Records of older builds have no such pixels. feeds  a bit for each vat
/// errors  kVerification: a material is recorded to have other pixels in the powder of another vat than `feeds` leaves it
Status check_unfed(std::span<const std::uint64_t> set, std::span<const std::uint32_t> vat,
                   std::span<const std::uint64_t> recorded, std::uint32_t feeds);

/// What is left in vats of stated depth, layer by layer in their order; a pause fills all of them. After a layer that is left
/// out, or that could not be carried out, nothing is known of them until they are filled.
class VatLevels {
 public:
  /// They are full.
  explicit VatLevels(const Machine& machine) : depth_mm_(machine.powder.vat_depth_mm), left_mm_(depth_mm_) {}

  /// count  none: the layer could not be carried out. errors  kVerification: a vat had less than the layer took; once each
  Status take(std::uint32_t layer, const std::optional<Count>& count);

 private:
  std::array<double, 2> depth_mm_, left_mm_;
  std::array<bool, 2> reports_{};
  std::uint32_t next_ = 0;  // layer
  bool known_ = false;
};

/// The count of a layer with what its host feeds by the profile, of a program that names its vats and moves none.
std::optional<Count> with_fed_by_host(const Machine& machine, const Layer& layer, std::optional<Count> count);

Material material_of(const Machine& machine, const Count& count);

}  // namespace lamina::replay
