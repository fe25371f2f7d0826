#include "pipeline/show/report_locations.h"

#include <array>
#include <stdexcept>
#include <utility>

#include "pipeline/manifest/inspection_file.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {
namespace {

struct Shown {
  const PixelGrid& grid;
  bool mirrored_x, mirrored_y;
  std::uint32_t layers;  // of the job

  /// Throws for one that the job has not.
  std::uint32_t layer(const Json& json) const {
    const auto number = json.get<std::int64_t>();
    if (number < 0 || number >= layers) throw std::out_of_range("layer");
    return static_cast<std::uint32_t>(number);
  }

  /// Throws where something is missing or of another type.
  ReportLocation position(const std::string& code, const std::string& unit, const Json& json) const {
    ReportLocation position;
    position.code = code;
    json.at("x_mm").get_to(position.x_mm);
    json.at("y_mm").get_to(position.y_mm);
    json.at("z_mm").get_to(position.z_mm);
    position.layer = position.last_layer = layer(json.at("layer"));
    std::array<double, 4> box{position.x_mm, position.y_mm, position.x_mm, position.y_mm};
    if (json.contains("last_layer")) position.last_layer = layer(json.at("last_layer"));
    for (std::size_t i = 0; json.contains("box_mm") && i < box.size(); ++i) json.at("box_mm").at(i).get_to(box[i]);
    if (!unit.empty()) {
      json.at(unit).get_to(position.amount);
      position.unit = unit;
    }
    const auto side = [](const PixelAxis& axis) { return static_cast<double>(axis.count) / axis.pixels_per_nm() / kNmPerMm; };
    const double x = (box[0] + box[2]) / 2, y = (box[1] + box[3]) / 2;
    position.width_mm = box[2] - box[0];
    position.depth_mm = box[3] - box[1];
    position.column_mm = mirrored_x ? side(grid.x) - x : x;
    position.row_mm = mirrored_y ? y : side(grid.y) - y;
    return position;
  }
};

void add(const Json& json, const Shown& shown, ReportLayers& detected) {
  for (const Json& warning : json.at("warnings")) {
    Warning& reported = detected.warnings.emplace_back(Warning{warning.at("code").text(), warning.at("text").text()});
    if (warning.contains("layer")) reported.layer = shown.layer(warning.at("layer"));
  }
  const Json& found = json.at("inspection");
  constexpr std::array<std::pair<const char*, const char*>, 4> kKinds = {
      {{"islands", "mm2"}, {"loose", "mm3"}, {"hollows", "mm3"}, {"thin", "mm2"}}};
  for (const auto& [code, unit] : kKinds) {
    if (!found.at(code).contains("locations")) continue;
    for (const Json& position : found.at(code).at("locations"))
      detected.positions.push_back(shown.position(code, unit, position));
  }
  for (const Json& pair : found.at("touching")) detected.positions.push_back(shown.position("touching", "", pair.at("at")));
  if (found.contains("bed_edge")) detected.positions.push_back(shown.position("bed-edge", "", found.at("bed_edge")));
}

}  // namespace

void add_inspection(const std::string& directory, const ManifestHead& head, bool mirrored_x, bool mirrored_y,
                    ReportLayers& detected) {
  if (head.product != Product::kImages) return;
  const auto json = read_inspection(directory, head);
  if (!json) return;
  ReportLayers with = {};
  const Shown shown{head.grid, mirrored_x, mirrored_y, head.layer_count};
  try {
    add(*json, shown, with);
  } catch (const std::exception&) {
    detected.warnings.push_back({"inspection", "inspection.json is not as lamina wrote it; plan the job again with --inspect"});
    return;
  }
  detected.warnings.insert(detected.warnings.end(), with.warnings.begin(), with.warnings.end());
  detected.positions = std::move(with.positions);
}

}  // namespace lamina::pipeline
