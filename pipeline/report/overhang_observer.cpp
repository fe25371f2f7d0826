#include "pipeline/report/overhang_observer.h"

namespace lamina::pipeline {

Json overhangs_json(const checks::OverhangTally& tally, double angle_deg) {
  Json json = {{"angle_deg", angle_deg}, {"area_mm2", tally.area_mm2()}, {"layers", tally.layers()}};
  if (tally.layers() > 0) json["first_layer"] = tally.first_layer(), json["last_layer"] = tally.last_layer();
  json["largest"] = Json::array();
  for (const auto& [area_mm2, x_mm, y_mm, z_mm] : tally.largest())
    json["largest"].push_back({{"area_mm2", area_mm2}, {"x_mm", x_mm}, {"y_mm", y_mm}, {"z_mm", z_mm}});
  return json;
}

}  // namespace lamina::pipeline
