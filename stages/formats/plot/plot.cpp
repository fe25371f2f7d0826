#include "stages/formats/plot/plot.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "stages/formats/image_format.h"
#include "stages/formats/png/png_format.h"
#include "stages/formats/svg/svg_writer.h"
#include "stages/support/text/escape.h"
#include "stages/support/text/json_text.h"

namespace lamina {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Plot::Box, left, top, width, height, colour)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Plot::Image, left, top, columns, colours, pixels)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Plot::Line, points, colour)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Plot::Dot, x, y, radius, colour)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Plot::Text, x, baseline, size, anchor, colour, line)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Plot, width, height, boxes, images, lines, dots, texts)

}  // namespace lamina

namespace lamina::formats {
namespace {

void colour(SvgWriter& svg, std::string_view name, const std::string& rgb) { svg.attribute(name, "#" + rgb); }

void put(SvgWriter& svg, const Plot::Box& box) {
  svg.begin("rect");
  svg.number("x", box.left);
  svg.number("y", box.top);
  svg.number("width", box.width);
  svg.number("height", box.height);
  colour(svg, "fill", box.colour);
  svg.end();
}

/// A picture within the picture, so that a colour is a byte a pixel before it is deflated.
void put(SvgWriter& svg, const Plot::Image& image) {
  const Bytes file = png::coloured(static_cast<std::uint32_t>(image.columns), image.colours, image.pixels);
  svg.begin("image");
  svg.number("x", image.left);
  svg.number("y", image.top);
  svg.number("width", image.columns);
  svg.number("height", static_cast<double>(image.pixels.size() / static_cast<std::size_t>(image.columns)));
  svg.attribute("href", "data:image/png;base64," + base64(file));
  svg.end();
}

void put(SvgWriter& svg, const Plot::Line& line) {
  std::string points;
  for (const auto& [x, y] : line.points) points += fmt::format("{}{:.2f},{:.2f}", points.empty() ? "" : " ", x, y);
  svg.begin("polyline");
  svg.attribute("points", points);
  svg.attribute("fill", "none");
  colour(svg, "stroke", line.colour);
  svg.end();
}

void put(SvgWriter& svg, const Plot::Dot& dot) {
  svg.begin("circle");
  svg.number("cx", dot.x);
  svg.number("cy", dot.y);
  svg.number("r", dot.radius);
  colour(svg, "fill", dot.colour);
  svg.attribute("fill-opacity", "0.5");
  svg.end();
}

void put(SvgWriter& svg, const Plot::Text& text) {
  constexpr std::string_view kAnchors[] = {"start", "middle", "end"};
  svg.begin("text");
  svg.number("x", text.x);
  svg.number("y", text.baseline);
  svg.attribute("font-size", fmt::format("{}", text.size));
  svg.attribute("text-anchor", kAnchors[static_cast<std::size_t>(text.anchor)]);
  colour(svg, "fill", text.colour);
  svg.text(text.line, "text");
}

}  // namespace

std::string plot_svg(const Plot& plot) {
  Buffer<char> out;
  SvgWriter svg(out);
  svg.begin("svg");
  svg.attribute("xmlns", "http://www.w3.org/2000/svg");
  svg.attribute("width", fmt::format("{}", plot.width));
  svg.attribute("height", fmt::format("{}", plot.height));
  svg.attribute("viewBox", fmt::format("0 0 {} {}", plot.width, plot.height));
  svg.attribute("font-family", "DejaVu Sans, sans-serif");
  svg.open();
  svg.comment("drawn by lamina");
  put(svg, Plot::Box{0, 0, double(plot.width), double(plot.height), "ffffff"});
  for (const Plot::Box& box : plot.boxes) put(svg, box);
  for (const Plot::Image& image : plot.images) put(svg, image);
  for (const Plot::Line& line : plot.lines) put(svg, line);
  for (const Plot::Dot& dot : plot.dots) put(svg, dot);
  for (const Plot::Text& text : plot.texts) put(svg, text);
  svg.close("svg");
  return {out.begin(), out.end()};
}

std::string plot_json(const Plot& plot) {
  return nlohmann::json(plot).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

Result<Plot> read_plot(std::string_view json) {
  if (!json_nests_within(json)) return Error{Fault::kUsage, "is no plot: it nests too deep"};
  try {
    return nlohmann::json::parse(json).get<Plot>();
  } catch (const nlohmann::json::exception& error) {
    return Error{Fault::kUsage, std::string("is no plot: ") + error.what()};
  }
}

}  // namespace lamina::formats
