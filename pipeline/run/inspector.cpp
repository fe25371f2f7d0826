#include "pipeline/run/inspector.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "stages/data/text/readable.h"
#include "stages/write/manifest/inspection_file.h"

namespace lamina::pipeline {
namespace {

/// Two pixels, or a drop as it flies, whichever is wider.
double narrowest_mm(const ImagePlan& images) {
  const double pixel = 25.4 / std::min(images.grid.x.dpi(), images.grid.y.dpi());
  const double drop_mm3 = images.machine ? images.machine->machine.head.drop_pl * 1e-6 : 0;
  return std::max(2 * pixel, std::cbrt(6 * drop_mm3 / std::numbers::pi));
}

nlohmann::ordered_json json_of(const inspect::Spot& spot) {
  return {{"x_mm", spot.x_mm}, {"y_mm", spot.y_mm}, {"z_mm", spot.z_mm}, {"layer", spot.layer}};
}

nlohmann::ordered_json json_of(const inspect::Found& found, std::string_view amount) {
  nlohmann::ordered_json json{{"count", found.count}};
  if (found.count == 0) return json;
  json[std::string(amount)] = found.amount;
  json["largest_" + std::string(amount)] = found.largest;
  json["largest_at"] = json_of(found.spot);
  for (const inspect::Place& place : found.places) {
    nlohmann::ordered_json& one = json["places"].emplace_back(json_of(place.spot));
    one["last_layer"] = place.last_layer;
    one["box_mm"] = place.box_mm;
    one[std::string(amount)] = place.amount;
  }
  return json;
}

}  // namespace

Inspector::Inspector(const Plan& plan) : plan_(plan) {
  if (!plan.job.inspect) return;
  std::vector<inspect::Stand> stands;
  for (std::size_t i = 0; i < plan.scene->instances.size(); ++i) {
    stands.push_back({box_of(*plan.scene, plan.scene->instances[i]), plan.scene->part_of_instance[i]});
  }
  for (const PlacedImages& images : plan.scene->images) {
    stands.push_back({plan.scene->parts[images.part].bounds, images.part});
    Box& box = stands.back().box;
    const PixelGrid& grid = plan.images->grid;
    const auto nm = [](std::int64_t pixel, const PixelAxis& axis) { return static_cast<Nm>(pixel * axis.span / axis.dots); };
    const std::int64_t back = std::int64_t{grid.rows()} - images.place.first_row;
    box.lo = {nm(images.place.column.front(), grid.x), nm(back - std::ssize(images.place.row), grid.y), images.bottom};
    box.hi = {nm(images.place.column.back(), grid.x), nm(back, grid.y),
              static_cast<Nm>(images.bottom + std::int64_t{images.thickness} * images.images->layers())};
  }
  least_mm_ = plan.job.least_wall_mm.value_or(narrowest_mm(*plan.images));
  inspection_.emplace(plan.images->grid, std::move(stands), nm_of(least_mm_));
}

void Inspector::look(const Runs& image, Work& work) const {
  work.image.columns = image.columns;
  work.image.row_offset.assign(image.row_offset.begin(), image.row_offset.end());
  work.image.change.assign(image.change.begin(), image.change.end());
  work.thin = inspection_->thin(image, work.scratch);
}

void Inspector::warn(std::vector<Warning>& warnings) {
  if (!on()) return;
  if (kept_) {
    warnings.push_back({"not-inspected",
                        "layers of an earlier run were kept: what hangs together was not looked at; run the job "
                        "anew, or as a dry run, with --inspect"});
    return;
  }
  std::vector<std::string> names;
  for (const PartSummary& part : plan_.scene->parts) names.push_back(one_line(part.path));
  inspect::tell(inspection_->finish(), names, least_mm_, told_);
  warnings.insert(warnings.end(), told_.begin(), told_.end());
}

nlohmann::ordered_json Inspector::json() const {
  const inspect::Findings& found = inspection_->findings();
  nlohmann::ordered_json json{{"layers", found.layers},
                              {"least_wall_mm", least_mm_},
                              {"islands", json_of(found.islands, "mm2")},
                              {"loose", json_of(found.loose, "mm3")},
                              {"hollows", json_of(found.hollows, "mm3")},
                              {"thin", json_of(found.thin, "mm2")},
                              {"touching", nlohmann::ordered_json::array()}};
  for (const auto& pair : found.touching) {
    json["touching"].push_back({{"part", pair.part}, {"other", pair.other}, {"at", json_of(pair.spot)}});
  }
  if (found.bed_edge) json["bed_edge"] = json_of(*found.bed_edge);
  return json;
}

void Inspector::tell(Summary& summary) const {
  if (on() && !kept_) (*summary.facts)["inspection"] = json();
}

Status Inspector::check_file() const { return on() && whole() ? check_inspection_file(plan_.job.output) : Status(); }

Status Inspector::write(const ManifestHead& head) const {
  if (!on() || kept_ || !whole()) return keep_inspection_of(plan_.job.output, head);
  return write_inspection(plan_.job.output, head, {{"inspection", json()}, {"warnings", warnings_json(told_)}});
}

bool Inspector::whole() const { return plan_.range[0] == 0 && plan_.range[1] == plan_.layer_count && !plan_.job.shard; }

}  // namespace lamina::pipeline
