#include "pipeline/output/toolpath_file.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "pipeline/job/decisions.h"
#include "pipeline/job/job.h"
#include "pipeline/job/profiles/extruder.h"
#include "pipeline/output/directory.h"
#include "pipeline/output/print_objects.h"
#include "pipeline/output/thumbnail_text.h"
#include "pipeline/plan/layers.h"
#include "stages/formats/rp3/rp3.h"
#include "stages/heights/evaluate.h"
#include "stages/support/io/file.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/version.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

std::string manifest_path(const Job& job) { return job.output + ".json"; }

/// The layer table of a toolpath file.
std::string table_path(const Job& job) { return fs::path(job.output).replace_extension(".rp3").string(); }

std::string source_text(const Plan& plan) {
  std::string text;
  for (const std::string& name : plan.sections->names()) {
    if (text.size() > 200) return text + ", ...";
    text += (text.empty() ? "" : ", ") + one_line(name);
  }
  return text;
}

/// The slopes that decided the layers, or else the flattest slopes in them.
Result<std::string> layer_table(const Plan& plan) {
  const Job& job = plan.job;
  const auto options = heights_options(job);
  if (!options) return options.error();
  auto own = job.heights.per_part ? decide_heights(job, *plan.scene) : Result<heights::Plan>(heights::Plan());
  if (!own) return own.error();
  const heights::Plan& of = job.heights.per_part ? *own : plan.heights;
  heights::Evaluation evaluation;
  if (of.inspected.empty()) {
    evaluation = heights::evaluate(index_scene(job, *plan.scene, *options), heights::boundaries_of(of.table), *options);
  }
  std::vector<formats::rp3::LayerSetting> layers;
  for (std::uint32_t i = plan.range[0]; i < std::min(plan.range[1], of.table.size()); ++i) {
    const auto& slope = of.inspected.empty() ? evaluation.layers[i].flattest : of.inspected[i];
    layers.push_back({mm(of.table[i].thickness), heights::angle_of(slope)});
  }
  const FillSettings& fill = job.fill.all;
  formats::rp3::Settings settings;
  settings.raster_width_mm = fill.width_mm;
  settings.contour_offset_mm = fill.wall_width_mm > 0 ? fill.wall_width_mm : fill.width_mm;
  settings.angle_step_deg = fill.angle_step_deg;
  settings.first_angle_deg = std::fmod(fill.angle_deg + settings.angle_step_deg * plan.range[0], 360);
  settings.shrink = job.parts.front().shrink;
  settings.rotation_deg = job.parts.front().rotate_deg;
  return formats::rp3::text_of(layers, settings);
}

/// The layer of the file before which every part on the bed has its first `count` layers deposited; the file's first one if it
/// begins above them.
std::uint32_t after_first(const Plan& plan, std::uint32_t count) {
  if (!plan.job.heights.per_part) return std::max(count, plan.range[0]);
  const std::vector<ScheduledLayer>& layers = plan.sections->layers();
  std::vector<bool> on_bed(plan.scene->parts.size());  // parts in the air have no first layer that has to stick
  std::uint32_t after = plan.range[0];
  for (std::uint32_t i = 0; i < layers.size(); ++i) {
    if (layers[i].number == 0) on_bed[layers[i].part] = layers[i].layer.bottom == 0;
    if (layers[i].number < count && on_bed[layers[i].part]) after = std::max(after, i + 1);
  }
  return after;
}

}  // namespace

Status check_toolpath_output(const Job& job, const Extruder& machine) {
  count(Decision::kOutput);
  const bool sml = machine.format == "sml";
  if (sml && table_path(job) == job.output) {
    return Error{Fault::kUsage, fmt::format("-o {}: is the name of its report; end it in .sml", job.output)};
  }
  std::error_code error;
  if (fs::is_directory(job.output, error)) {
    return Error{Fault::kUsage, fmt::format("-o {}: is a directory; name a file in it, as in {}", job.output,
                                            (fs::path(job.output) / "part.gcode").string())};
  }
  if (is_stream(job.output)) {
    if (!job.resume && !sml) return {};
    return Error{Fault::kUsage, fmt::format("-o {}: is not a file, and {} needs one; name a file", job.output,
                                            sml ? "the layer table of an SML file" : "--resume")};
  }
  if (Status status = job.dry_run ? Status() : check_can_write(job.output, false); !status) return status;
  if (Status status = check_not_being_written(job.output); !status) return status;
  if (Status status = LayeredFile::check_part(job.output, manifest_path(job)); !status) return status;
  if (job.overwrite || (job.resume && has_record(manifest_path(job)))) return {};
  // A record whose toolpaths are gone is that of lamina, and replaced.
  const bool gone = !fs::exists(fs::symlink_status(job.output, error)) && has_manifest_head(manifest_path(job));
  std::vector<std::string> names{job.output};
  if (!gone) names.push_back(manifest_path(job));
  if (sml) names.push_back(table_path(job));
  for (const std::string& name : names) {
    if (!fs::exists(fs::symlink_status(name, error))) continue;
    return Error{Fault::kUsage,
                 fmt::format("{}: is there already; replace it with --overwrite, or name another file with -o", name)};
  }
  if (job.resume || !fs::exists(manifest_path(job) + ".part", error)) return {};
  return Error{Fault::kUsage,
               fmt::format("{}.part: belongs to an interrupted job; continue with --resume, or start over with --overwrite",
                           job.output)};
}

ToolpathFile::ToolpathFile(const Plan& plan)
    : plan_(plan),
      raft_(plan_raft(plan.job.extrude, plan.sections->layers().front().layer.thickness)),
      format_(formats::make_extrusion_format(
          plan.moves->profile.machine, {after_first(plan, 1), after_first(plan, plan.moves->profile.machine.fan.from_layer)})) {
  if (plan.moves->profile.machine.code.objects != "none") objects_ = print_objects(*plan.sections);
}

Status ToolpathFile::open() {
  const Job& job = plan_.job;
  ManifestHead head = plan_head(plan_);
  const Extruder& machine = plan_.moves->profile.machine;
  head.format = machine.format;
  head.file = fs::path(job.output).filename().string();
  head.machine = machine.name;
  const std::string profile = pipeline::extruder_text(plan_.moves->profile);
  head.machine_profile = hash_bytes(std::as_bytes(std::span(profile)));
  const auto [width, height] = machine.code.thumbnail_px;
  const std::string picture = width > 0 && height > 0 ? thumbnail_text(*plan_.scene, width, height) : std::string();
  Buffer<char> start;
  format_->head({fmt::format("lamina {}", version()), source_text(plan_), layers(), plan_.segments->any(), objects_, picture},
                start);
  const bool streams = job.dry_run || is_stream(job.output);
  auto file = LayeredFile::open({job.dry_run ? "/dev/null" : job.output, manifest_path(job), job.resume && !job.dry_run,
                                 job.overwrite, job.sync, streams},
                                head, {start.data(), start.size()});
  if (!file) return file.error();
  file_.emplace(std::move(*file));
  return {};
}

std::unique_ptr<formats::LayerMoves> ToolpathFile::layer(const Layer& layer, Buffer<char>& text,
                                                         const formats::LayerSurroundings& around) const {
  formats::LayerSurroundings all = around;
  all.segmented = plan_.segments->any();
  all.objects = objects_;
  const Layer lifted{layer.index + raft_layers(), layer.bottom + raft_.lift, layer.thickness};
  return format_->layer(lifted, layers(), text, all);
}

std::unique_ptr<formats::LayerMoves> ToolpathFile::raft_layer(
    const Layer& layer, Buffer<char>& text, const std::optional<formats::LayerSurroundings::Progress>& progress) const {
  formats::LayerSurroundings around;
  around.progress = progress;
  return format_->layer(layer, layers(), text, around);
}

Result<std::uint64_t> ToolpathFile::finish(const formats::MoveTotals& totals) {
  if (file_->finished()) return file_->size();
  std::optional<File> neighbour;
  if (plan_.moves->profile.machine.format == "sml" && !plan_.job.dry_run) {
    const auto table = layer_table(plan_);
    if (!table) return table.error();
    FileOptions how{.replace = plan_.job.overwrite || plan_.job.resume};
    if (plan_.job.sync == Sync::kOff) how.durable = Durable::kNo;
    auto file = File::open(table_path(plan_.job), how);
    Status status = file ? file->append(std::string_view(*table)) : Status(file.error());
    if (status) status = file->flush();
    if (!status) return status.error();
    neighbour.emplace(std::move(*file));
  }
  Buffer<char> end;
  format_->tail(totals, layers(), end);
  return file_->finish({end.data(), end.size()}, [&]() -> Status {
    std::error_code error;  // the older manifest goes before anything that it speaks of
    if (!plan_.job.dry_run && !is_stream(plan_.job.output)) fs::remove(manifest_path(plan_.job), error);
    if (error) return Error{Fault::kOutput, fmt::format("{}: {}", manifest_path(plan_.job), error.message())};
    const auto named = neighbour ? neighbour->finish() : FileDigest();
    return named ? Status() : Status(named.error());
  });
}

void ToolpathFile::discard() {
  if (file_) file_->discard();
}

}  // namespace lamina::pipeline
