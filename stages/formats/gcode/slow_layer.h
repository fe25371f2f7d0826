// stages/formats/gcode/slow_layer.h: the minimum time of a layer, in which its beads cool down before the next ones are put on
// them. As slowdown_below_layer_time and min_print_speed of PrusaSlicer (GCode/CoolingBuffer.cpp), with one factor for all
// beads of a layer.
#pragma once

#include <cstdint>
#include <utility>

#include "stages/data/buffer.h"
#include "stages/formats/extrusion_format.h"
#include "stages/formats/gcode/write_gcode.h"

namespace lamina::formats::gcode {

/// Writes a layer as LayerWriter does, with slower beads if it takes less than fan.min_layer_s: by one factor, down to
/// fan.min_print_mm_s. Beads that are slower already keep their speed, as do segmented lines, whose widths depend on it.
///
/// memory  the moves wait until they take the minimum time: a layer that takes longer is written as it comes
/// cost    a short layer is written two to four times
class SlowLayer final : public LayerMoves {
 public:
  /// As of LayerWriter. machine  with fan.min_layer_s > 0
  SlowLayer(const Extruder& machine, const Layer& layer, std::uint32_t layers, Buffer<char>& out, const Switches& switches,
            const LayerSurroundings& around);
  double deposit(const BeadMove& move) override;
  void begin_object(std::uint32_t object) override;
  const MoveTotals& finish() override;

 private:
  /// The length of all beads of one speed.
  struct SpeedLength {
    double speed, length;
    bool keeps;
  };
  bool keeps_speed(const BeadMove& move) const;
  double slowed(double speed, double factor) const;
  double bead_seconds(double factor) const;
  double factor_for(double seconds) const;
  void replay(LayerWriter& writer, double factor) const;

  const Extruder& machine_;
  const Layer layer_;
  std::uint32_t layers_;
  Buffer<char>& out_;
  Switches switches_;
  LayerSurroundings around_;
  Buffer<BeadMove> waiting_;
  Buffer<std::pair<std::size_t, std::uint32_t>> object_;  // begins with that move
  Buffer<SpeedLength> lengths_;
  double seconds_ = 0;                 // of the waiting beads, at least
  std::optional<LayerWriter> writer_;  // once the layer is long enough
  MoveTotals totals_;
};

}  // namespace lamina::formats::gcode
