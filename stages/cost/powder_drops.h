// stages/cost/powder_drops.h: the pixels and drops of each material of a job.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace lamina::cost {

/// Of one material, summed over layers. Drops are those of its images: what blocked nozzles lose is among them.
struct PowderDrops {
  std::string name;
  std::uint64_t pixels = 0, drops = 0;
  void add(std::uint64_t more_pixels, std::uint64_t more_drops) { pixels += more_pixels, drops += more_drops; }

  /// For people, and for programs. drop_pl  a drop; 0: drops are not told
  std::string told(double drop_pl) const;
  nlohmann::ordered_json json(double drop_pl) const;
};

}  // namespace lamina::cost
