#include "stages/segment/moves.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <vector>

#include "stages/geometry/bead_section.h"
#include "stages/geometry/contours/contact.h"

namespace lamina::segment {

MoveTable::MoveTable(const Segmentation& plan, const LayerCut& cut, const Extruder& machine, const Layer& layer)
    : plan_(plan), cut_(cut), machine_(machine), height_(mm(layer.thickness)) {
  const double limit = layer.index == 0 ? machine.speed.first_layer_mm_s : INFINITY;
  reference_ = std::min(machine.speed.print_mm_s, limit);
  wall_ = std::min(machine.speed.wall_mm_s, limit);
  inner_ = std::min(machine.speed.inner_wall_mm_s, limit);
}

void MoveTable::make(const PathInterval& s, MoveEntry& entry) const {
  const auto& material = machine_.material;
  const double full = bead_area(mm(s.width), height_, material.shape()) * material.flow;
  // The deposit is as wide as a bead of that volume; only an ellipse is another shape in truth.
  const BeadShape deposited = material.shape() == BeadShape::kEllipse ? BeadShape::kEllipse : BeadShape::kStadium;
  const double width = bead_width(full, height_, deposited);
  const bool fills = s.kind != PathKind::kOuter && s.kind != PathKind::kInner;
  double share = 1, speed = 100, bead = fills && cut_.on ? plan_.continuous_width_mm : width;
  if (s.thickness == Thickness::kThick)
    share = plan_.thick_extrusion / 100, speed = plan_.thick_speed, bead = plan_.thick_width_mm;
  if (s.thickness == Thickness::kThin) {
    const auto thin = plan_.thin_of(cut_.ordinal(s.line));
    share = thin.extrusion / 100, speed = thin.speed, bead = thin.width_mm;
  }
  entry.stored = s.width;
  entry.width = static_cast<Nm>(nm_of(s.thickness == Thickness::kReference ? width : bead));
  entry.area = full * share;
  entry.measured = bead_area(bead, height_, deposited);
  const double reference = s.kind == PathKind::kOuter ? wall_ : s.kind == PathKind::kInner ? inner_ : reference_;
  entry.speed = reference * speed / 100;
  // Thick and thin segments need their speeds: those that exceed the rate give a warning (report/path_observers.cpp).
  if (material.max_melt_mm3_s > 0 && s.thickness == Thickness::kReference)
    entry.speed = std::min(entry.speed, material.max_melt_mm3_s / entry.area);
}

namespace {

constexpr double kNear = 10;  // nm: places are rounded, and so are the ends of lines

/// Calls use(path points i .. end) for every run of one line or curve.
template <class Use>
void for_each_run(const ToolpathsView& paths, Use use) {
  for (std::uint32_t p = 0; p < paths.size(); ++p) {
    const std::uint32_t last = paths.offset[p + 1] - 1;
    for (std::uint32_t i = paths.offset[p]; i < last;) {
      std::uint32_t end = i + 1;
      while (end < last && paths.kind[end] == paths.kind[i] && paths.line[end] == paths.line[i]) ++end;
      if (paths.line[i] != kNoLine) use(i, end);
      i = end;
    }
  }
}

/// A thin segment relative to the lines of the layer below: it is at one position along them and reaches across.
struct Over {
  Nm position, low, high;
};

}  // namespace

LineNeighbours::LineNeighbours(const ToolpathsView& paths, const LayerCut& cut) : paths_(paths), cut_(cut) {
  std::size_t runs = 0;
  for_each_run(paths, [&](std::uint32_t, std::uint32_t) { ++runs; });
  lines_.reserve(runs);
  for_each_run(paths, [&](std::uint32_t i, std::uint32_t end) {
    const Point2 a = paths.point[i], b = paths.point[end];
    const auto [low, high] = std::minmax({along(a), along(b)});
    const double across = cut.along_x * a.y - cut.along_y * a.x;
    lines_.push_back({paths.kind[i], end == i + 1, paths.line[i], i, end, low, high, across});
  });
  std::ranges::sort(lines_, {}, [](const NeighbourLine& l) { return std::tuple(l.kind, l.number, l.low, l.run); });
  order_.resize(lines_.size());
  for (std::uint32_t i = 0; i < order_.size(); ++i) order_[i] = i;
  std::ranges::sort(order_, {}, [&](std::uint32_t i) { return lines_[i].run; });
}

void LineNeighbours::find_neighbours(std::uint32_t run) {
  run_ = run;
  line_ = nullptr;
  const auto at = std::ranges::lower_bound(order_, run, {}, [&](std::uint32_t i) { return lines_[i].run; });
  if (at == order_.end() || lines_[*at].run != run) return;
  line_ = &lines_[*at];
  const auto before = [](const NeighbourLine& a, const NeighbourLine& b) {
    return std::tuple(a.kind, a.number) < std::tuple(b.kind, b.number);
  };
  for (std::size_t side = 0; side < 2; ++side) {
    NeighbourLine wanted = *line_;
    wanted.number += side == 0 ? -1 : 1;
    const auto found = std::equal_range(lines_.begin(), lines_.end(), wanted, before);
    adjacent_[side] = {found.first, found.second};
    if (!line_->straight) curve_[side] = curve_at(adjacent_[side]);
  }
}

std::optional<double> LineNeighbours::curve_at(std::span<const NeighbourLine> neighbour) const {
  std::uint32_t longest = line_->run;
  double maximum = -1;
  for (std::uint32_t i = line_->run; i < line_->end; ++i) {
    const double length = expand_detail::distance(paths_.point[i], paths_.point[i + 1]);
    if (length > maximum) maximum = length, longest = i;
  }
  const Point2 middle = expand_detail::between(paths_.point[longest], paths_.point[longest + 1], 0, 2, 1);
  double nearest = INFINITY;
  for (const NeighbourLine& line : neighbour) {
    for (std::uint32_t i = line.run; i < line.end; ++i) {
      nearest = std::min(nearest, distance_to(middle, paths_.point[i], paths_.point[i + 1]));
    }
  }
  if (nearest == INFINITY) return std::nullopt;
  return nearest * 1e-6;
}

std::optional<double> LineNeighbours::straight_at(std::span<const NeighbourLine> neighbour, double low, double high) const {
  // The piece that begins last at or before `low` is the one before.
  const auto at =
      static_cast<std::size_t>(std::ranges::upper_bound(neighbour, low + kNear, {}, &NeighbourLine::low) - neighbour.begin());
  if (at == 0 || !neighbour[at - 1].straight || neighbour[at - 1].high < high - kNear) return std::nullopt;
  return std::abs(neighbour[at - 1].across - line_->across) * 1e-6;
}

std::array<std::optional<double>, 2> LineNeighbours::of(std::uint32_t run, double low, double high) {
  if (run != run_) find_neighbours(run);
  if (line_ == nullptr) return {};
  if (!line_->straight) return curve_;
  return {straight_at(adjacent_[0], low, high), straight_at(adjacent_[1], low, high)};
}

PoreCounter::PoreCounter(const ToolpathsView& paths, const LayerCut& cut, const Segmentation& plan, PoreCounts& counts)
    : cut_(cut), plan_(plan), counts_(counts), neighbours_(paths, cut) {}

void PoreCounter::extend(const PathInterval& s, bool follows) {
  if (!follows || before_ != Thickness::kThin) {
    thick_before_ = follows && before_ == Thickness::kThick;
    kind_ = s.kind;
    line_ = s.line;
    from_ = s.from;
    length_mm_ = 0;
  }
  length_mm_ += expand_detail::distance(s.from, s.to) * 1e-6;
}

void PoreCounter::finish(bool thick_after) {
  const auto [low, high] = std::minmax({neighbours_.along(from_), neighbours_.along(at_)});
  const auto distances = neighbours_.of(run_, low, high);
  thin_mm_ = plan_.thin_of(cut_.ordinal(line_)).width_mm;
  for (std::size_t side = 0; side < 2; ++side) {
    const bool segmented = cut_.segments(kind_, line_ + (side == 0 ? -1 : 1));
    check(distances[side], segmented ? plan_.thick_width_mm : plan_.continuous_width_mm, thick_before_ && thick_after);
  }
}

void PoreCounter::check(const std::optional<double>& distance_mm, double other_mm, bool thick_ends) {
  if (!distance_mm || !thick_ends) {
    ++counts_.edges;
    return;
  }
  const PoreSize pore = pore_geometry({plan_.thick_width_mm, thin_mm_, other_mm}, length_mm_, *distance_mm);
  if (pore.gap_mm > kBondGap + 2 * kNear * 1e-6) {
    ++counts_.open;
    counts_.distance_mm += *distance_mm;
    return;
  }
  if (pore.length_mm <= 0 || pore.width_mm <= 0) {
    ++counts_.filled;
    return;
  }
  ++counts_.closed;
  counts_.length_mm += pore.length_mm;
  counts_.width_mm += pore.width_mm;
}

void count_crossed(const ToolpathsView& paths, const LayerCut& cut, const ToolpathsView& above, const LayerCut& cut_above,
                   PoreCounts& counts) {
  if (!cut.on || !cut_above.on || std::abs(cut.along_x * cut_above.along_x + cut.along_y * cut_above.along_y) > 1e-6) return;
  const auto along = [&](Point2 p) { return static_cast<Nm>(std::llround(cut.along_x * p.x + cut.along_y * p.y)); };
  const auto across = [&](Point2 p) { return static_cast<Nm>(std::llround(cut.along_x * p.y - cut.along_y * p.x)); };
  const auto is_thin = [](const PathInterval& s) { return s.thickness == Thickness::kThin && s.kind == PathKind::kRaster; };
  std::vector<Over> over;
  for_each_interval(above, cut_above, [&](const PathInterval& s) {
    if (!is_thin(s)) return;
    const auto [low, high] = std::minmax({across(s.from), across(s.to)});
    over.push_back({along(s.from), low, high});
  });
  std::ranges::sort(over, {}, [](const Over& o) { return std::tuple(o.position, o.low); });
  const auto by_position = [](const Over& o) { return o.position; };
  const auto meets = [&](Nm from, Nm to, Nm at) {
    for (auto line = std::ranges::lower_bound(over, from, {}, by_position); line != over.end() && line->position <= to;) {
      const auto next =
          std::upper_bound(line, over.end(), line->position, [](Nm position, const Over& o) { return position < o.position; });
      const auto after = std::upper_bound(line, next, at, [](Nm position, const Over& o) { return position < o.low; });
      if (after != line && std::prev(after)->high >= at) return true;
      line = next;
    }
    return false;
  };
  for_each_interval(paths, cut, [&](const PathInterval& s) {
    if (!is_thin(s)) return;
    const auto [from, to] = std::minmax({along(s.from), along(s.to)});
    ++counts.crossing;
    counts.crossed += meets(from, to, across(s.from)) ? 1 : 0;
  });
}

}  // namespace lamina::segment
