// stages/raster/materials.h: the images of a layer that has several materials.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "stages/data/runs.h"

namespace lamina::raster {

/// Images of one material each, while the solids of a layer are laid over each other.
struct MaterialImages {
  std::vector<Runs> image;  // one for each material; no pixel is set in two
  Runs scratch;

  void start(std::size_t materials, std::uint32_t columns, std::uint32_t rows);
  /// Lays a solid's section over the others: it is set in `whole` and in its material's image, and in no other one.
  /// parity  what is set in both becomes neither (even-odd over all solids)
  void lay(std::uint32_t material, const RunsView& section, Runs& whole, bool parity = false);
  /// Keeps only what is set in `whole`.
  void keep(const RunsView& whole);
  std::uint64_t bytes() const;
};

/// Adds the image of another material to those of a layer; `whole` is empty before the first one.
/// returns  false if a pixel is set in both, or their sizes differ; `whole` is then as it was
bool add_image(Runs&& image, Runs& whole);

/// Adds the image of the next drop, of the pixels that get one more than those before; `planes` is empty before the first one.
/// returns  false if it does not lie within the one before, or their sizes differ; `planes` is then as it was
bool add_drop(Runs&& image, std::vector<Runs>& planes);

}  // namespace lamina::raster
