// stages/raster/images.h: images of a layer as runs: turned over, and those of several materials.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "stages/data/bit_image.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"

namespace lamina::raster {

/// x: columns are reversed (left becomes right); y: rows are reversed. Both may be requested at once; mirroring twice
/// gives the image back. O(runs + rows).
void mirror(const RunsView& runs, bool x, bool y, Runs& out);
void mirror(BitImage& image, bool x, bool y);

/// Images of one material each, while the solids of a layer are drawn over each other.
struct MaterialImages {
  std::vector<Runs> image;  // one for each material; no pixel is set in two
  Runs scratch;

  void start(std::size_t materials, std::uint32_t columns, std::uint32_t rows);
  /// Draws a solid's section over the others: it is set in `whole` and in its material's image, and in no other one.
  /// parity  what is set in both becomes neither (even-odd over all solids)
  void deposit(std::uint32_t material, const RunsView& section, Runs& whole, bool parity = false);
  /// Keeps only what is set in `whole`.
  void keep(const RunsView& whole);
  std::uint64_t bytes() const;
};

/// Adds the image of another material to those of a layer; `whole` is empty before the first one.
/// returns  false if a pixel is set in both, or their sizes differ; `whole` is then as it was
bool add_image(Runs&& image, Runs& whole);

/// The images of a layer's files put together: of each material, of each drop of a pixel, or of both.
class DropPlanes {
 public:
  /// maximum  drops of a pixel, 1 or more
  /// shared   a pixel can get drops of several materials
  DropPlanes(std::uint32_t maximum, bool shared) : max_(maximum), shared_(shared) {}

  /// Images come material by material, those of a material drop by drop, all of one size. drop  of its material, from 0
  /// errors  kVerification: its pixels contradict the others, "get no drop before"; `planes` are then of no use
  Status add(Runs&& image, std::uint32_t drop);

  /// The pixels that get one drop or more of any material, two or more, ...: `maximum` of them, once an image was added.
  std::vector<Runs> planes;

 private:
  std::uint32_t max_;
  bool shared_;
  Runs before_;  // the image of the drop before
};

}  // namespace lamina::raster
