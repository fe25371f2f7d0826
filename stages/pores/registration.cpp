#include "stages/pores/registration.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <optional>
#include <span>
#include <tuple>
#include <vector>

#include "stages/pores/rows.h"

namespace lamina::pores {
namespace {

/// Columns below `columns` that are set in row a alone, or from `offset` on in b alone.
void add_differences(Row a, Row b, std::uint32_t offset, std::uint32_t columns, Match& match) {
  std::size_t j = static_cast<std::size_t>(std::ranges::upper_bound(b, offset) - b.begin()), i = 0;
  std::uint32_t at = 0;
  while (at < columns) {
    const std::uint32_t next_a = i < a.size() ? a[i] : columns;
    const std::uint32_t next_b = j < b.size() ? std::min(b[j] - offset, columns) : columns;
    const std::uint32_t next = std::min({next_a, next_b, columns});
    const bool in_a = i % 2 == 1, in_b = j % 2 == 1;
    if (in_a && !in_b) match.only_small += next - at;
    if (in_b && !in_a) match.only_large += next - at;
    if (next_a == next && i < a.size()) ++i;
    if (next_b == next && j < b.size()) ++j;
    at = next;
  }
}

Match match_at(const VoxelView& small, const VoxelView& large, const std::array<std::uint32_t, 3>& from) {
  Match match;
  for (std::uint32_t z = 0; z < small.nz; ++z)
    for (std::uint32_t y = 0; y < small.ny; ++y)
      add_differences(small.row(y, z), large.row(y + from[1], z + from[2]), from[0], small.nx, match);
  return match;
}

constexpr std::uint32_t kBlock = 4;  // of the finest voxels, a side

/// Sum of the squares of what blocks have more in one box than in the other.
std::uint64_t squares_at(const VoxelView& small, const VoxelView& large, const std::array<std::uint32_t, 3>& from,
                         std::uint32_t side) {
  std::uint64_t sum = 0;
  Buffer<std::int32_t> blocks((small.nx + side - 1) / side);
  for (std::uint32_t z = 0; z < small.nz; z += side) {
    for (std::uint32_t y = 0; y < small.ny; y += side) {
      std::ranges::fill(blocks, 0);
      for (std::uint32_t k = z; k < std::min(z + side, small.nz); ++k) {
        for (std::uint32_t j = y; j < std::min(y + side, small.ny); ++j) {
          add_to_blocks(small.row(j, k), 0, small.nx, 1, side, blocks);
          add_to_blocks(large.row(j + from[1], k + from[2]), from[0], small.nx, -1, side, blocks);
        }
      }
      for (const std::int64_t more : blocks) sum += static_cast<std::uint64_t>(more * more);
    }
  }
  return sum;
}

struct Candidate {
  Match match;
  std::uint64_t squares;
};

bool better(const Candidate& a, const Candidate& b) {
  const auto key = [](const Candidate& c) {
    std::int64_t far = 0;
    for (const std::int64_t s : c.match.shift) far += s * s;
    return std::tuple(c.squares, c.match.differing(), far, c.match.shift);
  };
  return key(a) < key(b);
}

/// The best of all shifts that are at most `reach` from a place, and within the range.
Match best_around(const VoxelView& small, const VoxelView& large, std::uint32_t range,
                  const std::array<std::int32_t, 3>& position, std::int32_t reach, std::uint32_t side) {
  const std::int32_t row = 2 * reach + 1, maximum = static_cast<std::int32_t>(range);
  Buffer<Candidate> found(static_cast<std::size_t>(row) * row * row);
  tbb::parallel_for(std::int32_t{0}, row * row * row, [&](std::int32_t i) {
    std::array<std::int32_t, 3> shift{position[0] + i % row - reach, position[1] + i / row % row - reach,
                                      position[2] + i / row / row - reach};
    std::array<std::uint32_t, 3> from{};
    for (std::size_t a = 0; a < 3; ++a) {
      shift[a] = std::clamp(shift[a], -maximum, maximum);
      from[a] = static_cast<std::uint32_t>(maximum + shift[a]);
    }
    Candidate& candidate = found[static_cast<std::size_t>(i)];
    candidate = {match_at(small, large, from), squares_at(small, large, from, side)};
    candidate.match.shift = shift;
  });
  return std::ranges::min_element(found, better)->match;
}

}  // namespace

Match find_shift(const VoxelView& small, const VoxelView& large, std::uint32_t range) {
  constexpr std::uint32_t kMinSide = 8;  // of a box, in coarse voxels
  std::uint32_t factor = 1;
  while (range % (2 * factor) == 0 && range / (2 * factor) >= 2 &&
         std::min({small.nx, small.ny, small.nz}) / (2 * factor) >= kMinSide)
    factor *= 2;
  std::optional<Match> match;
  for (; factor > 0; factor /= 2) {
    std::array<std::int32_t, 3> position{};
    if (match)
      for (std::size_t a = 0; a < 3; ++a) position[a] = 2 * match->shift[a];
    const std::int32_t reach = match ? 2 : static_cast<std::int32_t>(range / factor);
    if (factor == 1) return best_around(small, large, range, position, reach, kBlock);
    const std::array<std::uint32_t, 3> block{factor, factor, factor};
    const VoxelStack few = coarser(small, block), many = coarser(large, block);
    match = best_around(few, many, range / factor, position, reach, std::max(1u, kBlock / factor));
  }
  return {};
}

namespace {

constexpr double kUniform = 0.002;  // an image that differs less at any shift is the same all along
constexpr double kClear = 0.15;     // of what the worst shift misses, a period misses at most so much

/// Share of the pixels that differ between an image and itself, shifted, where both are; of those set.
double missed(const RunsView& image, bool columns, std::uint32_t shift, double set_share) {
  Match match;
  const std::uint32_t width = columns ? image.columns - shift : image.columns,
                      rows = columns ? image.rows() : image.rows() - shift;
  for (std::uint32_t r = 0; r < rows; ++r)
    add_differences(image.row(r), image.row(columns ? r : r + shift), columns ? shift : 0, width, match);
  return static_cast<double>(match.differing()) / (2 * set_share * width * rows);
}

}  // namespace

std::uint32_t period(const RunsView& image, bool columns, std::uint32_t minimum, double miss) {
  const double share = static_cast<double>(set_pixels(image)) / (static_cast<double>(image.columns) * image.rows());
  if (!(share > 0 && share < 1)) return 0;
  const std::uint32_t maximum = (columns ? image.columns : image.rows()) / 5 * 2;
  minimum = std::max(minimum, 1u);
  if (maximum < minimum) return 0;
  std::vector<double> at(maximum + std::size_t{1} - minimum);
  for (std::uint32_t shift = minimum; shift <= maximum; ++shift) at[shift - minimum] = missed(image, columns, shift, share);
  const double worst = *std::ranges::max_element(at);
  if (worst < kUniform) return minimum;
  const double pass = std::min(miss, kClear * worst);
  for (std::size_t i = 0; i < at.size(); ++i) {
    if (at[i] > pass) continue;
    std::size_t best = i;
    for (; i < at.size() && at[i] <= pass; ++i)
      if (at[i] < at[best]) best = i;
    // At the first shift it may only begin to differ.
    if (best > 0) return minimum + static_cast<std::uint32_t>(best);
  }
  return 0;
}

double mismatch(const RunsView& one, const RunsView& other) {
  Match match;
  for (std::uint32_t r = 0; r < one.rows(); ++r) add_differences(one.row(r), other.row(r), 0, one.columns, match);
  const std::uint64_t set = set_pixels(one) + set_pixels(other);
  return set == 0 ? 0 : static_cast<double>(match.differing()) / static_cast<double>(set);
}

}  // namespace lamina::pores
