#include "stages/pores/distance.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

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

}  // namespace lamina::pores
