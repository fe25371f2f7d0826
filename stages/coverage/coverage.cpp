#include "stages/coverage/coverage.h"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <utility>
#include <vector>

#include "stages/coverage/meet/meetings.h"
#include "stages/geometry/blocks/block_maker.h"
#include "stages/geometry/interval_table.h"
#include "stages/geometry/isa.h"

namespace lamina::coverage {
namespace {

// --- how many facets and runs of levels a layer can have, before it is planned.

constexpr double kUnit = 1024;
constexpr std::int64_t kMaxParts = 8;  // of a facet along z, each of one number a slab
constexpr double kUsualPixels = 4;     // that layers are thick: decides alone which of two bounds a facet goes to

/// Area of the facet on the plane of two axes.
template <auto kU, auto kV>
double projected_area(const Triangle& t) {
  return std::abs((static_cast<double>(t.b.*kU) - t.a.*kU) * (static_cast<double>(t.c.*kV) - t.a.*kV) -
                  (static_cast<double>(t.b.*kV) - t.a.*kV) * (static_cast<double>(t.c.*kU) - t.a.*kU)) /
         2;
}

/// Rounded up.
std::int64_t units(double amount) {
  const double scaled = amount * kUnit * (1 + 1e-9);
  const auto whole = static_cast<std::int64_t>(scaled);
  return whole + (static_cast<double>(whole) < scaled ? 1 : 0);
}

/// Sums over the facets of a mesh by slabs of height, 2^k nm high and no more than kMaxSlabs; 112 bytes a slab.
///
/// In plan view, the piece of a facet in a layer is convex: of area A, width w and depth d in voxels it touches at most A + 2 w
/// + 2 d + 4 voxels, in d + 2 rows. Twice its width is how far its border runs along x: along the facet's edges, of
/// which each slab has its share, and along the cuts with the layer's two planes, which grow evenly up to the middle corner and
/// shrink again, as areas for each nm of height do.
///
/// Of a steep facet, and of one that meets others, each voxel may be a run of levels. Along a row of a flat one coverage only
/// rises or only falls, by its area projected along x over that of the row: of levels 0 .. n it passes n times that many, and
/// the contributions of other facets begin or end with them.
class HeldBound {
 public:
  /// top_level  n. cost  some ten nanoseconds a facet; parallel
  HeldBound(const MeshBlocks& mesh, const Suspects& suspects, const PixelGrid& grid, std::uint32_t top_level);
  /// Of a layer between two heights, nm in the frame of the mesh, but for its scratch_bytes. cost  O(1)
  LayerBound at(std::int64_t bottom, std::int64_t top) const;
  std::uint64_t facets_at(std::int64_t bottom, std::int64_t top) const { return at(bottom, top).facets; }
  std::uint64_t bytes() const { return slab_.capacity() * sizeof(Slab); }

 private:
  static constexpr std::size_t kMaxSlabs = 8192;
  static constexpr std::uint32_t kFinest = 12;  // 4 micrometres
  static constexpr std::uint32_t kClustersAtOnce = 1024;

  /// Voxels, or levels x nm of height, in 1024ths, so that sums do not depend on their order.
  struct Sums {
    std::int64_t voxels = 0, runs = 0, rows = 0;
    std::int64_t levels = 0;  // that shares of flat facets pass, times the thickness of the layer
    void add(const Sums& more, std::int64_t times) {
      voxels += times * more.voxels, runs += times * more.runs, rows += times * more.rows;
      levels += times * more.levels;
    }
  };
  struct Slab {
    Sums below;               // of areas and edges in all slabs below
    Sums cut;                 // of any plane within
    Sums floor;               // of flat facets at its lower end, which no layer from there on holds
    std::uint64_t begin = 0;  // facets whose lowest corner lies in slabs below
    std::uint64_t end = 0;    // whose highest one does, or where they end
    void add(const Slab& more) {
      below.add(more.below, 1), cut.add(more.cut, 1), floor.add(more.floor, 1);
      begin += more.begin, end += more.end;
    }
  };
  struct Facet;
  void add(const Triangle& facet, bool suspect);
  void add_edge(const Facet& facet, const Point3& a, const Point3& b);
  void add_parts(const Facet& facet);
  void spread(std::int64_t first, std::int64_t end, const Sums& within);
  Slab& slab(std::int64_t number) { return slab_[static_cast<std::size_t>(number + 1)]; }
  std::int64_t slab_of(std::int64_t z) const { return (z >> shift_) - first_; }

  double columns_per_nm_, rows_per_nm_, top_level_;
  std::uint32_t shift_ = kFinest;
  std::int64_t first_ = 0;
  std::vector<Slab> slab_;  // one more before the lowest, and one behind the highest
};

struct HeldBound::Facet {
  Triangle t;           // corners by height
  bool suspect;         // meets others: samples may say anything
  bool flat;            // shares that pass levels are fewer than its voxels
  double area, levels;  // in plan view, voxels; along x, levels x nm
  double low, middle, high;
  double rise() const { return high - low; }
  /// Voxels that a way along x and one along y pass.
  Sums way(double x, double y, double share) const {
    // Rows count once more, for what lies between runs of voxels; of flat facets two changes a row.
    return {units((x + 1.5 * y) * share), units((flat ? y : x + 1.5 * y) * share), units((suspect ? 2 * x + 3 * y : y) * share),
            0};
  }
};

HeldBound::HeldBound(const MeshBlocks& mesh, const Suspects& suspects, const PixelGrid& grid, std::uint32_t top_level)
    : columns_per_nm_(grid.x.pixels_per_nm()), rows_per_nm_(grid.y.pixels_per_nm()), top_level_(top_level) {
  const std::span<const Box> bounds = mesh.bounds();
  if (bounds.empty()) return;
  std::int64_t lowest = INT32_MAX, highest = INT32_MIN;
  for (const Box& box : bounds) {
    lowest = std::min<std::int64_t>(lowest, box.lo.z);
    highest = std::max<std::int64_t>(highest, box.hi.z);
  }
  const std::size_t maximum = std::min(kMaxSlabs, 64 + 4 * bounds.size());
  const auto slabs = [&] { return static_cast<std::size_t>((highest >> shift_) - (lowest >> shift_) + 1); };
  while (slabs() > maximum) ++shift_;
  first_ = lowest >> shift_;
  slab_.resize(slabs() + 2);
  tbb::enumerable_thread_specific<HeldBound> parts(*this);
  tbb::parallel_for(tbb::blocked_range<std::uint32_t>(0, mesh.cluster_count(), kClustersAtOnce), [&](const auto& range) {
    HeldBound& part = parts.local();
    Cluster slack;
    for (std::uint32_t c = range.begin(); c < range.end(); ++c) {
      const Cluster& cluster = mesh.cluster(c, slack);
      for (std::uint32_t lane = 0; lane < kClusterSize; ++lane)
        part.add(cluster.triangle(lane), (suspects[c] >> lane & 1) != 0);
    }
  });
  for (const HeldBound& part : parts) {
    for (std::size_t i = 0; i < slab_.size(); ++i) slab_[i].add(part.slab_[i]);
  }
  // Differences become what each slab has, and that what all below have.
  Sums here, cut, below;
  std::uint64_t begin = 0, end = 0;
  for (Slab& slab : slab_) {
    here.add(slab.below, 1), cut.add(slab.cut, 1);
    const Slab own = slab;
    slab = {below, cut, own.floor, begin, end};
    below.add(here, 1), below.add(own.floor, 1);
    begin += own.begin, end += own.end;
  }
}

void HeldBound::add(const Triangle& facet, bool suspect) {
  Triangle t = facet;
  if (t.b.z < t.a.z) std::swap(t.a, t.b);
  if (t.c.z < t.b.z) std::swap(t.b, t.c);
  if (t.b.z < t.a.z) std::swap(t.a, t.b);
  const double area = projected_area<&Point3::x, &Point3::y>(t), side = projected_area<&Point3::y, &Point3::z>(t);
  if (t.a == t.b && t.b == t.c) return;  // no facet
  const double steps = top_level_ * side * rows_per_nm_;
  const Facet own{t,
                  suspect,
                  !suspect && kUsualPixels * area >= top_level_ * side,
                  area * columns_per_nm_ * rows_per_nm_,
                  steps,
                  static_cast<double>(t.a.z),
                  static_cast<double>(t.b.z),
                  static_cast<double>(t.c.z)};
  ++slab(slab_of(t.a.z)).begin;
  ++slab(slab_of(std::int64_t{t.c.z} - 1)).end;
  add_edge(own, t.a, t.b);
  add_edge(own, t.b, t.c);
  add_edge(own, t.a, t.c);
  add_parts(own);
}

/// Adds to each of the slabs [first, end).
void HeldBound::spread(std::int64_t first, std::int64_t end, const Sums& within) {
  slab(first).below.add(within, 1), slab(end).below.add(within, -1);
}

void HeldBound::add_edge(const Facet& facet, const Point3& a, const Point3& b) {
  const double x = std::abs(static_cast<double>(b.x) - a.x) * columns_per_nm_;
  const double y = std::abs(static_cast<double>(b.y) - a.y) * rows_per_nm_;
  const double rise = static_cast<double>(b.z) - a.z, height = std::ldexp(1.0, static_cast<int>(shift_));
  const Sums way = facet.way(x, y, rise > height ? height / rise : 1);
  const std::int64_t first = slab_of(a.z);
  if (rise == 0 && (first + first_) << shift_ == a.z) return slab(first).floor.add(way, 1);
  spread(first, slab_of(std::max<std::int64_t>(a.z, std::int64_t{b.z} - 1)) + 1, way);
}

void HeldBound::add_parts(const Facet& f) {
  const double low = f.low, middle = f.middle, high = f.high, rise = f.rise();
  const std::int64_t first = slab_of(f.t.a.z);
  const auto within = [&](double share) {
    return Sums{units(f.area * share), units(f.flat ? 0 : f.area * share), units(f.suspect ? 2 * f.area * share : 0),
                f.flat ? units(f.levels * share) : 0};
  };
  if (rise == 0) {
    if ((first + first_) << shift_ == f.t.a.z) return slab(first).floor.add(within(1), 1);
    return spread(first, first + 1, within(1));
  }
  // The cut through the middle corner ends on the edge between the other two.
  const double at = (middle - low) / rise;
  const double x = std::abs(f.t.a.x + at * (static_cast<double>(f.t.c.x) - f.t.a.x) - f.t.b.x) * columns_per_nm_;
  const double y = std::abs(f.t.a.y + at * (static_cast<double>(f.t.c.y) - f.t.a.y) - f.t.b.y) * rows_per_nm_;
  // Shares of that cut at a height, and of the area below.
  const auto tent = [&](double z) {
    return z < middle ? (z - low) / (middle - low) : z > middle ? (high - z) / (high - middle) : 1;
  };
  const auto below = [&](double z) {
    if (z < middle) return (z - low) * (z - low) / (rise * (middle - low));
    return z < high ? 1 - (high - z) * (high - z) / (rise * (high - middle)) : 1;
  };
  const double height = std::ldexp(1.0, static_cast<int>(shift_));
  const std::int64_t slabs = slab_of(std::int64_t{f.t.c.z} - 1) + 1 - first, parts = std::min(slabs, kMaxParts);
  Sums of_part{}, of_cut{};  // of the part below
  std::int64_t from = first;
  double bottom = low, tent_at_bottom = tent(low);
  for (std::int64_t p = 0; p < parts; ++p) {
    const std::int64_t end = first + slabs * (p + 1) / parts;
    const double top = std::min(high, static_cast<double>((end + first_) << shift_)), tent_at_top = tent(top);
    const double maximum = bottom <= middle && middle <= top ? 1 : std::max(tent_at_bottom, tent_at_top);
    const double share = end - from == 1 ? below(top) - below(bottom) : 2 * maximum * height / rise;
    Slab& slab_from = slab(from);
    slab_from.below.add(of_part, -1), slab_from.cut.add(of_cut, -1);
    of_part = within(std::min(1.0, share)), of_cut = f.way(x, y, maximum);
    slab_from.below.add(of_part, 1), slab_from.cut.add(of_cut, 1);
    from = end, bottom = top, tent_at_bottom = tent_at_top;
  }
  slab(from).below.add(of_part, -1), slab(from).cut.add(of_cut, -1);
}

LayerBound HeldBound::at(std::int64_t bottom, std::int64_t top) const {
  if (slab_.empty() || top <= bottom) return {};
  const auto last_slab = static_cast<std::int64_t>(slab_.size()) - 3;
  if (slab_of(top - 1) < 0 || slab_of(bottom) > last_slab) return {};
  const auto low = static_cast<std::size_t>(std::max<std::int64_t>(0, slab_of(bottom)) + 1);
  const auto high = static_cast<std::size_t>(std::min(last_slab, slab_of(top - 1)) + 1);
  const Slab &first = slab_[low], &above = slab_[high + 1];
  Sums sum = above.below;
  sum.add(first.below, -1), sum.add(first.cut, 1), sum.add(slab_[high].cut, 1);
  if (slab_of(bottom) >= 0) sum.add(first.floor, -1);
  const std::uint64_t facets = above.begin - first.end;
  const auto whole = [](double amount) { return static_cast<std::uint64_t>(std::max(0.0, amount) / kUnit * (1 + 1e-3)) + 1; };
  // Corners of each facet, and voxels that reach a nanometre beyond their edges.
  constexpr std::uint64_t kCorners = 7;
  const double levels = static_cast<double>(sum.levels) / static_cast<double>(top - bottom);
  const std::uint64_t voxels = whole(static_cast<double>(sum.voxels)) + kCorners * facets;
  const std::uint64_t runs = std::min(voxels, whole(static_cast<double>(sum.runs) + levels) + kCorners * facets);
  return {facets, voxels, runs, std::min(2 * runs, whole(static_cast<double>(sum.rows)) + kCorners * facets), 0};
}

// ---

/// A mesh, and what was found out about it once.
struct CoveredMesh {
  std::shared_ptr<const MeshBlocks> blocks;
  IntervalTable<Nm> index;
  Suspects suspects;
  HeldBound held;
  std::uint32_t copies = 0;
};

struct Copy {
  std::uint32_t mesh;
  Point3 offset;
  bool crowded;                                 // its box meets too many others to inspect each
  std::vector<Box> others;                      // boxes of other copies that its own meets, nm, on the bed
  std::uint32_t first_band = 0, last_band = 0;  // that it may reach; last included
};

constexpr std::uint32_t kNoFacet = UINT32_MAX;

/// Facets of the next band lie all over the memory of the layer.
void prefetch(const SlabFacet& facet) {
  const char* const first = reinterpret_cast<const char*>(&facet);
  for (std::size_t byte = 0; byte < sizeof facet; byte += 64) __builtin_prefetch(first + byte);
  __builtin_prefetch(first + sizeof facet - 1);
}

/// Boxes that each facet of a copy is compared with.
constexpr std::size_t kMaxOthers = 64;

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
  const Box box = box_of(facet);
  return std::ranges::any_of(copy.others, [&](const Box& other) { return boxes_meet(box, other); });
}

}  // namespace

struct Coverage::State {
  PixelGrid grid;
  Edges x, y;
  Rule rule;
  Isa isa;
  std::vector<CoveredMesh> meshes;
  std::vector<Copy> copies;
  std::vector<std::uint32_t> from_back;  // copies by the last band that they reach, the last one first

  State(const PixelGrid& pixel_grid, Rule of_rows, Isa widest)
      : grid(pixel_grid), x(pixel_grid.x), y(pixel_grid.y), rule(of_rows), isa(limited_isa(widest)) {}

  std::uint32_t bands() const { return (grid.rows() + kBandRows - 1) / kBandRows; }
  LayerBound held_in(const Layer& layer) const;
  std::uint64_t live_facets(const Layer& layer) const;
  void order_copies(std::span<const Mesh> of_copies);
  std::uint64_t shape_facets(const Layer& layer) const;
  void make_shape(std::uint32_t of_mesh, std::int64_t bottom, std::int64_t top, CoverageScratch& scratch) const;
  void gather(const Copy& copy, const Layer& layer, CoverageScratch& scratch, CoverageReport& report) const;
};

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
  const auto state = std::make_shared<State>(grid, Rule{rule, levels - 1}, isa);
  for (const Instance& instance : instances) state->copies.push_back({instance.mesh, instance.offset, false, {}});
  find_others(meshes, state->copies);
  state->order_copies(meshes);
  std::vector<std::shared_ptr<MeshBlocks>> blocks = take_blocks(meshes);
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    meshes[i].blocks = blocks[i];
    IntervalTable<Nm> index = heights_of(blocks[i]->bounds());
    Suspects suspects = find_suspects(*blocks[i], index, isa);
    HeldBound held(*blocks[i], suspects, grid, levels - 1);
    state->meshes.push_back({std::move(blocks[i]), std::move(index), std::move(suspects), std::move(held)});
  }
  for (const Copy& copy : state->copies) ++state->meshes[copy.mesh].copies;
  Coverage coverage;
  coverage.state_ = state;
  return coverage;
}

void Coverage::State::order_copies(std::span<const Mesh> of_copies) {
  for (std::uint32_t i = 0; i < copies.size(); ++i) {
    Copy& copy = copies[i];
    const Box box = moved(of_copies[copy.mesh].bounds, copy.offset);
    if (box.empty()) continue;
    copy.first_band = y.at(static_cast<double>(box.lo.y) - 1) / kBandRows;
    copy.last_band = y.at(static_cast<double>(box.hi.y) + 1) / kBandRows;
    from_back.push_back(i);
  }
  std::ranges::stable_sort(from_back, std::greater(), [&](std::uint32_t i) { return copies[i].last_band; });
}

/// Calls take(triangle, whether it meets others) for the facets of a mesh between two heights, all in its frame.
template <class Take>
void for_facets(const CoveredMesh& mesh, std::int64_t bottom, std::int64_t top, const Take& take) {
  Cluster slack;
  mesh.index.find(bottom, top - 1, [&](std::uint32_t c) {
    const Cluster& cluster = mesh.blocks->cluster(c, slack);
    for (std::uint32_t lane = 0; lane < kClusterSize; ++lane) {
      const std::int64_t z0 = cluster.z[0][lane], z1 = cluster.z[1][lane], z2 = cluster.z[2][lane];
      if (std::min({z0, z1, z2}) >= top || std::max({z0, z1, z2}) <= bottom) continue;
      take(cluster.triangle(lane), (mesh.suspects[c] >> lane & 1) != 0);
    }
  });
}

/// Cuts the facets of a mesh once for its copies at one height.
void Coverage::State::make_shape(std::uint32_t of_mesh, std::int64_t bottom, std::int64_t top, CoverageScratch& scratch) const {
  const CoveredMesh& mesh = meshes[of_mesh];
  SlabShape& shape = scratch.shape[of_mesh];
  shape = {bottom, static_cast<std::uint32_t>(scratch.shape_facets.size()), 0, true};
  SlabFacet facet;
  for_facets(mesh, bottom, top, [&](const Triangle& t, bool suspect) {
    if (!take_facet(t, suspect, bottom, top, y, facet)) return;
    facet.first_piece = static_cast<std::uint32_t>(scratch.shape_pieces.size());
    cut_trapezoids(facet, 0, y, scratch.shape_pieces);
    facet.piece_count = static_cast<std::uint32_t>(scratch.shape_pieces.size()) - facet.first_piece;
    scratch.shape_facets.push_back(facet);
  });
  shape.end = static_cast<std::uint32_t>(scratch.shape_facets.size());
}

/// Takes what of the copy reaches into the layer.
void Coverage::State::gather(const Copy& copy, const Layer& layer, CoverageScratch& scratch, CoverageReport& report) const {
  const Point3 by = copy.offset;
  const std::int64_t bottom = std::int64_t{layer.bottom} - by.z, top = bottom + layer.thickness;
  const auto end = static_cast<double>(grid.x.length);
  const auto take = [&](const SlabFacet& taken) {
    std::uint32_t at = 0;
    if (scratch.unused.empty()) {
      at = static_cast<std::uint32_t>(scratch.facets.size());
      scratch.facets.push_back(taken);
      scratch.next.push_back(kNoFacet);
    } else {
      at = scratch.unused.back();
      scratch.unused.pop_back();
      scratch.facets[at] = taken;
    }
    std::uint32_t& first = scratch.first[taken.last_row / kBandRows];
    scratch.next[at] = std::exchange(first, at);
    ++report.facets;
    report.volume_mm3 += taken.volume_behind(end);
  };
  const auto meets_others = [&](const Triangle& on_bed) { return copy.crowded || is_near_others(copy, on_bed); };
  if (meshes[copy.mesh].copies > 1 && !scratch.shape[copy.mesh].made) make_shape(copy.mesh, bottom, top, scratch);
  const SlabShape shape = scratch.shape[copy.mesh];
  SlabFacet taken;
  if (shape.made && shape.bottom == bottom) {
    for (std::uint32_t i = shape.first; i < shape.end; ++i) {
      taken = scratch.shape_facets[i];
      taken.move(by, y);
      taken.suspect |= meets_others(taken.facet);
      take(taken);
    }
    return;
  }
  for_facets(meshes[copy.mesh], bottom, top, [&](Triangle t, bool suspect) {
    for (Point3* p : {&t.a, &t.b, &t.c}) *p = {p->x + by.x, p->y + by.y, p->z + by.z};
    if (take_facet(t, suspect || meets_others(t), layer.bottom, std::int64_t{layer.bottom} + layer.thickness, y, taken)) take(taken);
  });
}

CoverageReport Coverage::layer(const Layer& layer, CoverageScratch& scratch, Levels& out) const {
  const State& state = *state_;
  CoverageReport report;
  out.start(state.grid.columns());
  const std::int64_t bottom = layer.bottom, top = bottom + layer.thickness;
  BandSlab slab{state.grid.x,
                state.grid.y,
                state.x,
                state.rule,
                {1 / state.x.per_nm(), 1 / state.y.per_nm(), static_cast<double>(layer.thickness)},
                bottom,
                top,
                {}};
  scratch.maker.start(slab, state.isa, scratch.counts_held);
  scratch.facets.clear(), scratch.next.clear(), scratch.live.clear(), scratch.unused.clear();
  const std::uint64_t facets = state.live_facets(layer);
  ensure_capacity(scratch.facets, facets), ensure_capacity(scratch.next, facets);
  scratch.first.assign(state.bands(), kNoFacet);
  scratch.shape.assign(state.meshes.size(), {});
  scratch.shape_facets.clear(), scratch.shape_pieces.clear();
  const std::uint64_t shared = state.shape_facets(layer);
  ensure_capacity(scratch.shape_facets, shared), ensure_capacity(scratch.shape_pieces, BandMaker::kMaxPieces * shared);
  std::size_t gathered = 0;
  for (std::uint32_t band = state.bands(); band-- > 0;) {
    for (; gathered < state.from_back.size(); ++gathered) {
      const Copy& copy = state.copies[state.from_back[gathered]];
      if (copy.last_band < band) break;
      state.gather(copy, layer, scratch, report);
    }
    slab.facets = scratch.facets;
    for (std::uint32_t at = scratch.first[band]; at != kNoFacet; at = scratch.next[at]) {
      const SlabFacet& facet = scratch.facets[at];
      scratch.maker.enter(facet, at, state.y, std::span(scratch.shape_pieces).subspan(facet.first_piece, facet.piece_count));
      scratch.live.push_back(at);
    }
    const std::uint32_t first = band * kBandRows, rows = std::min(state.grid.rows() - first, kBandRows);
    for (std::uint32_t at = band > 0 ? scratch.first[band - 1] : kNoFacet; at != kNoFacet; at = scratch.next[at])
      prefetch(scratch.facets[at]);
    if (scratch.maker.is_empty()) {
      for (std::uint32_t r = 0; r < rows; ++r) out.end_row();
    } else {
      scratch.maker.make(slab, first, rows, out, report);
    }
    std::erase_if(scratch.live, [&](std::uint32_t at) {
      const bool ends = scratch.facets[at].first_row >= first;
      if (ends) scratch.unused.push_back(at);
      return ends;
    });
  }
  report.volume_mm3 *= 1e-18;
  report.scratch_bytes = scratch.bytes();
  return report;
}

/// The facets of copies that reach one band, at most.
std::uint64_t Coverage::State::live_facets(const Layer& layer) const {
  std::vector<std::int64_t> change(std::size_t{bands()} + 1);
  for (const std::uint32_t i : from_back) {
    const Copy& copy = copies[i];
    const std::int64_t bottom = std::int64_t{layer.bottom} - copy.offset.z;
    const auto facets = static_cast<std::int64_t>(meshes[copy.mesh].held.facets_at(bottom, bottom + layer.thickness));
    change[copy.first_band] += facets, change[copy.last_band + 1] -= facets;
  }
  std::int64_t facets = 0, maximum = 0;
  for (const std::int64_t by : change) maximum = std::max(maximum, facets += by);
  return static_cast<std::uint64_t>(maximum);
}

/// Facets of shapes that copies share, at most.
std::uint64_t Coverage::State::shape_facets(const Layer& layer) const {
  std::vector<std::uint64_t> maximum(meshes.size());
  for (const Copy& copy : copies) {
    const std::int64_t bottom = std::int64_t{layer.bottom} - copy.offset.z;
    if (meshes[copy.mesh].copies < 2) continue;
    maximum[copy.mesh] = std::max(maximum[copy.mesh], meshes[copy.mesh].held.facets_at(bottom, bottom + layer.thickness));
  }
  return std::accumulate(maximum.begin(), maximum.end(), std::uint64_t{0});
}

LayerBound Coverage::State::held_in(const Layer& layer) const {
  LayerBound held;
  for (const Copy& copy : copies) {
    const std::int64_t bottom = std::int64_t{layer.bottom} - copy.offset.z;
    LayerBound own = meshes[copy.mesh].held.at(bottom, bottom + layer.thickness);
    if (copy.crowded || !copy.others.empty()) own.runs = own.voxels, own.edges = 2 * own.voxels;  // facets may meet others
    held.facets += own.facets, held.voxels += own.voxels, held.runs += own.runs, held.edges += own.edges;
  }
  return held;
}

LayerBound Coverage::bound(const Layer& layer) const {
  const State& state = *state_;
  LayerBound bound = state.held_in(layer);
  const std::uint64_t columns = state.grid.columns(), voxels = columns * state.grid.rows();
  // Samples of a row come on top where facets meet.
  const std::uint64_t facets = state.live_facets(layer);
  bound.scratch_bytes = (facets + facets / 8) * (sizeof(SlabFacet) + sizeof(std::uint32_t)) +
                        4 * facets * sizeof(std::uint32_t) + sizeof(std::uint32_t) * (std::uint64_t{state.bands()} + 2) +
                        BandMaker::bytes_of(facets, state.grid.columns()) + state.meshes.size() * sizeof(SlabShape);
  const std::uint64_t shared = state.shape_facets(layer);
  bound.scratch_bytes += (shared + shared / 8) * (sizeof(SlabFacet) + BandMaker::kMaxPieces * sizeof(Trapezoid));
  bound.voxels = std::min(bound.voxels, voxels);
  bound.runs = std::min(bound.runs, voxels);
  return bound;
}

std::uint64_t Coverage::index_bytes() const {
  std::uint64_t total = state_->x.bytes() + state_->y.bytes() + state_->copies.capacity() * sizeof(Copy);
  for (const Copy& copy : state_->copies) total += copy.others.capacity() * sizeof(Box);
  for (const CoveredMesh& mesh : state_->meshes) total += mesh.index.bytes() + bytes_held(mesh.suspects) + mesh.held.bytes();
  return total;
}

}  // namespace lamina::coverage
