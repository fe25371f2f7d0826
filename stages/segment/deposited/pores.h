// stages/segment/deposited/pores.h: the pores that thin stretches leave, counted from the toolpaths that are laid.
//
// Their sizes are those of pore_geometry.h, at the distances that the lines have.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "stages/data/toolpaths.h"
#include "stages/segment/expand.h"
#include "stages/segment/predict.h"

namespace lamina::segment {

/// Where the lines of one part in a layer lie, and how far each is from those numbered one less and one more.
class LineNeighbours {
 public:
  /// paths, cut  have to outlive it
  /// memory      40 bytes a line or curve. cost  O(points + lines log lines)
  LineNeighbours(const ToolpathsView& paths, const LayerCut& cut);

  /// Along the direction of the lines, nm.
  double along(Point2 p) const { return cut_.along_x * p.x + cut_.along_y * p.y; }
  /// Distances between centres, mm, to the line before and the one after; absent if none lies beside all of low .. high.
  /// run        Stretch::run of the line
  /// low, high  along() the ends of what is asked about; curves, which are as far apart everywhere, are looked at in the middle
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
  // --- of the run that was asked for last
  std::uint32_t run_ = UINT32_MAX;
  const NeighbourLine* line_ = nullptr;
  std::array<std::span<const NeighbourLine>, 2> adjacent_;
  std::array<std::optional<double>, 2> curve_;
};

/// Takes the stretches of a part in a layer in the order in which they are laid.
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
  // --- the stretch before
  std::uint32_t run_ = UINT32_MAX;
  Point2 at_{};
  Thickness before_ = Thickness::kReference;
  // --- the thin stretch that is being laid
  bool thick_before_ = false;
  PathKind kind_ = PathKind::kRaster;
  std::int32_t line_ = 0;
  Point2 from_{};
  double length_mm_ = 0, thin_mm_ = 0;
};

// --- thin stretches of a layer that lie under thin ones of the next, whose lines are turned by a
// quarter.

/// Counts the thin stretches of straight lines of a part in a layer, and those whose centre line meets that of a thin stretch
/// of the same part in the layer above. Layers that are not turned by 90 degrees have none.
/// counts  receives crossing and crossed
/// memory  12 bytes a thin stretch above. cost  O((thin + thin above) log (thin above)) and the lines that a stretch crosses
void count_crossed(const ToolpathsView& paths, const LayerCut& cut, const ToolpathsView& above, const LayerCut& cut_above,
                   PoreCounts& counts);

}  // namespace lamina::segment
