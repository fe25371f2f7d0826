// stages/formats/images/image_order.h: the order of layer images by the numbers in their names.
#pragma once

#include <string>
#include <vector>

#include "stages/data/status.h"
#include "stages/formats/images/layer_images.h"

namespace lamina::formats {

/// Sorts images from the bottom up. Their order is that of the last numbers of their names. If some of these have a decimal
/// point and all are heights of equal steps, z0.5.png to z1.5.png, it is that of the heights, whose numbers become whole
/// multiples of the step. Another number of each name that counts in steps of one size is an order too.
/// images  each with the last run of digits of its name as its number
/// errors  kInput: the names allow two orders; the message has the first names of both. cost  memory of the names' numbers
Status sort_images(const std::string& folder, std::vector<Numbered>& images);

}  // namespace lamina::formats
