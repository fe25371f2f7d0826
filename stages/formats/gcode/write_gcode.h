// stages/formats/gcode/write_gcode.h: bead moves -> G-code of Marlin, Klipper and RepRapFirmware. README.md has the dialect.
//
// head(), the layers in order and tail() are the file. A layer's text depends on that layer alone: it begins retracted
// with its extrusion counted from 0, and ends retracted, so layers can be written by many threads at once.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "stages/data/buffer.h"
#include "stages/data/extruder.h"
#include "stages/data/layer.h"
#include "stages/data/toolpaths.h"
#include "stages/formats/extrusion_format.h"
#include "stages/formats/gcode/print_time.h"
#include "stages/formats/gcode/wipe_trail.h"
#include "stages/geometry/travel/inside_route.h"

namespace lamina::formats::gcode {

/// Writes one layer's moves; made anew for each layer.
class LayerWriter final : public LayerMoves {
 public:
  /// out  appended to
  LayerWriter(const Extruder& machine, const Layer& layer, std::uint32_t layers, Buffer<char>& out,
              const Switches& switches = {}, const LayerSurroundings& around = {});
  double deposit(const BeadMove& move) override;
  void begin_object(std::uint32_t object) override;
  const MoveTotals& finish() override;

 private:
  void end_object();
  void begin_layer(const Layer& layer, std::uint32_t layers, const Switches& switches);
  void travel(Point2 to);
  void travel_line(Point2 to);
  bool stays_inside(Point2 to);
  void retract();
  void lift();
  std::int64_t drawn_after(double way_mm) const;
  void wipe(std::int64_t from);
  void move_filament(std::int64_t from, std::int64_t to);
  void prime();
  void move_height(std::int64_t height);
  void extrude_to(double filament_mm, char*& text);
  void tags(const BeadMove& move);

  const Extruder& machine_;
  Buffer<char>& out_;
  MoveTotals totals_;
  PrintTime time_;
  Nm height_;                 // of the layer
  std::int64_t top_;          // of the layer, nm
  std::int64_t lift_, back_;  // nm; retraction, 1e-5 mm
  bool lifted_ = false;
  WipeTrail trail_;
  std::span<const ExtrusionObject> objects_;  // none: no tags
  std::int64_t object_ = -1;                  // under way; -1: none
  std::optional<travel::InsideRoute> route_;  // if there is a region
  Buffer<Point2> line_;                       // the points of a travel
  double feed_per_volume_;                    // mm of filament a mm3 of bead
  double fed_ = 0;                            // mm of filament in this layer, exact
  std::int64_t written_ = 0;                  // the same as far as it is written, 1e-5 mm
  std::int64_t feed_rate_ = -1;               // mm/min as last written
  bool retracted_ = true, placed_ = false;
  Point2 at_{0, 0};
  std::int64_t corner_x_, corner_y_;  // nm
  int kind_ = -1;
  Nm width_ = -1;
};

void append_head(const Extruder& machine, const ExtrusionHead& facts, Buffer<char>& out);
void append_tail(const Extruder& machine, const MoveTotals& totals, std::uint32_t layers, Buffer<char>& out);

/// "1d 2h 3m 4s", as viewers read it.
std::string time_text(double seconds);

/// Replaces {name} in code of a profile; unknown names stay. `layer` and `z_mm` as far as they are known.
std::string fill_code(const std::string& code, const Extruder& machine, std::uint32_t layers, std::uint32_t layer, double z_mm);

}  // namespace lamina::formats::gcode
