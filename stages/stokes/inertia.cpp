#include "stages/stokes/inertia.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "stages/stokes/flow.h"
#include "stages/stokes/operator.h"

namespace lamina::stokes {
namespace {

constexpr std::size_t kMax = 16;      // vectors of a Krylov space
constexpr double kInexact = 0.1;      // what is left of Newton's equations, relative
constexpr double kOfCreeping = 0.02;  // the same of the creeping flows within, relative

/// Of velocities.
double dot(std::uint32_t count, const Field& x, const Field& y) {
  return sum_of_cells(count, [&](std::uint32_t i) {
    return double{x[i][0]} * y[i][0] + double{x[i][1]} * y[i][1] + double{x[i][2]} * y[i][2];
  });
}

void add(std::uint32_t count, double factor, const Field& x, Field& y) {
  const auto by = static_cast<float>(factor);
  for_cells(count, [&](std::uint32_t i) { y[i] += by * x[i]; });
}

void scale(std::uint32_t count, double factor, Field& x) {
  const auto by = static_cast<float>(factor);
  for_cells(count, [&](std::uint32_t i) { x[i] *= by; });
}

/// Least squares of a Hessenberg matrix, column by column.
class SmallestSum {
 public:
  explicit SmallestSum(double right) { right_[0] = right; }

  /// column  of `size` + 1 entries. returns  the norm of what is left then
  double take(std::size_t size, std::array<double, kMax + 1> column) {
    for (std::size_t k = 0; k + 1 < size; ++k) turn(k, column[k], column[k + 1]);
    const double length = std::hypot(column[size - 1], column[size]);
    cosine_[size - 1] = length > 0 ? column[size - 1] / length : 1;
    sine_[size - 1] = length > 0 ? column[size] / length : 0;
    turn(size - 1, column[size - 1], column[size]);
    turn(size - 1, right_[size - 1], right_[size]);
    triangle_[size - 1] = column;
    return std::abs(right_[size]);
  }
  std::array<double, kMax> solution(std::size_t size) const {
    std::array<double, kMax> x{};
    for (std::size_t k = size; k-- > 0;) {
      double sum = right_[k];
      for (std::size_t c = k + 1; c < size; ++c) sum -= triangle_[c][k] * x[c];
      x[k] = triangle_[k][k] != 0 ? sum / triangle_[k][k] : 0;
    }
    return x;
  }

 private:
  void turn(std::size_t k, double& upper, double& lower) const {
    const double above = cosine_[k] * upper + sine_[k] * lower;
    lower = cosine_[k] * lower - sine_[k] * upper;
    upper = above;
  }
  std::array<std::array<double, kMax + 1>, kMax> triangle_{};
  std::array<double, kMax + 1> right_{};
  std::array<double, kMax> cosine_{}, sine_{};
};

/// Newton's method: each step by minimal residuals in the space of what creeping flow answers to inertia. That answer is smooth
/// for any voxels, so few vectors do. See the source in inertia.h.
class Newton {
 public:
  Newton(const Grid& grid, int axis, double inertia, const InertiaOptions& options, Field& field)
      : grid_(grid),
        count_(grid.cells.size()),
        axis_(axis),
        inertia_(static_cast<float>(inertia)),
        options_(options),
        field_(field),
        stokes_(grid.cells),
        convection_(grid.cells),
        force_(field_of(grid.cells)),
        step_(field_of(grid.cells)) {
    basis_.push_back(field_of(grid.cells));
  }

  Result<InertialFlow> run() {
    if (Status status = inspection(); !status) return status.error();
    bool better = true;
    while (!flow_.settled && better && flow_.rounds < options_.max_rounds) {
      ++flow_.rounds;
      const double before = flow_.change;
      if (Status status = find_step(); !status) return status.error();
      add(count_, 1, step_, field_);
      if (Status status = inspection(); !status) return status.error();
      // Where a step leads away, a part of it may lead on.
      for (double share = 0.5; !(flow_.change < before) && share > 0.1; share /= 2) {
        add(count_, -share, step_, field_);
        if (Status status = inspection(); !status) return status.error();
      }
      better = flow_.change < before;
    }
    flow_.permeability = mean_velocity(grid_.cells, field_);
    return flow_;
  }

 private:
  /// The creeping flow that force_ drives.
  Status creep(Field& result) {
    std::fill(result.begin(), result.end(), Four{});
    FlowOptions creeping;
    creeping.tolerance = kOfCreeping;
    creeping.progress = [&](std::uint32_t, double) {
      return !options_.progress || options_.progress(flow_.rounds, flow_.change);
    };
    const Result<Flow> added = solve(grid_, axis_, creeping, result, &force_);
    if (!added) return added.error();
    flow_.steps += added->steps;
    return {};
  }

  /// Makes the first vector what creeping flow answers to what the equations lack.
  Status inspection() {
    for_cells(count_, [&](std::uint32_t i) {
      Four force{};
      force[axis_] = stokes_.exists(i)[axis_];
      force_[i] = force - stokes_.at(field_, i) - inertia_ * convection_.at(field_, field_, i);
    });
    if (Status status = creep(basis_[0]); !status) return status;
    lack_ = std::sqrt(dot(count_, basis_[0], basis_[0]));
    const double whole = std::sqrt(dot(count_, field_, field_));
    flow_.change = lack_ == 0 ? 0 : lack_ / whole;  // infinite at rest: the first step cannot be worse
    flow_.settled = flow_.change <= options_.tolerance;
    return {};
  }

  /// The step that makes what is lacking smallest, in a space that grows until it is small enough.
  Status find_step() {
    SmallestSum minimum(lack_);
    scale(count_, 1 / lack_, basis_[0]);
    std::size_t size = 0;
    for (double left = lack_; size < kMax && left > kInexact * lack_;) {
      const Field& last = basis_[size];
      for_cells(count_, [&](std::uint32_t i) {
        force_[i] = inertia_ * (convection_.at(field_, last, i) + convection_.at(last, field_, i));
      });
      if (basis_.size() == size + 1) basis_.push_back(field_of(grid_.cells));
      if (Status status = creep(basis_[size + 1]); !status) return status;
      left = minimum.take(size + 1, make_next(size));
      ++size;
    }
    std::fill(step_.begin(), step_.end(), Four{});
    const auto share = minimum.solution(size);
    for (std::size_t k = 0; k < size; ++k) add(count_, share[k], basis_[k], step_);
    return {};
  }

  /// Adds the last vector to what creeping flow answers to it, and makes that stand upright on all vectors.
  /// returns  its shares of them
  std::array<double, kMax + 1> make_next(std::size_t last) {
    Field& next = basis_[last + 1];
    add(count_, 1, basis_[last], next);
    std::array<double, kMax + 1> share{};
    for (std::size_t k = 0; k <= last; ++k) {
      share[k] = dot(count_, next, basis_[k]);
      add(count_, -share[k], basis_[k], next);
    }
    share[last + 1] = std::sqrt(dot(count_, next, next));
    if (share[last + 1] > 0) scale(count_, 1 / share[last + 1], next);
    return share;
  }

  const Grid& grid_;
  std::uint32_t count_;
  int axis_;
  float inertia_;
  const InertiaOptions& options_;
  Field& field_;
  Operator stokes_;
  Convection convection_;
  Field force_, step_;
  std::vector<Field> basis_;  // orthogonal, length 1: for velocities
  double lack_ = 0;           // length of the first one before it was made 1
  InertialFlow flow_;
};

}  // namespace

Result<InertialFlow> solve_with_inertia(const Grid& grid, int axis, double inertia, const InertiaOptions& options,
                                        Field& field) {
  return Newton(grid, axis, inertia, options, field).run();
}

std::uint64_t bytes_of_inertia(std::uint64_t cells) { return bytes_of_flow(cells) + (kMax + 8) * sizeof(Four) * cells; }

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
    for_cells(static_cast<std::uint32_t>(field.size()), [&](std::uint32_t i) {
      field[i] = share[0] * before_[0][i] + share[1] * before_[1][i] + share[2] * before_[2][i];
    });
  }

 private:
  std::array<Field, 3> before_;
  std::array<double, 3> force_{};
  std::size_t known_ = 0;
};

}  // namespace

Result<std::vector<SweepPoint>> sweep(const Grid& grid, int axis, double maximum, std::uint32_t count,
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
    const double wanted = maximum * i / count;
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
