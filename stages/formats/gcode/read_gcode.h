// stages/formats/gcode/read_gcode.h: reads the beads of a G-code file layer by layer, as its printer would extrude them.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/mesh.h"  // Box
#include "stages/data/status.h"
#include "stages/data/toolpaths.h"
#include "stages/data/units.h"

namespace lamina {
class FileReader;
}

namespace lamina::formats {

/// One straight move that extrudes filament; its type is one of GcodeFile::types.
using GcodeBead = DepositedBead;

struct GcodeLayer {
  std::int64_t z = 0;  // nm, of the nozzle at the first bead; without beads about there
  Buffer<GcodeBead> beads;
  Buffer<BeadFeed> feeds;  // one for each bead, if requested
};

struct GcodeOptions {
  double filament_mm = 0;                // diameter; 0: the file's value, else 1.75
  double layer_height_mm = 0;            // begins layers at its multiples; 0: at tags, heights or turns
  std::uint32_t max_beads = 10'000'000;  // of a layer, 24 bytes each
  std::uint32_t max_layers = 400'000;    // a bed's height in steps of 5 um, some 500 bytes each
};

/// A file of Marlin, Klipper or RepRapFirmware, by lamina or another slicer. Layers begin
/// - with GcodeOptions::layer_height_mm: wherever a bead is the first beyond a multiple of it;
/// - at the tags ;LAYER_CHANGE (lamina, PrusaSlicer, Orca), ;LAYER: (CuraEngine) or ; CHANGE_LAYER (BambuStudio);
/// - in a file without them wherever a bead lies at another height than the one before; and where beads climb (spirals), after
///   each turn of their direction, or after 5 mm without one.
/// Arcs (G2, G3) are chords within 5 um. Beads are net filament: E times the percentage of M221, and a bead begins where what
/// was drawn back before is fed again. Widths are those of ;WIDTH: tags; without them those of a rectangle with half circles
/// at its sides whose volume is the filament that is fed, in a layer as high as ;HEIGHT:, the climb of a turn, or the distance
/// to the beads below. The filament's diameter is the given one, or the one that comments state
/// (stages/formats/gcode/commands.h), or 1.75 mm.
///
/// memory  of the layers' positions in the file; beads are read on request
class GcodeFile {
 public:
  /// Reads the file once. errors  kUsage: cannot be read, is no text of G-code, has no bead, has unsupported moves (arcs
  /// out of the bed's plane, splines), has more than max_beads in a layer, or has more than max_layers; with the line
  /// cost    O(bytes + chords)
  static Result<GcodeFile> open(const std::string& path, const GcodeOptions& options = {});
  /// The same of an open file.
  static Result<GcodeFile> read(FileReader& reader, const GcodeOptions& options = {});
  std::uint32_t count() const { return static_cast<std::uint32_t>(layers_.size()); }
  const Box& box() const { return box_; }  // of all beads, with about their widths
  /// What the tags ;TYPE: call the beads; "" where they are silent.
  const std::vector<std::string>& types() const { return types_; }
  bool states_widths() const { return states_widths_; }
  double filament_mm() const { return filament_mm_; }  // diameter
  /// The printer's name, as lamina's files state it; "" of others.
  const std::string& machine() const { return machine_; }
  /// Net filament of all beads, mm3: without that of start code, and without priming.
  double fed_mm3() const { return fed_mm3_; }
  double density_g_cm3() const { return density_g_cm3_; }  // of the filament, by comments; 0: not stated
  /// The lowest and highest acceleration that beads are commanded with, mm/s2; 0: none is stated.
  const std::array<double, 2>& accelerations() const { return accelerations_; }
  /// More than a quarter of the beads begin at another speed than the one before on their line, as of segmented lines.
  bool changes_speeds() const { return 4 * speed_changes_ > beads_; }
  /// What a person should know of the drawing, one line each: thin beads, spirals, arcs on which firmwares differ.
  const std::vector<std::string>& notes() const { return notes_; }
  /// errors  kUsage: no such layer, the file has changed
  /// with_feeds  24 bytes a bead more
  Result<GcodeLayer> layer(std::uint32_t index, bool with_feeds = false) const;

  /// Decides what G90 and G91 mean for E, and of which tools M221 is.
  enum class Firmware : std::uint8_t { kUnknown, kMarlin, kRepRap, kKlipper };
  static constexpr std::uint8_t kTools = 16;  // those beyond share the flow of the last
  /// Where the printer stands in front of a line, or of a later command of it.
  struct FilePosition {
    FilePosition() { std::ranges::fill(flow, 100.F); }
    std::uint64_t byte = 0, line = 0;
    std::uint32_t left = 0;                        // bytes of commands from there to the end of the line; 0: all
    double at[4] = {};                             // x, y, z, e: in the file's own units
    double unit = 1;                               // mm
    double speed = 0;                              // mm/s; 0 until a line states it
    double acceleration = 0;                       // mm/s2, of M204 or SET_VELOCITY_LIMIT; 0 until a line states it
    bool relative = false, relative_feed = false;  // G91, M83
    Firmware firmware = Firmware::kUnknown;        // of the tag ;FLAVOR:
    bool volumetric = false;                       // M200: E counts mm3
    std::uint8_t plane = 17;                       // of arcs: G17, G18, G19
    std::uint8_t motion = UINT8_MAX;               // the last of G0 to G3
    std::uint8_t tool = 0;
    bool m83 = false;              // M83, and no M82 since then
    float flow[kTools];            // M221: percent, by tool
    double retracted = 0;          // mm, or mm3, that the tool draws back and has not fed again
    double width = 0, height = 0;  // mm: tags, 0 without
    std::uint32_t type = 0;
    bool deposits = false;  // the last move deposited a bead
    double primed = 0;      // fed since then: mm, or mm3
  };
  /// Where a layer begins, and how high its beads are where no tag states it.
  struct LayerPosition {
    FilePosition start;
    double below = 0, height = 0;  // mm: the top of the layer before; of all beads, 0: what they lie above `below`
    std::uint32_t beads = 0;
  };

 private:
  friend class GcodeSurvey;
  std::string path_;
  std::vector<LayerPosition> layers_;
  std::vector<std::string> types_{""}, notes_;
  std::string machine_;
  Box box_;
  bool states_widths_ = false, states_filament_ = false, volumetric_ = false;
  double filament_mm_ = 1.75, fed_mm3_ = 0, density_g_cm3_ = 0;
  std::array<double, 2> accelerations_{};
  std::uint64_t beads_ = 0, speed_changes_ = 0;
};

}  // namespace lamina::formats
