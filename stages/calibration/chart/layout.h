// stages/calibration/chart/layout.h: a calibration chart for the head of a powder printer.
//
//   o | nozzle by nozzle, thrice | verniers of stitches | bars of known widths, wedges | o
//
// Three combs are printed along the scan. In a comb each nozzle of each swath prints one dash alone; neighbouring dashes are of
// nozzles so far apart that blurred ones do not touch.
#pragma once

#include "stages/data/chart.h"
#include "stages/data/machine.h"
#include "stages/data/program.h"
#include "stages/data/status.h"

namespace lamina::calibration {

/// The machine as it prints charts: every nozzle fires what lies under it, once. Swaths share no lines, no nozzle counts as
/// blocked. drops  for a counted number of them: other nozzles fire those of blocked ones
Machine chart_machine(Machine machine, bool drops = false);

/// Arranges the chart for chart_machine() and its grid. Swaths are those of the print program: chart and nozzles belong
/// together. returns  its boxes, all of them on the bed errors   kUsage: the bed is too small for a chart of this head
Result<Chart> layout_chart(const Machine& machine, const HeadGrid& grid);

}  // namespace lamina::calibration
