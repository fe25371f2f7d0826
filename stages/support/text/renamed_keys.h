// stages/support/text/renamed_keys.h: keys of job files and profiles that have another name since version 0.1.0.
#pragma once

#include <string_view>

namespace lamina {

/// Section, old key, key of today. An empty key names a section that was renamed.
inline constexpr std::string_view kRenamedKeys[][3] = {
    {"fill", "by_height", "fill.range"},
    {"segment", "by_height", "segment.range"},
    {"segment", "least_end_mm", "segment.min_end_mm"},
    {"part", "material_by_height", "part.material_range"},
    {"extrude", "set", "extrude.machine"},
    {"run", "least_wall_mm", "run.min_wall_mm"},
    {"head", "most_drops", "head.max_drops"},
    {"head", "most_drop_sweeps", "head.max_drop_sweeps"},
    {"powder", "least_saturation_percent", "powder.min_saturation_percent"},
    {"skirt", "least_mm", "skirt.min_mm"},
    {"retraction", "least_travel_mm", "retraction.min_travel_mm"},
    {"place", "", "placement"},
    {"care", "", "maintenance"},
};

}  // namespace lamina
