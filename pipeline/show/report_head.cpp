#include "pipeline/show/report_head.h"

#include <array>
#include <cmath>
#include <span>
#include <stdexcept>
#include <utility>

#include "pipeline/manifest/inspection_file.h"
#include "pipeline/manifest/kept_sections.h"
#include "stages/support/text/escape.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {
namespace {

Json shown_part_json(const PartSummary& part) {
  const auto point = [](const Point3& p) { return Json{mm(p.x), mm(p.y), mm(p.z)}; };
  Json json = {{"path", part.path},
               {"copies", part.copies},
               {"triangles", part.triangles},
               {"low_mm", point(part.bounds.lo)},
               {"high_mm", point(part.bounds.hi)},
               {"notes", Json::array()}};
  for (const Note& note : part.notes) json["notes"].push_back((note.repair ? "repair: " : "") + note.text);
  return json;
}

/// The layers' numbers, a list for each column.
Json layers_json(const Manifest& manifest, const ReportLayers& detected) {
  const ManifestHead& head = manifest.head;
  Json columns;
  const auto column = [&](const char* name, auto value) {
    Json& list = columns[name] = Json::array();
    for (const LayerRecord& record : manifest.layers) list.push_back(value(record));
  };
  const auto rounded = [](double value) { return std::round(value * 1e6) / 1e6; };
  column("bottom", [](const LayerRecord& r) { return r.layer.bottom; });
  column("thickness", [](const LayerRecord& r) { return r.layer.thickness; });
  column("reason", [](const LayerRecord& r) { return static_cast<int>(r.layer.reason); });
  columns["set"] = detected.set;
  column("bytes", [](const LayerRecord& r) { return r.bytes; });
  column("capped", [](const LayerRecord& r) { return r.capped_rows; });
  column("hash", [](const LayerRecord& r) { return hex(r.hash); });
  if (head.product == Product::kMoves) {
    column("volume", [&](const LayerRecord& r) { return r.paths ? rounded(r.paths->totals.volume_mm3) : 0; });
    column("filament", [&](const LayerRecord& r) { return r.paths ? rounded(r.paths->totals.filament_mm) : 0; });
    if (!detected.overhang_mm2.empty()) {
      columns["overhang"] = Json::array();
      for (const double area : detected.overhang_mm2) columns["overhang"].push_back(rounded(area));
    }
  } else if (!head.machine.empty()) {
    column("sweeps", [](const LayerRecord& r) { return r.program.sweeps; });
  }
  if (head.machine.empty()) return columns;
  columns["seconds"] = Json::array();
  for (const double time : detected.seconds) columns["seconds"].push_back(rounded(time));
  return columns;
}

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
  constexpr std::array<std::pair<const char*, const char*>, 8> kKinds = {{{"islands", "mm2"},
                                                                          {"loose", "mm3"},
                                                                          {"hollows", "mm3"},
                                                                          {"drains", "mm3"},
                                                                          {"thin", "mm2"},
                                                                          {"roofs", "mm2"},
                                                                          {"gaps", "mm2"},
                                                                          {"contacts", "mm2"}}};
  for (const auto& [code, unit] : kKinds) {
    if (!found.at(code).contains("locations")) continue;
    for (const Json& position : found.at(code).at("locations"))
      detected.positions.push_back(shown.position(code, unit, position));
  }
  for (const Json& pair : found.at("touching")) detected.positions.push_back(shown.position("touching", "", pair.at("at")));
  if (found.contains("bed_edge")) detected.positions.push_back(shown.position("bed-edge", "", found.at("bed_edge")));
}

}  // namespace

std::string page_title(const ManifestHead& head) { return head.parts.empty() ? "a job" : title_of(head.parts); }

std::string head_json(const Manifest& manifest, const ReportManifest& file, const PixelGrid& grid, const ReportLayers& detected,
                      view::report::HeldLayers& held, const std::vector<ShownView>& views) {
  const ManifestHead& head = manifest.head;
  const double dpi_x = grid.x.dpi(), dpi_y = grid.y.dpi();
  Json json = {{"title", page_title(head)},
               {"version", head.version},
               {"images", head.product == Product::kImages},
               {"format", head.format},
               {"machine", head.machine},
               {"columns", grid.columns()},
               {"rows", grid.rows()},
               {"dpi", {dpi_x, dpi_y}},
               {"pixel_mm", {25.4 / dpi_x, 25.4 / dpi_y}},
               {"window", {detected.window.left, detected.window.top, detected.window.right, detected.window.bottom}},
               {"layer_count", head.layer_count},
               {"first_layer", head.first_layer},
               {"stride", held.stride()},
               {"job", head.job_toml},
               {"manifest", {{"name", file.name}, {"bytes", file.digest.bytes}, {"hash", hex(file.digest.hash)}}},
               {"sweeps", detected.sweeps},
               {"deposited", detected.deposited},
               {"deposited_svg", base64(std::as_bytes(std::span(detected.deposited_svg)))},
               {"quote", detected.quote},
               {"parts", Json::array()},
               {"warnings", Json::array()},
               {"locations", Json::array()},
               {"views", Json::object()},
               {"reasons", Json::array()},
               {"embedded", Json::array()}};
  for (const PartSummary& part : head.parts) json["parts"].push_back(shown_part_json(part));
  for (const Warning& warning : detected.warnings) {
    json["warnings"].push_back({{"code", warning.code}, {"text", warning.text}});
    if (warning.layer) json["warnings"].back()["layer"] = *warning.layer;
  }
  for (const ReportLocation& position : detected.positions) {
    json["locations"].push_back({{"code", position.code},
                                 {"mm", {position.x_mm, position.y_mm, position.z_mm}},
                                 {"box_mm", {position.column_mm, position.row_mm, position.width_mm, position.depth_mm}},
                                 {"layers", {position.layer, position.last_layer}},
                                 {"amount", position.amount},
                                 {"unit", position.unit}});
  }
  for (const ShownView& view : views)
    json["views"][view.name] = {view.width, view.height, view.maximum, view.width_mm, view.height_mm};
  for (int reason = 0; reason <= static_cast<int>(LayerReason::kFlat); ++reason)
    json["reasons"].push_back(reason_name(static_cast<LayerReason>(reason)));
  for (const auto& [position, code] : held.layers()) json["embedded"].push_back(position);
  json["layers"] = layers_json(manifest, detected);
  return json_text(json);
}

void add_inspection(const std::string& directory, const ManifestHead& head, bool mirrored_x, bool mirrored_y,
                    ReportLayers& detected) {
  if (head.product != Product::kImages) return;
  const auto json = read_inspection(directory, head);
  if (!json && is_file(sections_path(directory + "/manifest.json")))
    detected.warnings.push_back({"not-inspected", "layers are inspected by lamina merge, once it has all of them"});
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
