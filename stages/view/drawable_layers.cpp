#include "stages/view/drawable_layers.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "stages/geometry/clipping.h"

namespace lamina::view {

Result<std::vector<std::size_t>> chosen_layers(const LayerChoice& choice, const std::vector<std::uint32_t>& layers) {
  if (choice.layer.has_value() + choice.every.has_value() + choice.count.has_value() > 1) {
    return Error{Fault::kUsage, "--layer, --every and --count exclude each other; give one of them"};
  }
  std::vector<std::size_t> chosen;
  if (choice.layer) {
    for (std::size_t i = 0; i < layers.size(); ++i) {
      if (layers[i] == *choice.layer) return std::vector<std::size_t>{i};
    }
    return Error{Fault::kUsage,
                 fmt::format("--layer {}: the job has layers {} to {}", *choice.layer, layers.front(), layers.back())};
  }
  if (const auto every = choice.every) {
    const std::size_t cells = (layers.size() + *every - 1) / *every;
    if (cells > kMaxCells) {
      return Error{Fault::kUsage, fmt::format("--every {}: {} layers are too many for a picture; give {} or more", *every,
                                              cells, (layers.size() + kMaxCells - 1) / kMaxCells)};
    }
    for (std::size_t i = 0; i < layers.size(); i += *every) chosen.push_back(i);
    return chosen;
  }
  // The middle one of each of `cells` equal stretches of the height.
  const std::size_t cells = std::min<std::size_t>(choice.count.value_or(12), layers.size());
  for (std::size_t cell = 0; cell < cells; ++cell) chosen.push_back((2 * cell + 1) * layers.size() / (2 * cells));
  return chosen;
}

Ink shade(const Ink& ink, std::size_t step, std::size_t steps) {
  if (steps < 2) return ink;
  const double paper = 0.6 * static_cast<double>(steps - 1 - step) / static_cast<double>(steps - 1);
  Ink mixed{};
  for (std::size_t c = 0; c < mixed.size(); ++c) mixed[c] = static_cast<std::uint8_t>(ink[c] + (255 - ink[c]) * paper);
  return mixed;
}

namespace {

constexpr std::array<std::pair<PathKind, std::string_view>, 6> kKinds = {{{PathKind::kOuter, "outer wall"},
                                                                          {PathKind::kInner, "inner wall"},
                                                                          {PathKind::kContour, "closed curve"},
                                                                          {PathKind::kLink, "link"},
                                                                          {PathKind::kSolid, "solid line"},
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

constexpr std::size_t kMaxShades = 4;

/// Equal in all pictures.
Ink ink_of(PathKind kind) {
  constexpr Ink kInks[] = {{176, 58, 46},  {214, 137, 16},  {36, 113, 163}, {17, 120, 100},
                           {142, 68, 173}, {127, 140, 141}, {28, 58, 112},  {149, 165, 166}};
  return kInks[static_cast<std::size_t>(kind)];
}

/// The words that slicers use: PrusaSlicer and Slic3r, CuraEngine, Orca.
PathKind kind_of(const std::string& type) {
  std::string word = type;
  std::ranges::transform(word, word.begin(), [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
  const auto has = [&](std::string_view part) { return word.find(part) != std::string::npos; };
  if (has("skirt") || has("brim")) return PathKind::kSkirt;
  if (has("support")) return PathKind::kSupport;
  if (has("prime") || has("wipe") || has("custom")) return PathKind::kLink;
  if (has("solid") || has("skin") || has("surface")) return PathKind::kSolid;
  if (has("infill") || has("fill") || word.empty()) return PathKind::kRaster;
  if (has("external") || has("outer")) return PathKind::kOuter;
  return PathKind::kInner;
}

/// The beads of one type, width by width, joined where one begins at the end of another.
std::map<Nm, Contours> lines_by_width(std::span<const DepositedBead> beads, std::uint32_t type) {
  std::map<Nm, Contours> lines;
  const DepositedBead* last = nullptr;
  const auto end_line = [&] {
    if (last == nullptr) return;
    lines[last->width].close();
    last = nullptr;
  };
  for (const DepositedBead& bead : beads) {
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

/// Widths that a shade stands for.
struct WidthRange {
  Nm narrow, wide;
};

/// The ranges of one shade each, from narrow to wide: widths that differ by what rounding does (0.03 mm or 5 % of the
/// narrowest) are one; equal parts of all where that leaves more than kMaxShades.
std::vector<WidthRange> shades_of(const std::map<Nm, Contours>& lines) {
  std::vector<WidthRange> ranges;
  for (const auto& [width, line] : lines) {
    if (ranges.empty() || width > ranges.back().narrow + std::max<Nm>(ranges.back().narrow / 20, 30'000)) {
      ranges.push_back({width, width});
    }
    ranges.back().wide = width;
  }
  if (ranges.size() <= kMaxShades) return ranges;
  const Nm minimum = lines.begin()->first, maximum = lines.rbegin()->first;
  ranges.assign(kMaxShades, {INT32_MAX, 0});
  for (const auto& [width, line] : lines) {
    const std::int64_t part = (width - minimum) * static_cast<std::int64_t>(kMaxShades) / (maximum - minimum);
    WidthRange& range = ranges[std::min(kMaxShades - 1, static_cast<std::size_t>(part))];
    range = {std::min(range.narrow, width), width};
  }
  return ranges;
}

Status add_type(std::span<const DepositedBead> deposited, std::uint32_t type, const std::string& name, LayerShapes& shapes) {
  const std::map<Nm, Contours> lines = lines_by_width(deposited, type);
  const std::vector<WidthRange> ranges = shades_of(lines);
  auto line = lines.begin();
  for (std::size_t step = 0; step < ranges.size(); ++step) {
    const auto [narrow, wide] = ranges[step];
    LayerShapes::Beads beads;
    for (; line != lines.end() && line->first <= wide; ++line) {
      const auto covered = cover_lines(line->second, line->first);
      if (!covered) return covered.error();
      beads.outline.append(*covered);
    }
    if (beads.outline.size() == 0) continue;
    beads.ink = shade(ink_of(kind_of(name)), step, ranges.size());
    beads.type = name.empty() ? "bead" : name;
    beads.name =
        fmt::format("{} {:.3g}{} mm", beads.type, mm(narrow), wide > narrow ? fmt::format(" to {:.3g}", mm(wide)) : "");
    shapes.beads.push_back(std::move(beads));
  }
  return {};
}

}  // namespace

Status add_paths(const ToolpathsView& paths, LayerShapes& shapes) {
  for (const auto& [kind, name] : kKinds) {
    auto outline = outline_of(paths, kind);
    if (!outline) return outline.error();
    if (outline->size() > 0) shapes.beads.push_back({ink_of(kind), std::string(name), std::move(*outline), ""});
  }
  return {};
}

Status add_beads(std::span<const DepositedBead> beads, std::span<const std::string> types, LayerShapes& shapes) {
  std::vector<std::uint32_t> order;
  for (const DepositedBead& bead : beads) {
    if (std::ranges::find(order, bead.type) == order.end()) order.push_back(bead.type);
  }
  for (const std::uint32_t type : order) {
    if (Status status = add_type(beads, type, types[type], shapes); !status) return status;
  }
  return {};
}

double length_mm(std::span<const DepositedBead> beads) {
  double length = 0;
  for (const DepositedBead& bead : beads) {
    length += std::hypot(mm(std::int64_t{bead.to.x} - bead.from.x), mm(std::int64_t{bead.to.y} - bead.from.y));
  }
  return length;
}

}  // namespace lamina::view
