#include "stages/pores/period.h"

#include <algorithm>
#include <span>
#include <vector>

namespace lamina::pores {
namespace {

constexpr double kUniform = 0.002;  // an image that differs less at any shift is the same all along
constexpr double kClear = 0.15;     // of what the worst shift misses, a period misses at most so much

/// Pixels of [begin, end) that exactly one of two rows has; the second is shifted to the left.
std::uint64_t different(std::span<const std::uint32_t> one, std::span<const std::uint32_t> other, std::uint32_t shift,
                        std::uint32_t end) {
  std::uint64_t count = 0;
  std::uint32_t at = 0;
  bool in_one = false, in_other = false;
  std::size_t i = 0, j = 0;
  while (j < other.size() && other[j] <= shift) in_other = !in_other, ++j;
  while (at < end) {
    const std::uint32_t a = i < one.size() ? one[i] : UINT32_MAX, b = j < other.size() ? other[j] - shift : UINT32_MAX;
    const std::uint32_t next = std::min({a, b, end});
    if (in_one != in_other) count += next - at;
    if (a == next) in_one = !in_one, ++i;
    if (b == next) in_other = !in_other, ++j;
    at = next;
  }
  return count;
}

/// Share of the pixels that differ between an image and itself, shifted, where both are; of those set.
double missed(const RunsView& image, bool columns, std::uint32_t shift, double set_share) {
  std::uint64_t count = 0;
  const std::uint32_t width = columns ? image.columns - shift : image.columns,
                      rows = columns ? image.rows() : image.rows() - shift;
  for (std::uint32_t r = 0; r < rows; ++r)
    count += different(image.row(r), image.row(columns ? r : r + shift), columns ? shift : 0, width);
  return static_cast<double>(count) / (2 * set_share * width * rows);
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
  std::uint64_t count = 0;
  for (std::uint32_t r = 0; r < one.rows(); ++r) count += different(one.row(r), other.row(r), 0, one.columns);
  const std::uint64_t set = set_pixels(one) + set_pixels(other);
  return set == 0 ? 0 : static_cast<double>(count) / static_cast<double>(set);
}

}  // namespace lamina::pores
