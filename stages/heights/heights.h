// stages/heights/heights.h: which layers a job is made of.
//
// Five ways to decide. All of them read the same index of the parts' surface, all heights are integer nm, and the same
// parts and options give the same table for any number of threads.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/choices.h"
#include "stages/data/layer.h"
#include "stages/data/machine.h"
#include "stages/data/status.h"
#include "stages/heights/candidate_heights.h"
#include "stages/heights/settings.h"
#include "stages/heights/surface.h"

namespace lamina::heights {

/// Layers without gap or overlap, from height 0. A uniform table holds no layer and makes them on demand; any other one
/// holds 12 bytes a layer.
class LayerTable {
 public:
  /// height, thickness  nm, > 0
  /// first  thickness of the first layer; 0: as the others
  /// The last layer counts even where it is only partly filled: ceil(height / thickness) layers.
  static LayerTable uniform(std::int64_t height, Nm thickness, Nm first = 0) {
    LayerTable table;
    table.thickness_ = thickness;
    table.first_ = first > 0 ? first : thickness;
    const std::int64_t above = std::max<std::int64_t>(0, height - table.first_);
    table.count_ = 1 + static_cast<std::uint32_t>(ceil_div<std::int64_t>(above, thickness));
    return table;
  }
  LayerTable() = default;

  /// Layers are then added without moving the others; not of a uniform table.
  void reserve(std::uint32_t layers) { entries_.reserve(layers); }
  std::size_t capacity() const { return entries_.capacity(); }
  void add(Nm thickness, LayerReason reason) {
    entries_.push_back({static_cast<Nm>(top()), thickness, reason});
    ++count_;
  }

  /// Takes the last layer away; not of a uniform table.
  void drop_last() {
    entries_.pop_back();
    --count_;
  }

  std::uint32_t size() const { return count_; }
  Layer operator[](std::uint32_t index) const {
    if (thickness_ > 0) {
      if (index == 0) return {0, 0, first_, LayerReason::kUniform};
      return {index, static_cast<Nm>(first_ + (std::int64_t{index} - 1) * thickness_), thickness_, LayerReason::kUniform};
    }
    const LayerEntry& entry = entries_[index];
    return {index, entry.bottom, entry.thickness, entry.reason};
  }
  /// Where the last layer ends, nm.
  std::int64_t top() const {
    if (thickness_ > 0) return count_ == 0 ? 0 : first_ + (std::int64_t{count_} - 1) * thickness_;
    return count_ == 0 ? 0 : std::int64_t{entries_.back().bottom} + entries_.back().thickness;
  }

 private:
  struct LayerEntry {
    Nm bottom, thickness;
    LayerReason reason;
  };
  Nm thickness_ = 0;  // > 0: uniform, and nothing is stored
  Nm first_ = 0;      // of a uniform table
  std::uint32_t count_ = 0;
  Buffer<LayerEntry> entries_;
};

/// Empty, or a warning if some layers end between two steps of the build vat of a powder printer.
/// errors  kUsage: a layer thinner than a step
/// cost    O(layers)
Result<std::string> check_build_steps(const Machine& machine, const LayerTable& table);

/// What a layer costs; with both 0 every layer costs the same.
struct TimeModel {
  double seconds_per_layer = 0;
  double seconds_per_mm2 = 0;  // of the section at the layer's bottom, of all copies
  double seconds(double section_mm2) const { return seconds_per_layer + seconds_per_mm2 * section_mm2; }
  bool on() const { return seconds_per_layer > 0 || seconds_per_mm2 > 0; }
};

/// The time model of comparisons where none is given: a section filled with beads of 0.4 mm at 40 mm/s, and 2 s to lift.
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
  std::vector<bool> stepped_back;    // cusp: thinner than the slopes at its bottom require
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

/// Every part is built in slabs that are common to all; within a slab each part has its own layers, so that a part
/// with steep walls need not be built in the thin layers that its neighbour's slopes require.
/// source  J. Tyberg and J. H. Bohn, "Local adaptive slicing", Rapid Prototyping Journal 4 (1998)
struct PerPartPlan {
  std::int64_t slab = 0;    // nm: every part has a boundary at each multiple of it, up to the least thickness
                            // below its top
  std::vector<Plan> parts;  // by part; the table ends at the part's top
};

/// The height of the slabs: the greatest thickness, rounded up to a multiple of the least one, where the thicknesses
/// are a range; else the lowest height that both the least and the greatest thickness divide.
std::int64_t slab_height(const ThicknessSet& set);

/// Whether slabs of these thicknesses are low enough. errors  kUsage
Status check_slab(const ThicknessSet& set);

/// The best table for every part (of Mode::kOptimal) of those that keep to the slabs.
/// index  used up
/// errors  of check_slab; as plan_heights
Result<PerPartPlan> plan_per_part(SurfaceIndex index, const Options& options);

/// Holds layers, from the bottom up, to the options that decided them: each begins where the one before ends, the first on the
/// bed, and has a thickness of the set, or of an even division of a slab. Which thickness of the set a layer has the parts
/// decide, which are not at hand.
class OnRecord {
 public:
  /// options  none: they are not known
  explicit OnRecord(std::optional<Options> options) : options_(std::move(options)) {}

  /// Takes the next layer. errors  kVerification: "layer 3: begins 300000 nm above the bed, the manifest says 300001"
  Status check(const Layer& layer);

 private:
  Status check_thickness(const Layer& layer);
  bool divides_slab(const Layer& layer);

  std::optional<Options> options_;
  std::optional<std::int64_t> begins_;  // the next layer
  // Of a slab that is divided evenly: the layers of it so far, and into how many it can be divided.
  std::int64_t count_ = -1, fewest_ = 1, max_ = 1;  // count_: below 0 within a slab whose first layers are not known
};

}  // namespace lamina::heights
