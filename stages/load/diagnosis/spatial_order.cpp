// stages/load/diagnosis/spatial_order.cpp: a counting sort by coarse cells, each part of the list on its own, then
// one by fine cells in each coarse one.
#include "stages/load/diagnosis/spatial_order.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <utility>

#include "stages/geometry/blocks/pages.h"

namespace lamina::load {
namespace {

constexpr std::uint32_t kParts = 16;
constexpr unsigned kBits = 7, kFineBits = 6;  // of a cell along an axis; of its Morton code within the coarse cell
constexpr std::uint32_t kCoarse = 1u << (3 * kBits - kFineBits), kFine = 1u << kFineBits;

/// A cube around a box, divided into 2^kBits cells along each axis.
class CubeCells {
 public:
  explicit CubeCells(const Box& bounds) : lo_(bounds.lo) {
    const std::uint64_t side = std::max({reach(lo_.x, bounds.hi.x), reach(lo_.y, bounds.hi.y), reach(lo_.z, bounds.hi.z)});
    shift_ = std::max(static_cast<int>(std::bit_width(side)) - static_cast<int>(kBits), 0);
    for (std::uint32_t i = 0; i < spread_.size(); ++i) {
      spread_[i] = 0;
      for (unsigned bit = 0; bit < kBits; ++bit) spread_[i] |= (i >> bit & 1) << 3 * bit;
    }
  }
  /// The Morton code of a point's cell.
  std::uint32_t operator()(const Point3& p) const {
    return along(lo_.x, p.x) | along(lo_.y, p.y) << 1 | along(lo_.z, p.z) << 2;
  }

 private:
  static std::uint64_t reach(Nm lo, Nm hi) { return hi > lo ? static_cast<std::uint64_t>(std::int64_t{hi} - lo) : 0; }
  std::uint32_t along(Nm lo, Nm at) const {
    return spread_[std::min<std::uint64_t>(reach(lo, at) >> shift_, spread_.size() - 1)];
  }

  Point3 lo_;
  int shift_;
  std::array<std::uint32_t, 1u << kBits> spread_;  // Morton codes of cells along x
};

/// Turns how many facets each part has in each coarse cell into where they go. returns  the ends of cells
Buffer<std::uint32_t> begin_cells(Buffer<std::uint32_t>& parts) {
  Buffer<std::uint32_t> at(kCoarse);
  std::fill(at.begin(), at.end(), 0u);
  for (std::size_t i = 0; i < parts.size(); ++i) at[i % kCoarse] += parts[i];
  std::uint32_t end = 0;
  for (std::uint32_t& here : at) end += std::exchange(here, end);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    std::uint32_t& here = at[i % kCoarse];
    here += std::exchange(parts[i], here);
  }
  return at;
}

/// Puts facets of one coarse cell in the order of its fine ones.
void order_finely(std::span<std::uint32_t> facets, std::span<const std::uint32_t> code, Buffer<std::uint32_t>& scratch) {
  std::array<std::uint32_t, kFine> next{};
  for (const std::uint32_t f : facets) ++next[code[f] % kFine];
  std::uint32_t end = 0;
  for (std::uint32_t& here : next) end += std::exchange(here, end);
  scratch.assign(facets.begin(), facets.end());
  for (const std::uint32_t f : scratch) facets[next[code[f] % kFine]++] = f;
}

}  // namespace

Buffer<std::uint32_t> spatial_order(std::span<const Triangle> triangles, const Box& bounds) {
  const CubeCells cells(bounds);
  const auto from = [&](std::uint32_t part) { return triangles.size() * part / kParts; };
  Buffer<std::uint32_t> code(triangles.size()), next(std::size_t{kParts} * kCoarse), order(triangles.size());
  prefer_large_pages(code);
  prefer_large_pages(order);
  tbb::parallel_for(std::uint32_t{0}, kParts, [&](std::uint32_t part) {
    std::uint32_t* const in = next.data() + std::size_t{part} * kCoarse;
    std::fill(in, in + kCoarse, 0u);
    for (std::size_t i = from(part); i < from(part + 1); ++i) ++in[(code[i] = cells(triangles[i].a)) / kFine];
  });
  const Buffer<std::uint32_t> ends = begin_cells(next);
  tbb::parallel_for(std::uint32_t{0}, kParts, [&](std::uint32_t part) {
    std::uint32_t* const in = next.data() + std::size_t{part} * kCoarse;
    for (std::size_t i = from(part); i < from(part + 1); ++i) order[in[code[i] / kFine]++] = static_cast<std::uint32_t>(i);
  });
  tbb::parallel_for(tbb::blocked_range<std::uint32_t>(0, kCoarse, 256), [&](const auto& range) {
    Buffer<std::uint32_t> scratch;
    for (std::uint32_t c = range.begin(); c != range.end(); ++c) {
      const std::uint32_t begin = c == 0 ? 0 : ends[c - 1];
      if (ends[c] - begin > 1) order_finely({order.data() + begin, ends[c] - begin}, code, scratch);
    }
  });
  return order;
}

}  // namespace lamina::load
