// pipeline/report/dose_text.h: binder and voxels of a powder job, as text and as JSON.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "stages/dose/budget.h"
#include "stages/dose/share_count.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

std::string binder_text(const dose::Budget& budget, const dose::BinderCount& count);
Json binder_json(const dose::Budget& budget, const dose::BinderCount& count);

/// levels  of a voxel; as  what they are written as
std::string voxels_text(const dose::ShareCount& count, std::uint32_t levels, std::string_view as);
Json voxels_json(const dose::ShareCount& count, std::uint32_t levels, std::string_view as);

}  // namespace lamina::pipeline
