#include "pipeline/show/report_head.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <span>

#include "stages/support/text/escape.h"

namespace lamina::write::report {
namespace {

using Json = nlohmann::ordered_json;

Json part_json(const PartSummary& part) {
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
Json layers_json(const Manifest& manifest, const LayersSeen& seen) {
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
  columns["set"] = seen.set;
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
  for (const double time : seen.seconds) columns["seconds"].push_back(rounded(time));
  return columns;
}

}  // namespace

std::string page_title(const ManifestHead& head) { return head.parts.empty() ? "a job" : title_of(head.parts); }

std::string head_json(const Manifest& manifest, const ManifestSeen& file, const PixelGrid& grid, const LayersSeen& seen,
                      HeldLayers& held, const std::vector<ShownView>& views) {
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
               {"window", {seen.window.left, seen.window.top, seen.window.right, seen.window.bottom}},
               {"layer_count", head.layer_count},
               {"first_layer", head.first_layer},
               {"stride", held.stride()},
               {"job", head.job_toml},
               {"manifest", {{"name", file.name}, {"bytes", file.digest.bytes}, {"hash", hex(file.digest.hash)}}},
               {"sweeps", seen.sweeps},
               {"laid", seen.laid},
               {"laid_svg", base64(std::as_bytes(std::span(seen.laid_svg)))},
               {"quote", seen.quote},
               {"parts", Json::array()},
               {"warnings", Json::array()},
               {"places", Json::array()},
               {"views", Json::object()},
               {"reasons", Json::array()},
               {"embedded", Json::array()}};
  for (const PartSummary& part : head.parts) json["parts"].push_back(part_json(part));
  for (const Warning& warning : seen.warnings) {
    json["warnings"].push_back({{"code", warning.code}, {"text", warning.text}});
    if (warning.layer) json["warnings"].back()["layer"] = *warning.layer;
  }
  for (const SeenPlace& place : seen.places) {
    json["places"].push_back({{"code", place.code},
                              {"mm", {place.x_mm, place.y_mm, place.z_mm}},
                              {"box_mm", {place.column_mm, place.row_mm, place.width_mm, place.depth_mm}},
                              {"layers", {place.layer, place.last_layer}},
                              {"amount", place.amount},
                              {"unit", place.unit}});
  }
  for (const ShownView& view : views)
    json["views"][view.name] = {view.width, view.height, view.most, view.width_mm, view.height_mm};
  for (int reason = 0; reason <= static_cast<int>(LayerReason::kFlat); ++reason)
    json["reasons"].push_back(reason_name(static_cast<LayerReason>(reason)));
  for (const auto& [place, code] : held.layers()) json["embedded"].push_back(place);
  json["layers"] = layers_json(manifest, seen);
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace lamina::write::report
