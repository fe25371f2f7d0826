// stages/replay/count.h: what programs did, and what that used up.
#pragma once

#include <array>
#include <cstdint>

namespace lamina::replay {

/// What a program did.
struct Count {
  std::uint64_t drops = 0, vectors = 0;
  std::uint32_t sweeps = 0;
  double scan_mm = 0, travel_mm = 0;                     // of the head
  double seconds = 0;                                    // head, roller and vats, one after the other
  std::array<double, 2> fed_mm{0, 0};                    // by each vat
  std::uint32_t vats = 0;                                // that feed, a bit each, by words or by movement
  bool moves = false;                                    // whether the program moves the vats and the roller itself
  double build_mm = 0;                                   // where the build vat stands at the end
  double farthest_along_um = 0, farthest_across_um = 0;  // a drop from the centre of its pixel
  void add(const Count& other);
};

/// Binder and powder that a program used up.
struct Material {
  double binder_mm3 = 0;  // drops x their volume
  double powder_mm3 = 0;  // solid: height fed x area of the bed x packing
};

}  // namespace lamina::replay
