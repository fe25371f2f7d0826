// stages/stokes/operator.h: Stokes' equations on the cells of a fluid of viscosity 1; internal to stokes.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "stages/data/buffer.h"
#include "stages/stokes/cells.h"

namespace lamina::stokes {

/// What a cell holds: velocity through its three upper faces, and pressure.
using Four [[gnu::vector_size(16)]] = float;
using Field = Buffer<Four>;  // one entry a cell, and a last one that stays zero: what lies behind walls

inline Field field_of(const Cells& cells) {
  Field field(cells.size() + std::size_t{1});
  std::fill(field.begin(), field.end(), Four{});
  return field;
}

/// The symmetric operator (u, p) -> (-div grad u + grad p, -div u): central differences of second order; no slip at walls,
/// which hold a velocity the more strongly the nearer they are (Cells::hold).
///
/// source  F. H. Harlow, J. E. Welch, "Numerical calculation of time-dependent viscous incompressible flow of fluid with free
///         surface", Physics of Fluids 8 (1965); walls: F. Gibou, R. P. Fedkiw, L.-T. Cheng, M. Kang, "A second-order-accurate
///         symmetric discretization of the Poisson equation on irregular domains", J. Comput. Phys. 176 (2002)
class Operator {
 public:
  /// cells  outlives it
  explicit Operator(const Cells& cells) : cells_(cells), step_{}, around_{} {
    float sum = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      weight_[a] = static_cast<float>(1 / (cells.edge[a] * cells.edge[a]));
      step_[static_cast<int>(a)] = static_cast<float>(1 / cells.edge[a]);
      sum += 2 * weight_[a];
    }
    around_ = Four{sum, sum, sum, 0};
  }

  /// Of cell i. Lanes of faces that do not exist stay 0.
  Four at(const Field& x, std::uint32_t i) const {
    const std::array<std::uint32_t, 6>& n = cells_.neighbour[i];
    const Four here = x[i], x0 = x[n[0]], x1 = x[n[1]], y0 = x[n[2]], y1 = x[n[3]], z0 = x[n[4]], z1 = x[n[5]];
    const Faces faces = faces_of(i);
    const Four around = weight_[0] * (x0 + x1) + weight_[1] * (y0 + y1) + weight_[2] * (z0 + z1);
    const Four rise = {x1[3] - here[3], y1[3] - here[3], z1[3] - here[3], 0};
    Four result = faces.exists * (faces.diagonal * here - around + step_ * rise);
    result[3] = step_[0] * (x0[0] - here[0]) + step_[1] * (y0[1] - here[1]) + step_[2] * (z0[2] - here[2]);
    return result;
  }
  struct Faces {
    Four exists, diagonal;  // 1 for each face that exists, and what multiplies the velocity there; 0 for pressure
  };
  Faces faces_of(std::uint32_t i) const {
    const Four hold = __builtin_convertvector(cells_.hold[i], Four);
    const Four exists = __builtin_convertvector(-(hold < kShut), Four);
    return {exists, exists * (around_ + Cells::kHold * hold)};
  }
  Four exists(std::uint32_t i) const { return faces_of(i).exists; }
  /// What a pressure of 1 in a cell alone lets out of it, of what it does far from walls.
  float yields(std::uint32_t i) const { return Cells::kHold * static_cast<float>(cells_.hold[i][3]); }
  float weight(int axis) const { return weight_[axis]; }  // of the neighbours along an axis
  const Cells& cells() const { return cells_; }

 private:
  static constexpr Four kShut = {Cells::kShut, Cells::kShut, Cells::kShut, 0};
  const Cells& cells_;
  std::array<float, 3> weight_;
  Four step_, around_;
};

// --- what inertia adds to Stokes' equations on the cells of a fluid; internal to stokes.

/// Convection at the faces of cells: central differences of second order in skew-symmetric form. Convection takes no energy
/// from a flow and gives it none, for any divergence: the sum of u . at(by, u) over all faces is zero.
/// source  F. H. Harlow, J. E. Welch (1965), as operator.h; R. W. C. P. Verstappen, A. E. P. Veldman, "Symmetry-preserving
///         discretization of turbulent flow", J. Comput. Phys. 187 (2003), for the form
class Convection {
 public:
  /// cells  outlives it
  explicit Convection(const Cells& cells) : cells_(cells) {
    for (std::size_t a = 0; a < 3; ++a) weight_[a] = static_cast<float>(0.25 / cells.edge[a]);
  }

  /// (by . grad) u at the faces of cell i; 0 for faces that do not exist, and in the fourth lane. What flows through the side
  /// of a face's box is the mean of the two velocities of `by` there, and carries half of what the neighbouring face has.
  Four at(const Field& by, const Field& u, std::uint32_t i) const {
    const std::array<std::uint32_t, 6>& n = cells_.neighbour[i];
    const std::uint32_t none = cells_.size();
    Four result{};
    for (std::size_t a = 0; a < 3; ++a) {
      const std::uint32_t ahead = n[2 * a + 1];
      if (ahead == none || cells_.hold[i][a] == Cells::kShut) continue;
      const std::array<std::uint32_t, 6>& m = cells_.neighbour[ahead];
      const int lane = static_cast<int>(a);
      float sum = 0;
      for (std::size_t b = 0; b < 3; ++b) {
        const int across = static_cast<int>(b);
        const std::uint32_t below = n[2 * b], above = n[2 * b + 1];
        // Along its own axis the sides of a face's box lie in the middle of cells, else between two cells.
        const float out = by[i][across] + by[ahead][across];
        const float in = by[below][across] + by[b == a ? i : m[2 * b]][across];
        sum += weight_[b] * (out * u[above][lane] - in * u[below][lane]);
      }
      result[lane] = sum;
    }
    return result;
  }

 private:
  const Cells& cells_;
  std::array<float, 3> weight_{};
};

// --- a field's velocities.

/// Along an axis in the middle of cell i: the mean of its two faces.
inline double velocity(const Cells& cells, const Field& u, std::uint32_t i, std::size_t axis) {
  const int a = static_cast<int>(axis);
  return 0.5 * (double{u[i][a]} + u[cells.neighbour[i][2 * axis]][a]);
}

inline double speed(const Cells& cells, const Field& u, std::uint32_t i) {
  double squared = 0;
  for (std::size_t a = 0; a < 3; ++a) squared += velocity(cells, u, i, a) * velocity(cells, u, i, a);
  return std::sqrt(squared);
}

/// Mean over the whole box along x, y, z.
inline std::array<double, 3> mean_velocity(const Cells& cells, const Field& u) {
  std::array<double, 3> mean{};
  for (int a = 0; a < 3; ++a)
    mean[static_cast<std::size_t>(a)] =
        sum_of_cells(cells.size(), [&](std::uint32_t i) { return double{u[i][a]}; }) / static_cast<double>(cells.voxels());
  return mean;
}

}  // namespace lamina::stokes
