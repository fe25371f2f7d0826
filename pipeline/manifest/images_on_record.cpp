#include "pipeline/manifest/images_on_record.h"

#include <fmt/format.h>

#include <filesystem>
#include <system_error>

#include "pipeline/manifest/manifest.h"
#include "stages/data/layer.h"
#include "stages/support/text/readable.h"

namespace lamina {

namespace fs = std::filesystem;

Result<ImagesOnRecord> images_on_record(const std::string& path) {
  ImagesOnRecord reported{path, 0, 0, {}, 0};
  std::error_code ignored;
  if (!fs::is_directory(path, ignored)) return reported;
  std::string manifest = path + "/manifest.json";
  if (product_of_manifest(manifest) == Product::kImages) {
    reported.path = path + "/layers";
  } else {
    manifest = (fs::path(path).lexically_normal() / "../manifest.json").string();
    if (!fs::equivalent(path, fs::path(path) / "../layers", ignored) || product_of_manifest(manifest) != Product::kImages)
      return reported;
  }
  const auto read = read_manifest(manifest);
  if (!read || read->layers.empty()) return reported;
  if (read->head.grey_drops()) {
    return Error{Fault::kInput,
                 fmt::format("{}: its images are drops of a pixel as grey, which are no shares of a part; plan its "
                             "parts again, or copy the images into a folder of their own",
                             one_line(manifest))};
  }
  if (read->head.named_images() > 0) {
    return Error{Fault::kInput,
                 fmt::format("{}: has several images a layer, of drops or materials; plan its parts again, or name a "
                             "folder with one image a layer",
                             one_line(manifest))};
  }
  const Layer first = read->layers.front().layer;
  reported.bottom = first.bottom;
  reported.thickness = first.thickness;
  reported.mirror = read->head.mirror;
  reported.levels = read->head.full_level() > 0 ? read->head.levels : 0;
  for (const LayerRecord& record : read->layers) {
    if (record.layer.thickness == first.thickness) continue;
    return Error{Fault::kInput,
                 fmt::format("{}: layer {} is {} mm thick, the first one {} mm; images as parts are layers of "
                             "one thickness",
                             one_line(manifest), record.layer.index, mm(record.layer.thickness), mm(first.thickness))};
  }
  return reported;
}

bool are_grey_drops(const std::string& image) {
  const std::string manifest = (fs::path(image).parent_path() / "../manifest.json").string();
  if (product_of_manifest(manifest) != Product::kImages) return false;
  const auto read = read_manifest(manifest);
  return read && read->head.grey_drops();
}

}  // namespace lamina
