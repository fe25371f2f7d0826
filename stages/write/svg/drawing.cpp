#include "stages/write/svg/drawing.h"

#include <fmt/format.h>

#include <algorithm>

#include "stages/write/decimal.h"

namespace lamina::write::svg {

std::string drawing(const Box& box, std::span<const Region> regions) {
  const std::int64_t margin = std::max(box.width(), box.depth()) / 50;
  const std::int64_t left = box.lo.x - margin, back = box.hi.y + margin;
  Buffer<char> out;
  const auto put = [&](std::string_view text) { append(out, text); };
  const auto length = [&](std::int64_t nm) { append_mm(out, nm); };
  const std::int64_t width = box.width() + 2 * margin, height = box.depth() + 2 * margin;
  put("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"");
  length(width);
  put("mm\" height=\"");
  length(height);
  put("mm\" viewBox=\"0 0 ");
  length(width);
  put(" ");
  length(height);
  put("\">\n<!-- drawn by lamina -->\n");
  for (const auto& [contours, name, ink] : regions) {
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
  }
  put("</svg>\n");
  return {out.begin(), out.end()};
}

}  // namespace lamina::write::svg
