// tests/slice/contour_laws.h: what clean contours are, checked without the code that makes them.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "stages/data/contours.h"
#include "stages/data/grid.h"
#include "stages/data/runs.h"

namespace lamina::test {

/// Winding number of all contours about p, from the signs of exact areas; INT32_MAX if p lies on an edge.
inline std::int32_t winding_about(const ContoursView& contours, Point2 p, std::uint32_t skip = UINT32_MAX) {
  std::int32_t winding = 0;
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    if (c == skip) continue;
    Point2 a = contours[c].back();
    for (const Point2 b : contours[c]) {
      const __int128 area = static_cast<__int128>(std::int64_t{b.x} - a.x) * (std::int64_t{p.y} - a.y) -
                            static_cast<__int128>(std::int64_t{b.y} - a.y) * (std::int64_t{p.x} - a.x);
      if (area == 0 && std::min(a.x, b.x) <= p.x && p.x <= std::max(a.x, b.x) && std::min(a.y, b.y) <= p.y &&
          p.y <= std::max(a.y, b.y)) {
        return INT32_MAX;
      }
      if (a.y <= p.y && b.y > p.y && area > 0) ++winding;
      if (a.y > p.y && b.y <= p.y && area < 0) --winding;
      a = b;
    }
  }
  return winding;
}

/// Behind each outer contour come the holes in it: with it they wind once about what is just outside of each of them.
inline void expect_ordered(const ContoursView& contours, const std::string& where) {
  for (std::uint32_t first = 0, end = 0; first < contours.size(); first = end) {
    ASSERT_GT(doubled_area(contours[first]), 0) << where << ": a hole before its outer contour";
    end = first + 1;
    while (end < contours.size() && doubled_area(contours[end]) < 0) ++end;
    std::vector<std::uint32_t> offset;
    for (std::uint32_t c = first; c <= end; ++c) offset.push_back(contours.offset[c] - contours.offset[first]);
    const ContoursView region{offset, contours.point.subspan(contours.offset[first], offset.back())};
    for (std::uint32_t c = 1; c < region.size(); ++c) {
      std::int32_t outside = INT32_MAX;
      for (const Point2 p : region[c]) {
        outside = winding_about(region, p, c);
        if (outside != INT32_MAX) break;
      }
      EXPECT_TRUE(outside == 1 || outside == INT32_MAX)
          << where << ": contour " << first + c << " is no hole of contour " << first;
    }
  }
}

/// Every contour has an area, and lies inside an even number of others if it is an outer one, else inside an odd
/// number; a point just inside an outer contour has winding number 1, just inside a hole 0.
inline void expect_clean(const ContoursView& contours, const std::string& where) {
  expect_ordered(contours, where);
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    ASSERT_GE(contours[c].size(), 3u) << where;
    const __int128 area = doubled_area(contours[c]);
    ASSERT_TRUE(area != 0) << where << ": contour " << c << " of " << contours[c].size() << " points has no area";
    std::int32_t outside = INT32_MAX;  // about a point of the contour that no other one touches
    for (const Point2 p : contours[c]) {
      outside = winding_about(contours, p, c);
      if (outside != INT32_MAX) break;
    }
    if (outside == INT32_MAX) continue;  // touches others with every point: unions of solids that share corners
    EXPECT_EQ(outside, area > 0 ? 0 : 1) << where << ": contour " << c << " is nested wrongly";
  }
}

inline double perimeter(const ContoursView& contours) {
  double sum = 0;
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    Point2 a = contours[c].back();
    for (const Point2 b : contours[c]) {
      sum += std::hypot(static_cast<double>(b.x) - a.x, static_cast<double>(b.y) - a.y);
      a = b;
    }
  }
  return sum;
}

inline double distance_to(const ContoursView& contours, double x, double y) {
  double nearest = 1e300;
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    Point2 a = contours[c].back();
    for (const Point2 b : contours[c]) {
      const double ux = static_cast<double>(b.x) - a.x, uy = static_cast<double>(b.y) - a.y;
      const double vx = x - a.x, vy = y - a.y, length2 = ux * ux + uy * uy;
      const double t = length2 > 0 ? std::clamp((ux * vx + uy * vy) / length2, 0.0, 1.0) : 0;
      nearest = std::min(nearest, std::hypot(vx - t * ux, vy - t * uy));
      a = b;
    }
  }
  return nearest;
}

/// The pixels whose centres lie within the contours, by the rules of the bitmaps, as runs from the back row down.
inline Runs rasterized(const ContoursView& contours, const PixelGrid& grid) {
  std::vector<std::vector<std::pair<std::int64_t, int>>> crossings(grid.rows());
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    Point2 a = contours[c].back();
    for (const Point2 b : contours[c]) {
      const Point2 low = a.y < b.y ? a : b, high = a.y < b.y ? b : a;
      if (a.y != b.y) {
        const std::int64_t first = std::max<std::int64_t>(0, grid.y.first_at_or_beyond(low.y));
        const std::int64_t last = std::min<std::int64_t>(grid.rows(), grid.y.first_at_or_beyond(high.y));
        for (std::int64_t row = first; row < last; ++row) {
          const __int128 rise = std::int64_t{high.y} - low.y;
          const __int128 x = static_cast<__int128>(low.x) * rise +
                             static_cast<__int128>(std::int64_t{high.x} - low.x) * (grid.y.centre(row) - low.y);
          const auto column = grid.x.first_at_or_beyond(static_cast<std::int64_t>(ceil_div<__int128>(x, rise)));
          crossings[static_cast<std::size_t>(row)].emplace_back(column, b.y < a.y ? 1 : -1);
        }
      }
      a = b;
    }
  }
  Runs runs;
  runs.columns = grid.columns();
  runs.row_offset.push_back(0);
  for (std::uint32_t r = 0; r < grid.rows(); ++r) {
    auto& row = crossings[grid.rows() - 1 - r];
    std::sort(row.begin(), row.end());
    std::int32_t winding = 0;
    for (std::size_t i = 0; i < row.size();) {
      const std::int64_t column = row[i].first;
      const bool before = winding != 0;
      for (; i < row.size() && row[i].first == column; ++i) winding += row[i].second;
      if ((winding != 0) != before) runs.change.push_back(static_cast<std::uint32_t>(column));
    }
    runs.row_offset.push_back(static_cast<std::uint32_t>(runs.change.size()));
  }
  return runs;
}

}  // namespace lamina::test
