// stages/coverage/edges.h: where voxels end along a side of the bed.
#pragma once

#include <algorithm>
#include <cstdint>

#include "stages/data/buffer.h"
#include "stages/data/grid.h"

namespace lamina::coverage {

/// nm of the edge before pixel i; that of pixel `count` ends the last one.
constexpr std::int64_t edge(const PixelAxis& axis, std::int64_t i) { return i * axis.span / axis.dots; }

/// All edges of an axis; doubles hold them exactly. 8 bytes a pixel.
class Edges {
 public:
  explicit Edges(const PixelAxis& axis) : per_nm_(axis.pixels_per_nm()), count_(axis.count) {
    edge_.resize(std::size_t{axis.count} + 1 + kMore);
    for (std::uint32_t i = 0; i < edge_.size(); ++i) edge_[i] = static_cast<double>(edge(axis, i));
    narrowest_ = static_cast<double>(axis.span);
    for (std::uint32_t i = 0; i < axis.count; ++i) {
      widest_ = std::max(widest_, width(i));
      narrowest_ = std::min(narrowest_, width(i));
    }
  }

  /// A pixel at or before that of `nm` is at nm x per_nm(), one at or behind it at (nm + kBehind) x per_nm(): edges are up to
  /// 1 nm below i pixels.
  double per_nm() const { return per_nm_; }
  static constexpr double kBehind = 1.0625;

  /// kMore edges follow those of the axis, for who reads several at once.
  const double* data() const { return edge_.data(); }
  static constexpr std::uint32_t kMore = 16;

  double operator[](std::uint32_t i) const { return edge_[i]; }
  double width(std::uint32_t i) const { return edge_[i + 1] - edge_[i]; }
  double widest() const { return widest_; }
  double narrowest() const { return narrowest_; }
  std::uint32_t count() const { return count_; }
  std::uint64_t bytes() const { return bytes_held(edge_); }

  /// The pixel in which `nm` lies, the one behind if it lies on an edge; the nearest one of the bed.
  std::uint32_t at(double nm) const {
    const double guess = nm * per_nm_;
    auto i = guess <= 0 ? 0 : std::min(static_cast<std::uint32_t>(guess), count() - 1);
    while (i > 0 && edge_[i] > nm) --i;
    while (i + 1 < count() && edge_[i + 1] <= nm) ++i;
    return i;
  }

 private:
  double per_nm_;
  std::uint32_t count_;
  double widest_ = 0, narrowest_ = 0;
  Buffer<double> edge_;
};

}  // namespace lamina::coverage
