#include "pipeline/cli/command.h"
#include "stages/support/io/other_program.h"

namespace lamina::pipeline {
namespace {

CommandSpec preview_spec() {
  CommandSpec spec;
  spec.summary =
      "Draws layers of a job as one picture (PNG), each pixel as dark as the share of its area that is set, or as its share of\n"
      "the most drops, or of a full voxel's levels; or one layer of a sliced job with its filling, or of a G-code file, bead\n"
      "widths true (PNG or SVG), or several with --count or --every (PNG).";
  spec.operand = "DIR|GCODE";
  spec.operand_meaning =
      "directory that lamina jet or lamina slice wrote, or a G-code file of lamina extrude or another slicer";
  spec.options = {
      {"-o,--output", "PNG", "the picture", "", ""},
      {"--count", "N", "so many layers, spread over the height", "12", ""},
      {"--every", "N", "every N-th layer, from the first", "", ""},
      {"--layer", "K", "only layer K, counted from 0 at the bottom", "", ""},
      {"--swath", "N",
       "layer --layer of a job with a machine while swath N of it is jetted, with the head; middle for the one in the middle",
       "", ""},
      {"--step", "N", "position of the swath; default: the middle one", "", ""},
      {"--width", "PIXELS", "width of the picture, 200 to 20000", "2400", ""},
      {"--filament", "MM", "diameter of the filament of G-code", "the file's, else 1.75", ""},
      {"--layer-height", "MM", "cut G-code, as a spiral, every MM of height", "by tags, heights or turns", ""},
      {"--whole-bed", "", "show all of the bed, not only where the layers have something", "", ""},
      {"--overwrite", "", "replace a file that lamina did not write", "", ""},
      {"--quiet", "", "print errors only", "", ""}};
  spec.closing =
      "Examples:\n"
      "  lamina preview out -o sheet.png\n"
      "  lamina preview out -o layer.png --layer 120 --whole-bed\n"
      "  lamina preview sliced -o layer.svg --layer 12\n"
      "  lamina preview part.gcode -o layer.png --layer 3";
  return spec;
}

Outcome run_preview(const Arguments& arguments, Context&) { return hand_over("lamina-preview", arguments.given); }

}  // namespace

const Command preview_command = {"preview", "pictures of a job's layers for people", preview_spec, run_preview, true};

}  // namespace lamina::pipeline
