#include "pipeline/calibrate/pieces_text.h"

#include <fmt/format.h>

#include "stages/support/text/number_text.h"

namespace lamina::pipeline {

std::string steps_text(const std::vector<segment::TestPiece>& pieces, const segment::PieceRequest& request,
                       std::string_view extension) {
  std::string text = fmt::format(
      "# Calibrating segmented lines\n\n1. Parameters: beads of {} mm, layers of {} mm, the speeds and temperatures of the machine's profile; keep them for all "
      "pieces.\n",
      number_text(request.width_mm), number_text(request.height_mm));
  char step = '1';
  for (const segment::TestPiece& piece : pieces) {
    if (piece.name[0] == '6' && step < '5') {
      text +=
          "5. Spacing: fill in widths.csv, then `lamina calibrate --measured widths.csv --machine MACHINE -o machine.toml`; plan the pieces of steps 6 and 7 "
          "again with `lamina extrude --job FILE --machine machine.toml`.\n";
    }
    text += fmt::format("{}. `{}{}`: {}\n", piece.name[0], piece.name, extension, piece.task);
    step = piece.name[0];
  }
  return text;
}

std::string widths_text(const segment::PieceRequest& request) {
  std::string text =
      "# Widths in mm; leave cells empty where nothing was measured, add rows for further thick speeds or repeated measurements.\n"
      "test,percent,thick_speed_percent,region,wall_mm,thick_mm,thin_mm,continuous_mm,stable_mm\n"
      "flow,,,,,,,,\n";
  for (const double percent : request.thin_speeds) text += fmt::format("speed,{},,,,,,,\n", number_text(percent));
  for (const double percent : request.thin_extrusions) text += fmt::format("extrusion,{},,,,,,,\n", number_text(percent));
  for (const double percent : request.extrusions) {
    for (const char* region : {"initial", "central", "final"})
      text += fmt::format("repeated,{},100,{},,,,,\n", number_text(percent), region);
  }
  return text;
}

}  // namespace lamina::pipeline
