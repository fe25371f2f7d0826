// stages/stokes/preconditioner.h: a cheap estimate of the velocity and pressure that correct a residual; internal to stokes.
#pragma once

#include <vector>

#include "stages/stokes/cells.h"
#include "stages/stokes/operator.h"

namespace lamina::stokes {

/// Velocity is corrected on the cells and on all groups of them at once, each by the diagonal of the operator there; pressure
/// is the divergence over what the cell's faces let out. The sum is symmetric and positive, as minimal residuals need it.
/// source  J. H. Bramble, J. E. Pasciak, J. Xu, "Parallel multilevel preconditioners", Mathematics of Computation 55 (1990),
///         with groups for the coarse grids; H. C. Elman, D. J. Silvester, A. J. Wathen, "Finite Elements and Fast Iterative
///         Solvers" (2014), 4.2, for the pressure
class Preconditioner {
 public:
  /// stokes, levels  outlive it
  /// scratch         of the cells; is overwritten
  Preconditioner(const Operator& stokes, const std::vector<Groups>& levels, Field& scratch);

  /// The residual's sum over a group of the first level, which gather() needs of all.
  Four& sum_of(std::uint32_t group) { return coarse_.front().sum[group]; }
  /// Takes the sums on to the other levels and makes what they add. Then at() gives the result.
  void gather();
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

}  // namespace lamina::stokes
