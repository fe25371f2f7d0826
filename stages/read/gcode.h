// stages/read/gcode.h: the beads that a G-code file lays, layer by layer, as its printer would.
#pragma once

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

namespace lamina::read {

/// One straight move that lays filament; its type is one of GcodeFile::types.
using GcodeBead = LaidBead;

struct GcodeLayer {
  std::int64_t z = 0;  // nm, of the nozzle at the first bead; without beads about there
  Buffer<GcodeBead> beads;
};

/// A file of Marlin, Klipper or RepRapFirmware, by lamina or another slicer. Layers begin at the tags ;LAYER_CHANGE (lamina,
/// PrusaSlicer) or ;LAYER: (CuraEngine); in a file without them wherever a bead lies at another height than the one before.
/// Widths are those of ;WIDTH: tags; without them those of a rectangle with half circles at its sides whose volume is the
/// filament that is fed (1.75 mm, or what "; filament_diameter =" says), in a layer as high as ;HEIGHT: or the distance to the
/// beads below.
///
/// memory  of the layers' places in the file; beads are read when they are asked for
class GcodeFile {
 public:
  /// Reads the file once. errors  kUsage: cannot be read, is no G-code, lays nothing, or does what is not drawn (arcs);
  /// with the line
  /// cost    O(bytes)
  static Result<GcodeFile> open(const std::string& path);
  /// The same of an open file, or of a text in memory, whose layers cannot be asked for then.
  static Result<GcodeFile> read(FileReader& reader);
  std::uint32_t count() const { return static_cast<std::uint32_t>(layers_.size()); }
  const Box& box() const { return box_; }  // of all beads, with about their widths
  /// What the tags ;TYPE: call the beads; "" where they are silent.
  const std::vector<std::string>& types() const { return types_; }
  bool tells_widths() const { return tells_widths_; }
  double filament_mm() const { return filament_mm_; }  // diameter
  /// errors  kUsage: no such layer, the file has changed
  Result<GcodeLayer> layer(std::uint32_t index) const;

  /// Where the printer stands in front of a line.
  struct Place {
    std::uint64_t byte = 0, line = 0;
    double at[4] = {};                             // x, y, z, e: in the file's own units
    double unit = 1;                               // mm
    bool relative = false, relative_feed = false;  // G91, M83
    double width = 0, height = 0, below = 0;       // mm: tags, 0 without; the z of the layer before
    std::uint32_t type = 0;
  };

 private:
  std::string path_;
  std::vector<Place> layers_;
  std::vector<std::string> types_{""};
  Box box_;
  bool tells_widths_ = false;
  double filament_mm_ = 1.75;
};

}  // namespace lamina::read
