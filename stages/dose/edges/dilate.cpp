#include "stages/dose/edges/dilate.h"

#include <algorithm>
#include <utility>

namespace lamina::dose {
namespace {

using Row = std::span<const std::uint32_t>;

/// Appends [begin, end) to runs whose begins rise; joins what touches.
void append(std::uint32_t begin, std::uint32_t end, Buffer<std::uint32_t>& runs) {
  if (!runs.empty() && runs.back() >= begin) {
    runs.back() = std::max(runs.back(), end);
    return;
  }
  runs.push_back(begin);
  runs.push_back(end);
}

/// The runs of `merged` with those of `row`, each longer by `width` at both ends.
void merge(Row merged, Row row, std::uint32_t width, std::uint32_t columns, Buffer<std::uint32_t>& result) {
  result.clear();
  std::size_t u = 0;
  for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
    const std::uint32_t begin = row[i] > width ? row[i] - width : 0;
    for (; u + 1 < merged.size() && merged[u] <= begin; u += 2) append(merged[u], merged[u + 1], result);
    append(begin, columns - row[i + 1] > width ? row[i + 1] + width : columns, result);
  }
  for (; u + 1 < merged.size(); u += 2) append(merged[u], merged[u + 1], result);
}

}  // namespace

void dilate(const RunsView& image, const Reach& reach, Runs& result) {
  const std::int64_t rows = image.rows(), far = static_cast<std::int64_t>(reach.half_width.size()) - 1;
  result.columns = image.columns;
  result.row_offset.assign(1, 0);
  result.change.clear();
  Buffer<std::uint32_t> merged, next;
  for (std::int64_t r = 0; r < rows; ++r) {
    const Row own = image.row(static_cast<std::uint32_t>(r));
    merged.assign(own.begin(), own.end());
    for (std::int64_t j = -far; j <= far; ++j) {
      if (r + j < 0 || r + j >= rows) continue;
      const Row row = image.row(static_cast<std::uint32_t>(r + j));
      if (row.empty()) continue;
      merge(merged, row, reach.half_width[static_cast<std::size_t>(j < 0 ? -j : j)], image.columns, next);
      std::swap(merged, next);
    }
    result.change.insert(result.change.end(), merged.begin(), merged.end());
    result.row_offset.push_back(static_cast<std::uint32_t>(result.change.size()));
  }
}

bool grows_beyond(const RunsView& image, const Reach& reach) {
  if (reach.half_width.empty()) return false;
  const std::uint32_t rows = image.rows(), width = reach.half_width[0];
  const auto far = static_cast<std::uint32_t>(reach.half_width.size()) - 1;
  for (std::uint32_t r = 0; r < rows; ++r) {
    const Row row = image.row(r);
    if (row.empty()) continue;
    if (r < far || rows - 1 - r < far || row.front() < width || image.columns - row.back() < width) return true;
  }
  return false;
}

}  // namespace lamina::dose
