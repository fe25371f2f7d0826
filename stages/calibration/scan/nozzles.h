// stages/calibration/scan/nozzles.h: offsets of nozzles and swaths from the dashes of a chart, with their errors.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "stages/calibration/scan/dashes.h"
#include "stages/calibration/scan/sheet_fit.h"
#include "stages/data/chart.h"

namespace lamina::calibration {

/// A length with its standard error, 0 where all dashes are marred and nothing is known.
/// within_um  99 in 100 of them are nearer to the true value (stages/calibration/robust.h)
struct Measure {
  double um = 0, error_um = 0, within_um = 0;
  bool known() const { return error_um > 0; }
};

/// A shift: along the scan, positive where places rise; across it, positive where lines rise.
struct Offset {
  Measure along, across;
};

struct HeadReading {
  std::vector<std::uint32_t> blocked, weak;   // nozzles: never detected, detected sometimes
  std::vector<std::uint32_t> unreadable;      // nozzles whose dashes are all hidden
  std::vector<std::optional<Offset>> nozzle;  // against the head's line, of detected nozzles
  std::vector<std::optional<Offset>> swath;   // against the first one, along the head's line; absent: not printed
};

/// Whether a swath was printed at all: a fifth of its dashes are there.
std::vector<bool> printed_swaths(const Chart& chart, const std::vector<DashReading>& detected);

/// Dashes that are there, of swaths that were printed, where `view` has them.
std::vector<Sighting> sightings_of(const Chart& chart, const std::vector<DashReading>& detected, const View& view,
                                   const std::vector<bool>& printed);

/// Decides each nozzle by all of its dashes in the swaths that were printed, and measures nozzles and swaths.
///
/// The head's line is the straight line through its nozzles' offsets (line_of), which is not separable from the scale of the
/// photograph. Errors of swaths follow from leaving out a ninth of all dashes at a time (jackknife). Those of nozzles are of
/// two parts: the scatter of dashes, and the line's own error, which the middle nozzle brings to all: found by moving nozzles
/// by their errors. fit      of these dashes printed  as printed_swaths() has it, one at least
HeadReading read_head(const Chart& chart, const std::vector<DashReading>& detected, const std::vector<bool>& printed,
                      const SheetFit& fit, bool lens);

}  // namespace lamina::calibration
