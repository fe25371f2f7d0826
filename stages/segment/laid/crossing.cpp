#include "stages/segment/laid/crossing.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <vector>

namespace lamina::segment {
namespace {

/// A thin stretch seen from the lines of the layer below: it lies at one place along them and reaches across.
struct Over {
  Nm place, low, high;
};

}  // namespace

void count_crossed(const ToolpathsView& paths, const LayerCut& cut, const ToolpathsView& above, const LayerCut& cut_above,
                   PoreCounts& counts) {
  if (!cut.on || !cut_above.on || std::abs(cut.along_x * cut_above.along_x + cut.along_y * cut_above.along_y) > 1e-6) return;
  const auto along = [&](Point2 p) { return static_cast<Nm>(std::llround(cut.along_x * p.x + cut.along_y * p.y)); };
  const auto across = [&](Point2 p) { return static_cast<Nm>(std::llround(cut.along_x * p.y - cut.along_y * p.x)); };
  const auto is_thin = [](const Stretch& s) { return s.thickness == Thickness::kThin && s.kind == PathKind::kRaster; };
  std::vector<Over> over;
  for_each_stretch(above, cut_above, [&](const Stretch& s) {
    if (!is_thin(s)) return;
    const auto [low, high] = std::minmax({across(s.from), across(s.to)});
    over.push_back({along(s.from), low, high});
  });
  std::ranges::sort(over, {}, [](const Over& o) { return std::tuple(o.place, o.low); });
  const auto by_place = [](const Over& o) { return o.place; };
  const auto meets = [&](Nm from, Nm to, Nm at) {
    for (auto line = std::ranges::lower_bound(over, from, {}, by_place); line != over.end() && line->place <= to;) {
      const auto next =
          std::upper_bound(line, over.end(), line->place, [](Nm place, const Over& o) { return place < o.place; });
      const auto after = std::upper_bound(line, next, at, [](Nm place, const Over& o) { return place < o.low; });
      if (after != line && std::prev(after)->high >= at) return true;
      line = next;
    }
    return false;
  };
  for_each_stretch(paths, cut, [&](const Stretch& s) {
    if (!is_thin(s)) return;
    const auto [from, to] = std::minmax({along(s.from), along(s.to)});
    ++counts.crossing;
    counts.crossed += meets(from, to, across(s.from)) ? 1 : 0;
  });
}

}  // namespace lamina::segment
