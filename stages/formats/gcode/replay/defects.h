// stages/formats/gcode/replay/defects.h: what a replay of G-code finds, counted by kind with the first line of each.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace lamina::formats::gcode {

/// Kinds of defects. What certainly damages a print is a fault; from kNotes on they may be intended.
enum class Defect : std::uint8_t {
  kUnreadable,          // the replay ends there
  kCold,                // filament fed below the firmware's minimum; value: degrees, limit: the minimum
  kNozzleHot,           // above the machine's maximum; degrees
  kBedHot,              // the same of the bed
  kLostReset,           // absolute E jumps back; value: mm of filament
  kNotFedBack,          // a bead begins while filament is drawn back; mm of filament
  kOverfed,             // more is fed than was drawn back; mm of filament
  kFeedsNothing,        // M82 and M83 mistaken for each other; value: mm in all, limit: mm by moves that deposit
  kLayerOrder,          // a layer below the one before; value: z, limit: z of the one before
  kSkippedLayer,        // nothing below a layer; value: z, limit: the highest bead below
  kEmptyLayer,          // a layer without a bead between others; value: z
  kBeadHeight,          // a bead at another height than its layer; value: z, limit: z of the layer
  kBelowBed,            // a bead below z = 0; z
  kDoubledBead,         // deposited twice in a layer; value: mm long
  kNoFeedRate,          // a bead without a speed, or with F0
  kThinBead,            // less volume per mm than other beads of that width; value: ratio
  kThickBead,           // more; value: ratio, or mm2 beyond a limit of mm2
  kNoWall,              // a layer without outer walls between layers that have them
  kOpenWall,            // a wall that does not end where it began; value: mm between
  kOffBed,              // outside of the machine's bed; value: mm, limit: mm
  kTooHigh,             // above the build height; z
  kTooFast,             // above the fastest speed of the profile; mm/s
  kMeltRate,            // above the material's; mm3/s
  kTruncated,           // a file of lamina without the sums at its end
  kStatedFilament,      // another length of filament than a file of lamina states; mm
  kStatedTime,          // the same of the print time, where the machine is that of the file; s
  kNotes,               // from here on: notes
  kNotWaited = kNotes,  // beads after M104 without M109; degrees
  kHeatersOn,           // the file ends with a heated nozzle; degrees
  kCrossing,            // a travel without retraction through an outer wall; mm long
  kLateLayer,           // the first layer is above the bed; value: z, limit: its height
  kUnhomed,             // no G28 and no macro before the first bead
  kCount
};
inline constexpr std::size_t kDefects = static_cast<std::size_t>(Defect::kCount);

constexpr bool is_fault(Defect kind) { return kind < Defect::kNotes; }

/// Where in a file.
struct FileLine {
  std::uint64_t line = 0;   // from 1
  std::uint32_t layer = 0;  // from 0
};

/// All defects of a kind: their number, and the first.
struct DefectCount {
  std::uint64_t count = 0;
  FileLine first;
  double value = 0, limit = 0;  // of the first
};

class Defects {
 public:
  void add(Defect kind, FileLine at, double value, double limit, std::uint64_t count = 1) {
    DefectCount& of = kinds_[static_cast<std::size_t>(kind)];
    if (of.count == 0 || at.line < of.first.line) of.first = at, of.value = value, of.limit = limit;
    of.count += count;
  }
  const DefectCount& operator[](Defect kind) const { return kinds_[static_cast<std::size_t>(kind)]; }
  /// Of all kinds of faults.
  std::uint64_t faults() const {
    std::uint64_t sum = 0;
    for (std::size_t k = 0; k < static_cast<std::size_t>(Defect::kNotes); ++k) sum += kinds_[k].count;
    return sum;
  }

 private:
  std::array<DefectCount, kDefects> kinds_{};
};

}  // namespace lamina::formats::gcode
