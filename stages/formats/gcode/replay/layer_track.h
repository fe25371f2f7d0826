// stages/formats/gcode/replay/layer_track.h: heights, order and walls of layers while a file is replayed.
#pragma once

#include <cstdint>
#include <string_view>

#include "stages/formats/gcode/commands.h"
#include "stages/formats/gcode/replay/defects.h"

namespace lamina::formats::gcode {

/// What the types of beads of the slicers are: `External perimeter` (PrusaSlicer), `Outer wall` (Orca, BambuStudio),
/// `WALL-OUTER` (Cura).
enum class BeadRole : std::uint8_t { kOther, kOuter, kInner, kSupport };
BeadRole role_of(std::string_view type);

/// Takes the beads of a file by layers. Layers begin at tags; without them where z changes
/// between beads.
class LayerTrack {
 public:
  struct TrackRules {
    bool walls_close = false;
    std::uint32_t raft_layers = 0;  // may have a gap above them
    double nozzle_mm = 0.4;         // no layer is thicker
  };
  explicit LayerTrack(const TrackRules& rules) : rules_(rules) {}

  /// A tag that begins a layer.
  void tag(std::uint64_t line, Defects& defects);
  /// ;Z: of PrusaSlicer and lamina.
  void state_z(double z) { stated_z_ = z; }
  /// height  of tags; 0: not stated
  void bead(const RawBead& bead, BeadRole role, double height, std::uint64_t line, Defects& defects);
  /// A move that deposits nothing: what is deposited next is another path.
  void end_path(Defects& defects);
  void finish(Defects& defects);

  bool tagged() const { return tagged_; }
  std::uint32_t index() const { return now_.index; }  // from 0
  std::uint32_t count() const { return begun_ ? now_.index + 1 : 0; }

 private:
  struct TrackedLayer {
    std::uint32_t index = 0;
    std::uint64_t line = 0;
    double z = 0, top = 0, height = 0;  // z: of the first bead; top: of the highest
    std::uint64_t beads = 0;
    bool part = false, outer = false;  // has beads other than supports; outer walls
    bool climbs = false;               // begins with a bead that climbs
    FileLine begin() const { return {line, index}; }
  };
  void begin_layer(std::uint64_t line);
  void close_layer(Defects& defects);
  void compare_heights(Defects& defects);
  void compare_rise(double rise, Defects& defects);
  void compare_walls(Defects& defects);

  TrackRules rules_;
  bool tagged_ = false, begun_ = false;
  double stated_z_ = -1;
  TrackedLayer now_, below_;  // below: the last one with beads
  bool has_below_ = false;
  double first_z_ = 0, top_ = 0, last_z_ = 0;
  double rise_ = 0;  // of the layer before
  // A gap without tags of heights is compared with the rise of the next layer too.
  FileLine gap_;
  double gap_z_ = 0, gap_below_ = 0, gap_rise_ = 0;  // rise 0: no gap
  FileLine empty_;                                   // the first layer without beads since the last one with
  std::uint64_t empties_ = 0, wall_less_ = 0;
  double empty_z_ = 0;
  bool had_wall_ = false;
  FileLine without_wall_;
  bool path_ = false;  // a wall is being deposited
  double path_from_[2] = {}, path_to_[2] = {};
  std::uint64_t path_line_ = 0;
};

}  // namespace lamina::formats::gcode
