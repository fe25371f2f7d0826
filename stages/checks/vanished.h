// stages/checks/vanished.h: walls that a bleed takes away as a whole, though it leaves most of their part.
//
// codes   vanished     pieces of layers that the bleed leaves nothing of, larger than four of its discs, layer upon layer
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/checks/bodies.h"
#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"

namespace lamina::checks {

/// Of a layer.
struct VanishedPieces {
  std::uint32_t count = 0;
  std::uint64_t largest = 0;  // pixels
  PixelBox box;               // of the largest, the first of equals
};

/// Kept from layer to layer.
struct VanishScratch {
  Pieces pieces;
  Buffer<std::uint8_t> stays;  // by piece
  std::uint64_t bytes() const { return pieces.bytes() + bytes_held(stays); }
};

/// Pieces of `before`, of pixels that touch at sides or corners, in which `after` sets nothing; of more than `least` pixels,
/// since tips of domes and ridges are of no more. before, after  of the same size. cost  O(runs)
VanishedPieces vanished_pieces(const RunsView& before, const RunsView& after, std::uint64_t minimum, VanishScratch& scratch);

/// Counts them over a job. The last layers of a slope vanish rightly: fewer than kLayers in sequence are not reported.
class VanishCount {
 public:
  static constexpr std::uint32_t kLayers = 3;

  /// In layer order.
  void add(const Layer& layer, const VanishedPieces& found);
  /// mirrored  whether columns and rows of the images are
  void report(const PixelGrid& grid, bool mirrored_x, bool mirrored_y, std::vector<Warning>& warnings) const;

 private:
  struct LayerSpan {
    std::uint32_t layers = 0;
    std::uint64_t largest = 0;
    PixelBox box;
    Layer layer{};  // of the largest
  };
  void end_span();

  std::uint32_t next_ = 0;  // layer
  LayerSpan now_;
  std::uint32_t layers_ = 0;  // reported
  LayerSpan worst_;
};

}  // namespace lamina::checks
