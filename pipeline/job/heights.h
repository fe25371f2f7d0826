// pipeline/job/heights.h: [heights] of a job: how its layers are decided.
#pragma once

#include <array>
#include <string>
#include <string_view>

#include "stages/data/layer.h"
#include "stages/data/status.h"
#include "stages/heights/heights.h"

namespace lamina::pipeline {

struct Job;

struct HeightsRequest {
  heights::Mode mode = heights::Mode::kUniform;
  std::string thickness_mm;  // "0.178,0.254" or "0.05..0.3:0.01"; empty: layers.thickness_mm
  double cusp_mm = 0.1;
  double adapt_angle_deg = 45;
  double peak_angle_deg = 90;
  double normal_tolerance = 1e-3;
  heights::Facets facets = heights::Facets::kRange;
  double least_facet_mm2 = 0;
  bool flats = true;
  double least_flat_mm2 = 1;
  double flat_tolerance_um = 1;
  std::array<double, 2> time_model{0, 0};  // seconds a layer, seconds a mm2 of its section
  Containment containment = Containment::kAcross;
  bool per_part = false;
};

/// Reads a set "0.178,0.254" or a range "0.05..0.3:0.01" of thicknesses in mm; a range without a step has steps of
/// 0.001 mm, and holds what lies on the steps from its lower end. Sets may be in any order.
/// returns "" or what is wrong and what would be right; the set is then as it was
std::string read_thicknesses(std::string_view text, heights::ThicknessSet& set);

/// [heights] of a job as the stage takes it, checked. errors  kUsage, one line that begins with the key
Result<heights::Options> heights_options(const Job& job);

/// What a person is told of [heights]: "of 0.05 mm", "of 0.05..0.3 mm, optimal, steps up to 0.1 mm".
std::string heights_text(const Job& job);

/// The word of a way, as in a job file.
std::string mode_name(heights::Mode mode);

}  // namespace lamina::pipeline
