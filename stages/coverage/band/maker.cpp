#include "stages/coverage/band/maker.h"

#include "stages/coverage/coverage.h"
#include "stages/coverage/edges.h"

namespace lamina::coverage {
namespace {

/// A facet's piece in the layer has five corners at most, and one trapezoid less.
constexpr std::uint64_t kMaxPieces = 4;
constexpr std::size_t kExtraCapacity = 64;

}  // namespace

std::uint64_t BandMaker::bytes_of(std::uint64_t facets, std::uint32_t columns) {
  // Rows list facets where doubles do not decide, and double their room.
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
