#include "stages/raster/materials.h"

#include <utility>

#include "stages/raster/combine.h"

namespace lamina::raster {

void MaterialImages::start(std::size_t materials, std::uint32_t columns, std::uint32_t rows) {
  image.resize(materials);
  for (Runs& one : image) {
    one.columns = columns;
    one.row_offset.assign(std::size_t{rows} + 1, 0);
    one.change.clear();
  }
}

void MaterialImages::lay(std::uint32_t material, const RunsView& section, Runs& whole, bool parity) {
  if (section.change.empty()) return;
  if (parity) {
    Runs own, others;
    combine(section, whole, SetOperation::kDifference, own);
    combine(whole, section, SetOperation::kDifference, others);
    keep(others);
    std::swap(whole, others);
    return lay(material, own, whole);
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

bool add_drop(Runs&& image, std::vector<Runs>& planes) {
  if (!planes.empty()) {
    const Runs& before = planes.back();
    if (image.columns != before.columns || image.row_offset.size() != before.row_offset.size()) return false;
    Runs common;
    combine(before, image, SetOperation::kIntersection, common);
    if (set_pixels(common) != set_pixels(image)) return false;
  }
  planes.push_back(std::move(image));
  return true;
}

}  // namespace lamina::raster
