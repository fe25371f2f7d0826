// stages/stokes/convection.h: what inertia adds to Stokes' equations on the cells of a fluid; internal to stokes.
#pragma once

#include <array>
#include <cstdint>

#include "stages/stokes/cells.h"
#include "stages/stokes/operator.h"

namespace lamina::stokes {

/// Convection at the faces of cells: central differences of second order in skew-symmetric form. Convection takes no energy
/// from a flow and gives it none, whatever its divergence: the sum of u . at(by, u) over all faces is zero.
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

}  // namespace lamina::stokes
