// stages/formats/images/image_order.h: the order of layer images by the numbers in their names.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stages/data/status.h"
#include "stages/formats/images/layer_images.h"

namespace lamina::formats {

/// What the numbers of images count.
struct ImageSteps {
  bool heights = false;         // else they are those of the names
  double first = 0, step = 0;   // height of the first image, and between two numbers
  std::uint64_t first_number = 0;
  int digits = 0;               // of heights in the names, behind the decimal point

  /// "number 3", or "height 0.3".
  std::string name_of(std::uint64_t number) const;
};

/// Sorts images from the bottom up. Their order is that of the last numbers of their names. If some of these have a decimal
/// point and all are heights of equal steps, z0.5.png to z1.5.png, it is that of the heights, whose numbers become whole
/// multiples of the step; the heights may be rounded, as z0.033.png to z0.100.png. A minus in front of some of the heights is a
/// sign; in front of all, it separates. Another number of each name that counts in steps of one size is an order too.
/// images  each with the last run of digits of its name as its number
/// errors  kInput: the names allow two orders; the message has the first names of both. cost  memory of the names' numbers
Result<ImageSteps> sort_images(const std::string& folder, std::vector<Numbered>& images);

}  // namespace lamina::formats
