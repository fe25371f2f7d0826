// stages/text/changes.h: other values for some keys of a table, and where they hold: part.fill, [[fill.range]] of a job.
#pragma once

#include <cstddef>
#include <vector>

namespace lamina {

/// Some keys of a table with their values; where they are applied the others stay as they are.
template <class Target>
struct Changes {
  Target values{};
  std::vector<std::size_t> keys;  // numbers in the table
  bool empty() const { return keys.empty(); }
};

/// Changes from one height to another, in mm above the bottom of a part.
template <class Target>
struct Range {
  double from_mm = 0, to_mm = 0;
  Changes<Target> changes;
};

}  // namespace lamina
