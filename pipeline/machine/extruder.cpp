#include "pipeline/machine/extruder.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <vector>

#include "pipeline/job/lists/named_files.h"
#include "pipeline/machine/profiles.h"
#include "stages/bead/predicted_tables.h"
#include "stages/geometry/bead_section.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/key.h"
#include "stages/support/text/names.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {

Result<ExtruderProfile> resolve_extruder(const Job& job) {
  if (Status status = read::check_there(job.missing, job.machine.profile, {}); !status) return status.error();
  auto found = find_extruder(job.machine.profile.empty() ? "marlin" : job.machine.profile);
  if (!found) return Error{found.error().fault, "--machine: " + found.error().message};
  ExtruderProfile& profile = *found;
  for (const auto& [name, value] : job.extrude.machine) {
    if (const std::string wrong = read::set_extruder_key(name, value, profile); !wrong.empty()) {
      return Error{Fault::kUsage, fmt::format("extrude.machine: {}", wrong)};
    }
  }
  const ExtrudeRequest& r = job.extrude;
  Extruder& m = profile.machine;
  if (r.flow) m.material.flow = *r.flow;
  if (r.nozzle_degc) m.material.nozzle_degc = m.material.first_nozzle_degc = *r.nozzle_degc;
  if (r.bed_degc) m.material.bed_degc = m.material.first_bed_degc = *r.bed_degc;
  if (r.print_mm_s) m.speed.print_mm_s = *r.print_mm_s;
  if (r.wall_mm_s) m.speed.wall_mm_s = m.speed.inner_wall_mm_s = *r.wall_mm_s;
  if (r.first_layer_mm_s) m.speed.first_layer_mm_s = *r.first_layer_mm_s;
  if (r.travel_mm_s) m.speed.travel_mm_s = *r.travel_mm_s;
  if (r.retraction_mm) m.retraction.length_mm = *r.retraction_mm;
  if (r.fan_percent) m.fan.percent = *r.fan_percent;
  if (r.skirt_loops) m.skirt.loops = *r.skirt_loops;
  if (r.relative_extrusion) m.code.relative_extrusion = *r.relative_extrusion;
  return found;
}

constexpr std::string_view kPublished = "Anet A8";  // whose widths Di Nisio 2022 measured

constexpr double kLeastLag = 1e-3;  // s; what lags less makes no thin stretches

bool has_measured_widths(const ExtruderProfile& profile) {
  return profile.own_calibration || profile.machine.name == kPublished;
}

void predict_calibration(const Job& job, ExtruderProfile& profile) {
  const Extruder& m = profile.machine;
  if (has_measured_widths(profile) || !(m.material.lag_s >= kLeastLag)) return;
  const double width = job.fill.all.width_mm, height = job.layer_mm;
  const double area = bead_area(width, height, m.material.shape()) * m.material.flow;
  if (!(area > 0)) return;  // layers that are too thick for such beads are refused elsewhere
  profile.calibration =
      bead::predicted_tables({area, m.material.lag_s, m.speed.acceleration_mm_s2}, width, height, m.speed.print_mm_s);
  profile.predicted_calibration = true;
}

bool is_named(const Job& job, std::string_view key) { return std::ranges::find(job.named, key) != job.named.end(); }

void leave_to_machine(const Extruder& machine, Job& job) {
  if (!is_named(job, "fill.walls")) job.fill.all.walls = 1;
  if (is_named(job, "layers.thickness_mm") || !job.heights.thickness_mm.empty()) return;
  const bool listed = machine.format == "sml" && !machine.sml.pd.empty();
  job.layer_mm = listed ? machine.sml.pd.front().thickness_mm : machine.material.nozzle_mm / 2;
}

}  // namespace lamina::pipeline
