#include "stages/pores/sizes.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <utility>

#include "stages/pores/parts.h"
#include "stages/pores/rows.h"

namespace lamina::pores {
namespace {

/// The first and the last pixel of each run by part, where the part lies in one piece.
struct Ends {
  Buffer<std::uint32_t> begin;  // of each part in pixels, and the end
  Buffer<Pixel> pixels;
};

Ends ends_of(const VoxelView& slice, const Parts& parts) {
  Ends ends;
  ends.begin.assign(parts.size() + 1, 0);
  for (const std::uint32_t piece : parts.piece) ends.begin[parts.part[piece] + 1] += 2;
  for (std::size_t p = 0; p < parts.size(); ++p) ends.begin[p + 1] += ends.begin[p];
  ends.pixels.resize(2 * parts.piece.size());
  Buffer<std::uint32_t> next = ends.begin;
  std::size_t run = 0;
  for (std::uint32_t y = 0; y < slice.ny; ++y) {
    const auto row = slice.row(y, 0);
    for (std::size_t i = 0; i < row.size(); i += 2, ++run) {
      const std::uint32_t piece = parts.piece[run];
      const std::int32_t x0 = parts.cell[piece][0] * static_cast<std::int32_t>(slice.nx);
      const std::int32_t at = static_cast<std::int32_t>(y) + parts.cell[piece][1] * static_cast<std::int32_t>(slice.ny);
      std::uint32_t& to = next[parts.part[piece]];
      ends.pixels[to++] = {x0 + static_cast<std::int32_t>(row[i]), at};
      ends.pixels[to++] = {x0 + static_cast<std::int32_t>(row[i + 1]) - 1, at};
    }
  }
  return ends;
}

PoreSizes sizes_of(const VoxelView& slice, const VoxelView* outside, std::uint32_t number) {
  PoreSizes sizes;
  const Parts parts = parts_of(slice);
  Buffer<std::uint8_t> neighbour(parts.size(), std::uint8_t{0});
  if (outside != nullptr) neighbour = adjacent_parts(slice, parts, *outside);
  Ends ends = ends_of(slice, parts);
  const double pixel_mm2 = mm(slice.edge[0]) * mm(slice.edge[1]);
  const std::array<double, 2> size_mm{slice.nx * mm(slice.edge[0]), slice.ny * mm(slice.edge[1])};
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const double area = static_cast<double>(parts.voxels[p]) * pixel_mm2;
    if (parts.wraps[p] != 0) {
      ++sizes.endless;
      sizes.endless_mm2 += area;
      if (parts.wraps[p] < 3) sizes.channels_mm.push_back(area / (parts.wraps[p] == 1 ? size_mm[0] : size_mm[1]));
    } else if (neighbour[p] != 0 || (parts.faces[p] & (kFacesX | kFacesY)) != 0) {
      ++sizes.cut;
      sizes.cut_mm2 += area;
    } else {
      const std::span<Pixel> pixels = std::span(ends.pixels).subspan(ends.begin[p], ends.begin[p + 1] - ends.begin[p]);
      const BoxSides box = smallest_box(pixels, {slice.edge[0], slice.edge[1]});
      sizes.pores.push_back({box.length / kNmPerMm, box.width / kNmPerMm, area, number});
    }
  }
  return sizes;
}

template <class Value>
Distribution of_pores(const PoreSizes& sizes, double bin, std::uint32_t bins, const Value& value) {
  Buffer<double> values(sizes.pores.size());
  std::ranges::transform(sizes.pores, values.begin(), value);
  return distribution(values, bin, bins);
}

}  // namespace

PoreSizes pore_sizes(const VoxelView& solid, const VoxelView* body) {
  const VoxelStack empty = void_of(solid, body);
  const VoxelStack outside = body == nullptr ? VoxelStack() : without(void_of(solid), *body);
  std::vector<PoreSizes> found(solid.nz);
  tbb::parallel_for(std::uint32_t{0}, solid.nz, [&](std::uint32_t z) {
    const VoxelView neighbour = body == nullptr ? VoxelView() : outside.view().slice(z);
    found[z] = sizes_of(empty.view().slice(z), body == nullptr ? nullptr : &neighbour, z);
  });
  PoreSizes all;
  for (PoreSizes& slice : found) {
    all.pores.insert(all.pores.end(), slice.pores.begin(), slice.pores.end());
    all.channels_mm.insert(all.channels_mm.end(), slice.channels_mm.begin(), slice.channels_mm.end());
    all.cut += slice.cut, all.endless += slice.endless;
    all.cut_mm2 += slice.cut_mm2, all.endless_mm2 += slice.endless_mm2;
    slice = {};
  }
  return all;
}

Distribution distribution(std::span<const double> values, double bin, std::uint32_t bins) {
  Distribution result;
  result.bin = bin;
  result.bins.assign(bins, 0);
  result.count = values.size();
  if (values.empty()) return result;
  const auto [minimum, maximum] = std::ranges::minmax(values);
  result.minimum = minimum, result.maximum = maximum;
  double sum = 0, squares = 0;
  for (const double value : values) {
    sum += value;
    const double at = std::clamp(std::floor(value / bin), 0.0, static_cast<double>(bins) - 1);
    ++result.bins[static_cast<std::size_t>(at)];
  }
  const auto count = static_cast<double>(values.size());
  result.mean = sum / count;
  for (const double value : values) squares += (value - result.mean) * (value - result.mean);
  if (values.size() > 1) result.deviation = std::sqrt(squares / (count - 1));
  return result;
}

Distribution lengths(const PoreSizes& sizes, double bin_mm, std::uint32_t bins) {
  return of_pores(sizes, bin_mm, bins, [](const Pore& pore) { return pore.length_mm; });
}

Distribution widths(const PoreSizes& sizes, double bin_mm, std::uint32_t bins) {
  return of_pores(sizes, bin_mm, bins, [](const Pore& pore) { return pore.width_mm; });
}

namespace {

using Wide = __int128;

/// Twice the area of the triangle, in pixels.
std::int64_t turn(Pixel a, Pixel b, Pixel c) {
  return (std::int64_t{b.x} - a.x) * (std::int64_t{c.y} - a.y) - (std::int64_t{b.y} - a.y) * (std::int64_t{c.x} - a.x);
}

// Andrew's chains: the lower one grows in front, the upper one is found backwards behind it.
std::size_t hull_of(std::span<Pixel> pixels) {
  std::ranges::sort(pixels, {}, [](Pixel p) { return std::pair(p.y, p.x); });
  const std::size_t count = static_cast<std::size_t>(std::unique(pixels.begin(), pixels.end()) - pixels.begin());
  if (count < 3) return count;
  const Pixel first = pixels[0], last = pixels[count - 1];
  // Points right of the line between the ends go to the one chain, others to the other; both stay in order.
  const auto right = std::stable_partition(pixels.begin() + 1, pixels.begin() + static_cast<std::ptrdiff_t>(count) - 1,
                                           [&](Pixel p) { return turn(first, last, p) < 0; });
  const auto middle = static_cast<std::size_t>(right - pixels.begin());
  std::size_t size = 1;
  const auto push = [&](Pixel p, std::size_t minimum) {
    while (size > minimum && turn(pixels[size - 2], pixels[size - 1], p) <= 0) --size;
    pixels[size++] = p;
  };
  for (std::size_t i = 1; i < middle; ++i) push(pixels[i], 1);
  // The last one takes a place of its own only where the chain left one; else that of a pixel that is moved behind it.
  std::rotate(pixels.begin() + static_cast<std::ptrdiff_t>(middle), pixels.begin() + static_cast<std::ptrdiff_t>(count) - 1,
              pixels.begin() + static_cast<std::ptrdiff_t>(count));
  push(last, 1);
  const std::size_t turned = size;
  std::reverse(pixels.begin() + static_cast<std::ptrdiff_t>(middle) + 1, pixels.begin() + static_cast<std::ptrdiff_t>(count));
  for (std::size_t i = middle + 1; i < count; ++i) push(pixels[i], turned);
  while (size > turned && turn(pixels[size - 2], pixels[size - 1], first) <= 0) --size;
  return size;
}

/// Extents along a direction in nm and across it, each times its length.
std::array<double, 2> extents(std::span<const Pixel> hull, std::array<Nm, 2> edge, Wide dx, Wide dy) {
  Wide low = 0, high = 0, left = 0, right = 0;
  for (const Pixel& p : hull) {
    const Wide x = Wide{p.x - std::int64_t{hull[0].x}} * edge[0], y = Wide{p.y - std::int64_t{hull[0].y}} * edge[1];
    const Wide along = x * dx + y * dy, across = y * dx - x * dy;
    low = std::min(low, along), high = std::max(high, along);
    left = std::min(left, across), right = std::max(right, across);
  }
  const Wide ax = dx < 0 ? -dx : dx, ay = dy < 0 ? -dy : dy;
  return {static_cast<double>(high - low + std::max(ax * edge[0], ay * edge[1])),
          static_cast<double>(right - left + std::max(ay * edge[0], ax * edge[1]))};
}

}  // namespace

BoxSides smallest_box(std::span<Pixel> pixels, std::array<Nm, 2> edge) {
  const std::span<const Pixel> hull = pixels.first(hull_of(pixels));
  std::tuple<double, double, double> best;  // area, width, length
  const auto attempt = [&](Wide dx, Wide dy, bool first) {
    const auto [along, across] = extents(hull, edge, dx, dy);
    const auto squared = static_cast<double>(dx * dx + dy * dy);
    const double unit = std::sqrt(squared);
    const std::tuple box(along * across / squared, std::min(along, across) / unit, std::max(along, across) / unit);
    if (first || box < best) best = box;
  };
  attempt(1, 0, true);
  for (std::size_t i = 0; i < hull.size(); ++i) {
    const Pixel from = hull[i], to = hull[(i + 1) % hull.size()];
    const Wide dx = Wide{to.x - std::int64_t{from.x}} * edge[0], dy = Wide{to.y - std::int64_t{from.y}} * edge[1];
    if (dx != 0 && dy != 0) attempt(dx, dy, false);
  }
  return {std::get<2>(best), std::get<1>(best)};
}

}  // namespace lamina::pores
