#include "stages/calibration/chart/layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

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

  ChartBox box(const Area& area) const {
    const auto turned = [](std::uint32_t begin, std::uint32_t end, std::uint32_t count, bool from_end) {
      return from_end ? std::array{count - end, count - begin} : std::array{begin, end};
    };
    const auto across = turned(area.line, area.line_end, grid_.lines, chart_.across_sign < 0);
    const auto along = turned(area.position, area.position_end, grid_.positions, chart_.along_sign < 0);
    if (chart_.scan_along_x) return {along[0], across[0], along[1], across[1]};
    return {across[0], along[0], across[1], along[1]};
  }

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

}  // namespace lamina::calibration
