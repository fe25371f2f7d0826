// stages/program/head_grid.h: from the mounting of a head to the grid of pixels that it can reach.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "stages/data/machine.h"
#include "stages/data/program.h"
#include "stages/data/status.h"

namespace lamina::program {

/// The pixels, lines, lags and steps of a machine.
///
/// With theta the angle between the row of nozzles and the scan axis (the tilt for a scan along x, 90 degrees minus the
/// tilt for one along y), p the pitch and k the passes: lines are p sin(theta) / k apart, and nozzle i lags i p
/// cos(theta) behind nozzle 0. Pixels along the scan are as long as lines are apart, or along_dpi, or whole ticks.
/// Pitches are whole picometres (rounded to the nearest) unless dpi are given, which are exact.
///
/// Lags are rounded to whole steps, exact halves down, so that at 45 degrees nozzle i lags exactly i pixels, and so that
/// with a scan along y the pixel of nozzle x at step b is Equation (1) of Puppi and Volpato (2021),
/// y = round(b - tan(tilt) x), halves up.
///
/// errors  kUsage, "machine: key: what is wrong"; among them: no angle, no pitch, a dpi that the head cannot reach,
///         rows that do not land on lines, all nozzles blocked or one that does not exist, too fast for the nozzles
Result<HeadGrid> make_head_grid(const Machine& machine);

/// Warns if stitch lines do not move from layer to layer though mounting.joint_shift_lines says so.
void warn_of_fixed_stitching(const Machine& machine, const HeadGrid& grid, std::vector<Warning>& warnings);

/// Changes a machine so that it prints at these dpi, along x and y, if its head can: across the scan by its number of
/// interlaced passes, along it by the length of a pixel.
/// grid    of the machine as it is
/// errors  kUsage, "bed.dpi: what is wrong": dpi that the head or the encoder cannot reach
Status require_dpi(Machine& machine, const HeadGrid& grid, const std::array<double, 2>& dpi);

}  // namespace lamina::program
