// stages/view/report/run_code.h: runs as few bytes, for a page that unpacks them where they are looked at.
//
// Row by row, all numbers in base 128, low digit first, the high bit set on all bytes but the last:
//   0 n          the next n rows are like the row before (before the first row: empty)
//   1 d ...      as many changes as in the row before, each that of the row before plus d, folded: 0 -1 1 -2 2 ... are
//                0 1 2 3 4 ...
//   2 + m g ...  m changes, each the one before it in the row plus g (the first: g)
// and all of that in one zlib stream. Most rows of a part are like the row before, or near to it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/data/runs.h"

namespace lamina::view::report {

/// The code of an image, deflated. cost  one pass over the changes, and deflate
Buffer<std::byte> pack_runs(const RunsView& runs);

/// Any bytes as one zlib stream.
Buffer<std::byte> deflate_bytes(std::span<const std::byte> bytes);

}  // namespace lamina::view::report
