#include "stages/formats/plot/plot.h"

#include <fmt/format.h>

#include <concepts>

#include "stages/formats/image_format.h"
#include "stages/formats/png/png_format.h"
#include "stages/formats/svg/svg_writer.h"
#include "stages/support/text/escape.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/json_value.h"

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

// --- as JSON, for lamina-preview.

template <class T, class Shape>
concept Is = std::same_as<std::remove_const_t<T>, Shape>;

void each_field(Is<Plot::Box> auto& box, auto visit) {
  visit("left", box.left), visit("top", box.top), visit("width", box.width), visit("height", box.height);
  visit("colour", box.colour);
}
void each_field(Is<Plot::Image> auto& image, auto visit) {
  visit("left", image.left), visit("top", image.top), visit("columns", image.columns);
  visit("colours", image.colours), visit("pixels", image.pixels);
}
void each_field(Is<Plot::Line> auto& line, auto visit) { visit("points", line.points), visit("colour", line.colour); }
void each_field(Is<Plot::Dot> auto& dot, auto visit) {
  visit("x", dot.x), visit("y", dot.y), visit("radius", dot.radius), visit("colour", dot.colour);
}
void each_field(Is<Plot::Text> auto& text, auto visit) {
  visit("x", text.x), visit("baseline", text.baseline), visit("size", text.size), visit("anchor", text.anchor);
  visit("colour", text.colour), visit("line", text.line);
}
void each_field(Is<Plot> auto& plot, auto visit) {
  visit("width", plot.width), visit("height", plot.height), visit("boxes", plot.boxes), visit("images", plot.images);
  visit("lines", plot.lines), visit("dots", plot.dots), visit("texts", plot.texts);
}

template <class Shape>
Json json_of(const Shape& shape) {
  Json json = Json::object();
  each_field(shape, [&json](std::string_view name, const auto& value) {
    using Value = std::remove_cvref_t<decltype(value)>;
    if constexpr (std::same_as<Value, Plot::Anchor>) {
      json[name] = static_cast<int>(value);
    } else if constexpr (std::convertible_to<const Value&, Json>) {
      json[name] = value;
    } else {
      Json& list = json[name] = Json::array();
      for (const auto& element : value) list.push_back(json_of(element));
    }
  });
  return json;
}

/// errors  throws JsonError
template <class Shape>
void read(const Json& json, Shape& shape) {
  each_field(shape, [&json](std::string_view name, auto& value) {
    using Value = std::remove_cvref_t<decltype(value)>;
    if constexpr (std::same_as<Value, Plot::Anchor>) {
      value = static_cast<Plot::Anchor>(json.at(name).get<int>());
    } else if constexpr (std::same_as<Value, decltype(Plot::Line::points)>) {
      for (const Json& point : json.at(name)) value.push_back({point.at(0).get<double>(), point.at(1).get<double>()});
    } else if constexpr (std::convertible_to<const Value&, Json>) {
      json.at(name).get_to(value);
    } else {
      for (const Json& element : json.at(name)) read(element, value.emplace_back());
    }
  });
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

std::string plot_json(const Plot& plot) { return json_text(json_of(plot)); }

Result<Plot> read_plot(std::string_view json) {
  if (!json_nests_within(json)) return Error{Fault::kUsage, "is no plot: it nests too deep"};
  try {
    Plot plot;
    read(parse_json(json), plot);
    return plot;
  } catch (const JsonError& error) {
    return Error{Fault::kUsage, std::string("is no plot: ") + error.what()};
  }
}

}  // namespace lamina::formats
