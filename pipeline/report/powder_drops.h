// pipeline/report/powder_drops.h: the pixels and drops of each material of a job.
#pragma once

#include <cstdint>
#include <string>

#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

/// Of one material, summed over layers. Drops are those of its images, drops that blocked nozzles lose included.
struct PowderDrops {
  std::string name;
  std::uint64_t pixels = 0, drops = 0;
  void add(std::uint64_t more_pixels, std::uint64_t more_drops) { pixels += more_pixels, drops += more_drops; }
};

/// drop_pl  volume of a drop; 0: drops are not reported
std::string powder_text(const PowderDrops& powder, double drop_pl);
Json powder_json(const PowderDrops& powder, double drop_pl);

}  // namespace lamina::pipeline
