#include "pipeline/show/slice_series.h"

#include <fmt/format.h>

#include <array>
#include <map>
#include <memory>

#include "pipeline/job/file.h"
#include "pipeline/output/manifest.h"
#include "pipeline/plan/plan.h"
#include "stages/geometry/clipping.h"

namespace lamina::pipeline {
namespace {

constexpr std::array<std::pair<PathKind, std::string_view>, 5> kKinds = {{{PathKind::kOuter, "outer wall"},
                                                                          {PathKind::kInner, "inner wall"},
                                                                          {PathKind::kContour, "closed curve"},
                                                                          {PathKind::kLink, "link"},
                                                                          {PathKind::kRaster, "line"}}};

/// What the beads of a kind cover, width by width.
Result<Contours> outline_of(const ToolpathsView& paths, PathKind kind) {
  std::map<Nm, Contours> by_width;
  for (std::uint32_t p = 0; p < paths.size(); ++p) {
    const std::uint32_t last = paths.offset[p + 1] - 1;
    for (std::uint32_t begin = paths.offset[p]; begin < last;) {
      std::uint32_t end = begin + 1;
      while (end < last && paths.kind[end] == paths.kind[begin] && paths.width[end] == paths.width[begin]) ++end;
      if (paths.kind[begin] == kind) {
        Contours& lines = by_width[paths.width[begin]];
        lines.point.insert(lines.point.end(), paths.point.begin() + begin, paths.point.begin() + end + 1);
        lines.close();
      }
      begin = end;
    }
  }
  Contours all;
  for (const auto& [width, lines] : by_width) {
    const auto covered = cover_lines(lines, width);
    if (!covered) return covered.error();
    all.append(*covered);
  }
  return all;
}

/// What a sliced job is drawn from.
struct SlicedJob {
  std::string directory;
  Manifest manifest;
  Plan plan;

  /// Of the first part.
  std::string name() const { return plan.sections->names().empty() ? std::string() : plan.sections->names().front(); }
};

Result<view::LayerShapes> shapes_of(const SlicedJob& job, std::uint32_t index) {
  const std::uint32_t count = job.plan.layer_count, place = index - job.manifest.head.first_layer;
  if (index >= count) {
    return Error{Fault::kUsage, fmt::format("--layer {}: the job has layers 0 to {}", index, count - 1)};
  }
  Sections::Work work;
  if (Status status = job.plan.sections->layer(index, work); !status) return status.error();
  view::LayerShapes shapes;
  shapes.index = index;
  shapes.z = job.plan.layer(index).plane();
  shapes.contours = std::move(work.contours.contours);
  const double area = square_mm(doubled_area(shapes.contours));
  const std::vector<LayerRecord>& recorded = job.manifest.layers;
  const PathFacts* written = place < recorded.size() ? recorded[place].paths.get() : nullptr;
  if (written != nullptr &&
      (written->points != shapes.contours.point.size() || written->area_mm2 != area || written->paths != work.paths.size())) {
    return Error{Fault::kVerification, fmt::format("{}: layer {} is not what was written: a part has changed since; slice it "
                                                   "again",
                                                   job.directory, index)};
  }
  shapes.box = job.plan.sections->bounds();
  for (const auto& [kind, name] : kKinds) {
    auto outline = outline_of(work.paths, kind);
    if (!outline) return outline.error();
    if (outline->size() > 0) shapes.beads.push_back({view::ink_of(kind), std::string(name), std::move(*outline)});
  }
  shapes.title = fmt::format("{}   |   layer {} of {}   |   z {:.3f} mm", job.name(), index, count, mm(shapes.z));
  shapes.caption = fmt::format("{} contours, {:.2f} mm2", shapes.contours.size(), area);
  if (work.paths.size() > 0) shapes.caption += fmt::format(", {} paths", work.paths.size());
  return shapes;
}

}  // namespace

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
                           [sliced](std::uint32_t index) { return shapes_of(*sliced, index); }};
}

}  // namespace lamina::pipeline
