#include "pipeline/show/report_head.h"

#include <cmath>
#include <span>

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
  } else if (!head.machine.empty()) {
    column("sweeps", [](const LayerRecord& r) { return r.program.sweeps; });
  }
  if (head.machine.empty()) return columns;
  columns["seconds"] = Json::array();
  for (const double time : detected.seconds) columns["seconds"].push_back(rounded(time));
  return columns;
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

}  // namespace lamina::pipeline
