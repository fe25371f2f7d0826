#include "stages/raster/layer_bound.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <utility>

namespace lamina::raster {

CrossingSums::CrossingSums(Nm lowest, Nm highest, std::size_t maximum, Isa isa) : kernels_(kernels_for(limited_isa(isa))) {
  const auto slabs_between = [&] { return (std::int64_t{highest} >> shift_) - (lowest >> shift_) + 1; };
  while (slabs_between() > static_cast<std::int64_t>(maximum)) ++shift_;
  first_ = lowest >> shift_;
  bend_.resize(static_cast<std::size_t>(slabs_between()) + kBeyond);
  segments_.resize(bend_.size());
  clusters_.resize(bend_.size());
}

void CrossingSums::add(const ClusteredMesh& mesh, std::uint32_t cluster) {
  const Box& bounds = mesh.bounds[cluster];
  if (bounds.height() == 0) return;
  Sides sides;
  const MeshBlocks::Indexed indexed = mesh.blocks->indexed(cluster);
  if (indexed.cluster != nullptr) {
    kernels_.load_sides(*indexed.cluster, indexed.vertex, sides);
  } else {
    const Cluster& listed = mesh.blocks->listed(cluster);
    std::memcpy(sides.z, listed.z, sizeof sides.z);
    std::memcpy(sides.y, listed.y, sizeof sides.y);
  }
  Tents tents;
  kernels_.raise_tents(sides, shift_, first_, tents);
  double* const bend = bend_.data();
  std::int32_t* const segments = segments_.data();
  for (std::uint32_t i = 0; i < kClusterSize; ++i) {
    const double up = tents.up[i], down = tents.down[i];
    bend[tents.begin[i]] += up;
    bend[tents.top[i]] -= up;
    bend[tents.fall[i]] -= down;
    bend[tents.end[i] + 1] += down;
    segments[tents.begin[i]] += tents.count[i];
    segments[tents.end[i]] -= tents.count[i];
  }
  ++clusters_[static_cast<std::size_t>((bounds.lo.z >> shift_) - first_)];
  --clusters_[static_cast<std::size_t>(((bounds.hi.z - 1) >> shift_) - first_) + 1];
}

void CrossingSums::merge(const CrossingSums& other) {
  for (std::size_t i = 0; i < bend_.size(); ++i) {
    bend_[i] += other.bend_[i];
    segments_[i] += other.segments_[i];
    clusters_[i] += other.clusters_[i];
  }
}

CrossingSums::Table CrossingSums::table() const {
  Table table{shift_, first_, std::vector<Slab>(bend_.size() - kBeyond)};
  double slope = 0;
  Slab sum;
  for (std::size_t i = 0; i < table.slab.size(); ++i) {
    slope += bend_[i];
    sum.depth += slope;
    sum.segments += segments_[i];
    sum.clusters += clusters_[i];
    table.slab[i] = sum;
    const bool empty = sum.segments == 0, was_empty = i > 0 && table.slab[i - 1].segments == 0;
    if (empty && was_empty) slope = sum.depth = 0;  // clears rounding errors; the last bend lies one slab above an end
    table.slab[i].depth = empty ? 0 : std::max(0.0, sum.depth);
  }
  return table;
}

const CrossingSums::Slab* CrossingSums::Table::at(std::int64_t plane) const {
  const std::int64_t number = (plane >> shift) - first;
  return number < 0 || number >= static_cast<std::int64_t>(slab.size()) ? nullptr : &slab[static_cast<std::size_t>(number)];
}

void CrossingSums::Table::fit(std::size_t maximum) {
  const auto holds = [](const Slab& one) { return one.depth > 0 || one.segments != 0 || one.clusters != 0; };
  while (!slab.empty() && !holds(slab.back())) slab.pop_back();
  const auto lowest = std::find_if(slab.begin(), slab.end(), holds);
  first += lowest - slab.begin();
  slab.erase(slab.begin(), lowest);
  for (; slab.size() > maximum; ++shift) {
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

namespace {

using Clusters = tbb::blocked_range<std::uint32_t>;

/// Around all clusters.
Box box_of(const ClusteredMesh& mesh) {
  const auto add = [&](const Clusters& range, Box sum) {
    for (std::uint32_t c = range.begin(); c != range.end(); ++c) sum.add(mesh.bounds[c]);
    return sum;
  };
  const auto join = [](Box a, const Box& b) {
    a.add(b);
    return a;
  };
  constexpr std::uint32_t kTogether = 16384;
  return tbb::parallel_reduce(Clusters(0, mesh.cluster_count(), kTogether), Box(), add, join);
}

}  // namespace

CrossingSums sum_crossings(const ClusteredMesh& mesh, Isa isa) {
  if (mesh.cluster_count() == 0) return {0, 0, 1, isa};
  constexpr std::uint32_t kTogether = 1024;  // clusters
  constexpr std::size_t kFiner = 16;         // times as many slabs as are kept
  const Box box = box_of(mesh);
  const std::size_t maximum = std::min(CrossingSums::kMaxSlabs, kFiner * max_slabs_of(mesh.cluster_count()));
  const Clusters clusters(0, mesh.cluster_count(), kTogether);
  const auto add = [&](const Clusters& range, CrossingSums& to) {
    for (std::uint32_t c = range.begin(); c != range.end(); ++c) to.add(mesh, c);
  };
  CrossingSums all(box.lo.z, box.hi.z, maximum, isa);
  if (clusters.size() <= kTogether) {
    add(clusters, all);
    return all;
  }
  tbb::enumerable_thread_specific<CrossingSums> sums(all);
  tbb::parallel_for(clusters, [&](const Clusters& range) { add(range, sums.local()); });
  for (const CrossingSums& one_thread : sums) all.merge(one_thread);
  return all;
}

std::vector<CrossingSums::Table> crossing_tables(std::span<const ClusteredMesh> meshes, Isa isa) {
  std::vector<CrossingSums::Table> tables(meshes.size());
  tbb::parallel_for(std::size_t{0}, meshes.size(), [&](std::size_t i) {
    tables[i] = sum_crossings(meshes[i], isa).table();
    tables[i].fit(max_slabs_of(meshes[i].cluster_count()));
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

LayerBound::CrossingCount LayerBound::of(const CrossingSums::Slab& slab, std::uint64_t copies) const {
  // A cut of n rows' depth crosses less than n + 1 of them. Sums in double are known to far better than a millionth.
  const auto segments = static_cast<std::uint64_t>(slab.segments);
  const auto rows = static_cast<std::uint64_t>(slab.depth * rows_per_nm_ * (1 + 1e-6)) + 1;
  return {segments * copies, segments == 0 ? 0 : (rows + segments) * copies,
          static_cast<std::uint64_t>(slab.clusters) * copies};
}

LayerBound::CrossingCount LayerBound::at(Nm plane) const {
  CrossingCount total;
  for (const Copies& one : copies_) {
    const CrossingSums::Slab* slab = tables_[one.table].at(std::int64_t{plane} + kPlaneReach - one.lift);
    if (slab == nullptr) continue;
    const CrossingCount count = of(*slab, one.count);
    total = {total.segments + count.segments, total.crossings + count.crossings, total.clusters + count.clusters};
  }
  return total;
}

std::uint64_t LayerBound::max_crossings() const {
  std::uint64_t total = 0;
  for (const Copies& one : copies_) {
    std::uint64_t maximum = 0;
    for (const CrossingSums::Slab& slab : tables_[one.table].slab) maximum = std::max(maximum, of(slab, one.count).crossings);
    total += maximum;
  }
  return total;
}

std::uint64_t LayerBound::bytes() const {
  std::uint64_t total = tables_.capacity() * sizeof(CrossingSums::Table) + copies_.capacity() * sizeof(Copies);
  for (const CrossingSums::Table& table : tables_) total += table.slab.capacity() * sizeof(CrossingSums::Slab);
  return total;
}

}  // namespace lamina::raster
