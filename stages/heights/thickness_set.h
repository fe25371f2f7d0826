// stages/heights/thickness_set.h: the thicknesses that a process can build.
#pragma once

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

}  // namespace lamina::heights
