#include "stages/arrange/silhouette.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>

namespace lamina::arrange {
namespace {

constexpr double kRounding = 4;  // nm: a turn is rounded when the part is loaded

struct ShadowPoint {
  double x, y;
};

/// Turns about the origin; quarter turns without rounding.
class Turn {
 public:
  explicit Turn(MicroDegrees angle) {
    const std::int64_t quarters = angle / (kTurn / 4);
    if (quarters * (kTurn / 4) == angle) {
      constexpr double kCosine[] = {1, 0, -1, 0}, kSine[] = {0, 1, 0, -1};
      cosine_ = kCosine[quarters % 4];
      sine_ = kSine[quarters % 4];
      return;
    }
    const double radians = static_cast<double>(angle) * 1e-6 * std::numbers::pi / 180;
    cosine_ = std::cos(radians);
    sine_ = std::sin(radians);
  }
  ShadowPoint of(double x, double y) const { return {x * cosine_ - y * sine_, x * sine_ + y * cosine_}; }

 private:
  double cosine_, sine_;
};

/// Calls use(a, b, c) with the turned corners of each triangle.
template <class Use>
void for_each_triangle(std::span<const Mesh> meshes, std::span<const Instance> instances, const Turn& turn, Use use) {
  for (const Instance& instance : instances) {
    const Point3& by = instance.offset;
    const auto at = [&](const Point3& p) {
      return turn.of(static_cast<double>(std::int64_t{p.x} + by.x), static_cast<double>(std::int64_t{p.y} + by.y));
    };
    for (const Triangle& t : meshes[instance.mesh].triangles) use(at(t.a), at(t.b), at(t.c));
  }
}

/// Sets the cells that a triangle reaches into, in cells from the corner of the shape.
void add_triangle(const std::array<ShadowPoint, 3>& corner, BitShape& shape) {
  const auto [low, high] = std::ranges::minmax(corner, {}, &ShadowPoint::y);
  const auto row_of = [&](double y) { return static_cast<std::int64_t>(std::floor(y)); };
  const std::int64_t first = std::max<std::int64_t>(0, row_of(low.y));
  const std::int64_t last = std::min<std::int64_t>(std::int64_t{shape.depth} - 1, row_of(high.y));
  for (std::int64_t y = first; y <= last; ++y) {
    const double from = static_cast<double>(y), to = from + 1;
    double left = INFINITY, right = -INFINITY;
    const auto reach = [&](double x) { left = std::min(left, x), right = std::max(right, x); };
    for (std::size_t i = 0; i < 3; ++i) {
      const ShadowPoint& a = corner[i];
      const ShadowPoint& b = corner[(i + 1) % 3];
      if (a.y >= from && a.y <= to) reach(a.x);
      for (const double at : {from, to}) {
        if ((a.y < at) != (b.y < at)) reach(a.x + (at - a.y) / (b.y - a.y) * (b.x - a.x));
      }
    }
    if (left > right) continue;
    const double margin = 1e-9 * (std::abs(left) + std::abs(right)) + 1e-6;
    const auto begin = static_cast<std::int64_t>(std::floor(left - margin)),
               end = static_cast<std::int64_t>(std::floor(right + margin)) + 1;
    shape.set(static_cast<std::uint32_t>(y), static_cast<std::uint32_t>(std::clamp<std::int64_t>(begin, 0, shape.width)),
              static_cast<std::uint32_t>(std::clamp<std::int64_t>(end, 0, shape.width)));
  }
}

/// The row and its copies moved by 1 .. `by` cells to the right.
void spread_right(std::vector<std::uint64_t>& row, std::uint32_t by) {
  const auto move = [&](std::uint32_t shift) {  // row |= row << shift
    const std::size_t words = shift / 64, bits = shift % 64;
    for (std::size_t w = row.size(); w-- > words;) {
      std::uint64_t moved = row[w - words] << bits;
      if (bits > 0 && w > words) moved |= row[w - words - 1] >> (64 - bits);
      row[w] |= moved;
    }
  };
  for (std::uint32_t done = 0; done < by;) {
    const std::uint32_t step = std::min(done + 1, by - done);
    move(step);
    done += step;
  }
}

}  // namespace

void BitShape::set(std::uint32_t y, std::uint32_t begin, std::uint32_t end) {
  if (begin >= end) return;
  const std::span<std::uint64_t> words = row(y);
  const std::uint32_t first = begin / 64, last = (end - 1) / 64;
  const std::uint64_t from = ~std::uint64_t{0} << (begin % 64), to = ~std::uint64_t{0} >> (63 - (end - 1) % 64);
  if (first == last) {
    words[first] |= from & to;
    return;
  }
  words[first] |= from;
  for (std::uint32_t w = first + 1; w < last; ++w) words[w] = ~std::uint64_t{0};
  words[last] |= to;
}

std::uint64_t BitShape::count() const {
  std::uint64_t sum = 0;
  for (const std::uint64_t word : bits) sum += static_cast<std::uint64_t>(std::popcount(word));
  return sum;
}

Shadow shadow_of(std::span<const Mesh> meshes, std::span<const Instance> instances, MicroDegrees turn, std::int64_t cell,
                 std::array<std::int64_t, 2> phase) {
  Shadow shadow;
  const Turn turned(turn);
  ShadowPoint low{INFINITY, INFINITY}, high{-INFINITY, -INFINITY};
  std::int64_t bottom = INT64_MAX, top = INT64_MIN;
  for_each_triangle(meshes, instances, turned, [&](ShadowPoint a, ShadowPoint b, ShadowPoint c) {
    for (const ShadowPoint& p : {a, b, c}) {
      low = {std::min(low.x, p.x), std::min(low.y, p.y)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y)};
    }
  });
  if (!(low.x <= high.x)) return shadow;
  for (const Instance& instance : instances) {
    const Box& box = meshes[instance.mesh].bounds;
    bottom = std::min(bottom, std::int64_t{box.lo.z} + instance.offset.z);
    top = std::max(top, std::int64_t{box.hi.z} + instance.offset.z);
  }
  shadow.width = std::llround(high.x - low.x);
  shadow.depth = std::llround(high.y - low.y);
  shadow.height = top - bottom;
  low.x -= static_cast<double>(phase[0]);
  low.y -= static_cast<double>(phase[1]);
  const double size = static_cast<double>(cell);
  const auto cells = [&](std::int64_t length) {
    return static_cast<std::uint32_t>(std::floor((static_cast<double>(length) + kRounding) / size)) + 1;
  };
  shadow.shape = BitShape(cells(phase[0] + shadow.width), cells(phase[1] + shadow.depth));
  for_each_triangle(meshes, instances, turned, [&](ShadowPoint a, ShadowPoint b, ShadowPoint c) {
    const auto in_cells = [&](ShadowPoint p) { return ShadowPoint{(p.x - low.x) / size, (p.y - low.y) / size}; };
    add_triangle({in_cells(a), in_cells(b), in_cells(c)}, shadow.shape);
  });
  shadow.area_mm2 = static_cast<double>(shadow.shape.count()) * mm(cell) * mm(cell);
  return shadow;
}

BitShape coarse_shape(const BitShape& shape, std::uint32_t factor) {
  BitShape coarse(ceil_div(shape.width, factor), ceil_div(shape.depth, factor));
  for (std::uint32_t y = 0; y < shape.depth; ++y) {
    for (std::uint32_t x = 0; x < shape.width; ++x)
      if (shape.at(x, y)) coarse.set(y / factor, x / factor, x / factor + 1);
  }
  return coarse;
}

GrownShape grown_shape(const BitShape& shape, std::int64_t gap, std::int64_t cell) {
  GrownShape grown;
  // Cells (dx, dy) away from each other are max(|dx| - 1, 0), max(|dy| - 1, 0) cells apart.
  grown.reach = static_cast<std::uint32_t>(ceil_div(gap, cell));
  const std::uint32_t reach = grown.reach;
  grown.shape = BitShape(shape.width + 2 * reach, shape.depth + 2 * reach);
  std::vector<std::uint64_t> spread(grown.shape.words());
  std::vector<std::uint32_t> half(reach + 1);  // cells to both sides, by the distance of rows
  for (std::uint32_t dy = 0; dy <= reach; ++dy) {
    const double away = static_cast<double>(std::max(dy, 1u) - 1) * static_cast<double>(cell), limit = static_cast<double>(gap);
    const double side = std::sqrt(std::max(0.0, limit * limit - away * away)) / static_cast<double>(cell);
    // The largest dx with (dx - 1) cells < side.
    half[dy] = std::min(reach, static_cast<std::uint32_t>(std::ceil(side)));
  }
  for (std::uint32_t y = 0; y < shape.depth; ++y) {
    for (std::uint32_t dy = 0; dy <= reach; ++dy) {
      std::ranges::fill(spread, 0);
      std::ranges::copy(shape.row(y), spread.begin());
      // From the shape's column x to the columns x + reach - half .. x + reach + half.
      spread_right(spread, 2 * half[dy]);
      const std::uint32_t shift = reach - half[dy];
      for (const std::int64_t to : {std::int64_t{y} + reach + dy, std::int64_t{y} + reach - dy}) {
        const std::span<std::uint64_t> row = grown.shape.row(static_cast<std::uint32_t>(to));
        for (std::size_t w = row.size(); w-- > shift / 64;) {
          row[w] |= spread[w - shift / 64] << (shift % 64);
          if (shift % 64 > 0 && w > shift / 64) row[w] |= spread[w - shift / 64 - 1] >> (64 - shift % 64);
        }
      }
    }
  }
  return grown;
}

}  // namespace lamina::arrange
