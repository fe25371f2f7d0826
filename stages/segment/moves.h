// stages/segment/moves.h: the stored toolpaths of a layer become moves of a machine, one at a time: widths, cross-sections
// and speeds of walls, continuous lines, thick and thin segments. Segments are expanded here and nowhere kept; their pores are
// counted on the way.
//
// There is one volume: the extrusion at 100 % is the profile's bead_area x flow, times the extrusion of the segment.
// E, grams, porosity and the widths of walls and continuous lines follow from it. Sizes of pores are those of pore_geometry(),
// at the distances that the deposited lines have.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "stages/data/extruder.h"
#include "stages/data/layer.h"
#include "stages/data/toolpaths.h"
#include "stages/segment/cut.h"
#include "stages/segment/segmentation.h"

namespace lamina::segment {

// --- the pores that thin segments leave

/// Where the lines of one part in a layer lie, and how far each is from those numbered one less and one more.
class LineNeighbours {
 public:
  /// paths, cut  have to outlive it
  /// memory      40 bytes a line or curve. cost  O(points + lines log lines)
  LineNeighbours(const ToolpathsView& paths, const LayerCut& cut);

  /// Along the direction of the lines, nm.
  double along(Point2 p) const { return cut_.along_x * p.x + cut_.along_y * p.y; }
  /// Distances between centres, mm, to the line before and the one after; absent if none is next to all of low .. high.
  /// run        PathInterval::run of the line
  /// low, high  along() the ends of the requested interval; curves, whose distance is constant, are measured in the middle
  ///            of their longest edge
  std::array<std::optional<double>, 2> of(std::uint32_t run, double low, double high);

 private:
  struct NeighbourLine {
    PathKind kind;
    bool straight;
    std::int32_t number;
    std::uint32_t run, end;    // points run .. end of the toolpaths
    double low, high, across;  // nm, of straight ones
  };
  void find_neighbours(std::uint32_t run);
  std::optional<double> curve_at(std::span<const NeighbourLine> neighbour) const;
  std::optional<double> straight_at(std::span<const NeighbourLine> neighbour, double low, double high) const;

  const ToolpathsView& paths_;
  const LayerCut& cut_;
  std::vector<NeighbourLine> lines_;  // by kind, number and place
  std::vector<std::uint32_t> order_;  // into lines_, by run
  // --- of the run that was requested last
  std::uint32_t run_ = UINT32_MAX;
  const NeighbourLine* line_ = nullptr;
  std::array<std::span<const NeighbourLine>, 2> adjacent_;
  std::array<std::optional<double>, 2> curve_;
};

/// Takes the segments of a part in a layer in the order of deposition.
class PoreCounter {
 public:
  /// All have to outlive it. counts  what is found is added
  PoreCounter(const ToolpathsView& paths, const LayerCut& cut, const Segmentation& plan, PoreCounts& counts);

  void add(const PathInterval& s) {
    const bool follows = s.run == run_ && s.from == at_;
    if (before_ == Thickness::kThin && !(follows && s.thickness == Thickness::kThin)) {
      finish(follows && s.thickness == Thickness::kThick);
    }
    if (s.thickness == Thickness::kThin) extend(s, follows);
    run_ = s.run;
    at_ = s.to;
    before_ = s.thickness;
  }
  /// Ends the part.
  void end() {
    if (before_ == Thickness::kThin) finish(false);
    before_ = Thickness::kReference;
  }

 private:
  void extend(const PathInterval& s, bool follows);
  void finish(bool thick_after);
  void check(const std::optional<double>& distance_mm, double other_mm, bool thick_ends);

  const LayerCut& cut_;
  const Segmentation& plan_;
  PoreCounts& counts_;
  LineNeighbours neighbours_;
  // --- the segment before
  std::uint32_t run_ = UINT32_MAX;
  Point2 at_{};
  Thickness before_ = Thickness::kReference;
  // --- the thin segment that is being deposited
  bool thick_before_ = false;
  PathKind kind_ = PathKind::kRaster;
  std::int32_t line_ = 0;
  Point2 from_{};
  double length_mm_ = 0, thin_mm_ = 0;
};

// --- thin segments of a layer that lie under thin ones of the next, whose lines are turned by a
// quarter.

/// Counts the thin segments of straight lines of a part in a layer, and those whose centre line meets that of a thin segment
/// of the same part in the layer above. Layers that are not turned by 90 degrees have none.
/// counts  receives crossing and crossed
/// memory  12 bytes a thin segment above. cost  O((thin + thin above) log (thin above)) and the lines that a stretch crosses
void count_crossed(const ToolpathsView& paths, const LayerCut& cut, const ToolpathsView& above, const LayerCut& cut_above,
                   PoreCounts& counts);

// --- moves

/// What a machine does for each kind of stretch in a layer; made anew only where the stored width changes.
class MoveTable {
 public:
  /// plan, cut, machine  have to outlive it
  MoveTable(const Segmentation& plan, const LayerCut& cut, const Extruder& machine, const Layer& layer);

  struct MoveEntry {
    Nm stored = -1, width = 0;                 // nm, of the path and of the bead
    double area = 0, measured = 0, speed = 0;  // mm2, mm2, mm/s
  };
  const Segmentation& plan() const { return plan_; }
  const Extruder& machine() const { return machine_; }

  const MoveEntry& of(const PathInterval& s) {
    if (s.thickness == Thickness::kThin && !plan_.sweep.empty()) {
      make(s, swept_);
      return swept_;
    }
    MoveEntry& entry = table_[static_cast<std::size_t>(s.kind) * 3 + static_cast<std::size_t>(s.thickness)];
    if (entry.stored != s.width) make(s, entry);
    return entry;
  }

 private:
  void make(const PathInterval& s, MoveEntry& entry) const;

  const Segmentation& plan_;
  const LayerCut& cut_;
  const Extruder& machine_;
  double height_, reference_, wall_, inner_;  // mm, mm/s
  std::array<MoveEntry, kPathKinds * 3> table_;
  MoveEntry swept_;  // of a line of its own kind: not kept
};

/// Counts the segments of a part in a layer, in the order of deposition.
class SegmentCounter {
 public:
  SegmentCounter(const LayerCut& cut, SegmentCounts& counts) : cut_(cut), counts_(counts) {}

  void add(const PathInterval& s) {
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
      counts_.intervals += begins ? 1 : 0;
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

/// Counts thick and thin segments that end before the machine has reached their speed. A planner makes the change of speed
/// from one stretch of a line to the next within the faster of the two; at the ends of a line it begins and ends with half of
/// the speed that the machine changes at once. Lines that are not divided do not count.
class SpeedCounter {
 public:
  SpeedCounter(const Extruder& machine, ShortIntervals& counts)
      : acceleration_(machine.speed.acceleration_mm_s2), end_speed_(machine.speed.corner_mm_s / 2), counts_(counts) {}

  void add(const PathInterval& s, double length_mm, double speed_mm_s) {
    const bool follows = s.run == run_ && s.from == at_ && before_ != Thickness::kReference;
    if (follows && s.thickness == before_) {
      length_ += length_mm;
    } else {
      if (before_ != Thickness::kReference) finish(follows, follows ? speed_mm_s : end_speed_);
      entry_ = follows ? speed_ : end_speed_;
      divided_ = follows;
      length_ = length_mm;
      speed_ = speed_mm_s;
    }
    run_ = s.run;
    at_ = s.to;
    before_ = s.thickness;
  }
  void end() {
    if (before_ != Thickness::kReference) finish(false, end_speed_);
    before_ = Thickness::kReference;
  }

 private:
  void finish(bool goes_on, double exit) {
    if (!goes_on && !divided_) return;
    const double from = std::min(entry_, speed_), to = std::min(exit, speed_);
    const double reached = std::max({from, to, std::sqrt((from * from + to * to) / 2 + acceleration_ * length_)});
    if (reached < speed_ * (1 - 1e-9)) counts_.add({1, length_, reached, speed_});
  }

  double acceleration_, end_speed_;
  ShortIntervals& counts_;
  std::uint32_t run_ = UINT32_MAX;
  Point2 at_{};
  Thickness before_ = Thickness::kReference;
  bool divided_ = false;
  double entry_ = 0, length_ = 0, speed_ = 0;
};

/// Calls deposit(const BeadMove&) for every move of the paths of a part in a layer; it returns what the move has deposited, or
/// nothing to stop there. sums: deposits are added. returns  false if `deposit` stopped
template <class Deposit>
bool for_each_move(const ToolpathsView& paths, const LayerCut& cut, MoveTable& table, DepositedSums& sums, Deposit&& deposit) {
  bool goes_on = true;
  SegmentCounter counter(cut, sums.segments);
  SpeedCounter speeds(table.machine(), sums.shorts);
  std::optional<PoreCounter> pores;
  if (cut.on) pores.emplace(paths, cut, table.plan(), sums.pores);
  std::uint32_t run = UINT32_MAX;
  for_each_interval(paths, cut, [&](const PathInterval& s) {
    if (!goes_on) return;
    const MoveTable::MoveEntry& entry = table.of(s);
    const std::optional<DepositedMove> deposited =
        deposit(BeadMove{s.from, s.to, s.kind, s.jump, entry.width, entry.area, entry.speed, s.jump || s.run != run});
    run = s.run;
    if (!deposited) {
      goes_on = false;
      return;
    }
    sums.porosity.extruded_mm3 += deposited->volume_mm3;
    sums.porosity.measured_mm3 += deposited->length_mm * entry.measured;
    if (!pores) return;
    counter.add(s);
    speeds.add(s, deposited->length_mm, entry.speed);
    pores->add(s);
  });
  if (pores && goes_on) {
    speeds.end();
    pores->end();
  }
  return goes_on;
}

}  // namespace lamina::segment
