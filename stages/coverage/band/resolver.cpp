#include "stages/coverage/band/resolver.h"

#include <algorithm>
#include <cmath>

#include "stages/coverage/coverage.h"
#include "stages/coverage/exact_level.h"

namespace lamina::coverage {
namespace {

/// Half a unit in the last place of 1.
constexpr double kEpsilon = 0x1p-53;

/// Roundings of a facet's corners and volumes together, at most (docs/coverage.md counts 190).
constexpr double kRoundings = 512;

constexpr std::uint32_t kNoSpan = UINT32_MAX;

}  // namespace

double widest_side(const BandSlab& slab, double depth) { return std::max({slab.edges.widest(), depth, slab.sides.z}); }

double spoilt_share(const BandSlab& slab, double depth, double scale, double added, double maximum) {
  const double height = slab.sides.z;
  const double margin = slab.edges.widest() * (depth + height) + depth * height;
  return kRoundings * kEpsilon * margin / (slab.edges.narrowest() * depth * height) * scale + 2 * kEpsilon * added * maximum;
}

void RowResolver::start(const BandSlab& slab, BandPieces pieces, std::uint32_t row, std::uint32_t first,
                        CoverageReport& report) {
  slab_ = &slab;
  report_ = &report;
  pieces_ = pieces;
  row_ = row;
  first_row_ = first;
  strip_ = {edge(slab.rows, row), edge(slab.rows, std::int64_t{row} + 1), slab.bottom, slab.top};
  is_listed_ = false;
  taken_first_ = kNoSpan;
}

/// A facet that several trapezoids of the row are of is listed once.
void RowResolver::list_facets() {
  is_listed_ = true;
  facet_.clear();
  const std::uint32_t lane = row_ - first_row_;
  for (std::size_t i = 0; i < pieces_.piece.size(); ++i) {
    const Trapezoid& piece = pieces_.piece[i];
    if (piece.first_row > row_ || piece.last_row < row_) continue;
    facet_.push_back({pieces_.reach[i].first[lane], pieces_.reach[i].last[lane], piece.facet});
  }
  std::sort(facet_.begin(), facet_.end(), [](const RowFacet& a, const RowFacet& b) { return a.index < b.index; });
  std::size_t kept = 0;
  for (std::size_t i = 1; i < facet_.size(); ++i) {
    if (facet_[i].index == facet_[kept].index) {
      facet_[kept].first = std::min(facet_[kept].first, facet_[i].first);
      facet_[kept].last = std::max(facet_[kept].last, facet_[i].last);
    } else {
      facet_[++kept] = facet_[i];
    }
  }
  facet_.resize(std::min(facet_.size(), kept + 1));
  std::sort(facet_.begin(), facet_.end(),
            [](const RowFacet& a, const RowFacet& b) { return a.first != b.first ? a.first < b.first : a.index < b.index; });
}

/// Facets of the stretch, and the bound of its errors.
void RowResolver::take(const ColumnSpan& span) {
  if (taken_first_ == span.first) return;
  if (!is_listed_) list_facets();
  taken_first_ = span.first;
  const auto begins = [](const RowFacet& of_row) { return of_row.first; };
  const auto begin = std::ranges::lower_bound(facet_, span.first, {}, begins);
  const auto end = std::ranges::lower_bound(begin, facet_.end(), span.end, {}, begins);
  taken_ = {begin, end};
  const double depth = static_cast<double>(strip_.y1 - strip_.y0), widest = widest_side(*slab_, depth);
  double scale = 0, columns = 0;
  for (const RowFacet& of_row : taken_) {
    scale += std::max(static_cast<double>(slab_->facets[of_row.index].size), widest);
    columns += of_row.last - of_row.first + 1;
  }
  const auto facets = static_cast<double>(taken_.size());
  // Each facet is added as up to three trapezoids in a row.
  spoilt_ =
      spoilt_share(*slab_, depth, scale, 3 * (columns + 2 * facets), std::abs(static_cast<double>(span.winding)) + facets);
  even_begin_ = even_end_ = 0;
  samples_.forget();
}

/// False if all samples have winding number 0 or 1.
bool RowResolver::resolve_lane(const OpenLanes& open_lanes, std::uint32_t lane, std::uint8_t& level) {
  const std::uint32_t column = open_lanes.column + lane;
  if (!samples_.knows(column)) {
    samples_.count(strip_, slab_->columns, slab_->edges, open_lanes.span.winding, slab_->rule.fill, slab_->facets, taken_,
                   open_lanes.span.first, open_lanes.span.end);
  }
  ++report_->inspected;
  const Samples::SampleCount& count = samples_.at(column);
  if (count.others == 0) return false;
  ++report_->sampled_voxels;
  const double voxel = slab_->edges.width(column) * strip_.area();
  report_->volume_mm3 += static_cast<double>(count.solid) / kAllSamples * voxel - open_lanes.volume[lane];
  level = static_cast<std::uint8_t>(level_of_samples(count.solid, slab_->rule.top_level));
  return true;
}

std::uint8_t RowResolver::exact(const OpenLanes& open_lanes, std::uint32_t lane) {
  const std::uint32_t column = open_lanes.column + lane;
  if (column >= even_begin_ && column < even_end_) return even_level_;
  const auto top = static_cast<double>(slab_->rule.top_level);
  const double position = open_lanes.volume[lane] / (slab_->edges.width(column) * strip_.area()) * top + 0.5;
  const double off = spoilt_ * top + 16 * kEpsilon * (std::abs(position) + top);
  const double minimum = std::floor(position - off), maximum = std::floor(position + off);
  if (minimum == maximum || maximum <= 0 || minimum >= top) return static_cast<std::uint8_t>(std::clamp(minimum, 0.0, top));
  ++report_->exact_voxels;
  const Voxel voxel{
      edge(slab_->columns, column), edge(slab_->columns, std::int64_t{column} + 1), strip_.y0, strip_.y1, strip_.z0, strip_.z1};
  const auto level = static_cast<std::uint8_t>(
      exact_level(voxel, open_lanes.span.winding, slab_->facets, taken_, column, slab_->rule.top_level));
  even_begin_ = column;
  even_end_ = open_lanes.span.end;
  even_level_ = level;
  for (const RowFacet& of_row : taken_) {
    if (slab_->facets[of_row.index].edgewise || of_row.last < column) continue;
    even_end_ = std::min(even_end_, of_row.first);  // before `column` if it is no even one
  }
  return level;
}

std::uint64_t RowResolver::decide(const OpenLanes& open_lanes, std::uint64_t levels) {
  take(open_lanes.span);
  for (std::uint32_t lane = 0; lane < kLanes; ++lane) {
    const bool is_suspect = (open_lanes.suspects >> lane & 1) != 0, is_undecided = (open_lanes.undecided >> lane & 1) != 0;
    std::uint8_t level = 0;
    const bool is_sampled = is_suspect && resolve_lane(open_lanes, lane, level);
    if (!is_sampled && !is_undecided) continue;
    if (!is_sampled) level = exact(open_lanes, lane);
    levels = (levels & ~(std::uint64_t{255} << 8 * lane)) | std::uint64_t{level} << 8 * lane;
  }
  return levels;
}

void RowResolver::free(std::int64_t winding, std::uint32_t begin, std::uint32_t end) {
  const bool solid = is_solid(slab_->rule.fill, static_cast<std::int32_t>(winding));
  const auto reported = static_cast<double>((solid ? 1 : 0) - winding);
  report_->volume_mm3 += reported * (slab_->edges[end] - slab_->edges[begin]) * strip_.area();
}

}  // namespace lamina::coverage
