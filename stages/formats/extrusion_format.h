// stages/formats/extrusion_format.h: what writers of toolpaths are given, and how they are called.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "stages/data/buffer.h"
#include "stages/data/extruder.h"
#include "stages/data/layer.h"
#include "stages/data/status.h"
#include "stages/data/toolpaths.h"
#include "stages/geometry/travel/edge_grid.h"

namespace lamina::formats {

/// Sums over what was written; those of layers add up to those of the file.
struct MoveTotals {
  std::uint64_t moves = 0, travels = 0, retractions = 0;
  double bead_mm = 0, travel_mm = 0;
  double volume_mm3 = 0;   // of all beads: filament_mm x the filament's area x the machine's declared error
  double filament_mm = 0;  // sum of E; what is drawn back comes again and does not count
  double seconds = 0;      // as the firmware plans the moves (gcode/print_time.h)
  std::int64_t lo_x = INT64_MAX, lo_y = INT64_MAX, hi_x = INT64_MIN, hi_y = INT64_MIN;  // nm, of beads' centres
  // The share of moves, beads, volume and filament that is not of the parts: skirts, brims and rafts.
  std::uint64_t auxiliary_moves = 0;
  double auxiliary_mm = 0, auxiliary_mm3 = 0, auxiliary_filament_mm = 0;
  Point2 first{0, 0}, last{0, 0};  // where the first bead begins and the nozzle stops, if there are beads
  std::uint64_t part_moves() const { return moves - auxiliary_moves; }

  void add(const MoveTotals& other) {
    if (moves == 0) first = other.first;
    if (other.moves > 0) last = other.last;
    moves += other.moves;
    travels += other.travels;
    retractions += other.retractions;
    bead_mm += other.bead_mm;
    travel_mm += other.travel_mm;
    volume_mm3 += other.volume_mm3;
    filament_mm += other.filament_mm;
    seconds += other.seconds;
    lo_x = std::min(lo_x, other.lo_x);
    lo_y = std::min(lo_y, other.lo_y);
    hi_x = std::max(hi_x, other.hi_x);
    hi_y = std::max(hi_y, other.hi_y);
    auxiliary_moves += other.auxiliary_moves;
    auxiliary_mm += other.auxiliary_mm;
    auxiliary_mm3 += other.auxiliary_mm3;
    auxiliary_filament_mm += other.auxiliary_filament_mm;
  }
  /// Adds a bead. feed  mm of filament a mm3
  void deposit(const BeadMove& move, double length_mm, double feed) {
    const double volume = length_mm * move.area_mm2;
    if (moves == 0) first = move.from;
    last = move.to;
    ++moves;
    bead_mm += length_mm;
    volume_mm3 += volume;
    filament_mm += volume * feed;
    if (is_auxiliary(move.kind)) {
      ++auxiliary_moves;
      auxiliary_mm += length_mm;
      auxiliary_mm3 += volume;
      auxiliary_filament_mm += volume * feed;
    }
    for (const Point2 p : {move.from, move.to}) {
      lo_x = std::min<std::int64_t>(lo_x, p.x);
      lo_y = std::min<std::int64_t>(lo_y, p.y);
      hi_x = std::max<std::int64_t>(hi_x, p.x);
      hi_y = std::max<std::int64_t>(hi_y, p.y);
    }
  }
};

/// What a file takes: the one source of every volume and mass that is reported of it. Numbers of the file itself are rounded.
struct FilamentUse {
  double mm3 = 0, grams = 0;
};
inline FilamentUse filament_use(const MoveTotals& totals, const Extruder& machine) {
  const double mm3 = totals.filament_mm * machine.material.mm3_of_e();
  return {mm3, mm3 * 1e-3 * machine.material.density_g_cm3};
}

/// What a firmware can leave out of a running print: parts that touch are one.
struct ExtrusionObject {
  std::string name;           // letters, digits, - and _; different ones
  std::int64_t lo[2], hi[2];  // nm on the bed: x, y
};

struct ExtrusionHead {
  std::string program;  // "lamina 0.1.0"
  std::string source;   // names of the parts, one line
  std::uint32_t layers = 0;
  bool segmented = false;
  std::span<const ExtrusionObject> objects = {};  // if the machine has tags of them
  std::string thumbnail = {};                     // lines of comments
};

/// The layers of the file, from 0, with which settings of first layers end: parts with layers of their own have several.
struct Switches {
  std::uint32_t temperatures = 1;    // the later ones
  std::optional<std::uint32_t> fan;  // absent: the machine's from_layer
};

/// mm
inline double length_of(const BeadMove& move) {
  const double dx = mm(std::int64_t{move.to.x} - move.from.x), dy = mm(std::int64_t{move.to.y} - move.from.y);
  return std::sqrt(dx * dx + dy * dy);
}

/// What is around the moves of a layer.
struct LayerSurroundings {
  const travel::EdgeGrid* region = nullptr;       // within the layer's contours, for travels; may be absent
  Nm inset = 0;                                   // distance from the contours at which travels follow them
  bool segmented = false;                         // widths of lines depend on their speed
  std::span<const ExtrusionObject> objects = {};  // those of the head; none: no tags
  struct Progress {
    std::uint32_t layer;   // of the file, from 1
    int percent, minutes;  // of the time that is over, estimated; left
  };
  std::optional<Progress> progress = {};
};

/// Takes the moves of one layer, one after the other.
class LayerMoves {
 public:
  virtual ~LayerMoves() = default;
  /// Writes a move; returns its length in mm.
  virtual double deposit(const BeadMove& move) = 0;
  /// The moves from here on are those of ExtrusionHead::objects[object].
  virtual void begin_object(std::uint32_t) {}
  /// Ends the layer. returns its sums
  virtual const MoveTotals& finish() = 0;
};

/// A format. head, the layers in order and tail are the file; a layer's text depends on that layer alone, so layers can
/// be written by many threads at once.
class ExtrusionFormat {
 public:
  virtual ~ExtrusionFormat() = default;
  /// Whether the machine can extrude layers of that thickness. errors  kUsage
  virtual Status check(const Layer& layer) const = 0;
  virtual void head(const ExtrusionHead& head, Buffer<char>& out) const = 0;
  /// around  must outlive what is returned
  virtual std::unique_ptr<LayerMoves> layer(const Layer& layer, std::uint32_t layers, Buffer<char>& out,
                                            const LayerSurroundings& around = {}) const = 0;
  virtual void tail(const MoveTotals& totals, std::uint32_t layers, Buffer<char>& out) const = 0;
  /// Of a travel between layers.
  virtual double travel_seconds(double length_mm) const = 0;

  /// Adds the travel from the layers before to a layer, whose writer does not know them.
  void travel_from(const MoveTotals& before, MoveTotals& layer) const {
    if (before.moves == 0 || layer.moves == 0) return;
    const double length =
        std::hypot(mm(std::int64_t{layer.first.x} - before.last.x), mm(std::int64_t{layer.first.y} - before.last.y));
    layer.travel_mm += length;
    layer.seconds += travel_seconds(length);
  }
};

/// `machine` has to outlive them.
std::unique_ptr<ExtrusionFormat> make_gcode_format(const Extruder& machine, const Switches& switches = {});
std::unique_ptr<ExtrusionFormat> make_sml_format(const Extruder& machine);
/// The one that the machine reads.
inline std::unique_ptr<ExtrusionFormat> make_extrusion_format(const Extruder& machine, const Switches& switches = {}) {
  return machine.format == "sml" ? make_sml_format(machine) : make_gcode_format(machine, switches);
}

}  // namespace lamina::formats
