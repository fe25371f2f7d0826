#include "stages/calibration/chart/layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace lamina::calibration {
namespace {

constexpr double kNmPerMmReal = 1e6;
constexpr std::uint32_t kRepeats = 3;
constexpr double kTallEnoughMm = 30;  // of the combs, in as many swaths
constexpr double kMarkMm = 1.5, kApartMm = 1;
constexpr std::array<double, 4> kBarsMm{0.3, 0.5, 0.8, 1.2};
constexpr double kBarLongMm = 4, kWedgeMm = 3;
constexpr std::uint32_t kWedges = 8;
constexpr double kTickMm = 0.25, kTickApartMm = 0.7, kTickLongMm = 1.2, kTickGapMm = 0.1;  // of verniers
constexpr std::uint32_t kTicks = 4;                                                        // on either side of the middle one

/// Lengths of dashes; the first that fits is taken.
struct Dashes {
  double between_mm, long_mm, gap_mm;
};
constexpr std::array<Dashes, 4> kDashes{{{0.8, 1.2, 0.5}, {0.6, 1.0, 0.4}, {0.5, 0.8, 0.35}, {0.4, 0.6, 0.3}}};

/// A box of lines and places.
struct Area {
  std::uint32_t line = 0, line_end = 0, position = 0, position_end = 0;
};

/// Its box in the image.
ChartBox box_of(const Area& area, const HeadGrid& grid) {
  const bool along_x = grid.scan_axis == ScanAxis::kX;
  const auto turned = [](std::uint32_t begin, std::uint32_t end, std::uint32_t count, bool from_end) {
    return from_end ? std::array{count - end, count - begin} : std::array{begin, end};
  };
  const auto across = turned(area.line, area.line_end, grid.lines, grid.lines_from_end);
  const auto along = turned(area.position, area.position_end, grid.positions, along_x == grid.positions_from_end);
  const auto x = along_x ? along : across, y = along_x ? across : along;
  return {x[0], y[0], x[1], y[1]};
}

/// Lengths in lines and in places.
struct Pitch {
  double line_mm, position_mm;
  std::uint32_t lines(double mm) const { return std::max(1u, static_cast<std::uint32_t>(std::lround(mm / line_mm))); }
  std::uint32_t positions(double mm) const { return std::max(1u, static_cast<std::uint32_t>(std::lround(mm / position_mm))); }
};

/// Lines and places that lie on the bed, a margin from its edge; of a round bed the square inside of it.
Area printable(const Machine& machine, const HeadGrid& grid, const Pitch& pitch) {
  const auto within = [&](std::uint32_t count, double mm) {
    const double side = count * mm;
    const double lost = machine.bed.shape == BedShape::kRound ? side * (1 - std::numbers::sqrt2 / 2) / 2 + 0.5 : 2;
    const auto margin = static_cast<std::uint32_t>(std::ceil(std::min(lost, side / 4) / mm));
    return std::array{margin, count - margin};
  };
  const auto lines = within(grid.lines, pitch.line_mm), positions = within(grid.positions, pitch.position_mm);
  return {lines[0], lines[1], positions[0], positions[1]};
}

class Layout {
 public:
  Layout(const Machine& machine, const HeadGrid& grid)
      : grid_(grid), pitch_{grid.line_nm / kNmPerMmReal, grid.position_nm / kNmPerMmReal} {
    chart_.machine = machine.name;
    chart_.columns = grid.image.columns();
    chart_.rows = grid.image.rows();
    chart_.scan_along_x = grid.scan_axis == ScanAxis::kX;
    chart_.pixel_x_nm = chart_.scan_along_x ? grid.position_nm : grid.line_nm;
    chart_.pixel_y_nm = chart_.scan_along_x ? grid.line_nm : grid.position_nm;
    // Columns rise to the right, rows to the front.
    chart_.along_sign = chart_.scan_along_x == grid.positions_from_end ? -1 : 1;
    chart_.across_sign = grid.lines_from_end ? -1 : 1;
    chart_.nozzles = grid.nozzles;
    chart_.nozzle_rows =
        static_cast<std::uint32_t>(std::clamp<std::size_t>(machine.head.row_offset_um.size(), 1, grid.nozzles));
    chart_.mark_mm = kMarkMm;
    free_ = printable(machine, grid, pitch_);
    if (grid.first_swath == FirstSwath::kBed)
      free_.line = (free_.line + grid.swath_lines() - 1) / grid.swath_lines() * grid.swath_lines();
  }

  Result<Chart> make() {
    const std::uint32_t swath = grid_.swath_lines(), height = free_.line_end > free_.line ? free_.line_end - free_.line : 0;
    const std::uint32_t fit = height / swath,
                        requested_range = static_cast<std::uint32_t>(std::ceil(kTallEnoughMm / (swath * pitch_.line_mm)));
    chart_.swaths = std::min(fit, std::max(2u, requested_range));
    const std::uint32_t strip = strip_lines(), combs = chart_.swaths * swath;
    lines_ = std::max({combs, strip, 4 * pitch_.lines(2 * kMarkMm)});
    if (chart_.swaths == 0 || lines_ > height) return too_small();
    for (const Dashes& dashes : kDashes) {
      for (const bool verniers : {true, false}) {
        if (!add_combs(dashes, verniers)) continue;
        add_strip();
        add_stitches();
        if (verniers) add_verniers();
        add_marks();
        return std::move(chart_);
      }
    }
    return too_small();
  }

 private:
  Error too_small() const {
    return {
        Fault::kUsage,
        fmt::format("bed.size_mm: the bed of {} is too small for a chart of {} nozzles: {:.1f} mm across the scan, {:.1f} mm "
                    "along it can be printed",
                    chart_.machine, grid_.nozzles, (free_.line_end - std::min(free_.line, free_.line_end)) * pitch_.line_mm,
                    (free_.position_end - free_.position) * pitch_.position_mm)};
  }

  ChartBox box(const Area& area) const { return box_of(area, grid_); }

  std::uint32_t mark_positions() const { return pitch_.positions(2 * kMarkMm + 2 * kApartMm); }
  std::uint32_t bars_long(const auto& count) const {
    std::uint32_t total = 0;
    for (const double mm : kBarsMm) total += count(mm) + count(kApartMm);
    return total;
  }
  std::uint32_t bars_positions() const {
    return bars_long([&](double mm) { return pitch_.positions(mm); });
  }
  std::uint32_t bars_lines() const {
    return bars_long([&](double mm) { return pitch_.lines(mm); });
  }
  std::uint32_t strip_positions() const { return std::max(bars_positions(), 2 * pitch_.positions(kWedgeMm + kApartMm)); }
  std::uint32_t strip_lines() const {
    return pitch_.lines(kBarLongMm) + 3 * pitch_.lines(kApartMm) + bars_lines() +
           kWedges / 2 * pitch_.lines(kWedgeMm + kApartMm);
  }

  std::uint32_t tick_wide() const { return pitch_.positions(kTickMm); }
  std::uint32_t tick_apart() const { return std::max(pitch_.positions(kTickApartMm), tick_wide() + 2); }
  std::uint32_t vernier_positions() const { return 2 * kTicks * tick_apart() + tick_wide(); }

  /// Adds the combs if they fit, between marks and strip, with or without room for verniers; nothing else is there yet.
  bool add_combs(const Dashes& dashes, bool verniers) {
    const double nozzle_mm = grid_.passes * pitch_.line_mm;
    const auto tiers = static_cast<std::uint32_t>(std::ceil(dashes.between_mm / nozzle_mm - 1e-9));
    const std::uint32_t length = std::max(pitch_.positions(dashes.long_mm), 4u),
                        step = length + std::max(pitch_.positions(dashes.gap_mm), 2u);
    const std::uint32_t comb = tiers * step + pitch_.positions(kApartMm);
    first_position_ = free_.position + mark_positions();
    vernier_position_ = first_position_ + kRepeats * comb;
    strip_position_ =
        vernier_position_ + (verniers ? vernier_positions() + pitch_.positions(kApartMm) : 0) + 3 * pitch_.positions(kApartMm);
    end_position_ = strip_position_ + strip_positions() + mark_positions();
    if (end_position_ > free_.position_end) return false;
    chart_.between_mm = tiers * nozzle_mm;
    chart_.gap_mm = (step - length) * pitch_.position_mm;
    for (std::uint32_t s = 0; s < chart_.swaths; ++s) {
      for (std::uint32_t r = 0; r < kRepeats; ++r) {
        for (std::uint32_t n = 0; n < grid_.nozzles; ++n) {
          if (std::ranges::binary_search(grid_.blocked, n)) continue;  // which the controller cannot fire
          const std::uint32_t line = free_.line + s * grid_.swath_lines() + n * grid_.passes + r % grid_.passes;
          // Counted over all swaths, so that dashes stay apart at their joints.
          const std::uint32_t position = first_position_ + r * comb + (s * grid_.nozzles + n) % tiers * step;
          chart_.dashes.push_back({s, n, r, box({line, line + 1, position, position + length})});
        }
      }
    }
    return true;
  }

  /// Bars along, bars across, wedges, one below the other.
  void add_strip() {
    const std::uint32_t apart = pitch_.lines(kApartMm), tall = pitch_.lines(kBarLongMm), wide = pitch_.positions(kBarLongMm);
    std::uint32_t line = free_.line + apart, position = strip_position_;
    for (const double mm : kBarsMm) {
      const std::uint32_t w = pitch_.positions(mm);
      chart_.bars.push_back({true, box({line, line + tall, position, position + w})});
      position += w + pitch_.positions(kApartMm);
    }
    line += tall + apart;
    for (const double mm : kBarsMm) {
      const std::uint32_t w = pitch_.lines(mm);
      chart_.bars.push_back({false, box({line, line + w, strip_position_, strip_position_ + wide})});
      line += w + apart;
    }
    for (std::uint32_t w = 0; w < kWedges; ++w) {
      const std::uint32_t at = line + w / 2 * pitch_.lines(kWedgeMm + kApartMm);
      const std::uint32_t left = strip_position_ + w % 2 * pitch_.positions(kWedgeMm + kApartMm);
      chart_.wedges.push_back(
          {100.0 * (w + 1) / kWedges, box({at, at + pitch_.lines(kWedgeMm), left, left + pitch_.positions(kWedgeMm)})});
    }
  }

  void add_stitches() {
    const std::uint32_t left = strip_position_ - 2 * pitch_.positions(kApartMm),
                        reach = std::min(pitch_.lines(2), grid_.swath_lines() / 4);
    for (std::uint32_t s = 1; s < chart_.swaths && reach > 0; ++s) {
      const std::uint32_t joint = free_.line + s * grid_.swath_lines();
      chart_.stitches.push_back(box({joint - reach, joint + reach, left, left + pitch_.positions(kApartMm)}));
    }
  }

  /// The swath behind a joint has its ticks a place closer than the one before.
  void add_verniers() {
    const std::uint32_t gap = pitch_.lines(kTickGapMm), swath = grid_.swath_lines(),
                        tall = std::min(pitch_.lines(kTickLongMm), swath / 4);
    if (tall <= gap) return;
    for (std::uint32_t s = 1; s < chart_.swaths; ++s) {
      const std::uint32_t joint = free_.line + s * swath, middle = vernier_position_ + kTicks * tick_apart();
      ChartVernier vernier{s, {}, {}};
      for (std::uint32_t k = 0; k <= 2 * kTicks; ++k) {
        const std::uint32_t before = vernier_position_ + k * tick_apart(),
                            after = middle + k * (tick_apart() - 1) - kTicks * (tick_apart() - 1);
        vernier.before.push_back(box({joint - tall, joint - gap, before, before + tick_wide()}));
        vernier.after.push_back(box({joint + gap, joint + tall, after, after + tick_wide()}));
      }
      chart_.verniers.push_back(std::move(vernier));
    }
  }

  void add_marks() {
    const std::uint32_t positions = pitch_.positions(2 * kMarkMm), lines = pitch_.lines(2 * kMarkMm);
    const std::uint32_t far = free_.line + lines_ - lines, end = end_position_ - positions;
    for (const auto& [line, position] :
         {std::array{free_.line, free_.position}, {free_.line, end}, {far, end}, {far, free_.position}})
      chart_.marks.push_back(box({line, line + lines, position, position + positions}));
    // Whether lines and places fall, or are columns and rows, decides the sense of rotation; the ring stays the first.
    const auto middle = [](const ChartBox& b) { return std::array{0.5 * (b.left + b.right), 0.5 * (b.top + b.bottom)}; };
    const auto a = middle(chart_.marks[0]), b = middle(chart_.marks[1]), c = middle(chart_.marks[2]);
    if ((b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]) < 0) std::swap(chart_.marks[1], chart_.marks[3]);
  }

  const HeadGrid& grid_;
  Pitch pitch_;
  Chart chart_;
  Area free_;
  std::uint32_t lines_ = 0, first_position_ = 0, vernier_position_ = 0, strip_position_ = 0, end_position_ = 0;
};

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

Machine chart_machine(Machine machine, bool drops) {
  machine.mounting.overlap_lines = 0;
  if (drops) {
    if (!machine.head.blocked.empty()) machine.head.blocked_rule = BlockedRule::kSecondPass;
    return machine;
  }
  machine.head.blocked.clear();
  machine.head.blocked_rule = BlockedRule::kReport;
  return machine;
}

Result<Chart> layout_chart(const Machine& machine, const HeadGrid& grid) { return Layout(machine, grid).make(); }

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
    return Error{Fault::kUsage, fmt::format("bed.size_mm: the bed of {} is too small for drops", machine.name)};
  const std::uint64_t layers = (drops + wanted.a_layer - 1) / wanted.a_layer;
  if (layers > kMaxLayers)
    return Error{Fault::kUsage,
                 fmt::format("--drops {}: at {} drops per layer, {} layers are needed, which is too many; use at most {} drops",
                             drops, wanted.a_layer, layers, wanted.a_layer * kMaxLayers)};
  wanted.layers = static_cast<std::uint32_t>(layers);
  wanted.box = box_of({line, line_end, position, position_end}, grid);
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
