#include "stages/pores/passages.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "stages/pores/parts.h"
#include "stages/pores/rows.h"

namespace lamina::pores {
namespace {

constexpr float kFar = std::numeric_limits<float>::infinity();

/// Distances along a line from those that its voxels have: the lowest of the parabolas that stand on each of them.
class DistanceRow {
 public:
  /// values  count of them, `stride` apart
  void lower(float* values, std::size_t stride, std::uint32_t count, bool periodic, double step_squared) {
    const auto n = static_cast<std::int64_t>(count);
    // What is farther than half of a period has a copy that is nearer.
    const std::int64_t first = periodic ? -n / 2 - 1 : 0, end = periodic ? n + n / 2 + 1 : n;
    value_.resize(count);
    for (std::uint32_t i = 0; i < count; ++i) value_[i] = values[i * stride];
    set_.clear();
    from_.clear();
    std::int64_t wrapped = (first + 2 * n) % n;
    for (std::int64_t at = first; at < end; ++at) {
      const double height = value_[static_cast<std::size_t>(wrapped)];
      if (++wrapped == n) wrapped = 0;
      if (height == static_cast<double>(kFar)) continue;
      double from = -std::numeric_limits<double>::infinity();
      while (!set_.empty()) {
        from = crossing(set_.back(), {at, height}, step_squared);
        if (from > from_.back()) break;
        set_.pop_back();
        from_.pop_back();
      }
      if (set_.empty()) from = -std::numeric_limits<double>::infinity();
      set_.push_back({at, height});
      from_.push_back(from);
    }
    if (set_.empty()) return;
    std::size_t k = 0;
    for (std::int64_t i = 0; i < n; ++i) {
      while (k + 1 < from_.size() && from_[k + 1] <= static_cast<double>(i)) ++k;
      const auto away = static_cast<double>(i - set_[k].at);
      values[static_cast<std::size_t>(i) * stride] = static_cast<float>(set_[k].height + step_squared * away * away);
    }
  }

 private:
  struct PlacedPart {
    std::int64_t at;
    double height;
  };
  static double crossing(const PlacedPart& a, const PlacedPart& b, double step_squared) {
    const auto p = static_cast<double>(a.at), q = static_cast<double>(b.at);
    return ((b.height + step_squared * q * q) - (a.height + step_squared * p * p)) / (2 * step_squared * (q - p));
  }
  std::vector<float> value_;
  std::vector<PlacedPart> set_;
  std::vector<double> from_;
};

/// 0 in the solid of a row of the window, infinite elsewhere.
void mark(std::span<const std::uint32_t> row, std::uint32_t begin, std::uint32_t end, float* out) {
  std::fill(out, out + (end - begin), kFar);
  for (std::size_t i = 0; i < row.size(); i += 2) {
    const std::uint32_t from = std::max(row[i], begin), to = std::min(row[i + 1], end);
    if (from < to) std::fill(out + (from - begin), out + (to - begin), 0.0f);
  }
}

}  // namespace

VoxelWindow whole(const VoxelView& box) { return {{0, 0, 0}, box.size()}; }

Distances distances(const VoxelView& solid, const VoxelWindow& window) {
  Distances result{window, {}, std::min({solid.edge[0], solid.edge[1], solid.edge[2]}), {}};
  const std::array<std::uint32_t, 3> n{window.size(0), window.size(1), window.size(2)}, all = solid.size();
  std::array<double, 3> step_squared{};
  for (std::size_t i = 0; i < 3; ++i) {
    result.periodic[i] = solid.periodic[i] && n[i] == all[i];
    const double step = static_cast<double>(solid.edge[i]) / static_cast<double>(result.unit);
    step_squared[i] = step * step;
  }
  const std::size_t slice = std::size_t{n[0]} * n[1];
  result.squared.resize(slice * n[2]);
  float* const squared = result.squared.data();
  tbb::enumerable_thread_specific<DistanceRow> lines;
  tbb::parallel_for(std::uint32_t{0}, n[2], [&](std::uint32_t z) {
    DistanceRow& line = lines.local();
    float* const first = squared + slice * z;
    for (std::uint32_t y = 0; y < n[1]; ++y) {
      float* const row = first + std::size_t{n[0]} * y;
      mark(solid.row(y + window.begin[1], z + window.begin[2]), window.begin[0], window.end[0], row);
      line.lower(row, 1, n[0], result.periodic[0], step_squared[0]);
    }
    for (std::uint32_t x = 0; x < n[0]; ++x) line.lower(first + x, n[0], n[1], result.periodic[1], step_squared[1]);
  });
  tbb::parallel_for(std::uint32_t{0}, n[1], [&](std::uint32_t y) {
    DistanceRow& line = lines.local();
    float* const first = squared + std::size_t{n[0]} * y;
    for (std::uint32_t x = 0; x < n[0]; ++x) line.lower(first + x, slice, n[2], result.periodic[2], step_squared[2]);
  });
  return result;
}

namespace {

class Passage {
 public:
  Passage(const VoxelView& solid, const VoxelWindow& window) : distances_(distances(solid, window)) {
    box_.nx = window.size(0), box_.ny = window.size(1), box_.nz = window.size(2);
    box_.periodic = distances_.periodic;
    const Nm longest = std::max({solid.edge[0], solid.edge[1], solid.edge[2]});
    cubes_ = longest == distances_.unit;
    wall_ = static_cast<double>(longest) / static_cast<double>(distances_.unit);
    for (const float squared : distances_.squared) max_ = std::max(max_, squared);
  }

  double diameter_mm(int axis) {
    if (box_.voxels() == 0) return 0;
    if (max_ == std::numeric_limits<float>::infinity()) return max_;
    const double parts = cubes_ ? 1 : 64;  // of a squared unit; distances of cubes are whole
    // Through at `low`, not at `high`.
    auto low = std::int64_t{0}, high = static_cast<std::int64_t>(std::floor(max_ * parts)) + 1;
    while (high - low > 1) {
      const std::int64_t middle = low + (high - low) / 2;
      (leads_through(static_cast<float>(static_cast<double>(middle) / parts), axis) ? low : high) = middle;
    }
    if (low == 0) return 0;
    const double diameter = 2 * std::sqrt(static_cast<double>(low) / parts) - wall_;
    return std::max(0.0, diameter * mm(distances_.unit));
  }

 private:
  bool leads_through(float minimum, int axis) {
    const float* const squared = distances_.squared.data();
    const std::uint32_t nx = box_.nx;
    make_rows(box_, far_, [&](std::size_t r, const auto& take) {
      const float* const row = squared + r * nx;
      bool before = false;
      for (std::uint32_t x = 0; x < nx; ++x) {
        const bool now = row[x] >= minimum;
        if (now != before) take(x);
        before = now;
      }
      if (before) take(nx);
    });
    const Parts parts = parts_of(far_);
    for (std::size_t p = 0; p < parts.size(); ++p) {
      if (parts.through(p, axis)) return true;
    }
    return false;
  }

  Distances distances_;
  VoxelView box_;
  VoxelStack far_;
  bool cubes_ = true;
  double wall_ = 1;
  float max_ = 0;
};

}  // namespace

std::array<double, 3> throats(const VoxelView& solid, const VoxelWindow& window, std::array<bool, 3> axes) {
  Passage passage(solid, window);
  std::array<double, 3> diameters{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (axes[axis]) diameters[axis] = passage.diameter_mm(static_cast<int>(axis));
  }
  return diameters;
}

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

  // In each of the eight corners around a voxel, whose bits give the axes along which a neighbour is.
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
