// stages/formats/gcode/layers.h: decides where the layers of a G-code file begin.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "stages/formats/gcode/commands.h"
#include "stages/formats/gcode/read_gcode.h"

namespace lamina::formats {

/// Takes the beads of a file in their order. See GcodeFile for the rules.
///
/// memory  200 bytes a layer
class LayerCutter {
 public:
  explicit LayerCutter(double layer_height_mm) : step_(layer_height_mm) {}

  struct CutLayer {
    GcodeFile::LayerPosition position;
    double low = 0, top = 0;                       // of the beads; top: of the highest end
    double length = 0, sloped = 0;                 // mm, all beads and those that climb or fall
    double untagged_length = 0, untagged_fed = 0;  // of beads without ;WIDTH:
    double turn = 0;                               // rad: of the direction of beads that climb
    double min_rise = 0;                           // mm between heights of flat beads, 0 if there is one height
    double tag_height = 0;                         // ;HEIGHT: of the last bead
    bool volumetric = false;                       // of the last bead
    bool turned = false;                           // ends with a turn
  };

  void tag(const GcodeFile::FilePosition& before);
  /// before  in front of the bead's line; now  behind it, for tags
  void add(const RawBead& bead, const GcodeFile::FilePosition& before, const GcodeFile::FilePosition& now);
  /// Decides the heights of spirals. At least one bead must have been added.
  void finish();

  const std::vector<CutLayer>& layers() const { return layers_; }
  bool tagged() const { return tagged_; }
  std::size_t turns() const { return turns_; }        // layers that end with a turn
  std::size_t turnless() const { return turnless_; }  // layers that end after a climb without one

 private:
  enum class Cut { kNone, kLayer, kClimb };  // kClimb: a layer within a climb that continues
  Cut cut_at(const RawBead& bead);
  void finish_steps();
  bool begins_step(const RawBead& bead);
  bool ends_turn(const RawBead& bead);
  void start_turn(const RawBead& bead);
  void begin(const GcodeFile::FilePosition& before, bool climb_goes_on);
  void follow(const RawBead& bead);

  const double step_;
  std::vector<CutLayer> layers_;
  bool tagged_ = false;
  std::size_t turns_ = 0, turnless_ = 0;
  // The bead before, and the climb that it belongs to.
  double z_ = 0, heading_ = 0;
  bool climbs_ = false;                        // the climb has begun
  double turned_ = 0;                          // radians since the last turn of the climb
  double climb_from_ = 0;                      // z at which the turn, or the climb without one, began
  double seam_[2] = {};                        // x, y there
  double slope_length_ = 0, flat_length_ = 0;  // of the layer's slopes, and of the beads behind the last one
  long last_step_ = 0;
};

// --- the width of a bead from what is fed.

inline constexpr double kUsualHeight = 0.2;  // mm, of a layer of which nothing is known
inline constexpr double kRoundSides = 1 - std::numbers::pi / 4;

/// mm3 of a fed unit: of a mm of filament, or of one that is counted in mm3.
inline double volume_of_unit(bool volumetric, double filament_mm) {
  return volumetric ? 1 : std::numbers::pi * filament_mm * filament_mm / 4;
}

/// The height of a bead, mm. layer_height, below  of GcodeFile::LayerPosition
inline double height_of(const RawBead& bead, double tag, double layer_height, double below) {
  if (tag > 0) return tag;
  if (layer_height > 0) return layer_height;
  if (!(bead.to[2] > below)) return kUsualHeight;
  // The start of a slope lies on the layer below: a bead of no height is as wide as the plane.
  return bead.from[2] == bead.to[2] ? bead.to[2] - below : std::max(bead.to[2] - below, 0.05);
}

/// Width of a rectangle with half circles at its sides that holds what was fed; mm.
inline double width_of(const RawBead& bead, double height, double unit_mm3) {
  const double width = bead.fed * unit_mm3 / bead.length() / height + height * kRoundSides;
  return std::clamp(std::round(width * 100) / 100, 0.01, 20.0);
}

}  // namespace lamina::formats
