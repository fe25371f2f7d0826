// stages/formats/g4/steady_rows.h: rows that have as many changes as those above them, many changes at a time.
#pragma once

#include <cstdint>

#include "stages/formats/g4/bit_writer.h"
#include "stages/formats/g4/steps.h"

namespace lamina::formats::g4 {

/// Rows that follow each other; the first has a row above, and all have the same number of changes.
struct SteadyRows {
  const std::uint32_t* change;  // the first of the first row
  std::uint32_t changes;        // of a row, 2 or more
  std::uint32_t rows;
  std::uint32_t columns;
};

/// Codes changes from the first on as long as none needs pass mode. needs  room for all of them
/// returns  how many are coded; each row whose last change is among them is whole. The first that is not coded has the change
///          above of the same number as T.6's b1, the one before it as a0
std::uint32_t put_steady_rows(BitWriter& writer, const SteadyRows& rows, const StepsBody& body);

}  // namespace lamina::formats::g4
