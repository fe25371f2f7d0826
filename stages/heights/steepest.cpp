#include "stages/heights/steepest.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

namespace lamina::heights {

namespace {

// Raises ranges of an array to at least a value, many times, and then returns every entry: level l of the table contains
// the values set for intervals of 2^l entries; any range is two such intervals that may overlap. Handing levels down
// once at the end makes it O(1) a range. Ranges longer than a block are a range of blocks and two short ones, which
// keeps the table small.
class RangeRaiser {
 public:
  static constexpr std::uint32_t kLevels = 12;

  explicit RangeRaiser(std::uint32_t count)
      : count_(count), fine_(make_levels(count, kLevels)), coarse_(make_levels((count >> kBlockBits) + 1, 32)) {}

  void raise(std::uint32_t first, std::uint32_t last, Steepness value) {  // [first, last)
    if (last - first < (2u << kBlockBits)) return raise(fine_, first, last, value);
    const std::uint32_t whole_first = (first + kMask) >> kBlockBits, whole_last = last >> kBlockBits;
    raise(coarse_, whole_first, whole_last, value);
    if (first < whole_first << kBlockBits) raise(fine_, first, whole_first << kBlockBits, value);
    if (whole_last << kBlockBits < last) raise(fine_, whole_last << kBlockBits, last, value);
  }

  Buffer<Steepness> finish() {
    hand_down(coarse_);
    hand_down(fine_);
    Buffer<Steepness>& all = fine_.front();
    for (std::uint32_t i = 0; i < count_; ++i) all[i] = std::max(all[i], coarse_.front()[i >> kBlockBits]);
    return std::move(all);
  }

 private:
  static constexpr std::uint32_t kBlockBits = kLevels - 2, kMask = (1u << kBlockBits) - 1;
  using Levels = std::vector<Buffer<Steepness>>;

  static Levels make_levels(std::uint32_t count, std::uint32_t maximum) {
    Levels levels(std::min<std::uint32_t>(std::bit_width(count), maximum));
    for (auto& level : levels) level.assign(count, 0);
    return levels;
  }
  static void raise(Levels& levels, std::uint32_t first, std::uint32_t last, Steepness value) {
    const std::uint32_t l = std::bit_width(last - first) - 1;
    Buffer<Steepness>& level = levels[l];
    level[first] = std::max(level[first], value);
    Steepness& second = level[last - (1u << l)];
    second = std::max(second, value);
  }
  static void hand_down(Levels& levels) {
    for (std::size_t l = levels.size(); l-- > 1;) {
      const std::uint32_t half = 1u << (l - 1);
      const Buffer<Steepness>& from = levels[l];
      Buffer<Steepness>& to = levels[l - 1];
      const auto count = static_cast<std::uint32_t>(from.size());
      for (std::uint32_t i = 0; i < count; ++i) to[i] = std::max(to[i], from[i]);
      for (std::uint32_t i = half; i < count; ++i) to[i] = std::max(to[i], from[i - half]);
    }
  }

  std::uint32_t count_;
  Levels fine_, coarse_;
};

struct FacetRange {
  std::uint32_t first, last;
};

// The largest |n_z| of all facets by the range of entries that each covers. Every share raises entries of its own; the
// larger of two is the same in any order.
template <class RangeOf>
Buffer<Steepness> steepest_by(const SurfaceIndex& index, std::span<const PartSurface> parts, std::uint32_t entries, Slope slope,
                              const RangeOf& range_of) {
  const std::uint32_t shares = worthwhile_shares(index, parts, RangeRaiser::kLevels * entries);
  std::vector<Buffer<Steepness>> found(shares);
  tbb::parallel_for(0u, shares, [&](std::uint32_t share) {
    RangeRaiser raiser(entries);
    const auto raise = [&](Nm lo, Nm hi, Steepness steepness, double) {
      const FacetRange range = range_of(lo, hi);
      if (range.first < range.last) raiser.raise(range.first, range.last, steepness);
    };
    for (const PartSurface& part : parts) for_each_slope(index, part, share, shares, raise, slope);
    found[share] = raiser.finish();
  });
  for (std::uint32_t share = 1; share < shares; ++share) {
    for (std::uint32_t i = 0; i < entries; ++i) found[0][i] = std::max(found[0][i], found[share][i]);
  }
  return std::move(found[0]);
}

// What facets put below each candidate; sums of floating point, so shares are joined in their order.
struct Spread {
  Buffer<double> within;  // mm2 inside of a cell
  Buffer<double> slope;   // mm2 per nm that begins (or ends) to cover whole cells at a candidate
  explicit Spread(std::uint32_t candidates) : within(candidates, 0.0), slope(candidates + 1, 0.0) {}

  void add(const CandidateHeights& candidate_heights, Nm lo, Nm hi, double mm2) {
    const auto [first, last] = candidate_heights.cells_between(lo, hi);
    if (first >= last) return;
    if (last - first == 1 && lo >= candidate_heights[first] && hi <= candidate_heights[last]) {
      within[first] += mm2;
      return;
    }
    const double density = mm2 / (static_cast<double>(hi) - lo);
    const auto share = [&](std::uint32_t cell) {
      return density * static_cast<double>(std::min<std::int64_t>(hi, candidate_heights[cell + 1]) -
                                           std::max<std::int64_t>(lo, candidate_heights[cell]));
    };
    within[first] += share(first);
    if (last - first < 2) return;
    within[last - 1] += share(last - 1);
    if (last - first < 3) return;
    slope[first + 1] += density;
    slope[last - 1] -= density;
  }
  void add(const Spread& other) {
    for (std::size_t i = 0; i < within.size(); ++i) within[i] += other.within[i];
    for (std::size_t i = 0; i < slope.size(); ++i) slope[i] += other.slope[i];
  }
};

}  // namespace

Buffer<Steepness> steepest_in_cells(const SurfaceIndex& index, std::span<const PartSurface> parts,
                                    const CandidateHeights& candidate_heights, Slope slope) {
  return steepest_by(index, parts, candidate_heights.cells(), slope, [&](Nm lo, Nm hi) {
    const auto [first, last] = candidate_heights.cells_between(lo, hi);
    return FacetRange{first, last};
  });
}

Buffer<Steepness> steepest_at_candidates(const SurfaceIndex& index, std::span<const PartSurface> parts,
                                         const CandidateHeights& candidate_heights, Slope slope) {
  return steepest_by(index, parts, candidate_heights.candidates(), slope, [&](Nm lo, Nm hi) {
    return FacetRange{candidate_heights.candidates_up_to(lo), candidate_heights.candidates_up_to(hi)};
  });
}

Buffer<double> projected_below(const SurfaceIndex& index, std::span<const PartSurface> parts,
                               const CandidateHeights& candidate_heights, Sign sign) {
  const std::uint32_t shares = worthwhile_shares(index, parts, 4 * candidate_heights.candidates());  // doubles of two arrays
  std::vector<std::optional<Spread>> spreads(shares);
  tbb::parallel_for(0u, shares, [&](std::uint32_t share) {
    Spread& spread = spreads[share].emplace(candidate_heights.candidates());
    for (const PartSurface& part : parts) {
      for (const PlacedSurface& placed : part.placed) {
        const MeshSlopes& mesh = index.meshes[placed.mesh];
        for_each_slope(mesh, placed, share, shares, [&](Nm lo, Nm hi, Steepness, double projected) {
          spread.add(candidate_heights, lo, hi, sign == Sign::kBoth ? std::abs(projected) * mesh.step_share : projected);
        });
      }
    }
  });
  Spread& all = *spreads[0];
  for (std::uint32_t share = 1; share < shares; ++share) all.add(*spreads[share]);
  Buffer<double> below(candidate_heights.candidates(), 0.0);
  double density = 0;
  for (std::uint32_t cell = 0; cell < candidate_heights.cells(); ++cell) {
    density += all.slope[cell];
    below[cell + 1] =
        below[cell] + all.within[cell] + density * static_cast<double>(candidate_heights[cell + 1] - candidate_heights[cell]);
  }
  return below;
}

Buffer<double> section_at_candidates(const SurfaceIndex& index, const CandidateHeights& candidate_heights, Nm tolerance) {
  Buffer<double> section = projected_below(index, index.parts, candidate_heights, Sign::kUpMinusDown);
  std::vector<std::pair<std::int64_t, double>> faces;  // horizontal ones change the section at once
  for (const PartSurface& part : index.parts) {
    for (const PlacedSurface& placed : part.placed) {
      for (const FlatFacet& flat : index.meshes[placed.mesh].flats) {
        faces.emplace_back(std::int64_t{flat.height} + placed.raise, (flat.up ? flat.mm2 : -flat.mm2) * placed.copies);
      }
    }
  }
  std::ranges::stable_sort(faces, {}, &std::pair<std::int64_t, double>::first);
  double flat = 0;
  std::size_t next = 0;
  for (std::uint32_t candidate = 0; candidate < candidate_heights.candidates(); ++candidate) {
    for (; next < faces.size() && faces[next].first <= candidate_heights[candidate] + tolerance; ++next)
      flat += faces[next].second;
    section[candidate] = std::max(0.0, -flat - section[candidate]);
  }
  return section;
}

}  // namespace lamina::heights
