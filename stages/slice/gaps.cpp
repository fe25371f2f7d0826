#include "stages/slice/gaps.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>
#include <vector>

namespace lamina::slice {
namespace {

constexpr std::uint32_t kNone = UINT32_MAX;

struct Bridge {
  __int128 squared;  // nm^2
  std::uint32_t from, to;
};

/// All bridges that are short enough, shortest first.
std::vector<Bridge> find_bridges(const Contours& open, Nm maximum) {
  const std::uint32_t count = open.size();
  std::vector<std::uint32_t> by_x(count);  // chains by the x of their start
  std::iota(by_x.begin(), by_x.end(), 0u);
  const auto start_x = [&](std::uint32_t chain) { return open[chain].front().x; };
  std::ranges::sort(by_x, {}, [&](std::uint32_t chain) { return std::pair(start_x(chain), chain); });
  std::vector<Bridge> bridges;
  for (std::uint32_t from = 0; from < count; ++from) {
    const Point2 end = open[from].back();
    const auto first = std::ranges::lower_bound(by_x, std::int64_t{end.x} - maximum, {},
                                                [&](std::uint32_t chain) { return std::int64_t{start_x(chain)}; });
    for (auto it = first; it != by_x.end() && start_x(*it) <= std::int64_t{end.x} + maximum; ++it) {
      const Point2 start = open[*it].front();
      const std::int64_t dx = std::int64_t{start.x} - end.x, dy = std::int64_t{start.y} - end.y;
      const __int128 squared = static_cast<__int128>(dx) * dx + static_cast<__int128>(dy) * dy;
      if (squared <= static_cast<__int128>(maximum) * maximum) bridges.push_back({squared, from, *it});
    }
  }
  std::ranges::sort(bridges, [](const Bridge& a, const Bridge& b) {
    return std::tie(a.squared, a.from, a.to) < std::tie(b.squared, b.from, b.to);
  });
  return bridges;
}

}  // namespace

GapReport close_gaps(Contours& open, Nm maximum, Contours& closed) {
  GapReport report;
  const std::uint32_t count = open.size();
  if (count == 0) return report;
  std::vector<std::uint32_t> next(count, kNone), previous(count, kNone);
  for (const Bridge& bridge : find_bridges(open, maximum)) {
    if (next[bridge.from] != kNone || previous[bridge.to] != kNone) continue;
    next[bridge.from] = bridge.to;
    previous[bridge.to] = bridge.from;
    ++report.closed;
    const auto length = static_cast<std::int64_t>(std::ceil(std::sqrt(static_cast<double>(bridge.squared))));
    report.largest_closed = std::max(report.largest_closed, length);
  }
  Contours rest;
  std::vector<std::uint8_t> done(count, 0);
  const auto walk = [&](std::uint32_t first, Contours& out) {
    for (std::uint32_t chain = first; chain != kNone && done[chain] == 0; chain = next[chain]) {
      done[chain] = 1;
      const auto points = open[chain];
      out.point.insert(out.point.end(), points.begin(), points.end());
    }
    out.close();
  };
  for (std::uint32_t chain = 0; chain < count; ++chain) {
    if (previous[chain] == kNone) walk(chain, rest);
  }
  for (std::uint32_t chain = 0; chain < count; ++chain) {
    if (done[chain] == 0) walk(chain, closed);
  }
  report.open = rest.size();
  if (rest.size() > 0) report.first_open = rest[0].front();
  open = std::move(rest);
  return report;
}

}  // namespace lamina::slice
