// pipeline/report/image_text.h: figures of a powder job, as text and as JSON: powders, binder, voxels, layers, inspection.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "stages/checks/inspect.h"
#include "stages/checks/layer_warnings.h"
#include "stages/dose/budget.h"
#include "stages/dose/shares.h"
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

std::string binder_text(const dose::Budget& budget, const dose::BinderCount& count);
Json binder_json(const dose::Budget& budget, const dose::BinderCount& count);

/// levels  of a voxel; as  what they are written as
std::string voxels_text(const dose::ShareCount& count, std::uint32_t levels, std::string_view as);
Json voxels_json(const dose::ShareCount& count, std::uint32_t levels, std::string_view as);

/// "layers 0 to 41, 60 and 72 to 80", at most six ranges, and how many more.
std::string ranges_text(std::span<const checks::LayerRange> ranges);

/// "pauses before layers 812, 1630 and 4 more for vats to be filled"; empty without refills.
std::string refills_text(const std::vector<std::uint32_t>& refills);

/// min_mm  least width of what is not thin. drain_mm  the same of drains
Json json_of(const checks::Findings& findings, double min_mm, double drain_mm);

}  // namespace lamina::pipeline
