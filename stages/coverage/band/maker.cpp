#include "stages/coverage/band/maker.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "stages/coverage/band/exact.h"
#include "stages/coverage/coverage.h"

namespace lamina::coverage {
namespace {

// --- samples.

using Wide = __int128;

/// Samples along a side of a voxel.
constexpr std::int64_t kSamples = 8;
constexpr std::uint32_t kAllSamples = kSamples * kSamples * kSamples;

/// Sixteenths of a nanometre: there every sample is whole.
constexpr std::int64_t kParts = 2 * kSamples;

std::int64_t sample_position(std::int64_t begin, std::int64_t end, std::int64_t k) {
  return kParts * begin + (2 * k + 1) * (end - begin);
}

struct SamplePoint {
  std::int64_t x, y, z;  // sixteenths
};

SamplePoint position(const Point3& p) { return {kParts * p.x, kParts * p.y, kParts * p.z}; }

/// Whether the edge meets height z at or before y; exactly one of its ends is above z.
bool meets_before(const SamplePoint& p, const SamplePoint& q, std::int64_t y, std::int64_t z) {
  const SamplePoint &low = p.z <= z ? p : q, &high = p.z <= z ? q : p;
  return static_cast<Wide>(high.y - low.y) * (z - low.z) <= static_cast<Wide>(y - low.y) * (high.z - low.z);
}

/// The level of `solid` samples of a voxel.
constexpr std::uint32_t level_of_samples(std::uint32_t solid, std::uint32_t top_level) {
  return (2 * solid * top_level + kAllSamples) / (2 * kAllSamples);
}

// --- bounds of errors.

/// Half a unit in the last bit of 1.
constexpr double kEpsilon = 0x1p-53;

/// Roundings of a facet's corners and volumes together, and more (docs/theory/coverage.md counts 190).
constexpr double kRoundings = 512;

constexpr std::uint32_t kNoSpan = UINT32_MAX;

double widest_side(const BandSlab& slab, double depth) { return std::max({slab.edges.widest(), depth, slab.sides.z}); }

/// Bound of errors of shares in an interval of columns (docs/theory/coverage.md).
/// depth  of the row, nm
/// scale  sum over facets of the longer of a facet's size and the widest side of a voxel, nm
/// added  numbers that are added up; maximum  what their sum is below, in sections of the row
double spoilt_share(const BandSlab& slab, double depth, double scale, double added, double maximum) {
  const double height = slab.sides.z;
  const double margin = slab.edges.widest() * (depth + height) + depth * height;
  return kRoundings * kEpsilon * margin / (slab.edges.narrowest() * depth * height) * scale + 2 * kEpsilon * added * maximum;
}

// ---

/// A facet's piece in the layer has up to five corners, and one trapezoid less.
constexpr std::uint64_t kMaxPieces = 4;
constexpr std::size_t kExtraCapacity = 64;

}  // namespace

void Samples::cross(const BandSlab& slab, const Strip& strip, const Triangle& facet) {
  const SamplePoint a = position(facet.a), b = position(facet.b), c = position(facet.c);
  const Point3 &p = facet.a, &q = facet.b, &r = facet.c;
  const std::int64_t ux = std::int64_t{q.x} - p.x, uy = std::int64_t{q.y} - p.y, uz = std::int64_t{q.z} - p.z;
  const std::int64_t vx = std::int64_t{r.x} - p.x, vy = std::int64_t{r.y} - p.y, vz = std::int64_t{r.z} - p.z;
  const std::int64_t nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
  for (std::int64_t l = 0; l < kSamples; ++l) {
    const std::int64_t z = sample_position(strip.z0, strip.z1, l);
    const bool low_a = a.z <= z, low_b = b.z <= z, low_c = c.z <= z;
    if (low_a == low_b && low_b == low_c) continue;
    const bool alone_b = low_b != low_a && low_b != low_c, alone_c = low_c != low_a && low_c != low_b;
    const SamplePoint& alone = alone_b ? b : alone_c ? c : a;
    const SamplePoint& one = alone_b ? c : alone_c ? a : b;
    const SamplePoint& other = alone_b ? a : alone_c ? b : c;
    for (std::int64_t k = 0; k < kSamples; ++k) {
      const std::int64_t y = sample_position(strip.y0, strip.y1, k);
      if (meets_before(alone, one, y, z) == meets_before(alone, other, y, z)) continue;
      if (nx == 0) continue;
      // x = a.x - (ny (y - a.y) + nz (z - a.z)) / nx; the first whole sixteenth at or beyond it.
      Wide fall = static_cast<Wide>(ny) * (y - a.y) + static_cast<Wide>(nz) * (z - a.z);
      fall = nx < 0 ? -fall : fall;
      const Wide divisor = nx < 0 ? -static_cast<Wide>(nx) : static_cast<Wide>(nx);
      const auto x = a.x - static_cast<std::int64_t>(floor_div(fall, divisor));
      std::uint32_t column = slab.edges.at(static_cast<double>(x) / kParts);
      std::int64_t s = 0;
      const std::int64_t begin = edge(slab.columns, column), end = edge(slab.columns, column + 1);
      while (s < kSamples && sample_position(begin, end, s) < x) ++s;
      const std::int64_t sample = (std::int64_t{column} - first_) * kSamples + s;
      crossing_.push_back({static_cast<std::uint32_t>(l * kSamples + k), nx < 0 ? 1 : -1,
                           static_cast<std::uint64_t>(std::max<std::int64_t>(sample, 0))});
    }
  }
}

void Samples::count(const BandSlab& slab, const Strip& strip, const ColumnSpan& span, std::span<const RowFacet> taken) {
  first_ = span.first;
  end_ = span.end;
  crossing_.clear();
  count_.assign(end_ - first_, {});
  for (const RowFacet& of_row : taken) {
    const SlabFacet& facet = slab.facets[of_row.index];
    if (!facet.edgewise) cross(slab, strip, facet.facet);
  }
  std::sort(crossing_.begin(), crossing_.end());
  const FillRule fill = slab.rule.fill;
  const auto add = [&](SampleCount& count, std::int64_t wound, std::uint64_t samples) {
    if (is_solid(fill, static_cast<std::int32_t>(wound))) count.solid = static_cast<std::uint16_t>(count.solid + samples);
    if (wound < 0 || wound > 1) count.others = static_cast<std::uint16_t>(count.others + samples);
  };
  const std::uint64_t samples = std::uint64_t{end_ - first_} * kSamples;
  std::size_t next = 0;
  for (std::uint32_t line = 0; line < kSamples * kSamples; ++line) {
    std::int64_t wound = span.winding;
    std::uint64_t at = 0;
    while (at < samples) {
      for (; next < crossing_.size() && crossing_[next].line == line && crossing_[next].sample <= at; ++next) {
        wound += crossing_[next].sign;
      }
      const bool more = next < crossing_.size() && crossing_[next].line == line;
      const std::uint64_t stop = more ? std::min(samples, crossing_[next].sample) : samples;
      while (at < stop) {
        const std::uint64_t column_end = std::min(stop, (at / kSamples + 1) * kSamples);
        add(count_[at / kSamples], wound, column_end - at);
        at = column_end;
      }
    }
    while (next < crossing_.size() && crossing_[next].line == line) ++next;
  }
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

/// Facets of the span, and the bound of its errors.
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
  next_ = 0;
  near_.clear();
  samples_.forget();
}

/// False if all samples have winding number 0 or 1.
bool RowResolver::resolve_lane(const OpenLanes& open_lanes, std::uint32_t lane, std::uint8_t& level) {
  const std::uint32_t column = open_lanes.column + lane;
  if (!samples_.knows(column)) samples_.count(*slab_, strip_, open_lanes.span, taken_);
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
  return resolve(open_lanes.span, column, {(position - 0.5) / top, off / top, slab_->rule.top_level});
}

/// The level by the facets that reach the column, and how far it continues.
std::uint8_t RowResolver::resolve(const ColumnSpan& span, std::uint32_t column, const NearShare& near_share) {
  for (; next_ < taken_.size() && taken_[next_].first <= column; ++next_) near_.push_back(taken_[next_]);
  std::erase_if(near_, [&](const RowFacet& of_row) { return of_row.last < column; });
  near_facets_.clear();
  for (const RowFacet& of_row : near_) near_facets_.push_back(&slab_->facets[of_row.index]);
  const Voxel voxel{
      edge(slab_->columns, column), edge(slab_->columns, std::int64_t{column} + 1), strip_.y0, strip_.y1, strip_.z0, strip_.z1};
  const ExactLevel exact = exact_level(voxel, near_facets_, near_share);
  even_begin_ = even_end_ = column;
  even_level_ = exact.level;
  const auto ends = [&](const RowFacet& of_row) {
    return !splits_no_more(slab_->facets[of_row.index], exact.plane, voxel);
  };
  if (!exact.continues || std::ranges::any_of(near_, [&](const RowFacet& of_row) { return of_row.last > column && ends(of_row); }))
    return exact.level;
  even_end_ = span.end;
  for (std::size_t i = next_; i < taken_.size() && even_end_ == span.end; ++i) {
    if (ends(taken_[i])) even_end_ = taken_[i].first;
  }
  return exact.level;
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

std::uint64_t BandMaker::bytes_of(std::uint64_t facets, std::uint32_t columns) {
  // Rows list facets where doubles do not decide, and lists double as they grow.
  const std::uint64_t pieces = kMaxPieces * facets, slack = pieces + pieces / 8 + 2 * kExtraCapacity;
  return slack * (sizeof(Trapezoid) + sizeof(ColumnReach)) + 2 * pieces * sizeof(RowFacet) + BandCells::bytes_of(columns) +
         (std::uint64_t{columns} + 1 + kLanes) * (sizeof(std::uint32_t) + sizeof(std::uint8_t));
}

void BandMaker::start(const BandSlab& slab, Isa isa) {
  kernels_ = &band_kernels_for(isa);
  cells_.start(slab.edges.count());
  active_.clear();
  column_.resize(std::size_t{slab.edges.count()} + 1 + kLanes);
  level_.resize(std::size_t{slab.edges.count()} + 1 + kLanes);
}

void BandMaker::enter(const SlabFacet& facet, std::uint32_t index, const Edges& rows) {
  if (active_.size() + kMaxPieces > active_.capacity()) active_.reserve(active_.size() + active_.size() / 8 + kExtraCapacity);
  cut_trapezoids(facet, index, rows, active_);
}

/// All that reaches the band goes into its cells.
void BandMaker::deposit(const BandSlab& slab, BandSums& sums) {
  sums = {};
  ensure_capacity(reach_, active_.size());
  reach_.resize(active_.size());
  const std::uint32_t last = rows_.first + rows_.count - 1;
  for (std::size_t i = 0; i < active_.size(); ++i) {
    const Trapezoid& piece = active_[i];
    if (piece.first_row > last || piece.last_row < rows_.first) continue;
    kernels_->deposit(piece, rows_, slab.edges, cells_, reach_[i], sums);
  }
}

/// Runs between changes; those of level 0 are none.
void BandMaker::append(const Changes& changes, std::uint32_t columns, Levels& out) const {
  const std::size_t before = out.level.size(), maximum = before + changes.count;
  if (out.level.capacity() < maximum) {
    out.level.reserve(2 * maximum);
    out.change.reserve(4 * maximum);
  }
  out.level.resize(maximum);
  out.change.resize(2 * maximum);
  changes.column[changes.count] = columns;
  std::uint32_t* change = out.change.data() + 2 * before;
  std::uint8_t* level = out.level.data() + before;
  for (std::uint32_t i = 0; i < changes.count; ++i) {
    change[0] = changes.column[i];
    change[1] = changes.column[i + 1];
    *level = changes.level[i];
    const std::size_t taken = changes.level[i] != 0 ? 1 : 0;
    change += 2 * taken;
    level += taken;
  }
  out.level.resize(static_cast<std::size_t>(level - out.level.data()));
  out.change.resize(2 * out.level.size());
  out.end_row();
}

RowTask BandMaker::task(const BandSlab& slab, std::uint32_t lane, const BandSums& sums) {
  const double depth = rows_.y[lane + 1] - rows_.y[lane], area = depth * slab.sides.z, count = sums.count[lane];
  const double scale = sums.size[lane] + count * widest_side(slab, depth), added = sums.columns[lane] + 2 * count;
  const ColumnMarks suspect = cells_.suspect(lane);
  return {.edges = slab.edges.data(),
          .columns = slab.edges.count(),
          .fill = slab.rule.fill,
          .area = area,
          .widest = slab.edges.widest(),
          .per_widest = slab.rule.top_level / (slab.edges.widest() * area),
          .per_narrowest = slab.rule.top_level / (slab.edges.narrowest() * area),
          .top = static_cast<double>(slab.rule.top_level),
          .spoilt = spoilt_share(slab, depth, scale, added, count),
          .partial = cells_.partial(lane),
          .passed = cells_.passed(lane),
          .held = cells_.held(lane),
          .suspect = suspect,
          .has_suspects = suspect.next(0) != ColumnMarks::kNone,
          .resolver = &resolver_};
}

void BandMaker::make(const BandSlab& slab, std::uint32_t first, std::uint32_t rows, Levels& out, CoverageReport& report) {
  rows_.first = first;
  rows_.count = rows;
  for (std::uint32_t i = 0; i <= kBandRows; ++i) {
    rows_.y[i] = static_cast<double>(edge(slab.rows, std::int64_t{first} + std::min(i, rows)));
  }
  BandSums sums;
  deposit(slab, sums);
  for (std::uint32_t lane = rows; lane-- > 0;) {
    Changes changes{column_.data(), level_.data()};
    if (sums.count[lane] > 0) {
      resolver_.start(slab, {active_, reach_}, first + lane, first, report);
      const RowTask row = task(slab, lane, sums);
      kernels_->sweep(row, changes);
      report.held_voxels += changes.held;
      row.held.clear();
      if (row.has_suspects) row.suspect.clear();
    }
    append(changes, slab.edges.count(), out);
  }
  std::erase_if(active_, [&](const Trapezoid& piece) { return piece.first_row >= first; });
}

}  // namespace lamina::coverage
