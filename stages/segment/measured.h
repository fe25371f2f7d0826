// stages/segment/measured.h: widths that were measured on test pieces -> what a printer makes of speed and extrusion.
//
// The pieces and the rules are those of Di Nisio 2022, Appendix A: speeds and extrusions of thin stretches line by line,
// then repeated short stretches measured in the initial, the central and the final region of the part. Of the thick speeds
// tried for an extrusion the one at which widths change least along the part is taken (step 4), and spacings follow from
// the widths at that speed (step 5).
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "stages/data/status.h"
#include "stages/segment/calibration.h"

namespace lamina::segment {

/// One row of measurements, mm; what was not measured is absent.
struct Measured {
  enum class Test { kFlow, kSpeed, kExtrusion, kRepeated } test;
  double percent = 100;              // kSpeed: of thin stretches; kExtrusion: of thin stretches; kRepeated: of whole lines
  double thick_speed_percent = 100;  // kRepeated
  std::string region;                // kRepeated: of the part; several rows of one region are averaged
  std::optional<double> wall, thick, thin, continuous, stable;
  std::size_t row = 0;  // for messages
};

struct MeasuringSettings {
  double width_mm = 0.4, height_mm = 0.3, speed_mm_s = 15;  // what 100 % meant while the pieces were printed
  double thin_speed_percent = 200;                          // of the repeated stretches
  double flow = 1;                                          // that walls were printed with
  double gap_mm = 0;                                        // wanted between beads
  bool exact_spacing = false;  // from the mean widths; else as the document rounds them (published_spacing)
};

/// What was found for one extrusion of repeated stretches.
struct Settled {
  Calibration::Repeated widths;
  Spacing spacing;
  double deviation_mm;  // largest difference of a width between regions
  std::size_t tried;    // thick speeds
};

struct MeasuredMachine {
  Calibration calibration;
  std::optional<double> flow;       // with which two walls measure twice the width
  std::vector<Settled> settled;     // extrusion increasing
  std::vector<std::string> advice;  // what is to be printed again, and with what; one line each
};

/// A deviation along the part that is accepted: the resolution of the document's printer.
inline constexpr double kAcceptedDeviation = 0.012;

/// source  names the measurements, for people
/// errors  kInput: "row N: ..." where a row lacks a width or repeats one; nothing measured at all
Result<MeasuredMachine> calibrate(const std::vector<Measured>& rows, const MeasuringSettings& settings,
                                  const std::string& source);

}  // namespace lamina::segment
