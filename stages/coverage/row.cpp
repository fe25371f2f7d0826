#include "stages/coverage/row.h"

#include <algorithm>
#include <cmath>

#include "stages/coverage/coverage.h"
#include "stages/coverage/exact_level.h"
#include "stages/coverage/volume.h"

namespace lamina::cover {
namespace {

/// Half a unit in the last place of 1.
constexpr double kEpsilon = 0x1p-53;

/// Roundings of a facet's corners and volumes together, at most (docs/coverage.md counts 48).
constexpr double kRoundings = 128;

/// std::floor of less than 2^63, which is a call where SSE4.1 is not presumed.
std::int64_t whole_below(double value) {
  const auto whole = static_cast<std::int64_t>(value);
  return static_cast<double>(whole) > value ? whole - 1 : whole;
}

/// A tent for many columns: quotients are made once.
struct RowTent {
  double x0, x1, x2, area, mean, rise, fall;

  RowTent() = default;
  explicit RowTent(const Tent<double>& t)
      : x0(t.x0),
        x1(t.x1),
        x2(t.x2),
        area(t.area),
        mean(t.mean()),
        rise(area / ((x1 - x0) * (x2 - x0))),
        fall(area / ((x2 - x1) * (x2 - x0))) {}
  /// Adds the area before x and the volume behind it, as Tent does; a quotient by 0 is never used.
  void add(double x, double& covered, double& behind) const {
    if (x <= x0) return;
    if (x < x1) {
      const double d = x - x0, part = rise * d * d;
      covered += part;
      behind += part * d * (1.0 / 3);
      return;
    }
    covered += area;
    behind += area * (x - mean);
    if (x >= x2) return;
    const double d = x2 - x, part = fall * d * d;
    covered -= part;
    behind += part * d * (1.0 / 3);
  }
};

/// The piece of a facet within a row, as triangles that share its first corner.
struct Tents {
  std::array<RowTent, 6> tent;
  std::uint32_t count = 0;
  double first = 0, last = 0;  // x from the facet's corner

  bool make(const SlabFacet& facet, double low, double high) {
    Piece<double> whole, above, within;
    double lowest = facet.y[0], highest = facet.y[0];
    whole.size = facet.corners;
    for (std::uint32_t i = 0; i < facet.corners; ++i) {
      whole.corner[i] = {facet.x[i], facet.y[i], facet.z[i]};
      lowest = std::min(lowest, facet.y[i]);
      highest = std::max(highest, facet.y[i]);
    }
    const Piece<double>* piece = &whole;
    if (lowest < low) {
      cut<&Corner<double>::y, true>(*piece, low, above);
      piece = &above;
    }
    if (highest > high) {
      cut<&Corner<double>::y, false>(*piece, high, within);
      piece = &within;
    }
    if (piece->size == 0) return false;
    first = last = piece->corner[0].x;
    for (std::uint32_t i = 1; i < piece->size; ++i) {
      first = std::min(first, piece->corner[i].x);
      last = std::max(last, piece->corner[i].x);
    }
    count = 0;
    if (facet.edgewise) return true;
    for (std::uint32_t k = 1; k + 1 < piece->size; ++k) {
      tent[count++] = RowTent(Tent<double>(piece->corner[0], piece->corner[k], piece->corner[k + 1]));
    }
    return true;
  }
};

}  // namespace

void RowMaker::add(const Strip& strip, const Edges& edges, SlabFacet& facet) {
  const double from_y = static_cast<double>(facet.low.y), from_x = static_cast<double>(facet.low.x);
  Tents piece;
  if (!piece.make(facet, static_cast<double>(strip.y0) - from_y, static_cast<double>(strip.y1) - from_y)) {
    // Rounding has left nothing of a corner that touches the row: it holds that corner all the same.
    piece.first = 0;
    piece.last = facet.size;
    piece.count = 0;
  }
  facet.first_column = edges.at(from_x + piece.first - kRoom);
  facet.last_column = edges.at(from_x + piece.last + kRoom);
  const double longest = std::max({static_cast<double>(facet.size), edges.widest(), static_cast<double>(strip.y1 - strip.y0),
                                   static_cast<double>(strip.z1 - strip.z0)});
  Cell& begin = cells_.touch(facet.first_column);
  ++begin.held;
  ++begin.facets;
  begin.columns += facet.last_column - facet.first_column + 1;
  begin.scale += longest;
  Cell& end = cells_.touch(facet.last_column + 1);
  --end.held;
  if (facet.suspect) {
    ++begin.suspects;
    --end.suspects;
  }
  if (piece.count == 0) return;
  if (facet.first_column == facet.last_column) {
    const double right = edges[facet.first_column + 1] - from_x;
    for (std::uint32_t k = 0; k < piece.count; ++k) {
      begin.cover += piece.tent[k].area;
      begin.partial += piece.tent[k].area * (right - piece.tent[k].mean);
    }
    return;
  }
  double covered = 0, behind = 0;
  for (std::uint32_t c = facet.first_column; c <= facet.last_column; ++c) {
    const double right = edges[c + 1] - from_x;
    double next_covered = 0, next_behind = 0;
    for (std::uint32_t k = 0; k < piece.count; ++k) {
      piece.tent[k].add(right, next_covered, next_behind);
    }
    Cell& cell = cells_.touch(c);
    cell.cover += next_covered - covered;
    cell.partial += next_behind - behind - edges.width(c) * covered;
    covered = next_covered;
    behind = next_behind;
  }
}

std::uint8_t RowMaker::decide(const Job& job, const Stretch& stretch, std::uint32_t column, double share) {
  const double top = job.rule.top_level;
  const double spoilt = kRoundings * kEpsilon * job.margin * stretch.scale;
  const double summed =
      2 * kEpsilon * (stretch.columns + 2 * stretch.facets) * (std::abs(static_cast<double>(stretch.winding)) + stretch.facets);
  const double place = share * top + 0.5, off = (spoilt + summed) * top + 16 * kEpsilon * (std::abs(place) + top);
  const std::int64_t least = whole_below(place - off), most = whole_below(place + off), n = job.rule.top_level;
  if (least == most || most <= 0 || least >= n) return static_cast<std::uint8_t>(std::clamp<std::int64_t>(least, 0, n));
  ++job.report.exact_voxels;
  const Voxel voxel{
      edge(job.columns, column), edge(job.columns, column + 1), job.strip.y0, job.strip.y1, job.strip.z0, job.strip.z1};
  return static_cast<std::uint8_t>(
      exact_level(voxel, stretch.winding, job.facets, job.row, stretch.first, column, job.rule.top_level));
}

void RowMaker::look(const Job& job, const Stretch& stretch, std::uint32_t column) {
  if (samples_.knows(column)) return;
  std::int64_t held = stretch.held;
  std::uint32_t end = column;
  while (held > 0) {
    end = cells_.next(end + 1);
    if (end == RowCells::kNone) break;
    held += cells_.at(end).held;
  }
  end = std::min(end, job.edges.count());
  samples_.count(job.strip, job.columns, job.edges, stretch.winding, job.rule.fill, job.facets, job.row, stretch.first, end);
}

std::uint8_t RowMaker::level(const Job& job, const Stretch& stretch, std::uint32_t column, double volume, double& share) {
  share = volume / (job.edges.width(column) * job.area);
  ++job.report.held_voxels;
  if (stretch.suspects > 0) {
    look(job, stretch, column);
    ++job.report.looked_at;
    const Samples::Count& count = samples_.at(column);
    if (count.others > 0) {
      ++job.report.sampled_voxels;
      share = static_cast<double>(count.solid) / kAllSamples;
      return static_cast<std::uint8_t>(level_of_samples(count.solid, job.rule.top_level));
    }
  }
  return decide(job, stretch, column, share);
}

void RowMaker::pass_free(const Job& job, const Stretch& stretch, std::uint32_t begin, std::uint32_t end) {
  if (begin >= end || !is_solid(job.rule.fill, static_cast<std::int32_t>(stretch.winding))) return;
  job.out.append(begin, end, static_cast<std::uint8_t>(job.rule.top_level));
  job.report.volume_mm3 += (job.edges[end] - job.edges[begin]) * job.area;
}

void RowMaker::pass_even(const Job& job, const Stretch& stretch, std::uint32_t begin, std::uint32_t end) {
  double share = 0;
  if (stretch.suspects > 0) {
    for (std::uint32_t c = begin; c < end; ++c) {
      const std::uint8_t of_column = level(job, stretch, c, job.edges.width(c) * stretch.cover, share);
      job.out.append(c, c + 1, of_column);
      job.report.volume_mm3 += share * job.edges.width(c) * job.area;
    }
    return;
  }
  if (begin >= end) return;
  const std::uint8_t of_all = level(job, stretch, begin, job.edges.width(begin) * stretch.cover, share);
  job.report.held_voxels += end - begin - 1;
  job.out.append(begin, end, of_all);
  job.report.volume_mm3 += share * (job.edges[end] - job.edges[begin]) * job.area;
}

void RowMaker::sweep(const Job& job) {
  Stretch stretch;
  std::uint32_t at = 0;
  const std::uint32_t columns = job.edges.count();
  for (std::uint32_t c = cells_.next(0); c != RowCells::kNone; c = cells_.next(c + 1)) {
    if (stretch.held > 0) {
      pass_even(job, stretch, at, c);
    } else {
      pass_free(job, stretch, at, c);
    }
    at = c;
    if (stretch.held + cells_.at(c).held == 0) {
      cells_.take(c);
      stretch = {.first = c, .winding = std::llround(stretch.cover / job.area)};
      stretch.cover = static_cast<double>(stretch.winding) * job.area;
      samples_.forget();
      continue;
    }
    if (stretch.held == 0) stretch.first = c;
    const Cell cell = cells_.take(c);
    stretch.held += cell.held;
    stretch.suspects += cell.suspects;
    stretch.scale += cell.scale;
    stretch.facets += cell.facets;
    stretch.columns += cell.columns;
    double share = 0;
    const double width = job.edges.width(c);
    const std::uint8_t of_column = level(job, stretch, c, width * stretch.cover + cell.partial, share);
    job.out.append(c, c + 1, of_column);
    job.report.volume_mm3 += share * width * job.area;
    stretch.cover += cell.cover;
    at = c + 1;
  }
  if (stretch.held == 0) pass_free(job, stretch, at, columns);
}

void RowMaker::make(const Strip& strip, const PixelAxis& columns, const Edges& edges, const Rule& rule,
                    std::span<SlabFacet> facets, std::span<const std::uint32_t> row, Levels& out, LayerReport& report) {
  cells_.start(edges.count());
  samples_.forget();
  for (const std::uint32_t index : row) add(strip, edges, facets[index]);
  const double depth = static_cast<double>(strip.y1 - strip.y0), height = static_cast<double>(strip.z1 - strip.z0);
  const double margin = edges.widest() * (depth + height) + depth * height;
  sweep({strip, columns, edges, rule, facets, row, out, report, depth * height, margin / (edges.narrowest() * depth * height)});
  out.end_row();
}

}  // namespace lamina::cover
