#include "stages/heights/candidate_heights.h"

#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "stages/support/text/number_text.h"
#include "stages/support/text/value.h"

namespace lamina::heights {

namespace {

constexpr std::size_t kMaxThicknesses = 10'000;
constexpr double kDefaultStepMm = 0.001;

Error refused(std::string what) { return {Fault::kUsage, std::move(what)}; }

Status read_nm(std::string_view text, Nm& nm) {
  double millimetres = 0;
  if (auto wrong = read_number(text, kMinMm, kMaxMm, " mm", millimetres); !wrong.empty()) return refused(std::move(wrong));
  nm = static_cast<Nm>(std::llround(millimetres * static_cast<double>(kNmPerMm)));
  return {};
}

Result<ThicknessSet> read_range(std::string_view text, std::size_t dots) {
  const std::size_t colon = std::min(text.find(':', dots), text.size());
  Nm low = 0, high = 0, step = static_cast<Nm>(kDefaultStepMm * kNmPerMm);
  Status read = read_nm(text.substr(0, dots), low);
  if (read) read = read_nm(text.substr(dots + 2, colon - dots - 2), high);
  if (read && colon < text.size()) read = read_nm(text.substr(colon + 1), step);
  if (!read) return read.error();
  if (low > high) {
    return refused(fmt::format("the least thickness, {} mm, is above the greatest, {} mm; write the smaller one first", mm(low),
                               mm(high)));
  }
  if ((high - low) / step >= static_cast<Nm>(kMaxThicknesses)) {
    return refused(fmt::format("'{}' is more than {} thicknesses; give a coarser step, as {}..{}:{}", text, kMaxThicknesses,
                               mm(low), mm(high), mm((high - low) / 1000 + 1)));
  }
  if (const Nm rest = (high - low) % step; rest != 0) {
    return refused(fmt::format(
        "'{}': steps of {} mm from {} mm end at {} mm and miss {} mm; end there, choose a step that divides the range, or give a "
        "set as 0.178,0.254",
        text, mm(step), mm(low), mm(high - rest), mm(high)));
  }
  ThicknessSet set;
  for (std::int64_t value = low; value <= high; value += step) set.values.push_back(static_cast<Nm>(value));
  return set;
}

}  // namespace

Result<ThicknessSet> read_thicknesses(std::string_view text) {
  if (text.empty()) return refused("contains no thickness; give a set as 0.178,0.254 or a range as 0.05..0.3:0.01");
  if (const std::size_t dots = text.find(".."); dots != std::string_view::npos) return read_range(text, dots);
  ThicknessSet set;
  for (const std::string_view piece : split(text, ",")) {
    if (const Status read = read_nm(piece, set.values.emplace_back()); !read) return read.error();
  }
  if (set.values.size() > kMaxThicknesses) {
    return refused(fmt::format("holds {} thicknesses; {} are enough", set.values.size(), kMaxThicknesses));
  }
  std::ranges::sort(set.values);
  if (const auto twice = std::ranges::adjacent_find(set.values); twice != set.values.end()) {
    return refused(fmt::format("holds {} mm twice; leave one out", mm(*twice)));
  }
  return set;
}

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
