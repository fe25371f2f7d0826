// stages/formats/images/numbered.h: the images of a folder by their numbers, and the other side of one.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stages/data/runs.h"
#include "stages/data/status.h"

namespace lamina::formats {

struct Numbered {
  std::uint64_t number;
  std::string path;
};

/// Images .png, .tif, .tiff, .bmp, .pbm, .pgm of a folder in the order of the last numbers in their names; at least one.
/// Hidden files, folders and files of other kinds are passed over.
/// gaps    numbers may be missing
/// errors  kInput: no such images, no number in a name, two of one number, a number missing, a numbered JPEG, GIF or the like
Result<std::vector<Numbered>> numbered_images(const std::string& folder, bool gaps = false);

/// What is not set of an image.
Runs inverse(const Runs& image);

}  // namespace lamina::formats
