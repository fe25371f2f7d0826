#include "pipeline/cli/command.h"
#include "stages/support/io/other_program.h"

namespace lamina::pipeline {
namespace {

CommandSpec preview_spec() {
  CommandSpec spec;
  spec.summary =
      "Draws layers of a job on one PNG image; the darkness of a pixel is its set fraction, drops or grey level. Layers of\n"
      "sliced jobs and G-code are drawn with true bead widths: one layer as PNG or SVG, several as PNG.";
  spec.operand = "DIR|GCODE";
  spec.operand_meaning = "directory of lamina jet or lamina slice, or a G-code file of lamina extrude or another slicer";
  spec.options = {
      {"-o,--output", "PNG", "image file, PNG or SVG", "", ""},
      {"--count", "N", "number of layers, spread over the height", "12", ""},
      {"--every", "N", "draw every N-th layer, from the first", "", ""},
      {"--layer", "K", "draw only layer K, counted from 0 at the bottom", "", ""},
      {"--swath", "N", "draw --layer during swath N, with the print head; or middle", "", ""},
      {"--step", "N", "step of the swath to draw; default: the middle one", "", ""},
      {"--width", "PIXELS", "image width in pixels, 200 to 20000", "2400", ""},
      {"--filament", "MM", "filament diameter of G-code in mm", "the file's, else 1.75", ""},
      {"--layer-height", "MM", "layer height in mm to divide G-code by, as for spirals", "by tags, heights or turns", ""},
      {"--memory", "SIZE", "memory limit for images in flight: 256M, 1G", "1G", ""},
      {"--whole-bed", "", "show the whole bed, not only the printed area", "", ""},
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

const Command preview_command = {"preview", "draw layers of a job or a G-code file", preview_spec, run_preview, true};

}  // namespace lamina::pipeline
