#include "stages/dose/saturate.h"

#include <algorithm>
#include <cmath>

namespace lamina::dose {

std::uint32_t core_threshold(double share) {
  return static_cast<std::uint32_t>(std::clamp(std::llround(share * 4294967296.0), 0ll, 4294967295ll));
}

void saturate(const RunsView& image, const RunsView& core, double share, std::uint32_t layer, Runs& result) {
  const std::uint32_t threshold = core_threshold(share);
  const std::uint32_t rows = image.rows();
  result.columns = image.columns;
  result.row_offset.resize(std::size_t{rows} + 1);
  result.change.clear();
  for (std::uint32_t r = 0; r < rows; ++r) {
    result.row_offset[r] = static_cast<std::uint32_t>(result.change.size());
    const auto inner = core.row(r);
    std::size_t k = 0;
    const auto row = image.row(r);
    for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
      std::uint32_t at = row[i];
      bool set = false;
      const auto become = [&](bool now) {
        if (now != set) result.change.push_back(at);
        set = now;
      };
      while (at < row[i + 1]) {
        while (k + 1 < inner.size() && inner[k + 1] <= at) k += 2;
        const bool in_core = k + 1 < inner.size() && inner[k] <= at;
        const std::uint32_t end = std::min(row[i + 1], in_core ? inner[k + 1] : k + 1 < inner.size() ? inner[k] : row[i + 1]);
        if (!in_core) {
          become(true);
          at = end;
          continue;
        }
        for (; at < end; ++at) become(core_pixel(at, r, layer, threshold));
      }
      become(false);
    }
  }
  result.row_offset[rows] = static_cast<std::uint32_t>(result.change.size());
}

}  // namespace lamina::dose
