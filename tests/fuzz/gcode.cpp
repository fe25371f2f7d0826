// G-code of extrusion printers, by any slicer.
#include "stages/formats/gcode/read_gcode.h"
#include "stages/formats/gcode/replay/defect_text.h"
#include "stages/formats/gcode/replay/replay.h"

#include "tests/fuzz/laws.h"

namespace lamina::fuzz {
namespace {

/// The replay accepts what the reader accepts, and describes all that it finds.
void replay(const std::string& path, bool readable) {
  using namespace formats::gcode;
  static const Extruder machine;
  const auto report = replay_gcode(path, {&machine, 0});
  if (!report) return check_error(report.error());
  law(!readable || report->unreadable.empty(), "the reader accepts it");
  law(report->totals.seconds >= 0, "a negative time");
  for (std::size_t k = 0; k < kDefects; ++k) {
    const auto kind = static_cast<Defect>(k);
    if (report->defects[kind].count > 0) check_line(defect_text(kind, report->defects[kind]));
  }
}

bool read_gcode(std::string_view text) {
  static MemoryFile memory("part.gcode");
  Dice dice(text);
  formats::GcodeOptions options;
  options.max_beads = 200'000;
  if (dice.below(2) == 0) options.filament_mm = 2.85;
  if (dice.below(3) == 0) options.layer_height_mm = 0.25;
  const std::string path = memory.hold(text);
  const auto file = formats::GcodeFile::open(path, options);
  replay(path, file.ok());
  if (!file) return check_error(file.error()), false;
  law(file->count() > 0 && !file->box().empty(), "no layer");
  for (std::uint32_t i = 0; i < std::min(file->count(), 6u); ++i) {
    const auto layer = file->layer(i);
    law(layer.ok(), layer.ok() ? "" : layer.error().message.c_str());
    law(layer->beads.size() <= options.max_beads, "more beads than allowed");
    for (const formats::GcodeBead& bead : layer->beads) {
      law(bead.type < file->types().size(), "a bead of no type");
      law(bead.width > 0, "a bead without width");
      for (const Point2 end : {bead.from, bead.to}) {
        law(end.x >= file->box().lo.x && end.x <= file->box().hi.x && end.y >= file->box().lo.y && end.y <= file->box().hi.y,
            "a bead outside of the box");
      }
    }
  }
  for (const std::string& note : file->notes()) check_line(note);
  for (const std::string& type : file->types()) law(type.empty() || (check_line(type), true), "");
  return true;
}

std::vector<std::string> gcode_seeds() {
  return {
      "G21\nG90\nM82\n;LAYER_CHANGE\n;Z:0.2\n;HEIGHT:0.2\nG1 Z0.2 F600\nG1 X10 Y10 F3000\n;TYPE:Perimeter\n;WIDTH:0.45\n"
      "G1 X20 Y10 E0.5 F1200\nG1 X20 Y20 E1\n;LAYER_CHANGE\nG92 E0\nG1 Z0.4\n;TYPE:Internal infill\nG1 X10 Y20 E0.3\n",
      "; filament_diameter = 2.85\nM83\nG91\nG1 Z.3\nG1 X1 Y1 E.1\nG1 X-1 E.1\nG1 Z.3\nG1 Y5 E.2 ; more\nN12 G1 X3 E1*77\n",
      ";LAYER:0\nG0 X1 Y1 Z.1\nG1 X2 E1\n;LAYER:1\nG20\nG1 X0.5 Y0.5 Z0.02 E2\n",
      "G17\nM83\nG1 X10 Y10 Z.2\nG2 X20 Y10 I5 J0 E.5\nG3 X10 Y10 R-6 E1\nG2 I5 E1\nG91\nG3 X0 Y0 Z.2 I-3 J1 E1\nG2 X1 Y1 P1 I2\n",
      ";FLAVOR:UltiGCode\nG1 Z.2\nG1 X1 Z.25 E1\nG1 Y1 Z.3 E2\nG1 X0 Z.35 E3\nG1 Y0 Z.4 E4\nG1 X1 Z.45 E5\nG1 Y1 Z.5 E6\n"
      "G2 X1 Y1\nG2 X5 R1 E9\nG3 X9 Y9 R1e30 E10\nG2 X0 Y0 I3 J1 E11\n",
      "m83\rg1z.2\rG1X5Y+1.E1(a)f9\r\nM221 T1 S50\nT1\ng90 G1 X 7 E-1\nX9E3\nG3 X5 I-2 E2\nN3 G1 (b;*) Y5 E1*7 ; c\n",
      ";Filament used: 1.3m 9.1g\n;   extruderDiameter,0.4\nM200 D2.85\n; CHANGE_LAYER\n; LINE_WIDTH: 0.42\n; FEATURE: Outer wall\n"
      "G3 X9 Y9 I5 J5 E3\n;CURA_PROFILE_STRING:eJzLSaxMLYrPSM1MzyixNdAz5ChPzMmJL8nITM7OSy0uBgpZcOTll8SnZeYk5qbmlcSnZALpktQiW0sOTDEjPQtTTGEjWwOexBwgIy+xJLMsFQB98Sn4\n"};
}

const Registered kGcode({"gcode", read_gcode, gcode_seeds, "stages/formats/gcode stages/support/text", ".gcode",
                         "gcode.dict", 2048});

}  // namespace
}  // namespace lamina::fuzz
