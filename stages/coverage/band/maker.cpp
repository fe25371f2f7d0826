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

void Samples::count(const BandSlab& slab, const Strip& strip, const LineSpan& span, std::span<const RowFacet> taken) {
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
  facet_.clear();
}

/// A facet that several trapezoids of the row are of is listed once.
void RowResolver::list_facets() {
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
void RowResolver::take(const ColumnSpan& span, std::uint32_t lane) {
  span_ = {span.first, span.end, span.winding[lane]};
  const auto begins = [](const RowFacet& of_row) { return of_row.first; };
  const auto begin = std::ranges::lower_bound(facet_, span.first, {}, begins);
  const auto end = std::ranges::lower_bound(begin, facet_.end(), span.end, {}, begins);
  taken_ = {begin, end};
  const double depth = static_cast<double>(strip_.y1 - strip_.y0), widest = widest_side(*slab_, depth);
  double scale = 0;
  for (const RowFacet& of_row : taken_) scale += std::max(static_cast<double>(slab_->facets[of_row.index].size), widest);
  const auto facets = static_cast<double>(taken_.size());
  // Each facet is added as up to three trapezoids in a row, to no more columns than the span has.
  spoilt_ = spoilt_share(*slab_, depth, scale, 3 * facets * (span.end - span.first + 2.0),
                         std::abs(static_cast<double>(span_.winding)) + facets);
  next_ = 0;
  near_.clear();
  even_ = false;
  samples_.forget();
}

/// Finds the facets that reach the column.
void RowResolver::approach(std::uint32_t column) {
  std::size_t changes = next_;
  for (; next_ < taken_.size() && taken_[next_].first <= column; ++next_) near_.push_back(taken_[next_]);
  changes = next_ - changes + std::erase_if(near_, [&](const RowFacet& of_row) { return of_row.last < column; });
  if (changes != 0) even_ = false;
}

/// False if all samples have winding number 0 or 1.
bool RowResolver::count_samples(const OpenColumns& open, double share, std::uint8_t& level) {
  if (!samples_.knows(open.first)) samples_.count(*slab_, strip_, span_, taken_);
  ++report_->inspected;
  const Samples::SampleCount& count = samples_.at(open.first);
  if (count.others == 0) return false;
  report_->sampled_voxels += open.end - open.first;
  const double width = slab_->edges[open.end] - slab_->edges[open.first];
  report_->volume_mm3 += (static_cast<double>(count.solid) / kAllSamples - share) * width * strip_.area();
  level = static_cast<std::uint8_t>(level_of_samples(count.solid, slab_->rule.top_level));
  return true;
}

std::uint8_t RowResolver::exact(std::uint32_t column, double share) {
  if (even_) return even_level_;
  const auto top = static_cast<double>(slab_->rule.top_level);
  const double position = share * top + 0.5;
  const double off = spoilt_ * top + 16 * kEpsilon * (std::abs(position) + top);
  const double minimum = std::floor(position - off), maximum = std::floor(position + off);
  if (minimum == maximum || maximum <= 0 || minimum >= top) return static_cast<std::uint8_t>(std::clamp(minimum, 0.0, top));
  ++report_->exact_voxels;
  near_facets_.clear();
  for (const RowFacet& of_row : near_) near_facets_.push_back(&slab_->facets[of_row.index]);
  const Voxel voxel{
      edge(slab_->columns, column), edge(slab_->columns, std::int64_t{column} + 1), strip_.y0, strip_.y1, strip_.z0, strip_.z1};
  even_level_ = static_cast<std::uint8_t>(exact_level(voxel, near_facets_, {share, off / top, slab_->rule.top_level}));
  even_ = std::ranges::all_of(near_facets_, [](const SlabFacet* facet) { return facet->edgewise; });
  return even_level_;
}

void RowResolver::decide(SweptBand& swept) {
  const std::uint32_t lane = row_ - first_row_;
  std::uint32_t span = UINT32_MAX;
  for (const OpenColumns& open : swept.open) {
    const bool is_undecided = (open.undecided >> lane & 1) != 0;
    bool is_suspect = (open.outside >> lane & 1) != 0;
    if (!is_undecided && !is_suspect && !open.suspect) continue;
    if (span == UINT32_MAX) list_facets();
    if (span != open.span) take(swept.span[open.span], lane);
    span = open.span;
    approach(open.first);
    is_suspect |=
        open.suspect && std::ranges::any_of(near_, [&](const RowFacet& of_row) { return slab_->facets[of_row.index].suspect; });
    std::uint8_t level = 0;
    const bool is_sampled = is_suspect && count_samples(open, open.share[lane], level);
    if (!is_sampled && !is_undecided) continue;
    if (!is_sampled) level = exact(open.first, open.share[lane]);
    std::uint64_t& levels = swept.level[open.first];
    levels = (levels & ~(std::uint64_t{255} << 8 * lane)) | std::uint64_t{level} << 8 * lane;
  }
}

std::uint64_t RowResolver::count_held() {
  list_facets();
  std::uint64_t held = 0;
  std::uint32_t end = 0;
  for (const RowFacet& of_row : facet_) {
    if (of_row.last >= end) held += of_row.last + 1 - std::max(end, of_row.first);
    end = std::max(end, of_row.last + 1);
  }
  facet_.clear();
  return held;
}

void RowResolver::add_free(const SweptBand& swept) {
  const std::uint32_t lane = row_ - first_row_;
  for (std::size_t i = 1; i < swept.span.size(); ++i) {
    const std::int32_t winding = swept.span[i].winding[lane];
    if (winding == 0 || winding == 1) continue;
    const auto reported = static_cast<double>((is_solid(slab_->rule.fill, winding) ? 1 : 0) - winding);
    const std::uint32_t end = std::min(swept.span[i].first, slab_->edges.count());
    report_->volume_mm3 += reported * (slab_->edges[end] - slab_->edges[swept.span[i - 1].end]) * strip_.area();
  }
}

std::uint64_t BandMaker::bytes_of(std::uint64_t facets, std::uint32_t columns) {
  // Rows list facets where doubles do not decide, and lists double as they grow.
  const std::uint64_t pieces = kMaxPieces * facets, slack = pieces + pieces / 8 + 2 * kExtraCapacity;
  const std::uint64_t of_columns = std::uint64_t{columns} + 1 + kLanes;
  const std::uint64_t swept = sizeof(std::uint64_t) + sizeof(LevelSegment) + sizeof(ColumnSpan) / 2 + sizeof(OpenColumns);
  return slack * (sizeof(Trapezoid) + sizeof(ColumnReach)) + 2 * pieces * sizeof(RowFacet) + BandCells::bytes_of(columns) +
         of_columns * (kBandRows * (sizeof(std::uint32_t) + sizeof(std::uint8_t)) + swept);
}

void BandMaker::start(const BandSlab& slab, Isa isa, bool counts_held) {
  counts_held_ = counts_held;
  kernels_ = &band_kernels_for(isa);
  cells_.start(slab.edges.count());
  active_.clear();
  const std::size_t columns = std::size_t{slab.edges.count()} + 1 + kLanes;
  column_.resize(kBandRows * columns);
  level_.resize(kBandRows * columns);
}

void BandMaker::enter(const SlabFacet& facet, std::uint32_t index, const Edges& rows, std::span<const Trapezoid> pieces) {
  if (active_.size() + kMaxPieces > active_.capacity()) active_.reserve(active_.size() + active_.size() / 8 + kExtraCapacity);
  if (pieces.empty()) return cut_trapezoids(facet, index, rows, active_);
  for (const Trapezoid& piece : pieces) {
    active_.push_back(piece);
    Trapezoid& moved = active_.back();
    moved.from_x = facet.low.x, moved.from_y = facet.low.y;
    moved.facet = index;
    moved.suspect = facet.suspect;
    moved.find_rows(rows);
  }
}

/// All that reaches the band goes into its cells.
void BandMaker::deposit(const BandSlab& slab, BandSums& sums) {
  sums = {};
  faces_ = {};
  ensure_capacity(reach_, active_.size());
  reach_.resize(active_.size());
  const std::uint32_t last = rows_.first + rows_.count - 1;
  for (std::size_t i = 0; i < active_.size(); ++i) {
    const Trapezoid& piece = active_[i];
    if (piece.first_row > last || piece.last_row < rows_.first) continue;
    if (piece.level) faces_.add(slab.facets[piece.facet].facet.a.z);
    kernels_->deposit(piece, rows_, slab.edges, cells_, reach_[i], sums);
  }
}

/// Runs between changes; those of level 0 are none.
void BandMaker::append(Changes changes, std::uint32_t columns, Levels& out) const {
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

BandTask BandMaker::task(const BandSlab& slab, const BandSums& sums) {
  BandTask band{.columns = slab.edges.count(),
                .rows = rows_.count,
                .fill = slab.rule.fill,
                .area = {},
                .per_area = {},
                .off = {},
                .top = static_cast<double>(slab.rule.top_level),
                .cells = &cells_};
  for (std::uint32_t lane = 0; lane < rows_.count; ++lane) {
    const double depth = rows_.y[lane + 1] - rows_.y[lane], count = sums.count[lane];
    const double scale = sums.size[lane] + count * widest_side(slab, depth), added = sums.columns[lane] + 2 * count;
    band.area[lane] = depth * slab.sides.z;
    band.per_area[lane] = 1 / band.area[lane];
    band.off[lane] = band.top * (spoilt_share(slab, depth, scale, added, count) + 16 * kEpsilon * (count + 3));
  }
  return band;
}

/// Whether doubles may not decide what horizontal facets of one height split: cells then get rows of other facets.
void BandMaker::find_ties(const BandSlab& slab, BandTask& task) {
  if (faces_.heights != 1) return;
  task.faces = levels_of_height(faces_.z, slab.bottom, slab.top, slab.rule.top_level);
  const double off = std::ranges::max(task.off) + 16 * kEpsilon * task.top;
  task.has_ties = std::ranges::any_of(task.faces.share, [&](double share) {
    const double position = share * task.top + 0.5;
    return std::abs(position - std::round(position)) <= off;
  });
  if (!task.has_ties) return;
  std::ranges::transform(task.off, task.face_off.begin(), [&](double of_level) { return of_level / task.top + 0x1p-50; });
  cells_.clear_sloped();
  const std::uint32_t first = rows_.first, last = first + rows_.count - 1;
  for (std::size_t i = 0; i < active_.size(); ++i) {
    const Trapezoid& piece = active_[i];
    if (piece.level || piece.first_row > last || piece.last_row < first) continue;
    const std::uint32_t end = std::min(piece.last_row, last) - first;
    for (std::uint32_t lane = std::max(piece.first_row, first) - first; lane <= end; ++lane)
      cells_.mark_sloped(lane, reach_[i].first[lane], reach_[i].last[lane]);
  }
}

/// What doubles do not decide, row by row.
void BandMaker::resolve(const BandSlab& slab, CoverageReport& report) {
  report.exact_voxels += swept_.face_voxels;
  if (swept_.open.empty() && !swept_.winds && !counts_held_) return;
  for (std::uint32_t lane = rows_.count; lane-- > 0;) {
    resolver_.start(slab, {active_, reach_}, rows_.first + lane, rows_.first, report);
    if (counts_held_) report.held_voxels += resolver_.count_held();
    resolver_.decide(swept_);
    if (swept_.winds) resolver_.add_free(swept_);
  }
}

void BandMaker::make(const BandSlab& slab, std::uint32_t first, std::uint32_t rows, Levels& out, CoverageReport& report) {
  rows_.first = first;
  rows_.count = rows;
  for (std::uint32_t i = 0; i <= kBandRows; ++i) {
    rows_.y[i] = static_cast<double>(edge(slab.rows, std::int64_t{first} + std::min(i, rows)));
  }
  BandSums sums;
  deposit(slab, sums);
  const std::uint32_t columns = slab.edges.count();
  swept_.start(columns);
  BandTask band = task(slab, sums);
  find_ties(slab, band);
  kernels_->sweep(band, swept_);
  resolve(slab, report);
  for (const ColumnMarks& marks : {cells_.held(), cells_.summed(), cells_.suspect()}) marks.clear();
  std::array<Changes, kBandRows> changes;
  for (std::uint32_t lane = 0; lane < kBandRows; ++lane) {
    const std::size_t at = std::size_t{lane} * (columns + 1 + kLanes);
    changes[lane] = {column_.data() + at, level_.data() + at};
  }
  kernels_->split(swept_, changes.data());
  for (std::uint32_t lane = rows; lane-- > 0;) append(changes[lane], columns, out);
  std::erase_if(active_, [&](const Trapezoid& piece) { return piece.first_row >= first; });
}

}  // namespace lamina::coverage
