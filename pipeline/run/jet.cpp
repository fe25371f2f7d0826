#include "pipeline/run/jet.h"
#include "pipeline/flow/progress.h"

#include <fmt/core.h>
#include <tbb/global_control.h>
#include <tbb/info.h>

#include <algorithm>
#include <chrono>
#include <optional>

#include "pipeline/flow/graph.h"
#include "pipeline/machine/materials.h"
#include "pipeline/machine/powder_printer.h"
#include "pipeline/output/directory.h"
#include "pipeline/output/manifest.h"
#include "pipeline/output/print_program.h"
#include "pipeline/output/resume.h"
#include "pipeline/plan/heights.h"
#include "pipeline/plan/porous_plan.h"
#include "pipeline/plan/reach.h"
#include "pipeline/plan/solids.h"
#include "pipeline/run/layer_workshop.h"
#include "stages/write/image_format.h"

namespace lamina::pipeline {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// One line about rows that only repair closes, or that stay open, and where the first of them is.
class RowWarnings {
 public:
  void add(const LayerOutcome& outcome, const PixelGrid& grid, JetSummary& summary) {
    const raster::LayerReport& report = outcome.report;
    summary.capped_rows += report.capped_rows;
    note(capped_, outcome.record.layer, report.capped_rows, report.first_capped_row, report.first_capped_instance, grid);
    note(open_, outcome.record.layer, report.open_rows, report.first_open_row, 0, grid);
  }

  void finish(const Scene& scene, JetSummary& summary) const {
    if (capped_.rows > 0) {
      const std::uint32_t part = scene.part_of_instance[capped_.instance];
      summary.warnings.push_back(fmt::format(
          "{}: {} rows in {} layers are closed only by the caps put over its openings, first {}; look at `lamina info`",
          scene.parts[part].path, capped_.rows, capped_.layers, capped_.place));
    }
    if (open_.rows > 0) {
      summary.warnings.push_back(
          fmt::format("{} rows in {} layers stay open, first {}; each is drawn up to its last crossing; leave out "
                      "--no-repair to close the parts",
                      open_.rows, open_.layers, open_.place));
    }
  }

 private:
  struct Tally {
    std::uint64_t rows = 0;
    std::uint32_t layers = 0, instance = 0;
    std::string place;
  };
  static void note(Tally& tally, const Layer& layer, std::uint32_t rows, std::uint32_t first_row, std::uint32_t instance,
                   const PixelGrid& grid) {
    if (rows == 0) return;
    if (tally.rows == 0) {
      tally.place = fmt::format("in layer {} at y {:.3f} mm, z {:.3f} mm (image row {})", layer.index,
                                mm(grid.y.centre(first_row)), mm(layer.plane()), grid.rows() - 1 - first_row);
      tally.instance = instance;
    }
    tally.rows += rows;
    ++tally.layers;
  }
  Tally capped_, open_;
};

/// The layers of the range that are still to do, and the records that stand, by resume.
struct LayerPlan {
  std::vector<Layer> todo;
  std::vector<LayerRecord> kept;
};

Result<LayerPlan> plan_layers(const Job& job, const ManifestHead& head, const heights::LayerTable& table) {
  LayerPlan plan;
  if (job.resume) {
    auto kept = layers_that_hold(job.output, manifest_name(job), head);
    if (!kept) return kept.error();
    plan.kept = std::move(*kept);
  }
  auto next_kept = plan.kept.begin();
  for (std::uint32_t index = head.first_layer; index < head.last_layer; ++index) {
    if (next_kept != plan.kept.end() && next_kept->layer.index == index) {
      ++next_kept;
    } else {
      plan.todo.push_back(table[index]);
    }
  }
  return plan;
}

}  // namespace

Result<JetSummary> run_jet(const Job& asked, const ProgressCallback& progress, const std::atomic<bool>& cancel) {
  std::optional<tbb::global_control> threads;
  if (asked.threads > 0) threads.emplace(tbb::global_control::max_allowed_parallelism, asked.threads);
  Job job = asked;
  if (auto status = resolve_machine(job); !status) return status.error();
  JetSummary summary;
  summary.directory = job.output;

  if (job.heights.per_part) {
    return Error{Fault::kUsage, "--per-part: a powder bed has one table of layers for all parts; leave it out"};
  }
  const write::ImageFormat* format = write::find_image_format(job.format);
  if (format == nullptr) return Error{Fault::kUsage, fmt::format("unknown format '{}'", job.format)};

  const Result<Materials> materials = materials_of(job);
  if (!materials) return materials.error();

  // --- parts
  auto start = Clock::now();
  progress({ProgressEvent::Stage::kLoading});
  const PixelGrid grid = grid_of(job);
  const auto filled = PorousPlan::asked(job);
  if (!filled) return filled.error();
  std::optional<PorousPlan> porous;
  if (*filled) {
    auto made = PorousPlan::make(job, grid, progress);
    if (!made) return made.error();
    porous.emplace(std::move(*made));
    summary.warnings = porous->warnings();
  }
  // The slicer points into its own meshes, the rasterizer takes those it is given.
  auto scene = porous ? Result<Scene>(porous->slices().scene()) : load_scene(job);
  if (!scene) return scene.error();
  summary.seconds.load = seconds_since(start);
  if (cancel) return Error{Fault::kInterrupted, "interrupted before the first layer"};

  if (auto status = check_reach(job, *scene); !status) return status.error();
  const Result<heights::LayerTable> decided = layer_table(job, *scene);
  if (!decided) return decided.error();
  const heights::LayerTable& table = *decided;
  Result<std::string> steps = check_build_steps(job, table);
  if (!steps) return steps.error();
  if (!steps->empty()) summary.warnings.push_back(std::move(*steps));
  if (job.dose.core == 0 &&
      static_cast<double>(nm_of(job.dose.shell_mm)) * std::max(grid.x.pixels_per_nm(), grid.y.pixels_per_nm()) < 1) {
    summary.warnings.push_back(
        "dose.core: 0 without a shell of at least a pixel jets no drop, the parts stay loose powder; add --shell or "
        "give a share above 0");
  }
  const auto range = layer_range(job, table.size());
  if (!range) return range.error();
  const ManifestHead head = make_head(job, scene->parts, table.size(), *range, *materials);
  for (const JobMaterial& material : head.materials) summary.materials.push_back({material.name, 0});
  summary.columns = grid.columns();
  summary.rows = grid.rows();
  summary.layers_total = table.size();
  summary.parts = scene->parts;
  for (const Instance& instance : scene->instances) summary.triangles += scene->meshes[instance.mesh].triangles.size();

  // --- output
  if (!job.dry_run) {
    if (auto status = check_shard_replaces_itself(job, head); !status) return status.error();
    if (auto status = prepare_output(job); !status) return status.error();
  }
  auto plan = job.dry_run ? Result<LayerPlan>(LayerPlan{}) : plan_layers(job, head, table);
  if (!plan) return plan.error();

  // --- index
  start = Clock::now();
  progress({ProgressEvent::Stage::kIndexing});
  const auto solids = Solids::build(*scene, job, grid, *materials);
  if (!solids) return solids.error();
  summary.seconds.index = seconds_since(start);
  summary.mesh_bytes = solids->mesh_bytes();
  summary.index_bytes = solids->index_bytes();

  if (porous) {
    for (const Mesh& mesh : porous->slices().scene().meshes) summary.mesh_bytes += mesh.triangles.size() * sizeof(Triangle);
    summary.index_bytes += porous->slices().slicer().index_bytes();
  }

  std::optional<PrintProgram> program;
  if (job.machine.resolved) program.emplace(job, table.size());
  double covered = 0;
  for (const Instance& instance : scene->instances) {
    const Box& box = scene->meshes[instance.mesh].bounds;
    covered += (static_cast<double>(box.width()) * grid.x.pixels_per_nm() + 1) *
               (static_cast<double>(box.depth()) * grid.y.pixels_per_nm() + 1);
  }
  LayerWorkshop workshop(job, *solids, *materials, head, *format, program ? &*program : nullptr, porous ? &*porous : nullptr,
                         static_cast<std::uint64_t>(std::min(covered, static_cast<double>(grid.columns()) * grid.rows())));
  if (job.dry_run) {
    for (std::uint32_t index = range->front(); index < range->back(); ++index) {
      summary.peak_layer_bytes = std::max(summary.peak_layer_bytes, workshop.bytes_of_layer(table[index]));
    }
    summary.peak_resident_bytes = peak_resident_bytes();
    return summary;
  }

  // --- layers
  start = Clock::now();
  auto kept = plan->kept.begin();
  auto prefix_end = kept;  // the kept records below the first layer to do
  while (prefix_end != plan->kept.end() && (plan->todo.empty() || prefix_end->layer.index < plan->todo.front().index)) {
    ++prefix_end;
  }
  if (program) {
    if (auto status = program->begin(); !status) return status.error();
  }
  auto manifest = ManifestWriter::open(job.output + "/" + manifest_name(job), head, std::vector<LayerRecord>(kept, prefix_end));
  if (!manifest) return manifest.error();
  const double pixel_mm2 = 25.4 * 25.4 / (grid.x.dpi() * grid.y.dpi());
  const auto count = [&](const LayerRecord& record) {
    summary.set_pixels += record.set_pixels;
    summary.moved_pixels += record.program.moved;
    summary.lost_pixels += record.program.lost;
    for (std::size_t m = 0; m < record.images.size(); ++m) summary.materials[m].second += record.images[m].set_pixels;
    summary.set_volume_mm3 += static_cast<double>(record.set_pixels) * pixel_mm2 * mm(record.layer.thickness);
  };
  std::for_each(kept, prefix_end, count);
  kept = prefix_end;

  RowWarnings warnings;
  const auto layers = static_cast<std::uint32_t>(range->back() - range->front());
  std::uint32_t done = layers - static_cast<std::uint32_t>(plan->todo.size());
  progress({ProgressEvent::Stage::kLayers, done, layers});
  const LayerStages stages{[&](LayerWork& work, LayerOutcome& outcome) { return workshop.raster(work, outcome); },
                           [&](LayerWork& work, LayerOutcome& outcome) { return workshop.encode(work, outcome); },
                           [&](LayerWork& work, LayerOutcome& outcome) { return workshop.store(work, outcome); },
                           [&](const LayerOutcome& outcome) -> Status {
                             for (; kept != plan->kept.end() && kept->layer.index < outcome.record.layer.index; ++kept) {
                               if (auto status = manifest->append(*kept); !status) return status;
                               count(*kept);
                             }
                             if (auto status = manifest->append(outcome.record); !status) return status;
                             count(outcome.record);
                             warnings.add(outcome, grid, summary);
                             summary.solid_pixels += outcome.solid_pixels;
                             summary.bead_pixels += outcome.bead_pixels;
                             ++summary.layers_planned;
                             summary.bytes_written += outcome.record.bytes + outcome.record.program.bytes;
                             progress({ProgressEvent::Stage::kLayers, ++done, layers});
                             return {};
                           }};
  GraphLimits limits;
  limits.budget_bytes = job.memory_bytes;
  limits.most_in_flight =
      2 * static_cast<std::uint32_t>(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism));
  limits.bytes_of_layer = [&](const Layer& layer) { return workshop.bytes_of_layer(layer); };
  GraphReport graph;
  if (auto status = run_layers(plan->todo, stages, limits, cancel, graph); !status) {
    // What is finished stays on record; the job can be resumed.
    if (auto flushed = manifest->flush(); !flushed && status.error().fault == Fault::kInterrupted) return flushed.error();
    if (status.error().fault != Fault::kOutput) return status.error();
    return Error{Fault::kOutput, status.error().message + "; finished layers are kept, go on with --resume"};
  }
  for (; kept != plan->kept.end(); ++kept) {
    if (auto status = manifest->append(*kept); !status) return status.error();
    count(*kept);
  }
  if (auto status = manifest->finish(); !status) return status.error();

  warnings.finish(*scene, summary);
  summary.layers_kept = static_cast<std::uint32_t>(plan->kept.size());
  summary.most_layers_in_flight = graph.most_in_flight;
  summary.peak_layer_bytes = graph.most_bytes;
  summary.seconds.layers = seconds_since(start);
  summary.seconds.raster = static_cast<double>(workshop.sums.raster) * 1e-9;
  summary.seconds.encode = static_cast<double>(workshop.sums.encode) * 1e-9;
  summary.seconds.write = static_cast<double>(workshop.sums.write) * 1e-9;
  summary.peak_resident_bytes = peak_resident_bytes();
  return summary;
}

}  // namespace lamina::pipeline
