#include "stages/heights/steepest.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace lamina::heights {
namespace {

// Raises ranges of an array to at least a value, many times, and then tells every entry: level l of the table holds
// what was asked of stretches of 2^l entries; any range is two such stretches that may overlap. Handing levels down
// once at the end makes it O(1) a range. Ranges longer than a block are a range of blocks and two short ones, which
// keeps the table small.
class RangeRaiser {
 public:
  explicit RangeRaiser(std::uint32_t count)
      : count_(count), fine_(make_levels(count, kBlockBits + 2)), coarse_(make_levels((count >> kBlockBits) + 1, 32)) {}

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
  static constexpr std::uint32_t kBlockBits = 6, kMask = (1u << kBlockBits) - 1;
  using Levels = std::vector<Buffer<Steepness>>;

  static Levels make_levels(std::uint32_t count, std::uint32_t most) {
    Levels levels(std::min<std::uint32_t>(std::bit_width(count), most));
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

}  // namespace

Buffer<Steepness> steepest_in_cells(const SurfaceIndex& index, std::span<const PartSurface> parts, const Ladder& ladder) {
  RangeRaiser raiser(ladder.cells());
  for (const PartSurface& part : parts) {
    for_each_slope(index, part, [&](Nm lo, Nm hi, Steepness steepness, double) {
      const auto [first, last] = ladder.cells_between(lo, hi);
      if (first < last) raiser.raise(first, last, steepness);
    });
  }
  return raiser.finish();
}

Buffer<Steepness> steepest_at_rungs(const SurfaceIndex& index, std::span<const PartSurface> parts, const Ladder& ladder) {
  RangeRaiser raiser(ladder.rungs());
  for (const PartSurface& part : parts) {
    for_each_slope(index, part, [&](Nm lo, Nm hi, Steepness steepness, double) {
      const std::uint32_t first = ladder.rungs_up_to(lo), last = ladder.rungs_up_to(hi);
      if (first < last) raiser.raise(first, last, steepness);
    });
  }
  return raiser.finish();
}

Buffer<double> projected_below(const SurfaceIndex& index, std::span<const PartSurface> parts, const Ladder& ladder,
                               Sign sign) {
  // Within a cell: what lies in it; slope: mm2 per nm that begins (or ends) to cover whole cells at a rung.
  Buffer<double> within(ladder.rungs(), 0.0), slope(ladder.rungs() + 1, 0.0);
  for (const PartSurface& part : parts) {
    for_each_slope(index, part, [&](Nm lo, Nm hi, Steepness, double projected) {
      const auto [first, last] = ladder.cells_between(lo, hi);
      if (first >= last) return;
      const double mm2 = sign == Sign::kBoth ? std::abs(projected) : projected;
      if (last - first == 1 && lo >= ladder[first] && hi <= ladder[last]) {
        within[first] += mm2;
        return;
      }
      const double density = mm2 / (static_cast<double>(hi) - lo);
      const auto share = [&](std::uint32_t cell) {
        return density * static_cast<double>(std::min<std::int64_t>(hi, ladder[cell + 1]) -
                                             std::max<std::int64_t>(lo, ladder[cell]));
      };
      within[first] += share(first);
      if (last - first < 2) return;
      within[last - 1] += share(last - 1);
      if (last - first < 3) return;
      slope[first + 1] += density;
      slope[last - 1] -= density;
    });
  }
  Buffer<double> below(ladder.rungs(), 0.0);
  double density = 0;
  for (std::uint32_t cell = 0; cell < ladder.cells(); ++cell) {
    density += slope[cell];
    below[cell + 1] = below[cell] + within[cell] + density * static_cast<double>(ladder[cell + 1] - ladder[cell]);
  }
  return below;
}

}  // namespace lamina::heights
