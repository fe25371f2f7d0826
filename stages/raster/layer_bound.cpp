#include "stages/raster/layer_bound.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <map>
#include <utility>

namespace lamina::raster {
void CrossingSums::cover(std::int64_t lowest, std::int64_t highest) {
  std::int64_t begin = 0, end = 0;
  for (;; join_pairs()) {
    begin = lowest >> shift_, end = (highest >> shift_) + 1;
    if (slabs() > 0) begin = std::min(begin, first_), end = std::max(end, first_ + slabs());
    if (end - begin <= kMostSlabs) break;
  }
  if (slabs() == end - begin) return;
  // Some room beyond, so that a mesh that grows cluster by cluster is moved rarely.
  const std::int64_t spare = (kMostSlabs - (end - begin)) / 2, room = std::min<std::int64_t>(spare, 256);
  if (slabs() == 0 || begin < first_) begin -= room;
  if (slabs() == 0 || end > first_ + slabs()) end += room;
  std::vector<Change> wider(static_cast<std::size_t>(end - begin) + kBeyond);
  if (slabs() > 0) std::ranges::copy(change_, wider.begin() + (first_ - begin));
  change_ = std::move(wider);
  first_ = begin;
}

void CrossingSums::join_pairs() {
  const Table fine = table();
  ++shift_;
  if (fine.slab.empty()) return;
  first_ = fine.first >> 1;
  const std::int64_t last = (fine.first + static_cast<std::int64_t>(fine.slab.size()) - 1) >> 1;
  change_.assign(static_cast<std::size_t>(last - first_ + 1) + kBeyond, {});
  std::vector<Slab> joined(change_.size());
  for (std::size_t i = 0; i < fine.slab.size(); ++i) {
    Slab& slab = joined[static_cast<std::size_t>(((fine.first + static_cast<std::int64_t>(i)) >> 1) - first_)];
    slab = {std::max(slab.depth, fine.slab[i].depth), std::max(slab.segments, fine.slab[i].segments),
            std::max(slab.clusters, fine.slab[i].clusters)};
  }
  for (std::size_t i = 0; i < joined.size(); ++i) {
    const Slab below = i > 0 ? joined[i - 1] : Slab(), two_below = i > 1 ? joined[i - 2] : Slab();
    change_[i] = {joined[i].depth - 2 * below.depth + two_below.depth,
                  static_cast<std::int32_t>(joined[i].segments - below.segments),
                  static_cast<std::int32_t>(joined[i].clusters - below.clusters)};
  }
}

void CrossingSums::add(const Cluster& cluster, const Box& bounds) {
  if (bounds.height() == 0) return;
  const std::int64_t begin = bounds.lo.z >> shift_, last = bounds.hi.z >> shift_;
  if (begin < first_ || last >= first_ + slabs()) cover(bounds.lo.z, bounds.hi.z);
  Tents tents;
  raise_tents_(cluster, shift_, static_cast<std::int32_t>(first_), tents);
  for (std::uint32_t i = 0; i < kClusterSize; ++i) {
    const double up = tents.up[i], down = tents.down[i];
    Change* const from = change_.data() + tents.begin[i];
    Change* const last_slab = change_.data() + tents.last[i];
    from->bend += up;
    from->segments += tents.count[i];
    from[tents.rise[i]].bend -= up;
    (last_slab + 2 - tents.fall[i])->bend -= down;
    last_slab[1].segments -= tents.count[i];
    last_slab[2].bend += down;
  }
  ++change_[static_cast<std::size_t>((bounds.lo.z >> shift_) - first_)].clusters;
  --change_[static_cast<std::size_t>(((bounds.hi.z - 1) >> shift_) - first_) + 1].clusters;
}

void CrossingSums::merge(const CrossingSums& other) {
  if (other.slabs() == 0) return;
  CrossingSums added = other;
  const auto lowest = [&] { return added.first_ << added.shift_; };
  const auto highest = [&] { return ((added.first_ + added.slabs()) << added.shift_) - 1; };
  do {
    while (shift_ < added.shift_) join_pairs();
    cover(lowest(), highest());
    while (added.shift_ < shift_) added.join_pairs();
  } while (lowest() >> shift_ < first_ || highest() >> shift_ >= first_ + slabs());
  Change* to = change_.data() + (added.first_ - first_);
  for (const Change& change : added.change_) {
    to->bend += change.bend;
    to->segments += change.segments;
    to->clusters += change.clusters;
    ++to;
  }
}

CrossingSums::Table CrossingSums::table() const {
  Table table{shift_, first_, std::vector<Slab>(static_cast<std::size_t>(slabs()))};
  double slope = 0;
  Slab sum;
  for (std::size_t i = 0; i < table.slab.size(); ++i) {
    slope += change_[i].bend;
    sum.depth += slope;
    sum.segments += change_[i].segments;
    sum.clusters += change_[i].clusters;
    table.slab[i] = sum;
    if (sum.segments == 0) slope = sum.depth = 0;  // nothing is cut here, whatever rounding left
    table.slab[i].depth = std::max(0.0, sum.depth);
  }
  return table;
}

const CrossingSums::Slab* CrossingSums::Table::at(std::int64_t plane) const {
  const std::int64_t number = (plane >> shift) - first;
  return number < 0 || number >= static_cast<std::int64_t>(slab.size()) ? nullptr : &slab[static_cast<std::size_t>(number)];
}

void CrossingSums::Table::fit(std::size_t most) {
  const auto holds = [](const Slab& one) { return one.depth > 0 || one.segments != 0 || one.clusters != 0; };
  while (!slab.empty() && !holds(slab.back())) slab.pop_back();
  const auto lowest = std::find_if(slab.begin(), slab.end(), holds);
  first += lowest - slab.begin();
  slab.erase(slab.begin(), lowest);
  for (; slab.size() > most; ++shift) {
    const std::int64_t begin = first >> 1, last = (first + static_cast<std::int64_t>(slab.size()) - 1) >> 1;
    for (std::size_t i = 0; i < slab.size(); ++i) {
      const std::int64_t number = first + static_cast<std::int64_t>(i);
      Slab& to = slab[static_cast<std::size_t>((number >> 1) - begin)];  // never behind slab i
      const Slab from = slab[i];
      const bool is_first = i == 0 || number % 2 == 0;
      to = is_first ? from
                    : Slab{std::max(to.depth, from.depth), std::max(to.segments, from.segments),
                           std::max(to.clusters, from.clusters)};
    }
    slab.resize(static_cast<std::size_t>(last - begin + 1));
    first = begin;
  }
  slab.shrink_to_fit();
}

CrossingSums sum_crossings(const ClusteredMesh& mesh, Isa isa) {
  using Range = tbb::blocked_range<std::uint32_t>;
  constexpr std::uint32_t kTogether = 1024;  // clusters
  const Range clusters(0, mesh.cluster_count(), kTogether);
  const auto add = [&](const Range& range, CrossingSums& to) {
    Cluster room;
    for (std::uint32_t c = range.begin(); c != range.end(); ++c) to.add(mesh.cluster(c, room), mesh.bounds[c]);
  };
  CrossingSums all(isa);
  if (clusters.size() <= kTogether) {
    add(clusters, all);
    return all;
  }
  tbb::enumerable_thread_specific<CrossingSums> sums([isa] { return CrossingSums(isa); });
  tbb::parallel_for(clusters, [&](const Range& range) { add(range, sums.local()); });
  for (const CrossingSums& one_thread : sums) all.merge(one_thread);
  return all;
}

std::vector<CrossingSums::Table> crossing_tables(std::span<const ClusteredMesh> meshes, Isa isa) {
  std::vector<CrossingSums::Table> tables(meshes.size());
  tbb::parallel_for(std::size_t{0}, meshes.size(), [&](std::size_t i) {
    tables[i] = sum_crossings(meshes[i], isa).table();
    tables[i].fit(most_slabs_of(meshes[i].cluster_count()));
  });
  return tables;
}

LayerBound::LayerBound(std::span<const PlacedMesh> placed, std::span<const ClusteredMesh> meshes,
                       std::vector<CrossingSums::Table> tables, const PixelGrid& grid)
    : rows_per_nm_(grid.y.pixels_per_nm()), tables_(std::move(tables)) {
  std::map<std::pair<std::uint32_t, Nm>, std::uint64_t> count;
  for (const PlacedMesh& one : placed) ++count[{static_cast<std::uint32_t>(one.mesh - meshes.data()), one.offset.z}];
  for (const auto& [key, copies] : count) copies_.push_back({key.first, key.second, copies});
}

LayerBound::Count LayerBound::of(const CrossingSums::Slab& slab, std::uint64_t copies) const {
  // A cut of n rows' depth crosses less than n + 1 of them. Sums in double are known to far better than a millionth.
  const auto segments = static_cast<std::uint64_t>(slab.segments);
  const auto rows = static_cast<std::uint64_t>(slab.depth * rows_per_nm_ * (1 + 1e-6)) + 1;
  return {segments * copies, segments == 0 ? 0 : (rows + segments) * copies,
          static_cast<std::uint64_t>(slab.clusters) * copies};
}

LayerBound::Count LayerBound::at(Nm plane) const {
  Count total;
  for (const Copies& one : copies_) {
    const CrossingSums::Slab* slab = tables_[one.table].at(std::int64_t{plane} - one.lift);
    if (slab == nullptr) continue;
    const Count count = of(*slab, one.count);
    total = {total.segments + count.segments, total.crossings + count.crossings, total.clusters + count.clusters};
  }
  return total;
}

std::uint64_t LayerBound::most_crossings() const {
  std::uint64_t total = 0;
  for (const Copies& one : copies_) {
    std::uint64_t most = 0;
    for (const CrossingSums::Slab& slab : tables_[one.table].slab) most = std::max(most, of(slab, one.count).crossings);
    total += most;
  }
  return total;
}

std::uint64_t LayerBound::bytes() const {
  std::uint64_t total = tables_.capacity() * sizeof(CrossingSums::Table) + copies_.capacity() * sizeof(Copies);
  for (const CrossingSums::Table& table : tables_) total += table.slab.capacity() * sizeof(CrossingSums::Slab);
  return total;
}

}  // namespace lamina::raster
