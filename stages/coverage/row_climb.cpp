// Stretches of columns whose facets all enter the solid, or all leave it: steps are found, not passed.
#include "stages/coverage/coverage.h"
#include "stages/coverage/row.h"

namespace lamina::cover {
const Tents& RowMaker::tents(const Job& job, const RowFacet& of_row) {
  Walk& walk = walk_[of_row.index];
  if (walk.tents == kNone) {
    walk.tents = static_cast<std::uint32_t>(tents_.size());
    tents_.resize(tents_.size() + 1);
    walk.walk.cut_out(job.slab.facets[of_row.index], static_cast<double>(job.strip.y0) - walk.from_y,
                      static_cast<double>(job.strip.y1) - walk.from_y, tents_.back());
  }
  return tents_[walk.tents];
}

/// Of a column behind the one whose level is known.
std::uint32_t RowMaker::level_at(const Job& job, Stretch& stretch, std::uint32_t column) {
  const Edges& edges = job.slab.edges;
  const double left = edges[column], right = edges[column + 1];
  double before = stretch.cover, partial = 0;
  for (const RowFacet& of_row : stretch.near) {
    if (of_row.first > column) break;
    const Walk& walk = walk_[of_row.index];
    if (of_row.last < column) {
      before += walk.walk.area;
    } else if (walk.sign != 0) {
      partial += tents(job, of_row).between(left - walk.from_x, right - walk.from_x);
    }
  }
  const double width = right - left;
  return decide(job, stretch, column, (before * width + partial) / (width * job.area));
}

/// The level changes at a column.
void RowMaker::climb_to(const Job& job, Stretch& stretch, std::uint32_t column, std::uint32_t level) {
  job.out.append(stretch.at, column, static_cast<std::uint8_t>(stretch.level));
  stretch.at = column;
  stretch.level = level;
}

/// Up to column `high`, which has `level`. Between known columns levels only rise or only fall, unless some facets enter and
/// others leave: then each column is looked at.
void RowMaker::between(const Job& job, Stretch& stretch, std::int64_t high, std::uint32_t level) {
  const bool is_even = !stretch.rises || !stretch.falls;
  while (stretch.known + 1 < high && !(is_even && stretch.level == level)) {
    const std::int64_t middle = is_even ? stretch.known + (high - stretch.known) / 2 : stretch.known + 1;
    const std::uint32_t of_middle = level_at(job, stretch, static_cast<std::uint32_t>(middle));
    if (is_even) {
      between(job, stretch, middle, of_middle);
    } else if (of_middle != stretch.level) {
      climb_to(job, stretch, static_cast<std::uint32_t>(middle), of_middle);
    }
    stretch.known = middle;
  }
  if (stretch.level != level) climb_to(job, stretch, static_cast<std::uint32_t>(high), level);
  stretch.known = high;
}

/// Columns [begin, end], which hold one facet alone; false if nobody can tell its steps.
bool RowMaker::climb_plane(const Job& job, Stretch& stretch, const RowFacet& of_row, std::uint32_t begin, std::uint32_t end) {
  Walk& walk = walk_[of_row.index];
  const Slab& slab = job.slab;
  if (walk.sign == 0) {
    between(job, stretch, begin, level_at(job, stretch, begin));
    stretch.known = end;
    return true;
  }
  const std::uint32_t steps = slab.rule.top_level;
  PlaneSteps& plane = plane_[of_row.index];
  double* const step = step_.data() + std::size_t{of_row.index} * steps;
  if (walk.steps == Known::kNot) {
    plane.find(slab.facets[of_row.index], slab.bottom, slab.sides, slab.sides.x / 4, {step, steps});
    walk.steps = plane.is_known ? Known::kYes : Known::kNever;
  }
  if (walk.steps == Known::kNever) return false;
  const double per_nm = slab.edges.per_nm(), room = plane.room * per_nm;
  const double middle = static_cast<double>(job.strip.y0 + job.strip.y1) * 0.5 - walk.from_y;
  const double place = (walk.from_x + plane.x + plane.per_y * middle) * per_nm - 0.5;
  const auto level_behind = [&](std::uint32_t passed) { return walk.sign > 0 ? passed : steps - passed; };
  const double first = begin, last = end;
  std::uint32_t passed = 0;
  while (passed < steps && place + step[passed] * per_nm + room <= first) ++passed;
  if (passed < steps && place + step[passed] * per_nm - room <= first) {
    passed = level_behind(level_at(job, stretch, begin));
  }
  between(job, stretch, begin, level_behind(passed));
  for (; passed < steps; ++passed) {
    const double at = place + step[passed] * per_nm;
    if (at > last + room) break;
    // Columns before `at` come before the step, others behind; `at` is more than 0 here.
    auto column = static_cast<std::uint32_t>(at + room);
    if (static_cast<double>(column) < at + room) ++column;
    if (static_cast<double>(column) - 1 >= at - room) {
      column -= level_behind(level_at(job, stretch, column - 1)) > passed ? 1 : 0;
    }
    if (column > end) break;
    climb_to(job, stretch, column, level_behind(passed + 1));
  }
  stretch.known = end;
  return true;
}

void RowMaker::climb(const Job& job, Stretch& stretch) {
  const std::uint32_t top = job.slab.rule.top_level;
  stretch.known = std::int64_t{stretch.first} - 1;
  stretch.level = stretch.winding == 0 ? 0 : top;
  double cover = stretch.cover;
  std::uint32_t others_end = stretch.first;  // behind the last column that facets so far reach
  std::size_t from = 0;
  for (std::size_t i = 0; i < stretch.facets.size(); ++i) {
    const RowFacet& of_row = stretch.facets[i];
    const Walk& walk = walk_[of_row.index];
    stretch.near = stretch.facets.subspan(from, i + 1 - from);
    stretch.rises |= walk.sign > 0;
    stretch.falls |= walk.sign < 0;
    const std::uint32_t begin = std::max(of_row.first, others_end);
    std::uint32_t end = of_row.last + 1;
    others_end = std::max(others_end, end);
    if (i + 1 < stretch.facets.size()) end = std::min(end, stretch.facets[i + 1].first);
    if (begin < end && climb_plane(job, stretch, of_row, begin, end - 1)) {
      from = i;
      stretch.cover = cover;
      stretch.rises = walk.sign > 0;
      stretch.falls = walk.sign < 0;
    }
    cover += walk.walk.area;
  }
  stretch.near = stretch.facets.subspan(from);
  const double behind = cover;
  between(job, stretch, stretch.end, behind > 0.5 * job.area ? top : 0);
  climb_to(job, stretch, stretch.end, 0);
}

}  // namespace lamina::cover
