#include "stages/pores/tortuosity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <vector>

namespace lamina::pores {
namespace {

using VoxelIndex = std::array<std::uint32_t, 3>;

constexpr std::uint32_t kUnit = 4096;  // of the shortest edge
constexpr std::uint32_t kSolid = UINT32_MAX, kUnreached = UINT32_MAX - 1;
constexpr std::uint32_t kMaxDistance = UINT32_MAX - (1u << 24);

class PathSearch {
 public:
  PathSearch(const VoxelView& solid, const VoxelWindow& window, std::size_t axis) : axis_(axis) {
    const Nm shortest = std::min({solid.edge[0], solid.edge[1], solid.edge[2]});
    for (std::size_t i = 0; i < 3; ++i) {
      n_[i] = window.size(static_cast<int>(i));
      periodic_[i] = i != axis && solid.periodic[i] && n_[i] == solid.size()[i];
      step_[i] = static_cast<double>(solid.edge[i]) / static_cast<double>(shortest) * kUnit;
    }
    stride_ = {1, n_[0], std::size_t{n_[0]} * n_[1]};
    way_.assign(stride_[2] * n_[2], kUnreached);
    for (std::uint32_t z = 0; z < n_[2]; ++z) {
      for (std::uint32_t y = 0; y < n_[1]; ++y) {
        const auto row = solid.row(y + window.begin[1], z + window.begin[2]);
        for (std::size_t i = 0; i < row.size(); i += 2) {
          const std::uint32_t from = std::max(row[i], window.begin[0]), to = std::min(row[i + 1], window.end[0]);
          for (std::uint32_t x = from; x < to; ++x) way_[x - window.begin[0] + stride_[1] * y + stride_[2] * z] = kSolid;
        }
      }
    }
    for (std::uint32_t bits = 1; bits < 8; ++bits) {
      double squared = 0;
      for (std::size_t i = 0; i < 3; ++i) squared += (bits >> i & 1) != 0 ? step_[i] * step_[i] : 0;
      length_[bits] = static_cast<std::uint32_t>(std::lround(std::sqrt(squared)));
    }
    // As many as the longest step, so that no two ways that wait share a bucket by chance.
    std::size_t buckets = 1;
    while (buckets <= length_[7]) buckets *= 2;
    waiting_.resize(buckets);
  }

  void run() {
    std::uint64_t count = 0;
    for_each_of_face(0, [&](std::size_t at) {
      if (way_[at] == kUnreached) count += reach(at, 0);
    });
    const std::size_t mask = waiting_.size() - 1;
    std::vector<std::uint64_t> now;
    for (std::uint32_t way = 0; count > 0; ++way) {
      std::vector<std::uint64_t>& bucket = waiting_[way & mask];
      if (bucket.empty()) continue;
      if (way > kMaxDistance) throw std::length_error("a way through the void has more than 2^20 voxels");
      now.clear();
      now.swap(bucket);
      count -= now.size();
      for (const std::uint64_t at : now) {
        if (way_[at] == way) count += leave(at, way);
      }
    }
  }

  Tortuosity result() const {
    Tortuosity sum;
    double paths = 0;
    const double thickness = (n_[axis_] - 1.0) * step_[axis_];
    for_each_of_face(n_[axis_] - 1, [&](std::size_t at) {
      if (way_[at] == kSolid) return;
      ++sum.outlet;
      if (way_[at] == kUnreached) return;
      const double ratio = thickness > 0 ? way_[at] / thickness : 1;
      sum.minimum = sum.reached == 0 ? ratio : std::min(sum.minimum, ratio);
      sum.maximum = std::max(sum.maximum, ratio);
      ++sum.reached;
      paths += ratio;
    });
    if (sum.reached > 0) sum.mean = paths / static_cast<double>(sum.reached);
    return sum;
  }

 private:
  template <class Take>
  void for_each_of_face(std::uint32_t at, const Take& take) const {
    const std::size_t u = (axis_ + 1) % 3, v = (axis_ + 2) % 3;
    for (std::uint32_t j = 0; j < n_[v]; ++j) {
      for (std::uint32_t i = 0; i < n_[u]; ++i) take(at * stride_[axis_] + i * stride_[u] + j * stride_[v]);
    }
  }

  std::uint32_t reach(std::size_t at, std::uint32_t way) {
    way_[at] = way;
    waiting_[way & (waiting_.size() - 1)].push_back(at);
    return 1;
  }

  /// By how much the index of a voxel grows with a step along an axis; false at an end.
  bool step(const VoxelIndex& from, std::size_t i, int side, std::ptrdiff_t& by) const {
    const bool leaves = side < 0 ? from[i] == 0 : from[i] + 1 == n_[i];
    if (leaves && !periodic_[i]) return false;
    by = side * static_cast<std::ptrdiff_t>(stride_[i] * (leaves ? 1 - std::ptrdiff_t{n_[i]} : 1));
    return true;
  }

  // In each of the eight corners around a voxel, whose bits tell along which axes a neighbour lies.
  std::uint64_t leave(std::size_t at, std::uint32_t way) {
    const VoxelIndex from{static_cast<std::uint32_t>(at % n_[0]), static_cast<std::uint32_t>(at / stride_[1] % n_[1]),
                          static_cast<std::uint32_t>(at / stride_[2])};
    std::uint64_t count = 0;
    for (int corner = 0; corner < 8; ++corner) {
      std::array<std::ptrdiff_t, 3> by{};
      std::array<bool, 8> open{};  // by a way through faces
      open[0] = true;
      std::array<bool, 3> is{};
      for (std::size_t i = 0; i < 3; ++i) is[i] = step(from, i, (corner >> i & 1) != 0 ? 1 : -1, by[i]);
      for (std::uint32_t bits = 1; bits < 8; ++bits) {
        std::ptrdiff_t to = static_cast<std::ptrdiff_t>(at);
        bool there = true, around = false;
        for (std::size_t i = 0; i < 3; ++i) {
          if ((bits >> i & 1) == 0) continue;
          there = there && is[i];
          to += by[i];
          around = around || open[bits & ~(1u << i)];
        }
        if (!there || !around) continue;
        std::uint32_t& known = way_[static_cast<std::size_t>(to)];
        if (known == kSolid) continue;
        open[bits] = true;
        const std::uint32_t longer = way + length_[bits];
        if (longer < known) count += reach(static_cast<std::size_t>(to), longer);
      }
    }
    return count;
  }

  std::size_t axis_;
  VoxelIndex n_{};
  std::array<bool, 3> periodic_{};
  std::array<double, 3> step_{};
  std::array<std::size_t, 3> stride_{};
  std::array<std::uint32_t, 8> length_{};  // of steps, by the axes along which they go
  Buffer<std::uint32_t> way_;
  std::vector<std::vector<std::uint64_t>> waiting_;  // voxels by the length of their way, modulo their count
};

}  // namespace

Tortuosity tortuosity(const VoxelView& solid, const VoxelWindow& window, int axis) {
  const auto a = static_cast<std::size_t>(axis);
  if (window.size(0) == 0 || window.size(1) == 0 || window.size(2) == 0) return {};
  PathSearch paths(solid, window, a);
  paths.run();
  return paths.result();
}

}  // namespace lamina::pores
