#include "pipeline/jet.h"

#include <fmt/core.h>
#include <sys/resource.h>
#include <tbb/global_control.h>
#include <tbb/info.h>

#include <algorithm>
#include <chrono>
#include <optional>

#include "pipeline/dose_plan.h"
#include "pipeline/graph.h"
#include "pipeline/hash.h"
#include "pipeline/heights_plan.h"
#include "pipeline/machine.h"
#include "pipeline/manifest.h"
#include "pipeline/output_directory.h"
#include "pipeline/porous_plan.h"
#include "pipeline/print_program.h"
#include "pipeline/resume.h"
#include "stages/raster/combine.h"
#include "stages/raster/mirror.h"
#include "stages/raster/raster.h"
#include "stages/write/atomic_file.h"
#include "stages/write/image_format.h"

namespace lamina::pipeline {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// Adds the life of an object to a sum that many threads share.
class StageTimer {
 public:
  explicit StageTimer(std::atomic<std::int64_t>& sum) : sum_(sum) {}
  ~StageTimer() { sum_ += std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now() - start_).count(); }

 private:
  std::atomic<std::int64_t>& sum_;
  Clock::time_point start_ = Clock::now();
};

struct StageSums {
  std::atomic<std::int64_t> raster{0}, encode{0}, write{0};  // ns, over all threads
};

/// Where two engines disagree first.
Error disagreement(const Layer& layer, const PixelGrid& grid, const RunsView& rays, const RunsView& contours) {
  std::uint32_t row = 0;
  while (row + 1 < rays.rows() && std::ranges::equal(rays.row(row), contours.row(row))) ++row;
  const auto a = rays.row(row), b = contours.row(row);
  const auto place = static_cast<std::size_t>(std::ranges::mismatch(a, b).in1 - a.begin());
  const std::uint32_t column = std::min(place < a.size() ? a[place] : rays.columns,
                                        place < b.size() ? b[place] : rays.columns);
  return {Fault::kVerification,
          fmt::format("layer {}: engines disagree first in image row {}, column {} (x {:.4f} mm, y {:.4f} mm, z {:.4f} "
                      "mm); this is a fault of lamina, please report it with the part",
                      layer.index, row, column, mm(grid.x.centre(column)), mm(grid.y.centre(grid.rows() - 1 - row)),
                      mm(layer.plane()))};
}

/// One job while its layers are in flight: what the graph calls for each of them.
class LayerWorkshop {
 public:
  LayerWorkshop(const Job& job, const raster::Rasterizer& rasterizer, const write::ImageFormat& format,
                const PrintProgram* program, const PorousPlan* porous, std::uint64_t covered_pixels)
      : job_(job),
        rasterizer_(rasterizer),
        format_(format),
        program_(program),
        porous_(porous),
        dose_(job, rasterizer.grid()),
        covered_pixels_(covered_pixels) {}

  Status raster(LayerWork& work, LayerOutcome& outcome) {
    const StageTimer timer(sums.raster);
    const Layer& layer = outcome.record.layer;
    const bool rays = job_.engine != Engine::kContours;
    outcome.report = section(rays ? raster::Engine::kRays : raster::Engine::kContours, layer, work, work.runs);
    if (job_.engine == Engine::kBoth) {
      section(raster::Engine::kContours, layer, work, work.second);
      if (work.runs.row_offset != work.second.row_offset || work.runs.change != work.second.change) {
        return disagreement(layer, rasterizer_.grid(), work.runs, work.second);
      }
    }
    if (porous_ != nullptr) {
      outcome.solid_pixels = set_pixels(work.runs);
      if (Status status = porous_->apply(layer, work.runs, work.second, work.porous); !status) return status;
      outcome.bead_pixels = set_pixels(work.runs);
    }
    if (job_.mirror != Mirror::kNone) {
      raster::mirror(work.runs, job_.mirror != Mirror::kY, job_.mirror != Mirror::kX, work.second);
      std::swap(work.runs, work.second);
    }
    if (dose_.any()) dose_.apply(layer.index, work.runs, work.second, work.third);
    outcome.record.set_pixels = set_pixels(work.runs);
    outcome.record.capped_rows = outcome.report.capped_rows;
    return {};
  }

  /// The image of a layer: its middle plane, or what its lowest and highest sections have in common or together.
  raster::LayerReport section(raster::Engine engine, const Layer& layer, LayerWork& work, Runs& image) {
    if (job_.heights.containment == Containment::kAcross) {
      return rasterizer_.layer(engine, layer.plane(), work.scratch, image);
    }
    const raster::LayerReport low = rasterizer_.layer(engine, layer.lowest_plane(), work.scratch, work.lowest);
    const raster::LayerReport high = rasterizer_.layer(engine, layer.highest_plane(), work.scratch, work.highest);
    raster::combine(work.lowest, work.highest,
                    job_.heights.containment == Containment::kInside ? raster::SetOperation::kIntersection : raster::SetOperation::kUnion, image);
    return low.open_rows + low.capped_rows >= high.open_rows + high.capped_rows ? low : high;
  }

  Status encode(LayerWork& work, LayerOutcome& outcome) {
    const StageTimer timer(sums.encode);
    if (!work.encoder) work.encoder = format_.make_encoder();
    work.file.clear();
    if (auto status = work.encoder->encode(work.runs, rasterizer_.grid().x.dpi(), rasterizer_.grid().y.dpi(), work.file); !status) {
      return Error{status.error().fault, fmt::format("layer {}: {}", outcome.record.layer.index, status.error().message)};
    }
    outcome.record.bytes = work.file.size();
    outcome.record.hash = hash_bytes(work.file);
    return {};
  }

  Status store(LayerWork& work, LayerOutcome& outcome) {
    const StageTimer timer(sums.write);
    const std::string name = layer_file_name(outcome.record.layer.index, format_.extension);
    if (!name.empty()) {
      if (auto status = write::write_file(job_.output + "/" + name, work.file); !status) return status;
    }
    if (program_ == nullptr) return {};
    return program_->write_layer(outcome.record.layer, work.runs, work.program, outcome.record.program);
  }

  /// Scratch, runs and file, at most; a mirrored or second image counts as another one.
  std::uint64_t bytes_of_layer(const Layer& layer) const {
    if (job_.heights.containment != Containment::kAcross) {
      // Both sections, and an image that may have the crossings of both; twice with another engine or a mirror.
      return 2 * (bytes_of_section(layer.lowest_plane(), 0) + bytes_of_section(layer.highest_plane(), 0));
    }
    if (porous_ == nullptr) return bytes_of_section(layer.plane(), 0);
    return bytes_of_section(layer.plane(), 2 * porous_->spans_expected(layer.index)) + porous_->bytes_expected(layer.index);
  }

  /// bead_changes  that a filling adds to an image
  std::uint64_t bytes_of_section(Nm plane, std::uint64_t bead_changes) const {
    const std::uint64_t rows = rasterizer_.grid().rows();
    const std::uint64_t crossings =
        dose_.changes_bound(rasterizer_.crossings_bound(plane), covered_pixels_) + bead_changes;
    const bool second = porous_ != nullptr || job_.engine == Engine::kBoth || job_.mirror != Mirror::kNone || dose_.any();
    const std::uint64_t second_image = (second ? 8 * crossings + 4 * rows : 0) * (dose_.any() ? 3 : 1);
    const std::uint64_t file = format_.most_bytes(rasterizer_.grid().columns(), rows, crossings);
    const std::uint64_t program = program_ == nullptr ? 0 : program_->bytes_bound(crossings);
    return rasterizer_.layer_bytes_bound(plane) + second_image + file + program;
  }

  StageSums sums;

 private:
  const Job& job_;
  const raster::Rasterizer& rasterizer_;
  const write::ImageFormat& format_;
  const PrintProgram* program_;  // or nullptr
  const PorousPlan* porous_;     // or nullptr: parts are solid
  DosePlan dose_;
  std::uint64_t covered_pixels_;  // by the boxes of all parts, at most
};

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
  static void note(Tally& tally, const Layer& layer, std::uint32_t rows, std::uint32_t first_row,
                   std::uint32_t instance, const PixelGrid& grid) {
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

std::uint64_t peak_resident_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
}

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
  const auto range = layer_range(job, table.size());
  if (!range) return range.error();
  const ManifestHead head = make_head(job, scene->parts, table.size(), *range);
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
  auto rasterizer = raster::Rasterizer::build(scene->meshes, scene->instances, grid, job.fill_rule,
                                              job.engine != Engine::kContours, job.engine != Engine::kRays);
  if (!rasterizer) return rasterizer.error();
  summary.seconds.index = seconds_since(start);
  summary.mesh_bytes = rasterizer->mesh_bytes();
  summary.index_bytes = rasterizer->index_bytes();
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
  LayerWorkshop workshop(job, *rasterizer, *format, program ? &*program : nullptr, porous ? &*porous : nullptr,
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
  while (prefix_end != plan->kept.end() &&
         (plan->todo.empty() || prefix_end->layer.index < plan->todo.front().index)) {
    ++prefix_end;
  }
  if (program) {
    if (auto status = program->begin(); !status) return status.error();
  }
  auto manifest = ManifestWriter::open(job.output + "/" + manifest_name(job), head,
                                       std::vector<LayerRecord>(kept, prefix_end));
  if (!manifest) return manifest.error();
  const double pixel_mm2 = 25.4 * 25.4 / (grid.x.dpi() * grid.y.dpi());
  const auto count = [&](const LayerRecord& record) {
    summary.set_pixels += record.set_pixels;
    summary.set_volume_mm3 += static_cast<double>(record.set_pixels) * pixel_mm2 * mm(record.layer.thickness);
  };
  std::for_each(kept, prefix_end, count);
  kept = prefix_end;

  RowWarnings warnings;
  const auto layers = static_cast<std::uint32_t>(range->back() - range->front());
  std::uint32_t done = layers - static_cast<std::uint32_t>(plan->todo.size());
  progress({ProgressEvent::Stage::kLayers, done, layers});
  const LayerStages stages{
      [&](LayerWork& work, LayerOutcome& outcome) { return workshop.raster(work, outcome); },
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
  limits.most_in_flight = 2 * static_cast<std::uint32_t>(
                                  tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism));
  limits.bytes_of_layer = [&](const Layer& layer) { return workshop.bytes_of_layer(layer); };
  GraphReport graph;
  if (auto status = run_layers(plan->todo, stages, limits, cancel, graph); !status) {
    // What is finished stays on record; the job can be resumed.
    if (auto flushed = manifest->flush(); !flushed && status.error().fault == Fault::kInterrupted) return flushed.error();
    return status.error();
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
