#include "stages/coverage/meet/facet_order.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "stages/coverage/meet/triangles_meet.h"

namespace lamina::coverage {
namespace {

constexpr std::uint64_t kNoFacet = UINT64_MAX;
constexpr int kKeyBits = 32, kMaxBits = 16;  // of a place along the curve; of one axis

/// Where points of a box come along the curve.
class Curve {
 public:
  explicit Curve(const Box& box) : low_{box.lo.x, box.lo.y, box.lo.z} {
    const std::array<std::int64_t, 3> side{box.width() + 1, box.depth() + 1, box.height() + 1};
    std::array<int, 3> bits{};
    std::array<int, kKeyBits> axis_of{};  // from the highest bit of a key on
    int used = 0;
    for (; used < kKeyBits; ++used) {
      int widest = -1;
      for (int axis = 0; axis < 3; ++axis) {
        if (bits[axis] == kMaxBits) continue;
        if (widest < 0 || (side[axis] >> bits[axis]) > (side[widest] >> bits[widest])) widest = axis;
      }
      axis_of[used] = widest;
      ++bits[widest];
    }
    for (int axis = 0; axis < 3; ++axis) {
      cells_[axis] = static_cast<double>((std::int64_t{1} << bits[axis])) / static_cast<double>(side[axis]);
      std::array<std::uint32_t, kMaxBits> position{};  // of each bit of the axis, from its highest on
      int next = 0;
      for (int k = 0; k < used; ++k) {
        if (axis_of[k] == axis) position[next++] = 1u << (kKeyBits - 1 - k);
      }
      for (std::uint32_t byte = 0; byte < 256; ++byte) {
        for (int bit = 0; bit < 8; ++bit) {
          if ((byte >> bit & 1) == 0) continue;
          if (bit < bits[axis]) spread_[axis][0][byte] |= position[bits[axis] - 1 - bit];
          if (bit + 8 < bits[axis]) spread_[axis][1][byte] |= position[bits[axis] - 1 - bit - 8];
        }
      }
    }
  }

  std::uint32_t key(const Triangle& t) const {
    return part(0, t.a.x, t.b.x, t.c.x) | part(1, t.a.y, t.b.y, t.c.y) | part(2, t.a.z, t.b.z, t.c.z);
  }

 private:
  /// The cell of the middle between the least and the most.
  std::uint32_t part(int axis, Nm a, Nm b, Nm c) const {
    const std::int64_t low = std::min(a, std::min(b, c)), high = std::max(a, std::max(b, c));
    const auto cell = static_cast<std::uint32_t>(static_cast<double>((low + high) / 2 - low_[axis]) * cells_[axis]);
    return spread_[axis][0][cell & 255] | spread_[axis][1][cell >> 8 & 255];
  }

  std::array<std::int64_t, 3> low_;
  std::array<double, 3> cells_{};
  std::array<std::array<std::array<std::uint32_t, 256>, 2>, 3> spread_{};
};

/// By the upper half, stably; entries without a facet are left out.
void sort_entries(Buffer<std::uint64_t>& entry) {
  constexpr int kDigit = 11, kPasses = 3;
  constexpr std::uint32_t kValues = 1u << kDigit;
  std::erase(entry, kNoFacet);
  Buffer<std::uint64_t> other;
  other.resize(entry.size());
  std::vector<std::uint32_t> position(std::size_t{kPasses} * kValues);
  const auto digit = [](std::uint64_t of, int pass) { return of >> (32 + kDigit * pass) & (kValues - 1); };
  for (const std::uint64_t of : entry) {
    for (int pass = 0; pass < kPasses; ++pass) ++position[pass * kValues + digit(of, pass)];
  }
  for (int pass = 0; pass < kPasses; ++pass) {
    std::uint32_t* const next = position.data() + pass * kValues;
    std::uint32_t total = 0;
    for (std::uint32_t value = 0; value < kValues; ++value) total += std::exchange(next[value], total);
    for (const std::uint64_t of : entry) other[next[digit(of, pass)]++] = of;
    std::swap(entry, other);
  }
}

Triangle facet_of(const MeshBlocks& mesh, std::uint32_t number) {
  return mesh.triangle(number / kClusterSize, number % kClusterSize);
}

}  // namespace

FacetOrder::FacetOrder(const MeshBlocks& mesh, const PairKernels& kernels) : kernels_(kernels) {
  sort(mesh);
  bound(mesh);
}

void FacetOrder::sort(const MeshBlocks& mesh) {
  Box all;
  for (const Box& box : mesh.bounds()) all.add(box);
  if (all.empty()) return;
  const Curve curve(all);
  Buffer<std::uint64_t> entry;
  entry.resize(std::size_t{mesh.cluster_count()} * kClusterSize);
  tbb::parallel_for(std::uint32_t{0}, mesh.cluster_count(), [&](std::uint32_t c) {
    Cluster slack;
    const Cluster& cluster = mesh.cluster(c, slack);
    for (std::uint32_t lane = 0; lane < kClusterSize; ++lane) {
      const std::uint32_t number = c * kClusterSize + lane;
      const Triangle t = cluster.triangle(lane);
      entry[number] = Plane(t).flat() ? kNoFacet : std::uint64_t{curve.key(t)} << 32 | number;
    }
  });
  sort_entries(entry);
  facet_.resize(entry.size());
  for (std::size_t i = 0; i < entry.size(); ++i) facet_[i] = static_cast<std::uint32_t>(entry[i]);
}

void FacetOrder::bound(const MeshBlocks& mesh) {
  box_.resize(groups());
  tbb::parallel_for(std::uint32_t{0}, groups(), [&](std::uint32_t g) {
    Box box;
    for (const std::uint32_t number : facets(g)) {
      const Triangle t = facet_of(mesh, number);
      box.add(t.a), box.add(t.b), box.add(t.c);
    }
    box_[g] = box;
  });
  std::span<const Box> below = box_;
  std::vector<Box> around;
  while (!below.empty()) {
    std::vector<BoxLanes>& level = levels_.emplace_back((below.size() + kGroupSize - 1) / kGroupSize);
    std::vector<Box> next(level.size());
    for (std::uint32_t i = 0; i < below.size(); ++i) {
      level[i / kGroupSize].set(i % kGroupSize, below[i]);
      next[i / kGroupSize].add(below[i]);
    }
    if (level.size() == 1) break;
    around = std::move(next);
    below = around;
  }
}

}  // namespace lamina::coverage
