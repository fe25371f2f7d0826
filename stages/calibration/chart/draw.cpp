#include "stages/calibration/chart/draw.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace lamina::calibration {
namespace {

struct Run {
  std::uint32_t row, begin, end;
};

void add_box(const ChartBox& box, std::vector<Run>& runs) {
  for (std::uint32_t r = box.top; r < box.bottom; ++r) runs.push_back({r, box.left, box.right});
}

/// An ellipse of pixels that fills the box, in the mm of the image a disc, less the hole of a ring.
void add_disc(const ChartBox& box, bool ring, std::vector<Run>& runs) {
  const double width = box.right - box.left, height = box.bottom - box.top;
  const auto half_at = [&](double y, double share) {  // columns on either side of the middle
    const double v = (2 * y / height - 1) / share, rest = 1 - v * v;
    return rest <= 0 ? 0.0 : share * width / 2 * std::sqrt(rest);
  };
  for (std::uint32_t r = box.top; r < box.bottom; ++r) {
    const double y = r - box.top + 0.5, middle = box.left + width / 2;
    const auto column = [&](double x) { return static_cast<std::uint32_t>(std::lround(middle + x)); };
    const double out = half_at(y, 1), in = ring ? half_at(y, kRingHole) : 0;
    if (column(-out) < column(-in)) runs.push_back({r, column(-out), column(-in)});
    if (column(in) < column(out)) runs.push_back({r, column(in), column(out)});
  }
}

/// Ordered dither of 8 x 8 pixels (Bayer 1973): any percentage is spread as evenly as it can be.
void add_wedge(const ChartWedge& wedge, std::vector<Run>& runs) {
  const auto rank = [](std::uint32_t x, std::uint32_t y) {
    std::uint32_t value = 0;
    for (std::uint32_t bit = 0; bit < 3; ++bit)
      value |= (((x ^ y) >> bit & 1) << (5 - 2 * bit)) | ((y >> bit & 1) << (4 - 2 * bit));
    return value;
  };
  for (std::uint32_t r = wedge.box.top; r < wedge.box.bottom; ++r) {
    for (std::uint32_t c = wedge.box.left; c < wedge.box.right; ++c) {
      if ((rank(c & 7, r & 7) + 0.5) * 100 / 64 < wedge.percent) runs.push_back({r, c, c + 1});
    }
  }
}

/// Runs in any order, which may touch or overlap, as an image.
Runs image_of(std::vector<Run>& runs, std::uint32_t columns, std::uint32_t rows) {
  std::ranges::sort(runs, [](const Run& a, const Run& b) { return a.row != b.row ? a.row < b.row : a.begin < b.begin; });
  Runs image;
  image.columns = columns;
  image.row_offset.assign(std::size_t{rows} + 1, 0);
  std::size_t next = 0;
  for (std::uint32_t r = 0; r < rows; ++r) {
    const std::size_t first = image.change.size();
    for (; next < runs.size() && runs[next].row == r; ++next) {
      if (image.change.size() > first && runs[next].begin <= image.change.back()) {
        image.change.back() = std::max(image.change.back(), runs[next].end);
      } else {
        image.change.push_back(runs[next].begin);
        image.change.push_back(runs[next].end);
      }
    }
    image.row_offset[r + 1] = static_cast<std::uint32_t>(image.change.size());
  }
  return image;
}

}  // namespace

Runs draw(const Chart& chart) {
  std::vector<Run> runs;
  for (std::size_t m = 0; m < chart.marks.size(); ++m) add_disc(chart.marks[m], m == 0, runs);
  for (const ChartDash& dash : chart.dashes) add_box(dash.box, runs);
  for (const ChartBar& bar : chart.bars) add_box(bar.box, runs);
  for (const ChartWedge& wedge : chart.wedges) add_wedge(wedge, runs);
  for (const ChartBox& joint : chart.stitches) add_box(joint, runs);
  for (const ChartVernier& vernier : chart.verniers) {
    for (const ChartBox& tick : vernier.before) add_box(tick, runs);
    for (const ChartBox& tick : vernier.after) add_box(tick, runs);
  }
  return image_of(runs, chart.columns, chart.rows);
}

Result<DropLayers> layout_drops(const Machine& machine, const HeadGrid& grid, std::uint64_t drops) {
  constexpr std::uint32_t kMaxLayers = 1000;
  const bool along_x = grid.scan_axis == ScanAxis::kX;
  const auto side = [&](std::uint32_t count) {
    const double lost = machine.bed.shape == BedShape::kRound ? count * (1 - std::numbers::sqrt2 / 2) / 2 + 1 : 0;
    const auto margin = static_cast<std::uint32_t>(std::ceil(lost));
    return std::pair(margin, count > 2 * margin ? count - margin : margin);
  };
  auto [line, line_end] = side(grid.lines);
  const auto [position, position_end] = side(grid.positions);
  // From a swath's first line, if a whole swath fits behind it.
  const std::uint32_t swath = grid.swath_lines(), first = (line + swath - 1) / swath * swath;
  if (grid.first_swath == FirstSwath::kBed && first + swath <= line_end) line = first;
  if (line + swath <= line_end) line_end = line + (line_end - line) / swath * swath;
  DropLayers wanted{
      .drops = drops, .a_layer = std::uint64_t{line_end - line} * (position_end - position), .layers = 0, .box = {}};
  if (wanted.a_layer == 0)
    return Error{Fault::kUsage, fmt::format("bed.size_mm: the bed of {} has no room for drops", machine.name)};
  const std::uint64_t layers = (drops + wanted.a_layer - 1) / wanted.a_layer;
  if (layers > kMaxLayers)
    return Error{Fault::kUsage,
                 fmt::format("--drops {}: a layer takes {}, and {} layers are too many; ask for {} drops or fewer", drops,
                             wanted.a_layer, layers, wanted.a_layer * kMaxLayers)};
  wanted.layers = static_cast<std::uint32_t>(layers);
  const auto turned = [](std::uint32_t begin, std::uint32_t end, std::uint32_t count, bool from_end) {
    return from_end ? std::pair(count - end, count - begin) : std::pair(begin, end);
  };
  const auto across = turned(line, line_end, grid.lines, grid.lines_from_end);
  const auto along = turned(position, position_end, grid.positions, along_x == grid.positions_from_end);
  const auto x = along_x ? along : across, y = along_x ? across : along;
  wanted.box = {x.first, y.first, x.second, y.second};
  return wanted;
}

Runs draw_drops(const DropLayers& wanted, const HeadGrid& grid, std::uint32_t layer) {
  std::vector<Run> runs;
  std::uint64_t left = std::min(wanted.a_layer, wanted.drops - wanted.a_layer * layer);
  for (std::uint32_t r = wanted.box.top; r < wanted.box.bottom && left > 0; ++r) {
    const auto taken = static_cast<std::uint32_t>(std::min<std::uint64_t>(left, wanted.box.right - wanted.box.left));
    runs.push_back({r, wanted.box.left, wanted.box.left + taken});
    left -= taken;
  }
  return image_of(runs, grid.image.columns(), grid.image.rows());
}

}  // namespace lamina::calibration
