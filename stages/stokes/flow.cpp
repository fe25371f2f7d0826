#include "stages/stokes/flow.h"

#include <cmath>
#include <utility>

#include "stages/stokes/preconditioner.h"
#include "stages/stokes/sums.h"

namespace lamina::stokes {
namespace {

double dot(const Four& x, const Four& y) {
  return double{x[0]} * y[0] + double{x[1]} * y[1] + double{x[2]} * y[2] + double{x[3]} * y[3];
}

/// One run of minimal residuals; see the source for the letters.
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
        next_(field_of(grid.cells)),
        w_(field_of(grid.cells)),
        w_before_(field_of(grid.cells)),
        preconditioner_(stokes_, grid.levels, next_) {}

  /// The norm of the residual of a solution, from which steps start then.
  double start(const Field& u) {
    for_pieces(count_, [&](std::uint32_t begin, std::uint32_t end) {
      for (std::uint32_t i = begin; i < end; ++i) {
        v_[i] = force(i) - stokes_.at(u, i);
        before_[i] = w_[i] = w_before_[i] = Four{};
      }
    });
    gamma_ = std::sqrt(precondition(v_, z_));
    eta_ = gamma_;
    gamma_before_ = 1;
    c_ = c_before_ = 1;
    s_ = s_before_ = 0;
    return gamma_;
  }
  /// The norm of the residual of u = 0.
  double norm_of_force() {
    for_pieces(count_, [&](std::uint32_t begin, std::uint32_t end) {
      for (std::uint32_t i = begin; i < end; ++i) v_[i] = force(i);
    });
    return std::sqrt(precondition(v_, z_));
  }

  /// Improves a solution. returns  the norm of its residual, as it follows from the steps
  double step(Field& u) {
    if (!(gamma_ > 0)) return 0;
    const auto scale = static_cast<float>(1 / gamma_), back = static_cast<float>(gamma_ / gamma_before_);
    for_pieces(count_, [&](std::uint32_t begin, std::uint32_t end) {
      for (std::uint32_t i = begin; i < end; ++i) z_[i] *= scale;
    });
    const double delta = sum_of_pieces(count_, [&](std::uint32_t begin, std::uint32_t end) {
      double sum = 0;
      for (std::uint32_t i = begin; i < end; ++i) {
        const Four product = stokes_.at(z_, i);
        sum += dot(product, z_[i]);
        before_[i] = product - back * before_[i];
      }
      return sum;
    });
    const auto along = static_cast<float>(delta / gamma_);
    for_pieces(count_, [&](std::uint32_t begin, std::uint32_t end) {
      for (std::uint32_t i = begin; i < end; ++i) before_[i] -= along * v_[i];
    });
    std::swap(v_, before_);
    const double gamma = std::sqrt(std::max(precondition(v_, next_), 0.0));
    rotate(delta, gamma, u);
    gamma_before_ = std::exchange(gamma_, gamma);
    std::swap(z_, next_);
    return std::abs(eta_);
  }

 private:
  Four force(std::uint32_t i) const {
    if (force_ != nullptr) return (*force_)[i];
    Four force{};
    force[axis_] = stokes_.exists(i)[axis_];
    return force;
  }

  /// result = M^-1 of, and their product.
  double precondition(const Field& of, Field& result) {
    preconditioner_.gather(of);
    const auto take = [&](std::uint32_t i, std::uint32_t g) {
      result[i] = preconditioner_.at(i, g, of[i]);
      return dot(result[i], of[i]);
    };
    if (grid_.levels.empty()) {
      return sum_of_pieces(count_, [&](std::uint32_t begin, std::uint32_t end) {
        double sum = 0;
        for (std::uint32_t i = begin; i < end; ++i) sum += take(i, 0);
        return sum;
      });
    }
    const Groups& groups = grid_.levels.front();
    return sum_of_pieces(groups.size(), [&](std::uint32_t begin, std::uint32_t end) {
      double sum = 0;
      for (std::uint32_t g = begin; g < end; ++g)
        for (std::uint32_t m = groups.begin[g]; m < groups.begin[g + 1]; ++m) sum += take(groups.member[m], g);
      return sum;
    });
  }

  void rotate(double delta, double gamma, Field& u) {
    const double alpha0 = c_ * delta - c_before_ * s_ * gamma_, alpha1 = std::hypot(alpha0, gamma);
    const double alpha2 = s_ * delta + c_before_ * c_ * gamma_, alpha3 = s_before_ * gamma_;
    c_before_ = std::exchange(c_, alpha0 / alpha1);
    s_before_ = std::exchange(s_, gamma / alpha1);
    const auto by = static_cast<float>(1 / alpha1), less = static_cast<float>(alpha2), least = static_cast<float>(alpha3),
               along = static_cast<float>(c_ * eta_);
    for_pieces(count_, [&](std::uint32_t begin, std::uint32_t end) {
      for (std::uint32_t i = begin; i < end; ++i) {
        w_before_[i] = by * (z_[i] - least * w_before_[i] - less * w_[i]);
        u[i] += along * w_before_[i];
      }
    });
    std::swap(w_, w_before_);
    eta_ *= -s_;
  }

  const Grid& grid_;
  const Field* force_;
  std::uint32_t count_;
  int axis_;
  Operator stokes_;
  Field v_, before_, z_, next_, w_, w_before_;
  Preconditioner preconditioner_;
  double gamma_ = 0, gamma_before_ = 1, eta_ = 0, c_ = 1, c_before_ = 1, s_ = 0, s_before_ = 0;
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
      if (flow.residual <= options.tolerance || flow.steps >= options.most_steps || stuck) break;
      double told = flow.residual;
      while (told > 0.5 * options.tolerance && flow.steps < options.most_steps) {
        told = run.step(field) / whole;
        ++flow.steps;
        if (options.progress && !options.progress(flow.steps, told))
          return Error{Fault::kInterrupted, "the flow was not computed to its end"};
      }
    }
  }
  measure(grid.cells, axis, field, flow);
  return flow;
}

std::uint64_t bytes_of_flow(std::uint64_t cells) { return 150 * cells; }

}  // namespace lamina::stokes
