#include "stages/formats/svg/drawing.h"

#include <fmt/format.h>

#include <algorithm>

#include "stages/formats/svg/svg_writer.h"

namespace lamina::formats::svg {
namespace {

void write_region(SvgWriter& svg, const SvgFrame& frame, const std::string& name, const Ink& ink, const Contours& contours) {
  svg.begin("path");
  svg.attribute("class", svg_escaped(name));
  svg.attribute("fill", fmt::format("#{:02x}{:02x}{:02x}", ink[0], ink[1], ink[2]));
  svg.attribute("fill-rule", "nonzero");
  svg.begin_data();
  for (std::uint32_t c = 0; c < contours.size(); ++c) svg.contour(contours[c], frame);
  svg.end_data();
  svg.end();
}

}  // namespace

std::string drawing(const LayerShapes& shapes) {
  const Box& box = shapes.box;
  const std::int64_t margin = std::max(box.width(), box.depth()) / 50;
  const std::int64_t width = box.width() + 2 * margin, height = box.depth() + 2 * margin;
  const SvgFrame frame{box.lo.x - margin, box.hi.y + margin};
  Buffer<char> out;
  SvgWriter svg(out);
  svg.begin("svg");
  svg.attribute("xmlns", "http://www.w3.org/2000/svg");
  svg.millimetres("width", width, "mm");
  svg.millimetres("height", height, "mm");
  svg.attribute("viewBox", fmt::format("0 0 {} {}", mm(width), mm(height)));
  svg.open();
  svg.comment("drawn by lamina");
  write_region(svg, frame, "solid", {205, 209, 216}, shapes.contours);
  for (const LayerShapes::Beads& beads : shapes.beads) write_region(svg, frame, beads.name, beads.ink, beads.outline);
  svg.close("svg");
  return {out.begin(), out.end()};
}

}  // namespace lamina::formats::svg
