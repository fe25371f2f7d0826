// stages/write/cli/cli.cpp: Common Layer Interface, text and binary; see README.md for every field.
#include <fmt/format.h>

#include <bit>

#include "stages/write/decimal.h"
#include "stages/write/slice_format.h"

namespace lamina::write {
namespace {

enum Direction : std::uint32_t { kInternal = 0, kExternal = 1, kOpen = 2 };

/// Labels may hold neither what separates fields nor what begins a command.
std::string label_of(std::string_view name) {
  std::string out;
  for (const char c : name) out += c == ',' || c == '/' || c == '$' || static_cast<unsigned char>(c) < 0x20 ? '_' : c;
  return out;
}

/// What of a path is a hatch (a straight line of a raster on its own) is told apart from polylines.
bool is_hatch(const ToolpathsView& paths, std::uint32_t stretch) { return paths.kind[stretch] == PathKind::kRaster; }

class CliEncoder : public SliceEncoder {
 public:
  CliEncoder(bool binary, bool empty_first_layer) : binary_(binary), empty_first_(empty_first_layer) {}

  void head(const SliceHead& head, Buffer<char>& out) const override {
    append(out, binary_ ? "$$HEADERSTART\n$$BINARY\n$$UNITS/1\n$$VERSION/200\n"
                        : "$$HEADERSTART\n$$ASCII\n$$UNITS/1\n$$VERSION/200\n");
    for (std::size_t b = 0; b < head.parts.size(); ++b) {
      append(out, fmt::format("$$LABEL/{},{}\n", b + 1, label_of(head.parts[b])));
    }
    append(out, "$$DIMENSION/");
    const Box& box = head.bounds;
    for (const Nm v : {box.lo.x, box.lo.y, box.lo.z, box.hi.x, box.hi.y, box.hi.z}) {
      append_mm(out, v);
      out.push_back(',');
    }
    out.back() = '\n';
    append(out, fmt::format("$$LAYERS/{}\n$$HEADEREND", head.layers + (empty_first_ ? 1 : 0)));
    if (!binary_) append(out, "\n$$GEOMETRYSTART\n");
    if (empty_first_) begin_layer(head.first_bottom, out);
  }

  void layer(const SliceHead&, const SliceLayer& layer, Buffer<char>& out) const override {
    begin_layer(std::int64_t{layer.layer.bottom} + layer.layer.thickness, out);
    for (std::size_t b = 0; b + 1 < layer.body.size(); ++b) {
      const auto id = static_cast<std::uint32_t>(b + 1);
      for (const Direction wanted : {kExternal, kInternal}) {
        for (std::uint32_t c = layer.body[b]; c < layer.body[b + 1]; ++c) {
          const Direction direction = doubled_area(layer.contours[c]) > 0 ? kExternal : kInternal;
          if (direction == wanted) polyline(id, direction, layer.contours[c], true, out);
        }
      }
      if (layer.path_body.empty()) continue;
      for (std::uint32_t p = layer.path_body[b]; p < layer.path_body[b + 1]; ++p) path(id, layer.paths, p, out);
    }
  }

  void tail(const SliceHead&, Buffer<char>& out) const override {
    if (!binary_) append(out, "$$GEOMETRYEND\n");
  }

 private:
  template <class Integer>
  static void put_little_endian(Integer value, Buffer<char>& out) {
    for (std::size_t i = 0; i < sizeof value; ++i) {
      out.push_back(static_cast<char>(value >> (8 * i) & 0xFF));
    }
  }
  static void put_float(std::int64_t nm, Buffer<char>& out) {
    put_little_endian(std::bit_cast<std::uint32_t>(static_cast<float>(mm(nm))), out);
  }

  void begin_layer(std::int64_t top, Buffer<char>& out) const {
    if (binary_) {
      put_little_endian<std::uint16_t>(127, out);
      put_float(top, out);
    } else {
      append(out, "$$LAYER/");
      append_mm(out, top);
      out.push_back('\n');
    }
  }

  void points(std::span<const Point2> points, Buffer<char>& out) const {
    if (binary_) {
      for (const Point2 p : points) {
        put_float(p.x, out);
        put_float(p.y, out);
      }
      return;
    }
    append_written(out, points.size() * (2 * kMostDecimal + 2), [&](char* text) {
      for (const Point2 p : points) {
        *text++ = ',';
        text = put_mm(p.x, text);
        *text++ = ',';
        text = put_mm(p.y, text);
      }
      return text;
    });
  }

  /// A closed one ends with its first point.
  void polyline(std::uint32_t id, Direction direction, std::span<const Point2> line, bool closed, Buffer<char>& out) const {
    const auto count = static_cast<std::uint32_t>(line.size() + (closed ? 1 : 0));
    if (binary_) {
      put_little_endian<std::uint16_t>(130, out);
      for (const std::uint32_t field : {id, static_cast<std::uint32_t>(direction), count}) put_little_endian(field, out);
    } else {
      append(out, fmt::format("$$POLYLINE/{},{},{}", id, static_cast<std::uint32_t>(direction), count));
    }
    points(line, out);
    if (closed) points(line.first(1), out);
    if (!binary_) out.push_back('\n');
  }

  /// Raster lines as hatches, the rest of a path as open polylines.
  void path(std::uint32_t id, const ToolpathsView& paths, std::uint32_t p, Buffer<char>& out) const {
    std::uint32_t begin = paths.offset[p];
    const std::uint32_t last = paths.offset[p + 1] - 1;
    while (begin < last) {
      std::uint32_t end = begin + 1;
      while (end < last && is_hatch(paths, end) == is_hatch(paths, begin)) ++end;
      if (!is_hatch(paths, begin)) {
        polyline(id, kOpen, paths.point.subspan(begin, end - begin + 1), false, out);
      } else {
        if (binary_) {
          put_little_endian<std::uint16_t>(132, out);
          put_little_endian(id, out);
          put_little_endian(end - begin, out);
        } else {
          append(out, fmt::format("$$HATCHES/{},{}", id, end - begin));
        }
        for (std::uint32_t i = begin; i < end; ++i) points(paths.point.subspan(i, 2), out);
        if (!binary_) out.push_back('\n');
      }
      begin = end;
    }
  }

  bool binary_, empty_first_;
};

}  // namespace

std::unique_ptr<SliceEncoder> make_cli_encoder(bool binary, const SliceFormatOptions& options) {
  return std::make_unique<CliEncoder>(binary, options.empty_first_layer);
}

}  // namespace lamina::write
