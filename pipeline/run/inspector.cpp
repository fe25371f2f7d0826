#include "pipeline/run/inspector.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "pipeline/manifest/inspection_file.h"
#include "pipeline/report/inspection_json.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

/// Two pixels, or a drop as it flies, whichever is wider.
double narrowest_mm(const ImagePlan& images) {
  const double pixel = 25.4 / std::min(images.grid.x.dpi(), images.grid.y.dpi());
  const double drop_mm3 = images.machine ? images.machine->machine.head.drop_pl * 1e-6 : 0;
  return std::max(2 * pixel, std::cbrt(6 * drop_mm3 / std::numbers::pi));
}

}  // namespace

Inspector::Inspector(const Plan& plan) : plan_(plan) {
  if (!plan.job.inspect) return;
  std::vector<checks::Solid> placed_parts;
  for (std::size_t i = 0; i < plan.scene->instances.size(); ++i) {
    placed_parts.push_back({box_of(*plan.scene, plan.scene->instances[i]), plan.scene->part_of_instance[i]});
  }
  for (const PlacedImages& images : plan.scene->images) {
    placed_parts.push_back({plan.scene->parts[images.part].bounds, images.part});
    Box& box = placed_parts.back().box;
    const PixelGrid& grid = plan.images->grid;
    const auto nm = [](std::int64_t pixel, const PixelAxis& axis) { return static_cast<Nm>(pixel * axis.span / axis.dots); };
    const std::int64_t back = std::int64_t{grid.rows()} - images.position.first_row;
    box.lo = {nm(images.position.column.front(), grid.x), nm(back - std::ssize(images.position.row), grid.y), images.bottom};
    box.hi = {nm(images.position.column.back(), grid.x), nm(back, grid.y),
              static_cast<Nm>(images.bottom + std::int64_t{images.thickness} * images.images->layers())};
  }
  min_mm_ = plan.job.min_wall_mm.value_or(narrowest_mm(*plan.images));
  inspection_.emplace(plan.images->grid, std::move(placed_parts), nm_of(min_mm_), plan.job.memory_bytes / 2);
}

void Inspector::warn(const Summary&, std::vector<Warning>& warnings) {
  if (!on()) return;
  if (kept_) {
    warnings.push_back({"not-inspected",
                        "layers of an earlier run were kept: what hangs together was not looked at; run the job "
                        "anew, or as a dry run, with --inspect"});
    return;
  }
  std::vector<std::string> names;
  for (const PartSummary& part : plan_.scene->parts) names.push_back(one_line(part.path));
  checks::report(inspection_->finish(), names, min_mm_, reports_);
  warnings.insert(warnings.end(), reports_.begin(), reports_.end());
}

void Inspector::report(Summary& summary) const {
  if (on() && !kept_) summary.facts["inspection"] = json_of(inspection_->findings(), min_mm_);
}

Status Inspector::check_file() const { return on() && whole() ? check_inspection_file(plan_.job.output) : Status(); }

Status Inspector::write(const ManifestHead& head) const {
  if (!on() || kept_ || !whole()) return keep_inspection_of(plan_.job.output, head);
  return write_inspection(plan_.job.output, head,
                          {{"inspection", json_of(inspection_->findings(), min_mm_)}, {"warnings", warnings_json(reports_)}});
}

bool Inspector::whole() const { return plan_.range[0] == 0 && plan_.range[1] == plan_.layer_count && !plan_.job.shard; }

}  // namespace lamina::pipeline
