// stages/stokes/sums.h: loops and sums over cells that give the same digits for any number of threads; internal to stokes.
#pragma once

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstdint>

#include "stages/data/buffer.h"

namespace lamina::stokes {

inline constexpr std::uint32_t kTogether = 4096;  // cells or groups a task

/// Calls work(begin, end) for pieces of [0, count), in parallel.
template <class Work>
void for_pieces(std::uint32_t count, const Work& work) {
  tbb::parallel_for(std::uint32_t{0}, (count + kTogether - 1) / kTogether,
                    [&](std::uint32_t piece) { work(piece * kTogether, std::min(count, (piece + 1) * kTogether)); });
}

/// The sum of what work(begin, end) gives for the pieces, taken in their order.
template <class Work>
double sum_of_pieces(std::uint32_t count, const Work& work) {
  Buffer<double> sums((count + kTogether - 1) / kTogether);
  for_pieces(count, [&](std::uint32_t begin, std::uint32_t end) { sums[begin / kTogether] = work(begin, end); });
  double sum = 0;
  for (const double piece : sums) sum += piece;
  return sum;
}

}  // namespace lamina::stokes
