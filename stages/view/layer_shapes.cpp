#include "stages/view/layer_shapes.h"

#include <fmt/format.h>

#include "stages/write/decimal.h"

namespace lamina::pipeline {

Ink ink_of(PathKind kind) {
  constexpr Ink kInks[] = {{176, 58, 46}, {214, 137, 16}, {36, 113, 163}, {17, 120, 100}, {142, 68, 173}};
  return kInks[static_cast<std::size_t>(kind)];
}

std::string shapes_svg(const LayerShapes& shapes) {
  const std::int64_t margin = std::max(shapes.box.width(), shapes.box.depth()) / 50;
  const std::int64_t left = shapes.box.lo.x - margin, back = shapes.box.hi.y + margin;
  Buffer<char> out;
  const auto put = [&](std::string_view text) { write::append(out, text); };
  const auto length = [&](std::int64_t nm) { write::append_mm(out, nm); };
  const std::int64_t width = shapes.box.width() + 2 * margin, height = shapes.box.depth() + 2 * margin;
  put("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"");
  length(width);
  put("mm\" height=\"");
  length(height);
  put("mm\" viewBox=\"0 0 ");
  length(width);
  put(" ");
  length(height);
  put("\">\n");
  const auto shape = [&](const ContoursView& contours, std::string_view name, const Ink& ink) {
    put(fmt::format("<path class=\"{}\" fill=\"#{:02x}{:02x}{:02x}\" fill-rule=\"nonzero\" d=\"", name, ink[0], ink[1],
                    ink[2]));
    for (std::uint32_t c = 0; c < contours.size(); ++c) {
      put("M");
      for (const Point2 p : contours[c]) {
        put(" ");
        length(p.x - left);
        put(" ");
        length(back - p.y);
      }
      put(" z");
    }
    put("\"/>\n");
  };
  shape(shapes.contours, "solid", {205, 209, 216});
  for (const LayerShapes::Beads& beads : shapes.beads) shape(beads.outline, beads.name, beads.ink);
  put("</svg>\n");
  return {out.begin(), out.end()};
}

}  // namespace lamina::pipeline
