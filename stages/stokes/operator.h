// stages/stokes/operator.h: Stokes' equations on the cells of a fluid of viscosity 1; internal to stokes.
#pragma once

#include <array>
#include <cstdint>

#include "stages/data/buffer.h"
#include "stages/stokes/cells.h"

namespace lamina::stokes {

/// What a cell holds: velocity through its three upper faces, and pressure.
using Four [[gnu::vector_size(16)]] = float;
using Field = Buffer<Four>;  // one entry a cell, and a last one that stays zero: what lies behind walls

Field field_of(const Cells& cells);

/// The symmetric operator (u, p) -> (-div grad u + grad p, -div u): central differences of second order; no slip at walls,
/// which hold a velocity the more strongly the nearer they are (Cells::hold).
///
/// source  F. H. Harlow, J. E. Welch, "Numerical calculation of time-dependent viscous incompressible flow of fluid with free
///         surface", Physics of Fluids 8 (1965); walls: F. Gibou, R. P. Fedkiw, L.-T. Cheng, M. Kang, "A second-order-accurate
///         symmetric discretization of the Poisson equation on irregular domains", J. Comput. Phys. 176 (2002)
class Operator {
 public:
  /// cells  outlives it
  explicit Operator(const Cells& cells);

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

}  // namespace lamina::stokes
