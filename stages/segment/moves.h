// stages/segment/moves.h: the stored toolpaths of a layer become moves of a machine, one at a time: widths, cross-sections
// and speeds of walls, continuous lines, thick and thin stretches. Stretches are expanded here and nowhere kept.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "stages/data/extruder.h"
#include "stages/data/layer.h"
#include "stages/data/toolpaths.h"
#include "stages/segment/expand.h"
#include "stages/segment/predict.h"

namespace lamina::segment {

/// What a machine does for each kind of stretch in a layer; made anew only where the stored width changes.
class MoveTable {
 public:
  /// plan, cut  have to outlive it
  MoveTable(const Segmentation& plan, const LayerCut& cut, const Extruder& machine, const Layer& layer);

  struct Entry {
    Nm stored = -1, width = 0;                              // nm, of the path and of the bead
    double area = 0, ellipse = 0, measured = 0, speed = 0;  // mm2, mm2, mm2, mm/s
  };

  const Entry& of(const Stretch& s) {
    if (s.thickness == Thickness::kThin && !plan_.sweep.empty()) {
      make(s, swept_);
      return swept_;
    }
    Entry& entry = table_[static_cast<std::size_t>(s.kind) * 3 + static_cast<std::size_t>(s.thickness)];
    if (entry.stored != s.width) make(s, entry);
    return entry;
  }

 private:
  void make(const Stretch& s, Entry& entry) const;

  const Segmentation& plan_;
  const LayerCut& cut_;
  double height_, reference_, wall_, inner_;  // mm, mm/s
  std::array<Entry, 15> table_;
  Entry swept_;  // of a line of its own kind: not kept
};

/// Counts the stretches of a part in a layer, in the order in which they are laid.
class SegmentCounter {
 public:
  SegmentCounter(const LayerCut& cut, SegmentCounts& counts) : cut_(cut), counts_(counts) {}

  void add(const Stretch& s) {
    if (!cut_.on) return;
    if (cut_.segments(s.kind, s.line) && (s.line != line_ || s.kind != kind_)) {
      ++counts_.lines;
      line_ = s.line;
      kind_ = s.kind;
    }
    if (s.thickness != Thickness::kReference) {
      const bool follows = s.from == at_ && before_ != Thickness::kReference;
      counts_.pieces += follows ? 0 : 1;
      // A curve's corners divide no stretch.
      const bool begins = !follows || s.thickness != before_;
      counts_.stretches += begins ? 1 : 0;
      counts_.thin += begins && s.thickness == Thickness::kThin ? 1 : 0;
    }
    before_ = s.thickness;
    at_ = s.to;
  }

 private:
  const LayerCut& cut_;
  SegmentCounts& counts_;
  Point2 at_{INT32_MIN, INT32_MIN};
  std::int32_t line_ = kNoLine;
  PathKind kind_ = PathKind::kOuter;
  Thickness before_ = Thickness::kReference;
};

/// Calls lay(const BeadMove&) for every move of the paths of a part in a layer; it gives the move's length in mm, or nothing
/// to stop: no further move is laid.
/// counts, volume  what was laid is added
/// returns         false if `lay` stopped
template <class Lay>
bool for_each_move(const ToolpathsView& paths, const LayerCut& cut, MoveTable& table, SegmentCounts& counts,
                   PlannedPorosity& volume, Lay&& lay) {
  bool goes_on = true;
  SegmentCounter counter(cut, counts);
  for_each_stretch(paths, cut, [&](const Stretch& s) {
    if (!goes_on) return;
    const MoveTable::Entry& entry = table.of(s);
    const std::optional<double> length = lay(BeadMove{s.from, s.to, s.kind, s.jump, entry.width, entry.area, entry.speed});
    if (!length) {
      goes_on = false;
      return;
    }
    volume.extruded_mm3 += *length * entry.area;
    volume.ellipses_mm3 += *length * entry.ellipse;
    volume.measured_mm3 += *length * entry.measured;
    counter.add(s);
  });
  return goes_on;
}

}  // namespace lamina::segment
