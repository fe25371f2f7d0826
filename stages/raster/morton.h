// stages/raster/morton.h: places along a Morton curve through a box, and the order of many triangles along it.
//
// Source: G. M. Morton, "A computer oriented geodetic data base and a new technique in file sequencing", IBM (1966).
#pragma once

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/mesh.h"

namespace lamina::raster {

/// Curve of kBits bits an axis (at most 10) through the cube around a box.
template <std::uint32_t kBits>
class MortonCurve {
 public:
  explicit MortonCurve(const Box& box) : lo_(box.lo) {
    const std::int64_t side = std::max({box.width(), box.depth(), box.height(), std::int64_t{1}});
    scale_ = ((1u << kBits) - 1) / static_cast<double>(side);
  }
  /// p within the box.
  std::uint32_t operator()(const Point3& p) const {
    const auto step = [this](Nm at, Nm lo) {
      return spread(static_cast<std::uint32_t>(static_cast<double>(std::int64_t{at} - lo) * scale_));
    };
    return step(p.x, lo_.x) | step(p.y, lo_.y) << 1 | step(p.z, lo_.z) << 2;
  }

 private:
  /// Spreads the low 10 bits of v to every third bit.
  static std::uint32_t spread(std::uint32_t v) {
    v = (v | (v << 16)) & 0x030000FF;
    v = (v | (v << 8)) & 0x0300F00F;
    v = (v | (v << 4)) & 0x030C30C3;
    v = (v | (v << 2)) & 0x09249249;
    return v;
  }
  Point3 lo_;
  double scale_;
};

/// Order of `total` triangles along a curve of 30 bits: split by the upper 10 (count, scan, fill), then each bucket
/// alone. triangle_at(i) gives the i-th triangle.
template <class TriangleAt>
Buffer<std::uint32_t> morton_order(std::uint32_t total, const Box& box, const TriangleAt& triangle_at) {
  struct Keyed {
    std::uint32_t key, triangle;
    bool operator<(const Keyed& other) const { return key != other.key ? key < other.key : triangle < other.triangle; }
  };
  constexpr std::uint32_t kFineBits = 20, kBuckets = 1u << 10;
  const MortonCurve<10> curve(box);
  const std::uint32_t chunk = std::max(1u << 14, (total + 63) / 64);
  const std::uint32_t chunks = (total + chunk - 1) / chunk;

  Buffer<std::uint32_t> key(total);
  std::vector<std::uint32_t> place(std::size_t{chunks} * kBuckets, 0);
  tbb::parallel_for(0u, chunks, [&](std::uint32_t c) {
    std::uint32_t* count = place.data() + std::size_t{c} * kBuckets;
    const std::uint32_t end = std::min(total, (c + 1) * chunk);
    for (std::uint32_t t = c * chunk; t < end; ++t) {
      key[t] = curve(triangle_at(t).a);
      ++count[key[t] >> kFineBits];
    }
  });
  std::vector<std::uint32_t> bucket_begin(kBuckets + 1, total);
  std::uint32_t running = 0;
  for (std::uint32_t b = 0; b < kBuckets; ++b) {
    bucket_begin[b] = running;
    for (std::uint32_t c = 0; c < chunks; ++c) running += std::exchange(place[std::size_t{c} * kBuckets + b], running);
  }
  Buffer<Keyed> keyed(total);
  tbb::parallel_for(0u, chunks, [&](std::uint32_t c) {
    std::uint32_t* next = place.data() + std::size_t{c} * kBuckets;
    const std::uint32_t end = std::min(total, (c + 1) * chunk);
    for (std::uint32_t t = c * chunk; t < end; ++t) keyed[next[key[t] >> kFineBits]++] = {key[t], t};
  });
  Buffer<std::uint32_t> order = std::move(key);
  tbb::parallel_for(0u, kBuckets, [&](std::uint32_t b) {
    tbb::parallel_sort(keyed.begin() + bucket_begin[b], keyed.begin() + bucket_begin[b + 1]);
    for (std::uint32_t i = bucket_begin[b]; i < bucket_begin[b + 1]; ++i) order[i] = keyed[i].triangle;
  });
  return order;
}

}  // namespace lamina::raster
