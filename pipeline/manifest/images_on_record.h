// pipeline/manifest/images_on_record.h: what a manifest of lamina tells of the layer images beside it.
#pragma once

#include <cstdint>
#include <string>

#include "stages/data/status.h"
#include "stages/data/units.h"

namespace lamina {

struct ImagesOnRecord {
  std::string path;              // of the images
  Nm bottom = 0, thickness = 0;  // of the first layer, of all; 0: nothing is on record
  std::string mirror;            // of the job that wrote them
  std::uint32_t levels = 0;      // of shares of voxels, that they carry; 0: they are of 1 bit
};

/// path  a job's directory, its layers/, or anything else, of which nothing is on record
/// errors  kInput: several images a layer, or layers of several thicknesses
Result<ImagesOnRecord> images_on_record(const std::string& path);

/// Whether an image is a layer of a job whose manifest says that its grey is drops of a pixel. False where none says so.
bool are_grey_drops(const std::string& image);

}  // namespace lamina
