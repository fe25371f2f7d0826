// stages/formats/png/image_data.h: the image data of a 1-bit PNG straight from runs: no row of bits, no byte of white.
#pragma once

#include <cstddef>
#include <cstdint>

#include "stages/data/runs.h"
#include "stages/formats/image_format.h"

namespace lamina::formats::png {

/// A chunk is closed at the first row's end from here on.
inline constexpr std::size_t kChunkBytes = 64 * 1024;

/// Rows of bits, filtered and deflated, as IDAT chunks into file[start ...). Bytes before `start` are kept; the file grows
/// as needed and may be left larger than its content.
/// needs    1 <= columns and rows <= kMaxPixelsASide and well-formed runs (data/runs.h)
/// returns  one past the last byte of the chunks
/// cost     one read of each change and some 5 ns for each that is not as in the row above; some 10 ns for a row that is not
///          white; a stretch of white rows costs the logarithm of its length and a bit in a hundred bytes
std::size_t put_image_data(const RunsView& runs, Bytes& file, std::size_t start);

}  // namespace lamina::formats::png
