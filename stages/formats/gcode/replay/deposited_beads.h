// stages/formats/gcode/replay/deposited_beads.h: finds beads that a layer deposits twice.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace lamina::formats::gcode {

/// The beads of a layer by their ends, in micrometres, and their direction. A table of hashes of 64 bits: two beads of a layer
/// are taken for one with a probability of about 1e-12. Memory: 32 bytes a bead of the largest layer.
class DepositedBeads {
 public:
  void next_layer();
  /// from, to  x, y, z in mm; returns  whether the layer has this bead already
  bool add(const double (&from)[3], const double (&to)[3]);

 private:
  struct BeadSlot {
    std::uint64_t hash = 0;
    std::uint64_t layer = 0;  // 0: free
  };
  void grow();
  BeadSlot& slot_of(std::uint64_t hash);

  std::vector<BeadSlot> slots_ = std::vector<BeadSlot>(1024);
  std::size_t size_ = 0;
  std::uint64_t layer_ = 1;
};

}  // namespace lamina::formats::gcode
