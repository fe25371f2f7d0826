#include "pipeline/slice_picture.h"

#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>

#include "pipeline/job_toml.h"
#include "pipeline/slice.h"
#include "stages/data/clipping.h"
#include "stages/write/decimal.h"

namespace lamina::pipeline {
namespace {

std::string manifest_text(const std::string& directory) {
  std::ifstream file(directory + "/manifest.json", std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// The line of a layer in a manifest of our own making, or "".
std::string line_of(const std::string& manifest, std::uint32_t layer) {
  const std::string begin = fmt::format("\n    {{\"layer\":{},", layer);
  const std::size_t at = manifest.find(begin);
  return at == std::string::npos ? std::string() : manifest.substr(at + 1, manifest.find('\n', at + 1) - at - 1);
}

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
    for (std::uint32_t c = 0; c < covered->size(); ++c) {
      all.point.insert(all.point.end(), (*covered)[c].begin(), (*covered)[c].end());
      all.close();
    }
  }
  return all;
}

}  // namespace

bool is_slice_directory(const std::string& directory) {
  std::ifstream file(directory + "/manifest.json", std::ios::binary);
  std::string head(200, '\0');
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  return head.find("\"kind\": \"slice\"") != std::string::npos;
}

Result<SlicePictures> SlicePictures::open(const std::string& directory) {
  Job job;
  if (Status status = read_job(directory + "/job.toml", job); !status) return status.error();
  auto plan = SlicePlan::make(job, [](const ProgressEvent&) {});
  if (!plan) return plan.error();
  const auto range = layer_range(job, static_cast<std::uint32_t>(plan->layers().size()));
  if (!range) return range.error();
  SlicePictures pictures(directory, std::move(*plan));
  pictures.manifest_ = manifest_text(directory);
  pictures.range_ = *range;
  return pictures;
}

Result<LayerShapes> SlicePictures::layer(std::uint32_t index) const {
  if (index >= count()) {
    return Error{Fault::kUsage, fmt::format("--layer {}: the job has layers 0 to {}", index, count() - 1)};
  }
  SlicePlan::Work work;
  if (Status status = plan_.layer(index, work); !status) return status.error();
  LayerShapes shapes;
  shapes.layer = plan_.layers()[index].layer;
  shapes.contours = std::move(work.contours.contours);
  const double area = square_mm(doubled_area(shapes.contours));
  const std::string line = line_of(manifest_, index);
  if (!line.empty() && line.find(fmt::format("\"points\":{},\"area_mm2\":{:.9f},\"paths\":{},", shapes.contours.point.size(),
                                             area, work.paths.size())) == std::string::npos) {
    return Error{Fault::kVerification, fmt::format("{}: layer {} is not what was written: a part has changed since; slice it "
                                                   "again",
                                                   directory_, index)};
  }
  shapes.box = plan_.bounds();
  for (const auto& [kind, name] : kKinds) {
    auto outline = outline_of(work.paths, kind);
    if (!outline) return outline.error();
    if (outline->size() > 0) shapes.beads.push_back({kind, std::string(name), std::move(*outline)});
  }
  shapes.title = fmt::format("{}   |   layer {} of {}   |   z {:.3f} mm", plan_.names().empty() ? "" : plan_.names().front(),
                             index, count(), mm(shapes.layer.plane()));
  shapes.caption = fmt::format("{} contours, {:.2f} mm2", shapes.contours.size(), area);
  if (work.paths.size() > 0) shapes.caption += fmt::format(", {} paths", work.paths.size());
  return shapes;
}

std::string shapes_svg(const LayerShapes& shapes) {
  const std::int64_t margin = std::max(shapes.box.width(), shapes.box.depth()) / 50;
  const std::int64_t left = shapes.box.lo.x - margin, back = shapes.box.hi.y + margin;
  Buffer<char> out;
  const auto put = [&](std::string_view text) { write::append(out, text); };
  const auto length = [&](std::int64_t nm) { write::append_mm(out, nm); };
  const std::int64_t width = shapes.box.width() + 2 * margin, height = shapes.box.depth() + 2 * margin;
  put("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"");
  length(width);
  put("mm\" height=\"");
  length(height);
  put("mm\" viewBox=\"0 0 ");
  length(width);
  put(" ");
  length(height);
  put("\">\n");
  const auto shape = [&](const ContoursView& contours, std::string_view name, std::string_view colour) {
    put(fmt::format("<path class=\"{}\" fill=\"{}\" fill-rule=\"nonzero\" d=\"", name, colour));
    for (std::uint32_t c = 0; c < contours.size(); ++c) {
      put("M");
      for (const Point2 p : contours[c]) {
        put(" ");
        length(p.x - left);
        put(" ");
        length(back - p.y);
      }
      put(" z");
    }
    put("\"/>\n");
  };
  shape(shapes.contours, "solid", "#cdd1d8");
  for (const LayerShapes::Beads& beads : shapes.beads) {
    constexpr std::string_view kColours[] = {"#b03a2e", "#d68910", "#2471a3", "#117864", "#8e44ad"};
    shape(beads.outline, beads.name, kColours[static_cast<std::size_t>(beads.kind)]);
  }
  put("</svg>\n");
  return {out.begin(), out.end()};
}

}  // namespace lamina::pipeline
