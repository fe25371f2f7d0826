#include "stages/coverage/held_bound.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace lamina::coverage {
namespace {

constexpr double kUnit = 1024;
constexpr std::int64_t kMaxParts = 8;  // of a facet along z, each of one number a slab
constexpr double kUsualPixels = 4;     // that layers are thick: decides alone which of two bounds a facet goes to

double along_z(const Triangle& t) {
  return std::abs((static_cast<double>(t.b.x) - t.a.x) * (static_cast<double>(t.c.y) - t.a.y) -
                  (static_cast<double>(t.b.y) - t.a.y) * (static_cast<double>(t.c.x) - t.a.x)) /
         2;
}
double along_x(const Triangle& t) {
  return std::abs((static_cast<double>(t.b.y) - t.a.y) * (static_cast<double>(t.c.z) - t.a.z) -
                  (static_cast<double>(t.b.z) - t.a.z) * (static_cast<double>(t.c.y) - t.a.y)) /
         2;
}

std::int64_t units(double amount) { return static_cast<std::int64_t>(std::ceil(amount * kUnit * (1 + 1e-9))); }

}  // namespace

struct HeldBound::Facet {
  Triangle t;           // corners by height
  bool suspect;         // meets others: samples may say anything
  bool flat;            // shares that pass levels are fewer than its voxels
  double area, levels;  // in plan view, voxels; along x, levels x nm
  double low, middle, high;
  double rise() const { return high - low; }
  /// Voxels that a way along x and one along y pass.
  Sums way(double x, double y, double share) const {
    // Rows count once more, for what lies between stretches of voxels; of flat facets two changes a row.
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
  Cluster slack;
  for (std::uint32_t c = 0; c < bounds.size(); ++c) {
    const Cluster& cluster = mesh.cluster(c, slack);
    for (std::uint32_t lane = 0; lane < kClusterSize; ++lane) add(cluster.triangle(lane), (suspects[c] >> lane & 1) != 0);
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
  const double area = along_z(t), side = along_x(t);
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
void HeldBound::spread(std::int64_t first, std::int64_t end, const Sums& within, const Sums& cut) {
  slab(first).below.add(within, 1), slab(first).cut.add(cut, 1);
  slab(end).below.add(within, -1), slab(end).cut.add(cut, -1);
}

void HeldBound::add_edge(const Facet& facet, const Point3& a, const Point3& b) {
  const double x = std::abs(static_cast<double>(b.x) - a.x) * columns_per_nm_;
  const double y = std::abs(static_cast<double>(b.y) - a.y) * rows_per_nm_;
  const double rise = static_cast<double>(b.z) - a.z, height = std::ldexp(1.0, static_cast<int>(shift_));
  const Sums way = facet.way(x, y, rise > height ? height / rise : 1);
  const std::int64_t first = slab_of(a.z);
  if (rise == 0 && (first + first_) << shift_ == a.z) return slab(first).floor.add(way, 1);
  spread(first, slab_of(std::max<std::int64_t>(a.z, std::int64_t{b.z} - 1)) + 1, way, {});
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
    return spread(first, first + 1, within(1), {});
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
  for (std::int64_t p = 0; p < parts; ++p) {
    const std::int64_t from = first + slabs * p / parts, end = first + slabs * (p + 1) / parts;
    const double bottom = std::max(low, static_cast<double>((from + first_) << shift_));
    const double top = std::min(high, static_cast<double>((end + first_) << shift_));
    const double maximum = bottom <= middle && middle <= top ? 1 : std::max(tent(bottom), tent(top));
    const double share = end - from == 1 ? below(top) - below(bottom) : 2 * maximum * height / rise;
    spread(from, end, within(std::min(1.0, share)), f.way(x, y, maximum));
  }
}

HeldBound::HeldCount HeldBound::at(std::int64_t bottom, std::int64_t top) const {
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
  return {facets, voxels, runs, std::min(2 * runs, whole(static_cast<double>(sum.rows)) + kCorners * facets)};
}

}  // namespace lamina::coverage
