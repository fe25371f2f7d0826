#include "stages/formats/gcode/replay/defect_text.h"

#include <fmt/format.h>

namespace lamina::formats::gcode {
namespace {

/// {0} the value, {1} the limit of the first finding.
struct DefectWords {
  std::string_view name, text;
};

/// In the order of Defect.
constexpr DefectWords kWords[] = {
    {"unreadable", "cannot be replayed"},
    {"cold-extrusion", "a bead at {0:g} degC; firmwares feed from {1:g} degC"},
    {"nozzle-temperature", "the nozzle is heated to {0:g} degC; the machine reaches {1:g} degC"},
    {"bed-temperature", "the bed is heated to {0:g} degC; the machine reaches {1:g} degC"},
    {"lost-reset", "absolute E jumps back by {0:.3f} mm without G92 E0"},
    {"not-fed-back", "a bead begins with {0:.3f} mm of filament drawn back"},
    {"overfed", "{0:.3f} mm of filament more are fed than were drawn back"},
    {"feeds-nothing", "{0:.1f} mm of filament are fed in all, {1:.1f} mm by beads; check M82 and M83"},
    {"layer-order", "the layer at z {0:.3f} mm follows one at {1:.3f} mm"},
    {"skipped-layer", "nothing is below the layer at z {0:.3f} mm; the one before is at {1:.3f} mm"},
    {"empty-layer", "the layer has no beads, and the next one has"},
    {"bead-height", "a bead at z {0:.3f} mm in the layer at {1:.3f} mm"},
    {"below-bed", "a bead at z {0:.3f} mm, below the bed"},
    {"doubled-bead", "a bead of {0:.3f} mm is deposited twice in the layer"},
    {"no-feed-rate", "a move without a speed: F is 0 or was not stated"},
    {"thin-bead", "a bead has {0:.2f} times the volume of others of its width"},
    {"thick-bead", "a bead has too much volume: {0:.2f}, limit {1:.2f}"},
    {"no-outer-wall", "the layer has no outer wall, and those around it have"},
    {"open-wall", "a wall ends {0:.3f} mm from where it began"},
    {"off-bed", "a bead at {0:.3f} mm; the bed ends at {1:.3f} mm"},
    {"too-high", "a bead at z {0:.3f} mm; the machine builds up to {1:.3f} mm"},
    {"too-fast", "a move at {0:.1f} mm/s; the profile's fastest speed is {1:.1f} mm/s"},
    {"melt-rate", "{0:.2f} mm3/s are melted; the material's limit is {1:.2f} mm3/s"},
    {"truncated", "the file ends without the sums that lamina extrude writes; it is cut off"},
    {"stated-filament", "beads take {0:.2f} mm of filament; the file states {1:.2f} mm"},
    {"stated-time", "the moves take {0:.1f} s; the file states {1:.1f} s"},
    {"not-waited", "the first bead is deposited without a wait for the nozzle ({0:g} degC)"},
    {"heaters-on", "the file ends with the nozzle heated to {0:g} degC"},
    {"wall-crossing", "a travel of {0:.2f} mm without retraction crosses an outer wall"},
    {"late-layer", "the first layer, {1:g} mm high, is at z {0:g} mm"},
    {"not-homed", "the first bead is deposited without G28"},
};
static_assert(std::size(kWords) == kDefects);

}  // namespace

std::string_view defect_name(Defect kind) { return kWords[static_cast<std::size_t>(kind)].name; }

std::string defect_text(Defect kind, const DefectCount& of) {
  const std::string what = fmt::format(fmt::runtime(kWords[static_cast<std::size_t>(kind)].text), of.value, of.limit);
  const std::string others = of.count > 1 ? fmt::format("; {} in all", of.count) : "";
  return fmt::format("line {}: {} (layer {}{})", of.first.line, what, of.first.layer, others);
}

}  // namespace lamina::formats::gcode
