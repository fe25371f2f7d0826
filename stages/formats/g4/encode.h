// stages/formats/g4/encode.h: CCITT Group 4 (ITU-T T.6) straight from runs.
#pragma once

#include <cstddef>
#include <cstdint>

#include "stages/data/buffer.h"
#include "stages/data/choices.h"
#include "stages/data/runs.h"

namespace lamina::formats::g4 {

struct StepsBody;

/// Encodes images one after another and keeps its scratch rows between them.
class Encoder {
 public:
  /// isa  the widest instructions to use, if the processor has them (geometry/isa.h); the bytes are the same with any
  explicit Encoder(Isa isa = Isa::kAuto);

  /// The image as T.6 code words with runs as black, then EOFB and zeros up to a whole byte, into file[start ...).
  /// Bytes before `start` are kept; the file grows as needed and may be left larger than its content.
  /// needs    1 <= columns <= 2^31 - 1 and well-formed runs (data/runs.h)
  /// returns  one past the last byte of content
  /// cost     one read of each change: below a nanosecond where rows follow each other's edges, a few where they do
  ///          not; a row like the one above costs a comparison, a stretch of empty rows the logarithm of its length
  std::size_t encode(const RunsView& runs, Buffer<std::byte>& file, std::size_t start);

 private:
  const StepsBody* body_;
  Buffer<std::uint32_t> coding_, reference_;  // 0, the changes of a row, then `columns` some times
};

}  // namespace lamina::formats::g4
