#include "pipeline/show/gcode_series.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>

#include "stages/geometry/clipping.h"
#include "stages/read/gcode.h"

namespace lamina::pipeline {
namespace {

constexpr std::size_t kMostShades = 4;

/// The words that slicers use: PrusaSlicer and Slic3r, CuraEngine, Orca.
PathKind kind_of(const std::string& type) {
  std::string word = type;
  std::ranges::transform(word, word.begin(), [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
  const auto has = [&](std::string_view part) { return word.find(part) != std::string::npos; };
  if (has("skirt") || has("brim") || has("support") || has("prime") || has("wipe") || has("custom")) return PathKind::kLink;
  if (has("infill") || has("fill") || has("skin") || has("surface") || word.empty()) return PathKind::kRaster;
  if (has("external") || has("outer")) return PathKind::kOuter;
  return PathKind::kInner;
}

/// The beads of one type, width by width, joined where one begins at the end of another.
std::map<Nm, Contours> lines_by_width(const read::GcodeLayer& layer, std::uint32_t type) {
  std::map<Nm, Contours> lines;
  const read::GcodeBead* last = nullptr;
  const auto end_line = [&] {
    if (last == nullptr) return;
    lines[last->width].close();
    last = nullptr;
  };
  for (const read::GcodeBead& bead : layer.beads) {
    if (bead.type != type) {
      end_line();
      continue;
    }
    if (last == nullptr || last->width != bead.width || last->to != bead.from) {
      end_line();
      lines[bead.width].point.push_back(bead.from);
    }
    lines[bead.width].point.push_back(bead.to);
    last = &bead;
  }
  end_line();
  return lines;
}

Status add_beads(const read::GcodeLayer& layer, std::uint32_t type, const std::string& name, view::LayerShapes& shapes) {
  const std::map<Nm, Contours> lines = lines_by_width(layer, type);
  if (lines.empty()) return {};
  const Nm least = lines.begin()->first, most = lines.rbegin()->first;
  const std::size_t steps = std::min(lines.size(), kMostShades);
  const auto step_of = [&](Nm width, std::size_t place) {
    if (lines.size() <= kMostShades) return place;
    return std::min(steps - 1, static_cast<std::size_t>((width - least) * static_cast<std::int64_t>(steps) / (most - least)));
  };
  std::vector<view::LayerShapes::Beads> beads(steps);
  std::vector<std::pair<Nm, Nm>> range(steps, {INT32_MAX, 0});
  std::size_t place = 0;
  for (const auto& [width, line] : lines) {
    const auto covered = cover_lines(line, width);
    if (!covered) return covered.error();
    const std::size_t step = step_of(width, place++);
    beads[step].outline.append(*covered);
    range[step] = {std::min(range[step].first, width), std::max(range[step].second, width)};
  }
  for (std::size_t step = 0; step < steps; ++step) {
    if (beads[step].outline.size() == 0) continue;
    const auto& [narrow, wide] = range[step];
    beads[step].ink = view::shade(view::ink_of(kind_of(name)), step, steps);
    beads[step].name = fmt::format("{} {:.3g}{} mm", name.empty() ? "bead" : name, mm(narrow),
                                   wide > narrow ? fmt::format(" to {:.3g}", mm(wide)) : "");
    shapes.beads.push_back(std::move(beads[step]));
  }
  return {};
}

Result<view::LayerShapes> shapes_of(const read::GcodeFile& file, const std::string& name, std::uint32_t index) {
  const Result<read::GcodeLayer> layer = file.layer(index);
  if (!layer) return layer.error();
  view::LayerShapes shapes;
  shapes.index = index;
  shapes.z = layer->z;
  shapes.box = file.box();
  // In the order in which they are first laid.
  std::vector<std::uint32_t> types;
  double length_mm = 0;
  for (const read::GcodeBead& bead : layer->beads) {
    if (std::ranges::find(types, bead.type) == types.end()) types.push_back(bead.type);
    length_mm += std::hypot(mm(std::int64_t{bead.to.x} - bead.from.x), mm(std::int64_t{bead.to.y} - bead.from.y));
  }
  for (const std::uint32_t type : types) {
    if (Status status = add_beads(*layer, type, file.types()[type], shapes); !status) return status.error();
  }
  shapes.title = fmt::format("{}   |   layer {} of {}   |   z {:.3f} mm", name, index, file.count(), mm(shapes.z));
  shapes.caption = fmt::format("{} moves, {:.1f} mm{}", layer->beads.size(), length_mm,
                               file.tells_widths() ? "" : fmt::format(", widths by {:g} mm filament", file.filament_mm()));
  return shapes;
}

}  // namespace

Result<view::LayerSeries> gcode_series(const std::string& path) {
  auto file = read::GcodeFile::open(path);
  if (!file) return file.error();
  view::LayerSeries series;
  series.name = std::filesystem::path(path).filename().string();
  series.last = series.count = file->count();
  series.layer = [file = std::make_shared<const read::GcodeFile>(std::move(*file)), name = series.name](std::uint32_t index) {
    return shapes_of(*file, name, index);
  };
  return series;
}

}  // namespace lamina::pipeline
