// stages/segment/permeability.h: Darcy's and Forchheimer's coefficients from flows and pressure drops.
//
//   dp / L = (mu / k1) v + (rho / k2) v^2
//
// as Di Nisio 2022 fits it (Eq. 6, section 3.3.2, Appendix B). SI units throughout.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/status.h"

namespace lamina::segment {

inline constexpr double kDarcy = 9.869233e-13;  // m2

struct FlowPoint {
  double velocity_m_s;       // flow / cross-section, not that in the pores
  double gradient_pa_m;      // pressure drop / length
  std::uint32_t sample = 0;  // which one was measured
};

struct Fluid {
  double viscosity_pa_s = 1.81e-5;  // air at 20 degC
  double density_kg_m3 = 1.204;
};

struct Permeability {
  double k1_m2 = 0, k2_m = 0;
  double k1_error_m2 = 0, k2_error_m = 0;  // standard errors, from the scatter of the points
  double linear = 0, quadratic = 0;        // of the parabola: Pa s / m2, Pa s2 / m3
  double r_squared = 0;                    // share of the gradients' squares about their mean that the parabola explains
  double scatter_pa_m = 0;                 // standard deviation of the points from the parabola
};

/// One least-squares parabola through the origin.
/// errors  kInput: fewer than three points, or all at one velocity; coefficients that are not positive
Result<Permeability> fit_permeability(std::span<const FlowPoint> points, const Fluid& fluid);

/// Where a gas is measured, which expands on its way through the medium. Pa, absolute.
struct GasPressures {
  double outlet_pa = 101325;
  double reference_pa =
      101325;  // at which velocities and density are told: those of the outlet, of a flow meter, of a standard
};

/// The gradients that make the law of gases linear in the coefficients as the one above:
///
///   (p_in^2 - p_out^2) / (2 p L) = (mu / k1) v + (rho / k2) v^2,  v and rho at the pressure p
///
/// which is dp / L, integrated along the medium at one temperature: v and rho go with 1 / p and p.
/// errors  kInput: a drop below 0 by more than the outlet's pressure
/// source  Innocentini, Pandolfelli, "Considerações sobre a estimativa da permeabilidade em concretos refratários através das
///         equações de Darcy e de Forchheimer" (1999)
Result<std::vector<FlowPoint>> expanded(std::span<const FlowPoint> points, double length_m, const GasPressures& pressures);

}  // namespace lamina::segment
