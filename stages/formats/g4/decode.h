// stages/formats/g4/decode.h: CCITT Group 4 (ITU-T T.6) straight into runs.
#pragma once

#include <cstddef>
#include <cstdint>

#include "stages/data/buffer.h"
#include "stages/data/runs.h"
#include "stages/geometry/bits.h"

namespace lamina::formats {

/// How a strip of a TIFF is coded.
struct G4Strip {
  std::uint32_t columns = 0;   // 1 .. kMaxPixelsASide
  std::uint32_t rows = 0;      // of this strip
  bool low_bit_first = false;  // FillOrder 2
  bool white_is_set = false;   // runs are the white ones
};

/// Keeps its scratch rows between strips.
class G4Decoder {
 public:
  /// Appends the rows of a strip to `runs`, whose columns are set and whose row_offset holds a 0 at least; no end of block is
  /// needed behind them. `coded` gets some bytes behind its end, and its bits in order.
  /// false  for words that T.6 does not allow here, rows of another length, uncompressed mode and a strip that ends too early:
  ///        what was appended means nothing then. What is taken is what libtiff decodes
  /// cost   some nanoseconds a change; a nanosecond for those that lie below one, a bit for a blank row. Scratch is two rows
  bool append(Buffer<std::byte>& coded, const G4Strip& strip, Runs& runs);
  /// The same into a builder, some rows at a time.
  bool append(Buffer<std::byte>& coded, const G4Strip& strip, RunsBuilder& builder);

 private:
  void start(Buffer<std::byte>& coded, const G4Strip& strip);
  bool decode_row(const std::byte* coded);
  bool decode_rows(const std::byte* coded, const G4Strip& strip, std::uint32_t& row, Runs& runs, std::size_t max_changes);

  Buffer<std::uint32_t> above_, row_;         // changes, then `columns_` some times
  std::uint32_t columns_ = 0, of_above_ = 0;  // changes above
  std::uint32_t changes_ = 0;                 // of the row
  std::uint64_t bit_ = 0, bits_ = 0;          // the next one; all
};

}  // namespace lamina::formats
