#include "stages/stokes/flow.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

namespace lamina::stokes {
namespace {

double sum_of(const Four& x) { return double{x[0]} + x[1] + (double{x[2]} + x[3]); }

/// The sums of members.
void add_up(const Groups& groups, const Field& members, Field& sums) {
  for_pieces(groups.size(), [&](std::uint32_t begin, std::uint32_t end) {
    for (std::uint32_t g = begin; g < end; ++g) {
      Four sum{};
      for (std::uint32_t m = groups.begin[g]; m < groups.begin[g + 1]; ++m) sum += members[m];
      sums[g] = sum;
    }
  });
}

/// Group numbers of the cells become those of the next level.
void climb(const Groups& groups, Buffer<std::uint32_t>& of_cell) {
  std::uint32_t g = 0;
  for (std::uint32_t& group : of_cell) {
    while (group >= groups.begin[g + 1]) ++g;
    group = g;
  }
}

/// What each cell adds to the diagonal of its group: all but what flows between members.
void diagonals_within(const Operator& stokes, const Buffer<std::uint32_t>& of_cell, Field& result) {
  const Cells& cells = stokes.cells();
  for_pieces(cells.size(), [&](std::uint32_t begin, std::uint32_t end) {
    for (std::uint32_t i = begin; i < end; ++i) {
      Four sum = stokes.faces_of(i).diagonal;
      for (int side = 0; side < 6; ++side) {
        const std::uint32_t n = cells.neighbour[i][static_cast<std::size_t>(side)];
        if (n != cells.size() && of_cell[n] == of_cell[i]) sum -= stokes.weight(side / 2) * stokes.exists(i) * stokes.exists(n);
      }
      result[i] = sum;
    }
  });
}

/// Velocity is corrected on the cells and on all groups of them at once, each by the diagonal of the operator there; pressure
/// is the divergence over what the cell's faces let out. The sum is symmetric and positive, as minimal residuals need it.
/// source  J. H. Bramble, J. E. Pasciak, J. Xu, "Parallel multilevel preconditioners", Mathematics of Computation 55 (1990),
///         with groups for the coarse grids; H. C. Elman, D. J. Silvester, A. J. Wathen, "Finite Elements and Fast Iterative
///         Solvers" (2014), 4.2, for the pressure
class Preconditioner {
 public:
  /// stokes, levels  outlive it
  /// scratch         of the cells; is overwritten
  Preconditioner(const Operator& stokes, const std::vector<Groups>& levels, Field& scratch) : stokes_(stokes), levels_(levels) {
    Buffer<std::uint32_t> of_cell(stokes.cells().size());
    for (std::uint32_t i = 0; i < of_cell.size(); ++i) of_cell[i] = i;
    for (std::size_t level = 0; level < levels.size(); ++level) {
      climb(levels[level], of_cell);
      diagonals_within(stokes, of_cell, scratch);
      coarse_.push_back({Field(levels[level].size()), Field(levels[level].size())});
      for (std::size_t below = 0; below <= level; ++below)
        add_up(levels[below], below == 0 ? scratch : coarse_[below - 1].sum, coarse_[below].sum);
      Coarse& here = coarse_.back();
      for (std::uint32_t g = 0; g < levels[level].size(); ++g) {
        for (int a = 0; a < 3; ++a) here.inverse[g][a] = here.sum[g][a] > 1e-6f ? 1 / here.sum[g][a] : 0;
        here.inverse[g][3] = 0;
      }
    }
    std::fill(scratch.begin(), scratch.end(), Four{});
  }

  /// The residual's sum over a group of the first level, which gather() needs of all.
  Four& sum_of(std::uint32_t group) { return coarse_.front().sum[group]; }
  /// Takes the sums on to the other levels and makes what they add. Then at() gives the result.
  void gather() {
    for (std::size_t level = 1; level < levels_.size(); ++level)
      add_up(levels_[level], coarse_[level - 1].sum, coarse_[level].sum);
    for (std::size_t level = levels_.size(); level-- > 0;) {
      Coarse& here = coarse_[level];
      for_cells(levels_[level].size(), [&](std::uint32_t g) { here.sum[g] *= here.inverse[g]; });
    }
    for (std::size_t level = levels_.size(); level-- > 1;) {
      const Groups& groups = levels_[level];
      for_pieces(groups.size(), [&](std::uint32_t begin, std::uint32_t end) {
        for (std::uint32_t g = begin; g < end; ++g)
          for (std::uint32_t m = groups.begin[g]; m < groups.begin[g + 1]; ++m)
            coarse_[level - 1].sum[m] += coarse_[level].sum[g];
      });
    }
  }
  /// What cell i gets from its residual and, by way of its group g of the first level, from all groups.
  Four at(std::uint32_t i, std::uint32_t g, Four residual) const {
    const Operator::Faces faces = stokes_.faces_of(i);
    const Four rest = {1, 1, 1, 1}, pressure = {0, 0, 0, 1};
    Four under = faces.diagonal + (rest - faces.exists);
    under[3] = stokes_.yields(i);
    return (faces.exists + pressure) / under * residual + (levels_.empty() ? Four{} : faces.exists * coarse_.front().sum[g]);
  }

 private:
  struct Coarse {
    Field inverse, sum;  // of each group: of the diagonal; of the residual, then of corrections
  };
  const Operator& stokes_;
  const std::vector<Groups>& levels_;
  std::vector<Coarse> coarse_;
};

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
    for_cells(count_, [&](std::uint32_t i) { u[i] += along * w_[i]; });
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

}  // namespace

Result<Flow> solve(const Grid& grid, int axis, const FlowOptions& options, Field& field, const Field* force) {
  MinimalResiduals run(grid, axis, force);
  Flow flow;
  const double whole = run.norm_of_force();
  if (whole > 0) {
    // Steps are carried on in single precision: what they have lost is detected, and taken up, by starting again.
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
  flow.permeability = mean_velocity(grid.cells, field);
  const double speeds = sum_of_cells(grid.cells.size(), [&](std::uint32_t i) { return speed(grid.cells, field, i); });
  const double along = flow.permeability[static_cast<std::size_t>(axis)] * static_cast<double>(grid.cells.voxels());
  flow.tortuosity = along > 0 ? speeds / along : 0;
  return flow;
}

double error_floor(double porosity, double surface, std::uint32_t factor) {
  if (!(porosity > 0)) return 1;
  const double slit = surface / porosity, ball = porosity < 1 ? surface / (3 * (1 - porosity)) : 0, wall = 0.1 / factor;
  return std::max({0.5 * slit * slit, 3 * wall * slit, wall * ball});
}

std::uint64_t bytes_of_flow(std::uint64_t cells) { return 140 * cells; }

namespace {

/// Voxels that something flows in, around a place of a plane, along its columns or its rows.
std::uint32_t chord(const Plane& plane, std::uint32_t column, std::uint32_t row, bool along_columns) {
  const std::uint32_t maximum = along_columns ? plane.columns : plane.rows, from = along_columns ? column : row;
  const auto flows = [&](std::uint32_t i) {
    const std::uint32_t c = along_columns ? i : column, r = along_columns ? row : i;
    return plane.value[c + std::size_t{plane.columns} * r] != 0;
  };
  std::uint32_t low = from, high = from;
  while (low > 0 && flows(low - 1)) --low;
  while (high + 1 < maximum && flows(high + 1)) ++high;
  return high - low + 1;
}

/// value(i)  of cell i
template <class Value>
Plane plane_of(const Buffer<CellIndex>& positions, const CellIndex& size, const CellIndex& through, int normal,
               const Value& value) {
  const auto n = static_cast<std::size_t>(normal), c = static_cast<std::size_t>(column_axis(normal)),
             r = static_cast<std::size_t>(row_axis(normal));
  Plane plane{normal, through[n], size[c], size[r], {}};
  plane.value.assign(std::size_t{size[c]} * size[r], 0.0f);
  for (std::uint32_t i = 0; i < positions.size(); ++i) {
    const CellIndex& at = positions[i];
    if (at[n] == through[n] && at[c] < size[c] && at[r] < size[r])
      plane.value[at[c] + std::size_t{size[c]} * at[r]] = static_cast<float>(value(i));
  }
  return plane;
}

}  // namespace

Section section_of(CellPositions turned, const Cells& cells, const Field& field, double mean, std::uint32_t ends) {
  const int axis = turned.axis;
  const auto a = static_cast<std::size_t>(axis), lane = static_cast<std::size_t>(turned.lane);
  Buffer<CellIndex>& positions = turned.at;
  CellIndex size = turned.size;
  size[a] -= 2 * ends;
  Section section{.size = size, .fastest = {}, .across = {}, .along = {}};
  double maximum = -std::numeric_limits<double>::infinity();
  for (std::uint32_t i = 0; i < positions.size(); ++i) {
    positions[i][a] -= ends;  // what lies before the first end becomes larger than any size
    if (positions[i][a] >= size[a]) continue;
    const double here = velocity(cells, field, i, lane);
    if (here < maximum || (here == maximum && positions[i] > section.fastest)) continue;
    maximum = here;
    section.fastest = positions[i];
  }
  section.across =
      plane_of(positions, size, section.fastest, axis, [&](std::uint32_t i) { return velocity(cells, field, i, lane) / mean; });
  const int column = column_axis(axis), row = row_axis(axis);
  const std::uint32_t at_column = section.fastest[static_cast<std::size_t>(column)],
                      at_row = section.fastest[static_cast<std::size_t>(row)];
  const bool narrow_along_row =
      chord(section.across, at_column, at_row, false) < chord(section.across, at_column, at_row, true);
  section.along = plane_of(positions, size, section.fastest, narrow_along_row ? column : row,
                           [&](std::uint32_t i) { return speed(cells, field, i) / mean; });
  return section;
}

}  // namespace lamina::stokes
