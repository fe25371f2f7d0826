#include "stages/view/shapes.h"

namespace lamina::view {

Ink ink_of(PathKind kind) {
  constexpr Ink kInks[] = {{176, 58, 46}, {214, 137, 16}, {36, 113, 163}, {17, 120, 100}, {142, 68, 173}, {127, 140, 141}};
  return kInks[static_cast<std::size_t>(kind)];
}

Ink shade(const Ink& ink, std::size_t step, std::size_t steps) {
  if (steps < 2) return ink;
  const double paper = 0.6 * static_cast<double>(steps - 1 - step) / static_cast<double>(steps - 1);
  Ink mixed{};
  for (std::size_t c = 0; c < mixed.size(); ++c) mixed[c] = static_cast<std::uint8_t>(ink[c] + (255 - ink[c]) * paper);
  return mixed;
}

}  // namespace lamina::view
