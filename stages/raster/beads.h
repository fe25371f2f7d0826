// stages/raster/beads.h: beads of true width become runs of pixels.
//
// A pixel is set if and only if its centre lies in a bead: no farther than half of the width from the bead's straight
// line (round ends), or from the part of it between the two ends (square ends). Columns of a row begin and end where a double
// says so, unless a whole number is so near that rounding might pass it: then integers decide.
#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "stages/data/buffer.h"
#include "stages/data/choices.h"
#include "stages/data/contours.h"  // Point2
#include "stages/data/grid.h"
#include "stages/data/mesh.h"  // Box
#include "stages/data/runs.h"
#include "stages/data/toolpaths.h"
#include "stages/raster/kernels/bead_rows.h"

namespace lamina::raster {

/// Collects the beads of a layer, in any order; reused from layer to layer. Keeps 36 bytes a bead, and the bits and runs of one
/// band of rows at a time: a bead may cover thousands of rows.
class BeadRaster {
 public:
  /// isa  widest instructions of the loops; no image depends on it
  explicit BeadRaster(const PixelGrid& grid, Isa isa = Isa::kAuto);

  void clear() { beads_.clear(); }
  /// Capacity for so many beads after clear().
  void reserve(std::size_t beads) { ensure_capacity(beads_, beads); }
  /// a, b   nm on the bed; equal for a dot (round ends only, square ends leave nothing)
  /// width  nm, > 0 and below 2^27 (134 mm)
  void add(Point2 a, Point2 b, Nm width, BeadEnds ends);
  /// All beads of a layer, with round ends. origin  nm on the bed: the front left corner of the grid
  void add(std::span<const DepositedBead> beads, Point2 origin);
  /// Gives the union of all beads, as bands of image rows from row 0 (at the back) on; each serves until the next.
  /// take  called with the image row that is the band's first
  /// cost  O(S + W + rows) for S rows that beads cover, each counted on its own, and W words of 32 pixels that these share
  void for_each_band(const std::function<void(std::uint32_t first_row, const RunsView& band)>& take);
  /// All bands as one image. cost  of for_each_band
  void runs(Runs& out);

  std::uint64_t bytes() const {
    return bytes_held(beads_) + bytes_held(by_band_) + bytes_held(reaching_) + bytes_held(band_begin_) + bytes_held(words_) +
           bytes_held(touched_) + bytes_held(row_change_) + bytes_held(slots_) + bytes_held(free_) +
           bytes_held(band_.row_offset) + bytes_held(band_.change);
  }
  /// Bytes of a band: its bits, and runs of rows with so many changes, or beads.
  static std::uint64_t band_bytes(const PixelGrid& grid, std::uint64_t changes_of_row) {
    return (std::uint64_t{grid.columns()} / kBeadWordBits + 2) * (4 * kBeadBandRows + 1) +
           8 * kBeadBandRows * (changes_of_row + 256) + sizeof(Reaching) * changes_of_row;
  }

 private:
  struct DepositedParts {
    Point2 a, b;
    std::uint32_t first_row, last_row;  // image rows that it may reach
    Nm width;
    BeadEnds ends;
  };
  /// Image rows [first, last) between the discs, and columns of the first one with 32 bits after the point.
  struct Straight {
    std::uint32_t first = 0, last = 0;
    std::int64_t from = 0, to = 0, step = 0;  // step  from row to row
    std::uint32_t tolerance = 0;              // of BeadLine
  };
  struct Reaching {
    DepositedParts deposited;
    BeadShape shape;
    Straight straight;
  };
  static constexpr std::uint32_t kMinLineRows = 12;  // fewer are covered as the discs are

  void begin(const DepositedParts& bead);
  void set_straight(Reaching& bead) const;
  void cover(const Reaching& bead, std::uint32_t first_row, std::uint32_t band_rows);
  bool cover_line(const Straight& line, std::uint32_t first_row, std::uint32_t first, std::uint32_t last,
                  std::uint64_t& undecided);
  void cover_rows(const Reaching& bead, std::uint32_t first_row, std::uint32_t first, std::uint32_t last);
  void decide(const Reaching& reaching, std::uint32_t row, std::uint32_t in_band);
  void collect(std::uint32_t band_rows);
  void widen_rows();

  PixelGrid grid_;
  double rows_per_nm_;
  const BeadKernels* kernels_;
  Buffer<DepositedParts> beads_;
  Buffer<std::uint32_t> by_band_, band_begin_;  // beads by the band of their first row; where each band's end
  Buffer<Reaching> slots_;                      // of beads that reach into the band at work
  Buffer<std::uint32_t> reaching_, free_;       // slots that are in use, and others
  BeadRows rows_;                               // of the band, and of the bead at work
  Buffer<std::uint32_t> words_;                 // of the band; all 0 between bands
  Buffer<std::uint8_t> touched_;                // by column of words
  Buffer<std::uint32_t> row_change_;            // of the band: row_capacity_ for each row
  std::size_t row_capacity_ = 0;
  Runs band_;
};

/// A grid to inspect the beads in a box: pixels of 50 um, larger ones where there were more than 20 000 along a side.
PixelGrid bead_grid(const Box& box);

// --- a part of beads: segments of paths become beads of pixels, and the part keeps what they cover.

/// Widths of beads, nm. Walls are as wide as their paths.
struct BeadWidths {
  bool segmented = false;  // what fills next to thick and thin segments is `continuous`, else as wide as its path
  Nm thick = 0, thin = 0, continuous = 0;

  Nm of(const PathInterval& s) const;
};

/// Deposits the segments of a part in a layer, in their order.
class BeadPen {
 public:
  /// beads  gains them; outlives the pen
  BeadPen(BeadRaster& beads, const BeadWidths& widths, BeadEnds ends) : beads_(beads), widths_(widths), ends_(ends) {}

  void deposit(const PathInterval& s);

 private:
  BeadRaster& beads_;
  BeadWidths widths_;
  BeadEnds ends_;
  Nm last_width_ = 0;
  Thickness last_ = Thickness::kReference;
  PathKind last_kind_ = PathKind::kOuter;
};

/// Leaves those pixels of the image that beads cover or that lie in its shell; none is added.
/// beads    all beads of the layer, on the grid of the image
/// inner    what of the image lies below the shell, or nullptr without a shell
/// scratch  of the image's kind
void keep_beads(Runs& image, BeadRaster& beads, const Runs* inner, Runs& scratch);

}  // namespace lamina::raster
