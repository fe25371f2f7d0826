// stages/heights/candidate_heights.h: the heights at which a layer can end.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "stages/data/status.h"
#include "stages/data/units.h"
#include "stages/heights/thickness_set.h"

namespace lamina::heights {

/// Rungs r_0 = 0 < r_1 < ... in nm; cell k lies between rung k and rung k + 1. Rungs are evenly spaced where the
/// thicknesses share a useful step, else every sum of thicknesses is listed.
class CandidateHeights {
 public:
  /// Every height that a stack of these thicknesses can reach, up to the first rung at or above `highest`.
  /// errors  kUsage if there are more than kMaxCandidates
  static Result<CandidateHeights> reachable(const ThicknessSet& set, std::int64_t highest);
  /// These heights; increasing, the first is the lowest (need not be 0).
  static CandidateHeights listed(std::vector<std::int64_t> heights);

  static constexpr std::uint32_t kMaxCandidates = 1u << 23;

  std::uint32_t candidates() const { return count_; }
  std::uint32_t cells() const { return count_ - 1; }
  std::int64_t operator[](std::uint32_t candidate) const { return step_ > 0 ? step_ * candidate : heights_[candidate]; }
  /// nm between rungs, or 0 if they are listed.
  std::int64_t step() const { return step_; }

  /// The number of rungs at or below `height`.
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
  // Kurz, "Faster remainder by direct computation", 2019). 0 where that does not hold: a step of 1, or none.
  std::uint64_t inverse_ = 0;
  std::uint32_t count_ = 0;
  std::vector<std::int64_t> heights_;  // empty if evenly spaced
};

}  // namespace lamina::heights
