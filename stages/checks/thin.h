// stages/checks/thin.h: walls that are narrower than a width, and those that a bleed takes away as a whole, on runs.
//
// codes   vanished     pieces of layers that the bleed leaves nothing of, larger than four of its discs, layer upon layer
#pragma once

#include <cstdint>
#include <vector>

#include "stages/checks/bodies.h"
#include "stages/checks/chains.h"
#include "stages/checks/simple_chains.h"
#include "stages/data/buffer.h"
#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"

namespace lamina::checks {

// --- eight-sided discs of pixels, one for each width up to a least one.
//
// Each is the union of the previous one and its copy one pixel to the right, down, both, or right and up. So each consists of
// copies of all narrower ones, and what a wide one covers they cover too: a region thin for a width is so for wider ones.
//
// Source: sizes of what is opened, G. Matheron, Random Sets and Integral Geometry, Wiley 1975, chapter 1.5; polygons as sums of
// segments, P. Soille, Morphological Image Analysis, 2nd ed., Springer 2003, chapter 3.

/// Columns of each of its rows, ends included, counted from its left and its top.
struct Stencil {
  struct StencilRow {
    std::uint32_t first = 0, last = 0;
  };
  std::uint32_t columns = 0;  // rows are rows.size()
  std::vector<StencilRow> rows;
  StencilSteps steps;
};

class Stencils {
 public:
  /// The last one is just as wide and as high as a square of `min_nm`, in whole pixels upwards, or does not fit into the
  /// image. min_nm  0 .. kNmReach; 0: there is only the first one, of one pixel
  Stencils(const PixelGrid& grid, std::int64_t min_nm);

  std::uint32_t count() const { return static_cast<std::uint32_t>(sums_.size()); }
  /// By width; the first is one pixel, the second at least two in one direction.
  Stencil at(std::uint32_t number) const;
  /// Pixels of two squares of its width.
  std::uint64_t two_squares(std::uint32_t number) const;

 private:
  std::vector<StencilSteps> sums_;
};

// ---

struct ThinRegion {
  std::uint64_t pixels = 0;
  PixelBox box;
};

/// What a layer holds of thin places.
struct ThinRegions {
  std::uint32_t count = 0;
  std::uint64_t pixels = 0;         // of all
  std::vector<ThinRegion> largest;  // at most kMax, the largest first; equal ones from the top, then from the left
  std::uint64_t bytes = 0;          // that finding them took
  static constexpr std::size_t kMax = 20;
};

/// Scratch of thin_regions(); kept from layer to layer.
struct ThinScratch {
  Runs outside, anchors, grown, fits, left, chosen, waiting, pending, between;
  Chains chains;
  SimpleChains simple;
  Runs near, context, few, more;
  Buffer<std::uint32_t> rows;  // those of an image that `few` has; UINT32_MAX: an empty one
  Buffer<std::uint64_t> spans;
  Buffer<std::uint8_t> marks;
  Pieces pieces;
  std::uint64_t bytes() const;
};

/// Parts of an image that the last stencil does not cover. What of them is not narrow is corners, and necks between wide parts.
struct Widths {
  Runs narrow;  // thin regions, and pieces that the last stencil does not fit into, of any size
  Runs rest;    // all of them
  std::uint64_t bytes() const { return bytes_of(narrow) + bytes_of(rest); }
};

/// Places that for any of the stencils are thin: pixels that it covers nowhere where it lies on set pixels alone, and that
/// touch each other at sides or corners, more than two squares of its width. Of places within each other the largest counts.
/// Corners of thick bodies leave less: of a width of 2 r 0.22 r squared at right angles and 4.3 r squared at 20 degrees. More
/// stencils find more: never less. cost  O(rows of the last stencil x runs), and for narrower ones that of the places that are
/// left
/// widths  if not null: where the image is wide, and where it is narrow
ThinRegions thin_regions(const RunsView& image, const Stencils& stencils, ThinScratch& scratch, Widths* widths = nullptr);

/// Removes the pieces that reach the edge of the window.
void drop_at_edge(const PixelBox& window, ThinScratch& scratch, Runs& image);

/// The top left corners of all positions in which the stencil is within the image and the window.
void erode(const RunsView& image, const PixelBox& window, const Stencil& stencil, ThinScratch& scratch, Runs& corners);
/// The same of an image within the window whose chains scratch.simple has found last.
void erode_found(const RunsView& image, const PixelBox& window, const Stencil& stencil, ThinScratch& scratch, Runs& corners);
/// All pixels of an image that the stencil covers where it is within the image.
void open(const RunsView& image, const Stencil& stencil, ThinScratch& scratch, Runs& result);

/// Pixels whose eight neighbours are set.
void inner_pixels(const RunsView& image, Runs& result);

/// Where wide parts of an image meet in less than the last stencil: corners and necks that touch two of them, at sides or
/// corners, gaps of one pixel included, since parts that meet in an edge may leave one. Parts of fewer pixels than `minimum`
/// are no part. cost  O(runs)
class Necks {
 public:
  void find(const RunsView& image, const Widths& widths, std::uint64_t minimum, Runs& result);
  std::uint64_t bytes() const;

 private:
  void mark(const RunsView& wide, const RunsView& rest, std::uint64_t minimum);
  bool bridge(const RunsView& image);
  bool touches_two(const RunsView& wide, const RunsView& rest);

  Runs bridged_, rest_, added_;  // bridged: what bridges add to the image
  Runs near_, all_wide_;         // wide parts of rows next to the rest, and of all
  Pieces wide_, pieces_;
  Buffer<std::uint32_t> neighbour_;  // wide part of each piece of the rest
  Buffer<std::uint8_t> joins_;       // by piece of the rest: it touches two
  Buffer<std::uint64_t> spans_;      // of a row
  Buffer<std::uint32_t> joined_;     // the same as a row of an image
};

/// The pixels between the runs of `image`, in rows and columns [first, last) of the window; nothing beyond it.
void complement(const RunsView& image, const PixelBox& window, Runs& result);

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

  std::uint32_t next_ = 0;  // layer
  LayerSpan now_;
  std::uint32_t layers_ = 0;  // reported
  LayerSpan worst_;
};

}  // namespace lamina::checks
