// stages/raster/kernels/bead_rows.h: the inner loops of beads: which columns a bead covers in each row of a band, the bits of
// these, and the columns where the bits of a band change; a body for each instruction set, all with the same results.
//
// The bits of a band are stored by columns of words: word w of all rows of the band, then word w + 1. Neighbouring rows of a
// bead have their bits in neighbouring words, so a register takes many rows at once, at any angle of the bead.
#pragma once

#include <array>
#include <cstdint>

#include "stages/data/choices.h"

namespace lamina::raster {

inline constexpr std::uint32_t kBeadBandRows = 64, kBeadWordBits = 32;

/// Rows of a band, and what of each a bead covers: columns [begin, end), none unless begin < end.
struct alignas(64) BeadRows {
  double y[kBeadBandRows];  // nm of the row's centre on the bed, descending; any number beyond the last row of the image
  std::int32_t begin[kBeadBandRows], end[kBeadBandRows];
  double near[kBeadBandRows];  // from begin or end back to where it is: below BeadShape::tolerance it may be one less
};

/// A bead as two chains of edges, left and right, nm from its lower end; its columns are first guesses.
struct BeadShape {
  double y0;                 // of the lower end
  double dx, dy;             // to the other end; dy >= 0, and dx > 0 where dy is 0
  double radius, radius2;    // of both discs
  double slope, aside;       // edges along the bead: x = y slope -+ aside
  double left[2], right[2];  // y where these are its boundary; beyond are the discs
  bool square;               // no discs; left and right ends are x = y turned + end[.]
  double turned, end[2];
  double columns_per_nm, first_column;  // of x = 0, with half of `tolerance`
  double tolerance;                     // columns: twice of what boundaries may be off
  std::int32_t columns;                 // of the image
};

/// What a bead covers between its discs, in columns from first_word on, as numbers of kBeadLineBits bits after the point.
struct BeadLine {
  std::uint32_t first_word;
  std::uint32_t from, to;   // of the first row
  std::uint32_t step;       // from row to row; below 0 it wraps around
  std::uint32_t tolerance;  // a column is undecided where what is beyond it is less
};
inline constexpr int kBeadLineBits = 21;

struct BeadKernels {
  /// Columns of rows [first, last) of the band, and of some more.
  /// returns  whether any may be undecided
  bool (*columns)(const BeadShape& bead, std::uint32_t first, std::uint32_t last, BeadRows& rows);
  /// Sets the bits of [begin, end) in those rows. touched  of each column of words: becomes 1
  /// within  first and last column of words that may have any: known beforehand, no branch waits for begin and end
  void (*set)(const BeadRows& rows, std::uint32_t first, std::uint32_t last, const std::array<std::uint32_t, 2>& within,
              std::uint32_t* words, std::uint8_t* touched);
  /// Columns of rows [first, last) of a line, and their bits. nullptr: there is no faster way than both of the above
  /// returns  a bit for each undecided row, of which no bit is set
  std::uint64_t (*line)(const BeadLine& line, std::uint32_t first, std::uint32_t last, std::uint32_t* words,
                        std::uint8_t* touched);
  /// Which bits of a column of words differ from the ones before, and those of the rows to come; clears the words.
  /// words, carry, changed  kBeadBandRows each; returns  a bit for each row that changes
  std::uint64_t (*changes)(std::uint32_t* words, std::uint32_t* carry, std::uint32_t* changed);
};

const BeadKernels& bead_kernels_for(Isa isa);

}  // namespace lamina::raster
