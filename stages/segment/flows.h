// stages/segment/flows.h: tables of measured flows and pressure drops, and the parabola through them.
#pragma once

#include <string>
#include <vector>

#include "stages/data/plot.h"
#include "stages/data/status.h"
#include "stages/segment/permeability.h"

namespace lamina {
class FileReader;
}

namespace lamina::segment {

/// What the fluid flows through.
struct Medium {
  double length_m = 0, area_m2 = 0;  // along the flow; its cross-section
};

struct FlowGroup {
  std::string name;  // of the rows' column "configuration", if there is one
  std::vector<FlowPoint> points;
  std::vector<std::string> samples{};  // names that the points count in; empty: the table tells none apart
};

/// A table with a header: one column of flows or velocities, one or more of pressure drops; units by their endings. Rows may
/// name their sample in a column "sample"; without it, each of several columns of drops is a sample.
/// errors  kInput: file, line, column, what is wrong
Result<std::vector<FlowGroup>> read_flows(const std::string& path, const Medium& medium);
Result<std::vector<FlowGroup>> read_flows(FileReader& file, const Medium& medium);

/// Points and parabola.
/// gas  the points are expanded(): says so beside the axis
Plot draw_fit(const FlowGroup& group, const Permeability& fit, bool gas = false);

}  // namespace lamina::segment
