#include "stages/stokes/sweep.h"

#include <array>
#include <cmath>
#include <utility>

#include "stages/stokes/sums.h"

namespace lamina::stokes {
namespace {

/// The last fields, and what a parabola through them says of the next one.
class Foresight {
 public:
  explicit Foresight(const Cells& cells) : before_{{field_of(cells), field_of(cells), field_of(cells)}} {}

  void remember(double force, const Field& field) {
    std::swap(before_[1], before_[2]);
    std::swap(before_[0], before_[1]);
    force_ = {force, force_[0], force_[1]};
    std::copy(field.begin(), field.end(), before_[0].begin());
    known_ = std::min<std::size_t>(known_ + 1, 3);
  }
  void foresee(double force, Field& field) const {
    std::array<float, 3> share{};
    for (std::size_t k = 0; k < known_; ++k) {
      double product = 1;
      for (std::size_t other = 0; other < known_; ++other)
        if (other != k) product *= (force - force_[other]) / (force_[k] - force_[other]);
      share[k] = static_cast<float>(product);
    }
    for_pieces(static_cast<std::uint32_t>(field.size()), [&](std::uint32_t begin, std::uint32_t end) {
      for (std::uint32_t i = begin; i < end; ++i)
        field[i] = share[0] * before_[0][i] + share[1] * before_[1][i] + share[2] * before_[2][i];
    });
  }

 private:
  std::array<Field, 3> before_;
  std::array<double, 3> force_{};
  std::size_t known_ = 0;
};

}  // namespace

Result<std::vector<SweepPoint>> sweep(const Grid& grid, int axis, double most, std::uint32_t count,
                                      const InertiaOptions& options) {
  const auto along = static_cast<std::size_t>(axis);
  Field field = field_of(grid.cells);
  const Result<InertialFlow> creeping = solve_with_inertia(grid, axis, 0, options, field);
  if (!creeping) return creeping.error();
  std::vector<SweepPoint> points;
  const double k = creeping->permeability[along];
  if (!(k > 0)) return points;
  Foresight foresight(grid.cells);
  foresight.remember(0, field);
  double slope = 0;  // of the excess over the velocity
  for (std::uint32_t i = 1; i <= count; ++i) {
    const double wanted = most * i / count;
    SweepPoint point;
    point.force = wanted / k * (1 + slope * wanted);
    foresight.foresee(point.force, field);
    const Result<InertialFlow> flow = solve_with_inertia(grid, axis, point.force, options, field);
    if (!flow) return flow.error();
    point.velocity = point.force * flow->permeability[along];
    point.excess = k / flow->permeability[along] - 1;
    point.settled = flow->settled;
    points.push_back(point);
    if (!point.settled || !(point.velocity > 0)) break;
    foresight.remember(point.force, field);
    slope = point.excess / point.velocity;
  }
  return points;
}

double weak_up_to(const std::vector<SweepPoint>& points) {
  double velocity = 0;
  for (std::size_t i = 1; i < points.size(); ++i) {
    const SweepPoint &before = points[i - 1], &here = points[i];
    if (!(before.excess > 0) || std::log(here.excess / before.excess) < 1.5 * std::log(here.velocity / before.velocity)) break;
    velocity = here.velocity;
  }
  return velocity;
}

}  // namespace lamina::stokes
