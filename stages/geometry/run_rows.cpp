#include "stages/geometry/run_rows.h"

#include <algorithm>

namespace lamina {

void RunRows::row(std::uint32_t number, std::span<std::uint64_t> words) const {
  std::ranges::fill(words, 0);
  const auto change = runs_.row(number);
  for (std::size_t i = 0; i + 1 < change.size(); i += 2) {
    const std::uint32_t first = change[i] / 64, last = (change[i + 1] - 1) / 64;
    const std::uint64_t head = ~std::uint64_t{0} << (change[i] % 64),
                        tail = ~std::uint64_t{0} >> (63 - (change[i + 1] - 1) % 64);
    if (first == last) {
      words[first] |= head & tail;
      continue;
    }
    words[first] |= head;
    std::fill(words.begin() + first + 1, words.begin() + last, ~std::uint64_t{0});
    words[last] |= tail;
  }
}

}  // namespace lamina
