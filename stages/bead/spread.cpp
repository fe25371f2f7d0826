// stages/bead/spread.cpp: discs of the bead's width, summed into cells along the line.
#include "stages/bead/spread.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "stages/bead/section.h"

namespace lamina::bead {
namespace {

/// The share of a disc that lies left of `u` radii from its middle.
double share_left(double u) {
  if (u <= -1) return 0;
  if (u >= 1) return 1;
  return 0.5 + (u * std::sqrt(1 - u * u) + std::asin(u)) / std::numbers::pi;
}

}  // namespace

BeadSpread::BeadSpread(double height_mm, double cell_mm, double reach_mm)
    : height_(height_mm),
      cell_(cell_mm),
      reach_(reach_mm),
      reach_cells_(static_cast<std::int64_t>(std::ceil(reach_mm / cell_mm)) + 1),
      first_(-reach_cells_),
      ring_(static_cast<std::size_t>(2 * reach_cells_ + 4), Sum{}),
      last_(first_ - 1) {}

void BeadSpread::put(double place, double volume, bool pressed, double radius) {
  const double from = (place - radius) / cell_, to = (place + radius) / cell_;
  const auto begin = static_cast<std::int64_t>(std::floor(from)), end = static_cast<std::int64_t>(std::floor(to));
  double left = 0;
  for (std::int64_t cell = begin; cell <= end; ++cell) {
    const double right = cell == end ? 1 : share_left((static_cast<double>(cell + 1) * cell_ - place) / radius);
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
    put((begin + end) / 2, volume, piece.pressed, std::clamp(width / 2, cell_ * 1e-3, reach_));
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
