// stages/segment/design/designed.h: what is found of a wish, once its plan is run forward.
#pragma once

#include <string>
#include <vector>

#include "stages/segment/design/gradient.h"

namespace lamina::segment {

/// Of one period of the plan.
struct ForwardRun {
  double porosity = 0, porosity_through = 0;              // all void, and what leads through along z
  double permeability_m2 = 0, permeability_error_m2 = 0;  // Darcy's k1 along z; the error is that of the voxels
  bool resolved = true;                                   // false: voxels are too coarse for the pores
  double pore_length_mm = 0, pore_width_mm = 0;           // means of the pores that the written toolpaths leave; 0 without any
};

struct DesignedJob {
  Design design;       // as the corrected model says
  ForwardRun forward;  // of this design
  double miss = 0;     // of the wish that the forward run meets worst: relative
  bool met = false;    // within the tolerance
  std::uint32_t runs = 0;
  std::vector<RatioAt> known;        // what forward runs said, of earlier searches too
  double model_ratio = 1;            // k1 of the forward run / of the slots alone
  std::vector<std::string> outside;  // what of the choice lies beyond what was measured, one line each
  std::string widths;                // where the widths of beads come from
  std::string toml;                  // of the job file
};

struct GradientStep {
  WishStep step;
  DesignedJob found;  // its forward run, miss and met are of the one file of all regions
};

struct GradientJob {
  std::vector<GradientStep> steps;  // from the bottom up
  double miss = 0;                  // of the step that misses its wish by most
  bool met = false;                 // all of them
  std::uint32_t lines = 0;          // continuous ones in all regions; 0: not the same ones
  std::uint32_t runs = 0;           // forward runs, of the one file one for each region
  double porosity = 0;              // mean over the height
  double permeability_m2 = 0;       // along z, regions in series; what is lost where they meet is left out
  std::string toml;                 // of the job file: ranges of heights
};

/// Of the wish that a forward run meets worst: relative.
double miss_of(const PoreWish& wish, const ForwardRun& forward);

/// What of a choice lies beyond what was measured, one line each.
std::vector<std::string> outside_of(const DesignLimits& limits, const Choice& choice);

}  // namespace lamina::segment
