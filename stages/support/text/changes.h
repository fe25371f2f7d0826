// stages/support/text/changes.h: changed values for some keys of a table, and their heights: part.fill, [[fill.range]] of a
// job.
#pragma once

#include <cstddef>
#include <vector>

namespace lamina {

/// Some keys of a table with their values; all other keys keep theirs.
template <class Target>
struct Changes {
  Target values{};
  std::vector<std::size_t> keys;  // indices in the table
  bool empty() const { return keys.empty(); }
};

/// Changes between two heights, in mm above the bottom of a part.
template <class Target>
struct Range {
  double from_mm = 0, to_mm = 0;
  Changes<Target> changes;
};

}  // namespace lamina
