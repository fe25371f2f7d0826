// stages/segment/permeability.h: Darcy's and Forchheimer's coefficients from tables of flows and pressure drops.
//
//   dp / L = (mu / k1) v + (rho / k2) v^2
//
// as Di Nisio 2022 fits it (Eq. 6, section 3.3.2, Appendix B). SI units throughout.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stages/data/plot.h"
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
  double reference_pa = 101325;  // where velocities and density are stated: of the outlet, of a flow meter, of a standard
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

// --- tables of measurements

/// What the fluid flows through.
struct Medium {
  double length_m = 0, area_m2 = 0;  // along the flow; its cross-section
};

struct FlowGroup {
  std::string name;  // of the rows' column "configuration", if there is one
  std::vector<FlowPoint> points;
  std::vector<std::string> samples{};  // names that the points count in; empty: the table has none
};

/// A table with a header: one column of flows or velocities, one or more of pressure drops; units by their endings. Rows may
/// name their sample in a column "sample"; without it, each of several columns of drops is a sample.
/// errors  kInput: file, line, column, what is wrong
Result<std::vector<FlowGroup>> read_flows(const std::string& path, const Medium& medium);

/// Points and parabola.
/// gas  the points are expanded(): says so next to the axis
Plot draw_fit(const FlowGroup& group, const Permeability& fit, bool gas = false);

// --- the differences of a configuration's samples, besides the one parabola through all their points

/// Of values of equal weight, in their unit.
struct Spread {
  double mean = 0, deviation = 0;  // of a sample: n - 1
  double mean_error = 0;           // standard error of the mean: deviation / sqrt(n)
  double coefficient() const { return mean == 0 ? 0 : deviation / mean; }
};
/// values  at least one; of a single one nothing spreads: 0
Spread spread_of(const std::vector<double>& values);

struct SampleFit {
  std::string name;
  std::size_t points = 0;
  Permeability fit;
};

/// The points of one sample lie on one parabola better than those of several do: the standard errors of the pooled fit take all
/// points as independent, and are too small where samples differ. The spread of the samples' own fits shows that.
struct GroupFit {
  Permeability pooled;
  std::vector<SampleFit> samples;     // in the order of the table; empty where it names fewer than two
  Spread k1_m2, k2_m;                 // of the samples, 0 without them
  std::vector<std::string> left_out;  // samples that no parabola fits: name and why, one line each
};

/// errors  of fit_permeability() for all points; a sample that cannot be fitted is left out
/// cost    O(points)
Result<GroupFit> fit_group(const FlowGroup& group, const Fluid& fluid);

struct DropsSettings {
  Medium medium;
  Fluid fluid;
  std::optional<GasPressures> gas;  // fit the law of gases too
};

/// One configuration of a table.
struct DropsFit {
  FlowGroup group;
  std::optional<GroupFit> plain;  // none only where the law of gases fits and this one does not
  std::optional<GasPressures> pressures;
  FlowGroup expanded;  // with pressures: the gradients of gases
  std::optional<GroupFit> gas;
  std::vector<std::string> warnings;  // what is left out and why
};

/// errors  of read_flows(), fit_group() and expanded(), with the file and configuration
Result<std::vector<DropsFit>> fit_drops(const std::string& path, const DropsSettings& settings);

}  // namespace lamina::segment
