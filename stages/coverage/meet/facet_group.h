// stages/coverage/meet/facet_group.h: whether two facets meet, exactly, and sixteen facets that lie near each other, as kernels
// compare them in pairs.
#pragma once

#include <array>
#include <cstdint>

#include "stages/data/choices.h"
#include "stages/data/mesh.h"

namespace lamina::coverage {

/// A facet and its doubled area normal, which is exact where corners differ by less than 2^31 nm.
struct Plane {
  Triangle facet;
  std::int64_t nx, ny, nz;

  Plane() = default;
  explicit Plane(const Triangle& t);
  bool flat() const { return nx == 0 && ny == 0 && nz == 0; }  // no area
};

/// True if they do; also where they come too near for doubles to decide. Both have area.
/// shared  corners that both have
/// Source: separating axes of convex bodies (S. Gottschalk, 1996); coplanar and touching ones are decided in integers
bool triangles_meet(const Plane& f, const Plane& g, int& shared);

inline constexpr std::uint32_t kGroupSize = 16;

/// Sixteen boxes, coordinate by coordinate; unused ones are empty.
struct alignas(64) BoxLanes {
  Nm low[3][kGroupSize], high[3][kGroupSize];

  BoxLanes();
  void set(std::uint32_t lane, const Box& box);
};

/// Facets with area, coordinate by coordinate, and four planes of each: its own, and through each edge the one that stands on
/// it and faces away from the facet. A plane's value at p is normal . (p - corner 0), less `offset` where it does not hold
/// corner 0; what rounding can change of it is below `slack` x the sum of |p - corner 0| along the axes (and `reach` for that
/// one).
struct alignas(64) FacetGroup {
  Nm corner[3][3][kGroupSize];  // [corner][axis][lane]
  BoxLanes box;
  float normal[4][3][kGroupSize];  // own, edges 0-1, 1-2, 2-0
  float slack[4][kGroupSize];
  float offset[kGroupSize],
      reach[kGroupSize];  // of edge 1-2: its value at corner 0 with the sign turned, |corner 1 - corner 0|
  std::uint32_t number[kGroupSize];
  std::uint32_t used = 0;  // lanes

  void start();
  void add(const Triangle& facet, std::uint32_t its_number);
  Triangle facet(std::uint32_t lane) const;
};

/// Pairs of facets of two groups whose boxes touch: what has to be known or decided of them.
struct FoundPairs {
  struct FacetEdges {
    std::uint8_t a, b, edge_a, edge_b;  // lanes; edges from those corners to the next, walked opposite ways
  };
  struct Pair {
    std::uint8_t a, b;
  };
  static constexpr std::size_t kMax = kGroupSize * kGroupSize;
  std::array<FacetEdges, 9 * kMax> edge;
  std::array<Pair, kMax> uncertain;  // may meet beyond what they share
  std::array<Pair, 9 * kMax> alike;  // walk an edge the same way
  std::uint32_t edges = 0, uncertain_count = 0, alikes = 0;
};

/// The same numbers with each instruction set.
struct PairKernels {
  /// Which of the boxes touch the box. A bit a lane.
  std::uint32_t (*touching)(const BoxLanes& boxes, const Box& box);
  /// All pairs of a facet of `a` with one of `b`, which lies in `around_b`, whose boxes touch; within a group (`a` is `b`) each
  /// once. Both groups fit into a box of kWidestPair. Facets that share an edge are no suspects if their normals are less than
  /// a right angle apart; others are not if one of their planes parts them, with the corner that both have on it.
  void (*pairs)(const FacetGroup& a, const FacetGroup& b, const Box& around_b, FoundPairs& found);
};
inline constexpr std::int64_t kWidestPair = std::int64_t{1} << 30;

/// isa  one that this processor has (geometry/isa.h), not kAuto
const PairKernels& pair_kernels_for(Isa isa);

namespace plain {
std::uint32_t touching(const BoxLanes& boxes, const Box& box);
void pairs(const FacetGroup& a, const FacetGroup& b, const Box& around_b, FoundPairs& found);
}  // namespace plain
namespace avx2 {
std::uint32_t touching(const BoxLanes& boxes, const Box& box);
void pairs(const FacetGroup& a, const FacetGroup& b, const Box& around_b, FoundPairs& found);
}  // namespace avx2
namespace avx512 {
std::uint32_t touching(const BoxLanes& boxes, const Box& box);
void pairs(const FacetGroup& a, const FacetGroup& b, const Box& around_b, FoundPairs& found);
}  // namespace avx512

}  // namespace lamina::coverage
