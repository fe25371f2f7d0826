#include "stages/formats/png/deflate.h"

#include <array>

namespace lamina::formats::png {
namespace {

constexpr Table table_of(const Weights& weights) {
  const Codes codes = codes_of(weights);
  return {codes, block_head(codes)};
}

// Weights are symbols in 10,000 of layers of parts at 1200 dpi; README.md says of which, and what other codes would give.

/// Scattered points, lattices, dithering: hardly a byte stands.
constexpr Weights kDense = {1500, 20, 60, 40, 25, 700, {20, 20, 20, 20, 20, 20, 20, 20, 20, 20, 20, 20, 20, 20,
                                                        20, 20, 20, 20, 20, 20, 20, 20, 20, 20, 20, 20, 20, 20}};
/// A bed full of parts.
constexpr Weights kBusy = {2650, 550, 115, 10, 2, 2000, {2,  2,  8,  8,   8,   8,   8,   8,   25,  16,  15,  18,  40,  40,
                                                         42, 45, 90, 105, 120, 125, 310, 225, 190, 155, 310, 235, 285, 120}};
/// A large part or a bed that is nearly empty.
constexpr Weights kSparse = {1250, 570, 37, 7, 2, 6300, {2,  2,  9,  8,  8,  7,  7,   7,  14, 16, 14,  15,  24,  19,
                                                         15, 12, 20, 20, 25, 28, 110, 40, 38, 56, 270, 130, 100, 95}};

constexpr Table kDenseTable = table_of(kDense), kBusyTable = table_of(kBusy), kSparseTable = table_of(kSparse);

/// Zeros and the byte or two that follow them are written as one word.
constexpr bool fits(const Table& table) {
  return longest(table.codes.zeros) + 2 * longest(table.codes.byte) <= BitWriter::kMaxBits;
}
static_assert(fits(kDenseTable) && fits(kBusyTable) && fits(kSparseTable));

}  // namespace

const Table& table_for(std::uint64_t bytes, std::uint64_t changes) {
  if (changes * 16 > bytes) return kDenseTable;
  return changes * 512 > bytes ? kBusyTable : kSparseTable;
}

}  // namespace lamina::formats::png
