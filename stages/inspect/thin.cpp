#include "stages/inspect/thin.h"

#include <algorithm>
#include <cmath>

namespace lamina::inspect {
namespace {

/// Where the image has rows and columns that are set, one pixel more on each side than `margin`, within the image.
PixelBox window_of(const RunsView& image, std::uint32_t margin) {
  PixelBox box;
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    const auto row = image.row(r);
    if (!row.empty()) box.add({row.front(), row.back(), r, r + 1});
  }
  if (box.right == 0) return {0, 0, 0, 0};
  return {box.left - std::min(box.left, margin), std::min(image.columns, box.right + margin),
          box.top - std::min(box.top, margin), std::min(image.rows(), box.bottom + margin)};
}

/// All pixels that lie within the disc of a set pixel, within the window.
void grow(const RunsView& image, const Disc& disc, const PixelBox& window, Buffer<std::uint64_t>& spans, Runs& result) {
  result.columns = image.columns;
  result.row_offset.assign(1, 0);
  result.change.clear();
  const auto far = static_cast<std::int64_t>(disc.size()) - 1;
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    const std::size_t row_begin = result.change.size();
    if (r >= window.top && r < window.bottom) {
      spans.clear();
      for (std::int64_t j = -far; j <= far; ++j) {
        const std::int64_t from = r + j;
        if (from < 0 || from >= image.rows()) continue;
        const std::uint32_t width = disc[static_cast<std::size_t>(std::abs(j))];
        const auto row = image.row(static_cast<std::uint32_t>(from));
        for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
          const std::uint32_t begin = std::max(window.left, row[i] - std::min(row[i], width));
          const std::uint32_t end = std::min(window.right, row[i + 1] + width);
          if (begin < end) spans.push_back(std::uint64_t{begin} << 32 | end);
        }
      }
      std::sort(spans.begin(), spans.end());
      for (const std::uint64_t span : spans) {
        const auto begin = static_cast<std::uint32_t>(span >> 32), end = static_cast<std::uint32_t>(span);
        if (result.change.size() > row_begin && begin <= result.change.back()) {
          result.change.back() = std::max(result.change.back(), end);
        } else {
          result.change.push_back(begin);
          result.change.push_back(end);
        }
      }
    }
    result.row_offset.push_back(static_cast<std::uint32_t>(result.change.size()));
  }
}

/// The pixels of `image` that `taken` does not hold.
void subtract(const RunsView& image, const RunsView& taken, Runs& result) {
  result.columns = image.columns;
  result.row_offset.assign(1, 0);
  result.change.clear();
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    const auto row = image.row(r), away = taken.row(r);
    std::size_t k = 0;
    for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
      std::uint32_t at = row[i];
      while (k + 1 < away.size() && away[k + 1] <= at) k += 2;
      for (std::size_t j = k; j + 1 < away.size() && away[j] < row[i + 1]; j += 2) {
        if (at < away[j]) {
          result.change.push_back(at);
          result.change.push_back(away[j]);
        }
        at = std::max(at, away[j + 1]);
      }
      if (at < row[i + 1]) {
        result.change.push_back(at);
        result.change.push_back(row[i + 1]);
      }
    }
    result.row_offset.push_back(static_cast<std::uint32_t>(result.change.size()));
  }
}

}  // namespace

Disc disc_of(const PixelGrid& grid, std::int64_t radius_nm) {
  const auto picometres = [](const PixelAxis& axis) { return static_cast<__int128>(axis.span) * 1000 / axis.dots; };
  const __int128 px = picometres(grid.x), py = picometres(grid.y), radius = __int128{radius_nm} * 1000;
  const auto within = [&](std::int64_t i, std::int64_t j) { return i * px * (i * px) + j * py * (j * py) <= radius * radius; };
  Disc disc;
  auto width = static_cast<std::int64_t>(radius / px);
  for (std::int64_t j = 0; within(0, j); ++j) {
    while (width > 0 && !within(width, j)) --width;
    disc.push_back(static_cast<std::uint32_t>(width));
  }
  if (disc.size() == 1 && disc[0] == 0) disc.clear();
  return disc;
}

void complement(const RunsView& image, const PixelBox& window, Runs& result) {
  result.columns = image.columns;
  result.row_offset.assign(1, 0);
  result.change.clear();
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    if (r >= window.top && r < window.bottom) {
      std::uint32_t at = window.left;
      const auto row = image.row(r);
      for (std::size_t i = 0; i + 1 < row.size() && at < window.right; i += 2) {
        if (at < row[i]) {
          result.change.push_back(at);
          result.change.push_back(std::min(row[i], window.right));
        }
        at = std::max(at, row[i + 1]);
      }
      if (at < window.right) {
        result.change.push_back(at);
        result.change.push_back(window.right);
      }
    }
    result.row_offset.push_back(static_cast<std::uint32_t>(result.change.size()));
  }
}

std::uint64_t ThinScratch::bytes() const {
  std::uint64_t total = bytes_held(spans) + pieces.bytes();
  for (const Runs* image : {&outside, &shrunk, &grown, &left})
    total += bytes_held(image->row_offset) + bytes_held(image->change);
  return total;
}

ThinPlaces thin_places(const RunsView& image, const Disc& disc, std::uint64_t least_pixels, ThinScratch& scratch) {
  ThinPlaces places;
  if (disc.empty() || image.change.empty()) return places;
  // A disc fits where its centre is out of reach of everything that is not set; what such discs cover is not thin.
  const auto reach = std::max<std::uint32_t>(disc[0], static_cast<std::uint32_t>(disc.size()) - 1) + 1;
  const PixelBox window = window_of(image, reach);
  complement(image, window, scratch.outside);
  grow(scratch.outside, disc, window, scratch.spans, scratch.grown);
  complement(scratch.grown, window, scratch.shrunk);
  grow(scratch.shrunk, disc, window, scratch.spans, scratch.grown);
  subtract(image, scratch.grown, scratch.left);
  scratch.pieces.find(scratch.left, true);
  for (std::size_t p = 0; p < scratch.pieces.count(); ++p) {
    const std::uint64_t pixels = scratch.pieces.pixels[p];
    if (pixels <= least_pixels) continue;
    ++places.count;
    places.pixels += pixels;
    if (pixels <= places.largest) continue;
    places.largest = pixels;
    places.box = scratch.pieces.box[p];
  }
  return places;
}

}  // namespace lamina::inspect
