#include "pipeline/output/layer_images.h"

#include <utility>

#include "stages/raster/combine.h"

namespace lamina::pipeline {

bool add_image(Runs&& image, Runs& whole) {
  if (whole.row_offset.empty()) {
    whole = std::move(image);
    return true;
  }
  if (image.columns != whole.columns || image.row_offset.size() != whole.row_offset.size()) return false;
  Runs both;
  raster::combine(whole, image, raster::SetOperation::kUnion, both);
  both.columns = whole.columns;
  if (set_pixels(both) != set_pixels(whole) + set_pixels(image)) return false;
  whole = std::move(both);
  return true;
}

}  // namespace lamina::pipeline
