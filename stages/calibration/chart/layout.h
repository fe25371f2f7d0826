// stages/calibration/chart/layout.h: a calibration chart for the head of a powder printer, layers of a stated number of drops,
// and the images of both.
//
//   o | nozzle by nozzle, thrice | verniers of stitches | bars of known widths, wedges | o
//
// Three combs are printed along the scan. In a comb each nozzle of each swath prints one dash alone; neighbouring dashes are of
// nozzles so far apart that blurred ones do not touch.
#pragma once

#include <cstdint>

#include "stages/data/chart.h"
#include "stages/data/machine.h"
#include "stages/data/program.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"

namespace lamina::calibration {

/// The machine as it prints charts: every nozzle fires what lies under it, once. Swaths share no lines, no nozzle counts as
/// blocked. drops  for a counted number of them: other nozzles fire those of blocked ones
Machine chart_machine(Machine machine, bool drops = false);

/// Arranges the chart for chart_machine() and its grid. Swaths are those of the print program: chart and nozzles belong
/// together. returns  its boxes, all of them on the bed errors   kUsage: the bed is too small for a chart of this head
Result<Chart> layout_chart(const Machine& machine, const HeadGrid& grid);

/// The image of a chart. cost  O(rows of all boxes)
Runs draw(const Chart& chart);

/// Layers that hold a stated number of drops together: all but the last hold a full layer's. Whole swaths are filled, so that
/// every nozzle fires about as often.
struct DropLayers {
  std::uint64_t drops = 0, a_layer = 0;
  std::uint32_t layers = 0;
  ChartBox box;  // of a full layer
};

/// drops   at least 1
/// errors  kUsage: no room on the bed, or more than a thousand layers
Result<DropLayers> layout_drops(const Machine& machine, const HeadGrid& grid, std::uint64_t drops);

/// Layer `layer` of them: full from its first row on, its last row as far as the drops go.
Runs draw_drops(const DropLayers& wanted, const HeadGrid& grid, std::uint32_t layer);

/// Volume of a drop in pl from the mass of many. mass in mg, density in g/ml
constexpr double drop_pl_of(double mass_mg, double density, double drops) { return mass_mg / density / drops * 1e6; }

}  // namespace lamina::calibration
