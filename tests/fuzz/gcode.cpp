// G-code of extrusion printers, by whatever slicer.
#include "stages/read/gcode.h"

#include "tests/fuzz/laws.h"

namespace lamina::fuzz {
namespace {

bool read_gcode(std::string_view text) {
  static MemoryFile memory("part.gcode");
  const auto file = read::GcodeFile::open(memory.hold(text));
  if (!file) return check_error(file.error()), false;
  law(file->count() > 0 && !file->box().empty(), "no layer");
  for (std::uint32_t i = 0; i < std::min(file->count(), 6u); ++i) {
    const auto layer = file->layer(i);
    law(layer.ok(), layer.ok() ? "" : layer.error().message.c_str());
    for (const read::GcodeBead& bead : layer->beads) {
      law(bead.type < file->types().size(), "a bead of no type");
      law(bead.width > 0, "a bead without width");
      for (const Point2 end : {bead.from, bead.to}) {
        law(end.x >= file->box().lo.x && end.x <= file->box().hi.x && end.y >= file->box().lo.y && end.y <= file->box().hi.y,
            "a bead outside of the box");
      }
    }
  }
  for (const std::string& type : file->types()) law(type.empty() || (check_line(type), true), "");
  return true;
}

std::vector<std::string> gcode_seeds() {
  return {
      "G21\nG90\nM82\n;LAYER_CHANGE\n;Z:0.2\n;HEIGHT:0.2\nG1 Z0.2 F600\nG1 X10 Y10 F3000\n;TYPE:Perimeter\n;WIDTH:0.45\n"
      "G1 X20 Y10 E0.5 F1200\nG1 X20 Y20 E1\n;LAYER_CHANGE\nG92 E0\nG1 Z0.4\n;TYPE:Internal infill\nG1 X10 Y20 E0.3\n",
      "; filament_diameter = 2.85\nM83\nG91\nG1 Z.3\nG1 X1 Y1 E.1\nG1 X-1 E.1\nG1 Z.3\nG1 Y5 E.2 ; more\nN12 G1 X3 E1*77\n",
      ";LAYER:0\nG0 X1 Y1 Z.1\nG1 X2 E1\n;LAYER:1\nG20\nG1 X0.5 Y0.5 Z0.02 E2\n"};
}

const Registered kGcode({"gcode", read_gcode, gcode_seeds, "stages/read/gcode stages/data/text", ".gcode", "gcode.dict", 2048});

}  // namespace
}  // namespace lamina::fuzz
