#include "pipeline/run/extrude.h"
#include "pipeline/flow/progress.h"
#include "pipeline/text/version.h"

#include <fmt/format.h>
#include <tbb/global_control.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <optional>
#include <span>

#include "pipeline/flow/layer_flow.h"
#include "pipeline/plan/heights_study.h"
#include "pipeline/plan/layer_cut.h"
#include "pipeline/run/extrude_layer.h"
#include "pipeline/run/slice.h"
#include "pipeline/text/json_text.h"
#include "pipeline/text/number_text.h"
#include "stages/write/file.h"

namespace lamina::pipeline {
namespace {

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

std::string source_text(const SlicePlan& plan) {
  std::string text;
  for (const std::string& name : plan.names()) {
    if (text.size() > 200) return text + ", ...";
    text += (text.empty() ? "" : ", ") + one_line(name);
  }
  return text;
}

/// What a person is told of each range of heights before anything is printed.
void predict(const SegmentPlan& segments, const segment::Calibration& calibration, ExtrudeSummary& summary) {
  const auto one = [&](const SegmentRange& range, const std::string& heights) {
    if (!range.settings.on) return;
    for (const std::string& warning : segment::warnings(range.plan, calibration)) {
      summary.warnings.push_back(heights.empty() ? warning : heights + ": " + warning);
    }
    summary.pores.emplace_back(heights, segment::predict_pores(range.plan));
  };
  one(segments.base, "");
  for (const SegmentRange& range : segments.ranges) {
    one(range, fmt::format("{} to {} mm", number_text(mm(range.from)), number_text(mm(range.to))));
  }
}

/// The name of the report on a file of toolpaths.
std::string report_name(const std::string& output) { return std::filesystem::path(output).replace_extension(".rp3").string(); }

/// The layers of an SML file as the .rp3 report that belongs to it.
Status write_layer_table(const Job& job, const SlicePlan& plan, const std::array<std::uint32_t, 2>& range) {
  const auto study = study_heights(job, plan.scene());
  if (!study) return study.error();
  write::rp3::Settings settings;
  settings.raster_width_mm = job.fill.all.width_mm;
  settings.contour_offset_mm = job.fill.all.wall_width_mm > 0 ? job.fill.all.wall_width_mm : job.fill.all.width_mm;
  settings.angle_step_deg = job.fill.all.angle_step_deg;
  settings.first_angle_deg = std::fmod(job.fill.all.angle_deg + settings.angle_step_deg * range[0], 360);
  settings.shrink = job.parts.front().shrink;
  settings.rotation_deg = job.parts.front().rotate_deg;
  const std::string text = heights_rp3(*study, range, settings);
  return write::write_file(report_name(job.output), std::as_bytes(std::span(text)));
}

/// A point of stored toolpaths comes to some 40 bytes of text, a path to tags, the way to it and filament drawn back.
constexpr std::size_t kTextOfPoint = 48, kTextOfPath = 128;
/// A layer's text waits until those before it are written. What segmented lines come to beyond these bytes, and beyond
/// what the plain filling takes, does not wait: such a layer is written a piece at a time when its turn comes.
constexpr std::size_t kWaitingText = 1 << 17, kPieceOfText = 1 << 16;

struct Work {
  SlicePlan::Work layer;
  Buffer<char> text;
  std::optional<LayerExtrusion> sums;  // none: the layer's text is made when it is recorded
};

}  // namespace

Result<ExtrudeSummary> run_extrude(const Job& asked, const ProgressCallback& progress, const std::atomic<bool>& cancel) {
  std::optional<tbb::global_control> threads;
  if (asked.threads > 0) threads.emplace(tbb::global_control::max_allowed_parallelism, asked.threads);
  Job job = asked;
  const auto profile = resolve_extruder(job);
  if (!profile) return profile.error();
  const Extruder& machine = profile->machine;
  job.bed_mm = machine.bed.size_mm;
  job.machine.decides_bed = true;
  const auto segments = plan_segments(job.segment, profile->calibration, job.fill);
  if (!segments) return segments.error();

  ExtrudeSummary summary;
  if (job.shard) return Error{Fault::kUsage, fmt::format("run.shard: {}", kNoShards)};
  summary.output = job.output;
  summary.machine = machine.name;
  const auto plan = SlicePlan::make(job, progress);
  if (!plan) return plan.error();
  if (cancel) return Error{Fault::kInterrupted, "interrupted before the first layer; nothing was written"};
  const auto total = static_cast<std::uint32_t>(plan->layers().size());
  const auto range = layer_range(job, total);
  if (!range) return range.error();
  const auto [first, last] = *range;
  summary.layers = last - first;
  summary.parts = plan->scene().parts;
  summary.load_seconds = plan->load_seconds;
  summary.index_seconds = plan->index_seconds;
  for (const Instance& instance : plan->scene().instances)
    summary.triangles += plan->scene().meshes[instance.mesh].triangles.size();
  const Layer& highest = plan->layers().back().layer;
  summary.height_mm = mm(std::int64_t{highest.bottom} + highest.thickness);
  if (mm(plan->scene().height) > machine.bed.build_height_mm) {
    return Error{Fault::kUsage, fmt::format("the parts are {:.3f} mm high, {} builds {:.3f} mm; lay them down or scale them",
                                            mm(plan->scene().height), machine.name, machine.bed.build_height_mm)};
  }
  if (machine.format == "sml" && report_name(job.output) == job.output) {
    return Error{Fault::kUsage, fmt::format("-o {}: is the name of its report; end it in .sml", job.output)};
  }
  const auto format = machine.format == "sml" ? write::make_sml_format(machine) : write::make_gcode_format(machine);
  for (std::uint32_t i = first; i < last; ++i) {
    if (Status status = format->check(plan->layers()[i].layer); !status) return status.error();
  }
  if (!plan->fills()) {
    summary.warnings.push_back("nothing is asked for: no walls and no filling; give --walls, --fill or both");
  }
  if (Status status = check_thin_stretches(*segments, *plan); !status) return status.error();
  predict(*segments, profile->calibration, summary);
  if (segments->any() && !profile->own_calibration && machine.name != "Anet A8") {
    summary.warnings.push_back(
        fmt::format("{} has no calibration of its own; widths and limits are those measured on an Anet A8: "
                    "lamina calibrate makes one",
                    machine.name));
  }
  if (job.dry_run) {
    for (std::uint32_t i = first; i < last; ++i)
      summary.peak_layer_bytes = std::max(summary.peak_layer_bytes, plan->bytes_bound(i));
    summary.peak_resident_bytes = peak_resident_bytes();
    return summary;
  }

  // --- file
  auto file = write::File::open(job.output);
  if (!file) return file.error();
  Buffer<char> text;
  format->head({fmt::format("lamina {}", version()), source_text(*plan), summary.layers, segments->any()}, text);
  if (Status status = file->append(text); !status) return status.error();

  // --- layers
  std::atomic<std::int64_t> plan_ns{0}, write_ns{0};
  const auto timed = [](std::atomic<std::int64_t>& sum, Clock::time_point from) {
    sum += std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now() - from).count();
  };
  const auto prepare = [&](std::uint32_t i, Work& work) -> Result<std::uint64_t> {
    const auto from = Clock::now();
    if (Status status = plan->contours(first + i, work.layer); !status) return status.error();
    timed(plan_ns, from);
    auto bytes = plan->fill_bytes_bound(first + i, work.layer, {kTextOfPoint, 0, kTextOfPath});
    if (bytes && segments->any()) *bytes += 2 * kWaitingText;
    return bytes;
  };
  const auto expand = [&](std::uint32_t i, Work& work) -> Result<std::uint64_t> {
    auto from = Clock::now();
    if (Status status = plan->fill(first + i, work.layer); !status) return status.error();
    timed(plan_ns, from);
    from = Clock::now();
    work.text.clear();
    const ScheduledLayer& layer = plan->layers()[first + i];
    const auto out = format->layer(layer.layer, summary.layers, work.text);
    const std::size_t most = segments->any() ? std::max(kWaitingText, kTextOfPoint * work.layer.paths.point.size()) : SIZE_MAX;
    auto sums = extrude_layer(*plan, *segments, machine, layer, work.layer, {work.text, most, [] { return false; }}, *out);
    if (!sums) return sums.error();
    work.sums = *sums;
    if (!work.sums) Buffer<char>().swap(work.text);
    timed(write_ns, from);
    return work.layer.bytes() + bytes_held(work.text);
  };
  LayerExtrusion sums;
  std::uint32_t done = 0, open_layers = 0, undivided_layers = 0;
  std::string first_open, first_undivided;
  const auto write_pieces = [&](const ScheduledLayer& layer, Work& work) -> Status {
    const auto from = Clock::now();
    text.clear();
    Status status;
    const auto give = [&] {
      status = file->append(text);
      text.clear();
      return status.ok();
    };
    const auto out = format->layer(layer.layer, summary.layers, text);
    auto made = extrude_layer(*plan, *segments, machine, layer, work.layer, {text, kPieceOfText, give}, *out);
    if (!made) return made.error();
    if (!status) return status;
    work.sums = *made;
    timed(write_ns, from);
    return file->append(text);
  };
  const auto record = [&](std::uint32_t i, Work& work) -> Status {
    if (Status status = work.sums ? file->append(work.text) : write_pieces(plan->layers()[first + i], work); !status)
      return status;
    const segment::SegmentCounts& counts = work.sums->segments;
    if (i == 0) summary.first_layer_points = counts.points();
    sums.add(*work.sums);
    const Layer& layer = plan->layers()[first + i].layer;
    if (counts.lines > 0 && counts.thin == 0 && ++undivided_layers == 1) {
      first_undivided = fmt::format("in layer {} at z {:.3f} mm", first + i, mm(layer.plane()));
    }
    if (work.layer.report.gaps.open > 0 && ++open_layers == 1) {
      first_open = fmt::format("in layer {} at z {:.3f} mm", first + i, mm(layer.plane()));
    }
    progress({ProgressEvent::Stage::kLayers, ++done, summary.layers});
    return {};
  };
  FlowLimits limits;
  limits.budget_bytes = job.memory_bytes;
  limits.most_in_flight =
      4 * static_cast<std::uint32_t>(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism));
  FlowReport flow;
  const auto start = Clock::now();
  const auto bytes_of = [&](std::uint32_t i) { return plan->bytes_bound(first + i); };
  const LayerSteps<Work> steps{bytes_of, prepare, expand, record};
  if (Status status = flow_layers(summary.layers, steps, limits, cancel, flow); !status) return status.error();
  text.clear();
  format->tail(sums.totals, summary.layers, text);
  if (Status status = file->append(text); !status) return status.error();
  summary.bytes_written = file->size();
  if (const auto written = file->finish(); !written) return written.error();

  if (machine.format == "sml") {
    if (Status status = write_layer_table(job, *plan, *range); !status) return status.error();
  }

  summary.totals = sums.totals;
  summary.segments = sums.segments;
  summary.porosity = sums.porosity;
  summary.points = sums.points;
  const double filament = machine.material.filament_mm;
  summary.filament_cm3 = sums.totals.filament_mm * std::numbers::pi / 4 * filament * filament / 1000;
  summary.filament_g = summary.filament_cm3 * machine.material.density_g_cm3;
  summary.layer_seconds = seconds_since(start);
  summary.plan_seconds = static_cast<double>(plan_ns) * 1e-9;
  summary.write_seconds = static_cast<double>(write_ns) * 1e-9;
  summary.most_in_flight = flow.most_in_flight;
  summary.peak_layer_bytes = flow.most_bytes;
  summary.peak_resident_bytes = peak_resident_bytes();
  if (open_layers > 0) {
    summary.warnings.push_back(
        fmt::format("chains of cuts stay open in {} layers, first {}: they bound nothing and are left out; "
                    "leave out --no-repair to close the parts",
                    open_layers, first_open));
  }
  if (undivided_layers > 0) {
    summary.warnings.push_back(fmt::format(
        "segment.thin_mm: longer than every segmented line less its ends in {} of {} layers, first {}: no pores there",
        undivided_layers, summary.layers, first_undivided));
  }
  if (plan->fills() && sums.totals.moves == 0) {
    summary.warnings.push_back("no bead fits into the parts: they are narrower than the walls and the filling ask for");
  }
  return summary;
}

}  // namespace lamina::pipeline
