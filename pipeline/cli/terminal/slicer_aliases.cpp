#include "pipeline/cli/terminal/slicer_aliases.h"

#include <fmt/format.h>

#include <algorithm>

namespace lamina::pipeline {
namespace {

struct SlicerAlias {
  std::string_view theirs, ours, differs = {};
};
// Of two rows of a word, the first whose option the command has counts. Without an option of ours, lamina has nothing of it.
constexpr SlicerAlias kSlicerAliases[] = {
    {"--layer-height", "--layer"},
    {"--fill-density", "--line-distance", "it is the width of a bead over the density, as 2 for 0.4 mm and 20 %"},
    {"--infill-density", "--line-distance", "it is the width of a bead over the density, as 2 for 0.4 mm and 20 %"},
    {"--infill-sparse-density", "--line-distance", "it is the width of a bead over the density, as 2 for 0.4 mm and 20 %"},
    {"--infill-line-distance", "--line-distance"},
    {"--fill-pattern", "--pattern"},
    {"--infill-pattern", "--pattern"},
    {"--infill", "--pattern"},
    {"--fill-angle", "--angle"},
    {"--infill-angle", "--angle"},
    {"--infill-angles", "--angle"},
    {"--perimeters", "--walls"},
    {"--wall-line-count", "--walls"},
    {"--wall-loops", "--walls"},
    {"--extrusion-width", "--bead"},
    {"--line-width", "--bead"},
    {"--extrusion-multiplier", "--flow"},
    {"--material-flow", "--flow"},
    {"--resolution", "--dpi", "pixels per inch"},
    {"--resolution", "--tolerance", "micrometres"},
    {"--meshfix-maximum-deviation", "--tolerance", "micrometres"},
    {"--slice-closing-radius", "--bridge"},
    {"--temperature", "--nozzle-temperature"},
    {"--material-print-temperature", "--nozzle-temperature"},
    {"--material-bed-temperature", "--bed-temperature"},
    {"--perimeter-speed", "--wall-speed"},
    {"--speed-wall", "--wall-speed"},
    {"--infill-speed", "--print-speed"},
    {"--speed-print", "--print-speed"},
    {"--speed-travel", "--travel-speed"},
    {"--speed-layer-0", "--first-layer-speed"},
    {"--retract-length", "--retraction"},
    {"--retraction-amount", "--retraction"},
    {"--cool-fan-speed", "--fan"},
    {"--max-fan-speed", "--fan"},
    {"--use-relative-e-distances", "--relative-extrusion"},
    {"--bed-shape", "--bed", "width and depth, as 250x210"},
    {"--center", "--at", "the corner of the part's box, not its middle"},
    {"--align-xy", "--at"},
    {"--duplicate", "--copies"},
    {"--rotate-x", "--rotate", "angles about x, y and z, as 90,0,0"},
    {"--rotate-y", "--rotate", "angles about x, y and z, as 0,90,0"},
    {"--rotate-z", "--rotate", "angles about x, y and z, as 0,0,90"},
    {"--skirts", "--skirt"},
    {"--skirt-line-count", "--skirt"},
    {"--gcode-resolution", "--tolerance", "micrometres"},
    {"--load", "--job"},
    {"--save", "--save-job"},
    {"--printer", "--machine"},
    {"--printer-profile", "--machine"},
    {"--output-dir", "--output"},
    {"--loglevel", "--quiet"},
    {"--support", "", "lamina makes no supports"},
    {"--supports", "", "lamina makes no supports"},
    {"--support-material", "", "lamina makes no supports"},
    {"--support-enable", "", "lamina makes no supports"},
    {"--brim", "", "lamina lays no brim"},
    {"--brim-width", "", "lamina lays no brim"},
    {"--brim-line-count", "", "lamina lays no brim"},
    {"--raft", "", "lamina lays no raft"},
    {"--raft-layers", "", "lamina lays no raft"},
};

}  // namespace

std::string slicer_alias(std::string_view flag, const CommandSpec& spec) {
  std::string word(flag);
  std::ranges::replace(word, '_', '-');
  for (const SlicerAlias& row : kSlicerAliases) {
    if (row.theirs != word) continue;
    if (row.ours.empty()) return fmt::format("; {}", row.differs);
    if (spec.find(row.ours) == nullptr) continue;
    return row.differs.empty() ? fmt::format("; did you mean '{}'?", row.ours)
                               : fmt::format("; did you mean '{}' ({})?", row.ours, row.differs);
  }
  return {};
}

}  // namespace lamina::pipeline
