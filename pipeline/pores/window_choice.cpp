#include "pipeline/pores/window_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace lamina::pipeline {

namespace {

constexpr std::int64_t kMinSide = 1000;  // nm
/// The layers [first, last) of a part, of all without one; one at least.
std::array<std::uint32_t, 2> layers_of(const Pile& pile, const std::optional<Box>& part) {
  const auto count = static_cast<std::uint32_t>(pile.layers.size());
  if (!part) return {0, count};
  std::uint32_t first = 0, last = count;
  const auto middle = [&](std::uint32_t i) { return (pile.layers[i].low + pile.layers[i].high) / 2; };
  while (first + 1 < last && middle(first) < part->lo.z) ++first;
  while (last > first + 1 && middle(last - 1) > part->hi.z) --last;
  return {first, last};
}

constexpr std::int64_t kSameAllAlong = 150'000;  // nm: the least length that find_repeat() gives

}  // namespace

Result<WindowChoice> choose_window(const formats::GcodeFile& file, const Pile& pile, const WindowRequest& selection) {
  const Box& print = selection.part ? *selection.part : file.box();
  const auto [bottom_layer, top_layer] = layers_of(pile, selection.part);
  const std::uint32_t middle_layer = bottom_layer + (top_layer - bottom_layer) / 2;
  const Point3 middle = print.middle();
  Result<Repeat> repeat = find_repeat(file, pile, {middle.x, middle.y}, middle_layer);
  if (!repeat) return repeat.error();
  // Where beads touch, the middle of a layer is the same all over: that says nothing about the cusps above and below it.
  if (repeat->length[0] <= kSameAllAlong && repeat->length[1] <= kSameAllAlong) repeat->length = {};
  WindowChoice choice;
  const bool requested = selection.size_mm[2] > 0;
  std::array<std::int64_t, 2> side{};
  for (std::size_t a = 0; a < 2; ++a) {
    choice.window.periodic[a] = !requested && repeat->length[a] > 0;
    const std::int64_t maximum = a == 0 ? print.width() : print.depth();
    side[a] = requested               ? std::llround(selection.size_mm[a] * 1e6)
              : repeat->length[a] > 0 ? repeat->length[a]
                                      : std::min<std::int64_t>(2'000'000, maximum);
    if (side[a] > maximum)
      return Error{Fault::kUsage, fmt::format("--window: {:.3f} mm along {} are more than the print has: {:.3f} mm",
                                              mm(static_cast<Nm>(side[a])), "xy"[a], mm(static_cast<Nm>(maximum)))};
  }
  if (std::min(side[0], side[1]) < kMinSide)
    return Error{Fault::kInput, "the print is thinner than 1 um; there is nothing to analyse"};
  choice.window.periodic[2] = !requested && repeat->layers > 0;
  choice.first_layer = middle_layer;
  const auto& layers = pile.layers;
  const std::int64_t low = layers[middle_layer].low;
  const std::uint32_t maximum = top_layer - middle_layer;
  choice.layers = std::min(maximum, requested ? 1 : repeat->layers > 0 ? repeat->layers : 8);
  while (requested && choice.layers < maximum &&
         layers[middle_layer + choice.layers - 1].high - low < std::llround(selection.size_mm[2] * 1e6))
    ++choice.layers;
  const std::int64_t high = layers[middle_layer + choice.layers - 1].high;
  if (requested && high - low < std::llround(selection.size_mm[2] * 1e6) - 1000)
    return Error{Fault::kUsage,
                 fmt::format("--window: {:.3f} mm along z are more than the print has above its middle: {:.3f} mm",
                             selection.size_mm[2], static_cast<double>(high - low) * 1e-6)};
  const auto corner = [&](int sign, std::int64_t z) {
    return Point3{static_cast<Nm>(middle.x + sign * side[0] / 2), static_cast<Nm>(middle.y + sign * side[1] / 2),
                  static_cast<Nm>(z)};
  };
  choice.window.box.add(corner(-1, low));
  choice.window.box.add(corner(1, high));
  const std::array<std::int64_t, 3> length = {side[0], side[1], high - low};
  for (std::size_t a = 0; a < 3; ++a)
    choice.window.count[a] =
        static_cast<std::uint32_t>(std::max(4LL, std::llround(static_cast<double>(length[a]) / (1e3 * selection.voxel_um))));
  if (choice.window.voxels() > std::uint64_t{1} << 31)
    return Error{Fault::kUsage, "--voxel: so small that the window has more than 2^31; take larger ones or a smaller --window"};
  return choice;
}

Window with_half_as_many_voxels(Window window) {
  for (std::uint32_t& count : window.count) count = (count + 1) / 2;
  return window;
}

Window finer(Window window, std::uint32_t times) {
  for (std::uint32_t& count : window.count) count *= times;
  return window;
}

}  // namespace lamina::pipeline
