// stages/segment/samples.h: the differences of a configuration's samples, besides the one parabola through all their points.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stages/data/status.h"
#include "stages/segment/flows.h"
#include "stages/segment/permeability.h"

namespace lamina::segment {

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
