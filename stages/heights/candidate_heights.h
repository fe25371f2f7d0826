// stages/heights/candidate_heights.h: the thicknesses that a process can build, and the heights at which a layer can end.
#pragma once

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <string_view>
#include <vector>

#include "stages/data/status.h"
#include "stages/data/units.h"

namespace lamina::heights {

/// Thicknesses in nm, each > 0, strictly increasing, at least one.
struct ThicknessSet {
  std::vector<Nm> values;

  Nm minimum() const { return values.front(); }
  Nm maximum() const { return values.back(); }
  std::uint32_t size() const { return static_cast<std::uint32_t>(values.size()); }
  /// The length of which all of them are multiples.
  Nm step() const {
    Nm common = 0;
    for (const Nm value : values) common = std::gcd(common, value);
    return common;
  }
  /// Whether they are all the multiples of step() from the least to the most.
  bool is_contiguous() const { return (maximum() - minimum()) / step() + 1 == static_cast<Nm>(values.size()); }
};

/// Reads a set "0.178,0.254" or a range "0.05..0.3:0.01" of thicknesses in mm; a range without a step has steps of
/// 0.001 mm, and holds what lies on the steps from its lower end. Sets may be in any order.
/// errors  kUsage: what is wrong and what would be right, without the name of the option
Result<ThicknessSet> read_thicknesses(std::string_view text);

/// Candidate heights r_0 = 0 < r_1 < ... in nm; cell k is between candidates k and k + 1. They are evenly spaced if the
/// thicknesses share a useful step, else every sum of thicknesses is listed.
class CandidateHeights {
 public:
  /// Every height that a stack of these thicknesses can reach, up to the first one at or above `highest`.
  /// errors  kUsage if there are more than kMaxCandidates
  static Result<CandidateHeights> reachable(const ThicknessSet& set, std::int64_t highest);
  /// These heights; increasing, the first is the lowest (need not be 0).
  static CandidateHeights listed(std::vector<std::int64_t> heights);

  static constexpr std::uint32_t kMaxCandidates = 1u << 23;

  std::uint32_t candidates() const { return count_; }
  std::uint32_t cells() const { return count_ - 1; }
  std::int64_t operator[](std::uint32_t candidate) const { return step_ > 0 ? step_ * candidate : heights_[candidate]; }
  /// nm between candidates, or 0 if they are listed.
  std::int64_t step() const { return step_; }

  /// The number of candidates at or below `height`.
  std::uint32_t candidates_up_to(std::int64_t height) const {
    if (step_ > 0) {
      if (height < 0) return 0;
      if (height > UINT32_MAX || inverse_ == 0)
        return static_cast<std::uint32_t>(std::min<std::int64_t>(height / step_ + 1, count_));
      const auto below = static_cast<unsigned __int128>(inverse_) * static_cast<std::uint32_t>(height) >> 64;
      return std::min(static_cast<std::uint32_t>(below) + 1, count_);
    }
    return static_cast<std::uint32_t>(std::upper_bound(heights_.begin(), heights_.end(), height) - heights_.begin());
  }
  /// The cells [first, last) that share more than a point with (lo, hi).
  struct CellRange {
    std::uint32_t first, last;
  };
  CellRange cells_between(std::int64_t lo, std::int64_t hi) const {
    const std::uint32_t below = candidates_up_to(lo);
    const std::uint32_t last = std::min(candidates_up_to(hi - 1), cells());
    return {below == 0 ? 0 : below - 1, last};
  }

 private:
  std::int64_t step_ = 0;
  // ceil(2^64 / step): the upper half of its product with a height below 2^32 is the quotient, exactly (Lemire, Kaser and
  // Kurz, "Faster remainder by direct computation", 2019). 0 where that does not apply: a step of 1, or none.
  std::uint64_t inverse_ = 0;
  std::uint32_t count_ = 0;
  std::vector<std::int64_t> heights_;  // empty if evenly spaced
};

}  // namespace lamina::heights
