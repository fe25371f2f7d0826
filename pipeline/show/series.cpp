#include "pipeline/show/series.h"

#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "pipeline/job/file.h"
#include "pipeline/manifest/manifest.h"
#include "pipeline/plan/overhangs.h"
#include "pipeline/plan/plan.h"
#include "stages/geometry/clipping.h"
#include "stages/view/drawable_layers.h"

namespace lamina::pipeline {
namespace {

Result<LayerShapes> gcode_shapes(const formats::GcodeFile& file, const std::string& name, std::uint32_t index) {
  const Result<formats::GcodeLayer> layer = file.layer(index);
  if (!layer) return layer.error();
  LayerShapes shapes;
  shapes.index = index;
  shapes.z = layer->z;
  shapes.box = file.box();
  if (Status status = view::add_beads(layer->beads, file.types(), shapes); !status) return status.error();
  shapes.title = fmt::format("{}   |   layer {} of {}   |   z {:.3f} mm", name, index, file.count(), mm(shapes.z));
  shapes.caption = fmt::format("{} moves, {:.1f} mm{}", layer->beads.size(), view::length_mm(layer->beads),
                               file.states_widths() ? "" : fmt::format(", widths by {:g} mm filament", file.filament_mm()));
  return shapes;
}

constexpr Ink kOverhangInk{224, 62, 160};

/// The source of a sliced job's drawing.
struct SlicedJob {
  std::string directory;
  Manifest manifest;
  Plan plan;

  /// Of the first part.
  std::string name() const { return plan.sections->names().empty() ? std::string() : plan.sections->names().front(); }
};

Result<LayerShapes> slice_shapes(const SlicedJob& job, std::uint32_t index) {
  const std::uint32_t count = job.plan.layer_count, position = index - job.manifest.head.first_layer;
  if (index >= count) {
    return Error{Fault::kUsage, fmt::format("--layer {}: the job has layers 0 to {}", index, count - 1)};
  }
  Sections::Work work;
  if (Status status = job.plan.sections->layer(index, work); !status) return status.error();
  LayerShapes shapes;
  shapes.index = index;
  shapes.z = job.plan.layer(index).plane();
  shapes.contours = std::move(work.contours.contours);
  const double area = square_mm(doubled_area(shapes.contours));
  const std::vector<LayerRecord>& recorded = job.manifest.layers;
  const PathFacts* written = position < recorded.size() ? recorded[position].paths.get() : nullptr;
  if (written != nullptr &&
      (written->points != shapes.contours.point.size() || written->area_mm2 != area || written->paths != work.paths.size())) {
    return Error{Fault::kVerification, fmt::format("{}: layer {} is not what was written: a part has changed since; slice it "
                                                   "again",
                                                   job.directory, index)};
  }
  shapes.box = job.plan.sections->bounds();
  if (Status status = view::add_paths(work.paths, shapes); !status) return status.error();
  auto overhang = Overhangs(*job.plan.sections, job.plan.job.support_angle_deg, 2).region(index);
  if (!overhang) return overhang.error();
  if (overhang->size() > 0) shapes.beads.push_back({kOverhangInk, "overhang", std::move(*overhang), ""});
  shapes.title = fmt::format("{}   |   layer {} of {}   |   z {:.3f} mm", job.name(), index, count, mm(shapes.z));
  shapes.caption =
      fmt::format("{} contour{}, {:.2f} mm2", shapes.contours.size(), shapes.contours.size() == 1 ? "" : "s", area);
  if (work.paths.size() > 0) shapes.caption += fmt::format(", {} path{}", work.paths.size(), work.paths.size() == 1 ? "" : "s");
  return shapes;
}

}  // namespace

Result<view::LayerSeries> gcode_series(const std::string& path, const formats::GcodeOptions& options) {
  auto file = formats::GcodeFile::open(path, options);
  if (!file) return file.error();
  view::LayerSeries series;
  series.name = std::filesystem::path(path).filename().string();
  series.last = series.count = file->count();
  for (const std::string& note : file->notes()) series.notes.push_back(path + ": " + note);
  series.layer = [file = std::make_shared<const formats::GcodeFile>(std::move(*file)),
                  name = series.name](std::uint32_t index) { return gcode_shapes(*file, name, index); };
  return series;
}

Result<view::LayerSeries> slice_series(const std::string& directory) {
  auto manifest = read_manifest(directory + "/manifest.json");
  if (!manifest) return manifest.error();
  Job job;
  if (Status status = read_job(directory + "/job.toml", job); !status) return status.error();
  auto resolved = resolve(job, Product::kContours);
  if (!resolved) return resolved.error();
  auto plan = make_plan(std::move(*resolved), [](const ProgressEvent&) {});
  if (!plan) return plan.error();
  const auto sliced = std::make_shared<const SlicedJob>(SlicedJob{directory, std::move(*manifest), std::move(*plan)});
  return view::LayerSeries{sliced->name(), sliced->plan.range[0], sliced->plan.range[1], sliced->plan.layer_count,
                           [sliced](std::uint32_t index) { return slice_shapes(*sliced, index); }};
}

}  // namespace lamina::pipeline
