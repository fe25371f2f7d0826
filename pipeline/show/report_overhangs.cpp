#include "pipeline/show/report_overhangs.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <utility>

#include "pipeline/machine/profiles.h"
#include "pipeline/plan/layers.h"
#include "pipeline/plan/overhangs.h"
#include "stages/heights/heights.h"

namespace lamina::pipeline {

Result<ReportOverhangs> overhangs_of_job(const Manifest& manifest, const Job& job, const Scene& scene, const Box& drawn) {
  ReportOverhangs report;
  const std::vector<LayerRecord>& records = manifest.layers;
  if (records.size() != manifest.head.layer_count) return report;
  heights::LayerTable table;
  for (const LayerRecord& record : records) table.add(record.layer.thickness, record.layer.reason);
  auto schedule = schedule_layers(job, scene, table);
  if (!schedule) return schedule.error();
  if (job.heights.per_part) drop_empty_top(scene, job.heights.containment, *schedule);
  Job cut = job;
  cut.slice.tolerance_um = 0;
  auto sections = Sections::make(cut, scene, std::move(*schedule), {});
  if (!sections) return sections.error();
  constexpr std::uint32_t kKept = 64;  // layers whose contours their neighbours need
  const Overhangs overhangs(*sections, job.support_angle_deg, kKept);
  const auto count = static_cast<std::uint32_t>(std::min(sections->layers().size(), records.size()));
  std::vector<LayerOverhang> found(count);
  std::vector<Status> status(count);
  tbb::parallel_for(std::uint32_t{0}, count, [&](std::uint32_t i) {
    auto made = overhangs.at(i);
    made ? void(found[i] = std::move(*made)) : void(status[i] = made.error());
  });
  for (std::uint32_t i = 0; i < count; ++i) {
    if (!status[i]) return status[i].error();
    report.tally.add(records[i].layer, found[i]);
    report.area_mm2.push_back(found[i].area_mm2);
  }
  report.area_mm2.resize(records.size());
  const auto profile = resolve_extruder(job);
  const std::array<double, 2> corner = profile ? profile->machine.bed.corner_mm : std::array<double, 2>{};
  for (const checks::OverhangTally::Location& location : report.tally.largest()) {
    ReportLocation position;
    position.code = "overhangs";
    position.x_mm = location.x_mm;
    position.y_mm = location.y_mm;
    position.column_mm = location.x_mm + corner[0] - mm(drawn.lo.x);
    position.row_mm = mm(drawn.hi.y) - location.y_mm - corner[1];
    position.z_mm = location.z_mm;
    const auto above = std::ranges::find_if(
        records, [&](const LayerRecord& r) { return mm(std::int64_t{r.layer.bottom} + r.layer.thickness) > location.z_mm; });
    position.layer = position.last_layer = static_cast<std::uint32_t>(above - records.begin());
    position.amount = location.area_mm2;
    position.unit = "mm2";
    report.positions.push_back(position);
  }
  return report;
}

}  // namespace lamina::pipeline
