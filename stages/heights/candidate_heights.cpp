#include "stages/heights/candidate_heights.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

namespace lamina::heights {

Result<CandidateHeights> CandidateHeights::reachable(const ThicknessSet& set, std::int64_t highest) {
  CandidateHeights candidate_heights;
  const std::int64_t step = set.step(), even = ceil_div(highest, step) + 1;
  if (even <= kMaxCandidates) {
    candidate_heights.step_ = step;
    candidate_heights.inverse_ = step > 1 && step <= UINT32_MAX ? UINT64_MAX / static_cast<std::uint64_t>(step) + 1 : 0;
    candidate_heights.count_ = static_cast<std::uint32_t>(even);
    return candidate_heights;
  }
  const auto too_many = [&] {
    return Error{Fault::kUsage,
                 fmt::format("heights.thickness: layers can end at more than {} heights below {} mm; give thicknesses that "
                             "are multiples of a coarser step",
                             kMaxCandidates, mm(highest))};
  };
  // Of two lengths without a common divisor a and b, all but (a - 1) (b - 1) / 2 whole numbers are sums.
  const std::int64_t a = set.minimum() / step, b = set.maximum() / step;
  if (std::gcd(a, b) == 1 && even - a * b / 2 > kMaxCandidates) return too_many();
  // Sums in increasing order: the next one is the least of a known sum and one thickness more.
  std::vector<std::int64_t>& sums = candidate_heights.heights_;
  std::vector<std::uint32_t> next(set.size(), 0);
  sums.push_back(0);
  while (sums.back() < highest) {
    std::int64_t minimum = INT64_MAX;
    for (std::uint32_t i = 0; i < set.size(); ++i) {
      while (sums[next[i]] + set.values[i] <= sums.back()) ++next[i];
      minimum = std::min(minimum, sums[next[i]] + set.values[i]);
    }
    sums.push_back(minimum);
    if (sums.size() > kMaxCandidates) return too_many();
  }
  candidate_heights.count_ = static_cast<std::uint32_t>(sums.size());
  return candidate_heights;
}

CandidateHeights CandidateHeights::listed(std::vector<std::int64_t> heights) {
  CandidateHeights candidate_heights;
  candidate_heights.count_ = static_cast<std::uint32_t>(heights.size());
  candidate_heights.heights_ = std::move(heights);
  return candidate_heights;
}

}  // namespace lamina::heights
