// stages/heights/heights.h: which layers a job is made of.
//
// Five ways to decide. All of them read the same index of the parts' surface, all heights are integer nm, and the same
// parts and options give the same table for any number of threads.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/choices.h"
#include "stages/data/status.h"
#include "stages/heights/candidate_heights.h"
#include "stages/heights/flats.h"
#include "stages/heights/settings.h"
#include "stages/heights/surface.h"
#include "stages/heights/table.h"

namespace lamina::heights {

/// What a layer costs; with both 0 every layer costs the same.
struct TimeModel {
  double seconds_per_layer = 0;
  double seconds_per_mm2 = 0;  // of the section at the layer's bottom, of all copies
  bool on() const { return seconds_per_layer > 0 || seconds_per_mm2 > 0; }
};

/// What comparisons tell time by where no model is given: a section filled with beads of 0.4 mm at 40 mm/s, and 2 s to lift.
inline constexpr TimeModel kPlainTime{2, 1 / (0.4 * 40)};

struct Options {
  Mode mode = Mode::kUniform;
  ThicknessSet set;             // all modes; uniform has exactly one
  Nm cusp = 100'000;            // nm, the highest step on a slope: cusp, stepwise, optimal
  double adapt_angle_deg = 45;  // angle: slopes at least this flat get thinner layers
  SurfaceOptions surface;
  Facets facets = Facets::kRange;  // angle, cusp, stepwise
  double min_flat_mm2 = 1;         // smaller flats are not aimed at
  Peaks peaks = Peaks::kFlats;     // angle
  bool cover_top = false;          // angle, optimal: the last layer ends at or above the top, within the flat tolerance
  bool flats = true;               // optimal: end layers on flats and on tops and bottoms of parts
  TimeModel time;                  // optimal
  bool estimates_time = false;     // evaluate: by kPlainTime if no model is given
  std::int64_t slab = 0;           // nm, optimal: if not 0, every multiple of it is a boundary, but for one that is
                                   // nearer below the top than the least thickness
};

/// How near a flat the nearest boundary of a table lies.
struct FlatHit {
  Flat flat;
  std::int64_t miss = 0;  // nm
};

/// A table and what can be said for it.
struct Plan {
  LayerTable table;
  std::vector<Steepness> inspected;  // angle: of each layer, the flattest slope that decided; else empty
  std::vector<bool> stepped_back;    // cusp: thinner than the slopes at its bottom ask for
  std::uint32_t small_peaks = 0;     // angle: heights with horizontal facets that are peaks in the documents, but no flats
  /// optimal: no table of one layer less (or, with a time model, of less time) that ends as near to the flats and keeps
  /// the step gets higher than this, nm; -1 if there is no such statement
  std::int64_t one_less_reaches = -1;
  std::int64_t largest_miss = 0;  // optimal: nm, the smallest that any table can have
};

/// Settings as the stage takes them. layer_mm is the thickness where settings name none.
/// errors  kUsage, one line that begins with the key: no thicknesses to choose from; of read_thicknesses and check_options
Result<Options> options_of(const Settings& settings, double layer_mm);

/// Whether options make sense together. errors  kUsage, one line that begins with the key
Status check_options(const Options& options);

/// Decides all layers of the parts, standing on the bed at height 0.
/// errors  of check_options; kUsage if the thicknesses reach too many heights
/// cost    uniform O(1); others O(facets + height / step), optimal times the number of thicknesses
Result<Plan> plan_heights(const SurfaceIndex& index, const Options& options);

}  // namespace lamina::heights
