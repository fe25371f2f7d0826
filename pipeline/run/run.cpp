#include "pipeline/run/run.h"

#include <fmt/format.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <span>

#include "pipeline/flow/layers.h"
#include "pipeline/output/directory.h"
#include "pipeline/output/job_container.h"
#include "pipeline/output/slice_files.h"
#include "pipeline/output/toolpath_file.h"
#include "pipeline/report/heights_study.h"
#include "pipeline/report/image_observers.h"
#include "pipeline/report/path_observers.h"
#include "pipeline/report/timing.h"
#include "pipeline/run/image_maker.h"
#include "pipeline/run/job_checks.h"
#include "pipeline/run/path_makers.h"
#include "pipeline/run/sample.h"
#include "pipeline/run/space.h"
#include "stages/checks/layer_warnings.h"
#include "stages/support/text/number_text.h"

namespace lamina::pipeline {
namespace {

/// Refuses protected output before parts are loaded.
Status check_output_of(const Resolved& resolved) {
  switch (resolved.product) {
    case Product::kImages:
      return resolved.job.container == Container::kZip ? check_container(resolved.job) : check_output(resolved.job);
    case Product::kContours: return check_slice_output(resolved.job);
    case Product::kMoves: return check_toolpath_output(resolved.job, resolved.extruder->machine);
  }
  return {};
}

std::unique_ptr<Maker> make_maker(const Plan& plan, JobChecks& checks, const FlowLimits& limits) {
  switch (plan.product) {
    case Product::kImages: return make_image_maker(plan, checks, limits);
    case Product::kContours: return make_contour_maker(plan, checks, limits);
    case Product::kMoves: break;
  }
  return make_move_maker(plan, checks, limits);
}

void count_layers(const Plan& plan, Summary& summary) {
  summary.layers_total = plan.layer_count;
  if (plan.layer_count == 0) return;
  const Layer highest = plan.layer(plan.layer_count - 1);
  summary.height_mm = mm(std::int64_t{highest.bottom} + highest.thickness);
}

Summary summary_of(const Plan& plan) {
  Summary summary;
  summary.product = plan.product;
  summary.dry_run = plan.job.dry_run;
  summary.output = plan.job.output;
  summary.layer_text = text_of(plan.job.heights, plan.job.layer_mm);
  const auto& first_mm = plan.job.extrude.first_thickness_mm;
  if (plan.moves && first_mm && plan.job.extrude.raft_layers == 0 && *first_mm != plan.job.layer_mm)
    summary.layer_text += fmt::format(", the first of {} mm", number_text(*first_mm));
  const std::string small = small_peaks_text(plan.heights, plan.job.heights.min_flat_mm2);
  if (!small.empty()) summary.layer_text += "; " + small;
  summary.triangles = plan.triangles;
  summary.load_seconds = plan.load_seconds;
  summary.index_seconds = plan.index_seconds;
  summary.memory_budget_bytes = plan.job.memory_bytes;
  summary.parts = plan.scene->parts;
  summary.warnings = plan.warnings;
  count_layers(plan, summary);
  if (plan.product == Product::kImages) report_image_plan(plan, summary);
  if (plan.product == Product::kMoves) report_move_plan(plan, summary);
  return summary;
}

/// The maker's steps as those of the flow. layer_at  by position; outlives them
LayerSteps steps_of(Maker& maker, const std::function<std::uint32_t(std::uint32_t)>& layer_at,
                    const std::function<void()>& recorded) {
  LayerSteps steps;
  steps.bytes_of = [&](std::uint32_t position) { return maker.bytes_of(layer_at(position)); };
  for (MakerStep& step : maker.steps()) {
    Step& made = steps.steps.emplace_back();
    made.name = step.name;
    made.run = [&layer_at, run = std::move(step.run)](const Ticket& ticket) { return run(layer_at(ticket.position), ticket); };
    if (!step.needs) continue;
    made.needs = [&layer_at, needs = std::move(step.needs)](const Ticket& ticket) {
      return needs(layer_at(ticket.position), ticket);
    };
  }
  steps.record = [&](const Ticket& ticket) {
    const Status status = maker.record(layer_at(ticket.position), ticket);
    if (status) recorded();
    return status;
  };
  steps.bytes_held = [&](std::uint32_t work) { return maker.bytes_held(work); };
  steps.extra_bytes = [&] { return maker.extra_bytes(); };
  steps.let_go = [&](std::uint32_t work) { maker.let_go(work); };
  steps.records_from_work = maker.records_from_work();
  return steps;
}

/// Ends a job early: makes the error and keeps or removes its files. shared  an earlier run, or another shard, has made some
Error ended_early(Maker& maker, const Error& error, bool any_layer, bool shared) {
  const bool interrupted = error.fault == Fault::kInterrupted;
  const bool kept = interrupted || error.fault == Fault::kOutput || error.fault == Fault::kMemory;
  const bool keep = maker.keeps() && (shared || (kept && (any_layer || !maker.records_from_work())));
  if (Status stopped = maker.stop(keep); !stopped && interrupted) return stopped.error();
  if (interrupted) {
    return {Fault::kInterrupted, keep        ? "interrupted; finished layers are kept, run again with --resume to continue"
                                 : any_layer ? "interrupted; nothing of it is kept"
                                             : "interrupted before the first layer; nothing was written"};
  }
  if (!keep) return error;
  return {error.fault, error.message + "; finished layers are kept, continue with --resume"};
}

void report_flow(const FlowReport& report, const Elapsed& layers, Timing& timing) {
  timing.phases.push_back({"layers", layers});
  timing.nodes = report.nodes;
}

bool cut_short(const Status& status) {
  return !status && (status.error().fault == Fault::kInterrupted || status.error().fault == Fault::kMemory);
}

/// Collects the warnings while the files are unfinished still, and refuses empty jobs or, if strict, any warning. Then
/// nothing stays, unless an earlier run had made a part of it.
Status check_job(const Plan& plan, Maker& maker, const JobChecks& checks, bool shared, Summary& summary) {
  maker.warn(summary, summary.warnings);
  Status status = checks.end(summary.warnings);
  if (status && plan.job.strict) status = checks::refuse_warnings(summary.warnings);
  if (status) return {};
  if (cut_short(status)) return status;
  if (shared) {
    static_cast<void>(maker.stop(true));
  } else {
    maker.discard();
  }
  return status;
}

/// Lets the flow decide the layers of a plan whose layers are undecided. decided  called once they are all in the plan
void stream_layers(Plan& plan, LayerSteps& steps, const std::function<Status()>& decided) {
  steps.decide = [&plan](std::uint32_t position) { return plan.undecided->decide(position, plan.heights); };
  steps.decided = [&plan, decided] {
    plan.layer_count = plan.heights.table.size();
    plan.range = {0, plan.layer_count};
    return decided();
  };
}

/// Makes the remaining layers. errors  of the lowest failing layer
Status make_layers(Plan& plan, Maker& maker, JobChecks& checks, const FlowLimits& limits, Summary& summary,
                   const ProgressCallback& progress, const std::atomic<bool>& cancel) {
  auto todo = maker.open();
  if (!todo) return todo.error();
  const std::vector<LayerRecord> kept = maker.kept();
  for (const LayerRecord& record : kept) maker.add_kept(record);
  summary.layers_kept = static_cast<std::uint32_t>(kept.size());
  std::uint32_t layers = plan.range[1] - plan.range[0];
  std::uint32_t done = layers - static_cast<std::uint32_t>(todo->size());
  progress({ProgressEvent::Stage::kLayers, done, layers});
  const Stopwatch moving;
  const std::function<void()> recorded = [&] { progress({ProgressEvent::Stage::kLayers, ++done, layers}); };
  const std::function<std::uint32_t(std::uint32_t)> layer_at = [&](std::uint32_t position) {
    return plan.undecided ? position : (*todo)[position];
  };
  LayerSteps steps = steps_of(maker, layer_at, recorded);
  if (plan.undecided) {
    stream_layers(plan, steps, [&] {
      layers = plan.layer_count;
      count_layers(plan, summary);
      checks.count_layers();
      return maker.start();
    });
  }
  const bool shared = !kept.empty() || plan.job.shard;
  FlowReport report;
  const std::uint32_t count = plan.undecided ? plan.undecided->max_layers() : static_cast<std::uint32_t>(todo->size());
  const Status moved = flow_layers(count, steps, limits, cancel, report);
  if (!moved) return ended_early(maker, moved.error(), done > 0, shared);
  summary.layers_planned = done - summary.layers_kept;
  if (Status status = check_job(plan, maker, checks, shared, summary); !status) {
    return cut_short(status) ? ended_early(maker, status.error(), done > 0, shared) : status;
  }
  if (Status status = maker.finish(); !status) return ended_early(maker, status.error(), done > 0, shared);
  const Elapsed moved_in = moving.elapsed();
  summary.layer_seconds = moved_in.wall;
  for (const NodeTime& step : std::span(report.nodes).last(steps.steps.size() + 1))
    summary.step_seconds.emplace_back(step.name, step.busy.wall);
  summary.max_layers_in_flight = report.max_in_flight;
  summary.peak_layer_bytes = report.max_bytes;
  summary.oversized_layers = report.oversized;
  if (summary.timing) report_flow(report, moved_in, *summary.timing);
  return {};
}

/// What the plan took, to be completed by what follows.
std::shared_ptr<Timing> timing_of(const Plan& plan, const Elapsed& before) {
  auto timing = std::make_shared<Timing>();
  timing->threads = layers_in_flight() / 2;
  timing->phases = {{"start", before},
                    {"load", {plan.load_seconds, plan.load_processor_seconds}},
                    {"index", {plan.index_seconds, plan.index_processor_seconds}}};
  return timing;
}

/// Measures the minimum that any program would need for the same images.
void report_floor(const Plan& plan, const Maker& maker, const std::atomic<bool>& cancel, const Summary& summary,
                  Timing& timing) {
  if (plan.product != Product::kImages) return;
  std::vector<std::string> parts;
  for (const PartSummary& part : plan.scene->parts) parts.push_back(part.path);
  formats::Floor& floor = timing.floor.emplace();
  floor.bytes_written = summary.bytes_written;
  floor.files = summary.bytes_written == 0 ? 0 : summary.layers_planned;
  floor.crossings = maker.crossings();
  std::error_code error;
  const bool is_folder = std::filesystem::is_directory(plan.job.output, error);
  const std::string neighbour = is_folder ? plan.job.output + "/" + manifest_name(plan.job) : plan.job.output;
  if (Status status = formats::measure_floor(parts, neighbour, cancel, floor); !status)
    timing.not_measured = status.error().message;
}

}  // namespace

Result<Summary> run(const Job& job, Product product, const ProgressCallback& progress, const std::atomic<bool>& cancel) {
  auto resolved = resolve(job, product);
  return resolved ? run(std::move(*resolved), progress, cancel) : resolved.error();
}

Result<Summary> run(Resolved resolved, const ProgressCallback& progress, const std::atomic<bool>& cancel) {
  const Product product = resolved.product;
  const double before = process_seconds();
  std::optional<tbb::global_control> threads;
  if (resolved.job.threads > 0) threads.emplace(tbb::global_control::max_allowed_parallelism, resolved.job.threads);
  if (!resolved.job.dry_run) {
    if (Status status = check_output_of(resolved); !status) return status.error();
  }
  resolved.streams_layers = true;
  auto plan = make_plan(std::move(resolved), progress);
  if (!plan) return plan.error();
  if (cancel) return Error{Fault::kInterrupted, "interrupted before the first layer; nothing was written"};

  const Job& job = plan->job;
  if (Status status = checks::refuse_warnings(plan->warnings); job.strict && !status) return status.error();
  FlowLimits limits;
  limits.budget_bytes = job.memory_bytes;
  limits.max_in_flight = layers_in_flight();
  limits.processor_times = job.timing;
  limits.record_slots = 2 * limits.max_in_flight;  // some layers wait for an older one, in a single file with their scratch
  if (product != Product::kImages || job.container != Container::kNone) limits.max_in_flight = limits.record_slots;
  Summary summary = summary_of(*plan);
  if (job.timing) summary.timing = timing_of(*plan, {before, before});
  if (Status status = check_space(*plan, summary); !status) return status.error();
  JobChecks checks(*plan, cancel);
  const std::unique_ptr<Maker> maker = make_maker(*plan, checks, limits);
  if (job.dry_run && !maker->times_dry_runs()) {
    for (std::uint32_t i = plan->range[0]; i < plan->range[1]; ++i) {
      summary.peak_layer_bytes = std::max(summary.peak_layer_bytes, maker->bytes_of(i));
    }
    summary.estimated_layer_seconds = sample_layers(*maker, plan->range, cancel);
  } else if (Status status = make_layers(*plan, *maker, checks, limits, summary, progress, cancel); !status) {
    return status.error();
  }
  maker->report(summary);
  summary.peak_resident_bytes = peak_resident_bytes();
  if (summary.timing) report_floor(*plan, *maker, cancel, summary, *summary.timing);
  return summary;
}

}  // namespace lamina::pipeline
