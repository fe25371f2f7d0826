#include "stages/heights/ladder.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

namespace lamina::heights {

Result<Ladder> Ladder::reachable(const ThicknessSet& set, std::int64_t highest) {
  Ladder ladder;
  const std::int64_t step = set.step(), even = ceil_div(highest, step) + 1;
  if (even <= kMostRungs) {
    ladder.step_ = step;
    ladder.inverse_ = step > 1 && step <= UINT32_MAX ? UINT64_MAX / static_cast<std::uint64_t>(step) + 1 : 0;
    ladder.count_ = static_cast<std::uint32_t>(even);
    return ladder;
  }
  const auto too_many = [&] {
    return Error{Fault::kUsage,
                 fmt::format("heights.thickness: layers can end at more than {} heights below {} mm; give thicknesses that "
                             "are multiples of a coarser step",
                             kMostRungs, mm(highest))};
  };
  // Of two lengths without a common divisor a and b, all but (a - 1) (b - 1) / 2 whole numbers are sums.
  const std::int64_t a = set.least() / step, b = set.most() / step;
  if (std::gcd(a, b) == 1 && even - a * b / 2 > kMostRungs) return too_many();
  // Sums in increasing order: the next one is the least of a known sum and one thickness more.
  std::vector<std::int64_t>& sums = ladder.heights_;
  std::vector<std::uint32_t> next(set.size(), 0);
  sums.push_back(0);
  while (sums.back() < highest) {
    std::int64_t least = INT64_MAX;
    for (std::uint32_t i = 0; i < set.size(); ++i) {
      while (sums[next[i]] + set.values[i] <= sums.back()) ++next[i];
      least = std::min(least, sums[next[i]] + set.values[i]);
    }
    sums.push_back(least);
    if (sums.size() > kMostRungs) return too_many();
  }
  ladder.count_ = static_cast<std::uint32_t>(sums.size());
  return ladder;
}

Ladder Ladder::listed(std::vector<std::int64_t> heights) {
  Ladder ladder;
  ladder.count_ = static_cast<std::uint32_t>(heights.size());
  ladder.heights_ = std::move(heights);
  return ladder;
}

}  // namespace lamina::heights
