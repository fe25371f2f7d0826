#include "stages/formats/svg/svg_writer.h"

#include <fmt/format.h>

#include "stages/support/text/decimal.h"

namespace lamina::formats {

std::string svg_escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '&')
      out += "&amp;";
    else if (c == '<')
      out += "&lt;";
    else if (c == '>')
      out += "&gt;";
    else if (c == '"')
      out += "&quot;";
    else if (c == '-' && out.ends_with('-'))
      out += "&#45;";  // "--" may not stand in a comment
    else if (static_cast<unsigned char>(c) >= 0x20)
      out += c;
  }
  return out;
}

void SvgWriter::begin(std::string_view element) {
  indent();
  append(out_, "<");
  append(out_, element);
}

void SvgWriter::attribute(std::string_view name, std::string_view value) {
  append(out_, " ");
  append(out_, name);
  append(out_, "=\"");
  append(out_, value);
  append(out_, "\"");
}

void SvgWriter::number(std::string_view name, double value) { attribute(name, fmt::format("{:.2f}", value)); }

void SvgWriter::millimetres(std::string_view name, std::int64_t nm, std::string_view unit) {
  append(out_, " ");
  append(out_, name);
  append(out_, "=\"");
  append_mm(out_, nm);
  append(out_, unit);
  append(out_, "\"");
}

void SvgWriter::begin_data() { append(out_, " d=\""); }

void SvgWriter::put_points(std::span<const Point2> points, const SvgFrame& frame, bool closed) {
  append_written(out_, points.size() * (2 * kMaxDecimal + 2) + 4, [&](char* text) {
    *text++ = 'M';
    for (const Point2 p : points) {
      *text++ = ' ';
      text = put_mm(p.x - frame.left, text);
      *text++ = ' ';
      text = put_mm(frame.back - p.y, text);
    }
    if (!closed) return text;
    for (const char c : {' ', 'z', ' '}) *text++ = c;
    return text;
  });
}

void SvgWriter::end_data() { append(out_, "\""); }

void SvgWriter::comment(std::string_view text) { append(out_, fmt::format("<!-- {} -->\n", svg_escaped(text))); }

void SvgWriter::end() { append(out_, " />\n"); }

void SvgWriter::open() {
  append(out_, ">\n");
  ++depth_;
}

void SvgWriter::close(std::string_view element) {
  --depth_;
  indent();
  append(out_, "</");
  append(out_, element);
  append(out_, ">\n");
}

void SvgWriter::text(std::string_view line, std::string_view element) {
  append(out_, ">");
  append(out_, svg_escaped(line));
  append(out_, "</");
  append(out_, element);
  append(out_, ">\n");
}

}  // namespace lamina::formats
