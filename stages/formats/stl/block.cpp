#include "stages/formats/stl/block.h"

#include <cstdint>

namespace lamina::write::stl {

std::string block(const std::array<double, 3>& size) {
  std::string bytes(80, ' ');
  const auto put = [&](const auto& value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); };
  put(std::uint32_t{12});
  for (int axis = 0; axis < 3; ++axis) {
    for (int side = 0; side < 2; ++side) {
      // The four corners of a side, anticlockwise seen from outside.
      const int u = (axis + 1) % 3, v = (axis + 2) % 3;
      std::array<std::array<float, 3>, 4> corner{};
      for (int i = 0; i < 4; ++i) {
        const bool at_u = i == 1 || i == 2, at_v = i >= 2;
        corner[i][axis] = static_cast<float>(side * size[axis]);
        corner[i][side == 1 ? u : v] = static_cast<float>(at_u ? size[side == 1 ? u : v] : 0);
        corner[i][side == 1 ? v : u] = static_cast<float>(at_v ? size[side == 1 ? v : u] : 0);
      }
      for (const auto& triangle : {std::array{0, 1, 2}, {0, 2, 3}}) {
        put(std::array<float, 3>{});
        for (const int i : triangle) put(corner[i]);
        put(std::uint16_t{0});
      }
    }
  }
  return bytes;
}

}  // namespace lamina::write::stl
