// stages/bead/spread.cpp: what each piece of a line adds to the places ahead of it and behind it, summed into cells.
#include "stages/bead/spread.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace lamina::bead {
namespace {

constexpr double kAhead = std::numbers::ln2 / std::numbers::pi;  // bead widths: the tip of the melt
constexpr double kBehind = 1;                                    // bead widths: 1.4 % of the melt would flow further
constexpr std::size_t kSteps = 4096;

/// How much of its width the finger has a way behind the nozzle (below 0: ahead of it), in bead widths: 1 from kBehind on.
double formed(double behind) {
  if (behind <= -kAhead) return 0;
  if (behind >= kBehind) return 1;
  const auto angle = [](double s) { return std::acos(std::min(std::exp(-std::numbers::pi * s) / 2, 1.0)); };
  return angle(behind) / angle(kBehind);
}

/// The integral of formed() from the tip on, straight between the steps of a table: it has no closed form.
class FormedIntegral {
 public:
  FormedIntegral() {
    for (std::size_t i = 0; i < kSteps; ++i) {
      double sum = 0;
      for (const double part : {0.125, 0.375, 0.625, 0.875}) sum += formed(-kAhead + (static_cast<double>(i) + part) * kStep);
      upto_[i + 1] = upto_[i] + sum / 4 * kStep;
    }
  }
  double operator()(double behind) const {
    if (behind <= -kAhead) return 0;
    if (behind >= kBehind) return upto_[kSteps] + behind - kBehind;
    const double step = (behind + kAhead) / kStep;
    const std::size_t i = std::min(static_cast<std::size_t>(step), kSteps - 1);
    return upto_[i] + (step - static_cast<double>(i)) * (upto_[i + 1] - upto_[i]);
  }

 private:
  static constexpr double kStep = (kAhead + kBehind) / static_cast<double>(kSteps);
  std::array<double, kSteps + 1> upto_{};
};

/// The share of what leaves the nozzle on a way, in bead widths from a place, that comes to lie before that place.
double share_before(double from, double to) {
  static const FormedIntegral integral;
  if (to - from < 1e-6) return 1 - formed((from + to) / 2);
  return 1 - (integral(to) - integral(from)) / (to - from);
}

}  // namespace

BeadSpread::BeadSpread(double height_mm, double cell_mm, double reach_mm)
    : height_(height_mm),
      cell_(cell_mm),
      reach_(reach_mm),
      reach_cells_(static_cast<std::int64_t>(std::ceil(kBehind * 2 * reach_mm / cell_mm)) + 1),
      first_(-reach_cells_),
      ring_(static_cast<std::size_t>(2 * reach_cells_ + 4), Sum{}),
      last_(first_ - 1) {}

void BeadSpread::put(double begin_mm, double end_mm, double volume, bool pressed, double width) {
  const double from = (begin_mm - kBehind * width) / cell_, to = (end_mm + kAhead * width) / cell_;
  const auto begin = static_cast<std::int64_t>(std::floor(from)), end = static_cast<std::int64_t>(std::floor(to));
  double left = 0;
  for (std::int64_t cell = begin; cell <= end; ++cell) {
    const double edge = static_cast<double>(cell + 1) * cell_;
    const double right = cell == end ? 1 : share_before((begin_mm - edge) / width, (end_mm - edge) / width);
    Sum& sum = at(cell);
    sum.volume += volume * (right - left);
    sum.pressed += pressed ? volume * (right - left) : 0;
    left = right;
  }
  last_ = std::max(last_, end);
}

void BeadSpread::add(const BeadPiece& piece, const TakeCell& take) {
  const double length = piece.end_mm - piece.begin_mm;
  const double ends = piece.begin_area_mm2 + piece.end_area_mm2;
  double begin = piece.begin_mm, left = 0;
  while (begin < piece.end_mm) {
    const double cell = std::floor(begin / cell_ + 1e-9);
    const double next = (cell + 1) * cell_;
    const double end = next > piece.end_mm - 1e-9 * cell_ ? piece.end_mm : next;
    // The share of the piece's volume that lies before `end`: its area runs straight between its ends.
    const double t = (end - piece.begin_mm) / length;
    const double right = end == piece.end_mm || ends <= 0
                             ? t
                             : t * (2 * piece.begin_area_mm2 + t * (piece.end_area_mm2 - piece.begin_area_mm2)) / ends;
    const double volume = piece.volume_mm3 * (right - left);
    const double width = width_of(volume / (end - begin), piece.pressed, height_);
    give_before(static_cast<std::int64_t>(cell) - reach_cells_, take);
    put(begin, end, volume, piece.pressed, std::clamp(width, cell_ * 1e-3, 2 * reach_));
    left = right;
    begin = end;
  }
}

void BeadSpread::give_before(std::int64_t cell, const TakeCell& take) {
  for (; first_ < cell; ++first_) {
    Sum& sum = at(first_);
    begun_ = begun_ || sum.volume > 0;
    if (begun_) {
      const double area = sum.volume / cell_, share = sum.volume > 0 ? sum.pressed / sum.volume : 1;
      const double width = share * width_of(area, true, height_) + (1 - share) * width_of(area, false, height_);
      take({static_cast<double>(first_) * cell_, static_cast<double>(first_ + 1) * cell_, sum.volume, area, width});
    }
    sum = {};
  }
}

void BeadSpread::end(const TakeCell& take) {
  give_before(last_ + 1, take);
  first_ = -reach_cells_;
  last_ = first_ - 1;
  begun_ = false;
  std::fill(ring_.begin(), ring_.end(), Sum{});
}

}  // namespace lamina::bead
