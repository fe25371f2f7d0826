#include "stages/coverage/coverage.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <vector>

#include "stages/coverage/edges.h"
#include "stages/coverage/held_bound.h"
#include "stages/coverage/meet/meetings.h"
#include "stages/geometry/blocks/block_maker.h"
#include "stages/geometry/interval_table.h"
#include "stages/geometry/isa.h"

namespace lamina::coverage {
namespace {

/// A mesh, and what was found out about it once.
struct CoveredMesh {
  std::shared_ptr<const MeshBlocks> blocks;
  IntervalTable<Nm> index;
  Suspects suspects;
  HeldBound held;
};

struct Copy {
  std::uint32_t mesh;
  Point3 offset;
  bool crowded;             // its box meets too many others to inspect each
  std::vector<Box> others;  // boxes of other copies that its own meets, nm, on the bed
};

/// Boxes that each facet of a copy is compared with.
constexpr std::size_t kMaxOthers = 64;

bool boxes_meet(const Box& a, const Box& b) {
  return a.lo.x <= b.hi.x && b.lo.x <= a.hi.x && a.lo.y <= b.hi.y && b.lo.y <= a.hi.y && a.lo.z <= b.hi.z && b.lo.z <= a.hi.z;
}

Box moved(const Box& box, const Point3& by) {
  if (box.empty()) return box;
  const auto move = [&](const Point3& p) { return Point3{p.x + by.x, p.y + by.y, p.z + by.z}; };
  return {move(box.lo), move(box.hi)};
}

void note_other(Copy& copy, const Box& other) {
  copy.crowded |= copy.others.size() == kMaxOthers;
  if (!copy.crowded) copy.others.push_back(other);
}

/// Which boxes of copies meet, by a sweep along x.
void find_others(std::span<const Mesh> meshes, std::vector<Copy>& copies) {
  std::vector<Box> box;
  for (const Copy& copy : copies) box.push_back(moved(meshes[copy.mesh].bounds, copy.offset));
  std::vector<std::uint32_t> order(copies.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  std::sort(order.begin(), order.end(),
            [&](auto a, auto b) { return box[a].lo.x != box[b].lo.x ? box[a].lo.x < box[b].lo.x : a < b; });
  for (std::size_t i = 0; i < order.size(); ++i) {
    for (std::size_t k = i + 1; k < order.size() && box[order[k]].lo.x <= box[order[i]].hi.x; ++k) {
      if (!boxes_meet(box[order[i]], box[order[k]])) continue;
      note_other(copies[order[i]], box[order[k]]);
      note_other(copies[order[k]], box[order[i]]);
    }
  }
}

/// Whether a facet of the copy, where it stands, may meet another copy or lie within it.
bool is_near_others(const Copy& copy, const Triangle& facet) {
  if (copy.others.empty()) return false;
  Box box;
  box.add(facet.a), box.add(facet.b), box.add(facet.c);
  return std::ranges::any_of(copy.others, [&](const Box& other) { return boxes_meet(box, other); });
}

/// Facets are in the order of the mesh, and each is read once.
void fetch(const SlabFacet& facet) {
  const auto* bytes = reinterpret_cast<const char*>(&facet);
  for (std::size_t at = 0; at < sizeof facet; at += 64) __builtin_prefetch(bytes + at);
}

}  // namespace

struct Coverage::State {
  PixelGrid grid;
  Edges x, y;
  Rule rule;
  Isa isa;
  std::vector<CoveredMesh> meshes;
  std::vector<Copy> copies;

  State(const PixelGrid& pixel_grid, Rule of_rows, Isa widest)
      : grid(pixel_grid), x(pixel_grid.x), y(pixel_grid.y), rule(of_rows), isa(limited_isa(widest)) {}

  std::uint32_t bands() const { return (grid.rows() + kBandRows - 1) / kBandRows; }
  HeldBound::HeldCount held_in(const Layer& layer) const;
  void gather(const Layer& layer, CoverageScratch& scratch) const;
  void order_by_band(CoverageScratch& scratch) const;
};

Coverage::Coverage(Coverage&&) noexcept = default;
Coverage& Coverage::operator=(Coverage&&) noexcept = default;
Coverage::~Coverage() = default;

Result<Coverage> Coverage::build(std::span<Mesh> meshes, std::span<const Instance> instances, const PixelGrid& grid,
                                 FillRule rule, std::uint32_t levels, Isa isa) {
  if (levels < 2 || levels > 256) {
    return Error{Fault::kUsage, fmt::format("{} levels: a voxel has 2 to 256; give 2, 4 or 16", levels)};
  }
  for (const Mesh& mesh : meshes) {
    if (mesh.closed) continue;
    return Error{Fault::kInput, fmt::format("{}: the surface is open, so no voxel of it has a share; load it with repair, or "
                                            "leave out --levels",
                                            mesh.name)};
  }
  Coverage coverage;
  coverage.state_ = std::make_unique<State>(grid, Rule{rule, levels - 1}, isa);
  State& state = *coverage.state_;
  for (const Instance& instance : instances) state.copies.push_back({instance.mesh, instance.offset, false, {}});
  find_others(meshes, state.copies);
  std::vector<std::shared_ptr<MeshBlocks>> blocks = take_blocks(meshes);
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    meshes[i].blocks = blocks[i];
    IntervalTable<Nm> index = heights_of(blocks[i]->bounds());
    Suspects suspects = find_suspects(*blocks[i], index, isa);
    HeldBound held(*blocks[i], suspects, grid, levels - 1);
    state.meshes.push_back({std::move(blocks[i]), std::move(index), std::move(suspects), std::move(held)});
  }
  return coverage;
}

void Coverage::State::gather(const Layer& layer, CoverageScratch& scratch) const {
  const std::int64_t bottom = layer.bottom, top = bottom + layer.thickness;
  scratch.facets.clear();
  ensure_capacity(scratch.facets, held_in(layer).facets);
  SlabFacet taken;
  Cluster slack;
  for (const Copy& copy : copies) {
    const CoveredMesh& mesh = meshes[copy.mesh];
    const Point3 by = copy.offset;
    const auto moved = [&](const Point3& p) {
      return Point3{static_cast<Nm>(p.x + by.x), static_cast<Nm>(p.y + by.y), static_cast<Nm>(p.z + by.z)};
    };
    mesh.index.find(bottom - by.z, top - by.z - 1, [&](std::uint32_t c) {
      const Cluster& cluster = mesh.blocks->cluster(c, slack);
      const unsigned suspects = copy.crowded ? ~0u : mesh.suspects[c];
      for (std::uint32_t lane = 0; lane < kClusterSize; ++lane) {
        const std::int64_t z0 = cluster.z[0][lane], z1 = cluster.z[1][lane], z2 = cluster.z[2][lane];
        if (std::min({z0, z1, z2}) + by.z >= top || std::max({z0, z1, z2}) + by.z <= bottom) continue;
        const Triangle t = cluster.triangle(lane);
        const Triangle on_bed{moved(t.a), moved(t.b), moved(t.c)};
        const bool suspect = (suspects >> lane & 1) != 0 || is_near_others(copy, on_bed);
        if (take_facet(on_bed, suspect, bottom, top, y, taken)) scratch.facets.push_back(taken);
      }
    });
  }
}

void Coverage::State::order_by_band(CoverageScratch& scratch) const {
  scratch.begins.assign(std::size_t{bands()} + 2, 0);
  for (const SlabFacet& facet : scratch.facets) ++scratch.begins[facet.last_row / kBandRows + 2];
  for (std::size_t r = 1; r < scratch.begins.size(); ++r) scratch.begins[r] += scratch.begins[r - 1];
  ensure_capacity(scratch.order, scratch.facets.size());
  scratch.order.resize(scratch.facets.size());
  for (std::uint32_t i = 0; i < scratch.facets.size(); ++i)
    scratch.order[scratch.begins[scratch.facets[i].last_row / kBandRows + 1]++] = i;
}

CoverageReport Coverage::layer(const Layer& layer, CoverageScratch& scratch, Levels& out) const {
  const State& state = *state_;
  CoverageReport report;
  state.gather(layer, scratch);
  state.order_by_band(scratch);
  report.facets = static_cast<std::uint32_t>(scratch.facets.size());
  out.start(state.grid.columns());
  const std::int64_t bottom = layer.bottom, top = bottom + layer.thickness;
  const BandSlab slab{state.grid.x,
                      state.grid.y,
                      state.x,
                      state.rule,
                      {1 / state.x.per_nm(), 1 / state.y.per_nm(), static_cast<double>(layer.thickness)},
                      bottom,
                      top,
                      scratch.facets};
  scratch.maker.start(slab, state.isa);
  for (std::uint32_t band = state.bands(); band-- > 0;) {
    for (std::uint32_t k = scratch.begins[band]; k < scratch.begins[band + 1]; ++k) {
      if (k + 4 < scratch.order.size()) fetch(scratch.facets[scratch.order[k + 4]]);
      scratch.maker.enter(scratch.facets[scratch.order[k]], scratch.order[k], state.y);
    }
    const std::uint32_t first = band * kBandRows, rows = std::min(state.grid.rows() - first, kBandRows);
    if (scratch.maker.is_empty()) {
      for (std::uint32_t r = 0; r < rows; ++r) out.end_row();
    } else {
      scratch.maker.make(slab, first, rows, out, report);
    }
  }
  const auto end = static_cast<double>(state.grid.x.length);
  for (const SlabFacet& facet : scratch.facets) report.volume_mm3 += facet.edgewise ? 0 : volume_behind(facet, end);
  report.volume_mm3 *= 1e-18;
  report.scratch_bytes = scratch.bytes();
  return report;
}

HeldBound::HeldCount Coverage::State::held_in(const Layer& layer) const {
  HeldBound::HeldCount held;
  for (const Copy& copy : copies) {
    const std::int64_t bottom = std::int64_t{layer.bottom} - copy.offset.z;
    HeldBound::HeldCount own = meshes[copy.mesh].held.at(bottom, bottom + layer.thickness);
    if (copy.crowded || !copy.others.empty()) own.runs = own.voxels, own.edges = 2 * own.voxels;  // facets may meet others
    held.facets += own.facets, held.voxels += own.voxels, held.runs += own.runs, held.edges += own.edges;
  }
  return held;
}

LayerBound Coverage::bound(const Layer& layer) const {
  const State& state = *state_;
  const HeldBound::HeldCount held = state.held_in(layer);
  // Samples of a row come on top where facets meet.
  const std::uint64_t columns = state.grid.columns(), rows = state.grid.rows(), facets = held.facets + held.facets / 8;
  const std::uint64_t bytes = facets * (sizeof(SlabFacet) + sizeof(std::uint32_t)) +
                              sizeof(std::uint32_t) * (std::uint64_t{state.bands()} + 2) +
                              BandMaker::bytes_of(held.facets, state.grid.columns());
  return {held.facets, std::min(held.voxels, columns * rows), std::min(held.runs, columns * rows), held.edges, bytes};
}

std::uint64_t Coverage::suspects() const {
  std::uint64_t count = 0;
  for (const CoveredMesh& mesh : state_->meshes) {
    for (const std::uint16_t bits : mesh.suspects) count += static_cast<std::uint64_t>(std::popcount(bits));
  }
  return count;
}

std::uint64_t Coverage::index_bytes() const {
  std::uint64_t total = state_->x.bytes() + state_->y.bytes() + state_->copies.capacity() * sizeof(Copy);
  for (const Copy& copy : state_->copies) total += copy.others.capacity() * sizeof(Box);
  for (const CoveredMesh& mesh : state_->meshes) total += mesh.index.bytes() + bytes_held(mesh.suspects) + mesh.held.bytes();
  return total;
}

const PixelGrid& Coverage::grid() const { return state_->grid; }

}  // namespace lamina::coverage
