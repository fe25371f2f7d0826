#include "stages/stokes/flow.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "stages/stokes/preconditioner.h"
#include "stages/stokes/sums.h"

namespace lamina::stokes {
namespace {

double sum_of(const Four& x) { return double{x[0]} + x[1] + (double{x[2]} + x[3]); }

constexpr std::uint32_t kBlock = 8;  // cells whose products are summed in single precision

/// One run of minimal residuals, in the letters of its source: v and z = M^-1 v of this step and `before_`, the v of the last
/// one, none of them scaled; w the directions, to be multiplied by `w_scale_`; u what is solved for.
class MinimalResiduals {
 public:
  MinimalResiduals(const Grid& grid, int axis, const Field* force)
      : grid_(grid),
        force_(force),
        count_(grid.cells.size()),
        axis_(axis),
        stokes_(grid.cells),
        v_(field_of(grid.cells)),
        before_(field_of(grid.cells)),
        z_(field_of(grid.cells)),
        w_(field_of(grid.cells)),
        w_before_(field_of(grid.cells)),
        preconditioner_(stokes_, grid.levels, z_) {}

  /// The norm of the residual of a solution, from which steps start then.
  double start(const Field& u) {
    change_residual([&](std::uint32_t i) {
      before_[i] = w_[i] = w_before_[i] = Four{};
      return v_[i] = force(i) - stokes_.at(u, i);
    });
    gamma_ = std::sqrt(precondition());
    eta_ = gamma_;
    gamma_before_ = 1;
    c_ = c_before_ = 1;
    s_ = s_before_ = 0;
    w_scale_ = w_before_scale_ = along_ = 0;
    return gamma_;
  }
  /// The norm of the residual of u = 0.
  double norm_of_force() {
    change_residual([&](std::uint32_t i) { return v_[i] = force(i); });
    return std::sqrt(precondition());
  }

  /// Improves a solution; finish() brings it up to date. returns  the norm of its residual, as it follows from the steps
  double step(Field& u) {
    if (!(gamma_ > 0)) return 0;
    const auto scale = static_cast<float>(1 / gamma_), back = static_cast<float>(gamma_ / gamma_before_);
    const double delta = sum_of_pieces(count_, [&](std::uint32_t begin, std::uint32_t end) {
      double sum = 0;
      for (std::uint32_t block = begin; block < end; block += kBlock) {
        Four along_z{};
        for (std::uint32_t i = block; i < std::min(end, block + kBlock); ++i) {
          const Four product = scale * stokes_.at(z_, i);
          along_z += product * z_[i];
          before_[i] = product - back * before_[i];
        }
        sum += sum_of(along_z);
      }
      return sum / gamma_;
    });
    const double alpha2 = s_ * delta + c_before_ * c_ * gamma_, alpha3 = s_before_ * gamma_;
    const auto less_v = static_cast<float>(delta / gamma_), less = static_cast<float>(alpha2 * w_scale_),
               minimum = static_cast<float>(alpha3 * w_before_scale_), along = static_cast<float>(along_);
    change_residual([&](std::uint32_t i) {
      before_[i] -= less_v * v_[i];
      const Four w = w_[i];
      u[i] += along * w;
      w_before_[i] = scale * z_[i] - minimum * w_before_[i] - less * w;
      return before_[i];
    });
    std::swap(v_, before_);
    std::swap(w_, w_before_);
    rotate(delta, std::sqrt(std::max(precondition(), 0.0)));
    return std::abs(eta_);
  }
  void finish(Field& u) {
    const auto along = static_cast<float>(std::exchange(along_, 0));
    for_pieces(count_, [&](std::uint32_t begin, std::uint32_t end) {
      for (std::uint32_t i = begin; i < end; ++i) u[i] += along * w_[i];
    });
  }

 private:
  Four force(std::uint32_t i) const {
    if (force_ != nullptr) return (*force_)[i];
    Four force{};
    force[axis_] = stokes_.exists(i)[axis_];
    return force;
  }

  /// Calls change(cell), which gives the cell's new residual, for all, and takes its sums to the preconditioner.
  template <class Change>
  void change_residual(const Change& change) {
    if (grid_.levels.empty()) {
      for_pieces(count_, [&](std::uint32_t begin, std::uint32_t end) {
        for (std::uint32_t i = begin; i < end; ++i) change(i);
      });
      return;
    }
    const Groups& groups = grid_.levels.front();
    for_pieces(groups.size(), [&](std::uint32_t begin, std::uint32_t end) {
      for (std::uint32_t g = begin; g < end; ++g) {
        Four sum{};
        for (std::uint32_t i = groups.begin[g]; i < groups.begin[g + 1]; ++i) sum += change(i);
        preconditioner_.sum_of(g) = sum;
      }
    });
    preconditioner_.gather();
  }

  /// z = M^-1 v, and their product.
  double precondition() {
    const auto take = [&](std::uint32_t i, std::uint32_t g) {
      z_[i] = preconditioner_.at(i, g, v_[i]);
      return z_[i] * v_[i];
    };
    if (grid_.levels.empty()) {
      return sum_of_pieces(count_, [&](std::uint32_t begin, std::uint32_t end) {
        double sum = 0;
        for (std::uint32_t i = begin; i < end; ++i) sum += sum_of(take(i, 0));
        return sum;
      });
    }
    const Groups& groups = grid_.levels.front();
    return sum_of_pieces(groups.size(), [&](std::uint32_t begin, std::uint32_t end) {
      double sum = 0;
      for (std::uint32_t g = begin; g < end; ++g) {
        Four of_group{};
        for (std::uint32_t i = groups.begin[g]; i < groups.begin[g + 1]; ++i) of_group += take(i, g);
        sum += sum_of(of_group);
      }
      return sum;
    });
  }

  /// gamma  of the next step
  void rotate(double delta, double gamma) {
    const double alpha0 = c_ * delta - c_before_ * s_ * gamma_, alpha1 = std::hypot(alpha0, gamma);
    c_before_ = std::exchange(c_, alpha0 / alpha1);
    s_before_ = std::exchange(s_, gamma / alpha1);
    w_before_scale_ = std::exchange(w_scale_, 1 / alpha1);
    along_ = c_ * eta_ * w_scale_;
    eta_ *= -s_;
    gamma_before_ = std::exchange(gamma_, gamma);
  }

  const Grid& grid_;
  const Field* force_;
  std::uint32_t count_;
  int axis_;
  Operator stokes_;
  Field v_, before_, z_, w_, w_before_;
  Preconditioner preconditioner_;
  double gamma_ = 0, gamma_before_ = 1, eta_ = 0, c_ = 1, c_before_ = 1, s_ = 0, s_before_ = 0;
  double w_scale_ = 0, w_before_scale_ = 0, along_ = 0;  // u is behind by along x w
};

/// Mean velocities and the lengths of ways.
void measure(const Cells& cells, int axis, const Field& u, Flow& flow) {
  for (int a = 0; a < 3; ++a) {
    flow.permeability[static_cast<std::size_t>(a)] = sum_of_pieces(cells.size(),
                                                                   [&](std::uint32_t begin, std::uint32_t end) {
                                                                     double sum = 0;
                                                                     for (std::uint32_t i = begin; i < end; ++i)
                                                                       sum += double{u[i][a]};
                                                                     return sum;
                                                                   }) /
                                                     static_cast<double>(cells.voxels());
  }
  const double speed = sum_of_pieces(cells.size(), [&](std::uint32_t begin, std::uint32_t end) {
    double sum = 0;
    for (std::uint32_t i = begin; i < end; ++i) {
      double squared = 0;
      for (int a = 0; a < 3; ++a) {
        const double middle = 0.5 * (double{u[i][a]} + u[cells.neighbour[i][static_cast<std::size_t>(2 * a)]][a]);
        squared += middle * middle;
      }
      sum += std::sqrt(squared);
    }
    return sum;
  });
  const double along = flow.permeability[static_cast<std::size_t>(axis)] * static_cast<double>(cells.voxels());
  flow.tortuosity = along > 0 ? speed / along : 0;
}

}  // namespace

Result<Flow> solve(const Grid& grid, int axis, const FlowOptions& options, Field& field, const Field* force) {
  MinimalResiduals run(grid, axis, force);
  Flow flow;
  const double whole = run.norm_of_force();
  if (whole > 0) {
    // Steps are carried on in single precision: what they have lost is seen, and taken up, by starting again.
    for (int rounds = 0; rounds < 8; ++rounds) {
      const double before = std::exchange(flow.residual, run.start(field) / whole);
      const bool stuck = rounds > 0 && flow.residual > 0.5 * before;
      if (flow.residual <= options.tolerance || flow.steps >= options.max_steps || stuck) break;
      double reported = flow.residual;
      while (reported > 0.5 * options.tolerance && flow.steps < options.max_steps) {
        reported = run.step(field) / whole;
        ++flow.steps;
        if (options.progress && !options.progress(flow.steps, reported))
          return Error{Fault::kInterrupted, "the flow was not computed to its end"};
      }
      run.finish(field);
    }
  }
  measure(grid.cells, axis, field, flow);
  return flow;
}

double error_floor(double porosity, double surface, std::uint32_t factor) {
  if (!(porosity > 0)) return 1;
  const double slit = surface / porosity, ball = porosity < 1 ? surface / (3 * (1 - porosity)) : 0, wall = 0.1 / factor;
  return std::max({0.5 * slit * slit, 3 * wall * slit, wall * ball});
}

std::uint64_t bytes_of_flow(std::uint64_t cells) { return 140 * cells; }

}  // namespace lamina::stokes
