// stages/replay/count.h: totals of replayed programs, and the material they use.
#pragma once

#include <array>
#include <cstdint>

namespace lamina::replay {

/// A layer that is said to take longer takes so long: a program may say anything, and sums must hold.
inline constexpr double kMaxSeconds = 1e6;

/// Totals of a program. Time is that of head, roller and vats one after the other, and of the layer's pause.
struct Count {
  std::uint64_t drops = 0, vectors = 0;
  std::uint32_t sweeps = 0;
  std::uint32_t max_per_position = 0;                    // drops that a nozzle fires there in one sweep
  std::uint32_t added = 0;                               // sweeps beyond those that the head's own drops would take
  double scan_mm = 0, travel_mm = 0;                     // of the head
  std::int64_t microseconds = 0;                         // of the machine; whole, so that sums of layers are exact
  std::int64_t added_microseconds = 0;                   // of them, those that the layer takes for added sweeps
  std::array<double, 2> fed_mm{0, 0};                    // by each vat
  std::uint32_t vats = 0;                                // one bit per vat that feeds, by command or by movement
  std::uint64_t spat = 0;                                // drops off the bed
  std::uint32_t spits = 0, wipes = 0, refills = 0;       // times; refills: pauses for vats to be filled
  bool moves = false;                                    // whether the program moves vats and roller
  double build_mm = 0;                                   // final position of the build vat
  double farthest_along_um = 0, farthest_across_um = 0;  // greatest distance of a drop from its pixel's centre
  double seconds() const { return static_cast<double>(microseconds) / 1e6; }
  void add(const Count& other);
};

/// Binder and powder used by a program.
struct Material {
  double binder_mm3 = 0;  // drops, those off the bed too, x their volume
  double powder_mm3 = 0;  // solid: height fed x area of the vats x packing
};

}  // namespace lamina::replay
