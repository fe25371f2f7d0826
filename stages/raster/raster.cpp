#include "stages/raster/raster.h"

#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <set>
#include <utility>
#include <vector>

#include "stages/geometry/interval_table.h"
#include "stages/geometry/isa.h"
#include "stages/raster/beams.h"
#include "stages/raster/layer_bound.h"

namespace lamina::raster {
namespace {

/// Crossings of the band that a ray answers for, about: they stay within a second-level cache. Bands are few all the same,
/// since clusters that lie across two of them are cut twice.
constexpr std::uint64_t kBandCrossings = 1 << 17;

/// Clusters that engine `contours` cuts at once, at most: up to 40 MB of segments.
constexpr std::size_t kMaxClusters = 1 << 16;

/// Segments that a kernel may write behind those of a layer.
constexpr std::uint64_t kMoreSegments = kClusterSize;

/// The first of the owners with the largest area.
LevelFace largest(Buffer<LevelFace>& faces) {
  std::ranges::sort(faces, {}, &LevelFace::owner);
  LevelFace all;
  for (const LevelFace& face : faces) all.keep_larger(face);
  return all;
}

}  // namespace

struct Rasterizer::State {
  PixelGrid grid;
  PixelSampling sampling;
  FillRule rule;
  const Kernels& kernels;
  std::vector<ClusteredMesh> meshes;
  std::vector<PlacedMesh> placed;
  std::uint32_t first_row = 0, last_row = 0;  // geometry rows that any part can reach
  std::uint32_t band_rows = 1;                // rows a ray; they are equal shares of the rows above
  std::vector<BeamIndex> beams;               // one, or none
  std::vector<IntervalTable<Nm>> heights;     // of clusters, one table a mesh, or none: engine `contours`
  std::vector<LayerBound> bound;              // one

  State(const PixelGrid& pixel_grid, FillRule fill_rule, Isa isa)
      : grid(pixel_grid), sampling(pixel_grid), rule(fill_rule), kernels(kernels_for(isa)) {}
};

Result<Rasterizer> Rasterizer::build(std::span<Mesh> meshes, std::span<const Instance> instances, const PixelGrid& grid,
                                     FillRule rule, bool rays, bool contours, Isa isa) {
  const Result<Isa> usable = usable_isa(isa);
  if (!usable) return usable.error();
  const auto shared = std::make_shared<State>(grid, rule, *usable);
  State& state = *shared;
  std::int64_t lowest = grid.y.length, highest = 0;
  for (const Instance& instance : instances) {
    const Box& box = meshes[instance.mesh].bounds;
    lowest = std::min(lowest, std::int64_t{box.lo.y} + instance.offset.y);
    highest = std::max(highest, std::int64_t{box.hi.y} + instance.offset.y);
  }
  const auto row_at = [&](std::int64_t y) {
    return static_cast<std::uint32_t>(std::clamp<std::int64_t>(grid.y.first_at_or_beyond(y), 0, grid.rows()));
  };
  state.first_row = row_at(lowest);
  state.last_row = std::max(state.first_row, row_at(highest));

  state.meshes = make_clusters(meshes, *usable);
  for (const Instance& instance : instances) {
    state.placed.push_back({&state.meshes[instance.mesh], instance.offset});
  }
  const auto sum_up = [&] {
    state.bound.emplace_back(state.placed, state.meshes, crossing_tables(state.meshes, *usable), grid);
  };
  const auto sort_by_height = [&] {
    for (const ClusteredMesh& mesh : state.meshes) state.heights.push_back(heights_of(mesh.bounds));
  };
  if (contours) {
    tbb::parallel_invoke(sum_up, sort_by_height);
  } else {
    sum_up();
  }
  const std::uint32_t rows = std::max(1u, state.last_row - state.first_row);
  const std::uint64_t bands = std::clamp<std::uint64_t>(state.bound.front().max_crossings() / kBandCrossings, 1, rows);
  state.band_rows = ceil_div(rows, static_cast<std::uint32_t>(bands));
  if (rays) {
    // Shifted sampling reaches a row further on each side.
    auto beams = BeamIndex::build(state.placed, grid, state.band_rows + 2);
    if (!beams) return beams.error();
    state.beams.push_back(std::move(*beams));
  }
  Rasterizer rasterizer;
  rasterizer.state_ = shared;
  return rasterizer;
}

LayerReport Rasterizer::layer(Engine engine, Nm plane, LayerScratch& scratch, Runs& out, const std::array<Nm, 2>& shift) const {
  const State& state = *state_;
  std::uint32_t lowest_row = state.first_row, highest_row = state.last_row;
  std::vector<PlacedMesh> moved;
  if (shift != std::array<Nm, 2>{}) {
    moved = state.placed;
    for (PlacedMesh& one : moved) one.offset.x -= shift[0], one.offset.y -= shift[1];
    lowest_row -= std::min(lowest_row, 1u);
    highest_row = std::min(highest_row + 1, state.grid.rows());
  }
  const std::vector<PlacedMesh>& placed_meshes = moved.empty() ? state.placed : moved;
  LayerReport report;
  const LayerBound::CrossingCount bound = state.bound.front().at(plane);
  // What it meets is what one there would if no vertex counted as in it.
  const auto meets = static_cast<Nm>(std::min(std::int64_t{plane} + kPlaneReach, kNmReach));
  const std::uint32_t rows = state.grid.rows();
  out.columns = state.grid.columns();
  out.change.clear();
  ensure_capacity(out.change, bound.crossings + RowsTask::kMoreCrossings);
  out.row_offset.reserve(std::size_t{rows} + 1);
  out.row_offset.assign(1, 0);
  out.row_offset.resize(std::size_t{rows - highest_row} + 1, 0);

  const auto append = [&](const ClusterVisits& visits, std::uint32_t first_row, std::uint32_t last_row) {
    scratch.segments.size = 0;
    scratch.segments.ensure_capacity(std::min(bound.segments, kClusterSize * std::uint64_t{visits.size()}) + kMoreSegments);
    const RowBand band{state.kernels, state.sampling, placed_meshes, plane, first_row, last_row};
    cut_clusters(band, visits, scratch.segments);
    scratch.scan.append_rows(band, scratch.segments, state.rule, out, report);
  };
  // Bands from the back of the bed to its front, the order of the image's rows.
  const auto each_band = [&](auto&& take) {
    for (std::uint32_t last = highest_row; last > lowest_row;) {
      const std::uint32_t first = std::max(lowest_row, last - std::min(last, state.band_rows));
      take(first, last);
      last = first;
    }
  };
  scratch.visits.clear();
  scratch.segments.level.clear();
  ensure_capacity(scratch.visits, bound.clusters);
  if (engine == Engine::kRays) {
    each_band([&](std::uint32_t first, std::uint32_t last) {
      scratch.visits.clear();
      // Boxes of clusters are where parts are without the shift.
      const std::uint32_t more = moved.empty() ? 0 : 1;
      state.beams.front().find_clusters(state.sampling, meets, first - std::min(first, more),
                                        std::min(last + more, state.grid.rows()), scratch.visits);
      append(scratch.visits, first, last);
    });
  } else {
    for (std::uint32_t i = 0; i < placed_meshes.size(); ++i) {
      const PlacedMesh& placed = placed_meshes[i];
      const std::int64_t z = std::int64_t{meets} - placed.offset.z;
      state.heights[static_cast<std::size_t>(placed.mesh - state.meshes.data())].find(z, z, [&](std::uint32_t cluster) {
        scratch.visits.push_back({cluster, i});
      });
    }
    if (scratch.visits.size() <= kMaxClusters) {
      append(scratch.visits, lowest_row, highest_row);
    } else {
      each_band([&](std::uint32_t first, std::uint32_t last) {
        const std::int64_t low = state.sampling.y.centre(first), high = state.sampling.y.centre(last - 1);
        scratch.near.clear();
        for (const ClusterVisit& visit : scratch.visits) {
          const PlacedMesh& placed = placed_meshes[visit.instance];
          const Box& box = placed.mesh->bounds[visit.cluster];
          const bool reaches =
              std::int64_t{box.hi.y} + placed.offset.y >= low && std::int64_t{box.lo.y} + placed.offset.y <= high;
          if (reaches) scratch.near.push_back(visit);
        }
        append(scratch.near, first, last);
      });
    }
  }
  out.row_offset.resize(std::size_t{rows} + 1, static_cast<std::uint32_t>(out.change.size()));
  report.level = largest(scratch.segments.level);
  report.scratch_bytes = scratch.bytes();
  return report;
}

std::uint64_t Rasterizer::layer_bytes_bound(Nm plane) const {
  const LayerBound::CrossingCount count = state_->bound.front().at(plane);
  const std::uint64_t rows = state_->grid.rows(), positions = state_->last_row - state_->first_row;
  // Segments of open parts are held twice, and close at most as many crossings as they have; buffers double for these.
  const bool open = !std::ranges::all_of(state_->meshes, &ClusteredMesh::closed);
  const bool caps = std::ranges::any_of(state_->meshes, [](const ClusteredMesh& m) { return m.first_cap < m.cluster_count(); });
  const std::uint64_t closing = open ? 2 * count.segments * (Segments::kBytes + 4) + 5 * 8 * count.crossings : 0;
  const std::uint64_t visits = (count.clusters > kMaxClusters ? 3 : 1) * count.clusters * sizeof(ClusterVisit);
  const std::uint64_t buffers = visits + (count.segments + kMoreSegments) * Segments::kBytes +
                                2 * 4 * (count.crossings + RowsTask::kMoreCrossings);  // crossings and changes
  // Where each row begins, its offset, and whether it is capped.
  return buffers + buffers / 8 + 4 * (positions + rows + 2) + (open || caps ? positions : 0) + closing;
}

std::uint64_t Rasterizer::crossings_bound(Nm plane) const { return state_->bound.front().at(plane).crossings; }

void Rasterizer::mark_crossed(std::span<const Nm> planes, std::span<std::uint8_t> crossed) const {
  Cluster capacity;
  std::set<std::pair<const ClusteredMesh*, Nm>> visited;
  const auto first_from = [&](std::int64_t z) { return std::ranges::lower_bound(planes, z) - planes.begin(); };
  for (const PlacedMesh& one : state_->placed) {
    if (!visited.emplace(one.mesh, one.offset.z).second) continue;
    const std::int64_t lift = std::int64_t{one.offset.z} - kPlaneReach;
    for (std::uint32_t c = 0; c < one.mesh->cluster_count(); ++c) {
      const Box& box = one.mesh->bounds[c];
      if (first_from(box.lo.z + lift) == first_from(box.hi.z + lift)) continue;
      const auto& z = one.mesh->blocks->cluster(c, capacity).z;
      for (std::uint32_t i = 0; i < kClusterSize; ++i) {
        const auto [lowest, highest] = std::minmax({z[0][i], z[1][i], z[2][i]});
        std::fill(crossed.begin() + first_from(lowest + lift), crossed.begin() + first_from(highest + lift), std::uint8_t{1});
      }
    }
  }
}

std::uint64_t Rasterizer::index_bytes() const {
  std::uint64_t total = bytes_held(state_->sampling.row_centre) + state_->placed.capacity() * sizeof(PlacedMesh);
  total += state_->bound.front().bytes();
  for (const ClusteredMesh& mesh : state_->meshes) total += mesh.blocks->bounds_bytes();
  for (const IntervalTable<Nm>& heights : state_->heights) total += heights.bytes();
  for (const BeamIndex& beams : state_->beams) total += beams.bytes();
  return total;
}

}  // namespace lamina::raster
