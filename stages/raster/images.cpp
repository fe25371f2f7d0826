#include "stages/raster/images.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <utility>

#include "stages/geometry/bits.h"
#include "stages/geometry/combine.h"

namespace lamina::raster {

void mirror(const RunsView& runs, bool x, bool y, Runs& out) {
  const std::uint32_t rows = runs.rows();
  out.columns = runs.columns;
  out.row_offset.resize(std::size_t{rows} + 1);
  out.change.resize(runs.change.size());
  out.row_offset[0] = 0;
  std::uint32_t* next = out.change.data();
  for (std::uint32_t r = 0; r < rows; ++r) {
    const auto row = runs.row(y ? rows - 1 - r : r);
    if (x) {
      for (std::size_t i = row.size(); i-- > 0;) *next++ = runs.columns - row[i];
    } else {
      for (const std::uint32_t column : row) *next++ = column;
    }
    out.row_offset[r + 1] = static_cast<std::uint32_t>(next - out.change.data());
  }
}

void mirror(BitImage& image, bool x, bool y) {
  const std::uint32_t rows = image.rows();
  for (std::uint32_t r = 0; y && r < rows / 2; ++r) std::ranges::swap_ranges(image.row(r), image.row(rows - 1 - r));
  for (std::uint32_t r = 0; x && r < rows; ++r) reverse_row(image.row(r), image.columns());
}

void MaterialImages::start(std::size_t materials, std::uint32_t columns, std::uint32_t rows) {
  image.resize(materials);
  for (Runs& one : image) {
    one.columns = columns;
    one.row_offset.assign(std::size_t{rows} + 1, 0);
    one.change.clear();
  }
}

void MaterialImages::deposit(std::uint32_t material, const RunsView& section, Runs& whole, bool parity) {
  if (section.change.empty()) return;
  if (parity) {
    Runs own, others;
    combine(section, whole, SetOperation::kDifference, own);
    combine(whole, section, SetOperation::kDifference, others);
    keep(others);
    std::swap(whole, others);
    return deposit(material, own, whole);
  }
  for (std::uint32_t m = 0; m < image.size(); ++m) {
    if (m != material && image[m].change.empty()) continue;
    combine(image[m], section, m == material ? SetOperation::kUnion : SetOperation::kDifference, scratch);
    std::swap(image[m], scratch);
  }
  combine(whole, section, SetOperation::kUnion, scratch);
  std::swap(whole, scratch);
}

void MaterialImages::keep(const RunsView& whole) {
  for (Runs& one : image) {
    combine(one, whole, SetOperation::kIntersection, scratch);
    std::swap(one, scratch);
  }
}

std::uint64_t MaterialImages::bytes() const {
  std::uint64_t total = bytes_held(scratch.row_offset) + bytes_held(scratch.change);
  for (const Runs& one : image) total += bytes_held(one.row_offset) + bytes_held(one.change);
  return total;
}

bool add_image(Runs&& image, Runs& whole) {
  if (whole.row_offset.empty()) {
    whole = std::move(image);
    return true;
  }
  if (image.columns != whole.columns || image.row_offset.size() != whole.row_offset.size()) return false;
  Runs both;
  combine(whole, image, SetOperation::kUnion, both);
  both.columns = whole.columns;
  if (set_pixels(both) != set_pixels(whole) + set_pixels(image)) return false;
  whole = std::move(both);
  return true;
}

namespace {

/// Whether the operation leaves no pixel.
bool leaves_none(const RunsView& a, const RunsView& b, SetOperation operation) {
  Runs result;
  combine(a, b, operation, result);
  return result.change.empty();
}

void merge(const Runs& image, Runs& plane) {
  Runs both;
  combine(plane, image, SetOperation::kUnion, both);
  plane = std::move(both);
}

}  // namespace

Status DropPlanes::add(Runs&& image, std::uint32_t drop) {
  const auto wrong = [](std::string what) { return Error{Fault::kVerification, std::move(what)}; };
  if (planes.empty()) {
    Runs none;
    none.columns = image.columns;
    none.row_offset.assign(image.row_offset.size(), 0);
    planes.resize(max_, none);
  }
  if (drop >= max_) return wrong(fmt::format("get more than {} drops", max_));
  if (drop > 0 && !leaves_none(image, before_, SetOperation::kDifference)) return wrong("get no drop before");
  if (max_ > 1) before_ = image;
  if (!shared_) {
    if (planes[drop].change.empty()) {
      planes[drop] = std::move(image);
    } else if (drop == 0 && !leaves_none(planes[0], image, SetOperation::kIntersection)) {
      return wrong("another material's image sets as well");
    } else {
      merge(image, planes[drop]);
    }
    return {};
  }
  // A drop falls on those that other materials have there.
  for (Runs& plane : planes) {
    if (image.change.empty()) break;
    Runs upon;
    combine(plane, image, SetOperation::kIntersection, upon);
    merge(image, plane);
    image = std::move(upon);
  }
  return image.change.empty() ? Status() : wrong(fmt::format("get more than {} drops", max_));
}

}  // namespace lamina::raster
