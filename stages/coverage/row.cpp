#include "stages/coverage/row.h"

#include <algorithm>
#include <cmath>

#include "stages/coverage/coverage.h"
#include "stages/coverage/exact_level.h"

namespace lamina::cover {
namespace {

/// Half a unit in the last place of 1.
constexpr double kEpsilon = 0x1p-53;

/// Roundings of a facet's corners and volumes together, at most (docs/coverage.md counts 160).
constexpr double kRoundings = 512;

/// Facets of a stretch whose steps are found: each look at a column costs as many.
constexpr std::size_t kMostClimbed = 24;

/// std::floor of less than 2^63, which is a call where SSE4.1 is not presumed.
std::int64_t whole_below(double value) {
  const auto whole = static_cast<std::int64_t>(value);
  return static_cast<double>(whole) > value ? whole - 1 : whole;
}

}  // namespace

std::uint64_t RowMaker::bytes_of(std::uint64_t facets, std::uint32_t levels) {
  const std::uint64_t steps = levels - 1 <= kMostSteps ? levels - 1 : 0;
  // Facets of a row double their room as they are listed.
  return (facets + facets / 8) * (sizeof(Walk) + sizeof(PlaneSteps) + steps * sizeof(double)) +
         2 * facets * (sizeof(RowFacet) + sizeof(Tents));
}

void RowMaker::start(const Slab& slab) {
  cells_.start(slab.edges.count());
  row_.clear();
  const std::size_t facets = slab.facets.size(), steps = slab.rule.top_level <= kMostSteps ? slab.rule.top_level : 0;
  make_room(walk_, facets), make_room(plane_, facets), make_room(step_, facets * steps);
  walk_.resize(facets), plane_.resize(facets), step_.resize(facets * steps);
}

void RowMaker::enter(const SlabFacet& facet, std::uint32_t index) {
  Walk& walk = walk_[index];
  walk.walk.start(facet);
  walk.from_x = facet.low.x;
  walk.from_y = facet.low.y;
  walk.sign = static_cast<std::int8_t>(facet.edgewise ? 0 : facet.enters ? 1 : -1);
  walk.suspect = facet.suspect;
  walk.steps = Known::kNot;
  row_.push_back({0, 0, index, facet.first_row});
}

/// Finds what columns the facets of the row reach, and orders them by the first: nearly the order of the row before.
void RowMaker::step(const Job& job, std::uint32_t row) {
  const double y0 = static_cast<double>(job.strip.y0), y1 = static_cast<double>(job.strip.y1);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < row_.size(); ++i) {
    RowFacet of_row = row_[i];
    if (of_row.first_row > row) continue;
    Walk& walk = walk_[of_row.index];
    walk.walk.step(job.slab.facets[of_row.index], y0 - walk.from_y, y1 - walk.from_y);
    walk.tents = kNone;
    of_row.first = job.slab.edges.at_or_before(walk.from_x + walk.walk.first - kRoom);
    of_row.last = job.slab.edges.at_or_behind(walk.from_x + walk.walk.last + kRoom);
    std::size_t place = kept++;
    for (; place > 0 && row_[place - 1].first > of_row.first; --place) row_[place] = row_[place - 1];
    row_[place] = of_row;
  }
  row_.resize(kept);
}

std::uint8_t RowMaker::decide(const Job& job, Stretch& stretch, std::uint32_t column, double share) {
  if (stretch.spoilt < 0) {
    const double of_voxels =
        std::max({job.slab.edges.widest(), static_cast<double>(job.strip.y1 - job.strip.y0), job.slab.sides.z});
    double scale = 0, columns = 0;
    const auto facets = static_cast<double>(stretch.facets.size());
    for (const RowFacet& of_row : stretch.facets) {
      scale += std::max(static_cast<double>(job.slab.facets[of_row.index].size), of_voxels);
      columns += of_row.last - of_row.first + 1;
    }
    stretch.spoilt = kRoundings * kEpsilon * job.margin * scale +
                     2 * kEpsilon * (columns + 2 * facets) * (std::abs(static_cast<double>(stretch.winding)) + facets);
  }
  const double top = job.slab.rule.top_level;
  const double place = share * top + 0.5, off = stretch.spoilt * top + 16 * kEpsilon * (std::abs(place) + top);
  const std::int64_t least = whole_below(place - off), most = whole_below(place + off), n = job.slab.rule.top_level;
  if (least == most || most <= 0 || least >= n) return static_cast<std::uint8_t>(std::clamp<std::int64_t>(least, 0, n));
  ++job.report.exact_voxels;
  const PixelAxis& columns = job.slab.columns;
  const Voxel voxel{edge(columns, column), edge(columns, std::int64_t{column} + 1), job.strip.y0, job.strip.y1, job.strip.z0,
                    job.strip.z1};
  return static_cast<std::uint8_t>(
      exact_level(voxel, stretch.winding, job.slab.facets, stretch.facets, column, job.slab.rule.top_level));
}

void RowMaker::pass_free(const Job& job, std::int64_t winding, std::uint32_t begin, std::uint32_t end) {
  if (begin >= end) return;
  const bool solid = is_solid(job.slab.rule.fill, static_cast<std::int32_t>(winding));
  if (winding < 0 || winding > 1) {
    const auto told = static_cast<double>((solid ? 1 : 0) - winding);
    job.report.volume_mm3 += told * (job.slab.edges[end] - job.slab.edges[begin]) * job.area;
  }
  if (solid) job.out.append(begin, end, static_cast<std::uint8_t>(job.slab.rule.top_level));
}

/// Returns the winding number behind.
std::int64_t RowMaker::pass(const Job& job, Stretch& stretch) {
  double cover = 0;
  bool suspect = false;
  for (const RowFacet& of_row : stretch.facets) {
    const Walk& walk = walk_[of_row.index];
    cover += walk.walk.area;
    suspect |= walk.suspect;
  }
  stretch.cover = static_cast<double>(stretch.winding) * job.area;
  const std::int64_t behind = stretch.winding + whole_below(cover / job.area + 0.5);
  const bool is_plain = stretch.winding >= 0 && stretch.winding <= 1 && behind >= 0 && behind <= 1;
  if (!suspect && is_plain && stretch.facets.size() <= kMostClimbed && job.slab.rule.top_level <= kMostSteps) {
    climb(job, stretch);
  } else {
    for (const RowFacet& of_row : stretch.facets) add(job, of_row);
    sweep(job, stretch);
  }
  return behind;
}

void RowMaker::make(const Slab& slab, const Strip& strip, std::uint32_t row, Levels& out, LayerReport& report) {
  const double depth = static_cast<double>(strip.y1 - strip.y0), height = static_cast<double>(strip.z1 - strip.z0);
  const double margin = slab.edges.widest() * (depth + height) + depth * height;
  const Job job{slab, strip, out, report, depth * height, margin / (slab.edges.narrowest() * depth * height)};
  tents_.clear();
  step(job, row);
  std::int64_t winding = 0;
  std::uint32_t at = 0;
  for (std::size_t i = 0; i < row_.size();) {
    Stretch stretch;
    stretch.first = stretch.at = row_[i].first;
    stretch.winding = winding;
    pass_free(job, winding, at, stretch.first);
    std::size_t k = i;
    for (stretch.end = row_[i].last + 1; k < row_.size() && row_[k].first < stretch.end; ++k) {
      stretch.end = std::max(stretch.end, row_[k].last + 1);
    }
    stretch.facets = {row_.data() + i, k - i};
    report.held_voxels += stretch.end - stretch.first;
    winding = pass(job, stretch);
    at = stretch.end;
    i = k;
  }
  pass_free(job, winding, at, slab.edges.count());
  out.end_row();
}

// Stretches with suspect facets or many of them: each column is looked at.

void RowMaker::add(const Job& job, const RowFacet& of_row) {
  const Walk& walk = walk_[of_row.index];
  Cell& begin = cells_.touch(of_row.first);
  Cell& end = cells_.touch(of_row.last + 1);
  ++begin.held;
  --end.held;
  if (walk.suspect) {
    ++begin.suspects;
    --end.suspects;
  }
  if (walk.sign == 0) return;
  const Tents& piece = tents(job, of_row);
  const Edges& edges = job.slab.edges;
  double covered = 0, behind = 0;
  for (std::uint32_t c = of_row.first; c <= of_row.last; ++c) {
    double next_covered = 0, next_behind = 0;
    piece.add(edges[c + 1] - walk.from_x, next_covered, next_behind);
    Cell& cell = cells_.touch(c);
    cell.cover += next_covered - covered;
    cell.partial += next_behind - behind - edges.width(c) * covered;
    covered = next_covered;
    behind = next_behind;
  }
}

std::uint8_t RowMaker::level(const Job& job, Stretch& stretch, std::uint32_t column, double volume) {
  const double voxel = job.slab.edges.width(column) * job.area;
  if (stretch.suspects > 0) {
    if (!samples_.knows(column)) {
      samples_.count(job.strip, job.slab.columns, job.slab.edges, stretch.winding, job.slab.rule.fill, job.slab.facets,
                     stretch.facets, stretch.first, stretch.end);
    }
    ++job.report.looked_at;
    const Samples::Count& count = samples_.at(column);
    if (count.others > 0) {
      ++job.report.sampled_voxels;
      job.report.volume_mm3 += static_cast<double>(count.solid) / kAllSamples * voxel - volume;
      return static_cast<std::uint8_t>(level_of_samples(count.solid, job.slab.rule.top_level));
    }
  }
  return decide(job, stretch, column, volume / voxel);
}

void RowMaker::pass_even(const Job& job, Stretch& stretch, std::uint32_t begin, std::uint32_t end) {
  if (begin >= end) return;
  const Edges& edges = job.slab.edges;
  if (stretch.suspects == 0) {
    job.out.append(begin, end, level(job, stretch, begin, edges.width(begin) * stretch.cover));
    return;
  }
  for (std::uint32_t c = begin; c < end; ++c) {
    job.out.append(c, c + 1, level(job, stretch, c, edges.width(c) * stretch.cover));
  }
}

void RowMaker::sweep(const Job& job, Stretch& stretch) {
  samples_.forget();
  for (std::uint32_t c = cells_.next(stretch.first); c != RowCells::kNone; c = cells_.next(c + 1)) {
    pass_even(job, stretch, stretch.at, c);
    const Cell cell = cells_.take(c);
    if (c == stretch.end) break;
    stretch.held += cell.held;
    stretch.suspects += cell.suspects;
    job.out.append(c, c + 1, level(job, stretch, c, job.slab.edges.width(c) * stretch.cover + cell.partial));
    stretch.cover += cell.cover;
    stretch.at = c + 1;
  }
}

}  // namespace lamina::cover
