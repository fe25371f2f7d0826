#include "pipeline/report/inspection_json.h"

#include <string>

namespace lamina::pipeline {
namespace {

Json json_of(const checks::Spot& spot) {
  return {{"x_mm", spot.x_mm}, {"y_mm", spot.y_mm}, {"z_mm", spot.z_mm}, {"layer", spot.layer}};
}

Json json_of(const checks::Found& found, const std::string& amount) {
  Json json{{"count", found.count}};
  if (found.count == 0) return json;
  json[amount] = found.amount;
  json["largest_" + amount] = found.largest;
  json["largest_at"] = json_of(found.spot);
  for (const checks::Location& position : found.locations) {
    Json& one = json["locations"].emplace_back(json_of(position.spot));
    one["last_layer"] = position.last_layer;
    one["box_mm"] = position.box_mm;
    one[amount] = position.amount;
  }
  return json;
}

}  // namespace

Json json_of(const checks::Findings& findings, double min_mm) {
  Json json{{"layers", findings.layers},
            {"min_wall_mm", min_mm},
            {"islands", json_of(findings.islands, "mm2")},
            {"loose", json_of(findings.loose, "mm3")},
            {"hollows", json_of(findings.hollows, "mm3")},
            {"thin", json_of(findings.thin, "mm2")},
            {"touching", Json::array()}};
  for (const auto& pair : findings.touching) {
    json["touching"].push_back({{"part", pair.part}, {"other", pair.other}, {"at", json_of(pair.spot)}});
  }
  if (findings.bed_edge) json["bed_edge"] = json_of(*findings.bed_edge);
  if (findings.stop) json["stopped"] = {{"layer", findings.stop->layer}, {"bytes", findings.stop->bytes}};
  return json;
}

}  // namespace lamina::pipeline
