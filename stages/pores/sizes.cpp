#include "stages/pores/sizes.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "stages/pores/least_box.h"
#include "stages/pores/parts.h"
#include "stages/pores/voids.h"

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
  Buffer<std::uint8_t> beside(parts.size(), std::uint8_t{0});
  if (outside != nullptr) beside = parts_beside(slice, parts, *outside);
  Ends ends = ends_of(slice, parts);
  const double pixel_mm2 = mm(slice.edge[0]) * mm(slice.edge[1]);
  const std::array<double, 2> size_mm{slice.nx * mm(slice.edge[0]), slice.ny * mm(slice.edge[1])};
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const double area = static_cast<double>(parts.voxels[p]) * pixel_mm2;
    if (parts.wraps[p] != 0) {
      ++sizes.endless;
      sizes.endless_mm2 += area;
      if (parts.wraps[p] < 3) sizes.channels_mm.push_back(area / (parts.wraps[p] == 1 ? size_mm[0] : size_mm[1]));
    } else if (beside[p] != 0 || (parts.faces[p] & (kFacesX | kFacesY)) != 0) {
      ++sizes.cut;
      sizes.cut_mm2 += area;
    } else {
      const std::span<Pixel> pixels = std::span(ends.pixels).subspan(ends.begin[p], ends.begin[p + 1] - ends.begin[p]);
      const BoxSides box = least_box(pixels, {slice.edge[0], slice.edge[1]});
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
    const VoxelView beside = body == nullptr ? VoxelView() : outside.view().slice(z);
    found[z] = sizes_of(empty.view().slice(z), body == nullptr ? nullptr : &beside, z);
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
  const auto [least, most] = std::ranges::minmax(values);
  result.least = least, result.most = most;
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

}  // namespace lamina::pores
