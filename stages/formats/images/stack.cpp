#include "stages/formats/images/stack.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "stages/data/shortage.h"
#include "stages/formats/images/image.h"
#include "stages/formats/images/layer_images.h"
#include "stages/support/text/readable.h"

namespace lamina::formats {
namespace {

/// The columns and rows of a box, from the front to the back.
Runs part_of(const Runs& image, const std::array<std::uint32_t, 3>& low, const std::array<std::uint32_t, 3>& count) {
  Runs out;
  out.columns = count[0];
  out.row_offset.assign(1, 0);
  const std::uint32_t rows = image.view().rows(), end = low[0] + count[0];
  for (std::uint32_t y = low[1]; y < low[1] + count[1]; ++y) {
    const auto row = image.view().row(rows - 1 - y);
    for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
      const std::uint32_t from = std::max(row[i], low[0]), to = std::min(row[i + 1], end);
      if (from < to) out.change.insert(out.change.end(), {from - low[0], to - low[0]});
    }
    out.row_offset.push_back(static_cast<std::uint32_t>(out.change.size()));
  }
  return out;
}

}  // namespace

Result<ImageStack> stack_of_images(const std::string& folder, const StackRequest& request) {
  if (!(request.pixel_um > 0))
    return Error{Fault::kUsage, one_line(folder) + ": no manifest.json of lamina jet states the pixel size; give --pixel"};
  auto images = numbered_images(folder);
  if (!images) return images.error();
  const auto files = std::make_shared<const std::vector<Numbered>>(std::move(*images));
  const auto first = dark_pixels(files->front().path, request.threshold);
  if (!first) return first.error();
  ImageStack stack;
  stack.path = folder;
  stack.size = {first->runs.columns, first->runs.view().rows(), static_cast<std::uint32_t>(files->size())};
  const double layer_um = request.layer_um > 0 ? request.layer_um : request.pixel_um;
  stack.edge = {1e3 * request.pixel_um, 1e3 * request.pixel_um, 1e3 * layer_um};
  stack.part = stack.size;
  for (std::size_t a = 0; a < 3; ++a) {
    if (stack.size[a] * stack.edge[a] > static_cast<double>(kNmReach))
      return Error{Fault::kUsage, fmt::format("{}: is {:.3g} m long along {}; give smaller --pixel or --layer-um",
                                              one_line(folder), stack.size[a] * stack.edge[a] * 1e-9, "xyz"[a])};
  }
  for (std::uint32_t l = 0; l < stack.size[2]; ++l) stack.layer_of.push_back(l);
  stack.read = [files, request](std::uint32_t layer) -> Result<Runs> {
    auto image = dark_pixels((*files)[layer].path, request.threshold);
    if (!image) return image.error();
    return request.dark ? std::move(image->runs) : inverse(image->runs);
  };
  return stack;
}

Result<VoxelStack> cut_box(const ImageStack& stack, const std::array<std::uint32_t, 3>& low,
                           const std::array<std::uint32_t, 3>& count) {
  std::array<Nm, 3> edge{};
  for (std::size_t a = 0; a < 3; ++a) edge[a] = static_cast<Nm>(std::lround(stack.edge[a]));
  VoxelStack box(count[0], count[1], edge);
  Runs part;
  for (std::uint32_t z = low[2]; z < low[2] + count[2]; ++z) {
    const std::uint32_t layer = stack.layer_of[z];
    if (z == low[2] || layer != stack.layer_of[z - 1]) {
      const Result<Runs> image = stack.read(layer);
      if (!image) return of_input(image.error());
      if (image->columns != stack.size[0] || image->view().rows() != stack.size[1])
        return Error{Fault::kInput, fmt::format("{}: layer {} is {} x {} pixels, others are {} x {}", one_line(stack.path),
                                                layer, image->columns, image->view().rows(), stack.size[0], stack.size[1])};
      part = part_of(*image, low, count);
    }
    if (!box.append(part))
      return Error{Fault::kInput, "the window has too many runs of voxels; take a smaller one or larger voxels"};
  }
  return box;
}

}  // namespace lamina::formats
