// stages/write/svg/svg.cpp: slices as Slic3r writes them; see README.md for every attribute.
#include <fmt/format.h>

#include <iterator>

#include "stages/write/decimal.h"
#include "stages/write/slice_format.h"

namespace lamina::write {
namespace {

std::string_view colour_of(PathKind kind) {
  switch (kind) {
    case PathKind::kOuter: return "#c0392b";
    case PathKind::kInner: return "#e67e22";
    case PathKind::kRaster: return "#2980b9";
    case PathKind::kContour: return "#16a085";
    case PathKind::kLink: return "#8e44ad";
  }
  return "#000000";
}

std::string_view name_of(PathKind kind) {
  switch (kind) {
    case PathKind::kOuter: return "outer";
    case PathKind::kInner: return "inner";
    case PathKind::kRaster: return "raster";
    case PathKind::kContour: return "contour";
    case PathKind::kLink: return "link";
  }
  return "";
}

std::string escaped(std::string_view text) {
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

/// The picture's frame: x from the left of all parts, y downwards from their back.
struct Frame {
  std::int64_t left, back;
  char* put(Point2 p, char* out) const {
    out = put_mm(p.x - left, out);
    *out++ = ' ';
    return put_mm(back - p.y, out);
  }
};

class SvgEncoder : public SliceEncoder {
 public:
  void head(const SliceHead& head, Buffer<char>& out) const override {
    append(out,
           "<?xml version=\"1.0\" encoding=\"UTF-8\" standalone=\"yes\"?>\n"
           "<!DOCTYPE svg PUBLIC \"-//W3C//DTD SVG 1.0//EN\" \"http://www.w3.org/TR/2001/REC-SVG-20010904/DTD/svg10.dtd\">\n"
           "<svg width=\"");
    append_mm(out, head.bounds.width());
    append(out, "\" height=\"");
    append_mm(out, head.bounds.depth());
    append(out,
           "\" xmlns=\"http://www.w3.org/2000/svg\" xmlns:svg=\"http://www.w3.org/2000/svg\" "
           "xmlns:xlink=\"http://www.w3.org/1999/xlink\" xmlns:slic3r=\"http://slic3r.org/namespaces/slic3r\" "
           "viewport-fill=\"black\">\n");
    append(out, fmt::format("<!-- {}; millimetres; x 0 and y {:.6f} of the picture are x {:.6f} and y {:.6f} of the bed -->\n",
                            escaped(head.program), mm(head.bounds.depth()), mm(head.bounds.lo.x), mm(head.bounds.lo.y)));
  }

  void layer(const SliceHead& head, const SliceLayer& layer, Buffer<char>& out) const override {
    const Frame frame{head.bounds.lo.x, head.bounds.hi.y};
    append(out, fmt::format("\t<g id=\"layer{}\" slic3r:z=\"", layer.layer.index));
    append_mm(out, std::int64_t{layer.layer.bottom} + layer.layer.thickness);
    append(out, "\" slic3r:slice-z=\"");
    append_mm(out, layer.layer.plane());
    append(out, "\" slic3r:layer-height=\"");
    append_mm(out, layer.layer.thickness);
    append(out, "\">\n");
    for (std::size_t b = 0; b + 1 < layer.body.size(); ++b) {
      for (std::uint32_t c = layer.body[b]; c < layer.body[b + 1];) c = put_region(head, frame, layer, b, c, out);
    }
    for (std::uint32_t p = 0; p < layer.paths.size(); ++p) put_path(frame, layer.paths, p, out);
    append(out, "\t</g>\n");
  }

  void tail(const SliceHead&, Buffer<char>& out) const override { append(out, "</svg>\n"); }

 private:
  /// One element for an outer contour, the first, and the holes that follow it. returns the contour behind them
  static std::uint32_t put_region(const SliceHead& head, const Frame& frame, const SliceLayer& layer, std::size_t b,
                                  std::uint32_t first, Buffer<char>& out) {
    append(out, "\t\t<path d=\"");
    __int128 area = 0;
    std::uint32_t c = first;
    for (; c < layer.body[b + 1]; ++c) {
      const auto contour = layer.contours[c];
      const __int128 own = doubled_area(contour);
      if (c > first && own > 0) break;
      area += own;
      append_written(out, contour.size() * (2 * kMostDecimal + 2) + 4, [&](char* text) {
        *text++ = 'M';
        *text++ = ' ';
        for (const Point2 p : contour) {
          text = frame.put(p, text);
          *text++ = ' ';
        }
        *text++ = 'z';
        *text++ = ' ';
        return text;
      });
    }
    append(out, fmt::format("\" style=\"fill: white; stroke: black; stroke-width: 0; fill-type: evenodd; "
                            "fill-rule: evenodd\" slic3r:area=\"{:.4f}\"",
                            square_mm(area)));
    if (head.parts.size() > 1) append(out, fmt::format(" class=\"{}\"", escaped(head.parts[b])));
    append(out, " />\n");
    return c;
  }

  /// One element for each stretch of one kind and width, as wide as its bead.
  static void put_path(const Frame& frame, const ToolpathsView& paths, std::uint32_t p, Buffer<char>& out) {
    std::uint32_t begin = paths.offset[p];
    const std::uint32_t last = paths.offset[p + 1] - 1;
    while (begin < last) {
      std::uint32_t end = begin + 1;  // the stretch is begin .. end
      while (end < last && paths.kind[end] == paths.kind[begin] && paths.width[end] == paths.width[begin]) ++end;
      append(out, "\t\t<path d=\"");
      append_written(out, (end - begin + 1) * (2 * kMostDecimal + 2) + 4, [&](char* text) {
        *text++ = 'M';
        for (std::uint32_t i = begin; i <= end; ++i) {
          *text++ = ' ';
          text = frame.put(paths.point[i], text);
        }
        return text;
      });
      append(out, fmt::format("\" class=\"{}\" style=\"fill: none; stroke: {}; stroke-linecap: round; stroke-linejoin: round; "
                              "stroke-width: ",
                              name_of(paths.kind[begin]), colour_of(paths.kind[begin])));
      append_mm(out, paths.width[begin]);
      append(out, "\" />\n");
      begin = end;
    }
  }
};

}  // namespace

std::unique_ptr<SliceEncoder> make_svg_encoder() { return std::make_unique<SvgEncoder>(); }

}  // namespace lamina::write
