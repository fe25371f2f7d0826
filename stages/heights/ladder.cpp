#include "stages/heights/ladder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "stages/support/text/number_text.h"
#include "stages/support/text/value.h"

namespace lamina::heights {
namespace {

constexpr std::size_t kMostThicknesses = 10'000;
constexpr double kDefaultStepMm = 0.001;

std::string read_nm(std::string_view text, Nm& nm) {
  double millimetres = 0;
  if (auto wrong = read_number(text, kLeastMm, kMostMm, " mm", millimetres); !wrong.empty()) return wrong;
  nm = static_cast<Nm>(std::llround(millimetres * static_cast<double>(kNmPerMm)));
  return {};
}

std::string read_range(std::string_view text, std::size_t dots, ThicknessSet& set) {
  const std::size_t colon = std::min(text.find(':', dots), text.size());
  Nm low = 0, high = 0, step = static_cast<Nm>(kDefaultStepMm * kNmPerMm);
  if (auto wrong = read_nm(text.substr(0, dots), low); !wrong.empty()) return wrong;
  if (auto wrong = read_nm(text.substr(dots + 2, colon - dots - 2), high); !wrong.empty()) return wrong;
  if (colon < text.size()) {
    if (auto wrong = read_nm(text.substr(colon + 1), step); !wrong.empty()) return wrong;
  }
  if (low > high) {
    return fmt::format("the least thickness, {} mm, is above the greatest, {} mm; write the smaller one first", mm(low),
                       mm(high));
  }
  if ((high - low) / step >= static_cast<Nm>(kMostThicknesses)) {
    return fmt::format("'{}' is more than {} thicknesses; give a coarser step, as {}..{}:{}", text, kMostThicknesses, mm(low),
                       mm(high), mm((high - low) / 1000 + 1));
  }
  if (const Nm rest = (high - low) % step; rest != 0) {
    return fmt::format(
        "'{}': steps of {} mm from {} mm end at {} mm and miss {} mm; end there, choose a step that divides the range, or give a "
        "set as 0.178,0.254",
        text, mm(step), mm(low), mm(high - rest), mm(high));
  }
  set.values.clear();
  for (std::int64_t value = low; value <= high; value += step) set.values.push_back(static_cast<Nm>(value));
  return {};
}

}  // namespace

std::string read_thicknesses(std::string_view text, ThicknessSet& set) {
  if (text.empty()) return "holds no thickness; give a set as 0.178,0.254 or a range as 0.05..0.3:0.01";
  if (const std::size_t dots = text.find(".."); dots != std::string_view::npos) return read_range(text, dots, set);
  ThicknessSet read;
  for (const std::string_view piece : split(text, ",")) {
    if (auto wrong = read_nm(piece, read.values.emplace_back()); !wrong.empty()) return wrong;
  }
  if (read.values.size() > kMostThicknesses) {
    return fmt::format("holds {} thicknesses; {} are enough", read.values.size(), kMostThicknesses);
  }
  std::ranges::sort(read.values);
  if (const auto twice = std::ranges::adjacent_find(read.values); twice != read.values.end()) {
    return fmt::format("holds {} mm twice; leave one out", mm(*twice));
  }
  set = std::move(read);
  return {};
}

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
