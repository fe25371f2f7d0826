#include "stages/dose/zones.h"

#include <algorithm>

namespace lamina::dose {

void join_zones(std::span<const Runs> images, std::vector<ZonePiece>& scratch, Levels& result) {
  result.start(images.empty() ? 0 : images.front().columns);
  const std::uint32_t rows = images.empty() ? 0 : images.front().view().rows();
  for (std::uint32_t r = 0; r < rows; ++r) {
    scratch.clear();
    for (std::size_t i = 0; i < images.size(); ++i) {
      const auto row = images[i].view().row(r);
      for (std::size_t k = 0; k + 1 < row.size(); k += 2)
        scratch.push_back({row[k], row[k + 1], static_cast<std::uint8_t>(i + 1)});
    }
    std::ranges::sort(scratch, {}, &ZonePiece::begin);
    for (const ZonePiece& piece : scratch) result.append(piece.begin, piece.end, piece.level);
    result.end_row();
  }
}

}  // namespace lamina::dose
